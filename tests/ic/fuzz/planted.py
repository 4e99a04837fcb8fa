"""Many independent mistakes in one deck: is each told, and nothing else?

A mistake is a word misspelt, a unit left out or of another dimension, an entry left out. Only those are planted that
alone are told once; a dozen and more of them are then planted together, no two on a line, and what is told must be
what each is told alone. `python -m tests.ic.fuzz.planted SEED COUNT` tries many and prints what was hidden and what
was told besides.
"""

from __future__ import annotations

import random
import re
import sys
import tempfile
from collections import Counter
from functools import cache
from pathlib import Path

import ic

UNITS = ("kg", "m", "s", "rad", "deg", "N*m", "Hz", "kHz", "V", "ohm", "mm", "cm", "%", "rpm", "ms")
_NUMBER = r"(?:\d+(?:\.\d+)?(?:e-?\d+)?|\])"
_QUANTITY = re.compile(rf"({_NUMBER})( ?)([A-Za-z%]+(?:[*/^][A-Za-z0-9()*/^]+)*|1/[a-z]+|[a-z]\^-1)(?=\s*[;,)}}\]])")
_WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]{2,}")
_ENTRY = re.compile(r"(?<=[{;] )[A-Za-z_. ]+ = [^;{}]*;|^ +[A-Za-z_.]+ += [^;{}]*;$")

Told = tuple[str, int]
"""The code of an error and its line."""


@cache
def told(text: str, name: str, folder: str) -> tuple[Told, ...]:
    """The errors of a deck with this text, in order; of other files' lines as 0."""
    path = Path(folder) / name
    path.write_text(text, encoding="utf-8")
    found = [each for each in ic.check(path, select="all").diagnostics if each.severity == "error"]
    places = [each.at.place if each.at is not None else None for each in found]
    shown = [place.expansions[-1].use if place is not None and place.expansions else place for place in places]
    lines = [place.line if place is not None and Path(place.file).name == name else 0 for place in shown]
    return tuple(sorted(zip((each.code for each in found), lines, strict=True)))


def mistakes(line: str, rng: random.Random) -> list[str]:
    """The line with one mistake in it, in several ways."""
    code, mark, comment = line.partition("//")
    if not code.strip() or code.lstrip().startswith("#"):
        return []
    found = []
    for match in _WORD.finditer(code):
        word, at = match[0], rng.randrange(1, len(match[0]))
        found.append(code[: match.start()] + word[:at] + word[at + 1 :] + code[match.end() :])
        found.append(code[: match.start()] + word[:at] + "x" + word[at:] + code[match.end() :])
    for match in _QUANTITY.finditer(code):
        found.append(code[: match.end(1)] + code[match.end() :])
        found.append(code[: match.start(3)] + rng.choice(UNITS) + code[match.end() :])
    for match in _ENTRY.finditer(code):
        found.append(code[: match.start()] + code[match.end() :])
    brackets = [code.count(each) for each in "()[]{}"]  # one that is missing hides what stands behind it
    return [each + mark + comment for each in found if [each.count(bracket) for bracket in "()[]{}"] == brackets]


def lone(lines: list[str], name: str, folder: str, rng: random.Random, most: int) -> dict[int, tuple[str, Told]]:
    """By number of line, the line with a mistake that is told once, and what is told."""
    found: dict[int, tuple[str, Told]] = {}
    numbers = [n for n in range(len(lines)) if lines[n].strip() and not lines[n].lstrip().startswith(("//", "#"))]
    for n in rng.sample(numbers, len(numbers)):
        ways = mistakes(lines[n], rng)
        for way in rng.sample(ways, min(2, len(ways))):
            said = told("".join([*lines[:n], way, *lines[n + 1 :]]), name, folder)
            if len(said) == 1:
                found[n] = (way, said[0])
                break
        if len(found) == most:
            break
    return found


def planted(
    text: str, name: str, folder: str, rng: random.Random, count: int
) -> tuple[str, Counter[Told], Counter[Told]]:
    """The deck with mistakes, what each is told alone, and what is told of all of them together."""
    lines = text.splitlines(keepends=True)
    wrong = lone(lines, name, folder, rng, count)
    for n, (way, _) in wrong.items():
        lines[n] = way
    together = "".join(lines)
    return together, Counter(said for _, said in wrong.values()), Counter(told(together, name, folder))


def decks() -> dict[str, str]:
    """Texts of decks by name: those that come with MET, and the one of docs/deck.md. Without the line of their edition:
    a mistake in it is one of the whole text."""
    root = Path(__file__).parents[3]
    texts = {path.name: path.read_text() for path in sorted((root / "ic/decks").glob("*.ic"))}
    page = (root / "docs/deck.md").read_text()
    picker = re.findall(r"<!-- (?:picker\.ic|more) -->\n```c\n(.*?)```", page, re.DOTALL)
    without_files = (each for each in picker if "moves.csv" not in each and "cases.csv" not in each)
    texts = {"picker.ic": "\n".join(without_files), **texts}
    return {name: text.replace("deck 2;\n\n", "", 1) for name, text in texts.items()}


def main(seed: int, count: int) -> None:
    sound, hidden, besides = 0, Counter[str](), Counter[str]()
    for n in range(seed, seed + count):
        rng = random.Random(n)
        with tempfile.TemporaryDirectory() as folder:
            name, text = rng.choice(sorted(decks().items()))
            together, alone, all_told = planted(text, name, folder, rng, rng.randint(12, 20))
            missed, more = alone - all_told, all_told - alone
            sound += not missed and not more
            hidden.update(code for code, _ in missed.elements())
            besides.update(code for code, _ in more.elements())
            if missed or more:
                print(f"{n} {name}: {alone.total()} planted; hidden {sorted(missed)}; besides {sorted(more)}")
                Path(f"/tmp/planted.{n}.ic").write_text(together)
    print(f"{sound} of {count} decks tell all and nothing else; hidden {dict(hidden)}; besides {dict(besides)}")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
