"""`met plot`: an archive as a picture. One panel a signal; joints as lines, cases overlaid, many cases as a fan.

One case: a line a joint. Up to `OVERLAID` cases: a column a joint, a line a case. More: a line for the median of all
cases, a dark band for nine in ten and a light one for all. Without histories: metrics over the varied parameter.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, Group, Stored
from batch.signals import Panel, case_text, history, number_text, panels, pretty_unit
from met.diagnostic import Problem, error

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito, "Color Universal Design" (2008): told apart by colour-blind eyes as well."""

OVERLAID = 8
FAN_CASES = 2000
"""A fan is drawn from this many cases at most, spread over all."""

INK, FAINT = "#22282e", "#8a939c"
PANEL_INCHES, MARKER = 1.85, 14
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

    group = chosen(archive, (experiment,) if experiment else ())[0]
    output = Path(output)
    check_picture(output)
    matplotlib = _matplotlib()
    with matplotlib.rc_context(STYLE):
        if group.recorded or signals or cases:
            figure = _histories(archive, group, signals, cases)
        else:
            figure = _metrics(archive, group)
        _save(figure, output)
    return output


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
    wanted = panels(group, signals)
    positions = [_recorded_position(group, case) for case in cases] if cases else list(range(group.recorded))
    single = len(positions) == 1
    columns = 1 if single else max(len(panel.lines) for panel in wanted)
    fan = len(positions) > OVERLAID
    by_joint = single or columns > 3
    columns = 1 if by_joint else columns
    figure, axes = _grid(len(wanted), columns)
    time = group.values("time")
    joints = list(group.values("joint")) if "joint" in group.variables else []
    for row, panel in enumerate(wanted):
        for column in range(columns):
            ax = axes[row][column]
            lines = range(len(panel.lines)) if by_joint else [column] if column < len(panel.lines) else []
            if not lines:
                ax.set_visible(False)
                continue
            for line in lines:
                colour = _joint_colour(joints, panel, line)
                if single:
                    y = history(group, panel, positions[0])[:, line]
                    style = {"linewidth": _width(line, len(panel.lines)), "linestyle": _dashes(line)}
                    _line(ax, time, y, color=colour, label=panel.lines[line] or None, **style)
                elif fan:
                    _fan(ax, time, group, panel, positions, line, colour)
                else:
                    _overlay(ax, time, group, panel, positions, line, colour if by_joint else None)
            _dress(ax, panel, panel.lines[column] if not by_joint else "", column)
            ax.margins(x=0.0)
        for ax in axes[row]:
            ax.tick_params(labelbottom=row == len(wanted) - 1)
    _time_labels(axes, wanted, columns)
    _legend(figure, axes, group, wanted, positions, single=single, fan=fan, by_joint=by_joint)
    if single:
        below = case_text(group, positions[0]) if group.attributes["cases_in_table"] > 1 else ""
    else:
        below = f"{len(positions):,} cases" + (": median, nine in ten, and all" if fan else "")
    _title(figure, archive, group, below)
    return figure


def _recorded_position(group: Group, case: str) -> int:
    panels(group)  # refuses an archive without histories
    return group.find_case(case)


def _joint_colour(joints: list[str], panel: Panel, line: int) -> str:
    """A joint has one colour in all panels, also where a signal is its alone (`shoulder.servo.voltage`)."""
    joint = panel.lines[line] or panel.name.partition(".")[0]
    return COLOURS[(joints.index(joint) if joint in joints else line) % len(COLOURS)]


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
    some = (
        positions
        if len(positions) <= FAN_CASES
        else [positions[i] for i in np.linspace(0, len(positions) - 1, FAN_CASES).astype(int)]
    )
    values = np.stack([history(group, panel, position)[:, line] for position in some])
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


def _sequence(index: int, count: int) -> Any:
    """Colours that order cases: from dark blue to yellow, the pale end left out."""
    import matplotlib

    return matplotlib.colormaps["viridis"](0.0 if count == 1 else 0.88 * index / (count - 1))


