"""Values: numbers with units, names, calls, lists, and the operators between them.

    or  <  and  <  not  <  comparison  <  + -  <  * /  <  unary -  <  ^

A unit binds tightest and runs over * / ^ ( ) as long as unit names follow: `1/2 m` is 1/(2 m).
"""

from __future__ import annotations

import math
import re

from ic.grammar.cursor import Cursor, found, span
from ic.grammar.syntax import Binary, Call, Entry, Expression, List, Name, Number, String, Unary, Unit, WithUnit, Word
from ic.text.lexer import BAD, NAME, NUMBERS, STRING, WHOLE, Token
from ic.text.limits import LONGEST_NUMBER, LONGEST_STRING
from met import units
from met.diagnostic import Label

_LEVEL = {
    "or": 1, "||": 1, "and": 2, "&&": 2, "<": 4, "<=": 4, ">": 4, ">=": 4, "==": 4, "!=": 4, "+": 5, "-": 5,
    "*": 6, "/": 6, "^": 8,
}  # fmt: skip
_NOT, _COMPARISON, _SIGN = 3, 4, 7
_WORDS = {"||": "or", "&&": "and", "!": "not"}
_POWERED = re.compile(r"([A-Za-z]+)([2-9])")
_ESCAPES = {'"': '"', "\\": "\\", "n": "\n", "t": "\t"}
_UNIT_DEPTH = 8
MOST_FACTORS = 32


