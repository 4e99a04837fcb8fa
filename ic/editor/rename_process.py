"""Renaming in the server: the choice of decks that may have the name, and the process that proves the edits."""

from __future__ import annotations

import asyncio
import os
import pickle
import re
from collections.abc import Iterable, Iterator, Mapping

from lsprotocol import types
from pygls.exceptions import JsonRpcException
from pygls.workspace import PositionCodec

from ic.editor.answers import AskedPosition
from ic.editor.checking import CheckRequest
from ic.editor.checks import CheckedDeck, DeckChecks
from ic.editor.positions import Texts, path_of, uri_of
from ic.editor.renaming import Renamed, RenameRequest, refusal_of_name, refusal_of_word
from met.host import interpreter

MOST_FILES = 5_000  # of the folders that are open, that are looked into
MOST_DECKS = 100  # that have the name and are no part of the deck that is open
MOST_BYTES = 1 << 20  # of a deck that is looked into


class CannotRename(JsonRpcException):
    """The answer that a name cannot be changed, with the reason."""

    CODE = types.LSPErrorCodes.RequestFailed.value


def nameable(asked_position: AskedPosition) -> types.PrepareRenamePlaceholder | None:
    """The stretch of the name here, if the texts allow a renaming. Raises CannotRename."""
    token = asked_position.name_here
    if token is None:
        return None
    reason = refusal_of_name(token, asked_position.names.meant_in(asked_position.text, token))
    if reason:
        raise CannotRename(reason)
    return types.PrepareRenamePlaceholder(range=asked_position.location(token).range, placeholder=token.text)


async def rename(
    asked_position: AskedPosition,
    new: str,
    checks: DeckChecks,
    deck: CheckedDeck | None,
    folders: Iterable[str],
    codec: PositionCodec,
) -> types.WorkspaceEdit:
    """The edits that give the name here another one, in all files. Raises CannotRename.

    folders  that the editor has open, their paths;  deck: of which the text is a part
    """
    token = asked_position.name_here
    if token is None or deck is None:
        raise CannotRename("there is no name here")
    reason = refusal_of_word(new) or refusal_of_name(token, asked_position.names.meant_in(asked_position.text, token))
    if reason:
        raise CannotRename(reason)
    first = checks.request(deck.deck)
    roots = tuple(os.path.realpath(root) for root in (*folders, first.folder))
    others = tuple(_others(checks, deck, token.text, roots))
    if len(others) > MOST_DECKS:
        raise CannotRename(f"more than {MOST_DECKS} decks have the word `{token.text}`")
    request = RenameRequest((first, *others), asked_position.file, token.offset, new, roots)
    done = await _proved(request)
    if done.refused:
        raise CannotRename(done.refused)
    return types.WorkspaceEdit(changes=dict(_changes(done, new, checks, deck.deck.uri, codec)))


async def _proved(request: RenameRequest) -> Renamed:
    process = await asyncio.create_subprocess_exec(
        *interpreter.command("ic.editor.renamer"),
        env=interpreter.environment(),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    try:
        answer, _ = await process.communicate(pickle.dumps(request))
    finally:
        if process.returncode is None:
            process.kill()
    if process.returncode != 0:
        raise CannotRename("the process that proves the change has died; the log says more")
    done = pickle.loads(answer)
    assert isinstance(done, Renamed)
    return done


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
    for path in _decks_in(roots):
        real = os.path.realpath(path)
        if real in known or count > MOST_DECKS:
            continue
        known.add(real)
        if has_word.search(unsaved.get(real) or _text(real)):
            count += 1
            folder, name = os.path.split(path)
            yield CheckRequest(folder, name, None, checks.include_dirs, checks.defines, unsaved)


def _decks_in(roots: Iterable[str]) -> Iterator[str]:
    seen = 0
    for root in roots:
        for folder, folders, files in os.walk(root):
            folders[:] = sorted(entry for entry in folders if not entry.startswith("."))
            for name in sorted(files):
                seen += 1
                if seen > MOST_FILES:
                    return
                if name.endswith(".ic"):
                    yield os.path.join(folder, name)


def _text(path: str) -> str:
    try:
        if not os.path.isfile(path) or os.path.getsize(path) > MOST_BYTES:
            return ""
        with open(path, encoding="utf-8", errors="replace") as file:
            return file.read()
    except OSError:
        return ""


def _changes(
    done: Renamed, new: str, checks: DeckChecks, own: str, codec: PositionCodec
) -> Iterator[tuple[str, list[types.TextEdit]]]:
    open_at: Mapping[str, str] = {
        open_text.identity: open_text.uri for open_text in checks.texts.values() if path_of(open_text.uri)
    }
    for path, edits in done.edits.items():
        text = done.texts[path]
        texts = Texts({path: text}, codec)
        text_edits = [types.TextEdit(_range(texts, path, text, *edit), new) for edit in edits]
        yield own if not path else open_at.get(path, uri_of(path)), text_edits


def _range(texts: Texts, path: str, text: str, offset: int, length: int) -> types.Range:
    line = text.count("\n", 0, offset) + 1
    column = offset - text.rfind("\n", 0, offset)
    return types.Range(texts.position(path, line, column), texts.position(path, line, column + length))
