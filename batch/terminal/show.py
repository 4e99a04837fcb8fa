"""`met show`: an archive in a terminal: its run, its outcome, and its signals."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries import cases, ordering
from batch.queries.at_limits import reached_texts
from batch.queries.evidence_table import RequirementEvidence, requirement_evidence
from batch.queries.evidence_table import as_data as evidence_data
from batch.queries.given import settings_lines
from batch.queries.ordering import CaseOrder, CaseSelection, structures
from batch.queries.pool import Pool, by_run, cases_named, failure_lines, groups_named, pools
from batch.queries.search_answers import SearchAnswer, search_result
from batch.queries.signals import DeckUnits, case_text, history, number_text, number_texts, panels, pretty_unit
from batch.queries.step_errors.figures import NONE, about, error_text
from batch.queries.summary import (
    SPREAD_COLUMNS,
    SUMMED_COLUMNS,
    AnsweredRequirement,
    MetricSummary,
    SpreadColumn,
    Summary,
    SummedMetric,
    summary_of,
)
from batch.queries.tallies import is_streamed
from batch.terminal.evidence import evidence_lines, evidence_table_lines
from ic.printing.columns import columns, count
from ic.printing.columns import size as size_text
from met.distinct import distinct
from met.messages.visible import line
from met.outputs import quoted
from met.plan.columns import blocks

MOST_GROUPS = 4
"""Largest number of structures of a sweep that are shown in full unless they are named; with more, only their table is
shown, and after a run also what failed."""

NARROWEST = 40
"""Smallest width in characters of a line beside a name, however long that is."""

EVERYTHING = CaseSelection()

SIGNALS = 4
"""Number of signals whose ranges are listed by default."""


def show(
    archive: ArchiveFile,
    signals: Sequence[str] = (),
    *,
    experiments: Sequence[str] = (),
    case: str | None = None,
    all_cases: bool = False,
    by: CaseOrder | None = None,
    some: CaseSelection = EVERYTHING,
    width: int = 100,
) -> str:
    """The whole text: of all cases with their table, worst first or in the order `by`, or all about one `case`.

    By something, the cases of all structures of a sweep are in one table. some: the cases that the table is of; all
    else is of all of them.

    The ranges of signals are of one case, the first recorded unless `case` names another; under the table of all cases
    there are none unless `signals` are asked for.
    """
    out = [f"{archive.path}  ({size_text(archive.path.stat().st_size)}), from {archive.deck.strip('<>')}"]
    out += [f"  {line(setting)}" for setting in settings_lines(archive)]
    chosen = cases_named(archive, experiments, case)
    check_asked(archive, by, some)
    ordering.check([group for group, _ in chosen], by)
    if not experiments and case is None and not signals:
        out += [row for table in structures(archive) for row in ("", *table)]
        counts = Counter(group.sweep for group, _ in chosen if group.sweep)
        hidden = [group.name for group, _ in chosen if counts[group.sweep] > MOST_GROUPS and not all_cases]
        if hidden and by is None:
            remedy = f"`met show {quoted(archive.path)} --run {hidden[0]}`"
            out += ["", f"one structure in full: {remedy}; the cases of all: `--all-cases`"]
            chosen = [pair for pair in chosen if pair[0].name not in hidden]
    if by is not None:
        for pool in pools([group for group, _ in chosen]):
            order = ordering.order_of(pool.groups, by)
            if len(pool.groups) > 1 and order is not None:
                most = None if all_cases else cases.SHOWN_CASES
                among = None if some.everything else some.places(pool)
                selection = [] if among is None else [some.words(len(among), pool.count)]
                table = cases.table_across(pool, order, most, among=among) if among is None or len(among) else []
                out += ["", f"{pool.name}, {order.title}", *selection, *table]
                chosen = [pair for pair in chosen if signals or pair[0] not in pool.groups]
    for group, position in chosen:
        out += ["", *heading(group, width), "", *_about(archive, group, position, all_cases, by, some, width), ""]
        if signals or position is not None or group.count == 1:
            out += signal_lines(archive, group, signals, position)
    return "\n".join(map(line, out)).rstrip() + "\n"


def check_asked(archive: ArchiveFile, by: CaseOrder | None, some: CaseSelection) -> None:
    """Refuse to sort or to choose among the few cases whose rows are beside a summary. Raises Problem E330."""
    if by is not None or not some.everything:
        archive.need_every_row("a choice or an order of all cases")


def show_evidence(archive: ArchiveFile, experiments: Sequence[str] = (), *, width: int = 100) -> str:
    """The table of evidence (what the cases show of each requirement) of each run and sweep, or of these."""
    out = [f"{archive.path}  ({size_text(archive.path.stat().st_size)}), from {archive.deck.strip('<>')}"]
    for name, groups in by_run(groups_named(archive, tuple(experiments))).items():
        cases = sum(group.run for group in groups)
        answer = SearchAnswer.of(groups[0])
        of_answer = "" if answer is None else f"its answer, {count(len(answer.best.cases), 'case')} of "
        title = f"{name}: {of_answer}{count(cases, 'case')}"
        out += ["", title, *evidence_table_lines(_evidence(archive, groups), width)]
    return "\n".join(map(line, out)).rstrip() + "\n"


def _evidence(archive: ArchiveFile, groups: Sequence[ArchiveGroup]) -> list[RequirementEvidence]:
    """The rows of evidence, what the cases show of each requirement, of these groups."""
    return requirement_evidence(groups, str(archive.path), several=len(by_run(archive.groups)) > 1)


def _about(
    archive: ArchiveFile,
    group: ArchiveGroup,
    position: int | None,
    all_cases: bool,
    by: CaseOrder | None,
    some: CaseSelection,
    width: int,
) -> list[str]:
    """Lines about the outcomes of the cases, or about one case, with its varied values."""
    if position is not None:
        varied = cases.varied_lines(archive, group, position)
        name = [case_text(group, position, varied=False)] if group.count > 1 else []
        return [*name, *verdict(summary_of(group, position), width), *([""] if varied else []), *varied]
    summary = summary_of(group)
    out = [*verdict(summary, width), *warning_lines(summary, width)]
    answer = search_result(archive, group)
    if answer is not None:
        out = [*answer.lines, "", *out]
    if group.count > 1:
        most = None if all_cases else cases.SHOWN_CASES
        if some.everything:
            return [*out, "", cases.title(group, by=by, every=all_cases), *cases.table(group, most, by=by)]
        among = _positions(archive, group, some)
        out += ["", some.words(len(among), group.count)]
        if len(among):
            out += [cases.title(group, by=by, every=True), *cases.table(group, most, by=by, among=among)]
    return out


def _positions(archive: ArchiveFile, group: ArchiveGroup, some: CaseSelection) -> np.ndarray:
    """Positions in a group of the selected cases among those of all structures of its sweep."""
    name = group.sweep or group.name
    pool = Pool(name, by_run(archive.groups)[name])
    places = some.places(pool)
    return pool.position_of[places[pool.group_of[places] == pool.groups.index(group)]]


def as_json(
    archive: ArchiveFile,
    experiments: Sequence[str] = (),
    *,
    case: str | None = None,
    all_cases: bool = False,
    by: CaseOrder | None = None,
    some: CaseSelection = EVERYTHING,
) -> str:
    """An archive for programs: outcome, cases, variables and attributes, without the signals' values.

    `case_table` holds the cases as `show` lists them, the first of many unless `all_cases`, and `evidence` the rows of
    the table of evidence; where one `case` is asked for, the outcome is its own, and `case` holds it with all its
    parameters.
    """
    import json

    from batch.queries import summary as outcomes

    groups = []
    chosen = cases_named(archive, experiments, case)
    check_asked(archive, by, some)
    ordering.check([group for group, _ in chosen], by)
    for group, position in chosen:
        if position is None:
            among = None if some.everything else _positions(archive, group, some)
            most = None if all_cases else cases.SHOWN_CASES
            answer = search_result(archive, group)
            details: dict[str, Any] = {
                **({} if answer is None else {"answer": outcomes.finite(answer.data)}),
                "case_table": cases.rows_json(group, most, by=by, among=among),
                "evidence": outcomes.finite([evidence_data(row) for row in _evidence(archive, [group])]),
            }
        else:
            [about] = cases.rows_json(group, positions=[position])
            details = {"case": {**about, "parameters": outcomes.finite(cases.parameters(archive, group, position))}}
        variables = [{"name": v.name, "role": v.role, "dims": v.dims, "unit": v.unit} for v in group.variables.values()]
        groups.append(
            {
                **outcomes.as_json(summary_of(group, position)),
                **details,
                "attributes": outcomes.finite(group.attributes),
                "variables": variables,
            }
        )
    provenance = outcomes.finite(archive.provenance)
    data = {"archive": str(archive.path), "deck": archive.deck, "provenance": provenance, "experiments": groups}
    return json.dumps(data, indent=1, allow_nan=False)


def heading(group: ArchiveGroup, width: int) -> list[str]:
    """Lines that describe the run."""
    a = group.attributes
    cases_text = count(group.run, "case")
    if group.run < a["cases_in_table"]:
        cases_text += f" of {'at most ' * ('until_shown' in a)}{a['cases_in_table']:,}"
    text = (
        f"{cases_text}, {a['duration_s']:g} s, {a['integrator']} at {a['dynamics_hz']:g} Hz, recorded at "
        f"{a['record_hz']:g} Hz, arm {a['arm']}, velocity products {a['velocity_products']}"
    )
    indent = len(group.name) + 2
    if width - indent < NARROWEST:  # a name that leaves no room stands on a line of its own
        lines = ["", *textwrap.wrap(text, max(NARROWEST, width - (indent := 4)))]
    else:
        lines = textwrap.wrap(text, width - indent)
    out = [f"{group.name}  {lines[0]}".rstrip(), *(" " * indent + rest for rest in lines[1:])]
    for code in group.allowed:
        out += textwrap.wrap(f"allowed: {code}", max(NARROWEST, width), initial_indent="  ", subsequent_indent="    ")
    for variable in group.role("choice"):
        out.append(f"  {variable.path} = {group.at(variable.name, [0])[0]}")
    if group.summary is not None:
        named = f"a summary of them, and the rows of {group.count:,} that it names"
        out += textwrap.wrap(f"{named}: any case again: {_again(group)}", max(NARROWEST, width), initial_indent="  ",
                             subsequent_indent="    ")  # fmt: skip
    for variable in group.role("coordinate") if group.summary is None else ():
        scale = float(variable.attributes.get("deck_scale", 1.0))
        unit = pretty_unit(str(variable.attributes.get("deck_unit", variable.unit)))
        if is_streamed(group):
            stretches = (group.stretch(variable.name, piece.start, piece.stop) for piece in blocks(group.count))
            ends = np.array([(stretch.min(), stretch.max()) for stretch in stretches]) / scale
            low, high = number_text(ends[:, 0].min()), number_text(ends[:, 1].max())
            out.append(f"  {variable.name} = values from {low} to {high} {unit}".removesuffix(" 1"))
            continue
        values = distinct(group.values(variable.name)) / scale
        few = ", ".join(number_texts(values)) if len(values) <= 6 else ""
        low, high = number_texts([values[0], values[-1]])
        many = f"{len(values)} values from {low} to {high}"
        out.append(f"  {variable.name} = {few or many} {unit}".removesuffix(" 1"))
    return out


def _again(group: ArchiveGroup) -> str:
    """The command that runs a case of an archive's group again."""
    return f"`met run {quoted(group.path)} --case '#{group.at('case', [0])[0]}'`"


