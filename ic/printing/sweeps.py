"""Words in values and sweeps, for `met doc`: functions, designs, distributions.

The names, and what each takes, are those that the compiler reads by; here stands what they mean.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

from ic.meaning.definitions.row_tables import CSV
from ic.meaning.expressions.evaluate import CONSTANTS, FUNCTIONS, USAGE
from ic.printing.columns import columns, exactly
from ic.sweeps.designs import AT_MOST, DESIGNS, DIGITS, DISTRIBUTIONS, UNTIL_SHOWN
from met.frozen import frozen

Row = tuple[str, str, str]
"""A name, how it is written, what it is."""

OF_FUNCTIONS: Mapping[str, str] = MappingProxyType({
    "sqrt": "root; the unit's too", "sin": "of an angle, or of a bare number of radians", "cos": "the same",
    "min": "least of values of one dimension, two or more", "max": "greatest of values of one dimension, two or more",
    "linspace": "evenly spaced values, both ends included",
    "logspace": "values in one ratio, both ends included (ends, not exponents)",
    "abs": "size, whatever the sign", "tan": "of an angle, as sin", "asin": "angle of a sine", "acos": "of a cosine",
    "atan": "of a tangent", "atan2": "angle of the point (x, y), both of one dimension",
    "exp": "of a pure number, as log and tanh", "log": "natural logarithm", "tanh": "hyperbolic tangent",
    "floor": "greatest whole number not above a pure number", "ceil": "least whole number not below it",
    "round": "nearest whole number, halves away from zero", "sign": "1, 0 or -1, of any value",
})  # fmt: skip

OF_DESIGNS: Mapping[str, str] = MappingProxyType(
    {
        "lhs": "a Latin hypercube: each range in n equal parts, one value from each; more samples are other ones",
        "sobol": "a scrambled Sobol sequence, evenly spread; n a power of 2; more samples change no old case",
        "saltelli": "n times the d + 2 cases for the indices of d parameters (`met sensitivity`); n a power of 2; more "
        "samples change no old case",
        "random": "independent draws; neither more samples nor more parameters change an old case",
    }
)

OF_UNTIL_SHOWN = "the same draws, up to the first that decides all requirements with a confidence; at most n"

OF_DISTRIBUTIONS: Mapping[str, str] = MappingProxyType({
    "uniform": "evenly between two values", "loguniform": "evenly in the logarithm", "normal": "normal, without bounds",
    "truncated": "normal, cut off on either side",
})  # fmt: skip


def _functions() -> list[Row]:
    calls = [(name, f"{name}({', '.join(USAGE[name])})", OF_FUNCTIONS[name]) for name in FUNCTIONS]
    table = (
        CSV,
        f"{CSV}({', '.join(USAGE[CSV])})",
        "of a `let`: values by the names of rows and columns, NAME.ROW.COLUMN",
    )
    return [*calls, table, *((name, name, exactly(value)) for name, value in CONSTANTS.items())]


def _designs() -> list[Row]:
    early = ("random", f"random({UNTIL_SHOWN}, {AT_MOST} = n)", OF_UNTIL_SHOWN)
    return [*((name, f"{name}(n)", OF_DESIGNS[name]) for name in DESIGNS), early]


def _distributions() -> list[Row]:
    return [(name, f"{name}({', '.join(takes)})", OF_DISTRIBUTIONS[name]) for name, takes in DISTRIBUTIONS.items()]


@frozen
class Subject:
    """A page: what it is about, how that stands in a deck, a row for each word, and what holds for all of them."""

    what: str
    example: str
    rows: Callable[[], list[Row]]
    more: str


SUBJECTS: Mapping[str, Subject] = MappingProxyType(
    {
        "functions": Subject(
            "What values may call, and the constants",
            "let step = max(1 mm, sqrt(2) * 3 mm);",
            _functions,
            "The arguments bear units, or the whole has one behind its bracket: `linspace(1, 2, 5) kg`.",
        ),
        "designs": Subject(
            "How the points of a sweep's sample lie",
            "sample lhs(200) { PATH = normal(20, 1) kg; }",
            _designs,
            "What values the points become, `met doc distributions` says.",
        ),
        "distributions": Subject(
            "What a parameter of a sample is drawn from",
            "sample lhs(200) { PATH = uniform(0.09, 0.11) N*m/A; }",
            _distributions,
            f"The unit behind the brackets is for all numbers inside. Values are rounded to {DIGITS} digits in it.",
        ),
    }
)


def print_words(name: str) -> Iterator[str]:
    subject = SUBJECTS[name]
    yield f"{name}: {subject.what[0].lower()}{subject.what[1:]}"
    yield ""
    yield f"In a deck: {subject.example}"
    yield ""
    yield from columns([(written, text) for _, written, text in subject.rows()])
    yield ""
    yield subject.more


def words_json(name: str) -> list[dict[str, str]]:
    return [{"name": each, "written": written, "doc": text} for each, written, text in SUBJECTS[name].rows()]
