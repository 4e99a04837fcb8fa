"""Limits of stability, the step map's and those that runs have: `python -m tests.met.analysis.limits [MACHINES]`.

Each machine is a case of random inertias and parameters, and one number of it is scaled: the step map says up to where
the step is stable, and runs of the kernel say it again, by bisection. Of loops that tick the gain is scaled, and the
warning is asked for at 0.95 and 1.05 of the limit that runs have. All machines of a model share one program.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

import ic
from met import models
from met import run as engine
from met.analysis.blame import Opened
from met.analysis.loops import fastest, growing
from met.analysis.modes import modes
from met.analysis.step_map import Linearizer
from met.frozen import frozen
from met.plan import Experiment

STEPS = 2000
"""Of a run, each of 1 ms."""

EARLY = 12
"""Rows in which what a run does at first is seen: longer than a tick of the loops at 100 Hz."""

NEAR = 0.03
"""How far from the step map's limit that of runs is looked for, as a share."""


ROUNDED, BEYOND = 1e-6, 1e3
"""Shares of a run's first moves: below the one what moves may be rounding, above the other it has grown, or is at a
limit."""


@frozen
class Machine:
    """A model with what varies of it: ranges of its numbers, of which `scaled` is sought for, in SI."""

    deck: str
    ranges: Mapping[str, tuple[float, float, str]]
    scaled: str = "Kx"


SLIDE = """\
arm a {
    link block { mass = Mb;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint x prismatic { parent = base;  child = block;  axis = x; }
}
"""
TURN = """\
arm a {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [J_bar, J_bar, J_bar]; }
    joint x revolute { parent = base;  child = bar;  axis = z; }
}
"""
FREE = TURN.replace("link bar", "link base { mass = 1 kg;  inertia = [J_base, J_base, J_base]; }\n    link bar")
MASS, INERTIA = (0.1, 100.0, "kg"), (0.01, 100.0, "kg*m^2")

