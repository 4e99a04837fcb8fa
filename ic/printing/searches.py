"""A search or a tuning of a plan in words: its goal, the bounds of its parameters, and its plants."""

from __future__ import annotations

from collections.abc import Iterator

from ic.printing.columns import columns, count, size
from met.plan import Experiment
from met.plan.searches import Search
from met.unit_parser import decimals, written


def budget(search: Search) -> str:
    """The goal with the number of cases: `maximise effort, in at most 2,000 cases`."""
    return f"{search.goal}, in at most {count(search.at_most, 'case')}"


def search_lines(experiment: Experiment, search: Search) -> Iterator[str]:
    """The search in lines: its goal and its parameters."""
    case_bytes = experiment.structure.history_bytes
    histories = f"; {size(case_bytes)} of histories a case" if case_bytes else ""
    yield f"{search.kind.capitalize()}: {budget(search)}{histories}"
    rows = []
    units = {coordinate.path: coordinate.unit for coordinate in experiment.cases.coordinates}
    for each_parameter in search.parameters:
        unit = units[each_parameter.path]
        ends = f"{decimals([each_parameter.low], unit)[0]} to {written(each_parameter.high, unit)}"
        rows.append((each_parameter.path, f"{ends}{', by equal ratios' * each_parameter.logarithmic}"))
    yield from columns(rows)
    if search.against:
        borne = [coordinate.path for coordinate in experiment.cases.coordinates[len(search.parameters) :]]
        yield f"  against {count(len(search.plants), 'case')} of {search.against}: {', '.join(borne)}"
    if search.fresh:
        yield f"  confirmed by {count(len(search.fresh), 'case')} of {search.confirms}"
    if search.kind == "tune" and experiment.requirements:
        required = ", ".join(requirement.text for requirement in experiment.requirements)
        yield f"  with a margin of {100.0 * search.margin:g} % to the limits of {required}"
    if search.steers:
        yield f"  candidates keep a disk margin of {search.least_margin:g}"
    elif search.kind == "tune" and not search.least_margin:
        yield "  its stability is not judged"
