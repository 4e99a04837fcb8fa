"""What a `#define` may define: the checks of a macro's name, parameters and body, and the forms that its body takes."""

from __future__ import annotations

from typing import Any

from ic.text.lexer import BAD, NAME, NOTHING, NUMBERS, PASTE, SPACE, Token
from ic.text.limits import LONGEST_NAME, MOST_MACRO_BODY, Findings
from ic.text.strays import complain_of_stray
from met import units

PASTED_COMMA = "##"  # text of white space; see forms_at_comma
CLOCK = ("__DATE__", "__TIME__", "__TIMESTAMP__")
REST = "__VA_ARGS__"
PREDEFINED = ("__FILE__", "__LINE__", "defined", REST, *CLOCK)


def checked(tokens: list[Token], findings: Findings) -> list[Token] | None:
    """The body of a sound definition; None, and a message, for another."""
    name, tell = tokens[0], findings.error
    if name.kind != NAME:
        tell("D007", f"a macro's name cannot be `{name.text[:LONGEST_NAME]}`", name.place,
             help="a name is letters, digits and `_`, and begins with no digit")  # fmt: skip
        return None
    if name.text in PREDEFINED:
        tell("D007", f"`{name.text}` cannot be a macro of yours", name.place, help="choose another name")
        return None
    if units.is_unit(name.text):
        word = units.UNITS[name.text].word
        help = f"it would replace the unit in every quantity after it: `2 {name.text}` would lose its unit"
        tell("D011", f"a macro cannot be called `{name.text}`: that is the unit {word}", name.place, help=help)
        return None
    body = tokens[1:]
    parameters: list[Token] | None = None
    if body and body[0].text == "(":
        close = next((i for i, token in enumerate(body) if token.text == ")"), None)
        if close is None:
            tell("D007", f"the parameters of macro `{name.text}` have no `)`", body[0].place,
                 help=f"write `#define {name.text[:LONGEST_NAME]}(A, B) ...` on one line")  # fmt: skip
            return None
        parameters = [token for token in body[1:close] if token.kind != SPACE]
        if not _checked_parameters(name, parameters, findings):
            return None
        body = body[close + 1 :]
    elif body and body[0].kind != SPACE:
        tell(
            "D007", f"a space is needed between the macro's name and `{body[0].text[:LONGEST_NAME]}`",
            body[0].place, help=f"write `#define {name.text[:LONGEST_NAME]} {body[0].text[:LONGEST_NAME]}`",
        )  # fmt: skip
        return None
    if len(body) > MOST_MACRO_BODY:
        tell("D018", f"the body of macro `{name.text}` has more than {MOST_MACRO_BODY} tokens", name.place)
        return None
    written = [token for token in body if token.kind != SPACE]
    for token in written:
        if token.kind == BAD:
            complain_of_stray(token, findings)
    if parameters is not None and not _checked_strings(written, {token.text for token in parameters}, findings):
        return None
    for token in (*written[:1], *written[-1:]):
        if token.kind == PASTE:
            tell("D019", "`##` joins two tokens, so it cannot stand at an end", token.place,
                 help="write what it joins on both sides of it")  # fmt: skip
            return None
    return body


def _checked_parameters(name: Token, written: list[Token], findings: Findings) -> bool:
    seen: set[str] = set()
    for i, token in enumerate(written):
        last = i == len(written) - 1
        if i % 2:
            if token.text != "," or last:
                more = token.text == "..."
                help = f"write `...` alone, and `{REST}` in the body" if more else "write `(A, B)`: names, and commas"
                findings.error("D007", f"expected `,` and a parameter, or `)`, not `{token.text}`", token.place,
                               help=help)  # fmt: skip
                return False
        elif units.is_unit(token.text):
            word = units.UNITS[token.text].word
            message = f"a macro's parameter cannot be called `{token.text}`: that is the unit {word}"
            help = f"in the body of `{name.text}` it would replace the unit: `0.5 {token.text}` would lose it"
            findings.error("D011", message, token.place, help=help)
            return False
        elif token.text == "..." and last:
            pass
        elif token.kind != NAME or token.text in PREDEFINED or token.text in seen:
            why, help = "cannot be a parameter", "a parameter is a name"
            if token.text in seen:
                why, help = "is there twice", "give each parameter a name of its own"
            findings.error("D007", f"`{token.text}` {why}", token.place, help=help)
            return False
        seen.add(token.text)
    return True


