"""The scales of a deck's runs (`ic.meaning.checks.scales`): a table for a reviewer, and the same as data."""

from __future__ import annotations

from typing import Any

from ic.driver.compile import Compiled
from ic.meaning.checks.scales import Scale
from ic.printing.columns import columns


def print_scales(compiled: Compiled) -> list[str]:
    """The table of each experiment in its first case: of each kind of number the one nearest to an end of its usual
    range, or farthest outside, and how many there are."""
    assert compiled.plan is not None
    lines: list[str] = []
    for experiment, scope in zip(compiled.plan.experiments, compiled.scopes, strict=True):
        by_kind: dict[str, list[Scale]] = {}
        for scale in scope.scales:
            by_kind.setdefault(scale.what, []).append(scale)
        rows = [("", "", "", "number", "times", "of", "usual"), *map(_row, by_kind.values())]
        lines += [*([""] if lines else []), experiment.name, *columns(rows, right=(4,))]
    return lines


def _row(scales: list[Scale]) -> tuple[str, ...]:
    scale = max(scales, key=lambda each: each.nearness)
    usual = f"up to {scale.high:g}" if scale.low == 0.0 else f"{scale.low:g} to {scale.high:g}"
    verb = "" if scale.verb == "is" else f"{scale.verb} "
    return (
        scale.what,
        f"nearest of {len(scales)}:" if len(scales) > 1 else "",
        scale.path,
        f"{verb}{scale.size:.4g} {scale.unit}".rstrip(),
        f"{scale.multiple:.3g}" if scale.other else "",
        scale.other,
        usual + ("  OUTSIDE" if scale.nearness > 1.0 else ""),
    )


def scales_json(compiled: Compiled) -> list[dict[str, Any]]:
    """The same for programs, a list a run."""
    assert compiled.plan is not None
    return [
        {
            "run": experiment.name,
            "scales": [
                {
                    "what": scale.what,
                    "path": scale.path,
                    "size": scale.size,
                    "unit": scale.unit,
                    "multiple": scale.multiple,
                    "of": scale.other,
                    "low": scale.low,
                    "high": scale.high,
                    "usual": scale.usual,
                }
                for scale in scope.scales
            ],
        }
        for experiment, scope in zip(compiled.plan.experiments, compiled.scopes, strict=True)
    ]
