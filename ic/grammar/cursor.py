"""The parser's position in the tokens, its messages, and how it goes on after an error.

A mistake is noted and raises Unreadable; the list of entries around the faulty one catches it, skips to its end and
goes on, so that one run reports several mistakes, and none twice.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NoReturn

from ic.text.lexer import BAD, COMMAND_LINE, END, NAME, NUMBERS, STRING, Token
from ic.text.limits import DEPTH, MOST_OPERATORS, Findings, GiveUp
from met.diagnostic import Help, Label, Place, write
from met.messages.message import macro_count
from met.units import Measure

OPENING = {"(": ")", "[": "]", "{": "}"}
SHOWN = 40  # characters of a token in a message
NOT_OPEN = "leave it out, or open it where it begins"  # the help for a bracket that closes nothing


class Unreadable(Exception):
    """Raised where an entry cannot be read (already reported)."""


class EndedInsideBlock(Exception):
    """Raised where the tokens end inside a block, which has been reported."""


def token_in_words(token: Token) -> str:
    """A token as messages name it, cut where it is long."""
    if token.kind == END:
        return "the end of the deck" if token.source.name != COMMAND_LINE else "the end of the line"
    text = token.text if len(token.text) <= SHOWN else token.text[: SHOWN - 3] + "..."
    return f"`{text}`" if token.kind != STRING else f"the string {text}"


def span(first: Token, last: Token) -> Place:
    """The place from the first token to the last if both stand on one line and came the same way; else the first's."""
    together = first.source is last.source and first.expansions == last.expansions
    if first is last:
        return first.place
    if together and first.offset < last.offset and "\n" not in first.source.text[first.offset : last.offset]:
        return first.source.place(first.offset, last.end - first.offset, first.expansions)
    return first.place


