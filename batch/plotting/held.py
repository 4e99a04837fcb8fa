"""Limits over signals: thin dotted lines, named where the name covers least; limits far off are named above the panel,
with an arrow for their direction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.plotting.layout import BESIDE, LETTER, PictureSheet, letters
from batch.queries.limits import LimitMark

TONE = "#a33a0a"
DOTS: dict[str, Any] = {"color": TONE, "linewidth": 0.8, "linestyle": (0, (1, 1.6)), "zorder": 1.6, "label": "_limit"}
PLACES = (0.995, 0.005, 0.5, 0.75, 0.25)
"""Places along a limit's line where its name may stand."""


def draw(ax: Any, marks: Sequence[LimitMark], time: np.ndarray, sheet: PictureSheet, columns: int) -> None:
    """Draw the limits of a panel's signals. Those that would compress the panel are only named."""
    values = [mark for mark in dict.fromkeys(marks) if not mark.time]
    low, high = ax.dataLim.intervaly
    if not np.isfinite(high - low):
        return
    span = (high - low) or abs(high) or 1.0
    near = [mark for mark in values if low - span <= mark.value <= high + span]
    texts: dict[float, list[str]] = {}
    for mark in near:
        texts.setdefault(mark.value, []).append(mark.text)
    for value in texts:
        ax.axhline(value, **DOTS)
    instants = [mark for mark in dict.fromkeys(marks) if mark.time and len(time) and time[0] < mark.value < time[-1]]
    for mark in instants:
        ax.axvline(mark.value, **DOTS)
    for value, names in texts.items():
        _along(ax, value, ", ".join(names), sheet, columns)
    for mark in instants:
        late = mark.value > time[0] + 0.6 * (time[-1] - time[0])
        text = f"{mark.text} " if late else f" {mark.text}"
        _write(ax, mark.value, 0.03, text, ax.get_xaxis_transform(), sheet, ha="right" if late else "left", va="bottom")


def write_limits(ax: Any, marks: Sequence[LimitMark], sheet: PictureSheet, columns: int) -> None:
    """Write the names of limits for which no line is drawn, right of what stands above the panel, if they fit there."""
    lines = {float(line.get_ydata()[0]) for line in ax.lines if line.get_label() == DOTS["label"]}
    inside = {mark.text for mark in marks if mark.time or mark.value in lines}
    high = ax.dataLim.intervaly[1]
    far = {mark.text: "↑" if mark.value > high else "↓" for mark in reversed(marks) if mark.text not in inside}
    text = ", ".join(f"{name} {arrow}" for name, arrow in reversed(far.items()))
    room = letters(sheet, ax.figure.get_figwidth() / columns - BESIDE) - len(ax.get_title("left")) - 3
    if text and len(text) <= room:
        ax.set_title(text, loc="right", fontsize=sheet.small - 1.0, color=TONE, pad=3 if sheet.paper else 4)


def _along(ax: Any, value: float, text: str, sheet: PictureSheet, columns: int) -> None:
    """Write a name beside a horizontal line, where it covers the fewest points of the data."""
    left, right = ax.get_xlim()
    low, high = ax.get_ylim()
    size = sheet.small - 1.0
    wide = len(text) * LETTER * size / 72 / max(1.0, ax.figure.get_figwidth() / columns - BESIDE)
    tall = 1.6 * size / 72 / 1.4
    drawn = [line.get_xydata() for line in ax.lines if line.get_label() != DOTS["label"] and len(line.get_xdata())]
    points = (np.concatenate(drawn) if drawn else np.zeros((0, 2))) - (left, low)
    across, up = points[:, 0] / (right - left), points[:, 1] / (high - low)
    height = (value - low) / (high - low)
    best: tuple[int, float, str] | None = None
    for side, (bottom, top) in (("bottom", (height, height + tall)), ("top", (height - tall, height))):
        for place in PLACES if bottom >= 0.0 and top <= 1.02 else ():
            begins = place - wide * place
            covered = (across > begins - 0.01) & (across < begins + wide + 0.01) & (up > bottom) & (up < top)
            if best is None or covered.sum() < best[0]:
                best = int(covered.sum()), place, side
    _, place, side = best or (0, PLACES[0], "bottom")
    style = {"ha": "right" if place > 0.9 else "left" if place < 0.1 else "center", "va": side}
    _write(ax, place, value, text, ax.get_yaxis_transform(), sheet, **style)


def _write(ax: Any, x: float, y: float, text: str, place: Any, sheet: PictureSheet, **style: Any) -> None:
    """Write a text with a white rim, so that it can be read over lines."""
    from matplotlib.patheffects import withStroke

    ax.text(
        x,
        y,
        text,
        transform=place,
        color=TONE,
        fontsize=sheet.small - 1.0,
        zorder=4,
        in_layout=False,
        path_effects=[withStroke(linewidth=2.0, foreground="white")],
        **style,
    )