MODELS: Mapping[str, Machine] = MappingProxyType({
    "joint_damping": Machine(
        SLIDE + "run r { arm = a;  initial { x.qd = 0.1 m/s; }\n"
        "environment { e = joint_damping { sliding = Kx; } } REST }",
        {"Mb": MASS, "Kx": (1.0, 1e6, "N*s/m")},
    ),
    "passive": Machine(
        TURN + "servo s { model = passive;  stiffness = Kx;  damping = Dx; }\n"
        "run r { arm = a;  servos { x = s; }  initial { x.qd = 0.1 rad/s; }  integrator = rk4;  REST }",
        {"J_bar": INERTIA, "Dx": (1e-3, 1.0, "N*m*s/rad"), "Kx": (1.0, 1e10, "N*m/rad")},
    ),
    "spring": Machine(
        SLIDE + "run r { arm = a;  initial { x.qd = 0.1 m/s; }  integrator = rk4;\n"
        "environment { e = spring { link = block;  to = world;  stiffness = Kx;  damping = Dx; } } REST }",
        {"Mb": MASS, "Dx": (1e-2, 1.0, "N*s/m"), "Kx": (1.0, 1e10, "N/m")},
    ),
    "bushing": Machine(
        SLIDE + "run r { arm = a;  initial { x.qd = 0.1 m/s; }  integrator = semi_implicit_euler;\n"
        "environment { e = bushing { link = block;  stiffness = [Kx, 0 N/m, 0 N/m];\n"
        "damping = [Dx, 0 N*s/m, 0 N*s/m]; } } REST }",
        {"Mb": MASS, "Dx": (1e-2, 1.0, "N*s/m"), "Kx": (1.0, 1e10, "N/m")},
    ),
    "compliant_gearbox": Machine(
        TURN + "servo s { model = compliant_gearbox;  ratio = 50;  kp = 0 V*s/rad;  ki = 0 V/rad;  v_max = 1e9 V;\n"
        "resistance = 1e9 ohm;  kt = 0.08 N*m/A;  tau_max = 1e9 N*m;  j_m = J_m;  stiffness = Kx;  damping = Dx;\n"
        "command = torque(0 N*m); }\n"
        "run r { arm = a;  servos { x = s; }  initial { x.qd = 0.01 rad/s; }  integrator = rk4;\n"
        "environment { e = joint_damping { damping = 0.01 N*m*s/rad; } } REST }",
        {"J_bar": INERTIA, "J_m": (1e-5, 1e-2, "kg*m^2"), "Dx": (1e-3, 0.1, "N*m*s/rad"), "Kx": (1.0, 1e10, "N*m/rad")},
    ),
    "attitude_hold": Machine(
        FREE + "run r { arm = a;  base = free;  integrator = rk4;\n"
        "initial { base.rate = [0.001, 0.001, 0.001] rad/s; }\n"
        "environment { e = attitude_hold { stiffness = [Kx, Kx, Kx];  damping = [Dx, Dx, Dx]; } }\n"
        "record = [links.base.rate];  REST }",
        {"J_bar": INERTIA, "J_base": INERTIA, "Dx": (1e-3, 1.0, "N*m*s/rad"), "Kx": (1.0, 1e10, "N*m/rad")},
    ),
    "lugre": Machine(
        SLIDE + "servo s { model = rigid_gearbox;  ratio = 1 rad/m;  kp = 0 V*s/rad;  ki = 0 V/rad;  v_max = 1 V;\n"
        "resistance = 1 ohm;  kt = 1e-9 N*m/A;  tau_max = 1 N*m;  j_m = 1e6 kg*m^2;  friction = lugre;  sigma_0 = Kx;\n"
        "f_c = Fc;  f_s = 1.5*Fc;  rate_s = 0.001 rad/s;  command = torque(0 N); }\n"
        "run r { arm = a;  servos { x = s; }  initial { x.qd = Vo; }  record = [x.servo.bristle];  REST }",
        {"Mb": MASS, "Fc": (0.5, 5.0, "N*m"), "Vo": (0.02, 1.0, "m/s"), "Kx": (10.0, 1e9, "N*m/rad")},
    ),
    "cascade": Machine(
        TURN + "servo s { model = cascade;  gear = rigid;  ratio = 50;  kp = 0.01 A*s/rad;  ki = 0.01 A/rad;\n"
        "k_current = 1e-3 V/A;  ki_current = Kx;  resistance = Ro;  kt = 0.05 N*m/A;  inductance = Li;\n"
        "j_m = 1e-4 kg*m^2;  rate = continuous;  command = rate(0 rad/s); }\n"
        "run r { arm = a;  servos { x = s; }  initial { x.qd = 0.001 rad/s; }  integrator = rk4;  REST }",
        {"J_bar": INERTIA, "Ro": (0.3, 3.0, "ohm"), "Li": (1e-3, 5e-3, "H"), "Kx": (1.0, 1e7, "V/(A*s)")},
    ),
    "joint_stop": Machine(
        SLIDE.replace("axis = x", "axis = z") +
        "run r { arm = a;  initial { x.q = -1.001*9.81 m/s^2*Mb/Kx; }  integrator = semi_implicit_euler;\n"
        "environment { g = gravity { g = [0, 0, -9.81] m/s^2; }\n"
        "e = joint_stop { joint = x;  lower = 0 m;  stiffness = Kx;  dissipation = Dx; } } REST }",
        {"Mb": MASS, "Dx": (1e-3, 1e-2, "s/m"), "Kx": (1.0, 1e10, "N/m")},
    ),
})  # fmt: skip

REST = "rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 1 kHz; }  duration = 2 s;  RECORD"

DRIVE = (
    TURN + "servo s { model = MODEL;  ratio = 50;  GAINS  v_max = 1e9 V;  resistance = 1 ohm;  kt = 0.05 N*m/A;\n"
    "tau_max = 1e9 N*m;  j_m = J_m;  command = COMMAND;  SENSOR }\n"
    "run r { arm = a;  servos { x = s; }  initial { x.qd = 1e-6 rad/s; }\n"
    "rates { dynamics = 1 kHz;  servos = RATE;  record = 1 kHz; }  duration = 8 s;  record = [q]; }"
)


def loop(ranges: Mapping[str, tuple[float, float, str]], scaled: str, **words: str) -> Machine:
    """A servo on a joint with these words in the place of the deck's own."""
    plain = {
        "MODEL": "rigid_gearbox", "GAINS": "kp = Kx;  ki = Ci*Kx;", "COMMAND": "rate(0 rad/s)", "SENSOR": "",
        "RATE": "100 Hz",
    }  # fmt: skip
    deck = DRIVE
    for word, text in (plain | words).items():
        deck = deck.replace(word, text)
    arm = {"J_bar": (0.01, 1.0, "kg*m^2"), "J_m": (1e-5, 1e-4, "kg*m^2")}
    return Machine(deck, arm | dict(ranges), scaled)


