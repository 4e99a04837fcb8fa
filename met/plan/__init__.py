"""The run plan: the resolved contents of a deck, in SI, with the origin of every value; the input of the engine.

A plan is a portable file (`plan_file`): it holds everything that the engine needs and nothing of the deck's syntax.
One plan holds one or more experiments (the runs and sweeps that were asked for); the cases of one experiment share
one structure, hence one kernel, and differ in parameters alone.

Parameters are named by paths, the ones a deck uses inside a run:

    links.<link>.mass                      kg
    links.<link>.com.x|y|z                 m, link frame
    links.<link>.inertia.xx|yy|zz|xy|xz|yz kg m^2, about the centre of mass, link axes
    <joint>.at.x|y|z                       m, parent link's frame
    <joint>.rpy.x|y|z                      rad, fixed x-y-z (R = Rz Ry Rx)
    <joint>.axis.x|y|z                     unit vector in the joint frame
    <joint>.pivot.x|y|z                    m, joint frame: a point of a revolute joint's axis; not there: the origin
    <joint>.q_min|q_max|qd_max|tau_max     rad, rad/s, N m (m, m/s, N): limits of the joint, those that it has
    <joint>.ratio|offset  .ratio.<other>   of a joint that follows one, or several: q = ratio times the other's + offset
    <loop>.at|to_at.x|y|z                  m: the pin of a loop, in the frames of its two links
    <joint>.servo.<parameter>              as the servo declares
    <joint>.servo.command.<parameter>      as the command declares
    <joint>.servo.sensor.<of>.<parameter>  as the sensor declares through which the servo's law sees a quantity
    <joint>.bed|law.<parameter>            as the bed declares that the joint's motor is on, or the law of its load
    <joint>.bed.scale.torque|rate|voltage  of a bed whose motor is of another size than the joint's
    initial.<joint>.q|qd                   rad, rad/s (m, m/s)
    initial.base.position|velocity.x|y|z   of a free base, world axes, m, m/s; .rpy (rad, fixed x-y-z), .rate (rad/s)
    base.<component>.<parameter>           of a prescribed base, as the profile declares that gives this component
    environment.<name>.<parameter>         as the environment model declares; uniform gravity is `gravity`, `g`
    guides.<name>.<parameter>              as the guide declares
    guides.<name>.<joint>.<parameter>      of each joint that the guide moves, as the guide declares
    guides.<name>.<component>.<parameter>  of its path, as the profile declares that gives this component
    metrics|sensors.<name>.<parameter>     as the metric declares, or the sensor that is on a link
    payloads.<name>.mass .com.x .inertia.xx ...             of a payload, as of a link, in its own frame
    payloads.<name>.at|rpy.x|y|z           its frame in its link's, m, rad (fixed x-y-z): where it is held from the
                                           start; of one that is grappled `at` alone, the point that it should come to
    payloads.<name>.grapple|release        s; each only where it is grappled, released
    payloads.<name>.position|attitude|velocity|rate.x|y|z   where it is grappled: how it flies first (attitude: rpy)

A vector parameter of a model is three numbers, `.x .y .z`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from met.diagnostic import Place
from met.frozen import frozen, keyed
from met.parameter import BASE as BASE
from met.plan.chains import ground, springs, straightened
from met.plan.closing import Loop
from met.plan.columns import CaseValues, FormulaColumn, ShiftedColumn, all_rows, listed
from met.plan.judged import (
    LinearUse,
    MetricUse,
    Requirement,
    SignalExpression,
    StepErrorLimit,
    Tolerance,
)
from met.plan.mesh import Mesh as Mesh
from met.plan.run_keys import BALANCED, VELOCITY_PRODUCTS, run_key
from met.plan.searches import Search
from met.trace.graph import Formulas

JointKind = Literal["revolute", "prismatic", "fixed"]

COMPONENTS = ("x", "y", "z", "roll", "pitch", "yaw")
"""Components of the pose of a prescribed base, and of a guide's path: m, and rad about fixed x, y, z."""

INSTANT = 1e-6
"""Share of a step of the dynamics by which a written time may lie after the instant that it means: rounding."""

