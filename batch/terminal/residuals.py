"""Output of `met residuals`: what was measured less what was computed, and what that follows."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from batch.measured.residuals import FEWEST, Comparison, Explanation, Residual
from batch.queries.signals import number_text
from batch.queries.summary import finite
from ic.printing.columns import columns

SHOWN = 8
"""Largest number of gaps and channels that a line names."""


def as_data(found: Comparison) -> dict[str, Any]:
    """Plain data; a number that is not finite is null."""
    data: dict[str, Any] = finite(dataclasses.asdict(found))
    return data


def residual_lines(found: Comparison) -> Iterator[str]:
    """The residuals, what they follow, and what makes the log doubtful, in lines."""
    rows = [["", "rms", "", "of spread", "mean", "largest", "at", ""]]
    for each in found.residuals:
        spread = f"{each.rms / each.spread:.3g}" if each.spread else "-"
        rms, mean, largest = (f"{value:.3g}" for value in (each.rms, each.mean, each.largest))
        unit = "" if each.unit == "1" else each.unit
        rows.append([f"  {each.channel}", rms, unit, spread, mean, largest, f"{each.at:g} s", _whiteness(each)])
    yield from columns(rows, right=(1, 3, 4, 5, 6))
    if followed := [each for each in found.residuals if each.explained]:
        yield ""
        yield "What they follow, and the share of the residual's variance that each adds:"
        rows = [["", "", "", "share", ""]]
        for each in followed:
            for i, one in enumerate(each.explained):
                alike = f", or {' or '.join(one.alike)}" if one.alike else ""
                name = "" if i else f"  {each.channel}"
                rows.append([name, one.what, _size(one), f"{one.share:.0%}", f"{one.means}{alike}"])
        yield from columns(rows, right=(2, 3))
    notes = list(_notes(found))
    if notes:
        yield ""
        yield from notes


def _whiteness(residual: Residual) -> str:
    if residual.white is None:
        return "constant"
    return "white" if residual.white else f"not white ({residual.correlation:.2g})"


def _size(explanation: Explanation) -> str:
    if explanation.size is None:
        return ""
    unit = "" if explanation.unit == "1" else f" {explanation.unit}"
    return f"{explanation.size:+.3g}{unit}"


def _notes(found: Comparison) -> Iterator[str]:
    for each in found.doubts:
        yield f"  doubt: {each}"
    far = [each.channel for each in found.residuals if each.spread and each.rms > each.spread]
    if far and len(far) > len(found.residuals) // 2:
        what = f"{len(far)} of {len(found.residuals)} residuals are larger than what was measured varies"
        yield f"  doubt: {what}: is the log of this run?"
    if found.gaps:
        when = ", ".join(f"{length:.3g} s at {at:.4g} s" for at, length in found.gaps[:SHOWN])
        more = f", and {len(found.gaps) - SHOWN} more" if len(found.gaps) > SHOWN else ""
        step = f"the log's time goes on by {found.step:.3g} s, but {when}{more}"
        yield f"  note: {step}: instants are missing, or its clock jumped"
    if outlying := [f"{each.channel} {each.outliers:,}" for each in found.residuals if each.outliers]:
        listed = ", ".join(outlying[:SHOWN])
        yield f"  note: instants far from all others, left out of what a residual follows: {listed}"
    if found.step < 0.5 * found.run_step:
        steps = f"every {number_text(found.run_step)} s, and the log has an instant every {found.step:.3g} s"
        yield f"  note: the run is recorded {steps}: between its rows, it is on straight lines"
    if found.missing:
        names = ", ".join(found.missing[:SHOWN])
        more = f", and {len(found.missing) - SHOWN} more" if len(found.missing) > SHOWN else ""
        yield f"  note: not in the log: {names}{more}"
    if short := [each.channel for each in found.residuals if each.rows < FEWEST and each.white is False]:
        yield f"  note: fewer than {FEWEST} instants, too few to say what it follows: {', '.join(short[:SHOWN])}"
