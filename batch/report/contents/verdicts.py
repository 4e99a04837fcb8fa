"""The outcomes of the cases of a run or sweep: the verdict, by requirement, by cause; and their metrics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from batch.queries.answer_outcome import answer_outcome
from batch.queries.at_limits import limit_summaries, reached_texts
from batch.queries.evidence import EvidenceRow, evidence, percent_below
from batch.queries.pool import ENDED, CaseColumn, Pool, failures, page_number, ranges
from batch.queries.search_answers import SearchAnswer
from batch.queries.signals import deck_unit
from batch.queries.step_errors.figures import NONE, StepErrorVerdict, Verification, error_text, figures, verdicts
from batch.queries.summary import spread, summary_of
from batch.queries.warnings import campaign_warnings
from batch.report.contents.against import EarlierCases
from batch.report.contents.parameters import spot
from batch.report.contents.parts import (
    FailureRow,
    MetricRow,
    OutcomeCount,
    ReportWarning,
    RequirementCounts,
    Verdict,
)
from ic.printing.columns import count as counted
from met.plan import Experiment
from met.run import DONE

BARS = 36
"""Number of stretches of a histogram."""

WORSE = ("", "met", "demonstrated", "not shown", "missed", "refuted")
"""Verdicts on a requirement over a share of cases, from best to worst."""

FEWEST = 8
"""Smallest number of values for a histogram."""


def verdict(pool: Pool, experiments: Mapping[str, Experiment], *, named: bool) -> Verdict:
    """The verdict on a run or sweep: yes if all cases reached their end and met all requirements.

    experiments  of the plan, by name, for places in the deck;  named: True to say of which run or sweep
    """
    if (answer := SearchAnswer.of(pool.groups[0])) is not None:
        return _of_answer(pool, answer, experiments, named=named)
    ended = np.bincount(pool.ended, minlength=len(ENDED))
    parts = tuple(OutcomeCount(word, int(n)) for word, n in zip(ENDED, ended, strict=True) if n)
    good = int(ended[ENDED.index("met")] + ended[ENDED.index("done")])
    errors = [error for group in pool.groups for error in verdicts(group, figures(group))]
    shares: dict[str, list[EvidenceRow]] = {}
    for row in (row for group in pool.groups for row in evidence(group)):
        shares.setdefault(row.requirement.text, []).append(row)
    return Verdict(
        kind="requirements",
        about=pool.name if named else "",
        ok=all(summary_of(group).ok for group in pool.groups),
        headline=_headline(pool, good),
        parts=parts,
        demands=tuple(
            _over_share(_demand(pool, place, text), shares.get(text, []))
            for place, text in enumerate(pool.requirements)
        ),
        failing=_failing(pool),
        notes=(*_notes(pool), *map(_of_step_error, errors)),
        warnings=_report_warnings(pool, experiments),
    )


def _over_share(counts: RequirementCounts, rows: Sequence[EvidenceRow]) -> RequirementCounts:
    """A requirement with the worst verdict of its design points, and the bound where there is one of them."""
    verdict = max((row.verdict for row in rows), key=WORSE.index, default="")
    lower = rows[0].lower if len(rows) == 1 and verdict != "refuted" else None
    return replace(counts, verdict=verdict, bound="" if lower is None else f"at least {percent_below(lower)} of all")


def _of_answer(pool: Pool, answer: SearchAnswer, experiments: Mapping[str, Experiment], *, named: bool) -> Verdict:
    """The verdict on the answer of a search, in its cases alone: shares among cases that an optimiser chose mean
    nothing."""
    summary, errors = summary_of(pool.groups[0]), verdicts(pool.groups[0], figures(pool.groups[0]))
    outcome = answer_outcome(answer)
    tunes = answer.search.kind == "tune"
    requirements = outcome.requirements
    words = ("Requirements met", "Requirements not met") if tunes else ("No miss found", "A miss was found")
    if not requirements:
        words = ("Reached its end", "Did not reach its end") if tunes else ("No failure found", "A failure was found")
    return Verdict(
        kind="answer",
        about=pool.name if named else "",
        ok=summary.ok,
        headline=outcome.headline,
        parts=(),
        demands=tuple(
            RequirementCounts(
                requirement.text,
                requirement.met,
                requirement.missed,
                requirement.unknown,
                requirement.met + requirement.missed + requirement.unknown,
                requirement.worst,
                requirement.case,
                requirement.outcome,
                requirement.ok,
            )
            for requirement in requirements
        ),
        failing=() if tunes and not answer.best.failed else _failing(pool),
        notes=(*_notes(pool), *map(_of_step_error, errors)),
        warnings=_report_warnings(pool, experiments),
        word=words[0] if summary.ok else words[1],
    )


def _report_warnings(pool: Pool, experiments: Mapping[str, Experiment]) -> tuple[ReportWarning, ...]:
    """The warnings about a run or sweep, with places in the deck."""
    return tuple(
        ReportWarning(
            campaign_warning.code,
            campaign_warning.message,
            campaign_warning.help,
            spot(None if campaign_warning.at is None else campaign_warning.at.place),
        )
        for campaign_warning in campaign_warnings(pool.groups, experiments)
    )


def _of_step_error(step_error: StepErrorVerdict) -> str:
    """A sentence on whether the run's error by the step is as small as the deck requires."""
    return f"{step_error.text}: {step_error.word}, {step_error.reason}."


