"""The margin of a joint whose motor is on a bed, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from met.analysis.margin import Margin


def stable_head(spans: bool) -> str:
    """The heading above `stable_at`. spans: True where one of several has a lower end"""
    return "stable at r" if spans else "stable to r"


def stable_at(one: Margin, spans: bool) -> str:
    """The range of r in which the loop is stable, in words."""
    if one.limit == 0.0:
        return "nothing"
    limit = f"more than {one.searched:.4g}" if one.limit is None else f"{one.limit:.3g}"
    return f"{one.lower:.3g} to {limit}" if spans else limit


def verdict(one: Margin, none: str = "NONE") -> str:
    """The margin in words; the text begins with `none` where there is no margin."""
    if one.together != one.together:
        return f"{none}: r is no number"
    if not one.stable:
        return f"{none}: unstable, too light" if one.too_light else f"{none}: unstable"
    if one.lighter is None:
        return "no limit found" if one.heavier is None else f"{one.heavier:.2g} times"
    heavier = "" if one.heavier is None else f"{one.heavier:.2g} times heavier, "
    return f"{heavier}{one.lighter:.2g} times lighter"


def in_words(one: Margin) -> str:
    """A joint's r, and its stable range, in a line."""
    limit = f"more than {one.searched:.3g}" if one.limit is None else f"{one.limit:.3g}"
    ends = f"from {one.lower:.3g} to {limit}" if one.lower > 0.0 else f"to {limit}"
    r = one.least if one.too_light else one.together
    stable = "at no r" if one.limit == 0.0 else ends
    return f"{one.joint}: r = {r:.3g}, stable {stable} with {one.law} at {one.rate_hz:g} Hz"
