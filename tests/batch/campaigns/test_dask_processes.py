"""Campaigns on Dask as whole processes: schedulers, workers and drivers that are killed, that come, and that go."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

import batch
from met.plan import file as plan_file
from tests.batch import plans, whole

pytestmark = [pytest.mark.cluster, pytest.mark.slow]
CASES = 2_000


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The archive of a serial run on threads."""
    path = tmp_path_factory.mktemp("undisturbed") / "a.h5"
    return batch.run(plans.plan(whole.long(CASES)), output=path, threads=1).path.read_bytes()


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a driver that is killed leaves of a local cluster is left where tests leave things."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", f"{tmp_path / 'tmp'}")


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Where a campaign goes that takes seconds; its plan is `p.json` in the folder above."""
    plan_file.write(plans.plan(whole.long(CASES)), tmp_path / "p.json")
    (tmp_path / "out").mkdir()
    return tmp_path / "out" / "a.h5"


@pytest.fixture
def scheduler(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[subprocess.Popen[bytes]]:
    """A scheduler, whose file is `s.json`; its parameter says how many workers may die of a task."""
    allowed = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": str(getattr(request, "param", 3))}
    words = ["--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0", "--scheduler-file", "s.json"]
    with process("scheduler", *words, folder=tmp_path, environment=allowed) as started:
        whole.until((tmp_path / "s.json").exists)
        yield started


@contextlib.contextmanager
def process(
    *words: str, folder: Path, environment: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """`dask` with these words, in this folder; it does not outlive the block."""
    command = [sys.executable, "-m", "dask", *words]
    quiet = subprocess.DEVNULL
    given = {**os.environ, "PYTHONPATH": f"{whole.ROOT}", **(environment or {})}
    with subprocess.Popen(command, cwd=folder, stdout=quiet, stderr=quiet, env=given) as started:
        try:
            yield started
        finally:
            started.kill()


def worker(folder: Path) -> contextlib.AbstractContextManager[subprocess.Popen[bytes]]:
    """One more worker of the scheduler of this folder, one thread wide."""
    words = ["worker", "--scheduler-file", "s.json", "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    return process(*words, "--local-directory", "scratch", folder=folder)


def words(archive: Path, *cluster: str) -> list[str]:
    """Of `met`; without progress, so that what else is said stands alone."""
    ways = cluster or ("--dask", "local")
    return ["run", f"{archive.parents[1] / 'p.json'}", "-o", f"{archive}", "--no-picture", "--quiet", *ways]


def part_done(archive: Path) -> bool:
    return whole.done(archive, CASES) >= CASES / 3


@pytest.mark.release
def test_on_this_machine_the_same_bytes_as_on_threads(archive: Path, undisturbed: bytes) -> None:
    done = whole.met(words(archive), archive.parent, whole.SHORT_TASKS)
    assert (done.returncode, done.stderr) == (0, "")
    assert archive.read_bytes() == undisturbed
    assert whole.beside_it(archive) == ["a.h5", "a.h5.run.json"]
    cores = len(os.sched_getaffinity(0))
    workers = f'"workers": "Dask, 1 worker{f" with {cores} threads" if cores > 1 else ""}"'
    assert workers in archive.with_name("a.h5.run.json").read_text()


@pytest.mark.release
def test_a_local_child_that_is_killed_costs_nothing(archive: Path, undisturbed: bytes) -> None:
    with whole.started(words(archive), archive.parent, whole.SHORT_TASKS) as driver:
        whole.until(lambda: part_done(archive) and whole.workers(driver.pid), driver)
        os.kill(whole.workers(driver.pid)[0], signal.SIGKILL)
        _, err = driver.communicate(timeout=whole.PATIENCE_SECONDS)
    assert (driver.returncode, err) == (0, "")
    assert archive.read_bytes() == undisturbed
    assert whole.beside_it(archive) == ["a.h5", "a.h5.run.json"]


@pytest.mark.parametrize("scheduler", [3, 0], indirect=True, ids=["patient", "impatient"])
@pytest.mark.usefixtures("scheduler")
def test_workers_may_come_and_go(archive: Path, undisturbed: bytes, tmp_path: Path) -> None:
    with (
        worker(tmp_path) as first,
        whole.started(words(archive, "--dask", "../s.json"), archive.parent, whole.SHORT_TASKS) as driver,
    ):
        whole.until(lambda: part_done(archive), driver)
        first.kill()
        first.wait()  # then there is none
        with worker(tmp_path) as second, worker(tmp_path) as third:
            whole.until(lambda: whole.workers(second.pid) and whole.workers(third.pid), driver)
            _, err = driver.communicate(timeout=whole.PATIENCE_SECONDS)
            assert not whole.children(second.pid) and not whole.children(third.pid)
    assert driver.returncode == 0
    assert re.fullmatch(r"(Dask's scheduler at \S+ has no worker yet: waiting for one, 60 s at most\n)?", err)
    assert archive.read_bytes() == undisturbed
    assert '"workers": "Dask, 2 workers"' in archive.with_name("a.h5.run.json").read_text()


@pytest.mark.release
def test_where_the_scheduler_is_lost_what_is_done_is_kept(
    archive: Path, undisturbed: bytes, tmp_path: Path, scheduler: subprocess.Popen[bytes]
) -> None:
    with (
        worker(tmp_path) as theirs,
        whole.started(words(archive, "--dask", "../s.json"), archive.parent, whole.SHORT_TASKS) as driver,
    ):
        whole.until(lambda: part_done(archive), driver)
        scheduler.kill()
        _, err = driver.communicate(timeout=whole.PATIENCE_SECONDS)
        theirs.wait(timeout=whole.PATIENCE_SECONDS)  # a worker ends without its scheduler
    assert driver.returncode == 2
    assert err.endswith(
        "error[E354]: the campaign cannot go on: the connection to Dask's scheduler was lost\n"
        f" = help: what is done is kept in {archive}.campaign: the same command goes on\n"
        "\n1 error\n"
    )
    assert whole.met(words(archive, "--threads", "2"), archive.parent).returncode == 0
    assert archive.read_bytes() == undisturbed


@pytest.mark.release
@pytest.mark.parametrize("name", ["INT", "TERM", "KILL"])
def test_whatever_ends_the_driver_ends_its_cluster(archive: Path, name: str) -> None:
    own_session = f"import os\nos.setsid()\n{whole.MET}"
    with whole.started(words(archive), archive.parent, whole.SHORT_TASKS, own_session) as driver:
        whole.until(lambda: part_done(archive) and whole.workers(driver.pid), driver)
        theirs = whole.workers(driver.pid)
        if name == "INT":
            os.killpg(driver.pid, signal.SIGINT)  # as a terminal does it
        else:
            driver.send_signal(signal.Signals[f"SIG{name}"])
        _, said = driver.communicate(timeout=whole.PATIENCE_SECONDS)
    whole.until(lambda: all(map(whole.dead, theirs)))
    assert driver.returncode == {"INT": 130, "TERM": 143, "KILL": -9}[name]
    assert whole.beside_it(archive) == ["a.h5.campaign"]
    if name != "KILL":
        kept = f"{whole.done(archive, CASES):,} of {CASES:,} cases are kept in {archive}.campaign"
        last = {"INT": "interrupted", "TERM": "terminated"}[name]
        assert said == f"\n{kept}; the same command goes on\n\nmet: {last}\n"


@pytest.mark.release
@pytest.mark.usefixtures("scheduler")
def test_a_driver_that_is_killed_leaves_nothing_on_the_workers_of_others(archive: Path, tmp_path: Path) -> None:
    with worker(tmp_path) as theirs:
        with whole.started(words(archive, "--dask", "../s.json"), archive.parent, whole.SHORT_TASKS) as driver:
            whole.until(lambda: part_done(archive), driver)
            driver.kill()
            driver.communicate()
        whole.until(lambda: not whole.workers(theirs.pid))
        done = whole.met(words(archive, "--dask", "../s.json"), archive.parent, whole.SHORT_TASKS)
        assert (done.returncode, done.stderr, theirs.poll()) == (0, "", None)


@pytest.mark.release
def test_a_script_needs_no_guard_for_it_is_not_run_again(tmp_path: Path) -> None:
    plan_file.write(plans.plan(plans.gains(9)), tmp_path / "p.json")
    text = 'import batch\nbatch.run("p.json", output="a.h5", dask="local")\nprint("once")\n'
    (tmp_path / "script.py").write_text(text)
    environment = {**os.environ, "PYTHONPATH": f"{whole.ROOT}"}
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=environment,
        timeout=whole.PATIENCE_SECONDS,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "once\n", "")
    assert whole.beside_it(tmp_path / "a.h5") == ["a.h5", "a.h5.run.json", "p.json", "script.py", "tmp"]
