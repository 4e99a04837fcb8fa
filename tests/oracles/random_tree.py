"""Random arms and random instants, from a seed: print the seed, and anyone can make the same arm again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from met.dynamics.tree import Body


@dataclass(frozen=True)
class RandomArm:
    """Bodies in tree order, a state, and what acts on them. Entries of q .. rotor are for the moving joints."""

    seed: int
    bodies: tuple[Body, ...]
    q: tuple[float, ...]
    qd: tuple[float, ...]
    tau: tuple[float, ...]
    qdd: tuple[float, ...]
    mode: tuple[bool, ...]
    rotor: tuple[float, ...]
    gravity: tuple[float, float, float]
    wrenches: dict[str, tuple[tuple[float, ...], tuple[float, ...]]]

    @property
    def n(self) -> int:
        return len(self.q)


RIGHT_ANGLES = (0.0, math.pi / 2, -math.pi / 2, math.pi)


def random_tree(
    seed: int, moving: int | None = None, *, kinds: tuple[str, ...] = ("revolute", "prismatic")
) -> RandomArm:
    """An arm of 1 to 12 moving joints with fixed ones between, some of it with right angles and lined-up axes."""
    rng = np.random.default_rng(seed)
    moving = int(rng.integers(1, 13)) if moving is None else moving
    branching = rng.choice([0.0, 0.3, 0.8])
    square = rng.choice([0.0, 0.5, 1.0])
    bodies: list[Body] = []
    count = 0
    while count < moving:
        b = len(bodies)
        parent = int(rng.integers(-1, b)) if rng.random() < branching else b - 1
        kind = "fixed" if rng.random() < 0.2 else str(rng.choice(kinds, p=_weights(kinds)))
        count += kind != "fixed"
        bodies.append(_body(rng, b, kind, parent, rng.random() < square))
    n = moving

    def numbers(size: float) -> tuple[float, ...]:
        return tuple(float(x) for x in size * rng.standard_normal(n))

    wrenches = {body.name: (_vector(rng, 2.0), _vector(rng, 5.0)) for body in bodies if rng.random() < 0.4}
    rotor = tuple(float(x) for x in np.where(rng.random(n) < 0.5, 10.0 ** rng.uniform(-2, 2, n), 0.0))
    return RandomArm(
        seed,
        tuple(bodies),
        numbers(2.0),
        numbers(1.5),
        numbers(10.0),
        numbers(3.0),
        tuple(bool(x) for x in rng.random(n) < 0.6),
        rotor,
        _vector(rng, 6.0),
        wrenches,
    )


@cache
def random_trees() -> tuple[RandomArm, ...]:
    """300 arms of 1 to 30 moving joints, ten of each size, from seeds 1000 to 1299."""
    return tuple(random_tree(1000 + k, 1 + k % 30) for k in range(300))


def _weights(kinds: tuple[str, ...]) -> list[float]:
    return [1.0] if len(kinds) == 1 else [0.75, 0.25]


def _vector(rng: np.random.Generator, size: float) -> tuple[float, float, float]:
    x, y, z = (float(e) for e in size * rng.standard_normal(3))
    return (x, y, z)


def _body(rng: np.random.Generator, number: int, kind: str, parent: int, square: bool) -> Body:
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    at, rpy = _vector(rng, 0.5), tuple(float(x) for x in rng.uniform(-math.pi, math.pi, 3))
    if square:
        axis = np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
        rpy = tuple(float(rng.choice(RIGHT_ANGLES)) for _ in range(3))
        at = tuple(x if rng.random() < 0.4 else 0.0 for x in at)
    mass = float(rng.uniform(0.5, 5.0))
    # A body of two ellipsoids' worth of matter: always a possible inertia.
    spread = rng.standard_normal((3, 3)) * 0.2
    second = mass * spread @ spread.T
    J = np.trace(second) * np.eye(3) - second
    return Body(
        name=f"link{number}",
        joint=f"joint{number}",
        kind=kind,
        parent=parent,
        at=at,
        rpy=rpy,
        axis=tuple(float(x) for x in axis),
        mass=mass,
        com=_vector(rng, 0.3),
        inertia=tuple(float(J[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))),
    )
