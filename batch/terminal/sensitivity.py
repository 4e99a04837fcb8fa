"""The sensitivity of a metric, as lines of the terminal and as data."""

from __future__ import annotations

import dataclasses
from typing import Any

from batch.queries.sensitivity import FAILURE, Sensitivity, notes_of, share_text, total_text
from batch.queries.signals import number_text
from batch.queries.summary import finite
from ic.printing.columns import columns

BAR = 20
"""Length in characters of a bar for all of the variance."""


def as_data(sensitivity: Sensitivity) -> dict[str, Any]:
    """The sensitivity of a metric for JSON; a number that is not finite is null."""
    plain = dataclasses.asdict(sensitivity)
    del plain["inputs"], plain["shares"]
    inputs = [
        {"input": name, **dataclasses.asdict(share)}
        for name, share in zip(sensitivity.inputs, sensitivity.shares, strict=False)
    ]
    return finite({**plain, "inputs": inputs})


def sensitivity_lines(sensitivity: Sensitivity) -> list[str]:
    """The inputs of one output, those that explain most first, and further notes."""
    head = {"": sensitivity.name, FAILURE: "failing", "change": f"the change of {sensitivity.name}"}[sensitivity.of]
    counted = f"{sensitivity.cases:,} case{'s' * (sensitivity.cases != 1)}"
    if sensitivity.left and sensitivity.design:
        counted += f"; {sensitivity.left:,} have no finite value, or are of a pair of points of which one has none"
    elif sensitivity.left:
        counted += f"; {sensitivity.left:,} ha{'s' if sensitivity.left == 1 else 've'} no finite value"
    if sensitivity.cases < sensitivity.fewest:
        return [f"{head}: not enough cases, {counted}; {sensitivity.fewest:,} at least"]
    if not sensitivity.shares:
        return [f"{head}: the same in all cases, {counted}"]
    totals = sensitivity.shares[0].total is not None
    rows = [["", "", "alone", "with others" if totals else "", "mean, from low to high", "rank"]]
    for i in sensitivity.order:
        share = sensitivity.shares[i]
        low, high = (number_text(float(f"{end / sensitivity.scale:.4g}")) for end in (share.low, share.high))
        rows.append(
            [
                f"  {sensitivity.inputs[i]}",
                "█" * round(BAR * share.first) or "·",
                share_text(share.first, share.first_by),
                total_text(share),
                sensitivity.ends(share, f"{low} ..", high),
                f"{share.rank:+.2f}",
            ]
        )
    out = [f"{head}: {counted}", *columns(rows, right=(5,))]
    return [*out, *(f"  note: {note}" for note in notes_of(sensitivity))]
