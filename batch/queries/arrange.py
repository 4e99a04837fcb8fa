"""The layout of a picture of histories: a row for each quantity, a column for each joint, commands over the signals
that follow them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.queries.signals import Panel
from met.frozen import frozen
from met.plan.channel import joint_of

SPREAD = 2000
"""Largest number of cases in a fan, spread over all."""


@frozen
class Cell:
    """One plot of the grid: lines of a panel, the label of its axis, and its heading."""

    panel: Panel
    lines: tuple[int, ...]
    axis: str
    title: str


def panel_grid(group: ArchiveGroup, panels: Sequence[Panel]) -> list[list[Cell | None]]:
    """The grid of plots: a row for each quantity, a column for each joint; `q` in metres and in radians stand side by
    side, each with its axis, and `elbow.servo.voltage` under the elbow. None where a joint lacks a quantity. Other
    signals fill rows of their own, components side by side."""
    joints = joints_of(group)
    placed: list[tuple[str, str, Cell]] = []
    for panel in panels:
        for line, (label, joint) in enumerate(zip(panel.lines, panel.joints, strict=True)):
            quantity = panel.name.removeprefix(joint + ".") if joint else panel.name
            named = f"{quantity}.{label}" if panel.joints.count(joint) > 1 else quantity
            axis = panel.axis.replace(panel.name, named, 1)
            title = " · ".join(part for part in (joint, panel.about) if part)
            placed.append((named if joint else quantity, joint, Cell(panel, (line,), axis, title)))
    columns = [joint for joint in joints if any(joint == where for _, where, _ in placed)] or [""]
    rows: list[tuple[str, list[Cell | None]]] = []
    for quantity, joint, cell in placed:
        places = [columns.index(joint)] if joint in columns else range(len(columns))
        free = next(
            ((row, column) for name, row in rows if name == quantity for column in places if row[column] is None), None
        )
        if free is None:
            rows.append((quantity, [None] * len(columns)))
            free = rows[-1][1], places[0]
        free[0][free[1]] = cell
    return [row for _, row in rows]


def joints_of(group: ArchiveGroup) -> list[str]:
    """All joints with signals here, in the arm's order where one signal has them all."""
    signals = group.role("signal")
    together = sorted((v for v in signals if group.joints(v)), key=lambda v: v.dims[2] != "joint")
    names = [joint for variable in together for joint in group.joints(variable) if joint not in variable.springs]
    alone = [joint_of(v.name) for v in signals if not group.joints(v)]
    return [joint for joint in dict.fromkeys([*names, *alone]) if joint]


@frozen
class CommandCurve:
    """A servo's command that is drawn over a line, in that line's unit; whether the cases share it, and which of them
    lasts longest."""

    variable: str
    column: int
    shared: bool = True
    longest: int = 0
    scale: float = 1.0

    def values(self, group: ArchiveGroup, position: int) -> np.ndarray:
        values = group.signal(self.variable, position)
        return (values if values.ndim == 1 else values[:, self.column]) / self.scale


def command_curves(
    group: ArchiveGroup, panels: Sequence[Panel], positions: Sequence[int], *, apart: bool
) -> dict[tuple[str, str, int], CommandCurve]:
    """The recorded commands of the same kind as a line of q, qd or tau, by panel (name, unit) and line.

    apart: whether commands that differ between cases can be told apart; else only those that all cases share count.
    """
    commands = {}
    for variable in group.role("signal"):
        joint, _, rest = variable.name.partition(".")
        if rest == "servo.command" and len(variable.dims) == 2:
            commands[joint, variable.unit] = (variable.name, 0)
        elif variable.name == "servo.command":
            names = group.joints(variable)
            units = variable.units_by_joint or (variable.unit,) * len(names)
            commands |= {(j, u): (variable.name, i) for i, (j, u) in enumerate(zip(names, units, strict=True))}
    out = {}
    for panel in panels:
        for line, name in enumerate(panel.joints):
            command = commands.get((name, panel.si))
            if panel.variable.rpartition(".")[2] in ("q", "qd", "tau") and command is not None:
                shared, longest = _shared(group, CommandCurve(*command), fan_cases(positions))
                if shared or apart:
                    out[panel.name, panel.unit, line] = CommandCurve(
                        *command, shared=shared, longest=longest, scale=panel.scale
                    )
    return out


def _shared(group: ArchiveGroup, command: CommandCurve, positions: Sequence[int]) -> tuple[bool, int]:
    """True if all cases have the same command for as long as they last, and the case that lasts longest."""
    longest, best = positions[0], command.values(group, positions[0])
    for position in positions[1:]:
        values = command.values(group, position)
        if not np.all((values == best) | np.isnan(values) | np.isnan(best)):
            return False, longest
        if np.isfinite(values).sum() > np.isfinite(best).sum():
            longest, best = position, values
    return True, longest


def fan_cases(positions: Sequence[int]) -> Sequence[int]:
    """The cases that a fan draws, spread evenly over all."""
    if len(positions) <= SPREAD:
        return positions
    return [positions[i] for i in np.linspace(0, len(positions) - 1, SPREAD).astype(int)]
