"""Words in values and sweeps, for `met doc`: functions, designs, distributions.

The names, and what each takes, are those that the compiler reads by; here stands what they mean.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from ic.meaning.definitions.row_tables import CSV
from ic.meaning.expressions.evaluate import CONSTANTS, FUNCTIONS, USAGE
from ic.printing.page import Page, Table
from ic.sweeps.designs import AT_MOST, DESIGNS, DIGITS, DISTRIBUTIONS, UNTIL_SHOWN
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


def functions_page() -> Page:
    """The page of `met doc functions`: functions and constants in values."""
    calls = [(name, f"{name}({', '.join(USAGE[name])})", OF_FUNCTIONS[name]) for name in FUNCTIONS]
    table = (
        CSV,
        f"{CSV}({', '.join(USAGE[CSV])})",
        "table of a CSV file, for a `let NAME`; its values are NAME.ROW.COLUMN, by the names of rows and columns",
    )
    return _words_page(
        "functions",
        title="Functions",
        summary="the functions and constants that values may use",
        usage="let step = max(1 mm, sqrt(2) * 3 mm);",
        words=[*calls, table, *((name, name, ONE.decimal(value)) for name, value in CONSTANTS.items())],
        end="Each argument has its unit, or one unit for all stands behind the bracket: `linspace(1, 2, 5) kg`.",
    )


def designs_page() -> Page:
    """The page of `met doc designs`: ways to choose the points of a sample."""
    early = ("random", f"random({UNTIL_SHOWN}, {AT_MOST} = n)", OF_UNTIL_SHOWN)
    return _words_page(
        "designs",
        title="Designs of samples",
        summary="the ways to choose the points of a sample in a sweep",
        usage="sample lhs(200) { PATH = normal(20, 1) kg; }",
        words=[*((name, f"{name}(n)", OF_DESIGNS[name]) for name in DESIGNS), early],
        end="`met doc distributions` lists the distributions from which the points get their values.",
    )


def distributions_page() -> Page:
    """The page of `met doc distributions`: distributions of a sampled parameter."""
    return _words_page(
        "distributions",
        title="Distributions",
        summary="the probability distributions of a parameter in a sample",
        usage="sample lhs(200) { PATH = uniform(0.09, 0.11) N*m/A; }",
        words=[(name, f"{name}({', '.join(takes)})", OF_DISTRIBUTIONS[name]) for name, takes in DISTRIBUTIONS.items()],
        end=f"A unit behind the brackets applies to all numbers inside. Values are rounded to {DIGITS} digits in it.",
    )


def _words_page(subject: str, *, title: str, summary: str, usage: str, words: list[Row], end: str) -> Page:
    """A page of words, which ends with a fact about all of them."""
    rows = [(written, meaning) for _, written, meaning in words]
    return Page(
        subject=subject,
        title=title,
        summary=summary,
        usage=usage,
        parts=(Table(head=("written", "is"), rows=rows, headed=False), end),
        records=[{"name": name, "written": written, "doc": meaning} for name, written, meaning in words],
    )


PAGES: Mapping[str, Callable[[], Page]] = MappingProxyType(
    {"functions": functions_page, "designs": designs_page, "distributions": distributions_page}
)
"""The pages of words, by subject."""