def verdict(summary: Summary, width: int) -> Iterator[str]:
    """Lines about the outcome: cases, metrics, requirements."""
    yield _counts(summary)
    yield from failure_lines((*summary.failures, *summary.doubts), width)
    if summary.limited:
        cases_text = "" if summary.cases == 1 else f" in {summary.limited:,} of {summary.cases:,} cases"
        yield f"  note: the load motor of a bed was at its limit{cases_text}: the run is not what the joint would do"
        yield "  what gives it more: `i_max` and `kt_load` of the bed; what asks less: the arm, or its command"
    yield from [f"  {text}" for text in reached_texts(summary.limits, summary.cases)]
    if summary.metrics:
        yield from _metric_table(summary)
    if summary.verified is not None:
        yield from textwrap.wrap(about(summary.verified), width, initial_indent="  ", subsequent_indent="    ")
    texts = [requirement.text for requirement in summary.requirements if not requirement.evidence]
    wide = max(map(len, (*texts, *(step_error.text for step_error in summary.step_errors))), default=0)
    if summary.answer is not None:
        yield from textwrap.wrap(f"{summary.answer.headline}.", width, initial_indent="  ", subsequent_indent="    ")
    for r in summary.requirements:
        if isinstance(r, AnsweredRequirement):
            yield f"  require {r.text:<{wide}}  {r.said}"
            continue
        if r.evidence:
            yield from [f"  require {r.text}", *(f"    {text}" for text in evidence_lines(r.evidence))]
            continue
        if summary.cases == 1:
            why = "its metric has no value here" if r.no_value else "the case failed"
            outcome = "met" if r.met else "missed" if r.missed else f"not known: {why}"
        else:
            outcome = f"met by {r.met:,} of {summary.cases:,} ({100 * r.met / summary.cases:.3g} %)"
            outcome += f", not known of {r.unknown:,}" if r.unknown else ""
            outcome += f" (its metric has no value in {r.no_value:,})" if r.no_value else ""
        yield f"  require {r.text:<{wide}}  {outcome}"
    for step_error in summary.step_errors:
        yield f"  require {step_error.text:<{wide}}  {step_error.word}: {step_error.reason}"
    verdicts = [row for r in summary.requirements for row in r.evidence if row.lower is not None]
    if len(verdicts) > 1:
        tested = len({row.requirement.text for row in verdicts})
        where = f"{count(tested, 'requirement')} at {count(len(verdicts) // tested, 'design point')}"
        yield f"  {len(verdicts):,} verdicts ({where}): the confidence is that of each by itself"


