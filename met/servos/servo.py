"""What a servo is to the engine: a declaration, a tick of its computer, and the physics between ticks.

A servo is split where the real one is. What a computer does runs at the servo's rate and is held between its
ticks (`tick`, over `Memory`); what nature does is part of the derivative, evaluated at every stage of every step
(`drive`, over `State`). Both are ordinary functions over numbers that may be traced (docs/models.md).

Everything the servo gives back is on the joint's side of the gearbox, in joint units: rad, rad/s, N m; m, m/s, N
on a prismatic joint.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any

from met.frozen import frozen
from met.parameter import Memory, Parameter, Signal, State
from met.servos.motor import Motor
from met.trace import Real, Truth


@frozen
class Asked:
    """What the joint's command asks at a tick: its kind, its value and the value's rate of change.

    kind   "rate" (value in rad/s), "position" (rad), "torque" (N m, at the joint) or "acceleration" (rad/s^2); m/s, m,
           N and m/s^2 on a prismatic joint
    value  slope = d(value)/dt
    """

    kind: str
    value: Real
    slope: Real


@frozen
class Seen:
    """What the servo's computer sees at a tick.

    q, qd   joint position and rate
    asked   the command
    period  time from this tick to the next, s
    time    of this tick, s
    """

    q: Real
    qd: Real
    asked: Asked
    period: float
    time: Real = 0.0


@frozen
class JointMotion:
    """What nature does to the servo's physics at a stage.

    q, qd    joint position and rate
    time     of the stage, s
    begin    time at which the dynamics step began that the stage is part of, s: for what changes from step to step
    command  kind of the joint's command, known while the servo is recorded; "none" where it has none
    """

    q: Real
    qd: Real
    time: Real
    begin: Real = 0.0
    command: str = "none"


@frozen
class Drive:
    """What the servo does to its joint at a stage.

    torque     smooth torque on the joint, viscous friction included, dry friction not (N m; N)
    dry        level of dry friction that opposes motion and holds at rest, >= 0 (N m; N). The engine decides
               between sticking and sliding (docs/physics.md, "Friction sticks"). The number 0.0: none, ever
    rotor      inertia that moves rigidly with the joint but is not the arm's: N^2 J_m (kg m^2; kg)
    given      None: the joint is in torque mode. A truth: where true, in acceleration mode with qdd = `qdd`
    qdd        the acceleration, where `given`
    slopes     d(state)/dt for each `State` of the servo, by name
    signals    value of each `Signal` of the servo, by name
    """

    torque: Real = 0.0
    dry: Real = 0.0
    rotor: Real = 0.0
    given: Truth | None = None
    qdd: Real = 0.0
    slopes: Mapping[str, Real] = field(default_factory=dict)
    signals: Mapping[str, Real] = field(default_factory=dict)


@frozen(kw_only=True)
class Servo:
    """The declaration of a servo model; one a file, in met/servos or in a package of your own.

    commands  kinds of command it understands, of "rate", "position", "torque", "acceleration"; empty: it takes none
    tick      (p, held, seen) -> new memory, by name. p: parameters by name. None: no computer
    drive     (p, held, states, joint) -> Drive
    fastest   (p) -> upper bound of the fastest rate constant of the joint's motion under this servo, 1/s, whatever
              arm it carries; for the plan's stability figure. None: no such bound
    motor     (p) -> the motor that a bed may take the place of (met/substitution): the servo's computer then sets
              `voltage`, one of its memories, on the bed. None: there is none to substitute
    follows   whether the joint goes with its command whatever the arm, so that a position command that begins
              elsewhere than the joint makes it jump, which is told (D169)
    at_rest   (p) -> whether its joint must begin at rest: another initial rate is an error. None: it need not
    """

    name: str
    doc: str
    parameters: tuple[Parameter, ...] = ()
    commands: tuple[str, ...] = ()
    memory: tuple[Memory, ...] = ()
    states: tuple[State, ...] = ()
    signals: tuple[Signal, ...] = ()
    tick: Callable[[Any, Any, Seen], Mapping[str, Real]] | None = None
    drive: Callable[[Any, Any, Any, JointMotion], Drive]
    fastest: Callable[[Any], Real] | None = None
    follows: bool = False
    motor: Callable[[Any], Motor] | None = None
    at_rest: Callable[[Any], Truth] | None = None
