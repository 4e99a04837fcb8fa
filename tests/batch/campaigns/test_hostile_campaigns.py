"""Campaigns, by somebody who means them harm: what was found, each as a sentence of what should be."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import tracemalloc
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.campaigns import merge, resuming, status, tasks
from batch.campaigns.campaign import prepare
from batch.campaigns.drive import Outcome
from batch.campaigns.folder import Folder
from batch.campaigns.replaying import differences
from batch.executors import submitting
from batch.executors.threads import Threads
from batch.terminal import job
from met import cli
from met.diagnostic import Problem
from met.plan import Plan
from met.version import VERSION
from tests.batch import plans, whole
from tests.batch.begun import begin, plan, short_tasks
from tests.batch.door import ARM

DECK = """
#include <two_link.ic>

run brief like nominal { duration = 1 s; }
sweep kinds of brief { vary integrator = [modified_euler, rk4, midpoint]; }
"""

DOOR = (
    ARM
    + """run open {
    arm = door;
    initial { grip.q = 0.5 rad; }
    rates { dynamics = 100 Hz;  record = 20 Hz; }
    duration = 0.2 s;
    record = [q, qd];
    metric end = final { of = hinge.q; }
}
default sweep pushes of open { vary initial.hinge.qd = [0.01, 1e120] rad/s; }     // the last is too much for its square
"""
)


def deck(folder: Path, text: str = DECK, *select: str) -> Plan:
    (folder / "a.ic").write_text(text)
    return ic.compile("a.ic", select=list(select) or None)


def recorded(archive: batch.Archive) -> list[int]:
    """Positions of the cases whose histories are in an archive of one sweep."""
    with ArchiveFile(archive.path) as file:
        return list(file.groups[0].values("recorded_case").tolist())


class Losing(whole.Watched):
    """Threads that lose the tasks of a section with one of these places, as if their worker died."""

    def __init__(self, section: int, *places: int) -> None:
        super().__init__(Threads(1))
        self._section, self._places = section, places
        self._lost: list[tasks.Task] = []

    def submit(self, task: tasks.Task) -> None:
        if task.section == self._section and any(task.first <= place < task.last for place in self._places):
            self._lost.append(task)
        else:
            super().submit(task)

    def wait(self) -> list[Outcome]:
        lost, self._lost = self._lost, []
        return [Outcome(task, "lost", why="had too little memory") for task in lost] or super().wait()


# What is lost


@pytest.mark.release
def test_a_case_of_a_sweep_of_structures_does_not_take_its_sweeps_place(here: Path) -> None:
    whole_sweep = batch.run(deck(here, DECK, "kinds")).path.read_bytes()
    batch.run(deck(here, DECK, "kinds"), cases=["#1"])
    assert (here / "a.kinds.h5").read_bytes() == whole_sweep


@pytest.mark.parametrize("name", ["thesis.tex", *(each for each in ("plan of my thesis.txt", "status report.md"))])
def test_what_is_no_campaigns_is_not_removed(here: Path, name: str) -> None:
    mine = here / "a.h5.campaign" / name
    mine.parent.mkdir()
    mine.write_text("years of work")
    with pytest.raises(Problem, match="is no campaign's"):
        batch.run(plan(), output="a.h5")
    assert mine.exists()


@pytest.mark.slow
@pytest.mark.parametrize("nothing", [{"cases": []}, {"cases": np.flatnonzero([False])}, {"experiments": []}])
def test_a_campaign_of_nothing_replaces_no_archive(here: Path, nothing: dict[str, Any]) -> None:
    before = batch.run(plan(), output="a.h5").path.read_bytes()
    with pytest.raises(Problem):
        batch.run(plan(), output="a.h5", **nothing)
    assert (here / "a.h5").read_bytes() == before


@pytest.mark.slow
def test_a_history_whose_worker_died_is_not_said_to_be_kept(here: Path) -> None:
    archive = batch.run(plans.plan(plans.gains(6)), output="a.h5", histories="every:2", executor=Losing(1, 1))
    with ArchiveFile(archive.path) as file:
        (group,) = file.groups
        assert group.values("status").tolist() == [0] * 6
        assert group.values("recorded_case").tolist() == [0, 4]
        assert not any(np.isnan(group.signal("qd", place)).any() for place in (0, 4))
    assert archive.notes == (
        "no history of case #2 of `gains` is kept: its worker had too little memory, 3 times; "
        "`met run a.h5 --case '#2'` tries again",
    )


@pytest.mark.slow
def test_what_was_begun_afresh_is_gone_on_with(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short_tasks(monkeypatch)
    monkeypatch.setattr(resuming, "GUARDED_SECONDS", 0.0)
    batch.run(plans.plan(plans.gains(30)), output="a.h5")
    with pytest.raises(KeyboardInterrupt):  # "... cases are kept in a.h5.campaign; the same command goes on"
        batch.run(plan(), output="a.h5", fresh=True, executor=whole.Watched(after=3))
    assert "goes on: " in batch.run(plan(), output="a.h5").notes[0]


@pytest.mark.release
def test_what_replaces_an_archive_is_refused_before_it_is_submitted(
    submitted: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resuming, "GUARDED_SECONDS", 0.0)
    batch.run(plans.plan(plans.gains(30)), output="b.h5")
    another = prepare(plan(), output="b.h5")
    with pytest.raises(Problem, match=r"b\.h5 holds another campaign"):
        submitting.submit(another, jobs=2)
    assert submitting.submit(another, jobs=2, fresh=True) is not None
    folder = Path("b.h5.campaign")
    assert [run_job(folder, "share", str(k), str(folder / "jobs.json")) for k in (0, 1)] == [0, 0]
    assert run_job(folder, "together") == 1  # requirements are missed
    assert not folder.exists()


class Undead(Losing):
    """What it loses alone comes to its end after all, with the whole section."""

    def open(self, folder: Folder, sections: Mapping[int, tasks.CampaignSection], tell: Callable[[], None]) -> None:
        super().open(folder, sections, tell)
        self._folder, self._sections = folder, sections

    def wait(self) -> list[Outcome]:
        outcomes = super().wait()
        for task in (each.task for each in outcomes if each.kind == "lost" and each.task.cases == 1):
            section = self._sections[task.section]
            tasks.carry_out(section, tasks.Task(task.section, 0, len(section.rows)), self._folder.shards)
        return outcomes


@pytest.mark.slow
def test_a_worker_that_was_thought_dead_is_heard(here: Path) -> None:
    archive = batch.run(plans.plan(plans.gains(12)), output="a.h5", histories="every:2", executor=Undead(1, 2))
    calm = batch.run(plans.plan(plans.gains(12)), output="calm.h5", histories="every:2")
    assert archive.path.read_bytes() == calm.path.read_bytes()


# Memory


@pytest.mark.release
def test_histories_that_are_written_do_not_stay_in_memory(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    experiment = plans.gains(400, ticks=4000)
    monkeypatch.setattr(tasks, "MOST_BYTES", 2 << 20)
    batch.run(plans.plan(experiment), output="warm.h5", cases=range(40), histories="all")
    tracemalloc.start()
    try:
        batch.run(plans.plan(experiment), output="a.h5", histories="all")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert 400 * experiment.structure.history_bytes > 20 << 20
    assert peak < 12 << 20


@pytest.mark.slow
def test_what_decides_whose_histories_are_kept_takes_little_memory(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    peaks = []
    results = merge.results

    def measured(*words: Any) -> Any:
        tracemalloc.start()
        try:
            return results(*words)
        finally:
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()

    monkeypatch.setattr(merge, "results", measured)
    monkeypatch.setattr(tasks, "MOST_CASES", 1 << 10)
    batch.run(plans.plan(plans.gains(20_000, ticks=8)), output="a.h5", histories="worst:2:volts")
    assert 0 < peaks[0] < 50 * 20_000


# Jobs of a queue


@pytest.fixture
def submitted(here: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a campaign of 40 cases whose jobs wait in a queue."""
    (here / "bin").mkdir()
    (here / "bin" / "sbatch").write_text("#!/bin/sh\necho 7\n")
    (here / "bin" / "sbatch").chmod(0o755)
    monkeypatch.setenv("PATH", f"{here / 'bin'}:{os.environ['PATH']}")
    assert submitting.submit(prepare(plan(), output="a.h5"), jobs=2) is not None
    return here / "a.h5.campaign"


