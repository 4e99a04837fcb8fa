"""Output of `met run`: the announcement before it, and results and places after it."""

from __future__ import annotations

import json as json_module
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from batch.archive.read import ArchiveFile
from batch.campaigns.campaign import Campaign, CampaignPart
from batch.campaigns.performing import Performed
from batch.campaigns.status import duration
from batch.queries.pool import failure_lines
from batch.queries.search_answers import SearchResult
from batch.queries.step_errors.figures import HINT
from batch.queries.summary import Summary, as_json, finite
from batch.terminal.show import MOST_GROUPS, verdict, warning_lines
from ic.printing.columns import count
from ic.printing.columns import size as size_text
from ic.sweeps.confidences import OF_CASES
from met.diagnostic import Diagnostic
from met.frozen import frozen
from met.outputs import quoted

if TYPE_CHECKING:
    from batch.export import Exported

WORST = 3
"""Number of cases of a sweep that the verdict names."""


# Before the run


def announcement(campaign: Campaign, verbose: bool = False, *, notes: bool = False) -> Iterator[str]:
    """Lines that announce the cases and records. notes: also those of the plan, which `met plan` prints"""
    for part in campaign.parts:
        yield from _part_lines(part, verbose)
        yield from [f"  note: {note}" for note in part.experiment.notes] if notes else []
    if campaign.keep.failed:
        bytes_of_case = max(
            part.experiment.structure.history_bytes // (2 if part.single else 1) for part in campaign.parts
        )
        yield f"and those of cases that fail: {size_text(bytes_of_case)} a case more"
    yield from [f"note: {note}" for note in campaign.notes]


def writing(campaign: Campaign) -> str:
    """The line with the place and size of the archive: printed once there is a kernel to fill it."""
    instead = ", in place of the one that is there" if campaign.output.exists() else ""
    most = "at most " * campaign.open_ended
    return f"writing {campaign.output}, {most}about {size_text(campaign.bytes)}{instead}"


