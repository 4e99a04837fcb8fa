"""The arm without its computers, in continuous time: dx/dt = A x + B u, u being what computers hold."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from met.analysis.linear.flow import Flow
from met.analysis.linear.jacobian import seeds
from met.analysis.linear.period import PeriodProgram
from met.frozen import frozen
from met.program import cell_names


@frozen
class PlantModel:
    """Slopes of the arm's states by these and by what its computers hold: A [state, state], 1/s; B [state, input]."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    A: np.ndarray
    B: np.ndarray


def plant(program: PeriodProgram, flow: Flow, kept: Sequence[str]) -> PlantModel:
    """The plant where a flow stands, before its computers tick there; kept: states, of which those of the arm are its
    own."""
    step = program.builder.step
    arm = {*program.positions, *program.rates, *step.states}
    states = tuple(name for name in kept if name in arm)
    now = flow.copy()
    now.ticks()
    inputs = tuple(
        f"{actuator.path}.{output.name}"
        for actuator in program.system.working
        if actuator.ticks
        for output in actuator.parts.outputs
    )
    n, width = len(states), len(states) + len(inputs)
    now.tangents = {name: move for name, move in seeds(program, now, states, width).items() if name not in inputs}
    unit = np.eye(width)
    for place, path in enumerate(inputs):
        now.tangents[path] = now.tangents[cell_names.FIRST(path)] = unit[n + place]
    moves: dict[str, Any] = dict(now.tangents)
    (number,) = (k for k, each in enumerate(program.recording.sections) if each.name == "derive")
    now.run(number)
    slopes: dict[str, Any] = {}
    for name in step.coordinates:
        slopes[f"{name}.q"] = moves.get(f"{name}.qd", 0.0)
        slopes[f"{name}.qd"] = now.tangent(f"{name}.qdd")
    for name in step.states:
        slopes[name] = now.tangent(cell_names.SLOPE(name))
    for body in program.bodies:  # of a small turn theta from how it turns: d(theta)/dt = dw + theta x w
        w = [now.cells[f"{name}.qd"] for name in body.coordinates[3:]]
        theta, dw = ([unit[states.index(f"{name}.{part}")] for name in body.coordinates[3:]] for part in ("q", "qd"))
        for k, name in enumerate(body.coordinates[3:]):
            i, j = (k + 1) % 3, (k + 2) % 3
            slopes[f"{name}.q"] = dw[k] + theta[i] * w[j] - theta[j] * w[i]
    rows = np.array([np.broadcast_to(slopes[name], width) for name in states]).reshape(n, width)
    return PlantModel(states, inputs, rows[:, :n], rows[:, n:])
