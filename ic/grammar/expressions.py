"""Values: numbers with units, names, calls, lists, and the operators between them.

a .. b by c  <  or  <  and  <  not  <  comparison  <  + -  <  * /  <  unary -  <  ^
"""

from __future__ import annotations

import re

from ic.grammar.braced_names import USAGE, adjacent, braces_length, name_length
from ic.grammar.cursor import NOT_OPEN, SHOWN, Unreadable, span, token_in_words
from ic.grammar.quantities import Quantities
from ic.grammar.syntax import (
    Binary,
    Call,
    Entry,
    Expression,
    Indexed,
    List,
    Name,
    Range,
    String,
    Unary,
    WithUnit,
    Word,
)
from ic.text.lexer import BAD, END, NAME, NUMBERS, STRING, WHOLE, Token
from ic.text.limits import LONGEST_NUMBER, LONGEST_STRING
from met import units
from met.diagnostic import Label, write

_LEVEL = {
    "or": 1, "||": 1, "and": 2, "&&": 2, "<": 4, "<=": 4, ">": 4, ">=": 4, "==": 4, "!=": 4, "+": 5, "-": 5,
    "*": 6, "/": 6, "^": 8,
}  # fmt: skip
_NOT, _COMPARISON, _SIGN = 3, 4, 7
_WORDS = {"||": "or", "&&": "and", "!": "not"}
EVERY_JOINT = "*"
"""The first word of a path that names every joint: `*.servo.voltage`."""

_ESCAPES = {'"': '"', "\\": "\\", "n": "\n", "t": "\t"}


