"""Words in values and sweeps, for `met doc`: functions, designs, distributions.

The names, and what each takes, are those that the compiler reads by; here stands what they mean.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

from ic.meaning.definitions.row_tables import CSV
from ic.meaning.expressions.evaluate import CONSTANTS, FUNCTIONS, USAGE
from ic.printing.wrapping import described, terminal_width
from ic.sweeps.designs import AT_MOST, DESIGNS, DIGITS, DISTRIBUTIONS, UNTIL_SHOWN
from met.frozen import frozen
from met.units import ONE

Row = tuple[str, str, str]
"""A name, its syntax, and its meaning."""

OF_FUNCTIONS: Mapping[str, str] = MappingProxyType({
    "sqrt": "square root of a value and of its unit",
    "sin": "sine of an angle, or of a pure number in radians",
    "cos": "cosine of an angle, or of a pure number in radians",
    "min": "smallest of two or more values of one dimension",
    "max": "largest of two or more values of one dimension",
    "linspace": "evenly spaced values, both ends included",
    "logspace": "values with a constant ratio, both ends included; `from` and `to` are values, not exponents",
    "abs": "absolute value",
    "tan": "tangent of an angle, or of a pure number in radians",
    "asin": "angle whose sine is x",
    "acos": "angle whose cosine is x",
    "atan": "angle whose tangent is x",
    "atan2": "angle of the point (x, y), whose coordinates have the same dimension",
    "exp": "exponential function of a pure number",
    "log": "natural logarithm of a pure number",
    "tanh": "hyperbolic tangent of a pure number",
    "floor": "largest whole number not above the pure number x",
    "ceil": "smallest whole number not below the pure number x",
    "round": "whole number nearest to the pure number x; halves are rounded away from zero",
    "sign": "sign of a value of any dimension: 1, 0 or -1",
})  # fmt: skip

OF_DESIGNS: Mapping[str, str] = MappingProxyType(
    {
        "lhs": "Latin hypercube: each range is divided into n equal parts with one value in each; another n draws "
        "other values",
        "sobol": "scrambled Sobol sequence, which covers the ranges evenly; n is a power of 2; a larger n keeps all "
        "earlier cases",
        "saltelli": "the n (d + 2) cases for sensitivity indices of d parameters (`met sensitivity`); n is a power "
        "of 2; a larger n keeps all earlier cases",
        "random": "independent random draws; a larger n keeps all earlier cases, and more parameters keep all "
        "earlier values",
    }
)

OF_UNTIL_SHOWN = "draws of random(n), until all requirements that have a confidence are decided; at most n"

OF_DISTRIBUTIONS: Mapping[str, str] = MappingProxyType({
    "uniform": "uniform between two values", "loguniform": "uniform in the logarithm between two values",
    "normal": "normal, without bounds, by its mean and standard deviation",
    "truncated": "normal, by its mean and standard deviation, cut off at two values",
})  # fmt: skip


def _functions() -> list[Row]:
    calls = [(name, f"{name}({', '.join(USAGE[name])})", OF_FUNCTIONS[name]) for name in FUNCTIONS]
    table = (
        CSV,
        f"{CSV}({', '.join(USAGE[CSV])})",
        "table of a CSV file, for a `let NAME`; its values are NAME.ROW.COLUMN, by the names of rows and columns",
    )
    return [*calls, table, *((name, name, ONE.decimal(value)) for name, value in CONSTANTS.items())]


def _designs() -> list[Row]:
    early = ("random", f"random({UNTIL_SHOWN}, {AT_MOST} = n)", OF_UNTIL_SHOWN)
    return [*((name, f"{name}(n)", OF_DESIGNS[name]) for name in DESIGNS), early]


def _distributions() -> list[Row]:
    return [(name, f"{name}({', '.join(takes)})", OF_DISTRIBUTIONS[name]) for name, takes in DISTRIBUTIONS.items()]


@frozen
class Subject:
    """A page: its subject, its syntax in a deck, a row for each word, and facts about all of them."""

    what: str
    example: str
    rows: Callable[[], list[Row]]
    more: str


SUBJECTS: Mapping[str, Subject] = MappingProxyType(
    {
        "functions": Subject(
            "The functions and constants that values may use",
            "let step = max(1 mm, sqrt(2) * 3 mm);",
            _functions,
            "Each argument has its unit, or one unit for all stands behind the bracket: `linspace(1, 2, 5) kg`.",
        ),
        "designs": Subject(
            "The ways to choose the points of a sample in a sweep",
            "sample lhs(200) { PATH = normal(20, 1) kg; }",
            _designs,
            "`met doc distributions` lists the distributions from which the points get their values.",
        ),
        "distributions": Subject(
            "The probability distributions of a parameter in a sample",
            "sample lhs(200) { PATH = uniform(0.09, 0.11) N*m/A; }",
            _distributions,
            f"A unit behind the brackets applies to all numbers inside. Values are rounded to {DIGITS} digits in it.",
        ),
    }
)


def print_words(name: str) -> Iterator[str]:
    subject = SUBJECTS[name]
    yield f"{name}: {subject.what[0].lower()}{subject.what[1:]}"
    yield ""
    yield f"In a deck: {subject.example}"
    yield ""
    yield from described([(written, text) for _, written, text in subject.rows()], width=terminal_width())
    yield ""
    yield subject.more


def words_json(name: str) -> list[dict[str, str]]:
    return [{"name": each, "written": written, "doc": text} for each, written, text in SUBJECTS[name].rows()]
