"""The arm without its computers, in continuous time: dx/dt = A x + B u, with u the outputs that computers hold."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from met.analysis.linear.abreast import alike, side_by_side
from met.analysis.linear.flow import Flow, derive
from met.analysis.linear.jacobian import seeds, tangent_rows
from met.analysis.linear.period import PeriodProgram
from met.frozen import frozen
from met.program import cells


@frozen
class PlantModel:
    """Slopes of the arm's states by themselves and by the computers' outputs: A [state, state], 1/s; B [state,
    input]."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    A: np.ndarray
    B: np.ndarray

    def first_bending(self, springs: Collection[str]) -> float:
        """The frequency of the slowest mode in which one of these springs of booms turns most while the joints that
        computers move are held, Hz; infinite where none swings.

        A joint is held by the output of its computer that keeps its acceleration at 0: without the joint's own states,
        s x = A x + B u and 0 = C x + D u. These are the zeros from outputs to joints.
        """
        from scipy.linalg import eig

        if not springs:
            return math.inf
        held: dict[str, int] = {}
        for k, path in enumerate(self.inputs):
            joint = path.rpartition(".servo.")[0]
            if f"{joint}.qd" in self.states and self.B[:, k].any():
                held.setdefault(joint, k)
        free = [k for k, name in enumerate(self.states) if name.rpartition(".")[0] not in held]
        rows = [*free, *(self.states.index(f"{joint}.qd") for joint in held)]
        system = np.hstack([self.A[np.ix_(rows, free)], self.B[np.ix_(rows, [*held.values()])]])
        roots, moves = eig(system, np.diag([1.0] * len(free) + [0.0] * len(held)))
        sizes = np.abs(moves[: len(free)])
        turns = np.array([self.states[k].endswith(".q") for k in free], bool)
        own = np.array([self.states[k].removesuffix(".q") in springs for k in free], bool)
        most = sizes[own].max(axis=0, initial=0.0)
        swings = (most >= sizes[turns].max(axis=0, initial=0.0)) & (most > MOVES * sizes.max(axis=0, initial=0.0))
        return float(np.abs(roots[swings & (roots.imag > 0.0)]).min(initial=math.inf)) / (2.0 * math.pi)


MOVES = 1e-9
"""Share of the largest part of a mode up to which a spring's angle is rounding: the mode is one of filters alone."""


def plants(program: PeriodProgram, flows: Sequence[Flow], case_states: Sequence[Sequence[str]]) -> list[PlantModel]:
    """The arm's plant without its computers, dx/dt = A x + B u, where each of these flows (memories of cases at an
    instant) stands, before its computers tick there. case_states: the states of each; only those of the arm are
    used."""
    step, by_place = program.builder.step, dict[int, PlantModel]()
    arm = {*program.positions, *program.rates, *step.states}
    own = [tuple(name for name in names if name in arm) for names in case_states]
    inputs = tuple(
        f"{actuator.path}.{output.name}"
        for actuator in program.system.working
        if actuator.ticks
        for output in actuator.parts.outputs
    )
    for states, places in alike(own):
        A, B = _slopes(side_by_side([flows[k] for k in places]), states, inputs)
        for number, place in enumerate(places):
            by_place[place] = PlantModel(states, inputs, *((A, B) if A.ndim == 2 else (A[number], B[number])))
    return [by_place[place] for place in range(len(flows))]


def _slopes(now: Flow, states: tuple[str, ...], inputs: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """A and B where a flow stands; of a `FlowAbreast`, [case, ...] each."""
    program, n, width = now.program, len(states), len(states) + len(inputs)
    step = program.builder.step
    now.ticks()
    now.tangents = {name: move for name, move in seeds(program, now, states, width).items() if name not in inputs}
    unit = np.eye(width)
    for place, path in enumerate(inputs):
        now.tangents[path] = now.tangents[cells.FIRST(path)] = unit[n + place]
    moves: dict[str, Any] = dict(now.tangents)
    derive(now)
    slopes: dict[str, Any] = {}
    for name in step.coordinates:
        slopes[f"{name}.q"] = moves.get(f"{name}.qd", 0.0)
        slopes[f"{name}.qd"] = now.tangent(f"{name}.qdd")
    for name in step.states:
        slopes[name] = now.tangent(cells.SLOPE(name))
    for body in program.bodies:  # a small rotation theta changes by d(theta)/dt = dw + theta x w
        w = [now.cells[f"{name}.qd"] for name in body.coordinates[3:]]
        theta, dw = ([unit[states.index(f"{name}.{part}")] for name in body.coordinates[3:]] for part in ("q", "qd"))
        for k, name in enumerate(body.coordinates[3:]):
            i, j = (k + 1) % 3, (k + 2) % 3
            slopes[f"{name}.q"] = dw[k] + theta[i] * w[j] - theta[j] * w[i]
    rows = tangent_rows(now, [slopes[name] for name in states], width)
    return rows[..., :n], rows[..., n:]
