"""The margin of a joint whose motor is on a bed, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from met.analysis.margin import Margin


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
    """The margin in words; the text begins with `none` where there is no margin."""
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
