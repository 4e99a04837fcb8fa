"""Breakaway from rest and reversal through rest with an arm fifty times as heavy as the rotor: to 0.5 %."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles.worst import Worst
from tests.substitution.hybrid import RATIO, REVERSING, ROTOR, SLOW, apart, deck, loads, r_of, ran, shaft

# The arm needs its time: every 4 s it turns back, through rest at 8.3 s.
LONG = "table(times = [0, 3.9995, 4, 7.9995, 8, 12] s, values = [slow, slow, -slow, -slow, slow, slow])"


def ran_both(law: str, command: str, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Rate of the shoulder on its own motor, and on the bed: (row,), rad/s."""
    text = deck(law=law, command=command, duration=duration, sweep=loads([50.0]))
    own = ran(text, "own")
    assert r_of(own, 0)[0] == pytest.approx(50.0, rel=1e-3)
    return own.signals["qd"][0, :, 0], shaft(ran(text, "bench"), "shoulder")[0]


@pytest.mark.release
@pytest.mark.parametrize("law", ["velocity_tracking", pytest.param("torque_balance_observer", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("command", "duration"), [("slow", 5.0), (REVERSING, 5.0), (LONG, 12.0)])
def test_a_heavy_arm_breaks_away_and_turns_back_as_on_its_own_motor(law: str, command: str, duration: float) -> None:
    own, bench = ran_both(law, command, duration)
    worst = Worst(f"{law}, r = 50, {duration:g} s, %")
    worst.see(apart(own[None], bench[None])[0], "the run")
    print(f"at no time further apart than {100 * np.abs(own - bench).max() / SLOW:.2g} %")
    worst.below(0.5)


@pytest.mark.slow
def test_the_bed_breaks_away_when_the_joint_would() -> None:
    """Within 2 ms. Until then the shaft stands still, exactly: friction holds what the drive pulls."""
    own, bench = ran_both("velocity_tracking", "slow", 5.0)
    times = [int(np.flatnonzero(rate)[0]) for rate in (own, bench)]
    print(f"the joint breaks away at {times[0] / 1000} s, the bed at {times[1] / 1000} s")
    assert times[0] > 500 and abs(times[0] - times[1]) <= 2
    assert not bench[: times[1]].any()


@pytest.mark.slow
def test_the_shaft_passes_through_rest_with_the_joint() -> None:
    """Within 20 ms: where the rest band of the law, 0.5 rad/s of the shaft, is entered or left at 38 rad/s^2 / 51."""
    own, bench = (RATIO * rate for rate in ran_both("velocity_tracking", LONG, 12.0))
    assert own.max() > 20.0 and own.min() < -20.0, "it turns back through rest"
    found = [np.flatnonzero((rate[:-1] > 0.0) & (rate[1:] <= 0.0)) for rate in (own, bench)]
    print("through rest at", [[float(row) / 1000 for row in rows] for rows in found])
    assert [len(rows) for rows in found] == [1, 1] and abs(int(found[0][0]) - int(found[1][0])) <= 20


HANGING = (
    "one_rod",
    ("shoulder",),
    """
    let load = 100 kg;
    let pull = 0 m/s^2;
    arm one_rod {
        link upper { mass = load; shape = rod(length = reach, along = x); }
        joint shoulder revolute { parent = base; child = upper; axis = y; }
    }
""",
)


@pytest.mark.release
@pytest.mark.parametrize(("command", "limit"), [("slow", 0.5), (REVERSING, 0.6), ("0 rad/s", 0.5)])
def test_a_rod_that_is_pulled_down_holds_or_gives_way_as_on_its_own_motor(command: str, limit: float) -> None:
    """Friction holds 32 N m. With 20 N m a rod at rest stays there exactly, with 40 N m it turns its motor back."""
    heaviness, weights = (0.5, 5.0, 50.0), (-40.0, -20.0, 20.0, 40.0)
    cases = [(3.0 * r * ROTOR / 4.0, weight) for r in heaviness for weight in weights]  # kg, N m
    masses, pulls = (
        ", ".join(f"{x:.9g}" for x in row)
        for row in zip(*((mass, weight / mass) for mass, weight in cases), strict=True)
    )
    text = deck(
        arm=HANGING,
        command=command,
        sweep=f"zip {{ load = [{masses}] kg;  pull = [{pulls}] m/s^2; }}",
        pure="environment { gravity = [0 m/s^2, 0 m/s^2, -pull]; }",
    )
    own, bench = ran(text, "own").signals["qd"][:, :, 0], shaft(ran(text, "bench"), "shoulder")
    worst = Worst(f"rods pulled down, {command[:7]}, %")
    for (mass, weight), each in zip(cases, apart(own, bench), strict=True):
        worst.see(each, f"{mass:.4g} kg, {weight:g} N m")
    worst.below(limit)
    if command == "0 rad/s":
        held = np.abs([weight for _, weight in cases]) < 32.0
        assert not bench[held].any() and (np.abs(bench[~held]).max(axis=1) > 1e-3 * SLOW).all()