def run_job(folder: Path, *words: str) -> int:
    return job.main([str(folder), *words])


def test_a_merge_where_jobs_have_done_nothing_leaves_their_logs(submitted: Path) -> None:
    log = submitted / "logs" / "7_0.log"
    log.write_text("python: not found")
    assert run_job(submitted, "together") == 1
    assert log.read_text() == "python: not found"
    assert (submitted / "jobs.json").exists()


def test_who_looks_in_and_leaves_takes_no_submission_along(submitted: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        batch.run(plan(), output="a.h5", executor=whole.Watched(after=1))
    assert (submitted / "jobs.json").exists()
    assert run_job(submitted, "share", "0", str(submitted / "jobs.json")) == 0


@pytest.mark.slow
def test_a_merge_that_comes_too_late_gives_the_verdict(submitted: Path, capsys: pytest.CaptureFixture[str]) -> None:
    archive = batch.run(plan(), output="a.h5")
    assert run_job(submitted, "together") == (0 if archive.ok else 1)
    said = capsys.readouterr()
    assert "40 of 40 cases reached their end" in said.out and "E350" not in said.err


@pytest.mark.slow
@pytest.mark.parametrize("words", [("share", "0", "jobs.json"), ("together",)], ids=" ".join)
def test_a_job_with_other_code_than_was_submitted_computes_nothing(
    submitted: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    told = json.loads((submitted / "campaign.json").read_text())
    told["sections"][0]["code"] = "0" * 64
    (submitted / "campaign.json").write_text(json.dumps(told))
    verb, *rest = words
    assert run_job(submitted, verb, *(str(submitted / each) if "." in each else each for each in rest)) == 1
    assert capsys.readouterr().err == (
        f"error[E353]: the code of `gains` here is not that with which {submitted} was begun: nothing of it is run\n"
        f" = help: MET or a package of models has changed since; it was begun by MET {VERSION}, this is MET {VERSION}\n"
        " = help: bring the former code back, and submit or run the same again; `--fresh` starts over with this one\n"
        "\n1 error\n\n"
    )
    assert not list((submitted / "shards").iterdir())


@pytest.mark.release
@pytest.mark.parametrize("cores, number", [("", 0), ("2(x3)", 0), ("1", 9)])
def test_odd_words_of_the_queue_stop_no_share(
    submitted: Path, monkeypatch: pytest.MonkeyPatch, cores: str, number: int
) -> None:
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", cores)
    assert run_job(submitted, "share", str(number), str(submitted / "jobs.json")) in (0, 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"shares": [[[0]]], "timeout": null}',
        '{"shares": [[["a", null, {}]]], "timeout": null}',
        '{"shares": [[[0, 3, 1]]], "timeout": null}',
        '{"shares": [[[0, 0, 1000000000000]]], "timeout": null}',
        '{"shares": [[[7, 0, 1]]], "timeout": null}',
        '{"shares": [[[0, 0, 1]]], "timeout": "soon"}',
    ],
)
def test_damaged_shares_are_told(submitted: Path, capsys: pytest.CaptureFixture[str], text: str) -> None:
    (submitted / "jobs.json").write_text(text)
    assert run_job(submitted, "share", "0", str(submitted / "jobs.json")) == 1
    assert "jobs.json" in capsys.readouterr().err


