"""The time content of a course or a load: its begin, end, frequency and pulses, which the sampling instants must
resolve."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from met.frozen import frozen

SMALL = 0.1
"""Share of the range of a table's values below which a rise and fall is not counted as a pulse."""

MOST_HUMPS = 500
"""Largest number of humps of one course that are examined: it bounds the time for a measured course of many rows."""


@frozen(kw_only=True)
class Content:
    """The changes in time of something that is sampled.

    begins, ends  when it first changes, and when for the last time, s: inf where it never does; ends: where it goes on
    frequency     of its fastest swing, Hz; 0: it does not swing
    pulses        from and until, s, of each rise and fall: when it is beyond half of its height. What samples none of
                  these instants sees less than half of the pulse
    points        times, s, and values of a course of straight lines that holds its ends: by them it is known how much
                  of a pulse the instants carry that sample it. (): it is no such course
    """

    begins: float
    ends: float
    frequency: float = 0.0
    pulses: tuple[tuple[float, float], ...] = ()
    points: tuple[tuple[float, float], ...] = ()


NEVER = Content(begins=math.inf, ends=math.inf)
"""The content of a course that does not change."""


def content_of_points(times: Sequence[float], values: Sequence[float], begin: float = 0.0) -> Content:
    """The content of straight lines through points in time, whose ends are held; begin: when the table's time 0 is."""
    changes = [k for k in range(len(times) - 1) if values[k + 1] != values[k]]
    if not changes:
        return NEVER
    pulses = tuple((begin + first, begin + last) for first, last in _pulses(times, values))
    points = tuple((begin + time, value) for time, value in zip(times, values, strict=True))
    return Content(begins=begin + times[changes[0]], ends=begin + times[changes[-1] + 1], pulses=pulses, points=points)


@frozen
class Hump:
    """A part of a course of straight lines that rises and falls again, or dips: its points' times, s, and its heights
    there above the higher of its feet (or, in a dip, the depths below the lower)."""

    times: np.ndarray
    heights: np.ndarray

    @property
    def impulse(self) -> float:
        """The integral of the heights over time."""
        return float(np.trapezoid(self.heights, self.times))

    def at(self, instants: np.ndarray) -> np.ndarray:
        """The heights at these instants, s."""
        return np.asarray(np.interp(instants, self.times, self.heights, left=0.0, right=0.0))


def humps_of_turns(points: Sequence[tuple[float, float]]) -> Iterator[Hump]:
    """The humps of a course (a value as a function of time) between the points at which it turns back by more than
    `SMALL`; if there are very many, the highest. points: time, s, and value."""
    times, values = (list(column) for column in zip(*points, strict=True))
    every, heights = np.array(times), np.array(values)
    turned = list(_turned(values))
    if len(turned) > MOST_HUMPS:
        rises = [min(abs(values[peak] - values[side]) for side in (before, after)) for before, peak, after in turned]
        turned = [turned[place] for place in sorted(np.argsort(rises, kind="stable")[-MOST_HUMPS:].tolist())]
    for before, peak, after in turned:
        sign = math.copysign(1.0, values[peak] - values[before])
        foot = (max if sign > 0.0 else min)(values[before], values[after])  # one of the two values, without rounding
        first, last = _crossing(times, values, peak, -1, foot), _crossing(times, values, peak, 1, foot)
        inner = slice(int(np.searchsorted(every, first, "right")), int(np.searchsorted(every, last, "left")))
        yield Hump(
            np.concatenate([[first], every[inner], [last]]),
            np.concatenate([[0.0], sign * (heights[inner] - foot), [0.0]]),
        )


def humps_from_zero(points: Sequence[tuple[float, float]], until: float) -> Iterator[Hump]:
    """The parts of one sign of a course (a value as a function of time), from 0 s to `until`, each between two of its
    zeros."""
    times, values = np.array(points).T
    inner = (times > 0.0) & (times < until)
    ends = np.interp([0.0, until], times, values)
    times, values = np.concatenate([[0.0], times[inner], [until]]), np.concatenate([ends[:1], values[inner], ends[1:]])
    crossed = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    share = values[crossed] / (values[crossed] - values[crossed + 1])
    times = np.insert(times, crossed + 1, times[crossed] + share * (times[crossed + 1] - times[crossed]))
    values = np.insert(values, crossed + 1, 0.0)
    zeros = np.flatnonzero(values == 0.0)
    for first, last in pairwise(sorted({0, *zeros.tolist(), len(values) - 1})):
        part = values[first : last + 1]
        if part.any() and part[-1] == 0.0:  # else it goes on, and is no pulse
            yield Hump(times[first : last + 1], np.abs(part))


def _pulses(times: Sequence[float], values: Sequence[float]) -> Iterator[tuple[float, float]]:
    """The pulses between turns of the lines: each from half of the smaller of rise and fall until the same height
    again."""
    for before, peak, after in _turned(values):
        height = min(abs(values[peak] - values[before]), abs(values[peak] - values[after]))
        half = values[peak] - math.copysign(0.5 * height, values[peak] - values[before])
        yield (_crossing(times, values, peak, -1, half), _crossing(times, values, peak, 1, half))


def _turned(values: Sequence[float]) -> Iterator[tuple[int, int, int]]:
    """Each point at which the lines turn back, between the turns before and after it."""
    turns = _turns(values, SMALL * (max(values) - min(values)))
    return zip(turns, turns[1:], turns[2:], strict=False)


def _turns(values: Sequence[float], least: float) -> list[int]:
    """The points at which the lines turn back by more than `least`, between their first point and their last."""
    turns, extreme, rising = [0], 0, 0
    for k, value in enumerate(values):
        way = value - values[extreme]
        if rising * way > 0.0 or (rising == 0 and abs(way) > least):  # further the same way
            rising, extreme = (1 if way > 0.0 else -1), k
        elif rising and abs(way) > least:
            turns.append(extreme)
            rising, extreme = -rising, k
    return [*turns, extreme]


def _crossing(times: Sequence[float], values: Sequence[float], point: int, way: int, half: float) -> float:
    """The time at which the lines pass this value, searched from a point backwards (way -1) or forwards (1)."""
    above, k = values[point] > half, point
    while (values[k + way] > half) == above and values[k + way] != half:
        k += way
    share = (values[k] - half) / (values[k] - values[k + way])
    return times[k] + share * (times[k + way] - times[k])
