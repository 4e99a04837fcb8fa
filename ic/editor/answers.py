"""Answers to an editor's questions about a position: completion, hover, definition, references, renaming."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cached_property
from itertools import islice

from lsprotocol import types
from pygls.exceptions import JsonRpcException
from pygls.workspace import PositionCodec

from ic.editor import completion
from ic.editor.checker_process import CheckerProcess
from ic.editor.checking import CheckRequest, Crash
from ic.editor.checks import CheckedDeck, DeckChecks
from ic.editor.index import DeckIndex, ValueInDeck
from ic.editor.names import NamesInTexts, models_called
from ic.editor.positions import Texts, lines_of, normal, uri_of
from ic.editor.renaming import Renamed, RenameRequest, refusal_of_name, refusal_of_word
from ic.editor.structure import UNIT, DeckText, TextEntry
from ic.printing.models import summary
from ic.text.files import LIBRARY, Files, FoundFile, file_at
from ic.text.lexer import NAME, Text, Token
from met.diagnostic import Place
from met.host.files import read_regular
from met.messages.message import shown_place
from met.units import UNITS

NO_INDEX = DeckIndex((), ())

MOST_VALUES = 4  # values that are shown of one place; if there are more, their number


MOST_FILES = 5_000  # of the folders that are open, that are looked into
MOST_DECKS = 100  # that have the name and are no part of the deck that is open
MOST_BYTES = 1 << 20  # of a deck that is looked into


class CannotRename(JsonRpcException):
    """The answer that a name cannot be changed, with the reason."""

    CODE = types.LSPErrorCodes.RequestFailed.value


class AskedPosition:
    """A position in an open text, with the deck that the text is part of, if it is known.

    text  the text as it is now;  file: its name in the deck's places
    address  gives the editor's URI of a file of a deck by its name there, None where it has none
    """

    def __init__(
        self,
        checks: DeckChecks,
        codec: PositionCodec,
        address: Callable[[CheckedDeck, str], str | None],
        uri: str,
        position: types.Position,
    ) -> None:
        """checks: of all open decks; codec: for the editor's units of columns; address: of a file of a deck by its
        name; uri: of the open text"""
        self._checks, self._codec = checks, codec
        self._deck = deck = checks.deck_of(uri)
        opened = checks.texts.get(uri)
        self._path = opened.path if opened is not None else None
        current = normal(opened.text if opened is not None else "")
        texts: dict[str, str] = {}
        self._addresses: dict[str, str] = {}
        if deck is not None:
            for name, source in deck.reply.sources.items():
                where = address(deck, name)
                if where is None or (not name.rstrip(">").endswith(".ic") and where not in checks.texts):
                    continue
                now = checks.texts.get(where)
                texts[name] = source if now is None else normal(now.text)
                self._addresses[name] = where
        self.file = next((name for name, where in self._addresses.items() if where == uri), uri)
        self._addresses[self.file] = uri
        texts.setdefault(self.file, current)
        deck_uri = deck.deck.uri if deck is not None else uri
        self._structures = checks.structures.of(deck_uri, texts)
        self.text = self._structures[self.file]
        self.index = checks.indexes.get(deck_uri, NO_INDEX)
        lines = lines_of(current)
        line = lines[position.line] if position.line < len(lines) else ""
        self.offset = self.text.offset(position.line, characters(codec, line, position.character))

    @cached_property
    def names(self) -> NamesInTexts:
        """The names of all texts of the deck, open ones as they are now."""
        return NamesInTexts(self._structures.values(), self.index.names_by_owner)

    def position(self, offset: int) -> types.Position:
        """The editor's position of an offset of the text."""
        texts, place = Texts({self.file: self.text.source.text}, self._codec), self.text.source.place(offset, 1)
        return texts.position(self.file, place.line, place.column)

    @property
    def token(self) -> Token | None:
        return self.text.token_at(self.offset)

    @property
    def name_here(self) -> Token | None:
        """The word here, where it may be a name."""
        token = self.token
        return token if token is not None and token.kind == NAME else None

    def location(self, token: Token) -> types.Location:
        texts = Texts({token.source.name: token.source.text}, self._codec)
        return types.Location(self._addresses[token.source.name], texts.range(token.place))

    def complete(self) -> list[types.CompletionItem]:
        """The words that may stand here."""
        offers = completion.offers(self.text, self.offset, self.names, self.index, self._files_beside())
        return [
            types.CompletionItem(offer.word, kind=offer.kind, detail=offer.about or None, sort_text=f"{n:04d}")
            for n, offer in enumerate(offers)
        ]

    def hover(self) -> types.Hover | None:
        """The known facts about the word here."""
        token = self.token
        if token is None:
            return None
        paragraphs = _about(self.text, token, self.names, self.index, self.file)
        if not paragraphs:
            return None
        contents = types.MarkupContent(types.MarkupKind.Markdown, "\n\n---\n\n".join(paragraphs))
        return types.Hover(contents, self.location(token).range)

    def definitions(self) -> list[types.Location]:
        """The places where the word here is defined, or the beginning of the file that an include names."""
        included = self._included()
        if included is not None:
            beginning = types.Position(0, 0)
            return [types.Location(included, types.Range(beginning, beginning))]
        token = self.name_here
        if token is None:
            return []
        return [self.location(definition.token) for definition in self.names.meant_in(self.text, token)]

    def references(self, also_definitions: bool) -> list[types.Location]:
        """The uses of the word's meaning here: words that may mean the same definition."""
        token = self.name_here
        if token is None or token.text not in self.names.by_name:
            return []
        meant = self.names.meant_in(self.text, token)
        defined = {(definition.file, definition.token.offset) for definition in self.names.by_name[token.text]}
        return [
            self.location(use)
            for use, definitions in self.names.uses(token.text)
            if any(definition in meant for definition in definitions)
            if also_definitions or (use.source.name, use.offset) not in defined
        ]

    def nameable(self) -> types.PrepareRenamePlaceholder | None:
        """The stretch of the name here, if the texts allow a renaming. Raises CannotRename."""
        token = self.name_here
        if token is None:
            return None
        if reason := refusal_of_name(token, self.names.meant_in(self.text, token)):
            raise CannotRename(reason)
        return types.PrepareRenamePlaceholder(range=self.location(token).range, placeholder=token.text)

    async def rename(self, new: str, folders: Iterable[str], process: CheckerProcess) -> types.WorkspaceEdit:
        """The edits that give the name here another one, in all files. Raises CannotRename.

        folders  that the editor has open, their paths;  process: which proves the edits, and checks nothing meanwhile
        """
        token, deck = self.name_here, self._deck
        if token is None or deck is None:
            raise CannotRename("there is no name here")
        if reason := refusal_of_word(new) or refusal_of_name(token, self.names.meant_in(self.text, token)):
            raise CannotRename(reason)
        first = self._checks.request(deck.deck)
        roots = tuple(os.path.realpath(root) for root in (*folders, first.folder))
        others = tuple(_others(self._checks, deck, token.text, roots))
        if len(others) > MOST_DECKS:
            raise CannotRename(f"more than {MOST_DECKS} decks have the word `{token.text}`")
        request = RenameRequest((first, *others), self.file, token.offset, new, roots)
        async for done in process.ask(request):
            if isinstance(done, Crash):
                raise RuntimeError(done.traceback)
            assert isinstance(done, Renamed)
            if done.refused:
                raise CannotRename(done.refused)
            return types.WorkspaceEdit(changes=dict(self._changes(done, new, deck.deck.uri)))
        raise CannotRename("a deck was changed or saved before the new name was proved: rename again")

    def _changes(self, done: Renamed, new: str, own: str) -> Iterator[tuple[str, list[types.TextEdit]]]:
        """The edits of each file by its address. own: the address of the deck where it is in no file"""
        open_at = {text.identity: text.uri for text in self._checks.texts.values() if text.path is not None}
        for path, edits in done.edits.items():
            texts, source = Texts(done.texts, self._codec), Text(path, done.texts[path])
            text_edits = [types.TextEdit(texts.range(source.place(*edit)), new) for edit in edits]
            yield own if not path else open_at.get(path, uri_of(path)), text_edits

    def _included(self) -> str | None:
        """The address of the file that the include or the use at the position names."""
        for use in self.text.uses:
            if use.first.offset <= self.offset < use.last.end:
                return self._address(use.file, use.angled)
        for line in self.text.directives:
            if line.name == "include" and line.tokens[0].offset <= self.offset <= line.tokens[-1].end:
                return self._address(line.file[1:-1], line.file[:1] == "<")
        return None

    def _address(self, file: str, angled: bool) -> str | None:
        """The address of a file that the text names; None where there is none."""
        found_file = self._files().find(file, self._files().where(self._found_file(), angled))
        return None if found_file is None else uri_of(os.path.abspath(found_file.path))

    def _files(self) -> Files:
        return Files(self._checks.include_dirs, unsaved=self._checks.unsaved())

    def _found_file(self) -> FoundFile:
        """The file of the open text, from which includes are looked for."""
        if self._path is None:
            return FoundFile("", "")
        inside = os.path.relpath(self._path, LIBRARY)
        return file_at(self._path) if inside.startswith("..") else FoundFile(self._path, f"<{inside}>")

    def _files_beside(self) -> Iterator[str]:
        """The names of decks that an include in quotes finds, without the library's and the text's own."""
        files = self._files()
        own = os.path.basename(self._path or "")
        folders = files.where(self._found_file(), False)[:-1]
        yield from (name for name in files.listed(folders) if name != own)


