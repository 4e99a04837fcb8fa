"""The declaration of a servo: its parameters, its control law, and the physics that the law drives.

A servo is split where the real one is: the law of its computer (`control`), and the physics (`drive`). Both are
ordinary functions over numbers that may be traced (docs/models.md). The physics is part of the derivative, evaluated at
every stage of every step. The law is written once and runs in one of two ways, as the deck says:

    rate = 1 kHz          sampled: at the servo's ticks; outputs are held between them, an integral x' = x + T slope
    rate = continuous     analog: a part of the derivative; its integrals are integrated with the arm

All of the servo's results are on the joint's side of the gearbox, in joint units: rad, rad/s, N m; m, m/s, N on a
prismatic joint.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from met.frozen import frozen
from met.messages.renamed import old_fields, old_names
from met.parameter import Declaration, Memory, Only, Parameter, Signal, State, is_present
from met.servos.motor import Motor, RateLoop
from met.trace import Real, Truth


@frozen
class Setpoint:
    """The joint's setpoint at a tick or a stage: the kind of its command, its value and the value's rate of change.

    kind   "rate" (value in rad/s), "position" (rad), "torque" (N m, at the joint) or "acceleration" (rad/s^2); m/s, m,
           N and m/s^2 on a prismatic joint
    value  slope = d(value)/dt
    """

    kind: str
    value: Real
    slope: Real


@old_fields(asked="setpoint")
@frozen
class Seen:
    """The quantities that the servo's control law sees, at a tick or a stage.

    q, qd   position and rate as the servo's encoder and tachometer measure them (`Servo.measured`), through sensors
    setpoint  of the joint's command
    period  time from this tick to the next, s; 0 of a continuous law
    time    of the tick or stage, s
    states  the servo's own states by name, which sensors on the motor's side see; `states.motor_rate`
    """

    q: Real
    qd: Real
    setpoint: Setpoint
    period: float
    time: Real = 0.0
    states: Any = None


@frozen
class Control:
    """The answer of the control law: its outputs by name, and the slopes of its integrals, in their units per
    second."""

    outputs: Mapping[str, Real] = field(default_factory=dict)
    slopes: Mapping[str, Real] = field(default_factory=dict)


@frozen
class JointMotion:
    """The motion of the joint that the servo's physics sees at a stage.

    q, qd    joint position and rate
    time     of the stage, s
    begin    time at which the dynamics step began that the stage is part of, s: for what changes from step to step
    command  kind of the joint's command, known while the servo is recorded; "none" where it has none
    coupled  how far the servo has hold of its joint, 1 unless something lets it go: what does not reach the joint does
             not act back on states of the servo either. Of torque and friction on the joint the engine takes its share
    """

    q: Real
    qd: Real
    time: Real
    begin: Real = 0.0
    command: str = "none"
    coupled: Real = 1.0


@old_fields(astray="state_out_of_range")
@frozen
class Drive:
    """The servo's action on its joint at a stage.

    torque     smooth torque on the joint, viscous friction included, dry friction not (N m; N)
    dry        level of dry friction that opposes motion and holds at rest, >= 0 (N m; N). The engine decides
               between sticking and sliding (docs/physics.md, "Friction sticks"). The number 0.0: none, ever
    rotor      inertia that moves rigidly with the joint but is not the arm's: N^2 J_m (kg m^2; kg)
    spin       angular momentum about the joint's axis of what turns with the joint in the link before it, for a joint
               rate of 1: N J_m, below zero where it turns against the joint (kg m^2; kg m). A free base feels it
    rotors     of states that are rates of something that turns about the joint's axis in the link before it, by name:
               its inertia, kg m^2. A free base feels it, and it feels the turning of its link
    given      None: the joint is in torque mode. A truth: where true, in acceleration mode with qdd = `qdd`
    qdd        the acceleration, where `given`
    slopes     d(state)/dt for each of the servo's `states`, by name; dry friction on a state not included
    friction   of states that are rates of something with dry friction, by name: the level of that friction, >= 0, as
               what it takes off the state's slope (a motor's F_c/J_m, rad/s^2). It sticks as the joint's does: a rate
               that comes to zero stays there while the slope is no larger than the level
    signals    value of each `Signal` of the servo, by name
    kinetic    energy of what turns in the servo otherwise than with the joint, J;  potential: of what is wound up in it
    state_out_of_range  true where a state is where it can never be: the step was too long for it, and the case fails
    """

    torque: Real = 0.0
    dry: Real = 0.0
    rotor: Real = 0.0
    spin: Real = 0.0
    rotors: Mapping[str, Real] = field(default_factory=dict)
    given: Truth | None = None
    qdd: Real = 0.0
    slopes: Mapping[str, Real] = field(default_factory=dict)
    friction: Mapping[str, Real] = field(default_factory=dict)
    signals: Mapping[str, Real] = field(default_factory=dict)
    kinetic: Real = 0.0
    potential: Real = 0.0
    state_out_of_range: Truth = False


@frozen(kw_only=True)
class Servo(Declaration):
    """The declaration of a servo model; one a file, in met/servos or in a package of your own.

    commands   kinds of command it understands, of "rate", "position", "torque", "acceleration"; empty: it takes none
    outputs    what its law gives, held between ticks where it is sampled
    integrals  what its law integrates
    control    (p, held, seen) -> Control. held: the integrals, and of a sampled law the outputs of its last tick; p:
               parameters by name. None: no law
    clocked    whether the law needs a clock, for it reads outputs of its last tick or the period: never continuous
    states     what nature integrates for it
    measured   (p, q, qd, states) -> position and rate that the law sees, on the joint's side, where encoder and
               tachometer sit elsewhere than at the joint. None: at the joint
    drive      (p, held, states, joint) -> Drive. held: outputs of the law, and its integrals
    begin      (p, q, qd) -> states where a run begins, by name, from the joint's position and rate there. None: as
               declared
    balance    (p, torque, seen) -> states and integrals, by name, with which the joint gets this torque at the start
               and the law asks for just that. seen: at time 0, with the states that `begin` gives, and a command that
               the joint be as it is. None: it is not balanced
    fastest    (p) -> upper bound of the fastest rate constant of the joint's motion under this servo, 1/s, whatever
               arm it carries; to hold the dynamics' step against. None: no such bound
    motor      (p) -> the motor that a bed may take the place of (met/substitution): the servo's computer then sets
               `voltage`, one of its outputs, on the bed. None: there is none to substitute
    motor_only word and value of it under which that is so; None: under all
    rate_loop  (p) -> the loop on that motor's rate which is a part of the law, and which a drive on a bed may have
               in its place. None: there is none, or it is no such loop
    rate_wanted  (p, q, setpoint) -> the joint rate that this loop is given, under rate and position commands
    fastest_law  (p) -> the same under a law that is continuous, whose gains then count. None: `fastest`
    swings     (p, kind) -> what of the servo swings by itself, in words, and a and b of x'' = -a x - b x' (1/s^2, 1/s),
               the joint held; kind is that of the command. None: nothing, or it is not known
    full       (p) -> outputs of the law at full drive, by name, for what makes a drive run away. None: there is no such
    follows    whether the joint goes with its command whatever the arm, so that a position command that begins
               elsewhere than the joint makes it jump, which is told (D169)
    at_rest    (p) -> whether its joint must begin at rest: another initial rate is an error. None: it need not
    """

    commands: tuple[str, ...] = ()
    outputs: tuple[Memory, ...] = ()
    integrals: tuple[State, ...] = ()
    states: tuple[State, ...] = ()
    signals: tuple[Signal, ...] = ()
    control: Callable[[Any, Any, Seen], Control] | None = None
    clocked: bool = False
    measured: Callable[[Any, Real, Real, Any], tuple[Real, Real]] | None = None
    drive: Callable[[Any, Any, Any, JointMotion], Drive]
    begin: Callable[[Any, Real, Real], Mapping[str, Real]] | None = None
    balance: Callable[[Any, Real, Seen], Mapping[str, Real]] | None = None
    fastest: Callable[[Any], Real] | None = None
    fastest_law: Callable[[Any], Real] | None = None
    swings: Callable[[Any, str], Mapping[str, tuple[Real, Real]]] | None = None
    full: Callable[[Any], Mapping[str, Real]] | None = None
    follows: bool = False
    motor: Callable[[Any], Motor] | None = None
    motor_only: Only | None = None
    rate_loop: Callable[[Any], RateLoop] | None = None
    rate_wanted: Callable[[Any, Real, Setpoint], Real] | None = None
    at_rest: Callable[[Any], Truth] | None = None

    @property
    def is_passive(self) -> bool:
        """True where it takes no command, has no law and holds no joint: it may be on a joint that follows another."""
        return self.control is None and not self.commands and self.at_rest is None

    @cached_property
    def parts_by_words(self) -> dict[tuple[tuple[tuple[str, str], ...], bool], Parts]:
        """The results of `parts`, by words and whether the law is continuous."""
        return {}

    @property
    def deciding(self) -> tuple[str, ...]:
        """Names of the word parameters on which parts of the servo depend (`only`), in order."""
        parts: tuple[Parameter | Memory | State | Signal, ...] = (
            *self.parameters,
            *self.outputs,
            *self.integrals,
            *self.states,
            *self.signals,
        )
        names = {part.only[0] for part in parts if part.only is not None}
        return tuple(parameter.name for parameter in self.parameters if parameter.name in names)


@frozen
class Parts:
    """The parts of a servo in one use of it, under that use's words and with its law sampled or continuous.

    natural  states that nature integrates
    memory   held from tick to tick, and recorded at ticks: outputs and integrals of a sampled law
    states   integrated with the arm: nature's first, then integrals of a continuous law
    shown    recorded at instants besides states: outputs of a continuous law, then signals
    """

    parameters: tuple[Parameter, ...]
    outputs: tuple[Memory, ...]
    integrals: tuple[State, ...]
    natural: tuple[State, ...]
    signals: tuple[Signal, ...]
    continuous: bool

    @property
    def memory(self) -> tuple[Memory | State, ...]:
        return () if self.continuous else (*self.outputs, *self.integrals)

    @property
    def states(self) -> tuple[State, ...]:
        return (*self.natural, *self.integrals) if self.continuous else self.natural

    @property
    def shown(self) -> tuple[Memory | Signal, ...]:
        return (*self.outputs, *self.signals) if self.continuous else self.signals


def parts(servo: Servo, words: Mapping[str, str], *, continuous: bool = False) -> Parts:
    """The parts of a servo that are present under these words, by parameter; a word left out has its default."""
    known, key = servo.parts_by_words, (tuple(sorted(words.items())), continuous)
    if key not in known:
        known[key] = _parts(servo, words, continuous)
    return known[key]


def _parts(servo: Servo, words: Mapping[str, str], continuous: bool) -> Parts:
    """The parts of a servo that are there under these words of its parameters."""
    groups = (servo.parameters, servo.outputs, servo.integrals, servo.states, servo.signals)
    if any(part.only is not None for group in groups for part in group):
        words = {
            parameter.name: parameter.default for parameter in servo.parameters if isinstance(parameter.default, str)
        } | dict(words)
        groups = tuple(tuple(part for part in group if is_present(part, words)) for group in groups)  # type: ignore[assignment]
    return Parts(*groups, continuous)


if not TYPE_CHECKING:  # a type checker knows the new names alone
    __getattr__ = old_names(__name__, {"Asked": "Setpoint"}, globals())
