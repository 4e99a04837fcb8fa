"""Renaming in all decks that have a name: proved edits, or the reason why there are none.

The edits are found by name and place in the texts, which is less exact than the compiler. So they are proved: every
deck that has the name is compiled before and after, and the two plans must be equal up to the name.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ic.driver.compile import Compiled
from ic.editor.checking import CheckRequest, compiled_with_reply
from ic.editor.names import NameInText, NamesInTexts
from ic.editor.structure import DeckText
from ic.language import BLOCKS
from ic.meaning.expressions.evaluate import CONSTANTS, FUNCTIONS
from ic.text.lexer import COMMAND_LINE, NAME, Token
from met.frozen import frozen
from met.plan.codec import encode
from met.units import is_unit

WORDS = ("for", "in", "let", "param", "like", "of", "from", "and", "or", "not", "when", "default", "base")
"""Words of the grammar, which name nothing."""

NO_DECKS = (".csv", ".urdf", ".xacro")
"""The endings of files that decks name and that are not decks."""

NO_RUN = "D161"
"""The error of a text that is a part of decks and not a deck."""


@frozen
class RenameRequest:
    """A name to be changed.

    decks  the deck in which it was asked first, then others that may have the name
    file   the text with the name, as the first deck's places call it;  offset: where it stands
    roots  the real paths of the folders in which texts may be changed
    """

    decks: tuple[CheckRequest, ...]
    file: str
    offset: int
    new: str
    roots: tuple[str, ...]


@frozen
class Renamed:
    """Offsets and lengths of the replaced stretches, by the files' real paths (a text in no file: ""); or the reason
    why there are none.

    texts  the files' texts, by their paths
    """

    edits: Mapping[str, tuple[tuple[int, int], ...]]
    texts: Mapping[str, str]
    refused: str = ""


class NotRenamed(Exception):
    """Raised with the reason why a name is not changed."""


def refusal_of_word(new: str) -> str:
    """The reason why a word cannot be a name; "" where it can."""
    if not (new.isascii() and new.isidentifier()):
        return f"`{new}` is no name: letters, digits and `_`, not a digit first"
    if is_unit(new):
        return f"`{new}` is a unit"
    if new in (*FUNCTIONS, *CONSTANTS):
        return f"`{new}` is a function or a number of the language"
    return f"`{new}` is a word of the language" if new in WORDS or _begins_entries(new) else ""


def _begins_entries(word: str) -> bool:
    """True of the word of a block of the language, but for one behind a name, as in `link NAME boom`."""
    return word in BLOCKS and BLOCKS[word].written.startswith(word)


def refusal_of_name(token: Token, meant: Sequence[NameInText]) -> str:
    """The reason why the meaning of a word cannot be renamed, judged by texts alone; "" where it can."""
    if any("{" in definition.token.text for definition in meant):
        return f"`{token.text}` is made by a loop: change `{meant[0].token.text}` by hand"
    if any(definition.by_macro for definition in meant):
        return f"`{token.text}` is made by a macro: change what the macro is given by hand"
    library = [definition for definition in meant if definition.file.startswith("<")]
    if library:
        return f"`{token.text}` is defined in {library[0].file}, which comes with MET"
    if not meant:
        return f"`{token.text}` is no name that a deck defines here"
    return ""


class _Deck:
    """A compiled deck, with the names in its texts."""

    def __init__(self, request: CheckRequest) -> None:
        self.request = request
        self.compiled = _compiled(request)
        texts = self.compiled.sources
        decks = (name for name in texts if not name.endswith(NO_DECKS) and name != COMMAND_LINE)
        self.names = NamesInTexts(DeckText(name, texts[name]) for name in decks)

    def path(self, name: str) -> str:
        """The real path of a file that its places name; "" of a text in no file."""
        if self.request.text is not None and name == next(iter(self.compiled.sources)):
            return ""
        return os.path.realpath(os.path.join(self.request.folder, name))


def _compiled(request: CheckRequest) -> Compiled:
    os.chdir(request.folder)
    return compiled_with_reply(request)[0]


def renamed(rename_request: RenameRequest) -> Renamed:
    """The proved edits that change the name, or the reason why there are none."""
    try:
        return _renamed(rename_request)
    except NotRenamed as reason:
        return Renamed({}, {}, str(reason))


def _renamed(rename_request: RenameRequest) -> Renamed:
    """The edits of every deck that shares the name, each proved by its plan. Raises NotRenamed."""
    first = _Deck(rename_request.decks[0])
    text = next((candidate for candidate in first.names.texts if candidate.source.name == rename_request.file), None)
    token = text.token_at(rename_request.offset) if text is not None else None
    if text is None or token is None or token.kind != NAME:
        raise NotRenamed("there is no name here")
    meant = first.names.meant_in(text, token)
    reason = refusal_of_word(rename_request.new) or refusal_of_name(token, meant)
    if reason:
        raise NotRenamed(reason)
    home = {first.path(definition.file) for definition in meant}
    decks = [first]
    for request in rename_request.decks[1:]:
        other = _Deck(request)
        if home & {other.path(name) for name in other.compiled.sources}:
            decks.append(other)
    uses: dict[str, set[tuple[int, int]]] = {}
    texts: dict[str, str] = {}
    places = {(first.path(definition.file), definition.token.offset) for definition in meant}
    for deck in decks:
        for taken in deck.names.by_name.get(rename_request.new, ()):
            raise NotRenamed(f"`{rename_request.new}` exists: {taken.kind} at {taken.token.place}")
        for use in _uses(deck, token.text, places):
            path = deck.path(use.source.name)
            _refuse_outside(use, path, rename_request.roots)
            uses.setdefault(path, set()).add((use.offset, use.length))
            texts[path] = use.source.text
    edits = {path: tuple(sorted(offsets)) for path, offsets in uses.items()}
    proved = [_is_proved(deck, edits, token.text, rename_request.new) for deck in decks]
    if not any(proved):
        raise NotRenamed("no deck has a run by which the change could be proved: open one that includes this text")
    return Renamed(edits, texts)


def _refuse_outside(use: Token, path: str, roots: Iterable[str]) -> None:
    """Raise NotRenamed for a use in the standard library, or in a file outside of the open folders."""
    if use.source.name.startswith("<"):
        raise NotRenamed(f"`{use.text}` is used in {use.source.name}, which comes with MET")
    if path and not any(os.path.commonpath([path, root]) == root for root in roots):
        raise NotRenamed(f"`{use.text}` stands in {path}, which is outside of the folders that are open")


def _uses(deck: _Deck, name: str, places: set[tuple[str, int]]) -> Iterator[Token]:
    """The tokens of a deck's texts that mean one of the definitions."""
    for use, meant in deck.names.uses(name):
        if any((deck.path(definition.file), definition.token.offset) in places for definition in meant):
            yield use


