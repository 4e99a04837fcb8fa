"""A value for a deck, in the unit that it is written in. It stands apart from `write_values`, so that who shows values
does not import the compiler of decks.
"""

from __future__ import annotations

from met.frozen import frozen
from met.unit_parser import written


@frozen
class WrittenValue:
    """A value for a deck: its path, SI value, and a unit to write it in ("" or "1": none)."""

    path: str
    si: float
    unit: str

    @property
    def text(self) -> str:
        """The value in a deck's syntax."""
        return written(self.si, self.unit)

    @property
    def setting(self) -> str:
        """The setting `PATH=VALUE`, for `--set`."""
        return f"{self.path}={self.text}"
