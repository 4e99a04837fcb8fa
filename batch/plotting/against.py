"""Another archive beside the drawn one: its cases matched by varied values, its signals by channels."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.differences import matching
from batch.queries.pool import by_run
from batch.queries.signals import Panel, pretty_unit
from met.diagnostic import Problem, error
from met.messages.visible import line
from met.outputs import quoted
from met.plan.channel import channel_paths

LONGEST = 40
"""Largest number of letters of a file's name in a picture; of a longer one, those in the middle are left out."""


class OtherGroup:
    """The group of another archive that is matched with a drawn one.

    places  of each case of the drawn group its position in the other; -1 where it is not there
    """

    def __init__(self, drawn: ArchiveGroup, group: ArchiveGroup, names: tuple[str, str]) -> None:
        self.drawn, self.group = drawn, group
        self.own, self.name = names
        matched = matching.match_cases(drawn, group)
        self.places = np.full(drawn.count, -1)
        self.places[matched.a] = matched.b

    @cached_property
    def time(self) -> np.ndarray:
        return self.group.values("time")

    def recorded(self, positions: Sequence[int]) -> dict[int, int]:
        """The position of each drawn case in the other archive, by its position here, where its history was kept."""
        recorded = set(self.group.recorded_positions.tolist())
        places = {position: int(self.places[position]) for position in positions}
        return {position: place for position, place in places.items() if place in recorded}

    def columns(self, panel: Panel) -> list[int]:
        """The other archive's column for each line of a panel, as `Panel.columns`; -1 where it has none. Raises Problem
        E393 where it has it in another unit."""
        theirs = _channels(self.group, panel.variable)
        mine = {column: path for path, (column, _) in _channels(self.drawn, panel.variable).items()}
        out = []
        for column in panel.columns:
            place, unit = theirs.get(mine[column], (-1, panel.si))
            if unit != panel.si:
                raise other_unit(mine[column], panel.si, unit, self)
            out.append(place)
        return out

    def history(self, panel: Panel, columns: Sequence[int], place: int) -> np.ndarray:
        """The panel's lines in the other's case at this position: (its time, line); not a number where it has none."""
        values = self.group.signal(panel.variable, place)
        values = values.reshape(len(values), -1) / panel.scale
        lacking = np.full(len(values), np.nan)
        return np.stack([values[:, column] if column >= 0 else lacking for column in columns], axis=1)


def _channels(group: ArchiveGroup, name: str) -> dict[str, tuple[int, str]]:
    """For each channel, its place among a signal's columns, and its unit."""
    variable = group.variables.get(name)
    if variable is None or variable.role != "signal":
        return {}
    joints, components = group.joints(variable), group.components(variable)
    units = variable.units_by_joint or (variable.unit,) * max(1, len(joints))
    width = max(1, len(components))
    paths = channel_paths(name, joints, components)
    return {path: (column, units[column // width if joints else 0]) for column, path in enumerate(paths)}


def other_unit(name: str, mine: str, theirs: str, beside: OtherGroup) -> Problem:
    """The problem that the two archives have a quantity in different units."""
    units = [pretty_unit(unit) if unit not in ("", "1") else "no unit" for unit in (mine, theirs)]
    message = f"`{name}` is in {units[0]} in {beside.own}, and in {units[1]} in {beside.name}"
    helps = ("name what is alike in both", _differ(beside.drawn.path, beside.group.path))
    return Problem(error("E393", message, help=helps))


def not_in_other(name: str, beside: OtherGroup, existing: Sequence[str]) -> Problem:
    """The problem that a quantity to be drawn is not in the other archive. existing: those that it has"""
    helps = f"in {beside.name}: {', '.join(existing)}" if existing else _differ(beside.drawn.path, beside.group.path)
    return Problem(error("E393", f"no `{name}` in {beside.name} to draw against", help=helps))


def beside(archive: ArchiveFile, groups: Sequence[ArchiveGroup], other: ArchiveFile) -> list[OtherGroup | None]:
    """The other archive's group for each group; None where it lacks the structure. Raises Problem E393 where the two
    have nothing in common."""
    names = file_names(archive.path, other.path)
    pairs = {id(mine): theirs for mine, theirs in matching.match_experiments(archive, other)[0]}
    other_groups = [OtherGroup(group, pairs[id(group)], names) if id(group) in pairs else None for group in groups]
    if not any(other_groups):
        run_name = groups[0].sweep or groups[0].name
        message = f"no run or sweep `{run_name}` in {names[1]} to draw against"
        raise Problem(error("E393", message, help=f"in it: {', '.join(by_run(other.groups))}"))
    if not any((other_group.places >= 0).any() for other_group in other_groups if other_group is not None):
        message = f"no case of `{groups[0].sweep or groups[0].name}` is in both {names[0]} and {names[1]}"
        helps = ("cases are the same where what is varied has the same values", _differ(archive.path, other.path))
        raise Problem(error("E393", message, help=helps))
    return other_groups


def file_names(a: Path, b: Path) -> tuple[str, str]:
    """The names of two archives in a picture: those of the files, with folders where these are the same."""
    name_a, other = (a.name, b.name) if a.name != b.name else (str(a), str(b))
    return _labelling(name_a), _labelling(other)


def _labelling(name: str) -> str:
    """A name for a legend, where matplotlib leaves out names that begin with `_`, and lacks glyphs of some letters."""
    name = line(name)
    if len(name) > LONGEST:
        name = f"{name[: LONGEST // 2]}…{name[-LONGEST // 2 :]}"
    return f"./{name}" if name.startswith("_") else name


def _differ(a: Path, b: Path) -> str:
    """Help that names the command that compares two archives."""
    return f"`met diff {quoted(a)} {quoted(b)}` says what differs"
