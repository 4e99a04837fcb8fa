"""Simulations from Python: what a call of `Simulation.run` adds to its kernel, and how long a step takes.

The time of this process alone is counted, of all its threads, so that what else runs beside it matters little. A call
and its kernel alone are taken in the same turn.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.benchmark import Benchmark, Derived, Target, ratio

if TYPE_CHECKING:
    from batch.simulation.simulation import Simulation

TITLE = "simulations of the two-link arm from Python, 20 s a case, a step 40 ms; of the Panda a step 1 ms"

SWEEP = """\
#include <two_link.ic>
sweep same of nominal {
    vary gearbox.kp = [0.01] V*s/rad;
    vary gearbox.ki = [0.06] V/rad;
}
"""

MANY = 10_000
STEPS = 500


@cache
def _simulation(deck: str) -> Simulation:
    import batch

    return batch.Simulation(deck)


def _values(cases: int) -> dict[str, Any]:
    return {"gearbox.kp": np.linspace(0.01, 0.04, cases), "gearbox.ki": np.linspace(0.06, 0.25, cases)}


def _spent(work: Callable[[], object], times: int = 1) -> Callable[[], float]:
    """The least CPU time of several runs of the work, s."""

    def seconds() -> float:
        times_taken = []
        for _ in range(times):
            begun = time.process_time()
            work()
            times_taken.append(time.process_time() - begun)
        return min(times_taken)

    return seconds


def _call(cases: int, unit: float, times: int) -> Callable[[], Callable[[], float]]:
    def prepare() -> Callable[[], float]:
        simulation, values = _simulation("two_link.ic"), _values(cases)
        simulation.run(values)
        seconds = _spent(lambda: simulation.run(values), times)
        return lambda: seconds() * unit

    return prepare


def _kernel(cases: int, unit: float, times: int) -> Callable[[], Callable[[], float]]:
    """The kernel alone, on the inputs of the same cases."""

    def prepare() -> Callable[[], float]:
        import ic
        from met import run as engine

        prepared = engine.prepare(ic.compile(text=SWEEP, select="same").experiments[0])
        inputs = np.stack(list(_values(cases).values()), axis=-1)
        ticks = prepared.experiment.structure.schedule.ticks
        seconds = _spent(lambda: prepared.kernel.run(inputs, ticks, record=False), times)
        return lambda: seconds() * unit

    return prepare


def _steps(deck: str) -> Callable[[], Callable[[], float]]:
    """Microseconds of a step, of so many of one case."""

    def prepare() -> Callable[[], float]:
        simulation = _simulation(deck)
        joints = [use.joint for use in simulation.experiment.structure.servos]
        commands = [0.01] * len(joints)

        def case() -> float:
            state = simulation.start(commands=joints)
            begun = time.process_time()
            for _ in range(STEPS):
                state.step(commands)
            return (time.process_time() - begun) / STEPS * 1e6

        return case

    return prepare


BENCHMARKS: tuple[Benchmark | Derived, ...] = (
    Benchmark("simulation.one", "Simulation.run of one case", "ms", _call(1, 1e3, 50), Target(1.0)),
    Benchmark("simulation.one.kernel", "its kernel alone", "ms", _kernel(1, 1e3, 50)),
    Benchmark("simulation.many", f"Simulation.run of {MANY:,} cases", "s", _call(MANY, 1.0, 1)),
    Benchmark("simulation.many.kernel", "its kernel alone", "s", _kernel(MANY, 1.0, 1)),
    ratio("simulation.many.ratio", "times the kernel's time that it takes", over="simulation.many",
          under="simulation.many.kernel", target=Target(1.10)),
    Benchmark("simulation.step", "a step of the two-link arm", "us", _steps("two_link.ic"), Target(20.0)),
    Benchmark("simulation.step.7R", "a step of the Panda, seven joints commanded", "us", _steps("panda.ic")),
)  # fmt: skip
