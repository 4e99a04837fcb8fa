"""Macros: what may be defined, and what a use of one becomes.

pcpp parses a definition and puts arguments into a body, with `#` and `##`. The scan that finds what to expand is ours:
it is linear, keeps C's hide sets, and lets every token know each macro that it came through. So are the checks: a
deck's macros can be neither endless nor large, and may not take a unit's name.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from pcpp import Preprocessor as Pcpp

from ic.text.lexer import BAD, CHARACTER, JOINED, NAME, NUMBERS, PASTE, SPACE, STRING, WHOLE, Lexer, Token
from ic.text.limits import (
    LONGEST_NAME,
    LONGEST_STRING,
    MACRO_DEPTH,
    MOST_ARGUMENTS,
    MOST_EXPANDED,
    MOST_FROM_ONE_USE,
    MOST_MACRO_BODY,
    Findings,
    GiveUp,
)
from ic.text.strays import complain_of_stray
from met import units
from met.diagnostic import Expansion, Label, Place

CLOCK = ("__DATE__", "__TIME__", "__TIMESTAMP__")
PREDEFINED = ("__FILE__", "__LINE__", "defined", "__VA_ARGS__", *CLOCK)


class _Argument(list[Token]):
    """A macro's argument as written, with what it expands to; pcpp asks for one or the other."""

    expanded: list[Token]

    def __copy__(self) -> _Argument:
        other = _Argument(self)
        other.expanded = self.expanded
        return other