class Expressions(Cursor):
    def block(self) -> tuple[Entry, ...]:
        raise NotImplementedError

    def value(self) -> Expression:
        """An expression of its own: an entry's value, a list's item, a call's argument."""
        before = self.operators
        if self.begins_entry(self.at):
            self.fail("D020", "expected a value", self.behind(self.previous))
        result = self.expression()
        self.peak = max(self.peak, self.operators)
        self.operators = before
        return result

    def expression(self, least: int = 1) -> Expression:
        left = self.prefix(least)
        while True:
            token = self.token
            level = _LEVEL.get(token.text)
            if level is None or level < least or self.begins_entry(self.at):
                return left
            self.count_operator()
            self.advance()
            operator = self.in_words(token)
            if operator == "*" and self.token.text == "*" and self.token.offset == token.end:
                self.fail("D020", "`**` is not an operator", span(token, self.token), help="a power is written `a^b`")
            right = self.expression(level if operator == "^" else level + 1)
            left = Binary(operator, left, right, token.place)
            if level == _COMPARISON and _LEVEL.get(self.token.text) == _COMPARISON:
                first = Label(token.place, "the first is here")
                self.fail("D033", "comparisons do not chain", self.token, also=(first,), help="write `a < b and b < c`")

    def prefix(self, least: int) -> Expression:
        token = self.token
        text = token.text
        if text in ("-", "+"):
            self.count_operator()
            self.advance()
            return Unary(text, self.expression(_SIGN), token.place)
        if (text == "not" and not self.only_a_name()) or text == "!":
            if least > _NOT:
                self.unexpected("a value", help="put `not ...` in parentheses here")
            self.count_operator()
            self.advance()
            return Unary(self.in_words(token), self.expression(_NOT), token.place)
        return self.operand()

    def in_words(self, token: Token) -> str:
        word = _WORDS.get(token.text)
        if word is None:
            return token.text
        self.tell("D020", f"`{token.text}` is not an operator here", token, help=f"write `{word}`")
        return word

    def only_a_name(self) -> bool:
        """Whether a word that could be an operator is just somebody's name."""
        return self.following.text in (";", ",", ")", "]", "}", ".")

    def operand(self) -> Expression:
        token = self.token
        if token.kind in NUMBERS:
            return self.number()
        if token.kind == NAME:
            return self.name_or_call()
        if token.kind == STRING:
            return self.string()
        if token.text == "[":
            return self.with_unit(self.list(), token)
        if token.text == "(":
            opening = self.enter()
            inner = self.expression()
            self.leave()
            return self.with_unit(inner, opening)
        helps = {
            "{": "a block needs a name before it, as in `settling_time { ... }`",
            ";": "the value is missing", "}": "the value is missing", "%": "`%` follows its number: `2 %`",
            "..": "ranges are not in the language yet: write `linspace(first, last, count)`",
        }  # fmt: skip
        self.unexpected("a value", help=helps.get(token.text, ()))

    # numbers and units

    def number(self) -> Expression:
        token = self.advance()
        value = self.number_value(token)
        unit = self.unit()
        last = self.previous
        self.not_a_second_number(token)
        return Number(value, unit, span(token, last), token.text)

    def number_value(self, token: Token) -> float:
        text = token.text
        if len(text) > LONGEST_NUMBER:
            self.fail("D027", f"a number has at most {LONGEST_NUMBER} characters", token)
        if text[1:2] in ("x", "X"):
            self.fail(
                "D027", f"`{text}` is hexadecimal; a deck's numbers are decimal", token, help=f"write `{int(text, 16)}`"
            )
        value = float(text)
        if math.isinf(value):
            self.fail("D027", f"`{text}` is too large for a number", token, help="the largest is about 1.8e308")
        if value == 0.0 and any(digit in "123456789" for digit in re.split("[eE]", text)[0]):
            self.fail("D027", f"`{text}` is too small for a number: it would become 0", token)
        return value

    def not_a_second_number(self, first: Token) -> None:
        token = self.token
        if token.kind not in NUMBERS or self.on_new_line(self.at) or (self.open and self.open[-1].text != "{"):
            return
        if token.offset == first.end and token.text.startswith("."):
            self.fail("D027", f"`{first.text}{token.text}` is not a number", span(first, token))

    def unit(self) -> Unit | None:
        """The unit that follows, if one does. In `15 1/s` the 1 belongs to it, since no number follows a number."""
        token = self.token
        over = None
        if token.kind == WHOLE and token.text == "1" and self.following.text == "/":
            over = self.unit_factor(self.at + 2, -1, 0)
        if token.kind != NAME and token.text != "%" and over is None:
            return None
        if self.begins_entry(self.at):
            return None
        if over is None and not units.is_unit(token.text):
            self.unknown_unit()
            return None
        start = self.at
        product = self.unit_product(start, 1, 0, over)
        if product is None:  # a path or a block begins with this name
            return None
        factors, self.at = product
        if self.token.text == "^":
            self.fail("D030", "a unit's exponent is a whole number from -9 to 9", self.following,
                      help=f"for a power of the quantity write `(... {self.previous.text})^n`")  # fmt: skip
        if len(factors) > MOST_FACTORS:
            self.fail("D030", f"a unit has at most {MOST_FACTORS} factors", token)
        self.not_a_second_unit(start)
        taken = self.tokens[start : self.at]
        return Unit(tuple(factors), span(taken[0], taken[-1]), "".join(t.text for t in taken))

    def unit_product(
        self, at: int, sign: int, depth: int, first: tuple[list[tuple[Word, int]], int] | None = None
    ) -> tuple[list[tuple[Word, int]], int] | None:
        """Factors from token `at` on, and the token behind them; None where no unit begins there. first: was read."""
        first = self.unit_factor(at, sign, depth) if first is None else first
        if first is None:
            return None
        factors, at = first
        while self.tokens[at].text in ("*", "/"):
            more = self.unit_factor(at + 1, sign if self.tokens[at].text == "*" else -sign, depth)
            if more is None:
                break
            factors = factors + more[0]
            at = more[1]
        return factors, at

    def unit_factor(self, at: int, sign: int, depth: int) -> tuple[list[tuple[Word, int]], int] | None:
        token = self.tokens[at]
        if token.text == "(" and depth < _UNIT_DEPTH:
            inner = self.unit_product(at + 1, sign, depth + 1)
            if inner is None or self.tokens[inner[1]].text != ")":
                return None
            factors, at = inner[0], inner[1] + 1
        elif units.is_unit(token.text) and token.kind != STRING and self.tokens[at + 1].text not in ("{", "."):
            factors, at = [(Word(token.text, token.place), sign)], at + 1
        else:
            return None
        if self.tokens[at].text == "^":
            exponent = self.exponent(at + 1)
            if exponent is not None:
                factors = [(word, power * exponent[0]) for word, power in factors]
                at = exponent[1]
        return factors, at

    def exponent(self, at: int) -> tuple[int, int] | None:
        bracketed = self.tokens[at].text == "("
        at += bracketed
        sign = -1 if self.tokens[at].text == "-" else 1
        at += self.tokens[at].text in ("-", "+")
        digit = self.tokens[at]
        if digit.kind != WHOLE or len(digit.text) != 1 or (bracketed and self.tokens[at + 1].text != ")"):
            return None
        return sign * int(digit.text), at + 1 + bracketed

    def not_a_second_unit(self, start: int) -> None:
        token = self.token
        if token.kind == NAME and units.is_unit(token.text) and not self.on_new_line(self.at):
            written = "".join(t.text for t in self.tokens[start : self.at])
            self.fail("D030", "units are multiplied with `*`", token, help=f"write `{written}*{token.text}`")
        operator, named = token, self.following
        if operator.text not in ("*", "/") or named.kind != NAME:
            return
        powered = _POWERED.fullmatch(named.text)
        if powered and units.is_unit(powered.group(1)):
            self.fail(
                "D028", f"`{named.text}` is not a unit", named, help=f"write `{powered.group(1)}^{powered.group(2)}`"
            )
        near = units.suggest(named.text)
        if (
            near
            and named.text not in ("n", "k", "v", "M", "S")
            and self.tokens[self.at + 2].text in (";", ",", ")", "]")
        ):
            # `rad/sec`: said here, since after a unit this is what was meant more often than a name of one's own
            self.fail("D028", f"`{named.text}` is not a unit", named, help=f"did you mean `{near}`?")

    def unknown_unit(self) -> None:
        """A name behind a number that is no unit: says so, and takes it for one."""
        token = self.token
        if (
            self.on_new_line(self.at)
            or token.text in ("and", "or", "by")
            or self.following.text in ("=", "+=", "{", "(")
        ):
            return
        powered = _POWERED.fullmatch(token.text)
        near = units.suggest(token.text)
        if powered and units.is_unit(powered.group(1)):
            near = f"{powered.group(1)}^{powered.group(2)}"
        self.fail(
            "D028", f"`{token.text}` is not a unit", token, help=f"did you mean `{near}`?" if near else _units_known()
        )

    def with_unit(self, inner: Expression, opening: Token) -> Expression:
        """What has just been closed, with the unit that may follow it."""
        closing = self.previous
        unit = self.unit()
        return inner if unit is None else WithUnit(inner, unit, span(opening, closing))

    # names, calls, lists

    def string(self) -> String:
        token = self.advance()
        if len(token.text) > LONGEST_STRING:
            self.fail("D020", f"a string has at most {LONGEST_STRING} characters", token)

        def plain(match: re.Match[str]) -> str:
            if match.group(1) not in _ESCAPES:
                self.tell(
                    "D020",
                    f"`\\{match.group(1)}` means nothing in a string",
                    token,
                    help='`\\"`, `\\\\`, `\\n` and `\\t` do',
                )
            return _ESCAPES.get(match.group(1), "")

        return String(re.sub(r"\\(.)", plain, token.text[1:-1]), token.place)

    def path(self) -> list[Token]:
        """Names joined by points."""
        parts = [self.advance()]
        while self.token.text == ".":
            self.advance()
            if self.token.kind != NAME:
                self.unexpected("a name after `.`")
            parts.append(self.advance())
        return parts

    def name_or_call(self) -> Expression:
        self.not_a_lone_unit()
        parts = self.path()
        words = tuple([Word(t.text, t.place) for t in parts])
        name = Name(words, words[0].place if len(words) == 1 else span(parts[0], parts[-1]))
        if self.token.text == "(":
            return self.call(name, parts[0])
        if self.token.text == "{":
            return Call(name, (), (), self.block(), name.place)
        token = self.token
        if units.is_unit(token.text) and token.kind == NAME and not self.begins_entry(self.at):
            if units.is_unit(name.text):
                self.fail(
                    "D025",
                    f"`{name.text}` is the unit {units.UNITS[name.text].word}, and stands here without a number",
                    parts[0],
                )
            if name.text == "pi":
                unit = self.unit()
                text = token.text if unit is None else unit.text
                turn = f"; a whole turn is `1 cycle{text.removeprefix('rad')}`" if token.text == "rad" else ""
                self.fail("D030", "a unit follows a number or brackets, and `pi` is neither", token,
                          help=f"put brackets around the number, as in `(2*pi) {text}`{turn}")  # fmt: skip
            self.fail("D030", f"`{name.text[:LONGEST_NUMBER]}` is a name, and only a number takes a unit", token,
                      help="what it names has its unit already")  # fmt: skip
        return name

    def not_a_lone_unit(self) -> None:
        """`m` where a value stands, without a number: an operand, or before its number."""
        token, after = self.token, self.following
        if not units.is_unit(token.text) or after.text in ("(", "{", "."):
            return
        word = units.UNITS[token.text].word
        if after.kind in NUMBERS:
            self.fail(
                "D025", "a unit follows its number", span(token, after), help=f"write `{after.text} {token.text}`"
            )
        before = self.previous.text
        if before in ("+", "-", "*", "/", "^", "<", ">", "<=", ">=", "==", "!=") or after.text in (
            "+",
            "-",
            "*",
            "/",
            "^",
        ):
            self.fail("D025", f"`{token.text}` is the unit {word}, and stands here without a number", token,
                      help=f"write `1 {token.text}`; behind a unit, as in `2 m/s`, it needs none")  # fmt: skip

    def call(self, name: Name, first: Token) -> Expression:
        self.enter()
        outer = self.begin_items()
        positional: list[Expression] = []
        named: list[tuple[Word, Expression]] = []
        while self.token.text != ")":
            if self.token.kind == NAME and self.following.text == "=":
                word = self.advance()
                self.advance()
                named.append((Word(word.text, word.place), self.value()))
            else:
                start = self.token
                positional.append(self.value())
                if named:
                    self.tell("D034", "an argument without a name stands behind one with a name", start,
                              also=(Label(named[-1][0].place, "this one has a name"),))  # fmt: skip
            if not self.another(")"):
                break
        closing = self.leave("`,` or ")
        self.end_items(outer)
        place = span(first, closing)
        body = self.block() if self.token.text == "{" else None
        call = Call(name, tuple(positional), tuple(named), body, place)
        return call if body is not None else self.with_unit(call, first)

    def list(self) -> List:
        opening = self.enter()
        outer = self.begin_items()
        items: list[Expression] = []
        while self.token.text != "]":
            items.append(self.value())
            if not self.another("]"):
                break
        closing = self.leave("`,` or ")
        self.end_items(outer)
        return List(tuple(items), span(opening, closing))

    def another(self, closing: str) -> bool:
        """Whether a further item follows, its comma taken; a missing or mistaken comma is noted and forgiven."""
        token = self.token
        if token.text == ",":
            self.advance()
            return True
        if token.text == closing:
            return False
        if token.text == ";" and not self.ends_entry():
            self.tell("D024", "`;` between items", token, help="write `,`")
            self.advance()
            return True
        if self.begins_value() and not self.begins_entry(self.at) and token.kind != BAD:
            self.tell("D024", f"a `,` is missing before {found(token)}", self.behind(self.previous))
            return True
        if token.text == "..":
            self.unexpected(
                f"`,` or `{closing}`", help="ranges are not in the language yet: write `linspace(first, last, count)`"
            )
        if token.text == "=":
            self.unexpected(f"`,` or `{closing}`", help="to compare, write `==`")
        return False

    def ends_entry(self) -> bool:
        """Whether the semicolon here ends the entry, the bracket being the one that is missing."""
        after = self.following
        return after.text == "}" or after.kind == "END" or self.begins_entry(self.at + 1)


def _units_known() -> str:
    return "the units: " + ", ".join(units.UNITS)
