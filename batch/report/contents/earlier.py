"""Histories of another archive for a page's cases, and the changes since."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.differences.matching import match_instants
from batch.queries.signals import Panel, history, panels
from batch.report.contents.against import EarlierCases
from batch.report.contents.parts import History, SignalPanel
from batch.report.contents.thinning import thin, thin_clock


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
        change = History(case, self._clock(time[rows]), changes) if changes else None
        return (History(case, self._clock(was_time), was_values), change) if was_values else (None, None)

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

    def _clock(self, time: np.ndarray) -> int:
        """The number of a time axis, thinned, among those of the page."""
        thinned = thin_clock(time, self.points)
        same = [n for n, clock in enumerate(self.clocks) if np.array_equal(clock, thinned)]
        if not same:
            self.clocks.append(thinned)
        return same[0] if same else len(self.clocks) - 1


def _lines(page: SignalPanel, panel: Panel, values: np.ndarray) -> np.ndarray:
    """Values of a panel, (time, line), as the lines of the page's; not a number for what is not among them."""
    places = {(line.label, line.joint): n for n, line in enumerate(page.lines) if not line.command}
    out = np.full((len(values), len(page.lines)), np.nan)
    for column, line in enumerate(zip(panel.lines, panel.joints, strict=True)):
        if line in places:
            out[:, places[line]] = values[:, column]
    return out