def test_jobs_find_their_archive_and_their_logs(here: Path, submitted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []

    def sbatch(words: list[str], script: str, more: bool) -> str:
        told.extend([*words, script])
        return "7"

    monkeypatch.setattr(submitting, "_sbatch", sbatch)
    (here / "scratch").mkdir()
    (here / "50%j.h5.campaign").symlink_to(here / "scratch")
    (here / "60%j.h5.campaign").mkdir()
    for name in ("50%j.h5", "60%j.h5"):
        submitting.submit(prepare(plan(), output=name), jobs=2)
    assert sum(f"{here}/50%j.h5.campaign together" in each for each in told) == 1
    assert sum(f"--output={here}/60%%j.h5.campaign/logs/%A.log" in each for each in told) == 1


@pytest.mark.slow
def test_a_share_counts_its_own_cases(submitted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun = []

    class Bar:
        def begin(self, name: str, cases: int, done: int, failed: int, workers: str) -> None:
            begun.append((cases, done))

        def advance(self, done: int, failed: int, more: str = "") -> None: ...
        def end(self) -> None: ...

    monkeypatch.setattr(job, "Bar", Bar)
    assert run_job(submitted, "share", "1", str(submitted / "jobs.json")) == 0
    assert begun == [(8, 0)]


# Whose bits, and who is asked


def test_a_case_that_failed_may_be_run_again_on_another_machine(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = tasks.write_shard

    def elsewhere(path: Path, made: tasks.Shard) -> None:
        if made.history is not None:
            assert np.isnan(made.outputs).any()
            made.outputs[np.isnan(made.outputs)] = -made.outputs[np.isnan(made.outputs)]  # the other sign
        write(path, made)

    monkeypatch.setattr(tasks, "write_shard", elsewhere)
    batch.run(deck(here, DOOR), output="a.h5", histories="failed")


@pytest.mark.release
@pytest.mark.parametrize("single", [True, False])
def test_signals_of_another_width_are_compared(here: Path, single: bool) -> None:
    batch.run(plan(), output="a.h5", float32=single)
    batch.run(plan(), output="b.h5", float32=not single)
    assert differences("a.h5", "b.h5") == []
    with h5py.File("a.h5", "r+") as file:
        file["qd"][3, 7] += 1.0
    assert differences("a.h5", "b.h5") == ["#3 of gains: qd differs from 0.28 s on"]


@pytest.mark.slow
def test_the_commit_of_an_archive_is_mets_own(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = batch.run(plan(), output="a.h5").path.read_bytes()
    subprocess.run(["git", "init", "-q", "other"], check=True)
    who = ["-c", "user.name=a", "-c", "user.email=a@b"]
    subprocess.run(["git", "-C", "other", *who, "commit", "-q", "--allow-empty", "-m", "x"], check=True)
    monkeypatch.setenv("GIT_DIR", str(here / "other" / ".git"))
    assert batch.run(plan(), output="b.h5").path.read_bytes() == before


@pytest.mark.slow
def test_what_another_run_has_ended_meanwhile_is_not_run_again(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    look = resuming.finished_state

    def late(*words: Any) -> str:
        before = look(*words)
        monkeypatch.setattr(resuming, "finished_state", look)
        batch.run(plan(), output="a.h5")
        return before

    monkeypatch.setattr(resuming, "finished_state", late)
    executor = whole.Watched()
    batch.run(plan(), output="a.h5", executor=executor)
    assert executor.cases == 0


# Words


@pytest.mark.slow
def test_two_rules_of_every_so_many_add_up(here: Path) -> None:
    archive = batch.run(plan(), output="a.h5", histories=["every:10", "every:15"])
    assert recorded(archive) == [0, 10, 15, 20, 30]


@pytest.mark.slow
def test_every_so_many_may_be_more_than_there_can_be(here: Path) -> None:
    archive = batch.run(plan(), output="a.h5", histories=["every:99999999999999999999"])
    assert recorded(archive) == [0]


@pytest.mark.slow
@pytest.mark.parametrize("which", [np.int64(3), np.array([3]), [np.int32(3)]])
def test_positions_may_be_numpys(here: Path, which: Any) -> None:
    archive = batch.run(plan(), output="a.h5", histories=which)
    assert recorded(archive) == [3]


def test_a_position_counts_where_it_is_run(here: Path) -> None:
    both = plans.plan(plans.gains(6), plans.gains(7, "more"))
    selected = [(both.experiments[0], np.array([5])), (both.experiments[1], np.array([2]))]
    first, second = prepare(both, output="a.h5", selected=selected, histories="#2").parts
    assert first.history_places.tolist() == [] and second.history_places.tolist() == [0]


@pytest.mark.slow
def test_signals_in_another_order_are_told(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short_tasks(monkeypatch)
    begin(here / "a.h5")
    experiment = plans.gains(40)
    turned = replace(experiment.structure, record=experiment.structure.record[::-1])
    with pytest.raises(Problem) as caught:
        batch.run(plans.plan(replace(experiment, structure=turned)), output="a.h5")
    told = caught.value.diagnostics[0].help[0]
    assert told == "changed since: record: in another order"


@pytest.mark.release
def test_a_case_is_drawn_whichever_structure_it_is_of(here: Path) -> None:
    batch.run(deck(here, DECK, "kinds"), output="a.h5")
    assert cli.main(["plot", "a.h5", "--case", "#2"]) == 0


@pytest.mark.slow
def test_the_next_step_is_of_a_case_that_was_run(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deck(here, DECK, "kinds")
    assert cli.main(["run", "a.ic", "kinds", "--case", "#2", "--histories", "none", "--no-picture"]) == 1  # it misses
    assert "met run a.kinds.case2.h5 --case '#2'\n" in capsys.readouterr().out


@pytest.mark.slow
def test_a_replay_that_would_write_over_its_archive_by_a_link(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    batch.run(plan(), output="a.case2.h5")
    (here / "a.h5").symlink_to("a.case2.h5")
    assert cli.main(["run", "a.h5", "--case", "#2"]) == 2
    assert "cannot write a.case2.h5: it is what is run again" in capsys.readouterr().err


# Status


def test_status_needs_no_plan(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short_tasks(monkeypatch)
    begin(here / "a.h5")
    (here / "a.h5.campaign" / "plan.json").unlink()
    assert status.report(whole.folder_of(here / "a.h5"), 0.0)["sections"][0]["name"] == "gains"


def test_a_campaign_is_done_when_its_archive_is_there(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short_tasks(monkeypatch)
    begin(here / "a.h5", after=5)
    assert whole.done(here / "a.h5", 40) == 40
    assert cli.main(["status", "a.h5"]) == 1


@pytest.mark.parametrize("wrong", [{"section_done": "x"}, {"section_began": None}, {"at_first": []}])
def test_status_of_damaged_status(here: Path, monkeypatch: pytest.MonkeyPatch, wrong: dict[str, Any]) -> None:
    short_tasks(monkeypatch)
    begin(here / "a.h5")
    path = here / "a.h5.campaign" / "status.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **wrong}))
    assert cli.main(["status", "a.h5"]) == 1


# Names and places


def test_a_folder_on_another_disk_is_emptied_in_the_end(here: Path) -> None:
    (here / "scratch").mkdir()
    (here / "a.h5.campaign").symlink_to(here / "scratch")
    batch.run(plan(), output="a.h5")
    assert [path.name for path in here.glob(".*")] == []
    assert not any((here / "scratch").iterdir())


@pytest.mark.parametrize("length", [235, 244])
def test_a_long_name_is_refused_before_or_good_to_the_end(here: Path, length: int) -> None:
    name, executor = "n" * length, whole.Watched()
    try:
        batch.run(plan(), output=name, executor=executor)
    except Problem:
        assert executor.cases == 0
    else:
        assert whole.beside_it(here / name) == [name, f"{name}.run.json"]


@pytest.mark.slow
def test_processes_where_many_files_are_open(here: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (2048, limits[1]))
    held = [os.open(os.devnull, os.O_RDONLY) for _ in range(1100)]
    try:
        assert batch.run(plans.plan(plans.gains(4)), output="a.h5", processes=1).summaries[0].failed == 0
    finally:
        for each in held:
            os.close(each)
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)


# What held


@pytest.mark.release
def test_cases_at_the_edges_of_blocks(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of eight, of 23 to 25 cases; cases that are lost or kept on both sides of each edge."""
    monkeypatch.setattr(merge, "BLOCK", 8)
    lost = (0, 7, 8, 15, 22)
    for cases in (23, 24, 25):
        kept = [0, 8, 9, 16, cases - 1]
        of: Plan = plans.plan(plans.gains(cases), plans.gains(3, "tail"))
        calm = batch.run(of, output="calm.h5", histories="all").path
        path = batch.run(of, output="a.h5", histories=[0, "#8", 9, "#16", cases - 1], executor=Losing(0, *lost)).path
        with ArchiveFile(calm) as before, ArchiveFile(path) as after:
            old, new = before.groups[0], after.groups[0]
            assert np.flatnonzero(new.values("status")).tolist() == list(lost)
            others = np.setdiff1d(np.arange(cases), lost)
            for name in ("settle", "volts", "gearbox.kp", "case_id", "n_valid"):
                assert np.array_equal(old.values(name)[others], new.values(name)[others]), name
            assert new.values("recorded_case").tolist() == kept
            assert np.array_equal(new.values("recorded.case_id"), old.values("case_id")[kept])
            for place in kept:
                wanted = np.full_like(old.signal("qd", place), np.nan) if place in lost else old.signal("qd", place)
                assert np.array_equal(new.signal("qd", place), wanted, equal_nan=True)
