"""The declaration of an environment model: loads on the arm as functions of its pose and motion.

Evaluated at every stage of every step (`docs/physics.md`, "Rates"), as ordinary functions over numbers that may be
traced.

A step of the dynamics sees a window in time as the share of the step that lies in it. A load that jumped within a step
would cost an integrator its order. Multiplied by the share, the load has the right impulse, and a window that begins
and ends with steps is met exactly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, Literal, Protocol

from met.content import Content
from met.frozen import frozen
from met.instants import has_come
from met.messages.renamed import old_fields
from met.parameter import Declaration, Limit, Parameter, Signal
from met.trace import Real, Truth, both, clip, maximum, not_, where
from met.vectors import Matrix, Vector, cross, scale


class World(Protocol):
    """The view of the arm that an environment model has at a stage.

    time                 of the stage, s
    begin, step          time at which the dynamics step began that the stage is part of, and its length, s
    joints, links        names, in the plan's order; joints are those that move, but for springs of booms, and payloads
                         follow the links: where a link is asked for, a payload may be, whether a link carries it or not

    Where a link is asked for, but for its mass, centre and inertia, `WORLD` of `met.parameter` may be: it is at rest.
    """

    time: Real
    begin: Real
    step: float
    joints: tuple[str, ...]
    links: tuple[str, ...]

    def slides(self, joint: str) -> bool:
        """True for a prismatic joint."""

    def q(self, joint: str) -> Real:
        """A joint's position, rad (m)."""

    def qd(self, joint: str) -> Real:
        """A joint's rate, rad/s (m/s)."""

    def position(self, link: str, point: Vector = (0.0, 0.0, 0.0)) -> Vector:
        """World position, m, of a point given in the link's frame, m."""

    def velocity(self, link: str, point: Vector = (0.0, 0.0, 0.0)) -> Vector:
        """Velocity in the world, m/s, of a point given in the link's frame, m."""

    def to_world(self, link: str, vector: Vector) -> Vector:
        """Components in world axes of a vector given in the link's axes."""

    def orientation(self, link: str) -> Matrix:
        """Rows of the rotation that turns components in link axes into components in world axes."""

    def rate(self, link: str) -> Vector:
        """The link's angular velocity, rad/s, world axes."""

    def mass(self, link: str) -> Real:
        """The link's mass, kg."""

    def com(self, link: str) -> Vector:
        """The link's centre of mass in its own frame, m."""

    def inertia(self, link: str) -> tuple[Real, Real, Real, Real, Real, Real]:
        """xx, yy, zz, xy, xz, yz about the centre of mass, kg m^2, link axes."""


@frozen
class Force:
    """A force and a moment on a link, in the world's axes, the force at a point in the link's frame (m).

    On `WORLD` of `met.parameter` it does nothing.
    """

    link: str
    force: Vector = (0.0, 0.0, 0.0)
    moment: Vector = (0.0, 0.0, 0.0)
    point: Vector = (0.0, 0.0, 0.0)


@frozen
class Loads:
    """Loads of one environment model; those of several add up.

    gravity  acceleration of free fall, world axes (m/s^2)
    torques  torque on joints by name (N m; N)
    forces   wrenches on links
    dry      dry friction on joints by name, its level, N m (N): it opposes motion, and holds at rest. Of a model that
             declares the joint (`Environment.friction_joint`) alone
    """

    gravity: Vector = (0.0, 0.0, 0.0)
    torques: Mapping[str, Real] = field(default_factory=dict)
    forces: tuple[Force, ...] = ()
    dry: Mapping[str, Real] = field(default_factory=dict)


