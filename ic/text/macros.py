"""Macros: what may be defined, and what a use of one becomes.

pcpp parses a definition and puts arguments into a body, with `#` and `##`. The scan that finds what to expand is ours:
it is linear, keeps C's hide sets, and lets every token know each macro that it came through. So are the checks: a
deck's macros can be neither endless nor large, and may not take a unit's name.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from pcpp import Preprocessor as Pcpp

from ic.text import definitions
from ic.text.definitions import CLOCK, PASTED_COMMA, PREDEFINED
from ic.text.lexer import BAD, CHARACTER, HASHES, NAME, NOTHING, PASTE, SPACE, STRING, WHOLE, Lexer, Token
from ic.text.limits import (
    LONGEST_NAME,
    LONGEST_STRING,
    MACRO_DEPTH,
    MOST_ARGUMENTS,
    MOST_EXPANDED,
    MOST_FROM_ONE_USE,
    Findings,
    GiveUp,
)
from met import units
from met.diagnostic import Expansion, Label, Place


class _Argument(list[Token]):
    """A macro's argument as written, with what it expands to; pcpp asks for one or the other."""

    expanded: list[Token]
    omitted = spaced = False

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
        self.in_condition = False
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
        self.t_LINECONT = "none: lines are joined before"
        self.t_WS = (SPACE,)
        self.t_COMMENT1 = self.t_COMMENT2 = "none: comments are spaces"
        self.t_COMMENT = (self.t_COMMENT1,)

    def define(self, tokens: Any) -> None:
        if isinstance(tokens, str):  # pcpp's own macros, and the clock: a deck must mean the same tomorrow
            return
        body = definitions.checked(tokens, self.findings)
        name = tokens[0]
        if body is None:
            takes = len(tokens) > 1 and tokens[1].text == "("
            if name.kind == NAME and name.text not in PREDEFINED and (takes or not units.is_unit(name.text)):
                self.refused[name.text] = takes
            return
        self.refused.pop(name.text, None)
        old = self.macros.get(name.text)
        head, body = tokens[: len(tokens) - len(body)], definitions.without_space_at_paste(body)
        forms = definitions.forms_at_comma(body) if any(token.text == "..." for token in head) else None
        macro = self._defined(head, body if forms is None else forms[0])
        if forms is not None:
            macro.without_rest = self._defined(head, forms[1])
            self.macros[name.text] = macro
        if old is not None and definitions.spelling(old) != definitions.spelling(macro):
            self.findings.error(
                "D010", f"macro `{name.text}` is defined again, differently", name.place,
                also=(Label(old.name_token.place, "first defined here"),),
                help=(f"`#undef {name.text}` first, or put the default between `#ifndef {name.text}` and `#endif`",),
            )  # fmt: skip
        elif old is None and macro.arglist is None:
            definitions.warn_of_quantity(name, macro.value, self.findings)

    def _defined(self, head: list[Token], body: list[Token]) -> Any:
        """The macro as pcpp makes it, with what we want to know besides."""
        super().define([*head, *body])
        macro = self.macros[head[0].text]
        macro.name_token = head[0]
        macro.written = body
        macro.without_rest = None
        for token in macro.value:
            if token.kind == SPACE and token.text == PASTED_COMMA:
                token.kind = NOTHING
        macro.pastes = any(token.kind in (PASTE, NOTHING) for token in macro.value)
        if macro.arglist is None and macro.pastes:
            macro.patch, macro.str_patch = [], []
        macro.var_comma_patch = []
        return macro

    def undef(self, tokens: list[Token]) -> None:
        if tokens[0].kind != NAME:
            self.findings.error("D007", "`#undef` needs a name", tokens[0].place, help="write `#undef NAME`")
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
                if macro is not None and text not in token.hidden and not _is_varied(out, pending):
                    self._use(token, macro, pending, out)
                    continue
                if macro is None and text in self.refused:
                    self._use_refused(token, pending, out)
                    continue
                if text[:2] == "__":
                    token = self._predefined(token)
                elif text == "defined" and self.in_condition:
                    self._keep_defined(pending, out, token)
                    continue
            elif kind == NOTHING or (kind == SPACE and not keep_space):
                continue
            out.append(token)
        return out

    def _keep_defined(self, pending: list[Token], out: list[Token], token: Token) -> None:
        """`defined NAME` that a macro made: the name is asked for, not expanded."""
        out.append(token)
        while pending and (pending[-1].kind == SPACE or pending[-1].text == "("):
            out.append(pending.pop())
        if pending and pending[-1].kind == NAME:
            out.append(pending.pop())

    def _predefined(self, token: Token) -> Token:
        outermost = token.expansions[-1].use if token.expansions else token.place
        made = token.__copy__()
        if token.text == "__LINE__":
            made.kind, made.text = WHOLE, str(outermost.line)
        elif token.text == "__FILE__":
            made.kind, made.text = STRING, f'"{outermost.file}"'
        elif token.text in CLOCK:
            self.findings.error(
                "D016", f"`{token.text}` is not available: a deck must mean the same whenever it is read", token.place,
                help="leave it out: beside an archive, `.run.json` says when it was made",
            )  # fmt: skip
            made.kind, made.text = BAD, ""
        return made

    def _use_refused(self, token: Token, pending: list[Token], out: list[Token]) -> None:
        """Of a macro that was refused nothing is known but that it was meant: no more is said of what it makes."""
        if self.refused[token.text]:
            at = len(pending) - 1
            while at >= 0 and pending[at].kind == SPACE:
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
            while at >= 0 and pending[at].kind == SPACE:
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
            if piece.kind == NOTHING:
                continue
            if text == "(":
                depth += 1
            elif text == ")":
                if depth == 0:
                    break
                depth -= 1
            elif text == "," and depth == 0 and not (macro.variadic and len(arguments) == len(names)):
                arguments.append(_Argument())
                continue
            if piece.kind == PASTE:  # as an argument it joins nothing
                piece = piece.__copy__()
                piece.kind = HASHES
            arguments[-1].append(piece)
        else:
            self._give_up(
                "D012", f"the call of macro `{token.text}` is not closed", token.place,
                also=(self._defined_at(macro),), help="its `)` is missing, or a directive stands in between",
            )  # fmt: skip
        for argument in arguments:
            first = argument[0] if argument else None
            self.tokenstrip(argument)
            argument.spaced = argument != [] and argument[0] is not first
        if macro.variadic and len(arguments) == len(names) - 1:
            arguments.append(_Argument())
            arguments[-1].omitted = True
        elif macro.variadic and arguments == [[]]:
            arguments[-1].omitted = True
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
        if macro.without_rest is not None and arguments[-1].omitted:
            macro = macro.without_rest
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
                argument.append(Token(NOTHING, "", token.source, token.offset, token.length))
        self.lexer.made.clear()
        made: list[Token] = self.macro_expand_args(macro, arguments)
        for text, count in self.lexer.made:
            if count != 1:
                message = f"`##` makes `{text[:LONGEST_NAME]}`, which is not one token"
                self.findings.error("D019", message, token.place, also=(self._defined_at(macro),),
                                    help="what it joins must be one name, one number or one sign")  # fmt: skip
                return [Token(BAD, "", token.source, token.offset, token.length)]
        return definitions.without_nothing(made, macro.variadic and arguments[-1].spaced) if macro.pastes else made

    def is_macro(self, name: str) -> bool:
        return name in self.macros or name in ("__FILE__", "__LINE__")

    def on_unknown_macro_in_defined_expr(self, token: Token) -> bool:
        return self.is_macro(token.text)

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
        extra = next((token for token in rest if token.kind != SPACE), None)
        if extra is not None:
            self.findings.error(
                "D007", f"nothing may follow `{what}`", extra.place, help="is it a comment? Write `//` before it"
            )

    def _give_up(self, code: str, message: str, at: Place, also: Sequence[Label] = (), help: str = "") -> None:
        self.findings.error(code, message, at, also=also, help=help or ())
        raise GiveUp


def _is_varied(before: Sequence[Token], pending: Sequence[Token]) -> bool:
    """Whether a macro's name stands in `vary macro NAME = [...]`, where it is the macro that is meant, not its body.

    pending: what follows, the next token last
    """
    last = next((token for token in reversed(before) if token.kind != SPACE), None)
    if last is None or last.text != "macro":
        return False
    following = next((token for token in reversed(pending) if token.kind != SPACE), None)
    return following is not None and following.text == "="


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
