"""What merging takes from shards: each case once, in order, with its fate, and with its history where it has one.

The shards are made here, of a program that nothing computes: the output of a case is its row of the table.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from batch.campaigns import merge, tasks
from batch.campaigns.folder import Folder
from batch.campaigns.tasks import CampaignSection, Task, keep, not_run
from met import run as engine
from met.diagnostic import Problem
from met.run import DONE, LOST, TIMED_OUT, Run
from tests.batch import plans

DIED = "its worker died, 3 times"


class Numbering(plans.Answering):
    """A program with the three outputs of a failure, the row of the case, and one recorded column."""

    def __init__(self, cases: int) -> None:
        super().__init__(replace(plans.gains(cases, ticks=4), requirements=()))
        self.program.outputs = self.outputs = ("failure", "failure.part", "failure.tick", "row")
        self.program.columns = 1


class Written:
    """In place of an archive's writer: keeps what it is given, by the place of the first case.

    cases    [(first, rows of the table, outputs, status)];  signals: [(first, histories)]
    """

    def __init__(self) -> None:
        self.cases: list[tuple[int, list[int], list[float], list[int]]] = []
        self.signals: list[tuple[int, list[float]]] = []

    def case_values(self, number: int, run: Run) -> Run:
        return run

    def put_cases(self, number: int, first: int, run: Run) -> None:
        self.cases.append((first, run.case.tolist(), run.metrics["row"].tolist(), run.status.tolist()))

    def put_signals(self, number: int, first: int, run: Run, kept: np.ndarray | None = None) -> None:
        histories = run.signals["row"] if kept is None else run.signals["row"][kept]
        self.signals.append((first, histories[:, 0, 0].tolist()))


@pytest.fixture(autouse=True)
def nothing_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Results are the outputs, histories and fates of the shards, as they are."""

    def results(prepared: Any, rows: Any, history: Any, outputs: Any, fates: Any) -> Run:
        run = plans.answer(prepared, rows, record=False)
        for place, (status, _) in fates.items():
            run.status[place] = status
        return replace(run, metrics={"row": outputs[:, -1]}, signals={} if history is None else {"row": history})

    monkeypatch.setattr(engine, "results", results)
    monkeypatch.setattr(merge, "BLOCK", 10)


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """A campaign's folder without shards."""
    (tmp_path / "shards").mkdir()
    return Folder(tmp_path)


def section_of(rows: Iterable[int], *, recorded: bool = False, number: int = 0) -> CampaignSection:
    """A section of these rows of a table of 40 cases."""
    return CampaignSection(number, 0, Numbering(40), np.array([*rows]), recorded)  # type: ignore[arg-type]


def a_shard(section: CampaignSection, first: int, last: int) -> tasks.Shard:
    """The results of some cases of a section: the row is the output, and its negative fills the history."""
    rows = np.asarray(section.rows[first:last], float)
    steps = section.prepared.experiment.structure.schedule.rows
    history = np.repeat(-rows, steps).reshape(len(rows), steps, 1) if section.recorded else None
    outputs = np.outer(rows, [0.0, 0.0, 0.0, 1.0])
    return tasks.Shard(section.key(first, last), outputs, history, 1.0)


def put(folder: Folder, section: CampaignSection, *stretches: tuple[int, int], lost: Iterable[int] = ()) -> None:
    """Shards of a section: of these stretches of cases, and of single cases whose worker died."""
    for first, last in stretches:
        keep(folder.shards, Task(section.number, first, last), a_shard(section, first, last))
    for place in lost:
        task = Task(section.number, place, place + 1)
        keep(folder.shards, task, not_run(section, task, LOST, DIED))


def merged(folder: Folder, values: CampaignSection, histories: CampaignSection | None = None) -> tuple[Written, Any]:
    """What is written of an experiment, and the outcomes of its cases."""
    written, progress = Written(), list[int]()
    outcomes = merge.merge(written, 0, folder, values, histories, progress.append, threads=2)  # type: ignore[arg-type]
    assert progress == [first + len(rows) for first, rows, *_ in written.cases]
    return written, outcomes


# Values


def test_cases_come_in_blocks_whatever_the_shards_each_once(folder: Folder) -> None:
    """Where shards overlap, the first one counts; rows are those of the table, not places."""
    rows = range(3, 28)
    section = section_of(rows)
    put(folder, section, (0, 8), (5, 13), (13, 25), (6, 7), lost=[2])
    written, outcomes = merged(folder, section)
    assert [first for first, *_ in written.cases] == [0, 10, 20]
    assert [row for _, cases, *_ in written.cases for row in cases] == [*rows]
    assert [row for *_, found, _ in written.cases for row in found] == [*rows]
    assert written.signals == [] and outcomes.count == outcomes.done.set == 25
    assert [run.case.tolist() for _, run in merge.runs_in_blocks(folder, section)] == [
        cases for _, cases, *_ in written.cases
    ]