class Macros(Pcpp):
    """The half of the preprocessor that knows macros."""

    def __init__(self, findings: Findings) -> None:
        self.findings = findings
        self._expanded = 0
        self._expanded_here = 0
        self._depth = 0
        super().__init__(Lexer())
        self.macros: dict[str, Any] = {}
        self.refused: dict[str, bool] = {}  # macros that were refused, which was told; whether with parameters
        self.auto_pragma_once_enabled = False
        self.expand_filemacro = False

    def _Preprocessor__lexprobe(self) -> None:
        """Tells pcpp the kinds of our tokens, which it would otherwise find out by trying."""
        self.t_ID, self.t_INTEGER, self.t_INTEGER_TYPE = NAME, WHOLE, str
        self.t_STRING, self.t_CHAR, self.t_DPOUND = STRING, CHARACTER, PASTE
        self.t_SPACE = self.t_NEWLINE = SPACE
        self.t_LINECONT = JOINED
        self.t_WS = (SPACE, JOINED)
        self.t_COMMENT1 = self.t_COMMENT2 = "none: comments are spaces"
        self.t_COMMENT = (self.t_COMMENT1,)

    def define(self, tokens: Any) -> None:
        if isinstance(tokens, str):  # pcpp's own macros, and the clock: a deck must mean the same tomorrow
            return
        body = self._checked_definition(tokens)
        name = tokens[0]
        if body is None:
            takes = len(tokens) > 1 and tokens[1].text == "("
            if name.kind == NAME and name.text not in PREDEFINED and (takes or not units.is_unit(name.text)):
                self.refused[name.text] = takes
            return
        self.refused.pop(name.text, None)
        old = self.macros.get(name.text)
        super().define([*tokens[: len(tokens) - len(body)], *_without_space_at_paste(body)])
        macro = self.macros[name.text]
        macro.name_token = name
        macro.pastes = any(token.kind == PASTE for token in macro.value)
        if macro.arglist is None and macro.pastes:
            macro.patch, macro.str_patch, macro.var_comma_patch = [], [], []
        if old is not None and _spelling(old) != _spelling(macro):
            self.findings.error(
                "D010", f"macro `{name.text}` is defined again, differently", name.place,
                also=(Label(old.name_token.place, "first defined here"),),
                help=(f"`#undef {name.text}` first, or put the default between `#ifndef {name.text}` and `#endif`",),
            )  # fmt: skip
        elif old is None and macro.arglist is None:
            self._warn_of_quantity(name, macro.value)

    def _checked_definition(self, tokens: list[Token]) -> list[Token] | None:
        """The body of a sound definition; None, and a message, for another."""
        name, tell = tokens[0], self.findings.error
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
        if body and body[0].text == "(":
            close = next((i for i, token in enumerate(body) if token.text == ")"), None)
            if close is None:
                tell("D007", f"the parameters of macro `{name.text}` have no `)`", body[0].place,
                     help=f"write `#define {name.text[:LONGEST_NAME]}(A, B) ...` on one line")  # fmt: skip
                return None
            if not self._checked_parameters(name, [t for t in body[1:close] if t.kind not in (SPACE, JOINED)]):
                return None
            body = body[close + 1 :]
        elif body and body[0].kind not in (SPACE, JOINED):
            tell(
                "D007", f"a space is needed between the macro's name and `{body[0].text[:LONGEST_NAME]}`",
                body[0].place, help=f"write `#define {name.text[:LONGEST_NAME]} {body[0].text[:LONGEST_NAME]}`",
            )  # fmt: skip
            return None
        if len(body) > MOST_MACRO_BODY:
            tell("D018", f"the body of macro `{name.text}` has more than {MOST_MACRO_BODY} tokens", name.place)
            return None
        written = [token for token in body if token.kind not in (SPACE, JOINED)]
        for token in written:
            if token.kind == BAD:
                complain_of_stray(token, self.findings)
        for token in (*written[:1], *written[-1:]):
            if token.kind == PASTE:
                tell("D019", "`##` joins two tokens, so it cannot stand at an end", token.place)
                return None
        return body

    def _checked_parameters(self, name: Token, written: list[Token]) -> bool:
        seen: set[str] = set()
        for i, token in enumerate(written):
            last = i == len(written) - 1
            if i % 2:
                if token.text != "," or last:
                    self.findings.error(
                        "D007", f"expected `,` and a parameter, or `)`, not `{token.text}`", token.place
                    )
                    return False
            elif units.is_unit(token.text):
                word = units.UNITS[token.text].word
                message = f"a macro's parameter cannot be called `{token.text}`: that is the unit {word}"
                help = f"in the body of `{name.text}` it would replace the unit: `0.5 {token.text}` would lose it"
                self.findings.error("D011", message, token.place, help=help)
                return False
            elif token.text == "..." and last:
                pass
            elif token.kind != NAME or token.text in PREDEFINED or token.text in seen:
                why = "is there twice" if token.text in seen else "cannot be a parameter"
                self.findings.error("D007", f"`{token.text}` {why}", token.place)
                return False
            seen.add(token.text)
        return True

    def _warn_of_quantity(self, name: Token, body: list[Token]) -> None:
        """`#define LENGTH 2.0 m`: the value of `LENGTH^2` would surprise."""
        written = [token for token in body if token.kind not in (SPACE, JOINED)]
        if written and written[0].text in ("-", "+"):
            del written[0]
        if len(written) < 2 or written[0].kind not in NUMBERS or not units.is_unit(written[1].text):
            return
        if any(token.kind == NAME and not units.is_unit(token.text) for token in written[1:]):
            return
        quantity = "".join(token.text for token in body).strip()
        why = f"a macro is put in as text, so `{name.text}^2` would be `{quantity}^2`"
        help = f"write `let {name.text} = {quantity};`: {why}"
        self.findings.warn("D017", f"macro `{name.text}` is a quantity", name.place, help=help)

    def undef(self, tokens: list[Token]) -> None:
        if tokens[0].kind != NAME:
            self.findings.error("D007", "`#undef` needs a name", tokens[0].place)
            return
        self._nothing_after(tokens[1:], f"#undef {tokens[0].text}")
        self.macros.pop(tokens[0].text, None)
        self.refused.pop(tokens[0].text, None)

    def expand_macros(self, tokens: list[Token], expanding_from: object = ()) -> list[Token]:
        """The tokens with every macro expanded; at the outermost level without white space."""
        if type(tokens) is _Argument:
            return list(tokens.expanded)
        macros = self.macros
        keep_space = self._depth > 0
        pending = tokens[::-1]
        out: list[Token] = []
        while pending:
            token = pending.pop()
            kind = token.kind
            if kind == NAME:
                text = token.text
                macro = macros.get(text)
                if macro is not None and text not in token.hidden:
                    self._use(token, macro, pending, out)
                    continue
                if macro is None and text in self.refused:
                    self._use_refused(token, pending, out)
                    continue
                if text[:2] == "__":
                    token = self._predefined(token)
            elif not keep_space and kind in (SPACE, JOINED):
                continue
            out.append(token)
        return out

    def _predefined(self, token: Token) -> Token:
        outermost = token.expansions[-1].use if token.expansions else token.place
        made = token.__copy__()
        if token.text == "__LINE__":
            made.kind, made.text = WHOLE, str(outermost.line)
        elif token.text == "__FILE__":
            made.kind, made.text = STRING, f'"{outermost.file}"'
        elif token.text in CLOCK:
            self.findings.error(
                "D016", f"`{token.text}` is not available: a deck must mean the same whenever it is read", token.place
            )
            made.kind, made.text = BAD, ""
        return made

    def _use_refused(self, token: Token, pending: list[Token], out: list[Token]) -> None:
        """Of a macro that was refused nothing is known but that it was meant: no more is said of what it makes."""
        if self.refused[token.text]:
            at = len(pending) - 1
            while at >= 0 and pending[at].kind in (SPACE, JOINED):
                at -= 1
            if at < 0 or pending[at].text != "(":
                out.append(token)
                return
            depth = 0
            while at >= 0:
                depth += {"(": 1, ")": -1}.get(pending[at].text, 0)
                if depth == 0:
                    break
                at -= 1
            del pending[max(at, 0):]
        bad = token.__copy__()
        bad.kind, bad.text = BAD, ""
        out.append(bad)

    def _use(self, token: Token, macro: Any, pending: list[Token], out: list[Token]) -> None:
        """Puts a macro's replacement in front of what is pending, or the name itself out where it is no use."""
        if not token.expansions and self._depth == 0:
            self._expanded_here = 0
        if len(token.expansions) >= MACRO_DEPTH:
            self._endless(token, f"macros go deeper than {MACRO_DEPTH}")
        hidden = token.hidden
        if macro.arglist is None:
            made = self.macro_expand_args(macro, []) if macro.pastes else macro.value
        else:
            at = len(pending) - 1
            while at >= 0 and (pending[at].kind == SPACE or pending[at].kind == JOINED):
                at -= 1
            if at < 0 or pending[at].text != "(":
                out.append(token)
                return
            del pending[at:]
            arguments, close = self._collect(token, macro, pending)
            hidden = hidden & close.hidden
            if arguments is None:
                bad = token.__copy__()
                bad.kind, bad.text = BAD, ""
                out.append(bad)
                return
            made = self._substitute(token, macro, arguments)
        self._check_made(token, made)
        pending.extend(_come_through(token, made, hidden | {token.text})[::-1])

    def _collect(self, token: Token, macro: Any, pending: list[Token]) -> tuple[list[_Argument] | None, Token]:
        """Takes a call's arguments and its ")" off the pending tokens; None, and a message, for a wrong number."""
        arguments = [_Argument()]
        depth = taken = 0
        names = macro.arglist
        while pending:
            piece = pending.pop()
            taken += 1
            if taken > MOST_ARGUMENTS:
                self._give_up(
                    "D018", f"a call of macro `{token.text}` has more than {MOST_ARGUMENTS} tokens", token.place
                )
            text = piece.text
            if text == "(":
                depth += 1
            elif text == ")":
                if depth == 0:
                    break
                depth -= 1
            elif text == "," and depth == 0 and not (macro.variadic and len(arguments) == len(names)):
                arguments.append(_Argument())
                continue
            arguments[-1].append(piece)
        else:
            self._give_up(
                "D012", f"the call of macro `{token.text}` is not closed", token.place,
                also=(self._defined_at(macro),), help="its `)` is missing, or a directive stands in between",
            )  # fmt: skip
        for argument in arguments:
            self.tokenstrip(argument)
        if macro.variadic and len(arguments) == len(names) - 1:
            arguments.append(_Argument())
        if names == [] and arguments == [[]]:
            arguments = []
        if len(arguments) != len(names):
            self._wrong_number(token, macro, arguments, piece)
            return None, piece
        return arguments, piece

    def _wrong_number(self, token: Token, macro: Any, arguments: list[_Argument], close: Token) -> None:
        wanted, got = len(macro.arglist) - macro.variadic, len(arguments) if arguments != [[]] else 0
        least = "at least " if macro.variadic else ""
        count = f"{least}{wanted} argument{'s' * (wanted != 1)}, but {got} {'is' if got == 1 else 'are'} given"
        split = any(piece.text in ("[", "{") for argument in arguments for piece in argument)
        self.findings.error(
            "D012",
            f"macro `{token.text}` takes {count}",
            self._stretch(token, close),
            also=(self._defined_at(macro),),
            help="a comma inside [ ] or { } parts arguments too; only ( ) keeps them together" if split else (),
        )

    def _stretch(self, first: Token, last: Token) -> Place:
        """From one token to another where both stand on one line, else the first."""
        together = first.source is last.source and first.expansions == last.expansions and first.line == last.line
        return first.source.place(first.offset, (last.end if together else first.end) - first.offset, first.expansions)

    def _defined_at(self, macro: Any) -> Label:
        return Label(macro.name_token.place, f"`{macro.name}` is defined here")

    def _substitute(self, token: Token, macro: Any, arguments: list[_Argument]) -> list[Token]:
        """The macro's body with the arguments in it, by pcpp; sizes are checked before."""
        expanded = {number for kind, number, _ in macro.patch if kind == "e"}
        self._depth += 1
        if self._depth > MACRO_DEPTH:
            self._endless(token, f"macro calls within arguments go deeper than {MACRO_DEPTH}")
        for number in expanded:
            arguments[number].expanded = self.expand_macros([piece.__copy__() for piece in arguments[number]])
        self._depth -= 1
        size = len(macro.value)
        for kind, number, _ in macro.patch:
            size += len(arguments[number].expanded if kind == "e" else arguments[number])
        if size > MOST_FROM_ONE_USE:
            self._endless(token, f"one use of macro `{token.text}` makes more than {MOST_FROM_ONE_USE} tokens")
        for number, argument in enumerate(arguments):
            if number not in expanded:
                argument.expanded = argument
            if not argument and macro.pastes:  # pcpp would paste what stands on either side of an empty argument
                argument.append(Token(SPACE, "", token.source, token.offset, token.length))
        self.lexer.made.clear()
        made: list[Token] = self.macro_expand_args(macro, arguments)
        for text, count in self.lexer.made:
            if count != 1:
                message = f"`##` makes `{text[:LONGEST_NAME]}`, which is not one token"
                self.findings.error("D019", message, token.place, also=(self._defined_at(macro),))
                return [Token(BAD, "", token.source, token.offset, token.length)]
        return made

    def _check_made(self, token: Token, made: list[Token]) -> None:
        self._expanded += len(made) + 1
        self._expanded_here += len(made) + 1
        if self._expanded_here > MOST_FROM_ONE_USE:
            self._endless(token, f"one use of a macro makes more than {MOST_FROM_ONE_USE} tokens")
        if self._expanded > MOST_EXPANDED:
            self._endless(token, f"the deck's macros make more than {MOST_EXPANDED} tokens")
        for piece in made:
            if len(piece.text) > LONGEST_NAME and len(piece.text) > (
                LONGEST_STRING if piece.kind == STRING else LONGEST_NAME
            ):
                self._endless(token, f"macro `{token.text}` makes a token of {len(piece.text)} characters")

    def _endless(self, token: Token, message: str) -> None:
        macro = self.macros.get(token.text)
        self._give_up("D013", message, token.place, also=(self._defined_at(macro),) if macro else (),
                      help="do these macros use each other without end?")  # fmt: skip

    def _nothing_after(self, rest: Iterable[Token], what: str) -> None:
        extra = next((token for token in rest if token.kind not in (SPACE, JOINED)), None)
        if extra is not None:
            self.findings.error(
                "D007", f"nothing may follow `{what}`", extra.place, help="is it a comment? Write `//` before it"
            )

    def _give_up(self, code: str, message: str, at: Place, also: Sequence[Label] = (), help: str = "") -> None:
        self.findings.error(code, message, at, also=also, help=help or ())
        raise GiveUp


