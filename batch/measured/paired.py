"""A channel as computed and as measured, at the instants at which both have a number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from batch.archive.read import ArchiveGroup
from met.frozen import frozen

LARGEST = 1e100
"""A measured number that is larger than this counts as none: its square would be no number."""

OUTLYING, OUTLIERS = 5.0, 0.01
"""An outlier is so many times as far from the middle of nine tenths of a residual as these are; and the largest share
of outliers."""


def usual_rows(residual: np.ndarray) -> np.ndarray:
    """True for each residual that is no outlier; for all where outliers are not few, [number]."""
    low, high = np.quantile(residual, [0.05, 0.95])
    usual = np.abs(residual - 0.5 * (low + high)) <= OUTLYING * 0.5 * (high - low)
    return usual if np.mean(~usual) <= OUTLIERS else np.ones(len(residual), dtype=bool)


def autocorrelation(residual: np.ndarray) -> np.ndarray:
    """The correlation of residuals with those so many instants later, 1 at 0, [lag]; all 1 where they are constant."""
    centred = residual - residual.mean()
    spectrum = np.fft.rfft(centred, 2 * len(centred))
    correlation = np.fft.irfft(spectrum * spectrum.conj())[: len(centred)]
    return correlation / correlation[0] if correlation[0] > 0.0 else np.ones(len(centred))


@frozen
class ComputedChannel:
    """A channel of a run: its computed `values`, at `times`, s."""

    times: np.ndarray
    values: np.ndarray

    def at(self, instants: np.ndarray) -> np.ndarray:
        """Its numbers at other instants, on straight lines; not-a-number before the first and after the last."""
        return np.interp(instants, self.times, self.values, left=np.nan, right=np.nan)

    @property
    def rate(self) -> ComputedChannel:
        """Its slope, by central differences."""
        values = np.gradient(self.values, self.times) if len(self.times) > 1 else np.zeros(len(self.times))
        return ComputedChannel(self.times, values)


def computed(group: ArchiveGroup, position: int, columns: Sequence[Mapping[str, str]]) -> dict[str, ComputedChannel]:
    """The channels of a recorded case as far as they are finite. columns: those of `described_columns`, in order"""
    times = group.values("time")
    signals = list(dict.fromkeys(column["signal"] for column in columns))
    history = np.hstack([group.signal(name, position).reshape(len(times), -1) for name in signals])
    out = {}
    for column, values in zip(columns, history.T.astype(np.float64), strict=True):
        finite = np.isfinite(values)
        if finite.any():
            out[column["channel"]] = ComputedChannel(times[finite], values[finite])
    return out


@frozen
class Pair:
    """A channel measured at `instants`, s, and its computed course. `of` makes one whose numbers are all usual."""

    instants: np.ndarray
    measured: np.ndarray
    course: ComputedChannel

    @classmethod
    def of(cls, instants: np.ndarray, measured: np.ndarray, course: ComputedChannel) -> Pair:
        """The instants at which both have a number."""
        with np.errstate(invalid="ignore"):
            rows = (np.abs(measured) <= LARGEST) & np.isfinite(course.at(instants))
        return cls(instants[rows], measured[rows], course)

    @property
    def residual(self) -> np.ndarray:
        """The measured less the computed values."""
        return self.measured - self.course.at(self.instants)

    def usual(self) -> Pair:
        """The pair without its outliers, as long as they are few."""
        rows = usual_rows(self.residual)
        return self if rows.all() else Pair(self.instants[rows], self.measured[rows], self.course)

    def thinned(self, most: int) -> Pair:
        """The pair with so many instants at most."""
        every = -(-len(self.instants) // most)
        return Pair(self.instants[::every], self.measured[::every], self.course)
