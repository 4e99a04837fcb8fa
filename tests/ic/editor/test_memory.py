"""The server keeps nothing of what an editor has said and is dealt with."""

from __future__ import annotations

import gc
from concurrent.futures import Future

from lsprotocol import types
from pygls.workspace import Workspace

from ic.editor.server import DeckServer, make

URI = "file:///nowhere/deck.ic"


def change(server: DeckServer, version: int) -> None:
    """A change of the text, as the editor tells it."""
    whole = types.TextDocumentContentChangeWholeDocument(f"// {version}\n")
    changed = types.DidChangeTextDocumentParams(types.VersionedTextDocumentIdentifier(version, URI), [whole])
    server.protocol._handle_notification(types.TEXT_DOCUMENT_DID_CHANGE, changed)


def futures() -> int:
    return sum(issubclass(type(each), Future) for each in gc.get_objects())


def test_of_a_thousand_changes_of_a_text_none_is_kept() -> None:
    server = make()
    server.protocol._workspace = Workspace(None)
    item = types.TextDocumentItem(URI, "met", 0, "")
    server.protocol._handle_notification(types.TEXT_DOCUMENT_DID_OPEN, types.DidOpenTextDocumentParams(item))
    change(server, 1)
    before = futures()
    for version in range(2, 1002):
        change(server, version)
    assert server.checks.texts[URI].text == "// 1001\n"
    assert futures() <= before
