"""Logs of measured signals, as a run's channels: an MCAP file (`batch.measured.mcap_log`), or a CSV file as decks name
them. The head of a CSV file names `time` and channels of the run, each with its unit. Units may stand in a line of
their own above it, as `met export` writes them.

    time [s], shoulder.q [deg], elbow.q [deg]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from batch.measured.mcap_log import MeasuredSignals, mcap_signals
from ic.meaning.definitions.csv_files import CsvTable, read_csv
from met.diagnostic import Label, Problem, error
from met.messages.visible import visible
from met.unit_parser import parse_unit

TIME, CASE = "time", "case"

SHOWN = 12
"""Largest number of channels that a message names."""


def read_log(path: str | Path, columns: Sequence[Mapping[str, str]]) -> MeasuredSignals:
    """The channels of a run that a log has. columns: what the run records, of each number its channel, signal and SI
    unit. Raises Problem E478, and those of CSV files."""
    readers = {".csv": _csv_signals, ".mcap": mcap_signals}
    ending = Path(path).suffix.lower()
    if ending not in readers:
        helps = "write it as a CSV file whose head names `time [s]` and channels with their units: `elbow.q [deg]`"
        raise Problem(error("E478", f"{path} is neither an archive nor a CSV or MCAP file", help=helps))
    log = readers[ending](path, columns)
    if not log.signals:
        what = "column" if ending == ".csv" else "topic"
        channels = [each["channel"] for each in columns]
        raise Problem(
            error(
                "E478",
                f"no {what} of `{path}` is a signal that the run records",
                log.head,
                help=f"it records {_listed(channels)}: name {what}s so",
            )
        )
    return log


def _csv_signals(path: str | Path, columns: Sequence[Mapping[str, str]]) -> MeasuredSignals:
    table = read_csv(str(path))
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
