"""What a report holds of a comparison with another archive, which is before, and this one now, as plain data."""

from __future__ import annotations

from batch.report.content import Table
from met.frozen import frozen


@frozen
class Made:
    """What made the two and differs: what kind of thing, and what is said of it; lines that are left out."""

    about: str
    lines: tuple[str, ...]
    left: int = 0


@frozen
class EndedCase:
    case: int
    id: str
    cause: str


@frozen
class EndedAlike:
    """Cases that end otherwise than before, alike: how, which, and the first of them with their causes."""

    text: str
    cases: str
    each: tuple[EndedCase, ...]
    left: int


@frozen
class SignalRow:
    """A signal or metric in both, as `batch.differences.words.Compared`."""

    name: str
    word: str
    cases: str
    largest: str
    share: str
    where: str
    first: str
    tolerance: str
    case: int | None


@frozen
class ChangedCase:
    """A case that changed much: what changed most in it, and where; the value before and now; the commands that run it
    again in both."""

    case: int
    id: str
    what: str
    before: str
    now: str
    unit: str
    commands: tuple[str, str]


@frozen
class Compared:
    """A run, or the cases of one structure of a sweep, in both archives.

    heading  name, cases in both, verdict;  word: the verdict alone
    alone    cases that one archive has alone, and what else is to be said;  allowed: the tolerances, by who gives them
    """

    heading: str
    word: str
    alone: tuple[str, ...]
    ended: tuple[EndedAlike, ...]
    notes: tuple[str, ...]
    allowed: tuple[str, ...]
    signals: tuple[SignalRow, ...]
    samples: Table | None
    starred: str
    worst: tuple[ChangedCase, ...]
    left: int


@frozen
class Comparison:
    """What changed against another archive: `before` and `now` are what the two are called, `made` what made them,
    `alone` runs and sweeps that one has alone."""

    before: str
    now: str
    made: tuple[Made, ...]
    alone: tuple[str, ...]
