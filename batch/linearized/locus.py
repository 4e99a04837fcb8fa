"""A root locus: the poles of all cases of a sweep, in the plane of z and in that of s."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.plotting import output as places
from batch.plotting.layout import FAINT, INK, STYLE
from ic.printing.columns import count
from met.analysis.linear.answers import Linearized, LinearQuestion
from met.diagnostic import Problem, error

DAMPINGS = (0.1, 0.3, 0.5, 0.7)
"""Damping ratios for which lines are drawn."""

MAP = "viridis"
"""Colours of the cases, from the least value to the largest."""

ROOM = 1.05
"""Extent of the s plane, relative to the fastest rotating pole."""

WIDE, LEAST_SWING = 1.5, 0.05
"""Largest width of the s plane, relative to its height, where a pole oscillates: with at least this share of the width.
Poles that decay faster are shown only in the z plane."""


def draw(question: LinearQuestion, answers: Sequence[Linearized | str], output: Path) -> None:
    """Draw the poles of all cases that have an answer. Raises Problem E450 where there are none, E305, E326."""
    import matplotlib

    style: Any = STYLE
    with matplotlib.rc_context(style):
        places.save(figure(question, answers), output)


def figure(question: LinearQuestion, answers: Sequence[Linearized | str]) -> Any:
    """The picture that `draw` writes, a matplotlib Figure. Raises Problem E450.

    Poles are coloured by the value of what varies first; those of the first case are crosses, those of the last rings.
    The plane of s has, in Hz, the frequency at which a pole turns over the rate at which it grows. Poles that are gone
    within a period, or decay much faster than others turn, are in the plane of z alone.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    answered = {case: answer for case, answer in enumerate(answers) if isinstance(answer, Linearized)}
    if not answered:
        raise Problem(
            error("E450", "there is nothing to draw: no case has an answer", help="`--at` asks at another instant")
        )
    values, label = _coordinate(question)
    norm = Normalize(float(np.min(values)), float(np.max(values)))
    picture = Figure(figsize=(9.4, 4.9), dpi=144, layout="constrained")
    z_plane, s_plane = picture.subplots(1, 2)
    for case in answered:
        poles = np.array([(pole.z, pole.s / (2.0 * math.pi)) for pole in answered[case].poles])
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
