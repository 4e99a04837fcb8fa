"""Grapples and releases of payloads, the first events at an instant (docs/physics.md), and their figures.

Each at the first instant of the dynamics that is not before its time. All grapples of an instant are one impact, and
releases follow it. Joints that are told their acceleration do not jump, nor do those whose motors are on a bed; dry
friction holds no joint against a blow; states of servos stay what they are, but for the rate of a rotor behind an
elastic gear on a free base: the rotor goes on turning as it did, and the link that its rate counts from jumps.

The figures are outside of the state: no bit of a run depends on them. They are computed just before and after the
impact, so a run has a cost only at the instants of its grapples. With I_p the payload's spatial inertia, dV its
velocity against the link where it is caught (`met.dynamics.payload`), and dV_L what the impact adds to that of the link

    lost = 1/2 dV' I_p (dV - dV_L)

for I_p (dV - dV_L) is the impulse between the two, and they meet at dV and part at 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from met.dynamics.coupling import solve_coupled
from met.dynamics.kinematics import LinkMotion, fixed_motion, momentum
from met.dynamics.payload import Twist, raised, twist_against
from met.dynamics.recursion import Wrench, solve
from met.dynamics.spatial import ZERO, Vector, add, choose, compose, cross, dot, inverse, sub, turn_vector
from met.integrators.integrator import Motion
from met.plan import BASE, INSTANT, Payload
from met.plan.outputs import GRAPPLE_FIGURES
from met.program import cells, rotors
from met.program.cells import NamedValues
from met.program.evaluation import servo_response
from met.program.motion import bodies
from met.program.motion.base import base_of, free_base, motions
from met.program.motion.bodies import CARRIED, FLYING, place
from met.program.system import Actuator, System
from met.servos.servo import Drive
from met.trace import Real, Truth, any_of, both, either, maximum, not_, sqrt, where
from met.trace.program import CallPhase, Control, Every, Phase, RunPhase, Tape, WhileAny
from met.vectors import quaternion


class Grapple:
    """The phases in which payloads change hands. Every method that takes a tape is the body of a phase.

    state  gives the state at an instant
    held   gives what a servo's computer holds there
    keep_followers  puts joints that follow others where those that lead are
    """

    def __init__(
        self,
        system: System,
        state: Callable[[Tape], Motion],
        held: Callable[[Tape, Actuator], NamedValues],
        keep_followers: Callable[[Tape], None],
    ) -> None:
        self.system, self._state, self._held, self._keep_followers = system, state, held, keep_followers
        self.watch = GrappleWatch(system, state)

    def events(self) -> tuple[Control, ...]:
        """Phases of grapples and releases at an instant."""
        if not self.system.flying:
            return ()
        parts: list[Control] = [RunPhase(Phase("payloads", self.due))]
        if any(payload.grappled for payload in self.system.flying):
            before, after = (
                CallPhase(Phase(f"grapple_{name}", look))  # of their own: the impact's code is as without them
                for name, look in (("before", self.watch.before), ("after", self.watch.after))
            )
            parts.append(WhileAny("grappling", 1, (before, RunPhase(Phase("grapple", self.grapple)), after)))
        if any(payload.released for payload in self.system.flying):
            parts.append(WhileAny("releasing", 1, (RunPhase(Phase("release", self.release)),)))
        return (Every(self.system.structure.schedule.dynamics, tuple(parts)),)

    def due(self, tape: Tape) -> None:
        """Write which payloads are grappled and released at this instant."""
        grappling: list[Truth] = []
        releasing: list[Truth] = []
        for payload in self.system.flying:
            stage: Real = tape.read(cells.PAYLOAD_STAGE(payload.name))
            on = stage == CARRIED
            if payload.grappled:
                caught = both(stage == FLYING, self._is_time(tape, payload.name, "grapple"))
                tape.write_mask(cells.GRAPPLING(payload.name), caught)
                grappling.append(caught)
                on = either(on, caught)
            if payload.released:
                gone = both(on, self._is_time(tape, payload.name, "release"))
                tape.write_mask(cells.RELEASING(payload.name), gone)
                releasing.append(gone)
        tape.write_mask("grappling", any_of(grappling))
        tape.write_mask("releasing", any_of(releasing))

    def grapple(self, tape: Tape) -> None:
        """Compute the impact of all payloads that are grappled at this instant, and attach them from now on."""
        system, y = self.system, self._state(tape)
        base, tree = base_of(system, tape.read, y, tape.time), system.tree(tape.read)
        links = motions(tree, y.q[: len(system.joints)], y.qd[: len(system.joints)], base)
        blows: dict[str, Wrench] = {}
        for payload in system.flying:
            if not payload.grappled:
                continue
            caught = tape.read_mask(cells.GRAPPLING(payload.name))
            own, link = bodies.flying_motion(system, payload, tape.read, y), links[payload.link]
            body, pose = bodies.body_of(system, payload, tape.read), compose(inverse(link.pose), own.pose)
            blow = raised(momentum(body, twist_against(own, link)), pose)
            before = blows.get(payload.link, (ZERO, ZERO))
            blows[payload.link] = tuple(  # type: ignore[assignment]
                add(a, tuple(choose(caught, x, 0.0) for x in b))  # type: ignore[arg-type]
                for a, b in zip(before, blow, strict=True)
            )
            bodies.attach(system, tape, caught, payload, pose)
            for name in bodies.free_body(system, payload).coordinates:
                cells.keep(tape, caught, f"{name}.qd", 0.0)
        self._jump(tape, y, blows)

    def release(self, tape: Tape) -> None:
        """Release payloads at this instant, with the motion of their links."""
        system, y = self.system, self._state(tape)
        base, n = base_of(system, tape.read, y, tape.time), len(system.joints)
        links = motions(system.tree(tape.read), y.q[:n], y.qd[:n], base)
        for payload in system.flying:
            if payload.released:
                gone = tape.read_mask(cells.RELEASING(payload.name))
                motion = bodies.carried_motion(payload, tape.read, links)
                body, v = bodies.free_body(system, payload), turn_vector(motion.pose.R, motion.v)
                place(body, tape, gone, quaternion(motion.pose.R), motion.pose.p, v, motion.w)
                bodies.detach(tape, gone, payload)

    def _jump(self, tape: Tape, y: Motion, blows: dict[str, Wrench]) -> None:
        """Rates after the impact; by link, the momentum transferred to it, about its origin and in its axes."""
        system, n = self.system, len(self.system.joints)
        drives = [self._drive(tape, actuator, y) for actuator in system.actuators]
        on_beds = {actuator.index for actuator, _, _ in system.mounted}
        body = free_base(system)
        turning = None if body is None else rotors.of(system, drives, y, (0.0,) * len(system.states), {}, on_beds)
        ratios, tree = system.ratios(tape.read, y.q), bodies.tree_with_payloads(system, tape.read)
        solver = partial(solve_coupled, tree, ratios) if any(ratios) else partial(solve, tree)
        solved = solver(
            q=y.q[:n],
            qd=(0.0,) * n,
            mode=tuple(False if i in on_beds else _yields(drive) for i, drive in enumerate(drives)),
            rotor=tuple(0.0 if drive is None else drive.rotor for drive in drives),
            spin=None if turning is None else turning.spin,
            free_rotors=None if turning is None else turning.free,
            wrenches=blows,
        )
        jumping = tape.read_mask("grappling")
        jumps = [(joint.name, jump) for joint, jump in zip(system.joints, solved.qdd, strict=True)]
        if body is not None:
            wd, a = solved.base_acceleration
            R = base_of(system, tape.read, y, tape.time).pose.R
            jumps += zip(body.coordinates, (*turn_vector(R, a), *wd), strict=True)
        for name, jump in jumps:
            cells.keep(tape, jumping, f"{name}.qd", tape.read(f"{name}.qd") + jump)
        for i, channel in ({} if turning is None else turning.states).items():
            cells.keep(tape, jumping, channel, tape.read(channel) - solved.about[i])
        self._keep_followers(tape)

    def _drive(self, tape: Tape, actuator: Actuator | None, y: Motion) -> Drive | None:
        """How a servo drives its joint at the instant of a grapple, from the motion `y` and what the servo's computer
        holds; None for a joint without a servo."""
        if actuator is None:
            return None
        held = self._held(tape, actuator)
        return servo_response(self.system, actuator, tape.read, y, held, tape.time, tape.time).drive

    def _is_time(self, tape: Tape, name: str, event: str) -> Truth:
        """True at an instant that is not before the event's time."""
        time: Real = self.system.value(f"payloads.{name}.{event}", tape.read)
        return tape.time >= time - INSTANT * self.system.structure.schedule.step


def _yields(drive: Drive | None) -> Truth:
    """True where a blow moves the joint."""
    return True if drive is None or drive.given is None else not_(drive.given)


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
