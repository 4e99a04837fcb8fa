"""Matching of the experiments, cases and signals of two archives.

Experiments are matched by name, or where each archive has one alone; cases by their case_key, which is made from what
is varied alone; so the order of cases, and what else is in the archive, do not matter.
"""

from __future__ import annotations

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from met.frozen import frozen

BLOCK = 1 << 16
"""Number of names of cases that are read at a time."""


@frozen
class MatchedCases:
    """Matched cases, by their positions in the two groups; and positions of cases that only one of them has."""

    a: np.ndarray
    b: np.ndarray
    only_a: np.ndarray
    only_b: np.ndarray

    @property
    def count(self) -> int:
        return len(self.a)


def match_experiments(
    a: ArchiveFile, b: ArchiveFile
) -> tuple[list[tuple[ArchiveGroup, ArchiveGroup]], list[ArchiveGroup], list[ArchiveGroup]]:
    """Matched groups, and those that only one archive has."""
    if len(a.groups) == len(b.groups) == 1:
        return [(a.groups[0], b.groups[0])], [], []
    theirs = {group.name: group for group in b.groups}
    mine = {group.name for group in a.groups}
    pairs = [(group, theirs[group.name]) for group in a.groups if group.name in theirs]
    return (
        pairs,
        [group for group in a.groups if group.name not in theirs],
        [group for group in b.groups if group.name not in mine],
    )


def match_cases(a: ArchiveGroup, b: ArchiveGroup) -> MatchedCases:
    """Match by case_key. Cases that share one are taken in order."""
    keys_a, keys_b = _keys(a), _keys(b)
    if np.array_equal(keys_a, keys_b):
        both = np.arange(len(keys_a))
        return MatchedCases(both, both, both[:0], both[:0])
    order_a, order_b = np.argsort(keys_a, kind="stable"), np.argsort(keys_b, kind="stable")
    _, in_a, in_b = np.intersect1d(_nth(keys_a[order_a]), _nth(keys_b[order_b]), return_indices=True)
    found_a, found_b = order_a[in_a], order_b[in_b]
    by_a = np.argsort(found_a, kind="stable")
    found_a, found_b = found_a[by_a], found_b[by_a]
    only_a, only_b = (
        np.flatnonzero(~np.isin(np.arange(len(keys)), matched))
        for keys, matched in ((keys_a, found_a), (keys_b, found_b))
    )
    return MatchedCases(found_a, found_b, only_a, only_b)


def _keys(group: ArchiveGroup) -> np.ndarray:
    """The case_keys as whole numbers, [case]."""
    out = np.empty(group.count, np.uint64)
    for first in range(0, group.count, BLOCK):
        last = min(first + BLOCK, group.count)
        out[first:last] = group.digests("case_key", first, last)
    return out


def _nth(keys: np.ndarray) -> np.ndarray:
    """Sorted keys, each with its number among its equals."""
    starts = np.concatenate([[True], keys[1:] != keys[:-1]])[: len(keys)]
    place = np.arange(len(keys))
    nth = place - np.maximum.accumulate(np.where(starts, place, 0))
    out = np.empty(len(keys), dtype=[("key", np.uint64), ("nth", np.int64)])
    out["key"], out["nth"] = keys, nth
    return out


def match_instants(a: np.ndarray, b: np.ndarray, early: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows of two time axes that belong to the same instants, within `early` s: each is the nearest of the other."""
    if len(a) == len(b) and np.array_equal(a, b):
        return np.arange(len(a)), np.arange(len(b))
    if not len(a) or not len(b):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    nearest = _nearest(a, b)
    close = np.abs(b[nearest] - a) <= np.maximum(early, 1e-9 * np.maximum(np.abs(a), 1e-3))
    close &= _nearest(b, a)[nearest] == np.arange(len(a))
    return np.flatnonzero(close), nearest[close]


def _nearest(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The index of the nearest element of sorted `b` for each element of `a`."""
    after = np.clip(np.searchsorted(b, a), 0, len(b) - 1)
    before = np.clip(after - 1, 0, len(b) - 1)
    return np.where(np.abs(b[before] - a) < np.abs(b[after] - a), before, after)


def names(a: ArchiveGroup, b: ArchiveGroup, role: str) -> list[str]:
    """The names of the variables of a role in either group, in the order of the first, then of the second."""
    return list(dict.fromkeys(variable.name for group in (a, b) for variable in group.role(role)))
