"""The measured arms. All joints turn about their z axes, so that the peer can use its fastest joint, too."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from met.dynamics.tree import Body

GRAVITY = (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class Arm:
    """An arm by its short name; `bodies` makes its links, parents first."""

    name: str
    doc: str
    bodies: Callable[[], tuple[Body, ...]]

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(body.joint for body in self.bodies() if body.kind != "fixed")


@cache
def _two_link() -> tuple[Body, ...]:
    """The arm of two_link.ic, hung in a vertical plane so that gravity counts: 2 m rods of 40 and 20 kg.

    A deck may not write down the inertia of a rod without thickness, so it has a little; nothing follows from it.
    """
    upright = (math.pi / 2.0, 0.0, 0.0)
    first, second = (replace(body, inertia=(0.1, *body.inertia[1:])) for body in _deck("two_link.ic"))
    return (replace(first, rpy=upright), second)


@cache
def _panda() -> tuple[Body, ...]:
    return _deck("panda.ic")


@cache
def _robots() -> tuple[Body, ...]:
    """A trunk of six joints that carries four limbs of six, placed by right angles as robots are."""
    right = math.pi / 2.0
    places = [
        (i - 1 if i < 6 or i % 6 else 5, (0.3, 0.0, 0.1) if i % 2 else (0.0, 0.2, 0.0), (right if i % 2 else -right))
        for i in range(30)
    ]
    rng = np.random.default_rng(30)
    return tuple(_body(rng, i, parent, place, (turn, 0.0, 0.0)) for i, (parent, place, turn) in enumerate(places))


@cache
def _general() -> tuple[Body, ...]:
    """A random tree without right angles: each joint hangs from one of the three before it."""
    rng = np.random.default_rng(31)
    bodies = []
    for i in range(30):
        parent = int(rng.integers(max(0, i - 3), i)) if i else -1
        place, rpy = rng.standard_normal(3) * 0.3, rng.uniform(-math.pi, math.pi, 3)
        bodies.append(_body(rng, i, parent, place.tolist(), rpy.tolist()))
    return tuple(bodies)


@cache
def _chain() -> tuple[Body, ...]:
    """A hundred joints in a row, their axes at right angles by turns."""
    rng = np.random.default_rng(100)
    turns = [math.pi / 2.0 if i % 2 else -math.pi / 2.0 for i in range(100)]
    return tuple(_body(rng, i, i - 1, (0.1, 0.0, 0.0), (turns[i], 0.0, 0.0)) for i in range(100))


TWO = Arm("2R", "two joints in a vertical plane (two_link.ic, hung)", _two_link)
SEVEN = Arm("7R", "the Panda (panda.ic)", _panda)
THIRTY = Arm("30R", "a tree of 30 joints, a trunk and four limbs of six, at right angles as in robots", _robots)
GENERAL = Arm("30R-general", "a random tree of 30 joints, no angle right", _general)
CHAIN = Arm("100R", "a chain of 100 joints", _chain)

ARMS = (TWO, SEVEN, THIRTY, GENERAL)
"""The arms that are timed; for a chain of 100 joints only the compile time is measured."""


def _deck(name: str) -> tuple[Body, ...]:
    """The bodies of a deck's default run, as its plan has them."""
    import ic

    experiment = ic.compile(name).experiments[0]

    def numbers(prefix: str, parts: Sequence[str]) -> tuple[float, ...]:
        return tuple(float(experiment.parameters[f"{prefix}.{part}"].value) for part in parts)  # type: ignore[arg-type]

    structure = experiment.structure
    order = {joint.child: i for i, joint in enumerate(structure.joints)}
    return tuple(
        Body(
            name=joint.child,
            joint=joint.name,
            kind=joint.kind,
            parent=order.get(joint.parent, -1),
            at=numbers(f"{joint.name}.at", "xyz"),
            rpy=numbers(f"{joint.name}.rpy", "xyz"),
            axis=(0.0, 0.0, 1.0),
            mass=numbers(f"links.{joint.child}", ["mass"])[0],
            com=numbers(f"links.{joint.child}.com", "xyz"),
            inertia=numbers(f"links.{joint.child}.inertia", ("xx", "yy", "zz", "xy", "xz", "yz")),
        )
        for joint in structure.joints
    )


def _body(rng: np.random.Generator, number: int, parent: int, place: Sequence[float], rpy: Sequence[float]) -> Body:
    """A revolute joint about z and an asymmetric but physical link."""
    spread = rng.standard_normal((3, 3)) * 0.1
    second = spread @ spread.T
    J = np.trace(second) * np.eye(3) - second
    inertia = tuple(float(J[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return Body(
        f"link{number}", f"joint{number}", "revolute", parent, at=tuple(map(float, place)), rpy=tuple(map(float, rpy)),
        axis=(0.0, 0.0, 1.0), mass=float(rng.uniform(1.0, 4.0)),
        com=tuple(float(x) for x in rng.standard_normal(3) * 0.1), inertia=inertia,
    )  # fmt: skip