REPEAT, SEED = "noise:repeat", "noise:seed"
"""Inputs of a program besides coordinates: no path of a deck's has a colon."""


@frozen
class Origin:
    """The origin of a value: the place that wrote it, the places it overrode (latest first), and in words.

    kind: "deck", "default" (a model's declaration; place is None), "case" (a sweep varies it, at `place`) or
    "derived" (computed from others, such as a rod's inertia; `note` says how).
    """

    kind: Literal["deck", "default", "case", "derived"]
    place: Place | None = None
    overrides: tuple[Place, ...] = ()
    note: str = ""


@frozen
class Formula:
    """A value that varies with the case: output number `output` of the structure's `formulas`."""

    output: int


@frozen
class Quantity:
    """A resolved parameter: SI value (or formula, list or word), its SI unit as text, its origin."""

    value: float | tuple[float, ...] | str | Formula
    unit: str
    origin: Origin


@frozen
class Link:
    """A rigid body; its numbers are parameters. `shape` is its picture, in words of `ic` (kind, numbers in SI).

    meshes  what it looks like, where files say so
    lumped  whether its numbers are an identified set (base parameters), which need not be those of a body
    root    of a boom: the piece at its root. The boom itself is a frame at its tip: its numbers are those of the whole,
            and its pieces have the matter
    """

    name: str
    place: Place | None = keyed("never", default=None)
    shape: tuple[str, tuple[tuple[str, float], ...]] | None = keyed("never", default=None)
    lumped: bool = keyed("never", default=False)
    root: str = keyed("where set", default="")
    meshes: tuple[Mesh, ...] = keyed("never", default=())


@frozen
class Joint:
    """Connects `parent` (a link or the base) to `child`, along or about its axis.

    limits   those of `q_min`, `q_max`, `qd_max` and `tau_max` that the joint has
    follows  the joints whose positions give its own;  loop: by which it follows one, and not in proportion
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    place: Place | None = keyed("never", default=None)
    limits: tuple[str, ...] = keyed("where set", default=())
    follows: tuple[str, ...] = keyed("where set", default=())
    loop: Loop | None = keyed("where set", default=None)

    @property
    def ratio_paths(self) -> dict[str, str]:
        """By each joint that it follows, the path of the parameter that is its ratio to that joint; none of a loop."""
        head, names = f"{self.name}.ratio", () if self.loop is not None else self.follows
        return {name: f"{head}.{name}" if len(names) > 1 else head for name in names}


@frozen
class Course:
    """One of `COMPONENTS` of a prescribed base or a guide's path, and the model of its course in time."""

    component: str
    model: str


@frozen
class Base:
    """A base that moves: by courses, component by component (those left out stay 0), or freely."""

    kind: Literal["prescribed", "free"]
    courses: tuple[Course, ...] = ()
    place: Place | None = keyed("never", default=None)

    @property
    def turns(self) -> bool:
        """True where the base may turn: it is free, or one of its angles is not constant."""
        return self.kind == "free" or any(
            course.component in COMPONENTS[3:] and course.model != "constant" for course in self.courses
        )


@frozen
class Command:
    """A servo's command: "rate", "position", "torque" or "acceleration", and the model of its course in time.

    guide  the guide that tells it, by its name in the deck; then there is no model, ""
    """

    kind: str
    model: str
    guide: str = keyed("where set", default="")


@frozen
class SensorUse:
    """A sensor through which a control law sees a quantity: `q`, `qd`, or a state of its servo. words: as a servo's."""

    of: str
    model: str
    words: tuple[tuple[str, str], ...] = keyed("where set", default=())
    place: Place | None = keyed("never", default=None)