def warning_lines(summary: Summary, width: int) -> Iterator[str]:
    """Lines of the warnings due to errors by the step, with remedies."""
    for warning in summary.warnings:
        texts = [f"warning[{warning.code}]: {warning.message}", *(f"  help: {text}" for text in warning.help)]
        for text in texts:
            yield from textwrap.wrap(text, width, initial_indent="  ", subsequent_indent="      ")


def _counts(summary: Summary) -> str:
    """Words on the number of cases that reached their end, and that failed."""
    if summary.cases == 1:
        return "the case failed" if summary.failed else "the case reached its end"
    done = summary.cases - summary.failed
    return f"{done:,} of {summary.cases:,} cases reached their end" + (
        f", {summary.failed:,} failed" if summary.failed else ""
    )


def _metric_table(summary: Summary) -> Iterator[str]:
    """The table of metrics, with their spread over the cases and the error by the step where it is known."""
    single = summary.cases == 1
    columns = SUMMED_COLUMNS if isinstance(summary.metrics[0], SummedMetric) else SPREAD_COLUMNS
    head = ("",) if single else tuple(column.head for column in columns)
    errors = summary.verified
    rows = [("", *head, *([] if errors is None else ["±"]), "", "")]
    for metric in summary.metrics:
        unit = "" if metric.deck_unit == "1" else pretty_unit(metric.deck_unit)
        numbers = list(_metric_numbers(metric, single, columns))
        if errors is not None:
            error = error_text(errors.metrics.get(metric.name), metric.deck_scale)
            numbers.append(error if not single else "" if error == NONE else f"± {error}")
        infinite = f"; infinite in {metric.infinite:,}" if metric.infinite and not single else ""
        rows.append((metric.name, *numbers, unit, f"{metric.about}{infinite}"))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows[1:] if single else rows:
        cells = (" " if single else "  ").join(
            f"{text:{'<' if text.startswith('± ') else '>'}{wide}}"
            for text, wide in zip(row[1:-2], widths[1:-2], strict=True)
        )
        yield f"  {row[0]:<{widths[0]}}  {cells} {row[-2]:<{widths[-2]}}  {row[-1]}".rstrip()


