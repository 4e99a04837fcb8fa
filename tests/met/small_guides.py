"""What a guide makes of the small deck: an arm with joints enough for what it guides, and its path.

All follows from the guide's declaration: how many components it guides, of which link, and whether it ticks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

from met.plan import JointKind
from met.plan.defaults import component

INBOARD: dict[str, tuple[JointKind, str]] = {
    "shift": ("prismatic", "y"), "lift": ("prismatic", "z"), "swing": ("revolute", "z"), "bank": ("revolute", "x"),
    "reach": ("prismatic", "x"),
}  # fmt: skip
"""Joints between the base and the arm, where a guide needs more than the arm has: their kinds and axes.

With the arm's own, which move its tip along z and x, they move it any way there is.
"""

CARRIERS = {"bar": ("hinge",), "tip": ("hinge", "slide")}
"""The small arm's joints that carry a link of it."""


def components(guide: Any, words: Mapping[str, str]) -> tuple[str, ...]:
    """What is guided under these words; nothing by a guide without a path."""
    return () if guide.components is None else guide.components(SimpleNamespace(**words))


def followers(guide: Any, words: Mapping[str, str], link: str) -> tuple[str, ...]:
    """The joints that follow the guide: those of the small arm that carry its link, and inboard ones to be enough."""
    own = CARRIERS[link or "tip"]
    return (*list(INBOARD)[: max(len(components(guide, words)) - len(own), 0)], *own)


def inboard(kinds: Mapping[str, JointKind]) -> dict[str, str]:
    """The parts of the deck with the inboard ones of these joints."""
    text, root = [], "base"
    for joint in (joint for joint in kinds if joint in INBOARD):
        text.append(f"link {joint}_link {{ mass = 1 kg; shape = sphere(radius = 0.1 m); }}")
        ends = f"parent = {root}; child = {joint}_link; axis = {INBOARD[joint][1]};"
        text.append(f"joint {joint} {kinds[joint]} {{ {ends} }}")
        root = f"{joint}_link"
    return {"base": "\n    ".join(text), "root": root}


def body(guide: Any, guided: Sequence[str], entries: Sequence[str]) -> str:
    """The guide's entries with its path, which moves, and with its rate."""
    path = [
        f"{name} = ramp(to = 0.05 {'m' if component(name).kind == 'prismatic' else 'rad'}, over = 0.1 s);"
        for name in guided
    ]
    rate = ["rate = 125 Hz;"] if guide.steer is not None else []
    return " ".join([*entries, *path, *rate])
