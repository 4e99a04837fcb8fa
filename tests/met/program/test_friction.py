"""Dry friction that sticks: modes at rest, the first root in a step, and what splitting does."""

from __future__ import annotations

import numpy as np
import pytest

from met.integrators.integrator import Motion, Slope
from met.program import friction


@pytest.mark.parametrize(
    ("s", "need", "qdd", "expected"),
    [
        (0.0, 0.9, 0.0, 0.0),  # friction holds
        (0.0, 1.1, 0.0, 1.0),  # it breaks away forward
        (0.0, -1.1, 0.0, -1.0),  # and backward
        (1.0, 1.1, 0.3, 1.0),  # released, and moves the way it was released
        (1.0, 1.1, -0.3, 0.0),  # released, but would move the other way: another joint's release changed the load
        (-1.0, -1.1, 0.3, 0.0),
    ],
)
def test_a_joint_at_rest_is_decided(s: float, need: float, qdd: float, expected: float) -> None:
    assert friction.decide(s, True, need, 1.0, qdd) == expected


def test_a_moving_joint_keeps_its_mode_whatever_the_pass_finds() -> None:
    assert friction.decide(1.0, False, -5.0, 1.0, -9.0) == 1.0


def test_the_first_root_of_the_parabola_is_found() -> None:
    random = np.random.default_rng(1)
    for _ in range(500):
        root, other = random.uniform(0.001, 1.0), random.choice([-1.0, 1.0]) * random.uniform(1.1, 50.0)
        scale = random.normal()
        rate, slope = scale * root * other, -scale * (root + other)
        end = rate + slope + scale
        found = friction.first_root(np.float64(rate), np.float64(slope), np.float64(end))
        # the three numbers are rounded to about 50 of the parabola's size, and the root moves with them
        assert found == pytest.approx(root, rel=0, abs=1e-12), (root, other, scale)


def test_of_two_roots_in_the_step_the_first_counts() -> None:
    rate, slope, end = 0.1 * 0.4, -(0.1 + 0.4), (1 - 0.1) * (1 - 0.4)
    assert friction.first_root(np.float64(rate), np.float64(slope), np.float64(end)) == pytest.approx(0.1, abs=1e-15)


def test_a_straight_line_and_a_start_at_rest_are_no_special_cases() -> None:
    with np.errstate(all="ignore"):
        assert friction.first_root(np.float64(1.0), np.float64(-2.0), np.float64(-1.0)) == 0.5
        # at rest and pushed the wrong way: comes back through zero where the parabola does
        assert friction.first_root(np.float64(0.0), np.float64(1.0), np.float64(-1.0)) == pytest.approx(0.5, abs=1e-15)


def test_all_joints_stop_where_the_first_one_comes_to_rest() -> None:
    y = Motion((np.float64(0.0), np.float64(1.0)), (np.float64(1.0), np.float64(3.0)))
    k1 = Slope(y.qd, (np.float64(-4.0), np.float64(-4.0)))
    y_new = Motion((np.float64(0.0), np.float64(2.0)), (np.float64(-1.0), np.float64(1.0)))
    with np.errstate(all="ignore"):
        split = friction.split_at_rest(y, k1, y_new, 0.5, (1.0, 1.0), may_split=True)
    assert split.share == 0.5
    assert split.y.qd[0] == 0.0
    assert split.y.qd[1] == 2.0
    # positions on the parabola: y + s h qd + s^2 (y_new - y - h qd)
    assert split.y.q == pytest.approx((0.0 + 0.25 + 0.25 * (0.0 - 0.5), 1.0 + 0.75 + 0.25 * (2.0 - 1.0 - 1.5)), abs=0)


def test_twins_come_to_rest_together() -> None:
    y = Motion((np.float64(0.0),) * 2, (np.float64(0.3),) * 2)
    k1 = Slope(y.qd, (np.float64(-1.7),) * 2)
    y_new = Motion((np.float64(0.0),) * 2, (np.float64(-0.11),) * 2)
    split = friction.split_at_rest(y, k1, y_new, 0.25, (1.0, 1.0), may_split=True)
    assert split.y.qd == (0.0, 0.0)


def test_without_a_split_left_the_joint_is_put_to_rest_at_the_end() -> None:
    y = Motion((np.float64(0.0),), (np.float64(1.0),))
    y_new = Motion((np.float64(0.2),), (np.float64(-0.4),))
    split = friction.split_at_rest(y, Slope(y.qd, (np.float64(-1.0),)), y_new, 1.0, (1.0,), may_split=False)
    assert split == friction.Split(Motion((0.2,), (0.0,), ()), 1.0)


def test_a_joint_without_dry_friction_passes_through_zero() -> None:
    assert friction.crossings((None, 1.0, 0.0), Motion((0.0,) * 3, (-1.0, -1.0, -1.0))) == [False, True, False]
