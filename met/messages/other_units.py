"""Words that are not units of the table, and the units to write instead: for messages only.

A unit is proposed for a word only where both mean the same quantity of the same size. Otherwise the message explains
the word, and converts the number before it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from met.messages.message import nearest, write
from met.units import ALL_UNITS, UNITS, is_unit

LONGEST = 16  # longest word that is looked up
_FUZZY = 4  # fewest letters of a word that may be misspelt

_SAME: Mapping[str, str] = MappingProxyType({
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "msecs": "ms", "usec": "us", "hr": "h",
    "usecs": "us", "nsec": "ns", "nsecs": "ns",
    "hrs": "h", "hour": "h", "hours": "h", "mins": "min", "minute": "min", "minutes": "min", "meter": "m",
    "metre": "m", "meters": "m", "metres": "m", "micron": "um", "microns": "um", "degree": "deg", "degrees": "deg",
    "degs": "deg", "radian": "rad", "radians": "rad", "rads": "rad", "rev": "cycle", "revs": "cycle",
    "revolution": "cycle", "revolutions": "cycle", "turn": "cycle", "turns": "cycle", "cycles": "cycle", "RPM": "rpm",
    "rps": "cycle/s", "hz": "Hz", "HZ": "Hz", "khz": "kHz", "KHz": "kHz", "KHZ": "kHz", "KM": "km", "CM": "cm",
    "Ohm": "ohm", "ohms": "ohm", "Ohms": "ohm",
    "kOhm": "kohm", "mOhm": "mohm", "volt": "V", "volts": "V", "amp": "A", "amps": "A", "ampere": "A", "amperes": "A",
    "newton": "N", "newtons": "N", "watt": "W", "watts": "W", "joule": "J", "joules": "J", "kgs": "kg", "KG": "kg",
    "Kg": "kg", "gram": "g", "grams": "g", "tonnes": "t", "percent": "%", "pct": "%", "v": "V", "mv": "mV", "n": "N",
    "M": "m", "MM": "mm", "VA": "W", "coulomb": "A*s", "coulombs": "A*s", "Wb": "V*s", "weber": "V*s", "degK": "K",
    "asec": "arcsec", "amin": "arcmin", "in": "inch", "inches": "inch", "foot": "ft", "feet": "ft",
})  # fmt: skip

_SIZES: Mapping[str, int] = MappingProxyType({
    "T": 12, "G": 9, "M": 6, "k": 3, "h": 2, "da": 1, "d": -1, "c": -2, "m": -3, "u": -6, "n": -9, "p": -12,
})  # fmt: skip
_PREFIXED: Mapping[str, tuple[str, int]] = MappingProxyType(
    {name: (name, 0) for name in ("m", "s", "rad", "Hz", "N", "J", "W", "Pa", "A", "V", "ohm", "H", "F", "K")}
    | {name: (name, 0) for name in ("deg", "arcmin", "arcsec", "cycle", "rpm")}
    | {"g": ("kg", -3), "Ohm": ("ohm", 0), "bar": ("Pa", 5), "C": ("A*s", 0), "Wb": ("V*s", 0), "T": ("V*s/m^2", 0)}
    | {"S": ("ohm^-1", 0), "VA": ("W", 0), "Wh": ("W*h", 0), "Ah": ("A*h", 0), "Nm": ("N*m", 0), "l": ("m^3", -3)}
    | {"L": ("m^3", -3)}
)
"""Units that take prefixes, as units of the table and a power of ten."""

_OTHERS: Mapping[str, tuple[str, str, str]] = MappingProxyType({
    "yd": ("a yard", "0.9144", "m"), "mil": ("a thousandth of an inch", "2.54e-5", "m"),
    "thou": ("a thousandth of an inch", "2.54e-5", "m"), "mi": ("a mile", "1609.344", "m"),
    "mile": ("a mile", "1609.344", "m"), "miles": ("a mile", "1609.344", "m"), "nmi": ("a nautical mile", "1852", "m"),
    "mph": ("a mile an hour", "0.44704", "m/s"), "kph": ("a kilometre an hour", "1", "km/h"),
    "kmh": ("a kilometre an hour", "1", "km/h"), "knot": ("a knot", "1852", "m/h"),
    "knots": ("a knot", "1852", "m/h"), "kn": ("a knot", "1852", "m/h"),
    "lb": ("a pound", "0.45359237", "kg"), "lbs": ("a pound", "0.45359237", "kg"),
    "lbm": ("a pound", "0.45359237", "kg"), "oz": ("an ounce", "0.028349523125", "kg"),
    "ozin": ("an inch-ounce of force", "7.06155181422604375e-3", "N*m"), "dyne": ("a dyne", "1e-5", "N"),
    **dict.fromkeys(("lbft", "ftlb", "lbfft", "ftlbf"), ("a foot-pound of force", "1.3558179483314004", "N*m")),
    **dict.fromkeys(("lbin", "inlb", "lbfin", "inlbf"), ("an inch-pound of force", "0.1129848290276167", "N*m")),
    "kgfcm": ("a kilogram of force times a centimetre", "9.80665e-2", "N*m"),
    "mils": ("a thousandth of an inch", "2.54e-5", "m"),
    "kip": ("a thousand pounds of force", "4448.2216152605", "N"), "ksi": ("a thousand psi", "6894757.293168", "Pa"),
    **dict.fromkeys(("g0", "gee", "gn"), ("standard gravity", "9.80665", "m/s^2")),
    "slug": ("a slug", "14.59390294", "kg"), "ton": ("a ton of 2000 pounds", "907.18474", "kg"),
    "tons": ("a ton of 2000 pounds", "907.18474", "kg"),
    "ozf": ("an ounce of force", "0.27801385095378125", "N"), "kgf": ("a kilogram of force", "9.80665", "N"),
    "kp": ("a kilogram of force", "9.80665", "N"), "gf": ("a gram of force", "9.80665e-3", "N"),
    "dyn": ("a dyne", "1e-5", "N"), "psi": ("a pound of force on a square inch", "6894.757293168", "Pa"),
    "bar": ("a bar", "1e5", "Pa"), "atm": ("an atmosphere", "101325", "Pa"), "torr": ("a torr", "133.32236842", "Pa"),
    "Torr": ("a torr", "133.32236842", "Pa"), "mHg": ("a metre of mercury", "133322.387415", "Pa"),
    "mmHg": ("a millimetre of mercury", "133.322387415", "Pa"),
    "hp": ("a horsepower", "745.69987158227", "W"), "PS": ("a metric horsepower", "735.49875", "W"),
    "cal": ("a calorie", "4.184", "J"), "kcal": ("a kilocalorie", "4184", "J"), "Wh": ("a watt hour", "1", "W*h"),
    "kWh": ("a kilowatt hour", "1", "kW*h"), "eV": ("an electronvolt", "1.602176634e-19", "J"),
    "erg": ("an erg", "1e-7", "J"), "Ah": ("an ampere hour", "1", "A*h"), "mAh": ("a milliampere hour", "1", "mA*h"),
    "T": ("a tesla", "1", "V*s/m^2"), "tesla": ("a tesla", "1", "V*s/m^2"), "mT": ("a millitesla", "1", "mV*s/m^2"),
    "G": ("a gauss", "1e-4", "V*s/m^2"), "gauss": ("a gauss", "1e-4", "V*s/m^2"),
    "C": ("a coulomb", "1", "A*s"), "mho": ("a siemens", "1", "ohm^-1"),
    "S": ("a siemens", "1", "ohm^-1"), "siemens": ("a siemens", "1", "ohm^-1"),
    "mS": ("a millisiemens", "1", "kohm^-1"),
    "d": ("a day", "24", "h"), "day": ("a day", "24", "h"), "days": ("a day", "24", "h"),
    "wk": ("a week", "168", "h"), "week": ("a week", "168", "h"), "l": ("a litre", "1e-3", "m^3"),
    "L": ("a litre", "1e-3", "m^3"), "litre": ("a litre", "1e-3", "m^3"), "liter": ("a litre", "1e-3", "m^3"),
    "ml": ("a millilitre", "1", "cm^3"), "mL": ("a millilitre", "1", "cm^3"), "cc": ("a cubic centimetre", "1", "cm^3"),
    "P": ("a poise", "0.1", "Pa*s"), "cP": ("a centipoise", "1e-3", "Pa*s"), "gon": ("a gon", "0.9", "deg"),
    "grad": ("a gon", "0.9", "deg"), "cpm": ("a cycle a minute", "1", "cycle/min"),
    "cps": ("a cycle a second", "1", "cycle/s"), "bpm": ("a beat a minute", "1", "min^-1"),
    "ppm": ("a millionth", "1e-4", "%"), "Angstrom": ("an angstrom", "1e-10", "m"),
    "MHZ": ("a megahertz", "1e6", "Hz"), "mhz": ("a megahertz", "1e6", "Hz"),
    "Nms": ("a newton metre second", "1", "N*m*s"), "deg_s": ("a degree a second", "1", "deg/s"),
})  # fmt: skip
"""By word: its meaning, and its size as a number and a unit of the table."""

_NOT_HERE: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        **dict.fromkeys(
            ("degC", "Celsius", "celsius", "centigrade"),
            ("temperatures are in K: 0 degrees Celsius are 273.15 K", "a difference of 1 degree Celsius is 1 K"),
        ),
        **dict.fromkeys(
            ("degF", "Fahrenheit", "fahrenheit"),
            (
                "temperatures are in K: 32 degrees Fahrenheit are 273.15 K",
                "a difference of 1 degree Fahrenheit is 5/9 K",
            ),
        ),
        **dict.fromkeys(
            ("dB", "db", "dBm"), ("decibels are no unit here: write the ratio as a number, 20 dB as `10`",)
        ),
        **dict.fromkeys(
            ("k", "mega", "kilo", "milli", "micro"),
            ("a prefix stands in the unit's name, as in `kg`; for a pure number write `1e3`, `1e-3`",),
        ),
        **dict.fromkeys(("degR", "Rankine", "rankine"), ("temperatures are in K: 1 degree Rankine is 5/9 K",)),
        **dict.fromkeys(("KV", "Kv"), ("a kilovolt is a `kV`; what is called the KV of a motor is in `rpm/V`",)),
        **dict.fromkeys(("mol", "cd", "lm", "lx"), ("no unit of light or of an amount of substance is known here",)),
    }
)

_AS_FORCE: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("lb", "lbs"), "4.4482216152605"),
        "oz": "0.27801385095378125",
    }
)
"""Words for a mass that are also used for its weight, with their size in N."""

_NEVER_RUN_TOGETHER = ("t", "h", "K", "H", "F")  # `th`, `mHg`: such words are not products


def suggest(name: str) -> str | None:
    """The unit of the table with the same meaning and size: `sec` -> `s`, `Nm` -> `N*m`; None where there is none."""
    if name in _SAME:
        return _SAME[name]
    if name[:1] in ("\N{MICRO SIGN}", "\N{GREEK SMALL LETTER MU}"):
        name = f"u{name[1:]}"
        return name if is_unit(name) else suggest(name)
    if len(name) > LONGEST or name in _OTHERS or name in _NOT_HERE:
        return None
    prefixed = _with_prefix(name)
    if prefixed is not None:
        unit, power = prefixed
        return unit if power == 0 else None
    if name[0] == "K" and is_unit(f"k{name[1:]}"):
        return f"k{name[1:]}"
    if len(name) > 2 and name[-1] == name[-2] and is_unit(name[:-1]):
        return name[:-1]  # `kgg`: a key that was hit twice
    splits = _splits(name)
    if splits:
        return "*".join(splits[0]) if len(splits) == 1 else None
    whole = {unit.word: unit.name for unit in ALL_UNITS.values()}
    for word in (name.lower(), name.lower().removesuffix("s")):
        if word in whole:
            return whole[word]
    folded = [unit for unit in UNITS if unit.lower() == name.lower() and (unit[0] == name[0] or len(name) == 1)]
    if len(folded) == 1 and not (len(name) == 1 and name.isupper()):
        return folded[0]
    if name[:1] in _SIZES and is_unit(name[1:]):
        return None
    if len(name) >= _FUZZY:
        near = nearest(name, UNITS, cutoff=0.75)
        return near if near is not None and near[0] == name[0] and _one_slip(name, near) else None
    return next((unit for unit in UNITS if len(unit) > 2 and sorted(unit) == sorted(name)), None)


def _one_slip(word: str, unit: str) -> bool:
    """True where the two differ by one letter too many, too few or wrong, or by two swapped letters."""
    same = next(
        (i for i, pair in enumerate(zip(word, unit, strict=False)) if pair[0] != pair[1]), min(len(word), len(unit))
    )
    a, b = word[same:], unit[same:]
    return a[1:] in (b, b[1:]) or a == b[1:] or (a[1::-1] == b[:2] and a[2:] == b[2:])


def remedy(name: str, number: str = "", *, alone: bool = True) -> tuple[str, ...]:
    """Lines of help that say what to write for a word that is not a unit; none for an unknown word.

    number  what stands before it, as written; "" where none does
    alone   whether the word is the whole of the unit, or its first factor without an exponent
    """
    near = suggest(name)
    if near is not None:
        return (write(near, f"did you mean `{near}`?", old=name),)
    if name in _NOT_HERE:
        return _NOT_HERE[name]
    number = number if alone else ""
    if name in _OTHERS:
        what, size, unit = _OTHERS[name]
        new = f"{_times(number or '1', size)} {unit}"
        written = f"`{new}`"
        weight = f"`{_times(number or '1', _AS_FORCE[name])} N`" if name in _AS_FORCE else ""
        return (
            write(new, f"{what} is not in the table: write {written}", old=f"{number} {name}")
            if number
            else f"{what} is {written}: put that into the number",
            *([f"as a force it is {weight}"] if weight else []),
            *([_NOT_HERE["degC"][0]] if name == "C" else []),
        )
    prefixed = _with_prefix(name) if len(name) <= LONGEST else None
    if prefixed is not None:
        unit, power = prefixed
        new = f"{_shifted(number or '1', power)} {unit}"
        written = f"`{new}`"
        return (
            write(new, f"the table has no such prefix: write {written}", old=f"{number} {name}")
            if number
            else f"1 {name} is {written}: put that into the number",
        )
    splits = _splits(name) if len(name) <= LONGEST else []
    return (f"did you mean {' or '.join('`' + '*'.join(words) + '`' for words in splits[:3])}?",) if splits else ()


def _with_prefix(name: str) -> tuple[str, int] | None:
    """A prefix with a unit, as a unit of the table and a power of ten: `MHz` is Hz and 6."""
    prefix = "da" if name[:2] == "da" else name[:1].replace("K", "k")
    unit = name[len(prefix) :]
    if prefix not in _SIZES or unit not in _PREFIXED:
        return None
    if unit == "Nm" and is_unit(f"{prefix}N"):
        return f"{prefix}N*m", 0
    base, power = _PREFIXED[unit]
    if is_unit(f"{prefix}{base}"):
        return f"{prefix}{base}", 0
    return base, power + _SIZES[prefix]


def _splits(name: str) -> list[tuple[str, ...]]:
    """The ways in which a word is units without a sign between them, none of them twice; the shortest first.

    A letter that is a prefix too begins none: `mdeg` is not m*deg. A plural may be meant where the last is a second.
    """
    splits: list[tuple[str, ...]] = (
        [(name[:-1],)] if name.endswith("s") and len(name) > 2 and is_unit(name[:-1]) else []
    )
    for cut in range(1, len(name)):
        if is_unit(name[:cut]) and name[:cut] not in ("m", *_NEVER_RUN_TOGETHER):
            rest = name[cut:]
            splits += [(name[:cut], rest)] if is_unit(rest) and rest not in _NEVER_RUN_TOGETHER else []
            splits += [(name[:cut], *more) for more in _splits(rest) if 1 < len(more) < 3]
    return sorted((split for split in splits if len(set(split)) == len(split)), key=len)


def _times(number: str, factor: str) -> str:
    """The product of two decimals, exactly, as a deck writes it."""
    from decimal import Context, Decimal  # imported only after a mistake

    product = Context(prec=40).multiply(Decimal(number), Decimal(factor)).normalize()
    exponent = product.adjusted()
    return f"{product:f}" if -4 <= exponent <= 6 else re.sub(r"E\+?", "e", f"{product:E}")


def _shifted(number: str, power: int) -> str:
    """A decimal times a power of ten, with its digits as they are written: 2.5 by 6 is 2.5e6."""
    digits, _, exponent = number.lower().partition("e")
    power += int(exponent or 0)
    return f"{digits}e{power}" if power else digits
