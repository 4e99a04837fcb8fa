"""Derived channels: quantities that a record or a metric needs from the arm at an instant (docs/physics.md, section 1).

They follow from the state at the instant, in the modes in which its derivative was taken. They are separate pieces of
the program, which compute the derivative anew: so no bit of another channel depends on them.

Of the two unit quaternions of a rotation, the first that is asked for has w >= 0; each one after it has the sign by
which it lies nearer the one before. A record compares a row with the row before it, a metric an instant with the
instant before it, each in cells of its own, so that a metric changes no row. The signs depend on the case alone, not on
cases beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, reduce
from typing import Any

from met.dynamics.coupling import at_leaders
from met.dynamics.effective_inertia import effective_inertia
from met.dynamics.kinematics import Energy, LinkMotion, energy, jacobian
from met.dynamics.payload import energy_of
from met.dynamics.recursion import Wrench, reactions
from met.dynamics.spatial import Pose, Vector, add, choose, compose, inverse, scale, sub
from met.integrators.integrator import Motion
from met.plan.chains import chains
from met.plan.channel import WXYZ, XYZ, Channel
from met.program.cells import answer, returned
from met.program.evaluation import Derivative
from met.program.motion import bodies
from met.program.motion.base import ArmWorld, BaseMotion, environment_values, motions
from met.program.system import ReadCell, System
from met.trace import Real, absolute, minimum, sqrt, where
from met.trace.program import Tape
from met.vectors import Quaternion, dot, quaternion


def derived(system: System) -> tuple[list[Channel], list[Channel]]:
    """The requested derived channels: those computed at every instant, and those computed only at recorded rows.

    A metric and an expression see every instant. So does a record whose rows lie between instants, for they show the
    last one's value.
    """
    structure = system.structure
    paths = [path for recorded in structure.record for path in recorded.channels]
    watched = [channel for _, _, channel in system.metrics if channel.derived]
    parts = (system.channels[path] for expression in structure.expressions for path in expression.channels)
    watched += [channel for channel in parts if channel.derived]
    recorded = [channel for channel in map(system.channels.__getitem__, paths) if channel.derived]
    between = structure.schedule.record % structure.schedule.dynamics != 0
    held = {channel.path: channel for channel in (watched + recorded if between else watched)}
    rows = {channel.path: channel for channel in recorded if channel.path not in held}
    return list(held.values()), list(rows.values())


class Observed:
    """The arm at one instant. Quantities that no channel needs are not computed.

    y      the state, and base, where it stands, at this time, s;  derive  gives its derivative
    """

    def __init__(
        self, system: System, read: ReadCell, y: Motion, base: BaseMotion, time: Real, derive: Callable[[], Derivative]
    ) -> None:
        self.system, self.read, self.y, self.time = system, read, y, time
        self.joints = tuple(joint.name for joint in system.joints)
        n = len(self.joints)
        self.tree, self.q, self.qd, self.base = system.tree(read), y.q[:n], y.qd[:n], base
        self._derive = derive
        self._jacobians: dict[str, Sequence[tuple[Vector, Vector]]] = {}

    def value(self, channel: Channel) -> Real:
        """The value of a derived channel, in its unit; not for orientations, whose sign depends on former instants."""
        parts = channel.path.split(".")
        if parts[0] == "links":
            return self._of_link(channel, parts[1:])
        if parts[0] == "payloads":
            return self._of_payload(parts[1:])
        if parts[0] == "environment":
            return self._of_environment(*parts[1:])
        return self._of_joint(channel.joint, parts[1:]) if channel.joint else self._of_arm(parts)

    def orientation(self, name: str) -> Quaternion:
        """The orientation of a link or a payload, `links.tip.orientation`, with w >= 0."""
        kind, own, _ = name.split(".")
        return quaternion((self.motions if kind == "links" else self.seen)[own].pose.R)

    def _of_joint(self, joint: str, parts: list[str]) -> Real:
        """A derived number of a joint, by the words of its channel after the name. Raises KeyError."""
        if parts == ["limit_margin"]:
            return self._margin(joint)
        i, solved = self.joints.index(joint), self.derivative.solved
        match parts:
            case ["tau_load"]:
                return solved.tau_load[i]
            case ["J_eff"]:
                return self.effective(i)[0]
            case ["b"]:
                return self.effective(i)[1]
            case ["mode"]:
                return choose(solved.mode[i], 1.0, 0.0)
            case ["reaction", kind, axis]:
                moment, force = self.reactions[i]
                return (moment if kind == "moment" else force)[XYZ.index(axis)]
        raise KeyError(f"{joint}.{'.'.join(parts)}")

    def _of_link(self, channel: Channel, parts: list[str]) -> Real:
        """A channel of a link, by the words of its path: pose, velocity, Jacobian, or bending of a boom."""
        link, kind, *rest = parts
        if kind == "jacobian":
            angular, linear = self._jacobian(link)[self.joints.index(channel.joint)]
            return (angular if rest[0] == "angular" else linear)[XYZ.index(rest[-1])]
        of_booms = {"bend": self._bend, "deflection": self._deflection, "displacement": self._displacement}
        if kind in of_booms:
            return of_booms[kind](link)[XYZ.index(rest[0])]
        return _of_frame(self.motions[link], kind, rest[0])

    def _displacement(self, boom: str) -> Vector:
        """The way to a boom's tip from its place on the arm with all booms straight, world axes, m."""
        springs, tip = self.system.structure.springs, scale(2.0, self.system.com(boom, self.read))
        q = [0.0 if joint in springs else angle for joint, angle in zip(self.joints, self.q, strict=True)]
        straight = motions(self.tree, q, self.qd, self.base)[boom]
        return sub(self.motions[boom].position(tip), straight.position(tip))

    def _bend(self, boom: str) -> Vector:
        """The angles of a boom's tip against its root about each axis of the boom, rad: sums over its springs."""
        turned: Vector = (0.0, 0.0, 0.0)
        for joint in chains(self.system.structure.links, self.system.structure.joints)[boom]:
            if joint.kind == "fixed":
                continue
            axis = self.system.vector(f"{joint.name}.axis", self.read)
            turned = add(turned, scale(self.q[self.joints.index(joint.name)], axis))
        return turned

    def _deflection(self, boom: str) -> Vector:
        """The way of a boom's tip from its place on the straight boom, in axes of its root, m."""
        [root] = [link.root for link in self.system.structure.links if link.name == boom]
        tip = scale(2.0, self.system.com(boom, self.read))
        return sub(
            compose(
                inverse(self.motions[root].pose), Pose(self.motions[boom].pose.R, self.motions[boom].position(tip))
            ).p,
            tip,
        )

    def _of_payload(self, parts: list[str]) -> Real:
        """A channel of a payload, by the words of its path: whether it is carried, the distance from its place, or its
        motion."""
        name, kind, *rest = parts
        payload, motion = next(other for other in self.system.structure.payloads if other.name == name), self.seen[name]
        if kind == "carried":
            return choose(bodies.carried(payload, self.read), 1.0, 0.0) if payload.flies else 1.0
        if kind == "distance":
            way = bodies.gap(self.system, payload, self.read, motion, self.motions[payload.link])
            return sqrt(dot(way, way))
        return _of_frame(motion, kind, rest[0])

    def _of_environment(self, name: str, signal: str, axis: str = "") -> Real:
        """A signal that a model of the environment shows, at this instant."""
        model = dict(self.system.environment)[name]
        assert model.show is not None
        owner, p = environment_values(self.system, name, model, self.read)
        tree = bodies.tree_with_payloads(self.system, self.read)
        world = ArmWorld(self.system, self.read, tree, self.y, self.base, self.time, self.time)
        signals: Mapping[str, Any] = returned(
            owner, "signals", answer(owner, model.show, p, world), (declared.name for declared in model.signals)
        )
        return signals[signal][XYZ.index(axis)] if axis else signals[signal]

    def _of_arm(self, parts: list[str]) -> Real:
        """A channel of the whole arm, by the words of its path: energy, momentum, or the margin to joint limits."""
        match parts:
            case ["energy", "kinetic"]:
                return self.energy.kinetic + self.derivative.stored[0]
            case ["energy", "potential"]:
                return self.energy.potential + self.derivative.stored[1]
            case ["limits", "margin"]:
                return reduce(minimum, [self._margin(joint.name) for joint in self.system.joints if joint.limits])
            case ["momentum", kind, axis]:
                return (self.energy.linear if kind == "linear" else self.energy.angular)[XYZ.index(axis)]
        raise KeyError(".".join(parts))

    def _margin(self, joint: str) -> Real:
        """The smallest margin of a joint to its limits, each as a share of the range, or of the limit."""
        [limits] = [other.limits for other in self.system.joints if other.name == joint]
        value = {name: self.system.value(f"{joint}.{name}", self.read) for name in limits}
        shares = [
            excess(joint, name, value[name], self.read) / (value["q_min"] - value["q_max"])
            if name in ("q_min", "q_max")
            else excess(joint, name, value[name], self.read) / -value[name]
            for name in limits
        ]
        return reduce(minimum, shares)

    def _jacobian(self, link: str) -> Sequence[tuple[Vector, Vector]]:
        """Columns of a link's Jacobian in the world, for unit rates of the joints that lead."""
        if link not in self._jacobians:
            columns = jacobian(self.tree, self.q, link, base=self.base.pose)
            self._jacobians[link] = at_leaders(self.system.ratios(self.read, self.q), columns)
        return self._jacobians[link]

    @cached_property
    def derivative(self) -> Derivative:
        return self._derive()

    def effective(self, joint: int) -> tuple[Real, Real]:
        """J_eff and b of a joint, by its number."""
        derivative = self.derivative
        if derivative.felt is None:
            return self._effective[joint]
        inertia = derivative.felt(joint)
        return inertia, derivative.solved.tau_load[joint] - inertia * derivative.solved.qdd[joint]

    @cached_property
    def _effective(self) -> tuple[tuple[Real, Real], ...]:
        return effective_inertia(self.tree, self.derivative.solved)

    @cached_property
    def reactions(self) -> tuple[Wrench, ...]:
        return reactions(bodies.tree_with_payloads(self.system, self.read), self.derivative.solved)

    @cached_property
    def motions(self) -> dict[str, LinkMotion]:
        return motions(self.tree, self.q, self.qd, self.base)

    @cached_property
    def seen(self) -> dict[str, LinkMotion]:
        """Every payload in the world, by name."""
        return {
            payload.name: bodies.payload_motion(self.system, payload, self.read, self.y, self.motions)
            if payload.flies
            else self.motions[payload.name]
            for payload in self.system.structure.payloads
        }

    @cached_property
    def energy(self) -> Energy:
        """Energy and momentum of the arm, and of each payload that is a free body for a part of the run, whether a link
        carries it now or not."""
        derivative, base = self.derivative, self.base
        total = energy(
            self.tree,
            self.q,
            self.qd,
            rotor=derivative.solved.rotor,
            momenta=derivative.angular_momenta,
            gravity=derivative.gravity,
            base=base.pose,
            base_velocity=(base.w, base.v),
        )
        for payload in self.system.flying:
            body = bodies.body_of(self.system, payload, self.read)
            own = energy_of(body, self.seen[payload.name], derivative.gravity)
            total = Energy(
                total.kinetic + own.kinetic,
                total.potential + own.potential,
                add(total.linear, own.linear),
                add(total.angular, own.angular),
            )
        return total


