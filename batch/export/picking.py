"""The choice of an export's contents: cases with histories, and numbers of their signals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.archive.stored import Stored
from batch.queries.pool import cases_named, groups_named
from batch.queries.signals import panels
from met.diagnostic import Problem
from met.frozen import frozen
from met.plan.channel import channel_paths


@frozen
class SignalColumn:
    """One number that changes in time.

    path       of its channel, `elbow.qd`, `links.tip.position.x`
    variable   the signal that has it;  place  among that signal's joints and components, counted as one
    parts      its names within the signal: joint, component, each where there are some
    """

    path: str
    unit: str
    about: str
    variable: str
    place: int
    parts: tuple[str, ...]


@frozen
class ExportedCase:
    """A case that is exported.

    position  in its group;  number  in the case table, as `--case '#7'` names it
    time      of its rows, s: those before it failed, if it did
    columns   of its signals, those of one signal side by side
    """

    group: ArchiveGroup
    position: int
    number: int
    time: np.ndarray
    columns: tuple[SignalColumn, ...]

    @property
    def run_name(self) -> str:
        """The run or sweep that it is of."""
        return self.group.sweep or self.group.name

    @property
    def signals(self) -> dict[str, list[SignalColumn]]:
        """The columns of each signal, by its name."""
        out: dict[str, list[SignalColumn]] = {}
        for column in self.columns:
            out.setdefault(column.variable, []).append(column)
        return out

    def value(self, name: str) -> Any:
        """The value of a variable of which each case has one, such as `status` or a metric."""
        return self.group.at(name, [self.position])[0]

    def signal(self, variable: str) -> np.ndarray:
        """A signal's numbers, (row, place), in the archive's order."""
        values = self.group.signal(variable, self.position)[: len(self.time)]
        return values.reshape(len(values), math.prod(values.shape[1:]))

    def values(self) -> dict[str, np.ndarray]:
        """The numbers of each column, [row], by the column's path."""
        signals = {name: self.signal(name) for name in dict.fromkeys(column.variable for column in self.columns)}
        return {column.path: signals[column.variable][:, column.place] for column in self.columns}


def pick(file: ArchiveFile, runs: Sequence[str], cases: Sequence[str], signals: Sequence[str]) -> list[ExportedCase]:
    """The cases of these runs and sweeps (none: of the first), in the given order (none: all that have histories, by
    their positions), with these signals. Raises Problem E321-E325, E328."""
    names = tuple(runs) or (file.groups[0].sweep or file.groups[0].name,)
    groups = groups_named(file, names)
    columns = _columns(groups, signals)
    wanted = dict.fromkeys(
        (group, group.recorded_position(case)) for case in cases for group, _ in cases_named(file, names, case)
    )
    for group, _ in wanted:
        if group.name not in columns:
            panels(group, signals)  # raises for signals that this structure of the sweep does not have
    exported = []
    for group in groups:
        if group.name in columns:
            numbers, valid, time = (group.values(name) for name in ("case", "n_valid", "time"))
            places = [place for other, place in wanted if other is group] if cases else group.recorded_positions
            for place in map(int, places):
                rows = time[: valid[place]]
                exported.append(ExportedCase(group, place, int(numbers[place]), rows, columns[group.name]))
    if cases:
        order = {key: place for place, key in enumerate(wanted)}
        return sorted(exported, key=lambda case: order[case.group, case.position])
    ranks = {group.name: rank(names, group) for group in groups}
    return sorted(exported, key=lambda case: (ranks[case.group.name], case.number))


def rank(names: Sequence[str], group: ArchiveGroup) -> int:
    """The first of the names by which a group is asked for."""
    return min(place for place, name in enumerate(names) if name in (group.name, group.sweep))


def _columns(groups: Sequence[ArchiveGroup], signals: Sequence[str]) -> dict[str, tuple[SignalColumn, ...]]:
    """The columns by group. A signal that only some structures of a sweep have is listed for those; one that none has
    is a Problem, and so are groups without histories."""
    out: dict[str, list[SignalColumn]] = {}
    known: dict[tuple[str, str], list[SignalColumn]] = {}
    for name in signals or ("",):
        problems = []
        for group in groups:
            try:
                signal_panels = panels(group, [name] if name else [])
            except Problem as problem:
                problems.append(problem)
                continue
            for panel in signal_panels:
                key = (group.name, panel.variable)
                known[key] = known.get(key) or _columns_of(group, group.variables[panel.variable])
                out.setdefault(group.name, []).extend(known[key][place] for place in panel.columns)
        if len(problems) == len(groups):
            raise problems[0]
    return {name: _ordered(columns) for name, columns in out.items()}


def _columns_of(group: ArchiveGroup, variable: Stored) -> list[SignalColumn]:
    """A column for each number of a signal, by joint and component, with its channel's path and unit."""
    joints, components = group.joints(variable), group.components(variable)
    owners: list[tuple[str, ...]] = [(joint,) for joint in joints] or [()]
    inner: list[tuple[str, ...]] = [(component,) for component in components] or [()]
    parts = [(*owner, *component) for owner in owners for component in inner]
    units = [
        variable.units_by_joint[place // len(inner)] if variable.units_by_joint else variable.unit
        for place in range(len(parts))
    ]
    paths = channel_paths(variable.name, joints, components)
    return [
        SignalColumn(path, unit, variable.long_name, variable.name, place, part)
        for place, (path, unit, part) in enumerate(zip(paths, units, parts, strict=True))
    ]


def _ordered(columns: Sequence[SignalColumn]) -> tuple[SignalColumn, ...]:
    """The columns, each once: signals in the order of the request, and the numbers of each in its own order."""
    signals = list(dict.fromkeys(column.variable for column in columns))
    once = {column.path: column for column in columns}
    return tuple(sorted(once.values(), key=lambda column: (signals.index(column.variable), column.place)))
