"""How well a loop kept its time, from its records: lateness, round trips, misses and why, and how clocks drift."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hw.pace import MISSED
from hw.records import ANSWERED, LATE_ANSWERED, LATE_COMPUTED, LATE_WOKEN
from met.frozen import frozen

TICK = 1 << 32
"""A bed counts its ticks modulo this."""


@frozen
class TimeSpread:
    """Of times, s: median, 99th and 99.9th percentiles, largest; and how many are in each of `EDGES`' stretches."""

    median: float
    high: float
    highest: float
    largest: float
    counts: tuple[int, ...]


EDGES = tuple(1e-6 * step * 10**power for power in range(5) for step in (1, 2, 5))
"""s: where one stretch of a histogram ends and the next begins; the first is all below, the last all above."""


@frozen
class Timing:
    """Of one bed, or of all where they are taken together.

    lateness    from when an exchange was due to when it began;  trip: from there to its answer
    computing   from an answer to when the next command was known
    unanswered  exchanges without an answer
    woken, computed, waited  exchanges that began a period late or more, for the host woke too late, computed too long,
                or waited for the answer before
    drift       of the bed's clock against the host's, as a share; not-a-number where that is not known
    """

    exchanges: int
    lateness: TimeSpread
    trip: TimeSpread
    computing: TimeSpread
    unanswered: int
    woken: int
    computed: int
    waited: int
    drift: float


def timing(rows: np.ndarray, tick_hz: float) -> Timing:
    """Of the records of one bed, the first sample left out. tick_hz: rate of the bed's ticks."""
    rows = rows[rows["exchange"] > 0]
    answered = (rows["flags"] & ANSWERED) != 0
    trip = rows["ended"] - rows["began"]
    computing = rows["computed"][1:] - rows["ended"][:-1]
    woken, computed, waited = (
        int(((rows["flags"] & flag) != 0).sum()) for flag in (LATE_WOKEN, LATE_COMPUTED, LATE_ANSWERED)
    )
    return Timing(
        len(rows),
        time_spread(rows["began"] - rows["due"]),
        time_spread(trip[answered]),
        time_spread(computing[computing >= 0]),
        int((~answered).sum()),
        woken,
        computed,
        waited,
        _drift(rows[answered], tick_hz),
    )


def stops(rows: np.ndarray, period: float) -> int:
    """How often a run would have been stopped by lateness or silence, of the records of one bed that was only looked
    at. period: s, of the wire."""
    rows = rows[rows["exchange"] > 0]
    silent = ((rows["flags"] & ANSWERED) == 0).astype(int)
    long = np.convolve(silent, np.ones(MISSED, int), "valid") == MISSED if len(rows) >= MISSED else np.zeros(0, bool)
    fell_silent = int((np.diff(long.astype(int), prepend=0) == 1).sum())
    return fell_silent + int((rows["began"] - rows["due"] >= MISSED * period * 1e9).sum())


def time_spread(times: np.ndarray | Sequence[int]) -> TimeSpread:
    """Of times in ns."""
    seconds = np.asarray(times, dtype=np.float64) * 1e-9
    if not len(seconds):
        return TimeSpread(*(float("nan"),) * 4, (0,) * (len(EDGES) + 1))
    median, high, highest, largest = np.percentile(seconds, (50, 99, 99.9, 100)).tolist()
    counts = np.bincount(np.searchsorted(EDGES, seconds, side="right"), minlength=len(EDGES) + 1)
    return TimeSpread(median, high, highest, largest, tuple(counts.tolist()))


def _drift(rows: np.ndarray, tick_hz: float) -> float:
    """By a straight line through the host's times over the bed's ticks: its slope, but for one."""
    if len(rows) < 10:
        return float("nan")
    ticks = np.unwrap(rows["tick"].astype(np.float64), period=float(TICK))
    host = 0.5e-9 * (rows["began"] + rows["ended"])
    bed = (ticks - ticks[0]) / tick_hz
    if not bed[-1] > 0.0:
        return float("nan")
    slope = np.polyfit(host - host[0], bed, 1)[0]
    return float(slope - 1.0)
