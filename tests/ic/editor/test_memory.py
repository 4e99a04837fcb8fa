"""The server keeps nothing of what an editor has said and is dealt with."""

from __future__ import annotations

import asyncio
import gc
from collections import Counter
from collections.abc import AsyncIterator
from concurrent.futures import Future
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from lsprotocol import types
from pygls.workspace import Workspace

from ic.editor.checks import OpenText
from ic.editor.server import DeckServer, make
from ic.editor.structure import DeckText
from ic.text.files import LIBRARY

DECK = (LIBRARY / "two_link.ic").read_text()
URI = "file:///nowhere/deck.ic"


def change(server: DeckServer, version: int) -> None:
    """A change of the text, as the editor tells it."""
    whole = types.TextDocumentContentChangeWholeDocument(f"// {version}\n")
    changed = types.DidChangeTextDocumentParams(types.VersionedTextDocumentIdentifier(version, URI), [whole])
    server.protocol._handle_notification(types.TEXT_DOCUMENT_DID_CHANGE, changed)


def futures() -> int:
    return sum(issubclass(type(each), Future) for each in gc.get_objects())


@pytest.mark.slow
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


@asynccontextmanager
async def checking() -> AsyncIterator[DeckServer]:
    """A server without an editor, with its process that checks."""
    server = make()
    server.protocol._workspace = Workspace(None)
    server.protocol.set_writer(type("Nowhere", (), {"write": lambda self, data: None})())
    server.process.start()
    worker = asyncio.create_task(server.checks.work())
    try:
        yield server
    finally:
        worker.cancel()
        server.end()


async def edit(server: DeckServer, uri: str, edits: range) -> tuple[Counter[str], int]:
    """Change a deck and ask about it, each time once it is checked; the objects of MET's classes that there are in the
    end, and how many others."""
    for n in edits:
        server.checks.change(OpenText(uri, f"{DECK}let spare_{n} = {n} kg;\n", n))
        while server.checks.checked[uri].deck.version != n:
            await asyncio.sleep(0.001)
        assert "gearbox" in server.in_text(uri).names.by_name
    await server.checks.rest()
    gc.collect()
    classes = [type(each) for each in gc.get_objects()]
    ours = Counter(each.__qualname__ for each in classes if str(each.__module__).startswith(("ic.", "met.")))
    return ours, len(classes) - ours.total()


def structures() -> int:
    return sum(type(each) is DeckText for each in gc.get_objects())


@pytest.mark.release
def test_memory_does_not_grow_with_the_number_of_edits(tmp_path: Path) -> None:
    uri = (tmp_path / "arm.ic").as_uri()

    async def objects() -> tuple[tuple[Counter[str], int], tuple[Counter[str], int]]:
        async with checking() as server:
            server.checks.open(OpenText(uri, DECK, 0))
            await server.checks.rest()
            before, after = await edit(server, uri, range(1, 11)), await edit(server, uri, range(11, 21))
            assert structures() == len(server.checks.checked[uri].reply.sources)
            server.checks.shut(uri)
            gc.collect()
            assert structures() == 0, "of what is closed nothing is kept"
            return before, after

    (ours, others), (ours_later, others_later) = asyncio.run(objects())
    assert ours_later == ours and ours["Token"] > 100
    assert others_later - others < 100, "some are the interpreter's; each of these ten texts has hundreds of lists"
