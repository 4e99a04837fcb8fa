"""The exact Jacobian of a program over one period: what it makes of a small change of its states and its inputs.

What sticks is held: it stays at rest under small changes, so its position and rate are no states. Across an event there
is no derivative, and none is given: where something comes to rest or breaks away, where a limit is reached or left, and
where the memory stands on a kink whose other side has another derivative.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from met import run as engine
from met.analysis.linear.flow import Edge, Flow, added, listed
from met.analysis.linear.period import PeriodProgram
from met.analysis.linear.shafts import held_rates
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.passing import run_past
from met.plan import Experiment

ABREAST = 256
"""Cases that are run up to an instant side by side, so that their memory fits beside all else."""

SAME = 1e-9
"""Share of the largest number of its row by which the derivatives of two sides may differ and be one."""

NOTHING = 1e-12
"""Difference of two numbers, SI, that is rounding."""


@frozen
class InputTick:
    """One tick of an input within the period: the number of the input, and ticks of the base rate since its begin."""

    entry: int
    after: int


@frozen
class PeriodMap:
    """The linearised period of one case: x+ = A x + B u of small changes, y = C x + D u at its begin.

    tick      of the base rate, at which the period begins;  seconds: its length
    states    names of x: cells, a body's turn by its coordinate
    ticks     names of u: each tick of each input by itself
    outputs   names of y
    A, B      [state, state], [state, tick];  C, D: [output, state], [output, tick]
    Wx, Wu    what the inputs themselves come to at each of their ticks, by states and by what is added: [tick, ...]
    held      names of what sticks, and of joints that are locked;  locked: these alone
    at_limit  paths of the limits that it is at, all the time
    """

    tick: int
    seconds: float
    states: tuple[str, ...]
    ticks: tuple[InputTick, ...]
    outputs: tuple[str, ...]
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    Wx: np.ndarray
    Wu: np.ndarray
    held: tuple[str, ...]
    at_limit: tuple[str, ...]
    locked: tuple[str, ...] = ()


def at_instant(program: PeriodProgram, case: int, tick: int) -> Flow:
    """A case at an instant, from which a period goes on: as the run has it there. Raises Problem D371."""
    (flow,) = at_instants(program, engine.inputs(program.experiment, np.array([case])), tick)
    if flow is None:
        raise failed(program.experiment, tick)
    return flow


def at_instants(
    program: PeriodProgram, given: np.ndarray, tick: int, threads: int | None = None
) -> Iterator[Flow | None]:
    """Cases at an instant, one after the other; None for one that has failed before. given: the program's inputs,
    [case, input]."""
    prepared = program.prepared
    failure, cells = prepared.program.outputs.index("failure"), prepared.recording.cells
    for at in range(0, len(given), ABREAST):
        some = given[at : at + ABREAST]
        if tick:
            _, outputs, memory = run_past(
                prepared.kernel, some, tick - 1, [tick - 1], record=False, threads=threads
            )  # fmt: skip
        for place, row in enumerate(some):
            inputs = dict(zip(prepared.program.inputs, row.tolist(), strict=True))
            if not tick:
                flow = Flow(program, inputs, {}, 0)
                flow.begin()
                yield flow
            elif outputs[place, failure] != 0.0:
                yield None
            else:
                yield _gone_on(program, inputs, dict(zip(cells, memory[place, 0].tolist(), strict=True)), tick)


def _gone_on(program: PeriodProgram, inputs: Mapping[str, float], cells: Mapping[str, float], tick: int) -> Flow:
    """The flow from a memory at the end of the tick before, to where the step is finished that ends at this one."""
    if lost := program.remembered - cells.keys():
        raise ValueError(f"the run keeps no {sorted(lost)}, which a period begins with")
    flow = Flow(program, inputs, cells, tick - 1)
    flow.finish()
    return flow


def failed(experiment: Experiment, tick: int) -> Problem:
    """The refusal of an instant that a run does not come to."""
    time = tick / experiment.structure.schedule.base_hz
    return Problem(
        error(
            "D371",
            f"`{experiment.name}` has failed before t = {time:.6g} s, so there is nothing to linearise",
            experiment.place,
            help="`met run` says when and why; ask at an instant before that, `--at`",
        )
    )


def period_map(program: PeriodProgram, flow: Flow) -> PeriodMap:
    """The linearised period that begins where the flow stands. Raises Problem D370 where an event is on the way."""
    start = flow.copy()
    flow = start.copy()
    flow.ticks()
    locked = start.locked()
    rates = held_rates(start)
    held = (*(name for name, mode in flow.modes().items() if mode == 0.0), *rates.values(), *locked)
    if going := flow.breaking_away():
        raise flow.event(f"{listed(going)} {'breaks' if len(going) == 1 else 'break'} away")
    stuck = {f"{name}.{part}" for name in held for part in ("q", "qd")} | {*held, *rates}
    states = tuple(name for name in program.states if name not in stuck)
    ticks = tuple(
        InputTick(number, after)
        for number, each in enumerate(program.inputs)
        for after in range(0, program.ticks, each.divisor)
    )
    carried = partial(_carried, program, start, states, ticks)
    found = carried({})
    if found.edges:
        _refuse_kinks(found, carried)
    for each in (found.A, found.C, found.Wx, found.B, found.D, found.Wu):
        if not np.isfinite(each).all():
            raise start.event("a derivative is no number")
    return PeriodMap(
        start.tick, program.seconds, states, ticks, program.columns,
        found.A, found.B, found.C, found.D, found.Wx, found.Wu, held, found.at_limit, locked,
    )  # fmt: skip


@frozen
class _Carried:
    """A period carried out with tangents, as `PeriodMap` has them.

    ends   states at its end, and what is recorded at its begin;  edges: the kinks that it stood on
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    Wx: np.ndarray
    Wu: np.ndarray
    ends: np.ndarray
    at_limit: tuple[str, ...]
    edges: tuple[Edge, ...]
    flow: Flow

    def differs(self, other: _Carried) -> bool:
        """True where the derivatives are others, or what they are the derivatives of."""
        if np.any(np.abs(self.ends - other.ends) > SAME * np.abs(self.ends) + NOTHING):
            return True
        pairs = ((self.A, other.A), (self.B, other.B), (self.C, other.C), (self.Wx, other.Wx), (self.Wu, other.Wu))
        for a, b in pairs:
            largest = np.max(np.abs(a), axis=1, keepdims=True, initial=0.0)
            if not np.all(np.abs(a - b) <= SAME * np.maximum(largest, 1e-300)):
                return True
        return False


