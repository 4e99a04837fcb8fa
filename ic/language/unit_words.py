"""Units of declarations, such as `joint/s`, in the words of one use, `rad/s`."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache

from met import units
from met.plan import Joint, JointKind
from met.plan.channel import joint_unit
from met.unit_parser import parse_unit
from met.units import PURE, Dimension


def in_degrees(unit: str) -> tuple[str, ...]:
    """The usual ways to write a unit: `deg/s`, `rad/s`; for a unit without an angle only one."""
    return (unit.replace("rad", "deg", 1), unit) if re.fullmatch(r"rad(/s(\^\d)?)?", unit) else (unit,)


def either(texts: Iterable[str]) -> str:
    """Two texts in words, `30 deg` or `30 rad`, each in the quotes of deck text."""
    return " or ".join(f"`{text}`" for text in texts)


def units_of(dimension: Dimension) -> list[str]:
    """The units of the table that have this dimension."""
    return [name for name, unit in units.ALL_UNITS.items() if unit.measure.dimension == dimension]


@lru_cache(maxsize=4096)
def measure_here(written: str, joint: JointKind, command: str | None, of: str | None) -> units.Measure:
    """The SI measure of a declared unit, with these meanings of `joint`, `effort`, `command` and `of`."""
    names = {} if of is None else {"of": parse_unit(of)}
    return parse_unit(joint_unit(written, Joint("", joint, "", ""), command), names)


@lru_cache(maxsize=4096)
def unit_here(written: str, joint: JointKind, command: str | None, of: str | None) -> tuple[str, Dimension]:
    """A declared unit with these meanings of `joint`, `effort`, `command` and `of`: in SI, as text and as dimension."""
    text = joint_unit(written, Joint("", joint, "", ""), command)
    measure = measure_here(written, joint, command, of)
    if measure.dimension == PURE:
        return "1", PURE
    names = {"of"} if of is not None else set()
    simple = measure.scale == 1.0 and not names & set(text.replace("*", " ").replace("/", " ").split())
    return (text if simple else of if text == "of" and of else units.text(measure.dimension)), measure.dimension


def after_number(unit: str) -> str:
    """A unit as it stands after a number, with a space before it; "" of a pure number, whose unit is `1`."""
    return "" if unit == "1" else f" {unit}"