def test_a_fate_stays_with_its_case_in_any_block(folder: Folder) -> None:
    section = section_of(range(25))
    put(folder, section, (1, 9), (11, 19), (20, 25), lost=[0, 9, 10, 19])
    written, outcomes = merged(folder, section)
    ends = [status for *_, block in written.cases for status in block]
    assert [place for place, status in enumerate(ends) if status == LOST] == [0, 9, 10, 19]
    assert {*ends} == {DONE, LOST} and outcomes.done.set == 21
    assert merge.results(folder, section).done.set == 21


def test_a_block_has_the_fates_of_its_own_cases_and_none_is_empty() -> None:
    fates = {place: (LOST, str(place)) for place in (0, 9, 10, 19)}
    whole = replace(a_shard(section_of(range(20)), 0, 20), fates=fates)
    blocks = [(first, len(outputs), ends) for first, outputs, ends in merge.in_blocks([(0, whole)])]
    assert blocks == [(0, 10, {0: (LOST, "0"), 9: (LOST, "9")}), (10, 10, {0: (LOST, "10"), 9: (LOST, "19")})]


def test_a_shard_loses_its_first_cases_with_their_fates_and_histories() -> None:
    fates = {1: (LOST, DIED), 2: (TIMED_OUT, "slow"), 4: (LOST, DIED)}
    whole = replace(a_shard(section_of(range(6), recorded=True), 0, 6), fates=fates)
    cut = merge._part(whole, np.arange(2, 6), whole.key)
    assert cut.outputs[:, -1].tolist() == [2.0, 3.0, 4.0, 5.0] and cut.fates == {0: fates[2], 2: fates[4]}
    assert cut.history is not None and cut.history[:, 0, 0].tolist() == [-2.0, -3.0, -4.0, -5.0]
    assert cut.key == whole.key and cut.seconds == 0.0


