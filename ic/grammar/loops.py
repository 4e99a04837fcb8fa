"""Entries that stand for several: `for i in 1 .. 6 { ... }`, `for side in [left, right] { ... }`, and `[lift, swing] =
turner;`.

The block of a loop is read anew in each iteration. Its tokens know the iteration (`Expansion.iteration`), after the
macros that they came through; names with braces are replaced, and so is the index where a value begins. So later
stages see plain names, and messages know the loop and the value of its index.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ic.grammar.braced_names import USAGE, NoName, NotWhole, filled, name_length, whole
from ic.grammar.cursor import OPENING, span, token_in_words
from ic.grammar.expressions import EVERY_JOINT, Expressions
from ic.grammar.syntax import Entry, Group, Setting, Word
from ic.text.lexer import BAD, END, NAME, Token
from ic.text.limits import MOST_ITERATIONS, MOST_LOOPED, Findings, GiveUp
from ic.text.source import UnreadableStretch
from met import units
from met.diagnostic import Expansion, Place, did_you_mean
from met.messages.message import macro_count

_LISTED = (
    "a loop goes over names and whole numbers; for other values write a list, `let lengths = [1.2, 0.8] m;`, and take "
    "`lengths[i]`"
)
_ENDS = "its ends are whole numbers, macros that are such (`#define COUNT 6`, `-D COUNT=6`), and indices around it"


class Loops(Expressions):
    """The part of the parser for entries which stand for several."""

    def __init__(self, tokens: Sequence[Token], findings: Findings) -> None:
        super().__init__(tokens, findings)
        self.unreadable: list[UnreadableStretch] = []
        self.within: Place | None = None
        self.looped = [0]  # tokens of all iterations so far, of the whole deck

    def entries(self, into: list[Entry]) -> None:
        raise NotImplementedError

    # loops

    def at_loop(self) -> bool:
        """Return True if a loop begins here, or text that was meant for one."""
        if self.token.text != "for":
            return False
        behind = self.tokens[self.position + 2].text
        return self.following.text == "(" or (self.following.kind == NAME and behind in ("in", "=", ":", "from"))

    def loop(self, into: list[Entry]) -> None:
        """The entries of all iterations of a loop."""
        first = self.advance()
        if self.token.kind != NAME or self.following.text != "in":
            self.fail("D283", "this is not how a loop is written", span(first, self.previous), help=USAGE)
        index = self.advance()
        self.check_index(index)
        self.advance()
        values = self.listed() if self.token.text == "[" else self.counted()
        if self.token.text != "{":
            self.fail(
                "D283", f"expected the block of the loop, found {token_in_words(self.token)}", self.token, help=USAGE
            )
        opening, start = self.token, self.position + 1
        closing = self.closing(self.position)
        if self.tokens[closing].kind == END:
            self.enter()
            self.position = closing
            self.never_closed()
        self.enter()
        pieces = self.pieces(start, closing)
        use = first.source.place(
            first.offset,
            index.end - first.offset if index.source is first.source and index.line == first.line else first.length,
            first.expansions[: macro_count(first.expansions)],
        )
        for value in values:
            self.looped[0] += closing - start + 8
            if self.looped[0] > MOST_LOOPED:
                self.tell(
                    "D284",
                    f"the loops of this deck make more than {MOST_LOOPED:,} tokens",
                    use,
                    help="write fewer iterations, or a smaller block",
                )
                raise GiveUp
            known = {**self.indices, index.text: value}
            tokens = self.tokens_of(pieces, Expansion(index.text, use, value), known)
            self.read_turn([*tokens, self.tokens[closing]], opening, known, into)
        self.position = closing
        self.leave()

    def read_turn(self, tokens: Sequence[Token], opening: Token, known: Mapping[str, str], into: list[Entry]) -> None:
        """The entries of one iteration's tokens, the closing brace among these."""
        end = Token(END, "", tokens[-1].source, tokens[-1].end, 1)
        body = type(self)([*tokens, end], self.findings)
        body.indices, body.looped, body.within = known, self.looped, self.within
        body.declared, body.unsized, body.values_of_files = self.declared, self.unsized, self.values_of_files
        body.open, body.depth, body.operators = [opening], self.depth + len(self.open) - 1, self.operators
        body.entries(into)
        self.unreadable += body.unreadable
        self.unbalanced = self.unbalanced or body.unbalanced
        self.peak = max(self.peak, body.peak)

    def check_index(self, index: Token) -> None:
        """Report a loop's index that has a unit's name (D026) or that of a loop around it (D283)."""
        if self.is_reserved(index):
            message = f"`{index.text}` is the unit {units.UNITS[index.text].word}, so it cannot be a loop's index"
            self.tell(
                "D026",
                message,
                index,
                help="choose another name: after a number it would be the unit; in edition 2 (`deck 2;`) it may",
            )
        if index.text in self.indices:
            message = f"`{index.text}` is the index of a loop around this one"
            self.tell("D283", message, index, help="give one of the two another name")

    def closing(self, position: int) -> int:
        """The position of the token that closes the brace or parenthesis at `position`, or that of the end."""
        opening, depth = self.tokens[position].text, 0
        while self.tokens[position].kind != END:
            depth += {opening: 1, OPENING[opening]: -1}.get(self.tokens[position].text, 0)
            if depth == 0:
                break
            position += 1
        return position

    def counted(self) -> Sequence[str]:
        """The iterations of `1 .. 6 by 2`: both ends are among them where the steps meet the last."""
        start = self.position
        first = self.whole()
        if self.token.text != "..":
            self.fail("D283", f"expected `..`, found {token_in_words(self.token)}", self.token, help=USAGE)
        self.advance()
        last = self.whole()
        place = span(self.tokens[start], self.previous)
        step, by = 1, self.token
        if by.text == "by":
            self.advance()
            step = self.whole()
        if step == 0:
            self.fail(
                "D283",
                "this loop has a step of 0",
                span(by, self.previous),
                help="leave it out: a step is 1 unless written",
            )
        if (last - first) * step < 0 and (step != 1 or last < first - 1):
            message = f"this loop goes from {first} to {last} in steps of {step}: it has no iteration"
            self.fail(
                "D283",
                message,
                place,
                help=f"write `by {-step}`, or change the ends"
                if by.text == "by"
                else (
                    "to count down write `by -1`",
                    "for no iteration write an end that is 1 below the beginning: `1 .. 0`",
                ),
            )
        iterations = range(first, last + (1 if step > 0 else -1), step)
        if len(iterations) > MOST_ITERATIONS:
            message = f"a loop has at most {MOST_ITERATIONS:,} iterations, and this one has {len(iterations):,}"
            least = -(-abs(last - first) // (MOST_ITERATIONS - 1))
            longer = f"by {least if step > 0 else -least}"
            self.fail(
                "D284",
                message,
                place,
                help=f"change its ends, or take larger steps: `{longer}` is the smallest that fits",
            )
        return [str(iteration) for iteration in iterations]

    def whole(self, help: str = _ENDS) -> int:
        """The whole number that begins here. help: what to write where there is none."""
        try:
            value, self.position = whole(self.tokens, self.position, self.indices)
        except NotWhole as reason:
            self.position = max(self.position, self.tokens.index(reason.token, self.position))
            token_words = token_in_words(reason.token)
            near = did_you_mean(reason.token.text, () if reason.message else self.indices)
            self.fail(
                "D283",
                reason.message or f"expected a whole number, found {token_words}",
                reason.token,
                help=[*near, reason.help or help],
            )
        return value

    def listed(self) -> Sequence[str]:
        """The iterations of `[left, right]`: names, or whole numbers."""
        opening = self.enter()
        values: dict[str, None] = {}
        while self.token.text != "]":
            first = self.token
            if self.token.kind == NAME and self.following.text in (",", "]"):
                token = self.advance()
                value = self.indices.get(token.text, token.text)
            else:
                value = str(self.whole(_LISTED))
            if value in values:
                place = span(first, self.previous)
                self.tell("D283", f"this loop goes over `{value}` twice", place, help="leave it out")
            values[value] = None
            if not self.another("]"):
                break
        self.leave("`,` or ")
        if self.token.kind == NAME and units.is_unit(self.token.text):
            self.fail("D283", "a loop goes over names and whole numbers, without a unit", self.token, help=_LISTED)
        if not values:
            self.fail(
                "D283", "this loop goes over nothing", opening, help="write names or whole numbers: `[left, right]`"
            )
        if len(values) > MOST_ITERATIONS:
            self.fail(
                "D284",
                f"a loop has at most {MOST_ITERATIONS:,} iterations, and this one has {len(values):,}",
                opening,
                help="write two loops",
            )
        return tuple(values)

    # iterations

    def pieces(self, start: int, end: int) -> list[tuple[Token, ...]]:
        """The tokens of a loop's block, with a name with braces as one piece; inner loops are not changed."""
        pieces: list[tuple[Token, ...]] = []
        position = start
        while position < end:
            token = self.tokens[position]
            length = 1
            if (
                token.text == "for"
                and self.tokens[position + 1].kind == NAME
                and self.tokens[position + 2].text == "in"
            ):
                inner = position
                while inner < end and self.tokens[inner].text != "{":
                    inner += 1
                inner = min(end, self.closing(inner) + 1) if inner < end else end
                pieces += ((inner_token,) for inner_token in self.tokens[position:inner])
                position = inner
                continue
            if token.kind == NAME or token.text == "{":
                length = max(1, name_length(self.tokens, position))
            pieces.append(tuple(self.tokens[position : position + length]))
            position += length
        return pieces

    def tokens_of(
        self, pieces: Sequence[tuple[Token, ...]], iteration: Expansion, known: dict[str, str]
    ) -> list[Token]:
        """The tokens of a loop's body in one iteration, with the loop's index filled into names with braces. known: the
        value of each index, by name."""
        through: dict[int, tuple[Expansion, ...]] = {}  # by identity, as of macros
        tokens: list[Token] = []
        for piece in pieces:
            first = piece[0]
            came = first.expansions
            if id(came) not in through:
                count = macro_count(came)
                through[id(came)] = (*came[:count], iteration, *came[count:])
            token = Token(first.kind, first.text, first.source, first.offset, piece[-1].end - first.offset)
            token.expansions = through[id(came)]
            if len(piece) > 1:
                self.fill(token, piece, known)
            tokens.append(token)
        return tokens

    def fill(self, token: Token, piece: Sequence[Token], known: dict[str, str]) -> None:
        """Replace a piece with braces by the name that it stands for; if there is none, that is reported."""
        written = "".join(part.text for part in piece)
        try:
            token.kind, token.text = NAME, filled(piece, known)
        except NotWhole as reason:
            wrong = reason.token
            place = wrong.source.place(wrong.offset, wrong.length, token.expansions)
            near = did_you_mean(wrong.text, known) if wrong.kind == NAME and not reason.message else []
            message = reason.message or f"no index {token_in_words(wrong)} in `{written}`"
            self.tell(
                "D285",
                message,
                place,
                help=[*near, reason.help or f"braces hold an index, {_indices(known)}, or whole numbers"],
            )
            token.kind, token.text = BAD, ""
        except NoName as reason:
            message, helps = f"`{written}` makes `{reason.text[:40]}`, which is no name", ""
            if piece[0].text == "{":
                helps = "in a value the index stands without braces; a name has letters before them: `seg_{i}`"
            self.tell("D285", message, token.place, help=helps or "a name is made of letters, digits and `_`")
            token.kind, token.text = BAD, ""

    # several names

    def heads(self) -> list[list[Token]]:
        """The names in brackets that begin an entry."""
        opening = self.enter()
        heads = []
        while self.token.text != "]":
            if self.token.kind != NAME:
                self.unexpected("a name")
            heads.append(self.path())
            if not self.another("]"):
                break
        self.leave("`,` or ")
        if not heads:
            self.fail("D020", "these brackets hold no names", opening, help="write `[lift, swing] = turner;`")
        return heads

    def at_several(self) -> bool:
        """Return True if names in brackets begin an entry here, or `*`, which stands for all without one of their
        own."""
        token = self.token
        return token.text == "[" or (token.text == EVERY_JOINT and self.following.text in ("=", "{"))

    def several(self) -> list[Entry]:
        """An entry for each name of `[lift, swing] = turner;`, and the one of `* = spindle;`."""
        heads = [[self.advance()]] if self.token.text == EVERY_JOINT else self.heads()
        tail: list[Token] = []
        if self.token.text == ".":
            self.position -= 1
            tail = self.path()[1:]
        operator = self.token
        if operator.text == "{":
            body = self.block()
            words = [(Word(head[0].text, head[0].place), span(head[0], head[-1])) for head in heads]
            if tail or any(len(head) > 1 for head in heads):
                self.fail("D020", "a block's name has no points", operator, help="write one block within another")
            return [Group((word,), None, None, body, place) for word, place in words]
        if operator.text not in ("=", "+="):
            self.unexpected("`=` or `{` behind the names", help="several are set alike by `[lift, swing] = turner;`")
        self.advance()
        value = self.value()
        self.semicolon(value)
        return [
            Setting(
                (),
                tuple(Word(part.text, part.place) for part in (*head, *tail)),
                operator.text,
                value,
                span(head[0], head[-1]),
            )
            for head in heads
        ]


def _indices(known: Mapping[str, str]) -> str:
    """The indices in words: `i`, or `i` or `j`."""
    return " or ".join(f"`{index}`" for index in known)
