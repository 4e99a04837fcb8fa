"""Cases that fail, that kill their worker, or that never end: all others are done, to the same bits, and these are
listed by cause."""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.campaigns import performing, tasks
from batch.executors.processes import Processes
from batch.queries.pool import failures
from batch.terminal import running
from met import cli
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import Plan
from met.run import DONE, FAILED, LOST, TIMED_OUT
from tests.batch import plans, poisoned, whole
from tests.batch.door import ARM

DECK = (
    ARM
    + """
run open {
    arm      = door;
    initial  { grip.q = 0.5 rad; }
    rates    { dynamics = 100 Hz;  record = 20 Hz; }
    duration = 4 s;
    record   = [q, qd];
    metric end  = final { of = hinge.q; }
    metric fast = max { of = grip.qd; }
}

default sweep pushes of open {
    vary links.leaf.mass  = linspace(2, 6, MASSES) kg;
    vary initial.hinge.qd = [0.01 .. 0.99 by 0.01, 1e120] rad/s;       // the last is too much for its square
}
"""
)

POISON = {"row_1234": "SIGKILL", "row_4321": "SIGSEGV", "row_7777": "SIGKILL", "row_2500": "sleep", "row_9001": "sleep"}
POISONED = [1234, 2500, 4321, 7777, 9001]
DIVERGE = list(range(99, 10_000, 100))


def deck(folder: Path, masses: int) -> Path:
    path = folder / "door.ic"
    path.write_text(DECK.replace("MASSES", str(masses)))
    return path


def compiled(folder: Path, masses: int) -> Plan:
    return ic.compile(deck(folder, masses))


