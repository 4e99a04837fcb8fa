"""The conditions of `#if` and `#elif`: C's whole numbers of 64 bits, with and without a sign, and C's operators.

A result that does not fit wraps round, as gcc and clang do it. What C leaves open is an error here: a shift by less
than 0 or more than 63, a character constant of several characters. What `&&`, `||` and `?:` leave out is read, but not
computed: `0 && 1 / 0` is 0.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from operator import add as plus
from operator import and_, eq, ge, gt, le, lt, mul, ne, or_, sub, xor
from types import MappingProxyType
from typing import NamedTuple, NoReturn

from ic.text.lexer import BAD, CHARACTER, DECIMAL, NAME, SPACE, STRING, WHOLE, Token, complain_of_stray
from ic.text.limits import CONDITION_NESTING, LONGEST_NUMBER, MOST_TERMS, Findings
from met.diagnostic import Place, Problem, error, write

_NUMBER = re.compile(r"(?:0[xX](?P<hex>[0-9a-fA-F]+)|0(?P<octal>[0-7]*)|(?P<decimal>[1-9][0-9]*))")
_SUFFIX = re.compile(r"[uU](?:l|L|ll|LL)?|(?:l|L|ll|LL)[uU]?")
_WORDS = MappingProxyType({"and": "&&", "or": "||", "not": "!"})
_ESCAPE = re.compile(r"\\(?:x(?P<hex>[0-9a-fA-F]{1,2})|(?P<octal>[0-7]{1,3})|(?P<plain>[abfnrtv\\'\"?]))")
_ESCAPED = MappingProxyType(dict(zip("abfnrtv\\'\"?", b"\a\b\f\n\r\t\v\\'\"?", strict=True)))
_USUAL = "a condition is of whole numbers, macros, `defined(NAME)` and C's operators"

_LEVEL: Mapping[str, int] = MappingProxyType({
    "||": 1, "&&": 2, "|": 3, "^": 4, "&": 5, "==": 6, "!=": 6, "<": 7, "<=": 7, ">": 7, ">=": 7, "<<": 8, ">>": 8,
    "+": 9, "-": 9, "*": 10, "/": 10, "%": 10,
})  # fmt: skip
_COMPARED: Mapping[str, Callable[[int, int], bool]] = MappingProxyType(
    {"==": eq, "!=": ne, "<": lt, "<=": le, ">": gt, ">=": ge}
)
_COMPUTED: Mapping[str, Callable[[int, int], int]] = MappingProxyType(
    {"|": or_, "^": xor, "&": and_, "+": plus, "-": sub, "*": mul}
)


class _Value(NamedTuple):
    """A number of 64 bits; `plain` where it has no sign."""

    number: int
    plain: bool = False


def check_written(directive: Token, args: Sequence[Token]) -> None:
    """Raise Problem where a directive has no condition, a `defined` in it is without a name (D009), or it is too long
    (D018)."""
    written = [token for token in args if token.kind != SPACE]
    if not written:
        raise Problem(
            error(
                "D009",
                f"`#{directive.text}` needs a condition",
                directive.place,
                help=f"write `#{directive.text} NAME == 1`, or another condition",
            )
        )
    if len(written) > MOST_TERMS:
        raise Problem(error("D018", f"a condition has at most {MOST_TERMS} tokens", directive.place))
    _each_defined(written)


def with_defined(tokens: Sequence[Token], is_defined: Callable[[Token], bool]) -> list[Token]:
    """The condition with a number in place of each `defined NAME`. Raises Problem D009 where no name follows."""
    written = [token for token in tokens if token.kind != SPACE]
    replaced, position = [], 0
    for first, name, end in _each_defined(written):
        replaced += written[position:first]
        replaced.append(written[first].standing_for(WHOLE, "1" if is_defined(written[name]) else "0"))
        position = end
    return [*replaced, *written[position:]]


def _each_defined(written: Sequence[Token]) -> list[tuple[int, int, int]]:
    """Positions of each `defined`, its name, and the token after it. Raises Problem D009 if one has no name."""
    stretches: list[tuple[int, int, int]] = []
    texts = [token.text for token in written] + ["", "", ""]
    for i, token in enumerate(written):
        if token.text != "defined" or token.kind != NAME or (stretches and i < stretches[-1][2]):
            continue
        bracketed = texts[i + 1] == "("
        name = i + 1 + bracketed
        named = name < len(written) and written[name].kind == NAME
        if not named or (bracketed and texts[name + 1] != ")"):
            raise Problem(error("D009", "`defined` needs a macro's name", token.place, help="write `defined(NAME)`"))
        stretches.append((i, name, name + 1 + bracketed))
    return stretches


def evaluate(tokens: Sequence[Token], findings: Findings, unknown: Callable[[Token], None]) -> bool:
    """Return True if an expanded condition holds. Raises Problem where it has no meaning.

    unknown: called with each name that is not a macro and counts as 0
    """
    return _Condition([token for token in tokens if token.kind != SPACE], findings, unknown).truth()


class _Condition:
    """A reader of the tokens of a condition. `live`: whether what is read counts."""

    def __init__(self, tokens: Sequence[Token], findings: Findings, unknown: Callable[[Token], None]) -> None:
        self.tokens = tokens
        self.unknown = unknown
        self.findings = findings
        self.position = 0
        self.depth = 0

    def truth(self) -> bool:
        """True if the whole condition is not 0. Raises Problem."""
        value = self.whole(live=True)
        if self.position < len(self.tokens):
            self.cannot_follow()
        return value.number != 0

    # complaints

    def refuse(self, message: str, place: Token | Place, help: str = "", code: str = "D009") -> NoReturn:
        raise Problem(error(code, message, place.place if isinstance(place, Token) else place, help=help or ()))

    def not_understood(self, why: str, token: Token) -> NoReturn:
        used = next((token.text for token in self.tokens if token.text in _WORDS), "")
        words = f"the preprocessor writes `{_WORDS[used]}` for `{used}`" if used else ""
        self.refuse(f"this condition cannot be understood: {why}", token, words or _USUAL)

    def cannot_follow(self) -> NoReturn:
        """Refuse the token behind a complete condition, with what may have been meant."""
        token, before = self.tokens[self.position], self.tokens[self.position - 1]
        self.no_stray(token)
        if token.text == "=":
            self.refuse("`=` does not compare", token, write("=="))
        if token.text == "(" and before.kind == NAME:
            self.not_understood(f"`{before.text[:LONGEST_NUMBER]}` is not a macro with arguments", before)
        if token.text == ":":
            self.not_understood("`:` without its `?`", token)
        if token.text == ")":
            self.not_understood("this `)` closes nothing", token)
        self.not_understood(f"expected an operator, found `{token.text[:LONGEST_NUMBER]}`", token)

    def no_stray(self, token: Token) -> None:
        if token.kind == BAD:
            if token.text:  # else the mistake it stands for is already reported
                complain_of_stray(token, self.findings)
            raise Problem(())

    def no_double(self, token: Token) -> None:
        """Report `--` and `++`, which C reads as one token."""
        if token.text in ("-", "+") and self.text() == token.text:
            after = self.tokens[self.position]
            if after.source is token.source and after.offset == token.end:
                both = token.source.place(token.offset, 2, token.expansions)
                self.refuse(
                    f"`{token.text * 2}` has no meaning in a condition", both, write(f"{token.text} {token.text}")
                )

    # reading

    def text(self) -> str:
        return self.tokens[self.position].text if self.position < len(self.tokens) else ""

    def take(self, text: str, opening: Token) -> None:
        """Take the sign that is to be next. opening: the one that it closes. Raises Problem where another is there."""
        if self.text() != text:
            if self.position < len(self.tokens):
                if self.text() not in (")", ":"):
                    self.cannot_follow()
                self.not_understood(f"expected `{text}`, found `{self.text()}`", self.tokens[self.position])
            self.not_understood(f"this `{opening.text}` lacks its `{text}`", opening)
        self.position += 1

    def deeper(self, token: Token) -> None:
        self.depth += 1
        if self.depth > CONDITION_NESTING:
            self.refuse(f"a condition goes deeper than {CONDITION_NESTING}", token, code="D018")

    def whole(self, live: bool) -> _Value:
        """The value of a condition with commas, of which the last value counts."""
        value = self.choice(live)
        while self.text() == ",":
            self.position += 1
            value = self.choice(live)
        return value

    def choice(self, live: bool) -> _Value:
        """Read `a ? b : c`, or what binds tighter. live: False where C does not evaluate it."""
        condition = self.binary(1, live)
        if self.text() != "?":
            return condition
        question = self.tokens[self.position]
        self.deeper(question)
        self.position += 1
        holds = condition.number != 0
        yes = self.whole(live and holds)
        self.take(":", question)
        no = self.choice(live and not holds)
        self.depth -= 1
        return _wrapped((yes if holds else no).number, yes.plain or no.plain)

    def binary(self, least: int, live: bool) -> _Value:
        """The value of operators that bind at least as tightly as `least`. live: False where C does not evaluate it"""
        left = self.unary(live)
        while True:
            operator = self.text()
            level = _LEVEL.get(operator, 0)
            if level < least:
                return left
            token = self.tokens[self.position]
            self.position += 1
            self.no_double(token)
            if operator in ("&&", "||"):
                decides = (left.number != 0) == (operator == "||")
                right = self.binary(level + 1, live and not decides)
                left = _Value(int((left.number != 0) if decides else (right.number != 0)))
            else:
                left = self.computed(token, left, self.binary(level + 1, live), live)

    def computed(self, operator: Token, left: _Value, right: _Value, live: bool) -> _Value:
        """The value of an operator on two numbers of 64 bits, as in C. Raises Problem."""
        text, plain = operator.text, left.plain or right.plain
        if text in ("<<", ">>"):
            if not live:
                return left
            if not 0 <= right.number <= 63:
                self.refuse(
                    f"`{text}` shifts by a number from 0 to 63 here, and this is {right.number}",
                    operator,
                    "C does not say what another number means",
                )
            return _wrapped(left.number << right.number if text == "<<" else left.number >> right.number, left.plain)
        a, b = _wrapped(left.number, plain).number, _wrapped(right.number, plain).number
        if text in _COMPARED:
            return _Value(int(_COMPARED[text](a, b)))
        if text in _COMPUTED:
            return _wrapped(_COMPUTED[text](a, b), plain)
        if not live:
            return _Value(0, plain)
        if b == 0:
            self.refuse("this condition divides by zero", operator, "ask before: `NAME != 0 && 10 / NAME > 2`")
        quotient = abs(a) // abs(b) if (a < 0) == (b < 0) else -(abs(a) // abs(b))  # towards zero, as in C
        return _wrapped(quotient if text == "/" else a - b * quotient, plain)

    def unary(self, live: bool) -> _Value:
        """A value, with the operators in front of it."""
        if self.position == len(self.tokens):
            self.not_understood("it ends too early", self.tokens[-1])
        token = self.tokens[self.position]
        text = token.text
        if text not in ("-", "+", "~", "!", "("):
            return self.operand(token, live)
        self.deeper(token)
        self.position += 1
        if text == "(":
            value = self.whole(live)
            self.take(")", token)
        else:
            self.no_double(token)
            inner = self.unary(live)
            if text == "!":
                value = _Value(int(inner.number == 0))
            else:
                changed = {"-": -inner.number, "~": ~inner.number, "+": inner.number}[text]
                value = _wrapped(changed, inner.plain)
        self.depth -= 1
        return value

    def operand(self, token: Token, live: bool) -> _Value:
        """The value of a number, a name or a character; of other tokens Problem is raised."""
        self.no_stray(token)
        if token.kind == WHOLE:
            return self.number(token)
        if token.kind == NAME:  # a name that is not a macro is 0, as in C
            self.position += 1
            if live:
                self.unknown(token)
            return _Value(0)
        if token.kind == CHARACTER:
            return self.character(token)
        if token.kind == DECIMAL:
            self.refuse(
                f"`#if` compares whole numbers only, as in C, and `{token.text[:LONGEST_NUMBER]}` is not whole",
                token,
                "give the switch whole values, or choose by `#ifdef`",
            )
        if token.kind == STRING:
            self.refuse(
                "`#if` compares whole numbers only, as in C: a string has no value here",
                token,
                "define each choice as a number, `#define RIGID 1`, and compare with its name",
            )
        self.not_understood(f"expected a value, found `{token.text[:LONGEST_NUMBER]}`", token)

    def number(self, token: Token) -> _Value:
        """The value of one of C's whole numbers, with its suffix. Raises Problem."""
        self.position += 1
        text = token.text
        matched = _NUMBER.fullmatch(text)
        if len(text) > LONGEST_NUMBER or matched is None:
            self.refuse(
                f"`{text[:LONGEST_NUMBER]}` is not a whole number that C knows",
                token,
                "a number that begins with 0 is octal" if text.startswith("0") else "",
            )
        base = 16 if matched["hex"] else 10 if matched["decimal"] else 8
        value = int(matched["hex"] or matched["decimal"] or matched["octal"] or "0", base)
        if value >= 1 << 64:
            self.refuse(f"`{text}` does not fit into 64 bits", token, f"the largest number is {2**64 - 1}")
        plain = value >= 1 << 63
        after = self.tokens[self.position] if self.position < len(self.tokens) else None
        if after is not None and after.kind == NAME and after.source is token.source and after.offset == token.end:
            if not _SUFFIX.fullmatch(after.text):
                written = f"{text}{after.text}"[:LONGEST_NUMBER]
                self.refuse(
                    f"`{written}` is not a whole number that C knows",
                    token,
                    "write it in decimal, or in hexadecimal as in `0x1F`",
                )
            plain = plain or "u" in after.text.lower()
            self.position += 1
        return _Value(value, plain)

    def character(self, token: Token) -> _Value:
        """The code of a character between quotes, with the sign of `char`. Raises Problem."""
        self.position += 1
        inner = token.text[1:-1]
        escape = _ESCAPE.fullmatch(inner)
        if escape is not None:
            written = escape["hex"] or escape["octal"]
            code = int(written, 16 if escape["hex"] else 8) if written else _ESCAPED[escape["plain"]]
        elif len(inner) == 1 and inner.isascii():
            code = ord(inner)
        else:
            self.refuse(
                f"`{token.text[:LONGEST_NUMBER]}` has no value here",
                token,
                "between the quotes stands one character, of ASCII, or one escape such as `\\n`",
            )
        return _Value(code - 256 if 127 < code < 256 else code)


def _wrapped(number: int, plain: bool) -> _Value:
    """The number wrapped into 64 bits."""
    number &= (1 << 64) - 1
    return _Value(number if plain or number < 1 << 63 else number - (1 << 64), plain)