def characters(codec: PositionCodec, line: str, units: int) -> int:
    """The number of characters of a line before a position in an editor's units."""
    taken = 0
    for n, character in enumerate(line):
        if taken >= units:
            return n
        taken += codec.client_num_units(character)
    return len(line)


def _about(text: DeckText, token: Token, names: NamesInTexts, index: DeckIndex, file: str) -> list[str]:
    """Paragraphs, in Markdown, about a word of a text; none where nothing is known of it.

    file  the name that places of the deck give the text's file
    """
    entry = names.entry_at(text, token)
    paragraphs = [*_of_key(token, entry, names), *_of_model(token), *_of_unit(text, token)]
    return [*paragraphs, *_of_name(text, token, names, index), *_of_values(index, token, entry, file)]


def _of_key(token: Token, entry: TextEntry | None, names: NamesInTexts) -> Iterator[str]:
    """The paragraph about a word that begins an entry: its declaration in the block, or in the model."""
    if entry is None or entry.head is None or token.offset != entry.head.offset:
        return
    declared = names.declared_in(entry.within).get(token.text)
    if declared is not None and entry.within is None:
        yield f"`{declared.written}`\n\n{declared.doc}"
    elif declared is not None and declared.written == declared.name:
        unit = f" in {declared.unit}" if declared.unit not in ("", "1") else ""
        yield f"`{declared.name}`{unit}: {declared.doc}; {declared.default_in_words}"
    elif declared is not None:
        unit = f"unit: {declared.unit}; " if declared.unit not in ("", "1") else ""
        yield f"`{declared.written}`\n\n{declared.doc}\n\n{unit}{declared.default_in_words}"


