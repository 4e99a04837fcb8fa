"""The table of evidence: a row for each requirement at each design point, with the numbers that a review needs.

One set of rows for the terminal, reports, comparisons, tables for other programs and notebooks. Requirements over a
share of cases have a row for each design point, those on every case have one, and so have those on an error due to the
step, whose cases are the verified ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from batch.archive.read import ArchiveGroup
from batch.queries.evidence import EvidenceRow, Verdict, evidence_for, percent_above, percent_below
from batch.queries.requirements import group_requirements
from batch.queries.signals import deck_unit, number_text, pretty_unit
from batch.queries.step_errors.figures import NONE, StepErrorVerdict, figures, rounded, verdicts
from batch.queries.tallies import summed_up
from met.frozen import frozen
from met.outputs import quoted


@frozen(kw_only=True)
class RequirementEvidence:
    """A row of the table of evidence; numbers in SI, of which one `unit`, as the deck writes it, is `scale`.

    run, requirement  as the deck wrote them;  at: the design point, `gearbox.ki = 0.1 V/rad`, of a sum of
                      sweeps behind its part, `loads`; "" where there is one
    metric, comparison, limit, share, confidence  of what is required
    cases             that were judged;  missed: of these, with those that failed or have no value
    share_met         of the cases that were run;  at_least, at_most: of all cases, each with the confidence
    percentile_bound  on the side of the limit, an order statistic, with the confidence
    worst             the value nearest to the limit or furthest beyond it;  worst_case: its position in the case table
    margin            from the worst value to the limit, negative beyond it
    sigmas            from the mean to the limit, in standard deviations of the metric over the drawn cases
    step_error        of the metric by the step, the largest of its verified cases
    verdict           what follows;  more_cases: that would demonstrate it if none of them misses it, else 0
    test              of verdict and bounds: "fixed", of a number of cases that was chosen before they were looked at;
                      "sequential", looked at after every case; "" without a confidence
    decided           the number of cases after which a sequential test decided it; None where none did
    why               it was not judged as it asks for, or is not known;  again: the command that runs the worst case
    Every number but `cases`, `missed` and `limit` is None where there is none.
    """

    run: str
    requirement: str
    at: str
    metric: str
    unit: str
    si_unit: str
    scale: float
    comparison: str
    limit: float
    share: float | None = None
    confidence: float | None = None
    verdict: Verdict | str = ""
    cases: int
    missed: int
    share_met: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    percentile_bound: float | None = None
    worst: float | None = None
    worst_case: int | None = None
    margin: float | None = None
    sigmas: float | None = None
    step_error: float | None = None
    more_cases: int = 0
    test: str = ""
    decided: int | None = None
    why: str = ""
    again: str = ""

    @property
    def ok(self) -> bool:
        """True if the requirement is met, or demonstrated where it asks for a confidence."""
        return self.verdict in ("met", "demonstrated")

    @property
    def blurred(self) -> bool:
        """True if the error due to the step is as large as the margin, so that shorter steps may change the verdict."""
        return self.step_error is not None and self.margin is not None and self.step_error >= abs(self.margin) > 0.0


def requirement_evidence(
    groups: Sequence[ArchiveGroup], archive: str, *, several: bool = False
) -> list[RequirementEvidence]:
    """The rows of the requirements of these groups. archive: its name in commands; several: whether it holds other runs
    or sweeps, so that commands must name this one. Rows of one requirement are adjacent."""
    out = []
    for group in groups:
        structure = [f"{choice.path} = {group.at(choice.name, [0])[0]}" for choice in group.role("choice")]
        if group.sweep and not structure:  # a sum of sweeps
            structure = [group.name.removeprefix(f"{group.sweep}.")]
        verified = figures(group)
        errors = (
            {} if verified is None else {name: metric_error.error for name, metric_error in verified.metrics.items()}
        )
        drawn, chosen = _designs(group)
        for row in evidence_for(group, group_requirements(group)):
            conditions = [*structure, *(f"{path} = {text}" for path, text in row.chosen.items())]
            alike = drawn and (row.requirement.share is not None or not chosen)
            evidence = _of_metric(
                group, row, ", ".join(conditions), errors.get(row.requirement.metric), archive, several
            )
            out.append(evidence if alike else replace(evidence, sigmas=None))
        out += [
            _of_step_error(group, verdict, ", ".join(structure), archive, several)
            for verdict in verdicts(group, verified)
        ]
    order = list(dict.fromkeys(row.requirement for row in out))
    return sorted(out, key=lambda row: order.index(row.requirement))


def _designs(group: ArchiveGroup) -> tuple[bool, bool]:
    """Two truths: values were drawn at random in a group's cases, and values were chosen."""
    designs = [bool(variable.attributes.get("design")) for variable in group.role("coordinate")]
    if (summed := summed_up(group)) is not None:
        return summed.drawn, not all(designs)
    repeated = "repeat" in group.variables and bool(group.values("repeat").any())
    return any(designs) or repeated, not all(designs)


def _of_metric(
    group: ArchiveGroup, row: EvidenceRow, condition: str, error: float | None, archive: str, several: bool
) -> RequirementEvidence:
    """A row of the table: a requirement on a metric, under these conditions. error: the metric's by the step"""
    required, case = row.requirement, int(group.at("case", [row.worst])[0])
    variable = group.variables[required.metric]
    return RequirementEvidence(
        run=group.sweep or group.name,
        requirement=required.text,
        at=condition,
        metric=required.metric,
        unit=str(variable.attributes.get("deck_unit", variable.unit)),
        si_unit=variable.unit,
        scale=row.scale,
        comparison=required.comparison,
        limit=required.limit,
        share=required.share,
        confidence=required.confidence,
        verdict=row.verdict,
        cases=row.cases,
        missed=row.missed,
        share_met=1.0 - row.missed / row.cases if row.cases else None,
        at_least=row.lower,
        at_most=row.upper,
        percentile_bound=row.bound,
        worst=_known(row.value),
        worst_case=case,
        margin=_known(row.margin),
        sigmas=row.sigmas,
        step_error=_known(error),
        more_cases=row.more,
        test="" if row.lower is None else "sequential" if row.sequential else "fixed",
        decided=row.decided,
        why=row.why,
        again=_again(group, case, archive, several),
    )


