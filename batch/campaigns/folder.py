"""A campaign's folder, beside the archive until that is whole: the campaign's description, its shards, and its lock.

    two_link.gains.h5.campaign/
      campaign.json     what is computed: sections, the keys of their code and cases
      plan.json         the plan, for workers; large case tables and rows beside it
      points.*.npy      the cases of a search, as far as it has come
      shards/           one file a task, named SECTION-FIRST-LAST; those of a long section in folders
      status*.json      how far who is, written every second (batch/campaigns/status.py)
      lock              held while somebody works here: by one driver alone, or by the jobs of a cluster together

The shards are the journal: what is missing is what no sound shard of this very campaign covers. So a run that was
killed goes on by running what is missing, and it does not matter how its tasks were cut.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import glob
import io
import json
import os
import re
import shlex
import shutil
import stat
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from batch.archive.sink import is_at, lock_at_once
from batch.campaigns.points import NPY_HEAD_BYTES, grown_program, points_path, read_points
from batch.campaigns.tasks import CampaignSection, Done, Shard, Task, UnsoundShard, shard_of_file
from batch.campaigns.verification.verifying import WORDS as VERIFY_WORDS
from met import run as engine
from met.diagnostic import Problem, error
from met.host.files import is_count, new_file, read_json, read_regular, whole_file
from met.plan import Plan
from met.plan import file as plan_file
from met.plan.columns import MOST_SWEPT, CaseValues, all_rows
from met.program.step import TOO_FAST
from met.version import VERSION

SCHEMA, FORMAT = "met.campaign", 1
ENDING = ".campaign"
OURS = re.compile(
    r"(lock|shards|logs|plan\.json|plan\..*\.npy|rows\.\d+\.npy|points\.\d+\.npy|status(\.\d+)?\.json|jobs\.json|\..*\.tmp|\.nfs.*)$"
)
SHARD = re.compile(r"(\d+)-(\d+)-(\d+)")


class FolderBusy(Exception):
    """Raised where somebody else works in the folder."""


class Folder:
    """The folder of one campaign. `lock` it before writing; `close` gives it up."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = -1

    @property
    def shards(self) -> Path:
        return self.path / "shards"

    @property
    def submitted(self) -> bool:
        """True if the campaign was handed to a queue, whose jobs may not have begun."""
        return (self.path / "jobs.json").exists()

    @property
    def beds(self) -> Path:
        """The folder for records of cases on motor beds."""
        return self.path / "beds"

    @property
    def recorded(self) -> bool:
        """True if cases were driven on motor beds: they are not driven again."""
        return any(self.beds.glob("*.records"))

    def exists(self) -> bool:
        return (self.path / "campaign.json").exists()

    # Who works here

    def lock(self, *, together: bool = False) -> None:
        """Lock the folder, which is made if it does not exist. Raises FolderBusy where somebody works here, unless both
        do so `together`."""
        while self._lock < 0:
            self.path.mkdir(exist_ok=True)
            file = _lock_file(self.path / "lock")
            try:
                lock_at_once(file, fcntl.LOCK_SH if together else fcntl.LOCK_EX)
            except BlockingIOError:
                raise FolderBusy from None
            self._lock = file
            if not is_at(file, self.path / "lock"):  # who had it has taken the folder away meanwhile
                self.close()

    def close(self) -> None:
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def foreign(self) -> list[str]:
        """Names of files in a folder that do not belong to a campaign, and must not be removed."""
        if self.exists() or not self.path.is_dir():
            return []
        return sorted(path.name for path in self.path.iterdir() if not OURS.match(path.name))

    def empty(self) -> None:
        """Remove everything but the lock from the folder, which we have locked."""
        for path in self.path.iterdir():
            if path.name != "lock":
                _remove(path)

    def remove(self) -> None:
        """Remove the folder, which we have locked, or which is not locked."""
        leaving = self.path.with_name(f".{self.path.name}.{os.getpid()}.leaving")
        if self.path.is_symlink():  # the folder that it leads to is its owner's
            self.empty()
            (self.path / "lock").unlink(missing_ok=True)
            self.path.unlink()
        else:
            try:
                self.path.rename(leaving)
            except FileNotFoundError:
                pass
            except OSError:  # a name that would be too long
                shutil.rmtree(self.path, ignore_errors=True)
        self.finish_removal()
        self.close()

    def finish_removal(self) -> None:
        """Complete a removal that was begun, now or by a run that was killed meanwhile."""
        for leaving in self.path.parent.glob(f".{glob.escape(self.path.name)}.*.leaving"):
            shutil.rmtree(leaving, ignore_errors=True)

    # What is computed

    def describe(
        self,
        plan: Plan,
        sections: Iterable[CampaignSection],
        stops_early: Collection[int] = (),
        searches: Mapping[int, int] = MappingProxyType({}),
        **about: Any,
    ) -> None:
        """Write the campaign's description, for workers and for later runs.

        stops_early  numbers of sections that end as soon as it is decided whether their requirements hold
        searches     the largest number of cases of each section whose cases are chosen as they run, by its number
        about        `key` of the campaign, name of its `archive`, words for the `histories` that are kept

        A section with another number than its experiment runs cases of it `again`, for their histories. `rows` is the
        file with the cases of a section that does not run all.
        """
        self.shards.mkdir(exist_ok=True)
        # those that are there are ours, and may be damaged: plan_file writes over nothing but plans
        for path in (self.path / "plan.json", *self.path.glob("plan.*.npy")):
            path.unlink(missing_ok=True)
        plan_file.write(plan, self.path / "plan.json", computed=True)
        descriptions = []
        for section in sections:
            rows = None
            if section.number not in searches and len(section.rows) < section.prepared.experiment.cases.count:
                rows = f"rows.{section.number}.npy"
                with new_file(self.path / rows) as file:
                    np.save(file, np.asarray(section.rows))
            descriptions.append(
                {
                    "number": section.number,
                    "name": section.name,
                    "again": section.number != section.experiment,
                    "experiment": section.experiment,
                    "cases": searches.get(section.number, len(section.rows)),
                    "rows": rows,
                    "recorded": section.recorded,
                    "single": section.single,
                    "code": section.code,
                    "stops_early": section.number == section.experiment and section.number in stops_early,
                    "searches": section.number in searches,
                }
            )
        data = {
            "schema": SCHEMA,
            "version": FORMAT,
            "met": VERSION,
            "deck": plan.deck,
            "sections": descriptions,
            **about,
        }
        write_json(self.path / "campaign.json", data)

    def described(self) -> dict[str, Any]:
        """The campaign's description, campaign.json. Raises Problem where that is damaged, or of another version of
        MET."""
        path = self.path / "campaign.json"
        try:
            return _checked(read_json(path))
        except (OSError, ValueError, LookupError, TypeError) as reason:
            raise self._damaged(path) from reason

    def plan(self, *, every_case: bool = True) -> Plan:
        """The plan that is run here. every_case: as `met.plan.file.read`. Raises Problem."""
        return plan_file.read(self.path / "plan.json", every_case=every_case)

    def sections(self) -> dict[int, CampaignSection]:
        """The sections by their numbers, for a worker. Raises Problem E353 where this code is not that of the campaign,
        as after an update of MET or of models while jobs waited: its results would not count."""
        plan = self.plan(every_case=False)  # its writer has checked all of them
        experiments = [self._grown(engine.prepare(each), number) for number, each in enumerate(plan.experiments)]
        out = {}
        described = self.described()
        for description in described["sections"]:
            number, position = description["number"], description["experiment"]
            if position >= len(experiments):
                raise self._damaged(self.path / "campaign.json")
            if not experiments[position].is_work(description["code"]):
                raise Problem(_other_code(experiments[position].experiment.name, self.path, described))
            count = experiments[position].experiment.cases.count
            rows = all_rows(count) if description.get("searches") else self._rows(description, count)
            out[number] = CampaignSection(
                number,
                position,
                experiments[position],
                rows,
                description["recorded"],
                description["single"],
                description["code"],
            )
        return out

    def with_new_cases(self, section: CampaignSection) -> CampaignSection:
        """A section of a search with the cases that were asked for meanwhile; any other is unchanged. Raises
        Problem."""
        grown = self._grown(section.prepared, section.number)
        same = grown is section.prepared
        return section if same else replace(section, prepared=grown, rows=all_rows(grown.experiment.cases.count))

    def _grown(self, prepared: engine.Prepared, number: int) -> engine.Prepared:
        """The program of a search with the cases that were asked for so far; any other is unchanged, as is one that has
        not begun. Raises Problem."""
        path = points_path(self.path, number)
        if prepared.experiment.search is None or not path.exists():
            return prepared
        try:
            return grown_program(prepared, read_points(path, prepared.experiment))
        except (OSError, ValueError) as reason:
            raise self._damaged(path) from reason

    def _rows(self, description: dict[str, Any], count: int) -> CaseValues:
        """The rows of a section of an experiment with `count` cases. Raises Problem."""
        rows: CaseValues
        if description["rows"] is None:
            rows = all_rows(count)
        else:
            path = self.path / description["rows"]
            try:
                data = io.BytesIO(read_regular(path, count * np.dtype(np.int64).itemsize + NPY_HEAD_BYTES))
                rows = np.lib.format.read_array(data, allow_pickle=False)
            except (OSError, ValueError, TypeError, EOFError, OverflowError, MemoryError) as reason:
                raise self._damaged(path) from reason
            if rows.dtype != np.int64 or rows.ndim != 1 or not _rise(rows, count):
                raise self._damaged(path)
        if len(rows) != description["cases"]:
            raise self._damaged(self.path / "campaign.json")
        return rows

    def _damaged(self, path: Path) -> Problem:
        helps = "`--fresh` starts over, and removes what is in it"
        return Problem(error("E350", f"{path} is damaged, or of another version of MET", help=helps))

    # Finished tasks

    def named_tasks(self, number: int, stretch: tuple[int, int] | None = None) -> list[Task]:
        """The tasks of a section that have a file, sound or not, by their first cases; only those within a stretch of
        cases where one is given."""
        tasks, (first, last) = [], stretch or (0, MOST_SWEPT)
        for path in self._shard_files():
            parts = SHARD.fullmatch(path.name)
            task = Task(*map(int, parts.groups())) if parts else None
            if task is None or task.section != number or (stretch and not first <= task.first < task.last <= last):
                continue
            if path.name == task.name and path == self._path(task):
                tasks.append(task)
        return sorted(tasks, key=lambda task: (task.first, -task.last))

    def _shard_files(self) -> Iterator[Path]:
        """Everything in the folder of shards, and in the folders in it."""
        with contextlib.suppress(OSError):
            for entry in sorted(os.scandir(self.shards), key=lambda entry: entry.name):
                if entry.name.isdecimal() and entry.is_dir(follow_symlinks=False):
                    with contextlib.suppress(OSError):
                        yield from (self.shards / entry.name / name for name in os.listdir(entry.path))
                else:
                    yield self.shards / entry.name

    def _path(self, task: Task) -> Path:
        """The file of a task's shard: in its own folder, or beside all others, where an older MET wrote it."""
        path = self.shards / task.path
        beside = self.shards / task.name
        return beside if path != beside and beside.exists() else path

    def read(self, section: CampaignSection, task: Task) -> Shard:
        """A task's shard. Raises shard.UnsoundShard where it is not one of this section's, OSError."""
        read_shard = shard_of_file(self._path(task), task.cases * _bytes_of_case(section))
        if not 0 <= task.first < task.last <= len(section.rows) or len(read_shard.outputs) != task.cases:
            raise UnsoundShard("holds other cases than its name says")
        if read_shard.key != section.key(task.first, task.last):
            raise UnsoundShard("is of another plan, or of another version of MET's code")
        if not _fits(section, read_shard):
            raise UnsoundShard("holds other outputs than the program has")
        return read_shard

    def sound_tasks(self, section: CampaignSection) -> tuple[dict[Task, Done], list[str]]:
        """The tasks of a section whose shards count, and messages about those that do not, which are removed: their
        cases are run again."""
        tasks: dict[Task, Done] = {}
        messages: list[str] = []
        end = 0
        for task, read_shard in self.sound_shards(section, messages):
            tasks[task] = Done(read_shard.seconds, read_shard.failed_from(end - task.first))  # each case counts once
            end = max(end, task.last)
        return tasks, messages

    def sound_shards(
        self, section: CampaignSection, messages: list[str], stretch: tuple[int, int] | None = None
    ) -> Iterator[tuple[Task, Shard]]:
        """The tasks of a section, or those within a stretch of its cases, whose shards (files of results) count, with
        these, by their first cases. The others are removed, so that their cases are run again, and told in
        `messages`."""
        for task in self.named_tasks(section.number, stretch):
            try:
                read_shard = self.read(section, task)
            except (UnsoundShard, OSError) as reason:
                why = str(reason) if isinstance(reason, UnsoundShard) else f"cannot be read: {reason.strerror}"
                messages.append(f"shard {task.name} {why}; its {task.cases:,} cases are run again")
                _remove(self._path(task))
            else:
                yield task, read_shard

    def bytes(self) -> int:
        """The size of all existing shards."""
        sizes = 0
        with contextlib.suppress(OSError):
            for path in self._shard_files():
                sizes += path.stat().st_size if SHARD.fullmatch(path.name) else 0
        return sizes

    def seconds(self, enough: float) -> float:
        """Computing time of the existing shards, s; once it is `enough`, no more are read."""
        total = 0.0
        for path in self._shard_files():
            with contextlib.suppress(UnsoundShard, OSError):
                total += shard_of_file(path).seconds
            if total >= enough:
                break
        return total

    def remove_partial_shards(self) -> None:
        """Remove the unfinished files of workers that were killed; none may be at work."""
        for path in self._shard_files():
            if path.name.startswith(".") and path.name.endswith(".tmp"):
                path.unlink(missing_ok=True)


