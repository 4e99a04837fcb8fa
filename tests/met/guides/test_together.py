"""Point to point together: straight in the joints' coordinates, within every limit, and no faster way there is."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from met import run as engine
from met.guides.together import GUIDE, course
from tests.ic.small_decks import experiment

BEGIN = 0.3


def joint(to: float, rate: float, acceleration: float) -> SimpleNamespace:
    return SimpleNamespace(to=to, max_rate=rate, max_acceleration=acceleration)


def moves(joints: list[SimpleNamespace], begins: list[float], times: np.ndarray) -> np.ndarray:
    """Positions and rates: time, joint, (value, rate)."""
    return np.array([course(SimpleNamespace(begin=BEGIN), joints, begins, float(t)) for t in times], float)


def random_moves(seed: int) -> tuple[list[SimpleNamespace], list[float]]:
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 8))
    joints = [joint(*random.uniform([-2, 0.1, 0.1], [2, 2.0, 4.0])) for _ in range(count)]
    return joints, list(random.uniform(-2, 2, count))


def length(joints: list[SimpleNamespace], begins: list[float]) -> float:
    """How long the move lasts, by the formulas of a trapezoid whose limits are the smallest shares of the ways."""
    ways = np.abs([each.to - begin for each, begin in zip(joints, begins, strict=True)])
    rate = min(each.max_rate / way for each, way in zip(joints, ways, strict=True))
    acceleration = min(each.max_acceleration / way for each, way in zip(joints, ways, strict=True))
    return 1.0 / rate + rate / acceleration if rate**2 < acceleration else 2.0 / np.sqrt(acceleration)


@pytest.mark.release
@pytest.mark.parametrize("seed", range(30))
def test_all_arrive_together_within_their_limits_and_one_is_at_its_own(seed: int) -> None:
    joints, begins = random_moves(seed)
    whole = length(joints, begins)
    times = BEGIN + np.linspace(0.0, whole, 2001)
    found = moves(joints, begins, times)
    np.testing.assert_array_equal(found[0, :, 0], begins)
    # where a move ends is a sum of roundings of s, so the last of these times may be short of it by some
    np.testing.assert_allclose(found[-1, :, 0], [each.to for each in joints], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(moves(joints, begins, [BEGIN + 1.001 * whole])[0, :, 0], [j.to for j in joints])
    before = moves(joints, begins, [BEGIN + 0.999 * whole])[0, :, 0]
    assert all(before != [each.to for each in joints])
    share = (found[:, :, 0] - begins) / (np.array([each.to for each in joints]) - begins)
    np.testing.assert_allclose(share, share[:, :1] * np.ones(len(joints)), rtol=0, atol=1e-12)
    rates = np.abs(found[:, :, 1]) / [each.max_rate for each in joints]
    step = times[1] - times[0]
    accelerations = np.abs(np.diff(found[:, :, 1], axis=0)) / step / [each.max_acceleration for each in joints]
    assert rates.max() <= 1.0 + 1e-12
    assert accelerations.max() <= 1.0 + 1e-9
    assert max(rates.max(), accelerations.max()) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
def test_the_rate_is_the_slope_of_the_position() -> None:
    joints, begins = random_moves(3)
    times = BEGIN + np.linspace(-0.1, length(joints, begins) + 0.1, 4001)
    found = moves(joints, begins, times)
    slope = (found[2:, :, 0] - found[:-2, :, 0]) / (times[2:] - times[:-2])[:, None]
    step = times[1] - times[0]  # at a corner a central difference is off by a quarter step's acceleration
    np.testing.assert_allclose(found[1:-1, :, 1], slope, rtol=0, atol=4.0 * step)


def test_a_joint_that_is_there_stays_and_sets_no_time() -> None:
    joints, begins = [joint(1.0, 0.5, 1.0), joint(0.25, 1e-6, 1e-6)], [0.0, 0.25]
    found = moves(joints, begins, np.linspace(0.0, 4.0, 41))
    np.testing.assert_array_equal(found[:, 1], np.broadcast_to([0.25, 0.0], (41, 2)))
    assert found[-1, 0, 0] == 1.0
    nowhere = moves([joint(0.5, 1.0, 1.0)], [0.5], np.linspace(0.0, 4.0, 9))
    np.testing.assert_array_equal(nowhere, np.broadcast_to([0.5, 0.0], (9, 1, 2)))


DECK = """\
arm pair {
    link one { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link two { mass = 1 kg; shape = sphere(radius = 0.1 m); com = [0.2, 0.1, 0] m; }
    joint hinge revolute  { parent = base; child = one; axis = z; }
    joint slide prismatic { parent = one;  child = two; axis = x; at = [1, 0, 0] m; }
}
servo exact { model = ideal; bandwidth = 50 1/s; command = position(move); }
run it {
    arm     = pair;
    initial { hinge.q = 10 deg; }
    servos  { hinge = exact; slide = exact; }
    guide move = together {
        begin = 0.3 s;
        hinge.to = 60 deg;  hinge.max_rate = 40 deg/s;  hinge.max_acceleration = 90 deg/s^2;
        slide.to = 20 cm;   slide.max_rate = 0.1 m/s;   slide.max_acceleration = 1 m/s^2;
    }
    environment {}
    rates    { dynamics = 500 Hz; servos = RATE; record = 100 Hz; }
    duration = 4 s;
    record   = [q, servo.command];
    integrator = rk4;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "away"), [("500 Hz", 1e-15), ("continuous", 1e-15)])
def test_servos_are_told_the_course_itself(rate: str, away: float, tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, DECK.replace("RATE", rate)))
    deg = np.pi / 180
    joints = [joint(60 * deg, 40 * deg, 90 * deg), joint(0.2, 0.1, 1.0)]
    expected = moves(joints, [10 * deg, 0.0], run.time)[:, :, 0]
    np.testing.assert_allclose(run.signals["servo.command"][0], expected, rtol=0, atol=away)
    assert run.signals["q"][0, -1] == pytest.approx([60 * deg, 0.2], abs=1e-6)


def test_its_declaration() -> None:
    assert (GUIDE.commands, GUIDE.components, GUIDE.steer) == (("position",), None, None)