def _of_frame(motion: LinkMotion, kind: str, part: str) -> Real:
    """A component of a frame's position in the world, or of its motion."""
    vectors = {"position": motion.position, "velocity": motion.velocity, "rate": motion.rate}
    return vectors[kind]()[XYZ.index(part)]


INSTANT, ROW = "instant:", "row:"
"""Prefixes of the cells that hold the last quaternion seen, at an instant and in a row. They start as zeros, which are
as near to one sign as to the other: so the first quaternion keeps w >= 0."""


def vector(channel: Channel) -> str:
    """The orientation that a channel is a component of; "" of any other channel."""
    return channel.path.rpartition(".")[0] if channel.components == WXYZ else ""


def values(tape: Tape, arm: Observed, channels: list[Channel], last: str) -> dict[str, Real]:
    """Derived channels at this instant, by path. last: INSTANT or ROW, for the part that asks."""
    by_path = {channel.path: arm.value(channel) for channel in channels if not vector(channel)}
    for name in dict.fromkeys(map(vector, channels)):
        by_path |= _components(name, nearest(tape, name, arm.orientation(name), last)) if name else {}
    return {channel.path: by_path[channel.path] for channel in channels}


def held(tape: Tape, channels: list[Channel]) -> dict[str, Real]:
    """Orientations in a row between instants, or beside a metric that watches them: those of the last instant."""
    by_path: dict[str, Real] = {}
    for name in dict.fromkeys(filter(None, map(vector, channels))):
        seen = tuple(tape.read(cell) for cell in _cells(name, INSTANT))
        by_path |= _components(name, nearest(tape, name, seen, ROW))  # type: ignore[arg-type]
    return by_path


