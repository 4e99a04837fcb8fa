"""Derivatives: time per Jacobian and case, and how many times what is differentiated they cost.

    dynamics    all of d(qdd)/d(q, qd, tau) of an arm with a rotor behind each joint, beside the evaluation itself
    direction   a whole run of the Panda with its seven servos, carried along one direction, beside the plain run: what
                a gradient costs for each number (`met.analysis.linear.gradient`)
    period      the linearised period of the same run, by its 21 states and seven voltages, of one case by itself and of
                one of many that are carried side by side (`met.analysis.linear.jacobian`)

Those but the last are compiled kernels. Many cases on one core; time is the core's.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import numpy as np

import ic
from benchmarks import evaluation
from benchmarks.arms import ARMS, GRAVITY, Arm
from benchmarks.benchmark import Benchmark, Derived, Target, ratio
from met import run as engine
from met.analysis.linear.jacobian import at_instants, period_map, period_maps
from met.analysis.linear.period import PeriodProgram, is_converter
from met.backends.llvm import kernel
from met.dynamics.linearised import LinearisedDynamics, linearised
from met.dynamics.recursion import solve
from met.dynamics.tree import Tree
from met.plan.linear_signals import input_signals
from met.trace import Real
from met.trace.differentiated import differentiated
from met.trace.program import Phase, Program, RunPhase, Tape
from met.trace.recorder import record

TITLE = "derivatives, one core, many cases"

CASES = evaluation.CASES
TICKS = 200
"""Number of Jacobians of a case that are timed together."""

ABREAST = 128
"""Number of cases whose periods are linearised together."""

STEPS = 1000
"""Number of steps of the Panda's run that are timed together."""


def program(arm: Arm, *, jacobian: bool) -> Program:
    """A program that takes an evaluation a tick, and with it a Jacobian, whose sum over all entries is kept alive; its
    inputs are each case's q, qd, tau."""
    tree = Tree.build(arm.bodies(), arm.joints)
    numbers, names = range(len(tree.joints)), ("q", "qd", "tau")

    def start(tape: Tape) -> None:
        for name in names:
            for i in numbers:
                tape.write(f"{name}.{i}", tape.input(f"{name}.{i}"))
        tape.write("sum", 0.0)

    def tick(tape: Tape) -> None:
        q, qd, tau = ([tape.read(f"{name}.{i}") for i in numbers] for name in names)
        solved = solve(tree, q, qd, tau=tau, gravity=GRAVITY, rotor=[evaluation.ROTOR] * len(numbers))
        qdd = solved.qdd
        for i in numbers:
            tape.write(f"q.{i}", q[i] + evaluation.STEP * qd[i])
            tape.write(f"qd.{i}", qd[i] + evaluation.STEP * qdd[i])
        if jacobian:
            rows = _rows(linearised(tree, qd, solved), len(numbers))
            tape.write("sum", sum((entry for row in rows for entry in row), tape.read("sum")))

    def end(tape: Tape) -> None:
        tape.output("sum", tape.read("sum"))
        for i in numbers:
            tape.output(f"qd.{i}", tape.read(f"qd.{i}"))

    return Program(
        1.0, (RunPhase(Phase("start", start)),), (RunPhase(Phase("evaluate", tick)),), (RunPhase(Phase("end", end)),),
        tuple(f"{name}.{i}" for name in names for i in numbers), 0, ("sum", *(f"qd.{i}" for i in numbers)),
    )  # fmt: skip


def _rows(dynamics: LinearisedDynamics, n: int) -> list[list[Real]]:
    """The derivatives of the accelerations by each q, qd and tau; a list a direction."""
    still = [0.0] * n
    units = [[float(i == k) for i in range(n)] for k in range(n)]
    moves = [move for e in units for move in ((e, still, still), (still, e, still), (still, still, e))]
    return [dynamics.along(*move, still)[0] for move in moves]


