"""The system that an experiment describes: its models looked up, its parameters ready to be read.

This is what stays the same during a run. A parameter is a float where the plan gives it one value, and is read
from the case's memory where a sweep varies it (`PARAMETER` cells, computed once before the run).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

from met import models
from met.commands.profile import Profile
from met.diagnostic import Problem, error
from met.dynamics.coupling import Ratios
from met.dynamics.spatial import Six
from met.dynamics.tree import Body, Tree
from met.environments.environment import Environment
from met.frozen import frozen
from met.integrators.integrator import Integrator, Motion
from met.metrics.metric import Metric, furthest
from met.parameter import Memory, Parameter, State
from met.plan import (
    BASE,
    Experiment,
    Formula,
    Joint,
    LinkSensor,
    Payload,
    Quantity,
    SensorUse,
    ServoUse,
    Structure,
)
from met.plan.channel import Channel, channels
from met.plan.closing import Led, close, corners_of
from met.plan.defaults import of_environment, timing_defaults
from met.plan.uses import sensor_parts, servo_parts
from met.program.cells import NamedValues, answer, parameters, returned
from met.program.courses import recorded
from met.sensors.sensor import Sensor
from met.servos.servo import Drive, JointMotion, Parts, Servo
from met.substitution import BedModel, Law
from met.trace import Formulas, Graph, Real, Scalar, where
from met.vectors import Vector

PARAMETER, TREE, FURTHEST = "parameter:", "tree:", ":furthest"
"""Prefixes of the cells that hold a case's own parameters, and the parts of the tree that depend on them."""

ReadCell = Callable[[str], Real]


@frozen
class Fitted:
    """A sensor in use, of a joint or of a link: its declaration, its present parts, and the prefix of its cells'
    names."""

    use: SensorUse | LinkSensor
    sensor: Sensor
    parameters: tuple[Parameter, ...]
    states: tuple[State, ...]
    memory: tuple[Memory, ...]
    path: str

    @property
    def owner(self) -> str:
        """The sensor's name for messages."""
        return f"sensor `{self.path}` (model {self.sensor.name})"

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels of the sensor's states."""
        return tuple(f"{self.path}.{state.name}" for state in self.states)


@frozen
class Actuator:
    """A servo at work on a moving joint: its declaration, use, and number in the order of moving joints.

    parts    what there is of it in this use
    level    of its dry friction, where it is the same at all times and for all cases, N m (N); None where it varies
    gives    whether it may give the joint's acceleration
    may_leave_range  whether its states may be where they can never be
    levels   of the dry friction on its states, by name, as `level`
    sensors  through which its law sees
    """

    index: int
    use: ServoUse
    servo: Servo
    profile: Profile | None
    parts: Parts
    level: float | None
    gives: bool
    may_leave_range: bool
    levels: Mapping[str, float | None]
    sensors: tuple[Fitted, ...] = ()

    @property
    def ticks(self) -> bool:
        """True where the servo has a computer that ticks."""
        return self.servo.control is not None and not self.parts.continuous

    @property
    def path(self) -> str:
        return f"{self.use.joint}.servo"

    @property
    def states(self) -> tuple[str, ...]:
        """Channels of the servo's states, then those of its sensors."""
        own = [f"{self.path}.{state.name}" for state in self.parts.states]
        return (*own, *(name for sensor in self.sensors for name in sensor.channels))

    @property
    def command_kind(self) -> str:
        """Kind of the joint's command; "none" where it has none."""
        return self.use.command_kind

    @property
    def owner(self) -> str:
        """The servo's name for messages."""
        return f"servo `{self.use.definition}` of joint `{self.use.joint}` (model {self.use.model})"


