"""Campaigns on Dask: the same bytes, whatever becomes of its workers; what is missing there is told in words."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from distributed import Client, LocalCluster, Reschedule

import batch
from batch.campaigns.campaign import prepare, values_sections
from batch.campaigns.drive import Outcome
from batch.campaigns.folder import Folder, beside
from batch.campaigns.tasks import CampaignSection, Task
from batch.executors import dask as executor
from batch.executors import dask_connection, dask_worker
from batch.executors.child import Crew
from batch.executors.choose import choose
from batch.executors.dask import Dask
from met.diagnostic import Problem
from met.version import VERSION
from tests.batch import plans, whole
from tests.batch.refusals import refused

HOST = os.uname().nodename


@contextlib.contextmanager
def cluster(folder: Path, workers: int = 1, threads: int = 1) -> Iterator[LocalCluster]:
    """A scheduler that can be reached from anywhere on this machine, and workers, all in this process."""
    with LocalCluster(
        n_workers=workers,
        threads_per_worker=threads,
        processes=False,
        protocol="tcp://",
        memory_limit=0,
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
        local_directory=str(folder / "scratch"),
        silence_logs=logging.CRITICAL,
    ) as started:
        yield started


@pytest.fixture
def many(tmp_path: Path) -> tuple[Folder, dict[int, CampaignSection]]:
    """The folder of a small campaign, described as for workers."""
    campaign = prepare(plans.plan(plans.gains(96)), output=tmp_path / "a.h5")
    sections = {section.number: section for section in values_sections(campaign)}
    folder = Folder(beside(campaign.output))
    folder.path.mkdir()
    folder.describe(campaign.plan, sections.values(), key="", archive="a.h5", histories=["all"], float32=False)
    return folder, sections


def outcome(
    dask: Dask, many: tuple[Folder, dict[int, CampaignSection]], meanwhile: Callable[[], object] = int
) -> Outcome:
    """What comes of the first task. meanwhile: called before it is submitted."""
    dask.open(*many, lambda: None)
    try:
        meanwhile()
        dask.submit(Task(0, 0, 32))
        (found,) = dask.wait()
        assert not dask.wait()
        return found
    finally:
        dask.close()


class TestWhatItIsCalled:
    def test_processes_and_dask_are_two_ways(self) -> None:
        with pytest.raises(Problem) as caught:
            choose(dask="local", processes=2)
        assert refused(caught) == (
            "error[E356]: `--processes` and `--dask` are two ways to run a campaign\n"
            " = help: Dask's processes are its own; `--dask local` has as many at work as there are cores\n"
            "\n1 error\n"
        )

    def test_a_number_calls_no_cluster(self) -> None:
        with pytest.raises(TypeError) as caught:
            choose(dask=8786)
        assert str(caught.value) == 'dask is the address of a scheduler, "local" or a Client, and not int'

    @pytest.mark.slow
    @pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense", "http://example.org", "", "tcp://"])
    def test_where_no_scheduler_answers(self, many: Any, address: str, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(dask_connection, "CONNECT_SECONDS", 0.3)
        with pytest.raises(Problem) as caught:
            Dask(address).open(*many, lambda: None)
        assert refused(caught) == (
            f"error[E356]: no Dask scheduler answers at `{address}`\n"
            " = help: `dask scheduler` starts one, and says its address\n"
            "\n1 error\n"
        )

    def test_a_scheduler_file_that_is_not_there(self, many: Any, here: Path) -> None:
        with pytest.raises(Problem) as caught:
            Dask("s.json").open(*many, lambda: None)
        assert refused(caught) == (
            "error[E356]: cannot read the Dask scheduler file s.json: no such file or directory\n"
            " = help: `dask scheduler --scheduler-file s.json` writes it\n"
            "\n1 error\n"
        )

    def test_a_pipe_in_the_place_of_a_scheduler_file_is_not_waited_for(self, many: Any, here: Path) -> None:
        os.mkfifo("s.json")
        with pytest.raises(Problem) as caught:
            Dask("s.json").open(*many, lambda: None)
        assert refused(caught).startswith(
            "error[E356]: cannot read the Dask scheduler file s.json: it is a named pipe, not a regular file\n"
        )

    @pytest.mark.slow
    @pytest.mark.parametrize("text", ["", "[]", "{}", "\udcff", '{"a":' * 50_000])
    def test_a_file_that_is_no_schedulers(self, many: Any, here: Path, text: str) -> None:
        Path("s.json").write_bytes(text.encode(errors="surrogateescape"))
        with pytest.raises(Problem) as caught:
            Dask(Path("s.json")).open(*many, lambda: None)
        assert refused(caught) == (
            "error[E356]: s.json is no scheduler file of Dask\n"
            " = help: `dask scheduler --scheduler-file FILE.json` writes one\n"
            "\n1 error\n"
        )

    def test_a_client_that_is_closed(self, many: Any, tmp_path: Path) -> None:
        with cluster(tmp_path, workers=0) as started, Client(started, set_as_default=False) as client:
            pass
        with pytest.raises(Problem) as caught:
            Dask(client).open(*many, lambda: None)
        assert caught.value.diagnostics[0].message == "the Dask client is closed"

    def test_nothing_is_started_before_it_is_needed(self) -> None:
        before = whole.children(os.getpid())
        Dask("local").close()
        assert whole.children(os.getpid()) == before

    @pytest.mark.slow
    def test_commands_that_need_no_cluster_do_not_load_it(self) -> None:
        program = "import sys, batch.cli.show, batch.executors.dask; print('distributed' in sys.modules)"
        words = [sys.executable, "-c", program]
        assert subprocess.run(words, capture_output=True, text=True, cwd=whole.ROOT).stdout == "False\n"


class TestWorkersThatCannotServe:
    def test_none_at_all(
        self, many: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(executor, "WORKER_SECONDS", 0.3)
        with cluster(tmp_path, workers=0) as started:
            address = started.scheduler_address
            with pytest.raises(Problem) as caught:
                Dask(address).open(*many, lambda: None)
        assert refused(caught) == (
            "error[E356]: Dask's scheduler has had no worker for 0.3 s\n"
            f" = help: `dask worker {address}` starts one, where MET is installed and this folder is seen\n"
            "\n1 error\n"
        )
        said = f"Dask's scheduler at {address} has no worker yet: waiting for one, 0.3 s at most\n"
        assert capsys.readouterr().err == said

    def test_one_that_does_not_see_the_folder(self, many: Any, tmp_path: Path) -> None:
        folder = many[0].path

        def elsewhere() -> None:  # as if the worker had a folder of that name on a disk of its own
            (mark,) = folder.glob(".met-*")
            mark.unlink()

        with cluster(tmp_path) as started:
            found = outcome(Dask(started.scheduler_address), many, elsewhere)
        why = f"{HOST} does not see {folder}: put the archive where all hosts see it under the same name (`-o`)"
        assert found == Outcome(Task(0, 0, 32), "broken", why=why)

    def test_one_without_met(self, many: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def lose() -> None:
            monkeypatch.setitem(sys.modules, "batch.executors.dask_worker", None)

        with cluster(tmp_path) as started:
            found = outcome(Dask(started.scheduler_address), many, lose)
        assert found.kind == "broken"
        assert found.why == (
            f"{HOST} has no MET {VERSION} where its Dask worker runs (import of batch.executors.dask_worker halted; "
            "None in sys.modules): install it there"
        )

    def test_one_with_another_version_of_met(self, many: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(executor, "VERSION", "0.0.9")
        with cluster(tmp_path) as started:
            found = outcome(Dask(started.scheduler_address), many)
        assert found.kind == "broken"
        assert found.why == f"{HOST} has MET {VERSION}, and not 0.0.9: install that where its Dask worker runs"

    @pytest.mark.slow
    def test_one_with_other_code_of_the_same_version(self, many: Any, tmp_path: Path) -> None:
        folder, sections = many
        ours = {0: replace(sections[0], single=True)}  # so that the same cases have another key here
        with cluster(tmp_path) as started:
            found = outcome(Dask(started.scheduler_address), (folder, ours))
        assert found.kind == "broken"
        assert found.why == f"{HOST} has other code of MET {VERSION}, or other models: install the same everywhere"

    @pytest.mark.slow
    def test_one_that_cannot_write(self, many: Any, tmp_path: Path) -> None:
        folder = many[0]
        with cluster(tmp_path) as started:
            found = outcome(Dask(started.scheduler_address), many, folder.shards.rmdir)
        assert found.kind == "broken"
        assert found.why.startswith(f"on {HOST}, cannot keep what was computed in {folder.path}")
        assert found.why.endswith(": no such file or directory")

    @pytest.mark.slow
    def test_one_that_fails_at_dask_itself(self, many: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(executor, "CALL", "1 / 0")
        with cluster(tmp_path) as started:
            found = outcome(Dask(started.scheduler_address), many)
        assert (found.kind, found.why) == ("broken", "Dask cannot run a task: division by zero")

    @pytest.mark.slow
    def test_a_campaign_stops_with_these_words(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(executor, "VERSION", "0.0.9")
        with cluster(here) as started, pytest.raises(Problem) as caught:
            batch.run(plans.plan(plans.gains(9)), output="a.h5", dask=started.scheduler_address)
        assert refused(caught) == (
            f"error[E354]: the campaign cannot go on: {HOST} has MET {VERSION}, and not 0.0.9: install that where its "
            "Dask worker runs\n = help: nothing was kept\n\n1 error\n"
        )


POISONED = """
import os, signal, sys, time
from batch.campaigns import tasks
from batch.executors import worker
carry_out = tasks.carry_out
def poisoned(section, task, *words, **more):
    rows = set(section.rows[task.first : task.last])
    if 5 in rows:
        os.kill(os.getpid(), signal.SIGKILL)
    if 40 in rows:
        time.sleep(3600)
    return carry_out(section, task, *words, **more)
