"""Jacobians of a period by other ways: differences of the interpreted program, and steps in the imaginary direction."""

from __future__ import annotations

import cmath
import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import ic
from met import run as engine
from met.analysis.linear.flow import Flow
from met.analysis.linear.jacobian import PeriodMap, at_instants, failed
from met.analysis.linear.period import PeriodProgram, is_converter
from met.backends.reference.interpret import InterpretedBlock
from met.plan import Experiment
from met.trace.derivative import STEPS
from met.trace.nodes import OPERANDS, TRUTHS
from met.trace.primitives import PLAIN
from met.trace.program import Branch, Every, RecordedControl, RecordSection, Unless0

DECKS = Path(ic.__file__).parent / "decks"


def at_instant(program: PeriodProgram, case: int, tick: int) -> Flow:
    """A case at an instant, from which a period goes on, as in the run. Raises Problem D371."""
    (flow,) = at_instants(program, engine.inputs(program.experiment, np.array([case])), tick)
    if flow is None:
        raise failed(program.experiment, tick)
    return flow


@functools.cache
def shipped() -> list[tuple[str, str]]:
    """All decks that come with MET, each with the runs and sweeps in it."""
    return [
        (path.name, each.name)
        for path in sorted(DECKS.glob("*.ic"))
        for each in ic.compile(path).experiments
    ]  # fmt: skip


def shipped_experiment(deck: str, name: str) -> Experiment:
    (found,) = ic.compile(DECKS / deck, select=[name]).experiments
    return found


def turned(quaternion: Sequence[Any], theta: Sequence[Any]) -> list[Any]:
    """q o exp(theta), for turns so small that what is beyond the third order is nothing."""
    w, x, y, z = quaternion
    square = sum(part * part for part in theta)
    c, (a, b, d) = 1.0 - square / 8.0, (0.5 * part * (1.0 - square / 24.0) for part in theta)
    return [
        w * c - x * a - y * b - z * d, w * a + x * c + y * d - z * b,
        w * b - x * d + y * c + z * a, w * d + x * b - y * a + z * c,
    ]  # fmt: skip


def turn_between(first: Sequence[Any], second: Sequence[Any]) -> list[Any]:
    """The small rotation vector from one quaternion to another, in the axes of the first."""
    w0, x0, y0, z0 = first
    w, x, y, z = second
    return [
        2.0 * (w0 * x - x0 * w - y0 * z + z0 * y),
        2.0 * (w0 * y + x0 * z - y0 * w - z0 * x),
        2.0 * (w0 * z - x0 * y + y0 * x - z0 * w),
    ]


def by_differences(program: PeriodProgram, start: Flow, found: PeriodMap) -> np.ndarray:
    """A of `found` by central differences, of the program carried out over arrays with the bits of kernels."""
    states, n = found.states, len(found.states)
    inputs = np.array([[start.inputs[name] for name in program.recording.program.inputs]] * (2 * n + 1))
    block = InterpretedBlock(program.recording, inputs.reshape(2 * n + 1, -1))
    slots = {name: slot for slot, name in enumerate(program.recording.cells)}
    for name, value in start.cells.items():
        if name in slots:
            block.state[slots[name]] = value
    moves, sizes = _moves(program, start, states)
    for cell, values in moves.items():
        if cell in slots:
            block.state[slots[cell]] = values
    block._tick = start.tick
    for _ in range(program.ticks):
        with np.errstate(all="ignore"):
            block._row = np.zeros((2 * n + 1, len(program.columns)))
            block._follow(_unrecorded(program.rest))
            block._tick += 1
            block._follow(program.finish)
    ends: dict[str, np.ndarray] = {name: block.state[slots[name]] for name in states if name not in program.turns}
    for body in program.bodies:
        now = [block.state[slots[cell]] for cell in body.orientation]
        middle = [part[-1] for part in now]
        ends |= {f"{name}.q": each for name, each in zip(body.coordinates[3:], turn_between(middle, now), strict=True)}
    rows = np.array([ends[name] for name in states])
    return (rows[:, :n] - rows[:, n : 2 * n]) / (2.0 * sizes)


