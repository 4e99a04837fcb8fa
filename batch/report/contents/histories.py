"""Recorded signals of the worst cases, thinned so that a page can hold them and nothing that stands out is lost; with
those of another archive, and the changes since.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.differences.matching import match_instants
from batch.queries.arrange import CommandCurve, command_curves, joints_of
from batch.queries.pool import Pool
from batch.queries.signals import DeckUnits, Panel, history, panels
from batch.report.contents.against import EarlierCases
from batch.report.contents.parts import History, PanelLine, SignalPanel, Signals
from met.plan.channel import channel_paths


class EarlierHistories:
    """Histories of the other archive, in the panels of a page.

    signal_panels  the page's panels;  points: of a line at most
    scaled         the page's unit for each signal, as a panel of this archive, by name and SI unit
    clocks         the page's times, to which those of the other archive are added
    """

    def __init__(
        self,
        before: EarlierCases,
        signal_panels: Sequence[SignalPanel],
        scaled: Mapping[tuple[str, str], Panel],
        clocks: list[np.ndarray],
        points: int,
    ) -> None:
        self.before, self.signal_panels, self.scaled = before, signal_panels, scaled
        self.clocks, self.points = clocks, points
        self._panels: dict[tuple[bool, str], dict[tuple[str, str], Panel]] = {}

    def of(self, case: int, number: int, position: int) -> tuple[History | None, History | None]:
        """The earlier archive's history of the case at a position of the structure `number`, and the change since, at
        the common instants; None where it has no history there."""
        match_ = self.before.history_of(number, position)
        if match_ is None:
            return None, None
        (other, place), group = match_, self.before.now.groups[number]
        time, was_time = group.values("time"), other.values("time")
        rows, was_rows = match_instants(time, was_time, 0.0)
        was_values, changes = {}, {}
        for n, panel in enumerate(self.signal_panels):
            key = panel.name, panel.unit
            mine, theirs = self._panels_of(False, group).get(key), self._panels_of(True, other).get(key)
            if theirs is None:
                continue
            was = _lines(panel, theirs, history(other, theirs, place))
            was_values[n] = thin(was, self.points)
            if mine is not None and len(rows):
                now = _lines(panel, mine, history(group, mine, position))
                changes[n] = thin(now[rows] - was[was_rows], self.points)
        clocks, points = self.clocks, self.points
        change = History(case, _clock(clocks, time[rows], points), changes) if changes else None
        return (History(case, _clock(clocks, was_time, points), was_values), change) if was_values else (None, None)

    def _panels_of(self, other: bool, group: ArchiveGroup) -> dict[tuple[str, str], Panel]:
        """The panels of a group of either archive, by name and unit, in the page's units."""
        key = other, group.name
        if key not in self._panels:
            known = [self._in_unit(panel) for panel in panels(group)]
            self._panels[key] = {(panel.name, panel.unit): panel for panel in known}
        return self._panels[key]

    def _in_unit(self, panel: Panel) -> Panel:
        scaled = self.scaled.get((panel.name, panel.si))
        return panel if scaled is None else replace(panel, unit=scaled.unit, scale=scaled.scale, in_si=scaled.in_si)


def _clock(clocks: list[np.ndarray], time: np.ndarray, points: int) -> int:
    """The number of a time axis, s, thinned to so many points, among those of the page, to which it is added unless the
    same one is there."""
    thinned = thin_clock(time, points)
    for number, clock in enumerate(clocks):
        if np.array_equal(clock, thinned):
            return number
    clocks.append(thinned)
    return len(clocks) - 1


def _lines(page: SignalPanel, panel: Panel, values: np.ndarray) -> np.ndarray:
    """Values of a panel, (time, line), as the lines of the page's; not a number for what is not among them."""
    places = {(line.label, line.joint): n for n, line in enumerate(page.lines) if not line.command}
    out = np.full((len(values), len(page.lines)), np.nan)
    for column, line in enumerate(zip(panel.lines, panel.joints, strict=True)):
        if line in places:
            out[:, places[line]] = values[:, column]
    return out


MOST_POINTS = 4000
"""Largest number of points of a line: with more rows each stretch gives its smallest and its largest value."""