def values(path: Path, names: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    """All variables of an archive of one sweep, or those of these names."""
    with ArchiveFile(path) as file:
        (group,) = file.groups
        return {name: group.values(name) for name in group.variables if not names or name in names}


def alike(before: np.ndarray, after: np.ndarray) -> bool:
    """To the bit; anything that is no number is alike."""
    if before.dtype.kind == "f":
        return bool(np.array_equal(before.view(f"i{before.itemsize}"), after.view(f"i{after.itemsize}")))
    return bool(np.array_equal(before, after))


def differ(before: Path, after: Path, but: list[int]) -> list[str]:
    """Variables in which two archives differ, these cases left aside."""
    old, new = values(before), values(after)
    assert list(old) == list(new)
    others = np.setdiff1d(old["case"], but)
    out = []
    for name, numbers in old.items():
        along_cases = len(numbers) == len(old["case"])
        a, b = (numbers[others], new[name][others]) if along_cases else (numbers, new[name])
        if not alike(a, b):
            out.append(name)
    return out


class Poisoned(Processes):
    """Two processes of workers that are poisoned."""

    def __init__(self, timeout: float | None = 2.0, workers: int = 2, **poison: Any) -> None:
        super().__init__(workers, timeout=timeout, command=poisoned.command(**poison))


# Ten thousand cases, of which a hundred diverge and five are poisoned


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of a serial run that nothing happened to; its deck lies beside it."""
    folder = tmp_path_factory.mktemp("doors")
    return batch.run(compiled(folder, 100), output=folder / "undisturbed.h5", threads=1).path


@pytest.fixture(scope="module")
def ran(undisturbed: Path) -> tuple[Path, int, str]:
    """The archive of a poisoned run, its exit status, and what it said."""
    path = undisturbed.with_name("a.h5")
    words = ["run", str(path.with_name("door.ic")), "-o", str(path), "--no-picture", "--processes", "2"]
    return path, *told(words, lambda **_: Poisoned(**POISON))


def told(words: list[str], choose: Callable[..., Any] | None = None) -> tuple[int, str]:
    """What the command line function gives back, and prints."""
    from contextlib import redirect_stdout
    from io import StringIO

    said = StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(said):
        if choose is not None:
            patch.setattr(running, "choose", choose)
        status = cli.main(words)
    return status, said.getvalue()


@pytest.mark.release
class TestTenThousandCases:
    @pytest.mark.release
    def test_all_others_are_done_with_the_same_bits(self, ran: tuple[Path, int, str], undisturbed: Path) -> None:
        assert differ(undisturbed, ran[0], POISONED) == []

    def test_it_is_said_how_each_ended(self, ran: tuple[Path, int, str]) -> None:
        found = values(ran[0], ("status", "cause", "n_valid", "initial.hinge.qd", "links.leaf.mass", "end"))
        status = np.zeros(10_000, int)
        status[DIVERGE], status[[2500, 9001]], status[[1234, 4321, 7777]] = FAILED, TIMED_OUT, LOST
        assert np.array_equal(found["status"], status)
        assert [found["cause"][row] for row in POISONED] == [
            "its worker was killed by SIGKILL, 3 times",
            "timed out: no progress for 2 s",
            "its worker was killed by SIGSEGV, 3 times",
            "its worker was killed by SIGKILL, 3 times",
            "timed out: no progress for 2 s",
        ]
        assert set(found["cause"][status == DONE]) == {""}
        assert not found["n_valid"][POISONED].any() and np.isnan(found["end"][POISONED]).all()
        assert found["initial.hinge.qd"][1234] == pytest.approx(0.35)

    def test_the_verdict_lists_them_by_cause(self, ran: tuple[Path, int, str]) -> None:
        (summary,) = batch.look(ran[0]).summaries
        assert (summary.cases, summary.failed, summary.ok) == (10_000, 105, False)
        assert [(failure.status, failure.cases) for failure in summary.failures] == [
            ("failed", tuple(DIVERGE)),
            ("lost", (1234, 7777)),
            ("timed out", (2500, 9001)),
            ("lost", (4321,)),
        ]

    def test_the_exit_status_is_1_and_the_words_say_why(self, ran: tuple[Path, int, str]) -> None:
        _, status, said = ran
        assert status == 1
        assert "\n9,895 of 10,000 cases reached their end, 105 failed, " in said
        assert said.endswith("\nexit 1: 105 cases failed\n")
        self.lists_all(said)

    def test_met_show_lists_them(self, ran: tuple[Path, int, str]) -> None:
        status, said = told(["show", str(ran[0])])
        assert status == 0
        assert "\n9,895 of 10,000 cases reached their end, 105 failed\n" in said
        self.lists_all(said)

    def lists_all(self, said: str) -> None:
        flat = " ".join(said.split())
        assert ", ".join(f"#{row}" for row in DIVERGE) in flat
        assert "2 cases timed out: no progress for 2 s (#2500) #2500, #9001" in flat
        assert "2 cases lost: its worker was killed by SIGKILL, 3 times (#1234) #1234, #7777" in flat
        assert re.search(r"#4321 [0-9a-f]{8} lost: its worker was killed by SIGSEGV, 3 times", flat)

    def test_json_lists_them(self, ran: tuple[Path, int, str], tmp_path: Path) -> None:
        words = ["run", str(ran[0].with_name("door.ic")), "-o", str(ran[0]), "--no-picture", "--format", "json"]
        status, said = told(words)  # nothing is missing
        (experiment,) = json.loads(said)["experiments"]
        assert status == 1
        assert sorted(row for failure in experiment["failures"] for row in failure["cases"]) == sorted(
            [*POISONED, *DIVERGE]
        )

    @pytest.mark.release
    @pytest.mark.parametrize("row", [1235, 99])
    def test_a_case_is_run_again_with_the_same_bits(
        self, ran: tuple[Path, int, str], undisturbed: Path, here: Path, row: int
    ) -> None:
        name = values(ran[0], ("case_id",))["case_id"][row]
        status, said = told(["run", str(ran[0]), "--case", name, "--no-picture"])
        assert status == (1 if row in DIVERGE else 0)
        assert said.endswith(f"\nthe same bits as in {ran[0]}\n")
        again, before = values(here / f"a.case{row}.h5"), values(undisturbed)
        for variable in ("q", "qd", "end", "fast", "case_id", "cause", "status", "n_valid"):
            assert alike(before[variable][[row]], again[variable]), variable

    def test_all_that_failed_are_run_again(self, ran: tuple[Path, int, str], undisturbed: Path, here: Path) -> None:
        status, said = told(["run", str(ran[0]), "--failed", "--no-picture"])
        again, before = values(here / "a.failed.h5"), values(undisturbed)
        rows = sorted([*POISONED, *DIVERGE])
        assert again["case"].tolist() == again["recorded_case"].tolist() == rows
        assert [rows[place] for place in np.flatnonzero(again["status"] == DONE)] == POISONED
        for variable in ("q", "qd", "end", "fast", "case_id", "cause", "status", "n_valid"):
            assert alike(before[variable][rows], again[variable]), variable
        assert status == 1
        assert said.endswith(f"\nexit 1: 100 cases failed\nthe same bits as in {ran[0]}\n")


# A few


@pytest.mark.slow
def test_what_is_run_again_does_not_go_over_its_archive(here: Path) -> None:
    path = batch.run(small(here), output="a.h5").path
    before = path.read_bytes()
    told(["run", "a.h5", "--case", "#7", "-o", "a.h5", "--no-picture"])
    assert path.read_bytes() == before


def test_causes_of_two_joints_are_two_causes() -> None:
    causes = np.array([f"t = 0.{n} s: joint axis_{n}: something (d.ic:{n})" for n in (1, 2)], object)
    found = failures(np.array([FAILED, FAILED]), causes, np.array([3, 4]), np.array(["a", "b"], object))
    assert [failure.cases for failure in found] == [(3,), (4,)]


def test_causes_that_differ_in_their_time_are_one() -> None:
    causes = np.array([f"t = {time} s: joint hinge: something (d.ic:7)" for time in ("0.1", "1e-05")], object)
    found = failures(np.array([FAILED, FAILED]), causes, np.array([3, 4]), np.array(["a", "b"], object))
    assert [(failure.cause, failure.cases) for failure in found] == [(causes[0], (3, 4))]


def small(folder: Path) -> Plan:
    """Two hundred cases, of which two diverge."""
    return compiled(folder, 2)


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks of twenty cases, worth keeping."""
    monkeypatch.setattr(tasks, "MOST_CASES", 20)
    monkeypatch.setattr(performing, "WORTH_SECONDS", 0.0)


def stopped(plan: Plan, output: Path, **options: Any) -> str:
    with pytest.raises(Problem) as caught:
        batch.run(plan, output=output, **options)
    return render(caught.value.diagnostics)


@pytest.mark.usefixtures("kept")
class TestSoManyMayFail:
    @pytest.mark.slow
    def test_more_stop_it_and_what_is_done_is_kept(self, here: Path) -> None:
        (here / "out").mkdir()
        plan, path = small(here), here / "out" / "a.h5"
        assert stopped(plan, path, threads=1, max_failures=1) == (
            "error[E355]: 2 cases failed, more than the 1 allowed\n"
            f" = help: what is done is kept in {path}.campaign: the same command goes on, with a larger "
            "`--max-failures`\n"
            "\n1 error\n"
        )
        held = whole.shards(path)
        assert held and not path.exists()
        rest = whole.Watched()
        batch.run(plan, output=path, executor=rest)
        assert not held.keys() & set(rest.names)
        alone = batch.run(plan, output=here / "b.h5", threads=1)
        assert path.read_bytes() == alone.path.read_bytes()

    @pytest.mark.slow
    def test_the_command_ends_with_1(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        deck(here, 2)
        words = ["run", "door.ic", "-o", "a.h5", "--no-picture", "--threads", "1", "--max-failures"]
        assert cli.main([*words, "1"]) == 1
        assert "error[E355]: 2 cases failed, more than the 1 allowed\n" in capsys.readouterr().err
        assert not Path("a.h5").exists()
        assert cli.main([*words, "2"]) == 1
        assert "\nexit 1: 2 cases failed\n" in capsys.readouterr().out

    def test_as_many_as_allowed_are(self, here: Path) -> None:
        assert batch.run(small(here), output="a.h5", threads=1, max_failures=2).summaries[0].failed == 2

    def test_none_may_fail(self, here: Path) -> None:
        assert stopped(small(here), here / "a.h5", threads=1, max_failures=0).startswith("error[E355]: 1 case")

    def test_a_case_that_is_run_again_for_its_history_failed_once(self, here: Path) -> None:
        batch.run(small(here), output="a.h5", threads=1, max_failures=2, histories="failed")

    @pytest.mark.slow
    def test_a_case_that_two_shards_hold_failed_once(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        plan = small(here)
        with pytest.raises(KeyboardInterrupt):
            batch.run(plan, output="a.h5", executor=whole.Watched(after=7))
        shards = whole.folder_of(Path("a.h5")).shards
        shards.rename("aside")
        monkeypatch.setattr(tasks, "MOST_CASES", 30)
        with pytest.raises(KeyboardInterrupt):
            batch.run(plan, output="a.h5", executor=whole.Watched(after=5))
        for path in Path("aside").iterdir():
            path.rename(shards / path.name)
        batch.run(plan, output="a.h5", threads=1, max_failures=2)

    def test_the_same_command_stops_again_at_once(self, here: Path) -> None:
        plan, path = small(here), here / "a.h5"
        stopped(plan, path, threads=1, max_failures=1)
        held = whole.shards(path)
        stopped(plan, path, threads=1, max_failures=1)
        assert whole.shards(path) == held


@pytest.mark.slow
class TestWorkers:
    """Few cases, and what their workers die of."""

    def test_the_worker_of_one_case_alone(self, here: Path) -> None:
        archive = batch.run(plans.plan(plans.gains(1)), output="a.h5", executor=Poisoned(row_0="SIGTERM"))
        (failure,) = archive.summaries[0].failures
        assert (failure.status, failure.cause) == ("lost", "its worker was killed by SIGTERM, 3 times")

    @pytest.mark.release
    def test_all_cases_kill_their_worker(self, here: Path) -> None:
        poison = {f"row_{row}": "SIGKILL" for row in range(4)}
        archive = batch.run(plans.plan(plans.gains(4)), output="a.h5", executor=Poisoned(**poison))
        assert [f.cases for f in archive.summaries[0].failures] == [(0, 1, 2, 3)]
        assert np.isnan(values(archive.path)["qd"]).all()

    @pytest.mark.release
    def test_a_lost_case_may_be_run_again_for_its_history(self, here: Path) -> None:
        archive = batch.run(
            plans.plan(plans.gains(40)), output="a.h5", executor=Poisoned(row_7="SIGKILL"), histories="failed"
        )
        assert values(archive.path, ("recorded_case",))["recorded_case"].tolist() == [7]
        assert np.isnan(values(archive.path, ("qd",))["qd"]).all()

    @pytest.mark.release
    def test_a_case_that_was_lost_and_then_is_not(self, here: Path) -> None:
        poison = Poisoned(row_7="SIGKILL", section=0)
        archive = batch.run(plans.plan(plans.gains(40)), output="a.h5", executor=poison, histories="failed")
        assert archive.summaries[0].failed == 1
        assert np.isnan(values(archive.path, ("qd",))["qd"]).all()

    def test_a_slow_disk_is_no_case_without_an_end(self, here: Path) -> None:
        archive = batch.run(plans.plan(plans.gains(4)), output="a.h5", executor=Poisoned(timeout=0.5, fsync=1.0))
        assert archive.summaries[0].failed == 0

    @pytest.mark.release
    @pytest.mark.usefixtures("kept")
    def test_a_disk_that_is_full_for_a_worker(self, here: Path) -> None:
        plan, path = small(here), here / "a.h5"
        assert stopped(plan, path, executor=Poisoned(full=2)) == (
            f"error[E354]: the campaign cannot go on: cannot keep what was computed in {path}.campaign: no space left "
            "on device\n"
            f" = help: what is done is kept in {path}.campaign: the same command goes on\n"
            "\n1 error\n"
        )
        held = whole.shards(path)
        rest = whole.Watched(Processes(2))
        batch.run(plan, output=path, executor=rest)
        assert held and not held.keys() & set(rest.names)
        assert path.read_bytes() == batch.run(plan, output=here / "b.h5", threads=1).path.read_bytes()

    @pytest.mark.parametrize(
        ("number", "why"),
        [
            (errno.ENOMEM, "cannot allocate memory; fewer processes may do"),
            (errno.EAGAIN, "resource temporarily unavailable; fewer processes may do"),
            (
                errno.EMFILE,
                "too many open files; `ulimit -n` allows 77 open files: allow more in the shell that runs it, "
                "or use fewer processes",
            ),
            (errno.EACCES, "permission denied"),
        ],
    )
    def test_a_process_that_cannot_be_had_is_no_fault_of_the_archive(
        self, here: Path, monkeypatch: pytest.MonkeyPatch, number: int, why: str
    ) -> None:
        def refuse(*_: Any, **__: Any) -> Any:
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr("batch.executors.child.subprocess.Popen", refuse)
        monkeypatch.setattr("batch.campaigns.output.resource.getrlimit", lambda _: (77, 77))
        assert stopped(plans.plan(plans.gains(4)), here / "a.h5", executor=Processes(2)) == (
            f"error[E354]: the campaign cannot go on: a worker cannot be started: {why}\n"
            " = help: nothing was kept\n"
            "\n1 error\n"
        )

    def test_a_worker_that_cannot_start_is_told(self, here: Path) -> None:
        executor = Processes(2, command=("sh", "-c", "echo no such thing >&2; exit 9", "sh"))
        said = stopped(plans.plan(plans.gains(4)), here / "a.h5", executor=executor)
        assert said == (
            "error[E354]: the campaign cannot go on: a worker ended with status 9: no such thing\n"
            " = help: nothing was kept\n"
            "\n1 error\n"
        )
        assert not whole.folder_of(here / "a.h5").path.exists()
