"""Recorded signals of the worst cases, thinned so that a page can hold them and nothing that stands out is lost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batch.archive.read import Group
from batch.arrange import joints_of, overlaid
from batch.report.content import History, Line, SignalPanel, Signals
from batch.report.pool import Pool
from batch.signals import Panel, history, panels

MOST_POINTS = 4000
"""Points of a line: of more rows each stretch gives its smallest and its largest value."""

FEWEST_POINTS = 500
MOST_VALUES = 400_000
"""Numbers that a page holds, over all its lines; about five bytes each."""

MOST_HISTORIES, COMPARED = 200, 3
"""Cases whose signals are in a page; cases that are drawn together at first."""

FEWEST_COMPARED = 5
"""Cases of which one is in the middle: it is drawn beside the worst."""

MOST_PANELS = 32
"""Plots under one another."""


def signals(pool: Pool, values: int = MOST_VALUES) -> Signals | None:
    """Of the worst cases that have histories, and of the middle one; None where none has one.

    values  how many numbers there may be
    """
    known = _kept(pool)
    if not known:
        return None
    groups = [_Group(group, [place for number, place in known if number == n]) for n, group in enumerate(pool.groups)]
    width = max(max((each.width for each in groups), default=1), 1)
    few = min(len(known), COMPARED)
    points = int(np.clip(values // (width * few), FEWEST_POINTS, MOST_POINTS))
    rows = max(min(each.rows, points) for each in groups if each.panels)
    most = int(np.clip(values // max(1, width * rows), few, MOST_HISTORIES))
    clocks: list[np.ndarray] = []
    clock_of: dict[int, int] = {}
    names: dict[tuple[str, str], SignalPanel] = {}
    for number, each in enumerate(groups):
        if each.panels:
            time = thin_clock(each.group.values("time"), points)
            same = [n for n, other in enumerate(clocks) if np.array_equal(other, time)]
            clock_of[number] = same[0] if same else len(clocks)
            clocks += [] if same else [time]
        for panel in each.panels:
            key = panel.name, panel.unit
            names[key] = _joined(names.get(key), each.described(panel))
    found = tuple(names.values())[:MOST_PANELS]
    wanted, middle = known[:most], None
    if len(known) >= FEWEST_COMPARED:
        middle = known[len(known) // 2]
        wanted = wanted if middle in wanted else [*wanted[:-1], middle]
    numbers = {each: int(pool.groups[each[0]].at("case", [each[1]])[0]) for each in wanted}
    histories = tuple(
        History(numbers[n, position], clock_of[n], groups[n].thinned(found, position, points)) for n, position in wanted
    )
    joints = tuple(dict.fromkeys(joint for each in groups if each.panels for joint in joints_of(each.group)))
    shown = [numbers[each] for each in wanted[:COMPARED]]
    if middle is not None:
        shown[-1] = numbers[middle]
    said = _said(groups, len(known), len(histories), len(names), points)
    compared = None if middle is None else numbers[middle]
    return Signals(found, joints, tuple(clocks), histories, tuple(shown), compared, said)


def _kept(pool: Pool) -> list[tuple[int, int]]:
    """Group and position of the cases that have histories, worst first."""
    kept = [set(group.recorded_positions.tolist()) if group.role("signal") else set() for group in pool.groups]
    if not any(kept):
        return []
    places = zip(pool.group_of[pool.worst_first].tolist(), pool.position_of[pool.worst_first].tolist(), strict=True)
    return [(number, position) for number, position in places if position in kept[number]]


def _said(
    groups: Sequence[_Group], known: int, here: int, plots: int, points: int
) -> tuple[str, ...]:
    """What is not in the page. known, here: recorded cases, and those of them that are in it."""
    out = []
    if here < known:
        out.append(f"Signals of the worst of {known:,} recorded cases are in this page, {here:,} of them.")
    each = max(stretch(group.rows, points) for group in groups)
    if each > 1:
        out.append(
            f"Lines have the smallest and the largest value of every {each} rows, {points:,} points at most: "
            "no peak is lost, and its time is true to that stretch."
        )
    if plots > MOST_PANELS:
        out.append(f"The first {MOST_PANELS} of {plots} plots are in this page.")
    return tuple(out)


def no_signals(pool: Pool) -> str:
    """What to do where there are none."""
    if any(group.attributes.get("cases_in_table", 0) > 1 for group in pool.groups):
        return "No histories were kept. The commands of the table above run a case again, with its signals."
    return "No histories were kept: `--histories all` keeps them."


class _Group:
    """What was recorded of the cases of one structure, of which those at these positions are wanted."""

    def __init__(self, group: Group, positions: Sequence[int]) -> None:
        self.group = group
        self.panels: tuple[Panel, ...] = ()
        self.rows = 0
        if not positions or not group.role("signal"):
            return
        found = panels(group)
        self.rows = int(group.values("time").shape[0])
        commands = overlaid(group, found, positions[:COMPARED], apart=True)
        drawn = {(command.variable, command.column) for command in commands.values()}
        self.panels = tuple(p for p in found if not drawn.issuperset((p.variable, column) for column in p.columns))
        self.commands = {
            (p.name, p.unit): [(line, commands[p.name, p.unit, line]) for line in range(len(p.lines))
                               if (p.name, p.unit, line) in commands]
            for p in self.panels
        }  # fmt: skip

    @property
    def width(self) -> int:
        """Lines of a case."""
        return sum(len(panel.lines) + len(self.commands[panel.name, panel.unit]) for panel in self.panels)

    def described(self, panel: Panel) -> SignalPanel:
        lines = [Line(label, joint) for label, joint in zip(panel.lines, panel.joints, strict=True)]
        lines += [Line(lines[n].label, lines[n].joint, True) for n, _ in self.commands[panel.name, panel.unit]]
        return SignalPanel(panel.name, panel.about, panel.unit, tuple(lines))

    def thinned(self, found: Sequence[SignalPanel], position: int, points: int) -> dict[int, np.ndarray]:
        """By place among the page's panels: (point, line of that panel), not a number where this structure has none."""
        out = {}
        for panel in self.panels:
            key = panel.name, panel.unit
            place = next((n for n, each in enumerate(found) if (each.name, each.unit) == key), None)
            if place is None:
                continue
            own = [history(self.group, panel, position)]
            own += [command.values(self.group, position)[:, None] for _, command in self.commands[key]]
            values = thin(np.concatenate(own, axis=1).astype(np.float64), points)
            full = np.full((len(values), len(found[place].lines)), np.nan)
            for column, line in enumerate(self.described(panel).lines):
                full[:, found[place].lines.index(line)] = values[:, column]
            out[place] = full
        return out


