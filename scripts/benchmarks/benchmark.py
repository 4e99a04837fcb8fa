"""What a benchmark is, and how a figure is told."""

from __future__ import annotations

import os
import platform
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Benchmark:
    """One figure.

    measure   does it once and returns the figure, in `unit`; called once to warm up, then again and again
    target    what it should stay at or below; None where it is only watched
    """

    name: str
    doc: str
    unit: str
    measure: Callable[[], float]
    target: float | None = None


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "system": platform.platform(),
        "python": platform.python_version(),
        "load": round(os.getloadavg()[0], 2),
    }


def take(benchmark: Benchmark, repeats: int) -> dict[str, Any]:
    """Median, least and largest of `repeats` figures after one to warm up."""
    benchmark.measure()
    figures = [benchmark.measure() for _ in range(repeats)]
    median = statistics.median(figures)
    return {
        "name": benchmark.name,
        "doc": benchmark.doc,
        "unit": benchmark.unit,
        "median": median,
        "least": min(figures),
        "largest": max(figures),
        "repeats": repeats,
        "target": benchmark.target,
        "met": None if benchmark.target is None else median <= benchmark.target,
    }


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Processor", "Model"):
            return value.strip()
    return platform.processor() or platform.machine()
