"""Every parameter of what was run: its value, and the line of the deck that wrote it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from batch.queries.grids import levels
from batch.queries.pool import Pool, page_number
from batch.queries.signals import pretty_unit
from batch.report.contents.parts import ParameterRow, Spot, VariedParameter
from ic.printing.columns import number
from ic.printing.settings import settings
from met.diagnostic import Place
from met.distinct import distinct
from met.messages.message import shown_place
from met.plan import Experiment, Formula, Origin, Quantity

SAID = {"deck": "deck", "case": "varied", "default": "default", "derived": "computed"}
MOST_LISTED = 6
"""Largest number of values that are listed; of more only the ends."""

MOST_ROWS = 10_000
"""Largest number of cases, spread over all, from which the range of dependent parameters is computed."""


def spot(place: Place | None) -> Spot | None:
    """The line of the deck that its author should look at."""
    if place is None:
        return None
    deck_place = shown_place(place)
    return Spot(deck_place.file, deck_place.line)


def parameters(pool: Pool, experiments: Mapping[str, Experiment]) -> tuple[ParameterRow, ...]:
    """The parameters of all structures: settings of the run, then parameters, each once where all structures have it
    alike."""
    rows_of_path: dict[str, dict[ParameterRow, list[str]]] = {}
    names = [group.name for group in pool.groups if group.name in experiments]
    for name in names:
        experiment = experiments[name]
        quantities = {**settings(experiment), **experiment.parameters}
        spans = _spans(experiment)
        for path, quantity in quantities.items():
            row = _row(path, quantity, spans)
            rows_of_path.setdefault(path, {}).setdefault(row, []).append(name)
    out = []
    for rows in rows_of_path.values():
        for row, among in rows.items():
            alike = len(among) == len(names)
            out.append(row if alike else replace(row, among=tuple(among)))
    return tuple(out)


def _spans(experiment: Experiment) -> dict[int, tuple[float, float]]:
    """For each output of the formulas, the smallest and the largest value, over at most `MOST_ROWS` cases."""
    count = experiment.cases.count
    rows = distinct(np.linspace(0, count - 1, min(count, MOST_ROWS)).astype(int))
    inputs = {coordinate.path: coordinate.values[rows] for coordinate in experiment.cases.coordinates}
    outputs = (np.asarray(values, dtype=float) for values in experiment.formulas.replay(inputs))
    return {place: (float(values.min()), float(values.max())) for place, values in enumerate(outputs)}


def _row(path: str, quantity: Quantity, spans: Mapping[int, tuple[float, float]]) -> ParameterRow:
    """The row of a parameter: value, unit, and where it is from. spans: least and greatest value of each formula over
    the cases"""
    unit = "" if quantity.unit == "1" else pretty_unit(quantity.unit)
    origin = quantity.origin
    return ParameterRow(
        path,
        _value(quantity, spans),
        unit,
        _origin_text(origin),
        spot(origin.place),
        tuple(dict.fromkeys(place for place in map(spot, origin.overrides) if place is not None)),
    )


def _origin_text(origin: Origin) -> str:
    """A word for where a parameter's value is from, with its note."""
    if origin.kind == "case":
        return SAID["case"]
    return f"{SAID[origin.kind]}: {origin.note}" if origin.note else SAID[origin.kind]


def _value(quantity: Quantity, spans: Mapping[int, tuple[float, float]]) -> str:
    """A parameter's value in words; one that varies as its range over the cases."""
    match quantity.value:
        case str() as text:
            return text
        case tuple() as values:
            texts = [number(value) for value in values]
            if len(texts) > MOST_LISTED:
                texts = [*texts[:2], "…", texts[-1]]
                return f"[{', '.join(texts)}] ({len(values)} values)"
            return f"[{', '.join(texts)}]"
        case Formula() as formula:
            low, high = spans[formula.output]
            return number(low) if low == high else f"{number(low)} … {number(high)}"
        case value:
            return number(float(value))


def varied(pool: Pool, experiments: Mapping[str, Experiment]) -> tuple[VariedParameter, ...]:
    """The parameters and choices that differ between cases, with their values."""
    places: dict[str, tuple[Spot | None, tuple[str, ...]]] = {}
    for experiment in experiments.values():
        for choice in experiment.cases.choices:
            places.setdefault(choice.path, (spot(choice.place), ()))
        for coordinate in experiment.cases.coordinates:
            places.setdefault(coordinate.path, (spot(coordinate.place), coordinate.sets))
    out = []
    for column in pool.columns:
        if column.role == "metric":
            continue
        where, sets = places.get(column.label, (None, ()))
        texts: Sequence[str] = column.words or [page_number(float(value)) for value in levels(column.values)]
        few = ", ".join(texts) if len(texts) <= MOST_LISTED else ""
        many = f"{len(texts):,} values from {texts[0]} to {texts[-1]}" if texts else ""
        out.append(
            VariedParameter(column.label, few or many, column.unit, where, tuple(s for s in sets if s != column.label))
        )
    return tuple(out)