def _checked_strings(written: list[Token], parameters: set[str], findings: Findings) -> bool:
    """Whether a parameter follows each `#` of a macro that takes arguments."""
    known = parameters - {"...", ","} | ({REST} if "..." in parameters else set())
    for i, token in enumerate(written):
        if token.text == "#" and (i + 1 == len(written) or written[i + 1].text not in known):
            findings.error("D019", "`#` makes a string of a parameter, and none follows", token.place,
                           help="a macro cannot make directives")  # fmt: skip
            return False
    return True


def warn_of_quantity(name: Token, body: list[Token], findings: Findings) -> None:
    """`#define LENGTH 2.0 m`: the value of `LENGTH^2` would surprise."""
    written = [token for token in body if token.kind != SPACE]
    if written and written[0].text in ("-", "+"):
        del written[0]
    if len(written) < 2 or written[0].kind not in NUMBERS or not units.is_unit(written[1].text):
        return
    if any(token.kind == NAME and not units.is_unit(token.text) for token in written[1:]):
        return
    quantity = "".join(token.text for token in body).strip()
    why = f"a macro is put in as text, so `{name.text}^2` would be `{quantity}^2`"
    help = f"write `let {name.text} = {quantity};`: {why}"
    findings.warn("D017", f"macro `{name.text}` is a quantity", name.place, help=help)


def spelling(macro: Any) -> tuple[object, ...]:
    """What makes two definitions the same: parameters and body, any white space being as good as another."""
    body: list[str] = []
    for token in macro.written:
        blank = token.kind == SPACE and token.text != PASTED_COMMA
        if not blank or (body and body[-1] != " "):
            body.append(" " if blank else token.text)
    while body and body[-1] == " ":
        body.pop()
    return (tuple(macro.arglist) if macro.arglist is not None else None, macro.variadic, tuple(body))


def without_space_at_paste(body: list[Token]) -> list[Token]:
    kept: list[Token] = []
    for token in body:
        if token.kind == SPACE and kept and kept[-1].kind == PASTE:
            continue
        while token.kind == PASTE and kept and kept[-1].kind == SPACE and len(kept) > 1:
            kept.pop()
        kept.append(token)
    return kept


def forms_at_comma(body: list[Token]) -> tuple[list[Token], list[Token]] | None:
    """The body for a call that gives the rest of the arguments, and for one that does not; None where it is the same.

    As in gcc, `, ## __VA_ARGS__` is a comma and the rest of the arguments, or neither. The `##` that pastes nothing
    becomes white space; by its text pcpp still sees that the arguments behind it are to be put in as written.
    """
    given, omitted = list(body), list(body)
    for i in range(len(body) - 3, -1, -1):
        behind = body[i + 3].kind if i + 3 < len(body) else ""
        if body[i].text == "," and body[i + 1].kind == PASTE and body[i + 2].text == REST and behind != PASTE:
            given[i + 1] = body[i + 1].__copy__()
            given[i + 1].kind = SPACE
            spaced = i > 0 and body[i - 1].kind == SPACE
            del omitted[i - spaced : i + 2]
    return (given, omitted) if len(omitted) < len(body) else None


def without_nothing(made: list[Token], spaced: bool) -> list[Token]:
    """What a macro made, without what stood for nothing. spaced: white space was written before the rest of the
    arguments, and stands behind the comma of forms_at_comma too."""
    for piece in made:
        if piece.kind == NOTHING and spaced and piece.text == PASTED_COMMA:
            piece.kind, piece.text = SPACE, " "
    return [piece for piece in made if piece.kind != NOTHING]
