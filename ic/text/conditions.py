"""The conditions of `#if` and `#elif`: whole numbers, as in C. pcpp evaluates them; here is what it would get wrong.

pcpp cuts `0.5` in two, takes `08` for 0, compares strings by accident and computes `1 << 9999999999`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from ic.text.lexer import BAD, DECIMAL, JOINED, NAME, SPACE, STRING, WHOLE, Token
from ic.text.limits import LONGEST_NUMBER, Findings
from ic.text.strays import complain_of_stray

_C_NUMBER = re.compile(r"0[xX][0-9a-fA-F]+|0[0-7]*[lL]?|[1-9][0-9]*|1L")
_C_WORDS = {"and": "&&", "or": "||", "not": "!"}
MOST_TERMS = 2_000


class Refused(Exception):
    """The condition has no meaning, and that has been said."""


def well_formed(directive: Token, args: list[Token], findings: Findings) -> bool:
    """Whether there is a condition, and each `defined` in it is followed by a name."""
    written = [token for token in args if token.kind not in (SPACE, JOINED)]
    if not written:
        findings.error("D009", f"`#{directive.text}` needs a condition", directive.place)
        return False
    if len(written) > MOST_TERMS:
        findings.error("D018", f"a condition has at most {MOST_TERMS} tokens", directive.place)
        return False
    texts = [token.text for token in written] + ["", "", ""]
    for i, token in enumerate(written):
        if token.text != "defined" or token.kind != NAME:
            continue
        name = i + 2 if texts[i + 1] == "(" else i + 1
        named = name < len(written) and written[name].kind == NAME
        if not named or (name == i + 2 and texts[i + 3] != ")"):
            findings.error("D009", "`defined` needs a macro's name", token.place, help="write `defined(NAME)`")
            return False
    return True


def evaluate(tokens: list[Token], findings: Findings, compute: Callable[[], Any]) -> Any:
    """The value of an expanded condition, by `compute`; raises Refused, with a message noted, where it has none."""
    written = [token for token in tokens if token.kind not in (SPACE, JOINED)]
    after = [*written[1:], None]
    for token, following in zip(written, after, strict=True):
        _check(token, following, findings)
    try:
        value = compute()
        value.value()
        return value
    except ZeroDivisionError:
        findings.error("D009", "this condition divides by zero", _whole(written))
    except Exception as reason:  # whatever pcpp's parser makes of nonsense
        said = str(reason)
        why = said if said.endswith("is not a macro with arguments") else _expected(said)
        usual = "a condition is of whole numbers, macros, `defined(NAME)` and C's operators"
        help = _words_for_symbols(written) or usual
        findings.error("D009", f"this condition cannot be understood: {why}", _whole(written), help=help)
    raise Refused


def _check(token: Token, following: Token | None, findings: Findings) -> None:
    def refuse(message: str, help: str = "") -> None:
        findings.error("D009", message, token.place, help=help or ())
        raise Refused

    if token.kind == BAD:
        complain_of_stray(token, findings)
        raise Refused
    if token.kind == DECIMAL:
        refuse(f"`#if` compares whole numbers only, as in C, and `{token.text[:LONGEST_NUMBER]}` is not whole",
               "give the switch whole values, or choose by `#ifdef`")  # fmt: skip
    if token.kind == STRING:
        refuse("`#if` compares whole numbers only, as in C: a string has no value here",
               "define each choice as a number, `#define RIGID 1`, and compare with its name")  # fmt: skip
    if token.text == "=":
        refuse("`=` does not compare", "write `==`")
    if token.kind == WHOLE and (len(token.text) > LONGEST_NUMBER or not _C_NUMBER.fullmatch(token.text)):
        refuse(f"`{token.text[:LONGEST_NUMBER]}` is not a whole number that C knows",
               "a number that begins with 0 is octal" if token.text.startswith("0") else "")  # fmt: skip
    if token.text in ("<<", ">>"):
        whole = following is not None and following.text.isdigit() and len(following.text) <= 2
        if not whole or int(following.text if following else 0) > 63:
            refuse(f"`{token.text}` shifts by a number from 0 to 63 here")


def _expected(said: str) -> str:
    match = re.match(r"around token '(.*)' type", said, re.DOTALL)
    if match:
        return f"`{match.group(1)[:LONGEST_NUMBER]}` is not expected where it stands"
    return "it ends too early" if said == "at EOF" else "it is not an expression"


def _words_for_symbols(written: list[Token]) -> str:
    used = [token.text for token in written if token.text in _C_WORDS]
    return f"the preprocessor writes `{_C_WORDS[used[0]]}` for `{used[0]}`" if used else ""


def _whole(written: list[Token]) -> Any:
    first, last = written[0], written[-1]
    together = first.source is last.source and first.expansions == last.expansions and first.line == last.line
    return first.source.place(first.offset, (last.end if together else first.end) - first.offset, first.expansions)