@frozen
class ServoUse:
    """A servo on a joint: the definition's name in the deck, the model, the command.

    divisor     base ticks a tick of its control law; of one that is continuous, and where there is none, a step of the
                dynamics
    words       those of its parameters on which parts of the model depend (`Servo.deciding`), where they are not the
                defaults: name and word
    continuous  whether its control law is a part of the derivative
    sensors     through which its law sees; what none of them is of, it sees as it is
    """

    joint: str
    definition: str = keyed("never")
    model: str
    command: Command | None
    divisor: int
    place: Place | None = keyed("never", default=None)
    words: tuple[tuple[str, str], ...] = keyed("where set", default=())
    continuous: bool = keyed("where set", default=False)
    sensors: tuple[SensorUse, ...] = keyed("where set", default=())

    @property
    def command_kind(self) -> str:
        """The kind of the joint's command; "none" where it has none."""
        return "none" if self.command is None else self.command.kind


@frozen
class GuideUse:
    """A guide under a name of the deck's, which commands several joints.

    joints   that it moves, in the arm's order
    divisor  base ticks a tick of its computer, a multiple of the dynamics' step; of one without, that step
    courses  of its path's components; those left out stay 0
    """

    name: str
    model: str
    joints: tuple[str, ...]
    divisor: int
    courses: tuple[Course, ...] = ()
    place: Place | None = keyed("never", default=None)


@frozen
class LinkSensor:
    """A sensor of a link under a name of the deck's; which link is a parameter. words: as a servo's.

    divisor  base ticks a tick of it, a multiple of the dynamics' step
    """

    name: str
    model: str
    divisor: int
    words: tuple[tuple[str, str], ...] = keyed("where set", default=())
    place: Place | None = keyed("never", default=None)


@frozen
class Substitution:
    """A joint whose motor is on a bed: the models of bed and law. Its servo stays the same.

    All substituted joints of a structure have one law, and servos that tick together.

    scaled  whether the bed's motor is of another size than the joint's (met.substitution.bed_scale)
    """

    joint: str
    bed: str
    law: str
    place: Place | None = keyed("never", default=None)
    scaled: bool = keyed("where set", default=False)


@frozen
class EnvironmentUse:
    """An environment model under a name of the deck's. divisor None: evaluated at every stage; slides: whether its
    joint is prismatic, where units of its signals depend on that."""

    name: str
    model: str
    divisor: int | None = None
    place: Place | None = keyed("never", default=None)
    slides: bool = keyed("never", default=False)


@frozen
class Payload:
    """A rigid body that a link carries; its numbers are parameters.

    link      that carries it, the base too
    grappled  whether it flies freely first, until the link grapples it
    released  whether it flies freely in the end
    """

    name: str
    link: str
    grappled: bool = False
    released: bool = False
    place: Place | None = keyed("never", default=None)
    shape: tuple[str, tuple[tuple[str, float], ...]] | None = keyed("never", default=None)

    @property
    def flies(self) -> bool:
        """True where the payload moves freely for a time; otherwise it is always part of its link."""
        return self.grappled or self.released


@frozen
class Allowance:
    """A warning that a run allows, by its code, with the reason in one line."""

    code: str
    because: str
    place: Place | None = None

    def __str__(self) -> str:
        """The allowance as messages print it: `D105, because the report's own rates`."""
        return f"{self.code}, because {self.because}"


@frozen
class Schedule:
    """Rates as integer divisors of one base rate. A run of `ticks` base ticks has both ends, 0 and `ticks`.

    base_hz      base rate, Hz
    dynamics     base ticks a dynamics step
    record       base ticks a recorded row
    """

    base_hz: float
    dynamics: int
    record: int
    ticks: int

    @property
    def step(self) -> float:
        """Length of a dynamics step, s."""
        return self.dynamics / self.base_hz

    @property
    def duration(self) -> float:
        """Length of a run, s."""
        return self.ticks / self.base_hz

    @property
    def rows(self) -> int:
        """Recorded rows of a run that reaches its end."""
        return self.ticks // self.record + 1


