"""Bode, Nichols and Nyquist pictures of opened loops, and steps from inputs to outputs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.plotting import output as places
from batch.plotting.layout import COLOURS, FAINT, INK, STYLE
from ic.printing.columns import count
from met.analysis.linear.answers import Linearized, LinearQuestion, OpenLoop
from met.diagnostic import Problem, error

POINTS = 1500
"""Number of frequencies of a curve."""

DECADES = 5
"""Decades of a Bode picture, below the highest frequency that a loop sees."""

LEAST_DEGREES, MOST_MARKS = 100.0, 8
"""Smallest length of an axis of phases, deg, and the number of marks on it above which they are set wider apart."""

STEPS = 2000
"""Largest number of periods in a picture of a step."""


def draw(linearized: Linearized, output: Path) -> None:
    """Draw the available pictures: the Bode and Nichols curves of each opened loop, with margins marked; the responses
    of outputs to steps of inputs. Raises Problem E450 where there is neither, E305, E326."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        places.save(figure(linearized), output)


def figure(linearized: Linearized) -> Any:
    """The picture that `draw` writes, a matplotlib Figure. Raises Problem E450."""
    from matplotlib.figure import Figure

    highest = math.pi / linearized.seconds
    w = np.geomspace(highest / 10.0**DECADES, highest, POINTS)
    curves = [(loop, loop.loop.response(w)) for loop in linearized.loops if loop.loop is not None and loop.returns]
    steps = bool(linearized.inputs and linearized.outputs)
    if not curves and not steps:
        helps = ("`--open SIGNAL` opens a loop", "`--input SIGNAL --output SIGNAL` asks for a step")
        raise Problem(
            error(
                "E450",
                "there is nothing to draw: no loop of one rate that closes, and no input with an output",
                help=helps,
            )
        )
    rows = [2.0] * bool(curves) + [1.0] * (len(linearized.outputs) if steps else 0)
    picture = Figure(figsize=(9.4, 2.1 * sum(rows) + 0.9), dpi=144, layout="constrained")
    grid = picture.add_gridspec(len(rows), 1, height_ratios=rows)
    if curves:
        inner = grid[0].subgridspec(2, 2)
        _bode(picture.add_subplot(inner[0, 0]), picture.add_subplot(inner[1, 0]), w, curves)
        _nichols(picture.add_subplot(inner[:, 1]), curves)
    if steps:
        first = len(rows) - len(linearized.outputs)
        for row, name in enumerate(linearized.outputs):
            _step(
                picture.add_subplot(grid[first + row]), linearized, row, name, last=row == len(linearized.outputs) - 1
            )
    picture.suptitle(
        f"{linearized.experiment} {linearized.where}, a period of {1e3 * linearized.seconds:g} ms", x=0.01, ha="left"
    )
    return picture


def _bode(size: Any, phase: Any, w: np.ndarray, curves: Sequence[tuple[OpenLoop, np.ndarray]]) -> None:
    """Draw size and phase of the opened loops over the frequency, Hz, with the margins marked. w: frequencies, rad/s;
    curves: the loops with their complex responses there"""
    for number, (loop, L) in enumerate(curves):
        colour = COLOURS[number % len(COLOURS)]
        turned = np.degrees(_turned(L))
        size.loglog(w / (2.0 * math.pi), np.abs(L), color=colour, label=loop.paths[0])
        phase.semilogx(w / (2.0 * math.pi), turned, color=colour)
        if loop.margins is None:
            continue
        for frequency, axis, curve in (
            (loop.margins.at_phase, phase, turned),
            (loop.margins.at_gain_up, size, np.abs(L)),
        ):
            if frequency is not None:
                axis.plot(frequency / (2.0 * math.pi), np.interp(frequency, w, curve), "o", color=colour, markersize=4)
    size.axhline(1.0, color=FAINT, linewidth=0.8)
    phase.axhline(-180.0, color=FAINT, linewidth=0.8)
    size.set_ylabel("size of L")
    phase.set_ylabel("phase, deg")
    phase.set_xlabel("frequency, Hz")
    phase.set_ylim(*_degrees(phase.yaxis))
    for axis in (size.xaxis, size.yaxis, phase.xaxis):
        _plain_numbers(axis)
    size.tick_params(labelbottom=False)
    size.legend(fontsize="small")


