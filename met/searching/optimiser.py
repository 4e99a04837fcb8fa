"""An optimiser as whoever runs cases sees it: it asks for points of the unit cube, and is told what they are worth."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Optimiser(Protocol):
    """Asks for points, a generation at a time, and is told the value of each before it asks again.

    Two that are made alike and told alike ask alike, to the bit.
    """

    def ask(self) -> np.ndarray:
        """Points of the unit cube, [candidate, dimension]; none, [0, dimension], when it has ended."""

    def tell(self, values: np.ndarray) -> None:
        """Take the values of the points that were asked for last, [candidate], to be minimised; they may be
        infinite."""
