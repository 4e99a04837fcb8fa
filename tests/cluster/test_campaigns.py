"""Campaigns by a real SLURM: a job array that is cancelled in part and submitted again, and Dask's workers as jobs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import batch
from met.plan import file as plan_file
from tests.batch import plans
from tests.cluster.slurm import Slurm

pytestmark = pytest.mark.cluster
ROOT = Path(__file__).parents[2]
CASES, TICKS = 60_000, 20_000  # about 12 s of work for one core


def met(slurm: Slurm, *words: str, cwd: Path, status: int = 0) -> str:
    """What the command says, in a shell that has SLURM's commands."""
    environment = {**slurm.environment, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "met.cli", *words]
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


def numbers(said: str) -> tuple[str, str]:
    """Of the array and of the job that merges."""
    data = json.loads(said)
    return data["array"], data["end"]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes]:
    """A plan file, and the bytes of its archive as threads here make it."""
    folder = tmp_path_factory.mktemp("here")
    plan = plans.plan(plans.gains(CASES, ticks=TICKS))
    plan_file.write(plan, folder / "p.json")
    made = batch.run(plan, output=folder / "a.h5", histories=["every:10000", "worst:3:volts"])
    return folder / "p.json", made.path.read_bytes()


def until(holds: Any, seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def under_way(folder: Path, job: int) -> bool:
    """Whether a job has done some of its share, and not all of it."""
    try:
        told = json.loads((folder / f"status.{job}.json").read_text())
    except (OSError, ValueError):
        return False
    return told["state"] == "running" and told.get("section_done", 0) > told.get("at_first", 0)


KEPT = ("--histories", "every:10000", "--histories", "worst:3:volts")


@pytest.mark.release
def test_an_array_of_which_a_job_is_cancelled_midway_goes_on_when_it_is_submitted_again(
    slurm: Slurm, tmp_path: Path, campaign: tuple[Path, bytes]
) -> None:
    plan, bytes_here = campaign
    folder = tmp_path / "a.h5.campaign"
    words = ("submit", "--slurm", str(plan), "-o", "a.h5", "--jobs", "4", *KEPT, "--format", "json")
    array, end = numbers(met(slurm, *words, cwd=tmp_path))
    until(lambda: under_way(folder, 1))
    slurm.cancel(f"{array}_1")
    assert slurm.wait(f"{array}_1")[f"{array}_1"].state == "CANCELLED"
    assert slurm.wait(end)[end].state == "FAILED"
    log = (folder / "logs" / f"{end}.log").read_text()
    assert "cases are missing" in log
    said = met(slurm, "status", "a.h5", cwd=tmp_path, status=1)
    assert "nobody is at work" in said
    done = {path.name: path.stat().st_mtime_ns for path in (folder / "shards").iterdir()}

    array, end = numbers(met(slurm, *words, cwd=tmp_path))
    jobs = slurm.wait(array)
    assert jobs and all(job.state == "COMPLETED" for job in jobs.values())
    assert slurm.wait(end)[end].state == "COMPLETED"
    assert done, "the first array had done nothing"
    assert (tmp_path / "a.h5").read_bytes() == bytes_here
    assert not folder.exists()
    assert "is whole" in met(slurm, "status", "a.h5", cwd=tmp_path)


@pytest.mark.release
def test_what_is_left_of_an_array_is_run_here_by_met_run(
    slurm: Slurm, tmp_path: Path, campaign: tuple[Path, bytes]
) -> None:
    plan, bytes_here = campaign
    words = (str(plan), "-o", "a.h5", *KEPT)
    array, end = numbers(met(slurm, "submit", "--slurm", "--jobs", "3", "--format", "json", *words, cwd=tmp_path))
    until(lambda: under_way(tmp_path / "a.h5.campaign", 0))
    refused = met(slurm, "run", *words, cwd=tmp_path, status=2)
    assert "another run is writing it now" in refused
    slurm.cancel(end)
    slurm.cancel(array)
    slurm.wait(array)
    said = met(slurm, "run", *words, "--no-picture", cwd=tmp_path)
    assert "goes on: " in said
    assert (tmp_path / "a.h5").read_bytes() == bytes_here


def test_words_for_sbatch_are_passed_on_and_its_refusal_is_told(
    slurm: Slurm, tmp_path: Path, campaign: tuple[Path, bytes]
) -> None:
    plan, _ = campaign
    words = ("submit", "--slurm", str(plan), "-o", "a.h5", "--sbatch=--partition=nowhere")
    said = met(slurm, *words, cwd=tmp_path, status=2)
    assert "error[E358]: sbatch refuses the job: " in said and "partition" in said


@pytest.mark.release
def test_dask_workers_that_slurm_started_give_the_same_bytes(
    slurm: Slurm, tmp_path: Path, campaign: tuple[Path, bytes]
) -> None:
    plan, bytes_here = campaign
    python, environment = sys.executable, {**slurm.environment, "PYTHONPATH": str(ROOT)}
    scheduler = subprocess.Popen(
        [python, "-m", "distributed.cli.dask_scheduler", "--scheduler-file", "dask.json", "--port", "0",
         "--no-dashboard"], cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        until(lambda: (tmp_path / "dask.json").exists())
        worker = f"exec {python} -m distributed.cli.dask_worker --scheduler-file dask.json --nthreads 1 --no-dashboard"
        script = f"#!/bin/sh\nexport PYTHONPATH={ROOT}\n{worker}\n"
        (tmp_path / "worker.sh").write_text(script)
        slurm.run("sbatch", "--array=0-1", "--output=worker.%a.log", "worker.sh", cwd=tmp_path)
        address = json.loads((tmp_path / "dask.json").read_text())["address"]
        met(slurm, "run", str(plan), "-o", "a.h5", "--no-picture", "--dask", address, *KEPT, cwd=tmp_path)
        assert (tmp_path / "a.h5").read_bytes() == bytes_here
    finally:
        scheduler.kill()
        scheduler.wait()
    assert os.path.exists(tmp_path / "worker.0.log")
