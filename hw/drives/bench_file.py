"""The file of a bench of two drives, in TOML: which CAN bus and which two nodes, or which two serial lines, and what
the shaft bears.

A file is data of others: bounded, each key known, each figure a number with a unit of its kind.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hw.toml_file import TomlFile, quantity
from met.diagnostic import Place, did_you_mean
from met.frozen import frozen

MOST_BYTES = 1 << 16

FDCANUSB = "fdcanusb"
"""The `interface` that is not one of python-can's."""

SPEEDS = {"bitrate": "can.bitrate", "data_bitrate": "can.fd_bitrate"}
"""Settings in `[bus]` of an fdcanusb, and its own names of them."""

SERIAL, ASCII = "serial", "odrive_ascii"
"""The `interface` of drives on serial lines, one each, and the only dialect there is on them."""

FASTEST = 8_000_000
"""Bits a second, more than which no bus of CAN-FD carries."""

FIGURES: Mapping[str, Mapping[str, tuple[str, float | None]]] = {
    "shaft": {
        "inertia": ("kg*m^2", None),
        "rate_max": ("rad/s", None),
        "arming_rate": ("rad/s", 5.0),
        "filter": ("Hz", 0.0),
    },
    "supply": {"voltage_max": ("V", None)},
    "drive": {
        "kt": ("N*m/A", None),
        "resistance": ("ohm", None),
        "voltage_max": ("V", None),
        "torque_max": ("N*m", None),
        "watchdog": ("s", 0.020),
    },
    "load": {
        "kt": ("N*m/A", None),
        "current_max": ("A", None),
        "current_rated": ("A", None),
        "heat": ("A^2*s", None),
        "watchdog": ("s", 0.020),
    },
}
"""The quantities of each table: their SI unit, and the default; None where the file must give it."""

LONGEST_WATCHDOG = 1.0
"""s beyond which no watchdog's time is taken: a bed says how long it may be, and counters of drives end."""

_WORDS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "shaft": {},
    "supply": {},
    "drive": {"dialect": (), "endpoints": (), "model": (), "port": ()},
    "load": {"dialect": (), "endpoints": (), "model": (), "port": ()},
}
_TABLES = ("bus", *FIGURES)


@frozen
class DriveEntry:
    """One drive of a bench file.

    role      `drive`, the one under test, or `load`
    sense     1, or -1 where the drive counts the other way round: two motors that face each other
    figures   those of `FIGURES`, SI
    endpoints  path of the file that says where an ODrive's properties are; "" where none is given
    model      of the drive, by which a RobStride's frames mean what they mean; "" where none is given
    port       its serial line; "" of one on a CAN bus
    """

    role: str
    dialect: str
    node: int
    sense: int
    figures: Mapping[str, float]
    endpoints: str = ""
    model: str = ""
    port: str = ""


@frozen
class TwoDrives:
    """A bench of two drives on a bus. bus: what `can.Bus` is called with, or what serial lines
    are, with `ports` by node;  shaft, supply: of `FIGURES`, SI;
    filter_at, load_kt_at, dialect_at, torque_at: where the filter, None where there is none, the load's kt, the drive's
    dialect and its `torque_max` are written;  text: the file's
    """

    name: str
    bus: Mapping[str, Any]
    shaft: Mapping[str, float]
    supply: Mapping[str, float]
    drive: DriveEntry
    load: DriveEntry
    filter_at: Place | None = None
    load_kt_at: Place | None = None
    dialect_at: Place | None = None
    torque_at: Place | None = None
    text: str = ""

    @property
    def identity(self) -> dict[str, str]:
        """All that tells this bench from another, in words by the names in the file. The place of its bus or lines is
        none of it: an adapter may get another name."""
        words = {"name": self.name, "bus.interface": str(self.bus["interface"])}
        for table, figures in (("shaft", self.shaft), ("supply", self.supply)):
            words |= _in_words(table, figures)
        for drive in (self.drive, self.load):
            words |= {f"{drive.role}.dialect": drive.dialect, f"{drive.role}.node": str(drive.node)}
            words |= {
                f"{drive.role}.reversed": "true" if drive.sense < 0 else "false",
                f"{drive.role}.model": drive.model,
            }
            words |= _in_words(drive.role, drive.figures)
        return words