@frozen
class Touch:
    """The place at which two bodies touch, or would, in the world's axes.

    normal  unit vector along which they press the first apart from the other
    depth   of one in the other, m; below 0, the gap between them
    rate    at which the depth grows, m/s
    moving  velocity of the first against the other, at the point where they touch, m/s
    arm, other  that point from those at which the two are placed, `at` and `to_at`, m
    """

    normal: Vector
    depth: Real
    rate: Real
    moving: Vector
    arm: Vector
    other: Vector

    def forces(self, p: Any, force: Vector) -> tuple[Force, Force]:
        """A force on the first, and its opposite on the other, where they touch."""
        back = scale(-1.0, force)
        return Force(p.link, force, cross(self.arm, force), p.at), Force(p.to, back, cross(self.other, back), p.to_at)


@frozen
class Plate:
    """A rectangle that is fixed to a link: its middle, m, and its sides as vectors, m, in the link's frame."""

    link: str
    middle: Vector
    width: Vector
    height: Vector


@frozen
class Jet:
    """A jet of gas from a nozzle, as pictures draw it.

    link      that the nozzle is on, or `WORLD` of `met.parameter`
    point     the nozzle in that link's frame, m
    axis      where the gas goes to, in that link's axes; its length counts for nothing
    fires     share of the step in which it flows
    exponent  n of a density that falls with the angle from the axis as cos^n
    plate     that the gas meets
    """

    link: str
    point: Vector
    axis: Vector
    fires: Real
    exponent: Real
    plate: Plate


FILE = Parameter(name="file", shape="text", default="none", doc="CSV file whose columns take the place of the lists")


@old_fields(
    pushes="pushed_links",
    between="initial_range",
    rubs="friction_joint",
    loose="decoupling",
    gives="replaced_outputs",
    sees="replaced_reading",
    falls="free_fall",
    turns="world_rate",
)
@frozen(kw_only=True)
class Environment(Declaration):
    """The declaration of an environment model; one a file.

    loads  (p, world) -> Loads. None: it is no load
    at_rest  what it may put on an arm that stands still: `nothing`; a `weight`, which acts on every part; or a `force`,
           which may also bear the arm
    idle   (p, duration) -> the parameters because of which it never acts in a run of that length (s), and why, in
           words; None where it may act. Asked where all its numbers are constants. None: it always may
    pushed_links  (p) -> the parameters that name the links that it acts upon: a deck in which all of these are part of
           the ground is warned. None: it may act upon others
    initial_range  the two parameters that are the ends between which its joint should begin: a deck whose joint begins
           beyond is warned. (): there are none
    content  (p, duration) -> what it brings in a run of that length (s), where the dynamics' steps see it at their ends
           alone: a deck is warned where they do not carry that. Asked with numbers. None: nothing is known of it
    alone  (p) -> what only one model of a run should give, in words, such as "gravity": a deck with two is warned. "":
           nothing, with these numbers. None: several go together
    holds  (p) -> the parameters that name the two bodies that it holds where they are to each other, by a stiffness;
           one where the other is the ground: a deck in which servos tell all joints between them their accelerations
           is warned, for then it holds nothing. (): it holds none, with these numbers. None: it never does
    may_be_load  it is also a load, such as a balancing spring: nothing is said of what it holds where a metric sees
           torques
    springs  the parameter that names a joint, or with `touch` a link, and those of which one is the stiffness with
           which it is pushed back where it touches: a deck is warned where the dynamics' step is long for that
           (met/analysis/contact.py). (): there are none
    limits  those that it has: how much of a run is spent at each is kept of every case. (): there are none
    touch  (p, world) -> where two bodies touch. None: it is no contact of bodies
    lasts  (p, mass, rate) -> how long a contact lasts, s: of bodies of this reduced mass, kg, that meet at this rate,
           m/s
    jet  (p, world) -> the gas of which its loads come, which pictures show. None: they come of none
    signals  what it shows, each a channel `environment.NAME.SIGNAL`
    show  (p, world) -> the signals by name, a number or a vector each. None: it has none
    friction_joint  the parameter that names the one joint on which it puts dry friction. "": none does

    What it may do to the servo of one joint, such as to let it fail:

    servo_of  the parameter that names the joint
    decoupling  (p, step) -> how far the servo has let go of the joint in a step, from 0, not at all, to 1; step has
           `begin`, when it began, and `step`, its length (s)
    replaced_outputs  (p, time, outputs, full) -> outputs of the servo's law, by name, in the place of these. full: with
           what the servo's limits allow (`Servo.full`)
    replaced_reading  (p, time, of, value, last) -> what the law sees of the quantity `of` in the place of this value;
           last: what it saw at its last tick

    What of it no instrument on board feels:

    free_fall  (p, world, position, velocity) -> acceleration of a body that falls freely there, and moves so, beside
           `Loads.gravity`, world axes (m/s^2): of a model whose loads are gravitation, or that has the world turn
    world_rate  (p, world) -> angular velocity of the world's axes against directions that do not turn, world axes
           (rad/s)

    from_file  a deck may write `file` in the stead of the lists: they are then the columns of their names, and the
           list that rises is the column `time`
    """

    loads: Callable[[Any, World], Loads] | None = None
    at_rest: Literal["nothing", "weight", "force"] = "force"
    idle: Callable[[Any, float], tuple[tuple[str, ...], str] | None] | None = None
    pushed_links: Callable[[Any], tuple[str, ...]] | None = None
    initial_range: tuple[str, ...] = ()
    content: Callable[[Any, float], Content] | None = None
    alone: Callable[[Any], str] | None = None
    holds: Callable[[Any], tuple[str, ...]] | None = None
    may_be_load: bool = False
    springs: tuple[str, ...] = ()
    limits: tuple[Limit, ...] = ()
    touch: Callable[[Any, World], Touch] | None = None
    lasts: Callable[[Any, float, float], float] | None = None
    jet: Callable[[Any, World], Jet] | None = None
    signals: tuple[Signal, ...] = ()
    show: Callable[[Any, World], Mapping[str, Any]] | None = None
    friction_joint: str = ""
    servo_of: str = ""
    decoupling: Callable[[Any, Any], Real] | None = None
    replaced_outputs: Callable[[Any, Real, Mapping[str, Real], Mapping[str, Real]], Mapping[str, Real]] | None = None
    replaced_reading: Callable[[Any, Real, str, Real, Real], Real] | None = None
    free_fall: Callable[[Any, World, Vector, Vector], Vector] | None = None
    world_rate: Callable[[Any, World], Vector] | None = None
    from_file: bool = False

    @property
    def written(self) -> tuple[Parameter, ...]:
        """The parameters as a deck writes them."""
        return (*self.parameters, FILE) if self.from_file else self.parameters


