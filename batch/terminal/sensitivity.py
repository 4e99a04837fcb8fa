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


def as_data(found: Sensitivity) -> dict[str, Any]:
    """Plain data; a number that is not finite is null."""
    plain = dataclasses.asdict(found)
    del plain["inputs"], plain["shares"]
    each = [
        {"input": name, **dataclasses.asdict(share)} for name, share in zip(found.inputs, found.shares, strict=False)
    ]
    data: dict[str, Any] = finite({**plain, "inputs": each})
    return data


def sensitivity_lines(found: Sensitivity) -> list[str]:
    """The inputs of one output, those that explain most first, and further notes."""
    head = {"": found.name, FAILURE: "failing", "change": f"the change of {found.name}"}[found.of]
    counted = f"{found.cases:,} case{'s' * (found.cases != 1)}"
    if found.left and found.design:
        counted += f"; {found.left:,} have no finite value, or are of a pair of points of which one has none"
    elif found.left:
        counted += f"; {found.left:,} ha{'s' if found.left == 1 else 've'} no finite value"
    if found.cases < found.fewest:
        return [f"{head}: not enough cases, {counted}; {found.fewest:,} at least"]
    if not found.shares:
        return [f"{head}: the same in all cases, {counted}"]
    totals = found.shares[0].total is not None
    rows = [["", "", "alone", "with others" if totals else "", "mean, from low to high", "rank"]]
    for i in found.order:
        share = found.shares[i]
        low, high = (number_text(float(f"{each / found.scale:.4g}")) for each in (share.low, share.high))
        rows.append(
            [
                f"  {found.inputs[i]}",
                "█" * round(BAR * share.first) or "·",
                share_text(share.first, share.first_by),
                total_text(share),
                found.ends(share, f"{low} ..", high),
                f"{share.rank:+.2f}",
            ]
        )
    out = [f"{head}: {counted}", *columns(rows, right=(5,))]
    return [*out, *(f"  note: {note}" for note in notes_of(found))]
