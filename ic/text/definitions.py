"""Checks of a `#define`: the macro's name, parameters and body, and the forms that its body takes."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence

from ic.text.lexer import BAD, COMMAND_LINE, NAME, NUMBERS, PASTE, SPACE, Token, complain_of_stray
from ic.text.limits import LONGEST_NAME, MOST_MACRO_BODY, Findings
from ic.text.substitute import OPTIONAL, REST, Macro, closing, stripped
from met import units
from met.diagnostic import Help, Label, Problem, error, write

CLOCK = ("__DATE__", "__TIME__", "__TIMESTAMP__")
LONGEST_UNIT = 200  # tokens
COUNTER = "__COUNTER__"  # 0, 1, 2, ...: another number at each use
PREDEFINED = ("__FILE__", "__LINE__", COUNTER, "defined", REST, OPTIONAL, *CLOCK)


def checked_definition(tokens: list[Token], is_macro: Callable[[str], bool], findings: Findings) -> list[Token]:
    """The body of the `#define` whose tokens these are, from the macro's name on. Stray characters in it are reported.

    is_macro: whether there is a macro of a name. Raises Problem D007, D011, D018 or D019 where the definition is not
    sound.
    """
    name = tokens[0]
    if name.kind != NAME:
        raise Problem(
            error(
                "D007",
                f"a macro's name cannot be `{name.text[:LONGEST_NAME]}`",
                name.place,
                help="a name is letters, digits and `_`, and begins with no digit",
            )
        )
    if name.text in PREDEFINED:
        raise Problem(
            error("D007", f"`{name.text}` cannot be a macro of yours", name.place, help="choose another name")
        )
    if units.is_unit(name.text):
        raise Problem(
            error(
                "D011",
                f"a macro cannot be called `{name.text}`: that is the unit {units.UNITS[name.text].word}",
                name.place,
                help=f"it would replace the unit in every quantity after it: `2 {name.text}` would lose its unit",
            )
        )
    body = tokens[1:]
    parameters: list[Token] | None = None
    if body and body[0].text == "(":
        close = next((i for i, token in enumerate(body) if token.text == ")"), None)
        if close is None:
            raise Problem(
                error(
                    "D007",
                    f"the parameters of macro `{name.text}` have no `)`",
                    body[0].place,
                    help=f"write `#define {name.text[:LONGEST_NAME]}(A, B) ...` on one line",
                )
            )
        parameters = [token for token in body[1:close] if token.kind != SPACE]
        _check_parameters(parameters)
        body = body[close + 1 :]
    elif body and body[0].kind != SPACE:
        raise Problem(
            error(
                "D007",
                f"a space is needed between the macro's name and `{body[0].text[:LONGEST_NAME]}`",
                body[0].place,
                help=f"write `#define {name.text[:LONGEST_NAME]} {body[0].text[:LONGEST_NAME]}`",
            )
        )
    if len(body) > MOST_MACRO_BODY:
        raise Problem(
            error("D018", f"the body of macro `{name.text}` has more than {MOST_MACRO_BODY} tokens", name.place)
        )
    written = [token for token in body if token.kind != SPACE]
    for token in written:
        if token.kind == BAD:
            complain_of_stray(token, findings)
    _check_rest(written, parameters or ())
    if parameters is not None:
        _check_strings(written, {token.text for token in parameters})
        _check_units(parameters, written, is_macro)
    _check_ends((*written[:1], *written[-1:]))
    return body


def _check_parameters(written: list[Token]) -> None:
    """Raise Problem D007 where parameters of a macro are not names, each once, with commas between them."""
    seen: set[str] = set()
    for i, token in enumerate(written):
        last = i == len(written) - 1
        if i % 2:
            if token.text != "," or last:
                more = token.text == "..."
                help = f"write `...` alone, and `{REST}` in the body" if more else "write `(A, B)`: names, and commas"
                raise Problem(
                    error("D007", f"expected `,` and a parameter, or `)`, not `{token.text}`", token.place, help=help)
                )
        elif token.text == "..." and last:
            pass
        elif token.kind != NAME or token.text in PREDEFINED or token.text in seen:
            why, help = "cannot be a parameter", "a parameter is a name"
            if token.text in seen:
                why, help = "is there twice", "give each parameter a name of its own"
            raise Problem(error("D007", f"`{token.text}` {why}", token.place, help=help))
        seen.add(token.text)


def _check_strings(written: list[Token], parameters: set[str]) -> None:
    """Raise Problem D019 where no parameter follows a `#` in the body of a macro that takes arguments."""
    known = parameters - {"...", ","} | ({REST, OPTIONAL} if "..." in parameters else set())
    for i, token in enumerate(written):
        if token.text == "#" and (i + 1 == len(written) or written[i + 1].text not in known):
            raise Problem(
                error(
                    "D019",
                    "`#` makes a string of a parameter, and none follows",
                    token.place,
                    help="a macro cannot make directives",
                )
            )


def _check_rest(written: list[Token], parameters: Sequence[Token]) -> None:
    """Raise Problem where `__VA_ARGS__` or `__VA_OPT__(...)` stands in the body of a macro that takes no more
    arguments, or `__VA_OPT__` is not whole (D007), or begins or ends with `##` (D019)."""
    variadic = any(token.text == "..." for token in parameters)
    end = 0
    for i, token in enumerate(written):
        if token.kind != NAME or token.text not in (REST, OPTIONAL):
            continue
        if not variadic:
            raise Problem(
                error(
                    "D007",
                    f"`{token.text}` stands in the body of a macro that takes `...` only",
                    token.place,
                    help="`...` as the last parameter takes all further arguments",
                )
            )
        if token.text == REST:
            continue
        if i < end:
            raise Problem(
                error("D007", f"`{OPTIONAL}` stands within another", token.place, help="write one behind the other")
            )
        opens = i + 1 < len(written) and written[i + 1].text == "("
        end = closing(written, i + 1) if opens else len(written)
        if end == len(written):
            raise Problem(
                error(
                    "D007",
                    f"`{OPTIONAL}` needs parentheses around what it is about",
                    token.place,
                    help=f"write `{OPTIONAL}(, {REST})`: what stands there is left out where no more arguments are "
                    "given",
                )
            )
        _check_ends((written[i + 2], written[end - 1]))


def _check_ends(ends: Sequence[Token]) -> None:
    """Raise Problem D019 where a `##` is among the first and last tokens of a body or of an `__VA_OPT__(...)`."""
    for token in ends:
        if token.kind == PASTE:
            raise Problem(
                error(
                    "D019",
                    "`##` joins two tokens, so it cannot stand at an end",
                    token.place,
                    help="write what it joins on both sides of it",
                )
            )


def _check_units(parameters: Sequence[Token], written: list[Token], is_macro: Callable[[str], bool]) -> None:
    """Raise Problem D011 where a parameter with a unit's name stands where the body may have that unit."""
    names = {token.text: token for token in parameters}
    for i, token in enumerate(written):
        if token.text not in names or not units.is_unit(token.text):
            continue
        before = written[max(0, i - LONGEST_UNIT) : i]
        if _may_be_unit(before, names, is_macro):
            word = units.UNITS[token.text].word
            message = f"a macro's parameter cannot be called `{token.text}`: in its body that is the unit {word}"
            label = Label(token.place, f"this `{token.text}` would be the argument, not the unit")
            place, help = names[token.text].place, "choose another name for it"
            raise Problem(error("D011", message, place, also=(label,), help=help))


