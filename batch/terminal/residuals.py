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


def as_data(comparison: Comparison) -> dict[str, Any]:
    """The residuals of a log for JSON; a number that is not finite is null."""
    return finite(dataclasses.asdict(comparison))


def residual_lines(comparison: Comparison) -> Iterator[str]:
    """The residuals, what they follow, and what makes the log doubtful, in lines."""
    rows = [["", "rms", "", "of spread", "mean", "largest", "at", ""]]
    for residual in comparison.residuals:
        spread = f"{residual.rms / residual.spread:.3g}" if residual.spread else "-"
        rms, mean, largest = (f"{value:.3g}" for value in (residual.rms, residual.mean, residual.largest))
        unit = "" if residual.unit == "1" else residual.unit
        rows.append(
            [f"  {residual.channel}", rms, unit, spread, mean, largest, f"{residual.at:g} s", _whiteness(residual)]
        )
    yield from columns(rows, right=(1, 3, 4, 5, 6))
    if followed := [residual for residual in comparison.residuals if residual.explained]:
        yield ""
        yield "What they follow, and the share of the residual's variance that each adds:"
        rows = [["", "", "", "share", ""]]
        for residual in followed:
            for i, cause in enumerate(residual.explained):
                alike = f", or {' or '.join(cause.alike)}" if cause.alike else ""
                name = "" if i else f"  {residual.channel}"
                rows.append([name, cause.what, _size(cause), f"{cause.share:.0%}", f"{cause.means}{alike}"])
        yield from columns(rows, right=(2, 3))
    notes = list(note_lines(comparison))
    if notes:
        yield ""
        yield from notes


def _whiteness(residual: Residual) -> str:
    """A word on a channel's residual: "white" if its numbers are independent, or why that cannot be told."""
    if residual.white is None:
        return "equal" if residual.rms == 0.0 else "constant" if residual.rows >= FEWEST else "too few"
    return "white" if residual.white else f"not white ({residual.correlation:.2g})"


def _size(cause: FollowedCause) -> str:
    """The size of what a residual follows, signed, with its unit; "" where it has none."""
    if cause.size is None:
        return ""
    unit = "" if cause.unit == "1" else f" {cause.unit}"
    return f"{cause.size:+.3g}{unit}"


def doubt_lines(comparison: Comparison) -> Iterator[str]:
    """Lines that say why a log is doubtful."""
    for doubt in comparison.doubts:
        yield f"  doubt: {doubt}"
    far = [residual.channel for residual in comparison.residuals if residual.spread and residual.rms > residual.spread]
    if len(far) > max(1, len(comparison.residuals) // 2):
        what = f"{len(far)} of {len(comparison.residuals)} residuals are larger than what was measured varies"
        yield f"  doubt: {what}: is the log of this run?"


def note_lines(comparison: Comparison) -> Iterator[str]:
    """Lines that say why a log is doubtful, where its time has gaps, and what is not used of it."""
    yield from doubt_lines(comparison)
    if comparison.left_out:
        spans = " s, and the run from ".join(
            f"{first:.6g} s to {last:.6g}" for first, last in (comparison.log_span, comparison.run_span)
        )
        numbers = f"{comparison.left_out:,} of the log's numbers have none of the run beside them, or are none"
        yield f"  note: {numbers}: the log is from {spans} s"
    if comparison.gaps and not comparison.uneven:
        gaps = [f"{length:.3g} s at {begin:.4g} s" for begin, length in comparison.gaps]
        step = f"the log's time goes on by {comparison.step:.3g} s, but {_listed(gaps)}"
        yield f"  note: {step}: instants are missing, or its clock jumped"
    elif comparison.gaps:
        longest = max(length for _, length in comparison.gaps)
        yield f"  note: the log's time is uneven: its steps are {comparison.step:.3g} s, and up to {longest:.3g} s"
    if outlying := [
        f"{residual.channel} {residual.outliers:,}" for residual in comparison.residuals if residual.outliers
    ]:
        yield f"  note: instants far from all others, left out of what a residual follows: {_listed(outlying)}"
    if 0.0 < comparison.step < 0.5 * comparison.run_step:
        steps = f"every {number_text(comparison.run_step)} s, and the log has an instant every {comparison.step:.3g} s"
        yield f"  note: the run is recorded {steps}: between its rows, it is on straight lines"
    if short := [residual.channel for residual in comparison.residuals if residual.too_short]:
        yield f"  note: the log is too short to say what these follow: {_listed(short)}"
    if comparison.missing:
        yield f"  note: not in the log: {_listed(comparison.missing)}"
    if comparison.unused:
        yield f"  note: not of the run, and not used: {_listed(comparison.unused)}"


def _listed(names: Sequence[str]) -> str:
    more = f", and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
