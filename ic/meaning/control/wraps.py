"""Warnings of angles that a log has wrapped: 3.1 rad, then -3.1 rad, where the joint went on.

A command follows its rows as they are, so it asks a joint to turn back by almost a turn in one row. A wrap is told from
a real motion by what surrounds it: with a turn added the rows go on as fast as they went before, and without it the
row is far faster than all others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from statistics import median

from ic.meaning.parameters.scope import Scope
from met.diagnostic import Label, Place

TURN = 2.0 * math.pi
_LEAST = 0.75 * TURN  # a smaller jump is not that of a log whose rows are dense enough for its motion
_SLACK = 0.01  # rad by which rounding may take a wrapped log beyond one turn
_FEWEST = 2  # other rows that say how fast the joint is
_FASTER = 4.0  # times the fastest other row: a jump of less may be a motion
_GOES_ON = 2.0  # times the fastest other row: with a turn added, a wrapped row is no faster
_LONGER = 2.0  # times the usual time between rows: a longer one is a move between points, not a row of a log


def wrapped_rows(times: Sequence[float], values: Sequence[float]) -> list[int]:
    """The rows of a column, in rad, before which a log has wrapped the angle; empty where that is not plain."""
    steps = [
        (after - before, late - early) for (early, before), (late, after) in pairwise(zip(times, values, strict=True))
    ]
    others = [abs(step / time) for step, time in steps if abs(step) <= _LEAST]
    if (
        not max(_FEWEST, len(steps) - len(others)) <= len(others) < len(steps)
        or max(values) - min(values) > TURN + _SLACK
    ):
        return []
    fastest, usual = max(others), median(time for _, time in steps)

    def is_wrap(step: float, time: float) -> bool:
        rest = TURN - abs(step)
        fast = abs(step) >= _FASTER * fastest * time and abs(rest) <= _GOES_ON * fastest * time
        return abs(step) > _LEAST and fast and time <= _LONGER * usual

    return [n for n, (step, time) in enumerate(steps, 1) if is_wrap(step, time)]


def warn_of_wraps(
    scope: Scope, what: str, times: Sequence[float], values: Sequence[float], place: Callable[[int], Place]
) -> None:
    """Warn where an angle over time is wrapped. what: the angle, in words; place: of the value in a row, from 0"""
    rows = wrapped_rows(times, values)
    if not rows:
        return
    n = rows[0]
    step, time = values[n] - values[n - 1], times[n] - times[n - 1]
    more = f", and so in {len(rows) - 1:,} more row{'s' * (len(rows) > 2)}" * (len(rows) > 1)
    scope.complaints.remark(
        "D387",
        f"{what} jumps by {step:.4g} rad from one row to the next, almost a turn{more}: such is a log whose angle is "
        "wrapped",
        Label(place(n), f"it is followed as a motion of {abs(step / time):.3g} rad/s"),
        also=[Label(place(n - 1), "the row before")],
        help=[
            f"{'add' if step < 0.0 else 'subtract'} a turn, 360 deg, {'to' if step < 0.0 else 'from'} this row and all "
            "after it",
            "`numpy.unwrap` does that for a column in rad; for one in deg with `period=360`",
            'if it is meant so, `allow D387 because "...";`',
        ],
    )