FEWEST_POINTS = 500
MOST_VALUES = 400_000
"""Largest number of values in a page, over all its lines; about five bytes each."""

WHERE_RUN_AGAIN = 60_000
"""The largest number of values where the page can run cases again."""

MOST_HISTORIES, COMPARED = 200, 3
"""Largest number of cases whose signals are in a page, and number of cases that are drawn together at first."""

FEWEST_COMPARED = 5
"""Smallest number of cases for which the middle one is drawn beside the worst."""

MOST_PANELS = 32
"""Largest number of stacked plots."""


def signals(
    pool: Pool,
    values: int = MOST_VALUES,
    before: EarlierCases | None = None,
    units: Sequence[DeckUnits] = (),
    computed: Mapping[int, ArchiveGroup] = MappingProxyType({}),
) -> Signals | None:
    """The histories of the worst cases that have some, and of the middle one; None where none has one and none can be
    computed.

    values    how many numbers there may be;  units: the deck's for each group of the pool; none: SI
    computed  by place in the pool, groups of which the page runs cases again, as they are with histories
    before  another archive to compare with: the cases that differ most from it come first, each with what it was there
    """
    known = _recorded_cases(pool, before)
    if not known and not computed:
        return None
    values = values if before is None else values // 3  # now, before, and the difference
    scaled: dict[tuple[str, str], Panel] = {}
    groups = []
    for n, group in enumerate(pool.groups):
        own = units[n] if units else None
        places = [place for number, place in known if number == n]
        groups.append(_Group(group if places else computed.get(n, group), places, own, scaled))
    if not any(group.panels for group in groups):
        return None
    width = max(max((group.width for group in groups), default=1), 1)
    few = max(1, min(len(known), COMPARED))
    points = int(np.clip(values // (width * few), FEWEST_POINTS, MOST_POINTS))
    rows = max(min(group.rows, points) for group in groups if group.panels)
    most = int(np.clip(values // max(1, width * rows), few, MOST_HISTORIES))
    clocks: list[np.ndarray] = []
    clock_of: dict[int, int] = {}
    names: dict[tuple[str, str], SignalPanel] = {}
    for number, structure in enumerate(groups):
        if structure.panels:
            clock_of[number] = _clock(clocks, structure.group.values("time"), points)
        for panel in structure.panels:
            key = panel.name, panel.unit
            names[key] = _joined(names.get(key), structure.described(panel))
    signal_panels = tuple(names.values())[:MOST_PANELS]
    wanted, middle = known[:most], None
    if len(known) >= FEWEST_COMPARED and before is None:
        middle = known[len(known) // 2]
        wanted = wanted if middle in wanted else [*wanted[:-1], middle]
    numbers = {case: int(pool.groups[case[0]].at("case", [case[1]])[0]) for case in wanted}
    was = None if before is None else EarlierHistories(before, signal_panels, scaled, clocks, points)
    histories = tuple(
        History(
            numbers[n, position],
            clock_of[n],
            groups[n].thinned(signal_panels, position, points),
            *(was.of(numbers[n, position], n, position) if was is not None else ()),
        )
        for n, position in wanted
    )
    joints = tuple(dict.fromkeys(joint for group in groups if group.panels for joint in joints_of(group.group)))
    first_cases = [numbers[case] for case in wanted[: COMPARED if before is None else 1]]
    cases = {case_history.case for case_history in histories}
    worst = next((case for case in pool.cases[pool.worst_first[:1]].tolist() if case in cases), None)
    changed = () if before is None else tuple(case for case in before.most if case in cases)
    if middle is not None:
        first_cases[-1] = numbers[middle]
    compared = None if middle is None else numbers[middle]
    if not known:
        order = pool.cases[pool.worst_first]
        middle_too = len(order) >= FEWEST_COMPARED and before is None
        first_cases = order[: COMPARED - 1 if middle_too else COMPARED].tolist()
        compared = int(order[len(order) // 2]) if middle_too else None
        first_cases += [] if compared is None else [compared]
        if before is not None:
            changed = before.most
            first_cases = [*changed, *first_cases][:1]
    notes = tuple(
        _notes(groups, len(known), len(histories), len(names), points, before is not None, again=bool(computed))
    )
    sources = tuple(group.sources(signal_panels) for group in groups)
    return Signals(
        signal_panels,
        joints,
        tuple(clocks),
        histories,
        tuple(first_cases),
        compared,
        notes,
        changed,
        worst,
        compared,
        sources,
    )


def _recorded_cases(pool: Pool, before: EarlierCases | None = None) -> list[tuple[int, int]]:
    """Group and position of the cases that have histories, worst first; with `before`, those that differ most from it
    come first, and the worst of all second."""
    recorded = [set(group.recorded_positions.tolist()) if group.role("signal") else set() for group in pool.groups]
    if not any(recorded):
        return []
    order = pool.worst_first
    if before is not None:
        most = np.flatnonzero(np.isin(pool.cases, before.most))
        ranked = most[np.argsort([before.most.index(number) for number in pool.cases[most].tolist()])]
        order = np.concatenate([ranked[:1], order[:1], ranked[1:], order])
    places = zip(pool.group_of[order].tolist(), pool.position_of[order].tolist(), strict=True)
    cases = [(number, position) for number, position in places if position in recorded[number]]
    return list(dict.fromkeys(cases))


def _notes(
    groups: Sequence[_Group], known: int, in_page: int, plots: int, points: int, compared: bool, *, again: bool
) -> Iterator[str]:
    """A sentence about histories that are not in the page. known, in_page: the numbers of recorded cases, and of those
    in the page; again: whether others are run again there"""
    if again and in_page < known:
        yield f"{in_page:,} of {known:,} recorded cases are in this page; the others are run again where it is read."
    elif in_page < known:
        which = "those that changed most and of the worst" if compared else "the worst"
        yield f"Signals of {which} of {known:,} recorded cases are in this page, {in_page:,} of them."
    rows_per_point = max(stretch(group.rows, points) for group in groups)
    if rows_per_point > 1:
        yield (
            f"Lines have the smallest and the largest value of every {rows_per_point} rows, {points:,} points at most: "
            "no peak is lost, and its time is true to that stretch."
        )
    if plots > MOST_PANELS:
        yield f"The first {MOST_PANELS} of {plots} plots are in this page."


def no_signals(pool: Pool) -> str:
    """A sentence about how to record signals, where there are none."""
    if any(group.attributes.get("cases_in_table", 0) > 1 for group in pool.groups):
        return "No histories were kept. The commands of the table above run a case again, with its signals."
    return "No histories were kept: `--histories all` keeps them."


class _Group:
    """The histories of the cases of one structure, of which those at these positions are wanted.

    units   the deck's; None: SI
    scaled  panels of structures before it, by name and SI unit: the same signal is in one unit on the whole page
    """

    def __init__(
        self,
        group: ArchiveGroup,
        positions: Sequence[int],
        units: DeckUnits | None,
        scaled: dict[tuple[str, str], Panel],
    ) -> None:
        self.group = group
        self.panels: tuple[Panel, ...] = ()
        self.rows = 0
        self.commands: dict[tuple[str, str], list[tuple[int, CommandCurve]]] = {}
        if not group.role("signal"):
            return
        own_panels = [self._in_unit(panel, units, scaled) for panel in panels(group)]
        self.rows = int(group.values("time").shape[0])
        commands = command_curves(group, own_panels, positions[:COMPARED], apart=True) if positions else {}
        drawn = {(command.variable, command.column) for command in commands.values()}
        self.panels = tuple(p for p in own_panels if not drawn.issuperset((p.variable, column) for column in p.columns))
        self.commands = {
            (p.name, p.unit): [
                (line, commands[p.name, p.unit, line])
                for line in range(len(p.lines))
                if (p.name, p.unit, line) in commands
            ]
            for p in self.panels
        }

    @staticmethod
    def _in_unit(panel: Panel, units: DeckUnits | None, scaled: dict[tuple[str, str], Panel]) -> Panel:
        unit_panel = scaled.setdefault((panel.name, panel.si), panel if units is None else units.panel(panel))
        return replace(panel, unit=unit_panel.unit, scale=unit_panel.scale, in_si=unit_panel.in_si)

    @property
    def width(self) -> int:
        """Lines of a case."""
        return sum(len(panel.lines) + len(self.commands[panel.name, panel.unit]) for panel in self.panels)

    def described(self, panel: Panel) -> SignalPanel:
        lines = [PanelLine(label, joint) for label, joint in zip(panel.lines, panel.joints, strict=True)]
        lines += [PanelLine(lines[n].label, lines[n].joint, True) for n, _ in self.commands[panel.name, panel.unit]]
        return SignalPanel(panel.name, panel.about, panel.unit, tuple(lines), panel.scale)

    def sources(self, page_panels: Sequence[SignalPanel]) -> tuple[tuple[str, ...], ...]:
        """The channel of each line of each of the page's panels; "" where this structure has none."""
        out = [[""] * len(panel.lines) for panel in page_panels]
        for place, panel, commands, places in self._on_page(page_panels):
            channels = [self._channel(panel.variable, column) for column in panel.columns]
            channels += [self._channel(command.variable, command.column) for command in commands]
            for line, channel in zip(places, channels, strict=True):
                out[place][line] = channel
        return tuple(map(tuple, out))

    def _on_page(
        self, page_panels: Sequence[SignalPanel]
    ) -> Iterator[tuple[int, Panel, list[CommandCurve], list[int]]]:
        """The panels of this structure that the page has: the place there, the panel, the commands in it, and the place
        of each line, of the panel and then of the commands, among those of the page's panel."""
        places = {(panel.name, panel.unit): n for n, panel in enumerate(page_panels)}
        for panel in self.panels:
            key = panel.name, panel.unit
            if key in places:
                lines = map(page_panels[places[key]].lines.index, self.described(panel).lines)
                yield places[key], panel, [command for _, command in self.commands[key]], list(lines)

    def _channel(self, variable: str, column: int) -> str:
        stored = self.group.variables[variable]
        return channel_paths(variable, self.group.joints(stored), self.group.components(stored))[column]

    def thinned(self, page_panels: Sequence[SignalPanel], position: int, points: int) -> dict[int, np.ndarray]:
        """The lines of each of the page's panels, by its place: (point, line of that panel), not a number where this
        structure has none."""
        out = {}
        for place, panel, commands, places in self._on_page(page_panels):
            own = [history(self.group, panel, position)]
            own += [command.values(self.group, position)[:, None] for command in commands]
            values = thin(np.concatenate(own, axis=1).astype(np.float64), points)
            out[place] = np.full((len(values), len(page_panels[place].lines)), np.nan)
            out[place][:, places] = values
        return out


def _joined(panel: SignalPanel | None, other: SignalPanel) -> SignalPanel:
    """The panel of two structures: the lines of both."""
    if panel is None:
        return other
    return SignalPanel(
        panel.name, panel.about, panel.unit, tuple(dict.fromkeys((*panel.lines, *other.lines))), panel.scale
    )


# Thinning


def stretch(rows: int, points: int) -> int:
    """Number of rows for two points; 1 where every row has its point."""
    return 1 if rows <= points else -(-rows // (points // 2))


def thin_clock(time: np.ndarray, points: int) -> np.ndarray:
    """The times of the points: the first row and the middle one of each stretch."""
    length = stretch(len(time), points)
    if length == 1:
        return time
    first = np.arange(0, len(time), length)
    return np.stack([time[first], time[np.minimum(first + length // 2, len(time) - 1)]], axis=1).ravel()


def thin(values: np.ndarray, points: int) -> np.ndarray:
    """The smallest and the largest value of each stretch of rows, in the order in which they come.

    values: (time, line). Values that are not finite are none; a stretch of nothing else is not a number.
    """
    values = np.where(np.isfinite(values), values, np.nan)
    length = stretch(len(values), points)
    if length == 1:
        return values
    count = -(-len(values) // length)
    padded = np.full((count * length, values.shape[1]), np.nan)
    padded[: len(values)] = values
    parts = padded.reshape(count, length, -1)
    none = np.isnan(parts)
    extremes = [np.where(none, other, sign * parts).argmin(axis=1) for sign, other in ((1.0, np.inf), (-1.0, np.inf))]
    pair = np.sort(np.stack(extremes, axis=1), axis=1)
    return np.take_along_axis(parts, pair, axis=1).reshape(2 * count, -1)
