"""Data for a page that runs cases again: each structure's module, the cases' inputs, and the archive's results.

A page that has only the histories of a few cases computes all others where it is read. Inputs and metrics are kept to
the bit, so that it can compare what it computed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from batch.archive.layout import layout
from batch.archive.read import ArchiveGroup
from batch.archive.stored import Stored
from batch.archive.values import times_of, values_of_dimensions
from batch.arms.drawn import drawn_arm
from batch.modules.description import described
from batch.queries.pool import Pool
from batch.report.contents.against import EarlierCases
from batch.report.contents.overview import MOST_POINTS
from batch.report.contents.parts import Overview, Signals
from batch.report.contents.simulated import PageSimulation, SimulatedStructure
from met.plan import Experiment
from met.run import inputs, prepare

MOST_STRUCTURES = 8
"""Largest number of structures of a page with a module: each takes seconds to compile."""

MOST_EXACT = 600_000
"""Largest size in bytes of inputs and metrics of a section's cases."""


def simulation(
    pool: Pool,
    experiments: Mapping[str, Experiment],
    drawn: Signals,
    first: Sequence[int],
    points: Overview | None,
    before: EarlierCases | None = None,
    *,
    meshes: bool = True,
) -> PageSimulation | None:
    """The modules of a pool's structures, and of as many cases as there is room for what they are run with; None where
    the plan cannot be read here.

    first   numbers of the cases that are wanted before others
    points  the cases that are drawn, of which the worst come next; None: all are
    before  another archive to compare with: its program of these cases is there too, where its plan can be read here
    meshes  whether links are drawn by their meshes
    """
    groups = {n: group for n, group in enumerate(pool.groups[:MOST_STRUCTURES]) if group.name in experiments}
    if not groups:
        return None
    others = pool.cases[pool.worst_first]
    others = others[np.isin(others, points.cases)] if points is not None else others[:MOST_POINTS]
    numbers = np.array(list(dict.fromkeys([*first, *others.tolist()])), np.int64)
    structures, left = [], MOST_EXACT
    earlier = {} if before is None else before.experiments()
    for number, group in groups.items():
        of_group = pool.group_of == number
        mine = numbers[np.isin(numbers, pool.cases[of_group])]
        sources = drawn.sources[number]
        folder = group.path.parent if meshes else None
        structure, left = _structure(group, experiments[group.name], mine, sources, left, folder)
        if before is not None:
            was, left = _earlier(before, earlier, number, structure, sources, left)
            structure = replace(structure, before=was)
        structures.append(structure)
    notes = []
    count = sum(len(structure.cases) for structure in structures)
    if count < pool.count:
        notes.append(f"{count:,} of {pool.count:,} cases can be run again in this page.")
    if len(groups) < len(pool.groups):
        notes.append(f"The first {len(groups)} of {len(pool.groups)} structures can be run again in this page.")
    return PageSimulation(tuple(structures), tuple(notes))


def _earlier(
    before: EarlierCases,
    experiments: Mapping[str, Experiment],
    number: int,
    now: SimulatedStructure,
    sources: Sequence[Sequence[str]],
    left: int,
) -> tuple[SimulatedStructure | None, int]:
    """The other archive's data of a structure's cases, and the remaining bytes; None where it has none of them or its
    plan cannot be read here. number: the structure's place in the pool"""
    for place, group, matched in before.pairs:
        if place != number or group.name not in experiments:
            continue
        mine, theirs = before.now.groups[number].values("case"), group.values("case")
        pairs = dict(zip(mine[matched.cases.b].tolist(), theirs[matched.cases.a].tolist(), strict=True))
        both = [case for case in now.cases.tolist() if case in pairs]
        wanted = np.array([pairs[case] for case in both], np.int64)
        structure, left = _structure(group, experiments[group.name], wanted, sources, left, None)
        cases = np.array(both[: len(structure.cases)], np.int64)
        # on the arm of an earlier archive, a ghost, nothing is drawn that acts on it
        return replace(structure, cases=cases, arm=replace(structure.arm, acting=None)), left
    return None, left


def _structure(
    group: ArchiveGroup,
    experiment: Experiment,
    wanted: np.ndarray,
    sources: Sequence[Sequence[str]],
    left: int,
    folder: Path | None,
) -> tuple[SimulatedStructure, int]:
    """A structure with as many of the wanted cases as fit in `left` bytes, and the remaining bytes. sources: the
    channel of each line of each panel; folder: where files of meshes are looked for, None to draw none"""
    from met.backends.wasm.module import compiled

    prepared = prepare(experiment)
    module = compiled(prepared.recording)
    description = described(prepared, module)
    stored = {metric.name.removeprefix("metrics."): metric.name for metric in group.role("metric")}
    metrics = [stored[metric["name"]] for metric in description["metrics"] if metric["name"] in stored]
    width = 8 * (len(description["inputs"]) + len(metrics)) or 8
    wanted = wanted[: left // width]
    positions = np.searchsorted(group.values("case"), wanted)
    rows = np.searchsorted(experiment.cases.table, wanted)
    columns = {column["channel"]: place for place, column in enumerate(description["columns"])}
    structure = SimulatedStructure(
        code=module.code,
        description=description,
        same_code=prepared.code_key == group.attributes.get("code_key"),
        cases=wanted,
        inputs=inputs(experiment, np.asarray(rows, np.int64)),
        metrics=tuple((name, group.at(name, positions)) for name in metrics),
        status=group.at("status", positions),
        panels=tuple(tuple(columns.get(channel, -1) for channel in panel) for panel in sources),
        arm=drawn_arm(experiment, list(columns), folder),
    )
    return structure, left - width * len(wanted)


class ComputedGroup(ArchiveGroup):
    """A group whose signals are in no archive: those that a run of its experiment would record."""

    def __init__(self, group: ArchiveGroup, experiment: Experiment) -> None:
        """Describe the variables that an archive of the experiment with one recorded case would have."""
        self.__dict__.update(group.__dict__)
        laid = layout(experiment, 1, 1).variables
        self._dimensions = values_of_dimensions(experiment) | {"time": times_of(experiment)}
        self.__dict__["variables"] = {
            variable.name: Stored(
                variable.name,
                variable.dims,
                variable.role,
                variable.unit,
                tuple(variable.attributes.get("units_by_joint", ())),
                variable.long_name,
                dict(variable.attributes),
            )
            for variable in laid
        }

    def values(self, name: str) -> np.ndarray:
        return np.asarray(self._dimensions[name])
