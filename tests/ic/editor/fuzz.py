"""Random edits of shipped decks in the real server: no crash, and in the end what a fresh start says.

python -m tests.ic.editor.fuzz SECONDS [SEED]      edits, and questions at random positions
python -m tests.ic.editor.fuzz --delay DECK N      how long a keystroke takes to diagnostics, N times
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from ic.driver.compile import check
from ic.text.files import LIBRARY
from met.messages.message import shown_place
from tests.ic.editor.client import Editor, uri

PIECES = [
    "{",
    "}",
    ";",
    "(",
    ")",
    '"',
    "#",
    "/*",
    "=",
    ".",
    "5 kg",
    "#if 1\n",
    "#include <",
    "run x like ",
    "é\U0001f9be",
]
QUESTIONS = ("completion", "hover", "definition")


def mutated(text: str, chance: random.Random) -> str:
    """The text with one edit as somebody may make it."""
    at = chance.randrange(len(text) + 1)
    match chance.randrange(4):
        case 0:
            return text[:at] + text[at + chance.choice((1, 1, 1, 5, 40)) :]
        case 1:
            return text[:at] + chance.choice(PIECES) + text[at:]
        case 2:
            first = text.rfind("\n", 0, at) + 1
            last = text.find("\n", at) + 1 or len(text)
            return text[:first] + text[last:]
        case _:
            other = chance.randrange(len(text) + 1)
            return text[:at] + text[other : other + chance.randrange(30)] + text[at:]


def fresh(deck: Path, text: str) -> list[tuple[str, str, int]]:
    """Code, message and line of all that a fresh start finds in the deck's own file."""
    here = Path.cwd()
    import os

    os.chdir(deck.parent)
    try:
        found = check(deck.name, include_dirs=(), defines=(), select="all", unsaved={str(deck.resolve()): text})
    finally:
        os.chdir(here)
    result = []
    for each in found.diagnostics:
        place = shown_place(each.at.place) if each.at is not None else None
        if place is None or place.file == deck.name:
            lines = text.count("\n") + 1
            result.append((each.code, each.message, min(place.line, lines) - 1 if place else 0))
    return sorted(set(result))


def shown(found: list[Any]) -> list[tuple[str, str, int]]:
    return sorted({(each["code"], each["message"], each["range"]["start"]["line"]) for each in found})


def ask_anything(editor: Editor, deck: Path, text: str, chance: random.Random) -> None:
    lines = text.split("\n")
    line = chance.randrange(len(lines))
    editor.about(f"textDocument/{chance.choice(QUESTIONS)}", deck, line, chance.randrange(len(lines[line]) + 1))
    editor.about("textDocument/references", deck, line, 3, context={"includeDeclaration": True})
    document = {"textDocument": {"uri": uri(deck)}}
    editor.ask("textDocument/documentSymbol", document)
    for question in ("foldingRange", "semanticTokens/full", "codeLens"):
        editor.ask(f"textDocument/{question}", document)
    editor.ask("textDocument/formatting", {**document, "options": {"tabSize": 4, "insertSpaces": True}})
    everything = {"start": {"line": 0, "character": 0}, "end": {"line": len(lines), "character": 0}}
    editor.ask("textDocument/codeAction", {**document, "range": everything, "context": {"diagnostics": []}})


def fuzz(seconds: float, seed: int) -> tuple[int, int]:
    """Edit for so long; how many edits were made, and how many states compared with a fresh start's."""
    chance = random.Random(seed)
    edits = compared = 0
    until = time.monotonic() + seconds
    originals = {path.name: path.read_text() for path in sorted(LIBRARY.glob("*.ic"))}
    with tempfile.TemporaryDirectory() as folder, Editor(Path(folder)) as editor:
        while time.monotonic() < until:
            name = chance.choice(list(originals))
            deck, text = Path(folder) / name, originals[name]
            editor.open(deck, text)
            for _ in range(chance.randrange(1, 6)):
                for _ in range(chance.randrange(1, 8)):
                    text = mutated(text, chance)
                    editor.change(deck, text)
                    edits += 1
                    if chance.random() < 0.3:
                        ask_anything(editor, deck, text, chance)
                assert shown(editor.of(deck)) == fresh(deck, text), (seed, edits, name, text)
                compared += 1
                assert not editor.logged, (editor.logged, text)
            editor.close_all()
            assert not any(editor.diagnostics.values())
        assert editor.end() == 0
    return edits, compared


def delays(deck: str, times: int) -> list[float]:
    """Seconds from a keystroke to the diagnostics of it, in order."""
    path = Path(deck) if Path(deck).exists() else LIBRARY / deck
    text = path.read_text()
    found = []
    with tempfile.TemporaryDirectory() as folder, Editor(Path(folder)) as editor:
        copy = Path(folder) / path.name
        editor.open(copy, text)
        editor.settle()
        for n in range(times):
            began = time.monotonic()
            version = editor.change(copy, text + f"// {n}\n")
            while editor.versions.get(uri(copy)) != version:
                editor.next()
            found.append(time.monotonic() - began)
            editor.settle()
    return sorted(found)


if __name__ == "__main__":
    if sys.argv[1] == "--delay":
        every = delays(sys.argv[2], int(sys.argv[3]))
        middle, late = every[len(every) // 2], every[int(0.95 * (len(every) - 1))]
        print(f"{sys.argv[2]}: median {1e3 * middle:.0f} ms, p95 {1e3 * late:.0f} ms of {len(every)}")
    else:
        made, held = fuzz(float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0)
        print(f"{made} edits, {held} states as a fresh start has them")
