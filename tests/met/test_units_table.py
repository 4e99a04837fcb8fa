"""Units against pint: the SI size and dimension of many written units, and which of them may stand for which.

pint takes an angle for a pure number. So it is asked for the size of everything, and for all of the dimension but the
angle; how angles compare is the contract's: the angle's exponent counts only where the rest is a power of time or
nothing.
"""

from __future__ import annotations

import itertools
import re

import pytest

from met.unit_parser import parse_unit
from met.units import UNITS, Dimension, counted, same
from tests.met.test_units import PINT_NAMES
from tests.oracles.package import Package

pint = Package("pint")

UNIT = re.compile(r"[A-Za-z]+|%")

WRITTEN = (
    # lengths, masses, times, and their powers
    "m", "km", "cm", "mm", "um", "mm^2", "cm^3", "1/m", "m^-1", "m/mm", "kg", "g", "t", "kg/m", "t/m^3", "g/cm^3",
    "s", "ms", "us", "min", "h", "1/s", "s^-1", "1/ms", "s^2", "1/h", "Hz", "kHz", "Hz*s", "kHz/s", "Hz^2",
    # angles alone and over time
    "rad", "mrad", "deg", "arcmin", "arcsec", "cycle", "deg^2", "rad/deg", "rad*rad", "rad/s", "deg/s", "mrad/ms",
    "arcsec/min", "cycle/s", "cycle/min", "cycle/h", "rpm", "rpm/s", "deg/s^2", "rad/s^2", "rad/s^3", "rad*Hz", "rad*s",
    # motion and force
    "m/s", "km/h", "mm/us", "m/s^2", "cm/min^2", "N", "mN", "kN", "kg*m/s^2", "g*m/s^2", "N/kg", "N*s", "kg*m/s",
    "N*m", "mN*m", "J", "kN*mm", "W*s", "kW*h", "N*m/s", "W", "kW", "N/m", "kN/mm", "N*s/m", "kg/s", "Pa", "N/mm^2",
    # turning
    "N*m*s", "N*m/rad", "N*m/deg", "N*m*s/rad", "mN*m/rpm", "N*m*s/deg", "kg*m^2", "g*cm^2", "kg*m^2/rad",
    "N*m*s^2", "N*m*s^2/rad", "kg*m^2/s", "W/rpm", "N*m*rad/s", "N*m*rpm", "cycle/mm", "rad/m", "m/rad", "mm/cycle",
    # electricity
    "A", "mA", "V", "mV", "kV", "W/A", "ohm", "mohm", "kohm", "V/A", "H", "mH", "uH", "V*s/A", "ohm*s", "F", "uF",
    "A*s/V", "s/ohm", "A*s", "V*A", "V*s", "V*s/rad", "mV/rpm", "V/rad", "mV/deg", "V/cycle", "N*m/A", "mN*m/mA",
    "kg*m^2/(A*s^2)", "N*m/(A*rad)", "N*m/ohm^2", "H/ohm", "ohm*F", "A^2*ohm", "V^2/ohm", "N/A", "(N*m/A)^2/ohm",
    # heat and shares
    "K", "W/K", "J/(kg*K)", "K/W", "1", "%", "%/s", "%/rad", "N*m/%",
)  # fmt: skip

WRONG_IN_PINT = (  # what pint takes for one another, and what is not one: an angular rate is no frequency
    ("Hz", "rad/s"), ("rpm", "Hz"), ("cycle/s", "Hz"), ("deg", "1"), ("rad", "%"), ("rad/s^2", "1/s^2"),
    ("rad/s^2", "Hz^2"), ("rad*rad", "rad"), ("deg^2", "1"), ("rad*s", "s"), ("%/rad", "1"),
)  # fmt: skip


@pytest.fixture(scope="module")
def registry() -> pint.UnitRegistry:
    return pint.UnitRegistry()


def in_pint(registry: pint.UnitRegistry, written: str) -> pint.Quantity:
    """One of this unit, in SI."""
    named = UNIT.sub(lambda match: PINT_NAMES.get(match[0], match[0]), written)
    return (registry.Quantity(1.0) * registry.parse_expression(named)).to_base_units()


