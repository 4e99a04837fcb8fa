"""Faults that a bed has latched: it forgets them when it is told to, once its shaft is slow, and at no other time."""

from __future__ import annotations

from hw import refusals
from hw.bed import About, BedDriver, BedState, Fault

COMING_TO_REST = 10.0
"""s that a shaft is given for it."""

LOOKS = 0.1
"""s between two looks at it."""


def cleared(bed: BedDriver, about: About) -> Fault:
    """What a bed, which is greeted, had latched; now it is disarmed. Raises Problem E406 where its shaft turns on."""
    sample = bed.read()
    if sample.state != BedState.STOPPED:
        return Fault(0)
    left = COMING_TO_REST
    while abs(sample.rate) > about.limits.arming_rate and left > 0.0:
        sample, left = bed.rest(LOOKS), left - LOOKS
    bed.clear()
    return sample.faults & ~Fault.WATCHDOG


def check(bed: BedDriver, about: About, port: str) -> None:
    """Raises Problem E406 where a bed, which is greeted, has latched faults."""
    sample = bed.read()
    if sample.state == BedState.STOPPED:
        raise refusals.latched(about, sample.faults, port)
