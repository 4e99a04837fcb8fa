"""The declaration of a guide: it commands several joints together, which servos of theirs then follow.

In a deck a guide stands in a run, `guide tip = resolved_rate { ... }`, and moves the joints whose servos name it:
`command = rate(tip)`, `command = position(tip)`. A guide is one of two things. A computer that ticks (`steer`) sees
the arm and gives each joint's rate; the rate is held to its next tick, and a position command is the integral of the
rates from where the joint begins. A course in time (`course`) gives each joint's position and rate, and sees nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from typing import Any, Protocol

from met.frozen import frozen
from met.parameter import Declaration, Memory, Parameter
from met.trace import Real
from met.vectors import Matrix, Vector


@frozen
class Stance:
    """A frame that moves: its axes and origin in the world, its angular velocity and velocity, world axes."""

    R: Matrix
    p: Vector
    w: Vector
    v: Vector


class Arm(Protocol):
    """The arm at a tick, with the guide's joints at some positions. The guided frame has the axes of the parameter
    `link`, and its origin at the parameter `point` of it.

    answers  whether a free base answers the joints' rates as the conservation of momentum has it (the generalized
             Jacobian). Else it is taken as held. A base that is fixed or prescribed does what it does either way
    """

    def stance(self, *, answers: bool) -> Stance:
        """The guided frame; its velocities are those that it has with the guide's joints at rest."""

    def columns(self, *, answers: bool) -> Sequence[tuple[Vector, Vector]]:
        """The frame's angular velocity and velocity, world axes, for a unit of the rate of each guide's joint, in
        order."""


@frozen
class Sight:
    """The inputs of a guide's computer at its tick.

    time     s
    slides   of each of its joints, whether it is prismatic
    arm      as it is
    asked    with the guide's joints where it has asked them to be, the integral of its rates
    wanted   the path: where the guided frame is to be, and how it moves there
    """

    time: Real
    slides: tuple[bool, ...]
    arm: Arm
    asked: Arm
    wanted: Stance


@frozen
class Steered:
    """The result of a guide's computer: each joint's rate, in order, rad/s (m/s), and all its memory by name."""

    rates: Sequence[Real]
    memory: Mapping[str, Real] = field(default_factory=dict)


Steer = Callable[[Any, Sequence[Any], Sight], Steered]
Course = Callable[[Any, Sequence[Any], Sequence[Real], Real], Sequence[tuple[Real, Real]]]


@frozen(kw_only=True)
class Guide(Declaration):
    """The declaration of a guide; one a file, in met/guides or in a package of your own.

    parameters  read under their names from `p`. A guide with a path has `link`, a word, and `point`, a vector
    of_joint    parameters that each of its joints has; a deck writes one for all, `max_rate = 4 deg/s`, or one for a
                joint, `elbow.max_rate = 3 deg/s`
    components  (p) -> which of the pose (`met.plan.COMPONENTS`) the path has; None: there is no path. Words of p alone
    commands    kinds of command that its joints may take of it
    memory      what its computer shows of a tick
    error       name of that memory which is the distance from the path, m; "": none is
    fastest     (p) -> the rate constant with which its error falls, 1/s: 2 over its period, and it grows; None: unknown
    steer       (p, joints, sight) -> Steered, joints the parameters of each; None: it is a course
    idle        (p, duration) -> the parameters because of which it, or some part of it, does nothing in a run of this
                length (s), and why, in words that follow its name; None where all may act. Asked where all its numbers
                are constants. None: it always may
    undefined   where its rates are no numbers, in words that follow its name: told of a case that fails so. "": nowhere
    course      (p, joints, begins, t) -> position and rate of each joint at time t (s); begins: where each begins
    """

    of_joint: tuple[Parameter, ...] = ()
    components: Callable[[Any], tuple[str, ...]] | None = None
    commands: tuple[str, ...]
    memory: tuple[Memory, ...] = ()
    error: str = ""
    fastest: Callable[[Any], Real] | None = None
    steer: Steer | None = None
    idle: Callable[[Any, float], tuple[tuple[str, ...], str] | None] | None = None
    undefined: str = ""
    course: Course | None = None

    @property
    def written(self) -> tuple[Parameter, ...]:
        """The parameters as a deck writes them: those of each joint too."""
        return (*self.parameters, *(replace(p, doc=f"for each joint: {p.doc}") for p in self.of_joint))
