"""The timing of a loop, from its records: lateness, round trips, misses and their causes, and the drift of clocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hw.driving.pace import MISSED
from hw.recording.records import ANSWERED, LATE_ANSWERED, LATE_COMPUTED, LATE_WOKEN
from met.frozen import frozen

TICK = 1 << 32
"""The number of a bed's ticks after which its count begins again at 0."""


@frozen
class TimeSpread:
    """The distribution of times: median, 99th and 99.9th percentile and largest, s; and the counts in the bins of
    `EDGES`."""

    median: float
    high: float
    highest: float
    largest: float
    counts: tuple[int, ...]


EDGES = tuple(1e-6 * step * 10**power for power in range(5) for step in (1, 2, 5))
"""Ends of the bins of a histogram, s. The first bin is all below the first of them, the last bin all above the last."""


@frozen
class Timing:
    """The timing of exchanges with one bed, or with all.

    lateness    from when an exchange was due to when it began;  trip: from there to its answer
    computing   from an answer to when the next command was known
    unanswered  exchanges without an answer
    woken, computed, waited  exchanges that began a period late or more, for the host woke too late, computed too
                             long, or waited for the answer before
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
    """The timing of one bed from its records, without the first sample. tick_hz: rate of the bed's ticks."""
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
    """The number of times that a run would have been stopped by lateness or silence, from the records of one bed
    that was only read. period: s, of the wire."""
    rows = rows[rows["exchange"] > 0]
    silent = ((rows["flags"] & ANSWERED) == 0).astype(int)
    long = np.convolve(silent, np.ones(MISSED, int), "valid") == MISSED if len(rows) >= MISSED else np.zeros(0, bool)
    fell_silent = int((np.diff(long.astype(int), prepend=0) == 1).sum())
    return fell_silent + int((rows["began"] - rows["due"] >= MISSED * period * 1e9).sum())


def time_spread(times: np.ndarray | Sequence[int]) -> TimeSpread:
    """The distribution of times in ns."""
    seconds = np.asarray(times, dtype=np.float64) * 1e-9
    if not len(seconds):
        return TimeSpread(*(float("nan"),) * 4, (0,) * (len(EDGES) + 1))
    median, high, highest, largest = np.percentile(seconds, (50, 99, 99.9, 100)).tolist()
    counts = np.bincount(np.searchsorted(EDGES, seconds, side="right"), minlength=len(EDGES) + 1)
    return TimeSpread(median, high, highest, largest, tuple(counts.tolist()))


def _drift(rows: np.ndarray, tick_hz: float) -> float:
    """The drift of the bed's clock: the slope of its ticks over the host's times, less 1."""
    if len(rows) < 10:
        return float("nan")
    ticks = np.unwrap(rows["tick"].astype(np.float64), period=float(TICK))
    host = 0.5e-9 * (rows["began"] + rows["ended"])
    bed = (ticks - ticks[0]) / tick_hz
    if not bed[-1] > 0.0:
        return float("nan")
    slope = np.polyfit(host - host[0], bed, 1)[0]
    return float(slope - 1.0)
