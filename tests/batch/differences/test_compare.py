"""Histories compared many cases at once: as each by itself, and as by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from batch.differences import campaigns
from batch.differences.campaigns import diff
from batch.differences.compare import Difference, SampledCourse, compare, compare_cases
from batch.differences.data import as_data
from batch.differences.tolerance import SignalTolerance, tolerances
from met.diagnostic import Problem
from met.run import Run
from tests.batch.differences.planted import order, two

CASES, ROWS, COLUMNS = 4, 7, 2
SPECIAL = [math.nan, math.inf, -math.inf, -0.0, 5e-324, 1e308, -1e308, 1.0]
TIME = np.arange(ROWS) * 0.1


def pair(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Few values that differ, some of them not finite, and some that are the same on both sides though not finite."""
    a = rng.integers(0, 3, (CASES, ROWS, COLUMNS)).astype(float)
    a.flat[rng.integers(a.size, size=3)] = rng.choice(SPECIAL, 3)
    b = a.copy()
    some = rng.integers(5)
    b.flat[rng.integers(b.size, size=some)] = rng.choice(SPECIAL, some)
    return a, b


def by_hand(a: np.ndarray, b: np.ndarray, allowed: SignalTolerance) -> tuple[int, int, float, int, int]:
    """beyond, nan, largest, first, first_beyond, value by value."""
    beyond = nan = 0
    within, largest, first, first_beyond = 0.0, 0.0, -1, -1
    for row in range(len(a)):
        for x, y in zip(a[row].tolist(), b[row].tolist(), strict=True):
            if (math.isnan(x) and math.isnan(y)) or (x == y and math.copysign(1, x) == math.copysign(1, y)):
                continue
            first = row if first < 0 else first
            apart = abs(y - x)
            nan += math.isnan(x) != math.isnan(y)
            if math.isnan(apart):
                beyond += 1
                first_beyond = row if first_beyond < 0 else first_beyond
            elif not (
                math.isfinite(x)
                and math.isfinite(y)
                and apart <= allowed.absolute + allowed.relative * max(abs(x), abs(y))
            ):
                beyond += 1
                first_beyond = row if first_beyond < 0 else first_beyond
                largest = max(largest, apart)
            else:
                within = max(within, apart)
    return beyond, nan, largest if beyond else within, first, first_beyond


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(200))
def test_cases_at_once_are_what_each_is_by_itself_and_by_hand(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = pair(rng)
    allowed = SignalTolerance(*(float(rng.choice([0.0, limit])) for limit in (0.5, 1e-3)))
    for early in (0.0, 0.04, 0.25):
        later = SignalTolerance(allowed.absolute, allowed.relative, early)
        for absolute in (None, np.array([0.1, 2.0])):
            each = [compare(before, after, later, TIME, absolute) for before, after in zip(a, b, strict=True)]
            assert repr(compare_cases(a, b, later, SampledCourse(TIME, TIME, a), absolute)) == repr(each)
    for before, after, found in zip(a, b, compare_cases(a, b, allowed), strict=True):
        expected = by_hand(before, after, allowed)
        if found is None:
            assert expected == (0, 0, 0.0, -1, -1)
        else:
            assert (found.beyond, found.nan, found.largest, found.first, found.first_beyond) == expected


def test_where_the_difference_is_largest() -> None:
    a = np.zeros((3, 4, 2))
    b = a.copy()
    b[0, 2, 1], b[0, 3, 0], b[2, 1, 0] = 0.5, -2.0, -0.0
    first, second, third = compare_cases(a, b, SignalTolerance(1.0))
    assert first == Difference(
        beyond=1,
        nan=0,
        largest=2.0,
        row=3,
        column=0,
        before=0.0,
        after=-2.0,
        squares=4.25,
        values=8,
        first=2,
        first_beyond=3,
        used=2.0,
    )
    assert second is None
    assert third is not None and (third.row, third.column, third.largest, third.beyond) == (1, 0, 0.0, 0)


@pytest.mark.release
@pytest.mark.parametrize("words", [[], ["q=1e-7rad", "rel=1e-9"], ["time=50ms"]])
def test_blocks_of_any_size_give_one_answer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: list[str]) -> None:
    def plant(run: Run, place: dict[int, int]) -> None:
        for values in run.signals.values():
            values[::3] += 1e-8
            values[1, 5:] = math.nan

    a, b = two(monkeypatch, tmp_path, order(11, 40), plant, cases=40)
    found = diff(a, b, tolerances(words))
    assert found.verdict == "different"
    for size in (1, 1000, 1 << 30):
        monkeypatch.setattr(campaigns, "BLOCK", size)
        assert as_data(diff(a, b, tolerances(words))) == as_data(found)


@pytest.mark.release
@pytest.mark.parametrize("key", ["", "123", "0123456789abcdeg", "0123456789abcdef0"])
def test_a_case_key_that_is_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, key: str) -> None:
    import h5py

    a, b = two(monkeypatch, tmp_path, order(12, 40), cases=40)
    with h5py.File(b, "r+") as file:
        file["case_key"][7] = key
    with pytest.raises(Problem) as caught:
        diff(a, b)
    [told] = caught.value.diagnostics
    assert (told.code, told.message) == ("E302", f"the archive {b} is damaged: variable `case_key` is not of digests")