def _plain_numbers(axis: Any) -> None:
    """Write the numbers of a logarithmic axis without powers."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _turned(L: np.ndarray) -> np.ndarray:
    """The phase of a curve without jumps, shifted so that its low end is between -360 and 0 deg."""
    turned = np.unwrap(np.angle(L))
    return np.asarray(turned - 2.0 * math.pi * math.ceil(turned[0] / (2.0 * math.pi)))


def _degrees(axis: Any) -> tuple[float, float]:
    """Mark an axis of phases every 45 deg, or 90, or 180 where it is long, and set its ends: at least two marks are
    between them."""
    from matplotlib.ticker import MultipleLocator

    low, high = sorted(axis.get_view_interval().tolist())
    if high - low < LEAST_DEGREES:
        middle = 0.5 * (low + high)
        low, high = middle - 0.5 * LEAST_DEGREES, middle + 0.5 * LEAST_DEGREES
    step = next((step for step in (45.0, 90.0) if high - low <= MOST_MARKS * step), 180.0)
    axis.set_major_locator(MultipleLocator(step))
    return low, high


def _nichols(ax: Any, curves: Sequence[tuple[OpenLoop, np.ndarray]]) -> None:
    """Draw size over phase of the opened loops, with the curves on which |S| is 2 and 4. curves: as for `_bode`"""
    for number, (_, L) in enumerate(curves):
        ax.semilogy(np.degrees(_turned(L)), np.abs(L), color=COLOURS[number % len(COLOURS)])
    ax.plot(-180.0, 1.0, "+", color=INK, markersize=9)
    for sensitivity, style in ((2.0, "-"), (4.0, "--")):  # |S| is so large on the curve around -1
        turn = np.linspace(0.0, 2.0 * math.pi, 400)
        around = -1.0 + np.exp(1j * turn) / sensitivity
        phase = np.degrees(np.angle(around))
        ax.semilogy(np.where(phase > 0.0, phase - 360.0, phase), np.abs(around), style, color=FAINT, linewidth=0.8)
    _plain_numbers(ax.yaxis)
    ax.set_xlim(*_degrees(ax.xaxis))
    ax.set_xlabel("phase of L, deg")
    ax.set_ylabel("size of L")
    ax.set_title("Nichols; grey: |S| is 2, and 4", fontsize="small", color=FAINT)


def _step(ax: Any, linearized: Linearized, row: int, name: str, *, last: bool) -> None:
    """Draw the response of an output, by its row in C, to a step of each input, over the periods."""
    period = linearized.seconds
    slowest = max((pole.seconds for pole in linearized.poles if pole.s.real < 0.0 and pole.seconds < 1e7 * period),
                  default=period)  # fmt: skip
    count = int(min(STEPS, max(20.0, 6.0 * slowest / period)))
    for number, signal in enumerate(linearized.inputs):
        x, values = np.zeros(len(linearized.states)), []
        for _ in range(count + 1):
            values.append(float(linearized.C[row] @ x + linearized.D[row, number]))
            x = linearized.A @ x + linearized.B[:, number]
        time = period * np.arange(count + 1)
        ax.step(time, values, where="post", color=COLOURS[number % len(COLOURS)], label=f"step of {signal}")
    ax.set_ylabel(name)
    ax.legend(fontsize="small")
    if last:
        ax.set_xlabel("time, s")
    else:
        ax.tick_params(labelbottom=False)


DAMPINGS = (0.1, 0.3, 0.5, 0.7)
"""Damping ratios for which lines are drawn."""

MAP = "viridis"
"""Colours of the cases, from the least value to the largest."""

ROOM = 1.05
"""Extent of the s plane, relative to the fastest rotating pole."""

WIDE, LEAST_SWING = 1.5, 0.05
"""Largest width of the s plane, relative to its height, where a pole oscillates: with at least this share of the width.
Poles that decay faster are shown only in the z plane."""


def draw_locus(question: LinearQuestion, answers: Sequence[Linearized | str], output: Path) -> None:
    """Draw the poles of all cases that have an answer. Raises Problem E450 where there are none, E305, E326."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        places.save(locus_figure(question, answers), output)


