"""The lines that an editor shows above runs and sweeps: the number of cases, the time, and the last run's outcome.

The server opens no archive: its caller passes a function that does (`batch.queries.last_run`), which is called when an
editor asks for lenses. Nor does it run anything: a lens names a command for a terminal of the editor's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from lsprotocol import types

from ic.editor.index import DeckIndex
from ic.editor.structure import DeckText, TextEntry
from ic.language import EXPERIMENTS
from met.frozen import frozen

IN_TERMINAL = "met.terminal"
"""The editor's command that runs words in a terminal: its one argument is their list."""


@frozen
class LastRun:
    """The newest archive beside a deck that holds a run or sweep.

    archive       its path;  cases: in it;  seconds: of computing, None where that is not known
    requirements  by their texts: cases that meet it, that miss it, and of which it is not known
    """

    archive: str
    cases: int
    seconds: float | None
    requirements: Mapping[str, tuple[int, int, int]]


FindLastRuns = Callable[[str], Mapping[str, LastRun]]
"""The last run of each run and sweep of the deck at a path, by name."""


RangeOf = Callable[[int, int], types.Range]
"""The range between two offsets of a text."""


def lenses(
    text: DeckText,
    index: DeckIndex,
    path: str | None,
    runs: Mapping[str, LastRun],
    range_of: RangeOf,
) -> Iterator[types.CodeLens]:
    """The lenses of a text. path: of its file, None without one; range_of: the range of an entry."""
    for entry in text.entries:
        name = entry.named.text if entry.named is not None else ""
        if entry.kind not in EXPERIMENTS or not name:
            continue
        where = range_of(entry.words[0].offset, entry.words[-1].end)
        last = runs.get(name)
        title = _title(index.cases.get(name), last)
        if title:
            yield types.CodeLens(where, types.Command(title, ""))
        if path is not None:
            yield types.CodeLens(where, types.Command("run", IN_TERMINAL, arguments=[["run", path, name]]))
            if last is not None:
                for word, names in (("show", []), ("view", [name])):
                    words = [word, last.archive, *names]
                    yield types.CodeLens(where, types.Command(word, IN_TERMINAL, arguments=[words]))
        if last is not None:
            yield from _verdicts(entry, last, range_of)


def _title(cases: int | None, last: LastRun | None) -> str:
    """The words above a run: the number of its cases, and the time that they take by the last run."""
    words = [f"{cases} case" + ("s" if cases != 1 else "")] if cases is not None else []
    if cases is not None and last is not None and last.seconds is not None and last.cases:
        words.append(f"about {_duration(last.seconds * cases / last.cases)}, after the last run")
    return ", ".join(words)


def _duration(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds < 100 else f"{seconds / 60:.3g} min"


def _verdicts(entry: TextEntry, last: LastRun, range_of: RangeOf) -> Iterator[types.CodeLens]:
    """The last run's verdict on each requirement written here."""
    words = {"".join(text.split()): counts for text, counts in last.requirements.items()}
    for inner in entry.entries:
        if inner.kind != "require" or len(inner.words) < 2:
            continue
        source = inner.words[0].source.text
        written = "".join(source[inner.words[1].offset : inner.words[-1].end].split())
        if written in words:
            met, missed, unknown = words[written]
            counts = [f"met by {met} of {met + missed + unknown}"] + ([f"{unknown} not known"] if unknown else [])
            where = range_of(inner.words[0].offset, inner.words[-1].end)
            yield types.CodeLens(where, types.Command(f"last run: {', '.join(counts)}", ""))
