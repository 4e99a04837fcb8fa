"""The last run of each run and sweep of a deck, from the archives beside it: for the lenses of an editor."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries.requirements import outcomes, requirement_texts
from ic.editor.lenses import LastRun
from met.diagnostic import Problem

MOST_ARCHIVES = 20
"""Largest number of archives beside a deck that are read, the newest first."""


def last_runs(deck: str) -> dict[str, LastRun]:
    """The last run of each run and sweep, by name, from the archives that `met run` calls after the deck.

    What cannot be read is left out: an editor has no use for what is wrong with an archive.
    """
    path = Path(deck)
    runs: dict[str, LastRun] = {}
    for archive in _newest(path):
        try:
            with ArchiveFile(archive) as opened:
                if Path(opened.deck).name != path.name:
                    continue
                seconds = _seconds(archive)
                for group in opened.groups:
                    runs.setdefault(group.name, _last_run(archive, group, seconds.get(group.name)))
        except (Problem, OSError):
            continue
    return runs


def _newest(deck: Path) -> list[Path]:
    """The newest archives beside a deck whose names begin as the deck's."""
    try:
        archives = [path for path in deck.parent.iterdir() if path.suffix == ".h5" and path.name.startswith(deck.stem)]
        return sorted(archives, key=lambda path: -path.stat().st_mtime)[:MOST_ARCHIVES]
    except OSError:
        return []


def _last_run(archive: Path, group: ArchiveGroup, seconds: float | None) -> LastRun:
    """The last run of a run or sweep: for each requirement the number of cases that met it, missed it, and left it
    open."""
    counts = {}
    if group.summary is None:
        met = outcomes(group)
        for number, text in enumerate(requirement_texts(group)[: met.shape[1]]):
            met_of_requirement = met[:, number]
            counts[text] = (
                int((met_of_requirement == 1).sum()),
                int((met_of_requirement == 0).sum()),
                int((met_of_requirement == -1).sum()),
            )
    return LastRun(str(archive), group.count, seconds, counts)


def _seconds(archive: Path) -> dict[str, float]:
    """Seconds of computing by experiment, from the file beside the archive; empty where it lacks them."""
    try:
        return dict(_numbers(json.loads(archive.with_name(archive.name + ".run.json").read_text())))
    except (OSError, ValueError):
        return {}


def _numbers(timings: Any) -> Iterator[tuple[str, float]]:
    """The names of experiments in a sidecar with the seconds that they took."""
    every = timings.get("experiments") if isinstance(timings, dict) else None
    for entry in every if isinstance(every, list) else ():
        if isinstance(entry, dict) and isinstance(entry.get("experiment"), str):
            seconds = entry.get("seconds")
            if isinstance(seconds, int | float) and seconds >= 0:
                yield entry["experiment"], float(seconds)
