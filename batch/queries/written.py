"""Values as a deck would write them: in its unit, in as few digits as read back to the same bits."""

from __future__ import annotations

import numpy as np

from met.unit_parser import parse_unit


def written(si: float, unit: str) -> str:
    """An SI value in a unit, in as few digits as give the same value again: `0.33 V*s/rad`; of a unit that cannot be
    read, as no MET writes, the number alone."""
    try:
        measure = parse_unit(unit)
    except ValueError:
        return f"{si!r}"
    rough = si / measure.to_si(1.0)
    texts = (_plain(float(f"{rough:.{digits}g}")) for digits in range(1, 18))
    text = next((each for each in texts if measure.to_si(float(each), each.lstrip("-")) == si), f"{rough!r}")
    return text if unit in ("", "1") else f"{text} {unit}"


def _plain(value: float) -> str:
    """A number's own digits, without an exponent where it reads well without."""
    if value and not 1e-4 <= abs(value) < 1e7:
        return repr(value)
    return np.format_float_positional(value, trim="-")
