"""What is proposed for a word that is no unit is of the same size, by pint; else it is said what to write."""

from __future__ import annotations

import pytest

from met.messages.other_units import remedy, suggest
from met.unit_parser import parse_unit
from met.units import UNITS
from tests.oracles.package import Package

pint = Package("pint")

PREFIXES = ("G", "M", "k", "h", "d", "c", "m", "u", "n", "p")
FOREIGN = """
    in inch inches ft foot yd mil thou mile nmi mph kph knot lb lbs oz slug lbf ozf kgf dyn psi bar atm torr mmHg hp PS
    cal kcal Wh kWh eV erg Ah mAh T mT S mS d day week l L ml cc P cP gon grad rps ppm degC degF C Wb sec secs hours
    degrees turns volts newton joule Nms mNm kNm rads
    MNm uNm daN THz uS mho KN KW KV Km degK degR uC mT uT mWb MWh kip ksi ozin lbft lbin kgfcm dyne mils
"""
OTHERWISE = {"M", "MM", "G", "PA", "KV", "a", "ma", "k", "kn", "mrads", "mh", "uh"}
# what pint takes for a constant, a year, a molar, thousandths of an hour
WORDS = [
    *(prefix + unit for prefix in PREFIXES for unit in (*UNITS, "Ohm", "Nm") if unit != "%"),
    *(unit.upper() for unit in UNITS),
    *(unit.lower() for unit in UNITS),
    *(unit + "s" for unit in UNITS),
    *FOREIGN.split(),
]
PINT = {
    "in": "inch", "mil": "thou", "lbs": "lb", "PS": "metric_horsepower", "l": "liter", "L": "liter", "rps": "turn/s",
    "ml": "milliliter", "P": "poise", "cP": "centipoise", "G": "gauss", "gon": "grade", "grad": "grade", "d": "day",
    "ton": "short_ton", "kph": "km/hour", "C": "coulomb", "t": "metric_ton", "mAh": "mA*hour", "Ah": "A*hour",
    "Wh": "W*hour", "kWh": "kW*hour", "Nm": "N*m", "Nms": "N*m*s", "mNm": "mN*m", "kNm": "kN*m", "ozf": "force_ounce",
    "deg": "degree", "cycle": "turn", "lb": "pound", "hp": "horsepower", "min": "minute", "h": "hour", "rads": "rad",
    "mph": "mile/hour", "knot": "knot", "%": "percent", "Torr": "torr", "mil_": "thou", "T": "tesla", "m%": "percent",
    "KN": "kN", "KW": "kW", "Km": "km", "degK": "K", "uC": "microcoulomb", "MWh": "MW*hour", "MNm": "MN*m",
    "uNm": "uN*m", "mWb": "mV*s", "kip": "kip", "ksi": "ksi", "ozin": "force_ounce*inch",
    **{f"{p}Nm": f"{p}N*m" for p in PREFIXES}, "lbft": "force_pound*foot",
    "lbin": "force_pound*inch", "kgfcm": "kgf*cm", "mils": "thou", "uT": "microtesla", "uS": "microsiemens",
    "cc": "cm^3", "dyn": "dyne", "S": "siemens", "mS": "millisiemens", "mT": "millitesla",
}  # fmt: skip


@pytest.fixture(scope="module")
def registry() -> pint.UnitRegistry:
    return pint.UnitRegistry()


def _in_pint(written: str, registry: pint.UnitRegistry) -> pint.Quantity:
    measure = parse_unit(written)
    base = registry.Quantity(measure.scale)
    for name, exponent in zip(("m", "kg", "s", "A", "K"), measure.dimension[:5], strict=True):
        base = base * registry.Quantity(1.0, name) ** exponent
    return base


