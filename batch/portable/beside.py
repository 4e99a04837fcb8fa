"""Data that a page shows beside its own run, as a second arm and wide pale lines: another archive's run, computed in
the page by that archive's own code, or a log of measured signals.

A log is an MCAP file (`batch.portable.mcap_log`), or a CSV file as decks name them: its head names `time` and channels
of the run, each with its unit. Units may stand in a line of their own above it, as `met export` writes them.

    time [s], shoulder.q [deg], elbow.q [deg]
"""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.plotting.against import beside
from batch.portable.mcap_log import MeasuredSignals, mcap_signals
from batch.queries.signals import number_texts
from ic.meaning.definitions.csv_files import CsvTable, read_csv
from met.diagnostic import Label, Place, Problem, error
from met.host.files import open_regular
from met.host.sources import names_archive
from met.messages.visible import visible
from met.plan import Experiment
from met.unit_parser import parse_unit

TIME, CASE = "time", "case"
UNITS = "# units: "
LONGEST_LINE, MOST_REMARKS = 1 << 16, 100
"""Length, and number, of the lines above a head that are searched."""

NANOSECOND = 1e-9
SHOWN = 12
"""Largest number of channels that a message or a page names."""


def other_group(archive: ArchiveFile, group: ArchiveGroup, other: ArchiveFile) -> tuple[ArchiveGroup, Experiment]:
    """The other archive's run or sweep that is matched with `group`: it varies the same parameters. Raises Problem E393
    where they have no case in common."""
    (found,) = beside(archive, [group], other)
    assert found is not None
    theirs = next(each for each in other.plan().experiments if each.name == found.group.name)
    return found.group, theirs


def is_archive(path: str | Path) -> bool:
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
    readers = {".csv": _csv_signals, ".mcap": mcap_signals}
    ending = Path(path).suffix.lower()
    if ending not in readers:
        helps = "write it as a CSV file whose head names `time [s]` and channels with their units: `elbow.q [deg]`"
        raise Problem(error("E478", f"{path} is neither an archive nor a CSV or MCAP file", help=helps))
    log = readers[ending](path, columns)
    channels = [each["channel"] for each in columns]
    if not log.signals:
        what = "column" if ending == ".csv" else "topic"
        raise Problem(
            error(
                "E478",
                f"no {what} of `{path}` is a signal that the run records",
                log.head,
                help=f"it records {_listed(channels)}: name {what}s so",
            )
        )
    begin, end = (pick(time[at] for time, _ in log.signals.values()) for pick, at in ((min, 0), (max, -1)))
    if not (begin < rows[-1] and end > rows[0]):
        message = _spans(begin, end, rows)
        raise Problem(error("E478", message, log.head, help="let its times begin where the run begins, at 0 s"))
    both, run = min(end, rows[-1]) - max(begin, rows[0]), rows[-1] - rows[0]
    whole = both >= COVERED * (end - begin) and both >= COVERED * run
    values = [_at(rows, *log.signals[name]) if name in log.signals else None for name in channels]
    part = "" if whole else f"{_spans(begin, end, rows)}: what both have is shown"
    return {"values": values, "told": log.told, "unused": log.unused, "part": part}


def _spans(begin: float, end: float, rows: np.ndarray) -> str:
    """The spans of a log and of a run, in words."""
    log, run = number_texts([begin, end]), number_texts([rows[0], rows[-1]])
    return f"the log is from {log[0]} s to {log[1]} s, and the run from {run[0]} s to {run[1]} s"


def _at(rows: np.ndarray, time: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Numbers at other times, by straight lines; not-a-number before the first and after the last, with an allowance
    for the rounding of a clock in nanoseconds."""
    inside = (rows >= time[0] - NANOSECOND) & (rows <= time[-1] + NANOSECOND)
    return np.where(inside, np.interp(rows, time, numbers), np.nan)


def _csv_signals(path: str | Path, columns: Sequence[Mapping[str, str]]) -> MeasuredSignals:
    table = _with_units(read_csv(str(path)))
    head = table.columns[0].place
    time_column = table.column(TIME)
    if time_column is None:
        raise Problem(error("E478", f"`{path}` has no column `{TIME}`", head, help="name it in the head: `time [s]`"))
    if len(table.rows) < 2:
        raise Problem(error("E478", f"`{path}` has fewer than two rows", head, help="a log has a row an instant"))
    case = table.column(CASE)
    if case is not None:
        texts = [table.cell(case, number) for number in range(len(table.rows))]
        other = next((each for each in texts if each.text != texts[0].text), None)
        if other is not None:
            helps = "export one: `met export ARCHIVE --case '#0' -o log.csv`"
            raise Problem(error("E478", f"`{path}` has several cases, and a log is of one", other.place, help=helps))
    time = table.numbers(time_column, "s", parse_unit("s").dimension, Label(time_column.place, "times of the log"))
    table.rising(time_column, time)
    instants = np.array(time)
    found = {each["channel"]: _column(table, each) for each in columns}
    signals = {name: (instants, np.array(numbers)) for name, numbers in found.items() if numbers is not None}
    known = {TIME, *found}
    used = [f"{each.name} [{each.unit or '1'}]" for each in table.columns if each.name in known]
    unused = [visible(each.name) for each in table.columns if each.name not in known]
    return MeasuredSignals(signals, [visible(each) for each in used], unused, time_column.place if signals else head)


def _with_units(table: CsvTable) -> CsvTable:
    """The table with the units of the line `# units: s,rad`, which stands above the head of a file by `met export`.
    Raises Problem E478 where that line does not have a unit for each column."""
    line = table.columns[0].place.line
    if any(each.unit is not None for each in table.columns) or line < 2:
        return table
    with open_regular(table.file) as file:
        above = [file.readline(LONGEST_LINE).decode("utf-8-sig", "replace") for _ in range(min(line - 1, MOST_REMARKS))]
    number, told = next(((n, each) for n, each in enumerate(above, 1) if each.startswith(UNITS)), (0, ""))
    if not number:
        return table
    units = next(csv.reader([told.removeprefix(UNITS).rstrip("\r\n")]), [])
    if len(units) != len(table.columns):
        message = f"this line has {len(units)} units, and {len(table.columns)} columns follow"
        place = Place(table.file, number, 1, max(len(told.rstrip()), 1))
        raise Problem(error("E478", message, place, help="give each column its unit, and 1 where it has none"))
    columns = zip(table.columns, units, strict=True)
    return dataclasses.replace(
        table, columns=tuple(dataclasses.replace(each, unit=unit.strip() or None) for each, unit in columns)
    )


def _column(table: CsvTable, recorded: Mapping[str, str]) -> tuple[float, ...] | None:
    """A channel's numbers in SI; none where the log lacks it."""
    column = table.column(recorded["channel"])
    if column is None:
        return None
    unit = recorded["unit"]
    label = Label(column.place, f"the run records it in {unit}" if unit != "1" else "the run records it without a unit")
    return table.numbers(column, unit, parse_unit(unit).dimension, label)


def _listed(names: Sequence[str]) -> str:
    if not names:
        return "nothing"
    more = f", and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(f"`{name}`" for name in names[:SHOWN]) + more
