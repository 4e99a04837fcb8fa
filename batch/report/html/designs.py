"""The design to use: a sentence, a map of which designs meet all requirements, tables, the command that runs it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from batch.queries.pool import page_number
from batch.report.contents.parts import DesignAnswer, DesignMap
from batch.report.html.blocks import command
from batch.report.html.markup import Html, el, join
from batch.report.html.tables import table

SIDE = 320
"""Length of a map's longer side in its drawing's units."""

SHADES = 4
"""Number of shades of designs that meet all requirements: deeper the farther from the border."""


def designs(answer: DesignAnswer) -> Html:
    """The answer of `met best`, or of a search."""
    first, *others = [el("p", line, cls="said") for line in answer.why.split("\n")]
    again = [el("p", answer.purpose, cls="said"), el("p", command(answer.command), cls="command")]
    words = [
        el("p", answer.headline, cls="pick"),
        first,
        again if answer.command else None,
        others,
        [el("p", note, cls="note") for note in answer.notes],
        table(answer.stretches, "How far each may go") if answer.stretches is not None else None,
    ]
    head = el("div", el("div", words), _map(answer.map) if answer.map is not None else None, cls="answered")
    about = el("p", answer.about, cls="said")
    return join([head, about, _progress(answer), table(answer.table, answer.title)])


WIDE, HIGH = 640, 120
"""Size of the drawing of a search's progress, in its units."""


def _progress(answer: DesignAnswer) -> Html | None:
    """The best value so far over the cases of a search, as steps of a line, with a gap where there is none, or where it
    was run on more plants (cases to judge it on) than before; None where it never changed."""
    values = [value for _, value, _ in answer.progress if math.isfinite(value)]
    if len(set(values)) < 2:
        return None
    low, high, last = min(values), max(values), answer.progress[-1][0]
    path, on = "", 0
    for cases, value, tried in answer.progress:
        if not math.isfinite(value):
            on = 0
            continue
        x, y = WIDE * cases / last, HIGH - HIGH * (value - low) / (high - low)
        path += f"H{x:.1f}V{y:.1f}" if on == tried else f"M{x:.1f} {y:.1f}"
        on = tried
    floor = el("line", x1=0, x2=WIDE, y1=HIGH + 3, y2=HIGH + 3, cls="floor")
    ends = f"from {page_number(low)} to {page_number(high)}"
    words = f"{answer.table.heads[2]} over cases, {ends}, after {last:,} cases {page_number(answer.progress[-1][1])}"
    drawn = el("svg", floor, el("path", d=path), viewBox=f"-2 -4 {WIDE + 4} {HIGH + 8}", role="img", aria_label=words)
    caption = [el("code", answer.table.heads[2]), f" {ends}, over {last:,} cases"]
    return el("figure", el("p", caption, cls="under"), drawn, cls="progress")


def _map(design_map: DesignMap) -> Html:
    """A cell for each design: one that meets all requirements, deeper the farther from the border; one that does not;
    one that was not run."""
    rows, columns = design_map.steps.shape
    side = SIDE / max(rows, columns)
    deepest = max(1, int(design_map.steps.max(initial=1)))
    cells = []
    for y in range(rows):
        for x in range(columns):
            steps = int(design_map.steps[y, x])
            if steps < 0:
                continue
            shade = 1 + (SHADES - 1) * (steps - 1) // max(1, deepest - 1) if steps else 0
            corner = {"x": f"{x * side:.2f}", "y": f"{(rows - 1 - y) * side:.2f}"}
            size = f"{side - min(1.0, 0.1 * side):.2f}"
            cells.append(el("rect", **corner, width=size, height=size, cls=f"good{shade}" if steps else "miss"))
    y, x = design_map.best
    middle = {"cx": f"{(x + 0.5) * side:.2f}", "cy": f"{(rows - 0.5 - y) * side:.2f}"}
    cells.append(el("circle", **middle, r=f"{min(10.0, max(3.0, 0.32 * side)):.2f}", cls="best"))
    wide, high = columns * side, rows * side
    good, run_count = int((design_map.steps > 0).sum()), int((design_map.steps >= 0).sum())
    words = f"Designs over {design_map.x} and {design_map.y}: {good} of {run_count} meet all"
    drawn = el("svg", cells, viewBox=f"-2 -2 {wide + 4:.2f} {high + 4:.2f}", role="img", aria_label=words)
    return el(
        "figure",
        el("p", _side(design_map.y, design_map.y_texts, design_map.y_unit, "upwards"), cls="under"),
        drawn,
        el("p", _side(design_map.x, design_map.x_texts, design_map.x_unit, "to the right"), cls="under"),
        el(
            "figcaption",
            el("span", el("span", cls="key good4"), "meets all, far from the border"),
            el("span", el("span", cls="key good1"), "meets all, at the border"),
            el("span", el("span", cls="key miss"), "does not"),
            cls="legend",
        ),
        cls="designs",
    )


def _side(name: str, texts: Sequence[str], unit: str, way: str) -> str:
    """A side of the map in words: `drive.kp from 0.05 to 1 V*s/rad, to the right`."""
    return f"{name} from {texts[0]} to {texts[-1]} {unit}".rstrip() + f", {way}"
