"""Sensitivity of an output to the inputs of existing cases: first-order and total indices of its variance.

No particular design is needed, only cases whose inputs vary independently of each other: a product of lists, a random
sample, a Latin hypercube. An input is cut into cells of about equally many cases.

- A first-order index is the share of the variance that lies between the means of an input's cells, once an additive
  model has taken out the others: the correlation ratio (K. Pearson, 1905), less the share that as many cells explain
  by chance (T. L. Kelley, PNAS 21 (1935) 554-559). The model is fitted to other cases than those it is taken from
  (cross-fitting: V. Chernozhukov et al., The Econometrics Journal 21 (2018) C1-C68). Fitted to the same, it would leave
  an input without effect more than chance does.
- The index of a pair is the same for cells in two inputs, of the variance that single inputs leave unexplained. It is
  extrapolated from cells of two widths.
- A total index is an input's own with those of its pairs (I. M. Sobol, 1993; A. Saltelli et al., Global Sensitivity
  Analysis: The Primer, 2008). Effects of three inputs and more together are in no pair; with noise and chance they
  make up the rest. Any part of the rest may belong to any input, so that a total is a range: from what the input and
  its pairs explain to what all others leave.
- Intervals are by the jackknife, leaving out each of `GROUPS` parts of the cases in turn. To it come the variance that
  a step within one cell may hide, and for totals the extrapolation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from met.frozen import frozen

GROUPS = 20
"""Number of parts of the cases that are left out in turn."""

QUANTILE = 2.093
"""Two-sided 95 % quantile of Student's distribution with GROUPS - 1 degrees of freedom."""

ROUNDING = 1e-12
"""Relative spread of an output's values, by its mean, below which they differ by rounding alone and nothing explains
them."""

FEWEST = 64
"""Smallest number of cases for a result."""

MOST_INPUTS = 40
"""Largest number of inputs for which pairs are examined: their number grows with the square."""

CELLS, PAIR_CELLS = 64, 32
"""Largest number of cells of an input, alone and in a pair."""

PAIR_CASES = 1 << 18
"""Largest number of cases in which pairs are examined, evenly chosen where there are more."""

SWEEPS = 3
"""Number of times that each input's effect is fitted to the residuals of the others."""

FOLDS = 5
"""Number of parts of the cases, each of which is compared with an additive model of the others."""


@frozen
class InputShare:
    """The share of an output's variance that one input explains.

    first, total             alone, and with its pairs; total is None where there are too many inputs for pairs
    first_by                 half the width of a 95 % interval
    total_low, total_high    ends of a 95 % interval of what the input explains with any number of others
    rank                     Spearman's correlation of input and output, -1 to 1
    low, high                the mean output in the input's lowest and its highest cell
    ends_by                  half the width of a 95 % interval of high - low, where the cases were drawn
    """

    first: float
    first_by: float
    total: float | None
    total_low: float
    total_high: float
    rank: float
    low: float
    high: float
    ends_by: float = 0.0

    def without_intervals(self) -> InputShare:
        """The same shares, with intervals that are not numbers."""
        return replace(self, first_by=math.nan, total_low=math.nan, total_high=math.nan)


@frozen
class Shares:
    """The inputs' shares of an output's variance, in the inputs' order; None where the output does not vary.

    rest  the share that no input and no pair explains: more than two together, noise, chance; None without pairs
    """

    inputs: tuple[InputShare, ...]
    rest: float | None


def cells(values: np.ndarray, most: int) -> np.ndarray:
    """The cell of each value, counted from 0: one a value where there are at most `most`, else of equal frequency."""
    known = np.unique(values)
    if len(known) > most:
        known = np.unique(np.quantile(values, np.arange(1, most) / most))
        return np.searchsorted(known, values, side="right").astype(np.uint8)
    return np.searchsorted(known, values).astype(np.uint8)


