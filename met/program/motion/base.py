"""The base at an instant, and the view of the arm that environment models get from it.

A free one is the first of the `bodies` that move freely.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from met.diagnostic import Problem, error
from met.dynamics.kinematics import LinkMotion, link_motions
from met.dynamics.spatial import HERE, Pose, rotation_quaternion, settled, turn_vector_back
from met.dynamics.tree import Tree
from met.environments.environment import Environment
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.parameter import WORLD
from met.plan import BASE
from met.program.cells import NamedValues, parameters
from met.program.courses import TIME
from met.program.motion.bodies import FreeBody, bodies, flight, payload_motion, place
from met.program.system import PARAMETER, ReadCell, System
from met.trace import Real, Scalar
from met.trace.program import Tape
from met.vectors import ZERO, Matrix, Vector, quaternion_rpy


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
    """Pose and velocity of a prescribed base at a time (s), from the formulas of its components."""
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


def environment_values(system: System, name: str, model: Environment, read: ReadCell) -> tuple[str, NamedValues]:
    """The name in messages of an environment model in use, and its parameters."""
    owner = f"environment model `{model.name}` (as `{name}`)"
    head = f"environment.{name}"
    return owner, parameters(owner, head, system.declared[head], lambda path: system.value(path, read))


class ArmWorld:
    """A `met.environments.environment.World` at one stage."""

    def __init__(
        self, system: System, read: ReadCell, tree: Tree, y: Motion, base: BaseMotion, time: Real, begin: Real
    ) -> None:
        self.time, self.begin = time, begin
        self.step = system.structure.schedule.step
        self._names = tuple(joint.name for joint in system.joints)
        self.joints = tuple(name for name in self._names if name not in system.structure.springs)
        self.links = (*(link.name for link in system.structure.links), *(p.name for p in system.structure.payloads))
        self._sliding = {joint.name: joint.kind == "prismatic" for joint in system.joints}
        self._system, self._read = system, read
        n = len(self._names)
        self._tree, self._y, self._base = tree, y, base
        self._q, self._qd = y.q[:n], y.qd[:n]
        self._flying = {payload.name: payload for payload in system.flying}
        self._motions: dict[str, LinkMotion] | None = None

    def slides(self, joint: str) -> bool:
        return self._sliding[self._names[self._number(joint)]]

    def q(self, joint: str) -> Real:
        return self._q[self._number(joint)]

    def qd(self, joint: str) -> Real:
        return self._qd[self._number(joint)]

    def position(self, link: str, point: Vector = (0.0, 0.0, 0.0)) -> Vector:
        return self.link(link).position(point)

    def velocity(self, link: str, point: Vector = (0.0, 0.0, 0.0)) -> Vector:
        return self.link(link).velocity(point)

    def to_world(self, link: str, vector: Vector) -> Vector:
        return self.link(link).to_world(vector)

    def orientation(self, link: str) -> Matrix:
        return self.link(link).pose.R

    def rate(self, link: str) -> Vector:
        return self.link(link).rate()

    def mass(self, link: str) -> Real:
        return self._system.mass(self._own(link), self._read)

    def com(self, link: str) -> Vector:
        return self._system.com(self._own(link), self._read)

    def inertia(self, link: str) -> tuple[Real, Real, Real, Real, Real, Real]:
        return self._system.inertia(self._own(link), self._read)

    def is_ground(self, link: str) -> bool:
        """True for the ground's name. Where a link of the arm has that name, no model's parameter means the ground by
        it."""
        return link == WORLD and link not in self.links

    def link(self, link: str) -> LinkMotion:
        """The motion of a link, payload or the ground in the world."""
        if self.is_ground(link):
            return LinkMotion(HERE, ZERO, ZERO)
        if self._motions is None:
            self._motions = motions(self._tree, self._q, self._qd, self._base)
        if link in self._flying:
            return payload_motion(self._system, self._flying[link], self._read, self._y, self._motions)
        return self._motions[self._own(link)]

    def _own(self, link: str) -> str:
        """The name of a link that the arm has. Raises Problem E218 for another."""
        if link not in self.links:
            message = f"an environment model asks for link `{link}`, which the arm does not have"
            raise Problem(error("E218", message, help=f"links: {', '.join(self.links)}"))
        return link

    def _number(self, joint: str) -> int:
        """The number of a moving joint. Raises Problem E218 where the arm does not have it."""
        if joint not in self._names:
            message = f"an environment model asks for joint `{joint}`, which the arm does not have"
            raise Problem(error("E218", message, help=f"moving joints: {', '.join(self.joints)}"))
        return self._names.index(joint)
