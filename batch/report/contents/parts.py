"""The contents of a report as plain data: texts and numbers, without HTML. Values are in the deck's units.

A report has a section for each run or sweep that is asked for. A sweep of several structures is one section: its cases
are numbered through, and what decides the structure is a column of words.
"""

from __future__ import annotations

import numpy as np

from batch.queries.colours import Reach
from batch.queries.evidence_table import EvidenceTexts
from batch.queries.pool import CaseColumn
from batch.queries.summary import MetricSpread
from batch.report.contents.changes import ArchiveChanges, RunChanges
from batch.report.contents.simulated import PageSimulation
from met.frozen import frozen


@frozen
class Fact:
    """Something about what was run: its name and its value; `code`: to be set as a program's text."""

    name: str
    text: str
    code: bool = False


@frozen
class Spot:
    """A line of a deck file: where a value was written. `file` as `Source.name`."""

    file: str
    line: int


# The verdict


@frozen
class OutcomeCount:
    """The number of cases that came out in one way."""

    word: str
    count: int


@frozen
class RequirementCounts:
    """A requirement: by how many of the cases it is met and missed, of how many that is not known, and the value that
    is furthest beyond the limit, or nearest to it, with its case.

    verdict  of one over a share of cases: its worst of all design points, such as "not shown"; "" of one that every
             case is to meet; of one in the cases of a search's answer, how it came out in words
    ok       of the latter alone: it is met
    bound    of one over a share of cases at one design point: on the share of all cases, in words; "" without one
    """

    text: str
    met: int
    missed: int
    unknown: int
    cases: int
    furthest: str = ""
    case: int | None = None
    verdict: str = ""
    ok: bool = True
    bound: str = ""


@frozen
class FailureRow:
    """Cases that failed alike: how they ended, why, how many, which, and the first."""

    status: str
    cause: str
    count: int
    cases: str
    first: int


@frozen
class MetricMove:
    """Cases in which a required metric went one way, away from its limit or towards it, by more than is allowed: how
    many they are, and of the one that went furthest its number and the value before and now, in `unit`."""

    cases: int
    case: int
    before: str
    now: str
    unit: str


@frozen
class RequirementFlow:
    """A requirement in two archives, or that a case reaches its end: by how many of the cases in both it is met, in
    words, and which of these it is met in now, or missed now, and was not before.

    better, worse  cases whose metric is further on the good side of the limit, or less far; None where there is none
    """

    text: str
    met: str
    gained: str
    lost: str
    better: MetricMove | None = None
    worse: MetricMove | None = None


@frozen
class ReportWarning:
    """A warning that makes an answer doubtful: its message, its remedies, and the line of the deck that it is about."""

    code: str
    message: str
    help: tuple[str, ...]
    spot: Spot | None = None