def test_blocks_have_65536_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an archive with more cases, the bytes depend on it."""
    monkeypatch.undo()
    shards = [(at, tasks.Shard("", np.zeros((count, 1)), None, 0.0)) for at, count in ((0, 65_535), (65_535, 2))]
    assert [(first, len(outputs)) for first, outputs, _ in merge.in_blocks(shards)] == [(0, 65_536), (65_536, 1)]


@pytest.mark.parametrize(
    ("stretches", "words"),
    [
        ([(0, 8), (9, 25)], "no shard holds case 8 of gains"),
        ([(0, 24)], "no shard holds case 24 of gains"),
        ([(0, 8), (8, 25)], "shard 0-000000008-000000025 is not what was written: its checksum differs"),
    ],
)
def test_a_case_without_a_sound_shard_is_missing(folder: Folder, stretches: list[tuple[int, int]], words: str) -> None:
    section = section_of(range(25))
    put(folder, section, *stretches)
    last = folder.shards / Task(0, *stretches[-1]).name
    if "checksum" in words:
        last.write_bytes(last.read_bytes()[:-1] + b"!")
    with pytest.raises(merge.Missing, match=words):
        merged(folder, section)


# Histories


def test_histories_are_written_with_the_values_where_all_are_kept(folder: Folder) -> None:
    section = section_of(range(2, 8), recorded=True)
    put(folder, section, (0, 4), (2, 6))
    written, _ = merged(folder, section)
    assert written.signals == [(0, [-2.0, -3.0, -4.0, -5.0]), (4, [-6.0, -7.0])]


def test_histories_of_some_cases_are_written_one_after_another(folder: Folder) -> None:
    """Cases that were lost at first keep an empty one; those that were lost only when they were run again have none."""
    values = section_of(range(25))
    histories = section_of([0, 4, 9, 10, 11, 20, 24], recorded=True, number=1)
    put(folder, values, (0, 4), (5, 25), lost=[4])
    put(folder, histories, (0, 3), (4, 7), lost=[3])
    written, outcomes = merged(folder, values, histories)
    assert written.signals == [(0, [0.0, -4.0, -9.0]), (3, [-11.0, -20.0, -24.0])]
    assert outcomes.count == 25 and outcomes.done.set == 24
    assert merge.without_history(folder, values, histories) == {10: DIED}


def test_a_case_that_is_lost_twice_keeps_its_empty_history(folder: Folder) -> None:
    values, histories = section_of(range(5)), section_of([0, 3], recorded=True, number=1)
    put(folder, values, (1, 5), lost=[0])
    put(folder, histories, (1, 2), lost=[0])
    written, _ = merged(folder, values, histories)
    assert [first for first, _ in written.signals] == [0, 1]
    np.testing.assert_array_equal([history for _, each in written.signals for history in each], [np.nan, -3.0])
    assert merge.without_history(folder, values, histories) == {}


def test_a_worker_that_was_thought_dead_and_finished_has_lost_no_case(folder: Folder) -> None:
    values, histories = section_of(range(8)), section_of(range(8), recorded=True, number=1)
    put(folder, histories, (1, 5), lost=[0, 2, 5, 6, 7])
    assert merge.without_history(folder, values, histories) == dict.fromkeys((0, 5, 6, 7), DIED)


@pytest.mark.parametrize("case", [0, 10, 24])
def test_another_number_of_a_case_run_again_is_an_error(folder: Folder, case: int) -> None:
    values, histories = section_of(range(25)), section_of([0, 10, 24], recorded=True, number=1)
    put(folder, values, (0, 25))
    put(folder, histories, (0, 3))
    assert len(merged(folder, values, histories)[0].signals) == 1
    place = [0, 10, 24].index(case)
    other = a_shard(histories, 0, 3)
    other.outputs[place, -1] = np.nextafter(case, np.inf)
    tasks.write_shard(folder.shards / Task(1, 0, 3).name, other)
    with pytest.raises(Problem) as caught:
        merged(folder, values, histories)
    [diagnostic] = caught.value.diagnostics
    assert diagnostic.message == f"case #{case} of `gains` gave other numbers when it was run again for its history"


# Some of another section's cases


def test_chosen_cases_get_shards_of_their_own(folder: Folder) -> None:
    """Those of an earlier choice go; a shard without a chosen case has none; of two with a case the first counts."""
    section = section_of(range(3, 28))
    put(folder, section, (0, 8), (5, 13), (13, 20), (20, 25), lost=[23])
    put(folder, section_of(range(9), number=7), (0, 9))
    places = np.array([0, 4, 7, 8, 12, 21, 24])
    chosen = merge.with_rows(folder, section, places, 7)
    assert folder.named_tasks(7) == [Task(7, 0, 3), Task(7, 3, 5), Task(7, 5, 7)]
    assert chosen.number == 7 and np.asarray(chosen.rows).tolist() == [3, 7, 10, 11, 15, 24, 27]
    written, _ = merged(folder, chosen)
    assert written.cases == [(0, [3, 7, 10, 11, 15, 24, 27], [3.0, 7.0, 10.0, 11.0, 15.0, 24.0, 27.0], [DONE] * 7)]


def test_chosen_cases_keep_fates_and_histories(folder: Folder) -> None:
    section = section_of(range(6), recorded=True)
    put(folder, section, (0, 2), (3, 6), lost=[2])
    chosen = merge.with_rows(folder, section, np.array([1, 2, 5]), 7)
    assert folder.read(chosen, Task(7, 0, 1)).seconds == 0.0, "computing time stays with the other section's shard"
    written, _ = merged(folder, chosen)
    assert written.cases == [(0, [1, 2, 5], [1.0, 0.0, 5.0], [DONE, LOST, DONE])]
    np.testing.assert_array_equal([history for _, each in written.signals for history in each], [-1.0, np.nan, -5.0])


def test_a_chosen_case_without_a_shard_is_missing(folder: Folder) -> None:
    section = section_of(range(25))
    put(folder, section, (0, 8), (12, 25))
    with pytest.raises(merge.Missing, match=r"^2 cases of gains have no shard any more$"):
        merge.with_rows(folder, section, np.array([7, 8, 11, 12]), 7)


# Threads


@pytest.mark.parametrize("threads", [None, 1, 3])
def test_results_come_in_order(threads: int | None) -> None:
    calls: list[Callable[[], int]] = [partial(int, number) for number in range(9)]
    if threads is None:
        assert list(merge.ahead(None, calls, 2)) == [*range(9)]
        return
    with ThreadPoolExecutor(threads) as pool:
        assert list(merge.ahead(pool, calls, 2)) == [*range(9)]


def test_no_more_is_computed_ahead_than_is_said_and_nothing_after_the_last_that_is_wanted() -> None:
    begun: list[int] = []
    go_on = threading.Event()

    def call(number: int) -> int:
        begun.append(number)
        return number if number == 0 or go_on.wait(10.0) else -1

    taken: list[int] = []

    def calls() -> Iterable[Callable[[], int]]:
        for number in range(9):
            taken.append(number)
            yield partial(call, number)

    with ThreadPoolExecutor(1) as pool:
        results = merge.ahead(pool, calls(), 3)
        assert next(results) == 0 and taken == [0, 1, 2, 3]
        results.close()  # type: ignore[attr-defined]
        go_on.set()
    assert begun in ([0], [0, 1])
