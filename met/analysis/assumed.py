"""What a run assumes: what it leaves out or holds, each with its size along the motion that is commanded.

The torques are those of inverse dynamics, tau = M qdd + h(q, qd), along the commands of the joints, with all others
where they start. Nothing is simulated: an arm that does not follow its commands has other torques.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from met.backends.reference.plain import begun
from met.dynamics.recursion import Solved, reactions, solve
from met.dynamics.spatial import ZERO, Vector
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.plan import Experiment, Joint
from met.plan.closing import in_loops
from met.program.build import Builder
from met.program.cells import parameters
from met.program.system import Actuator, System
from met.run import inputs

INSTANTS = 200
"""Number of instants, evenly spaced over the run, at which the commanded motion is looked at."""

EARTH = 9.80665
"""Acceleration of free fall on the Earth, m/s^2."""


@frozen
class Assumption:
    """An assumption of a run.

    subject  what it is about: "gravity", "velocity products", "base", "joint `elbow`"
    assumed  what is assumed of it, in words
    size     of what is left out or held, or None where it has none;  unit: of the size;  at: the joint where it is
    meaning  of the size, in words, "" where there is none
    """

    subject: str
    assumed: str
    size: float | None = None
    unit: str = ""
    at: str = ""
    meaning: str = ""


def assumptions(experiment: Experiment, case: int = 0) -> tuple[Assumption, ...]:
    """The assumptions of a run in this row of its case table. Raises Problem where the program cannot be built."""
    return tuple(_Along(experiment, case).assumptions())


class _Along:
    """A run along its commanded motion: its joints' positions q, rates qd and accelerations qdd, each an array of one
    number an instant."""

    def __init__(self, experiment: Experiment, case: int) -> None:
        """Compute the commanded motion of a case's joints at `INSTANTS` instants, and that of the joints that follow
        them."""
        builder = Builder(System(experiment))
        program = builder.program()
        (values,) = inputs(experiment, np.array([case]))
        tape = begun(program, dict(zip(program.inputs, values, strict=True)))
        with np.errstate(all="ignore"):
            self.derivative = builder.step.observed(tape).derivative
        self.system, self.parameters, self.read = builder.system, experiment.parameters, tape.read
        self.tree = self.system.tree(tape.read).map_numbers(lambda _, value: float(value))
        self.t = np.linspace(0.0, experiment.structure.schedule.duration, INSTANTS)
        motions = [
            self._course(actuator, joint) for actuator, joint in zip(self.system.actuators, self.names, strict=True)
        ]
        self.q, self.qd, self.qdd = ([motion[k] for motion in motions] for k in range(3))
        moving, turning = (
            self.system.followed(tape.read, Motion(tuple(self.q), tuple(rates)))  # type: ignore[arg-type]
            for rates in (self.qd, self.qdd)
        )
        self.q, self.qd, self.qdd = list(moving.q), list(moving.qd), list(turning.qd)  # type: ignore[arg-type]
        self.bends = [bend + np.zeros(INSTANTS) for bend in self.system.bends(tape.read, moving)]
        """Accelerations of joints in loops while their leaders go at constant rates, by joint."""
        self.qdd = [a + b for a, b in zip(self.qdd, self.bends, strict=True)]
        self.ratios = self.system.ratios(tape.read, moving.q)

    @property
    def names(self) -> list[str]:
        return [joint.name for joint in self.system.joints]

    def _course(self, actuator: Actuator | None, joint: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The commanded motion of a joint: where its command is of another kind, or follows a guide, it stays."""
        q, still = np.full(INSTANTS, float(self.read(f"{joint}.q"))), np.zeros(INSTANTS)
        profile = actuator.profile if actuator is not None else None
        if actuator is None or profile is None or actuator.command_kind not in ("position", "rate"):
            return q, still, still
        value = partial(self.system.value, read=self.read)
        p = parameters(actuator.owner, f"{actuator.path}.command", profile.parameters, value)
        commanded, slope = (np.broadcast_to(np.asarray(x, float), self.t.shape) for x in profile.course(p, self.t))  # type: ignore[arg-type]
        if actuator.command_kind == "position":
            smooth = profile.jump(p) == "none"
            return commanded, slope, np.gradient(slope, self.t) if smooth else still
        turned = np.concatenate([[0.0], np.cumsum(0.5 * (commanded[1:] + commanded[:-1]) * np.diff(self.t))])
        return q + turned, commanded, still if profile.jump(p) == "value" else slope

    def solved(self, *, gravity: Vector = ZERO, rates: bool = False, accelerations: bool = False) -> Solved:
        """Inverse dynamics with these of its parts, at all instants."""
        still, of_start = [np.zeros(INSTANTS)] * len(self.q), self.derivative.solved
        uniform = self.bends if rates and self.system.structure.velocity_products else still
        solved = solve(
            self.tree,
            self.q,  # type: ignore[arg-type]
            self.qd if rates else still,  # type: ignore[arg-type]
            qdd=self.qdd if accelerations else uniform,  # type: ignore[arg-type]
            mode=False,
            rotor=of_start.rotor,
            spin=of_start.spin,
            gravity=gravity,
            velocity_products=rates,
        )
        return replace(solved, tau=tuple(self._at_leaders(solved.tau, i) for i in range(len(self.q))))

    def _at_leaders(self, torques: Sequence[Any], joint: int) -> Any:
        """A joint's torque, with those of all that follow it, as it feels them; none of a follower."""
        if self.ratios[joint]:
            return sum((row[joint] * torque for row, torque in zip(self.ratios, torques, strict=True) if joint in row),
                       np.zeros(INSTANTS))  # fmt: skip
        return torques[joint]

    def largest(self, subject: str, assumed: str, meaning: str, torques: Sequence[Any]) -> Iterator[Assumption]:
        """An assumption with the largest of these torques by joint, over all instants; one with forces besides."""
        sizes = [float(np.max(np.abs(torque))) for torque in torques]
        for unit in ("N*m", "N"):
            indices = [i for i, joint in enumerate(self.system.joints) if _unit(joint) == unit and not joint.follows]
            if indices:
                worst = max(indices, key=sizes.__getitem__)
                yield Assumption(
                    subject, assumed, sizes[worst], unit, self.names[worst] if sizes[worst] else "", meaning
                )

    def assumptions(self) -> Iterator[Assumption]:
        """The assumptions of the run: gravity, velocity products, a base that is held, joints without drive or limits,
        and numbers that are 0 because the deck does not say them."""
        structure = self.system.structure
        if self.names and not structure.free:
            yield from self._gravity()
            yield from self._products()
            if structure.base is None:
                yield from self._base()
        for i, (joint, actuator) in enumerate(zip(self.system.joints, self.system.actuators, strict=True)):
            if joint.follows:
                leaders = " and ".join(f"`{name}`" for name in joint.follows)
                lost = "forces between teeth" if joint.loop is None else "friction in the loop's pin"
                assumed = f"follows {leaders} without play, elasticity or {lost}"
                yield Assumption(f"joint `{joint.name}`", assumed)
            elif not structure.free:
                yield from self._drive(i, joint, actuator)
        yield from self._zeros()

    @cached_property
    def gravity(self) -> tuple[float, float, float]:
        x, y, z = map(float, self.derivative.gravity)
        return x, y, z

    @cached_property
    def moving(self) -> Solved:
        """Inverse dynamics along the commanded motion with all that the run computes."""
        products = self.system.structure.velocity_products
        return self.solved(gravity=self.gravity, rates=products, accelerations=True)

    def _gravity(self) -> Iterator[Assumption]:
        """The gravity that is assumed, with its largest load on a joint; where there is none, with the load that the
        Earth's would be."""
        g = self.gravity
        if any(g):
            size = math.hypot(*g)
            signed = [f"{'-' if x < 0.0 else '+'}{axis}" for x, axis in zip(g, "xyz", strict=True) if abs(x) == size]
            direction = signed[0] if signed else f"[{', '.join(f'{x / size:.3g}' for x in g)}]"
            assumed, loads = f"{size:.4g} m/s^2 along {direction}", self.solved(gravity=g).tau
            yield from self.largest("gravity", assumed, "its largest load", loads)
            return
        axes = [self.solved(gravity=tuple(EARTH * x for x in axis)).tau for axis in np.eye(3).tolist()]  # type: ignore[arg-type]
        worst = [np.sqrt(sum(np.square(x) for x in components)) for components in zip(*axes, strict=True)]
        yield from self.largest("gravity", "none", "the Earth's largest load, in its worst direction", worst)

    def _products(self) -> Iterator[Assumption]:
        torques, taken = self.solved(rates=True).tau, self.system.structure.velocity_products
        meaning = "the largest that they are" if taken else "the largest that they would be"
        yield from self.largest("velocity products", "computed" if taken else "off", meaning, torques)

    def _base(self) -> Iterator[Assumption]:
        """The assumption that the base is held, with the largest force (N) and moment (N m) that a joint exerts on
        it."""
        wrenches, looped = reactions(self.tree, self.moving), in_loops(self.system.structure.joints)
        for part, unit, meaning in ((1, "N", "the largest force on it"), (0, "N*m", "the largest moment on it")):
            sizes = {
                self.names[i]: float(np.max(np.sqrt(sum(np.square(x) for x in wrenches[i][part]))))
                for i, joint in enumerate(self.tree.joints)
                if joint.parent < 0 and self.names[i] not in looped
            }
            if not sizes:
                return  # how the joints of a loop share its load is not known
            joint = max(sizes, key=sizes.__getitem__)
            yield Assumption("base", "held", sizes[joint], unit, joint, meaning)

    def _drive(self, i: int, joint: Joint, actuator: Actuator | None) -> Iterator[Assumption]:
        """The assumption about a joint that nothing drives, or that goes with its command whatever torque that
        takes."""
        if actuator is None or actuator.servo.follows:
            size = float(np.max(np.abs(self.moving.tau[i])))
            assumed, meaning = "no motor", "what its command takes, without a limit"
            if actuator is None:
                assumed, meaning = "no servo", "what would hold it where it starts"
            yield Assumption(f"joint `{joint.name}`", assumed, size, _unit(joint), joint.name, meaning)

    def _zeros(self) -> Iterator[Assumption]:
        """The assumption that numbers of servos are 0 where the deck does not say them, one for servos that are
        alike."""
        joints: dict[str, list[str]] = {}
        for actuator in self.system.working:
            known = {
                parameter.name: self.parameters.get(f"{actuator.path}.{parameter.name}")
                for parameter in actuator.parts.parameters
            }
            zeros = [name for name, x in known.items() if x and x.origin.kind == "default" and x.value == 0.0]
            if zeros and actuator.use.joint not in self.system.structure.springs:
                joints.setdefault(", ".join(zeros), []).append(f"`{actuator.use.joint}`")
        for names, alike in joints.items():
            subject = alike[0] if len(alike) == 1 else f"{alike[0]} and {len(alike) - 1} more"
            yield Assumption(f"servo of {subject}", f"0, as not written: {names}")


def _unit(joint: Joint) -> str:
    return "N*m" if joint.kind == "revolute" else "N"
