"""The progress of a campaign: its processes write it into its folder every second, and `met status` reads it."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from batch.archive.read import ArchiveFile
from batch.campaigns.drive import Progress
from batch.campaigns.folder import ENDING, Folder, beside, uncovered, write_json
from batch.campaigns.output import sidecar_path
from met.host import system
from met.host.files import is_count, read_json

WRITE_SECONDS = 1.0

STALE_SECONDS = 30.0
"""Age, s, from which a status file counts as that of a dead process."""


TYPES: dict[str, type | tuple[type, ...]] = {
    "state": str,
    "pid": int,
    "host": str,
    "workers": str,
    "cases": int,
    "failed": int,
    "updated": (int, float),
    "section_done": int,
    "section_began": (int, float),
    "at_first": int,
}
"""Required entries of a status file, with their types."""


class Reporter:
    """Progress display that also writes a status file. name: of one job among several that work in a folder"""

    def __init__(self, folder: Folder, cases: int, progress: Progress | None = None, name: str = "") -> None:
        """Prepare the record of a campaign that is about to start; nothing is written yet. cases: of the campaign in
        all; progress: the display that is told the same, if any"""
        self._path = folder.path / (f"status.{name}.json" if name else "status.json")
        self._progress = progress
        self._next = 0.0
        self._record: dict[str, Any] = {
            "state": "starting",
            "pid": os.getpid(),
            "host": socket.gethostname(),
            "began": time.time(),
            "cases": cases,
            "failed": 0,
            "at_first": 0,
            "workers": "",
            "section_done": 0,
            "section_began": time.time(),
        }
        self._before: dict[str, tuple[int, int]] = {}
        self._name = ""

    def begin(self, name: str, cases: int, done: int, failed: int, workers: str) -> None:
        """A section starts, or is taken up again."""
        self._name = name
        self._record |= {
            "state": "running",
            "section": name,
            "section_cases": cases,
            "workers": workers,
            "section_began": time.time(),
            "at_first": done,
            "section_done": done,
            "failed": failed,
        }
        self._write()
        if self._progress is not None:
            self._progress.begin(name, cases, done, failed, workers)

    def advance(self, done: int, failed: int, more: str = "") -> None:
        """Take the numbers of done and failed cases, show them, and write the status file now and then."""
        self._record |= {"section_done": done, "failed": failed, "more": more}
        if time.monotonic() > self._next:
            self._write()
        if self._progress is not None:
            self._progress.advance(done, failed, more)

    def end(self) -> None:
        if self._progress is not None:
            self._progress.end()

    def state(self, state: str) -> None:
        """Write a state: running, merging, interrupted, stopped, or done."""
        self._record["state"] = state
        self._write()

    def _write(self) -> None:
        """Write the status file; a full disk is left to whoever writes results."""
        self._next = time.monotonic() + WRITE_SECONDS
        self._record["updated"] = time.time()
        with suppress(OSError):  # the writer of results reports a full disk
            write_json(self._path, self._record)


def status_records(folder: Folder) -> list[dict[str, Any]]:
    """The last status of each process that works or worked in a folder, the latest first."""
    records = []
    for path in folder.path.glob("status*.json"):
        try:
            data = read_json(path)
        except (OSError, ValueError):
            continue
        if isinstance(data, dict) and all(isinstance(data.get(name), kind) for name, kind in TYPES.items()):
            records.append({**data, "name": path.name.removeprefix("status").removesuffix(".json").strip(".")})
    return sorted(records, key=lambda record: -record["updated"])


def find_folder(name: str) -> Folder | None:
    """The folder that a user means: by its own name, or its archive's; None where there is none. Raises Problem for an
    unsound archive."""
    path = Path(name)
    for folder in (path, beside(path) if path.name else path):
        if Folder(folder).exists():
            return Folder(folder)
    return None


def report(folder: Folder, now: float) -> dict[str, Any]:
    """The progress of a campaign as data: the finished cases of each section, by its shards, and the processes at
    work."""
    sections = []
    told_here = folder.described()
    for section in told_here["sections"]:
        left = sum(last - first for first, last in uncovered(folder.named_tasks(section["number"]), section["cases"]))
        sections.append(
            {
                "name": section["name"],
                "cases": section["cases"],
                "done": section["cases"] - left,
                "again": section["again"],
                "stops_early": section.get("stops_early", False),
            }
        )
    workers = []
    for status_record in status_records(folder):
        done = status_record["section_done"] - status_record["at_first"]
        seconds = status_record["updated"] - status_record["section_began"]
        workers.append(
            {
                "job": status_record["name"],
                "state": status_record["state"]
                if alive(status_record, now) or status_record["state"] not in AT_WORK
                else "died",
                "host": status_record["host"],
                "pid": status_record["pid"],
                "workers": status_record["workers"],
                "cases": status_record["cases"],
                "done": status_record["section_done"],
                "failed": status_record["failed"],
                "more": status_record["more"] if isinstance(status_record.get("more"), str) else "",
                "cases_per_s": done / seconds if done > 0 and seconds > 0 else None,
                "seconds_ago": max(0.0, now - status_record["updated"]),
            }
        )
    return {
        "folder": str(folder.path),
        "archive": told_here["archive"],
        "deck": told_here["deck"],
        "sections": sections,
        "workers": workers,
    }


def lines(data: dict[str, Any]) -> Iterator[str]:
    """The progress of a campaign in lines, for people."""
    from ic.printing.columns import columns

    first = [section for section in data["sections"] if not section["again"]]
    cases, done = (sum(section[name] for section in first) for name in ("cases", "done"))
    early = any(section["stops_early"] for section in first)
    yield f"{data['folder']}: {done:,} of {'at most ' * early}{cases:,} cases are done"
    rows = [
        [
            section["name"] + (", again for histories" if section["again"] else ""),
            f"{section['done']:,}",
            f"of {'at most ' * section['stops_early']}{section['cases']:,}",
        ]
        for section in data["sections"]
    ]
    yield from columns(rows, right=(1, 2)) if len(rows) > 1 else []
    working = [worker for worker in data["workers"] if worker["state"] in AT_WORK]
    rates = [worker["cases_per_s"] for worker in working if worker["cases_per_s"]]
    if rates and cases > done:
        rate = sum(rates)
        rate_text = f"{rate:,.3g}" if rate < 1000 else f"{rate:,.0f}"
        yield f"  {rate_text} cases/s, {'at most ' * early}{duration((cases - done) / rate)} left"
    rows = []
    for worker in data["workers"]:
        failed = f"{worker['failed']:,} failed" if worker["failed"] else ""
        job, ago = f"job {worker['job']}" if worker["job"] else "", f"{duration(worker['seconds_ago'])} ago"
        where, process = f"on {worker['host']}", f"process {worker['pid']}"
        rows.append([job, worker["state"], where, process, worker["workers"], failed, worker["more"], ago])
    yield from columns(rows, right=())
    if not working and done < cases:
        yield "  nobody is at work: the command that began it goes on"


def finished_archive(archive: Path) -> dict[str, Any] | None:
    """Data about a finished archive from its sidecar: its cases, and when it was begun; None where there is none.
    Raises Problem for an unsound archive."""
    with suppress(OSError, ValueError, LookupError, TypeError):
        sidecar = read_json(sidecar_path(archive))
        cases = sum(record["cases"] for record in sidecar["experiments"] if is_count(record["cases"]))
        return {"archive": str(archive), "cases": cases, "began": str(sidecar["began"])} if archive.is_file() else None
    if not archive.exists():
        return None
    with ArchiveFile(archive) as file:
        return {"archive": str(archive), "cases": sum(group.run for group in file.groups), "began": "unknown"}


def unfinished_in(folder: Path) -> list[str]:
    """Campaigns in a folder that are not finished."""
    return sorted(path.name for path in folder.glob(f"*{ENDING}") if Folder(path).exists())


AT_WORK = ("starting", "running", "merging")


def died_lines(folder: Folder) -> Iterator[str]:
    """Lines about an earlier run that ended without a message."""
    for status_record in status_records(folder):
        if not status_record["name"] and status_record["state"] in AT_WORK and not alive(status_record, time.time()):
            alone = "thread" in status_record["workers"] and not status_record["workers"].startswith("Dask")
            remedy = "; if a case did it, `--processes 2` finds out which" if alone else ""
            process = f"process {status_record['pid']} on {status_record['host']}"
            yield f"the run before this one was killed ({process}){remedy}"


def alive(record: dict[str, Any], now: float) -> bool:
    """True if the process that wrote this status is still at work, as far as is known."""
    if record["state"] not in AT_WORK:
        return False
    if record["host"] == socket.gethostname():
        return system.is_running(record["pid"])
    return bool(now - record["updated"] < STALE_SECONDS)


def duration(seconds: float) -> str:
    """A duration in words: 95 -> `1 min 35 s`."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    if seconds < 60:
        return f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"
