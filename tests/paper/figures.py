"""Figures 5 to 8 of the paper: rate of joint 1 and of joint 2 against time, in software alone and with joint 1's motor
on a bed.

    python -m tests.paper.figures          writes docs/figures/paper_figure_5.png to paper_figure_8.png

The paper's own curves are lost. Figures 5 and 6 are drawn with the exact motion (tests/oracles/two_link_lagrange.py)
behind them, 7 and 8 with the run in software, at the paper's rates and at 1 kHz.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from met.run import Run
from tests.oracles.two_link_lagrange import Command, Motion, reference
from tests.paper.two_link import SLOW, hybrid, run

FOLDER = Path(__file__).parents[2] / "docs" / "figures"
RATES = {"servo 100 Hz, dynamics 25 Hz": (100.0, 25.0), "servo and dynamics 1 kHz": (1000.0, 1000.0)}
SURFACE, INK, MUTED, LINE, BEHIND = "#fcfcfb", "#0b0b0b", "#52514e", "#2a78d6", "#eb6834"


@cache
def curves() -> tuple[Run, Motion]:
    """The run at the paper's rates, servo 100 Hz and dynamics 25 Hz, and the exact motion at the same instants."""
    told = Command("rate", lambda t: ((SLOW, 0.0), (SLOW, 0.0)))
    return run(duration=20), reference(np.arange(501) / 25.0, command=told, servo_hz=100.0)


@cache
def pair(servo_hz: float, dynamics_hz: float) -> tuple[Run, Run]:
    """The run in software, and with the shoulder's motor on a bed with typical faults."""
    return run(servo_hz=servo_hz, dynamics_hz=dynamics_hz), hybrid(servo_hz=servo_hz, dynamics_hz=dynamics_hz)


def draw(folder: Path) -> list[Path]:
    """All four figures, as PNG in `folder`; gives back their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    return [*_in_software(folder), *_with_a_motor(folder)]


def _in_software(folder: Path) -> list[Path]:
    met, exact = curves()
    written = []
    for joint, name in enumerate(("shoulder", "elbow")):
        figure = Figure(figsize=(7.0, 3.6), dpi=150, facecolor=SURFACE, layout="constrained")
        axes = figure.add_subplot(facecolor=SURFACE)
        rate = met.signals["qd"][0, :, joint]
        axes.axhline(SLOW, color=MUTED, linewidth=1.0, linestyle=(0, (4, 3)))
        axes.annotate(
            f"commanded, {SLOW} rad/s",
            (20.0, SLOW),
            xytext=(0, 5),
            textcoords="offset points",
            ha="right",
            color=MUTED,
            fontsize=9,
        )
        axes.plot(
            exact.time, exact.qd[:, joint], color=BEHIND, linewidth=4.0, alpha=0.45, label="exact (Lagrange, DOP853)"
        )
        axes.plot(met.time, rate, color=LINE, linewidth=1.6, label="MET, dynamics 25 Hz, servo 100 Hz")
        title = f"Joint {joint + 1} ({name}): the paper's figure {joint + 5}"
        axes.set_title(title, loc="left", color=INK, fontsize=11)
        axes.set_xlabel("time, s", color=MUTED)
        axes.set_ylabel("joint rate, rad/s", color=MUTED)
        axes.set_xlim(0.0, 20.0)
        axes.set_ylim(0.0, 0.034)
        axes.grid(color=MUTED, alpha=0.15, linewidth=0.8)
        axes.tick_params(colors=MUTED)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="lower right", frameon=False, labelcolor=INK, fontsize=9)
        path = folder / f"paper_figure_{joint + 5}.png"
        figure.savefig(path, metadata={"Software": None})
        written.append(path)
    return written


def _with_a_motor(folder: Path) -> list[Path]:
    """A row for each pair of rates: the whole run, and one second of it, near to."""
    written = []
    for joint, name in enumerate(("shoulder", "elbow")):
        figure = Figure(figsize=(9.0, 5.4), dpi=150, facecolor=SURFACE, layout="constrained")
        title = f"Joint {joint + 1} ({name}), shoulder's motor on a bed: the paper's figure {joint + 7}"
        figure.suptitle(title, x=0.01, ha="left", color=INK, fontsize=11)
        grid = figure.subplots(2, 2, width_ratios=(1.7, 1.0), sharex="col")
        for (whole, near), (label, rates) in zip(grid, RATES.items(), strict=True):
            pure, mixed = pair(*rates)
            one, other = (each.signals["qd"][0, :, joint] for each in (pure, mixed))
            whole.axhline(SLOW, color=MUTED, linewidth=1.0, linestyle=(0, (4, 3)))
            whole.plot(pure.time, one, color=BEHIND, linewidth=4.0, alpha=0.45, label="in software")
            whole.plot(mixed.time, other, color=LINE, linewidth=0.8, label="motor on a bed")
            whole.set_title(label, loc="left", color=INK, fontsize=9)
            whole.set_ylabel("joint rate, rad/s", color=MUTED)
            whole.set_xlim(0.0, 20.0)
            whole.set_ylim(0.0, 0.034)
            whole.legend(loc="lower right", frameon=False, labelcolor=INK, fontsize=9)
            shown = (mixed.time >= 12.0) & (mixed.time <= 13.0)
            near.axhline(0.0, color=BEHIND, linewidth=4.0, alpha=0.45)
            marker = "." if shown.sum() < 100 else ""
            near.plot(mixed.time[shown], 100.0 * (other - one)[shown] / SLOW, color=LINE, linewidth=1.0, marker=marker)
            near.set_title("off the run in software, near to", loc="left", color=INK, fontsize=9)
            near.set_ylabel("% of the rate asked", color=MUTED)
            near.set_xlim(12.0, 13.0)
            reach = (1.6, 0.35)[joint]
            near.set_ylim(-reach, reach)
            for axes in (whole, near):
                axes.set_facecolor(SURFACE)
                axes.grid(color=MUTED, alpha=0.15, linewidth=0.8)
                axes.tick_params(colors=MUTED)
                axes.spines[["top", "right"]].set_visible(False)
        for axes in grid[1]:
            axes.set_xlabel("time, s", color=MUTED)
        path = folder / f"paper_figure_{joint + 7}.png"
        figure.savefig(path, metadata={"Software": None})
        written.append(path)
    return written


if __name__ == "__main__":
    for path in draw(FOLDER):
        print(path)