def _may_be_unit(body: Sequence[Token], parameters: Container[str], is_macro: Callable[[str], bool]) -> bool:
    """Return True if a unit could follow: the body ends in a number or closing bracket, or what may become one, or in
    `*`, `/` or `(` behind another unit."""
    position = len(body)
    while position > 0:
        before = body[position - 1]
        if before.text == "(":
            position -= 1
            continue
        if before.text not in ("*", "/"):
            if before.kind == NAME:
                return before.text in parameters or is_macro(before.text)
            return before.kind in NUMBERS or before.text in ("]", ")", "%")
        position -= 2
        if position < 1:
            return False
        if body[position].text == "1" and (body[position - 1].kind in NUMBERS or body[position - 1].text in ("]", ")")):
            return True  # `15 1/s`
        if body[position].kind in NUMBERS:  # behind an exponent, or no unit at all
            position -= 1
            position -= body[position].text in ("-", "+")
            if body[position].text != "^":
                return False
            position -= 1
        if body[position].text == ")":
            depth = 0
            while position > 0:
                depth += {")": 1, "(": -1}.get(body[position].text, 0)
                if depth == 0:
                    break
                position -= 1
        elif not units.is_unit(body[position].text):
            return False
    return False


def warn_of_quantity(name: Token, body: list[Token], findings: Findings) -> None:
    """Warn about `#define LENGTH 2.0 m`, since the value of `LENGTH^2` would surprise."""
    written = [token for token in body if token.kind != SPACE]
    if written and written[0].text in ("-", "+"):
        del written[0]
    if len(written) < 2 or written[0].kind not in NUMBERS or not units.is_unit(written[1].text):
        return
    if any(token.kind == NAME and not units.is_unit(token.text) for token in written[1:]):
        return
    quantity = "".join(token.text for token in body).strip()
    why = f"a macro is put in as text, so `{name.text}^2` would be `{quantity}^2`"
    line = name.source.text.rfind("#", 0, name.offset)
    definition = name.source.place(line, written[-1].end - line, name.expansions)
    help = write(f"let {name.text} = {quantity};", f"write `let {name.text} = {quantity};`: {why}", at=definition)
    if name.source.name == COMMAND_LINE:
        help = Help(f"write `let {name.text} = ...;` in the deck, and `--set '{name.text}={quantity}'`: {why}")
    findings.warn("D017", f"macro `{name.text}` is a quantity", name.place, help=help)


def parameters(head: list[Token]) -> tuple[str, ...] | None:
    """The names between the parentheses of a sound definition; None where it has none. head: the tokens of
    `NAME(a, b)`"""
    if not any(token.text == "(" for token in head):
        return None
    names = [token.text for token in head[2:-1] if token.kind != SPACE and token.text != ","]
    return tuple(REST if name == "..." else name for name in names)


def spelling(macro: Macro) -> tuple[object, ...]:
    """A key that is equal for equal definitions: parameters and body, with all white space alike."""
    body: list[str] = []
    for token in macro.body:
        blank = token.kind == SPACE
        if not blank or (body and body[-1] != " "):
            body.append(" " if blank else token.text)
    return (macro.parameters, tuple(body))


def trimmed(body: list[Token]) -> list[Token]:
    """The body without white space at its ends and beside `##`."""
    tokens: list[Token] = []
    for token in body:
        if token.kind == SPACE and tokens and tokens[-1].kind == PASTE:
            continue
        while token.kind == PASTE and tokens and tokens[-1].kind == SPACE:
            tokens.pop()
        tokens.append(token)
    return stripped(tokens)