tasks.carry_out = poisoned
worker.main(sys.argv[1:])
"""
"""A worker for which case 5 is deadly, and case 40 never ends."""


@pytest.fixture
def poisoned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask workers in this process have such children."""

    def crew(*words: Any, **more: Any) -> Crew:
        return Crew(*words, **more, command=(sys.executable, "-c", POISONED))

    monkeypatch.setattr(dask_worker, "Crew", crew)


def listening() -> set[str]:
    """Sockets of this process to which another may connect."""
    mine = set()
    for number in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):
            mine.add(os.readlink(f"/proc/self/fd/{number}"))
    lines = [line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/net/{name}").read_text().splitlines()]
    return {words[1] for words in lines if words[3] == "0A" and f"socket:[{words[9]}]" in mine}


class TestInThisProcess:
    def test_a_local_one_can_be_reached_by_nobody_else(self) -> None:
        before = listening()
        with dask_connection.dask_client("local", threads=1) as client:
            assert client.scheduler.address.startswith("inproc://") and client.submit(abs, -1).result() == 1
            assert listening() == before

    @pytest.mark.release
    def test_the_same_bytes_as_with_threads(self, here: Path) -> None:
        plan = plans.plan(plans.nominal(), plans.gains(100))
        expected = batch.run(plan, output="t.h5", threads=1).path.read_bytes()
        with cluster(here, workers=2) as started:
            archive = batch.run(plan, output="a.h5", dask=started.scheduler_address)
        assert archive.path.read_bytes() == expected
        assert '"workers": "Dask, 2 workers"' in Path("a.h5.run.json").read_text()
        assert not whole.workers(os.getpid())

    @pytest.mark.release
    def test_a_client_that_the_user_made_stays_open_and_nothing_of_ours_on_its_workers(self, here: Path) -> None:
        with cluster(here, workers=1, threads=2) as started, Client(started, set_as_default=False) as client:
            (worker,) = (each for each in started.workers.values())
            before = set(worker.plugins)
            batch.run(plans.plan(plans.gains(100)), output="a.h5", dask=client)
            assert client.submit(abs, -1).result() == 1
            assert set(worker.plugins) == before and not whole.workers(os.getpid())
        assert '"workers": "Dask, 1 worker with 2 threads"' in Path("a.h5.run.json").read_text()

    @pytest.mark.release
    @pytest.mark.usefixtures("poisoned")
    def test_a_case_that_kills_or_hangs_takes_down_a_child_and_no_worker(self, here: Path) -> None:
        with cluster(here) as started:
            (worker,) = started.workers.values()
            archive = batch.run(plans.plan(plans.gains(96)), output="a.h5", dask=started.scheduler_address, timeout=1.0)
            assert list(started.workers.values()) == [worker] and worker.status.name == "running"
        with archive.open() as data:
            assert {int(case): str(data.cause.values[case]) for case in data.case[data.status.values != 0]} == {
                5: "its worker was killed by SIGKILL, 3 times",
                40: "timed out: no progress for 1 s",
            }

    @pytest.mark.usefixtures("poisoned")
    def test_closing_stops_a_case_that_hangs(self, many: Any, tmp_path: Path) -> None:
        before = set(whole.children(os.getpid()))
        with cluster(tmp_path) as started:
            dask = Dask(started.scheduler_address)
            dask.open(*many, lambda: None)
            dask.submit(Task(0, 40, 41))
            whole.until(lambda: len(set(whole.children(os.getpid())) - before) == 1)
            dask.close()
            whole.until(lambda: set(whole.children(os.getpid())) == before)
            whole.until(lambda: not [n for worker in started.workers.values() for n in worker.plugins if "met" in n])

    @pytest.mark.slow
    @pytest.mark.usefixtures("poisoned")
    def test_a_driver_that_is_gone_leaves_no_child(
        self, many: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(Dask, "_tell_all", lambda *_: None)  # one that is killed says nothing
        before = set(whole.children(os.getpid()))
        with cluster(tmp_path) as started:
            dask = Dask(started.scheduler_address)
            dask.open(*many, lambda: None)
            dask.submit(Task(0, 40, 41))
            whole.until(lambda: len(set(whole.children(os.getpid())) - before) == 1)
            dask.close()
            whole.until(lambda: set(whole.children(os.getpid())) == before)

    def test_a_worker_that_is_closing_takes_on_no_children(self, many: Any, tmp_path: Path) -> None:
        order = {"folder": str(many[0].path), "campaign": "met-late", "key": "late", "threads": 1, "timeout": None}
        with cluster(tmp_path) as started:
            (worker,) = started.workers.values()
        with pytest.raises(Reschedule):
            asyncio.run(dask_worker.WorkerChildren.on(worker, order))
        assert not [name for name in worker.plugins if "met" in name]

    @pytest.mark.release
    def test_children_that_get_nothing_to_do_go_home(
        self, many: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(dask_worker, "IDLE_SECONDS", 0.2)
        monkeypatch.setattr(dask_worker, "LOOK_SECONDS", 0.05)
        before = set(whole.children(os.getpid()))
        with cluster(tmp_path) as started:
            dask = Dask(started.scheduler_address)
            dask.open(*many, lambda: None)
            for first in (0, 32):  # others come, where there is something to do again
                dask.submit(Task(0, first, first + 32))
                assert [found.kind for found in dask.wait()] == ["done"]
                whole.until(lambda: set(whole.children(os.getpid())) == before)
            dask.close()
