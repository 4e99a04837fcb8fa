"""The case table of a sweep: position, name and coordinates of each case, in the units that the deck uses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ic.printing.columns import columns, count, size
from ic.printing.plan import budget
from ic.sweeps.confidences import OF_CASES
from met.plan import Coordinate, Experiment, keys
from met.plan.columns import row_at
from met.unit_parser import decimals

HEAD, TAIL = 30, 10
SHORTEST = 4
MOST_COMPARED = 10_000_000
REPEAT = "repeat"
SAMPLED = "sample"


def print_cases(groups: Sequence[Experiment], *, everything: bool = False) -> Iterator[str]:
    """Line by line the table of one sweep, of which these are the groups; of a long one the head and the tail."""
    total = sum(group.cases.count for group in groups)
    most = "at most " * any(group.cases.until_shown for group in groups)
    title = f"{groups[0].name_in_deck}: {most}{count(total, 'case')}"
    if len(groups) > 1:
        yield f"{title}, {len(groups)} structures"
        yield from _structures(groups)
        yield ""
    else:
        case_bytes = groups[0].structure.history_bytes
        yield title + (f", {size(case_bytes)} of histories each" if case_bytes and total > 1 else "")
    if (search := groups[0].search) is not None and not search.complete:
        yield f"  the first ones of a {search.kind}, {budget(search)}: what they give decides those behind them"
    for note in dict.fromkeys(note for group in groups for note in group.notes if note.startswith((SAMPLED, OF_CASES))):
        yield f"  {note}"
    cut = not everything and total > HEAD + TAIL
    positions = [*range(HEAD), *range(total - TAIL, total)] if cut else range(total)
    rows = _Rows(groups, positions if cut else None)
    short = _short(groups, rows.ids)
    heads = ["", "id", *rows.choices, *(path for path, _ in rows.coordinates), *([REPEAT] if rows.repeated else [])]
    units = ["", "", *("" for _ in rows.choices), *(unit for _, unit in rows.coordinates), *([""] * rows.repeated)]
    table = [heads, units] if any(units) else [heads]
    table += [[f"#{position}", short[n], *rows.cells(n)] for n, position in enumerate(positions)]
    first = 2 + len(rows.choices)
    lines = columns(table, right=(0, *range(first, len(heads))))
    if cut:
        lines.insert(len(lines) - TAIL, f"  ... {total - HEAD - TAIL} more; --all prints them")
    yield from lines


def _structures(groups: Sequence[Experiment]) -> Iterator[str]:
    """For each group of a sweep, its choices, its number of cases, and the size of a case's record."""
    paths = list(dict.fromkeys(choice.path for group in groups for choice in group.cases.choices))
    rows = [["group", *paths, "cases", "a case"]]
    for group in groups:
        chosen = {choice.path: choice.value for choice in group.cases.choices}
        values = [chosen.get(path, "") for path in paths]
        rows.append([group.name, *values, str(group.cases.count), size(group.structure.history_bytes)])
    yield from columns(rows, right=(len(paths) + 1, len(paths) + 2))


