"""What a search or a tuning asks of an optimiser: points to try, a batch at a time."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Optimiser(Protocol):
    """Chooses points of the unit cube, a generation at a time, by the values of those before: the least is looked for.

    Which it asks for follows from how it was made and from what it was told, to the bit, on every machine.
    """

    def ask(self) -> np.ndarray:
        """The points of the next generation, [candidate, dimension]; empty, [0, dimension]: it has ended."""
        ...

    def tell(self, values: np.ndarray) -> None:
        """The values of the points that were asked last, [candidate]: +inf and -inf may be among them, NaN is not."""
        ...