def _of_model(token: Token) -> Iterator[str]:
    """A line about each model of this name."""
    for kind, model in models_called(token.text).items():
        yield f"{kind} model `{token.text}`: {summary(model)}"


def _of_unit(text: DeckText, token: Token) -> Iterator[str]:
    """A line about the unit that a word is behind a number or another unit."""
    unit = UNITS.get(token.text)
    if unit is not None and text.may_be_unit(token):
        yield f"unit `{token.text}`: {unit.word}, {unit.measure.scale:g} in SI"


def _of_name(text: DeckText, token: Token, names: NamesInTexts, index: DeckIndex) -> Iterator[str]:
    """The definitions that a name may mean, each with its line of the deck."""
    for definition in names.meant_in(text, token)[:2] if token.kind == NAME else ():
        source = definition.token.source
        line = source.text.split("\n")[source.line(definition.token.offset) - 1].strip()
        size = index.units.get(token.text) if definition.kind == UNIT else None
        size_words = f": {size} in SI" if size is not None else ""
        yield f"{definition.kind} `{definition.token.text}`{size_words}\n\n```met\n{line}\n```"


def _of_values(index: DeckIndex, token: Token, entry: TextEntry | None, file: str) -> Iterator[str]:
    """The values that are written in the entry of a word, or at it."""
    lines = _lines(token, entry)
    values = [
        candidate
        for candidate in index.values
        if candidate.place is not None and _is_at(candidate.place, file, lines, token)
    ]
    for value in values[:MOST_VALUES]:
        yield _words(value)
    if len(values) > MOST_VALUES:
        yield f"and {len(values) - MOST_VALUES} more values are written here"


def _lines(token: Token, entry: TextEntry | None) -> tuple[tuple[int, int], tuple[int, int]]:
    """The begin and end of an entry, up to its block: lines and columns from 1."""
    words = entry.words if entry is not None and entry.words else [token]
    first, last = words[0].place, words[-1].place
    return (first.line, first.column), (last.line, last.column + last.length)


def _is_at(place: Place, file: str, lines: tuple[tuple[int, int], tuple[int, int]], token: Token) -> bool:
    """True where a place, or the one that a macro came from, is in these lines of the file."""
    return any(
        seen_place.file == file and lines[0] <= (seen_place.line, seen_place.column) < lines[1]
        for seen_place in {place, shown_place(place)}
    )


def _words(value: ValueInDeck) -> str:
    notes = "; ".join(value.origins)
    return (
        f"`{value.path}` = {value.value}"
        + (f"  \n{notes}" if notes else "")
        + (f"  \n{value.doc}" if value.doc else "")
    )


def _others(checks: DeckChecks, deck: CheckedDeck, word: str, roots: Iterable[str]) -> Iterator[CheckRequest]:
    """The other decks with a word, open ones and those in the open folders; at most one more than the limit."""
    has_word = re.compile(rf"\b{re.escape(word)}\b")
    known = {deck.deck.identity}
    for other in checks.decks():
        if other.deck.identity not in known:
            known.add(other.deck.identity)
            yield checks.request(other.deck)
    unsaved = checks.unsaved()
    count = 0
    for path in islice(_files_in(roots), MOST_FILES):
        real = os.path.realpath(path)
        if not path.endswith(".ic") or real in known or count > MOST_DECKS:
            continue
        known.add(real)
        with suppress(OSError):
            if has_word.search(unsaved.get(real) or read_regular(real, MOST_BYTES).decode(errors="replace")):
                count += 1
                folder, name = os.path.split(path)
                yield CheckRequest(folder, name, None, checks.include_dirs, checks.defines, unsaved)


def _files_in(roots: Iterable[str]) -> Iterator[str]:
    """The paths of all files in some folders and in their folders, but for hidden folders."""
    for root in roots:
        for folder, folders, files in os.walk(root):
            folders[:] = sorted(entry for entry in folders if not entry.startswith("."))
            yield from (os.path.join(folder, name) for name in sorted(files))
