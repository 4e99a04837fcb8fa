"""Figures of grapples: the distance of a payload from its place, its motion against its link, and the lost energy.

All of it is outside of the state: no bit of a run depends on it. The figures are computed just before and after the
impact, so a run has a cost only at the instants of its grapples. With I_p the payload's spatial inertia, dV its
velocity against the link where it is caught (`met.dynamics.payload`), and dV_L what the impact adds to that of the link

    lost = 1/2 dV' I_p (dV - dV_L)

for I_p (dV - dV_L) is the impulse between the two, and they meet at dV and part at 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from met.dynamics.kinematics import LinkMotion, fixed_motion
from met.dynamics.payload import Twist, momentum, twist_against
from met.dynamics.spatial import Vector, add, compose, cross, dot, inverse, sub
from met.integrators.integrator import Motion
from met.plan import BASE, Payload
from met.plan.outputs import GRAPPLE_FIGURES
from met.program import cells
from met.program.motion import bodies
from met.program.motion.base import base_of, motions
from met.program.system import System
from met.trace import Real, maximum, sqrt, where
from met.trace.program import Tape

PAYLOADS, LINKS, REACHES = 1.5, 0.2, 0.05
"""Shares of a payload's size, a link's size and an arm's length up to which a payload counts as near its place."""

SMALLEST = 1e-6
"""m: the smallest recorded distance of a payload; 0 stands for a grapple that never came."""

HALF_A_ROD = 3.0
"""A uniform rod reaches sqrt(3) times its radius of gyration from its centre, other uniform solids less."""


class GrappleWatch:
    """The figures of each grapple of one system. state gives the state at an instant."""

    def __init__(self, system: System, state: Callable[[Tape], Motion]) -> None:
        self.system, self._state = system, state
        self.payloads = [payload for payload in system.flying if payload.grappled]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Outputs: the figures of each payload's grapple, 0 where it never came."""
        return tuple(cells.GRAPPLED(payload.name, name) for payload in self.payloads for name in GRAPPLE_FIGURES)

    def before(self, tape: Tape) -> None:
        """Keep the poses and velocities of payloads that are grappled at this instant."""
        links, y = self._links(tape), self._state(tape)
        for payload in self.payloads:
            own, link = bodies.flying_motion(self.system, payload, tape.read, y), links[payload.link]
            away = bodies.gap(self.system, payload, tape.read, own, link)
            w, v = against = twist_against(own, link)
            of_centre = add(v, cross(w, self.system.com(payload.name, tape.read)))
            rate, size = sqrt(dot(w, w)), self._size(payload.name, tape)
            figures = {
                "distance": sqrt(dot(away, away)),
                "near": self._near(payload, tape),
                "speed": sqrt(dot(of_centre, of_centre)) + rate * size,
                "rate": rate,
            }
            caught = tape.read_mask(cells.GRAPPLING(payload.name))
            for name, value in figures.items():
                cells.keep(tape, caught, cells.GRAPPLED(payload.name, name), value)
            for i, x in enumerate((*against[0], *against[1], *_flat(self._carrying(payload, own, link)))):
                cells.keep(tape, caught, cells.AGAINST(payload.name, i), x)

    def after(self, tape: Tape) -> None:
        """Keep the energy that the impact at this instant has lost."""
        links = self._links(tape)
        for payload in self.payloads:
            x = [tape.read(cells.AGAINST(payload.name, i)) for i in range(12)]
            w, v = (x[0], x[1], x[2]), (x[3], x[4], x[5])
            pose = bodies.pose_in_link(payload, tape.read)
            w_now, v_now = fixed_motion((links[payload.link].w, links[payload.link].v), pose)
            left = sub(w, sub(w_now, (x[6], x[7], x[8]))), sub(v, sub(v_now, (x[9], x[10], x[11])))
            spin, linear = momentum(bodies.body_of(self.system, payload, tape.read), left)
            caught = tape.read_mask(cells.GRAPPLING(payload.name))
            lost = 0.5 * (dot(w, spin) + dot(v, linear))
            cells.keep(tape, caught, cells.GRAPPLED(payload.name, "energy"), lost)

    def _links(self, tape: Tape) -> Mapping[str, LinkMotion]:
        system, y, n = self.system, self._state(tape), len(self.system.joints)
        return motions(system.tree(tape.read), y.q[:n], y.qd[:n], base_of(system, tape.read, y, tape.time))

    def _carrying(self, payload: Payload, own: LinkMotion, link: LinkMotion) -> Twist:
        """The velocity of the link's material that is where the payload's frame is, in the payload's axes."""
        return fixed_motion((link.w, link.v), compose(inverse(link.pose), own.pose))

    def _near(self, payload: Payload, tape: Tape) -> Real:
        """The distance from its place up to which a payload is near, m. Without a written place, which is the link's
        origin then, a payload is near if it touches the link."""
        system, place = self.system, self.system.vector(f"payloads.{payload.name}.at", tape.read)
        has_body = f"links.{payload.link}.mass" in system.experiment.parameters
        of_link = self._size(payload.link, tape) if has_body else 0.0
        middle = _length(system.com(payload.link, tape.read)) if has_body else 0.0
        own = self._size(payload.name, tape)
        reach: Real = _length(place)
        for name in self._way_to(payload.link):
            reach = reach + _length(system.vector(f"{name}.at", tape.read))
        touching = middle + _length(system.com(payload.name, tape.read)) + PAYLOADS * of_link
        near = PAYLOADS * own + maximum(LINKS * of_link, REACHES * reach)
        return maximum(near + where(dot(place, place) == 0.0, touching, 0.0), SMALLEST)

    def _way_to(self, link: str) -> list[str]:
        """The joints between a link and the base."""
        carrying, joints = {joint.child: joint for joint in self.system.structure.joints}, []
        while link in carrying and link != BASE:
            joints.append(carrying[link].name)
            link = carrying[link].parent
        return joints

    def _size(self, body: str, tape: Tape) -> Real:
        """The largest distance of a body's matter from its centre of mass, for usual shapes, m."""
        mass, (xx, yy, zz, *_) = self.system.mass(body, tape.read), self.system.inertia(body, tape.read)
        largest = maximum(xx, maximum(yy, zz))
        return where(mass > 0.0, sqrt(HALF_A_ROD * largest / where(mass > 0.0, mass, 1.0)), 0.0)


def _length(vector: Vector) -> Real:
    return sqrt(dot(vector, vector))


def _flat(twist: Twist) -> tuple[Real, ...]:
    return (*twist[0], *twist[1])
