"""Pictures of logs beside runs: what was measured and computed, and what is left, a row of panels a channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from batch.measured.mcap_log import MeasuredSignals
from batch.measured.paired import ComputedChannel, Pair
from batch.plotting import output as places
from batch.plotting.layout import COLOURS, FAINT, STYLE
from met.frozen import frozen

MOST_CHANNELS = 16
"""Largest number of channels in a picture: the first ones."""


@frozen
class MeasuredPanel:
    """A channel of a log: `measured` at `instants`, s, and what was computed there, by what computed it; in `unit`."""

    channel: str
    unit: str
    instants: np.ndarray
    measured: np.ndarray
    computed: Mapping[str, np.ndarray]


def panels(
    log: MeasuredSignals, units: Mapping[str, str], courses: Mapping[str, Mapping[str, ComputedChannel]]
) -> list[MeasuredPanel]:
    """The channels of a log, one panel each, at the instants for which there is a computed number.

    courses  the computed signals over time, by what computed them and by channel;  units: SI, by channel
    """
    drawable_panels = []
    for channel, (instants, measured) in log.signals.items():
        ways = {name: course[channel] for name, course in courses.items() if channel in course}
        if ways:
            pair = Pair.of(instants, measured, next(iter(ways.values())))
            computed = {name: channel.at(pair.instants) for name, channel in ways.items()}
            drawable_panels.append(MeasuredPanel(channel, units[channel], pair.instants, pair.measured, computed))
    return drawable_panels


def draw(title: str, panels: Sequence[MeasuredPanel], output: Path) -> None:
    """Draw what was measured and computed of each channel on the left, and the residuals on the right. Raises Problem
    for an output that cannot be written."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        drawn = panels[:MOST_CHANNELS]
        figure = Figure(figsize=(11.0, 1.5 * len(drawn) + 0.9), dpi=144, layout="constrained")
        more = f", {len(panels) - len(drawn)} more channels are not drawn" if len(panels) > len(drawn) else ""
        figure.suptitle(f"{title}{more}", fontsize=10.0)
        axes = figure.subplots(len(drawn), 2, sharex=True, squeeze=False)
        for panel, (left, right) in zip(drawn, axes, strict=True):
            left.plot(panel.instants, panel.measured, color=FAINT, linewidth=2.6, label="measured")
            right.axhline(0.0, color=FAINT, linewidth=0.8)
            colours = COLOURS[: len(panel.computed)][::-1]
            for (name, computed), colour in zip(panel.computed.items(), colours, strict=True):
                left.plot(panel.instants, computed, color=colour, linewidth=1.0, label=name)
                right.plot(panel.instants, panel.measured - computed, color=colour, linewidth=0.8)
            left.set_title(panel.channel, loc="left", fontsize=8.5)
            right.set_title("measured - computed", loc="left", fontsize=8.5)
            left.set_ylabel("" if panel.unit == "1" else panel.unit, fontsize=9.0)
        axes[0, 0].legend(loc="upper right", fontsize=8.0)
        for ax in axes[-1]:
            ax.set_xlabel("time, s", fontsize=9.0)
        places.save(figure, output)
