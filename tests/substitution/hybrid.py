"""Decks of arms whose motors are on beds, beside the same runs on their own motors, and how far apart the two are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

import ic
from met import run as engine
from met.plan import Experiment

SLOW = 0.03  # rad/s, the rate that the paper commands
RATIO = 1570.0  # of the gearbox, table 1
ROTOR = RATIO**2 * 6.38e-5  # N^2 J_m of table 1, kg m^2

R = (0.5, 1.5, 5.0, 20.0)  # r = J_eff/(N^2 J_m) of the table of what to expect (docs/physics.md, motor substitution)

# From 0.03 rad/s to -0.03 rad/s and back, every 1.5 s, between two ticks of 1 kHz.
REVERSING = (
    "table(times = [0, 1.4995, 1.5, 2.9995, 3, 4.4995, 4.5, 5] s, "
    "values = [slow, slow, -slow, -slow, slow, slow, -slow, -slow])"
)

TWO_LINK = ("two_link", ("shoulder", "elbow"), "")


def compiled(text: str, name: str) -> Experiment:
    """The run or sweep of this name in a deck."""
    return ic.compile(text=text, select=[name]).experiments[0]


@lru_cache(maxsize=64)
def ran(text: str, name: str) -> engine.Run:
    """The run or sweep of this name, run; every case is to reach its end."""
    result = engine.run(compiled(text, name))
    assert not result.status.any(), result.cause
    return result


def deck(
    joints: Sequence[str] = ("shoulder",),
    *,
    law: str = "velocity_tracking",
    bed: str = "emulated",
    servos: float = 1000.0,
    dynamics: float = 1000.0,
    record: float | None = None,
    command: str = "slow",
    duration: float = 5.0,
    base: float | None = None,
    fast: float = 1000.0,
    servo: Mapping[str, str] | None = None,
    sweep: str = "",
    swept: str = "",
    arm: tuple[str, Sequence[str], str] = TWO_LINK,
    pure: str = "",
    hybrid: str = "",
) -> str:
    """A deck with the sweeps `own` and `bench` (runs `on_own`, `on_bench`): joints on their own motors, or on beds.

    The run on its own motors has the same servos, and dynamics of rate `fast`. Rates in Hz, duration in s.
    arm     name, joints, and text that defines it; without velocity products for two_link.ic alone, as there
    pure    more of the bodies of both runs;  hybrid: of the second
    sweep   body of both sweeps;  swept: more of that of `bench`, before it
    servo   of both runs, by joint, where it is another than `told`, a rigid gearbox that is told `command`
    """
    name, moving, text = arm
    both = "\n".join(f"    substitute {joint} {{ bed = {bed};  law = {law}; }}" for joint in joints)
    shafts = ", ".join(f"{joint}.bed.shaft_rate" for joint in joints)
    used = " ".join(f"{joint} = {(servo or {}).get(joint, 'told')};" for joint in moving)
    return f"""
        #include <two_link.ic>
        {text}
        servo told like rigid_gearbox {{ command = rate({command}); }}
        run on_own {{
            arm      = {name};
            servos   {{ {used} }}
            rates    {{ base = {fast} Hz; dynamics = {fast} Hz; servos = {servos} Hz; record = {record or servos} Hz; }}
            {"environment { velocity_products = off; }" if arm is TWO_LINK else ""}
            duration = {duration} s;
            record   = [q, qd, J_eff];
            {pure}
        }}
        run on_bench like on_own {{
            rates    {{ base = {base or max(dynamics, servos)} Hz; dynamics = {dynamics} Hz; }}
            record   += [{shafts}];
        {both}
            {hybrid}
        }}
        sweep own of on_own {{ {sweep} }}
        sweep bench of on_bench {{ {swept} {sweep} }}
    """


def loads(heaviness: Sequence[float]) -> str:
    """Body of a sweep: both rods of two_link.ic heavier by one factor, for these r of the shoulder (see `inertias`)."""
    found = [factor(r) for r in heaviness]
    upper, lower = (", ".join(f"{mass * each:.9g}" for each in found) for mass in (40.0, 20.0))
    return f"zip {{ links.upper.mass = [{upper}] kg;  links.lower.mass = [{lower}] kg; }}"


def inertias(heavier: float) -> np.ndarray:
    """Inertia matrix of the straight arm of two_link.ic about its joints, both rods heavier by a factor: kg m^2."""
    length, upper, lower = 2.0, 40.0 * heavier, 20.0 * heavier
    elbow = lower * length**2 / 3.0
    both = lower * length**2 / 2.0
    return np.array(
        [[upper * length**2 / 3.0 + lower * length**2 + 2.0 * both + elbow, both + elbow], [both + elbow, elbow]]
    )


def factor(r: float) -> float:
    """How much heavier both rods are, where the shoulder's r is this while the elbow turns freely but for its rotor."""
    low, high = 1e-3, 1e4
    for _ in range(60):
        middle = (low * high) ** 0.5
        (shoulder, both), (_, elbow) = inertias(middle)
        low, high = (middle, high) if (shoulder - both**2 / (elbow + ROTOR)) / ROTOR < r else (low, middle)
    return low


def shaft(run: engine.Run, joint: str) -> np.ndarray:
    """Rate of a substituted joint's shaft, joint side: (case, row), rad/s."""
    return run.signals[f"{joint}.bed.shaft_rate"] / RATIO


def apart(own: np.ndarray, bench: np.ndarray, *, rate: float = SLOW) -> np.ndarray:
    """Rms over the run of how far two rates are apart, as a share of the commanded one, %: (case,)."""
    assert own.shape == bench.shape
    difference: np.ndarray = 100.0 * np.sqrt(np.mean((bench - own) ** 2, axis=1)) / rate
    return difference


def measured(joint: str, number: int, text: str) -> np.ndarray:
    """`apart` of a deck's two sweeps at one joint, whose number is given: (case,), %."""
    own, bench = ran(text, "own"), ran(text, "bench")
    return apart(own.signals["qd"][:, :, number], shaft(bench, joint))


def r_of(run: engine.Run, number: int) -> np.ndarray:
    """r = J_eff/(N^2 J_m) of a joint as soon as all joints move: (case,). A joint at rest holds what it carries."""
    moving = (run.signals["qd"] != 0.0).all(axis=2)
    assert moving.any(axis=1).all()
    first = moving.argmax(axis=1)
    found: np.ndarray = run.signals["J_eff"][np.arange(len(first)), first, number] / ROTOR
    return found
