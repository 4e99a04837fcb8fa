"""Units with another angle than the declared one: a hertz in place of radians or decays, and the reverse. None of these
is an error.

Hz and 1/s are one dimension, and beside metres or kilograms a radian counts as one. So `bandwidth = 5 Hz` is taken as
5 1/s, and a volt for each hertz as a volt for each radian a second: less by 2 pi than cycles would be.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ic.grammar.syntax import Expression, List, Number, Unit, WithUnit
from ic.language.unit_words import in_degrees, units_of
from ic.meaning.definitions.merge import Item
from ic.meaning.expressions.quantity import Value, measure_of
from met import units
from met.diagnostic import Help, write
from met.frozen import frozen
from met.trace import Scalar
from met.unit_parser import parse_unit
from met.units import ONE, PURE, Dimension, Measure


def components(item: Item | None, count: int) -> tuple[Expression | None, ...]:
    """The expressions of a list's `count` numbers; None for each where the item writes no such list."""
    written = item.value if item is not None and not item.appended else None
    unit = written.unit if isinstance(written, WithUnit) else None
    listed = written.inner if isinstance(written, WithUnit) else written
    if not isinstance(listed, List):
        return (None,) * count
    parts: list[Expression | None] = []
    for part in listed.items:
        if unit is not None:
            part = replace(part, unit=unit) if isinstance(part, Number) else WithUnit(part, unit, part.place)
        parts.append(part)
    return (*parts, *[None] * (count - len(parts)))


def unit_remedy(value: Value, text: str, dimension: Dimension) -> Help:
    """The remedy where a value has the wrong dimension."""
    number = None if isinstance(value.number, Scalar) else float(value.number)
    if dimension == PURE:
        return Help("leave the unit out; `%` is the only unit of a pure number")
    if value.dimension == Dimension(s=-1) and dimension == Dimension(s=-1, rad=1):
        return Help("Hz counts cycles without an angle: write rad/s, deg/s, rpm or cycle/s")
    if value.dimension == Dimension(s=-1, rad=1) and dimension == Dimension(s=-1):
        if text == "Hz":
            why = "a frequency counts cycles, without an angle"
            hertz = "" if number is None else f"{ONE.decimal(number / (2.0 * math.pi))} Hz"
            return write(hertz, f"{why}: write `{hertz}`", where="value") if hertz else Help(why)
        if number is None:
            return Help(f"leave the angle out: write `... {text}`")
        same = f"{ONE.decimal(number)} {text}"
        return write(same, f"leave the angle out: write `{same}`", where="value")
    known = list(dict.fromkeys((text, *sorted(in_degrees(text)), *units_of(dimension))))
    return Help(f"write it in {', '.join(known[:-1])} or {known[-1]}" if len(known) > 1 else f"write it in {known[0]}")


_RATE = Dimension(s=-1)
_FLUX = parse_unit("V*s").dimension  # of a motor's constant: V*s/rad and N*m/A are one thing


@frozen
class AmbiguousUnit:
    """A unit that may be a mistake: the assumed meaning, and the text to write for each possible meaning."""

    taken: str
    helps: tuple[str, ...]


def ambiguous_unit(value: Value, text: str, wanted: Measure) -> AmbiguousUnit | None:
    """The other possible meaning of a value whose dimension is right; None where there is none.

    text, wanted  the unit that is declared, in SI, as text and as what it means
    """
    mine, declared = value.dimension, wanted.dimension
    if value.hertz is None:
        return None
    if value.hertz != wanted.hertz:
        if mine.rad and mine == declared and not (mine.kg or mine.m or mine.A or mine.K):
            return None  # an angle times a frequency: 15 deg * 2 Hz
        if wanted.hertz:
            return _no_hertz(value) if mine == declared == _RATE and not value.hertz else None
        if declared.rad:
            return _hertz_for_rad(value, text)
        return _hertz_for_rate(value) if declared == mine == _RATE else None
    if mine.rad == declared.rad:
        return None
    if declared.rad and not mine.rad:
        plain = not (declared.kg or declared.A or declared.K)
        return _no_angle(value, text, declared.rad) if plain and declared.m else None
    if not declared.rad and _unit(value) is not None and declared not in (_FLUX, units.PURE):
        return _angle_for_none(value, text)
    return None


