"""Latched faults of a bed: it clears them on command, once its shaft is slow, and at no other time."""

from __future__ import annotations

from hw import refusals
from hw.bed import About, BedDriver, BedState, Fault

COMING_TO_REST = 10.0
"""Longest time for which a shaft may go on turning before faults are cleared, s."""

LOOKS = 0.1
"""Time between two looks at the shaft's rate, s."""


def cleared(bed: BedDriver, about: About) -> Fault:
    """Clear the faults that a greeted bed has latched, and return them; it is disarmed then. Raises Problem E406
    where its shaft turns on."""
    sample = bed.read()
    if sample.state != BedState.STOPPED:
        return Fault(0)
    left = COMING_TO_REST
    while abs(sample.rate) > about.limits.arming_rate and left > 0.0:
        sample, left = bed.rest(LOOKS), left - LOOKS
    bed.clear()
    return sample.faults & ~Fault.WATCHDOG


def check(bed: BedDriver, about: About, port: str) -> None:
    """Raise Problem E406 where a greeted bed has latched faults. port: as the user wrote it, for the remedy."""
    sample = bed.read()
    if sample.state == BedState.STOPPED:
        raise refusals.latched(about, sample.faults, port)
