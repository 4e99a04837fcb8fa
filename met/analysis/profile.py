"""Run time of a kernel: operations and time of each part, and the share of what the core can do.

How a part's time is found. The kernel is made of sections, pieces of straight code. Each is compiled alone, called
again and again from a state that the run went through, and its best time taken; times how often the run calls it a
step, which is counted. Parts within a section (servo physics, environment, dynamics) share its time by operations. An
operation that two parts share is counted where it was first used.

The whole run is timed as well, in turns with its sections. The parts never add up to it exactly: alone, a section has
its code and data at hand, and in the run short ones are put in their caller's place.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np

from met import backends
from met.backends.backend import Block, Kernel
from met.backends.llvm.pieces import operations
from met.frozen import frozen
from met.plan import Experiment, Formula
from met.program.build import build
from met.program.system import PARAMETER, TREE
from met.run import inputs
from met.trace import fma
from met.trace.counting import counting
from met.trace.nodes import LEAVES, OPERANDS
from met.trace.program import (
    Branch,
    CodeSection,
    Every,
    Phase,
    Program,
    RecordedControl,
    Recording,
    RecordPhase,
    RecordSection,
    RunPhase,
    RunSection,
    Tape,
    Unless0,
    WhileAny,
    sections_in,
    walk,
)
from met.trace.recorder import record

FLOPS = {"add": 1, "sub": 1, "mul": 1, "div": 1, "sqrt": 1, "fma": 2}
"""Weights of the operations that count as arithmetic; comparing, choosing and moving do not count."""

WORK = {
    "bed": "emulated beds",
    "read": "observers",
    "follow": "observers",
    "guides_": "guides",
    "sensors_": "sensors of links",
    "servos_": "servo computers",
    "modes": "friction modes",
    "decide": "friction decisions",
    "arm": "arm on a bed",
    "law": "laws",
    "given": "laws",
    "derive": "first stage",
    "judge": "failures",
    "left_open": "friction decisions",
    "advance": "integrator",
    "carry": "integrator",
    "slope": "further stages",
    "split": "friction splits",
    "expressions_": "expressions",
    "metrics_": "metrics",
    "record": "recorder",
}
"""Names of kinds of work by the beginning of a phase's name, in the order of an instant and the step after it."""

WITHIN = ("servo physics", "environment", "dynamics", "sensors")
"""Parts of a stage (met/program/evaluation.py), in order."""

_BLOCKS, _MANY = 4, 256  # blocks of cases that are timed together, and at most of a short run
_STEPS = 5_000  # steps times blocks of the run that is timed, at most: well under a second, some 100 MB of rows
_CALLS, _STARTS = 1000, 4  # calls of a section alone from one state, and the number of repeats from that state
_TURNS = 9  # number of times that each is timed

Work = Callable[[], object]


@frozen
class WorkCost:
    """One kind of work. All numbers are a step's and a case's, averages over the run.

    work        `first stage`;  part: `dynamics` of it, or "" for what is none of its parts
    event       whether it is done seldom: where a joint of the block comes to rest or breaks away, or a case fails
    calls       how often it is done
    operations  of the graph;  flops: of these, a fused multiply-add counting as two
    ns          its time alone
    """

    work: str
    part: str
    event: bool
    calls: float
    operations: float
    flops: float
    ns: float


@frozen
class Input:
    """A coordinate that varies from case to case.

    sets     parameters that follow from it
    hoisted  operations that depend on it and are done once, before the first step
    kept     numbers that this leaves in a case's memory;  read_by: operations of a step that take one of them
    """

    path: str
    sets: int
    hoisted: int
    kept: int
    read_by: int


