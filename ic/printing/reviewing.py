"""Tables for a reviewer of a deck's runs: their assumptions (`met.analysis.assumed`) and their scales."""

from __future__ import annotations

import textwrap
from dataclasses import asdict
from typing import Any

from ic.driver.compile import Compiled
from ic.meaning.checks.scale import Scale
from ic.printing.columns import columns, quantity
from met.analysis.assumed import Assumption, assumptions


def print_assumptions(compiled: Compiled) -> list[str]:
    """A table for each experiment, in its first case."""
    assert compiled.plan is not None
    lines: list[str] = []
    for experiment in compiled.plan.experiments:
        lines += [
            *([""] if lines else []),
            experiment.name,
            *columns([_row(assumption) for assumption in assumptions(experiment)]),
        ]
    return lines


def _row(assumption: Assumption) -> tuple[str, ...]:
    """The row of an assumption: what it is about, what is assumed, its size, and what that means."""
    size = ""
    if assumption.size is not None:
        where = f" at `{assumption.at}`" if assumption.at not in assumption.subject else ""
        size = f"{quantity(float(f'{assumption.size:.3g}'), assumption.unit)}{where}"
    return assumption.subject, assumption.assumed, size, assumption.meaning


def assumptions_json(compiled: Compiled) -> list[dict[str, Any]]:
    """The assumptions of each run or sweep in its first case, for programs."""
    assert compiled.plan is not None
    return [
        {"run": experiment.name, "assumptions": [asdict(assumption) for assumption in assumptions(experiment)]}
        for experiment in compiled.plan.experiments
    ]


BESIDE = textwrap.TextWrapper(100, initial_indent="      ", subsequent_indent="      ", break_long_words=False)
"""The form of the line below a row, which is never wider than 100 columns."""

HEADINGS = ("kind", "how many", "ratio", "usual")
LEGEND = ("  Of each kind the number whose ratio to another is nearest to an end of what is usual, or outside:", "")


def print_scales(compiled: Compiled) -> list[str]:
    """The table of each experiment in its first case: of each kind of number the one nearest to an end of its usual
    range, or farthest outside, and how many there are."""
    assert compiled.plan is not None
    lines: list[str] = []
    for experiment, scope in zip(compiled.plan.experiments, compiled.scopes, strict=True):
        by_kind: dict[str, list[Scale]] = {}
        for scale in scope.scales:
            by_kind.setdefault(scale.what, []).append(scale)
        nearest = [max(scales, key=lambda number: number.nearness) for scales in by_kind.values()]
        counts = (f"{len(scales)}" for scales in by_kind.values())
        table = columns([HEADINGS, *map(_scale_row, nearest, counts)], right=(1, 2))
        lines += [*([""] if lines else []), experiment.name, *(() if lines else LEGEND), table[0]]
        for line, scale in zip(table[1:], nearest, strict=True):
            lines += [line, *BESIDE.wrap(_numbers(scale))]
    return lines


def _scale_row(scale: Scale, count: str) -> tuple[str, ...]:
    usual = f"up to {scale.high:g}" if scale.low == 0.0 else f"{scale.low:g} to {scale.high:g}"
    return scale.what, count, f"{scale.multiple:.3g}", usual + ("  OUTSIDE" if scale.nearness > 1.0 else "")


def _numbers(scale: Scale) -> str:
    """The two numbers of a ratio in words."""
    number = f"{scale.path} {scale.verb} {scale.size:.4g} {scale.unit}".rstrip()
    return f"{number}, beside {scale.other}" if scale.other else number


def scales_json(compiled: Compiled) -> list[dict[str, Any]]:
    """All numbers of each run or sweep that are compared with what is usual, for programs."""
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
