"""Forward dynamics: ns per evaluation and case, on one core over many cases, and how many times the peer's speed.

A tick takes one evaluation and moves the state on by it for a nanosecond, q += h qd and qd += h qdd, so that each
evaluation needs the one before and none can be left out or done once for all. These two multiply-adds a joint, the
kernel's loop and the handing over of cases are in the figure; nothing is subtracted. Time is the core's, ours and the
peer's alike: waiting for a core that another process has is not counted.

    static    torque asked of every joint, no rotors: what the peer computes
    dynamic   each joint in torque or acceleration mode as each case says, with rotors; torques are found as well
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from benchmarks import peer
from benchmarks.arms import ARMS, GRAVITY, Arm
from benchmarks.benchmark import Benchmark, Derived, Target, Untaken, ratio
from met.backends.llvm import kernel
from met.dynamics.recursion import solve
from met.dynamics.tree import Tree
from met.trace.program import Phase, Program, RunPhase, Tape

TITLE = "forward dynamics, ns per evaluation and case, one core, many cases"

CASES = 512
"""Number of cases: whole blocks of any width, many more than a core holds at once."""

TICKS = {"2R": 8000, "7R": 1200, "30R": 200, "30R-general": 150}
"""Number of evaluations of a case that are timed together: some 20 ms at the targets, long against Python's share."""

STEP = 1e-9  # s, of the step that ties each evaluation to the one before
ROTOR = 0.3  # kg m^2 behind each joint, N^2 J_m: some servo of a robot's


def program(arm: Arm, *, dynamic: bool = False) -> Program:
    """A program that takes an evaluation a tick; its inputs are each case's q, qd, tau, and qdd and mode if dynamic."""
    tree = Tree.build(arm.bodies(), arm.joints)
    numbers = range(len(tree.joints))
    names = ("q", "qd", "tau", *(("qdd", "mode") if dynamic else ()))

    def start(tape: Tape) -> None:
        for name in names:
            for i in numbers:
                tape.write(f"{name}.{i}", tape.input(f"{name}.{i}"))

    def tick(tape: Tape) -> None:
        q, qd, tau = ([tape.read(f"{name}.{i}") for i in numbers] for name in ("q", "qd", "tau"))
        if dynamic:
            solution = solve(
                tree, q, qd, tau=tau, gravity=GRAVITY,
                qdd=[tape.read(f"qdd.{i}") for i in numbers],
                mode=[tape.read_mask(f"mode.{i}") for i in numbers],
                rotor=[ROTOR] * len(numbers),
            )  # fmt: skip
        else:
            solution = solve(tree, q, qd, tau=tau, gravity=GRAVITY)
        for i in numbers:
            tape.write(f"q.{i}", q[i] + STEP * qd[i])
            tape.write(f"qd.{i}", qd[i] + STEP * solution.qdd[i])
            if dynamic:  # the torque that was asked, or the one that was found: alive, and changes no later tick
                tape.write(f"tau.{i}", solution.tau[i])

    def end(tape: Tape) -> None:
        for i in numbers:
            tape.output(f"qd.{i}", tape.read(f"qd.{i}"))

    return Program(
        1.0, (RunPhase(Phase("start", start)),), (RunPhase(Phase("evaluate", tick)),), (RunPhase(Phase("end", end)),),
        tuple(f"{name}.{i}" for name in names for i in numbers), 0, tuple(f"qd.{i}" for i in numbers),
    )  # fmt: skip


def states(arm: Arm, cases: int, *, dynamic: bool = False) -> np.ndarray:
    """Inputs of that many cases, [case, input]: any position, rates of 1 rad/s, torques of 10 N m, half the joints
    in either mode."""
    n = len(arm.joints)
    rng = np.random.default_rng(7)
    q, qd, tau = rng.uniform(-np.pi, np.pi, (cases, n)), rng.standard_normal((cases, n)), rng.normal(0, 10, (cases, n))
    if not dynamic:
        return np.hstack([q, qd, tau])
    return np.hstack([q, qd, tau, rng.standard_normal((cases, n)), rng.integers(0, 2, (cases, n)).astype(float)])


def _ours(arm: Arm, dynamic: bool, cpu: str | None) -> Callable[[], float]:
    if cpu is not None and platform.machine() != "x86_64":
        raise Untaken("this is no x86 processor")
    compiled = kernel.compile(program(arm, dynamic=dynamic), cpu=cpu)
    inputs, ticks = states(arm, CASES, dynamic=dynamic), TICKS[arm.name]

    def measure() -> float:
        begun = time.thread_time()
        compiled.run(inputs, ticks - 1, record=False, threads=1)
        return (time.thread_time() - begun) * 1e9 / (CASES * ticks)

    return measure


def _peers(arm: Arm) -> Callable[[], float]:
    """The peer's evaluations, over a batch as large as ours."""
    n = len(arm.joints)
    inputs = states(arm, peer.BATCH)
    return peer.evaluations(arm, inputs[:, :n], inputs[:, n : 2 * n], inputs[:, 2 * n :])


def _benchmarks(
    kind: str, doc: str, bounds: Mapping[str, float], *, dynamic: bool, cpu: str | None = None
) -> tuple[Benchmark, ...]:
    return tuple(
        Benchmark(
            f"{kind}.{arm.name}", doc, "ns", partial(_ours, arm, dynamic, cpu),
            Target(bounds[arm.name]) if arm.name in bounds else None,
        )
        for arm in ARMS
    )  # fmt: skip


_AVX2 = {"2R": 16.0, "7R": 190.0, "30R": 1600.0}
_LEAST = {"2R": 90.0, "7R": 30.0, "30R": 25.0}

RATIOS: tuple[Derived, ...] = tuple(
    ratio(
        f"ratio.{arm.name}", "throughput, times pin.abaInParallel on one thread",
        over=f"pin.{arm.name}", under=f"static.{arm.name}",
        target=Target(_LEAST[arm.name], "at_least") if arm.name in _LEAST else None,
    )
    for arm in ARMS
)  # fmt: skip

BENCHMARKS: tuple[Benchmark, ...] = (
    *_benchmarks("static", "torque mode", {"2R": 4.0, "7R": 46.0, "30R": 280.0}, dynamic=False),
    *_benchmarks("dynamic", "any mode, rotors", {"2R": 5.5, "7R": 55.0, "30R": 380.0}, dynamic=True),
    *_benchmarks("avx2.static", "torque mode on AVX2", _AVX2, dynamic=False, cpu="haswell"),
    *_benchmarks("avx2.dynamic", "any mode, rotors, on AVX2", _AVX2, dynamic=True, cpu="haswell"),
    *(Benchmark(f"pin.{arm.name}", "pin.abaInParallel, one thread", "ns", partial(_peers, arm)) for arm in ARMS),
)
