"""What `met margin` prints: of each joint whose motor is on a bed, how heavy the arm is and how heavy it may be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from ic.printing.columns import columns, count
from met.margin import HEAVIEST, Margin
from met.plan import Experiment


def told(experiment: Experiment, found: Sequence[Sequence[Margin]]) -> Iterator[str]:
    """The margins in lines: of one case each joint, of several the tightest of each joint."""
    cases = f", {count(len(found), 'case')}" if len(found) > 1 else ""
    yield f"{experiment.name}: {count(len(found[0]), 'joint')} on a bed{cases}"
    yield ""
    several = len(found[0]) > 1
    rows = [["joint", "law", "servo", "delay", "r", *["together"] * several, "stable to r", "margin"]]
    joints = list(zip(*found, strict=True))
    for each in joints:
        worst = min(each, key=_room)
        rows.append([
            worst.joint, worst.law, f"{worst.rate_hz:g} Hz", f"{worst.delay:g}", f"{worst.r:.3g}",
            *[f"{worst.together:.3g}"] * several, _limit(worst), _verdict(worst),
        ])  # fmt: skip
    yield from columns(rows, right=(2, 3, 4, 5, 6) if several else (2, 3, 4, 5))
    yield ""
    for each in joints:
        bad = [one for one in each if not one.stable]
        if bad and len(found) > 1:
            named = ", ".join(f"#{one.case}" for one in bad[:5]) + (" ..." if len(bad) > 5 else "")
            yield f"  {each[0].joint}: not stable in {len(bad)} of {len(found)} cases: {named}"
    if len(found) > 1:
        yield "  each row is the tightest of all cases"
    yield "  r = J_eff/(N^2 J_m) at the start of the run, each joint by itself; delay in ticks of the servo"
    if several:
        yield "  together: the largest of any motion of all of them, which the limit is held against"


def as_data(experiment: Experiment, found: Sequence[Sequence[Margin]]) -> dict[str, Any]:
    """The margins for programs."""
    rows = [asdict(one) | {"stable": one.stable, "margin": one.factor} for case in found for one in case]
    return {"experiment": experiment.name, "searched_to": HEAVIEST, "margins": rows}


def _limit(one: Margin) -> str:
    if one.limit is None:
        return f"more than {one.searched:.4g}"
    return f"{one.limit:.3g}" if one.limit > 0.0 else "nothing"


def _room(one: Margin) -> float:
    """How many times heavier the arm might be at least; nothing is tighter than an arm whose r is no number."""
    room = one.factor if one.factor is not None else one.searched / one.together
    return room if room == room else 0.0


def _verdict(one: Margin) -> str:
    if not one.stable and one.together != one.together:
        return "NONE: r is no number"
    if one.factor is None:
        return "no limit found"
    return f"{one.factor:.2g} times" if one.stable else "NONE: unstable"
