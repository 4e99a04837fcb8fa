"""The cases of an archive one by one: which failed, which missed a requirement and by how much, worst first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, Group, Stored
from batch.failures import STATUS
from batch.signals import deck_unit, number_text, value_text
from batch.summary import finite
from met.diagnostic import Problem

SHOWN_CASES = 20
"""Rows of the table unless all are asked for."""

MISSES = "\N{BALLOT X}"


def worst_first(group: Group) -> np.ndarray:
    """Positions of the cases: failed ones, then those that miss most requirements, then by how far they miss.

    How far is relative to the limit (to the largest value where the limit is 0); a case that meets all requirements
    stands by how close it comes to one. Without requirements the order is the case table's.
    """
    keys, outcomes = [np.arange(group.count)], _outcomes(group)
    if outcomes.shape[1]:
        keys += [-_excess(group), -(outcomes != 1).sum(axis=1)]
    return np.lexsort((*keys, group.values("status") == 0))


def table(group: Group, most: int | None = SHOWN_CASES, *, hint: bool = True) -> list[str]:
    """The cases as lines, worst first, in the deck's units; a metric that misses a requirement bears a cross.

    most: how many, None for all; hint: whether to say how many are left out.
    """
    from ic.printing.columns import columns

    positions = worst_first(group)
    left = 0 if most is None else max(0, len(positions) - most)
    positions = positions[: len(positions) - left]
    outcomes = _outcomes(group, positions)
    cells = [["", *(f"#{row}" for row in group.at("case", positions))]]
    cells.append(["id", *(case_id[:8] for case_id in group.at("case_id", positions))])
    marks, units = _marks(group, outcomes), ["", ""]
    if "repeat" in group.variables and group.values("repeat").any():
        cells.append(["repeat", *map(str, group.at("repeat", positions))])
        units.append("")
    for variable in (*group.role("coordinate"), *group.role("metric")):
        scale, unit = deck_unit(variable)
        texts = [number_text(value / scale) for value in group.at(variable.name, positions)]
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


def title(group: Group, most: int | None = None) -> str:
    """What the order of the table is, or of its beginning."""
    outcomes = _outcomes(group)
    number = f"{min(most, group.count)} " if most is not None else ""
    if (group.values("status") != 0).any() or (outcomes != 1).any():
        return f"the {number}worst cases:" if number else "cases, worst first:"
    near = f"the {number}cases closest to a limit:" if number else "cases, closest to a limit first:"
    return near if outcomes.shape[1] else "cases:"


def rows_json(
    group: Group, most: int | None = SHOWN_CASES, *, positions: Sequence[int] | np.ndarray | None = None
) -> list[dict[str, Any]]:
    """The same for programs, in SI, of these cases or of the worst: what a case is, how it ended, its metrics (null
    where not finite), and whether it meets each requirement (null where that is not known)."""
    positions = worst_first(group)[:most] if positions is None else np.asarray(positions)
    numbers = [variable.name for variable in (*group.role("coordinate"), *group.role("metric"))]
    repeats = {"repeat": group.at("repeat", positions)} if "repeat" in group.variables else {}
    values = {name: group.at(name, positions) for name in ("case", "case_id", "status", "cause", *numbers)}
    texts = [str(text) for text in group.values("requirement")] if "requirement" in group.variables else []
    outcomes = _outcomes(group, positions)
    return [
        {
            "row": int(values["case"][i]),
            "case_id": str(values["case_id"][i]),
            **{each: int(found[i]) for each, found in repeats.items()},
            "status": STATUS.get(int(values["status"][i]), "unknown"),
            "cause": str(values["cause"][i]),
            "coordinates": {v.path: finite(float(values[v.name][i])) for v in group.role("coordinate")},
            "metrics": {v.name: finite(float(values[v.name][i])) for v in group.role("metric")},
            "met": {text: {1: True, 0: False}.get(int(value)) for text, value in zip(texts, outcomes[i], strict=True)},
        }
        for i in range(len(positions))
    ]


def parameters(archive: ArchiveFile, group: Group, position: int) -> dict[str, dict[str, Any]]:
    """All parameters of a case by path: SI value, unit, and whether it follows from what is varied."""
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


def varied_lines(archive: ArchiveFile, group: Group, position: int) -> list[str]:
    """What is varied in a case, and every parameter that follows from it."""
    from ic.printing.columns import columns

    coordinates = group.role("coordinate")
    if not coordinates:
        return []
    rows = [[v.path, value_text(group.at(v.name, [position])[0], v)] for v in coordinates]
    try:
        followers = parameters(archive, group, position)
    except Problem:  # a model of the plan's is not installed here; what was varied is known all the same
        followers = {}
    for path, given in followers.items():
        if given["varies"] and path not in group.variables:
            plain = Stored(path, (), "", given["unit"], (), "", {})
            rows.append([path, value_text(given["value"], plain)])
    out = ["varied, and what follows from it:", *columns(rows)]
    return [*out, f"  of {len(followers)} parameters; --format json lists them all"] if followers else out


# Outcomes


def _outcomes(group: Group, positions: np.ndarray | None = None) -> np.ndarray:
    """(case, requirement): 1 met, 0 missed, -1 unknown; of all cases or of some."""
    if "met" not in group.variables:
        return np.zeros((group.count if positions is None else len(positions), 0), np.int8)
    return group.values("met") if positions is None else group.at("met", positions)


def _outcome(status: int, outcomes: np.ndarray) -> str:
    if status != 0:
        return STATUS.get(int(status), "failed")
    if not len(outcomes):
        return ""
    return "missed" if (outcomes == 0).any() else "unknown" if (outcomes < 0).any() else "met"


def _limits(group: Group) -> list[tuple[int, str, str, float]]:
    """Index, metric's variable, comparison and limit of each requirement; none in an archive that does not say."""
    if "requirement" not in group.variables:
        return []
    told = group.variables["requirement"].attributes
    metrics, comparisons, limits = (_listed(told.get(name, [])) for name in ("metric", "comparison", "limit"))
    if not len(metrics) == len(comparisons) == len(limits) == len(group.values("requirement")):
        return []
    known = {variable.name for variable in group.role("metric")}
    given = enumerate(zip(metrics, comparisons, limits, strict=True))
    return [(i, m, str(c), float(x)) for i, (m, c, x) in given if m in known and isinstance(x, float)]


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _marks(group: Group, outcomes: np.ndarray) -> dict[str, np.ndarray]:
    """By metric that has requirements: which of the cases miss one."""
    out: dict[str, np.ndarray] = {}
    for index, metric, _, _ in _limits(group):
        out[metric] = out.get(metric, False) | (outcomes[:, index] == 0)
    return out


def _excess(group: Group) -> np.ndarray:
    """How far each case is beyond the limit it violates most, relative to the limit; what is unknown is infinitely."""
    worst = np.full(group.count, -np.inf)
    for _, metric, comparison, limit in _limits(group):
        values = group.values(metric)
        finite = values[np.isfinite(values)]
        scale = abs(limit) or float(np.abs(finite).max(initial=0.0)) or 1.0
        beyond = (values - limit if comparison.startswith("<") else limit - values) / scale
        worst = np.maximum(worst, np.where(np.isnan(beyond), np.inf, beyond))
    return worst
