"""Differences between the readings of editions 1 and 2. Edition 1 warns about them, with the change that means the same
in both.

In edition 1 the names of units name no value. In edition 2 they may, and are units only behind a number, a bracket, or
`*` and `/` behind a unit. So `2 m/s` is a unit, whatever the deck calls `s`; where the same file calls a value so, it
is an error that asks which is meant. Edition 2 also refuses `1/2 m`, which is 1/(2 m) in edition 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise

from ic.grammar.cursor import Cursor, span
from ic.grammar.syntax import Binary, Expression, Name, Number, Unary
from ic.text.edition import EDITION_WORD
from ic.text.lexer import NAME, NUMBERS, Token
from met import units
from met.diagnostic import Help, Label, Place, write


class EditionDifferences(Cursor):
    """The part of the parser that warns about, or refuses, what the editions of the language read differently."""

    units_alone = False
    """True where a unit is declared here, so that no name can be a value's."""

    @cached_property
    def names_of_units(self) -> frozenset[str]:
        """Names of further units that the deck uses for something else: they stand where no unit can stand."""
        return frozenset(
            token.text
            for before, token in pairwise(self.tokens)
            if token.text in units.FURTHER_UNITS
            and token.kind == NAME
            and before.kind not in NUMBERS
            and before.text not in ("*", "/", "(", ")", "]")
        )

    @cached_property
    def values_of_files(self) -> Mapping[tuple[str, str], Token]:
        """The names that values and indices of loops get, by file and name."""
        return {
            (token.source.name, token.text): token
            for before, token in pairwise(self.tokens)
            if before.text in ("let", "param", "for") and token.kind == NAME
        }

    def is_reserved(self, token: Token) -> bool:
        """Return True if a name is that of a unit, and so cannot name a value in its file's edition."""
        return units.is_unit(token.text) and token.source.edition == 1

    def as_edition_2(self, token: Token, why: str) -> Help:
        """The help that says to change the file of a token to edition 2."""
        source, edition_line = token.source, token.source.heading
        text = f"{why}: write `{EDITION_WORD} 2;` as its first line"
        if edition_line is None:
            return write(f"{EDITION_WORD} 2;\n", text, at=Place(source.name, 1, 1, 0), where="before")
        start, end = edition_line.number
        return write("2", text, at=source.place(start, end - start))

    def not_a_value_too(self, taken: Sequence[Token]) -> None:
        """Refuse `2 m/s` in a file of edition 2 that calls a value `s`. taken: the tokens of the unit"""
        if len(taken) == 1 or self.units_alone:
            return
        start = 2 if taken[0].kind in NUMBERS else 0  # `15 1/s`
        depth = 0
        while start < len(taken):  # text in brackets after the number consists of units only
            depth += {"(": 1, ")": -1}.get(taken[start].text, 0)
            start += 1
            if depth == 0:
                break
        for n, token in enumerate(taken[start:], start):
            named = self.values_of_files.get((token.source.name, token.text)) if token.kind == NAME else None
            if named is None or token.source.edition == 1:
                continue
            unit = "".join(part.text for part in taken)
            sign = max(i for i in range(n) if taken[i].text in ("*", "/"))
            before = "".join(part.text for part in taken[:sign])
            number = self.tokens[self.tokens.index(taken[0], max(0, self.position - len(taken))) - 1]
            quantity = f"{number.text} {before}" if number.kind in NUMBERS else f"... {before}"
            first = number if number.kind in NUMBERS else taken[0]
            value = f"for the value write `({quantity}) {taken[sign].text} {token.text}`"
            self.fail(
                "D393",
                f"`{token.text}` is a unit here, and this file gives a value that name",
                token,
                also=(Label(named.place, f"`{token.text}`"),),
                help=(
                    write(f"({unit})", f"for the unit write `({unit})`", at=span(taken[0], taken[-1])),
                    write(f"({quantity})", value, at=span(first, taken[sign - 1])) if first is number else value,
                ),
            )

    def not_a_value_behind(self, first: Token) -> None:
        """Warn about `2 kg*rev` in edition 1 where `rev` is a value. first: the quantity's first token"""
        sign, named = self.token, self.following
        if (
            sign.text not in ("*", "/")
            or named.kind != NAME
            or named.text not in units.FURTHER_UNITS
            or named.source.edition > 1
            or self.tokens[self.position + 2].text in ("(", "{", ".")
        ):
            return
        quantity = first.source.text[first.offset : self.previous.end]
        unit = units.FURTHER_UNITS[named.text].word
        self.findings.warn(
            "D392",
            f"`{named.text}` is a value here, and in edition 2 the unit {unit}",
            named.place,
            help=write(
                f"({quantity})",
                f"write `({quantity}) {sign.text} {named.text}`, which means this in both",
                at=span(first, self.previous),
            ),
        )

    def not_a_bare_fraction(self, left: Expression, right: Expression, first: Token, under: Token) -> None:
        """Warn about `1/2 m` in edition 1, and refuse it in edition 2. first, under: first tokens of the two"""
        if under.kind not in NUMBERS or not isinstance(right, Number) or right.unit is None or not _is_bare(left):
            return
        last = self.previous
        quantity = under.source.text[under.offset : last.end]
        above = under.source.text[first.offset : under.end] if first.source is under.source else ""
        helps = [write(f"({quantity})", f"write `.../({quantity})`", at=span(under, last))]
        if above and first.offset < under.offset and not first.expansions:
            fraction = f"({above}) {right.unit.text}"
            in_brackets = f"{under.source.text[first.offset : under.offset]}({quantity})"
            helps = [
                write(f"({quantity})", f"for what it is in edition 1 write `{in_brackets}`", at=span(under, last)),
                write(fraction, f"for the fraction of a unit write `{fraction}`", at=span(first, last)),
            ]
        if under.source.edition > 1:
            message = "a number is divided by a number with a unit: which of the two has the unit?"
            self.fail("D393", message, span(first, last), help=helps)
        message = "this divides by a quantity, since a unit binds to its number; edition 2 wants brackets around it"
        self.findings.warn("D392", message, span(first, last), help=helps)


def _is_bare(expression: Expression) -> bool:
    """Return True for numbers without a unit, and expressions of them."""
    match expression:
        case Number():
            return expression.unit is None
        case Name():
            return expression.text == "pi"
        case Unary():
            return _is_bare(expression.operand)
        case Binary():
            return _is_bare(expression.left) and _is_bare(expression.right)
    return False
