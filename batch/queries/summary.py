"""The outcomes of an archive's cases in numbers: the verdict that `met run` prints and `met show` repeats."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.archive.stored import Stored
from batch.archive.summarised import DOUBTFUL, CaseSummary
from batch.queries.answer_outcome import AnswerOutcome, answer_outcome
from batch.queries.at_limits import LimitSummary, limit_summaries
from batch.queries.evidence import EvidenceRow, evidence
from batch.queries.pool import STATUS, FailureGroup, failures
from batch.queries.requirements import requirement_texts
from batch.queries.search_answers import SearchAnswer
from batch.queries.signals import number_text
from batch.queries.step_errors import figures
from batch.queries.step_errors.figures import StepErrorVerdict, Verification, verdicts
from batch.queries.tallies import summed_up
from batch.queries.warnings import warnings
from met.diagnostic import Diagnostic
from met.frozen import frozen
from met.plan.columns import blocks


@frozen
class MetricSpread:
    """Smallest, median and largest of the values that are finite, not-a-number where none is; how many are not.

    infinite  such as a settling time that never comes;  unknown  not a number
    """

    minimum: float
    median: float
    maximum: float
    infinite: int
    unknown: int


@frozen
class SpreadColumn:
    """A column of the table of metrics: a number of `MetricSpread`, with its heads in `met show` and in a report."""

    field: str
    head: str
    page_head: str


SUMMED_COLUMNS = (
    SpreadColumn("minimum", "min", "smallest"),
    SpreadColumn("mean", "mean", "mean"),
    SpreadColumn("maximum", "max", "largest"),
    SpreadColumn("deviation", "sigma", "standard deviation"),
)
"""The columns of the table of metrics for `SummedMetric`, where an archive keeps a summary."""

SPREAD_COLUMNS = (
    SpreadColumn("minimum", "min", "smallest"),
    SpreadColumn("median", "median", "median"),
    SpreadColumn("maximum", "max", "largest"),
)


@frozen
class MetricSummary(MetricSpread):
    """A metric over cases: its spread in SI.

    deck_unit   the unit its requirement is written in, else that of its values; shown = value / deck_scale
    """

    name: str
    unit: str
    about: str
    deck_unit: str = ""
    deck_scale: float = 1.0


@frozen
class SummedMetric(MetricSummary):
    """A metric of which an archive keeps a summary: the mean and the standard deviation of its finite values, SI, in
    place of the median, and the positions in the case table of the smallest and the largest."""

    mean: float = np.nan
    deviation: float = np.nan
    least_case: int = -1
    most_case: int = -1


@frozen
class RequirementSummary:
    """The numbers of cases that meet a requirement, miss it, and leave it open.

    unknown  because they failed, or because the metric has no value;  no_value  of these, the latter
    evidence of one over a share of cases, at each design point; empty of one that every case is to meet
    """

    text: str
    met: int
    missed: int
    unknown: int
    no_value: int
    evidence: tuple[EvidenceRow, ...] = ()

    @property
    def ok(self) -> bool:
        """True if every case meets it, or, for one over a share of cases, if every design point does."""
        return all(row.ok for row in self.evidence) if self.evidence else not self.missed and not self.unknown


@frozen
class AnsweredRequirement(RequirementSummary):
    """A requirement of a search, in the cases of its answer.

    said  how it came out, in words;  elsewhere: a case that a search tried besides its answer misses it
    """

    said: str = ""
    elsewhere: bool = False

    @property
    def ok(self) -> bool:
        """True if all cases of the answer meet it, and all that a search tried."""
        return not self.missed and not self.unknown and not self.elsewhere


@frozen
class Summary:
    """One experiment's outcome.

    failures  all of them, by cause
    sweep     of which this is a group; "" where it is the whole of its run or sweep
    limited   cases in which the load motor of a bed was at its limit at some tick
    verified  how true the metrics are, by the names of their variables; None where that is not known
    step_errors  what is required of errors by the step; of a case alone, nothing
    warnings  of what that, or a limit of a machine, calls in question; of a case alone, none
    limits    of machines and tables, with the share of time at each
    doubts    of cases that are done and doubtful all the same, by what makes them so
    answer    of a search or a tuning, whose requirements are those of its answer; None of what is none
    """

    name: str
    cases: int
    failed: int
    recorded: int
    failures: tuple[FailureGroup, ...]
    metrics: tuple[MetricSummary, ...]
    requirements: tuple[RequirementSummary, ...]
    limited: int = 0
    sweep: str = ""
    verified: Verification | None = None
    step_errors: tuple[StepErrorVerdict, ...] = ()
    warnings: tuple[Diagnostic, ...] = ()
    doubts: tuple[FailureGroup, ...] = ()
    limits: tuple[LimitSummary, ...] = ()
    answer: AnswerOutcome | None = None

    @property
    def ok(self) -> bool:
        """True if every case reached its end and met every requirement, and errors due to the step are within their
        limits; for a search, if its answer meets the requirements, whatever else was tried."""
        if self.answer is not None:
            return self.answer.ok and not self.untrue
        return self.failed == 0 and all(r.ok for r in self.requirements) and not self.untrue

    @property
    def untrue(self) -> tuple[StepErrorVerdict, ...]:
        """Requirements on errors due to the step that are missed, or not known to be met."""
        return tuple(step_error for step_error in self.step_errors if not step_error.met)


def summarise(archive: ArchiveFile) -> tuple[Summary, ...]:
    """The outcome of every experiment of an archive."""
    return tuple(summary_of(group) for group in archive.groups)


def summary_of(group: ArchiveGroup, position: int | None = None) -> Summary:
    """The outcome of one experiment, or of its case at this position."""
    if position is None and (summed := summed_up(group)) is not None:
        return _of_summary(group, summed)
    cases = slice(None) if position is None else slice(position, position + 1)
    status = group.values("status")[cases]
    failed = np.flatnonzero(status != 0)
    failure_groups: tuple[FailureGroup, ...] = ()
    if len(failed):
        rows, ids, causes = (group.at(name, (position or 0) + failed) for name in ("case", "case_id", "cause"))
        failure_groups = failures(status[failed], causes, rows, ids)
    requirements: tuple[RequirementSummary, ...] = ()
    searched = SearchAnswer.of(group) if position is None else None
    answer = None if searched is None else answer_outcome(searched)
    if answer is not None:
        requirements = tuple(
            AnsweredRequirement(
                r.text, r.met, r.missed, r.unknown, r.no_value, said=r.outcome_with_value, elsewhere=r.elsewhere
            )
            for r in answer.requirements
        )
    elif "met" in group.variables:
        met, done = group.values("met")[cases], group.values("status")[cases] == 0
        shares = evidence(group) if position is None else []
        requirements = tuple(
            RequirementSummary(
                str(text),
                met=int((met[:, i] == 1).sum()),
                missed=int((met[:, i] == 0).sum()),
                unknown=int((met[:, i] == -1).sum()),
                no_value=int(((met[:, i] == -1) & done).sum()),
                evidence=tuple(row for row in shares if row.requirement.place == i),
            )
            for i, text in enumerate(group.values("requirement"))
        )
    verified = figures.figures(group, position)
    return Summary(
        name=group.name,
        cases=group.count if position is None else 1,
        failed=len(failed),
        recorded=group.recorded if position is None else int(position in group.recorded_positions),
        failures=failure_groups,
        metrics=tuple(_metric(v, group.values(v.name)[cases]) for v in group.role("metric")),
        requirements=requirements,
        sweep=str(group.attributes.get("sweep", "")),
        verified=verified,
        step_errors=verdicts(group, verified) if position is None else (),
        warnings=tuple(warnings(group)) if position is None else (),
        doubts=_doubts(group, position),
        limits=limit_summaries(group, cases),
        answer=answer,
        limited=int((group.values("bed_limited")[cases] > 0).sum()) if "bed_limited" in group.variables else 0,
    )


def _of_summary(group: ArchiveGroup, case_summary: CaseSummary) -> Summary:
    """The outcome of an experiment whose archive keeps a summary."""
    values = case_summary.values
    causes: dict[bool, list[FailureGroup]] = {True: [], False: []}
    for cause, status, cases, first in zip(
        *(values[f"cause{name}"].tolist() for name in ("", "_status", "_cases", "_first")), strict=True
    ):
        word = "warning" if status == DOUBTFUL else STATUS.get(status, str(status))
        name = str(group.at("case_id", [group.position_of(first)])[0])
        causes[status == DOUBTFUL].append(FailureGroup(word, str(cause), name, (first,), cases))
    shares = evidence(group)
    texts = requirement_texts(group)
    whole = {place: case_summary.judged(place, whole=True)[0] for place in range(len(texts))}
    verified = figures.figures(group)
    return Summary(
        name=group.name,
        cases=case_summary.cases,
        failed=sum(failure_group.count for failure_group in causes[False]),
        recorded=group.recorded,
        failures=tuple(causes[False]),
        metrics=tuple(
            _summed(group.variables[str(name)], case_summary, place)
            for place, name in enumerate(values["summed_metric"])
        ),
        requirements=tuple(
            RequirementSummary(
                text,
                met=whole[place]["cases"] - whole[place]["missed"] - whole[place]["unknown"],
                missed=whole[place]["missed"],
                unknown=whole[place]["unknown"],
                no_value=whole[place]["no_value"],
                evidence=tuple(row for row in shares if row.requirement.place == place),
            )
            for place, text in enumerate(texts)
        ),
        sweep=group.sweep,
        verified=verified,
        step_errors=verdicts(group, verified),
        warnings=tuple(warnings(group)),
        doubts=tuple(causes[True]),
        limits=limit_summaries(group) if group.summary is None else (),
        limited=case_summary.limited,
    )


def _summed(variable: Stored, case_summary: CaseSummary, place: int) -> SummedMetric:
    """A metric of a summary of cases, from its moments and extremes; of one finite value this is the median."""
    sums = {name: case_summary.values[name][place].item() for name in SUMMED}
    return SummedMetric(
        minimum=sums["least"],
        median=sums["least"] if sums["finite"] == 1 else np.nan,
        maximum=sums["most"],
        infinite=sums["infinite"],
        unknown=sums["unknown"],
        name=variable.name,
        unit=variable.unit,
        about=variable.long_name,
        deck_unit=str(variable.attributes.get("deck_unit", variable.unit)),
        deck_scale=float(variable.attributes.get("deck_scale", 1.0)),
        mean=sums["mean"],
        deviation=float(np.sqrt(sums["variance"])),
        least_case=sums["least_case"],
        most_case=sums["most_case"],
    )


SUMMED = ("least", "most", "finite", "infinite", "unknown", "mean", "variance", "least_case", "most_case")
"""Variables of a summary from which a metric's row is made."""


