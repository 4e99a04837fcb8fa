"""Logs whose angles are wrapped: what is told of them, and what is taken for a motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from ic.meaning.control.courses import wrapped_rows
from tests.ic.meaning.control.trajectories import shown

WRAPPED = (0.0, 1.0, 2.0, 3.1, -3.1, -3.0, -2.0)


def followed(angles: Sequence[float]) -> str:
    """A log with a row a second."""
    return "time [s], hinge [rad]\n" + "".join(f"{n},{angle!r}\n" for n, angle in enumerate(angles))


def test_a_log_of_a_wrapped_angle_is_told_and_its_remedy_works(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, followed(WRAPPED), 'trajectory(file = "moves.csv")')
        == """\
warning[D387]: column `hinge` jumps by -6.2 rad from one row to the next, almost a turn: such is a log whose angle is \
wrapped
 --> moves.csv:6:3
  |
6 | 4,-3.1
  |   ^^^^ it is followed as a motion of 6.2 rad/s
 ::: moves.csv:5:3  the row before
  = help: add a turn, 360 deg, to this row and all after it
  = help: `numpy.unwrap` does that for a column in rad; for one in deg with `period=360`
  = help: if it is meant so, `allow D387 because "...";`
"""
    )
    assert "D387" not in shown(tmp_path, followed(np.unwrap(WRAPPED).tolist()), 'trajectory(file = "moves.csv")')


@pytest.mark.parametrize(("values", "rows"), [
    (WRAPPED, [4]),
    ((-1.0, -2.0, -3.0, 3.0, 2.0, 3.0, -3.0, -2.0), [3, 6]),
    ((4.0, 5.0, 6.0, 0.5, 1.0), [3]),
    ((0.0, 3.0, -3.0, 3.0, 0.0), []),  # as fast everywhere
    ((-3.0, -3.0, -3.0, 3.0, 3.0, 3.0), []),  # at rest before and after: a move to another place
    ((2.0, 3.0, -3.0, -2.0), [2]),  # of two rows beside the wrap
    ((0.0, 6.0), []),
    ((0.0, 1.0, 2.0, 3.0, 10.0, 11.0), []),  # beyond one turn: not wrapped
])  # fmt: skip
def test_a_wrap_is_told_from_a_motion(values: tuple[float, ...], rows: list[int]) -> None:
    assert wrapped_rows(tuple(map(float, range(len(values)))), values) == rows


def test_a_long_move_between_two_points_is_no_wrap() -> None:
    assert wrapped_rows((0.0, 1.0, 5.0, 6.0, 7.0), (-3.0, -2.9, 3.0, 2.9, 2.8)) == []


def test_smooth_motions_within_a_turn_are_no_wraps() -> None:
    """Also the measure of the warning's rate of false alarms: none in 500 motions of 20 to 200 rows."""
    rng = np.random.default_rng(11)
    for _ in range(500):
        times = np.linspace(0.0, 10.0, int(rng.integers(20, 200)))
        waves = rng.normal(size=4) @ np.sin(np.outer(rng.uniform(0.2, 3.0, 4), times) + rng.uniform(0.0, 6.0, (4, 1)))
        values = waves * (rng.uniform(0.5, math.pi) / np.abs(waves).max())
        assert wrapped_rows(times.tolist(), values.tolist()) == []
