"""The blocks and names of a deck's text as it stands, whole or not, and the texts that it includes and uses.

The parser's tree is that of a deck with its includes and macros, and does not exist for a broken text. This one is that
of a single text, complete or not.
"""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property

from ic.grammar.braced_names import name_length
from ic.grammar.uses import AS, USE
from ic.language import BLOCKS, DEFINITIONS
from ic.text.lexer import NAME, SPACE, STRING, Text, Token, logical_lines
from ic.text.limits import Findings, GiveUp
from ic.text.macros import Macros
from ic.text.substitute import Macro
from met.frozen import frozen

LETS = ("let", "param")
"""Words that give a value a name."""

UNIT = "unit"
"""The word that declares a unit."""

LOOP = "for"

INSIDE_SERVO = "sensor"
"""A word that names something in a run, and is followed by a quantity in a servo."""

NAMING = frozenset({
    *DEFINITIONS, *LETS, UNIT, "require", *(word for block in BLOCKS.values() for word in block.named),
}) - {"substitute", "with"}  # fmt: skip
"""Words that are followed by a new name."""

DEFINED = ("let", "servo", "arm")
"""The kinds of names that stand under a roof."""

_USE = re.compile(rf'\b{USE}\s*(?:"([^"\n]*)"|<([^>\n]*)>)\s*{AS}\b')


@dataclass
class TextEntry:
    """An entry of a block: from its first token to its `;`, `}` or the end of the text.

    words     the tokens before its block, its `;`, or all there are; a name with an index in braces is one
    within    the entry in whose block it stands, through loops
    opened    the `{` of its block; None where it has none
    closed    the offset behind its last token
    entries   those in its block
    """

    words: list[Token]
    within: TextEntry | None
    opened: Token | None = None
    closed: int = 0
    complete: bool = False
    entries: list[TextEntry] = field(default_factory=list)

    @property
    def own_words(self) -> list[Token]:
        """Its words, without a `default` before them."""
        return self.words[len(self.words) > 1 and self.words[0].text == "default" :]

    @property
    def texts(self) -> list[str]:
        """The texts of its words, without a `default` before them."""
        return [token.text for token in self.own_words]

    @property
    def kind(self) -> str:
        return next(iter(self.texts), "")

    @property
    def head(self) -> Token | None:
        """The first of its words, or the one behind `default`."""
        return next(iter(self.own_words), None)

    @property
    def block(self) -> str:
        """The block of the language to which it belongs: `servo` also for `elbow = motor { ... }` among a run's
        servos."""
        if "=" in self.texts[1:]:
            if self.within is not None and self.within.kind == "servos":
                return "servo"
            return self.kind if self.texts[2:3] == ["="] and self.kind in BLOCKS else ""
        behind = next((text for text in self.texts[2:3] if text in BLOCKS), "")  # `link NAME boom { ... }`
        if behind and BLOCKS[behind].written.startswith(f"{self.kind} "):
            return behind
        return self.kind if self.kind in BLOCKS else ""

    @property
    def named(self) -> Token | None:
        """The token of the name that it defines: `reach` in `let reach = 2 m;`, `motor` in `servo motor { ... }`."""
        words = self.own_words
        if len(words) < 2 or words[0].text not in NAMING or words[1].kind != NAME:
            return None
        if words[0].text == INSIDE_SERVO and self.within is not None and self.within.block == "servo":
            return None
        if words[0].text in LETS or self.opened is not None or "like" in self.texts[2:3]:
            return words[1]
        return words[1] if len(words) > 2 and words[2].text in ("=", ":") else None

    def word_behind(self, word: str) -> str:
        """The word after another one, such as the servo after `like`; "" where there is none."""
        texts = self.texts
        return texts[texts.index(word) + 1] if word in texts[:-1] else ""

    def name_behind(self, word: str) -> Token | None:
        """The token of the name after a word, `drive` in `like panda.drive`; None where there is none."""
        words = self.own_words
        index = self.texts.index(word) + 1 if word in self.texts[:-1] else len(words)
        while index + 2 < len(words) and words[index + 1].text == "." and words[index + 2].kind == NAME:
            index += 2
        return words[index] if index < len(words) else None