class Expressions(Quantities):
    """The part of the parser for values: expressions, calls and lists, and what ends them."""

    def block(self) -> tuple[Entry, ...]:
        raise NotImplementedError

    def value(self) -> Expression:
        """A separate expression: an entry's value, a list's item, a call's argument."""
        before = self.operators
        if self.begins_entry(self.position):
            self.fail("D020", "expected a value", self.behind(self.previous))
        result = self.ranged(self.expression())
        self.peak = max(self.peak, self.operators)
        self.operators = before
        return result

    def ranged(self, first: Expression) -> Expression:
        """The range that begins with an expression, if `..` follows it."""
        dots = self.token
        if dots.text != "..":
            return first
        self.count_operator()
        self.advance()
        last = self.expression()
        if self.token.text != "by":
            self.fail(
                "D220",
                "a range has no step",
                dots,
                help=[
                    "write `first .. last by step`",
                    "a `tune` and a `search` take all between: `between(first, last)`",
                ],
            )
        self.advance()
        return Range(first, last, self.expression(), dots.place)

    def expression(self, least: int = 1) -> Expression:
        """An expression whose operators bind at least as tightly as `least`."""
        first = self.token
        left = self.prefix(least)
        while True:
            token = self.token
            level = _LEVEL.get(token.text)
            if level is None or level < least or self.begins_entry(self.position):
                return left
            self.count_operator()
            self.advance()
            operator = self.in_words(token)
            if operator == "*" and self.token.text == "*" and self.token.offset == token.end:
                self.fail(
                    "D020",
                    "`**` is not an operator",
                    span(token, self.token),
                    help=write("^", "a power is written `a^b`"),
                )
            under = self.token
            right = self.expression(level if operator == "^" else level + 1)
            if operator == "/":
                self.not_a_bare_fraction(left, right, first, under)
            left = Binary(operator, left, right, token.place)
            if level == _COMPARISON and _LEVEL.get(self.token.text) == _COMPARISON:
                compared = Label(token.place, "the first is here")
                helps = (
                    "in `exclude when` write `a < b and b < c`",
                    "of requirements write two: `require a < b; require b < c;`",
                )
                self.fail("D033", "comparisons do not chain", self.token, also=(compared,), help=helps)

    def prefix(self, least: int) -> Expression:
        """Read an operand, with the sign or `not` before it. least: the binding strength of what it is part of. Raises
        Unreadable."""
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
        """The operator that a sign such as `&&` stands for, `and`; the sign is reported (D020)."""
        word = _WORDS.get(token.text)
        if word is None:
            return token.text
        self.tell("D020", f"`{token.text}` is not an operator here", token, help=write(word))
        return word

    def only_a_name(self) -> bool:
        """Return True if a word that could be an operator is a name in the deck."""
        return self.following.text in (";", ",", ")", "]", "}", ".")

    def operand(self) -> Expression:
        """A number, name, call, string, list, or an expression in brackets, with the unit after it."""
        token = self.token
        if token.kind == NAME and token.text in self.indices:
            token = self.tokens[self.position] = self.stand_in(token)
        if token.kind in NUMBERS:
            return self.number()
        if token.kind == NAME or (token.text == EVERY_JOINT and self.following.text == "."):
            return self.name_or_call()
        if token.kind == STRING:
            return self.string()
        if token.text == "[":
            return self.with_unit(self.list(), token)
        if token.text == "(":
            opening = self.enter()
            inner = self.ranged(self.expression())
            self.leave()
            return self.with_unit(inner, opening)
        helps = {
            "{": "a block needs a name before it, as in `settling_time { ... }`",
            ";": "the value is missing",
            "}": "the value is missing",
            "%": "`%` follows its number: `2 %`",
            "..": "a range is written `first .. last by step`",
        }
        self.unexpected("a value", help=helps.get(token.text, ()))

    def stand_in(self, index: Token) -> Token:
        """The token for which the index of a loop stands in this iteration, at the index's place."""
        text = self.indices[index.text]
        return index.standing_for(WHOLE if text.lstrip("-").isdigit() else NAME, text)

    def with_unit(self, inner: Expression, opening: Token) -> Expression:
        """The expression whose bracket was just closed, with the unit that may follow it."""
        closing = self.previous
        unit = self.unit()
        if unit is None:
            return inner
        self.not_a_value_behind(opening)
        return WithUnit(inner, unit, span(opening, closing))

    # names, calls, lists

    def string(self) -> String:
        """A string without its quotes, its escapes replaced."""
        token = self.advance()
        if len(token.text) > LONGEST_STRING:
            self.fail("D020", f"a string has at most {LONGEST_STRING} characters", token)

        def plain(match: re.Match[str]) -> str:
            """The character of an escape in a string; an unknown one is reported (D020)."""
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
        """A name, alone or with arguments, a block, an index or a unit after it."""
        self.not_a_lone_unit()
        parts = self.path()
        words = tuple([Word(t.text, t.place) for t in parts])
        name = Name(words, words[0].place if len(words) == 1 else span(parts[0], parts[-1]))
        if self.token.text == "(":
            return self.call(name, parts[0])
        if self.token.text == "{":
            self.refuse_braces()
            return Call(name, (), (), self.block(), name.place)
        if self.token.text == "[" and adjacent(self.previous, self.token):
            return self.indexed(name, parts[0])
        token = self.token
        known = units.is_unit(token.text) or token.text in self.declared or token.text in self.unsized
        if known and token.kind == NAME and not self.begins_entry(self.position):
            if self.is_reserved(parts[0]) and len(parts) == 1:
                self.fail(
                    "D025",
                    f"`{name.text}` is the unit {units.UNITS[name.text].word}, and stands here without a number",
                    parts[0],
                )
            unit = self.unit()
            text = token.text if unit is None else unit.text
            if name.text == "pi":
                turn = f"; a whole turn is `1 cycle{text.removeprefix('rad')}`" if token.text == "rad" else ""
                self.fail(
                    "D030",
                    "a unit follows a number or brackets, and `pi` is neither",
                    token,
                    help=f"put brackets around the number, as in `(2*pi) {text}`{turn}",
                )
            short = name.text[:LONGEST_NUMBER]
            helps = ["what it names has its unit already", f"if it is a bare number, write `({short}) {text}`"]
            if name.text.lower() in ("nan", "inf", "infinity"):
                helps = ["every number of a deck is finite: write one, or leave the entry out"]
            self.fail("D030", f"`{short}` is a name, and only a number takes a unit", token, help=helps)
        return name

    def not_a_lone_unit(self) -> None:
        """Report a unit such as `m` in place of a value, without a number: as an operand, or before its number."""
        token, after = self.token, self.following
        if not units.is_unit(token.text) or after.text in ("(", "{", "."):
            return
        word = units.UNITS[token.text].word
        if after.kind in NUMBERS:
            self.fail(
                "D025",
                "a unit follows its number",
                span(token, after),
                help=self.write(f"{after.text} {token.text}", token, after),
            )
        before = self.previous.text
        if not self.is_reserved(token):
            return
        if before in ("+", "-", "*", "/", "^", "<", ">", "<=", ">=", "==", "!=") or after.text in (
            "+",
            "-",
            "*",
            "/",
            "^",
        ):
            number = self.tokens[self.position - 2]
            factor = before == "*" and number.kind in NUMBERS  # `2 * m`
            self.fail(
                "D025",
                f"`{token.text}` is the unit {word}, and stands here without a number",
                token,
                help=self.write(f"{number.text} {token.text}", number, token)
                if factor
                else write(f"1 {token.text}", f"write `1 {token.text}`; behind a unit, as in `2 m/s`, it needs none"),
            )

    def call(self, name: Name, first: Token) -> Expression:
        """The arguments in the brackets after a name; those with names stand last."""
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
                    self.tell(
                        "D034",
                        "an argument without a name stands behind one with a name",
                        start,
                        also=(Label(named[-1][0].place, "this one has a name"),),
                        help="give it a name, too: `NAME = VALUE`",
                    )
            if not self.another(")"):
                break
        closing = self.leave("`,` or ")
        self.end_items(outer)
        place = span(first, closing)
        body = self.block() if self.token.text == "{" else None
        call = Call(name, tuple(positional), tuple(named), body, place)
        return call if body is not None else self.with_unit(call, first)

    def refuse_braces(self) -> None:
        """Refuse `seg_{i}` outside of a loop, at the brace."""
        length = braces_length(self.tokens, self.position)
        if length and adjacent(self.previous, self.token):
            first, start = self.token, self.position - 1
            written = "".join(token.text for token in self.tokens[self.position : self.position + length])
            self.position = start + name_length(self.tokens, start)
            place = span(first, self.tokens[start + length])
            self.fail("D285", f"`{written[:SHOWN]}` within a name stands in a loop alone", place, help=USAGE)

    def indexed(self, name: Name, first: Token) -> Indexed:
        """The element of a list, `lengths[i]`, read from its bracket on."""
        self.enter()
        outer = self.begin_items()
        index = self.value()
        closing = self.leave()
        self.end_items(outer)
        return Indexed(name, index, span(first, closing))

    def list(self) -> List:
        """Read a list in square brackets, `[1, 2 m]`. Raises Unreadable."""
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
        """Return True if a further item follows, after taking its comma; a missing or wrong comma is reported."""
        token = self.token
        if token.text == ",":
            self.advance()
            return True
        if token.text == closing:
            return False
        if token.text == ";" and not self.ends_entry():
            self.tell("D024", "`;` between items", token, help=write(","))
            self.advance()
            return True
        if self.begins_value() and not self.begins_entry(self.position) and token.kind != BAD:
            self.tell("D024", f"a `,` is missing before {token_in_words(token)}", self.behind(self.previous))
            return True
        if token.text == "=":
            compare = "to compare, write `==`"
            self.unexpected(f"`,` or `{closing}`", help=write("==", compare) if closing == ")" else compare)
        return False

    def semicolon(self, value: Expression, *, may_open: bool = False) -> None:
        """Read an entry's `;`; one missing at a line's end is noted. may_open: it may be a block's head without `{`."""
        token = self.token
        if token.text == ";":
            self.advance()
            return
        if isinstance(value, Call) and value.body is not None:
            return
        if token.kind == BAD:
            raise Unreadable
        if may_open and isinstance(value, Name):
            self.unopened.append(self.behind(self.previous))
        begins_next = token.kind == NAME and self.following.text in ("=", "+=", "{", ".")
        if token.text == "}" or token.kind == END or self.on_new_line(self.position) or begins_next:
            self.tell(
                "D021",
                "expected `;`",
                self.behind(self.previous),
                help=write(";", "an entry ends with `;`", where="before"),
            )
            return
        another = self.following.kind == NAME and self.tokens[self.position + 2].text in ("=", "+=")
        if token.text == "," and (another or self.on_new_line(self.position + 1) or self.following.text == "}"):
            self.tell("D024", "`,` at the end of an entry", token, help=write(";"))
            self.advance()
            return
        if token.text in (")", "]"):
            self.unbalanced = True
            self.fail("D022", f"this `{token.text}` closes nothing", token, help=NOT_OPEN)
        helps = {
            "=": "to compare, write `==`; to set two things, write two entries",
            "..": "a range is written `first .. last by step`",
            ",": self.decimal_comma() or "a list stands in brackets: `[a, b]`",
            "?": "there is no `?:` in a deck; `#if` chooses between builds",
        }
        self.unexpected(
            "`;`" if token.kind in (*NUMBERS, STRING, NAME) else "`;` or an operator", help=helps.get(token.text, ())
        )

    def decimal_comma(self) -> str:
        """The remedy for `0,325`; "" where the comma has another meaning."""
        whole, part = self.previous, self.following
        if not (whole.kind == part.kind == WHOLE and whole.end == self.token.offset and self.token.end == part.offset):
            return ""
        remedy = f"a number has a decimal point: `{whole.text}.{part.text}`"
        if len(part.text) == 3 and whole.text != "0":
            remedy += f"; thousands have no mark: `{whole.text}{part.text}`"
        return remedy

    def ends_entry(self) -> bool:
        """Return True if the semicolon here ends the entry, so that only the closing bracket is missing."""
        after = self.following
        return after.text == "}" or after.kind == END or self.begins_entry(self.position + 1)
