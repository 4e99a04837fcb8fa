"""The SLURM that other tests rely on: arrays, cancelling, jobs side by side; nothing of it outlives a test."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cluster.slurm import Slurm, SlurmFailed, cluster, processes

pytestmark = pytest.mark.cluster
ROOT = Path(__file__).parents[2]

# Says who it is, waits for the file `go`, and says that it came to its end.
TASK = """#!/bin/bash
echo "$SLURM_ARRAY_TASK_ID of $SLURM_ARRAY_TASK_COUNT on $SLURM_CPUS_ON_NODE core" > begun.$SLURM_ARRAY_TASK_ID
until [ -e go ]; do sleep 0.1; done
touch done.$SLURM_ARRAY_TASK_ID
"""

# Starts a cluster with a job that ignores SIGTERM and has left its session, says where, and waits to be killed.
KILLED = """
import sys, time
sys.path.insert(0, sys.argv[1])
from tests.cluster.slurm import cluster
with cluster() as slurm:
    slurm.run("sbatch", "--output=/dev/null", "--wrap", "trap '' TERM; setsid sleep 600 & touch begun; sleep 600")
    print(slurm.folder, flush=True)
    time.sleep(600)
"""


def until(holds: Callable[[], bool], seconds: float = 30.0) -> None:
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def submit(slurm: Slurm, folder: Path, text: str, *words: str) -> str:
    """The id of a job that runs a script in `folder`."""
    (folder / "job.sh").write_text(text)
    return slurm.run("sbatch", "--parsable", *words, "job.sh", cwd=folder).strip()


def running(slurm: Slurm, job: str) -> None:
    until(lambda: slurm.jobs()[job].state == "RUNNING")


def test_of_an_array_one_task_is_cancelled_and_the_others_end_well(slurm: Slurm, tmp_path: Path) -> None:
    array = submit(slurm, tmp_path, TASK, "--array=0-3")
    until(lambda: (tmp_path / "begun.0").exists() and (tmp_path / "begun.1").exists())
    slurm.cancel(f"{array}_1")
    assert slurm.wait(f"{array}_1")[f"{array}_1"].state == "CANCELLED"
    assert slurm.jobs()[f"{array}_0"].state == "RUNNING"
    (tmp_path / "go").touch()
    found = {job.id: job.state for job in slurm.wait(array).values()}
    ended = {0: "COMPLETED", 1: "CANCELLED", 2: "COMPLETED", 3: "COMPLETED"}
    assert found == {f"{array}_{task}": state for task, state in ended.items()}
    for task in (0, 2, 3):
        assert (tmp_path / f"begun.{task}").read_text() == f"{task} of 4 on 1 core\n"
    assert sorted(file.name for file in tmp_path.glob("done.*")) == ["done.0", "done.2", "done.3"]


def test_as_many_jobs_as_there_are_cores_run_side_by_side(slurm: Slurm, tmp_path: Path) -> None:
    array = submit(slurm, tmp_path, TASK, f"--array=1-{slurm.cores + 1}")
    until(lambda: len(list(tmp_path.glob("begun.*"))) == slurm.cores)
    states = sorted(job.state for job in slurm.jobs().values() if job.id.startswith(f"{array}_"))
    assert states == ["PENDING", *["RUNNING"] * slurm.cores]
    (tmp_path / "go").touch()
    assert {job.state for job in slurm.wait(array).values()} == {"COMPLETED"}


def test_a_job_says_how_it_ended(slurm: Slurm, tmp_path: Path) -> None:
    job = submit(slurm, tmp_path, "#!/bin/bash\nexit 3\n")
    (ended,) = slurm.wait(job).values()
    assert (ended.id, ended.state, ended.reason) == (job, "FAILED", "NonZeroExitCode")


def test_what_goes_wrong_is_told_with_the_logs(slurm: Slurm, tmp_path: Path) -> None:
    job = submit(slurm, tmp_path, "#!/bin/bash\nsleep 600\n")
    running(slurm, job)
    with pytest.raises(SlurmFailed, match=rf"^after 0 s job {job} has not ended: {job} RUNNING \(None\)\n") as late:
        slurm.wait(job, timeout=0.0)
    assert f"Launching batch job {job} for UID" in f"{late.value}"
    with pytest.raises(SlurmFailed, match=r"^there is no job 999999, only "):
        slurm.wait(999999)
    with pytest.raises(SlurmFailed, match=r"^`sbatch --partition=none --wrap true` ended with 1: sbatch: error: "):
        slurm.run("sbatch", "--partition=none", "--wrap", "true")


def test_each_test_begins_with_an_empty_queue(slurm: Slurm) -> None:
    """The test before this one left a job behind that runs."""
    assert all(job.ended for job in slurm.jobs().values())


def test_it_starts_twice_in_a_row_and_leaves_nothing(slurm: Slurm, tmp_path: Path) -> None:
    folders = set()
    for _ in range(2):
        with cluster(cores=3) as another:
            folders.add(another.folder)
            assert slurm.folder not in folders
            running(another, submit(another, tmp_path, "#!/bin/bash\nsleep 600\n"))
            assert len(processes(another.folder)) > 3
        assert not processes(another.folder) and not another.folder.exists()
    assert len(folders) == 2


@pytest.mark.parametrize("whom", ["the test", "the test and its keeper"])
def test_of_one_that_was_killed_nothing_is_left_for_the_next(slurm: Slurm, tmp_path: Path, whom: str) -> None:
    words = [sys.executable, "-c", KILLED, f"{ROOT}"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, cwd=tmp_path, text=True) as process:
        assert process.stdout is not None
        folder = Path(process.stdout.readline().strip())
        until((tmp_path / "begun").exists)
        if whom == "the test":
            process.kill()
        else:
            process.send_signal(signal.SIGSTOP)  # so that it cannot tidy up
            os.kill(keeper(folder), signal.SIGKILL)
            process.kill()
    if whom == "the test":
        until(lambda: not processes(folder) and not folder.exists())
    else:
        until(lambda: keeper_has_gone(folder))  # a signal is sent at once, and its process ends when it is scheduled
    with cluster() as another:
        until(lambda: not processes(folder) and not folder.exists())  # another test may sweep at the same time
        assert another.run("sinfo", "--noheader", "--format=%T").strip() == "idle"


def keeper(folder: Path) -> int:
    """The process id of a cluster's keeper."""
    (found,) = (pid for pid in processes(folder) if b"keeper.py\0" in Path(f"/proc/{pid}/cmdline").read_bytes())
    return found


def keeper_has_gone(folder: Path) -> bool:
    """Whether a cluster's keeper has ended: its lock is free, or another test has swept the folder away."""
    try:
        with (folder / "held").open() as held:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except FileNotFoundError:
        pass
    return True
