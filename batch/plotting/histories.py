"""Signals over time. One case: a line a joint. Up to `OVERLAID` cases: a column a joint, a line a case. More: a line
for the median of all cases, a dark band for nine in ten and a light one for all.

A recorded command is dashed over what should follow it. Another archive's cases lie wide and pale under these.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.archive.stored import Stored
from batch.plotting import held, layout
from batch.plotting.against import OtherGroup, not_in_other
from batch.plotting.layout import COLOURS, FAINT, INK, PictureSheet, sequence
from batch.queries.arrange import Cell, CommandCurve, command_curves, fan_cases, joints_of, panel_grid
from batch.queries.limits import LimitMark, limits_of
from batch.queries.signals import DeckUnits, Panel, case_text, deck_unit, history, number_text, panels
from met.diagnostic import Problem, error
from met.distinct import distinct
from met.outputs import quoted

OVERLAID = 8
LEGEND_EVERY = 4
"""Largest number of stacked panels that share a legend."""

MOST_COLUMNS = 3
LEAST_COLUMN = 1.5
"""Smallest width of a column of panels on paper, inches."""

COMMAND = "command"
DASHED: dict[str, Any] = {"linestyle": (0, (4, 3))}
ON, NEARLY_ALWAYS = 0.004, 0.9
"""Lines count as coincident that are nearer than this, relative to the span of their panel, for this share of the
time."""

ON_ANOTHER: tuple[Any, ...] = ("-", (0, (6, 6)), (0, (3, 9)), (0, (1.5, 10.5)))
"""Dashes for lines that coincide with others, through whose gaps these are seen."""

WIDER, PALE = 3.0, 0.35
"""Width, relative to the own lines, and opacity of another archive's lines."""


