"""The worth of a case to a search, as a number to be minimised.

A search looks for the worst case: the goal counts unchanged, and a case that fails, or gives the goal no value, is
infinitely bad. A tuning looks for the best candidate. Its cases are in tiers, each worse than the one before whatever
its numbers:

    (-1, 1)   all requirements are met: the goal, g / (1 + |g|)
    [1, 2]    some are missed, by m in all as shares of their limits: 2 - 1 / (1 + m)
    (2, 3]    the goal, or the metric of a requirement, has no value: 2 + the share of those that have none
    infinite  the case failed

A limit that is near makes the goal worse: by the margin, as a share of the goal, for each limit on which its metric
lies, less the farther it lies inside, and by nothing from the margin on. So a case gives up its distance from a limit
only for a goal that is better by more.

So no weight has to be chosen between the goal and what is required (K. Deb, Computer Methods in Applied Mechanics and
Engineering 186 (2000) 311), and between values that an optimiser compares by rank alone nothing is lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

MET, MISSED, UNKNOWN = 1.0, 2.0, 3.0
"""The ends of the tiers of a tuning's cases: a value below the first is of a case that meets all requirements."""


class MetricLimit(Protocol):
    """A requirement as used here: the name of its metric, `<` or `>` with or without `=`, its limit."""

    @property
    def metric(self) -> str:
        """The name of its metric."""

    @property
    def comparison(self) -> str:
        """`<`, `<=`, `>` or `>=`."""

    @property
    def limit(self) -> float:
        """The limit, SI."""


def hurt(goal: np.ndarray, largest: bool, done: np.ndarray) -> np.ndarray:
    """The worth of cases to a search, [case], by the goal's values and whether each case reached its end."""
    value = np.where(done, -goal if largest else goal, np.nan)
    return np.where(np.isnan(value), -np.inf, value)


def missed(limit: MetricLimit, values: np.ndarray) -> np.ndarray:
    """The distance of a metric's values beyond a limit, as a share of it, or in SI where that is 0; 0 within;
    not-a-number stays so."""
    return np.maximum(0.0, -_inside(limit, values) / (abs(limit.limit) or 1.0))


def short(limit: MetricLimit, values: np.ndarray, margin: float) -> np.ndarray:
    """The missing share, from 0 to 1, of the margin that a metric should keep from a limit; 0 for a limit of 0, which
    has no share."""
    wanted = margin * abs(limit.limit)
    if wanted == 0.0:
        return np.zeros(len(values))
    return np.clip(1.0 - _inside(limit, values) / wanted, 0.0, 1.0)


def _inside(limit: MetricLimit, values: np.ndarray) -> np.ndarray:
    return limit.limit - values if limit.comparison.startswith("<") else values - limit.limit


def served(
    goal: np.ndarray,
    largest: bool,
    done: np.ndarray,
    limits: Sequence[MetricLimit],
    metrics: Mapping[str, np.ndarray],
    margin: float,
) -> np.ndarray:
    """The worth of cases to a tuning, [case], the least the best: infinite for a failed case, else by metrics without a
    value, by missed requirements, by the goal. metrics: their values by name, SI."""
    least = -goal if largest else goal
    shape = (len(limits), len(goal))
    far = np.array([missed(limit, metrics[limit.metric]) for limit in limits]).reshape(shape)
    near = np.array([short(limit, metrics[limit.metric], margin) for limit in limits]).reshape(shape)
    with np.errstate(invalid="ignore"):
        held = np.where(np.isinf(least), least, least + np.abs(least) * margin * near.sum(axis=0))
        tame = np.where(np.isinf(held), np.sign(held), held / (1.0 + np.abs(held)))
    without = np.isnan(np.concatenate([far, least[None]])).mean(axis=0)
    strict = np.array([limit.comparison in ("<", ">") for limit in limits], bool)
    on_limit = np.array([metrics[limit.metric] == limit.limit for limit in limits]).reshape(shape)[strict].any(axis=0)
    total = far.sum(axis=0)
    value = np.where((total > 0.0) | on_limit, 2.0 - 1.0 / (1.0 + total), tame)
    value = np.where(without > 0.0, 2.0 + without, value)
    return np.where(done, value, np.inf)