def _of_step_error(
    group: ArchiveGroup, verdict: StepErrorVerdict, condition: str, archive: str, several: bool
) -> RequirementEvidence:
    """A row of the table: a requirement on an error due to the step, under these conditions."""
    limit = verdict.limit
    variable = group.variables[limit.metric]
    units = (
        ("%", "1", 0.01)
        if limit.share
        else (str(variable.attributes.get("deck_unit", variable.unit)), variable.unit, abs(deck_unit(variable)[0]))
    )
    size = _known(verdict.size)
    return RequirementEvidence(
        run=group.sweep or group.name,
        requirement=limit.text,
        at=condition,
        metric=limit.metric,
        unit=units[0],
        si_unit=units[1],
        scale=units[2],
        comparison=limit.comparison,
        limit=limit.limit,
        verdict=verdict.word,
        cases=verdict.cases,
        missed=verdict.missed,
        share_met=1.0 - verdict.missed / verdict.cases if verdict.cases else None,
        worst=size,
        worst_case=verdict.worst if verdict.worst >= 0 else None,
        margin=None if size is None else limit.limit - size,
        why="" if verdict.met is not None else verdict.reason,
        again=_again(group, verdict.worst, archive, several) if verdict.worst >= 0 else "",
    )


def _known(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value


def _again(group: ArchiveGroup, case: int, archive: str, several: bool) -> str:
    """The command that runs a case again."""
    named = f" {quoted(group.sweep or group.name)}" if several else ""
    return f"met run {quoted(archive)}{named} --case '#{case}'"


@frozen
class EvidenceTexts:
    """A row's numbers as texts, with their units; `NONE` where there is none.

    missed  `3 of 600`;  of_all: `at least 98.71 %`;  demand: `99 % with 90 %`;  needed: more cases
    bound   of the percentile, on the side of the limit, `2.9 s`;  limit: `< 3 s`
    """

    verdict: str
    missed: str
    share_met: str
    of_all: str
    demand: str
    bound: str
    needed: str
    limit: str
    worst: str
    margin: str
    sigmas: str
    step_error: str


def texts_of(row: RequirementEvidence, number: Callable[[float], str] = number_text) -> EvidenceTexts:
    """The texts of a row. number: as the page or terminal writes one."""

    unit = "" if row.unit == "1" else pretty_unit(row.unit)

    def quantity(value: float | None) -> str:
        return NONE if value is None else f"{number(value / row.scale)} {unit}".rstrip()

    of_all = NONE
    if row.at_least is not None and row.at_most is not None:
        refuted = row.verdict == "refuted"
        of_all = f"at most {percent_above(row.at_most)}" if refuted else f"at least {percent_below(row.at_least)}"
    demand = "every case" if row.share is None else f"{100.0 * row.share:g} %"
    if row.confidence is not None:
        demand += f" with {100.0 * row.confidence:g} %"
    return EvidenceTexts(
        verdict=row.verdict if row.decided in (None, row.cases) else f"{row.verdict} after {row.decided:,}",
        missed=f"{row.missed:,} of {row.cases:,}",
        share_met=NONE if row.share_met is None else percent_below(row.share_met).replace(".00 %", " %"),
        of_all=of_all,
        demand=demand,
        bound=quantity(row.percentile_bound),
        needed=f"{row.more_cases:,}" if row.more_cases else NONE,
        limit=f"{row.comparison} {quantity(row.limit)}",
        worst=quantity(row.worst),
        margin=quantity(row.margin),
        sigmas=NONE if row.sigmas is None else f"{row.sigmas:.2f}",
        step_error=NONE if row.step_error is None else f"{rounded(row.step_error / abs(row.scale))} {unit}".rstrip(),
    )


def notes_of(rows: Sequence[RequirementEvidence]) -> list[str]:
    """Sentences about the table: why a row was not judged as the deck asks, where the error due to the step is as large
    as the margin, the use of more cases, and the meaning of the confidence."""
    out = []
    for row in rows:
        where = f"{row.requirement}{f', {row.at}' if row.at else ''}"
        if row.why:
            out.append(f"{where}: {row.why}")
        if row.blurred:
            out.append(f"{where}: the error by the step is as large as the margin; shorter steps may change it")
    if any(row.more_cases for row in rows):
        out.append("needed: so many more cases would show it if none of these misses it")
    if any(row.test == "sequential" for row in rows):
        out.append("sequential test: the bounds hold although it was looked at after every case")
    with_confidence = sum(row.at_least is not None for row in rows)
    if with_confidence > 1:
        out.append(
            f"{with_confidence:,} verdicts with a confidence: it is that of each by itself; of all together it is less"
        )
    return list(dict.fromkeys(out))


FIELDS = tuple(name for name in RequirementEvidence.__dataclass_fields__ if name not in ("si_unit", "scale"))
"""Fields of a row as data."""


def as_data(row: RequirementEvidence) -> dict[str, Any]:
    """A row as plain data, in SI, by `FIELDS`; `unit` is that of SI."""
    return {name: row.si_unit if name == "unit" else getattr(row, name) for name in FIELDS}
