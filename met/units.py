"""Units: a closed table, their dimensions and their size in SI.

A dimension is six small integers, the exponents of m, kg, s, A, K and rad. Angle is a dimension of its own, so that
60 rpm (rad/s) is not 60 Hz (1/s); but it is compared only where the rest is a power of time or nothing. Elsewhere a
radian counts as one, since N*m/A and V*s/rad are the same thing.

Units exist only until a plan is made; the plan is SI (angles in rad). There are no offsets (no degree Celsius) and no
prefixes beyond the tables. The names of `UNITS` are units wherever a deck writes values, and name nothing else there.
Those of `FURTHER_UNITS` came later: they are units only after a number or a unit, and a deck may give a value such a
name.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from decimal import Context, Decimal
from fractions import Fraction
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

from met.frozen import frozen


class Dimension(NamedTuple):
    """Exponents of the base units."""

    m: int = 0
    kg: int = 0
    s: int = 0
    A: int = 0
    K: int = 0
    rad: int = 0

    def __mul__(self, other: object) -> Dimension:
        if not isinstance(other, Dimension):
            return NotImplemented
        return Dimension(*(mine + theirs for mine, theirs in zip(self, other, strict=True)))

    def __truediv__(self, other: Dimension) -> Dimension:
        return Dimension(*(mine - theirs for mine, theirs in zip(self, other, strict=True)))

    def __pow__(self, exponent: int) -> Dimension:
        return Dimension(*(mine * exponent for mine in self))

    def __str__(self) -> str:
        return text(self)


# pi to 75 places: a product with it is rounded once, as one with a fraction is
_PI = 3141592653589793238462643383279502884197169399375105820974944592307816406286
_PI_BELOW = 10**75


@frozen
class Measure:
    """The meaning of a unit: its dimension, and its exact size in SI units, over / under * pi^turns.

    hertz  the exponent of the hertz in it: Hz and 1/s are one dimension, but only Hz says that it counts cycles
    """

    dimension: Dimension
    over: int = 1
    under: int = 1
    turns: int = 0
    hertz: int = 0

    @property
    def scale(self) -> float:
        """The unit's size in SI as a double. Raises OverflowError where that is too large."""
        return _divided(self.over, self.under, self.turns)

    @property
    def exact(self) -> Fraction:
        """The unit's size in SI, with pi to 75 places."""
        return Fraction(self.over, self.under) * Fraction(_PI, _PI_BELOW) ** self.turns

    def __mul__(self, other: Measure) -> Measure:
        """The measure of the product of two units."""
        over, under = self.over * other.over, self.under * other.under
        common = math.gcd(over, under)
        return Measure(
            self.dimension * other.dimension,
            over // common,
            under // common,
            self.turns + other.turns,
            self.hertz + other.hertz,
        )

    def __pow__(self, exponent: int) -> Measure:
        over, under = (self.over, self.under) if exponent >= 0 else (self.under, self.over)
        size = abs(exponent)
        return Measure(self.dimension**exponent, over**size, under**size, self.turns * exponent, self.hertz * exponent)

    def to_si(self, number: float, decimal: str = "") -> float:
        """A number of this unit converted to SI, rounded once: 64.1 km is 64100 m, and 700 ms the float that 0.7 is.

        decimal  how the number is written, its sign aside. Without it a number that prints with 15 digits or less is
                 the decimal that it prints as, and any other the double that it is.

        A recorded number is divided or multiplied directly. A result that is too large is infinite.
        """
        if not isinstance(number, float | int):
            return number * self.scale if self.turns or self.over != 1 else number / self.under
        if (self.over, self.under, self.turns) == (1, 1, 0) or number == 0.0 or not math.isfinite(number):
            return float(number)
        above, below = _exactly(number, decimal)
        try:
            size = _divided(above * self.over, below * self.under, self.turns)
        except OverflowError:
            size = math.inf
        return math.copysign(size, number)

    def decimal(self, si: float) -> str:
        """The shortest decimal number of this unit that `to_si` converts to this SI value: `0.05`, `-2.5e-07`.

        At most one decimal of 15 digits or less converts to a double, and always one of 17. An infinite value and
        not-a-number are as `repr` writes them.
        """
        si = float(si)
        if si == 0.0 or not math.isfinite(si):
            return f"{si + 0.0:g}"
        if (self.over, self.under, self.turns) == (1, 1, 0):
            return _plainly(Decimal(repr(si)))
        exact, text = _EXACTLY.multiply(Decimal(si), _units_in_si(self)), ""
        for rounding in _ROUNDINGS:
            text = _plainly(rounding.plus(exact))
            if self.to_si(float(text), text) == si:
                break
        return text