def _other_code(name: str, path: Path, described: dict[str, Any]) -> Any:
    """The error that a campaign was begun by other code than this (E353). described: its description"""
    message = f"the code of `{name}` here is not that with which {path} was begun: nothing of it is run"
    helps = [
        f"MET or a package of models has changed since; it was begun by MET {described['met']}, this is MET {VERSION}",
        "bring the former code back, and submit or run the same again; `--fresh` starts over with this one",
    ]
    return error("E353", message, help=helps)


def _remove(path: Path) -> None:
    """Remove the file, link or folder of this name."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _lock_file(path: Path) -> int:
    """The open lock file; made where there is none. A link in its place, which would lock another's file, is refused.
    Raises Problem E350, OSError."""
    helps = f"nobody at work in a campaign has such a lock: remove it, `rm -r {shlex.quote(str(path))}`"
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    except OSError as reason:
        if reason.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):  # a link, a folder, a socket
            raise Problem(error("E350", f"{path} is not a regular file", help=helps)) from None
        raise
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise Problem(error("E350", f"{path} is not a regular file", help=helps))
    return file


def _checked(data: Any) -> dict[str, Any]:
    """The contents of campaign.json, checked, but for the sizes of plan and rows. Raises ValueError, LookupError,
    TypeError."""
    sections = data["sections"]
    good = (
        data["schema"] == SCHEMA
        and data["version"] == FORMAT
        and all(isinstance(data[name], str) for name in ("key", "archive", "deck"))
        and Path(data["archive"]).name == data["archive"] != ""
        and all(isinstance(word, str) or is_count(word) for word in data["histories"])
        and isinstance(data["float32"], bool)
        and data.get("verify", "auto") in VERIFY_WORDS
        and isinstance(data.get("rows", "all"), str)
        and all(is_count(section["number"]) for section in sections)
        and all(section["number"] < other["number"] for section, other in pairwise(sections))
    )
    good = good and all(
        is_count(section["experiment"])
        and is_count(section["cases"])
        and isinstance(section["name"], str)
        and isinstance(section["code"], str)
        and section["rows"] in (None, f"rows.{section['number']}.npy")
        and all(isinstance(section[name], bool) for name in ("again", "recorded", "single"))
        and isinstance(section.get("stops_early", False), bool)
        and isinstance(section.get("searches", False), bool)
        for section in sections
    )
    if not good:
        raise ValueError("it is no description of a campaign")
    return dict(data)


def _rise(rows: np.ndarray, count: int) -> bool:
    """True if these are rows of a case table with `count` cases, each once and in order."""
    return len(rows) == 0 or bool(rows[0] >= 0 and rows[-1] < count and (np.diff(rows) > 0).all())


def _bytes_of_case(section: CampaignSection) -> int:
    """The size of one case of a section in a shard."""
    rows = section.prepared.experiment.structure.schedule.rows if section.recorded else 0
    return np.dtype(float).itemsize * (len(section.prepared.outputs) + rows * section.prepared.program.columns)


def _fits(section: CampaignSection, read_shard: Shard) -> bool:
    """True if the arrays of a shard have the program's sizes, and its failures are possible."""
    program, structure = section.prepared.program, section.prepared.experiment.structure
    if read_shard.outputs.shape[1] != len(section.prepared.outputs):
        return False
    shape = (len(read_shard.outputs), structure.schedule.rows, program.columns)
    wanted = shape if section.recorded and program.columns else None
    if wanted != (None if read_shard.history is None else read_shard.history.shape):
        return False
    failed = read_shard.outputs[read_shard.outputs[:, 0] != 0.0, :3]
    parts = len(structure.moving) + bool(structure.free) + len(structure.payloads) + len(structure.sensors)
    most = np.array([TOO_FAST, parts, structure.schedule.ticks + 1])
    return bool(((failed >= 0.0) & (failed <= most)).all())


def beside(archive: Path) -> Path:
    """The folder of the campaign that fills an archive."""
    return archive.with_name(archive.name + ENDING)


def uncovered(tasks: Iterable[Task], cases: int) -> list[tuple[int, int]]:
    """Stretches of cases that no task covers; tasks by their first cases."""
    out, end = [], 0
    for task in tasks:
        if task.first > end:
            out.append((end, task.first))
        end = max(end, task.last)
    return [*out, (end, cases)] if end < cases else out


def write_json(path: Path, data: Any) -> None:
    """Write JSON whole, or not at all."""
    with whole_file(path) as file:
        file.write(json.dumps(data).encode())