@pytest.mark.release
@pytest.mark.oracle
@pytest.mark.parametrize("written", WRITTEN)
def test_a_written_unit_has_pints_size_and_dimension(written: str, registry: pint.UnitRegistry) -> None:
    theirs, mine = in_pint(registry, written), parse_unit(written)
    # the same few factors, multiplied in another order: a rounding each
    assert mine.scale == pytest.approx(theirs.magnitude, rel=2e-15 * len(UNIT.findall(written) or "1"))
    names = {"[length]": "m", "[mass]": "kg", "[time]": "s", "[current]": "A", "[temperature]": "K"}
    known = {names[name]: exponent for name, exponent in theirs.dimensionality.items()}
    assert mine.dimension._replace(rad=0) == Dimension(**known)


@pytest.mark.oracle
def test_one_unit_stands_for_another_where_pint_says_so_and_the_angle_does_not_count(
    registry: pint.UnitRegistry,
) -> None:
    dimensionality = {written: in_pint(registry, written).dimensionality for written in WRITTEN}
    for a, b in itertools.product(WRITTEN, repeat=2):
        mine = [parse_unit(each).dimension for each in (a, b)]
        rest = dict(dimensionality[a])
        angles_count = set(rest) <= {"[time]"}
        alike = dimensionality[a] == dimensionality[b] and (mine[0].rad == mine[1].rad or not angles_count)
        assert same(*mine) is alike, (a, b)


@pytest.mark.oracle
@pytest.mark.parametrize(("a", "b"), WRONG_IN_PINT)
def test_what_pint_takes_for_one_another_is_told_apart(a: str, b: str, registry: pint.UnitRegistry) -> None:
    assert in_pint(registry, a).dimensionality == in_pint(registry, b).dimensionality
    assert not same(parse_unit(a).dimension, parse_unit(b).dimension)


@pytest.mark.oracle
def test_a_newton_metre_without_its_sign_is_no_unit(registry: pint.UnitRegistry) -> None:
    # pint reads a unit of textiles, kilometres a kilogram
    assert registry.parse_expression("Nm").dimensionality == {"[length]": 1, "[mass]": -1}
    with pytest.raises(ValueError, match=r"`Nm` is not a unit; `N\*m`\?"):
        parse_unit("Nm")


@pytest.mark.slow
@pytest.mark.parametrize("angle", [name for name, unit in UNITS.items() if unit.measure.dimension == Dimension(rad=1)])
@pytest.mark.parametrize("rest", ["1", "s", "1/s", "1/s^2", "min^3", "Hz"])
@pytest.mark.parametrize(("power", "other"), [(1, 0), (1, 2), (-1, 1), (2, 3)])
def test_all_angles_are_one_dimension_and_counted_beside_a_power_of_time(
    angle: str, rest: str, power: int, other: int
) -> None:
    a, b = (parse_unit(f"{angle}^{n}*{rest}").dimension for n in (power, other))
    assert not same(a, b)
    assert same(a, parse_unit(f"rad^{power}*{rest}").dimension)
    assert counted(a).rad == power


@pytest.mark.parametrize("rest", ["m", "kg", "A", "K", "m/s", "N*m", "V", "ohm*s", "m^-2", "W/(K*s)"])
@pytest.mark.parametrize("power", [-2, -1, 1, 3])
def test_a_radian_is_one_beside_anything_else(rest: str, power: int) -> None:
    assert same(parse_unit(f"rad^{power}*{rest}").dimension, parse_unit(rest).dimension)
    assert parse_unit(f"cycle^{power}*{rest}").scale == pytest.approx(
        parse_unit("cycle").scale ** power * parse_unit(rest).scale, rel=1e-15 * 8
    )


def test_sixty_turns_a_minute() -> None:
    assert 60.0 * parse_unit("rpm").scale == pytest.approx(6.283185307179586, rel=1e-15)
    assert parse_unit("rpm").scale == pytest.approx(parse_unit("cycle/min").scale, rel=1e-15)
    assert same(parse_unit("rpm").dimension, parse_unit("rad/s").dimension)
