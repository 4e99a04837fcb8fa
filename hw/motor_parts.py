"""Motors to buy for a bed, from files in TOML: `hw/motor_parts.toml`, and users' own of the same form.

A file is data of others: bounded, and each figure is a number with a unit of its kind, above zero.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from hw.toml_file import TomlFile, quantity
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen

SHIPPED = Path(__file__).with_suffix(".toml")
MOST_BYTES = 1 << 20
MOST_MOTORS = 1000

FIGURES: Mapping[str, str] = {
    "torque_rated": "N*m",
    "torque_peak": "N*m",
    "rate_max": "rad/s",
    "kt": "N*m/A",
    "resistance": "ohm",
    "inductance": "H",
    "voltage": "V",
    "inertia": "kg*m^2",
    "current_rated": "A",
    "current_peak": "A",
    "thermal_time": "s",
}
"""Figures of a motor, and the SI unit of each."""

_WORDS = ("name", "maker", "model", "source", "note")
_BENCH = ("name", "drive", "load")
_PART = ("name", "kind", "maker", "model", "source", "note")


@frozen
class MotorPart:
    """A motor that can be bought. figures: those of `FIGURES` that its source gives, SI;  file: that it is from"""

    name: str
    source: str
    maker: str = ""
    model: str = ""
    note: str = ""
    figures: Mapping[str, float] = field(default_factory=dict)
    file: str = ""

    def figure(self, name: str) -> float | None:
        """One of `FIGURES`, SI; None where the source does not give it."""
        return self.figures.get(name)


@frozen
class Bench:
    """Two motors that go together, by their names."""

    name: str
    drive: str
    load: str


@frozen
class BenchPart:
    """A part that a bench needs besides motors, in words. kind: amplifier, supply, brake resistor, encoder ..."""

    name: str
    kind: str
    source: str
    maker: str = ""
    model: str = ""
    note: str = ""


@frozen
class PartsList:
    """The motors, benches and further parts of some files, by name."""

    motors: Mapping[str, MotorPart]
    benches: Mapping[str, Bench]
    others: Mapping[str, BenchPart] = field(default_factory=dict)

    def motor(self, name: str) -> MotorPart:
        """The motor of a name. Raises Problem E442."""
        if name in self.motors:
            return self.motors[name]
        helps = [*did_you_mean(name, self.motors), f"motors: {', '.join(self.motors)}"]
        raise Problem(error("E442", f"no motor `{name}` in the files of parts", help=helps))


def parts_list(more: str | os.PathLike[str] | None = None) -> PartsList:
    """The motors that are shipped, and those of a file of one's own, which go before. Raises Problem E441, OSError."""
    lists = [_File(SHIPPED).parts(), *([] if more is None else [_File(more).parts()])]
    own_first = [*reversed(lists)]
    motors = {name: motor for parts in lists for name, motor in parts.motors.items()}
    names = dict.fromkeys(name for parts in own_first for name in parts.motors)
    benches = {name: bench for parts in lists for name, bench in parts.benches.items()}
    others = {name: other for parts in lists for name, other in parts.others.items()}
    return PartsList({name: motors[name] for name in names}, benches, others)


