"""Sensors of links: their inputs at a stage and where a run begins, and their readings at ticks.

An acceleration follows from the derivative, so circuits have it at stages. A tick comes before the servos, whose
outputs are not yet known: its readings are of the state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from met.diagnostic import Place, Problem, error
from met.dynamics.kinematics import LinkMotion, fixed_acceleration, link_acceleration
from met.dynamics.spatial import choose
from met.dynamics.tree import Tree
from met.environments.environment import World
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan import BASE
from met.program import cells
from met.program.cells import answer
from met.program.control import sensing
from met.program.motion import bodies
from met.program.motion.base import ArmWorld, BaseMotion, base_of, environment_values
from met.program.system import Fitted, ReadCell, System
from met.trace import Real
from met.trace.program import Tape
from met.vectors import ZERO, Vector, add, cross, sub, turn_vector_back


@frozen
class Accelerations:
    """Accelerations at a stage, from the derivative.

    qdd      slopes of all rates, those of bodies too, as in `Slope`
    base     angular acceleration of the base frame, and that of its origin, base axes, rad/s^2, m/s^2
    gravity  uniform, of all environment models, world axes, m/s^2
    """

    qdd: tuple[Real, ...]
    base: tuple[Vector, Vector]
    gravity: Vector


class Aboard(ArmWorld):
    """A `met.sensors.sensor.Felt`.

    moved  None: at a tick, where no acceleration is known
    place  of the sensor that asks at a tick
    """

    def __init__(
        self,
        system: System,
        read: ReadCell,
        tree: Tree,
        y: Motion,
        base: BaseMotion,
        time: Real,
        begin: Real,
        moved: Accelerations | None,
        place: Place | None = None,
    ) -> None:
        super().__init__(system, read, tree, y, base, time, begin)
        self._moved, self._place = moved, place

    def link(self, link: str) -> LinkMotion:
        if link == BASE and BASE not in self.links:
            return LinkMotion(self._base.pose, self._base.w, self._base.v)
        return super().link(link)

    def acceleration(self, link: str, point: Vector = ZERO) -> Vector:
        return self.link(link).to_world(self._acceleration(link, point))

    def specific_force(self, link: str, point: Vector = ZERO) -> Vector:
        own, motion = self._acceleration(link, point), self.link(link)
        falling = free_fall(self._system, self._read, self, self._known(link).gravity, motion, point)
        return sub(own, motion.to_link(falling))

    def spin(self, link: str) -> Vector:
        """The angular velocity of a link in its axes, rad/s, including that of a turning world."""
        motion = self.link(link)
        w = motion.w
        for name, model in self._system.environment:
            if model.world_rate is not None:
                owner, p = environment_values(self._system, name, model, self._read)
                w = add(w, motion.to_link(answer(owner, model.world_rate, p, self)))
        return w

    def _acceleration(self, link: str, point: Vector) -> Vector:
        """Acceleration of a point given in the link's frame, m, in the link's axes, m/s^2."""
        wd, a = self._of_frame(link)
        w = self.link(link).w
        return add(a, add(cross(wd, point), cross(w, cross(w, point))))

    def _of_frame(self, link: str) -> tuple[Vector, Vector]:
        """Angular acceleration of a link or payload and acceleration of its frame's origin, in its axes."""
        moved = self._known(link)
        if link in self._flying:
            return self._of_payload(link, moved)
        if link not in self._tree.frames:
            return moved.base
        n = len(self.joints)
        return link_acceleration(self._tree, self._q, self._qd, moved.qdd[:n], link, self._base.w, moved.base)

    def _of_payload(self, name: str, moved: Accelerations) -> tuple[Vector, Vector]:
        """Angular and linear acceleration of a payload, in its frame, rad/s^2 and m/s^2: its link's while it is
        carried, else its own."""
        payload, read = self._flying[name], self._read
        body = bodies.free_body(self._system, payload)
        own = body.qdd(moved.qdd)
        flown = bodies.flying_motion(self._system, payload, read, self._y)
        free = own[3:], turn_vector_back(flown.pose.R, own[:3])  # type: ignore[arg-type]
        carrier = self.link(payload.link)
        held = fixed_acceleration(carrier.w, self._of_frame(payload.link), bodies.pose_in_link(payload, read))
        on = bodies.carried(payload, read)
        wd, a = (
            (choose(on, x[0], y[0]), choose(on, x[1], y[1]), choose(on, x[2], y[2]))
            for x, y in zip(held, free, strict=True)
        )
        return wd, a

    def _known(self, link: str) -> Accelerations:
        """The accelerations at this instant. Raises Problem E216 where a sensor asks for them at its tick, before they
        are known."""
        if self._moved is None:
            message = f"a sensor asks at its tick for an acceleration, of link `{link}`, which is not known yet"
            help = "keep what a circuit makes of it: a state, whose slope `follow` gives"
            raise Problem(error("E216", message, self._place, help=help))
        return self._moved


