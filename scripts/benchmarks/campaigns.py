"""Campaigns: what the toolchain adds to the kernel's own time, on all cores of this machine, and what memory it takes.

The same cases, two ways in the same turn: a whole `met run`, from the shell's start of the process to its end, with
metrics for all cases and 1,000 histories, shards, archive and verdict; and the kernel alone on what it needs.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

from benchmarks.benchmark import Benchmark, Derived, Target
from benchmarks.whole_process import run

TITLE = "campaigns of the two-link arm, 20 s a case, on all cores"

DECK = """
#include <two_link.ic>
sweep million of nominal {{
    vary gearbox.kp = linspace(0.010, 0.030, 1000) V*s/rad;
    vary links.upper.mass = linspace(40, 60, {masses}) kg;
}}
run fast like nominal {{ rates {{ dynamics = 1 kHz; servos = 1 kHz; }} }}
sweep khz of fast {{
    vary gearbox.kp = linspace(0.010, 0.030, 1000) V*s/rad;
    vary links.upper.mass = linspace(40, 60, {masses}) kg;
}}
"""

MILLION, KHZ, MINUTE = 1_000_000, 300_000, 650_000


def _deck(cases: int) -> str:
    return DECK.format(masses=cases // 1000)


def _whole(name: str, cases: int, which: int, *words: str) -> Callable[[], Callable[[], float]]:
    """Seconds (0) or MiB (1) of `met run` with these further words."""
    return lambda: lambda: run(
        "run", "deck.ic", name, "-o", "out.h5", "--no-picture", "--histories", f"every:{cases // 1000}", *words,
        deck=_deck(cases),
    )[which]  # fmt: skip


@cache
def _kernel(name: str, cases: int) -> Callable[[], float]:
    """Seconds of the kernel alone, with as many threads as there are cores."""
    import numpy as np

    import ic
    from met import run as engine

    with tempfile.TemporaryDirectory() as directory:
        deck = Path(directory, "deck.ic")
        deck.write_text(_deck(cases), encoding="utf-8")
        experiment = ic.compile(deck, select=[name]).experiments[0]
    prepared = engine.prepare(experiment)
    inputs, ticks = engine.inputs(experiment, np.arange(cases)), experiment.structure.schedule.ticks

    def seconds() -> float:
        begun = time.perf_counter()
        prepared.kernel.run(inputs, ticks, record=False)
        return time.perf_counter() - begun

    return seconds


def _alone(name: str, cases: int) -> Callable[[], Callable[[], float]]:
    return lambda: _kernel(name, cases)


BENCHMARKS: tuple[Benchmark | Derived, ...] = (
    Benchmark("campaign.million", "met run of a million cases at the paper's rates", "s",
              _whole("million", MILLION, 0), turns=2, slow=True),
    Benchmark("campaign.million.kernel", "its kernel alone", "s", _alone("million", MILLION), turns=2, slow=True),
    Derived("campaign.million.added", "what the toolchain adds", "s", ("campaign.million", "campaign.million.kernel"),
            lambda whole, kernel: whole - kernel, Target(8.0)),
    Derived("campaign.million.rate", "cases a second, all in all", "/s", ("campaign.million",),
            lambda whole: MILLION / whole),
    Derived("campaign.million.kernel.rate", "cases a second of the kernel alone", "/s", ("campaign.million.kernel",),
            lambda kernel: MILLION / kernel),
    Benchmark("campaign.million.memory", "memory in use", "MiB", _whole("million", MILLION, 1), Target(1024.0),
              turns=1, slow=True),
    Benchmark("campaign.khz", f"met run of {KHZ:,} cases with all rates at 1 kHz", "s", _whole("khz", KHZ, 0),
              turns=1, slow=True),
    Benchmark("campaign.khz.kernel", "its kernel alone", "s", _alone("khz", KHZ), turns=1, slow=True),
    Derived("campaign.khz.ratio", "times the kernel's time that it takes", "", ("campaign.khz", "campaign.khz.kernel"),
            lambda whole, kernel: whole / kernel, Target(1.15)),
    Benchmark("campaign.minute", f"met run of {MINUTE:,} cases at 1 kHz by threads of its own", "s",
              _whole("khz", MINUTE, 0), turns=1, slow=True),
    Benchmark("campaign.minute.dask", "the same by `--dask local`, a worker a core", "s",
              _whole("khz", MINUTE, 0, "--dask", "local"), turns=1, slow=True),
    Derived("campaign.minute.dask.ratio", "times that it takes with Dask", "",
            ("campaign.minute.dask", "campaign.minute"), lambda dask, threads: dask / threads, Target(1.10)),
)  # fmt: skip
