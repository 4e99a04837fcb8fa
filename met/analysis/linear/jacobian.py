"""The exact Jacobian of a program over one period, by its states and its inputs.

A sticking joint stays at rest under small changes, so its position and rate are no states. Across an event there is no
derivative, and none is given: where something comes to rest or breaks away, where a limit is reached or left, and where
the memory stands on a kink whose other side has another derivative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial, reduce
from operator import and_, or_
from typing import Any

import numpy as np

from met.analysis.linear.abreast import FlowAbreast, alike, of_case, together
from met.analysis.linear.flow import Edge, Flow, added, listed
from met.analysis.linear.period import PeriodProgram
from met.analysis.linear.shafts import held_rates, shaft_rates
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import Experiment

SAME = 1e-9
"""Share of the largest number of its row by which derivatives from the two sides may differ and count as equal."""

NOTHING = 1e-12
"""Difference of two numbers, SI, that counts as rounding."""


@frozen
class InputTick:
    """One tick of an input within the period: the number of the input, and ticks of the base rate since its begin."""

    entry: int
    after: int


@frozen
class PeriodMatrices:
    """The linearised period of a case: x+ = A x + B u of small changes, y = C x + D u at its begin.

    tick      of the base rate, at which the period begins
    states    names of x: cells, a body's turn by its coordinate
    ticks     names of u: each tick of each input by itself
    A, B      [state, state], [state, tick];  C, D: [output, state], [output, tick]
    Wx, Wu    what the inputs themselves come to at each of their ticks, by states and by what is added: [tick, ...]
    """

    tick: int
    states: tuple[str, ...]
    ticks: tuple[InputTick, ...]
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    Wx: np.ndarray
    Wu: np.ndarray


@frozen
class PeriodMap(PeriodMatrices):
    """The linearised period of one case, of which it is known what holds.

    seconds   length of the period
    outputs   names of y
    held      names of what sticks, and of joints that are locked;  locked: these alone
    at_limit  paths of the limits that it is at, all the time
    """

    seconds: float
    outputs: tuple[str, ...]
    held: tuple[str, ...]
    at_limit: tuple[str, ...]
    locked: tuple[str, ...] = ()


def at_instants(
    program: PeriodProgram, case_inputs: np.ndarray, tick: int, threads: int | None = None
) -> list[Flow | None]:
    """Cases at an instant; None for one that has failed before. case_inputs: the program's inputs, [case, input]."""
    prepared = program.prepared
    inputs = [dict(zip(prepared.program.inputs, row, strict=True)) for row in case_inputs.tolist()]
    if not tick:
        return [*together([Flow(program, values, {}, 0) for values in inputs], Flow.begin)]
    from met.passing import run_past

    _, outputs, memory = run_past(
        prepared.kernel, case_inputs, tick - 1, [tick - 1], record=False, threads=threads
    )  # fmt: skip
    cells = prepared.recording.cells
    if len(case_inputs) and (lost := program.remembered - set(cells)):
        raise ValueError(f"the run keeps no {sorted(lost)}, which a period begins with")
    done = np.flatnonzero(outputs[:, prepared.program.outputs.index("failure")] == 0.0).tolist()
    before = [
        Flow(program, inputs[k], dict(zip(cells, memory[k, 0].tolist(), strict=True)), tick - 1) for k in done
    ]  # fmt: skip
    flows: list[Flow | None] = [None] * len(case_inputs)
    for place, flow in zip(done, together(before, Flow.finish), strict=True):
        flows[place] = flow
    return flows


def failed(experiment: Experiment, tick: int) -> Problem:
    """The refusal of an instant that a run does not reach."""
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
    after = flow.copy()
    after.ticks()
    held = _held(flow, after)
    carried = partial(_carried, flow.copy, held.states)
    period = carried({})
    if period.flow.edges:
        _refuse_kinks(period, carried)
    if not period.finite:
        raise flow.event("a derivative is no number")
    return period.map_of(held)


def period_maps(program: PeriodProgram, flows: Sequence[Flow]) -> list[PeriodMap | Problem]:
    """The linearised periods that begin where these flows stand, all at one tick: each is the map of `period_map`, or
    the Problem that it raises, to the bit. Flows with the same held states are carried side by side; one with an event
    or a kink on the way is linearised alone."""
    answers: list[PeriodMap | Problem | None] = [None] * len(flows)
    helds = list[_Held | None]()
    for place, (flow, after) in enumerate(zip(flows, together(flows, Flow.ticks), strict=True)):
        try:
            helds.append(_held(flow, after))
        except Problem as refused:
            helds.append(None)
            answers[place] = refused
    for states, places in alike(None if held is None else held.states for held in helds):
        if states is not None and len(places) > 1:
            maps = _side_by_side([flows[k] for k in places], states, [held for k in places if (held := helds[k])])
            for place, answer in zip(places, maps, strict=True):
                answers[place] = answer
    return [
        _by_itself(program, flow) if answer is None else answer for flow, answer in zip(flows, answers, strict=True)
    ]