@frozen
class RunProfile:
    """Measurements of an experiment's kernel, as `met profile` shows them.

    lanes         cases a block; vector: cases a register;  cpu: LLVM's name of the processor
    code_bytes    of machine code, in `pieces` functions
    cached        whether the machine code was found; seconds: recording the program, machine code (or finding it)
    blocks, steps that were timed;  ns: of a step and case, all in all
    peak          flops a second that this core can do, measured just now
    constants     parameters that no case varies: folded into the code
    """

    experiment: str
    cases: int
    joints: int
    lanes: int
    vector: int
    cpu: str
    code_bytes: int
    pieces: int
    cached: bool
    recording_s: float
    compiling_s: float
    blocks: int
    steps: int
    ns: float
    peak: float
    constants: int
    inputs: tuple[Input, ...]
    parts: tuple[WorkCost, ...]

    @property
    def flops(self) -> float:
        """Floating-point operations of a step and case, friction's events included as often as they were."""
        return sum(part.flops for part in self.parts)

    @property
    def share_of_peak(self) -> float:
        """Flops a second of the run, as a share of the peak."""
        return self.flops / (self.ns * 1e-9) / self.peak


def profile(experiment: Experiment) -> RunProfile:
    """Measure an experiment's kernel on this core. Raises Problem where the experiment cannot be built."""
    begun = time.perf_counter()
    recording = record(build(experiment))
    recorded = time.perf_counter()
    kernel = backends.load(recording)
    compiled = time.perf_counter()

    schedule = experiment.structure.schedule
    cases = _cases(experiment, kernel.lanes, max(1, schedule.ticks // schedule.dynamics))
    blocks = len(cases) // kernel.lanes
    ticks = min(schedule.ticks, max(1, _STEPS // blocks) * schedule.dynamics)
    steps = max(1, ticks // schedule.dynamics)
    calls = _calls(kernel, cases, ticks)
    halfway = kernel.block(cases[: kernel.lanes])
    halfway.step(0, ticks // 2)
    numbers = sorted({number for number, _ in calls})
    chains, fused = _chains()
    seconds, fastest, *alone = _best(
        [lambda: kernel.run(cases, ticks, threads=1), chains, *(_alone(kernel, number, halfway) for number in numbers)]
    )
    ns = {
        number: section_seconds * 1e9 / (_CALLS * _STARTS * kernel.lanes)
        for number, section_seconds in zip(numbers, alone, strict=True)
    }
    return RunProfile(
        experiment=experiment.name,
        cases=experiment.cases.count,
        joints=len(experiment.structure.moving),
        lanes=kernel.lanes,
        vector=kernel.vector,
        cpu=kernel.processor,
        code_bytes=kernel.code_bytes,
        pieces=kernel.functions,
        cached=kernel.cached,
        recording_s=recorded - begun,
        compiling_s=compiled - recorded,
        blocks=blocks,
        steps=steps,
        ns=seconds * 1e9 / (len(cases) * steps),
        peak=2.0 * fused / fastest,
        constants=sum(not isinstance(parameter.value, Formula | str) for parameter in experiment.parameters.values()),
        inputs=tuple(hoisted(experiment, recording)),
        parts=_parts(recording, {key: count / steps for key, count in calls.items()}, ns),
    )


def _chains() -> tuple[Work, int]:
    """Work that keeps a core at its peak, and the number of its fused multiply-adds: enough chains to hide latency."""
    chains, length, blocks, ticks = 12, 16, 4, 2000

    def start(tape: Tape) -> None:
        for i in range(chains):
            tape.write(f"x{i}", tape.input("x") + float(i))

    def tick(tape: Tape) -> None:
        """Record chains of fused multiply-adds that do not wait for each other, to measure a core's peak."""
        values = [tape.read(f"x{i}") for i in range(chains)]
        for _ in range(length):
            values = [fma(value, 0.75, 0.5) for value in values]
        for i, value in enumerate(values):
            tape.write(f"x{i}", value)

    def end(tape: Tape) -> None:
        for i in range(chains):
            tape.output(f"x{i}", tape.read(f"x{i}"))

    names = tuple(f"x{i}" for i in range(chains))
    program = Program(
        1.0,
        (RunPhase(Phase("start", start)),),
        (RunPhase(Phase("chains", tick)),),
        (RunPhase(Phase("end", end)),),
        ("x",),
        0,
        names,
    )
    kernel = backends.load(record(program))
    cases = np.ones((blocks * kernel.lanes, 1))
    work = partial(kernel.run, cases, ticks - 1, record=False, threads=1)
    return work, chains * length * ticks * len(cases)


def hoisted(experiment: Experiment, recording: Recording) -> Iterator[Input]:
    """For each coordinate, the work that is done before the first step, and the work left to a step."""
    sections, ticking = set(sections_in(recording.start)), set(sections_in(recording.tick))
    for coordinate in experiment.cases.coordinates:
        count, stored = 0, set()
        for section in (recording.sections[i] for i in sections):
            needs: set[int] = set()
            for i in section.order:
                node = section.nodes[i]
                refs = node[1 : 1 + OPERANDS[node[0]]]
                if node == ("input", coordinate.path) or any(ref >> 1 in needs for ref in refs):
                    needs.add(i)
                    count += node[0] not in LEAVES
            stored |= {name for name, ref in section.stores if ref >> 1 in needs and name.startswith((PARAMETER, TREE))}
        readers = sum(_reads(recording.sections[i], stored) for i in ticking)
        yield Input(coordinate.path, len(coordinate.sets), count, len(stored), readers)


def _reads(section: CodeSection, cells: set[str]) -> int:
    """Live operations that take one of these cells."""
    count = 0
    for i in operations(section):
        node = section.nodes[i]
        operands = (section.nodes[ref >> 1] for ref in node[1 : 1 + OPERANDS[node[0]]])
        count += any(operand[0] == "cell" and operand[1] in cells for operand in operands)
    return count


def by_part(section: CodeSection) -> dict[str, tuple[int, int]]:
    """Live operations and flops of a section by part, in order of first appearance."""
    costs: dict[str, tuple[int, int]] = {}
    parts = iter((*section.parts, (len(section.nodes), "")))
    name, (until, following) = "", next(parts)
    for i in operations(section):
        while i >= until:
            name, (until, following) = following, next(parts)
        count, flops = costs.get(name, (0, 0))
        costs[name] = (count + 1, flops + FLOPS.get(section.nodes[i][0], 0))
    return costs


# Times


def _parts(
    recording: Recording, calls: Mapping[tuple[int, bool], float], alone: Mapping[int, float]
) -> tuple[WorkCost, ...]:
    """Every kind of work of a step, in the order in which a step comes to it.

    calls  of a section a step, by its number and whether within a loop;  alone: ns of a call of it and case
    """
    costs: dict[tuple[str, str, bool], WorkCost] = {}
    for (number, event), rate in calls.items():
        section = recording.sections[number]
        shares = by_part(section) or {section.parts[0][1]: (0, 0)}  # without any operation
        whole = sum(ops for ops, _ in shares.values()) or 1
        for path, (ops, flops) in shares.items():
            phase, _, part = path.partition("/")
            key = (_work(phase), part, event)
            old = costs.get(key, WorkCost(*key, 0.0, 0.0, 0.0, 0.0))
            ns = alone[number] * rate * (ops / whole if ops else 1.0)
            costs[key] = WorkCost(
                *key, max(old.calls, rate), old.operations + ops * rate, old.flops + flops * rate, old.ns + ns
            )
    return tuple(sorted(costs.values(), key=_place))


def _work(phase: str) -> str:
    """The kind of a phase's work, as `WORK` names it; the phase's own name where it is no phase of a step."""
    return next((work for begin, work in WORK.items() if phase.startswith(begin)), phase)


def _place(part: WorkCost) -> tuple[bool, int, int]:
    """The sort key of a row: rows stand in the order of a step, work outside a stage's parts after those."""
    works = list(WORK.values())
    return (
        part.event,
        works.index(part.work) if part.work in works else len(works),
        WITHIN.index(part.part) if part.part in WITHIN else len(WITHIN),
    )


def _calls(kernel: Kernel, cases: np.ndarray, ticks: int) -> dict[tuple[int, bool], float]:
    """Mean number of calls of each section in a run, over the blocks, by (section, whether within a loop)."""
    program, loops = counting(kernel.program)
    counter = backends.load(record(program), kernel.lanes)
    _, outputs = counter.run(cases, ticks, record=False, threads=1)
    turns = iter([float(outputs[:: kernel.lanes, program.outputs.index(loop.turns)].mean()) for loop in loops])
    calls: dict[tuple[int, bool], float] = {}

    def ticks_of(first: int, divisor: int) -> int:
        """The number of multiples of the divisor from the first tick to the last."""
        return ticks // divisor - (first + divisor - 1) // divisor + 1

    def note(body: tuple[RecordedControl, ...], first: int, divisor: int, event: float | None) -> None:
        """Count the calls in a body. event: number of turns of the enclosing loop"""
        for node in body:
            match node:
                case RunSection(section):
                    key = (section, event is not None)
                    calls[key] = calls.get(key, 0.0) + (ticks_of(first, divisor) if event is None else event)
                case RecordSection(section, own):
                    calls[section, False] = ticks_of(0, own)
                case Branch(Every(own), inner):
                    note(inner, first, math.lcm(divisor, own), event)
                case Branch(Unless0(), inner):
                    note(inner, max(first, 1), divisor, event)
                case Branch(WhileAny(), inner):
                    note(inner, first, divisor, next(turns))

    note(kernel.recording.start, 0, 1, None)
    calls.clear()  # of the start only the loops' counters matter: they come first
    note(kernel.recording.tick, 0, 1, None)
    return calls


def _alone(kernel: Kernel, number: int, state: Block) -> Work:
    """Work that calls a section many times in a row, from copies of this state."""
    recording = kernel.recording
    section = recording.sections[number]
    program, step = recording.program, RunSection(0)
    if section.records:
        only = next(node for node in walk(program.tick) if isinstance(node, RecordPhase))
        program, step = replace(program, tick=(replace(only, divisor=1),)), RecordSection(0, 1)  # type: ignore[assignment]
    else:
        program = replace(program, tick=())
    single = Recording(program, (section,), (), (step,), (), recording.cells)
    # Not inlined: in a loop of its own a compiler would find that nothing changes, and skip much of the work.
    alone = backends.find().load(single, lanes=kernel.lanes, inline=False).block(state.inputs.T)

    def work() -> None:
        """Run the section `_CALLS` times from copies of the state, several times."""
        for _ in range(_STARTS):
            alone.state[:] = state.state
            if section.records:
                alone.recorded(1, _CALLS)
            else:
                alone.step(1, _CALLS)

    return work


def _cases(experiment: Experiment, lanes: int, steps: int) -> np.ndarray:
    """Inputs of whole blocks, [case, input], taken evenly from the case table; few cases are repeated.

    There are a few blocks, and more for a short run, so that its time is that of its steps and not of the call.
    """
    count = experiment.cases.count
    blocks = max(min(_BLOCKS, -(-count // lanes)), min(_MANY, -(-_STEPS // steps)))
    return inputs(experiment, np.linspace(0, count - 1, blocks * lanes).round().astype(np.int64))


def _best(works: Sequence[Work]) -> list[float]:
    """The shortest CPU time of several turns of each, in s, after one to warm up: the machine's other load then hits
    all alike.

    The core's own time, not the clock's: waiting for a core that another process has is not counted.
    """
    least = [math.inf] * len(works)
    for turn in range(_TURNS + 1):
        for i, work in enumerate(works):
            begun = time.thread_time()
            work()
            if turn:
                least[i] = min(least[i], time.thread_time() - begun)
    return least


def as_data(run_profile: RunProfile) -> Mapping[str, Any]:
    """The profile as JSON can hold it."""
    return {**asdict(run_profile), "flops": run_profile.flops, "share_of_peak": run_profile.share_of_peak}