def _moves(program: PeriodProgram, start: Flow, states: Sequence[str]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Values of cells with each state moved forward, then each backward, then none; and by how much."""
    n = len(states)
    first = np.array([0.0 if name in program.turns else start.cells.get(name, 0.0) for name in states])
    sizes = 1e-5 * np.maximum(np.abs(first), 1e-2)
    moved = np.repeat(first[:, None], 2 * n + 1, axis=1)
    moved[range(n), range(n)] += sizes
    moved[range(n), range(n, 2 * n)] -= sizes
    places = {name: place for place, name in enumerate(states)}
    cells = {name: moved[place] for name, place in places.items() if name not in program.turns}
    for body in program.bodies:
        theta = [moved[places[f"{name}.q"]] for name in body.coordinates[3:]]
        at = [start.cells[cell] for cell in body.orientation]
        cells |= dict(zip(body.orientation, turned(at, theta), strict=True))
    return cells, sizes


def _unrecorded(body: Iterable[RecordedControl]) -> list[RecordedControl]:
    return [step for step in body if not isinstance(step, RecordSection)]


# Steps in the imaginary direction: arithmetic of complex numbers, decided by real parts.


def _abs(x: Any) -> Any:
    return -x if x.real < 0.0 else x


def _flip(x: Any, t: Any, n: int) -> Any:
    return PLAIN["flip"](1.0, float(complex(t).real), n) * x


def _real(name: str) -> Callable[..., Any]:
    return lambda *operands: PLAIN[name](*(x if isinstance(x, int) else float(complex(x).real) for x in operands))


def _divide(a: Any, b: Any) -> Any:
    return a / b if b != 0.0 else math.nan


def _significand(x: Any) -> Any:
    value = PLAIN["significand"](float(complex(x).real))
    return value * (1.0 + 1j * (complex(x).imag / complex(x).real))


def _sum(a: Any, b: Any) -> Any:
    """The sum, whole where one of the two is a constant so large that it rounds the other to whole numbers."""
    return (a + b).real if min(abs(a), abs(b)) < 2.0**51 <= max(abs(a), abs(b)) else a + b


COMPLEX: Mapping[str, Callable[..., Any]] = {
    "add": _sum,
    "sub": lambda a, b: _sum(a, -b),
    "mul": lambda a, b: a * b,
    "div": _divide,
    "fma": lambda a, b, c: _sum(a * b, c),
    "abs": lambda x: _abs(complex(x)),
    "sqrt": lambda x: cmath.sqrt(complex(x)),
    "flip": _flip,
    "where": lambda mask, a, b: a if mask else b,
    "and": lambda a, b: a and b,
    "significand": _significand,
    **{name: _real(name) for name in ("floor", "rint", "lt", "le", "eq", "bit", "pow2", "exponent", "philox")},
    "gather": lambda index, table: PLAIN["gather"](float(complex(index).real), table),
}

TINY = 1e-200


def by_complex_step(program: PeriodProgram, start: Flow, found: PeriodMap) -> np.ndarray:
    """A of `found`, one column for each run of a period with an imaginary part in one state."""
    columns = []
    for state in found.states:
        cells: dict[str, complex] = {name: complex(value) for name, value in start.cells.items()}
        if state not in program.turns:
            cells[state] = cells.get(state, 0j) + 1j * TINY
        for body in program.bodies:
            theta = [1j * TINY * (state == f"{name}.q") for name in body.coordinates[3:]]
            if any(theta):
                cells |= dict(zip(body.orientation, turned([cells[c] for c in body.orientation], theta), strict=True))
        tick = start.tick
        for _ in range(program.ticks):
            _follow(program, _unrecorded(program.rest), cells, tick, start.inputs)
            tick += 1
            _follow(program, program.finish, cells, tick, start.inputs)
        ends = {name: cells[name].imag / TINY for name in found.states if name not in program.turns}
        for body in program.bodies:
            now = [cells[cell] for cell in body.orientation]
            turns = turn_between([part.real for part in now], now)
            ends |= {f"{n}.q": part.imag / TINY for n, part in zip(body.coordinates[3:], turns, strict=True)}
        columns.append([ends[name] for name in found.states])
    return np.array(columns).T


def _follow(
    program: PeriodProgram,
    body: Iterable[RecordedControl],
    cells: dict[str, complex],
    tick: int,
    inputs: Mapping[str, float],
) -> None:
    for step in body:
        if not isinstance(step, Branch):
            _run(program, step.section, cells, tick, inputs)
        elif isinstance(step.condition, Every):
            if tick % step.condition.divisor == 0:
                _follow(program, step.body, cells, tick, inputs)
        elif isinstance(step.condition, Unless0):
            if tick > 0:
                _follow(program, step.body, cells, tick, inputs)
        else:
            for _ in range(step.condition.at_most):
                if cells.get(step.condition.cell, 0.0) == 0.0:
                    break
                _follow(program, step.body, cells, tick, inputs)


def _run(
    program: PeriodProgram, number: int, cells: dict[str, complex], tick: int, inputs: Mapping[str, float]
) -> None:
    section = program.recording.sections[number]
    nodes, found = section.nodes, dict[int, Any]()
    for i in section.order:
        op, *rest = nodes[i]
        count = OPERANDS[op]
        if op == "const":
            found[i] = rest[0]
        elif op == "false":
            found[i] = False
        elif op == "cell":
            found[i] = cells.get(rest[0], 0.0)
        elif op == "input":
            found[i] = inputs[rest[0]]
        elif op in ("tick", "time"):
            found[i] = float(tick) if op == "tick" else tick / program.schedule.base_hz
        else:
            operands = []
            for ref in rest[:count]:
                value = found[ref >> 1]
                if ref & 1:
                    value = (not value) if nodes[ref >> 1][0] in TRUTHS else -value
                operands.append(value)
            found[i] = COMPLEX[op](*operands, *rest[count:])
            if op in STEPS and is_converter(section, i):  # the straight line through its steps
                found[i] += 1j * complex(operands[0]).imag
    stores = [(cell, found[ref >> 1] * (-1.0 if ref & 1 else 1.0)) for cell, ref in section.stores]
    cells.update({cell: complex(value) for cell, value in stores})


def scattered(program: PeriodProgram, rng: np.random.Generator, *, time: float, size: float) -> Flow:
    """The first case at an instant of its run, its states moved at random by such a share of what they are there."""
    tick = int(time * program.schedule.base_hz) // program.ticks * program.ticks
    flow = at_instant(program, 0, tick)
    for name in program.states:
        if name not in program.turns:
            own = flow.cells.get(name, 0.0)
            flow.cells[name] = own + size * max(abs(own), 1e-3) * float(rng.normal())
    for body in program.bodies:
        at = [flow.cells[cell] for cell in body.orientation]
        new = np.array(turned(at, (size * rng.normal(size=3)).tolist()))
        flow.cells |= dict(zip(body.orientation, (new / np.linalg.norm(new)).tolist(), strict=True))
    return flow


def near(a: np.ndarray, b: np.ndarray) -> float:
    """The largest difference as a share of the largest number of its row."""
    largest = np.maximum(np.max(np.abs(a), axis=1, initial=0.0), 1e-12)
    return float(np.max(np.abs(a - b) / largest[:, None], initial=0.0))