def _side_by_side(flows: Sequence[Flow], states: tuple[str, ...], helds: Sequence[_Held]) -> Iterator[PeriodMap | None]:
    """The maps of flows with the same held states; None for one that has to be linearised alone."""
    carried = partial(_carried, partial(FlowAbreast.of, flows), states)
    period = carried({})
    flow: Any = period.flow
    unusual = flow.unusual | ~period.finite
    if flow.on_kink.any():
        other = carried(flow.kinks)
        # where one jumps at a kink others may be led another way: its kinks are then not those of the other side
        led: Any = other.flow
        astray = led.unusual | (led.sections_run != flow.sections_run)
        unusual = unusual | (flow.on_kink & (astray | period.differs(other)))
    for place, held in enumerate(helds):
        yield None if unusual[place] else period.map_of(held, place)


def _by_itself(program: PeriodProgram, flow: Flow) -> PeriodMap | Problem:
    """The linearised period of a case alone, or the Problem in its place."""
    try:
        return period_map(program, flow)
    except Problem as refused:
        return refused


@frozen
class _Held:
    """Names of the states that are held in a case where a period begins, of the locked joints among them, and of all
    others."""

    held: tuple[str, ...]
    locked: tuple[str, ...]
    states: tuple[str, ...]


def _held(start: Flow, after: Flow) -> _Held:
    """The states that friction, locked servos or standing shafts hold where a period begins. after: the flow behind its
    first ticks. Raises Problem where something breaks away."""
    locked, rates = start.locked(), held_rates(start)
    held = (*(name for name, mode in after.modes().items() if mode == 0.0), *rates.values(), *locked)
    if going := after.breaking_away():
        raise after.event(f"{listed(going)} {'breaks' if len(going) == 1 else 'break'} away")
    stuck = {f"{name}.{part}" for name in held for part in ("q", "qd")} | {*held, *rates}
    return _Held(held, locked, tuple(name for name in start.program.states if name not in stuck))


@frozen
class _Carried(PeriodMatrices):
    """A period carried out with tangents; of a `FlowAbreast`, each matrix is [case, ...].

    numbers   states at its end, and what is recorded at its begin
    at_limit  paths of limits, with the number of steps that begin at them;  flow: at the end
    """

    numbers: np.ndarray
    at_limit: Mapping[str, Any]
    flow: Flow

    def _matrices(self) -> tuple[np.ndarray, ...]:
        return self.A, self.B, self.C, self.Wx, self.Wu, self.D

    @property
    def finite(self) -> Any:
        """True where all numbers are finite."""
        return reduce(and_, (np.isfinite(matrix).all((-2, -1)) for matrix in self._matrices()))

    def differs(self, other: _Carried) -> Any:
        """True where the derivatives differ: of states, of inputs, of outputs by states, or the cells that they belong
        to."""
        *pairs, _ = zip(self._matrices(), other._matrices(), strict=True)
        jumps = np.any(np.abs(self.numbers - other.numbers) > SAME * np.abs(self.numbers) + NOTHING, axis=-1)
        return reduce(or_, (_differ(a, b) for a, b in pairs), jumps)

    def map_of(self, held: _Held, place: int | None = None) -> PeriodMap:
        """The map; of a `FlowAbreast`, that of the case at a place."""
        program, own = self.flow.program, [matrix if place is None else matrix[place] for matrix in self._matrices()]
        A, B, C, Wx, Wu, D = own
        at_limit = tuple(path for path, steps in self.at_limit.items() if of_case(steps, place or 0))
        return PeriodMap(
            self.tick, self.states, self.ticks, A, B, C, D, Wx, Wu, program.seconds, program.columns,
            held.held, at_limit, held.locked,
        )  # fmt: skip


def _differ(a: np.ndarray, b: np.ndarray) -> Any:
    """True where some entry of two matrices differs by more than the rounding error of its row."""
    largest = np.max(np.abs(a), axis=-1, keepdims=True, initial=0.0)
    return ~np.all(np.abs(a - b) <= SAME * np.maximum(largest, 1e-300), axis=(-2, -1))


