"""How heavy an arm a law bears, by servo rate and delay: the map of docs/linear.md, from `met margin`'s numbers.

    python -m tests.paper.stability_map          writes docs/figures/stability_map.png, and prints the limits

Above the limit a pole of the loop from tick to tick is larger than one (met/analysis/linear/bed_loop.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

import ic
from met.analysis.margin import margins
from tests.paper.figures import FOLDER, INK, MUTED, SURFACE

RATES = (50, 100, 200, 500, 1000, 2000, 5000)
DELAYS = (0, 1, 2)
COLOURS = ("#2a78d6", "#eb6834", "#52514e")


def limits(law: str, rate_hz: float, delays: Sequence[int] = DELAYS, bed: str = "") -> list[float | None]:
    """The largest r = J_eff/(N^2 J_m) at which a law is stable, for each delay in ticks; None where none was found.

    law, bed  as a deck has them: `velocity_tracking(gain = 0.5)`; `f_cut = 20 Hz`
    """
    text = f"""
        #include <two_link.ic>
        run there like nominal {{
            substitute shoulder {{ bed = emulated({bed});  law = {law}; }}
            rates {{ base = {rate_hz} Hz; dynamics = {rate_hz} Hz; servos = {rate_hz} Hz; record = {rate_hz} Hz; }}
            duration = 1 s;
        }}
        sweep delays of there {{ vary shoulder.bed.delay = {list(delays)}; }}
    """
    (experiment,) = ic.compile(text=text, select=["delays"]).experiments
    return [joint.limit for (joint,) in margins(experiment)]


def draw(folder: Path, found: Sequence[Sequence[float | None]]) -> Path:
    """The map of measured acceleration, as PNG in `folder`. found: for each of `RATES`, the limit at each delay."""
    figure = Figure(figsize=(7.0, 4.2), dpi=150, facecolor=SURFACE, layout="constrained")
    axes = figure.add_subplot(facecolor=SURFACE)
    for number, (delay, colour) in enumerate(zip(DELAYS, COLOURS, strict=True)):
        column = [row[number] for row in found]
        axes.loglog(RATES, column, color=colour, linewidth=1.6, marker="o", markersize=4, label=f"delay {delay}")
    axes.set_title("measured_acceleration: unstable above the line", loc="left", color=INK, fontsize=11)
    axes.set_xlabel("servo rate, Hz", color=MUTED)
    axes.set_ylabel("r = J_eff/(N^2 J_m)", color=MUTED)
    axes.set_xticks(RATES, [str(rate) for rate in RATES])
    axes.set_xticks([], minor=True)
    axes.set_yticks((1, 2, 5, 10, 20), ("1", "2", "5", "10", "20"))
    axes.set_yticks([], minor=True)
    axes.grid(color=MUTED, alpha=0.15, linewidth=0.8)
    axes.tick_params(colors=MUTED)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper left", frameon=False, labelcolor=INK, fontsize=9, title="ticks of the servo")
    path = folder / "stability_map.png"
    figure.savefig(path, metadata={"Software": None})
    return path


if __name__ == "__main__":
    table = [limits("measured_acceleration", rate) for rate in RATES]
    print("measured_acceleration", dict(zip(RATES, table, strict=True)))
    for law in ("torque_balance", "torque_balance_observer", "velocity_tracking", "velocity_tracking(gain = 0.6)"):
        print(law, {rate: limits(law, rate) for rate in (100, 1000)})
    print(draw(FOLDER, table))