def free_fall(
    system: System, read: ReadCell, world: World, gravity: Vector, motion: LinkMotion, point: Vector = ZERO
) -> Vector:
    """Acceleration of a freely falling body at a point of a frame, with the point's velocity; world axes, m/s^2."""
    acceleration = gravity
    for name, model in system.environment:
        if model.free_fall is not None:
            owner, p = environment_values(system, name, model, read)
            point_motion = motion.position(point), motion.velocity(point)
            acceleration = add(acceleration, answer(owner, model.free_fall, p, world, *point_motion))
    return acceleration


def start(system: System, tape: Tape, gravity: Callable[[Motion], Vector]) -> None:
    """Write sensors where a run begins: settled with joints that do not accelerate, and bodies that fall freely.

    gravity  at a state where a run begins, as in `Accelerations`
    """
    if not system.sensors:
        return
    y, stands = _state(system, tape, 0.0)
    at_once = Aboard(system, tape.read, system.tree(tape.read), y, stands, 0.0, 0.0, None)
    g = gravity(y)
    qdd: list[Real] = [0.0 for _ in system.joints]
    base = stands.wd, stands.a
    for body in bodies.bodies(system):
        own = bodies.flight(body, tape.read, y)
        fall = free_fall(system, tape.read, at_once, g, LinkMotion(own.pose, own.w, own.v))
        qdd += [*fall, 0.0, 0.0, 0.0]
        if body.name == BASE:
            base = ZERO, turn_vector_back(own.pose.R, fall)
    moved = Accelerations(tuple(qdd), base, g)
    felt = Aboard(system, tape.read, system.tree(tape.read), y, stands, 0.0, 0.0, moved)
    for fitted in system.sensors:
        sensing.begin(system, tape, fitted, measured(system, fitted, tape.read, felt))


def slopes(system: System, read: ReadCell, felt: Aboard, own: Mapping[str, Real]) -> tuple[Real, ...]:
    """Slopes of the sensors' states at a stage, in their order. own: the states, by channel."""
    by_channel: dict[str, Real] = {}
    for fitted in system.sensors:
        if fitted.sensor.follow is not None:
            by_channel.update(sensing.sensor_slopes(system, fitted, read, own, measured(system, fitted, read, felt)))
    return tuple(by_channel[name] for fitted in system.sensors for name in fitted.channels)


def tick(system: System, tape: Tape, divisor: int) -> None:
    """A tick of the sensors with this divisor, on the state at this time."""
    y, stands = _state(system, tape, tape.time)
    tree, period = system.tree(tape.read), divisor / system.structure.schedule.base_hz
    for fitted, use in zip(system.sensors, system.structure.sensors, strict=True):
        if use.divisor == divisor:
            felt = Aboard(system, tape.read, tree, y, stands, tape.time, tape.time, None, use.place)
            find = partial(measured, system, fitted, tape.read, felt)
            sensing.tick(system, tape, fitted, find, divisor, period, tape.read)


def measured(system: System, fitted: Fitted, read: ReadCell, felt: Aboard) -> Real:
    """The quantity that a sensor measures."""
    assert fitted.sensor.measures is not None
    return answer(fitted.owner, fitted.sensor.measures, sensing.values(system, fitted, read), felt)


def _state(system: System, tape: Tape, time: Real) -> tuple[Motion, BaseMotion]:
    """The arm at an instant, and its base."""
    y = bodies.with_zero_turn(system, cells.state(tape, bodies.coordinates(system), system.states))
    return y, base_of(system, tape.read, y, time)