class Step(Protocol):
    """A step of the dynamics: the time at which it began, and its length, s."""

    begin: Real
    step: float


WINDOW = (
    Parameter(name="from", unit="s", default=0.0, doc="time at which the effect begins"),
    Parameter(name="until", unit="s", default=math.inf, doc="time at which the effect ends; by default never"),
)


def share(world: Step, begins: Real, ends: Real) -> Real:
    """The share of the step that lies in begins <= t < ends; 0 where `ends` is the earlier."""
    return maximum(0.0, passed(world, ends) - passed(world, begins))


def passed(world: Step, time: Real) -> Real:
    """The share of the step that lies before this time."""
    before = clip((time - world.begin) / world.step, 0.0, 1.0)
    whole = has_come(time, world.begin + world.step)  # to rounding, as in the case of no share
    return where(has_come(world.begin, time), 0.0, where(whole, 1.0, before))


def open_at(p: Any, now: Real) -> Truth:
    """True where an instant lies in the window of a model that declares one: from <= now < until."""
    return both(has_come(now, getattr(p, "from")), not_(has_come(now, p.until)))


def never(begins: float, until: float, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why a window of constants contains no part of a run of this length, with the parameters that say
    so."""
    if begins >= until:
        return ("until", "from"), f"it would begin at {begins:g} s and end at {until:g} s"
    if begins >= duration:
        return ("from",), f"it would begin at {begins:g} s, and the run ends at {duration:g} s"
    if until <= 0.0:
        return ("until",), f"it would end at {until:g} s, and the run begins at 0 s"
    return None
