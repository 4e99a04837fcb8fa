"""How close a test came: the worst figure of many, and where. `pytest -rP` shows what passing tests print."""

from __future__ import annotations

import math

import numpy as np


class Worst:
    """Collects figures that are to stay below a limit."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.figure = -1.0
        self.where = ""
        self.count = 0

    def see(self, figure: object, where: str) -> None:
        """One more figure; not a number is worse than all numbers."""
        value = float(figure)  # type: ignore[arg-type]
        value = math.inf if math.isnan(value) else value
        self.count += 1
        if value > self.figure:
            self.figure, self.where = value, where

    def below(self, limit: float) -> None:
        """Print the worst, and fail unless it is below the limit."""
        said = f"{self.what}: worst {self.figure:.2g} of {self.count}, at {self.where}; limit {limit:g}"
        print(said)
        assert self.count > 0 and self.figure < limit, said


def relative(ours: object, theirs: object) -> float:
    """Largest difference as a share of the largest entry."""
    a, b = np.asarray(ours), np.asarray(theirs)
    return float(np.max(np.abs(a - b)) / max(np.max(np.abs(b)), 1e-300))