_EXACTLY = Context(prec=60)
_ROUNDINGS = tuple(Context(prec=digits) for digits in (15, 16, 17))


@lru_cache
def _units_in_si(measure: Measure) -> Decimal:
    """The number of this unit that makes one SI unit."""
    exact = 1 / measure.exact
    return _EXACTLY.divide(Decimal(exact.numerator), Decimal(exact.denominator))


def _plainly(number: Decimal) -> str:
    """A decimal without zeros at its end; with an exponent only below 1e-4 or from 1e7 on, where it is no longer so."""
    number = number.normalize()
    plain, power = format(number, "f"), number.adjusted()
    if -5 < power < 7:
        return plain
    digits = "".join(map(str, number.as_tuple().digits))
    rest = f".{digits[1:]}" if digits[1:] else ""
    return min(f"{'-' * number.is_signed()}{digits[0]}{rest}e{power:+03d}", plain, key=len)


def fraction(decimal: str) -> tuple[int, int]:
    """The exact fraction of a decimal such as `-1.5e-3`, as numerator and denominator, not reduced."""
    digits, _, power = decimal.lower().partition("e")
    whole, _, rest = digits.partition(".")
    exponent = int(power or 0) - len(rest)
    return int(whole + rest) * 10 ** max(exponent, 0), 10 ** max(-exponent, 0)


def _exactly(number: float, decimal: str) -> tuple[int, int]:
    """The exact size of a number as numerator and denominator (`Measure.to_si`)."""
    shortest = repr(abs(float(number)))
    digits = shortest.partition("e")[0].replace(".", "").strip("0")
    if decimal or len(digits) <= sys.float_info.dig:
        return fraction(decimal.lstrip("+-") or shortest)
    return abs(number).as_integer_ratio()


def _divided(over: int, under: int, turns: int) -> float:
    """The double nearest to over / under * pi^turns. (Python divides whole numbers of any size and rounds once.)"""
    if turns > 0:
        over, under = over * _PI**turns, under * _PI_BELOW**turns
    elif turns < 0:
        over, under = over * _PI_BELOW**-turns, under * _PI**-turns
    return over / under


@frozen
class NamedUnit:
    """A row of the table: the name in decks, the word in messages, and the meaning."""

    name: str
    word: str
    measure: Measure


PURE = Dimension()
ONE = Measure(PURE)

_LENGTH = Dimension(m=1)
_MASS = Dimension(kg=1)
_TIME = Dimension(s=1)
_CURRENT = Dimension(A=1)
_ANGLE = Dimension(rad=1)
_FORCE = _MASS * _LENGTH / _TIME**2
_ENERGY = _FORCE * _LENGTH
_POWER = _ENERGY / _TIME
_VOLTAGE = _POWER / _CURRENT
_RESISTANCE = _VOLTAGE / _CURRENT
_INDUCTANCE = _RESISTANCE * _TIME
_CAPACITANCE = _TIME / _RESISTANCE
_PRESSURE = _FORCE / _LENGTH**2