def nearest(tape: Tape, name: str, q: Quaternion, last: str) -> Quaternion:
    """The one of q and -q that is nearer the last one; it becomes the last one."""
    near = dot(q, [tape.read(cell) for cell in _cells(name, last)])
    sign = where(near < 0.0, -1.0, 1.0)
    w, x, y, z = (sign * part for part in q)
    for cell, part in zip(_cells(name, last), (w, x, y, z), strict=True):
        tape.write(cell, part)
    return w, x, y, z


def _components(name: str, q: Quaternion) -> dict[str, Real]:
    return {f"{name}.{part}": value for part, value in zip(WXYZ, q, strict=True)}


def _cells(name: str, last: str) -> list[str]:
    return [f"{last}{name}.{part}" for part in WXYZ]


def excess(joint: str, limit: str, value: Real, read: ReadCell) -> Real:
    """The distance of a joint beyond a limit of this name and value, in the limit's unit; below 0 within the limit.
    Limits are watched, and do not affect the motion.

    Its position and rate are those of the state, its torque that of the derivative taken last.
    """
    if limit in ("q_min", "q_max"):
        q = read(f"{joint}.q")
        return value - q if limit == "q_min" else q - value
    return absolute(read(f"{joint}.{'qd' if limit == 'qd_max' else 'tau'}")) - value