def _joined(one: SignalPanel | None, other: SignalPanel) -> SignalPanel:
    """The panel of two structures: the lines of both."""
    if one is None:
        return other
    return SignalPanel(one.name, one.about, one.unit, tuple(dict.fromkeys((*one.lines, *other.lines))))


# Thinning


def stretch(rows: int, points: int) -> int:
    """Rows that two points stand for; 1 where every row has its point."""
    return 1 if rows <= points else -(-rows // (points // 2))


def thin_clock(time: np.ndarray, points: int) -> np.ndarray:
    """The times of the points: of each stretch its first row and the one in its middle."""
    each = stretch(len(time), points)
    if each == 1:
        return time
    first = np.arange(0, len(time), each)
    return np.stack([time[first], time[np.minimum(first + each // 2, len(time) - 1)]], axis=1).ravel()


def thin(values: np.ndarray, points: int) -> np.ndarray:
    """Of each stretch of rows the smallest and the largest value, in the order in which they come.

    values: (time, line). Values that are not finite are none; a stretch of nothing else is not a number.
    """
    values = np.where(np.isfinite(values), values, np.nan)
    each = stretch(len(values), points)
    if each == 1:
        return values
    count = -(-len(values) // each)
    padded = np.full((count * each, values.shape[1]), np.nan)
    padded[: len(values)] = values
    parts = padded.reshape(count, each, -1)
    none = np.isnan(parts)
    at = [np.where(none, other, sign * parts).argmin(axis=1) for sign, other in ((1.0, np.inf), (-1.0, np.inf))]
    pair = np.sort(np.stack(at, axis=1), axis=1)
    return np.take_along_axis(parts, pair, axis=1).reshape(2 * count, -1)
