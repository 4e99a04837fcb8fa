"""Output of `met margin`: for each joint with its motor on a bed, how heavy the arm is and may be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from batch.queries.stability_words import stable_at, stable_head, verdict
from hw.driving.pace import pace
from ic.printing.columns import columns, count
from met.analysis.margin import HEAVIEST, Margin, remedy
from met.plan import Experiment


def margin_lines(experiment: Experiment, margins: Sequence[Sequence[Margin]]) -> Iterator[str]:
    """The margins in lines: every joint of a single case, or the tightest case of each joint."""
    cases = f", {count(len(margins), 'case')}" if len(margins) > 1 else ""
    yield f"{experiment.name}: {count(len(margins[0]), 'joint')} on a bed{cases}"
    yield ""
    several = len(margins[0]) > 1
    joints = list(zip(*margins, strict=True))
    tightest = [min(cases_of_joint, key=lambda margin: margin.room) for cases_of_joint in joints]
    spans = any(margin.lower > 0.0 for margin in tightest)
    rows = [["joint", "law", "servo", "delay", "r", *["together"] * several, stable_head(spans), "margin"]]
    for margin in tightest:
        together = f"{margin.least:.3g} to {margin.together:.3g}" if spans else f"{margin.together:.3g}"
        rows.append(
            [
                margin.joint,
                margin.law,
                f"{margin.rate_hz:g} Hz",
                f"{margin.delay:g}",
                f"{margin.r:.3g}",
                *[together] * several,
                stable_at(margin, spans),
                verdict(margin),
            ]
        )
    yield from columns(rows, right=(2, 3, 4, 5, 6) if several else (2, 3, 4, 5))
    yield ""
    for margin in tightest:
        if not margin.stable:
            yield f"  {margin.joint}: {remedy(margin)} may help"
    for joint in joints:
        if early := next((margin for margin in joint if margin.delay < pace(margin.rate_hz).late(False)), None):
            own = f"`bed = {early.bed}(delay = 1, ...)`, which has another margin"
            yield f"  {early.joint}: `met bed run` refuses this delay on a line, where commands act a tick later: {own}"
    for cases_of_joint in joints:
        bad = [margin for margin in cases_of_joint if not margin.stable]
        if bad and len(margins) > 1:
            named = ", ".join(f"#{margin.case}" for margin in bad[:5]) + (" ..." if len(bad) > 5 else "")
            yield f"  {cases_of_joint[0].joint}: not stable in {len(bad)} of {len(margins)} cases: {named}"
    if len(margins) > 1:
        yield "  each row is the tightest of all cases"
    yield "  r = J_eff/(N^2 J_m) at the start of the run, each joint by itself; delay in ticks of the servo"
    if several:
        which, end = ("the least and the largest", "ends are") if spans else ("the largest", "limit is")
        yield f"  together: {which} of any motion of all of them, which the {end} held against"


def as_data(experiment: Experiment, margins: Sequence[Sequence[Margin]]) -> dict[str, Any]:
    """The margins for programs."""
    rows = [asdict(margin) | {"stable": margin.stable, "margin": margin.factor} for case in margins for margin in case]
    return {"experiment": experiment.name, "searched_to": HEAVIEST, "margins": rows}