def _dynamics(arm: Arm, jacobian: bool) -> Callable[[], float]:
    compiled = kernel.compile(program(arm, jacobian=jacobian))
    inputs = evaluation.states(arm, CASES)

    def measure() -> float:
        begun = time.thread_time()
        compiled.run(inputs, TICKS - 1, record=False, threads=1)
        return (time.thread_time() - begun) * 1e9 / (CASES * TICKS)

    return measure


def _compiling(arm: Arm) -> Callable[[], float]:
    """CPU seconds from the recorded program to machine code, without the cache."""
    from met.backends.llvm import machine

    recording, this_machine = record(program(arm, jacobian=True)), machine.machine(None)

    def measure() -> float:
        begun = time.thread_time()
        machine.assemble(kernel.written(recording, this_machine)[1], this_machine, level=None)
        return time.thread_time() - begun

    return measure


@cache
def _panda() -> engine.Prepared:
    text = f'#include "{Path(ic.__file__).parent / "decks" / "panda.ic"}"\n'
    sweep = "sweep masses of reach { sample lhs(512) { links.link7.mass = uniform(0.5, 1) kg; } }\n"
    (sweep_experiment,) = ic.compile(text=text + sweep, select=["masses"]).experiments
    return engine.prepare(sweep_experiment)


def _period(*, abreast: bool) -> Callable[[], float]:
    """CPU milliseconds for the map of a period of a case."""
    experiment = _panda().experiment
    laws = [input_signal for input_signal in input_signals(experiment.structure) if input_signal.is_output]
    program = PeriodProgram(experiment, laws)
    begun = at_instants(program, engine.inputs(experiment, np.arange(ABREAST if abreast else 1)), STEPS, threads=1)
    flows = [flow for flow in begun if flow is not None]

    def measure() -> float:
        begun = time.thread_time()
        if abreast:
            period_maps(program, flows)
        else:
            period_map(program, flows[0])
        return (time.thread_time() - begun) * 1e3 / len(flows)

    return measure


def _run(tangents: bool) -> Callable[[], float]:
    prepared = _panda()
    inputs = engine.inputs(prepared.experiment, np.arange(CASES))
    compiled = prepared.kernel
    if tangents:
        recording = differentiated(prepared.recording, prepared.program.inputs, is_converter)
        compiled = kernel.from_recording(recording)
        inputs = np.hstack([inputs, np.ones_like(inputs)])

    def measure() -> float:
        begun = time.thread_time()
        compiled.run(inputs, STEPS, record=False, threads=1)
        return (time.thread_time() - begun) * 1e9 / (CASES * STEPS)

    return measure


_ARMS = {arm.name: arm for arm in ARMS}

BENCHMARKS: tuple[Benchmark | Derived, ...] = (
    Benchmark("dynamics.7R", "torque mode, rotors", "ns", partial(_dynamics, _ARMS["7R"], False)),
    Benchmark(
        "jacobian.7R", "its Jacobian by q, qd, tau, with it", "ns", partial(_dynamics, _ARMS["7R"], True), Target(300.0)
    ),
    ratio("jacobian.times.7R", "times the evaluation", over="jacobian.7R", under="dynamics.7R"),
    Benchmark("jacobian.compiling.7R", "machine code of it", "s", partial(_compiling, _ARMS["7R"]), Target(1.0), 3),
    Benchmark("run.panda", "a step of the Panda's run", "ns", partial(_run, False)),
    Benchmark("direction.panda", "a step with its tangent along one direction", "ns", partial(_run, True)),
    ratio("direction.times.panda", "times the plain step", over="direction.panda", under="run.panda"),
    Benchmark("period.panda", "the map of a period, of one case by itself", "ms", partial(_period, abreast=False)),
    Benchmark("period.abreast.panda", "the same, of one of many side by side", "ms", partial(_period, abreast=True)),
    ratio("period.times.panda", "times less", over="period.panda", under="period.abreast.panda"),
)  # fmt: skip
