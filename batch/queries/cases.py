"""The cases of an archive one by one: failed ones, and those that missed a requirement, with the amount."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.archive.stored import Stored
from batch.queries import ordering, requirements
from batch.queries.ordering import CaseOrder
from batch.queries.pool import ENDED, STATUS, Pool
from batch.queries.signals import deck_unit, number_text, number_texts, value_text
from batch.queries.summary import finite
from batch.queries.tallies import is_streamed, summed_up
from met.diagnostic import Problem
from met.distinct import distinct

SHOWN_CASES = 20
"""Number of rows of the table unless all are asked for."""

MISSES = "\N{BALLOT X}"


def table(
    group: ArchiveGroup,
    most: int | None = SHOWN_CASES,
    *,
    by: CaseOrder | None = None,
    among: np.ndarray | None = None,
    hint: bool = True,
) -> list[str]:
    """The cases as lines, worst first or in the order `by`, in the deck's units; a metric that misses a requirement
    bears a cross.

    most: how many, None for all; among: positions, None for all; hint: whether to say how many are left out.
    """
    from ic.printing.columns import columns

    listed = _listed(group, by, among, most)
    positions = listed[:most]
    left = len(listed) - len(positions)
    outcomes = requirements.outcomes(group, positions)
    cells = [["", *(f"#{row}" for row in group.at("case", positions))]]
    cells.append(["id", *(case_id[:8] for case_id in group.at("case_id", positions))])
    marks, units = _marks(group, outcomes), ["", ""]
    if "repeat" in group.variables and group.at("repeat", positions).any():
        cells.append(["repeat", *map(str, group.at("repeat", positions))])
        units.append("")
    for variable in (*group.role("coordinate"), *group.role("metric")):
        scale, unit = deck_unit(variable)
        values = [value / scale for value in group.at(variable.name, positions)]
        texts = number_texts(values) if variable.role == "coordinate" else list(map(number_text, values))
        name = variable.path
        if variable.name in marks:
            missed = marks[variable.name]
            texts = [f"{text} {MISSES if miss else ' '}" for text, miss in zip(texts, missed, strict=True)]
            name, unit = f"{name}  ", f"{unit}  "
        cells.append([name, *texts])
        units.append(unit)
    cells.append(["", *map(_outcome, group.at("status", positions), outcomes)])
    rows = [list(row) for row in zip(*cells, strict=True)]
    if any(unit.strip() for unit in units):
        rows.insert(1, [*units, ""])
    out = columns(rows, right=(0, *range(2, len(cells) - 1)))
    return [*out, f"  ... {left:,} more; --all-cases prints them"] if left and hint else out


def table_across(
    pool: Pool, by: CaseOrder, most: int | None = SHOWN_CASES, *, among: np.ndarray | None = None
) -> list[str]:
    """The cases of all structures of a sweep as lines, in the order `by`, with the values that distinguish the
    structures. among: places, None for all"""
    from ic.printing.columns import columns

    listed = _among(ordering.places(pool, by), among)
    places = listed[:most]
    left = len(listed) - len(places)
    cells = [["", "", *(f"#{case}" for case in pool.cases[places])]]
    cells.append(["id", "", *(case_id[:8] for case_id in pool.texts("case_id", places))])
    words = 0
    for column in pool.columns:
        values, name, unit = column.values[places], column.label, column.unit
        if column.role == "choice":
            words += 1
            cells.append([name, "", *("" if np.isnan(value) else column.words[int(value)] for value in values)])
            continue
        written = number_texts(values) if column.role == "parameter" else map(number_text, values)
        texts = ["" if np.isnan(value) else text for value, text in zip(values, written, strict=True)]
        if column.limits:
            missed = pool.missed(column)[places]
            texts = [f"{text} {MISSES if miss else ' '}" for text, miss in zip(texts, missed, strict=True)]
            name, unit = f"{name}  ", f"{unit}  "
        cells.append([name, unit, *texts])
    ended = [ENDED[number] for number in pool.ended[places]]
    cells.append(["", "", *("" if word == "done" else word for word in ended)])
    rows = [list(row) for row in zip(*cells, strict=True)]
    out = columns(rows, right=(0, *range(2 + words, len(cells) - 1)))
    return [*out, f"  ... {left:,} more; --all-cases prints them"] if left else out


def _among(order: np.ndarray, some: np.ndarray | None) -> np.ndarray:
    return order if some is None else order[np.isin(order, some)]


def title(group: ArchiveGroup, most: int | None = None, *, by: CaseOrder | None = None, every: bool = False) -> str:
    """The title of the table, with its order, and the choice of cases where not all have rows. every: whether all cases
    are listed"""
    if is_streamed(group) and by is None and not every:
        return f"of {group.count:,} cases those that stand out:"
    text = _title(group, most, by)
    return text if group.summary is None else f"of the rows that are kept, {text}"


def _listed(group: ArchiveGroup, by: CaseOrder | None, among: np.ndarray | None, most: int | None) -> np.ndarray:
    """Positions of the cases of the table, in order. If there are very many, and not all are asked for: those that
    stand out, in the order of the case table."""
    if (
        most is not None
        and by is None
        and among is None
        and is_streamed(group)
        and (summed := summed_up(group)) is not None
    ):
        named = distinct(np.concatenate([summed.values[name] for name in CASES]))
        return np.array([group.position_of(int(case)) for case in named[named >= 0][:MOST_STANDING_OUT]], np.int64)
    return _among(ordering.places(Pool(group.name, [group]), by), among)


CASES = ("judged_worst_case", "least_case", "most_case", "cause_first")
"""Variables of a summary that name cases."""

MOST_STANDING_OUT = 100
"""Largest number of cases that stand out and are listed among very many."""


def _title(group: ArchiveGroup, most: int | None, by: CaseOrder | None) -> str:
    """The title of the list of cases, by the order that it has."""
    if (order := ordering.order_of([group], by)) is not None:
        return order.title
    outcomes = requirements.outcomes(group)
    number = f"{min(most, group.count)} " if most is not None else ""
    failed = bool((group.values("status") != 0).any())
    equal = 0
    if failed or outcomes.shape[1]:
        equal = Pool(group.name, [group]).ranking.equal(SHOWN_CASES if most is None else most)
    if failed or (outcomes != 1).any():
        many = f" ({equal:,} are equally bad)" if equal else ""
        return f"the {number}worst cases{many}:" if number else f"cases, worst first{many}:"
    many = f" ({equal:,} are equally close)" if equal else ""
    near = f"the {number}cases closest to a limit{many}:" if number else f"cases, closest to a limit first{many}:"
    return near if outcomes.shape[1] else "cases:"


def rows_json(
    group: ArchiveGroup,
    most: int | None = SHOWN_CASES,
    *,
    by: CaseOrder | None = None,
    among: np.ndarray | None = None,
    positions: Sequence[int] | np.ndarray | None = None,
) -> list[dict[str, Any]]:
    """The table of cases for programs, in SI, of these cases or of the worst among some: each case's name, its end, its
    metrics (null where not finite), and whether it meets each requirement."""
    if positions is None:
        positions = _listed(group, by, among, most)[:most]
    positions = np.asarray(positions)
    numbers = [variable.name for variable in (*group.role("coordinate"), *group.role("metric"))]
    repeats = {"repeat": group.at("repeat", positions)} if "repeat" in group.variables else {}
    values = {name: group.at(name, positions) for name in ("case", "case_id", "status", "cause", *numbers)}
    texts = requirements.requirement_texts(group)
    outcomes = requirements.outcomes(group, positions)
    return [
        {
            "row": int(values["case"][i]),
            "case_id": str(values["case_id"][i]),
            **{name: int(repeat[i]) for name, repeat in repeats.items()},
            "status": STATUS.get(int(values["status"][i]), "unknown"),
            "cause": str(values["cause"][i]),
            "coordinates": {v.path: finite(float(values[v.name][i])) for v in group.role("coordinate")},
            "metrics": {v.name: finite(float(values[v.name][i])) for v in group.role("metric")},
            "met": {text: {1: True, 0: False}.get(int(value)) for text, value in zip(texts, outcomes[i], strict=True)},
        }
        for i in range(len(positions))
    ]


def parameters(archive: ArchiveFile, group: ArchiveGroup, position: int) -> dict[str, dict[str, Any]]:
    """All parameters of a case by path: SI value, unit, and whether it depends on varied ones."""
    from met.plan import Formula

    experiment = next(e for e in archive.plan().experiments if e.name == group.name)
    varied = {v.path: float(group.at(v.name, [position])[0]) for v in group.role("coordinate")}
    outputs = experiment.formulas.replay(varied)
    out = {}
    for path, quantity in experiment.parameters.items():
        follows = isinstance(quantity.value, Formula)
        value = float(outputs[quantity.value.output]) if isinstance(quantity.value, Formula) else quantity.value
        out[path] = {"value": value, "unit": quantity.unit, "varies": follows}
    return out


def varied_lines(archive: ArchiveFile, group: ArchiveGroup, position: int) -> list[str]:
    """Lines about a case: its varied values, and every parameter that depends on them."""
    from ic.printing.columns import columns

    coordinates = group.role("coordinate")
    if not coordinates:
        return []
    rows = [[v.path, value_text(group.at(v.name, [position])[0], v)] for v in coordinates]
    try:
        followers = parameters(archive, group, position)
    except Problem:  # a model of the plan is not installed here; the varied values are known all the same
        followers = {}
    for path, follower in followers.items():
        if follower["varies"] and path not in group.variables:
            plain = Stored(path, (), "", follower["unit"], (), "", {})
            rows.append([path, value_text(follower["value"], plain)])
    out = ["varied, and what follows from it:", *columns(rows)]
    return [*out, f"  of {len(followers)} parameters; --format json lists them all"] if followers else out


# Outcomes


def _outcome(status: int, outcomes: np.ndarray) -> str:
    """The outcome of a case in a word. outcomes: of its requirements, 1, 0 or -1"""
    if status != 0:
        return STATUS.get(int(status), "failed")
    if not len(outcomes):
        return ""
    return "missed" if (outcomes == 0).any() else "unknown" if (outcomes < 0).any() else "met"


def _marks(group: ArchiveGroup, outcomes: np.ndarray) -> dict[str, np.ndarray]:
    """For each metric with requirements, the cases that miss one."""
    out: dict[str, np.ndarray] = {}
    for group_requirement in requirements.group_requirements(group):
        out[group_requirement.metric] = out.get(group_requirement.metric, False) | (
            outcomes[:, group_requirement.place] == 0
        )
    return out
