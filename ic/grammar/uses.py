"""`use <panda.ic> as panda;`: the entry by which a deck brings in the definitions of another one."""

from __future__ import annotations

from collections.abc import Sequence

from ic.grammar.cursor import token_in_words
from ic.grammar.edition_entries import EditionEntries
from ic.grammar.syntax import Broken, UseEntry, Word
from ic.text.lexer import NAME, STRING, Token
from ic.text.limits import Findings

USE, AS = "use", "as"
USAGE = 'write `use <panda.ic> as panda;` or `use "beside.ic" as beside;`'


class Uses(EditionEntries):
    """The part of the parser for this entry."""

    def __init__(self, tokens: Sequence[Token], findings: Findings) -> None:
        super().__init__(tokens, findings)
        self.uses: list[UseEntry] = []

    def at_use(self) -> bool:
        """Return True if a deck is used here, or text that was meant for that."""
        if self.token.text != USE:
            return False
        if self.following.text == "<" or self.following.kind == STRING:
            return True
        position = self.position + 1  # `use panda.ic as panda;`
        while self.tokens[position].kind == NAME or self.tokens[position].text in (".", "/", "-"):
            if self.tokens[position].text == AS and position > self.position + 1:
                return True
            position += 1
        return False

    def use(self) -> None:
        word = self.advance()
        if self.depth or self.open:
            self.fail("D395", "a deck is used outside of blocks and loops", word, help="move this entry out")
        if self.token.kind != STRING and self.token.text != "<":
            self.fail("D395", f"expected a file, found {token_in_words(self.token)}", self.token, help=USAGE)
        first = self.token
        name = first.text[1:-1]
        place = first.place
        if first.text == "<":
            written = first.source.rest_of_line(first.offset)
            end = written.find(">")
            if end < 0:
                self.fail("D395", "`use <` without its `>`", first, help=USAGE)
            name, place = written[1:end], first.source.place(first.offset, end + 1, first.expansions)
            while self.token.source is first.source and first.offset <= self.token.offset <= first.offset + end:
                self.advance()
        else:
            self.advance()
        if not name.strip():
            self.fail("D395", "`use` needs a file, and this name is empty", place, help=USAGE)
        if self.token.text != AS:
            self.fail("D395", f"expected `as`, found {token_in_words(self.token)}", self.token, help=USAGE)
        self.advance()
        roof = self.token
        if roof.kind != NAME:
            words = token_in_words(roof)
            self.fail("D395", f"expected a name for the roof, found {words}", roof, help=USAGE)
        self.advance()
        self.semicolon(Broken(roof.place))
        self.uses.append(UseEntry(name, first.text == "<", Word(roof.text, roof.place), place, first.source.name))