@dataclass
class TextDirective:
    """A line of the preprocessor: its tokens without white space, `#` first, and all of them."""

    tokens: list[Token]
    line: list[Token]

    @property
    def name(self) -> str:
        return self.tokens[1].text if len(self.tokens) > 1 else ""

    @property
    def file(self) -> str:
        """The file of an `#include` as it is written, with its quotes or angles; "" of another line."""
        first, last = self.tokens[0], self.tokens[-1]
        return first.source.text[self.tokens[1].end : last.end].strip() if self.name == "include" else ""

    @property
    def words(self) -> list[Token]:
        """The tokens that may be words of the deck: what follows the name of a directive that includes no file."""
        return self.tokens[2:] if self.name != "include" else []


@frozen
class UseInText:
    """`use <panda.ic> as panda;` in a text: the file as it is asked for, the tokens around its name, and the roof's."""

    file: str
    angled: bool
    first: Token
    last: Token
    roof: Token


def _use(entry: TextEntry) -> UseInText | None:
    """The use of a deck that an entry is; None where it is something else, or incomplete."""
    words = entry.words
    end = next((n for n, word in enumerate(words) if word.text == AS), 0)
    if end < 2 or words[0].text != USE or len(words) <= end + 1 or words[end + 1].kind != NAME:
        return None
    first, last = words[1], words[end - 1]
    if first.kind != STRING and (first.text, last.text) != ("<", ">"):
        return None
    file = first.source.text[first.offset + 1 : last.end - 1]
    return UseInText(file, first.text == "<", first, last, words[end + 1])


def used_files(text: str) -> set[str]:
    """The names, without folders, of the files that a text uses, whose runs do not belong to the deck."""
    return {os.path.basename(quoted or angled) for quoted, angled in _USE.findall(text)}


def _no_loop(entry: TextEntry | None) -> TextEntry | None:
    """The entry, or the one around it where it is a loop."""
    return entry.within if entry is not None and entry.kind == LOOP and "in" in entry.texts[2:3] else entry


def _is_call(words: list[Token]) -> bool:
    """True for `NAME(...)` and nothing else."""
    return len(words) > 2 and words[1].text == "(" and words[-1].text == ")" and words[0].kind == NAME


def entries_of(tokens: Iterable[Token], last: int, within: TextEntry | None = None) -> list[TextEntry]:
    """The entries of a sequence of tokens, with braces in names joined; last: the offset at which the text ends."""
    outermost: list[TextEntry] = []
    around: TextEntry | None = None
    entry: TextEntry | None = None
    blocks: list[TextEntry] = []  # that are open, loops among them
    rounds = 0
    for token in tokens:
        text = token.text
        rounds = max(rounds + (text in ("(", "[")) - (text in (")", "]")), 0)
        if text == "}":
            rounds = 0
            _end(entry, token.offset, False)
            entry = None
            if blocks:
                _end(blocks.pop(), token.end, True)
                around = blocks[-1] if blocks else None
            continue
        if entry is not None and not rounds and token.kind == NAME and _is_call(entry.words):
            _end(entry, entry.words[-1].end, True)  # a macro's, that stands alone
            entry = None
        if entry is None:
            if text == ";":
                continue
            entry = TextEntry([], _no_loop(around) or within)
            (outermost if around is None else around.entries).append(entry)
        if text == ";" and not rounds:
            _end(entry, token.end, True)
            entry = None
        elif text == "{":
            rounds = 0
            entry.opened = token
            blocks.append(entry)
            around, entry = entry, None
        else:
            entry.words.append(token)
    _end(entry, last, False)
    for block in blocks:
        _end(block, last, False)
    return outermost


def _end(entry: TextEntry | None, offset: int, complete: bool) -> None:
    if entry is not None:
        entry.closed, entry.complete = offset, complete


def with_whole_names(seen: Sequence[Token]) -> Iterator[Token]:
    """The tokens, with a name with braces in a loop joined into one: `seg_{i-1}`."""
    indices: list[str] = [""]  # of each block that is open; "" where it is no loop's
    index, first = "", 0
    while first < len(seen):
        token, length = seen[first], 1
        if token.kind == NAME or token.text == "{":
            length = max(1, name_length(seen, first))
            inside = seen[first : first + length]
            if not any(part.text in indices for part in inside[1:] if part.kind == NAME):
                length = 1
        if length > 1:
            text = "".join(part.text for part in seen[first : first + length])
            token = Token(NAME, text, token.source, token.offset, seen[first + length - 1].end - token.offset)
        elif token.text == LOOP and first + 2 < len(seen) and seen[first + 2].text == "in":
            index = seen[first + 1].text
        elif token.text == "{":
            indices.append(index)
            index = ""
        elif token.text == "}" and len(indices) > 1:
            indices.pop()
        first += length
        yield token