def _doubts(group: ArchiveGroup, position: int | None) -> tuple[FailureGroup, ...]:
    """The doubts about cases, or about the one at a position, by cause; none in an archive older than warnings."""
    if "warning" not in group.variables:
        return ()
    doubtful, causes = [], []
    first, last = (0, group.count) if position is None else (position, position + 1)
    for piece in blocks(last - first):  # words take ten times the memory of numbers, and most of these are empty
        words = group.stretch("warning", first + piece.start, first + piece.stop)
        some = np.flatnonzero(words != "")
        doubtful.append(first + piece.start + some)
        causes.append(words[some])
    those = np.concatenate(doubtful) if doubtful else np.zeros(0, np.int64)
    if not len(those):
        return ()
    rows, ids = (group.at(name, those) for name in ("case", "case_id"))
    doubts = failures(np.zeros(len(those)), np.concatenate(causes), rows, ids)
    return tuple(replace(doubt, status="warning") for doubt in doubts)


def _metric(variable: Stored, values: np.ndarray) -> MetricSummary:
    """A metric's spread over the cases, with its units."""
    moments, attributes = spread(values), variable.attributes
    return MetricSummary(
        **asdict(moments),
        name=variable.name,
        unit=variable.unit,
        about=variable.long_name,
        deck_unit=str(attributes.get("deck_unit", variable.unit)),
        deck_scale=float(attributes.get("deck_scale", 1.0)),
    )


