"""The stability of a tuning's design in words, and for programs."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from batch.queries.signals import number_text
from ic.printing.columns import count
from met.plan.searches import USUAL_MARGIN, JudgedDesign, LeastMargins, allowed_gain

if TYPE_CHECKING:
    from met.analysis.margin import Margin


WIDTH = 100
"""Largest length of a line in characters."""

KEPT = "\N{NO-BREAK SPACE}"
"""A space at which no line is broken."""


CONTINUED = "    "
"""The indent of a line that goes on with a text."""


def wrapped(*texts: str) -> list[str]:
    """Indented texts of an answer in lines, of which the first of each is indented less."""
    lines = []
    for text in texts:
        lines += textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent=CONTINUED, break_on_hyphens=False)
    return [line.replace(KEPT, " ") for line in lines]


def unwrapped(lines: Iterable[str]) -> list[str]:
    """The texts of an answer's lines, without indents: what `wrapped` has broken is whole again."""
    texts = list[str]()
    for line in lines:
        if line.startswith(CONTINUED):
            texts[-1] += f" {line.strip()}"
        else:
            texts.append(line.strip())
    return texts


def stability_texts(design: JudgedDesign | None, least_margin: float) -> list[str]:
    """Texts on the stability of a design that was chosen with a least disk margin, one for each thing."""
    if not least_margin:
        return ["stability not judged: the least margin that is asked for is 0"]
    if design is None:
        return []
    if design.margins is None:
        return [f"stability not judged: {design.why_not}"]
    margins = design.margins
    looked_at = f"{count(margins.loops, 'loop')} in {count(margins.cases, 'case')} at {count(margins.poses, 'pose')}"
    out = [f"stability: {margin_words(margins)}, the least of {looked_at}, dry friction released"]
    if least_margin <= margins.disk < USUAL_MARGIN:
        out.append(f"less than usual, which is a disk margin of {USUAL_MARGIN}: {_allowance(USUAL_MARGIN)}")
    return out


def margin_words(margins: LeastMargins) -> str:
    """The least margins, and where they are so."""
    if not margins.disk:
        are = f"{_loops(margins)} is" if len(margins.joints) == 1 else "the servo loops are"
        return f"{are} unstable in case #{margins.case} at {margins.time:.4g} s"
    words = [f"disk margin {margins.disk:.3g} ({_allowance(margins.disk)})"]
    if math.isfinite(margins.gain):
        words.append(f"gain margin {margins.gain:.4g}")
    if math.isfinite(margins.delay):
        words.append(f"delay margin {number_text(1e3 * margins.delay)} ms")
    where = f"{_loops(margins)} in case #{margins.case} at {margins.time:.4g} s"
    return f"{', '.join(words)}: {where}"


def _loops(margins: LeastMargins) -> str:
    if len(margins.joints) == 1:
        return f"the loop of joint `{margins.joints[0]}`"
    return "the loops of all joints at once"


def _allowance(disk: float) -> str:
    """The changes that a disk margin allows: a factor on the gain, and an angle of phase."""
    factor = allowed_gain(disk)
    gain = f"{factor:.4g} times the gain" if math.isfinite(factor) else "any gain"
    return f"{gain} or {math.degrees(2.0 * math.atan(0.5 * disk)):.3g} deg"


def stability_data(design: JudgedDesign | None) -> dict[str, Any] | None:
    """The stability of a design for programs, SI; None where it was not judged."""
    if design is None or design.margins is None:
        return None
    margins = design.margins
    return {
        "disk": margins.disk,
        "gain": margins.gain,
        "delay": margins.delay,
        "joints": list(margins.joints),
        "case": margins.case,
        "time": margins.time,
        "loops": margins.loops,
        "cases": margins.cases,
        "poses": margins.poses,
    }


def stable_head(spans: bool) -> str:
    """The heading above `stable_at`. spans: True where one of several has a lower end"""
    return "stable at r" if spans else "stable to r"


def stable_at(margin: Margin, spans: bool) -> str:
    """The range of r in which the loop is stable, in words."""
    if margin.limit == 0.0:
        return "nothing"
    limit = f"more than {margin.searched:.4g}" if margin.limit is None else f"{margin.limit:.3g}"
    return f"{margin.lower:.3g} to {limit}" if spans else limit


def verdict(margin: Margin, none: str = "NONE") -> str:
    """The margin of a motor bed's law in words; the text begins with `none` where there is no margin."""
    if margin.together != margin.together:
        return f"{none}: r is no number"
    if not margin.stable:
        return f"{none}: unstable, too light" if margin.too_light else f"{none}: unstable"
    if margin.lighter is None:
        return "no limit found" if margin.heavier is None else f"{margin.heavier:.2g} times"
    heavier = "" if margin.heavier is None else f"{margin.heavier:.2g} times heavier, "
    return f"{heavier}{margin.lighter:.2g} times lighter"


def in_words(margin: Margin) -> str:
    """A joint's r, and its stable range, in a line."""
    limit = f"more than {margin.searched:.3g}" if margin.limit is None else f"{margin.limit:.3g}"
    ends = f"from {margin.lower:.3g} to {limit}" if margin.lower > 0.0 else f"to {limit}"
    r = margin.least if margin.too_light else margin.together
    stable = "at no r" if margin.limit == 0.0 else ends
    return f"{margin.joint}: r = {r:.3g}, stable {stable} with {margin.law} at {margin.rate_hz:g} Hz"