def flattened(entries: Iterable[TextEntry]) -> Iterator[TextEntry]:
    """Entries with all those inside of them, outer ones first."""
    waiting = list(reversed(list(entries)))
    while waiting:
        entry = waiting.pop()
        yield entry
        waiting += reversed(entry.entries)


def innermost_around(entries: Iterable[TextEntry], offset: int) -> TextEntry | None:
    """The innermost of the entries in whose block an offset is, through loops; None outside all blocks."""
    innermost: TextEntry | None = None
    while True:
        inside = [e for e in entries if e.opened is not None and e.opened.end <= offset < max(e.closed, 1)]
        inside += [e for e in entries if e.opened is not None and not e.complete and offset == e.closed]
        if not inside:
            return _no_loop(innermost)
        innermost, entries = inside[-1], inside[-1].entries


def through_loops(entries: Iterable[TextEntry]) -> Iterator[TextEntry]:
    """Entries of a block including those in its loops, in the order in which the block is read."""
    waiting = list(reversed(list(entries)))
    while waiting:
        entry = waiting.pop()
        yield entry
        if _no_loop(entry) is not entry:
            waiting += reversed(entry.entries)


def indices_around(entries: Iterable[TextEntry], offset: int) -> set[str]:
    """The indices of the loops in whose bodies an offset is."""
    loops = (entry for entry in flattened(entries) if _no_loop(entry) is not entry and entry.opened is not None)
    return {loop.texts[1] for loop in loops if loop.opened is not None and loop.opened.end <= offset < loop.closed}


@frozen
class TextMacro:
    """A macro as a text defines it; parameters: None where it has no parentheses."""

    name: Token
    parameters: tuple[Token, ...] | None
    body: tuple[Token, ...]

    @property
    def end(self) -> int:
        return self.body[-1].end if self.body else self.name.end


def _macro(line: TextDirective) -> TextMacro | None:
    """The macro that a `#define` defines, with its parameters (None: it has no brackets) and body; None for another
    directive."""
    tokens = line.tokens
    if line.name != "define" or len(tokens) < 3 or tokens[2].kind != NAME:
        return None
    parameters, begin = None, 3
    if len(tokens) > 3 and tokens[3].text == "(" and tokens[3].offset == tokens[2].end:
        close = next((n for n, token in enumerate(tokens) if token.text == ")"), len(tokens) - 1)
        parameters = tuple(token for token in tokens[4:close] if token.text != ",")
        begin = close + 1
    body = [token for token in tokens[begin:] if token.text.strip()]
    return TextMacro(tokens[2], parameters, tuple(with_whole_names(body)))


class DeckText:
    """A text with its tokens, entries and preprocessor lines."""

    def __init__(self, name: str, text: str) -> None:
        """name: of the text, as places of its deck call it"""
        self.source = Text(name, text)
        self.tokens: list[Token] = []  # of the deck itself
        self.comments: list[Token] = []
        self.directives: list[TextDirective] = []
        for line in logical_lines(self.source):
            seen = [token for token in line if token.kind != SPACE and token.text]
            self.comments += (
                token for token in line if token.kind == SPACE and text[token.offset : token.offset + 1] == "/"
            )
            if seen and seen[0].text == "#":
                self.directives.append(TextDirective(seen, line))
            else:
                self.tokens += (token for token in seen if token.text.strip())
        self.tokens = list(with_whole_names(self.tokens))
        self.entries = entries_of(self.tokens, len(text))
        self.macros = [macro for macro in map(_macro, self.directives) if macro is not None]
        self.uses = [use for use in map(_use, self.entries) if use is not None]

    def all_entries(self) -> Iterator[TextEntry]:
        """All entries, outer ones first."""
        return flattened(self.entries)

    def around(self, offset: int) -> TextEntry | None:
        """The innermost entry in whose block an offset is, through loops; None outside all blocks."""
        return innermost_around(self.entries, offset)

    def token_at(self, offset: int) -> Token | None:
        """The word at an offset or just before it, in the deck or in a preprocessor line."""
        tokens = self._all_tokens
        n = bisect_right([token.offset for token in tokens], offset) - 1
        if n < 0:
            return None
        token = tokens[n]
        if token.offset == offset and token.kind != NAME and n and tokens[n - 1].end == offset:
            token = tokens[n - 1]
        return token if token.offset <= offset <= token.end else None

    @cached_property
    def defined(self) -> dict[str, Macro]:
        """Its macros as the preprocessor takes them, by name, the last of each name; none that it refuses."""
        reader = Macros(Findings())
        with suppress(GiveUp):
            for line in self.directives:
                if line.name == "define" and len(line.tokens) > 2:
                    reader.define(line.line[line.line.index(line.tokens[2]) :])
        return reader.macros

    @cached_property
    def _all_tokens(self) -> list[Token]:
        tokens = self.tokens + [token for line in self.directives for token in line.tokens if token.text.strip()]
        return sorted(tokens, key=lambda token: token.offset)

    def may_be_unit(self, token: Token) -> bool:
        """True for a word after a number, a bracket, or a sign of a product of units."""
        before = self.source.text[: token.offset].rstrip()[-1:]
        return before.isdigit() or before in "*/.])^"

    def offset(self, line: int, column: int) -> int:
        """The offset of a column of a line, both counted from 0."""
        lines = self.source.text.split("\n")
        line = min(line, len(lines) - 1)
        return self.source.offset(line + 1, 1) + min(column, len(lines[line]))


