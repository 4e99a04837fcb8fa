"""The case table of a sweep: position, name and coordinates of each case, in the units that the deck uses."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from ic.printing.columns import columns, count, number
from met import keys
from met.plan import Experiment

HEAD, TAIL = 30, 10
SHORTEST = 4


def print_cases(experiment: Experiment, *, everything: bool = False) -> Iterator[str]:
    """Line by line; of a long table the head and the tail, unless `everything` is asked for."""
    cases = experiment.cases
    names = prefixes(keys.case_ids(experiment))
    yield f"{experiment.name}: {count(cases.count, 'case')}"
    positions = list(range(cases.count))
    cut = not everything and cases.count > HEAD + TAIL
    if cut:
        positions = [*positions[:HEAD], *positions[-TAIL:]]
    units = ["" if coordinate.unit == "1" else coordinate.unit for coordinate in cases.coordinates]
    rows = [["", "id", *(coordinate.path for coordinate in cases.coordinates)], ["", "", *units]]
    for position in positions:
        shown = [number(float(c.values[position]) / c.scale) for c in cases.coordinates]
        rows.append([f"#{position}", names[position], *shown])
    if not any(units):
        del rows[1]
    lines = columns(rows, right=(0, *range(2, 2 + len(units))))
    if cut:
        lines.insert(len(lines) - TAIL, f"  ... {cases.count - HEAD - TAIL} more; --all prints them")
    yield from lines


def cases_json(experiment: Experiment) -> dict[str, Any]:
    """The same for programs, in SI, whole."""
    coordinates = experiment.cases.coordinates
    names = keys.case_ids(experiment)
    columns_ = [coordinate.values.tolist() for coordinate in coordinates]
    return {
        "experiment": experiment.name,
        "count": experiment.cases.count,
        "coordinates": [{"path": c.path, "deck_unit": c.unit, "scale": c.scale} for c in coordinates],
        "cases": [
            {"position": position, "id": names[position], "values": [column[position] for column in columns_]}
            for position in range(experiment.cases.count)
        ],
    }


def prefixes(names: list[str]) -> list[str]:
    """The shortest beginnings, all of one length, that tell the names apart."""
    length = 1 + max((_shared(a, b) for a, b in pairwise(sorted(names)) if a != b), default=0)
    return [name[: max(SHORTEST, length)] for name in names]


def _shared(a: str, b: str) -> int:
    """How many characters both begin with."""
    return next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
