"""Logs of measured signals, as a run's channels: an MCAP file (`batch.measured.mcap_log`), or a CSV file as decks name
them. The head of a CSV file names `time` and channels of the run, each with its unit. Units may stand in a line of
their own above it, as `met export` writes them.

    time [s], shoulder.q [deg], elbow.q [deg]
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from batch.measured.mcap_log import MeasuredSignals, mcap_signals
from ic.meaning.definitions.csv_files import CsvColumn, CsvTable, read_csv
from met.diagnostic import Label, Problem, did_you_mean, error
from met.frozen import frozen
from met.messages.visible import visible
from met.unit_parser import parse_unit

TIME, CASE = "time", "case"

SHOWN = 12
"""Largest number of channels that a message names."""


@frozen
class MappedColumn:
    """A channel of a run, or `time`, that a CSV file has under another name: `factor` times its column, and `offset`.

    unit  of that sum; None where the file's head says it
    """

    channel: str
    column: str
    factor: float
    offset: float
    unit: str | None


_MAPPED = re.compile(
    r"(?P<channel>[^=]+)=\s*(?:(?P<minus>-)|(?P<factor>[-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*\*)?"
    r"(?P<column>[^\[\]]+?)(?P<offset>\s[-+]\s*[\d.]+(?:[eE][-+]?\d+)?\s*)?(?:\[(?P<unit>[^\[\]]+)\])?\s*"
)


def mapped_column(text: str) -> MappedColumn:
    """The meaning of `CHANNEL=[FACTOR *] COLUMN [+ OFFSET] [UNIT]`, with `-` for a factor of -1.

    Raises Problem E478.
    """
    match = _MAPPED.fullmatch(text)
    try:
        if match is not None:
            factor = -1.0 if match["minus"] else float(match["factor"] or 1.0)
            offset = float("".join((match["offset"] or "0").split()))
            unit = None if match["unit"] is None else match["unit"].strip()
            parse_unit(unit or "1")
            if math.isfinite(factor + offset) and factor:
                return MappedColumn(match["channel"].strip(), match["column"].strip(), factor, offset, unit)
    except ValueError:
        pass
    helps = "such as `elbow.q=-angle_2 + 12 [deg]` or `elbow.tau=95.8 * current_2 [N*m]`, the unit that of the channel"
    raise Problem(error("E478", f"`{visible(text)}` is no column of a log for a channel", help=helps))


def read_log(
    path: str | Path, columns: Sequence[Mapping[str, str]], mapped: Sequence[MappedColumn] = (), zero: float = 0.0
) -> MeasuredSignals:
    """The channels of a run that a log has.

    columns  what the run records, of each number its channel, signal and SI unit
    mapped   channels that a CSV file has under other names
    zero     the log's time at which the run begins, s

    Raises Problem E478, and those of CSV files.
    """
    ending = Path(path).suffix.lower()
    if ending not in (".csv", ".mcap"):
        helps = "write it as a CSV file whose head names `time [s]` and channels with their units: `elbow.q [deg]`"
        raise Problem(error("E478", f"{path} is neither an archive nor a CSV or MCAP file", help=helps))
    if mapped and ending != ".csv":
        helps = "signals of an MCAP file have the names of topics: leave `--column` out"
        raise Problem(error("E478", f"`{path}` has no columns", help=helps))
    log = _csv_signals(path, columns, mapped) if ending == ".csv" else mcap_signals(path, columns)
    if not log.signals:
        what = "column" if ending == ".csv" else "topic"
        channels = [column["channel"] for column in columns]
        more = ["or say which it is: `--column 'CHANNEL=COLUMN [UNIT]'`"] if ending == ".csv" else []
        raise Problem(
            error(
                "E478",
                f"no {what} of `{path}` is a signal that the run records",
                log.head,
                help=[f"it records {_listed(channels)}: name {what}s so", *more],
            )
        )
    return replace(log, signals={name: (times - zero, values) for name, (times, values) in log.signals.items()})


def _csv_signals(
    path: str | Path, columns: Sequence[Mapping[str, str]], mapped: Sequence[MappedColumn]
) -> MeasuredSignals:
    """The channels of a run that a CSV file has, in SI. Raises Problem E478."""
    table = _with_names(read_csv(str(path)), mapped, [TIME, *(column["channel"] for column in columns)])
    changes = {mapping.channel: mapping for mapping in mapped}
    head = table.columns[0].place
    time_column = table.column(TIME)
    if time_column is None:
        raise Problem(
            error(
                "E478",
                f"`{path}` has no column `{TIME}`",
                head,
                help=["name it in the head: `time [s]`", "or say which it is: `--column 'time=COLUMN [s]'`"],
            )
        )
    if len(table.rows) < 2:
        raise Problem(error("E478", f"`{path}` has fewer than two rows", head, help="a log has a row an instant"))
    case = table.column(CASE)
    if case is not None:
        texts = [table.cell(case, number) for number in range(len(table.rows))]
        other = next((text for text in texts if text.text != texts[0].text), None)
        if other is not None:
            helps = "export one: `met export ARCHIVE --case '#0' -o log.csv`"
            raise Problem(error("E478", f"`{path}` has several cases, and a log is of one", other.place, help=helps))
    time = table.numbers(time_column, "s", parse_unit("s").dimension, Label(time_column.place, "times of the log"))
    table.rising(time_column, time)
    instants = _changed(time_column, time, changes)
    columns_read = {column["channel"]: _column(table, column, changes) for column in columns}
    signals = {name: (instants, numbers) for name, numbers in columns_read.items() if numbers is not None}
    known, sources = {TIME, *columns_read}, {mapping.column for mapping in mapped}
    used = [f"{column.name} [{column.unit or '1'}]" for column in table.columns if column.name in known]
    unused = [visible(column.name) for column in table.columns if column.name not in {*known, *sources}]
    return MeasuredSignals(signals, [visible(name) for name in used], unused, time_column.place if signals else head)


def _with_names(table: CsvTable, mapped: Sequence[MappedColumn], channels: Sequence[str]) -> CsvTable:
    """The table with columns under the names of channels, too. channels: what the run records, and `time`."""
    head = table.columns[0].place
    added: list[CsvColumn] = []
    for mapping in mapped:
        if any(mapping.channel == column.name for column in added):
            message = f"`{visible(mapping.channel)}` has two columns"
            raise Problem(error("E478", message, help="leave one of them out"))
        if mapping.channel == TIME and mapping.factor < 0.0:
            message = f"times of `{visible(mapping.column)}` would fall"
            raise Problem(error("E478", message, head, help="the factor of `time` is above 0"))
        if mapping.channel not in channels:
            helps = did_you_mean(mapping.channel, channels) or f"it records {_listed(channels[1:])}"
            raise Problem(error("E478", f"the run does not record `{visible(mapping.channel)}`", help=helps))
        column = table.column(mapping.column)
        if column is None:
            names = [visible(column.name) for column in table.columns]
            message = f"`{table.file}` has no column `{visible(mapping.column)}`"
            raise Problem(
                error("E478", message, head, help=did_you_mean(mapping.column, names) or f"it has {_listed(names)}")
            )
        added.append(replace(column, name=mapping.channel, unit=column.unit if mapping.unit is None else mapping.unit))
    return replace(table, columns=(*added, *table.columns))


def _changed(column: CsvColumn, numbers: Sequence[float], changes: Mapping[str, MappedColumn]) -> np.ndarray:
    """A column's numbers with the factor and the offset of its channel, SI, [row]. numbers: as they stand, SI"""
    change = changes.get(column.name)
    if change is None:
        return np.array(numbers)
    return np.asarray(change.factor * np.array(numbers) + parse_unit(column.unit or "1").to_si(change.offset))


def _column(table: CsvTable, recorded: Mapping[str, str], changes: Mapping[str, MappedColumn]) -> np.ndarray | None:
    """A channel's numbers in SI, [row]; none where the log lacks it."""
    column = table.column(recorded["channel"])
    if column is None:
        return None
    unit = recorded["unit"]
    label = Label(column.place, f"the run records it in {unit}" if unit != "1" else "the run records it without a unit")
    return _changed(column, table.numbers(column, unit, parse_unit(unit).dimension, label), changes)


def _listed(names: Sequence[str]) -> str:
    if not names:
        return "nothing"
    more = f", and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(f"`{name}`" for name in names[:SHOWN]) + more