class DecksUsed:
    """The texts in which a name of a text may be defined: those that includes connect with it, and behind the roof of a
    used deck those of that deck.

    A text that no other one is seen to include or use, for a macro names its file, counts as a part of the first.
    """

    def __init__(self, texts: Sequence[DeckText]) -> None:
        """texts: those of one deck, its own first"""
        self._uses = {text.source.name: text.uses for text in texts}
        self._seen = {name: {name} for name in self._uses}
        reached: set[str] = set()
        for text in texts if self else ():
            for line in text.directives:
                for other in self._called(line.file[1:-1]):
                    self._connect(text.source.name, other)
                    reached |= {other} - {text.source.name}
            reached.update(*(self._called(use.file) for use in text.uses))
        for text in texts[1:] if self else ():
            if text.source.name not in reached:
                self._connect(text.source.name, texts[0].source.name)

    def _connect(self, name: str, other: str) -> None:
        """Let two texts, and those that are connected with them, see each other."""
        connected = self._seen[name] | self._seen[other]
        self._seen.update(dict.fromkeys(connected, connected))

    def __bool__(self) -> bool:
        """True where a text uses a deck."""
        return any(self._uses.values())

    def _called(self, file: str) -> set[str]:
        """The texts that a file's name may mean."""
        pattern = re.compile(rf"<?(?:.*/)?{re.escape(file.removeprefix('./'))}>?")
        return {name for name in self._uses if pattern.fullmatch(name)}

    def seen_from(self, name: str) -> set[str]:
        """The texts whose definitions a text sees without a roof, including itself."""
        return self._seen[name] if self else set(self._uses)

    def roofs(self, names: Iterable[str]) -> dict[str, UseInText]:
        """The roofs that some texts have."""
        return {use.roof.text: use for name in names for use in self._uses.get(name, ())}

    def under(self, name: str, words: Sequence[str]) -> set[str]:
        """The texts for which roofs in a text stand, `cell`, `panda` in `cell.panda.d1`; none where one is not a
        roof."""
        seen = self.seen_from(name)
        for word in words:
            use = self.roofs(seen).get(word)
            seen = {name for file in self._called(use.file) for name in self._seen[file]} if use is not None else set()
        return seen


class KnownStructures:
    """The structures of the texts of decks that an editor asks about, found once for each state of a text.

    A deck's are those of the texts that it had when it was last asked about, so memory follows from what is open, never
    from how often it was changed.
    """

    def __init__(self, opened: Container[str]) -> None:
        """opened: the addresses of the decks that are open now; nothing is kept of others."""
        self._opened = opened
        self._by_deck: dict[str, dict[str, DeckText]] = {}

    def of(self, deck: str, texts: Mapping[str, str]) -> dict[str, DeckText]:
        """The structures of all texts of a deck at an address, by the texts' names."""
        known = {structure.source.name: structure for other in self._by_deck.values() for structure in other.values()}
        known.update(self._by_deck.get(deck, {}))
        structures = {}
        for name, text in texts.items():
            last = known.get(name)
            structures[name] = last if last is not None and last.source.text == text else DeckText(name, text)
        if deck in self._opened:
            self._by_deck[deck] = structures
        return structures

    def forget(self, deck: str) -> None:
        """Release the structures of a deck that an editor has closed."""
        self._by_deck.pop(deck, None)