def _headline(pool: Pool, good: int) -> str:
    """The headline of the verdict: `31 of 37 cases meet every requirement`."""
    several = len(pool.requirements) > 1
    if pool.count == 1:
        if pool.status[0] != DONE:
            return "The case did not reach its end"
        if not pool.requirements:
            return "The case reached its end"
        what = "every requirement" if several else "its requirement"
        return f"The case meets {what}" if good else f"The case does not meet {what}"
    who = f"All {pool.count:,} cases" if good == pool.count else f"{good:,} of {pool.count:,} cases"
    if not pool.requirements:
        return f"{who} reached their end"
    verb = "meets" if good == 1 and good < pool.count else "meet"
    return f"{who} {verb} {'every requirement' if several else 'the requirement'}"


def _demand(pool: Pool, place: int, text: str) -> RequirementCounts:
    """The counts of a requirement over all cases, and the metric's value that is furthest on its wrong side. place:
    among the requirements"""
    outcomes = pool.outcomes[:, place]
    met, missed, unknown = (int((outcomes == value).sum()) for value in (1, 0, -1))
    furthest, case = "", None
    for column in pool.metrics():
        for limit in (limit for limit in column.limits if limit.text == text):
            values = np.where(np.isnan(column.values), -np.inf if limit.sense == "<" else np.inf, column.values)
            worst = int(values.argmax() if limit.sense == "<" else values.argmin())
            if not np.isnan(column.values[worst]):
                furthest = f"{page_number(float(column.values[worst]))} {column.unit}".rstrip()
                case = int(pool.cases[worst])
    return RequirementCounts(text, met, missed, unknown, pool.count, furthest, case)


def _failing(pool: Pool) -> tuple[FailureRow, ...]:
    """The causes of failed cases, a row each, with the numbers of their cases."""
    return tuple(
        FailureRow(
            failure.status,
            failure.cause.removeprefix(f"{failure.status}: "),
            len(failure.cases),
            ranges(failure.cases),
            failure.row,
        )
        for failure in pool.failures
    )