@frozen
class Recorded:
    """One variable of the archive: a channel of one thing, or of all joints (`joints` then names them in order).

    name        the variable's name, as the deck records it: `q`, `shoulder.qd`, `links.tip.position`
    channels    paths of the scalar channels: joint by joint, and of each joint component by component
    unit        one for all, or one a channel
    components  what a vector's numbers are called, `x y z` or `w x y z`; none where there is one number
    """

    name: str
    channels: tuple[str, ...]
    joints: tuple[str, ...] = ()
    unit: tuple[str, ...] = keyed("never", default=("1",))
    doc: str = keyed("never", default="")
    components: tuple[str, ...] = keyed("never", default=())

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the variable at one instant: (joints, components), each where there are some."""
        return tuple(len(names) for names in (self.joints, self.components) if names)


@frozen
class Structure:
    """Everything that determines the compiled program, apart from values.

    base_meshes  what a base looks like that is no link
    """

    arm: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    servos: tuple[ServoUse, ...]
    environment: tuple[EnvironmentUse, ...]
    metrics: tuple[MetricUse, ...]
    velocity_products: bool = keyed("always", run_key=VELOCITY_PRODUCTS)
    integrator: str
    schedule: Schedule
    record: tuple[Recorded, ...]
    substitutions: tuple[Substitution, ...] = keyed("where set", default=())
    base: Base | None = keyed("where set", default=None)
    payloads: tuple[Payload, ...] = keyed("where set", default=())
    guides: tuple[GuideUse, ...] = keyed("where set", default=())
    sensors: tuple[LinkSensor, ...] = keyed("where set", default=())
    expressions: tuple[SignalExpression, ...] = keyed("where set", default=())
    balanced: bool = run_key(BALANCED)
    base_meshes: tuple[Mesh, ...] = keyed("never", default=())

    @property
    def free(self) -> bool:
        """True where the base moves freely."""
        return self.base is not None and self.base.kind == "free"

    @property
    def ground(self) -> tuple[str, ...]:
        """The links that do not move against the base: the base, where it is a link, and all links fixed to it."""
        return ground(self.links, self.joints)

    @property
    def history_bytes(self) -> int:
        """Size of one case's histories: doubles, a column a channel."""
        return 8 * self.schedule.rows * sum(len(recorded.channels) for recorded in self.record)

    @cached_property
    def springs(self) -> frozenset[str]:
        """Names of the joints at which booms bend and twist."""
        return springs(self.links, self.joints)

    @cached_property
    def straight(self) -> Structure:
        """The structure with each boom as the rigid link that it is while straight."""
        links, joints = straightened(self.links, self.joints)
        return replace(self, links=links, joints=joints)

    @property
    def moving(self) -> tuple[Joint, ...]:
        """The moving joints, in the order of `joints`: the order of every `joint` dimension."""
        return tuple(joint for joint in self.joints if joint.kind != "fixed")

    @property
    def independent(self) -> tuple[Joint, ...]:
        """The moving joints that follow no other, in the order of `joints`."""
        return tuple(joint for joint in self.moving if not joint.follows)

    @property
    def on_beds(self) -> dict[str, Substitution]:
        """The joints whose motors are on motor beds, by name, each with its substitution."""
        return {substitution.joint: substitution for substitution in self.substitutions}


Design = Literal["", "random", "lhs", "sobol", "saltelli"]
"""The ways in which values of a coordinate are drawn; "" where they are chosen."""


@frozen
class Coordinate:
    """One varied parameter of a sweep, by the path that the deck wrote; values are in SI, one a case, and in a long
    table computed on demand. sets: paths of the parameters that follow it directly. unit, scale: as the deck wrote it,
    for display; shown = value / scale. design: of the sample that drew it; "" where its values were chosen."""

    path: str
    unit: str
    scale: float
    values: CaseValues
    sets: tuple[str, ...]
    place: Place | None = None
    design: Design = keyed("never", default="")


@frozen
class Choice:
    """A coordinate of a sweep that decides the structure, so that it is one for all cases of an experiment.

    path   as the deck wrote it: `integrator`, `shoulder.servo`, `rates.dynamics`, `macro PAYLOAD`
    value  as the deck wrote it: `rk4`, `500 Hz`
    """

    path: str
    value: str
    place: Place | None = None