def _hertz_for_rate(value: Value) -> AmbiguousUnit:
    """The two meanings of a value in Hz where 1/s is wanted, with what to write for each."""
    number = _number(value)
    if isinstance(value.number, Scalar):
        return AmbiguousUnit(
            "in 1/s, and Hz is taken as 1/s",
            ("if that is meant, write `1/s`", "if cycles a second are meant, write `1/s`, and 2 pi times each number"),
        )
    return AmbiguousUnit(
        f"in 1/s, and {_written(value)} is taken as {number} 1/s",
        (
            _write("if that is meant", f"{number} 1/s"),
            _write("if cycles a second are meant", f"(2*pi*{number}) 1/s"),
        ),
    )


def _no_hertz(value: Value) -> AmbiguousUnit | None:
    """The two meanings of a value in 1/s where Hz is wanted; None of one that was computed, as from a period."""
    if _unit(value) is None:
        return None
    number = _number(value)
    if isinstance(value.number, Scalar):
        return AmbiguousUnit(
            "in Hz, and 1/s is taken as Hz, cycles a second",
            (
                "if that is meant, write `Hz`",
                "if radians a second are meant, write `Hz`, and each number divided by 2 pi",
            ),
        )
    return AmbiguousUnit(
        f"in Hz, and {_written(value)} is taken as {number} Hz, cycles a second",
        (
            _write("if that is meant", f"{number} Hz"),
            _write("if radians a second are meant", f"({number}/(2*pi)) Hz"),
        ),
    )


def _hertz_for_rad(value: Value, text: str) -> AmbiguousUnit:
    """The two meanings of a value in a unit with Hz, such as V/Hz, where one with rad, V*s/rad, is wanted, with what to
    write for each."""
    unit = _unit(value)
    if unit is not None and "kHz" not in unit.text:
        number = _in(value, measure_of(unit))
        helps: tuple[str, ...] = (
            _write("if that is meant", f"{number} {unit.text.replace('Hz', '(rad/s)')}"),
            _write("if cycles a second are meant", f"{number} {unit.text.replace('Hz', '(cycle/s)')}"),
        )
    else:
        helps = (
            _write("if that is meant", f"{_number(value)} {text}"),
            "if cycles a second are meant, write `cycle/s` in the place of the hertz",
        )
    return AmbiguousUnit(f"in {text}, and {_written(value)} is taken as {_number(value)} {text}", helps)


def _no_angle(value: Value, text: str, power: int) -> AmbiguousUnit:
    """The two meanings of a value without an angle, such as 1/mm, where a unit with rad, rad/m, is wanted, with what to
    write for radians and for turns. power: of the missing rad."""
    unit = _unit(value)
    number = _in(value, ONE if unit is None else measure_of(unit))
    plain = unit.text if unit is not None else units.text(value.dimension)

    def angled(angle: str) -> str:
        """The value as a deck writes it with this angle's unit in the place where the angle is missing."""
        angle = angle if abs(power) == 1 else f"{angle}^{abs(power)}"
        if power < 0:
            return f"{number} {plain}/{angle}"
        return f"{number} {angle}{plain[1:]}" if plain.startswith("1/") else f"{number} {angle}*{plain}"

    return AmbiguousUnit(
        f"in {text}, and {_written(value)} is taken as {_number(value)} {text}",
        (_write("if that is meant", angled("rad")), _write("if turns are meant", angled("cycle"))),
    )


def _angle_for_none(value: Value, text: str) -> AmbiguousUnit | None:
    """The meaning of a value in 1/cycle or 1/deg where no angle is wanted, which counts in radians; None of others."""
    unit = _unit(value)
    if unit is None or not measure_of(unit).turns:
        return None
    number = _number(value)
    return AmbiguousUnit(
        f"in {text}, and {_written(value)} is taken as {number} {text}: angles count in radians",
        (write(f"{number} {text}", where="value"),),
    )


def _write(condition: str, new: str) -> Help:
    return write(new, f"{condition}, write `{new}`", where="value")


def _unit(value: Value) -> Unit | None:
    """The unit in which the whole value is written; None for a computed value."""
    unit = value.unit
    if unit is None or not unit.factors or measure_of(unit).dimension != value.dimension:
        return None
    return unit


def _number(value: Value) -> str:
    """The number in SI, in a deck's notation; `[...]` where a sweep varies it."""
    return _in(value, ONE)


def _in(value: Value, measure: Measure) -> str:
    """The number in this unit, in a deck's notation; `[...]` where a sweep varies it."""
    return "[...]" if isinstance(value.number, Scalar) else measure.decimal(value.number)


def _written(value: Value) -> str:
    """A value as the deck writes it, with its unit."""
    unit = _unit(value)
    if unit is not None:
        return f"{_in(value, measure_of(unit))} {unit.text}"
    return f"{_number(value)} {units.text(value.dimension)}" if not value.hertz else "a number with Hz in its unit"
