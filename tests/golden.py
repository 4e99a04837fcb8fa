"""All that the commands print and write, before and after a change that must not change it.

    python -m tests.golden FOLDER                       write it: of the decks that come with MET and of random sweeps
    python -m tests.golden FOLDER --against EARLIER     also say what differs from an earlier folder; exit status 1
    --sweeps N    random sweeps over these decks [200]
    --only TEXT   only decks and sweeps with TEXT in their name

Each output is a file, `DECK/COMMAND.out`, with the exit status. Left out is what no two runs share: times of day, how
long something took, and where from (host, commit). A table in a file (CSV, Parquet, JSON, HTML) is kept as it is.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import itertools
import os
import random
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import ic
from ic.find import standard_decks
from ic.printing.models import KINDS
from ic.printing.requests import SUBJECTS
from met import cli
from tests.ic.fuzz.sweeps import Writer

VARYING = (
    (r"\d+(\.\d+)?(e[-+]\d+)? (ns|us|ms|s|min|h) of computing", "SOME TIME of computing"),
    (r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?( ?UTC|Z|\+00:00)?", "DATE"),
    (r"\b[0-9a-f]{40}(-dirty|\+)?", "COMMIT"),
)
"""Patterns of what differs from run to run, and what stands in the output instead."""


def of_a_deck(deck: str, names: list[str], options: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Commands about a deck and its runs or sweeps, in the order in which they are to be carried out, by name."""
    yield "check", ["check", deck]
    yield "check-json", ["check", deck, "--format", "json"]
    for name in names:
        about = [deck, name, *options]
        yield f"{name}-plan", ["plan", *about]
        yield f"{name}-plan-json", ["plan", *about, "--format", "json"]
        yield f"{name}-cases", ["cases", *about]
        yield f"{name}-explain", ["explain", *about]
        archive = f"{name}.h5"
        yield f"{name}-run", ["run", *about, "-o", archive, "--fresh", "--no-picture", "--threads", "1"]
        yield f"{name}-show", ["show", archive]
        yield f"{name}-show-rows", ["show", archive, "--all-cases", "--evidence"]
        yield f"{name}-show-json", ["show", archive, "--format", "json"]
        yield f"{name}-report", ["report", archive, "-o", f"{name}.html", "--no-simulation"]
        yield f"{name}-metrics", ["export", archive, "-o", f"{name}.csv", "--metrics", "--units", "deck", "--force"]
        yield f"{name}-evidence", ["export", archive, "-o", f"{name}.evidence.csv", "--evidence", "--force"]
        yield f"{name}-parquet", ["export", archive, "-o", f"{name}.parquet", "--metrics", "--force"]
        yield f"{name}-best", ["best", archive]
        yield f"{name}-best-json", ["best", archive, "--format", "json"]
        yield f"{name}-sensitivity", ["sensitivity", archive]
        yield f"{name}-diff", ["diff", archive, archive, "--all"]
    for earlier, later in itertools.pairwise(names):
        yield f"{later}-diff-{earlier}", ["diff", f"{earlier}.h5", f"{later}.h5"]


def write(folder: Path, sweeps: int, only: str) -> None:
    """Write the outputs into a folder for each deck."""
    decks = tuple(standard_decks())
    for deck in decks:
        if only not in deck:
            continue
        compiled = ic.check(deck, select="all")
        names = [each.name for each in compiled.plan.experiments] if compiled.plan else []
        carry_out(folder / deck.removesuffix(".ic"), of_a_deck(deck, names, []))
    for number in range(sweeps):
        place = folder / f"sweep_{number:03}"
        if only not in place.name:
            continue
        place.mkdir(parents=True, exist_ok=True)
        writer = Writer(random.Random(number), place, rough=0.03, decks=decks)
        (place / "deck.ic").write_text(writer.text(), encoding="utf-8")
        options = [word for each in writer.options for word in ("--vary", each)]
        carry_out(place, of_a_deck("deck.ic", list(writer.names), options))
    if only in "doc":
        subjects = [(name, ["doc", name]) for name in (*SUBJECTS, *KINDS)]
        programs = ("language-json", ["doc", "language", "--format", "json"])
        others = [("doc", ["doc"]), ("help", ["--help"]), programs]
        carry_out(folder / "doc", [*others, *subjects])


def carry_out(place: Path, commands: Iterator[tuple[str, list[str]]] | list[tuple[str, list[str]]]) -> None:
    """Carry out commands in a folder, and write what each prints."""
    place.mkdir(parents=True, exist_ok=True)
    before = Path.cwd()
    os.chdir(place)
    try:
        for name, words in commands:
            print(f"{place.name}: met {' '.join(words)}", file=sys.stderr)
            with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as errors:
                status = cli.main(words)
            text = f"$ met {' '.join(words)}\n{out.getvalue()}--\n{errors.getvalue()}exit status {status}\n"
            for pattern, instead in VARYING:
                text = re.sub(pattern, instead, text)
            Path(f"{name}.out").write_text(text, encoding="utf-8")
    finally:
        os.chdir(before)


def differences(now: Path, earlier: Path) -> Iterator[str]:
    """What differs between two folders, a line each: the file, and the first line in which it does."""
    endings = {".out", ".csv", ".parquet", ".html", ".json"}
    names = {
        path.relative_to(folder)
        for folder in (now, earlier)
        for path in folder.rglob("*")
        if path.suffix in endings
        and not path.name.endswith(".run.json")
    }  # fmt: skip
    for name in sorted(names):
        texts = [(folder / name).read_bytes() if (folder / name).exists() else None for folder in (earlier, now)]
        if texts[0] == texts[1]:
            continue
        if None in texts:
            yield f"{name}: {'new' if texts[0] is None else 'missing'}"
            continue
        old, new = ((text or b"").decode(errors="replace").splitlines() for text in texts)
        row = next((row for row, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), min(len(old), len(new)))
        shown = [lines[row][:120] if row < len(lines) else "(ends)" for lines in (old, new)]
        yield f"{name}:{row + 1}\n    - {shown[0]}\n    + {shown[1]}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--sweeps", type=int, default=200)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    write(given.folder.resolve(), given.sweeps, given.only)
    if given.against is None:
        return 0
    found = list(differences(given.folder, given.against))
    print("\n".join(found) if found else "nothing differs")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
