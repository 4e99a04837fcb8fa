"""`met submit --slurm`: a campaign as a job array, each job with a share of its cases, and a job that merges them."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

from batch.campaigns import resuming
from batch.campaigns.campaign import Campaign, values_sections
from batch.campaigns.folder import Folder, FolderBusy, beside, uncovered, write_json
from batch.campaigns.output import busy, cannot_write, check_room
from batch.campaigns.tasks import GRANULE, Task
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host import interpreter

STRIPES = 8
"""Number of stretches of a job's share, spread over all cases: neighbours in a sweep often take equally long, and all
jobs should."""

JOBS = 16
"""Default number of jobs."""


@frozen
class Submitted:
    """Submitted jobs. array, end: numbers of the job array and of the job that merges; jobs: of the array; cases:
    missing ones"""

    array: str
    end: str
    jobs: int
    cases: int


def submit(
    campaign: Campaign,
    *,
    jobs: int | None = None,
    options: Sequence[str] = (),
    timeout: float | None = None,
    fresh: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> Submitted | None:
    """Submit a campaign's missing cases to SLURM; None where its archive is whole. Raises Problem.

    jobs     of the array; None: `JOBS`, or fewer where there is less to share
    options  further words for sbatch, of both jobs: `--partition=long`
    """
    if any(part.searches for part in campaign.parts):
        message = "jobs have shares that are fixed beforehand, and a search asks for cases as it goes"
        remedy = "`met run --dask` runs it on workers, which may be jobs of SLURM: docs/cluster.md"
        raise Problem(error("E358", message, help=remedy))
    if campaign.open_ended:
        message = "jobs have shares that are fixed beforehand, and `until_shown` runs cases until something is shown"
        helps = (
            "`met run --dask` runs it on workers, which may be jobs of SLURM: docs/cluster.md",
            "or draw a number of cases: `sample random(N) { ... }`",
        )
        raise Problem(error("E358", message, help=helps))
    program = shutil.which("sbatch")
    if program is None:
        helps = ("submit where SLURM's commands are, on a login node", "`met run` runs it on this machine")
        raise Problem(error("E358", "there is no `sbatch` here", help=helps))
    values = values_sections(campaign)
    key = resuming.campaign_key(values)
    campaign = resuming.settled(campaign, values)
    if not fresh and resuming.finished_state(campaign, key) == resuming.WHOLE:
        return None
    if not fresh and not resuming.is_begun(Folder(beside(campaign.output)), key):
        resuming.guard(campaign)
    check_room(campaign.output, campaign.bytes_missing)
    folder = Folder(beside(campaign.output))
    try:
        folder.lock()
        for note in resuming.take_up(folder, campaign, values, key, fresh):
            say(note)
        resuming.describe(folder, campaign, values, key)
        folder.remove_partial_shards()
        missing = []
        for section in values:
            sound, messages = folder.sound_tasks(section)
            for note in messages:
                say(note)
            missing += [Task(section.number, *gap) for gap in uncovered(sound, len(section.rows))]
        cases = sum(task.cases for task in missing)
        if cases < campaign.cases:
            say(f"goes on: {campaign.cases - cases:,} of {campaign.cases:,} cases are done")
        count = min(jobs or JOBS, max(1, -(-cases // GRANULE)))
        tasks = folder.path / "jobs.json"
        dealt = [[[t.section, t.first, t.last] for t in share] for share in shares(missing, count)]
        write_json(tasks, {"shares": dealt, "timeout": timeout})
    except FolderBusy:
        raise Problem(busy(campaign.output)) from None
    except OSError as reason:
        raise Problem(cannot_write(campaign.output, reason)) from reason
    finally:
        folder.close()
    try:
        return _hand_over(campaign, folder, count if cases else 0, cases, options)
    except Problem:
        if cases == campaign.cases:  # no finished case would be lost
            folder.remove()
        raise


def _hand_over(campaign: Campaign, folder: Folder, count: int, cases: int, options: Sequence[str]) -> Submitted:
    """Submit the array, of so many jobs, and the job that merges."""
    program, tasks = str(shutil.which("sbatch")), folder.path / "jobs.json"
    logs = folder.path / "logs"
    logs.mkdir(exist_ok=True)
    log = str(logs.resolve()).replace("%", "%%")  # in the syntax of sbatch
    common = [program, "--parsable", f"--job-name=met-{campaign.output.stem}", *options]
    array = ""
    if cases:
        script = _script(folder.path, "share", '"$SLURM_ARRAY_TASK_ID"', shlex.quote(str(tasks.resolve())))
        array = _sbatch([*common, f"--array=0-{count - 1}", f"--output={log}/%A_%a.log"], script, bool(options))
    script = _script(folder.path, "together")
    after = [f"--dependency=afterany:{array}"] if array else []
    end = _sbatch([*common, *after, f"--output={log}/%A.log"], script, bool(options))
    return Submitted(array, end, count, cases)


def shares(missing: Sequence[Task], count: int) -> list[list[Task]]:
    """Cut the missing tasks into stretches and distribute them, so that each job has about as many cases, from
    everywhere."""
    whole = sum(task.cases for task in missing)
    cases_each = max(GRANULE, -(-whole // (count * STRIPES * GRANULE)) * GRANULE)
    pieces = [
        Task(task.section, first, min(first + cases_each, task.last))
        for task in missing
        for first in range(task.first, task.last, cases_each)
    ]
    return [pieces[number::count] for number in range(count)]


def _script(folder: Path, *words: str) -> str:
    """The job's script. words: after the folder, as a shell reads them."""
    exports = [f"export {name}={shlex.quote(value)}" for name, value in interpreter.packages().items()]
    job = shlex.join(interpreter.command("batch.terminal.job", str(folder.absolute())))
    return "\n".join(["#!/bin/sh", *exports, f"exec {job} {' '.join(words)}", ""])


def _sbatch(command: Sequence[str], script: str, more: bool) -> str:
    """Submit a job; returns its number. Raises Problem E358 with SLURM's own words."""
    done = subprocess.run(command, input=script, capture_output=True, text=True)
    number = re.match(r"\d+", done.stdout.strip())
    if done.returncode != 0 or number is None:
        lines = (done.stderr or done.stdout).strip().splitlines()
        words = lines[-1] if lines else "it said nothing"
        hint = ["what is given by `--sbatch` goes to sbatch as it is"] if more else []
        helps = [*hint, "`met run` runs it on this machine"]
        raise Problem(error("E358", f"sbatch refuses the job: {words}", help=helps))
    return number.group()