@frozen
class System:
    """The models of one experiment, looked up, and its parameters, to be read by path.

    between_samples  whether metrics that move in steps of a sample are told between samples (`Metric.between`)
    furthest         whether metrics that samples may miss are also told with the furthest values between these, under
                     their names with `FURTHEST`
    """

    experiment: Experiment
    between_samples: bool = False
    furthest: bool = False

    @property
    def structure(self) -> Structure:
        return self.experiment.structure

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        return self.structure.moving

    @cached_property
    def followers(self) -> tuple[Joint, ...]:
        """The joints that follow others."""
        return tuple(joint for joint in self.joints if joint.follows)

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The joints' numbers, by name."""
        return {joint.name: i for i, joint in enumerate(self.joints)}

    def led(self, joint: Joint, read: ReadCell, q: Sequence[Real]) -> Led:
        """Position and ratio of a joint in a loop, with its derivative, as they follow from the position in q of the
        joint that leads the loop."""
        loop = joint.loop
        assert loop is not None
        number = lambda path: self.value(path, read) if path in self._parameters else 0.0  # noqa: E731  # a pivot
        corners = corners_of(loop, self.structure.joints, number)
        return close(corners, q[self.numbers[loop.leader]], left=loop.branch == "left")[0][joint.name]

    def _ratios(self, joint: Joint, read: ReadCell, q: Sequence[Real]) -> dict[int, Real]:
        """The ratios of a joint's rate to those of the joints that it follows directly, by their numbers."""
        if joint.loop is not None:
            return {self.numbers[joint.loop.leader]: self.led(joint, read, q).ratio}
        return {self.numbers[name]: self.value(path, read) for name, path in joint.ratio_paths.items()}

    def ratios(self, read: ReadCell, q: Sequence[Real]) -> Ratios:
        """The ratio of each joint's rate to those of the joints that lead it, at positions q; through followers of
        followers, to those that move by themselves."""

        def row(i: int) -> dict[int, Real]:
            """The ratio of joint i's rate to that of each joint that leads it."""
            if not self.joints[i].follows:
                return {i: 1.0}
            by_leader: dict[int, Real] = {}
            for other, ratio in self._ratios(self.joints[i], read, q).items():
                for leader, of_other in row(other).items():
                    by_leader[leader] = by_leader.get(leader, 0.0) + ratio * of_other
            return by_leader

        rows = {i: row(i) for i in map(self.joints.index, self.followers)}
        leaders = {leader for row_ratios in rows.values() for leader in row_ratios}
        return tuple(rows.get(i, {i: 1.0} if i in leaders else {}) for i in range(len(self.joints)))

    def bends(self, read: ReadCell, y: Motion) -> tuple[Real, ...]:
        """The accelerations of joints in loops while the joints that lead them have none, rad/s^2. Not-a-number for a
        loop that would be flat within two steps, since a longer step jumps across onto the same branch."""

        def bend(i: int) -> Real:
            """The acceleration of joint i while the joints that lead it have none."""
            joint = self.joints[i]
            own: Real = 0.0
            if joint.loop is not None:
                rate, led = y.qd[self.numbers[joint.loop.leader]], self.led(joint, read, y.q)
                is_flat_soon = 2.0 * self.structure.schedule.step * led.flattening * rate > 1.0
                own = where(is_flat_soon, math.nan, led.bend) * rate * rate
            return sum((ratio * bend(other) for other, ratio in self._ratios(joint, read, y.q).items()), own)

        return tuple(map(bend, range(len(self.joints))))

    def followed(self, read: ReadCell, y: Motion) -> Motion:
        """The motion with positions and rates of followers as those of their leaders give them."""
        if not self.followers:
            return y
        q, qd = list(y.q), list(y.qd)

        def place(i: int) -> int:
            """Set position and rate of joint i from those that lead it, and return i."""
            joint = self.joints[i]
            if joint.loop is not None:
                leader = place(self.numbers[joint.loop.leader])
                led = self.led(joint, read, q)
                q[i], qd[i] = led.q + self.value(f"{joint.name}.offset", read), led.ratio * qd[leader]
            elif joint.follows:
                ratios = [(place(other), ratio) for other, ratio in self._ratios(joint, read, q).items()]
                q[i] = sum((ratio * q[j] for j, ratio in ratios), self.value(f"{joint.name}.offset", read))
                qd[i] = sum((ratio * qd[j] for j, ratio in ratios), 0.0)
            return i

        for joint in self.followers:
            place(self.numbers[joint.name])
        return Motion(tuple(q), tuple(qd), y.x)

    @cached_property
    def channels(self) -> dict[str, Channel]:
        return channels(self.structure)

    @cached_property
    def integrator(self) -> Integrator:
        return models.find("integrator", self.structure.integrator)

    @cached_property
    def environment(self) -> tuple[tuple[str, Environment], ...]:
        """Environment models by the deck's name for them."""
        return tuple((use.name, models.find("environment", use.model)) for use in self.structure.environment)

    @cached_property
    def braked(self) -> frozenset[str]:
        """Joints on which environment models put dry friction."""
        return frozenset(
            str(self.experiment.parameters[f"environment.{name}.{model.friction_joint}"].value)
            for name, model in self.environment
            if model.friction_joint
        )

    @cached_property
    def failing(self) -> dict[str, list[tuple[str, Environment]]]:
        """Environment models about a servo, by its joint, with the deck's names for them."""
        by_joint: dict[str, list[tuple[str, Environment]]] = {}
        for name, model in self.environment:
            if model.servo_of:
                joint = str(self.experiment.parameters[f"environment.{name}.{model.servo_of}"].value)
                by_joint.setdefault(joint, []).append((name, model))
        return by_joint

    @cached_property
    def metrics(self) -> tuple[tuple[str, Metric, Channel], ...]:
        """The metrics by name, each with its model and the channel that it watches; those with furthest values
        behind."""
        uses = [(use, models.find("metric", use.model)) for use in self.structure.metrics]
        own = [
            (use.name, (metric.between or metric) if self.between_samples else metric, self.channels[use.of])
            for use, metric in uses
        ]
        more = [(name + FURTHEST, furthest(metric), channel) for name, metric, channel in own if self.furthest]
        return (*own, *((name, metric, channel) for name, metric, channel in more if metric is not None))

    @cached_property
    def actuators(self) -> tuple[Actuator | None, ...]:
        """One actuator for each moving joint, in order; None for a passive joint."""
        uses = {use.joint: use for use in self.structure.servos}
        return tuple(
            self._actuator(index, uses[joint.name]) if joint.name in uses else None
            for index, joint in enumerate(self.joints)
        )

    @property
    def working(self) -> tuple[Actuator, ...]:
        """The actuators of the joints that have one."""
        return tuple(actuator for actuator in self.actuators if actuator is not None)

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Channels of the states of servos and their sensors, then of links' sensors, in the order of `Motion.x`."""
        of_servos = (name for actuator in self.working for name in actuator.states)
        return (*of_servos, *(name for sensor in self.sensors for name in sensor.channels))

    @cached_property
    def sensors(self) -> tuple[Fitted, ...]:
        """The sensors of links."""
        return tuple(self._fitted(use, f"sensors.{use.name}") for use in self.structure.sensors)

    @cached_property
    def ticking_between(self) -> tuple[Actuator, ...]:
        """Servos that tick between instants: faster than the dynamics, or slower and no multiple of them."""
        step = self.structure.schedule.dynamics
        return tuple(actuator for actuator in self.working if actuator.ticks and actuator.use.divisor % step)

    @cached_property
    def mounted(self) -> tuple[tuple[Actuator, BedModel, Law], ...]:
        """The actuators of the joints whose motors are on a bed (a real or emulated shaft with a load motor), each with
        its bed's and its law's model, in the order of joints."""
        uses = {use.joint: use for use in self.structure.substitutions}
        return tuple(
            (a, models.find("bed", uses[a.use.joint].bed), models.find("law", uses[a.use.joint].law))
            for a in self.working
            if a.use.joint in uses
        )

    @cached_property
    def flying(self) -> tuple[Payload, ...]:
        """The payloads that move freely for a time."""
        return tuple(payload for payload in self.structure.payloads if payload.flies)

    @cached_property
    def courses(self) -> Formulas:
        """The motion of a prescribed base as recorded formulas of time (`met.program.courses`)."""
        return recorded(self.experiment)

    @cached_property
    def varying(self) -> tuple[str, ...]:
        """Paths of the parameters that vary with the case."""
        return tuple(sorted(path for path, q in self.experiment.parameters.items() if isinstance(q.value, Formula)))

    def value(self, path: str, read: ReadCell) -> Any:
        """A parameter: a float, list or word as the plan has it, or read from the case's memory."""
        value = self._parameters[path].value
        return read(PARAMETER + path) if isinstance(value, Formula) else value

    @cached_property
    def declared(self) -> dict[str, tuple[Parameter, ...]]:
        """The declarations of each environment model's parameters, by the prefix of their paths."""
        return dict(of_environment(self.experiment))

    @cached_property
    def _parameters(self) -> Mapping[str, Quantity]:
        return {**timing_defaults(self.experiment), **self.experiment.parameters}

    def mass(self, link: str, read: ReadCell) -> Real:
        """Mass of a link or payload, kg."""
        mass: Real = self.value(f"{self._head(link)}.mass", read)
        return mass

    def com(self, link: str, read: ReadCell) -> Vector:
        """Centre of mass of a link or payload in its frame, m."""
        return self.vector(f"{self._head(link)}.com", read)

    def inertia(self, link: str, read: ReadCell) -> Six:
        """xx, yy, zz, xy, xz, yz of a link or payload about its centre of mass in its axes, kg m^2."""
        head = self._head(link)
        xx, yy, zz, xy, xz, yz = (
            self.value(f"{head}.inertia.{entry}", read) for entry in ("xx", "yy", "zz", "xy", "xz", "yz")
        )
        return xx, yy, zz, xy, xz, yz

    def vector(self, path: str, read: ReadCell) -> Vector:
        """A parameter of three numbers."""
        x, y, z = (self.value(f"{path}.{axis}", read) for axis in "xyz")
        return x, y, z

    def _head(self, link: str) -> str:
        """Prefix of the paths of a link's or payload's parameters."""
        return (
            f"payloads.{link}" if any(payload.name == link for payload in self.structure.payloads) else f"links.{link}"
        )

    def servo_values(self, actuator: Actuator, read: ReadCell) -> NamedValues:
        return parameters(actuator.owner, actuator.path, actuator.parts.parameters, lambda path: self.value(path, read))

    def tree(self, read: ReadCell) -> Tree:
        """The arm for the dynamics: built once where no case varies it, else kept in the case's memory."""
        if self._fixed_tree is not None:
            return self._fixed_tree
        return self._tree(read).map_numbers(lambda name, _: read(TREE + name))

    def keep_tree(self, read: ReadCell, write: Callable[[str, Real], None]) -> None:
        """Compute the parts of the tree that vary with the case, and keep them for `tree`."""

        def keep(name: str, value: Real) -> Real:
            write(TREE + name, value)
            return value

        if self._fixed_tree is None:
            self._tree(read).map_numbers(keep)

    @cached_property
    def _fixed_tree(self) -> Tree | None:
        """The arm's tree where no case varies anything of it; else None."""
        joints = {joint.name for joint in self.structure.joints}
        for path in self.varying:
            head, *rest = path.split(".")
            if head in ("links", "payloads") or (head in joints and rest[0] in ("at", "rpy", "axis", "pivot")):
                return None
        return self._tree(lambda _: 0.0)

    def _tree(self, read: ReadCell) -> Tree:
        """The arm's tree of links and fixed payloads, with the numbers that `read` gives for parameters that vary."""
        numbers = {link.name: index for index, link in enumerate(self._link_order())}
        joints = {joint.child: joint for joint in self.structure.joints}
        bodies = []
        for link in self._link_order():
            joint = joints[link.name]
            bodies.append(
                Body(
                    name=link.name,
                    joint=joint.name,
                    kind=joint.kind,
                    parent=-1 if joint.parent == BASE else numbers[joint.parent],
                    at=self.vector(f"{joint.name}.at", read),
                    rpy=self.vector(f"{joint.name}.rpy", read),
                    axis=(0.0, 0.0, 1.0) if joint.kind == "fixed" else self.vector(f"{joint.name}.axis", read),
                    pivot=self.vector(f"{joint.name}.pivot", read) if self._has_pivot(joint) else (0.0, 0.0, 0.0),
                    mass=0.0 if link.root else self.mass(link.name, read),
                    com=self.com(link.name, read),
                    inertia=(0.0,) * 6 if link.root else self.inertia(link.name, read),
                )
            )
        if any(link.name == BASE for link in self.structure.links):
            bodies.append(self._fixed(BASE, -1, read))
        elif any(payload.link == BASE for payload in self.structure.payloads):
            bodies.append(Body(BASE, "", "fixed", -1))
        for payload in self.structure.payloads:
            if not payload.flies:
                at, rpy = (self.vector(f"payloads.{payload.name}.{name}", read) for name in ("at", "rpy"))
                bodies.append(replace(self._fixed(payload.name, numbers.get(payload.link, -1), read), at=at, rpy=rpy))
        return Tree.build(tuple(bodies), tuple(joint.name for joint in self.joints), free=self.structure.free)

    def _fixed(self, name: str, parent: int, read: ReadCell) -> Body:
        """A link or payload that no joint carries, rigid with its parent."""
        mass, com, inertia = self.mass(name, read), self.com(name, read), self.inertia(name, read)
        return Body(name, "", "fixed", parent, mass=mass, com=com, inertia=inertia)

    def _has_pivot(self, joint: Joint) -> bool:
        return f"{joint.name}.pivot.x" in self.experiment.parameters

    def _link_order(self) -> list[Any]:
        """Links in the order of the joints that carry them."""
        links = {link.name: link for link in self.structure.links}
        return [links[joint.child] for joint in self.structure.joints]

    def _actuator(self, index: int, use: ServoUse) -> Actuator:
        """The servo of a joint with its models looked up, and what it does to the joint by its nature: dry friction, a
        given acceleration. Raises Problem E219 where a given acceleration meets friction, or a joint that follows
        another."""
        servo = models.find("servo", use.model, use.place)
        has_course = use.command is not None and not use.command.guide
        profile = models.find("command", use.command.model, use.place) if use.command and has_course else None
        sensors = tuple(self._fitted(sensor, f"{use.joint}.servo.sensor.{sensor.of}") for sensor in use.sensors)
        bare = Actuator(index, use, servo, profile, servo_parts(use), None, False, False, {}, sensors)
        drive, level, levels = self._probe(bare)
        if drive.given is not None and (level != 0.0 or use.joint in self.braked):
            message = f"{bare.owner} gives both an acceleration and dry friction"
            if level == 0.0:
                message = f"{bare.owner} gives an acceleration, and a brake is on the joint"
            help = "a joint that is told its acceleration has no use for friction"
            raise Problem(error("E219", message, use.place, help=help))
        if drive.given is not None and self.joints[index].follows:
            message = f"{bare.owner} gives an acceleration, and the joint follows another"
            raise Problem(error("E219", message, use.place, help="put the servo on the joint that leads"))
        if level != 0.0 and any(model.decoupling is not None for _, model in self.failing.get(use.joint, ())):
            level = None  # brakes come and go
        return replace(
            bare,
            level=level,
            gives=drive.given is not None,
            may_leave_range=drive.state_out_of_range is not False,
            levels=levels,
        )

    def _fitted(self, use: SensorUse | LinkSensor, path: str) -> Fitted:
        declared, states, memory = (sensor_parts(use, group) for group in ("parameters", "states", "memory"))
        return Fitted(use, models.find("sensor", use.model, use.place), declared, states, memory, path)

    def _probe(self, actuator: Actuator) -> tuple[Drive, float | None, dict[str, float | None]]:
        """The servo's physics recorded once, to find its parts in use; and its levels of dry friction, where known
        beforehand."""
        graph, parts = Graph(), actuator.parts
        named = [*(output.name for output in parts.outputs), *(state.name for state in parts.integrals)]
        held = NamedValues(actuator.owner, {name: graph.input(name) for name in named})
        states = NamedValues(actuator.owner, {state.name: graph.input(state.name) for state in parts.natural})
        q, qd, time, begin = (graph.input(name) for name in ("q", "qd", "time", "begin"))
        joint = JointMotion(q, qd, time, begin, actuator.command_kind)
        p = self.servo_values(actuator, graph.input)
        drive = answer(actuator.owner, actuator.servo.drive, p, held, states, joint)

        def level(value: Real) -> float | None:
            return graph.value(value.ref) if isinstance(value, Scalar) else float(value)

        states_of_it = (state.name for state in parts.natural)
        returned(actuator.owner, "friction", drive.friction, states_of_it, all_of_them=False)
        return drive, level(drive.dry), {name: level(value) for name, value in drive.friction.items()}