@frozen
class Cases:
    """The case table: `count` rows of coordinates, in the order that `met cases` prints.

    seed         of the noise. "common": cases that differ in coordinates alone feel the same noise; "independent": each
                 has noise of its own, by its case_key
    choices      what all these cases share, and other groups of the same sweep have otherwise
    repeats      number of each case's repeat, which has a stream of noise of its own; None where nothing is repeated
    positions    of each case in the table of its sweep, rising; None where they are 0 to count - 1
    until_shown  the most cases of a design point, which are run in order until its requirements with a confidence are
                 decided; 0 where all cases are run
    """

    count: int
    coordinates: tuple[Coordinate, ...] = ()
    seed: int = 0
    seeds: Literal["common", "independent"] = "common"
    choices: tuple[Choice, ...] = ()
    repeats: CaseValues | None = None
    positions: CaseValues | None = None
    until_shown: int = 0

    @property
    def noise(self) -> tuple[str, ...]:
        """Inputs of the program that give a case its own noise; they follow the coordinates."""
        return (*([REPEAT] if self.repeats is not None else []), *([SEED] if self.seeds == "independent" else []))

    @property
    def table(self) -> CaseValues:
        """Position of each case in the table of its sweep."""
        if self.positions is None:
            return all_rows(self.count)
        if isinstance(self.positions, np.ndarray):
            return self.positions.astype(np.int64)
        return ShiftedColumn(self.positions, 0, np.int64)


@frozen
class Experiment:
    """A run or sweep, or of a sweep of several structures one group: structure, parameters, cases.

    formulas   from the coordinates (inputs, by path) to every parameter that varies (`Formula.output`)
    sweep      what a group is of; "" where the experiment is the whole of its run or sweep
    allowances  warnings that are not given of it
    search     what chooses its cases, where these are not listed beforehand
    linear     answers that are asked for by name;  linear_metrics: figures of them, computed of each case after it has
               run: the model is the figure, `of` the name
    """

    name: str
    structure: Structure
    parameters: Mapping[str, Quantity]
    formulas: Formulas
    cases: Cases
    requirements: tuple[Requirement, ...] = ()
    place: Place | None = None
    notes: tuple[str, ...] = ()
    sweep: str = ""
    tolerances: tuple[Tolerance, ...] = ()
    step_errors: tuple[StepErrorLimit, ...] = ()
    allowances: tuple[Allowance, ...] = ()
    search: Search | None = None
    linear: tuple[LinearUse, ...] = ()
    linear_metrics: tuple[MetricUse, ...] = ()

    @property
    def metrics(self) -> tuple[MetricUse, ...]:
        """All its metrics: those that its program computes, then those of linear answers."""
        return (*self.structure.metrics, *self.linear_metrics)

    def allows(self, code: str) -> bool:
        """Return True if warnings with this code are suppressed for this experiment, at a check or at a run."""
        return any(allowance.code == code for allowance in self.allowances)

    def column(self, formula: Formula) -> CaseValues:
        """The values of a parameter that varies, one a case."""
        alone = Formulas(self.formulas.inputs, self.formulas.nodes, (self.formulas.outputs[formula.output],))
        inputs = {coordinate.path: coordinate.values for coordinate in self.cases.coordinates}
        return listed(FormulaColumn(alone, inputs, self.cases.count))

    @property
    def name_in_deck(self) -> str:
        """The name of the run or sweep in the deck, by which a user asks for it."""
        return self.sweep or self.name

    @property
    def varies(self) -> bool:
        """True for a sweep, or a group of one."""
        return bool(self.sweep or self.cases.coordinates or self.cases.choices or self.cases.repeats is not None)


@frozen
class Source:
    """A deck file: its name in messages, its text, the SHA-256 of its bytes, and its edition of the deck language, on
    which no result depends."""

    name: str
    text: str
    sha256: str
    edition: int = 1


@frozen
class Plan:
    """A resolved deck. `deck` names the root file; `sources` holds every file that was read.

    selected: how the runs and sweeps were asked for, by name or `all`; none where they are what the deck itself
    chooses. It gives an archive its name. settings: values set from outside of the deck, `PATH=VALUE`, as if the deck
    contained them.
    """

    deck: str
    experiments: tuple[Experiment, ...]
    sources: tuple[Source, ...] = ()
    defines: tuple[str, ...] = field(default=())
    selected: tuple[str, ...] = field(default=())
    settings: tuple[str, ...] = field(default=())