GAIN, RESET = {"Kx": (1e-4, 1e6, "V*s/rad")}, {"Ci": (0.1, 5.0, "1/s")}
PLACE = "kp = Kp;  ki = Kx;  k_position = Wp;"
OF_PLACE = {
    "J_bar": (0.5, 5.0, "kg*m^2"), "Kp": (0.01, 0.05, "V*s/rad"), "Wp": (40.0, 100.0, "1/s"),
    "Kx": (1e-4, 1e3, "V/rad"),
}  # fmt: skip

LOOPS: Mapping[str, Machine] = MappingProxyType({
    "ticks": loop(GAIN | RESET, "Kx"),
    "filter": loop(
        {**GAIN, "Ci": (2.0, 50.0, "1/s"), "Fs": (1.0, 20.0, "Hz")},
        "Kx",
        RATE="1 kHz",
        SENSOR="sensor qd = tachometer { filter = butterworth;  cutoff = Fs; }",
    ),
    "delay": loop(GAIN | RESET, "Kx", SENSOR="sensor qd = tachometer { delay = 2; }"),
    "continuous": loop(OF_PLACE, "Kx", RATE="1 kHz", GAINS=PLACE + "  rate = continuous;", COMMAND="position(0 rad)"),
    "elastic": loop(
        {**OF_PLACE, "Ks": (200.0, 2000.0, "N*m/rad")},
        "Kx",
        RATE="1 kHz",
        MODEL="compliant_gearbox",
        GAINS=PLACE + "  stiffness = Ks;  damping = 0.5 N*m*s/rad;",
        COMMAND="position(0 rad)",
    ),
})  # fmt: skip
"""Loops by what makes them unstable: a rate loop's ticks at 100 Hz, its filter, ticks of delay; and too much of the
integral of a loop of position, that has no ticks, or is on a gear that winds up."""


def experiment(machine: Machine, count: int, rng: np.random.Generator) -> Experiment:
    """So many random machines as the cases of one sweep; the number that is scaled at its least."""
    deck = machine.deck.replace("REST", REST).replace("RECORD", "" if "record =" in machine.deck else "record = [q];")
    deck = deck.replace("record = [q];  }", "record = [q]; }")
    lets = "".join(f"let {name} = {low!r} {unit};\n" for name, (low, _, unit) in machine.ranges.items())
    deck = lets + deck
    # drawn below: what a servo says of itself would refuse some of the whole range
    vary = "".join(
        f"vary {name} = [{low!r}, {1.01 * low!r}] {unit};\n" for name, (low, _, unit) in machine.ranges.items()
    )
    (made,) = ic.compile(text=f"{deck}\nsweep all of r {{\n{vary}}}\n", select=["all"]).experiments
    coordinates = []
    for each in made.cases.coordinates:
        low, high, _ = machine.ranges[each.path]
        drawn = np.exp(rng.uniform(np.log(low), np.log(high), count))
        coordinates.append(replace(each, values=np.full(count, low) if each.path == machine.scaled else drawn))
    return replace(made, cases=replace(made.cases, count=count, coordinates=tuple(coordinates)))


def scaled(made: Experiment, name: str, values: np.ndarray) -> Experiment:
    """The same machines with other values of one number."""
    coordinates = tuple(replace(each, values=values) if each.path == name else each for each in made.cases.coordinates)
    return replace(made, cases=replace(made.cases, coordinates=coordinates))


def by_map(made: Experiment) -> np.ndarray:
    """Whether the step map has a mode that grows by e and more over the run, of each case as it begins."""
    integrator = models.find("integrator", made.structure.integrator)
    found, grown = Linearizer(made, range(made.cases.count)).map(), np.zeros(made.cases.count, bool)
    for mode in modes(found, integrator):
        if not mode.loose and STEPS * mode.growth > 1.0:
            grown[mode.case] = True
    return grown


