"""What a page shows beside its own run, as a second arm and as wide pale lines: another archive's run, computed in the
page by that archive's own code, or a log of measured signals.

A log is a CSV file as decks name them: its head names `time` and channels of the run, each with its unit.

    time [s], shoulder.q [deg], elbow.q [deg]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.plotting.against import beside
from ic.meaning.definitions.csv_files import CsvTable, read_csv
from met.diagnostic import Label, Problem, error
from met.host.sources import names_archive
from met.messages.visible import visible
from met.plan import Experiment
from met.unit_parser import parse_unit

TIME = "time"
SHOWN = 12
"""Channels that a message or a page names."""


def other_group(archive: ArchiveFile, group: ArchiveGroup, other: ArchiveFile) -> tuple[ArchiveGroup, Experiment]:
    """The other archive's run or sweep that is matched with `group`: it varies the same numbers. Raises Problem E393
    where no case is in both."""
    (found,) = beside(archive, [group], other)
    assert found is not None
    theirs = next(each for each in other.plan().experiments if each.name == found.group.name)
    return found.group, theirs


def is_archive(path: str | Path) -> bool:
    return names_archive(str(path))


def log_data(path: str | Path, columns: Sequence[Mapping[str, str]], rows: np.ndarray) -> dict[str, Any]:
    """A log at the rows of a run.

    columns  what the run records: of each number its channel and SI unit
    rows     times of the run's rows, s; between rows of the log its numbers are on a straight line, before its first
             and after its last they are none

    Gives `values`, of each column an array over `rows` in SI, or none where the log has not the channel; and `told`,
    what the log's columns are, with their units. Raises Problem E478, and those of CSV files.
    """
    if Path(path).suffix.lower() != ".csv":
        helps = "write it as a CSV file whose head names `time [s]` and channels with their units: `elbow.q [deg]`"
        raise Problem(error("E478", f"{path} is neither an archive nor a CSV file", help=helps))
    table = read_csv(str(path))
    head = table.columns[0].place
    time_column = table.column(TIME)
    channels = [each["channel"] for each in columns]
    if time_column is None:
        raise Problem(error("E478", f"`{path}` has no column `{TIME}`", head, help="name it in the head: `time [s]`"))
    if len(table.rows) < 2:
        raise Problem(error("E478", f"`{path}` has fewer than two rows", head, help="a log has a row an instant"))
    time = table.numbers(time_column, "s", parse_unit("s").dimension, Label(time_column.place, "times of the log"))
    table.rising(time_column, time)
    if not (time[0] < rows[-1] and time[-1] > rows[0]):
        message = f"the log is from {time[0]:g} s to {time[-1]:g} s, and the run from {rows[0]:g} s to {rows[-1]:g} s"
        raise Problem(
            error("E478", message, time_column.place, help="let its times begin where the run begins, at 0 s")
        )
    values = [_column(table, each, time, rows) for each in columns]
    if all(each is None for each in values):
        message = f"no column of `{path}` is a signal that the run records"
        raise Problem(error("E478", message, head, help=f"it records {_listed(channels)}: name columns so"))
    known = {TIME, *channels}
    used = [f"{each.name} [{each.unit or '1'}]" for each in table.columns if each.name in known]
    return {
        "values": values,
        "told": [visible(each) for each in used],
        "unused": [visible(each.name) for each in table.columns if each.name not in known],
    }


def _column(
    table: CsvTable, recorded: Mapping[str, str], time: tuple[float, ...], rows: np.ndarray
) -> np.ndarray | None:
    column = table.column(recorded["channel"])
    if column is None:
        return None
    unit = recorded["unit"]
    label = Label(column.place, f"the run records it in {unit}" if unit != "1" else "the run records it without a unit")
    numbers = table.numbers(column, unit, parse_unit(unit).dimension, label)
    return np.interp(rows, time, numbers, left=np.nan, right=np.nan)


def _listed(names: Sequence[str]) -> str:
    if not names:
        return "nothing"
    more = f", and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(f"`{name}`" for name in names[:SHOWN]) + more