class Cursor:
    """The lowest part of the parser: the present token, the brackets that are open, messages, and recovery."""

    def __init__(self, tokens: Sequence[Token], findings: Findings) -> None:
        """tokens: of the deck, the last of kind END; findings: where mistakes are reported"""
        last = tokens[-1]
        assert last.kind == END
        # looking two tokens ahead never needs a check
        self.tokens = [*tokens, last, last]
        self.findings = findings
        self.position = 0
        self.open: list[Token] = []
        self.operators = 0
        self.peak = 0
        self.misindented: tuple[Token, Token] | None = None
        self.unopened: list[Place] = []  # where a `{` may be missing, if a `}` proves to be too many
        self.unbalanced = False  # whether a brace is missing somewhere, or a bracket too many
        self.indices: Mapping[str, str] = {}  # of the loops around: the value of each in this iteration
        self.declared: Mapping[str, Measure] = {}  # units that the deck declares
        self.unsized: set[str] = set()  # those whose declarations are wrong (reported already)
        self.depth = 0  # brackets that are open around the tokens

    @property
    def token(self) -> Token:
        return self.tokens[self.position]

    @property
    def following(self) -> Token:
        return self.tokens[self.position + 1]

    @property
    def previous(self) -> Token:
        return self.tokens[max(0, self.position - 1)]

    def advance(self) -> Token:
        token = self.tokens[self.position]
        if token.kind != END:
            self.position += 1
        return token

    # complaints

    def tell(
        self,
        code: str,
        message: str,
        place: Token | Place | Label,
        *,
        also: Iterable[Label] = (),
        help: str | Iterable[str] = (),
    ) -> None:
        """Report an error at a token or place, and go on."""
        self.findings.error(
            code, message, place.place if isinstance(place, Token) else place, also=also, help=help or ()
        )

    def fail(
        self,
        code: str,
        message: str,
        place: Token | Place | Label,
        *,
        also: Iterable[Label] = (),
        help: str | Iterable[str] = (),
    ) -> NoReturn:
        """Report an error at a token or place, and raise Unreadable, so that parsing goes on behind this entry."""
        if self.token.kind != BAD:  # such a token has been reported
            self.tell(code, message, place, also=also, help=help)
        raise Unreadable

    def unexpected(self, wanted: str, help: str | Iterable[str] = ()) -> NoReturn:
        self.fail("D020", f"expected {wanted}, found {token_in_words(self.token)}", self.token, help=help)

    def write(self, new: str, first: Token, last: Token) -> Help:
        """The help that says to write this in place of the stretch from the first token to the last."""
        place = span(first, last)
        return write(new, at=place) if first is last or place != first.place else Help(f"write `{new}`")

    def behind(self, token: Token) -> Place:
        """The place just after a token, where something is missing."""
        return token.source.place(token.end, 1, token.expansions)

    # brackets

    def enter(self) -> Token:
        """Take an opening brace, bracket or parenthesis."""
        opening = self.advance()
        if self.depth + len(self.open) >= DEPTH:
            self.tell("D029", f"braces, brackets and parentheses go deeper than {DEPTH}", opening)
            raise GiveUp
        self.open.append(opening)
        return opening

    def leave(self, wanted: str = "") -> Token:
        """Take the matching closing one."""
        opening = self.open[-1]
        closing = OPENING[opening.text]
        if self.token.text != closing:
            expected = f"{wanted}`{closing}`"
            label = Label(opening.place, f"to close this `{opening.text}`")
            self.fail("D022", f"expected {expected}, found {token_in_words(self.token)}", self.token, also=(label,))
        self.open.pop()
        return self.advance()

    def never_closed(self) -> NoReturn:
        """Report the last open bracket as not closed (D022), and raise EndedInsideBlock."""
        also = [Label(self.behind(self.previous), "the deck ends here")]
        opening = self.open[-1]
        if self.misindented is not None:
            inner, closing = self.misindented
            also = [
                Label(inner.place, f"perhaps this one: the `}}` on line {closing.line} that closes it is indented less")
            ]
        self.unbalanced = True
        self.tell(
            "D022",
            f"this `{opening.text}` is not closed",
            opening,
            also=also,
            help=f"write the `{OPENING[opening.text]}` where it ends",
        )
        raise EndedInsideBlock

    def count_operator(self) -> None:
        """Count an operator of the present expression. Raises GiveUp beyond `MOST_OPERATORS` (D029)."""
        self.operators += 1
        if self.operators > MOST_OPERATORS:
            self.tell(
                "D029",
                f"an expression has at most {MOST_OPERATORS} operators",
                self.token,
                help="give its parts names with `let`",
            )
            raise GiveUp

    # items do not nest in each other, so each may use the operators that are left; what holds them counts the most
    # that one used: so the depth of the tree is bounded, and with it that of every function that walks it

    def begin_items(self) -> int:
        outer, self.peak = self.peak, self.operators
        return outer

    def end_items(self, outer: int) -> None:
        self.operators = self.peak
        self.peak = max(outer, self.peak)

    # lines, as the reader of the deck sees them

    def line_of(self, token: Token) -> tuple[str, int]:
        """The file and line of a token; of one from a macro, those of the macro's use."""
        macros = macro_count(token.expansions)
        if macros:
            use = token.expansions[macros - 1].use
            return use.file, use.line
        return token.source.name, token.line

    def on_new_line(self, position: int) -> bool:
        return position > 0 and self.line_of(self.tokens[position]) != self.line_of(self.tokens[position - 1])

    def begins_entry(self, position: int) -> bool:
        """Return True if a new line begins here, and looks like an entry: the one before lacks its semicolon."""
        if self.tokens[position].kind != NAME:
            return False
        behind = position + 1
        while self.tokens[behind].text == "." and self.tokens[behind + 1].kind == NAME:  # a path
            behind += 2
        after = self.tokens[behind]
        looks_like_one = after.text in ("=", "+=", "{", ".") or (after.kind == NAME and after.text not in ("and", "or"))
        return looks_like_one and self.on_new_line(position)

    def begins_value(self) -> bool:
        token = self.token
        return token.kind in (*NUMBERS, NAME, STRING) or token.text in ("[", "(")

    # recovery

    def recover(self, start: int, depth: int) -> None:
        """Skip the rest of an entry that began at `start`, when `depth` brackets were open."""
        unclosed = len(self.open) - depth
        braces = sum(token.text == "{" for token in self.open[depth:])
        rounds = unclosed - braces
        del self.open[depth:]
        while self.token.kind != END:
            text = self.token.text
            if text == "{":
                braces += 1
            elif text == "}":
                if braces == 0:
                    return
                braces -= 1
                if braces == 0:
                    self.advance()
                    if self.token.text == ";":
                        self.advance()
                    return
            elif text in ("(", "["):
                rounds += 1
            elif text in (")", "]"):
                rounds -= 1
            elif text == ";" and braces == 0:
                self.advance()
                return
            elif braces == 0 and rounds <= 0 and self.position > start and self.begins_entry(self.position):
                return
            self.advance()
        self.unbalanced = True
