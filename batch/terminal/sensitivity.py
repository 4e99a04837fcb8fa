"""What explains a metric, as lines of the terminal and as data."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from batch.queries.sensitivity import FAILURE, Sensitivity
from batch.queries.signals import number_text
from batch.queries.summary import finite
from ic.printing.columns import columns
from met.statistics.sensitivity import FEWEST

BAR = 20
"""Characters of a bar that stands for all of the variance."""

UNCLEAR = 0.1
"""Half a width of an interval from which on more cases are asked for, and a rest from which on it is told."""


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
    """The inputs of one output, those that explain most first, and what is to be known besides."""
    head = {"": found.name, FAILURE: "failing", "change": f"the change of {found.name}"}[found.of]
    counted = f"{found.cases:,} case{'s' * (found.cases != 1)}"
    if found.left:
        counted += f"; {found.left:,} ha{'s' if found.left == 1 else 've'} no finite value"
    if found.cases < FEWEST:
        return [f"{head}: not enough cases, {counted}; {FEWEST} at least"]
    if not found.shares:
        return [f"{head}: the same in all cases, {counted}"]
    totals = found.shares[0].total is not None
    order = sorted(range(len(found.shares)), key=lambda i: -(found.shares[i].total or found.shares[i].first))
    rows = [["", "", "alone", "with others" if totals else "", "mean, from low to high", "rank"]]
    for i in order:
        share = found.shares[i]
        low, high = (number_text(float(f"{each / found.scale:.4g}")) for each in (share.low, share.high))
        rows.append(
            [
                f"  {found.inputs[i]}",
                "█" * round(BAR * share.first) or "·",
                _share(share.first, share.first_by),
                _share(share.total, share.total_by) if share.total is not None else "",
                f"{low} .. {high} {found.unit}".rstrip(" 1")
                if found.unit == "1"
                else f"{low} .. {high} {found.unit}".rstrip(),
                f"{share.rank:+.2f}",
            ]
        )
    out = [f"{head}: {counted}", *columns(rows, right=(5,))]
    return [*out, *(f"  note: {note}" for note in _notes(found))]


def _share(share: float, by: float) -> str:
    return f"{share:.2f} ± {max(by, 0.005):.2f}"


def _notes(found: Sensitivity) -> Sequence[str]:
    notes = []
    if found.rest is not None and found.rest > UNCLEAR:
        notes.append(
            f"{found.rest:.2f} of the variance is of three inputs or more together, of noise, or of too few cases"
        )
    if max(max(each.first_by, each.total_by) for each in found.shares) > UNCLEAR:
        notes.append("not enough cases for narrow intervals: four times as many halve them")
    for one, other, size in found.together:
        notes.append(
            f"{one} and {other} do not vary independently (rank correlation {size:+.2f}): their shares overlap"
        )
    return notes
