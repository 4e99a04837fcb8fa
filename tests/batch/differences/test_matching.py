"""Experiments, cases and rows of two archives that belong together: `batch/differences/matching.py`."""

from __future__ import annotations

from collections import defaultdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from batch.differences import matching
from batch.differences.matching import match_cases, match_experiments, match_instants


def archive(*names: str) -> Any:
    """What an archive is to the matching of experiments."""
    return SimpleNamespace(groups=[SimpleNamespace(name=name) for name in names])


def test_experiments_match_by_name_or_where_each_archive_has_one_alone() -> None:
    for a, b, pairs, only_a, only_b in [
        (["x"], ["y"], ["xy"], [], []),
        (["x"], ["y", "x"], ["xx"], [], ["y"]),
        (["x", "z", "y"], ["y"], ["yy"], ["x", "z"], []),
        (["x", "y"], ["z", "y", "x"], ["xx", "yy"], [], ["z"]),
    ]:
        matched, alone_a, alone_b = match_experiments(archive(*a), archive(*b))
        assert [one.name + other.name for one, other in matched] == pairs
        assert ([each.name for each in alone_a], [each.name for each in alone_b]) == (only_a, only_b)


def group(keys: np.ndarray) -> Any:
    """What an experiment of an archive is to the matching of cases."""
    return SimpleNamespace(count=len(keys), digests=lambda _, first, last: keys[first:last])


@pytest.mark.parametrize("seed", range(6))
def test_cases_match_by_key_and_those_of_one_key_in_their_order(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matching, "BLOCK", 3)
    random = np.random.default_rng(seed)
    a, b = (random.integers(0, 5, size).astype(np.uint64) for size in random.integers(0, 9, 2))
    if seed == 0:
        b = a.copy()
    places = defaultdict(list)
    for at, key in enumerate(b):
        places[int(key)].append(at)
    pairs = [(at, places[int(key)].pop(0)) for at, key in enumerate(a) if places[int(key)]]
    found = match_cases(group(a), group(b))
    assert list(zip(found.a.tolist(), found.b.tolist(), strict=True)) == pairs
    assert found.only_a.tolist() == sorted(set(range(len(a))) - {at for at, _ in pairs})
    assert found.only_b.tolist() == sorted(set(range(len(b))) - {at for _, at in pairs})
    assert found.count == len(pairs)


@pytest.mark.parametrize(
    ("a", "b", "early", "pairs"),
    [
        ([0.0, 1.0], [0.0, 1.0], 0.0, [(0, 0), (1, 1)]),
        ([0.0, 1.0], [0.0, 1.0005], 0.0, [(0, 0)]),
        ([0.0, 1.0], [0.0, 1.0 + 5e-10], 0.0, [(0, 0), (1, 1)]),
        ([0.0, 1.0], [0.0, 1.0 + 2e-9], 0.0, [(0, 0)]),
        ([0.0, 1000.0], [0.0, 1000.0 + 5e-7], 0.0, [(0, 0), (1, 1)]),
        ([0.0, 1.0], [5e-13, 2.0], 0.0, [(0, 0)]),
        ([0.0, 1.0], [5e-12, 2.0], 0.0, []),
        ([0.0, 1.0], [0.0, 1.01], 0.02, [(0, 0), (1, 1)]),
        ([0.0, 1.0], [0.0, 1.03], 0.02, [(0, 0)]),
        ([0.0, 0.99, 1.0], [0.0, 1.001], 0.02, [(0, 0), (2, 1)]),
        ([0.0, 1.001], [0.0, 0.99, 1.0], 0.02, [(0, 0), (1, 2)]),
        ([0.0, 0.5, 1.0], [0.5], 0.0, [(1, 0)]),
        ([2.1], [0.0, 1.0, 2.0, 3.0], 0.2, [(0, 2)]),
        ([], [0.0], 0.1, []),
    ],
)
def test_instants_match_that_are_nearest_to_each_other_and_near_enough(
    a: list[float], b: list[float], early: float, pairs: list[tuple[int, int]]
) -> None:
    """Near enough is `early`, or a billionth of the time, or of a millisecond; either way around."""
    in_a, in_b = match_instants(np.array(a), np.array(b), early)
    assert list(zip(in_a.tolist(), in_b.tolist(), strict=True)) == pairs
