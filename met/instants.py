"""Comparison of times to rounding: times in decks and instants are both computed, and both mean round numbers.

`(0.1 + 0.2) s` is 4e-17 s after the instant at 0.3 s, and means it. Without this, an event at that time would wait for
the next step or tick.
"""

from __future__ import annotations

from met.trace import Real, Truth

ROUNDING = 1e-12
"""Relative amount by which a time may be late: thousands of roundings, and a millisecond in thirty years."""


def has_come(now: Real, time: Real) -> Truth:
    """True where `now` is not before `time`, to rounding; both in s from the start of the run."""
    return now >= time * (1.0 - ROUNDING)