def _in_words(table: str, figures: Mapping[str, float]) -> dict[str, str]:
    return {f"{table}.{key}": f"{value!r} {FIGURES[table][key][0]}" for key, value in figures.items()}


def two_drives(path: str | os.PathLike[str]) -> TwoDrives:
    """The bench that a file describes. Raises Problem E446, OSError."""
    return _BenchFile(path).bench()


class _BenchFile(TomlFile):
    """One bench file."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        about = "docs/drives.md shows a bench file"
        super().__init__(path, code="E446", most=MOST_BYTES, kind="a bench file is TOML", about=about)

    def bench(self) -> TwoDrives:
        """The bench that the file describes. Raises Problem where it has too little, too much, or wrong values."""
        for key, value in self.tables.items():
            if key not in ("name", *_TABLES):
                helps = (*did_you_mean(key, ("name", *_TABLES)), f"a bench has name, {', '.join(_TABLES)}")
                raise self.wrong(f"a bench has no `{key}`", helps, key=key)
            if key in _TABLES and not isinstance(value, dict):
                raise self.wrong(f"`{key}` is no table", f"write `[{key}]` above what belongs to it", key=key)
        name = self.tables.get("name", Path(self.name).stem)
        if not isinstance(name, str) or not name.isprintable() or not 0 < len(name) <= 16 or not name.isascii():
            raise self.wrong("`name` is no name of 1 to 16 letters", '`name = "mine"`', key="name")
        for table in _TABLES:
            if table not in self.tables:
                raise self.wrong(f"it has no table `[{table}]`", "docs/drives.md shows a whole bench file")
        drive, load = self._drive("drive", 1), self._drive("load", 2)
        if drive.port and drive.port == load.port:
            raise self.wrong(f"drive and load are both on {load.port}", "each has a line of its own", "load", "port")
        if (drive.dialect, drive.node) == (load.dialect, load.node):
            raise self.wrong(
                f"drive and load are both node {load.node}", "each has a number of its own", "load", "node"
            )
        shaft, supply = self._figures("shaft"), self._figures("supply")
        filter_at = self.place("shaft", "filter") if "filter" in self.tables["shaft"] else None
        load_kt_at, dialect_at = self.place("load", "kt"), self.place("drive", "dialect")
        return TwoDrives(
            name,
            self._bus() if not drive.port else self._lines(drive, load),
            shaft,
            supply,
            drive,
            load,
            filter_at,
            load_kt_at,
            dialect_at,
            self.place("drive", "torque_max"),
            self.text,
        )

    def _bus(self) -> dict[str, Any]:
        """The keys of `[bus]`, with which the bus is opened. Raises Problem E446 where one is missing or of the wrong
        type."""
        figures = self.tables["bus"]
        for key in ("interface", "channel"):
            if key not in figures:
                raise self.wrong(
                    f"`[bus]` has no `{key}`", 'such as `interface = "socketcan"`, `channel = "can0"`', "bus"
                )
        adapter = figures["interface"] == FDCANUSB
        for key, value in figures.items():
            if adapter and key not in ("interface", "channel", *SPEEDS):
                helps = (*did_you_mean(key, SPEEDS), f"it has channel, {', '.join(SPEEDS)}")
                raise self.wrong(f"an fdcanusb has no `{key}`", helps, "bus", key)
            if adapter and key in SPEEDS and (type(value) is not int or not 0 < value <= FASTEST):
                raise self.wrong(f"`{key}` is no number of bits a second", f"`{key} = 1000000`", "bus", key)
            if not isinstance(value, str | int | float | bool):
                raise self.wrong(f"`{key}` is no word and no number", "python-can's documentation has them", "bus", key)
        return dict(figures)

    def _lines(self, drive: DriveEntry, load: DriveEntry) -> dict[str, Any]:
        """The `[bus]` of drives on serial lines, with the port of each."""
        figures = self.tables["bus"]
        for key in figures:
            if key not in ("interface", "baud"):
                helps = "`baud` of UARTs, and nothing of USB; each drive has its `port`"
                raise self.wrong(f"serial lines have no `{key}`", helps, "bus", key)
        baud = figures.get("baud")
        if baud is not None and (type(baud) is not int or not 0 < baud <= FASTEST):
            raise self.wrong("`baud` is no number of bits a second", "`baud = 921600`", "bus", "baud")
        ports = {drive.node: drive.port for drive in (drive, load)}
        return {"interface": SERIAL, "channel": ", ".join(ports.values()), "baud": baud, "ports": ports}

    def _port(self, role: str, dialect: str) -> str:
        """The serial line of a drive; "" of one on a CAN bus."""
        serial = self.tables["bus"].get("interface") == SERIAL
        if serial != (dialect == ASCII):
            message = f"dialect `{dialect}` is spoken on no {'serial line' if serial else 'CAN bus'}"
            helps = f'`interface = "{SERIAL}"` is for `dialect = "{ASCII}"`, of both drives'
            raise self.wrong(message, helps, role, "dialect")
        other = "node" if serial else "port"
        if other in self.tables[role]:
            message = f"a drive on a {'serial line' if serial else 'CAN bus'} has no `{other}`"
            raise self.wrong(message, f"`{'port' if serial else 'node'}` says which it is", role, other)
        port = self._word(role, "port", "")
        if serial and not port:
            raise self.wrong(f"`[{role}]` has no `port`", '`port = "/dev/ttyACM0"`', role)
        return port

    def _drive(self, role: str, number: int) -> DriveEntry:
        """A drive. number: the node that it is taken for on a serial line of its own"""
        table = self.tables[role]
        dialect = self._word(role, "dialect", None)
        port = self._port(role, dialect)
        node, reversed_ = number if port else table.get("node"), table.get("reversed", False)
        if not isinstance(node, int) or isinstance(node, bool) or not 0 <= node <= 127:
            raise self.wrong(f"`node` of `[{role}]` is no number of a node", "`node = 1`: 0 to 127", role, "node")
        if not isinstance(reversed_, bool):
            raise self.wrong(
                f"`reversed` of `[{role}]` is neither true nor false", "`reversed = true`", role, "reversed"
            )
        endpoints = self._word(role, "endpoints", "")
        if endpoints:
            endpoints = os.path.join(os.path.dirname(self.name), endpoints)
        figures, model = self._figures(role, ("node", "reversed")), self._word(role, "model", "")
        return DriveEntry(role, dialect, node, -1 if reversed_ else 1, figures, endpoints, model, port)

    def _figures(self, table: str, others: tuple[str, ...] = ()) -> dict[str, float]:
        """The figures of a table of the bench file, SI. Raises Problem E446 for an unknown key."""
        known = (*FIGURES[table], *_WORDS[table], *others)
        for key in self.tables[table]:
            if key not in known:
                helps = (*did_you_mean(key, known), f"`[{table}]` has {', '.join(known)}")
                raise self.wrong(f"`[{table}]` has no `{key}`", helps, table, key)
        return {key: self._figure(table, key, unit, default) for key, (unit, default) in FIGURES[table].items()}

    def _figure(self, table: str, key: str, unit: str, default: float | None) -> float:
        """A quantity above zero, SI."""
        value = self.tables[table].get(key)
        if value is None and default is not None:
            return default
        try:
            figure = quantity(value, unit)
            if key == "watchdog" and figure > LONGEST_WATCHDOG:
                raise self.wrong(f"`watchdog` of `[{table}]` is more than a second", "10 to 20 ms", table, key)
            return figure
        except ValueError:
            message = f"`{key}` of `[{table}]` is no quantity above zero in {unit}"
            raise self.wrong(message, f'write `{key} = "1.5 {unit}"`', table, key) from None

    def _word(self, table: str, key: str, default: str | None) -> str:
        """The word of a key of the bench file. Raises Problem E446 where it is missing or unknown."""
        word, known = self.tables[table].get(key, default), _WORDS[table][key]
        if not isinstance(word, str) or not word.isprintable() or (known and word and word not in known):
            helps = f"one of: {', '.join(known)}" if known else f'`{key} = "..."`'
            raise self.wrong(f"`{key}` of `[{table}]` is missing, or is none that there is", helps, table, key)
        return word