def _metric_numbers(metric: MetricSummary, single: bool, columns: Sequence[SpreadColumn]) -> tuple[str, ...]:
    """The numbers of a metric's finite values, as texts."""
    if single:
        return ("inf" if metric.infinite else _text(metric.median, metric),)
    return tuple(_text(getattr(metric, column.field), metric) for column in columns)


def _text(value: float, metric: MetricSummary) -> str:
    return "-" if math.isnan(value) else number_text(value / metric.deck_scale)


def signal_lines(archive: ArchiveFile, group: ArchiveGroup, signals: Sequence[str], case: int | None) -> list[str]:
    """The ranges of signals in one case, a row for each joint or component, and the command that draws them.

    Instants are the first at which a value is reached; a signal without finite values has none. Raises Problem E323,
    E324.
    """
    if not group.recorded:
        if signals:
            panels(group, signals)  # says that there are none
        return ["no histories kept"]
    position = int(group.recorded_positions[0]) if case is None else case
    row = f"'#{group.values('case')[position]}'"
    if position not in group.recorded_positions:
        return [f"its history was not kept: `met run {quoted(group.path)} --case {row}` runs it again"]
    units = DeckUnits(archive, group)
    recorded = [units.panel(panel) for panel in panels(group, signals)]
    listed = recorded if signals else recorded[:SIGNALS]
    time = group.values("time")
    rows: list[tuple[str, ...]] = [("", "", "first", "last", "smallest", "at", "largest", "at", "", "")]
    for panel in listed:
        unit = "" if panel.unit == "1" else pretty_unit(panel.unit)
        for label, values in zip(panel.lines, history(group, panel, position).T, strict=True):
            rows.append((panel.name, label, *_range_texts(time, values), unit, panel.about))
    one_of_many = group.count > 1
    out = [case_text(group, position)] if one_of_many and case is None else []
    out += columns(rows, right=range(2, 8))
    names = list(dict.fromkeys(panel.name for panel in recorded))
    rest = [name for name in names if name not in {panel.name for panel in listed}]
    if rest:
        out.append(f"also recorded: {', '.join(rest)}")
    of_run = f" --run {quoted(group.name)}" if len(archive.groups) > 1 else ""
    of_case = f" --case {row}" if one_of_many else ""
    return [*out, f"`met plot {quoted(group.path)} {' '.join(names)}{of_run}{of_case}` draws them"]


def _range_texts(time: np.ndarray, values: np.ndarray) -> tuple[str, ...]:
    """The first, last, smallest and largest finite value of a line, the latter two with their instants."""
    finite = np.flatnonzero(np.isfinite(values))
    if len(finite) == 0:
        return ("-",) * 6
    low, high = finite[np.argmin(values[finite])], finite[np.argmax(values[finite])]
    first, last, smallest, largest = (number_text(values[row]) for row in (finite[0], finite[-1], low, high))
    return first, last, smallest, f"{number_text(time[low])} s", largest, f"{number_text(time[high])} s"
