"""A report of figures as a table, as JSON, and compared with another report."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.benchmark import Figure
from benchmarks.machine import SAME

FORMAT = "met benchmarks 1"

PLACEMENT = 0.12
"""Relative difference of a figure that may be due to the placement of code alone."""


class Unreadable(Exception):
    """Raised for a file that is not a report; the text says why."""


def write(path: Path, machine_facts: dict[str, Any], turns: int, figures: Sequence[Figure]) -> None:
    """The report as JSON."""
    data = {"format": FORMAT, "machine": machine_facts, "turns": turns, "figures": list(figures)}
    path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def read(path: Path) -> dict[str, Any]:
    """A report that `write` wrote. Raises Unreadable."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as reason:
        raise Unreadable(f"{path}: {reason.strerror}") from None
    except ValueError as reason:
        raise Unreadable(f"{path}: not JSON: {reason}") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise Unreadable(f'{path}: not a report of this scripts/benchmark (no "format": "{FORMAT}")')
    return data


# A report alone


def table(figures: Sequence[Figure]) -> list[str]:
    """The table: a line for each figure with name, best, median, target, whether it is met, and description."""
    rows = [["", "best", "median", "target", "", ""]]
    for figure in figures:
        bound = _bound(figure)
        if "untaken" in figure:
            rows.append([figure["name"], "-", "-", bound, "", f"not taken: {figure['untaken']}"])
            continue
        unit = f" {figure['unit']}" if figure["unit"] else ""
        verdict = {True: "met", False: "MISSED", None: ""}[figure["met"]]
        rows.append([figure["name"], number(figure["best"]) + unit, number(figure["median"]) + unit, bound, verdict,
                     figure["doc"]])  # fmt: skip
    return _aligned(rows, right=(1, 2, 3))


def missed(figures: Sequence[Figure]) -> list[str]:
    """A sentence for each figure that is on the wrong side of its target."""
    return [
        f"{figure['name']} is {number(figure['best'])}{' ' * bool(figure['unit'])}{figure['unit']}, "
        f"its target {_bound(figure)}"
        for figure in figures
        if figure["met"] is False
    ]


def verdict(figures: Sequence[Figure]) -> list[str]:
    """A sentence on missed targets, or that there are none; and the targets that were not tested."""
    wanted = [figure for figure in figures if figure["target"] is not None]
    lines = [f"MISSED: {line}" for line in missed(figures)] or [f"targets: {len(wanted)}, none missed"]
    untaken = [figure["name"] for figure in wanted if "untaken" in figure]
    return [*lines, f"targets of figures that were not taken: {', '.join(untaken)}"] if untaken else lines


def _bound(figure: Figure) -> str:
    return "".join(
        f"{'<=' if side == 'at_most' else '>='} {bound:g}" for side, bound in (figure["target"] or {}).items()
    )


# Against another


def against(then: dict[str, Any], machine_facts: dict[str, Any], figures: Sequence[Figure]) -> list[str]:
    """Then, now and how many times it is, by figure; what got slower and what faster, beyond noise.

    The margin of a figure is what noise can do: 12 %, or where it is more the distance of the median from the best,
    then and now together.
    """
    lines = [f"against commit {then['machine'].get('commit') or 'unknown'}"]
    other = [what for what in SAME if then["machine"].get(what) != machine_facts.get(what)]
    if other:
        differences = ", ".join(f"{what} {then['machine'].get(what)}, now {machine_facts.get(what)}" for what in other)
        lines.append(f"a different machine ({differences}): the times say nothing about MET")
    before = {figure["name"]: figure for figure in then["figures"]}
    rows = [["", "then", "now", "now/then", "margin", ""]]
    worse: list[str] = []
    better: list[str] = []
    for figure in figures:
        old = before.pop(figure["name"], None)
        if old is None or "untaken" in old or "untaken" in figure or old["best"] <= 0.0:
            continue
        share = figure["best"] / old["best"]
        margin = max(PLACEMENT, spread(old) + spread(figure))
        # a ratio, or what else is to be at least something, is worse where it is less
        cost = 1.0 / share if _more_is_better(figure) and share > 0.0 else share
        verdict = "slower" if cost > 1.0 + margin else "faster" if cost < 1.0 / (1.0 + margin) else ""
        (worse if verdict == "slower" else better if verdict == "faster" else []).append(figure["name"])
        rows.append([figure["name"], number(old["best"]), number(figure["best"]), f"{share:.2f}", f"{margin:.0%}",
                     verdict])  # fmt: skip
    lines += _aligned(rows, right=(1, 2, 3, 4))
    gone = [name for name, figure in before.items() if "untaken" not in figure]
    lines += [f"not taken now: {', '.join(gone)}"] if gone else []
    lines.append(f"slower: {', '.join(worse) or 'nothing'}")
    lines.append(f"faster: {', '.join(better) or 'nothing'}")
    return lines


def spread(figure: Figure) -> float:
    """The relative distance of the median from the best."""
    return abs(figure["median"] / figure["best"] - 1.0) if figure["best"] else 0.0


def _more_is_better(figure: Figure) -> bool:
    return "at_least" in (figure["target"] or {}) or figure["name"].startswith("ratio.")


# Text


def number(value: float) -> str:
    """Three digits, and all of those before the point."""
    if value == 0.0:
        return "0"
    size = abs(value)
    return f"{value:.0f}" if size >= 100 else f"{value:.1f}" if size >= 10 else f"{value:.3g}"


def _aligned(rows: Sequence[Sequence[str]], right: Sequence[int]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  ".join(cell.rjust(widths[i]) if i in right else cell.ljust(widths[i]) for i, cell in enumerate(row)).rstrip()
        for row in rows
    ]
