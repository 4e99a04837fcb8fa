"""Units: pint, which knows them independently, agrees with every row of the table; angles compare as contracts say."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest

from met import units
from met.unit_parser import parse_unit
from met.units import ALL_UNITS, ONE, UNITS, Dimension, same, text
from tests.oracles.package import Package

pint = Package("pint")

# what pint calls those that it names otherwise
PINT_NAMES = {
    "%": "percent",
    "cycle": "turn",
    "t": "metric_ton",
    "um": "micrometer",
    "us": "microsecond",
    "arcmin": "arcminute",
    "arcsec": "arcsecond",
    "mohm": "milliohm",
    "kohm": "kiloohm",
}


@pytest.fixture(scope="module")
def pint_registry():
    return pint.UnitRegistry()


@pytest.mark.release
@pytest.mark.oracle
@pytest.mark.parametrize("name", [n for n in ALL_UNITS if n not in ("rpm", "cycle", "rev", "Hz", "kHz", "MHz")])
def test_every_unit_has_the_size_and_dimension_that_pint_gives_it(name, pint_registry):
    quantity = pint_registry.Quantity(1.0, PINT_NAMES.get(name, name)).to_base_units()
    mine = ALL_UNITS[name].measure
    # pint multiplies the factors in another order than the table's constants do: a few roundings
    assert mine.scale == pytest.approx(quantity.to(_in_pint(mine.dimension, pint_registry)).magnitude, rel=1e-15 * 8)


def _in_pint(dimension: Dimension, registry):
    # pint takes an angle for a pure number, and pure is also what it must come out as
    product = registry.Quantity(1.0)
    for name, exponent in zip(("m", "kg", "s", "A", "K"), dimension[:5], strict=True):
        product = product * registry.Quantity(1.0, name) ** exponent
    return product.units


def test_turning_units_are_angles_a_time_and_hertz_is_not():
    # pint is no oracle here: it makes 1 Hz one rad/s
    assert parse_unit("rpm").scale == pytest.approx(2 * math.pi / 60, rel=1e-15)
    assert parse_unit("cycle").scale == pytest.approx(2 * math.pi, rel=1e-15)
    assert 60 * parse_unit("rpm").scale == pytest.approx(6.283185307179586, rel=1e-15)
    assert same(parse_unit("rpm").dimension, parse_unit("deg/s").dimension)
    assert not same(parse_unit("Hz").dimension, parse_unit("rpm").dimension)
    assert same(parse_unit("kHz").dimension, parse_unit("1/ms").dimension)


@pytest.mark.parametrize(
    ("a", "b", "alike"),
    [
        ("N*m/A", "V*s/rad", True),
        ("N*m", "J", True),
        ("N*m/rad", "N*m", True),
        ("V/rad", "V", True),
        ("W", "N*m*rad/s", True),
        ("rad", "1", False),
        ("rad/s", "1/s", False),
        ("rad/s^2", "rad/s", False),
        ("deg", "cycle", True),
        ("rad/m", "1/m", True),
        ("m", "1", False),
        ("%", "1", True),
    ],
)
def test_an_angle_counts_only_where_the_rest_is_time_or_nothing(a, b, alike):
    assert same(parse_unit(a).dimension, parse_unit(b).dimension) is alike


@pytest.mark.parametrize(
    ("written", "scale"),
    [
        ("1", 1.0),
        ("1/s", 1.0),
        ("mm^2", 1e-6),
        ("kg*m^2", 1.0),
        ("g*cm^2", 1e-7),
        ("N*m/(A*s)", 1.0),
        ("N*m/(mA*ms)", 1e6),
        ("1/(kg*mm^2)", 1e6),
        ("V / (rad / s)", 1.0),
        ("m^-2", 1.0),
        ("mm^-1", 1e3),
        ("(mm)^2", 1e-6),
    ],
)
def test_a_declared_unit_is_read_with_products_powers_and_parentheses(written, scale):
    # powers and products of the scales: a few roundings
    assert parse_unit(written).scale == pytest.approx(scale, rel=1e-15 * 8)


@pytest.mark.parametrize(
    "written", ["", "foo", "m*", "m/", "(m", "m)", "m^x", "m^99", "2*m", "m m", "m$", "m^", "*m", "()"]
)
def test_a_declared_unit_that_cannot_be_read_is_refused_by_name(written):
    with pytest.raises(ValueError, match="unit"):
        parse_unit(written)


def test_words_that_the_use_decides_can_be_given_a_meaning():
    joint = {"joint": parse_unit("rad")}
    assert parse_unit("rad/joint", joint).dimension == units.PURE
    assert parse_unit("rad/joint", {"joint": parse_unit("m")}).dimension == Dimension(rad=1, m=-1)


@pytest.mark.parametrize("name", [n for n in UNITS if n != "%"])
def test_the_text_of_a_dimension_reads_back_as_that_dimension(name):
    for exponent in (1, -1, 2):
        dimension = UNITS[name].measure.dimension ** exponent / Dimension(s=1)
        assert parse_unit(text(dimension)).dimension == dimension


def test_a_product_with_a_name_that_is_no_unit_is_refused():
    assert units.measure([("N", 1), ("m", 1), ("A", -1)]) == parse_unit("N*m/A")
    with pytest.raises(ValueError, match="foo"):
        units.measure([("foo", 1)])


def test_a_number_of_a_unit_is_written_so_that_it_reads_back_to_the_bit_in_the_fewest_digits():
    rng = random.Random(8)
    for name in ("deg", "rpm", "g", "kg*cm^2", "V*s/rad", "%", "1"):
        measure = parse_unit(name)
        for literal in ("0.05", "30", "1e+09", "2.5e-07", "-17.25", "1234567", "0.0001"):
            assert measure.decimal(measure.to_si(float(literal), literal.lstrip("-"))) == literal, name
        for _ in range(60):
            si = measure.scale * rng.uniform(-100.0, 100.0)
            text = measure.decimal(si)
            assert measure.to_si(float(text), text) == si and len(text.strip("-0.").replace(".", "")) <= 17, (si, name)
    assert [ONE.decimal(x) for x in (0.0, -0.0, 0.1 + 0.2, math.inf, 5e-324)] == [
        "0", "0", "0.30000000000000004", "inf", "5e-324"
    ]  # fmt: skip


PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803")
_IN_SI = {
    "m": "1", "km": "1000", "cm": "0.01", "mm": "0.001", "um": "0.000001", "kg": "1", "g": "0.001", "t": "1000",
    "s": "1", "ms": "0.001", "us": "0.000001", "ns": "0.000000001", "min": "60", "h": "3600", "rad": "1",
    "mrad": "0.001", "Hz": "1",
    "kHz": "1000", "N": "1", "mN": "0.001", "kN": "1000", "J": "1", "W": "1", "kW": "1000", "Pa": "1", "A": "1",
    "mA": "0.001", "V": "1", "mV": "0.001", "kV": "1000", "ohm": "1", "mohm": "0.001", "kohm": "1000", "H": "1",
    "mH": "0.001", "uH": "0.000001", "F": "1", "uF": "0.000001", "K": "1", "%": "0.01",
    "inch": "0.0254", "ft": "0.3048", "mg": "0.000001", "MHz": "1000000", "lbf": "4.4482216152605", "mW": "0.001",
    "kPa": "1000", "MPa": "1000000", "GPa": "1000000000",
}  # fmt: skip
EXACT = {
    **{name: Fraction(each) for name, each in _IN_SI.items()},
    "deg": PI / 180,
    "arcmin": PI / 10800,
    "arcsec": PI / 648000,
    "cycle": 2 * PI,
    "rpm": PI / 30,
    "rev": 2 * PI,
}


@pytest.mark.slow
def test_a_number_in_a_unit_is_the_double_nearest_to_the_product_of_what_is_written():
    """46,000 products against fractions, pi to 86 places; as they are written, and by what the number prints as."""
    assert set(EXACT) == set(ALL_UNITS)
    rng = random.Random(7)
    made = [f"{rng.uniform(0.0, 1000.0):.{rng.randrange(1, 7)}g}" for _ in range(1000)]
    literals = ["64.1", "0.7", "1e-3", "5.E2", ".25", "700", "0.30000000000000001", "9007199254740993", *made]
    for name, unit in ALL_UNITS.items():
        for literal in literals:
            wanted = float(Fraction(literal.rstrip(".")) * EXACT[name])
            assert unit.measure.to_si(float(literal), literal) == wanted, (literal, name)
            assert unit.measure.to_si(-float(literal), literal) == -wanted, (literal, name)
            if len(literal) < 16:
                assert unit.measure.to_si(float(literal)) == wanted, (literal, name)


def test_products_that_were_a_last_place_off():
    assert UNITS["km"].measure.to_si(64.1) == 64100.0
    assert UNITS["ms"].measure.to_si(700.0) == 0.7
    assert UNITS["deg"].measure.to_si(180.0) == math.pi
    assert parse_unit("g/cm^3").to_si(1.1) == 1100.0
    assert parse_unit("mV*s/rad").to_si(50.0) == 0.05


def test_a_computed_number_of_many_digits_is_the_double_that_it_is():
    third = 1.0 / 3.0
    assert UNITS["km"].measure.to_si(third) == float(Fraction(third) * 1000)


def test_what_no_double_holds_in_si_is_infinite_or_nothing():
    assert UNITS["km"].measure.to_si(-1e308) == -math.inf
    assert UNITS["mm"].measure.to_si(4.9e-324) == 0.0
    assert math.copysign(1.0, UNITS["mm"].measure.to_si(-0.0)) == -1.0