def locus_figure(question: LinearQuestion, answers: Sequence[Linearized | str]) -> Any:
    """The picture that `draw` writes, a matplotlib Figure. Raises Problem E450.

    Poles are coloured by the value of what varies first; those of the first case are crosses, those of the last rings.
    The plane of s has, in Hz, the frequency at which a pole turns over the rate at which it grows. Poles that are gone
    within a period, or decay much faster than others turn, are in the plane of z alone.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    answered = {case: answer for case, answer in enumerate(answers) if isinstance(answer, Linearized)}
    if not any(answer.poles for answer in answered.values()):
        reason, help = "no case has an answer", "`--at` asks at another instant"
        if answered:
            reason, help = "no case has a pole, for nothing moves", "a joint that is locked or prescribed has none"
        raise Problem(error("E450", f"there is nothing to draw: {reason}", help=help))
    values, label = _coordinate(question)
    norm = Normalize(float(np.min(values)), float(np.max(values)))
    picture = Figure(figsize=(9.4, 4.9), dpi=144, layout="constrained")
    z_plane, s_plane = picture.subplots(1, 2)
    for case in answered:
        places_of_poles = [(pole.z, pole.s / (2.0 * math.pi)) for pole in answered[case].poles]
        poles = np.array(places_of_poles, complex).reshape(-1, 2)  # also of a case without states
        colour = ScalarMappable(norm, MAP).to_rgba(values[case])
        for axes, points in ((z_plane, poles[:, 0]), (s_plane, poles[np.isfinite(poles[:, 1].real), 1])):
            axes.plot(points.real, points.imag, ".", color=colour, markersize=4)
            for end, sign in ((min(answered), "x"), (max(answered), "o")):
                if case == end and len(answered) > 1:
                    axes.plot(
                        points.real,
                        points.imag,
                        sign,
                        color=INK,
                        markersize=7,
                        markerfacecolor="none",
                        markeredgewidth=0.9,
                    )
    _circle(z_plane)
    _damping(s_plane)
    s_plane.set_xlabel("Re s / 2π, Hz: growth")
    s_plane.set_ylabel("Im s / 2π, Hz")
    z_plane.set_xlabel("Re z")
    z_plane.set_ylabel("Im z")
    picture.colorbar(ScalarMappable(norm, MAP), ax=[z_plane, s_plane], label=label, aspect=30, pad=0.02)
    first = next(iter(answered.values()))
    left = len(answers) - len(answered)
    picture.suptitle(
        f"{first.experiment} {first.where}, {count(len(answers), 'case')}"
        + (f", {left:,} of them without an answer" if left else "")
        + "; × the first, ○ the last",
        x=0.01,
        ha="left",
    )
    return picture


def _coordinate(question: LinearQuestion) -> tuple[np.ndarray, str]:
    """The values by which cases are coloured, [case], in the deck's unit, and their label."""
    cases = question.experiment.cases
    if not cases.coordinates:
        return np.arange(float(cases.count)), "case"
    first = cases.coordinates[0]
    unit = "" if first.unit in ("", "1") else f", {first.unit}"
    return np.array([float(first.values[case]) / first.scale for case in range(cases.count)]), f"{first.path}{unit}"


def _circle(axes: Any) -> None:
    """The stability limit, and curves of equal damping within it, from z = 1 to half of the sampling rate."""
    turn = np.linspace(0.0, math.pi, 400)
    axes.plot(np.cos(turn), np.sin(turn), color=FAINT, linewidth=1.0)
    for ratio in DAMPINGS:
        curve = np.exp(turn * complex(-ratio / math.sqrt(1.0 - ratio * ratio), 1.0))
        axes.plot(curve.real, curve.imag, color=FAINT, linewidth=0.5)
    axes.axhline(0.0, color=FAINT, linewidth=0.5)
    low, high = axes.get_ylim()
    axes.set_ylim(min(0.0, low), high)
    axes.set_aspect("equal", adjustable="box")


def _damping(axes: Any) -> None:
    """Rays of equal damping from s = 0 to the ends of the axes, each with its ratio, and the stability limit."""
    left, right = axes.get_xlim()
    top = ROOM * axes.get_ylim()[1]
    if top > LEAST_SWING * -left:
        left = max(left, -WIDE * top)
    axes.axvline(0.0, color=FAINT, linewidth=1.0)
    for ratio in DAMPINGS:
        slope = math.sqrt(1.0 - ratio * ratio) / ratio
        x = max(left, -top / slope)
        axes.plot([0.0, x], [0.0, -slope * x], color=FAINT, linewidth=0.5)
        axes.annotate(f"{ratio:g}", (x, -slope * x), fontsize="x-small", color=FAINT, ha="right", va="bottom")
    axes.set_xlim(left, max(right, 0.02 * -left))
    axes.set_ylim(0.0, top)