def _case_label(group: Group, position: int) -> str:
    varied = group.coordinates_of(position)
    differing = {v.name for v in group.role("coordinate") if len(np.unique(group.values(v.name))) > 1}
    words = [
        f"{path} = {number_text(value)} {pretty_unit(unit)}".removesuffix(" 1")
        for path, (value, unit) in varied.items()
        if path in differing
    ]
    return "\n".join(words) or f"case #{group.values('case')[position]}"


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
    figure, axes = _grid(len(metrics), 1)
    x, x_label = group.values("case"), "case"
    if varied:
        x, x_label = _shown(group, varied[0])
    for row, metric in enumerate(metrics):
        ax = axes[row][0]
        y = group.values(metric.name)
        _scatter(ax, group, x, np.where(np.isfinite(y), y, np.nan), varied[1] if len(varied) > 1 else None)
        lost = int((~np.isfinite(y)).sum())
        about = metric.long_name + (f"; not finite in {lost:,} cases, which are left out" if lost else "")
        _dress(ax, Panel(metric.name, about, metric.unit, metric.name, ("",), (0,)), "", 0)
        ax.tick_params(labelbottom=row == len(metrics) - 1)
    axes[-1][0].set_xlabel(x_label)
    if len(varied) > 1:
        handles, labels = axes[0][0].get_legend_handles_labels()
        if handles:
            figure.legend(
                handles, labels, loc="outside right upper", fontsize=8, markerscale=_marker_scale(group.count)
            )
    _title(figure, archive, group, f"{group.count:,} cases")
    return figure


def _shown(group: Group, variable: Stored) -> tuple[np.ndarray, str]:
    """A varied parameter in the deck's unit, and its axis label."""
    scale = float(variable.attributes.get("deck_scale", 1.0))
    unit = pretty_unit(str(variable.attributes.get("deck_unit", variable.unit)))
    return group.values(variable.name) / scale, variable.name if unit == "1" else f"{variable.name}  ({unit})"


def _marker_scale(count: int) -> float:
    """How much smaller than alone a marker is among so many; the legend's are not."""
    return 1.0 if count < 400 else 1.7 if count < 20_000 else 3.7


def _scatter(ax: Any, group: Group, x: np.ndarray, y: np.ndarray, by: Stored | None) -> None:
    size = MARKER / _marker_scale(len(x)) ** 2
    if by is None:
        ax.scatter(x, y, s=size, color=COLOURS[0], linewidths=0, rasterized=True)
        return
    values, label = _shown(group, by)
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


def _grid(rows: int, columns: int) -> tuple[Any, list[list[Any]]]:
    """Panels under and beside one another, time shared."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    width = 8.6 if columns == 1 else 3.6 * columns + 2.2
    engine = ConstrainedLayoutEngine(h_pad=0.05, w_pad=0.06, hspace=0.02)
    figure = Figure(figsize=(width, PANEL_INCHES * max(rows, 1.5) + 1.0), layout=engine)
    axes = figure.subplots(rows, columns, sharex=True, sharey="row", squeeze=False)
    return figure, [list(row) for row in axes]


def _dress(ax: Any, panel: Panel, joint: str, column: int) -> None:
    """Label of the axis, and above the panel what it shows."""
    if column == 0:
        ax.set_ylabel(_broken(panel.axis))
    above = joint if column else " · ".join(part for part in (joint, panel.about) if part)
    ax.set_title(above, loc="left", fontsize=8.5, color=INK if joint else FAINT, pad=4)


def _broken(label: str) -> str:
    """A long label in two lines: name, unit."""
    return label.replace("  (", "\n(") if len(label) > 16 else label


def _time_labels(axes: list[list[Any]], wanted: list[Panel], columns: int) -> None:
    for column in range(columns):
        shown = [row for row in range(len(wanted)) if axes[row][column].get_visible()]
        last = axes[shown[-1]][column]
        last.set_xlabel("time  (s)")
        last.tick_params(labelbottom=True)


def _legend(
    figure: Any, axes: list[list[Any]], group: Group, wanted: list[Panel], positions: list[int], *,
    single: bool, fan: bool, by_joint: bool,
) -> None:  # fmt: skip
    """Beside the panels, once for all that share it."""
    if not single and not fan and not by_joint:
        handles, labels = axes[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", fontsize=8, labelspacing=0.9)
        return
    if not by_joint:
        return
    last: tuple[str, ...] = ()
    for row, panel in enumerate(wanted):
        if panel.lines != last and any(panel.lines):
            axes[row][0].legend(loc="upper left", bbox_to_anchor=(1.005, 1.06), fontsize=8.5, handlelength=1.4)
        last = panel.lines if any(panel.lines) else last


def _title(figure: Any, archive: ArchiveFile, group: Group, below: str) -> None:
    head = f"{archive.deck.strip('<>')} · {group.name}"
    text = f"{head}\n" if below else head
    figure.suptitle(text, x=0.012, ha="left", fontsize=12, fontweight="bold", linespacing=1.5)
    if below:
        height = figure.get_figheight()
        figure.text(0.012, 1.0 - 0.42 / height, below, fontsize=8.5, color=FAINT, ha="left", va="center")
