"""Whole steps: ns per step of modified Euler and case, with servos and friction that truly sticks.

A step is a servo's tick, two evaluations with the servo's physics, and what friction asks for. Where a rate comes to
zero in any case of a block, the block decides anew and takes part of the step again: an event. The first figures are
of a run with next to none; how many there were stands beside them, and so does a run with many. Time is the core's.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np

from benchmarks import decks
from benchmarks.arms import ARMS, SEVEN, Arm
from benchmarks.benchmark import Benchmark, Derived, Target
from met.backends.llvm import kernel
from met.program import build
from met.trace.counting import counting

TITLE = "modified Euler with gearbox, servo and friction, ns per step and case, one core, many cases"

STEPS = {"2R": 2000, "7R": 500, "30R": 100, "30R-general": 100}
"""Steps of a case that are timed together: some 10 ms and more."""

_BOUNDS = {"2R": 11.0, "7R": 125.0, "30R": 1150.0}
FEW = 0.1  # events a step and block, in what is called a run with few


OVER_TIME = (
    "always(abs({0}.qd - {0}.servo.command) < 1 rad/s, after = 0.5 s)",
    "eventually(abs({0}.q) < 1 deg, within = 1 s)",
    "never(abs({0}.servo.voltage) > 900 V)",
    "holds_for({0}.qd > 0 rad/s and {0}.qd < 2 rad/s, 0.2 s)",
)
"""Requirements of each joint, of which each watches a signal of its own."""


@cache
def _kernel_and_inputs(arm: Arm, command: str, watched: bool = False) -> tuple[Any, np.ndarray]:
    """The kernel, and the inputs of all cases. watched: with requirements over time, `OVER_TIME`."""
    joints = [body.joint for body in arm.bodies() if body.kind != "fixed"]
    run = " ".join(f"require {text.format(joint)};" for joint in joints for text in OVER_TIME)
    experiment = decks.experiment(arm, command, variant=decks.Variant(run=run) if watched else None)
    inputs = np.stack([coordinate.values for coordinate in experiment.cases.coordinates], axis=1)
    return kernel.compile(build(experiment)), np.ascontiguousarray(inputs)


def _step(arm: Arm, command: str, watched: bool = False) -> Callable[[], float]:
    compiled, inputs = _kernel_and_inputs(arm, command, watched)
    steps = STEPS[arm.name]

    def measure() -> float:
        begun = time.thread_time()
        compiled.run(inputs, steps, record=False, threads=1)
        return (time.thread_time() - begun) * 1e9 / (len(inputs) * steps)

    return measure


def _events(arm: Arm, command: str) -> Callable[[], float]:
    """Events a step and block, in just the run that is timed. An event is one loop of friction's come to and run."""
    compiled, inputs = _kernel_and_inputs(arm, command)
    program, loops = counting(compiled.program)
    counter = kernel.compile(program, lanes=compiled.lanes)

    def measure() -> float:
        _, outputs = counter.run(inputs, STEPS[arm.name], record=False, threads=1)
        columns = [program.outputs.index(loop.entries) for loop in loops if loop.outer and loop.cell != "again"]
        return float(outputs[:: compiled.lanes, columns].sum(axis=1).mean()) / STEPS[arm.name]

    return measure


def _hot(arm: Arm) -> Callable[[], float]:
    """One case, stepped one tick a call from Python, as a bed's loop does; us a step."""
    compiled, inputs = _kernel_and_inputs(arm, "steady")
    block = compiled.block(inputs[:1])
    block.step(0, 0)
    count = 2000
    tick = 0

    def measure() -> float:
        nonlocal tick
        begun = time.thread_time()
        for k in range(tick + 1, tick + count + 1):
            block.step(k, k)
        tick += count
        return (time.thread_time() - begun) * 1e6 / count

    return measure


def _per_arm(
    kind: str, doc: str, unit: str, prepare: Callable[[Arm, str], Any], command: str, **more: Any
) -> list[Any]:
    return [Benchmark(f"{kind}.{arm.name}", doc, unit, partial(prepare, arm, command), **more)
            for arm in ARMS]  # fmt: skip


BENCHMARKS: tuple[Benchmark | Derived, ...] = (
    *(
        Benchmark(
            f"step.{arm.name}", "all joints turn on", "ns", partial(_step, arm, "steady"),
            Target(_BOUNDS[arm.name]) if arm.name in _BOUNDS else None,
        )
        for arm in ARMS
    ),
    *_per_arm("step.events", "events a step and block in that run", "", _events, "steady", target=Target(FEW), turns=1),
    *_per_arm("reversing", "all joints turn back fifty times a second", "ns", _step, "reversing"),
    *_per_arm("reversing.events", "events a step and block in that run", "", _events, "reversing", turns=1),
    *(
        Derived(
            f"event.{arm.name}", "cost of an event to each case of its block", "ns",
            (f"step.{arm.name}", f"reversing.{arm.name}", f"step.events.{arm.name}", f"reversing.events.{arm.name}"),
            lambda few, many, rare, often: (many - few) / (often - rare),
        )
        for arm in ARMS
    ),
    Benchmark("watched.7R", "step.7R with four requirements over time on each joint", "ns",
              partial(_step, SEVEN, "steady", True)),
    Derived("over_time.7R", "a requirement over time, of a signal of its own", "ns", ("watched.7R", "step.7R"),
            lambda watched, bare: (watched - bare) / (len(OVER_TIME) * 7), Target(1.0)),
    Benchmark("hot.7R", "one step of one case, called from Python: the Panda", "us", partial(_hot, SEVEN)),
)  # fmt: skip
