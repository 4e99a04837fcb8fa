"""`met plot`: an archive as a picture. One panel a signal; joints as lines, cases overlaid, many cases as a fan.

One case: a line a joint. Up to `OVERLAID` cases: a column a joint, a line a case. More: a line for the median of all
cases, a dark band for nine in ten and a light one for all. A recorded command is dashed over what should follow it.
Without histories: metrics over the varied parameter.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, Group, Stored
from batch.arrange import Cell, Command, arranged, joints_of, overlaid, spread
from batch.signals import Panel, case_text, deck_unit, history, number_text, panels
from met.diagnostic import Problem, error

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito, "Color Universal Design" (2008): told apart by colour-blind eyes as well."""

OVERLAID = 8
INK, FAINT = "#22282e", "#8a939c"
PANEL_INCHES, MARKER = 1.85, 14
FLAT = 0.3
"""Height of a row that is zero throughout, against the others."""
LEGEND_EVERY = 4
"""Panels under one another that a legend serves at most."""
MOST_COLUMNS = 3
COMMAND = "command"
SOFTWARE = "MET"

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "grid.color": "#e4e7ea",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "figure.dpi": 144,
    "savefig.dpi": 144,
    "figure.facecolor": "white",
    "agg.path.chunksize": 20000,
}

MANY, DOTS = 20_000, (1600, 500)
"""Points from which on it is looked which of them hide others; dots of a panel, across and up, that are told apart."""


def plot(
    archive: ArchiveFile,
    output: str | os.PathLike[str],
    signals: Sequence[str] = (),
    *,
    experiment: str | None = None,
    cases: Sequence[str] = (),
) -> Path:
    """Draw one experiment, the first unless one is named, into a PNG."""
    from batch.show import chosen

    groups = chosen(archive, (experiment,) if experiment else ())
    group = _with_case(groups, cases[0]) if cases else groups[0]
    output = Path(output)
    check_picture(output)
    matplotlib = _matplotlib()
    with matplotlib.rc_context(STYLE):
        if signals or cases or group.recorded == group.count or (group.recorded and not group.role("metric")):
            figure = _histories(archive, group, signals, cases)
        else:
            figure = _metrics(archive, group)
        _save(figure, output)
    return output


def _with_case(groups: Sequence[Group], case: str) -> Group:
    """The first experiment that has a case; the first of all where none has it, which says so."""
    for group in groups:
        with contextlib.suppress(Problem):
            group.find_case(case)
            return group
    return groups[0]


def check_picture(output: Path) -> None:
    """Refuse to write over what is no picture of MET's."""
    if output.is_dir():
        raise Problem(error("E305", f"cannot write {output}: it is a folder", help=f"`-o {output / 'plot.png'}`"))
    if output.suffix.lower() != ".png":
        raise Problem(
            error("E326", f"cannot write {output}: pictures are PNG files", help=f"`-o {output.with_suffix('.png')}`")
        )
    if not output.parent.is_dir():
        raise Problem(
            error("E305", f"cannot write {output}: {output.parent} is no folder", help=f"`mkdir -p {output.parent}`")
        )
    if output.exists() and output.stat().st_size and not _own(output):
        message = f"{output} exists and was not drawn by MET: it is not written over"
        raise Problem(error("E305", message, help="give another name with `-o`, or remove the file"))


def _own(output: Path) -> bool:
    """Whether a PNG says that MET drew it."""
    with output.open("rb") as file:
        return b"Software\0" + SOFTWARE.encode() in file.read(400)


