"""What a course in time or a load brings, and so what the instants that sample it must carry."""

from __future__ import annotations

import math
from collections.abc import Sequence

from met.frozen import frozen

SMALL = 0.1
"""Share of the range of a table's values: what rises and falls again by less is no pulse of it."""


@frozen(kw_only=True)
class Content:
    """The changes in time of something that is sampled.

    begins, ends  when it first changes, and when for the last time, s: inf where it never does; ends: where it goes on
    frequency     of its fastest swing, Hz; 0: it does not swing
    pulses        from and until, s, of each rise and fall: when it is beyond half of its height. What samples none of
                  these instants sees less than half of the pulse
    """

    begins: float
    ends: float
    frequency: float = 0.0
    pulses: tuple[tuple[float, float], ...] = ()


NEVER = Content(begins=math.inf, ends=math.inf)
"""Of what does not change."""


def content_of_points(times: Sequence[float], values: Sequence[float], begin: float = 0.0) -> Content:
    """The content of straight lines through points in time, whose ends are held; begin: when the table's time 0 is."""
    changes = [k for k in range(len(times) - 1) if values[k + 1] != values[k]]
    if not changes:
        return NEVER
    pulses = tuple((begin + first, begin + last) for first, last in _pulses(times, values))
    return Content(begins=begin + times[changes[0]], ends=begin + times[changes[-1] + 1], pulses=pulses)


def _pulses(times: Sequence[float], values: Sequence[float]) -> list[tuple[float, float]]:
    """Where the lines turn back: from half of the smaller of the way there and the way back, until half of it."""
    turns = _turns(values, SMALL * (max(values) - min(values)))
    found = []
    for before, at, after in zip(turns, turns[1:], turns[2:], strict=False):
        height = min(abs(values[at] - values[before]), abs(values[at] - values[after]))
        half = values[at] - math.copysign(0.5 * height, values[at] - values[before])
        found.append((_crossing(times, values, at, -1, half), _crossing(times, values, at, 1, half)))
    return found


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


def _crossing(times: Sequence[float], values: Sequence[float], at: int, way: int, half: float) -> float:
    """When the lines pass this value, going from a point back (way -1) or on (1)."""
    above, k = values[at] > half, at
    while (values[k + way] > half) == above and values[k + way] != half:
        k += way
    share = (values[k] - half) / (values[k] - values[k + way])
    return times[k] + share * (times[k + way] - times[k])