def shares(inputs: Sequence[np.ndarray], output: np.ndarray) -> Shares | None:
    """The shares of an output's variance that independent inputs explain.

    inputs  of each case, [case] each;  output: of each case, finite. Raises ValueError with fewer than FEWEST cases
    """
    cases = len(output)
    if cases < FEWEST:
        raise ValueError(f"{cases} cases are fewer than {FEWEST}")
    mean = float(output.mean())
    deviation = float(np.abs(output - mean).max())
    if not deviation > ROUNDING * abs(mean):
        return None
    y = (output - mean) / deviation
    part = (np.random.default_rng(0).permutation(cases) % GROUPS).astype(np.uint8)
    whole = _Variance(y, part)
    alone = [cells(values, max(4, min(CELLS, cases // 8))) for values in inputs]
    first, hidden = [], []
    for values, cell, own in zip(inputs, alone, _less_others(alone, y, part % FOLDS), strict=True):
        variance, count = _Variance(own, part), _count(cell)
        sizes, totals = variance.sums(cell, count)
        first.append(variance.between(sizes, totals) / whole.spread)
        is_divided = len(np.unique(values)) > count
        hidden.append(_hidden(sizes[:, 0], totals[:, 0], own) / whole.spread[0] if is_divided else 0.0)
    _, left = _additive(alone, y)
    total: list[np.ndarray] | None = None
    cut = np.zeros(len(inputs))
    unexplained = rest = None
    if len(inputs) <= MOST_INPUTS:
        some = slice(None, None, -(-cases // PAIR_CASES))
        left = left[some]
        size = max(3, min(PAIR_CELLS, int((len(left) / 25) ** 0.5)))
        coarse = [cells(values[some], size).astype(np.int64) for values in inputs]
        pairs, spread = _Variance(left, part[some]), _Variance(y[some], part[some]).spread
        counts = [_count(cell) for cell in coarse]
        is_cut = [
            count == size and len(np.unique(column[some])) > size for count, column in zip(counts, inputs, strict=True)
        ]
        total = [column.copy() for column in first]
        explained = np.sum(first, axis=0)
        for i, j in combinations(range(len(inputs)), 2):
            sums = pairs.sums(coarse[i] * counts[j] + coarse[j], counts[i] * counts[j])
            fine, wide = (
                pairs.between(*both, fitted=a + b - 2) / spread
                for both, a, b in (
                    (sums, counts[i], counts[j]),
                    _halved(sums, counts[i], counts[j], is_cut[i], is_cut[j]),
                )
            )
            # the variance hidden within cells falls with the square of their width
            together = fine + (fine - wide) / 3.0
            for place in (i, j):
                total[place] += together
                cut[place] += abs(fine[0] - wide[0]) / 3.0
            explained = explained + together
        unexplained = 1.0 - explained
        rest = float(np.clip(unexplained[0], 0.0, 1.0))
    ranks = _ranks(output)
    of_inputs = []
    for number, values in enumerate(inputs):
        least, low, high = None, 0.0, 1.0
        if total is not None and unexplained is not None:
            most = total[number] + unexplained
            least = max(_share(total[number]), _share(first[number]))
            high = min(1.0, max(least, float(most[0])) + interval(most) + cut[number] + hidden[number])
            low = min(high, max(0.0, float(total[number][0]) - interval(total[number]) - cut[number]))
        low_end, high_end, ends_by = means_of_ends(values, output)
        of_inputs.append(
            InputShare(
                first=_share(first[number]),
                first_by=min(1.0, interval(first[number]) + hidden[number]),
                total=least,
                total_low=low,
                total_high=high,
                rank=_correlation(_ranks(values), ranks),
                low=low_end,
                high=high_end,
                ends_by=ends_by,
            )
        )
    return Shares(tuple(of_inputs), rest)


DEPENDENT = 1e-3
"""Probability by which a pair of independent inputs, over all pairs, is called dependent."""

SLIGHT = 0.05
"""Rank correlation below which two inputs that depend on each other may count as independent."""


def dependent(inputs: Sequence[np.ndarray]) -> list[tuple[int, int, float]]:
    """Pairs of inputs that do not vary independently of each other, with the correlation of their ranks.

    It is tested by that correlation, and by the numbers of cases in cells of both (K. Pearson's chi-squared test): it
    sees what does not rise or fall. The level `DEPENDENT` holds over all pairs (Bonferroni).
    """
    from scipy.special import chdtrc, ndtri

    if len(inputs) < 2:
        return []
    some = np.random.default_rng(0).permutation(len(inputs[0]))[:20_000]
    count, pairs = len(some), len(inputs) * (len(inputs) - 1) // 2
    level = 0.5 * DEPENDENT / pairs
    ranks = [_ranks(values[some]) for values in inputs]
    coarse = [cells(values[some], max(4, min(8, int((count / 12) ** 0.5)))).astype(np.int64) for values in inputs]
    dependent_pairs = []
    for i, j in combinations(range(len(inputs)), 2):
        size = _correlation(ranks[i], ranks[j])
        is_correlated = abs(size) > max(SLIGHT, -ndtri(0.5 * level) / np.sqrt(max(1, count - 1)))
        a, b = _count(coarse[i]), _count(coarse[j])
        both = np.bincount(coarse[i] * b + coarse[j], minlength=a * b).reshape(a, b)
        expected = np.outer(both.sum(axis=1), both.sum(axis=0)) / count
        excess = float(((both - expected) ** 2 / np.maximum(expected, 1e-300)).sum())
        is_uneven = excess > SLIGHT**2 * count and chdtrc(max(1, (a - 1) * (b - 1)), excess) < level
        if is_correlated or is_uneven:
            dependent_pairs.append((i, j, size))
    return dependent_pairs


def _additive(
    alone: Sequence[np.ndarray], y: np.ndarray, counts: Sequence[int] = ()
) -> tuple[list[np.ndarray], np.ndarray]:
    """The effect of each input's cells, and the residual that no input explains alone: an additive model, fitted in
    turns (backfitting), so that chance dependence between inputs is not counted twice. counts: of cells, where some may
    be empty"""
    left, effects = y.copy(), [np.zeros(count) for count in counts or map(_count, alone)]
    for _ in range(SWEEPS):
        for cell, effect in zip(alone, effects, strict=True):
            more = _means(cell, left, len(effect))
            effect += more
            left -= more[cell]
    return effects, left


def _less_others(alone: Sequence[np.ndarray], y: np.ndarray, fold: np.ndarray) -> Iterator[np.ndarray]:
    """For one input after the other, the output less the effects of all other inputs, each case's by an additive model
    of the other folds. alone: the cells of each input, [case] each"""
    fits = []
    for number in range(FOLDS):
        others = fold != number
        fits.append(_additive([cell[others] for cell in alone], y[others], [_count(cell) for cell in alone])[0])
    effects = [np.stack([fit[place] for fit in fits]) for place in range(len(alone))]
    left = y - sum(effect[fold, cell] for effect, cell in zip(effects, alone, strict=True))
    for effect, cell in zip(effects, alone, strict=True):
        yield left + effect[fold, cell]


def _hidden(n: np.ndarray, sums: np.ndarray, own: np.ndarray) -> float:
    """The largest sum of squares within an input's cells that a step of its effect may hide, one step between the
    middles of the cells at either side; less what chance makes of it. n, sums: of each cell's cases"""
    if len(n) < 3:
        return 0.0
    means = sums / np.maximum(1.0, n)
    within = max(0.0, float(own @ own - (sums * means).sum())) / max(1.0, len(own) - len(n))
    step = np.pad(np.abs(means[2:] - means[:-2]), 1, mode="edge")
    chance = np.pad(within / np.maximum(1.0, n[2:]) + within / np.maximum(1.0, n[:-2]), 1, mode="edge")
    return float(max(0.0, (n * (step**2 - chance)).sum()) / 4.0)


class _Variance:
    """Sums of squares of all cases, and of the cases less each part: [1 + GROUPS], all cases first.

    spread  about the mean
    """

    def __init__(self, y: np.ndarray, part: np.ndarray) -> None:
        self._y, self._part = y, part.astype(np.int64)
        count, total, squares = (_sums(self._part, GROUPS, weights) for weights in (None, y, y * y))
        self._cases = _less_each(count[None, :])[0]
        self._mean = _less_each(total[None, :])[0] / self._cases
        self.spread = _less_each(squares[None, :])[0] - self._cases * self._mean**2

    def sums(self, cell: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """The number of cases in each of `count` cells, and the sum of their values: [cell, 1 + GROUPS] each."""
        key, shape = cell * np.int64(GROUPS) + self._part, (count, GROUPS)
        n = _less_each(_sums(key, count * GROUPS).reshape(shape))
        return n, _less_each(_sums(key, count * GROUPS, self._y).reshape(shape))

    def between(self, n: np.ndarray, sums: np.ndarray, fitted: int = 0) -> np.ndarray:
        """The sum of squares between the means of cells, less the part that as many cells explain by chance.

        fitted  degrees of freedom of the cells that were taken out before
        """
        between = np.divide(sums * sums, n, out=np.zeros_like(sums), where=n > 0).sum(axis=0)
        between -= self._cases * self._mean**2
        freedom = (n > 0).sum(axis=0) - 1.0
        within = (self.spread - between) / np.maximum(1.0, self._cases - freedom - 1.0)
        return np.asarray(between - np.maximum(0.0, freedom - fitted) * within)


def _halved(
    sums: tuple[np.ndarray, np.ndarray], a: int, b: int, cut_a: bool, cut_b: bool
) -> tuple[tuple[np.ndarray, np.ndarray], int, int]:
    """Sums of a by b cells, merged into cells twice as wide along the inputs that were cut, and the new numbers of
    cells."""
    at_a, at_b = np.arange(0, a, 2 if cut_a else 1), np.arange(0, b, 2 if cut_b else 1)
    n, totals = (
        np.add.reduceat(np.add.reduceat(array.reshape(a, b, -1), at_a, axis=0), at_b, axis=1) for array in sums
    )
    cells = len(at_a) * len(at_b)
    return (n.reshape(cells, -1), totals.reshape(cells, -1)), len(at_a), len(at_b)


def _sums(key: np.ndarray, count: int, weights: np.ndarray | None = None) -> np.ndarray:
    return np.bincount(key, weights, minlength=count).astype(float)


def _less_each(sums: np.ndarray) -> np.ndarray:
    """Sums of all parts, and of all but each: [cell, 1 + GROUPS] from [cell, GROUPS]."""
    whole = sums.sum(axis=1, keepdims=True)
    return np.concatenate([whole, whole - sums], axis=1)


def _count(cell: np.ndarray) -> int:
    return int(cell.max(initial=0)) + 1


def _means(cell: np.ndarray, y: np.ndarray, cells: int = 0) -> np.ndarray:
    count = np.bincount(cell, minlength=cells)
    return np.asarray(np.bincount(cell, y, minlength=cells) / np.maximum(1, count))


def _share(estimates: np.ndarray) -> float:
    return float(np.clip(estimates[0], 0.0, 1.0))


def interval(estimates: np.ndarray) -> float:
    """Half the width of the jackknife's 95 % interval. estimates: from all cases, then without each part."""
    without_part = estimates[1:]
    return float(QUANTILE * np.sqrt((GROUPS - 1) / GROUPS * ((without_part - without_part.mean()) ** 2).sum()))


def means_of_ends(values: np.ndarray, output: np.ndarray) -> tuple[float, float, float]:
    """The mean output in an input's lowest and in its highest cell, with half the width of a 95 % interval of their
    difference where the cases were drawn. What differs from 0, or from one another, by rounding alone does not."""
    cell = cells(values, max(4, min(CELLS, len(output) // 16)))
    ends = [output[cell == number] for number in (cell.min(), cell.max())]
    low, high = (float(end.mean()) for end in ends)
    rounding = ROUNDING * float(np.abs(output).max())
    low, high = (0.0 if abs(mean) <= rounding else mean for mean in (low, high))
    by = QUANTILE * math.sqrt(sum(float(end.var()) / max(1, len(end) - 1) for end in ends))
    return low, low if abs(high - low) <= rounding else high, by


def rank_correlation(values: np.ndarray, output: np.ndarray) -> float:
    """Spearman's correlation of an input and the output, -1 to 1."""
    return _correlation(_ranks(values), _ranks(output))


def _ranks(values: np.ndarray) -> np.ndarray:
    """Ranks, equal values with their mean rank."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    return np.asarray((last - (count - 1) / 2.0)[place.ravel()])


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size else 0.0
