"""The numbers of one case of a run, and what follows from them without its equations: lengths, limits, loads."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from functools import cached_property
from graphlib import TopologicalSorter
from types import SimpleNamespace

import numpy as np

from ic.meaning.checks.idle import INSTANTS, at_rest
from ic.meaning.control.servos import Use
from ic.meaning.parameters.owner import XYZ, Settled
from met import models
from met.plan import BASE, Structure
from met.plan.defaults import INERTIA
from met.vectors import rotation_about, rotation_rpy


class RunNumbers:
    """The numbers of one case of a run, and what follows from them for several scales.

    settled  parameters by path, also words and lists;  numbers: those that are numbers, in this case, SI
    ranges   least and largest of each number in all cases
    """

    def __init__(
        self,
        structure: Structure,
        uses: Iterable[Use],
        settled: Mapping[str, Settled],
        numbers: Mapping[str, float],
        ranges: Mapping[str, tuple[float, float]],
    ) -> None:
        self.structure, self.uses, self.settled, self.numbers = structure, tuple(uses), settled, numbers
        self.ranges = ranges
        self.duration = structure.schedule.duration
        self.instants = np.linspace(0.0, self.duration, INSTANTS)
        self.by_unit = defaultdict[str, list[tuple[str, Settled]]](list)
        for path, parameter in settled.items():
            self.by_unit[parameter.unit].append((path, parameter))
        self.moved = {link.name for link in structure.links} - {BASE, *structure.ground}
        """The links that move against the base."""
        self.lumped = {link.name for link in structure.links if link.lumped}
        self.kinds = {joint.name: joint.kind for joint in structure.moving}
        self.offsets = {joint.name: self.length(f"{joint.name}.at") for joint in structure.joints}
        self.extents = {link.name: self.extent(f"links.{link.name}") for link in structure.links}
        by_child = {joint.child: joint for joint in structure.joints}
        links = TopologicalSorter({child: [joint.parent] for child, joint in by_child.items()}).static_order()
        self.outward = tuple(by_child[link] for link in links if link in by_child)
        """The joints, each behind those between it and the base."""
        self.carried = defaultdict[str, list[str]](list)  # by each link: joints
        for joint in structure.joints:
            self.carried[joint.parent].append(joint.name)
        self.depths = {BASE: 0.0}  # of each link: length of the way from the base to its joint
        for joint in self.outward:
            self.depths[joint.child] = self.depths.get(joint.parent, 0.0) + self.offsets[joint.name]
        self.beyond = dict(self.extents)  # of each link: length of the longest way from its joint to an end
        for joint in reversed(self.outward):
            way = self.offsets[joint.name] + self.beyond.get(joint.child, 0.0)
            self.beyond[joint.parent] = max(self.beyond.get(joint.parent, 0.0), way)

    def largest(self, head: str, unit: str) -> dict[str, float]:
        """The parameters in this unit at this path or below it: the number, or of a list the one farthest from 0."""
        largest = {}
        for path, settled in self.by_unit[unit]:
            if path == head or path.startswith(f"{head}."):
                value = self.numbers.get(path, settled.value)
                if isinstance(value, tuple):
                    largest[path] = max(value, key=abs, default=0.0)
                elif isinstance(value, (int, float)):
                    largest[path] = float(value)
        return largest

    def is_placed(self, joint: str) -> bool:
        """True of a joint whose servo follows a position."""
        return any(use.joint == joint and use.command_kind == "position" for use in self.uses)

    def length(self, path: str) -> float:
        """The length of a vector; 0 where there is none."""
        return math.hypot(*(self.numbers.get(f"{path}.{axis}", 0.0) for axis in XYZ))

    def extent(self, head: str) -> float:
        """The largest size of a body's shape, m; 0 of one without."""
        sizes = [self.numbers.get(f"{head}.shape.{size}", 0.0) for size in ("length", "radius")]
        return max(*sizes, self.length(f"{head}.shape.size"))

    def beside_shape(self, head: str, point: np.ndarray) -> float | None:
        """The distance of a point of a body's frame from its rod, box or cylinder, m; None of a body without one."""
        along = self.settled.get(f"{head}.shape.along")
        if along is None:
            return None
        axis, size = XYZ.index(str(along.value)), self.vector(f"{head}.shape.size")
        half = 0.5 * size if size.any() else np.full(3, self.numbers.get(f"{head}.shape.radius", 0.0))
        half[axis] = 0.5 * (size[axis] or self.numbers.get(f"{head}.shape.length", 0.0))
        centre = np.zeros(3)
        centre[axis] = half[axis]
        return float(np.linalg.norm(np.maximum(np.abs(point - centre) - half, 0.0)))

    def beside_link(self, link: str, point: np.ndarray) -> float:
        """The distance of a point of a link's frame from the nearer of its shape and the box about its joint and those
        that it carries, m."""
        joints = [self.vector(f"{joint}.at") for joint in self.carried[link]]
        own = np.array([np.zeros(3), *joints])
        far = np.linalg.norm(np.maximum(np.maximum(own.min(axis=0) - point, point - own.max(axis=0)), 0.0))
        shape = self.beside_shape(f"links.{link}", point)
        return float(far) if shape is None else min(float(far), shape)

    def slender(self, head: str) -> tuple[float, float]:
        """Length and largest width of a cylinder or a box along its axis, m; 0 and 0 of another body."""
        along, size = self.settled.get(f"{head}.shape.along"), self.vector(f"{head}.shape.size")
        if along is None:
            return 0.0, 0.0
        axis = XYZ.index(str(along.value))
        wide = max(np.delete(size, axis).max(), 2.0 * self.numbers.get(f"{head}.shape.radius", 0.0))
        return float(size[axis] or self.numbers.get(f"{head}.shape.length", 0.0)), float(wide)

    @cached_property
    def span(self) -> float:
        """The longest way from a joint on the base over joints to the end of a shape, m."""
        chains = [self.beyond.get(joint.child, 0.0) for joint in self.structure.joints if joint.parent == BASE]
        return max(chains, default=0.0)

    @cached_property
    def reach(self) -> float:
        """The span, m; where it is 0 the distance of the farthest centre of mass."""
        coms = [self.length(f"links.{link.name}.com") for link in self.structure.links]
        return self.span or max(coms, default=0.0)

    @property
    def reach_words(self) -> str:
        return f"the arm's reach, {self.reach:.4g} m"

    def is_written(self, path: str) -> bool:
        """True where the deck wrote a number of this vector, or of this tensor."""
        ends = [f"{path}.{part}" for part in (*XYZ, *INERTIA)]
        components = [self.settled[end] for end in ends if end in self.settled]
        return any(
            component.origin.place is not None and component.origin.kind != "derived" for component in components
        )

    def gyration(self, head: str) -> float:
        """The largest radius of gyration of a body about a frame axis, m; 0 of one without mass."""
        mass = self.numbers.get(f"{head}.mass", 0.0)
        moments = [self.numbers.get(f"{head}.inertia.{part}", 0.0) for part in INERTIA[:3]]
        return math.sqrt(max(*moments, 0.0) / mass) if mass > 0.0 else 0.0

    def of_motor(self, use: Use, name: str) -> float | None:
        """A number of a servo's motor, by the name that all servos with motors share; None of one without."""
        return self.numbers.get(f"{use.joint}.servo.{name}")

    def largest_torque(self, use: Use) -> tuple[str, float] | None:
        """The largest torque of a servo's motor, N m, and the parameter that sets it; None where there is none."""
        torque, current, kt = self.limit(use, "N*m"), self.limit(use, "A"), self.of_motor(use, "kt")
        limits = [torque] if torque is not None else []
        if current is not None and kt is not None:
            limits.append((current[0], kt * current[1]))
        least = min(limits, key=lambda limit: limit[1], default=None)
        return least if least is not None and least[1] > 0.0 else None

    @cached_property
    def gravity(self) -> np.ndarray:
        """The acceleration of free fall, m/s^2, in the world's axes; zeros without gravity."""
        named = [use.name for use in self.structure.environment if use.model == "gravity"]
        return sum((self.vector(f"environment.{name}.g") for name in named), np.zeros(3))

    @cached_property
    def loads(self) -> dict[str, float]:
        """The torque (force) of gravity about (along) each moving joint's axis where the run begins, N m (N); none on a
        base that moves, or without gravity."""
        g = self.gravity
        if self.structure.base is not None or not g.any():
            return {}
        begins = {joint.name: self.numbers.get(f"initial.{joint.name}.q", 0.0) for joint in self.structure.moving}
        turned, places, lines = self.poses(begins)
        bodies = [
            (link.name, f"links.{link.name}", self.vector(f"links.{link.name}.com")) for link in self.structure.links
        ]
        for payload in self.structure.payloads:
            if not payload.grappled:
                head = f"payloads.{payload.name}"
                own = np.array(rotation_rpy(*self.vector(f"{head}.rpy"))) @ self.vector(f"{head}.com")
                bodies.append((payload.link, head, self.vector(f"{head}.at") + own))
        masses = dict.fromkeys(places, 0.0)
        moments = {link: np.zeros(3) for link in places}
        for link, head, centre in bodies:
            if link in places:
                mass = self.numbers.get(f"{head}.mass", 0.0)
                masses[link] += mass
                moments[link] = moments[link] + mass * (places[link] + turned[link] @ centre)
        loads = {}
        for joint in reversed(self.outward):
            axis, through = lines[joint.name]
            mass, moment = masses[joint.child], moments[joint.child]
            force = mass * g
            torque = np.cross(moment - mass * through, g)
            loads[joint.name] = float(axis @ (force if joint.kind == "prismatic" else torque))
            masses[joint.parent] += mass
            moments[joint.parent] = moments[joint.parent] + moment
        return {joint.name: loads[joint.name] for joint in self.structure.moving}

    def poses(
        self, q: Mapping[str, float]
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, tuple[np.ndarray, np.ndarray]]]:
        """Rotations and places of links against the base, and each joint's axis with a point of it, for positions of
        joints."""
        turned, places = {BASE: np.eye(3)}, {BASE: np.zeros(3)}
        lines: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for joint in self.outward:
            parent = turned[joint.parent]
            frame = parent @ np.array(rotation_rpy(*self.vector(f"{joint.name}.rpy")))
            axis = frame @ self.vector(f"{joint.name}.axis")
            origin = places[joint.parent] + parent @ self.vector(f"{joint.name}.at")
            pivot = frame @ self.vector(f"{joint.name}.pivot")
            way = q.get(joint.name, 0.0)
            turn = np.array(rotation_about(tuple(axis), way)) if joint.kind == "revolute" else np.eye(3)
            slide = axis * way if joint.kind == "prismatic" else 0.0
            turned[joint.child], places[joint.child] = turn @ frame, origin + pivot - turn @ pivot + slide
            lines[joint.name] = axis, origin + pivot
        return turned, places, lines

    def is_helped(self, joint: str) -> bool:
        """True where a model of the environment may bear a joint's load at the start: one that puts a force
        on an arm at rest, not of another joint alone, and does not begin later."""
        bearing = [use.name for use in self.structure.environment if at_rest(use) == "force"]
        others = [name for name in bearing if not self.numbers.get(f"environment.{name}.from", 0.0) > 0.0]
        joints = [self.settled.get(f"environment.{name}.joint") for name in others]
        return any(helped is None or helped.value == joint for helped in joints)

    def vector(self, path: str) -> np.ndarray:
        """A vector; zeros where there is none."""
        return np.array([self.numbers.get(f"{path}.{axis}", 0.0) for axis in XYZ])

    def limit(self, use: Use, unit: str) -> tuple[str, float] | None:
        """The parameter that limits a servo's output or signal of this unit, and its value; None where none does."""
        for signal in (*use.servo.outputs, *use.servo.signals):
            value = (
                self.numbers.get(f"{use.joint}.servo.{signal.limit}") if signal.limit and signal.unit == unit else None
            )
            if value is not None:
                return signal.limit, value
        return None

    def course(self, use: Use) -> tuple[np.ndarray, np.ndarray] | None:
        """Values and slopes of a servo's command through the run; None where it is not known by its numbers."""
        command = use.command
        if command is None or not command.model:
            return None
        profile = models.find_own("command").get(command.model)
        if profile is None:
            return None
        p = SimpleNamespace()
        for parameter in profile.parameters:
            path = f"{use.joint}.servo.command.{parameter.name}"
            value = self.numbers.get(path, self.settled[path].value if path in self.settled else None)
            if value is None:
                return None
            setattr(p, parameter.name, value)
        t = self.instants
        with np.errstate(all="ignore"):  # of a swing at 1e308 Hz there are no numbers
            values, slopes = (np.broadcast_to(np.asarray(samples, float), t.shape) for samples in profile.course(p, t))
        return values, slopes

    def motion(self, use: Use) -> tuple[np.ndarray, np.ndarray] | None:
        """Positions and rates that a command asks for at the run's instants, two arrays; those of a commanded rate
        begin at the joint's initial position. Under a command of another kind positions are not-a-number, and its
        values stand for the rates. None where the command's values in time are not known."""
        course, kind = self.course(use), use.command_kind
        if course is None or kind == "position":
            return course
        values, places = course[0], np.full_like(self.instants, math.nan)
        if kind == "rate":
            ways = np.cumsum(values[1:] + values[:-1]) * (0.5 * self.instants[1])
            places = self.numbers.get(f"initial.{use.joint}.q", math.nan) + np.append(0.0, ways)
        return places, values