def edited(text: str, edits: Iterable[tuple[int, int]], new: str) -> str:
    """A text with stretches of it replaced."""
    for offset, length in sorted(edits, reverse=True):
        text = text[:offset] + new + text[offset + length :]
    return text


def _is_proved(deck: _Deck, edits: Mapping[str, tuple[tuple[int, int], ...]], old: str, new: str) -> bool:
    """True where a deck's plan is the same except for the name; False where it has none, since it has no runs. Raises
    NotRenamed."""
    codes = [diagnostic.code for diagnostic in deck.compiled.diagnostics if diagnostic.severity == "error"]
    if codes and codes != [NO_RUN]:
        label = deck.compiled.diagnostics[0].at
        raise NotRenamed(f"{label.place if label is not None else deck.request.name}: mend {codes[0]} first")
    changed = {
        deck.path(name): edited(text, edits[deck.path(name)], new)
        for name, text in deck.compiled.sources.items()
        if deck.path(name) in edits
    }
    request = deck.request
    if "" in changed:
        request = replace(request, text=changed.pop(""))
    after = _compiled(replace(request, unsaved={**request.unsaved, **changed}))
    before = deck.compiled
    same_codes = [message.code for message in before.diagnostics] == [message.code for message in after.diagnostics]
    if before.plan is None or after.plan is None:
        if not same_codes:
            raise NotRenamed(f"`{old}` would not be found everywhere: {after.diagnostics[0].message}")
        return False
    old_plan, new_plan = (encode(type(plan), plan) for plan in (before.plan, after.plan))
    if not same_codes or not same_but_for(old, new, old_plan, new_plan):
        raise NotRenamed(f"{deck.request.name or 'the deck'} would mean something else: `{old}` has other uses")
    return True


def same_but_for(old: str, new: str, before: Any, after: Any) -> bool:
    """True for two values of plans that are equal with one word in place of another, and columns of places aside."""
    word = re.compile(rf"\b{old}\b")
    return bool(_with_word(word, new, before) == _with_word(word, new, after))


def _with_word(old: re.Pattern[str], new: str, value: Any) -> Any:
    """A value of a plan with a word in place of another, without the columns of places and the plan's sources."""
    match value:
        case str():
            return old.sub(new, value)
        case list() | tuple():
            return [_with_word(old, new, inner) for inner in value]
        case dict():
            place, plan = {"file", "line"} <= value.keys(), {"sources", "experiments"} <= value.keys()
            left_out = ("column", "length") if place else ("sources",) if plan else ()
            return {
                old.sub(new, key): _with_word(old, new, inner) for key, inner in value.items() if key not in left_out
            }
    return value
