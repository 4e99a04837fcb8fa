"""From a plan to a kernel that can be called: recorded, written as vector code, compiled, loaded; s.

The programs are the whole steps of stepping.py. Cold: nothing is in the cache. Cached: the same once more, its machine
code found by the hash of its text. Time is the processor's, which one thread has to itself: what the clock says on an
idle machine, and near to it on a busy one.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from benchmarks import decks, evaluation
from benchmarks.arms import ARMS, CHAIN, Arm
from benchmarks.benchmark import Benchmark, Target
from met.backends.llvm import kernel
from met.plan import Experiment
from met.run import prepare

TITLE = "from plan to callable kernel, s"

_COLD = {"2R": 0.15, "7R": 0.5, "30R": 2.0}
_CACHED = 0.01


@contextmanager
def _empty_cache() -> Iterator[None]:
    """No compiled object is found, and what is made goes when this ends."""
    before = os.environ.get("MET_CACHE_DIR")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MET_CACHE_DIR"] = folder
        try:
            yield
        finally:
            if before is None:
                del os.environ["MET_CACHE_DIR"]
            else:
                os.environ["MET_CACHE_DIR"] = before


def _seconds(work: Callable[[], object]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def _callable(experiment: Experiment) -> object:
    return prepare(experiment).kernel.entry


def _cold(arm: Arm) -> Callable[[], float]:
    experiment = decks.experiment(arm, "steady")

    def measure() -> float:
        with _empty_cache():
            return _seconds(lambda: _callable(experiment))

    return measure


def _cached(arm: Arm) -> Callable[[], float]:
    experiment = decks.experiment(arm, "steady")

    def measure() -> float:
        return _seconds(lambda: _callable(experiment))

    measure()
    return measure


def _evaluation(arm: Arm) -> Callable[[], float]:
    def measure() -> float:
        with _empty_cache():
            return _seconds(lambda: kernel.compile(evaluation.program(arm)).entry)

    return measure


BENCHMARKS: tuple[Benchmark, ...] = (
    *(
        Benchmark(
            f"compile.{arm.name}", "cold", "s", partial(_cold, arm),
            Target(_COLD[arm.name]) if arm.name in _COLD else None, turns=5,
        )
        for arm in ARMS
    ),
    *(
        Benchmark(
            f"cached.{arm.name}", "from the cache", "s", partial(_cached, arm),
            Target(_CACHED) if arm.name in _COLD else None,
        )
        for arm in ARMS
    ),
    Benchmark("compile.100R", "cold", "s", partial(_cold, CHAIN), Target(6.0), turns=1, slow=True),
    Benchmark(
        "compile.100R.static", "cold, one evaluation in torque mode alone", "s",
        partial(_evaluation, CHAIN), turns=2, slow=True,
    ),
)  # fmt: skip