def spread(values: np.ndarray) -> MetricSpread:
    """The spread of a metric's values, by the one rule for tables, reports and comparisons."""
    rising = np.sort(values[np.isfinite(values)])
    infinite, unknown = int(np.isinf(values).sum()), int(np.isnan(values).sum())
    if not len(rising):
        return MetricSpread(np.nan, np.nan, np.nan, infinite, unknown)
    half = len(rising) // 2  # numpy's own median takes 60 ms to import
    middle = rising[half] if len(rising) % 2 else 0.5 * rising[half - 1] + 0.5 * rising[half]
    return MetricSpread(float(rising[0]), float(middle), float(rising[-1]), infinite, unknown)


def median_text(values: np.ndarray, *, infinite: str = "inf", none: str = "-") -> str:
    """The median in a table, with the number of infinite values: `2.44, 2 inf`."""
    moments = spread(values)
    if np.isnan(moments.median):
        return infinite if moments.infinite else none
    return number_text(moments.median) + (f", {moments.infinite:,} {infinite}" if moments.infinite else "")


def as_json(summary: Summary) -> dict[str, Any]:
    """Plain data for `--format json`; a number that is not finite is null."""
    plain = asdict(replace(summary, verified=None, warnings=(), step_errors=(), answer=None))
    del plain["answer"]  # `met show` and `met run` print all of it
    warned = [{"code": warning.code, "message": warning.message, "help": warning.help} for warning in summary.warnings]
    limits = [
        {"text": step_error.text, "met": step_error.met, "said": step_error.reason}
        for step_error in summary.step_errors
    ]
    judged = {"verified": figures.as_json(summary.verified), "step_errors": limits, "warnings": warned}
    metrics = [_named_first(asdict(metric)) for metric in summary.metrics]
    return {**finite({**plain, "metrics": metrics, **judged}), "ok": summary.ok}


def _named_first(metric: dict[str, Any]) -> dict[str, Any]:
    """A metric's data, with its description first and its numbers after it."""
    return {**{key: metric[key] for key in ("name", "unit", "about")}, **metric}


def finite(value: Any) -> Any:
    """Plain data with null for every non-finite number."""
    if isinstance(value, Mapping):
        return {key: finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [finite(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