def _notes(pool: Pool) -> tuple[str, ...]:
    """Sentences on cases that were at a limit, of a motor bed or of the arm, and other warnings."""
    notes = []
    limited = int((pool.gathered("bed_limited", 0.0) > 0).sum())
    if limited:
        cases_text = "" if pool.count == 1 else f" in {limited:,} of {pool.count:,} cases"
        notes.append(
            f"The load motor of a bed was at its limit{cases_text}: there the run is not what the joint would do."
        )
    for group in pool.groups:
        texts = reached_texts(limit_summaries(group), group.count)
        named = f" of {group.name}" if len(pool.groups) > 1 else ""
        notes += [f"{text[0].upper()}{text[1:]}{named}." for text in texts]
    return (*notes, *_warnings(pool))


def _warnings(pool: Pool) -> list[str]:
    """The doubts about finished cases, each with its cases."""
    warnings = np.array(pool.texts("warning", np.arange(pool.count)), dtype=object)
    doubtful = np.flatnonzero(warnings != "")
    doubts = failures(np.zeros(len(doubtful)), warnings[doubtful], pool.cases[doubtful], pool.cases[doubtful])
    return [f"Warning of {ranges(doubt.cases)}: {doubt.cause}" for doubt in doubts]


def metric_rows(
    pool: Pool, before: EarlierCases | None = None, errors: Verification | None = None
) -> tuple[MetricRow, ...]:
    """The rows of the table of metrics. before: the cases of another archive to compare with; errors: those due to the
    step, where they are known"""
    return tuple(
        _metric(column, None if before is None else before.values(column), _by_step(pool, column, errors))
        for column in pool.metrics()
    )


def _by_step(pool: Pool, column: CaseColumn, errors: Verification | None) -> str:
    """A metric's error by the step, in its column's unit."""
    if errors is None:
        return ""
    name = column.key.partition(":")[2]
    [variable, *_] = (group.variables[name] for group in pool.groups if name in group.variables)
    error = error_text(errors.metrics.get(name), deck_unit(variable)[0])
    return page_number(np.nan) if error == NONE else error


def _metric(column: CaseColumn, before: np.ndarray | None, by_step: str) -> MetricRow:
    """The spread of the finite values, with a remark on the number of others. before: the values of the other
    archive"""
    moments, finite = spread(column.values), column.values[np.isfinite(column.values)]
    was = np.zeros(0) if before is None else np.sort(before[np.isfinite(before)])
    was_text = "" if before is None else page_number(spread(was).median)
    remarks = [f"infinite in {counted(moments.infinite, 'case')}"] if moments.infinite else []
    remarks += [f"no value in {counted(moments.unknown, 'case')}"] if moments.unknown else []
    if not len(finite):
        return MetricRow(
            column.label, column.about, column.unit, moments, ", ".join(remarks), by_step=by_step, before=was_text
        )
    low, middle, high = moments.minimum, moments.median, moments.maximum
    bars: tuple[int, ...] = ()
    bars_before: tuple[int, ...] = ()
    from_, to = min([low, *was[:1]]), max([high, *was[-1:]])
    if len(finite) >= FEWEST and np.isfinite(to - from_) and to > from_:
        near = [limit.value for limit in column.limits if abs(limit.value - middle) <= 2.0 * (to - from_)]
        from_, to = min([from_, *near]), max([to, *near])
        bars = _counts(finite, from_, to)
        bars_before = _counts(was, from_, to) if len(was) else ()
    limits = tuple(limit.value for limit in column.limits if from_ <= limit.value <= to)
    return MetricRow(
        name=column.label,
        about=column.about,
        unit=column.unit,
        spread=moments,
        remark=", ".join(remarks),
        bars=bars,
        low=from_,
        high=to,
        limits=limits if bars else (),
        by_step=by_step,
        before=was_text,
        bars_before=bars_before,
    )


def _counts(values: np.ndarray, low: float, high: float) -> tuple[int, ...]:
    """A histogram: the number of values in each of `BARS` equal stretches."""
    places = np.minimum(((values - low) / (high - low) * BARS).astype(int), BARS - 1)
    return tuple(np.bincount(places, minlength=BARS).tolist())
