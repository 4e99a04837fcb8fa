"""Figures 5 and 6 of the paper, the run in software alone: rate of joint 1 and of joint 2 against time.

    python -m tests.paper.figures          writes docs/figures/paper_figure_5.png and paper_figure_6.png

The paper's own curves are lost; ours are drawn with the exact motion (tests/oracles/two_link_lagrange.py) behind them.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from met.run import Run
from tests.oracles.two_link_lagrange import Command, Motion, reference
from tests.paper.two_link import SLOW, run

FOLDER = Path(__file__).parents[2] / "docs" / "figures"
SURFACE, INK, MUTED, LINE, BEHIND = "#fcfcfb", "#0b0b0b", "#52514e", "#2a78d6", "#eb6834"


@cache
def curves() -> tuple[Run, Motion]:
    """The run at the paper's rates, servo 100 Hz and dynamics 25 Hz, and the exact motion at the same instants."""
    told = Command("rate", lambda t: ((SLOW, 0.0), (SLOW, 0.0)))
    return run(duration=20), reference(np.arange(501) / 25.0, command=told, servo_hz=100.0)


def draw(folder: Path) -> list[Path]:
    """Both figures, as PNG in `folder`; gives back their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    met, exact = curves()
    written = []
    for joint, name in enumerate(("shoulder", "elbow")):
        figure = Figure(figsize=(7.0, 3.6), dpi=150, facecolor=SURFACE, layout="constrained")
        axes = figure.add_subplot(facecolor=SURFACE)
        rate = met.signals["qd"][0, :, joint]
        axes.axhline(SLOW, color=MUTED, linewidth=1.0, linestyle=(0, (4, 3)))
        axes.annotate(f"commanded, {SLOW} rad/s", (20.0, SLOW), xytext=(0, 5), textcoords="offset points",
                      ha="right", color=MUTED, fontsize=9)  # fmt: skip
        axes.plot(exact.time, exact.qd[:, joint], color=BEHIND, linewidth=4.0, alpha=0.45,
                  label="exact (Lagrange, DOP853)")  # fmt: skip
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


if __name__ == "__main__":
    for path in draw(FOLDER):
        print(path)