@frozen
class Verdict:
    """An answer: yes or no, in one sentence, and what it rests on.

    kind    what was asked: "requirements"; "answer", the same of a search, whose other cases an optimiser chose;
            "comparison", with another archive
    about   the run or sweep, or the other archive
    parts   how the cases came out; they add up to all of them
    word    of a comparison: "identical", "equivalent", "different" or "incomparable"; of an answer: what it comes to
    figure  of a comparison: cases with nothing against them, before and now, of how many in both
    ends    of a comparison: cases that reach their end now and did not, and the reverse; None where all do as before
    """

    kind: str
    about: str
    ok: bool
    headline: str
    parts: tuple[OutcomeCount, ...]
    demands: tuple[RequirementCounts, ...] = ()
    failing: tuple[FailureRow, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[ReportWarning, ...] = ()
    word: str = ""
    figure: tuple[int, int, int] | None = None
    flows: tuple[RequirementFlow, ...] = ()
    ends: RequirementFlow | None = None

    @property
    def cases(self) -> int:
        return sum(part.count for part in self.parts)

    @property
    def good(self) -> int:
        """Cases with nothing against them."""
        return sum(part.count for part in self.parts if part.word in ("met", "done"))


# Tables


@frozen
class VariedParameter:
    """A parameter that differs between cases, or a choice: its values in words, and where the deck says so."""

    path: str
    text: str
    unit: str
    spot: Spot | None = None
    sets: tuple[str, ...] = ()


@frozen
class MetricRow:
    """A metric over the cases: spread, histogram of the finite values, limits in the histogram's range.

    spread  in `unit`, as a deck writes it
    remark  how many values are infinite or missing
    bars    counts of equal stretches from `low` to `high`; none where there are too few values to show a shape
    limits  of requirements, in the metric's unit
    by_step the error by the step, in `unit`; "" where the run was not verified
    before  the median of the other archive's cases, where one is compared with, and `bars_before` their counts
    """

    name: str
    about: str
    unit: str
    spread: MetricSpread
    remark: str
    bars: tuple[int, ...] = ()
    low: float = 0.0
    high: float = 0.0
    limits: tuple[float, ...] = ()
    by_step: str = ""
    before: str = ""
    bars_before: tuple[int, ...] = ()


@frozen
class TextTable:
    """A table of texts. right: the columns that are set flush right; marked: (row, column) that miss a requirement."""

    heads: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    right: frozenset[int] = frozenset()
    marked: frozenset[tuple[int, int]] = frozenset()


@frozen
class NotableCases:
    """The best cases, or the worst: a table whose rows are these cases, the command that runs each again, and what is
    said of more of them."""

    title: str
    table: TextTable
    cases: tuple[int, ...]
    commands: tuple[str, ...]
    more: str = ""


@frozen
class EvidenceLine:
    """A row of the table of evidence: a requirement at a design point, whether it is met, the number of its worst case
    and what runs that again, and its numbers as texts."""

    requirement: str
    condition: str
    ok: bool
    case: int | None
    command: str
    texts: EvidenceTexts


@frozen
class EvidencePart:
    """The table of evidence of a section, and sentences beneath it."""

    rows: tuple[EvidenceLine, ...]
    notes: tuple[str, ...]


@frozen
class InfluenceRow:
    """A varied parameter that explains a metric: its shares of the variance, alone and with others, the metric's mean
    where it is lowest and highest, as numbers in the deck's unit and as a text, and the correlation of the ranks."""

    path: str
    alone: str
    together: str
    low: float
    high: float
    ends: str
    rank: str


@frozen
class InfluencePart:
    """The parameters that explain a metric, those that explain most first; none where nothing can be told, as is said.

    metric  "" where it is said of all;  mean: of the metric, in the deck's unit
    """

    metric: str
    summary: str
    mean: float
    rows: tuple[InfluenceRow, ...]
    notes: tuple[str, ...]


@frozen
class ParameterRow:
    """A resolved parameter: value, unit, where it comes from. among: the structures that have it so, where not all."""

    path: str
    value: str
    unit: str
    origin: str
    spot: Spot | None = None
    overrides: tuple[Spot, ...] = ()
    among: tuple[str, ...] = ()


@frozen
class DesignMap:
    """Two parameters that are chosen, and which designs meet all requirements, all else as in the best.

    x_texts, y_texts  the values along each side
    steps   (y, x): cells to the border; 0 of a design that is not good, -1 where there is none
    best    place of the best: (y, x)
    """

    x: str
    y: str
    x_unit: str
    y_unit: str
    x_texts: tuple[str, ...]
    y_texts: tuple[str, ...]
    steps: np.ndarray
    best: tuple[int, int]


@frozen
class DesignAnswer:
    """The design to use, as `met best` says it.

    headline, why     which it is, and what it has for it, in lines;  table: it and others
    stretches         how far each parameter may go
    purpose, command  how to run it or confirm it;  map: None where no two parameters with an order are chosen
    title, about      what the table is called, and what its numbers are
    heading, link     over all of it, and in the page's menu;  chooses: False where it is the worst case of a search
    case              number of the design's worst case; None where no design is advised
    progress          of a search: the cases after each look at it, the best value by then, and the cases of a sweep
                      that this was tried with; none of what is none
    """

    headline: str
    why: str
    table: TextTable
    stretches: TextTable | None
    purpose: str
    command: str
    notes: tuple[str, ...]
    map: DesignMap | None
    title: str = "Designs"
    about: str = "Each number is that of the worst case of a design."
    heading: str = "Which design to use"
    link: str = "Which design"
    chooses: bool = True
    progress: tuple[tuple[int, float, int], ...] = ()
    case: int | None = None


# Plots


@frozen
class Ruler:
    """A side of a map: where the cells end on it, from 0 to 1, and what may be written there.

    edges  one more than cells
    ticks  of several choices, the densest first, each (where, text)
    """

    edges: tuple[float, ...]
    ticks: tuple[tuple[tuple[float, str], ...], ...]


@frozen
class Map:
    """Two parameters that make a grid, and of each metric what its cells hold.

    x_levels, y_levels   values, or stretches of them where there are many
    x_ruler, y_ruler     where these lie in a drawing
    values   by metric's key: (y, x), the worst case of the cell by the metric's first limit, or its middle one
    cases    by metric's key: (y, x), which case that is; -1 where there is none
    counts   (y, x): cases in the cell
    missed   by metric's key: (y, x), cases of the cell that miss a requirement of this metric
    failed   (y, x): cases of the cell that did not reach their end
    reaches  by metric's key: how far its colours reach; None where no cell has a number
    """

    x: str
    y: str
    x_levels: tuple[str, ...]
    y_levels: tuple[str, ...]
    counts: np.ndarray
    values: dict[str, np.ndarray]
    cases: dict[str, np.ndarray]
    missed: dict[str, np.ndarray]
    failed: np.ndarray
    reaches: dict[str, Reach | None]
    x_ruler: Ruler
    y_ruler: Ruler


@frozen
class Overview:
    """The cases as points. Not all of many: those left out lie on a dot with one that is here.

    cases, ids   number in the case table, and first letters of the id, of each point
    ended        how it came out: place in `pool.ENDED`
    causes       by place among the points: why a case failed; of the first ones
    start        keys of what is drawn first: against, metric, colour ("" for none)
    """

    cases: np.ndarray
    ids: tuple[str, ...]
    ended: np.ndarray
    columns: tuple[CaseColumn, ...]
    causes: dict[int, str]
    total: int
    start: tuple[str, str, str]
    maps: tuple[Map, ...] = ()
    note: str = ""


@frozen
class PanelLine:
    """One line of a panel: its label, its joint, and whether it is the command that the line should follow."""

    label: str
    joint: str
    command: bool = False


@frozen
class SignalPanel:
    """Lines that share an axis: of one signal in one unit, of which one is `scale` SI units."""

    name: str
    about: str
    unit: str
    lines: tuple[PanelLine, ...]
    scale: float = 1.0


@frozen
class History:
    """The recorded signals of a case: for each panel (by place in `Signals.panels`) its lines, (time, line), at the
    times numbered `clock`.

    before, change  what the other archive has of it, where one is compared with, and this less that
    """

    case: int
    clock: int
    values: dict[int, np.ndarray]
    before: History | None = None
    change: History | None = None


@frozen
class Signals:
    """Recorded signals of the worst cases, worst first.

    clocks       the times of histories, s
    first_cases  cases that are drawn first
    most         cases that differ most from the other archive, where one is compared with;  worst  the worst of all
    middle       the case in the middle of the order, to compare the worst with; None where there are few
    notes        what was left out, and how lines were thinned
    opens        case that the arm begins with: that of the design to use, else the middle one; None: the first of
                 `first_cases`
    sources      of each structure, by its place in the pool, the channel of each line of each panel; "" where it has
                 none
    """

    panels: tuple[SignalPanel, ...]
    joints: tuple[str, ...]
    clocks: tuple[np.ndarray, ...]
    histories: tuple[History, ...]
    first_cases: tuple[int, ...]
    middle: int | None = None
    notes: tuple[str, ...] = ()
    most: tuple[int, ...] = ()
    worst: int | None = None
    opens: int | None = None
    sources: tuple[tuple[tuple[str, ...], ...], ...] = ()


@frozen
class BedStability:
    """A joint whose motor is on a bed: how heavy the arm is against the rotor, r, and how heavy it might be.

    r         of each case, the heaviest motion of all substituted joints together
    lower     of each case, the r from which the loop is stable; not a number where it is at any that is smaller
    limit     of each case, the r up to which it is stable; not a number where no limit was found, 0 where it is nowhere
    unstable  whether each case is
    """

    joint: str
    law: str
    servo: str
    delay: str
    r: np.ndarray
    lower: np.ndarray
    limit: np.ndarray
    unstable: np.ndarray
    spread: str
    stable_at: str
    margin: str
    ok: bool


@frozen
class Stability:
    """The stability of the motor beds in some cases.

    columns  what r may be drawn against
    spans    whether one is unstable where the arm is too light, so that the beds' `stable_at` have two ends
    """

    cases: np.ndarray
    columns: tuple[CaseColumn, ...]
    beds: tuple[BedStability, ...]
    unstable: tuple[str, ...]
    spans: bool = False
    note: str = ""


# The whole


@frozen
class SourceListing:
    """A file of the deck. text: the beginning of it, where it is long; `left`: lines that are not here."""

    name: str
    text: str
    sha256: str
    left: int = 0


@frozen
class ReportSection:
    """A run or sweep.

    name        as it is asked for;  lede  what it is, in a sentence
    evidence    what the cases show of each requirement;  None where nothing is required
    simulation  by which the page runs cases again;  None where it cannot, or was not to
    designs     which design of a sweep to use;  None where it chooses none, or requires nothing
    changes     against another archive, a structure each;  what one of them lacks is in `ArchiveChanges.alone`
    trouble     why parameters and stability are missing; "" where they are not
    by_step     what the errors of metrics by the step rest on; "" where none was verified
    influences  of the varied parameters on each metric;  none where that is not asked: one parameter, or few cases
    """

    name: str
    lede: str
    facts: tuple[Fact, ...]
    varied: tuple[VariedParameter, ...]
    metrics: tuple[MetricRow, ...]
    evidence: EvidencePart | None
    designs: DesignAnswer | None
    structures: TextTable | None
    best: NotableCases | None
    worst: NotableCases | None
    overview: Overview | None
    signals: Signals | None
    no_signals: str
    simulation: PageSimulation | None
    stability: Stability | None
    parameters: tuple[ParameterRow, ...]
    trouble: str = ""
    notes: tuple[str, ...] = ()
    single: bool = False
    changes: tuple[RunChanges, ...] = ()
    by_step: str = ""
    influences: tuple[InfluencePart, ...] = ()


@frozen
class Report:
    """All of a page. verdicts: one a section, in their order; of other kinds, such as a comparison, after them.
    again: the commands that run this archive again, and the one it is compared with."""

    title: str
    archive: str
    deck: str
    replay: str
    again: tuple[str, ...]
    verdicts: tuple[Verdict, ...]
    sections: tuple[ReportSection, ...]
    sources: tuple[SourceListing, ...]
    provenance: tuple[Fact, ...]
    changes: ArchiveChanges | None = None

    @property
    def chosen_design(self) -> DesignAnswer | None:
        """The design to use, with which a page begins: that of a report on one sweep or tuning that chooses."""
        if len(self.sections) != 1 or self.changes is not None:
            return None
        answer = self.sections[0].designs
        return answer if answer is not None and answer.chooses else None
