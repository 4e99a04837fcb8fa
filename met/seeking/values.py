"""The worth of a case to a search, as a number to be minimised.

A search looks for what hurts: the goal counts as it is, and a case that fails, or gives the goal no value, hurts
infinitely. A tuning looks for what serves. Its cases are in tiers, each worse than the one before whatever its numbers:

    (-1, 1)   all requirements are met with their margin: the goal, g / (1 + |g|)
    [1, 2]    some are missed, by m in all as shares of their limits: 2 - 1 / (1 + m)
    (2, 3]    the goal, or the metric of a requirement, has no value: 2 + the share of those that have none
    infinite  the case failed

So no weight has to be chosen between the goal and what is required (K. Deb, Computer Methods in Applied Mechanics and
Engineering 186 (2000) 311), and between values that an optimiser compares by rank alone nothing is lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

MET, MISSED, UNKNOWN = 1.0, 2.0, 3.0
"""The ends of the tiers of a tuning's cases: a value below the first is of a case that meets all with its margin."""


class Limit(Protocol):
    """A requirement as far as it counts here: the name of its metric, `<` or `>` with or without `=`, its limit."""

    @property
    def metric(self) -> str: ...
    @property
    def comparison(self) -> str: ...
    @property
    def limit(self) -> float: ...


def hurt(goal: np.ndarray, largest: bool, done: np.ndarray) -> np.ndarray:
    """The worth of cases to a search, [case], by the goal's values and whether each case reached its end."""
    value = np.where(done, -goal if largest else goal, np.nan)
    return np.where(np.isnan(value), -np.inf, value)


def missed(limit: Limit, values: np.ndarray, margin: float) -> np.ndarray:
    """How far the values of its metric are from meeting a requirement with a margin, as a share of the limit, or in SI
    where that is 0; not-a-number stays so."""
    size = abs(limit.limit)
    beyond = values - limit.limit if limit.comparison.startswith("<") else limit.limit - values
    return np.maximum(0.0, (beyond + margin * size) / (size or 1.0))


def served(
    goal: np.ndarray,
    largest: bool,
    done: np.ndarray,
    limits: Sequence[Limit],
    metrics: Mapping[str, np.ndarray],
    margin: float,
) -> np.ndarray:
    """The worth of cases to a tuning, [case]. metrics: their values by name, SI."""
    least = -goal if largest else goal
    with np.errstate(invalid="ignore"):
        tame = np.where(np.isinf(least), np.sign(least), least / (1.0 + np.abs(least)))
    far = np.array([missed(each, metrics[each.metric], margin) for each in limits]).reshape(len(limits), len(goal))
    without = np.isnan(np.concatenate([far, least[None]])).mean(axis=0)
    total = far.sum(axis=0)
    short = np.array([each.comparison in ("<", ">") and margin == 0.0 for each in limits], bool)
    on_limit = np.array([metrics[each.metric] == each.limit for each in limits]).reshape(far.shape)[short].any(axis=0)
    value = np.where((total > 0.0) | on_limit, 2.0 - 1.0 / (1.0 + total), tame)
    value = np.where(without > 0.0, 2.0 + without, value)
    return np.where(done, value, np.inf)
