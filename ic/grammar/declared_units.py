"""Units that a deck declares, `unit ozin = 7.061552e-3 N*m;`: names that are units behind a number, in edition 2.

They are found before the deck is parsed, since the meaning of a name after a number decides how the deck reads; so
their sizes consist of numbers and units only, and are computed exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

from ic.grammar.syntax import Binary, Expression, Name, Number, Unary, Unit, WithUnit
from ic.text.lexer import NAME, Token
from ic.text.limits import Findings
from met import units
from met.diagnostic import Label, Place, Problem, error, write
from met.units import ONE, PURE, Measure

UNIT = "unit"
USAGE = "write `unit NAME = NUMBER UNIT;`, as in `unit ozin = 7.061552e-3 N*m;`"

TAKEN = (
    "in", "with", "of", "and", "or", "not", "by", "when", "like", "from", "cases", "confidence", "because", "pi", "for",
    "let", "param", "deck", UNIT,
)  # fmt: skip
"""Words that stand after numbers, or begin the text there, and so cannot be units."""

MOST_BITS = 4096  # of a size, over or under the line: decks write a few digits
DEEPEST = 64  # units that need units


def declarations(tokens: Sequence[Token]) -> dict[str, int]:
    """Positions of the names that `unit NAME =` declares outside of blocks, in files whose edition has it; of a name
    that is declared twice, the first."""
    positions: dict[str, int] = {}
    depth = 0
    for position, token in enumerate(tokens):
        if token.text == "{":
            depth += 1
        elif token.text == "}":
            depth = max(depth - 1, 0)  # a bracket that closes none is only reported
        elif token.text == UNIT and depth == 0 and is_declaration(tokens, position) and token.source.edition > 1:
            positions.setdefault(tokens[position + 1].text, position + 1)
    return positions


def is_declaration(tokens: Sequence[Token], position: int) -> bool:
    """Return True if `unit NAME =` stands at this position, where an entry begins."""
    return (
        position + 2 < len(tokens)
        and (tokens[position].text, tokens[position + 1].kind, tokens[position + 2].text) == (UNIT, NAME, "=")
        and (position == 0 or tokens[position - 1].text in (";", "}", "{"))
    )


class Unsized(Exception):
    """Raised where a unit depends on one without a size (already reported)."""


def measures(sizes: Mapping[str, tuple[Token, Expression]], findings: Findings) -> dict[str, Measure]:
    """The measure of each unit that has one; the reasons why others have none are reported, each mistake once.

    sizes  the token of each unit's name, and what it is declared to be; without those that cannot be read
    """
    known: dict[str, Measure] = {}
    unsized: set[str] = set()

    def find(name: str, within: tuple[str, ...]) -> Measure:
        """The measure of a unit, computed at the first request. within: the units whose declarations led here. Raises
        Problem D394 for a unit that needs itself or is too deep in others, Unsized where it has no measure."""
        if name in known:
            return known[name]
        if name in unsized or name not in sizes:
            raise Unsized
        token, size = sizes[name]
        if name in within:
            loop = [*within[within.index(name) :], name]
            message = f"unit `{name}` needs itself: " + " needs ".join(f"`{needed}`" for needed in loop)
            labels = [Label(sizes[needed][0].place, f"`{needed}`") for needed in loop[1:-1]]
            raise Problem(
                error("D394", message, token.place, also=labels, help="write one of them in units of the language")
            )
        if len(within) >= DEEPEST:
            message = f"unit `{name}` is at the end of a chain of {DEEPEST} units"
            raise Problem(error("D394", message, token.place, help="write it in units of the language"))
        _check_name(token)
        measure = _measure(size, lambda other: find(other, (*within, name)))
        known[name] = measure
        return measure

    for name in sizes:
        try:
            find(name, ())
        except Problem as problem:
            findings.add(*problem.diagnostics)
            unsized.add(name)
        except Unsized:
            unsized.add(name)
    return known


def _check_name(token: Token) -> None:
    """Raise Problem D394 where a unit may not have this name."""
    name = token.text
    if name in units.ALL_UNITS:
        unit = units.ALL_UNITS[name]
        helps = f"leave this entry out; a unit of another size needs another name, such as `my_{name}`"
        message = f"`{name}` is a unit already: {unit.word}, {units.size_in_si(unit.measure)}"
        raise Problem(error("D394", message, token.place, help=helps))
    if name in TAKEN:
        message = f"`{name}` is a word of the language, so it cannot be a unit"
        raise Problem(error("D394", message, token.place, help="choose another name"))


def _measure(size: Expression, find: Callable[[str], Measure]) -> Measure:
    """The measure of an expression of numbers, units and `pi`. Raises Problem D394 for other expressions."""
    place = size.place
    match size:
        case Number():
            number = Fraction(size.text) if size.value else Fraction(0)
            own = _of_unit(size.unit, find) if size.unit is not None else ONE
            return _product(Measure(PURE, number.numerator, number.denominator), own, place)
        case WithUnit():
            inner = _measure(size.inner, find)
            if (inner.dimension, inner.hertz) == (PURE, 0):
                return _product(inner, _of_unit(size.unit, find), place)
        case Unary(operator="+"):
            return _measure(size.operand, find)
        case Binary(operator="*" | "/"):
            left, right = _measure(size.left, find), _measure(size.right, find)
            return _product(left, right if size.operator == "*" else right**-1, place)
        case Name(text="pi"):
            return Measure(PURE, turns=1)
    if isinstance(size, Name) and size.text in units.ALL_UNITS:
        helps = write(f"1 {size.text}", f"write `1 {size.text}`", at=place)
        raise Problem(error("D394", f"`{size.text}` is a unit, and stands behind a number", place, help=helps))
    what = f"`{size.text}` is no number and no unit: a" if isinstance(size, Name) else "a"
    raise Problem(error("D394", f"{what} unit is made of numbers and units, with `*` and `/`", place, help=USAGE))


def _product(measure: Measure, other: Measure, place: Place) -> Measure:
    """The product, if it is not too large for numbers. Raises Problem D394."""
    product = measure * other
    if product.over == 0:
        raise Problem(error("D394", "a unit has a size above 0", place, help=USAGE))
    if max(product.over.bit_length(), product.under.bit_length()) <= MOST_BITS and abs(product.turns) <= DEEPEST:
        try:
            if product.scale > 0.0:
                return product
        except OverflowError:
            pass
    raise Problem(error("D394", "this unit is beyond what a number can hold", place, help=USAGE))


def _of_unit(unit: Unit, find: Callable[[str], Measure]) -> Measure:
    """The measure of a unit of the language or of the deck's own, which `find` gives."""
    measure = ONE
    for word, power in unit.factors:
        known = units.ALL_UNITS.get(word.text)
        measure = _product(measure, (known.measure if known is not None else find(word.text)) ** power, unit.place)
    return measure
