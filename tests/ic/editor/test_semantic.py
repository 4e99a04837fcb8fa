"""Words are coloured by what they mean: as the language declares them, and as the deck defines them."""

from __future__ import annotations

from pathlib import Path

import pytest

from ic.editor.names import NamesInTexts
from ic.editor.semantic import DEFINES, MODIFIERS, TYPES, meanings
from ic.editor.structure import DeckText
from ic.language import BLOCKS
from ic.text.files import LIBRARY
from tests.ic.editor.client import Editor, uri
from tests.ic.editor.test_loops import CHAIN
from tests.ic.editor.test_questions import ARM


def of(text: str) -> dict[tuple[str, int], tuple[str, int]]:
    """The kind and modifiers of each word that means something, by word and offset."""
    deck = DeckText("deck.ic", text)
    return {(token.text, token.offset): (kind, bits) for token, kind, bits in meanings(deck, NamesInTexts([deck]))}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mark", "kind", "bits"),
    [
        ("ROD(NAME", "macro", DEFINES),
        ("NAME, MASS", "parameter", DEFINES),
        ("NAME {", "parameter", 0),
        ("ROD(upper", "macro", 0),
        ("upper, 40", "struct", DEFINES),
        ("mass = MASS", "property", 0),
        ("kg)", "type", 0),
        ("arm two", "keyword", 0),
        ("two {", "struct", DEFINES),
        ("joint shoulder", "keyword", 0),
        ("revolute", "enumMember", 0),
        ("upper;", "struct", 0),
        ("parent", "property", 0),
        ("gearbox like", "class", DEFINES),
        ("like", "keyword", 0),
        ("kp = 0.03", "property", 0),
        ("slow)", "variable", 0),
        ("default", "keyword", 0),
        ("nominal {", "method", DEFINES),
        ("off;", "enumMember", 0),
        ("gearbox.kp", "class", 0),
    ],
)
def test_a_word_has_its_kind(mark: str, kind: str, bits: int) -> None:
    found = of(ARM.replace("servo gearbox like rigid_gearbox {", "servo gearbox like rigid { model = rigid_gearbox;"))
    text = ARM.replace("servo gearbox like rigid_gearbox {", "servo gearbox like rigid { model = rigid_gearbox;")
    at = text.index(mark)
    word = next(name for name, offset in found if offset == at)
    assert found[word, at] == (kind, bits)


def test_a_files_name_is_no_word_of_the_deck() -> None:
    text = '#include <servos/rigid_gearbox.ic>\n#include "two.ic"\nuse <two.ic> as two;\nlet rigid_gearbox = 2 m;\n'
    found = of(text)
    assert {offset for _, offset in found if offset < text.index("as two")} == {text.index("use")}
    assert ("two", text.index("two;")) in found


def test_an_index_of_a_loop_is_a_parameter_of_it() -> None:
    found = of(CHAIN)
    assert found["i", CHAIN.index("i in 0")] == ("parameter", DEFINES)
    assert found["seg_{i}", CHAIN.index("seg_{i} {")] == ("struct", DEFINES)


@pytest.mark.slow
def test_each_key_that_stands_in_a_shipped_deck_is_known() -> None:
    for path in sorted(LIBRARY.glob("*.ic")):
        text = DeckText(path.name, path.read_text())
        known = {token.offset for token, _, _ in meanings(text, NamesInTexts([text]))}
        for entry in text.all_entries():
            block = BLOCKS.get(entry.within.block) if entry.within is not None else None
            if block is not None and entry.head is not None and entry.kind in block.keys:
                assert entry.head.offset in known, (path.name, entry.texts)


@pytest.mark.release
def test_an_editor_is_told_all_words_in_order(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "chain.ic"
    editor.open(deck, CHAIN)
    legend = editor.offered["semanticTokensProvider"]["legend"]
    assert (tuple(legend["tokenTypes"]), tuple(legend["tokenModifiers"])) == (TYPES, MODIFIERS)
    data = editor.ask("textDocument/semanticTokens/full", {"textDocument": {"uri": uri(deck)}})["data"]
    line = column = 0
    lines = CHAIN.split("\n")
    told = []
    for lines_on, on, length, kind, _ in zip(*[iter(data)] * 5, strict=True):
        line, column = line + lines_on, on if lines_on else column + on
        told.append((lines[line][column : column + length], TYPES[kind]))
    assert told == [(word, kind) for (word, _), (kind, _) in of(CHAIN).items()]
