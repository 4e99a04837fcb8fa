"""Names of cases by their place in the case table: `#7`."""

from __future__ import annotations

MOST_DIGITS = 18
"""Largest number of digits of a row: more than any table needs, and few enough for an int64."""


def row_of(case: str) -> int | None:
    """The row that `#7` names; None for other text. For a row that no table can have, the largest int64."""
    digits = case[1:].lstrip("0")
    if not case.startswith("#") or not case[1:].isdecimal():
        return None
    return int(digits or "0") if len(digits) <= MOST_DIGITS else 2**63 - 1
