"""The view of the arm that environment models get: positions and velocities in the world, computed only on request."""

from __future__ import annotations

from met.diagnostic import Problem, error
from met.dynamics.kinematics import LinkMotion
from met.dynamics.spatial import HERE
from met.dynamics.tree import Tree
from met.environments.environment import Environment
from met.integrators.integrator import Motion
from met.parameter import WORLD
from met.program.motion.base import BaseMotion, motions
from met.program.motion.payloads import payload_motion
from met.program.system import ReadCell, System
from met.program.values import NamedValues, parameters
from met.trace import Real
from met.vectors import ZERO, Matrix, Vector


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
        if self.is_ground(link):
            return LinkMotion(HERE, ZERO, ZERO)
        if self._motions is None:
            self._motions = motions(self._tree, self._q, self._qd, self._base)
        if link in self._flying:
            return payload_motion(self._system, self._flying[link], self._read, self._y, self._motions)
        return self._motions[self._own(link)]

    def _own(self, link: str) -> str:
        if link not in self.links:
            message = f"an environment model asks for link `{link}`, which the arm does not have"
            raise Problem(error("E218", message, help=f"links: {', '.join(self.links)}"))
        return link

    def _number(self, joint: str) -> int:
        if joint not in self._names:
            message = f"an environment model asks for joint `{joint}`, which the arm does not have"
            raise Problem(error("E218", message, help=f"moving joints: {', '.join(self.joints)}"))
        return self._names.index(joint)