class _File(TomlFile):
    """One file of parts."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        about = "`met doc E441` shows a file of parts"
        super().__init__(path, code="E441", most=MOST_BYTES, kind="a file of parts is TOML", about=about)

    def parts(self) -> PartsList:
        """The motors, benches and other parts of the file. Raises Problem E441."""
        for key in self.tables:
            if key not in ("motor", "bench", "part"):
                helps = "motors are `[[motor]]`, benches `[[bench]]`, what else a bench needs `[[part]]`"
                raise self.wrong(f"no `{key}` belongs here", helps, key=key)
        motors: dict[str, MotorPart] = {}
        for number, table in enumerate(self._several("motor")):
            motor = self._motor(number, table)
            if motor.name in motors:
                raise self.wrong(
                    f"motor `{motor.name}` is there twice", "give each a name of its own", "motor", number=number
                )
            motors[motor.name] = motor
        benches: dict[str, Bench] = {}
        for number, table in enumerate(self._several("bench")):
            words = {key: self._text("bench", number, table, key) for key in _BENCH}
            self._only(_BENCH, "bench", number, table)
            for role in _BENCH[1:]:
                if words[role] not in motors:
                    message = f"bench `{words['name']}`: there is no motor `{words[role]}` in this file"
                    raise self.wrong(message, f"its motors: {', '.join(motors)}", "bench", role, number)
            benches[words["name"]] = Bench(**words)
        return PartsList(motors, benches, self._others())

    def _others(self) -> dict[str, BenchPart]:
        """The parts of a bench besides motors, by name. Raises Problem for one without name, kind or source, or named
        twice."""
        parts: dict[str, BenchPart] = {}
        for number, table in enumerate(self._several("part")):
            self._only(_PART, "part", number, table)
            words = {key: self._text("part", number, table, key) for key in _PART if key in table}
            for key, why in (("name", "a name of its own"), ("kind", "what it is for"), ("source", "where it is from")):
                if not words.get(key):
                    raise self.wrong(f"part number {number + 1} has no `{key}`", why, "part", number=number)
            if words["name"] in parts:
                raise self.wrong(
                    f"part `{words['name']}` is there twice", "give each a name of its own", "part", number=number
                )
            parts[words["name"]] = BenchPart(**words)
        return parts

    def _several(self, kind: str) -> list[dict[str, Any]]:
        """The tables of a kind, `[[kind]]`. Raises Problem E441 where it is no list, or too long."""
        tables = self.tables.get(kind, [])
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            raise self.wrong(f"`{kind}` is no list of tables", f"write `[[{kind}]]` above each", key=kind)
        if len(tables) > MOST_MOTORS:
            raise self.wrong(f"it has {len(tables)} tables `[[{kind}]]`", f"{MOST_MOTORS} are the most", kind)
        return tables

    def _motor(self, number: int, table: dict[str, Any]) -> MotorPart:
        """The motor of a table. Raises Problem E441 where it has no name or source."""
        self._only((*_WORDS, *FIGURES), "motor", number, table)
        words = {key: self._text("motor", number, table, key) for key in _WORDS if key in table}
        for key, why in (("name", "`--drive` and `--load` call it so"), ("source", "say where its figures are from")):
            if not words.get(key):
                raise self.wrong(f"motor number {number + 1} has no `{key}`", why, "motor", number=number)
        figures = {key: self._figure(number, table, key) for key in FIGURES if key in table}
        return MotorPart(**words, figures=figures, file=self.name)

    def _only(self, known: tuple[str, ...], kind: str, number: int, table: dict[str, Any]) -> None:
        """Raise Problem E441 for a key that this kind of table does not have."""
        for key in table:
            if key not in known:
                helps = (*did_you_mean(key, known), f"a {kind} has {', '.join(known)}")
                raise self.wrong(f"a {kind} has no `{key}`", helps, kind, key, number)

    def _text(self, kind: str, number: int, table: dict[str, Any], key: str) -> str:
        """The text of a key of the motors' file. Raises Problem E441 where it is none in a line."""
        text = table.get(key)
        if not isinstance(text, str) or not text.isprintable():
            message = f"`{key}` of {kind} number {number + 1} is no text in a line"
            raise self.wrong(message, f'`{key} = "..."`', kind, key, number)
        return text

    def _figure(self, number: int, table: dict[str, Any], key: str) -> float:
        """A quantity above zero, SI."""
        unit, value = FIGURES[key], table[key]
        try:
            return quantity(value, unit)
        except ValueError:
            message = f"`{key}` is no quantity above zero in {unit}: {value!r}"
            raise self.wrong(message, f'write `{key} = "1.5 {unit}"`', "motor", key, number) from None