def _carried(begin: Callable[[], Flow], states: tuple[str, ...], opposite: Mapping[int, Any]) -> _Carried:
    """Carry a period from where a flow begins. opposite: as for the flow"""
    flow = begin()
    program, tick, n = flow.program, flow.tick, len(states)
    ticks = tuple(
        InputTick(number, after)
        for number, signal in enumerate(program.inputs)
        for after in range(0, program.ticks, signal.divisor)
    )
    width = n + len(ticks)
    unit = np.eye(width)
    flow.opposite = opposite
    flow.tangents = seeds(program, flow, states, width)
    W: list[Any] = [0.0] * len(ticks)
    modes: dict[str, float] | None = None
    at_limit, steps = dict[str, Any](), 0
    for after in range(program.ticks):
        for place, pulse in enumerate(ticks):
            if pulse.after == after:
                flow.tangents[added(program.inputs[pulse.entry].path)] = unit[n + place]
        turned = shaft_rates(flow)
        flow.ticks(recording=after == 0)
        for place, pulse in enumerate(ticks):
            path = program.inputs[pulse.entry].path
            if pulse.after == after:
                flow.tangents.pop(added(path))
                W[place] = flow.tangent(path)
        now = flow.modes()
        modes = now if modes is None else modes
        flow.refuse(reduce(or_, (now[name] != modes[name] for name in now), False), partial(_changed, now, modes))
        before = flow.limits()
        flow.finish()
        for joint, rate in shaft_rates(flow).items():
            stopped = (turned[joint] != 0.0) & (turned[joint] * rate <= 0.0)
            flow.refuse(stopped, partial("the shaft of the bed of `{}` stops, or turns back".format, joint))
        if flow.tick % program.schedule.dynamics == 0:
            steps += 1
            for path, count in flow.limits().items():
                at_limit[path] = at_limit.get(path, 0) + (count - before[path] > 0.0)
    for path, count in at_limit.items():
        flow.refuse((count > 0) & (count < steps), partial("`{}` is reached or left".format, path))
    ends = end_tangents(program, flow, states, width)
    rows = tangent_rows(flow, [flow.row_tangents.get(column, 0.0) for column in range(len(program.columns))], width)
    own = tangent_rows(flow, W, width)
    reached = [flow.cells[state] for state in states if state in flow.cells] + list(flow.rows.values())
    numbers = np.concatenate([np.broadcast_to(number, (*flow.shape, 1)) for number in (*reached, 0.0)], axis=-1)
    return _Carried(
        tick, states, ticks, ends[..., :n], ends[..., n:], rows[..., :n], rows[..., n:], own[..., :n], own[..., n:],
        numbers, at_limit, flow,
    )  # fmt: skip


def tangent_rows(flow: Flow, moves: Sequence[Any], width: int) -> np.ndarray:
    """Tangents as rows, [row, direction], of a `FlowAbreast` [case, row, direction]. Zeros have no sign, so that the
    result does not depend on which cases were carried together."""
    rows = [np.broadcast_to(move, (*flow.shape, width)) for move in moves]
    return np.stack(rows, axis=-2) + 0.0 if rows else np.zeros((*flow.shape, 0, width))


def seeds(program: PeriodProgram, flow: Flow, states: Sequence[str], width: int) -> dict[str, np.ndarray]:
    """Tangents of cells, with one direction for each state."""
    unit, tangents = np.eye(len(states), width), dict[str, np.ndarray]()
    places = {name: unit[place] for place, name in enumerate(states)}
    for body in program.bodies:
        a, b, c = (places[f"{name}.q"] for name in body.coordinates[3:])
        w, x, y, z = (flow.cells[cell] for cell in body.orientation)
        moves = (-x * a - y * b - z * c, w * a - z * b + y * c, z * a + w * b - x * c, x * b - y * a + w * c)
        tangents |= {cell: 0.5 * move for cell, move in zip(body.orientation, moves, strict=True)}
    tangents |= {name: move for name, move in places.items() if name not in program.turns}
    return tangents


def end_tangents(program: PeriodProgram, flow: Flow, states: Sequence[str], width: int) -> np.ndarray:
    """The tangents of the states where a flow stands: [state, direction], of a `FlowAbreast` [case, ...]."""
    tangents: dict[str, Any] = {name: flow.tangent(name) for name in states}
    for body in program.bodies:
        a, b, c, d = (flow.tangent(cell) for cell in body.orientation)
        w, x, y, z = (flow.cells[cell] for cell in body.orientation)
        turns = (w * b - x * a + z * c - y * d, w * c - y * a - z * b + x * d, y * b - z * a - x * c + w * d)
        tangents |= {f"{name}.q": 2.0 * turn for name, turn in zip(body.coordinates[3:], turns, strict=True)}
    return tangent_rows(flow, [tangents[name] for name in states], width)


def _changed(now: Mapping[str, float], before: Mapping[str, float]) -> str:
    return ", ".join(f"`{name}` {_became(now[name])}" for name in now if now[name] != before[name])


def _became(mode: float) -> str:
    return "comes to rest" if mode == 0.0 else "breaks away"


def _refuse_kinks(period: _Carried, carried: Any) -> None:
    """Raises Problem where the derivative is another from the other side of a kink that the memory stands on."""
    if not period.differs(carried(_all(period.flow.edges))):
        return
    for edge in period.flow.edges:
        if period.differs(carried(_all([edge]))):
            raise period.flow.event(f"{edge.subject} is just where something begins to act", edge.tick)
    raise period.flow.event("several numbers are just where something begins to act", period.flow.edges[0].tick)


def _all(edges: Sequence[Edge]) -> dict[int, frozenset[int]]:
    """The nodes of all these kinks, by the number of the section's run in the period."""
    nodes_by_run: dict[int, frozenset[int]] = {}
    for edge in edges:
        nodes_by_run[edge.run] = nodes_by_run.get(edge.run, frozenset()) | frozenset(edge.nodes)
    return nodes_by_run
