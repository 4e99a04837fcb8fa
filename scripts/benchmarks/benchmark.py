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
    of: tuple[str, ...]
    compute: Callable[..., float]
    target: Target | None = None


def ratio(name: str, doc: str, *, over: str, under: str, target: Target | None = None) -> Derived:
    """The ratio of two figures."""
    return Derived(name, doc, "", (over, under), lambda a, b: a / b, target)


Figure = dict[str, Any]
"""A figure as in the JSON of a report: name, doc, unit, best, median, largest, turns, target, met; or `untaken`, the
reason."""


def with_sources(asked: Sequence[str], known: Mapping[str, Benchmark | Derived]) -> list[str]:
    """The requested names and those from which they are computed, in the order of `known`."""
    wanted = set(asked)
    for name in asked:
        one = known[name]
        wanted.update(one.of if isinstance(one, Derived) else ())
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
    for each in measured:
        say(f"preparing {each.name}")
        try:
            measures[each.name] = each.prepare()
            if each.turns > 1:
                measures[each.name]()
        except Untaken as reason:
            untaken[each.name] = str(reason)
    values: dict[str, list[float]] = {each.name: [] for each in measured}
    for turn in range(turns):
        say(f"turn {turn + 1} of {turns}")
        for each in measured:
            if each.name not in untaken and turn < each.turns:
                values[each.name].append(measures[each.name]())
    return [
        _derived(benchmark, values, untaken) if isinstance(benchmark, Derived)
        else _untaken(benchmark, untaken[benchmark.name]) if benchmark.name in untaken
        else _figure(benchmark, values[benchmark.name])
        for benchmark in benchmarks
    ]  # fmt: skip


def _figure(one: Benchmark, values: Sequence[float]) -> Figure:
    best = max(values) if one.target is not None and one.target.side == "at_least" else min(values)
    return _told(one, best, statistics.median(values), max(values), len(values))


def _derived(one: Derived, values: Mapping[str, Sequence[float]], untaken: Mapping[str, str]) -> Figure:
    for name in one.of:
        if name in untaken:
            return _untaken(one, untaken[name])
    best = one.compute(*(min(values[name]) for name in one.of))
    median = one.compute(*(statistics.median(values[name]) for name in one.of))
    return _told(one, best, median, max(best, median), min(len(values[name]) for name in one.of))


def _told(one: Benchmark | Derived, best: float, median: float, largest: float, turns: int) -> Figure:
    """A figure's data. The best decides whether a target is met: other load of the machine only adds to a time."""
    target = None if one.target is None else {one.target.side: one.target.bound}
    return {
        "name": one.name, "doc": one.doc, "unit": one.unit, "best": best, "median": median, "largest": largest,
        "turns": turns, "target": target, "met": None if one.target is None else one.target.met(best),
    }  # fmt: skip


def _untaken(one: Benchmark | Derived, why: str) -> Figure:
    target = None if one.target is None else {one.target.side: one.target.bound}
    return {"name": one.name, "doc": one.doc, "unit": one.unit, "untaken": why, "target": target, "met": None}
