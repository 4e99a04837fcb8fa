"""Exact sums of very many values, their mean and variance, and one-sided order statistics, in nearly constant
memory."""

from __future__ import annotations

import math

import numpy as np

ROOM = 1 << 16
"""Number of values that are collected before the furthest are selected."""


class ExactSum:
    """A sum of doubles that is rounded once, whatever their order; not-a-number where one of them is not finite."""

    def __init__(self) -> None:
        self._whole, self._finite = 0, True

    def add(self, values: np.ndarray) -> None:
        """Add values whose own sum is rounded, so that they must come in the same pieces each time."""
        try:
            numerator, denominator = math.fsum(values.tolist()).as_integer_ratio()
        except (OverflowError, ValueError):
            self._finite = False
            return
        self._whole += numerator << (1074 - (denominator.bit_length() - 1))

    @property
    def value(self) -> float:
        """The sum, rounded once; not-a-number beyond all doubles."""
        try:
            return self._whole / (1 << 1074) if self._finite else math.nan
        except OverflowError:
            return math.nan


class Moments:
    """Mean and variance of the finite values among those that come in blocks, computed from their distance to the
    first."""

    def __init__(self) -> None:
        self.count = 0
        self._from = 0.0
        self._first, self._second = ExactSum(), ExactSum()

    def add(self, values: np.ndarray) -> None:
        """Add the finite ones of these values."""
        finite = values[np.isfinite(values)]
        if len(finite):
            if not self.count:
                self._from = float(finite[0])
            with np.errstate(over="ignore"):
                off = finite - self._from
                self._first.add(off)
                self._second.add(off * off)
            self.count += len(finite)

    @property
    def mean(self) -> float:
        return self._from + self._first.value / self.count if self.count else math.nan

    @property
    def variance(self) -> float:
        if self.count < 2:
            return math.nan
        return max(0.0, self._second.value - self._first.value**2 / self.count) / (self.count - 1)


class Furthest:
    """The `most` furthest values so far, taken as large ones: the least of them is an order statistic."""

    def __init__(self, most: int) -> None:
        self._most, self._parts, self._held = most, list[np.ndarray](), 0
        self._above = -math.inf

    def add(self, values: np.ndarray) -> None:
        """Take the next values, and keep the largest."""
        if self._most:
            self._parts.append(values[values > self._above] if self._above > -math.inf else values.copy())
            self._held += len(self._parts[-1])
            if self._held > 2 * self._most + ROOM:
                self._cut()

    def _cut(self) -> None:
        values = np.concatenate(self._parts)
        values = np.partition(values, len(values) - self._most)[-self._most :].copy()
        self._parts, self._held, self._above = [values], len(values), float(values[0])

    @property
    def least(self) -> float:
        """The least of them; not-a-number where there are too few, or it is infinite."""
        if not self._most or self._held < self._most:
            return math.nan
        self._cut()
        return self._above if math.isfinite(self._above) else math.nan