def _spelling(macro: Any) -> tuple[object, ...]:
    """What makes two definitions the same: parameters and body, any white space being as good as another."""
    body = tuple(" " if token.kind in (SPACE, JOINED) else token.text for token in macro.value)
    return (tuple(macro.arglist) if macro.arglist is not None else None, macro.variadic, body)


def _without_space_at_paste(body: list[Token]) -> list[Token]:
    kept: list[Token] = []
    for token in body:
        if token.kind in (SPACE, JOINED) and kept and kept[-1].kind == PASTE:
            continue
        while token.kind == PASTE and kept and kept[-1].kind in (SPACE, JOINED) and len(kept) > 1:
            kept.pop()
        kept.append(token)
    return kept


def _come_through(token: Token, made: list[Token], hidden: frozenset[str]) -> list[Token]:
    """Copies of the tokens that a macro made, each knowing that it came through this use of it.

    Where the use stands in a macro's body itself, an argument's tokens have come through what surrounds the use
    already: the new step goes in front of that.
    """
    around = token.expansions
    step = (Expansion(token.text, token.source.place(token.offset, token.length)),)
    through = step + around
    # by identity: to hash or compare chains of places would cost more than all the rest
    steps: dict[int, tuple[Expansion, ...]] = {id(()): through, id(around): through}
    hides: dict[frozenset[str], frozenset[str]] = {frozenset(): hidden}
    copies = []
    for piece in made:
        copy = Token(piece.kind, piece.text, piece.source, piece.offset, piece.length)
        came = piece.expansions
        if id(came) not in steps:
            inner = len(came) - len(around)
            within = inner >= 0 and all(a is b for a, b in zip(came[inner:], around, strict=True))
            steps[id(came)] = (came[:inner] if within else came) + through
        copy.expansions = steps[id(came)]
        if piece.hidden not in hides:
            hides[piece.hidden] = piece.hidden | hidden
        copy.hidden = hides[piece.hidden]
        copies.append(copy)
    return copies