_ROWS: tuple[tuple[str, str, Dimension, int, int], ...] = (
    ("m", "metre", _LENGTH, 1, 1),
    ("km", "kilometre", _LENGTH, 1000, 1),
    ("cm", "centimetre", _LENGTH, 1, 100),
    ("mm", "millimetre", _LENGTH, 1, 1000),
    ("um", "micrometre", _LENGTH, 1, 1_000_000),
    ("kg", "kilogram", _MASS, 1, 1),
    ("g", "gram", _MASS, 1, 1000),
    ("t", "tonne", _MASS, 1000, 1),
    ("s", "second", _TIME, 1, 1),
    ("ms", "millisecond", _TIME, 1, 1000),
    ("us", "microsecond", _TIME, 1, 1_000_000),
    ("min", "minute", _TIME, 60, 1),
    ("h", "hour", _TIME, 3600, 1),
    ("rad", "radian", _ANGLE, 1, 1),
    ("mrad", "milliradian", _ANGLE, 1, 1000),
    ("deg", "degree", _ANGLE, 1, 180),
    ("arcmin", "minute of arc", _ANGLE, 1, 10800),
    ("arcsec", "second of arc", _ANGLE, 1, 648_000),
    ("cycle", "cycle", _ANGLE, 2, 1),
    ("rpm", "cycle a minute", _ANGLE / _TIME, 1, 30),
    ("Hz", "hertz", _TIME**-1, 1, 1),
    ("kHz", "kilohertz", _TIME**-1, 1000, 1),
    ("N", "newton", _FORCE, 1, 1),
    ("mN", "millinewton", _FORCE, 1, 1000),
    ("kN", "kilonewton", _FORCE, 1000, 1),
    ("J", "joule", _ENERGY, 1, 1),
    ("W", "watt", _POWER, 1, 1),
    ("kW", "kilowatt", _POWER, 1000, 1),
    ("Pa", "pascal", _PRESSURE, 1, 1),
    ("A", "ampere", _CURRENT, 1, 1),
    ("mA", "milliampere", _CURRENT, 1, 1000),
    ("V", "volt", _VOLTAGE, 1, 1),
    ("mV", "millivolt", _VOLTAGE, 1, 1000),
    ("kV", "kilovolt", _VOLTAGE, 1000, 1),
    ("ohm", "ohm", _RESISTANCE, 1, 1),
    ("mohm", "milliohm", _RESISTANCE, 1, 1000),
    ("kohm", "kiloohm", _RESISTANCE, 1000, 1),
    ("H", "henry", _INDUCTANCE, 1, 1),
    ("mH", "millihenry", _INDUCTANCE, 1, 1000),
    ("uH", "microhenry", _INDUCTANCE, 1, 1_000_000),
    ("F", "farad", _CAPACITANCE, 1, 1),
    ("uF", "microfarad", _CAPACITANCE, 1, 1_000_000),
    ("K", "kelvin", Dimension(K=1), 1, 1),
    ("%", "per cent", PURE, 1, 100),
)
"""Name, word, dimension, and size in SI units as numerator and denominator; some angles are that many times pi."""

_FURTHER_ROWS: tuple[tuple[str, str, Dimension, int, int], ...] = (
    ("inch", "inch", _LENGTH, 254, 10_000),
    ("ft", "foot", _LENGTH, 3048, 10_000),
    ("mg", "milligram", _MASS, 1, 1_000_000),
    ("ns", "nanosecond", _TIME, 1, 10**9),
    ("rev", "revolution, a cycle", _ANGLE, 2, 1),
    ("MHz", "megahertz", _TIME**-1, 1_000_000, 1),
    ("lbf", "pound of force", _FORCE, 44_482_216_152_605, 10**13),
    ("mW", "milliwatt", _POWER, 1, 1000),
    ("kPa", "kilopascal", _PRESSURE, 1000, 1),
    ("MPa", "megapascal", _PRESSURE, 1_000_000, 1),
    ("GPa", "gigapascal", _PRESSURE, 10**9, 1),
)
"""Rows, like those of `_ROWS`, of units that give way to names of a deck. Inch and pound are those of 1959, which are
exact."""

_OF_PI = frozenset({"deg", "arcmin", "arcsec", "cycle", "rpm", "rev"})
_OF_HERTZ = frozenset({"Hz", "kHz", "MHz"})


def _named(rows: Iterable[tuple[str, str, Dimension, int, int]]) -> Mapping[str, NamedUnit]:
    return MappingProxyType(
        {
            name: NamedUnit(name, word, Measure(dimension, over, under, int(name in _OF_PI), int(name in _OF_HERTZ)))
            for name, word, dimension, over, under in rows
        }
    )