def _matplotlib() -> Any:
    """matplotlib without pyplot, and without its remarks about caches of fonts."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib

    return matplotlib


def _save(figure: Any, output: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    temporary = output.with_name(f".{output.name}.{os.getpid()}.tmp")
    try:
        try:
            with temporary.open("wb") as file:
                FigureCanvasAgg(figure).print_png(file, metadata={"Software": SOFTWARE})
            temporary.replace(output)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as reason:
        message = f"cannot write {output}: {(reason.strerror or str(reason)).lower()}"
        raise Problem(error("E305", message)) from reason


# Histories


def _histories(archive: ArchiveFile, group: Group, signals: Sequence[str], cases: Sequence[str]) -> Any:
    positions = [_recorded_position(group, case) for case in cases] if cases else group.recorded_positions.tolist()
    single, fan = len(positions) == 1, len(positions) > OVERLAID
    found = panels(group, signals)
    commands = overlaid(group, found, positions, apart=not single and not fan)
    if not signals:  # a command that is drawn where it belongs needs no panel of its own
        drawn = {(command.variable, command.column) for command in commands.values()}
        found = [panel for panel in found if not drawn.issuperset((panel.variable, c) for c in panel.columns)]
    rows = arranged(group, found)
    by_joint = single or len(rows[0]) > MOST_COLUMNS
    if by_joint:
        rows = [[Cell(panel, tuple(range(len(panel.lines))), panel.axis, panel.about)] for panel in found]
    flat = [not fan and _is_zero(group, row, positions) for row in rows]
    figure, axes = _grid(rows, flat)
    time = group.values("time")
    joints = joints_of(group)
    for cells, row in zip(rows, axes, strict=True):
        for cell, ax in zip(cells, row, strict=True):
            if cell is None:
                continue
            for line in cell.lines:
                panel, colour = cell.panel, _joint_colour(joints, cell.panel, line)
                if single:
                    y = history(group, panel, positions[0])[:, line]
                    style = {"linewidth": _width(line, len(panel.lines)), "linestyle": _dashes(line)}
                    _line(ax, time, y, color=colour, label=panel.lines[line] or None, **style)
                elif fan:
                    _fan(ax, time, group, panel, positions, line, colour)
                else:
                    _overlay(ax, time, group, panel, positions, line, colour if by_joint else None)
            for line in cell.lines:
                _draw_command(ax, time, group, commands.get((cell.panel.name, cell.panel.unit, line)), positions)
            ax.margins(x=0.0)
    _dress(axes, rows)
    _legend(figure, axes, group, rows, flat, single=single, fan=fan, by_joint=by_joint)
    if single:
        below = case_text(group, positions[0]) if group.attributes["cases_in_table"] > 1 else ""
    else:
        below = f"{len(positions):,} cases" + (": median, nine in ten, and all" if fan else "")
    _title(figure, archive, group, below)
    return figure


def _is_zero(group: Group, row: Sequence[Cell | None], positions: Sequence[int]) -> bool:
    """Whether nothing of a row is ever other than zero."""
    cells = [cell for cell in row if cell is not None]
    return not any(
        np.any(history(group, cell.panel, position)[:, list(cell.lines)]) for cell in cells for position in positions
    )


def _recorded_position(group: Group, case: str) -> int:
    panels(group)  # refuses an archive without histories
    return group.recorded_position(case)


def _joint_colour(joints: list[str], panel: Panel, line: int) -> str:
    """A joint has one colour in all panels, also where a signal is its alone (`shoulder.servo.voltage`); components of
    one vector have the colours in turn."""
    joint = panel.joints[line]
    own = joint in joints and panel.joints.count(joint) == 1
    return COLOURS[(joints.index(joint) if own else line) % len(COLOURS)]


def _width(line: int, count: int) -> float:
    """The first lines are wider, so that they are seen under those that run over them."""
    widest = 2.6 if count <= 3 else 2.0
    return 1.4 if count == 1 else widest - (widest - 1.2) * line / (count - 1)


def _dashes(line: int) -> str:
    """Where there are more joints than colours."""
    return ("-", "--", ":", "-.")[line // len(COLOURS) % 4]


def _line(ax: Any, time: np.ndarray, y: np.ndarray, **style: Any) -> None:
    """A line; a cross where it breaks off."""
    ax.plot(time, y, **style)
    valid = np.flatnonzero(np.isfinite(y))
    if len(valid) and valid[-1] < len(y) - 1:
        ax.plot(time[valid[-1]], y[valid[-1]], marker="x", markersize=6, color=style["color"])


def _fan(ax: Any, time: np.ndarray, group: Group, panel: Panel, positions: list[int], line: int, colour: str) -> None:
    """Median, nine in ten, all."""
    values = np.stack([history(group, panel, position)[:, line] for position in spread(positions)])
    good = np.isfinite(values).any(axis=0)
    time, values = time[good], values[:, good]
    if not len(time):
        return
    low, five, middle, ninety_five, high = np.nanpercentile(values, (0, 5, 50, 95, 100), axis=0)
    ax.fill_between(time, low, high, color=colour, alpha=0.15, linewidth=0)
    ax.fill_between(time, five, ninety_five, color=colour, alpha=0.30, linewidth=0)
    ax.plot(time, middle, color=colour, label=panel.lines[line] or None)


def _overlay(
    ax: Any, time: np.ndarray, group: Group, panel: Panel, positions: list[int], line: int, colour: str | None
) -> None:
    """A line a case; where joints share the panel they have the colours, and cases are told apart by how faint."""
    for index, position in enumerate(positions):
        y = history(group, panel, position)[:, line]
        if colour is not None:
            alpha = 1.0 - 0.7 * index / max(1, len(positions) - 1)
            label = panel.lines[line] if index == 0 and panel.lines[line] else None
            _line(ax, time, y, color=colour, alpha=alpha, linewidth=1.0, label=label)
        else:
            _line(ax, time, y, color=_sequence(index, len(positions)), label=_case_label(group, position))


def _draw_command(ax: Any, time: np.ndarray, group: Group, command: Command | None, positions: Sequence[int]) -> None:
    """Dashed, over what followed it; in the cases' colours where each has its own."""
    if command is None:
        return
    style: dict[str, Any] = {"linestyle": (0, (4, 3)), "linewidth": 1.0}
    if command.shared:
        known = COMMAND in ax.get_legend_handles_labels()[1]
        label = None if known else COMMAND
        ax.plot(time, command.values(group, command.longest), color=INK, label=label, **style)
        return
    for index, position in enumerate(positions):
        colour = _sequence(index, len(positions))
        ax.plot(time, command.values(group, position), color=colour, **style)
    ax.plot([], [], color=INK, label=COMMAND, **style)


