"""Output of `met margin`: for each joint with its motor on a bed, how heavy the arm is and may be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from batch.queries.bed_margins import stable_at, stable_head, verdict
from hw.driving.pace import pace
from ic.printing.columns import columns, count
from met.analysis.margin import HEAVIEST, Margin, remedy
from met.plan import Experiment


def margin_lines(experiment: Experiment, found: Sequence[Sequence[Margin]]) -> Iterator[str]:
    """The margins in lines: every joint of a single case, or the tightest case of each joint."""
    cases = f", {count(len(found), 'case')}" if len(found) > 1 else ""
    yield f"{experiment.name}: {count(len(found[0]), 'joint')} on a bed{cases}"
    yield ""
    several = len(found[0]) > 1
    joints = list(zip(*found, strict=True))
    tightest = [min(each, key=lambda one: one.room) for each in joints]
    spans = any(one.lower > 0.0 for one in tightest)
    rows = [["joint", "law", "servo", "delay", "r", *["together"] * several, stable_head(spans), "margin"]]
    for one in tightest:
        together = f"{one.least:.3g} to {one.together:.3g}" if spans else f"{one.together:.3g}"
        rows.append(
            [
                one.joint,
                one.law,
                f"{one.rate_hz:g} Hz",
                f"{one.delay:g}",
                f"{one.r:.3g}",
                *[together] * several,
                stable_at(one, spans),
                verdict(one),
            ]
        )
    yield from columns(rows, right=(2, 3, 4, 5, 6) if several else (2, 3, 4, 5))
    yield ""
    for one in tightest:
        if not one.stable:
            yield f"  {one.joint}: {remedy(one)} may help"
    for joint in joints:
        if early := next((one for one in joint if one.delay < pace(one.rate_hz).late(False)), None):
            own = f"`bed = {early.bed}(delay = 1, ...)`, which has another margin"
            yield f"  {early.joint}: `met bed run` refuses this delay on a line, where commands act a tick later: {own}"
    for each in joints:
        bad = [one for one in each if not one.stable]
        if bad and len(found) > 1:
            named = ", ".join(f"#{one.case}" for one in bad[:5]) + (" ..." if len(bad) > 5 else "")
            yield f"  {each[0].joint}: not stable in {len(bad)} of {len(found)} cases: {named}"
    if len(found) > 1:
        yield "  each row is the tightest of all cases"
    yield "  r = J_eff/(N^2 J_m) at the start of the run, each joint by itself; delay in ticks of the servo"
    if several:
        which, end = ("the least and the largest", "ends are") if spans else ("the largest", "limit is")
        yield f"  together: {which} of any motion of all of them, which the {end} held against"


def as_data(experiment: Experiment, found: Sequence[Sequence[Margin]]) -> dict[str, Any]:
    """The margins for programs."""
    rows = [asdict(one) | {"stable": one.stable, "margin": one.factor} for case in found for one in case]
    return {"experiment": experiment.name, "searched_to": HEAVIEST, "margins": rows}