class Histories:
    """The signals of some cases of a group, with the way in which they are drawn."""

    def __init__(
        self,
        archive: ArchiveFile,
        group: ArchiveGroup,
        signals: Sequence[str],
        cases: Sequence[str],
        sheet: PictureSheet,
        other: OtherGroup | None,
    ) -> None:
        """signals: names, all for none; cases: names of recorded ones, all for none; other: another archive's group,
        drawn below. Raises Problem where there are no histories."""
        self.archive, self.group, self.sheet, self.other = archive, group, sheet, other
        panels(group)  # refuses an archive without histories
        self.units = DeckUnits(archive, group)
        own_panels = [self.units.panel(panel) for panel in panels(group, signals)]
        chosen = [group.recorded_position(case) for case in cases]
        self.positions: list[int] = chosen or group.recorded_positions.tolist()
        self.single, self.fan = len(self.positions) == 1, len(self.positions) > OVERLAID
        self.time = group.values("time")
        self.joints = joints_of(group)
        self.commands = command_curves(group, own_panels, self.positions, apart=not self.single and not self.fan)
        if not signals:  # a command that is drawn with its signal needs no panel of its own
            drawn = {(command.variable, command.column) for command in self.commands.values()}
            own_panels = [
                panel for panel in own_panels if not drawn.issuperset((panel.variable, c) for c in panel.columns)
            ]
        self.panels, self.left = layout.as_many_as_fit(own_panels, bool(signals), "signals")
        self.pairs, self.theirs = self._against(bool(signals))

    def _against(self, named: bool) -> tuple[dict[int, int], dict[int, list[int]]]:
        """The other archive's position of each case, and its lines of each panel."""
        other = self.other
        if other is None:
            return {}, {}
        if not other.group.role("signal"):
            message = f"no histories of `{other.group.name}` are in {other.name} to draw against"
            helps = f"`met run {quoted(other.group.path)} --all --histories all` runs it again with them"
            raise Problem(error("E393", message, help=helps))
        pairs = other.recorded(self.positions)
        if not pairs:
            message = f"no case that is drawn has its history in {other.name}"
            raise Problem(error("E393", message, help=f"`met show {quoted(other.group.path)}` lists its cases"))
        columns = {number: other.columns(panel) for number, panel in enumerate(self.panels)}
        for number, places in columns.items():
            if named and max(places) < 0:
                raise not_in_other(
                    self.panels[number].name, other, [signal.name for signal in other.group.role("signal")]
                )
        return pairs, columns

    def draw(self) -> Any:
        """The figure: a panel for each quantity, over time, with a legend and a title."""
        rows = panel_grid(self.group, self.panels)
        most = MOST_COLUMNS if not self.sheet.width else max(1, int(self.sheet.width / LEAST_COLUMN))
        by_joint = self.single or len(rows[0]) > most
        if by_joint:
            rows = [[Cell(panel, tuple(range(len(panel.lines))), panel.axis, panel.about)] for panel in self.panels]
        flat = [not self.fan and self._is_zero(row) for row in rows]
        figure, axes = grid(self.sheet, rows, flat)
        for cells, row in zip(rows, axes, strict=True):
            for cell, ax in zip(cells, row, strict=True):
                if cell is not None:
                    self._cell(ax, cell, by_joint, len(cells))
        label_axes(axes, rows, self.sheet)
        for cells, row in zip(rows, axes, strict=True):
            for cell, ax in zip(cells, row, strict=True):
                if cell is not None:
                    held.write_limits(ax, self._marks(cell), self.sheet, len(cells))
        self._legend(figure, axes, rows, flat, by_joint)
        layout.title(figure, self.archive, self.group.name, self._below(), self.sheet)
        return figure

    def _below(self) -> str:
        """The line below the picture: which cases it shows, and what was left out."""
        count = len(self.positions)
        if self.single:
            below = case_text(self.group, self.positions[0]) if self.group.attributes["cases_in_table"] > 1 else ""
        else:
            below = f"{count:,} cases" + (": median, nine in ten, and all" if self.fan else "")
        if self.other is not None and len(self.pairs) < count:
            below += f"; {len(self.pairs):,} of them also in {self.other.name}"
        return "; ".join(part for part in (below, self.left) if part)

    def _is_zero(self, row: Sequence[Cell | None]) -> bool:
        """True if all values of a row are zero."""
        cells = [cell for cell in row if cell is not None]
        return not any(
            np.any(history(self.group, cell.panel, position)[:, list(cell.lines)])
            for cell in cells
            for position in self.positions
        )

    def _cell(self, ax: Any, cell: Cell, by_joint: bool, columns: int) -> None:
        """Draw one cell of the picture: its lines, another archive's under them, and the commands and marks over
        them."""
        panel = cell.panel
        above = self._above(cell) if self.single else {}
        for line in cell.lines:
            colour = self._joint_colour(panel, line)
            self._their_lines(ax, panel, line, colour if by_joint or self.fan else None)
            if self.single:
                y = layout.drawable(history(self.group, panel, self.positions[0])[:, line])
                _line(
                    ax,
                    self.time,
                    y,
                    color=colour,
                    label=layout.legend_label(panel.lines[line]),
                    linestyle=ON_ANOTHER[above[line]] if above.get(line) else _dashes(line),
                )
            elif self.fan:
                self._fan(ax, panel, line, colour)
            else:
                self._overlay(ax, panel, line, colour if by_joint else None)
        for line in cell.lines:
            self._draw_command(ax, self.commands.get((panel.name, panel.unit, line)))
        ax.margins(x=0.0)
        held.draw(ax, self._marks(cell), self.time, self.sheet, columns)

    def _above(self, cell: Cell) -> dict[int, int]:
        """For each line, the number of others on which it lies."""
        values = layout.drawable(history(self.group, cell.panel, self.positions[0]))[:, list(cell.lines)]
        finite = values[np.isfinite(values)]
        near = ON * float(np.ptp(finite)) if len(finite) else 0.0
        out = {}
        for place, line in enumerate(cell.lines):
            with np.errstate(invalid="ignore"):
                same = np.abs(values[:, :place] - values[:, place, None]) <= near
            out[line] = min(int((same.mean(axis=0) > NEARLY_ALWAYS).sum()), len(ON_ANOTHER) - 1)
        return out

    def _marks(self, cell: Cell) -> list[LimitMark]:
        """The limits of a panel's lines, each once."""
        if self.units.experiment is None:
            return []
        marks = (limits_of(self.units.experiment, cell.panel, line) for line in cell.lines)
        return list(dict.fromkeys(mark for marks in marks for mark in marks))

    def _joint_colour(self, panel: Panel, line: int) -> str:
        """The colour of a joint, which is the same in all panels, even for a signal of one joint
        (`shoulder.servo.voltage`); components of a vector have the colours in turn."""
        joint = panel.joints[line]
        own = joint in self.joints and panel.joints.count(joint) == 1
        return COLOURS[(self.joints.index(joint) if own else line) % len(COLOURS)]

    def _fan(self, ax: Any, panel: Panel, line: int, colour: str) -> None:
        """Draw the median, and the bands of nine in ten and of all."""
        values = layout.drawable(
            np.stack([history(self.group, panel, position)[:, line] for position in fan_cases(self.positions)])
        )
        good = np.isfinite(values).any(axis=0)
        time, values = self.time[good], values[:, good]
        if not len(time):
            return
        low, five, middle, ninety_five, high = np.nanpercentile(values, (0, 5, 50, 95, 100), axis=0)
        ax.fill_between(time, low, high, color=colour, alpha=0.15, linewidth=0)
        ax.fill_between(time, five, ninety_five, color=colour, alpha=0.30, linewidth=0)
        ax.plot(time, middle, color=colour, label=layout.legend_label(panel.lines[line]))

    def _overlay(self, ax: Any, panel: Panel, line: int, colour: str | None) -> None:
        """Draw a line for each case; where joints share the panel they have the colours, and cases differ by
        opacity."""
        count = len(self.positions)
        for index, position in enumerate(self.positions):
            y = layout.drawable(history(self.group, panel, position)[:, line])
            if colour is not None:
                label = layout.legend_label(panel.lines[line]) if index == 0 else None
                _line(ax, self.time, y, color=colour, alpha=_faint(index, count), label=label)
            else:
                _line(ax, self.time, y, color=sequence(index, count), label=_case_label(self.group, position))

    def _their_lines(self, ax: Any, panel: Panel, line: int, colour: str | None) -> None:
        """Draw the other archive's cases under the own ones; of a fan its median, and nine in ten between dots."""
        other, columns = self.other, self.theirs.get(self.panels.index(panel), [])
        if other is None or columns[line] < 0:
            return
        style: dict[str, Any] = {"alpha": PALE, "solid_capstyle": "butt", "zorder": 1.8}
        if self.fan:
            places = list(self.pairs.values())
            values = layout.drawable(
                np.stack([other.history(panel, columns, place)[:, line] for place in fan_cases(places)])
            )
            good = np.isfinite(values).any(axis=0)
            if good.any():
                five, middle, ninety_five = np.nanpercentile(values[:, good], (5, 50, 95), axis=0)
                ax.plot(other.time[good], middle, color=colour, linewidth=1.4 + WIDER, **style)
                for edge in (five, ninety_five):
                    ax.plot(other.time[good], edge, color=colour, linewidth=1.0, linestyle=":")
            return
        for index, position in enumerate(self.positions):
            if position in self.pairs:
                y = layout.drawable(other.history(panel, columns, self.pairs[position])[:, line])
                tone = colour or sequence(index, len(self.positions))
                ax.plot(other.time, y, color=tone, linewidth=1.2 + WIDER, **style)

    def _draw_command(self, ax: Any, command: CommandCurve | None) -> None:
        """Draw a command dashed, over the signal that follows it; in the cases' colours where each has its own."""
        if command is None:
            return
        if command.shared:
            known = COMMAND in ax.get_legend_handles_labels()[1]
            label = None if known else COMMAND
            ax.plot(self.time, command.values(self.group, command.longest), color=INK, label=label, **DASHED)
            return
        for index, position in enumerate(self.positions):
            colour = sequence(index, len(self.positions))
            ax.plot(self.time, command.values(self.group, position), color=colour, **DASHED)
        ax.plot([], [], color=INK, label=COMMAND, **DASHED)

    def _legend(
        self,
        figure: Any,
        axes: list[list[Any]],
        rows: Sequence[Sequence[Cell | None]],
        flat: Sequence[bool],
        by_joint: bool,
    ) -> None:
        """Draw the legend beside the panels, once for some that share it; not beside a flat one, where it has no
        room."""
        archives = self._archives()
        if by_joint and not self.sheet.narrow:
            last: list[str] | None = None
            since = 0
            for row, low in zip(axes, flat, strict=True):
                handles, labels = row[0].get_legend_handles_labels()
                since += 1
                if (labels or (archives and last is None)) and (labels != last or (since > LEGEND_EVERY and not low)):
                    row[0].legend(
                        [*handles, *archives.values()],
                        [*labels, *archives],
                        loc="upper left",
                        bbox_to_anchor=(1.005, 1.06),
                        fontsize=self.sheet.small,
                        handlelength=1.4,
                    )
                    last, since = labels, 1
            layout.legend(figure, self._cases(), self.sheet, below=True)
            return
        known = layout.legend_entries(
            [
                [ax for cell, ax in zip(cells, row, strict=True) if cell is not None]
                for cells, row in zip(rows, axes, strict=True)
            ]
        )
        if self.fan and not by_joint:  # its panels have their joints' names above them
            known = {text: handle for text, handle in known.items() if text == COMMAND}
        command = {text: known.pop(text) for text in [COMMAND] if text in known}
        title = _case_title(self.group) if known and not self.fan and not by_joint else None
        cases = self._cases() if by_joint else {}
        layout.legend(figure, known | command | archives | cases, self.sheet, title)

    def _cases(self) -> dict[str, Any]:
        """Legend entries of cases that differ by opacity."""
        from matplotlib.lines import Line2D

        count = len(self.positions)
        if self.single or self.fan:
            return {}
        return {
            _case_words(self.group, position): Line2D([], [], color=INK, linewidth=1.4, alpha=_faint(index, count))
            for index, position in enumerate(self.positions)
        }

    def _archives(self) -> dict[str, Any]:
        """Legend entries of the two archives."""
        from matplotlib.lines import Line2D

        if self.other is None:
            return {}
        theirs = Line2D([], [], color=INK, linewidth=1.2 + WIDER, alpha=PALE, solid_capstyle="butt")
        return {self.other.own: Line2D([], [], color=INK, linewidth=1.4), self.other.name: theirs}


