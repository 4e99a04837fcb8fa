"""Benchmarks, their measurement, and figures."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal


class Untaken(Exception):
    """Raised where a figure cannot be measured here; the text says why."""


@dataclass(frozen=True)
class Target:
    """The target of a figure's best value: `at_most` a number or `at_least` it."""

    bound: float
    side: Literal["at_most", "at_least"] = "at_most"

    def met(self, value: float) -> bool:
        return value <= self.bound if self.side == "at_most" else value >= self.bound


@dataclass(frozen=True)
class Benchmark:
    """One figure that is measured.

    prepare   makes all that is not measured, and returns what takes the figure once, in `unit`; raises Untaken
    target    None where the figure is only watched
    turns     it is taken at most this often: for what takes seconds, or is the same each time
    slow      left out of a quick look
    """

    name: str
    doc: str
    unit: str
    prepare: Callable[[], Callable[[], float]]
    target: Target | None = None
    turns: int = 1_000_000
    slow: bool = False


@dataclass(frozen=True)
class Derived:
    """A figure computed from others, by name: its best from their bests, its median from their medians."""

    name: str
    doc: str
    unit: str
    sources: tuple[str, ...]
    compute: Callable[..., float]
    target: Target | None = None


def ratio(name: str, doc: str, *, over: str, under: str, target: Target | None = None) -> Derived:
    """The ratio of two figures."""
    return Derived(name, doc, "", (over, under), lambda a, b: a / b, target)


Figure = dict[str, Any]
"""A figure as in the JSON of a report: name, doc, unit, best, median, largest, turns, target, met; or `untaken`, the
reason."""


def with_sources(requested: Sequence[str], known: Mapping[str, Benchmark | Derived]) -> list[str]:
    """The requested names and those from which they are computed, in the order of `known`."""
    wanted = set(requested)
    for name in requested:
        benchmark = known[name]
        wanted.update(benchmark.sources if isinstance(benchmark, Derived) else ())
    return [name for name in known if name in wanted]


def take(
    benchmarks: Sequence[Benchmark | Derived], turns: int, say: Callable[[str], None] = lambda _: None
) -> list[Figure]:
    """All figures, in the order of `benchmarks`.

    Every turn measures each of them once, so that the machine's other load hits all alike. One turn before the first
    warms up and is not counted.
    """
    measures: dict[str, Callable[[], float]] = {}
    untaken: dict[str, str] = {}
    measured = [benchmark for benchmark in benchmarks if isinstance(benchmark, Benchmark)]
    for benchmark in measured:
        say(f"preparing {benchmark.name}")
        try:
            measures[benchmark.name] = benchmark.prepare()
            if benchmark.turns > 1:
                measures[benchmark.name]()
        except Untaken as reason:
            untaken[benchmark.name] = str(reason)
    values: dict[str, list[float]] = {benchmark.name: [] for benchmark in measured}
    for turn in range(turns):
        say(f"turn {turn + 1} of {turns}")
        for benchmark in measured:
            if benchmark.name not in untaken and turn < benchmark.turns:
                values[benchmark.name].append(measures[benchmark.name]())
    return [
        _derived(benchmark, values, untaken) if isinstance(benchmark, Derived)
        else _untaken(benchmark, untaken[benchmark.name]) if benchmark.name in untaken
        else _figure(benchmark, values[benchmark.name])
        for benchmark in benchmarks
    ]  # fmt: skip


def _figure(benchmark: Benchmark, values: Sequence[float]) -> Figure:
    best = max(values) if benchmark.target is not None and benchmark.target.side == "at_least" else min(values)
    return _figure_data(benchmark, best, statistics.median(values), max(values), len(values))


def _derived(derived: Derived, values: Mapping[str, Sequence[float]], untaken: Mapping[str, str]) -> Figure:
    for name in derived.sources:
        if name in untaken:
            return _untaken(derived, untaken[name])
    best = derived.compute(*(min(values[name]) for name in derived.sources))
    median = derived.compute(*(statistics.median(values[name]) for name in derived.sources))
    return _figure_data(derived, best, median, max(best, median), min(len(values[name]) for name in derived.sources))


def _figure_data(benchmark: Benchmark | Derived, best: float, median: float, largest: float, turns: int) -> Figure:
    """A figure's data. The best decides whether a target is met: other load of the machine only adds to a time."""
    target = None if benchmark.target is None else {benchmark.target.side: benchmark.target.bound}
    return {
        "name": benchmark.name, "doc": benchmark.doc, "unit": benchmark.unit, "best": best, "median": median,
        "largest": largest, "turns": turns, "target": target,
        "met": None if benchmark.target is None else benchmark.target.met(best),
    }  # fmt: skip


def _untaken(benchmark: Benchmark | Derived, why: str) -> Figure:
    target = None if benchmark.target is None else {benchmark.target.side: benchmark.target.bound}
    return {
        "name": benchmark.name,
        "doc": benchmark.doc,
        "unit": benchmark.unit,
        "untaken": why,
        "target": target,
        "met": None,
    }