@pytest.mark.slow
@pytest.mark.oracle
@pytest.mark.parametrize("word", sorted({*WORDS} - {*UNITS, *OTHERWISE}))
def test_what_is_proposed_has_the_size_and_the_kind_that_pint_gives_the_word(
    word: str, registry: pint.UnitRegistry
) -> None:
    """Of words that pint knows, spelt as they are; an offset of a temperature is never mended."""
    try:
        meant = registry.Quantity(2.0, PINT.get(word, word)).to_base_units()
    except (pint.UndefinedUnitError, pint.OffsetUnitCalculusError):
        return
    for help in remedy(word, "2"):
        quoted = help.partition("`")[2].partition("`")[0]
        if (
            word in ("degC", "degF", "degR")
            or "temperatures" in help
            or "as a force" in help
            or help.startswith(("no unit", "a prefix"))
        ):
            assert "did you mean" not in help
            continue
        number, _, unit = quoted.partition(" ") if quoted[:1].isdigit() else ("2", "", quoted)
        mine = float(number) * _in_pint(unit, registry)
        assert mine.check(meant.dimensionality), (word, help, meant)
        assert mine.to(meant.units).magnitude == pytest.approx(meant.magnitude, rel=1e-9), (word, help, meant)


@pytest.mark.parametrize(("word", "told"), [
    ("MHz", "the table has no such prefix: write `2e6 Hz`"),
    ("kPa", "the table has no such prefix: write `2e3 Pa`"),
    ("mW", "the table has no such prefix: write `2e-3 W`"),
    ("mg", "the table has no such prefix: write `2e-6 kg`"),
    ("in", "did you mean `inch`?"),
    ("yd", "a yard is not in the table: write `1.8288 m`"),
    ("psi", "a pound of force on a square inch is not in the table: write `13789.514586336 Pa`"),
    ("T", "a tesla is not in the table: write `2 V*s/m^2`"),
    ("S", "a siemens is not in the table: write `2 ohm^-1`"),
    ("kOhm", "did you mean `kohm`?"),
    ("sec", "did you mean `s`?"),
])  # fmt: skip
def test_what_is_said_of_a_word_behind_a_2(word: str, told: str) -> None:
    assert remedy(word, "2") == (told,)


def test_of_a_word_without_its_number_the_size_is_said() -> None:
    assert remedy("MHz", "2", alone=False) == ("1 MHz is `1e6 Hz`: put that into the number",)
    assert remedy("yd") == ("a yard is `0.9144 m`: put that into the number",)
    assert remedy("degC", "20")[0] == "temperatures are in K: 0 degrees Celsius are 273.15 K"


@pytest.mark.parametrize(("number", "told"), [
    ("2.50", "2.50e6 Hz"), ("1e3", "1e9 Hz"), (".5", ".5e6 Hz"), ("3E-6", "3 Hz"), ("64.1", "64.1e6 Hz"),
])  # fmt: skip
def test_the_digits_stay_as_they_are_written(number: str, told: str) -> None:
    assert remedy("MHz", number) == (f"the table has no such prefix: write `{told}`",)


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("sec", "s"),
        ("Nm", "N*m"),
        ("Ohm", "ohm"),
        ("degrees", "deg"),
        ("RPM", "rpm"),
        ("kgs", "kg"),
        ("Metre", "m"),
        ("hz", "Hz"),
        ("radd", "rad"),
        ("elephant", None),
        ("x" * 500, None),
        ("foo", None),
        ("am", None),
        ("th", None),
        ("At", None),
        ("mfarad", None),
        ("minHg", None),
        ("minch", None),
        ("mho", None),
        ("uS", None),
        ("degR", None),
        ("KV", None),
        ("KN", "kN"),
        ("mNm", "mN*m"),
        ("MNm", None),
        ("asec", "arcsec"),
    ],
)
def test_a_word_that_is_no_unit_gets_the_unit_that_was_meant(wrong: str, right: str | None) -> None:
    assert suggest(wrong) == right


def test_a_key_that_was_hit_twice_is_no_product_of_units() -> None:
    assert [suggest(word) for word in ("kgg", "radd", "Nmm", "mss")] == ["kg", "rad", "N*mm", "ms"]
