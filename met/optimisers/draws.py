"""Random numbers for optimisers that are equal to the bit on every machine."""

from __future__ import annotations

import zlib

import numpy as np

from met.optimisers.arithmetic import added

SUMMED = 12
"""Number of uniform numbers in a nearly normal one: the variance of their sum is 1."""


class Draws:
    """A stream of random numbers that follows from a seed and a name, by Philox, a counter-based generator."""

    def __init__(self, seed: int, name: str) -> None:
        self._generator = np.random.Generator(np.random.Philox(key=[seed, zlib.crc32(name.encode())]))

    def even(self, *shape: int) -> np.ndarray:
        """Numbers that are uniform in [0, 1)."""
        return self._generator.random(shape)

    def nearly_normal(self, *shape: int) -> np.ndarray:
        """Numbers of mean 0 and variance 1: sums of twelve uniform ones less 6, so that no logarithm is needed; all lie
        between -6 and 6."""
        return added(self.even(SUMMED, *shape)) - SUMMED / 2

    def whole(self, below: int, *shape: int) -> np.ndarray:
        """Whole numbers in [0, below)."""
        return (self.even(*shape) * below).astype(np.int64)

    def spread(self, count: int, dimension: int) -> np.ndarray:
        """Points of the unit cube, [count, dimension], as a Latin hypercube: each coordinate has one in each of `count`
        equal intervals."""
        out = np.empty((count, dimension))
        for column in range(dimension):
            out[:, column] = (np.argsort(self.even(count), kind="stable") + self.even(count)) / max(count, 1)
        return out
