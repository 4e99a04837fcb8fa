"""`scripts/benchmark`: takes the requested figures, prints them as tables, writes and compares them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

from benchmarks import (
    arms,
    bed,
    campaigns,
    compiling,
    coupled,
    differences,
    editor,
    evaluation,
    hybrid,
    jacobians,
    ladder,
    report,
    simulations,
    stepping,
    whole_process,
)  # fmt: skip
from benchmarks.benchmark import Benchmark, Derived, take, with_sources
from benchmarks.machine import in_words, machine

RATIOS = SimpleNamespace(
    TITLE="ratios of throughput over many cases, each on one core and in the same turns", BENCHMARKS=evaluation.RATIOS
)
SUBJECTS = (
    RATIOS,
    evaluation,
    stepping,
    ladder,
    hybrid,
    jacobians,
    bed,
    compiling,
    coupled,
    editor,
    whole_process,
    campaigns,
    simulations,
    differences,
)
"""Benchmarks in the order of the report: ratios first, since they depend least on machine and load."""

TURNS, QUICK = 15, 3


def main(words: Sequence[str] | None = None) -> int:
    known: dict[str, Benchmark | Derived] = {
        benchmark.name: benchmark for subject in SUBJECTS for benchmark in subject.BENCHMARKS
    }
    options = _arguments(known, words)
    if options.list:
        width = max(map(len, known))
        for subject in SUBJECTS:
            print(subject.TITLE)
            print("\n".join(f"    {benchmark.name:{width}}  {benchmark.doc}" for benchmark in subject.BENCHMARKS))
        print("arms", *_legend(), sep="\n    ")
        return 0
    then = report.read(options.against) if options.against is not None else None
    names = with_sources(options.names or list(known), known)
    slow = {name for name, benchmark in known.items() if getattr(benchmark, "slow", False)} if options.quick else set()
    chosen = [known[name] for name in names if not slow & {name, *getattr(known[name], "sources", ())}]
    turns = options.repeats or (QUICK if options.quick else TURNS)

    this_machine = machine()
    print(in_words(this_machine))
    print(f"best and median of {turns} turns, each of which takes every figure once; a target is for the best")
    print("arms", *_legend(), sep="\n    ")
    watched = sys.stderr.isatty()
    figures = take(chosen, turns, lambda text: print(f"\r{text:60}", end="", file=sys.stderr) if watched else None)
    if watched:
        print(f"\r{'':60}\r", end="", file=sys.stderr)
    for subject in SUBJECTS:
        own = {benchmark.name for benchmark in subject.BENCHMARKS}
        own_figures = [figure for figure in figures if figure["name"] in own]
        if own_figures:
            print(f"\n{subject.TITLE}", *report.table(own_figures), sep="\n")
    if options.output is not None:
        report.write(options.output, this_machine, turns, figures)
    if then is not None:
        print("", *report.against(then, this_machine, figures), sep="\n")
    print("", *report.verdict(figures), sep="\n")
    return 1 if report.missed(figures) else 0


def _legend() -> list[str]:
    """The meanings of the arms' names in the names of figures."""
    return [f"{arm.name:13}{arm.doc}" for arm in (*arms.ARMS, arms.CHAIN)]


def _arguments(known: dict[str, Benchmark | Derived], words: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="scripts/benchmark", description="Measures MET on this machine. Exit status 1 where a target is missed.",
    )  # fmt: skip
    parser.add_argument("names", nargs="*", metavar="NAME", help="what to take, or beginnings of names [all]")
    parser.add_argument("--list", action="store_true", help="list them and stop")
    parser.add_argument("--quick", action="store_true", help=f"a look: {QUICK} turns, without what takes seconds")
    parser.add_argument("--repeats", type=int, metavar="N", help=f"turns [{TURNS}]")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the figures there, as JSON")
    parser.add_argument("--against", type=Path, metavar="FILE", help="compare with figures that -o wrote")
    options = parser.parse_args(words)
    names: list[str] = []
    for word in options.names:
        matches = [name for name in known if name == word] or [name for name in known if name.startswith(f"{word}.")]
        if not matches:
            parser.error(f"no benchmark `{word}`; there are {', '.join(known)}")
        names += matches
    options.names = names
    if options.repeats is not None and options.repeats < 1:
        parser.error("--repeats: at least 1")
    return options


if __name__ == "__main__":
    try:
        sys.exit(main())
    except report.Unreadable as reason:
        print(f"scripts/benchmark: error: {reason}", file=sys.stderr)
        sys.exit(2)
