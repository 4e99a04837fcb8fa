"""Results of a comparison of two archives: for signals, cases, experiments, and the whole."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from batch.differences.compare import DIFFERENT, EQUIVALENT, IDENTICAL, INCOMPARABLE, VERDICTS
from batch.differences.matching import MatchedCases
from batch.differences.provenance import ProvenanceChanges
from batch.differences.samples import MetricSamples
from batch.differences.tolerance import SignalTolerance, Tolerances
from batch.queries.evidence_table import RequirementEvidence
from met.frozen import frozen


@frozen
class DiffPlace:
    """The place of the largest difference of one signal or metric: position of the case, label of the joint or
    component, time (s), and both values."""

    case: int
    label: str
    time: float
    before: float
    after: float


@dataclass
class SignalDiff:
    """One signal, or metric, over all matched cases.

    verdict     of compare.VERDICTS;  why: of what is incomparable
    by_joint    what is allowed of single joints, in the stead of tolerance.absolute
    as_written  the same and tolerance.absolute as they were written: by joint, "" for the whole
    deck_unit   in which people read it, typeset; shown = SI value / deck_scale
    compared    cases that both have;  identical, equivalent, different: of these
    largest     the largest |b - a|, of what is beyond its tolerance where anything is;  place: where they differ most
    rms         of all finite differences;  span: of the values of a
    first       s, the earliest time of a difference, in whichever case; first_beyond: by more than is allowed
    used        the largest share of the tolerance that was needed
    nan         values that are not-a-number in one archive alone
    higher      of a metric, cases in which b has the larger value;  lower: the smaller
    chance      the probability of pairs as one-sided by chance, corrected; not a number where it was not tested
    by_step     of a metric, the sum of both archives' errors by the step; not a number where neither was verified
    """

    name: str
    unit: str
    metric: bool
    tolerance: SignalTolerance
    by_joint: dict[str, float] = field(default_factory=dict)
    as_written: dict[str, str] = field(default_factory=dict)
    deck_unit: str = ""
    deck_scale: float = 1.0
    compared: int = 0
    identical: int = 0
    equivalent: int = 0
    different: int = 0
    largest: float = 0.0
    place: DiffPlace | None = None
    first: float = float("inf")
    first_beyond: float = float("inf")
    used: float = 0.0
    nan: int = 0
    higher: int = 0
    lower: int = 0
    chance: float = float("nan")
    why: str = ""
    low: float = float("inf")
    high: float = float("-inf")
    most: float = 0.0
    beyond: bool = False
    by_step: float = float("nan")
    squares: float = 0.0
    values: int = 0

    @property
    def verdict(self) -> str:
        if self.why:
            return INCOMPARABLE
        return DIFFERENT if self.different else EQUIVALENT if self.equivalent else IDENTICAL

    @property
    def within_step_error(self) -> bool:
        """True if there are differences, all finite, and the errors by the step are as large."""
        return not self.why and not self.nan and 0.0 < self.largest <= self.by_step

    @property
    def rms(self) -> float:
        return (self.squares / self.values) ** 0.5 if self.values else 0.0

    @property
    def share(self) -> float:
        """The largest difference as a share of the span of a's values."""
        span = self.high - self.low
        return self.largest / span if span > 0.0 else float("inf") if self.largest else 0.0


@frozen
class EndingDiff:
    """A case with another ending: position in the case table, id, status, cause and rows in a and b."""

    case: int
    case_id: str
    before: int
    after: int
    cause_before: str
    cause_after: str
    rows_before: int
    rows_after: int


@frozen
class RankedCase:
    """One of the worst cases: positions in both case tables, id in b, the signal that differs most, by which share of
    its span (or of its tolerance, where one is given), and where."""

    case_a: int
    case_b: int
    case_id: str
    signal: str
    score: float
    place: DiffPlace
    difference: float
    deck_unit: str = ""
    deck_scale: float = 1.0


@frozen
class RequirementDiff:
    """A requirement of both archives.

    before, now          its text in a and in b
    met_before, met_now  how many matched cases meet it
    gained, lost         how many meet it in b alone, and in a alone
    other                whether its limit or its comparison is another
    limits               its limits in a and in b, where they differ and the text does not; else ""
    chance               the probability of pairs as one-sided by chance, corrected; not a number where not tested
    """

    before: str
    now: str
    met_before: int
    met_now: int
    gained: int = 0
    lost: int = 0
    other: bool = False
    limits: tuple[str, str] = ("", "")
    chance: float = float("nan")

    @property
    def has_changed(self) -> bool:
        """True if the requirement has changed, or is met by another number of cases."""
        return self.other or self.before != self.now or self.met_before != self.met_now


@frozen
class EvidenceDiff:
    """The rows of one requirement at one design point in the tables of evidence of a and of b, whose cases are all of
    each archive; a limit that was changed is taken for the same requirement."""

    before: RequirementEvidence
    now: RequirementEvidence


@dataclass
class ExperimentDiff:
    """Two matched experiments. tolerances: what the deck of b and the command line allow; partial: whether one has
    instants or histories that the other lacks, or something that is counted differs, so that they are not identical;
    required_in_one: requirements that one archive has alone, in words; last_digits: that cases are unmatched because
    of last digits of what is varied, in words."""

    name_a: str
    name_b: str
    cases: MatchedCases
    tolerances: Tolerances = field(default_factory=Tolerances)
    signals: list[SignalDiff] = field(default_factory=list)
    partial: bool = False
    ended: list[EndingDiff] = field(default_factory=list)
    requirements: list[RequirementDiff] = field(default_factory=list)
    evidence: list[EvidenceDiff] = field(default_factory=list)
    required_in_one: list[str] = field(default_factory=list)
    worst: list[RankedCase] = field(default_factory=list)
    samples: list[MetricSamples] = field(default_factory=list)
    only_a: list[int] = field(default_factory=list)
    only_b: list[int] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    last_digits: str = ""
    cases_different: int = 0
    how: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int8))

    @property
    def other_requirements(self) -> bool:
        """True if the two have different requirements."""
        return bool(self.required_in_one) or any(requirement.other for requirement in self.requirements)

    @property
    def verdict(self) -> str:
        return DIFFERENT if self.other_requirements else self.of_values

    @property
    def of_values(self) -> str:
        """The verdict on cases, their endings and values, without requirements."""
        verdicts = [signal.verdict for signal in self.signals]
        if self.ended or self.only_a or self.only_b:
            verdicts.append(DIFFERENT)
        if not any(signal.compared for signal in self.signals):
            verdicts.append(INCOMPARABLE)
        worst = max(verdicts, key=VERDICTS.index)
        if worst == IDENTICAL and self.partial:
            return EQUIVALENT
        return DIFFERENT if worst == INCOMPARABLE and DIFFERENT in verdicts else worst


@frozen
class Diff:
    """The difference of two archives. tolerances: of the command line; only_a, only_b: experiments that one has
    alone."""

    a: Path
    b: Path
    tolerances: Tolerances
    changed: ProvenanceChanges
    experiments: tuple[ExperimentDiff, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """identical, equivalent, different or incomparable: the worst of all, but different where anything differs."""
        other = any(experiment.other_requirements for experiment in self.experiments)
        return DIFFERENT if other else self.of_values

    @property
    def of_values(self) -> str:
        """The verdict on everything but requirements."""
        verdicts = [experiment.of_values for experiment in self.experiments]
        if not verdicts:
            return INCOMPARABLE
        if DIFFERENT in verdicts or self.only_a or self.only_b:
            return DIFFERENT
        return max(verdicts, key=VERDICTS.index)
