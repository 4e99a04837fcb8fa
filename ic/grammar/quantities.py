"""Numbers, and the unit that may follow one.

A unit binds tightest and runs over * / ^ ( ) as long as unit names follow: `1/2 m` is 1/(2 m).
"""

from __future__ import annotations

import math
import re

from ic.grammar.cursor import Unreadable, span
from ic.grammar.edition_differences import EditionDifferences
from ic.grammar.syntax import Expression, Number, Unit, Word
from ic.text.lexer import NAME, NUMBERS, STRING, WHOLE, Token
from ic.text.limits import LONGEST_NUMBER
from met import units
from met.diagnostic import write
from met.messages import other_units

_POWERED = re.compile(r"([A-Za-z]+)([2-9])")
_UNIT_DEPTH = 8
MOST_FACTORS = 32


class Quantities(EditionDifferences):
    """The part of the parser for numbers and units."""

    def number(self) -> Expression:
        """Read a number, and the unit that may follow it. Raises Unreadable."""
        token = self.advance()
        value = self.number_value(token)
        unit = self.unit()
        last = self.previous
        if unit is not None:
            self.not_a_value_behind(token)
        self.not_a_second_number(token)
        return Number(value, unit, span(token, last), token.text)

    def number_value(self, token: Token) -> float:
        """The value of a number's token. Raises Unreadable (D027) for one that is too long, too large or too small, or
        hexadecimal."""
        text = token.text
        if len(text) > LONGEST_NUMBER:
            self.fail("D027", f"a number has at most {LONGEST_NUMBER} characters", token)
        if text[1:2] in ("x", "X"):
            self.fail(
                "D027", f"`{text}` is hexadecimal; a deck's numbers are decimal", token, help=write(str(int(text, 16)))
            )
        value = float(text)
        if math.isinf(value):
            self.fail("D027", f"`{text}` is too large for a number", token, help="the largest is about 1.8e308")
        if value == 0.0 and any(digit in "123456789" for digit in re.split("[eE]", text)[0]):
            self.fail("D027", f"`{text}` is too small for a number: it would become 0", token)
        return value

    def not_a_second_number(self, first: Token) -> None:
        """Refuse two numbers without anything between them, `1.2.3`. first: the first one's token. Raises
        Unreadable."""
        token = self.token
        if token.kind not in NUMBERS or self.on_new_line(self.position) or (self.open and self.open[-1].text != "{"):
            return
        if token.offset == first.end and token.text.startswith("."):
            self.fail("D027", f"`{first.text}{token.text}` is not a number", span(first, token))

    def unit(self) -> Unit | None:
        """The unit that follows, if any. In `15 1/s` the 1 belongs to it, since no number follows a number, and so does
        the bracket in `9 (m/s)^2`."""
        token = self.token
        over = None
        if token.kind == WHOLE and token.text == "1" and self.following.text == "/":
            over = self.unit_factor(self.position + 2, -1, 0)
            named = self.tokens[self.position + 2]
            named_unit = self.reads_as_unit(self.position + 2)
            if over is None and named.kind == NAME and not named_unit and not self.on_new_line(self.position):
                self.fail(
                    "D028",
                    f"`{named.text}` is not a unit",
                    named,
                    help=other_units.remedy(named.text) or self.units_known(),
                )
        if token.kind != NAME and token.text not in ("%", "(") and over is None:
            return None
        if self.begins_entry(self.position) or self.is_word_of_requirement():
            return None
        if over is None and token.text != "(" and not self.reads_as_unit(self.position, first=True):
            self.unknown_unit()
            return None
        start = self.position
        product = self.unit_product(start, 1, 0, over)
        self.not_joined_otherwise(start if product is None else product[1] - 1, start)
        if product is None:  # a path or a block begins with this name
            return None
        factors, self.position = product
        if self.token.text == "^":
            self.fail(
                "D030",
                "a unit's exponent is a whole number from -9 to 9",
                self.following,
                help=f"for a power of the quantity write `(... {self.previous.text})^n`",
            )
        if len(factors) > MOST_FACTORS:
            self.fail("D030", f"a unit has at most {MOST_FACTORS} factors", token)
        if not self.units_alone and any(word.text in self.unsized for word, _ in factors):
            raise Unreadable
        self.not_a_second_unit(start)
        taken = self.tokens[start : self.position]
        self.not_a_value_too(taken)
        declared = [(word.text, self.declared[word.text]) for word, _ in factors if word.text in self.declared]
        text = "".join(t.text for t in taken)
        return Unit(tuple(factors), span(taken[0], taken[-1]), text, tuple(declared))

    def reads_as_unit(self, position: int, *, first: bool = False) -> bool:
        """Return True if the name at token `position`, which follows a number or a unit, is a unit.

        first  it stands behind the number, where no other name may stand
        """
        name = self.tokens[position].text
        if name in self.unsized:
            return True
        if self.tokens[position].source.edition > 1:
            return name in units.ALL_UNITS or name in self.declared
        if name not in units.FURTHER_UNITS:
            return units.is_unit(name)
        if first:
            return not self.on_new_line(position) and self.tokens[position + 1].text not in ("=", "+=", "{", "(")
        return name not in self.names_of_units

    def is_word_of_requirement(self) -> bool:
        """Return True at `in 99 %`, `of cases`, `with 90 %` or `confidence`, none of which is a unit."""
        text, following = self.token.text, self.following
        if text in ("in", "with"):
            return following.kind in (*NUMBERS, NAME) or following.text == "("
        return (text == "of" and following.text == "cases") or text == "confidence"

    def unit_product(
        self, position: int, sign: int, depth: int, first: tuple[list[tuple[Word, int]], int] | None = None
    ) -> tuple[list[tuple[Word, int]], int] | None:
        """The factors from token `position` on, and the token after them; None where no unit begins there. first: True
        for the first factor"""
        first = self.unit_factor(position, sign, depth, first=position == self.position) if first is None else first
        if first is None:
            return None
        factors, position = first
        while self.tokens[position].text in ("*", "/"):
            more = self.unit_factor(position + 1, sign if self.tokens[position].text == "*" else -sign, depth)
            if more is None:
                break
            factors = factors + more[0]
            position = more[1]
        return factors, position

    def unit_factor(
        self, position: int, sign: int, depth: int, *, first: bool = False
    ) -> tuple[list[tuple[Word, int]], int] | None:
        """The factor of a unit at token `position`: its units with their powers, and the position of the token behind
        it; None where there is no unit.

        sign   1, or -1 behind a `/`;  depth: of brackets around it
        first  whether it is the first unit behind its number, where a deck's own units count too
        """
        token = self.tokens[position]
        if token.text == "(" and depth < _UNIT_DEPTH:
            inner = self.unit_product(position + 1, sign, depth + 1)
            if inner is None or self.tokens[inner[1]].text != ")":
                return None
            factors, position = inner[0], inner[1] + 1
        elif (
            token.kind != STRING
            and self.tokens[position + 1].text not in ("{", ".")
            and not (token.text == "min" and self.tokens[position + 1].text == "(" and not first)  # the function
            and self.reads_as_unit(position, first=first)
        ):
            factors, position = [(Word(token.text, token.place), sign)], position + 1
        else:
            return None
        if self.tokens[position].text == "^":
            exponent = self.exponent(position + 1)
            if exponent is not None:
                factors = [(word, power * exponent[0]) for word, power in factors]
                position = exponent[1]
        return factors, position

    def exponent(self, position: int) -> tuple[int, int] | None:
        """The whole exponent of one digit, with or without sign and brackets, at token `position`, and the position
        behind it; None where there is none."""
        bracketed = self.tokens[position].text == "("
        position += bracketed
        sign = -1 if self.tokens[position].text == "-" else 1
        position += self.tokens[position].text in ("-", "+")
        digit = self.tokens[position]
        if digit.kind != WHOLE or len(digit.text) != 1 or (bracketed and self.tokens[position + 1].text != ")"):
            return None
        return sign * int(digit.text), position + 1 + bracketed

    def not_a_second_unit(self, start: int) -> None:
        """Refuse a name behind a number with its unit that was meant as another unit, as in `2 N m` or `3 rad/sec`
        (D028, D030). start: position of the number's token. Raises Unreadable."""
        token = self.token
        if token.kind == NAME and token.text in units.ALL_UNITS and not self.on_new_line(self.position):
            written = "".join(t.text for t in self.tokens[start : self.position])
            helps = self.write(f"{written}*{token.text}", self.tokens[start], token)
            self.fail("D030", "units are multiplied with `*`", token, help=helps)
        operator, named = token, self.following
        if operator.text not in ("*", "/") or named.kind != NAME:
            return
        powered = _POWERED.fullmatch(named.text)
        if powered and units.is_unit(powered.group(1)):
            self.fail(
                "D028", f"`{named.text}` is not a unit", named, help=write(f"{powered.group(1)}^{powered.group(2)}")
            )
        near = other_units.suggest(named.text)
        if (
            near
            and named.text not in ("n", "k", "v", "M", "S", *self.names_of_units)
            and self.tokens[self.position + 2].text in (";", ",", ")", "]")
        ):
            # `rad/sec`: said here, since after a unit this is what was meant more often than a name of one's own
            self.fail("D028", f"`{named.text}` is not a unit", named, help=write(near, f"did you mean `{near}`?"))

    def not_joined_otherwise(self, position: int, start: int) -> None:
        """Refuses `N.m` and `N-m`, and `s-1`, whose last unit before the sign is token `position`, of a unit from
        `start` on.

        Without a space these are meant as a unit, and no number can continue so: names of units are of units alone, and
        nothing but a pure number is added to one.
        """
        unit, sign, more = (
            self.tokens[position : position + 3] if position + 3 <= len(self.tokens) else (self.token,) * 3
        )
        if sign.text not in (".", "-") or sign.offset != unit.end or more.offset != sign.end or unit.text == "%":
            return
        if unit.kind != NAME or not units.is_unit(unit.text):
            return
        before = "".join(token.text for token in self.tokens[start : position + 1])
        near = more.text if units.is_unit(more.text) else other_units.suggest(more.text)
        if more.kind == NAME and near is not None:
            helps = self.write(f"{before}*{near}", self.tokens[start], more)
            self.fail("D030", "units are multiplied with `*`", more, help=helps)
        if more.kind == WHOLE and sign.text == "-" and len(more.text) == 1 and position + 3 < len(self.tokens):
            self.fail(
                "D030",
                "a unit's exponent stands behind `^`",
                span(sign, more),
                help=self.write(f"{before}^-{more.text}", self.tokens[start], more),
            )

    def unknown_unit(self) -> None:
        """Report a name after a number that is not a unit, and treat it as one."""
        token = self.token
        if (
            self.on_new_line(self.position)
            or token.text in ("and", "or", "by")
            or self.following.text in ("=", "+=", "{", "(")
        ):
            return
        powered = _POWERED.fullmatch(token.text)
        before = self.previous
        number = before.text if before.kind in NUMBERS else ""
        helps = other_units.remedy(token.text, number, alone=self.following.text not in ("^", "*", "/"))
        if powered and units.is_unit(powered.group(1)):
            near = f"{powered.group(1)}^{powered.group(2)}"
            helps = (write(near, f"did you mean `{near}`?"),)
        elif powered and (other := other_units.suggest(powered.group(1))) and "/" not in other:
            near = f"{other}^{powered.group(2)}"
            helps = (write(near, f"did you mean `{near}`?"),)
        if token.text in self.declared:
            helps = (self.as_edition_2(token, "units that a deck declares are known in files of edition 2"),)
        self.fail("D028", f"`{token.text}` is not a unit", token, help=helps or self.units_known())

    def units_known(self) -> str:
        return "the units: " + ", ".join((*units.ALL_UNITS, *self.declared))
