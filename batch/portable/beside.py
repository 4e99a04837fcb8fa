"""Data that a page shows beside its own run, as a second arm and wide pale lines: another archive's run, computed in
the page by that archive's own code, or a log of measured signals (`batch.measured.log`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.measured.log import read_log
from batch.plotting.against import beside
from batch.queries.signals import number_texts
from met.diagnostic import Problem, error
from met.host.sources import names_archive
from met.plan import Experiment

NANOSECOND = 1e-9


def other_group(archive: ArchiveFile, group: ArchiveGroup, other: ArchiveFile) -> tuple[ArchiveGroup, Experiment]:
    """The other archive's run or sweep that is matched with `group`: it varies the same parameters. Raises Problem E393
    where they have no case in common."""
    (matched,) = beside(archive, [group], other)
    assert matched is not None
    theirs = next(experiment for experiment in other.plan().experiments if experiment.name == matched.group.name)
    return matched.group, theirs


def is_archive(path: str | Path) -> bool:
    """True for the name of an archive; other files are read as logs."""
    return names_archive(str(path))


COVERED = 0.9
"""Share of a log's span, and of a run's, that the other has, below which it is said."""


def log_data(path: str | Path, columns: Sequence[Mapping[str, str]], rows: np.ndarray) -> dict[str, Any]:
    """A log at the rows of a run.

    columns  what the run records: of each number its channel, signal and SI unit
    rows     times of the run's rows, s; between rows of the log its numbers are on a straight line, before its first
             and after its last they are none

    Gives `values`, of each column an array over `rows` in SI, or none where the log has not the channel; `told`, what
    the log's columns are, with their units; and `unused`, those that are not shown; `part`, a line on the
    spans of both where one is much longer, else "". Raises Problem E478, and those of
    CSV files.
    """
    log = read_log(path, columns)
    channels = [column["channel"] for column in columns]
    begin, end = (
        pick(time[end_place] for time, _ in log.signals.values()) for pick, end_place in ((min, 0), (max, -1))
    )
    if not (begin < rows[-1] and end > rows[0]):
        message = _spans(begin, end, rows)
        raise Problem(error("E478", message, log.head, help="let its times begin where the run begins, at 0 s"))
    both, run = min(end, rows[-1]) - max(begin, rows[0]), rows[-1] - rows[0]
    whole = both >= COVERED * (end - begin) and both >= COVERED * run
    values = [_interpolated(rows, *log.signals[name]) if name in log.signals else None for name in channels]
    part = "" if whole else f"{_spans(begin, end, rows)}: what both have is shown"
    return {"values": values, "told": log.column_texts, "unused": log.unused, "part": part}


def _spans(begin: float, end: float, rows: np.ndarray) -> str:
    """The spans of a log and of a run, in words."""
    log, run = number_texts([begin, end]), number_texts([rows[0], rows[-1]])
    return f"the log is from {log[0]} s to {log[1]} s, and the run from {run[0]} s to {run[1]} s"


def _interpolated(rows: np.ndarray, time: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Numbers at other times, by straight lines; not-a-number before the first and after the last, with an allowance
    for the rounding of a clock in nanoseconds."""
    inside = (rows >= time[0] - NANOSECOND) & (rows <= time[-1] + NANOSECOND)
    return np.where(inside, np.interp(rows, time, numbers), np.nan)
