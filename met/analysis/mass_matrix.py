"""The mass matrix of an arm at poses of its range, and whether it is positive definite there.

What an arm moves by is its mass matrix, rotors included: links whose numbers are an identified set need be no bodies,
but where their mass matrix is not positive definite a joint moves against its torque, or without end.

    M = sum over bodies J' I J + rotors,    T = qd' M qd/2

A free base adds its six velocities. Payloads that come or go are left out: with them M is larger.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from met.backends.reference.plain import begun
from met.dynamics.coupling import Ratios
from met.dynamics.kinematics import fixed_motion, joint_rates, link_motions
from met.dynamics.spatial import ZERO, Vector, add, apply_symmetric, cross, scale, sub
from met.dynamics.tree import Tree
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan import Experiment
from met.program.build import Builder
from met.program.system import System
from met.run import inputs
from met.trace.program import Program

POINTS = 256
"""Number of poses within the range besides the start and the ends."""

LEAST = 1e-12
"""Smallest eigenvalue that counts as above 0, of the matrix scaled to ones on its diagonal, whose largest is between 1
and n: rounding leaves some n 1e-16, and below this hardly a digit of an acceleration would be right."""

CURED = 1e-6
"""Least eigenvalue, likewise, that a remedy leaves, as poses between those that are looked at have one that is less."""

LARGER = tuple(digits * 10.0 ** (power - 1) for power in range(-9, 4) for digits in range(10, 100))
"""Amounts by which a moment of inertia is made larger in search of a remedy, kg m^2: numbers of two digits."""


@frozen
class Definiteness:
    """The answer to whether the mass matrices of some cases are positive definite.

    poses    number of poses that were looked at, in all cases
    least    the least eigenvalue at any of them, of the matrix scaled to ones, or -1, on its diagonal
    case, q  where that is: row of the case table, position of each joint, rad (m)
    remedy   where it is not above 0: an amount, kg m^2, a link, and its moment "xx", "yy" or "zz", which made larger by
             that leaves no pose so; None where no one moment does
    """

    poses: int
    least: float
    case: int
    q: tuple[float, ...]
    remedy: tuple[float, str, str] | None = None


def definiteness(experiment: Experiment, cases: Sequence[int]) -> Definiteness:
    """The definiteness of the mass matrix of these cases at the start, with all joints at the lower ends of their
    ranges, at the upper ends, and at points spread over the ranges.

    The range of a joint is that of its limits, else a full turn; a prismatic joint without limits stays where it
    starts. Raises Problem where the program cannot be built.
    """
    builder = Builder(System(experiment))
    program = builder.program()
    arms = [_posed(builder, program, values) for values in inputs(experiment, np.array(cases))]
    matrices = np.concatenate([case_matrices for _, case_matrices, _ in arms])
    size = np.abs(np.diagonal(matrices, axis1=1, axis2=2))
    root = np.sqrt(np.where(size > 0.0, size, 1.0))
    scaled = np.nan_to_num(matrices / (root[:, :, None] * root[:, None, :]), posinf=0.0, neginf=0.0)
    least = np.linalg.eigvalsh(scaled)[:, 0]
    worst = int(np.argmin(least))
    poses = [(case, tuple(q)) for case, (arm_poses, _, _) in zip(cases, arms, strict=True) for q in arm_poses.tolist()]
    if least[worst] > LEAST:
        return Definiteness(len(poses), float(least[worst]), *poses[worst])
    turns = {link: np.concatenate([turn[link] for _, _, turn in arms]) / root[..., None] for link in arms[0][2]}
    return Definiteness(len(poses), float(least[worst]), *poses[worst], _remedy(scaled, turns))


def _remedy(matrices: np.ndarray, turns: Mapping[str, np.ndarray]) -> tuple[float, str, str] | None:
    """The smallest amount that, added to one moment of one link, makes all matrices, [pose, n, n], positive definite.

    turns  of each link, [pose, n, axis]: its angular velocity for each unit velocity, scaled as the matrices
    """
    remedies = []
    for (link, turn), (axis, moment) in product(turns.items(), enumerate(("xx", "yy", "zz"))):
        outer = turn[:, :, None, axis] * turn[:, None, :, axis]
        # adding more never makes an eigenvalue smaller
        place = bisect_right(LARGER, CURED, key=lambda x, outer=outer: np.linalg.eigvalsh(matrices + x * outer).min())  # type: ignore[misc]
        if place < len(LARGER):
            remedies.append((LARGER[place], link, moment))
    return min(remedies, default=None)


def _posed(
    builder: Builder, program: Program, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """An arm in a case of these inputs: its poses [pose, joint], each once, its mass matrices there, and the angular
    velocity of each lumped link in its axes for each unit velocity, [pose, direction, axis]."""
    system, tape = builder.system, begun(program, dict(zip(program.inputs, values, strict=True)))
    with np.errstate(all="ignore"):
        solved = builder.step.observed(tape).derivative.solved
    start = [float(tape.read(f"{joint.name}.q")) for joint in system.joints]
    low, high, end = np.array([start] * 3)
    for i, joint in enumerate(system.joints):
        if "q_min" in joint.limits:
            low[i], high[i], end[i] = (system.value(f"{joint.name}.q_{x}", tape.read) for x in ("min", "max", "max"))
        elif joint.kind == "revolute":
            low[i], high[i], end[i] = start[i] - math.pi, start[i] + math.pi, start[i] - math.pi
    poses = np.vstack([start, low, end, low + (high - low) * _spread(len(start))])
    placed: Any = system.followed(tape.read, Motion(tuple(poses.T), tuple(poses.T))).q
    q = (
        np.array(list(dict.fromkeys(zip(*(column.tolist() for column in placed), strict=True))))
        if placed
        else poses[:1]
    )
    q = q[np.isfinite(q).all(axis=1)]  # a loop closes in some poses alone
    tree = system.tree(tape.read).map_numbers(lambda _, value: float(value))
    columns, qd, base = _unit_velocities(tree, q)
    motions = link_motions(tree, columns, qd, base_velocity=base)
    lumped = [link.name for link in system.structure.links if link.lumped]
    turns = {link: _stacked(motions[link].w, (len(q), _size(tree))) for link in lumped}
    matrices = mass_matrices(tree, q, *(list(map(float, inertias)) for inertias in (solved.rotor, solved.spin)))
    free = _independent(system.ratios(tape.read, q.T), _size(tree), len(q))
    back = free.transpose(0, 2, 1)
    return q, back @ matrices @ free, {link: back @ turn for link, turn in turns.items()}


def _independent(ratios: Ratios, size: int, poses: int) -> np.ndarray:
    """The velocities of a free base and of all joints, [pose, velocity, independent one], for unit velocities of the
    base and of the joints that follow none. size: number of all"""
    rows = np.tile(np.eye(size), (poses, 1, 1))
    before = size - len(ratios)
    for i, row in enumerate(ratios):
        if row:
            rows[:, before + i] = 0.0
            for j, ratio in row.items():
                rows[:, before + i, before + j] = ratio
    return rows[
        ..., [j for j in range(size) if j < before or not ratios[j - before] or j - before in ratios[j - before]]
    ]


def _spread(joints: int) -> np.ndarray:
    """Points of the unit cube, [point, joint], of the sequence of M. Roberts ("The unreasonable effectiveness of
    quasirandom sequences", 2018): multiples of powers of 1/phi, phi^(n+1) = phi + 1, which leave no large gaps."""
    phi = 1.0
    for _ in range(60):
        phi = (1.0 + phi) ** (1.0 / (joints + 1))
    return (0.5 + np.outer(np.arange(1, POINTS + 1), phi ** -np.arange(1.0, joints + 1))) % 1.0


def mass_matrices(tree: Tree, q: np.ndarray, rotor: Sequence[float], spin: Sequence[float]) -> np.ndarray:
    """The mass matrix at each pose, [pose, n, n]: of the joints, and before them of a free base's angular and linear
    velocity in its own axes.

    q  [pose, joint], rad (m);  rotor, spin  by joint, as in `recursion.solve`
    """
    columns, qd, base = _unit_velocities(tree, q)
    shape = (len(q), _size(tree))
    rates = list(joint_rates(tree, tree.transforms(columns), qd, base))
    bodies = [joint.body for joint in tree.joints]
    matrices = np.zeros((*shape, shape[1]))
    for i, joint in enumerate(tree.joints):
        k = i - len(bodies)
        matrices[:, k, k] += rotor[i]
        of_link = _stacked(rates[i][0], shape)[:, :, 2] - (qd[i] if joint.kind == "revolute" else 0.0)
        matrices[:, k, :] += spin[i] * of_link
        matrices[:, :, k] += spin[i] * of_link
    if tree.floating is not None:
        bodies.append(tree.floating.body)
        rates.append(fixed_motion(base, tree.base))
    for (m, h, I), (w, v) in zip(bodies, rates, strict=True):  # noqa: E741
        for rate, momentum in ((w, add(apply_symmetric(I, w), cross(h, v))), (v, sub(scale(m, v), cross(h, w)))):
            matrices += np.einsum("pax,pbx->pab", _stacked(rate, shape), _stacked(momentum, shape))
    return matrices


def _size(tree: Tree) -> int:
    """The number of velocities: of the joints, and six of a free base."""
    return len(tree.joints) + 6 * (tree.floating is not None)


def _unit_velocities(tree: Tree, q: np.ndarray) -> tuple[list[Any], list[Any], tuple[Vector, Vector]]:
    """Positions of the joints, [pose, 1] each; their rates, [direction] each, and the base's angular and linear
    velocity, where each direction is one unit velocity of all."""
    units: Any = list(np.eye(_size(tree)))
    base = (ZERO, ZERO) if tree.floating is None else (tuple(units[:3]), tuple(units[3:6]))
    return [column[:, None] for column in q.T], units[len(units) - len(tree.joints) :], base


def _stacked(vector: Vector, shape: tuple[int, int]) -> np.ndarray:
    """A vector of numbers and arrays as one array [pose, direction, axis]."""
    return np.stack([np.broadcast_to(np.asarray(x, float), shape) for x in vector], axis=-1)
