"""The base at an instant: its pose and motion, prescribed by courses or free (docs/physics.md, section 1).

A free one is the first of the `bodies` that move freely.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from met.dynamics.kinematics import LinkMotion, link_motions
from met.dynamics.spatial import (
    HERE,
    ZERO,
    Pose,
    Real,
    Vector,
    rotation_quaternion,
    settled,
    turn_vector_back,
)
from met.dynamics.tree import Tree
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan import BASE
from met.program.courses import TIME
from met.program.motion.bodies import FreeBody, bodies, flight, place
from met.program.system import PARAMETER, ReadCell, System
from met.trace import Scalar
from met.trace.program import Tape
from met.vectors import quaternion_rpy


@frozen
class BaseMotion:
    """The base at one stage.

    pose    R_WB, and p_WB, m
    w, v    angular velocity, and velocity of the origin, base axes, rad/s, m/s
    wd, a   their derivatives in the world, base axes, where the motion is prescribed; zero of a free base
    turned  d(theta)/dt of a free base, rad/s; zero of others
    """

    pose: Pose = HERE
    w: Vector = ZERO
    v: Vector = ZERO
    wd: Vector = ZERO
    a: Vector = ZERO
    turned: Vector = ZERO

    def to_base(self, vector: Vector) -> Vector:
        """Base components of a vector given in world axes."""
        return vector if self.pose is HERE else turn_vector_back(self.pose.R, vector)


def free_base(system: System) -> FreeBody | None:
    """The base as a freely moving body; None where it is not free."""
    return bodies(system)[0] if system.structure.free else None


def base_of(system: System, read: ReadCell, y: Motion, time: Real) -> BaseMotion:
    """The base at a state and a time (s); y has a free base's coordinates, theta included."""
    if system.structure.base is None:
        return BaseMotion()
    body = free_base(system)
    if body is None:
        return prescribed(system, read, time)
    flying = flight(body, read, y)
    return BaseMotion(flying.pose, flying.w, flying.v, turned=flying.turned)


def motions(tree: Tree, q: Sequence[Real], qd: Sequence[Real], base: BaseMotion) -> dict[str, LinkMotion]:
    """The motion of every link in the world, by name; that of the base, where it is a link, is the given one."""
    by_link = link_motions(tree, q, qd, base.pose, (base.w, base.v))
    return by_link | ({BASE: LinkMotion(base.pose, base.w, base.v)} if BASE in by_link else {})


def prescribed(system: System, read: ReadCell, time: Real) -> BaseMotion:
    """The motion of the base from its courses at a time (`courses`)."""
    varying = {path: read(PARAMETER + path) for path in system.courses.inputs if path != TIME}
    numbers = system.courses.replay({TIME: time, **varying})
    settled_numbers = [settled(x) if isinstance(x, Scalar) else np.float64(x) for x in numbers]
    rows: list[Any] = [tuple(settled_numbers[i : i + 3]) for i in range(0, len(settled_numbers), 3)]
    pose = Pose((rows[0], rows[1], rows[2]), rows[3])
    return BaseMotion(pose, *(turn_vector_back(pose.R, row) for row in rows[4:]))


def start(system: System, tape: Tape) -> None:
    """Write the initial state of a free base, whose `rate` is given in world axes."""
    body = free_base(system)
    if body is None:
        return

    def parameter(name: str) -> Vector:
        x, y, z = (system.value(f"initial.base.{name}.{axis}", tape.read) for axis in "xyz")
        return x, y, z

    turn = quaternion_rpy(*parameter("rpy"))
    w = turn_vector_back(rotation_quaternion(*turn), parameter("rate"))
    place(body, tape, True, turn, parameter("position"), parameter("velocity"), w)