class _Rows:
    """The rows of all groups of a sweep, by position in its table, or those at some ascending positions."""

    def __init__(self, groups: Sequence[Experiment], positions: Sequence[int] | None = None) -> None:
        """groups: those of one sweep; positions: None for all rows"""
        rows = [np.arange(g.cases.count) if positions is None else _rows_at(g, positions) for g in groups]
        everything = np.concatenate([group.cases.table[own] for group, own in zip(groups, rows, strict=True)])
        order = np.argsort(everything, kind="stable")
        self.experiments = groups
        self.groups = np.concatenate([np.full(len(own), n) for n, own in enumerate(rows)])[order]
        self.rows = np.concatenate(rows)[order]
        ids = [case_id for group, own in zip(groups, rows, strict=True) for case_id in keys.case_ids(group, own)]
        self.ids = [ids[n] for n in order]
        self.choices = list(dict.fromkeys(choice.path for group in groups for choice in group.cases.choices))
        named = (coordinate for group in groups for coordinate in group.cases.coordinates)
        self.coordinates = list(dict.fromkeys((c.path, "" if c.unit == "1" else c.unit) for c in named))
        self.repeated = any(group.cases.repeats is not None for group in groups)
        self._chosen = [{choice.path: choice.value for choice in group.cases.choices} for group in groups]
        self._columns: list[dict[str, Coordinate]] = [{c.path: c for c in g.cases.coordinates} for g in groups]

    def value(self, position: int, path: str) -> float | None:
        """A coordinate in SI; None where this case has no such coordinate."""
        coordinate = self._columns[self.groups[position]].get(path)
        return None if coordinate is None else float(coordinate.values[self.rows[position]])

    def repeat(self, position: int) -> int:
        repeats = self.experiments[self.groups[position]].cases.repeats
        return 0 if repeats is None else int(repeats[self.rows[position]])

    def cells(self, position: int) -> list[str]:
        """Cells of the row after its id."""
        cells = [self._chosen[self.groups[position]].get(path, "") for path in self.choices]
        values = [(self.value(position, path), unit) for path, unit in self.coordinates]
        cells += ["" if value is None else decimals([value], unit)[0] for value, unit in values]
        return [*cells, *([str(self.repeat(position))] if self.repeated else [])]


def _rows_at(group: Experiment, positions: Sequence[int]) -> np.ndarray:
    """The rows of a group at these positions of its sweep's table, as far as it has them."""
    rows = [row_at(group.cases.table, position) for position in positions]
    return np.array([row for row in rows if row is not None], np.int64)


def cases_json(groups: Sequence[Experiment]) -> dict[str, Any]:
    """The cases for programs, in SI, in full; a value is null where a case of this group has no such coordinate."""
    rows = _Rows(groups)
    first = {c.path: c for group in reversed(groups) for c in group.cases.coordinates}
    paths = list(first)
    cases = []
    for position, case_id in enumerate(rows.ids):
        values = [rows.value(position, path) for path in paths]
        case: dict[str, Any] = {"position": position, "id": case_id, "values": values}
        if len(groups) > 1:
            case["group"] = groups[rows.groups[position]].name
        if rows.repeated:
            case["repeat"] = rows.repeat(position)
        cases.append(case)
    return {
        "experiment": groups[0].name_in_deck,
        "count": len(rows.ids),
        "groups": [
            {
                "name": group.name,
                "count": group.cases.count,
                "choices": {choice.path: choice.value for choice in group.cases.choices},
                "history_bytes": group.structure.history_bytes,
            }
            for group in groups
        ],
        "coordinates": [{"path": c.path, "deck_unit": c.unit, "scale": c.scale} for c in first.values()],
        "cases": cases,
    }


def _short(groups: Sequence[Experiment], ids: list[str]) -> list[str]:
    """The beginnings of these ids that distinguish all cases; whole ids where there are very many."""
    total = sum(group.cases.count for group in groups)
    if len(ids) == total:
        return prefixes(ids)
    if total > MOST_COMPARED:
        return ids
    numbers = np.sort(np.concatenate([keys.id_numbers(group).astype(np.uint64) for group in groups]))
    apart = numbers[1:] ^ numbers[:-1]
    least = int(apart[apart > 0].min(initial=2**64 - 1))  # of the two with the longest common beginning
    shared = (64 - least.bit_length()) // 4
    return [case_id[: max(SHORTEST, 1 + shared)] for case_id in ids]


def prefixes(names: list[str]) -> list[str]:
    """The shortest beginnings, all of one length, that distinguish the names."""
    length = 1 + max((_shared(a, b) for a, b in pairwise(sorted(names)) if a != b), default=0)
    return [name[: max(SHORTEST, length)] for name in names]


def _shared(a: str, b: str) -> int:
    """The length of the common beginning."""
    return next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