UNITS = _named(_ROWS)
"""Units whose names are reserved where values stand."""

FURTHER_UNITS = _named(_FURTHER_ROWS)
"""Units that count only after a number or a unit, where the deck does not use the name otherwise."""

ALL_UNITS: Mapping[str, NamedUnit] = MappingProxyType({**UNITS, **FURTHER_UNITS})

_SPOKEN: Mapping[Dimension, str] = MappingProxyType(
    {
        _ENERGY / _CURRENT: "N*m/A",
        _VOLTAGE * _TIME / _ANGLE: "V*s/rad",
        _VOLTAGE / _ANGLE: "V/rad",
        _ENERGY * _TIME / _ANGLE: "N*m*s/rad",
        _MASS * _LENGTH**2: "kg*m^2",
        _FORCE: "N",
        _ENERGY: "N*m",
        _POWER: "W",
        _VOLTAGE: "V",
        _RESISTANCE: "ohm",
        _INDUCTANCE: "H",
        _CAPACITANCE: "F",
        _PRESSURE: "Pa",
        _FORCE / _LENGTH: "N/m",
        _FORCE * _TIME / _LENGTH: "N*s/m",
        _VOLTAGE / _TIME: "V/s",
        _FORCE / _TIME: "N/s",
        _FORCE / _CURRENT: "N/A",
        _ENERGY / _ANGLE: "N*m/rad",
    }
)
"""Words for dimensions that would be hard to read in base units."""


def is_unit(name: str) -> bool:
    """True where a word is the name of a unit, and so cannot name a value in a deck."""
    return name in UNITS


def measure(factors: Iterable[tuple[str, int]], declared: Mapping[str, Measure] = MappingProxyType({})) -> Measure:
    """The meaning of a product of units, (name, exponent) each; ValueError for a name that is no unit. declared: units
    of a deck's own."""
    named = tuple(factors)
    return _product(named, declared) if declared else _known_product(named)


@lru_cache(maxsize=1024)
def _known_product(factors: tuple[tuple[str, int], ...]) -> Measure:
    return _product(factors, {})


def _product(factors: Iterable[tuple[str, int]], declared: Mapping[str, Measure]) -> Measure:
    """The measure of a product of units with exponents. Raises ValueError for an unknown unit."""
    result = ONE
    for name, exponent in factors:
        if name not in ALL_UNITS and name not in declared:
            raise ValueError(f"`{name}` is not a unit")
        result = result * (ALL_UNITS[name].measure if name in ALL_UNITS else declared[name]) ** exponent
    return result


def counted(dimension: Dimension) -> Dimension:
    """The dimension for comparisons: without the angle, unless the rest is a power of time or nothing."""
    if dimension.m or dimension.kg or dimension.A or dimension.K:
        return dimension._replace(rad=0)
    return dimension


def same(a: Dimension, b: Dimension) -> bool:
    """True where a quantity of dimension `a` may stand where `b` is wanted."""
    return counted(a) == counted(b)


def size_in_si(measure: Measure) -> str:
    """The size of a unit in SI, as a deck would write it: `0.007061552 N*m`."""
    unit = text(measure.dimension)
    return f"{measure.scale:.10g}" + (f" {unit}" if unit != "1" else "")


def text(dimension: Dimension) -> str:
    """The dimension in SI units, as a deck would write it: `N*m`, `rad/s`, `1` for a pure number."""
    spoken = _SPOKEN.get(dimension)
    if spoken is not None:
        return spoken
    exponents = [(name, getattr(dimension, name)) for name in ("kg", "m", "s", "A", "K", "rad")]
    above = [_power(name, e) for name, e in exponents if e > 0]
    below = [_power(name, -e) for name, e in exponents if e < 0]
    if not below:
        return "*".join(above) or "1"
    divisor = below[0] if len(below) == 1 else f"({'*'.join(below)})"
    return f"{'*'.join(above) or '1'}/{divisor}"


def _power(name: str, exponent: int) -> str:
    return name if exponent == 1 else f"{name}^{exponent}"
