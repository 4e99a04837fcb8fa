"""Output of `met residuals`: what was measured less what was computed, and what that follows."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

from batch.measured.residuals import FEWEST, Comparison, FollowedCause, Residual
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
    for residual in found.residuals:
        spread = f"{residual.rms / residual.spread:.3g}" if residual.spread else "-"
        rms, mean, largest = (f"{value:.3g}" for value in (residual.rms, residual.mean, residual.largest))
        unit = "" if residual.unit == "1" else residual.unit
        rows.append(
            [f"  {residual.channel}", rms, unit, spread, mean, largest, f"{residual.at:g} s", _whiteness(residual)]
        )
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
    notes = list(note_lines(found))
    if notes:
        yield ""
        yield from notes


def _whiteness(residual: Residual) -> str:
    if residual.white is None:
        return "equal" if residual.rms == 0.0 else "constant" if residual.rows >= FEWEST else "too few"
    return "white" if residual.white else f"not white ({residual.correlation:.2g})"


def _size(cause: FollowedCause) -> str:
    if cause.size is None:
        return ""
    unit = "" if cause.unit == "1" else f" {cause.unit}"
    return f"{cause.size:+.3g}{unit}"


def doubt_lines(found: Comparison) -> Iterator[str]:
    """Lines that say why a log is doubtful."""
    for doubt in found.doubts:
        yield f"  doubt: {doubt}"
    far = [residual.channel for residual in found.residuals if residual.spread and residual.rms > residual.spread]
    if len(far) > max(1, len(found.residuals) // 2):
        what = f"{len(far)} of {len(found.residuals)} residuals are larger than what was measured varies"
        yield f"  doubt: {what}: is the log of this run?"


def note_lines(found: Comparison) -> Iterator[str]:
    """Lines that say why a log is doubtful, where its time has gaps, and what is not used of it."""
    yield from doubt_lines(found)
    if found.left_out:
        spans = " s, and the run from ".join(
            f"{first:.6g} s to {last:.6g}" for first, last in (found.log_span, found.run_span)
        )
        numbers = f"{found.left_out:,} of the log's numbers have none of the run beside them, or are none"
        yield f"  note: {numbers}: the log is from {spans} s"
    if found.gaps and not found.uneven:
        gaps = [f"{length:.3g} s at {at:.4g} s" for at, length in found.gaps]
        step = f"the log's time goes on by {found.step:.3g} s, but {_listed(gaps)}"
        yield f"  note: {step}: instants are missing, or its clock jumped"
    elif found.gaps:
        longest = max(length for _, length in found.gaps)
        yield f"  note: the log's time is uneven: its steps are {found.step:.3g} s, and up to {longest:.3g} s"
    if outlying := [f"{residual.channel} {residual.outliers:,}" for residual in found.residuals if residual.outliers]:
        yield f"  note: instants far from all others, left out of what a residual follows: {_listed(outlying)}"
    if 0.0 < found.step < 0.5 * found.run_step:
        steps = f"every {number_text(found.run_step)} s, and the log has an instant every {found.step:.3g} s"
        yield f"  note: the run is recorded {steps}: between its rows, it is on straight lines"
    if short := [residual.channel for residual in found.residuals if residual.too_short]:
        yield f"  note: the log is too short to say what these follow: {_listed(short)}"
    if found.missing:
        yield f"  note: not in the log: {_listed(found.missing)}"
    if found.unused:
        yield f"  note: not of the run, and not used: {_listed(found.unused)}"


def _listed(names: Sequence[str]) -> str:
    more = f", and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