def by_runs(prepared: engine.Prepared, made: Experiment) -> np.ndarray:
    """Whether what a run does from step to step is more in the end than in its beginning, by e."""
    history, _ = engine.compute(replace(prepared, experiment=made), np.arange(made.cases.count))
    assert history is not None
    rows = history.shape[1]
    with np.errstate(all="ignore"):
        moves = np.abs(np.diff(history, axis=1)).max(2)
        early, late = moves[:, :EARLY].max(1), moves[:, -rows // 20 :].max(1)
        return ~(np.isfinite(late) & (late < np.e * early))


def swings_up(prepared: engine.Prepared, made: Experiment) -> np.ndarray:
    """Whether what a run does from step to step grows by e over its length, as of its first to its last tenth."""
    history, _ = engine.compute(replace(prepared, experiment=made), np.arange(made.cases.count))
    assert history is not None
    tenth = history.shape[1] // 10
    with np.errstate(all="ignore"):
        moves = np.abs(np.diff(history, axis=1)).max(2)
        early, late = moves[:, tenth // 2 : tenth + tenth // 2].max(1), moves[:, -tenth:].max(1)
        before = np.maximum(early, ROUNDED * moves[:, 0])
        return ~((late <= math.exp(0.85) * before) & (late <= BEYOND * moves[:, 0]))


def bisect(grows: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray, to: float) -> np.ndarray:
    """Limits between these, to a share; not numbers where it grows at the lower one, or does not at the upper."""
    sound = ~grows(low) & grows(high)
    while np.max(high / low) > 1.0 + to:
        middle = np.sqrt(low * high)
        growing = grows(middle)
        low, high = np.where(growing, low, middle), np.where(growing, middle, high)
    return np.where(sound, np.sqrt(low * high), np.nan)


def prepared_for(made: Experiment) -> engine.Prepared:
    prepared = engine.prepare(made)
    prepared.kernel  # noqa: B018 - one for all values
    return prepared


def errors(name: str, count: int, seed: int = 1) -> np.ndarray:
    """(limit of the step map)/(limit of runs) - 1 of so many machines of a model; not a number where runs have none
    within `NEAR` of it."""
    machine = MODELS[name]
    made = experiment(machine, count, np.random.default_rng(seed))
    low, high, _ = machine.ranges[machine.scaled]
    ends = np.full(count, low), np.full(count, high)
    limit = bisect(lambda k: by_map(scaled(made, machine.scaled, k)), *ends, 2e-4)
    prepared = prepared_for(made)
    share = np.where(np.isfinite(limit), limit, 1.0)
    found = bisect(
        lambda k: by_runs(prepared, scaled(made, machine.scaled, k)), share * (1.0 - NEAR), share * (1.0 + NEAR), 2e-4
    )
    return limit / found - 1.0


def warned(made: Experiment) -> np.ndarray:
    """Whether the check calls a loop unstable, of each case."""
    linearizer = Linearizer(made, range(made.cases.count))
    sampled = linearizer.sampled()
    assert sampled is not None
    told, opened = np.zeros(made.cases.count, bool), Opened(linearizer, sampled)
    for lane, limit, ticks in growing(sampled, fastest(sampled), made.structure.schedule.duration):
        told[lane] = bool(opened.lane(lane, limit, ticks).blamed())
    return told


def sides(name: str, count: int, seed: int = 1) -> tuple[int, int, int]:
    """Of so many loops: how many have a limit by runs, are warned of at 1.05 of it, and are not at 0.95."""
    machine = LOOPS[name]
    made = experiment(machine, count, np.random.default_rng(seed))
    prepared = prepared_for(made)
    low, high, _ = machine.ranges[machine.scaled]
    ends = np.full(count, low), np.full(count, high)
    limit = bisect(lambda k: swings_up(prepared, scaled(made, "Kx", k)), *ends, 1e-3)
    known = np.isfinite(limit)
    limit = np.where(known, limit, low)
    above, below = (warned(scaled(made, "Kx", limit * share))[known] for share in (1.05, 0.95))
    return int(known.sum()), int(above.sum()), int((~below).sum())


def lines(count: int) -> Iterator[str]:
    """Lines of the table of docs/physics.md."""
    for name, machine in MODELS.items():
        found = errors(name, count)
        integrator = machine.deck.partition("integrator = ")[2].partition(";")[0] or "modified_euler"
        told = (
            f"{100 * np.max(np.abs(found)):.2f} %" if np.isfinite(found).all() else f"{np.isnan(found).sum()} without"
        )
        yield f"| `{name}` | {integrator} | {told} |"
    for name in LOOPS:
        known, above, below = sides(name, max(2, count // 2))
        yield f"loops, {name}: {known} limits, {above} warned of at 1.05 of it, {below} not at 0.95"


if __name__ == "__main__":
    for line in lines(int(sys.argv[1]) if len(sys.argv) > 1 else 100):
        print(line, flush=True)
