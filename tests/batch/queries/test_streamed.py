"""Very many rows are gone through some at a time: what is said of them is what is said of rows that are held."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries import tallies
from batch.queries.evidence_table import requirement_evidence
from batch.queries.summary import SummedMetric, summarise
from batch.terminal.show import show, show_evidence
from met.plan import columns
from met.plan.judged import Requirement
from met.run import DONE
from met.statistics.confidence import percentile_rank

DECK = """
#include <two_link.ic>
run short like nominal {
    duration = 2 s;
    rates { dynamics = 50 Hz; servos = 100 Hz; record = 5 Hz; }
    record = [];
    require quick: settle < 1.9 s in 90 % of cases with 90 % confidence;
    require percentile(volts, 95 %) < 5.2 V with 90 % confidence;
    require volts < 5 V;
    allow D341 because "what does not settle is part of it";
}
sweep many of short {
    vary gearbox.kp = [0.01, 0.03] V*s/rad;
    vary initial.shoulder.qd = [0, 1e120] rad/s;  // the last is too much for its square
    sample random(90) { gearbox.kt = normal(0.1, 0.003) N*m/A; }
}
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("streamed")
    return batch.run(ic.compile(text=DECK, select=["many"]), output=folder / "d.h5", verify="some").path


@pytest.mark.parametrize(("size", "spoilt"), [(1, True), (7, True), (60, True), (7, False)])
def test_tallies_of_blocks_of_any_size_are_those_of_all_cases(
    size: int, spoilt: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two design points. spoilt: a case in five fails, a case in seven has no value, and one value is infinite."""
    monkeypatch.setattr(tallies, "MOST_CAUSES", 2)
    cases, at = 60, np.arange(60)
    values = np.random.default_rng(1).normal(3.0, 1.0, cases)
    if spoilt:
        values[at % 7 == 0], values[11] = np.nan, np.inf
    status = np.where(spoilt & (at % 5 == 0), DONE + 1, DONE)
    cause = [f"{'abcd'[place // 15]} at {place} s" if status[place] != DONE else "" for place in at]
    unknown, points = np.isnan(values) | (status != DONE), at % 2
    asked = [
        Requirement("m < 0", "m", "<", 0.0),
        Requirement("m > 2", "m", ">", 2.0, None, 0.3, 0.5),
        Requirement("m < 4", "m", "<", 4.0, None, 0.4, 0.9),
        Requirement("m < 3", "m", "<", 3.0, None, 0.5),
    ]
    met = [np.where(unknown, -1, (values < each.limit) == (each.comparison == "<")) for each in asked]
    found = tallies.CaseTallies(["m", "none"], asked, [30, 30])
    for first in range(0, cases, size):
        part = slice(first, first + size)
        found.add(
            tallies.CaseBlock(
                at[part], status[part], cause[part], [""] * len(at[part]),
                {"m": values[part], "none": np.full(len(at[part]), np.nan)},
                np.stack(met, 1)[part], points[part], 1,
            )
        )  # fmt: skip
    numbers = tallies.PointNumbers()
    numbers.of([points], cases)
    said = {
        name: each.tolist()
        for name, each in found.values(lambda at: at + 100, {"m": "m", "none": "none"}, ["p"], numbers).items()
    }
    finite = np.isfinite(values)
    assert found.limited == -(-cases // size)
    assert said["finite"] == [finite.sum(), 0] and said["infinite"] == [int(spoilt), 0]
    assert said["unknown"] == [np.isnan(values).sum(), cases]
    assert said["mean"][0] == pytest.approx(values[finite].mean(), rel=1e-12)
    assert said["variance"][0] == pytest.approx(values[finite].var(ddof=1), rel=1e-12)
    assert (said["least"][0], said["most"][0]) == (values[finite].min(), values[finite].max())
    assert said["least_case"] == [100 + int(np.flatnonzero(values == values[finite].min())[0]), -1]
    cases_that_stand_out = (said[name] for name in ("least_case", "most_case", "judged_worst_case", "cause_first"))
    assert {place + 100 for place in found.named()} == {case for each in cases_that_stand_out for case in each} - {-1}
    if spoilt:
        assert said["cause"] == ["a at 0 s", "b at 15 s", tallies.OTHERS]
        assert (said["cause_cases"], said["cause_first"]) == ([3, 3, 6], [100, 115, 130])
        assert said["cause_status"] == [DONE + 1] * 3
    assert said["judged_point"] == [-1, -1, -1, -1, 0, 1, 0, 1, 0, 1]
    assert said["judged_requirement"] == [0, 1, 2, 3, 1, 1, 2, 2, 3, 3]
    for row, (number, point) in enumerate(zip(said["judged_requirement"], said["judged_point"], strict=True)):
        here, each = np.ones(cases, bool) if point < 0 else points == point, asked[number]
        sign = 1.0 if each.comparison == "<" else -1.0
        far = np.where(unknown, np.inf, sign * values)[here]
        assert said["judged_cases"][row] == here.sum()
        assert said["judged_missed"][row] == np.count_nonzero(met[number][here] == 0)
        assert said["judged_unknown"][row] == unknown[here].sum()
        assert said["judged_no_value"][row] == (np.isnan(values) & (status == DONE))[here].sum()
        assert said["judged_worst_case"][row] == 100 + at[here][np.argmax(far)]
        least = np.nan
        if point >= 0 and each.share and each.confidence:
            rank = percentile_rank(30, each.share, each.confidence)
            least = sign * np.sort(far)[rank - 1]
        assert said["judged_bound"][row] == pytest.approx(least if np.isfinite(least) else np.nan, nan_ok=True)


@pytest.fixture
def many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tallies, "MANY", 100)


@pytest.mark.release
def test_evidence_is_that_of_rows_that_are_held(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with ArchiveFile(archive) as file:
        held = requirement_evidence(file.groups, "d.h5")
    monkeypatch.setattr(tallies, "MANY", 100)
    with ArchiveFile(archive) as file:
        found = requirement_evidence(file.groups, "d.h5")
        assert file.groups[0].summed is not None and file.groups[0].summary is None
    assert len(held) == len(found) == 2 + 4 * 2
    for one, other in zip(held, found, strict=True):
        sigmas = None if one.sigmas is None else pytest.approx(one.sigmas, rel=1e-9)
        assert other.sigmas == sigmas
        assert dataclasses.replace(one, sigmas=None) == dataclasses.replace(other, sigmas=None)


@pytest.mark.slow
def test_the_outcome_is_that_of_rows_that_are_held(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with ArchiveFile(archive) as file:
        (held,) = summarise(file)
    monkeypatch.setattr(tallies, "MANY", 100)
    with ArchiveFile(archive) as file:
        (found,) = summarise(file)
    assert (held.cases, held.failed, held.ok, held.limits) == (found.cases, found.failed, found.ok, found.limits)
    assert held.failed == 180
    for one, other in zip(held.metrics, found.metrics, strict=True):
        assert isinstance(other, SummedMetric)
        for name in ("minimum", "maximum", "infinite", "unknown", "name", "deck_unit"):
            assert repr(getattr(one, name)) == repr(getattr(other, name))  # some have no finite value
    for one, other in zip(held.requirements, found.requirements, strict=True):
        assert (one.met, one.missed, one.unknown, one.no_value) == (
            other.met,
            other.missed,
            other.unknown,
            other.no_value,
        )


def test_met_show_lists_those_that_stand_out(archive: Path, many: None) -> None:
    with ArchiveFile(archive) as file:
        said = show(file)
        assert "median" not in said and "sigma" in said
        assert "of 360 cases those that stand out:" in said
        assert "gearbox.kt = values from " in said
        assert "180 of 360 cases reached their end, 180 failed" in said
        assert "percentile(volts, 95 %)" in show_evidence(file)


@pytest.mark.slow
def test_no_column_of_them_is_read_whole(archive: Path, many: None, monkeypatch: pytest.MonkeyPatch) -> None:
    values, stretch = ArchiveGroup.values, ArchiveGroup.stretch

    def some(group: ArchiveGroup, name: str) -> np.ndarray:
        assert group.variables[name].dims[0] != "case", name
        return values(group, name)

    def short(group: ArchiveGroup, name: str, first: int, last: int) -> np.ndarray:
        assert last - first <= 64, name
        return stretch(group, name, first, last)

    monkeypatch.setattr(columns, "BLOCK", 64)
    monkeypatch.setattr(ArchiveGroup, "values", some)
    monkeypatch.setattr(ArchiveGroup, "stretch", short)
    with ArchiveFile(archive) as file:
        assert "of 360 cases those that stand out:" in show(file)
        assert "percentile(volts, 95 %)" in show_evidence(file)
        assert summarise(file)[0].failed == 180


def test_all_cases_are_listed_where_they_are_asked_for(archive: Path, many: None) -> None:
    with ArchiveFile(archive) as file:
        said = show(file, all_cases=True)
    assert "cases, worst first" in said and "stand out" not in said
    assert sum(line.lstrip().startswith("#") for line in said.splitlines()) >= 360


def test_too_many_design_points_are_held(archive: Path, many: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tallies, "MOST_POINTS", 3)
    with ArchiveFile(archive) as file:
        assert tallies.summed_up(file.groups[0]) is None
        assert "180 of 360 cases reached their end" in show(file)