def _dashes(line: int) -> str:
    """The line style of the `line`th joint: dashed where there are more joints than colours."""
    return ("-", "--", ":", "-.")[line // len(COLOURS) % 4]


def _line(ax: Any, time: np.ndarray, y: np.ndarray, **style: Any) -> None:
    """Draw a line, with a cross where it breaks off."""
    ax.plot(time, y, **style)
    valid = np.flatnonzero(np.isfinite(y))
    if len(valid) and valid[-1] < len(y) - 1:
        ax.plot(time[valid[-1]], y[valid[-1]], marker="x", markersize=6, color=style["color"])


def _differing(group: ArchiveGroup) -> list[Stored]:
    """The varied parameters that differ between the cases here."""
    return [v for v in group.role("coordinate") if len(distinct(group.values(v.name))) > 1]


def _faint(index: int, count: int) -> float:
    """The opacity of the lines of one of several cases that share their joints' colours."""
    return 1.0 - 0.75 * index / max(1, count - 1)


def _case_words(group: ArchiveGroup, position: int) -> str:
    """Varied parameters of a case, by name, for a legend without a title."""
    scales = {v.name: deck_unit(v) for v in _differing(group)}
    texts = [
        f"{name} = {number_text(group.values(name)[position] / scale)} {unit}".rstrip()
        for name, (scale, unit) in scales.items()
    ]
    return layout.legend_label(", ".join(texts)) or f"case #{group.values('case')[position]}"


def _case_label(group: ArchiveGroup, position: int) -> str:
    """The values of the differing parameters, which the legend's title names."""
    values = [number_text(group.values(v.name)[position] / deck_unit(v)[0]) for v in _differing(group)]
    return " · ".join(values) or f"case #{group.values('case')[position]}"


def _case_title(group: ArchiveGroup) -> str:
    """The title of the legend: the names of its values, one a line."""
    return " ·\n".join(layout.with_unit(v.name, deck_unit(v)[1]) for v in _differing(group))


# Panels


def grid(
    sheet: PictureSheet, rows: Sequence[Sequence[Cell | None]], flat: Sequence[bool]
) -> tuple[Any, list[list[Any]]]:
    """Axes for all cells; time shared, and in a row the scale of what has the same unit. flat: which rows are low."""
    figure, axes = layout.figure(sheet, len(rows[0]), [layout.FLAT if low else 1.0 for low in flat])
    for ax in (ax for row, low in zip(axes, flat, strict=True) for ax in row if low):
        ax.set_yticks([0.0])
    for cells, row in zip(rows, axes, strict=True):
        first: dict[str, Any] = {}
        for cell, ax in zip(cells, row, strict=True):
            if cell is None:
                ax.set_visible(False)
            elif cell.axis in first:
                ax.sharey(first[cell.axis])
            else:
                first[cell.axis] = ax
    return figure, axes


def label_axes(axes: list[list[Any]], rows: Sequence[Sequence[Cell | None]], sheet: PictureSheet) -> None:
    """Label the axes, once where neighbours share them, and write each panel's heading."""
    for number, (cells, row) in enumerate(zip(rows, axes, strict=True)):
        before = None
        for column, (cell, ax) in enumerate(zip(cells, row, strict=True)):
            if cell is not None:
                alike = before is not None and before.axis == cell.axis
                ax.set_ylabel("" if alike else layout.two_lines(cell.axis))
                ax.tick_params(labelleft=not alike)
                text = cell.title.partition(" · ")[0] if sheet.narrow and len(cells) > 1 else cell.title
                layout.head(ax, text, sheet, len(cells), INK if len(cells) > 1 or sheet.paper else FAINT)
                last = all(later[column] is None for later in rows[number + 1 :])
                ax.set_xlabel("time  (s)" if last else "")
                ax.tick_params(labelbottom=last)
            before = cell