def _carried(
    program: PeriodProgram,
    start: Flow,
    states: Sequence[str],
    ticks: Sequence[InputTick],
    opposite: Mapping[int, frozenset[int]],
) -> _Carried:
    flow, n, m = start.copy(), len(states), len(ticks)
    unit = np.eye(n + m)
    flow.opposite = opposite
    flow.tangents = seeds(program, flow, states, n + m)
    W, modes, limits = np.zeros((m, n + m)), None, list[dict[str, float]]()
    for after in range(program.ticks):
        for place, each in enumerate(ticks):
            cell = added(program.inputs[each.entry].path)
            if each.after == after:
                flow.tangents[cell] = unit[n + place]
        flow.ticks(recording=after == 0)
        for place, each in enumerate(ticks):
            path = program.inputs[each.entry].path
            if each.after == after:
                flow.tangents.pop(added(path))
                W[place] = flow.tangent(path)
        if modes is None:
            modes = flow.modes()
        elif flow.modes() != modes:
            now = flow.modes()
            changed = [f"`{name}` {_became(now[name])}" for name in now if now[name] != modes.get(name)]
            raise flow.event(", ".join(changed))
        before = flow.limits()
        flow.finish()
        limits.append({path: count - before[path] for path, count in flow.limits().items()})
        limits[-1] = limits[-1] if flow.tick % program.schedule.dynamics == 0 else {}
    at_limit = _at_all(flow, [each for each in limits if each])
    ends = end_tangents(program, flow, states, n + m)
    numbers = np.array([flow.cells[each] for each in states if each in flow.cells] + list(flow.rows.values()))
    rows = np.zeros((len(program.columns), n + m))
    for column, move in flow.row_tangents.items():
        rows[column] = move
    return _Carried(
        ends[:, :n],
        ends[:, n:],
        rows[:, :n],
        rows[:, n:],
        W[:, :n],
        W[:, n:],
        numbers,
        at_limit,
        tuple(flow.edges),
        flow,
    )


def seeds(program: PeriodProgram, flow: Flow, states: Sequence[str], width: int) -> dict[str, np.ndarray]:
    """Tangents of cells, of which each state is a direction."""
    unit, found = np.eye(len(states), width), dict[str, np.ndarray]()
    places = {name: unit[place] for place, name in enumerate(states)}
    for body in program.bodies:
        turns = np.array([places[f"{name}.q"] for name in body.coordinates[3:]])
        w, x, y, z = (flow.cells[cell] for cell in body.orientation)
        moves = 0.5 * np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) @ turns
        found |= dict(zip(body.orientation, moves, strict=True))
    found |= {name: move for name, move in places.items() if name not in program.turns}
    return found


def end_tangents(program: PeriodProgram, flow: Flow, states: Sequence[str], width: int) -> np.ndarray:
    """The tangents of the states where a flow stands: [state, direction]."""
    found: dict[str, Any] = {name: flow.tangent(name) for name in states}
    for body in program.bodies:
        moves = np.array([np.broadcast_to(flow.tangent(cell), width) for cell in body.orientation])
        w, x, y, z = (flow.cells[cell] for cell in body.orientation)
        turns = 2.0 * np.array([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]) @ moves
        found |= {f"{name}.q": turn for name, turn in zip(body.coordinates[3:], turns, strict=True)}
    return np.array([np.broadcast_to(found[name], width) for name in states]).reshape(len(states), width)


def _became(mode: float) -> str:
    return "comes to rest" if mode == 0.0 else "breaks away"


def _at_all(flow: Flow, limits: Sequence[Mapping[str, float]]) -> tuple[str, ...]:
    """The limits at which every step of the period begins. Raises Problem where one is reached or left within it."""
    counts = {path: sum(each[path] > 0.0 for each in limits) for path in (limits[0] if limits else ())}
    for path, count in counts.items():
        if 0 < count < len(limits):
            raise flow.event(f"`{path}` is reached or left")
    return tuple(path for path, count in counts.items() if count)


def _refuse_kinks(found: _Carried, carried: Any) -> None:
    """Raises Problem where the derivative is another from the other side of a kink that the memory stands on."""
    if not found.differs(carried(_all(found.edges))):
        return
    for edge in found.edges:
        if found.differs(carried(_all([edge]))):
            raise found.flow.event(f"{edge.subject} is just where something begins to act", edge.tick)
    raise found.flow.event("several numbers are just where something begins to act", found.edges[0].tick)


def _all(edges: Sequence[Edge]) -> dict[int, frozenset[int]]:
    found: dict[int, frozenset[int]] = {}
    for edge in edges:
        found[edge.run] = found.get(edge.run, frozenset()) | frozenset(edge.nodes)
    return found
