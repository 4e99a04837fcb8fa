"""First-order and total indices from cases that were made for them: the scheme of Saltelli.

For each drawn pair of points a and b, the cases are a, a with one input after the other from b, and b: d + 2 cases for
d inputs (`ic/sweeps/designs.py`).

- First order: A. Saltelli et al., Computer Physics Communications 181 (2010) 259-270, table 2 (b).
- Total: M. J. W. Jansen, Computer Physics Communications 117 (1999) 35-43; table 2 (f) there. Whatever many inputs do
  together is in it.
- Intervals are by the jackknife over the pairs, as those of `met.statistics.sensitivity`. They take pairs for drawn at
  random; those of a Sobol sequence are more even, so that intervals are on the safe side.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from met.statistics.sensitivity import GROUPS, ROUNDING, InputShare, Shares, interval, means_of_ends, rank_correlation

FEWEST_PAIRS = 64
"""Smallest number of pairs of points for a result."""


def is_saltelli(inputs: Sequence[np.ndarray]) -> bool:
    """True if the cases are those of the scheme. inputs: [case] each, in the order of their columns."""
    width = len(inputs) + 2
    if not inputs or len(inputs[0]) % width:
        return False
    for place, values in enumerate(inputs):
        cases = values.reshape(-1, width)
        own = cases.copy()
        own[:, place + 1] = own[:, 0]
        if (own[:, :-1] != own[:, :1]).any() or (cases[:, place + 1] != cases[:, -1]).any():
            return False
    return True


def saltelli_shares(inputs: Sequence[np.ndarray], output: np.ndarray) -> Shares | None:
    """The shares of the output's variance that the inputs explain; None where it does not vary.

    inputs  of each case of the scheme, [case] each;  output: of each case, finite. Raises ValueError with fewer than
            `FEWEST_PAIRS` pairs
    """
    width = len(inputs) + 2
    y = output.reshape(-1, width)
    if len(y) < FEWEST_PAIRS:
        raise ValueError(f"{len(y)} pairs of points are fewer than {FEWEST_PAIRS}")
    size = float(np.abs(y - y.mean()).max())
    if not size > ROUNDING * abs(float(y.mean())):
        return None
    y = (y - y.mean()) / size
    a, b, mixed = y[:, 0], y[:, -1], y[:, 1:-1]
    part = np.arange(len(y)) % GROUPS
    ends = np.stack([a, b], axis=1)
    cases = _less_each(np.full((len(y), 1), 2.0), part)
    variance = _less_each((ends**2).sum(axis=1, keepdims=True), part) / cases
    variance = variance - (_less_each(ends.sum(axis=1, keepdims=True), part) / cases) ** 2
    pairs = 0.5 * cases
    first = _less_each(b[:, None] * (mixed - a[:, None]), part) / pairs / variance
    total = 0.5 * _less_each((mixed - a[:, None]) ** 2, part) / pairs / variance
    drawn = np.concatenate([y[:, 0], y[:, -1]]) * size + output.mean()
    of_inputs = []
    for place, values in enumerate(inputs):
        points = values.reshape(-1, width)
        own = np.concatenate([points[:, 0], points[:, -1]])
        low, high, ends_by = means_of_ends(own, drawn)
        of_inputs.append(
            InputShare(
                first=float(np.clip(first[0, place], 0.0, 1.0)),
                first_by=interval(first[:, place]),
                total=float(np.clip(total[0, place], 0.0, 1.0)),
                total_low=max(0.0, float(total[0, place]) - interval(total[:, place])),
                total_high=min(1.0, float(total[0, place]) + interval(total[:, place])),
                rank=rank_correlation(own, drawn),
                low=low,
                high=high,
                ends_by=ends_by,
            )
        )
    return Shares(tuple(of_inputs), None)


def _less_each(values: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Sums over all pairs, and over the pairs less each part: [1 + GROUPS, column] from [pair, column]."""
    sums = np.stack([np.bincount(part, column, minlength=GROUPS) for column in values.T], axis=1)
    whole = sums.sum(axis=0, keepdims=True)
    return np.concatenate([whole, whole - sums])
