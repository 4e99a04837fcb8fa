"""How commands name a case by its place in the case table: `#7`."""

from __future__ import annotations

MOST_DIGITS = 18
"""More than the rows of any table have, and few enough for an int64."""


def row_of(case: str) -> int | None:
    """The row that `#7` names; None for what is no such name. A row that no table can have is the largest int64."""
    digits = case[1:].lstrip("0")
    if not case.startswith("#") or not case[1:].isdecimal():
        return None
    return int(digits or "0") if len(digits) <= MOST_DIGITS else 2**63 - 1
