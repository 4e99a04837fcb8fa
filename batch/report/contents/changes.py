"""The contents of a report about a comparison with an earlier archive, as plain data. Its rows are those of `met diff`,
batch/differences/words.py."""

from __future__ import annotations

from batch.differences.words import Distribution, Ending, SignalRow, WorstCase
from met.frozen import frozen

PARAMETERS = "Parameters and models"
"""The kind of differing origins that are parameters, or models, with other values."""


@frozen
class OtherOrigin:
    """Something that the two archives were made from and that differs, such as a parameter.

    about  what kind of thing;  lines  what is said of it;  left  how many more lines there are
    """

    about: str
    lines: tuple[str, ...]
    left: int = 0


@frozen
class DeckTextChange:
    """A file of the decks that differs.

    summary  how, in words;  lines: a unified difference of its text, without its heads;  left  lines that are not here
    """

    summary: str
    lines: tuple[str, ...]
    left: int = 0


@frozen
class RunChanges:
    """A run, or the cases of one structure of a sweep, in both archives.

    heading  name, cases in both, verdict;  word: the verdict alone
    alone    cases that one archive has alone, and what else is to be said;  allowed: the tolerances, by who gives them
    worst    the cases that changed most;  left: how many more differ
    """

    heading: str
    word: str
    alone: tuple[str, ...]
    endings: tuple[Ending, ...]
    notes: tuple[str, ...]
    allowed: tuple[str, ...]
    signals: tuple[SignalRow, ...]
    samples: tuple[Distribution, ...]
    starred: str
    worst: tuple[WorstCase, ...]
    left: int


@frozen
class ArchiveChanges:
    """The differences from another archive as a whole.

    before   what the other is called, and `now` this one
    origins  what they were made from and that differs, but for the texts of the decks
    decks    files of the decks that differ
    alone    runs and sweeps that one of them has alone
    """

    before: str
    now: str
    origins: tuple[OtherOrigin, ...]
    decks: tuple[DeckTextChange, ...]
    alone: tuple[str, ...]
