"""A value that is to be written into a deck."""

from __future__ import annotations

from met.frozen import frozen
from met.unit_parser import written


@frozen
class WrittenValue:
    """A value that a deck is to have: its path, SI value, and a unit to write it in ("" or "1": none)."""

    path: str
    si: float
    unit: str

    @property
    def text(self) -> str:
        """The value as a deck would write it."""
        return written(self.si, self.unit)

    @property
    def setting(self) -> str:
        """`PATH=VALUE`, as `--set` takes it."""
        return f"{self.path}={self.text}"
