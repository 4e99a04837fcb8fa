"""The interface of an optimiser: it gives points to try, a batch at a time."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Optimiser(Protocol):
    """Chooser of points of the unit cube, a generation at a time, by the values of former ones: it looks for the least
    value.

    Which it asks for follows from how it was made and from what it was told, to the bit, on every machine.
    """

    def ask(self) -> np.ndarray:
        """The points of the next generation, [candidate, dimension]; empty, [0, dimension], after the end."""

    def tell(self, values: np.ndarray) -> None:
        """Take the values of the points that were asked last, [candidate]: +inf and -inf may be among them, NaN is
        not."""