def _sequence(index: int, count: int) -> Any:
    """Colours that order cases: from dark blue to yellow, the pale end left out."""
    import matplotlib

    return matplotlib.colormaps["viridis"](0.0 if count == 1 else 0.88 * index / (count - 1))


def _differing(group: Group) -> list[Stored]:
    """The varied parameters that tell the cases here apart."""
    return [v for v in group.role("coordinate") if len(np.unique(group.values(v.name))) > 1]


def _case_label(group: Group, position: int) -> str:
    """The values of what differs; the legend's title says of what."""
    values = [number_text(group.values(v.name)[position] / deck_unit(v)[0]) for v in _differing(group)]
    return " · ".join(values) or f"case #{group.values('case')[position]}"


def _case_title(group: Group) -> str:
    """What the values in the legend are of, a line each."""
    return " ·\n".join(_with_unit(v) for v in _differing(group))


def _with_unit(variable: Stored) -> str:
    unit = deck_unit(variable)[1]
    return f"{variable.name}  ({unit})" if unit else variable.name


# Metrics


def _metrics(archive: ArchiveFile, group: Group) -> Any:
    """Metrics over the parameter with most values; the next one in colour."""
    metrics = group.role("metric")
    if not metrics:
        helps = "`--histories all` keeps histories; a `metric` in the deck gives a number a case"
        raise Problem(
            error("E327", f"nothing to draw in `{group.name}`: it has neither histories nor metrics", help=helps)
        )
    varied = sorted(group.role("coordinate"), key=lambda v: -len(np.unique(group.values(v.name))))
    shown = [_shown(group, metric) for metric in metrics]
    rows: list[list[Cell | None]] = []
    for metric, (y, label) in zip(metrics, shown, strict=True):
        lost = int((~np.isfinite(y)).sum())
        about = metric.long_name + (f"; not finite in {lost:,} cases, which are left out" if lost else "")
        panel = Panel(metric.name, about, metric.unit, metric.name, ("",), (0,))
        rows.append([Cell(panel, (0,), label, about)])
    figure, axes = _grid(rows)
    x, x_label = group.values("case"), "case"
    if varied:
        x, x_label = _shown(group, varied[0])
    for (y, _), row in zip(shown, axes, strict=True):
        _scatter(row[0], group, x, np.where(np.isfinite(y), y, np.nan), varied[1] if len(varied) > 1 else None)
    _dress(axes, rows, below=x_label)
    if len(varied) > 1:
        handles, labels = axes[0][0].get_legend_handles_labels()
        if handles:
            figure.legend(
                handles, labels, loc="outside right upper", fontsize=8, markerscale=_marker_scale(group.count)
            )
    _title(figure, archive, group, f"{group.count:,} cases")
    return figure


def _shown(group: Group, variable: Stored) -> tuple[np.ndarray, str]:
    """A varied parameter or a metric in the deck's unit, and its axis label."""
    return group.values(variable.name) / deck_unit(variable)[0], _with_unit(variable)


def _marker_scale(count: int) -> float:
    """How much smaller than alone a marker is among so many; the legend's are not."""
    return 1.0 if count < 400 else 1.7 if count < 20_000 else 3.7