def _part_lines(part: CampaignPart, verbose: bool) -> Iterator[str]:
    """Lines about an experiment before it runs: its cases, and the histories to be kept."""
    experiment = part.experiment
    schedule = experiment.structure.schedule
    own, whole = len(part.rows), experiment.cases.count
    if part.searches and experiment.search is not None:
        own = whole = part.most
    cases = count(own, "case") + (f" of {whole:,}" if own < whole else "")
    if own == 1 and whole > 1:
        whole_text = f"`{experiment.sweep}`" if experiment.sweep else f"{whole:,}"
        cases = f"case #{experiment.cases.table[part.rows[0]]} of {whole_text}"
    early = part.open_ended and own == whole
    if early:
        cases = f"at most {cases}"
    steps = schedule.ticks // schedule.dynamics
    yield (
        f"{experiment.name}: {cases}, {schedule.duration:g} s in {steps:,} steps of {1e3 * schedule.step:g} ms, "
        f"{experiment.structure.integrator}"
    )
    if early:
        yield from [f"  {note.removeprefix(OF_CASES)}" for note in experiment.notes if note.startswith(OF_CASES)]
    recorded = ", ".join(recorded.name for recorded in experiment.structure.record)
    if part.searches and experiment.search is not None:
        paths = ", ".join(parameter.path for parameter in experiment.search.parameters)
        against = f", against {len(experiment.search.plants):,} cases of {experiment.search.against}"
        yield f"  {experiment.search.goal} by {paths}{against * bool(experiment.search.against)}"
    if part.searches and part.keeps_best:
        yield f"  histories of its answer: {recorded}"
    elif part.recorded:
        size = size_text(experiment.structure.history_bytes // (2 if part.single else 1))
        whole_text = "" if part.all_recorded else f" of {part.recorded:,} cases" + (" at most" if part.later else "")
        yield f"  histories{whole_text}: {recorded}; {schedule.rows:,} rows, {size} a case"
    else:
        yield "  histories: none" + (f" (would be {recorded})" if recorded else "")
    for coordinate in experiment.cases.coordinates if verbose else ():
        yield f"  varied: {coordinate.path} ({', '.join(coordinate.sets)})"


# After the run


@frozen
class WorstCaseLines:
    """The worst cases of a sweep: as lines, for programs, and the row of the first."""

    lines: tuple[str, ...] = ()
    rows: tuple[dict[str, Any], ...] = ()

    @property
    def first(self) -> str:
        return f"#{self.rows[0]['row']}"


def worst_cases(archive: ArchiveFile) -> Iterator[WorstCaseLines]:
    """The worst cases of every experiment; none where there is one case, or no order among them."""
    from batch.queries import cases

    for group in archive.groups:
        rows = tuple(cases.rows_json(group, WORST))
        judged = any(row["met"] or row["status"] != "done" for row in rows)
        lines = (cases.title(group, WORST), *cases.table(group, WORST, hint=False)) if judged else ()
        yield WorstCaseLines(lines, rows if judged else ()) if group.count > 1 else WorstCaseLines()


@frozen
class RunResult:
    """The results that an archive has of the cases that were run, and the picture of it.

    worst    the worst cases of each summary
    picture  its file; None where there is none
    excuse   why there can be none, in words
    tables   of sweeps of several structures
    answers  of searches, by summary; None of what is none; empty where nothing is a search
    warned   what errors by the step, the steps themselves and limits of machines call in question, with their places
    """

    summaries: tuple[Summary, ...]
    worst: tuple[WorstCaseLines, ...]
    picture: Path | None
    excuse: str
    tables: Sequence[Sequence[str]] = ()
    warned: tuple[Diagnostic, ...] = ()
    answers: tuple[SearchResult | None, ...] = ()

    @property
    def ok(self) -> bool:
        """True if every case reached its end and met its requirements; for a tuning, if those of its answer did."""
        return all(summary.ok for summary in self.summaries)


def result_lines(campaign: Campaign, result: RunResult, exported: Exported | None, performed: Performed) -> list[str]:
    """The verdict, and the places of everything."""
    summaries, worst, seconds = result.summaries, result.worst, performed.seconds
    answers = result.answers or (None,) * len(summaries)
    out: list[str] = []
    many = {s.sweep for s in summaries if sum(s.sweep == other.sweep for other in summaries) > MOST_GROUPS} - {""}
    for summary, cases, answer in zip(summaries, worst, answers, strict=True):
        lines = list(verdict(summary, 100))
        if summary.sweep in many:
            if of_cases := (*summary.failures, *summary.doubts):
                out += ["", f"{summary.name}: {lines[0]}", *failure_lines(of_cases, 100)]
            continue
        name = f"{summary.name}: " if len(summaries) > 1 else ""
        took = f", {duration(seconds[summary.name])} of computing" if summary.name in seconds else ""
        out += ["", f"{name}{lines[0]}{took}", *lines[1:]]
        if _may_be_verified(campaign, summary):
            out.append(f"  {HINT}")
        out += ["", *cases.lines] if cases.lines and (answer is None or not answer.tunes) else []
        out += ["", *answer.lines] if answer is not None else []
    out += [line for table in result.tables for line in ("", *table)]
    path = campaign.output
    out += ["", f"archive  {path}  ({size_text(path.stat().st_size)})"]
    if result.picture is not None:
        names = list(dict.fromkeys(summary.sweep or summary.name for summary in summaries))
        out.append(f"picture  {result.picture}")
        if len(names) > 1:
            out[-1] += f", of {names[0]} alone: `met plot {quoted(path)} --run {quoted(names[1])}` draws another"
    elif result.excuse:
        out.append(f"picture  none: {result.excuse}")
    if exported is not None:
        out.append(f"export   {exported.path}  ({size_text(exported.path.stat().st_size)})")
    out.append(f"next     met show {quoted(path)}")
    for summary, cases in zip(summaries, worst, strict=True):
        if cases.rows and summary.sweep not in many and not any(answers):
            only = f" --run {quoted(summary.name)}" if len(summaries) > 1 else ""
            out.append(f"         met show {quoted(path)}{only} --case '{cases.first}'")
    if not any(summary.recorded for summary in summaries) and campaign.parts[0].experiment.structure.record:
        part, name = campaign.parts[0], f" {quoted(summaries[0].name)}" if len(summaries) > 1 else ""
        first = worst[0].first if worst[0].rows else f"#{part.experiment.cases.table[part.rows[0]]}"
        out.append(f"         met run {quoted(path)}{name} --case '{first}'")
    if not result.ok:
        judged = [  # cases that a tuning tried on its way may fail and miss requirements
            summary if answer is None or not answer.tunes else replace(summary, failed=0, requirements=())
            for summary, answer in zip(summaries, answers, strict=True)
        ]
        tuned = [
            f"`{answer.name}` found nothing that {'it may advise' if answer.data['stability'] else 'meets all'}"
            for answer in answers
            if answer and answer.tunes and not answer.ok
        ]
        out.append(f"exit 1: {'; '.join(filter(None, [_why_not(tuple(judged)), *tuned]))}")
    return out


def _may_be_verified(campaign: Campaign, summary: Summary) -> bool:
    """True where the step's error is not known, and verification was not declined."""
    has_metrics = summary.metrics and summary.failed < summary.cases
    return bool(has_metrics) and summary.verified is None and campaign.verify != "none"


def _why_not(summaries: tuple[Summary, ...]) -> str:
    """The reasons why a run's outcome is not good, in words."""
    failed = sum(summary.failed for summary in summaries)
    missed = [r for summary in summaries for r in summary.requirements if not r.ok]
    parts = [f"{count(failed, 'case')} failed"] if failed else []
    if missed:
        parts.append("not met everywhere: " + ", ".join(dict.fromkeys(r.text for r in missed)))
    if untrue := [step_error.text for summary in summaries for step_error in summary.untrue]:
        parts.append("not met, or not known: " + ", ".join(dict.fromkeys(untrue)))
    return "; ".join(parts)


def short_result_lines(path: Path, summaries: tuple[Summary, ...]) -> list[str]:
    """The verdict of an archive alone, for the log of a job."""
    out: list[str] = []
    for summary in summaries:
        name = f"{summary.name}: " if len(summaries) > 1 else ""
        lines = list(verdict(summary, 100))
        out += ["", f"{name}{lines[0]}", *lines[1:], *warning_lines(summary, 100)]
    out += ["", f"archive  {path}  ({size_text(path.stat().st_size)})"]
    return out if all(summary.ok for summary in summaries) else [*out, f"exit 1: {_why_not(summaries)}"]


def verdict_json(
    campaign: Campaign,
    result: RunResult,
    exported: Exported | None,
    performed: Performed,
    notes: Sequence[str],
    ok: bool,
) -> str:
    """The verdict for programs. notes: besides those of the run; ok: whether export and comparison went well too"""
    answers = result.answers or (None,) * len(result.summaries)
    data = {
        "ok": ok,
        "archive": str(campaign.output),
        "picture": None if result.picture is None else str(result.picture),
        "export": None if exported is None else str(exported.path),
        "notes": [*campaign.notes, *performed.notes, *notes],
        "experiments": [
            {
                **as_json(summary),
                "worst": list(cases.rows),
                "seconds": performed.seconds.get(summary.name),
                **({} if answer is None else {"answer": finite(answer.data)}),
            }
            for summary, cases, answer in zip(result.summaries, result.worst, answers, strict=True)
        ],
    }
    return json_module.dumps(data, indent=1)
