"""Macros: their definitions, and the expansion of their uses.

The scan that finds what to expand is linear, does what gcc's does (C leaves some of it open), and lets every token know
each macro that it came through. A deck's macros can be neither endless nor large, and may not take a unit's name.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from pcpp import Preprocessor as Pcpp

from ic.text import definitions
from ic.text.definitions import CLOCK, COUNTER, PREDEFINED
from ic.text.lexer import BAD, CHARACTER, HASHES, LEFT, NAME, NOTHING, PASTE, SPACE, STRING, WHOLE, Token
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
from ic.text.substitute import Argument, Macro, NotOneToken, substituted
from met import units
from met.diagnostic import Expansion, Label, Place


class Macros(Pcpp):
    """The half of the preprocessor for macros."""

    def __init__(self, findings: Findings) -> None:
        self.not_undefined: list[Token] = []  # names of `#undef` that were no macros
        self.findings = findings
        self._expanded = 0
        self._expanded_here = 0
        self._counted = 0
        self.used_names: dict[str, None] = {}  # names that were used as macros, or asked for
        self._depth = 0
        self._inside: set[str] = set()  # macros that are not used now: what they made is being read
        self.in_condition = False
        super().__init__(object())  # a lexer, which it never asks: it is handed tokens
        self.macros: dict[str, Macro] = {}
        self.refused: dict[str, bool] = {}  # macros that were refused (already reported); whether with parameters
        self.auto_pragma_once_enabled = False
        self.expand_filemacro = False

    def _Preprocessor__lexprobe(self) -> None:
        """Tell pcpp the kinds of our tokens, which it would otherwise find out by trying."""
        self.t_ID, self.t_INTEGER, self.t_INTEGER_TYPE = NAME, WHOLE, str
        self.t_STRING, self.t_CHAR, self.t_DPOUND = STRING, CHARACTER, PASTE
        self.t_SPACE = self.t_NEWLINE = SPACE
        self.t_LINECONT = "none: lines are joined before"
        self.t_WS = (SPACE,)
        self.t_COMMENT1 = self.t_COMMENT2 = "none: comments are spaces"
        self.t_COMMENT = (self.t_COMMENT1,)

    def define(self, tokens: Any) -> None:
        """Enter a `#define`; a macro that is refused, or defined again differently, is reported."""
        if isinstance(tokens, str):  # pcpp's own macros, and the clock: a deck must mean the same tomorrow
            return
        name = tokens[0]
        body: list[Token] | None = None
        with self.findings.gather():
            body = definitions.checked_definition(tokens, self.macros.__contains__, self.findings)
        if body is None:
            takes = len(tokens) > 1 and tokens[1].text == "("
            if name.kind == NAME and name.text not in PREDEFINED and (takes or not units.is_unit(name.text)):
                self.refused[name.text] = takes
            return
        self.refused.pop(name.text, None)
        old = self.macros.get(name.text)
        macro = Macro(name, definitions.parameters(tokens[: len(tokens) - len(body)]), definitions.trimmed(body))
        self.macros[name.text] = macro
        if old is not None and definitions.spelling(old) != definitions.spelling(macro):
            self.findings.error(
                "D010",
                f"macro `{name.text}` is defined again, differently",
                name.place,
                also=(Label(old.name_token.place, "first defined here"),),
                help=(
                    f"`#undef {name.text}` first; or, if this is a default, write it between "
                    f"`#ifndef {name.text}` and `#endif`",
                ),
            )
        elif old is None and macro.parameters is None:
            definitions.warn_of_quantity(name, macro.body, self.findings)

    def undef(self, tokens: list[Token]) -> None:
        """Remove the macro of an `#undef`."""
        if tokens[0].kind != NAME:
            self.findings.error("D007", "`#undef` needs a name", tokens[0].place, help="write `#undef NAME`")
            return
        self._nothing_after(tokens[1:], f"#undef {tokens[0].text}")
        if self.macros.pop(tokens[0].text, None) is None:
            self.not_undefined.append(tokens[0])
        self.refused.pop(tokens[0].text, None)

    def expand_macros(self, tokens: list[Token], expanding_from: object = ()) -> list[Token]:
        """The tokens with every macro expanded; at the outermost level without white space.

        As in gcc, a macro is not used while its expansion is being read, up to the token of kind LEFT after it; a token
        of its name that is met meanwhile is never again a use of it.
        """
        macros, inside = self.macros, self._inside
        keep_space = self._depth > 0
        pending = tokens[::-1]
        out: list[Token] = []
        before = ""  # the last token that is not white space
        while pending:
            token = pending.pop()
            kind = token.kind
            if kind == NAME:
                text = token.text
                macro = macros.get(text)
                if macro is not None and not token.painted:
                    self.used_names[text] = None
                    if text in inside:
                        token.painted = True
                    elif not (before == "macro" and self._is_varied(pending)) and self._use(token, macro, pending):
                        continue
                elif macro is None and text in self.refused:
                    token = self._use_refused(token, pending)
                elif text[:2] == "__":
                    token = self._predefined(token)
                elif text == "defined" and self.in_condition:
                    self._keep_defined(pending, out, token)
                    continue
            elif kind == LEFT:
                inside.discard(token.text)
                continue
            elif kind == NOTHING or (kind == SPACE and not keep_space):
                continue
            out.append(token)
            if kind != SPACE:
                before = token.text
        return out

    def _next_solid(self, pending: list[Token]) -> Token | None:
        """The next token that is not white space, which stays; macros whose end is passed on the way are left."""
        blanks = []
        while pending and pending[-1].kind in (SPACE, LEFT):
            piece = pending.pop()
            if piece.kind == LEFT:
                self._inside.discard(piece.text)
            else:
                blanks.append(piece)
        token = pending[-1] if pending else None
        pending.extend(reversed(blanks))
        return token

    def _opens(self, pending: list[Token]) -> bool:
        """Return True if a "(" is next, and take it."""
        following = self._next_solid(pending)
        if following is None or following.text != "(":
            return False
        while pending.pop() is not following:
            pass
        return True

    def _is_varied(self, pending: list[Token]) -> bool:
        """Return True if a macro's name after `macro` stands in `vary macro NAME = [...]`, which means the macro, not
        its body."""
        following = self._next_solid(pending)
        return following is not None and following.text == "="

    def _keep_defined(self, pending: list[Token], out: list[Token], token: Token) -> None:
        """Keep a `defined NAME` from a macro: the name is noted as used, not expanded."""
        out.append(token)
        if self._opens(pending):
            out.append(Token("CPP_LPAREN", "(", token.source, token.offset, token.length))
        following = self._next_solid(pending)
        if following is not None and following.kind == NAME:
            while pending.pop() is not following:
                pass
            out.append(following)

    def _predefined(self, token: Token) -> Token:
        """The replacement of a predefined macro, such as `__LINE__`, at this use; those of the clock are refused."""
        outermost = token.expansions[-1].use if token.expansions else token.place
        if token.text == "__LINE__":
            return token.standing_for(WHOLE, str(outermost.line))
        if token.text == "__FILE__":
            return token.standing_for(STRING, f'"{outermost.file}"')
        if token.text == COUNTER and not self.in_condition:
            self._counted += 1
            return token.standing_for(WHOLE, str(self._counted - 1))
        if token.text == COUNTER:
            self.findings.error(
                "D009",
                f"`{COUNTER}` has no value in a condition",
                token.place,
                help="it counts its uses in the text; `#define` a macro to choose by",
            )
        elif token.text in CLOCK:
            self.findings.error(
                "D016",
                f"`{token.text}` is not available: a deck must mean the same whenever it is read",
                token.place,
                help="leave it out: beside an archive, `.run.json` says when it was made",
            )
        else:
            return token
        return token.standing_for(BAD, "")

    def _use_refused(self, token: Token, pending: list[Token]) -> Token:
        """Skip the use of a refused macro, including arguments; its expansion causes no further messages."""
        if self.refused[token.text]:
            if not self._opens(pending):
                return token
            depth = 1
            while pending and depth:
                piece = pending.pop()
                depth += {"(": 1, ")": -1}.get(piece.text, 0)
                if piece.kind == LEFT:
                    self._inside.discard(piece.text)
        return token.standing_for(BAD, "")

    def _use(self, token: Token, macro: Macro, pending: list[Token]) -> bool:
        """Put a macro's replacement in front of the pending tokens; False where the name is not a use of it."""
        if not token.expansions and self._depth == 0:
            self._expanded_here = 0
        if len(token.expansions) >= MACRO_DEPTH:
            self._endless(token, f"macros go deeper than {MACRO_DEPTH}")
        arguments: list[Argument] = []
        if macro.parameters is not None:
            if not self._opens(pending):
                return False
            collected = self._collect(token, macro, pending)
            if collected is None:
                pending.append(token.standing_for(BAD, ""))
                return True
            arguments = collected
        replacement = self._substitute(token, macro, arguments)
        self._check_made(token, replacement)
        pending.append(Token(LEFT, token.text, token.source, token.offset, 0))
        pending.extend(_come_through(token, replacement)[::-1])
        self._inside.add(token.text)
        return True

    def _collect(self, token: Token, macro: Macro, pending: list[Token]) -> list[Argument] | None:
        """Take a call's arguments and its ")" off the pending tokens; None, and a message, for a wrong number."""
        arguments = [Argument()]
        depth = taken = 0
        names = macro.parameters or ()
        while pending:
            piece = pending.pop()
            taken += 1
            if taken > MOST_ARGUMENTS:
                self._give_up(
                    "D018", f"a call of macro `{token.text}` has more than {MOST_ARGUMENTS} tokens", token.place
                )
            text = piece.text
            if piece.kind == LEFT:
                self._inside.discard(text)
                continue
            if piece.kind == NOTHING:
                continue
            if piece.kind == NAME and text in self._inside:
                piece.painted = True
            if text == "(":
                depth += 1
            elif text == ")":
                if depth == 0:
                    break
                depth -= 1
            elif text == "," and depth == 0 and not (macro.variadic and len(arguments) == len(names)):
                arguments.append(Argument())
                continue
            if piece.kind == PASTE:  # as an argument it joins nothing
                piece = piece.standing_for(HASHES, text)
            arguments[-1].append(piece)
        else:
            self._give_up(
                "D012",
                f"the call of macro `{token.text}` is not closed",
                token.place,
                also=(self._defined_at(macro),),
                help="its `)` is missing, or a directive stands in between",
            )
        for argument in arguments:
            first = argument[0] if argument else None
            self.tokenstrip(argument)
            argument.spaced = argument != [] and argument[0] is not first
        if macro.variadic and len(arguments) == len(names) - 1:
            arguments.append(Argument())
            arguments[-1].omitted = True
        elif macro.variadic and arguments == [[]]:
            arguments[-1].omitted = True
        if not names and arguments == [[]]:
            arguments = []
        if len(arguments) != len(names):
            return self._wrong_number(token, macro, arguments, piece)
        return arguments

    def _wrong_number(
        self, token: Token, macro: Macro, arguments: list[Argument], close: Token
    ) -> list[Argument] | None:
        """Report a call with a wrong number of arguments. Returns those that count in their place, None for no call."""
        wanted, got = len(macro.parameters or ()) - macro.variadic, len(arguments) if arguments != [[]] else 0
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
        return None

    def _stretch(self, first: Token, last: Token) -> Place:
        """The place from one token to another where both stand on one line, else the first's."""
        together = first.source is last.source and first.expansions == last.expansions and first.line == last.line
        return first.source.place(first.offset, (last.end if together else first.end) - first.offset, first.expansions)

    def _defined_at(self, macro: Macro) -> Label:
        return Label(macro.name_token.place, f"`{macro.name}` is defined here")

    def _substitute(self, token: Token, macro: Macro, arguments: list[Argument]) -> list[Token]:
        """The macro's body with the arguments in it, after checks of its size."""
        self._depth += 1
        if self._depth > MACRO_DEPTH:
            self._endless(token, f"macro calls within arguments go deeper than {MACRO_DEPTH}")
        for number in macro.expanded:
            arguments[number].expanded = self.expand_macros([piece.__copy__() for piece in arguments[number]])
        self._depth -= 1
        size = len(macro.body)
        for piece in macro.body:
            if piece.text in macro.numbers:
                number = macro.numbers[piece.text]
                size += len(arguments[number].expanded if number in macro.expanded else arguments[number])
        if size > MOST_FROM_ONE_USE:
            self._endless(token, f"one use of macro `{token.text}` makes more than {MOST_FROM_ONE_USE} tokens")
        try:
            return substituted(macro, arguments)
        except NotOneToken as reason:
            message = f"`##` makes `{reason.text[:LONGEST_NAME]}`, which is not one token"
            self.findings.error(
                "D019",
                message,
                token.place,
                also=(self._defined_at(macro),),
                help="what it joins must be one name, one number or one sign",
            )
            return [Token(BAD, "", token.source, token.offset, token.length)]

    def is_macro(self, name: str) -> bool:
        self.used_names[name] = None
        return name in self.macros or name in ("__FILE__", "__LINE__", COUNTER)

    def on_unknown_macro_in_defined_expr(self, token: Token) -> bool:
        return self.is_macro(token.text)

    def _check_made(self, token: Token, replacement: list[Token]) -> None:
        """Give up where the tokens that macros make are too many or too long (D013)."""
        self._expanded += len(replacement) + 1
        self._expanded_here += len(replacement) + 1
        if self._expanded_here > MOST_FROM_ONE_USE:
            self._endless(token, f"one use of a macro makes more than {MOST_FROM_ONE_USE} tokens")
        if self._expanded > MOST_EXPANDED:
            self._endless(token, f"the deck's macros make more than {MOST_EXPANDED} tokens")
        for piece in replacement:
            if len(piece.text) > LONGEST_NAME and len(piece.text) > (
                LONGEST_STRING if piece.kind == STRING else LONGEST_NAME
            ):
                self._endless(token, f"macro `{token.text}` makes a token of {len(piece.text)} characters")

    def _endless(self, token: Token, message: str) -> None:
        """Give up on a macro that expands without end (D013)."""
        macro = self.macros.get(token.text)
        self._give_up(
            "D013",
            message,
            token.place,
            also=(self._defined_at(macro),) if macro else (),
            help="do these macros use each other without end?",
        )

    def _nothing_after(self, rest: Iterable[Token], what: str) -> None:
        """Report what stands behind a directive that takes nothing more (D007)."""
        extra = next((token for token in rest if token.kind != SPACE), None)
        if extra is not None:
            self.findings.error(
                "D007", f"nothing may follow `{what}`", extra.place, help="is it a comment? Write `//` before it"
            )

    def _give_up(self, code: str, message: str, place: Place, also: Sequence[Label] = (), help: str = "") -> None:
        self.findings.error(code, message, place, also=also, help=help or ())
        raise GiveUp


def _come_through(token: Token, replacement: list[Token]) -> list[Token]:
    """Copies of the tokens that a macro made, each knowing that it came through this use of it.

    Where the use stands in a macro's body itself, an argument's tokens have come through what surrounds the use
    already: the new step goes in front of that.
    """
    around = token.expansions
    step = (Expansion(token.text, token.source.place(token.offset, token.length)),)
    through = step + around
    # by identity: to hash or compare chains of places would cost more than all the rest
    steps: dict[int, tuple[Expansion, ...]] = {id(()): through, id(around): through}
    copies = []
    for piece in replacement:
        copy = Token(piece.kind, piece.text, piece.source, piece.offset, piece.length)
        came = piece.expansions
        if id(came) not in steps:
            inner = len(came) - len(around)
            within = inner >= 0 and all(a is b for a, b in zip(came[inner:], around, strict=True))
            steps[id(came)] = (came[:inner] if within else came) + through
        copy.expansions = steps[id(came)]
        copy.painted = piece.painted
        copies.append(copy)
    return copies