def _apart(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Places of the points to draw, of many: of those that fall on one dot of the picture, the last, which hides the
    others. So none that stands alone is left out."""
    if len(x) <= MANY:
        return np.arange(len(x))
    there = np.flatnonzero(np.isfinite(y))[::-1]
    dots = np.zeros(len(there), np.int64)
    for values, count in ((x, DOTS[0]), (y, DOTS[1])):
        low, high = values[there].min(initial=np.inf), values[there].max(initial=-np.inf)
        dots = dots * (count + 1) + (count * (values[there] - low) / ((high - low) or 1.0)).astype(np.int64)
    return np.sort(there[np.unique(dots, return_index=True)[1]])


def _scatter(ax: Any, group: Group, x: np.ndarray, y: np.ndarray, by: Stored | None) -> None:
    drawn_ones = _apart(x, y)
    size = MARKER / _marker_scale(len(x)) ** 2
    x, y = x[drawn_ones], y[drawn_ones]
    if by is None:
        ax.scatter(x, y, s=size, color=COLOURS[0], linewidths=0, rasterized=True)
        return
    values, label = _shown(group, by)
    values = values[drawn_ones]
    levels = np.unique(values)
    if len(levels) <= OVERLAID:
        name, _, unit = label.partition("  (")
        for index, level in enumerate(levels):
            here = values == level
            text = f"{name} = {number_text(level)} {unit.rstrip(')')}".strip()
            ax.scatter(x[here], y[here], s=size, color=_sequence(index, len(levels)), linewidths=0, label=text)
        return
    drawn = ax.scatter(x, y, s=size, c=values, cmap="viridis", linewidths=0, rasterized=True)
    bar = ax.figure.colorbar(drawn, ax=ax, pad=0.01, aspect=18)
    bar.set_label(label, fontsize=8)
    bar.outline.set_visible(False)


# Dress


def _grid(rows: Sequence[Sequence[Cell | None]], flat: Sequence[bool] = ()) -> tuple[Any, list[list[Any]]]:
    """Panels under and beside one another; time shared, and in a row the scale of what has the same unit.

    flat  which rows are zero throughout, and low; none where that is not said
    """
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    columns = len(rows[0])
    width = 8.6 if columns == 1 else 3.6 * columns + 2.2
    engine = ConstrainedLayoutEngine(h_pad=0.05, w_pad=0.06, hspace=0.02)
    heights = [FLAT if low else 1.0 for low in flat or [False] * len(rows)]
    figure = Figure(figsize=(width, PANEL_INCHES * max(sum(heights), 1.5) + 1.0), layout=engine)
    axes = [list(row) for row in figure.subplots(len(rows), columns, sharex=True, squeeze=False, height_ratios=heights)]
    for ax in (ax for row, height in zip(axes, heights, strict=True) for ax in row if height < 1.0):
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


def _dress(axes: list[list[Any]], rows: Sequence[Sequence[Cell | None]], below: str = "time  (s)") -> None:
    """Labels of the axes, once where neighbours share them, and above each panel what it shows."""
    for number, (cells, row) in enumerate(zip(rows, axes, strict=True)):
        before = None
        for column, (cell, ax) in enumerate(zip(cells, row, strict=True)):
            if cell is not None:
                alike = before is not None and before.axis == cell.axis
                ax.set_ylabel("" if alike else _broken(cell.axis))
                ax.tick_params(labelleft=not alike)
                colour = INK if len(cells) > 1 else FAINT
                ax.set_title(cell.title, loc="left", fontsize=8.5, color=colour, pad=4)
                last = all(later[column] is None for later in rows[number + 1 :])
                ax.set_xlabel(below if last else "")
                ax.tick_params(labelbottom=last)
            before = cell


def _broken(label: str) -> str:
    """A long label in two lines: name, unit."""
    return label.replace("  (", "\n(") if len(label) > 16 else label


def _legend(
    figure: Any, axes: list[list[Any]], group: Group, rows: Sequence[Sequence[Cell | None]], flat: Sequence[bool], *,
    single: bool, fan: bool, by_joint: bool,
) -> None:  # fmt: skip
    """Beside the panels, once for some that share it; not beside a flat one, where it has no room."""
    if by_joint:
        last: list[str] = []
        since = 0
        for row, low in zip(axes, flat, strict=True):
            labels = row[0].get_legend_handles_labels()[1]
            since += 1
            if labels and (labels != last or (since > LEGEND_EVERY and not low)):
                row[0].legend(loc="upper left", bbox_to_anchor=(1.005, 1.06), fontsize=8.5, handlelength=1.4)
                last, since = labels, 1
        return
    known: dict[str, Any] = {}
    for cells, row in zip(rows, axes, strict=True):
        for cell, ax in zip(cells, row, strict=True):
            if cell is not None:
                handles, labels = ax.get_legend_handles_labels()
                known |= {text: handle for text, handle in zip(labels, handles, strict=True) if text not in known}
    if fan:  # its panels have their joints' names above them
        known = {text: handle for text, handle in known.items() if text == COMMAND}
    if known:
        command = known.pop(COMMAND, None)
        known |= {COMMAND: command} if command is not None else {}
        title = None if fan else _case_title(group)
        figure.legend(
            known.values(), known.keys(), loc="outside right upper", fontsize=8, title=title, title_fontsize=8,
            alignment="left",
        )  # fmt: skip


def _title(figure: Any, archive: ArchiveFile, group: Group, below: str) -> None:
    head = f"{archive.deck.strip('<>')} · {group.name}"
    text = f"{head}\n" if below else head
    figure.suptitle(text, x=0.012, ha="left", fontsize=12, fontweight="bold", linespacing=1.5)
    if below:
        height = figure.get_figheight()
        figure.text(0.012, 1.0 - 0.42 / height, below, fontsize=8.5, color=FAINT, ha="left", va="center")
