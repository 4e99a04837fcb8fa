"""Initial models: a Python file with the declaration, and the parts of a small deck that uses it."""

from __future__ import annotations

from met.frozen import frozen


@frozen(kw_only=True)
class Beginning:
    """An initial model. In its texts $name stands for its name.

    group        of entry points in which it is offered
    declaration  what the entry point gives of the file
    module       the file
    to_see       what there is to be seen in the deck
    servo, guide, environment, integrator, metric, require      what stands in the deck
    """

    group: str
    declaration: str
    to_see: str
    module: str
    servo: str = "{ model = ideal;  bandwidth = 40 1/s;  command = rate(step(to = 0.5 rad/s, at = 0.1 s)); }"
    guide: str = ""
    environment: str = " "
    integrator: str = "modified_euler"
    metric: str = "final { of = hinge.qd; }"
    require: str = "seen > 0.4 rad/s"


SERVO = Beginning(
    group="met.servos",
    declaration="SERVO",
    to_see="the bar is brought to 0.5 rad/s by a torque that has a limit",
    servo="""{
    model   = $name;
    gain    = 20 N*m*s/rad;
    limit   = 5 N*m;
    rotor   = 0.2 kg*m^2;
    command = rate(step(to = 0.5 rad/s, at = 0.1 s));
}""",
    module='''\
"""$name: a drive whose torque is the rate error times a gain, within a limit.

    torque = clip(gain (qd_cmd - qd), -limit, limit)        qd_cmd is held from tick to tick

Say here what the model is, with its equations and their source, and what it is not. `met doc $name` prints it.
"""

from __future__ import annotations

from typing import Any

from met.parameter import Memory, Parameter, Signal
from met.servos import Servo
from met.servos.servo import Control, Drive, JointMotion, Seen
from met.trace import Real, clip

# These functions are called while the program is built, with recorded numbers: no `if` on a number, but
# `where(condition, a, b)` of met.trace; no `min` or math.sin, but `minimum`, `sin`. docs/models.md has the table.


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The servo's computer, at its rate: gives every output below."""
    return Control({"qd_cmd": seen.setpoint.value})


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """The servo's physics, at every stage of every step: torque on the joint, and what it shows."""
    wanted = p.gain * (held.qd_cmd - joint.qd)
    return Drive(torque=clip(wanted, -p.limit, p.limit), rotor=p.rotor, signals={"wanted": wanted})


def fastest(p: Any) -> Real:
    """No rate constant is larger than this, 1/s, whatever the arm: a step that is too long for it is warned of."""
    return p.gain / p.rotor


# `effort` is N*m, or N on a prismatic joint; `joint` is rad, or m.
SERVO = Servo(
    name="$name",
    doc=__doc__,
    commands=("rate",),
    parameters=(
        Parameter(name="gain", unit="effort*s/joint", above=0.0, doc="torque per rate error"),
        Parameter(name="limit", unit="effort", above=0.0, doc="largest torque"),
        Parameter(name="rotor", unit="effort*s^2/joint", above=0.0, doc="inertia of the drive seen at the joint"),
    ),
    outputs=(Memory(name="qd_cmd", unit="joint/s", doc="commanded rate"),),
    signals=(Signal(name="wanted", unit="effort", doc="torque that would be given without the limit"),),
    control=control,
    drive=drive,
    fastest=fastest,
)
''',
)

SENSOR = Beginning(
    group="met.sensors",
    declaration="SENSOR",
    to_see="the bar goes slower than the 0.5 rad/s asked, by the bias of what its servo sees",
    servo="""{
    model      = rigid_gearbox;
    ratio      = 100;
    kp         = 0.1 V*s/rad;
    ki         = 2 V/rad;
    v_max      = 48 V;
    resistance = 0.5 ohm;
    kt         = 0.1 N*m/A;
    tau_max    = 1.2 N*m;
    j_m        = 6e-5 kg*m^2;
    sensor qd  = $name { cutoff = 50 Hz;  bias = 0.05 rad/s;  noise = 0.002 rad/s; }
    command    = rate(step(to = 0.5 rad/s, at = 0.1 s));
}""",
    require="seen < 0.47 rad/s",
    module='''\
"""$name: a filter of order 1, then a bias and noise.

    y' = 2 pi cutoff (x - y)        x is the quantity that it is of; integrated with the arm
    reading = y + bias + noise n_k  n_k a normal deviate of tick k

Say here what the model is, with its equations and their source, and what it is not. `met doc $name` prints it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from met.parameter import Parameter, State
from met.sensors import Sensor
from met.sensors.sensor import Reading, Sensed
from met.trace import Real

# These functions are called while the program is built, with recorded numbers: no `if` on a number, but
# `where(condition, a, b)` of met.trace; no `min` or math.sin, but `minimum`, `sin`. docs/models.md has the table.


def follow(p: Any, states: Any, value: Real) -> Mapping[str, Real]:
    """The sensor's circuit, at every stage of every step: gives the slope of every State below."""
    return {"filtered": 2.0 * math.pi * p.cutoff * (value - states.filtered)}


def begin(p: Any, value: Real) -> Mapping[str, Real]:
    """Every State where a run begins: here the filter is settled."""
    return {"filtered": value}


def read(p: Any, held: Any, states: Any, sensed: Sensed) -> Reading:
    """The sensor's computer, at the servo's ticks: gives what the law sees."""
    return Reading(states.filtered + p.bias + p.noise * sensed.draw())


# `of` is the unit of the quantity: rad/s of `sensor qd`, rad of `sensor q`, ...
SENSOR = Sensor(
    name="$name",
    doc=__doc__,
    parameters=(
        Parameter(name="cutoff", unit="Hz", above=0.0, doc="cut-off frequency of the filter"),
        Parameter(name="bias", unit="of", default=0.0, doc="reading at zero of the quantity"),
        Parameter(name="noise", unit="of", default=0.0, at_least=0.0, doc="noise at each tick, rms"),
    ),
    states=(State(name="filtered", unit="of", doc="output of the filter"),),
    follow=follow,
    begin=begin,
    read=read,
)
''',
)

ENVIRONMENT = Beginning(
    group="met.environments",
    declaration="ENVIRONMENT",
    to_see="the drag on the bar's end is what the servo must overcome",
    environment=" drag = $name { link = bar;  damping = 3 N*s/m;  point = [1, 0, 0] m; } ",
    metric="max { of = hinge.tau; }",
    require="seen > 1 N*m",
    module='''\
"""$name: a drag on one link, a force against the velocity of one of its points.

    F = -damping v          v of the point, in the world

Say here what the model is, with its equations and their source, and what it is not. `met doc $name` prints it.
"""

from __future__ import annotations

from typing import Any

from met.environments import Environment
from met.environments.environment import Force, Loads, World
from met.parameter import Parameter

# This function is called while the program is built, with recorded numbers: no `if` on a number, but
# `where(condition, a, b)` of met.trace; no `min` or math.sin, but `minimum`, `sin`. docs/models.md has the table.


def loads(p: Any, world: World) -> Loads:
    """What acts on the arm at a stage: gravity, torques on joints, forces on links. Those of all models add up."""
    x, y, z = world.velocity(p.link, p.point)
    return Loads(forces=(Force(p.link, force=(-p.damping * x, -p.damping * y, -p.damping * z), point=p.point),))


ENVIRONMENT = Environment(
    name="$name",
    doc=__doc__,
    parameters=(
        Parameter(name="link", shape="word", names="link", doc="link that is held back"),
        Parameter(name="damping", unit="N*s/m", at_least=0.0, doc="force per velocity"),
        Parameter(
        name="point",
        unit="m", shape="vector", default=(0.0, 0.0, 0.0), doc="point at which it acts, in the link's frame"),
    ),
    loads=loads,
)
''',
)

COMMAND = Beginning(
    group="met.profiles",
    declaration="PROFILE",
    to_see="the bar goes to 0.5 rad/s smoothly, within 0.5 s",
    servo="{ model = ideal;  bandwidth = 40 1/s;  command = rate($name(to = 0.5 rad/s, over = 0.5 s)); }",
    module='''\
"""$name: from zero to a value along half a cosine, then that value.

    to (1 - cos(pi t/over))/2       while t < over

Say here what the course is, and what it is not. `met doc $name` prints it.
"""

from __future__ import annotations

import math
from typing import Any

from met.commands import Profile
from met.parameter import Parameter
from met.trace import Real, cos, sin, where

# This function is called while the program is built, with recorded numbers: no `if` on a number, but
# `where(condition, a, b)` of met.trace; no `min` or math.sin, but `minimum`, `sin`. docs/models.md has the table.


def course(p: Any, t: Real) -> tuple[Real, Real]:
    """The value at a time, s, and its slope."""
    turn = math.pi * t / p.over
    value = where(t < p.over, 0.5 * p.to * (1.0 - cos(turn)), p.to)
    slope = where(t < p.over, 0.5 * p.to * math.pi / p.over * sin(turn), 0.0)
    return value, slope


# `command` is the unit of the commanded quantity: rad/s of a rate, rad of a position, ...
PROFILE = Profile(
    name="$name",
    doc=__doc__,
    parameters=(
        Parameter(name="to", unit="command", doc="value that is reached"),
        Parameter(name="over", unit="s", above=0.0, doc="time that this takes"),
    ),
    course=course,
)
''',
)

METRIC = Beginning(
    group="met.metrics",
    declaration="METRIC",
    to_see="`seen` is the mean speed of the bar, there and back alike",
    metric="$name { of = hinge.qd; }",
    require="seen > 0.4 rad/s",
    module='''\
"""$name: the mean over time of the size of a channel, by the trapezoidal rule.

Say here what the metric is, and what it is not. `met doc $name` prints it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from met.metrics import Metric
from met.parameter import Memory
from met.trace import Real, absolute, where

# These functions are called while the program is built, with recorded numbers: no `if` on a number, but
# `where(condition, a, b)` of met.trace; no `min` or math.sin, but `minimum`, `sin`. docs/models.md has the table.


def update(p: Any, held: Any, x: Real, t: Real, dt: Real) -> Mapping[str, Real]:
    """At every sample: gives the new value of every Memory below. At the first sample dt is 0."""
    size = absolute(x)
    return {"area": held.area + dt * 0.5 * (held.last + size), "last": size, "until": t}


def result(p: Any, held: Any, t: Real) -> Real:
    """After the last sample."""
    length = where(held.until > 0.0, held.until, 1.0)  # `where` computes both sides: never divide by what may be zero
    return where(held.until > 0.0, held.area / length, held.last)


# `of` is the unit of the signal that is evaluated.
METRIC = Metric(
    name="$name",
    doc=__doc__,
    unit="of",
    memory=(
        Memory(name="area", unit="of*s", doc="integral so far"),
        Memory(name="last", unit="of", doc="size of the latest value"),
        Memory(name="until", unit="s", doc="time of the latest value"),
    ),
    update=update,
    result=result,
)
''',
)

INTEGRATOR = Beginning(
    group="met.integrators",
    declaration="INTEGRATOR",
    to_see="the bar is brought to 0.5 rad/s; `integrator` says by whom",
    integrator="$name",
    module='''\
"""$name: Ralston's method, order 2, which has the least bound of its error among those of two slopes.

    y+ = y + h (k1 + 3 k2)/4,       k2 = f(t + 2h/3, y + 2h/3 k1)

A. Ralston, Runge-Kutta methods with minimum error bounds, Mathematics of Computation 16, 1962. Say here what the method
is, and what it is not. `met doc $name` prints it.
"""

from __future__ import annotations

from collections.abc import Callable

from met.integrators import Integrator
from met.integrators.integrator import Motion, Slope, ahead, by_parts
from met.trace import Real


def advance(slope: Callable[[float, Motion], Slope], h: Real, y: Motion, k1: Slope) -> Motion:
    """The state at the end of a step of h s. `slope(c, y)` is the derivative at the share c of the step."""
    k2 = slope(2.0 / 3.0, ahead(y, 2.0 / 3.0 * h, k1))
    return ahead(y, h, by_parts(lambda a, b: 0.25 * a + 0.75 * b, k1, k2))


# real_limit: the h lambda below which a rate that decays as d(qd)/dt = -lambda qd stays stable.
INTEGRATOR = Integrator(name="$name", doc=__doc__, order=2, real_limit=2.0, advance=advance)
''',
)

GUIDE = Beginning(
    group="met.guides",
    declaration="GUIDE",
    to_see="the bar is brought to 0.5 rad along half a wave, as all joints would be that follow the guide",
    servo="{ model = ideal;  bandwidth = 40 1/s;  command = position(lead); }",
    guide="\n    guide lead  = $name { over = 1 s;  hinge.to = 0.5 rad; }",
    metric="final { of = hinge.q; }",
    require="seen > 0.49 rad",
    module='''\
"""$name: every joint goes to where it is told along half a cosine wave, all in the same time.

    q = begins + (to - begins) (1 - cos(pi t/over))/2       while t < over

Say here what the guide is, and what it is not. `met doc $name` prints it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from met.guides import Guide
from met.parameter import Parameter
from met.trace import Real, cos, sin, where

# This function is called while the program is built, with recorded numbers: no `if` on a number, but
# `where(condition, a, b)` of met.trace; no `min` or math.sin, but `minimum`, `sin`. docs/models.md has the table.


def course(p: Any, joints: Sequence[Any], begins: Sequence[Real], t: Real) -> list[tuple[Real, Real]]:
    """Position and rate of each joint at a time, s. `begins`: where they are when the run begins."""
    turn = math.pi * t / p.over
    share = where(t < p.over, 0.5 * (1.0 - cos(turn)), 1.0)
    rate = where(t < p.over, 0.5 * math.pi / p.over * sin(turn), 0.0)
    ways = [(begin, joint.to - begin) for joint, begin in zip(joints, begins, strict=True)]
    return [(begin + share * way, rate * way) for begin, way in ways]


# of_joint: what each joint that follows has of its own; a deck writes it for all, or as `JOINT.to`.
GUIDE = Guide(
    name="$name",
    doc=__doc__,
    parameters=(Parameter(name="over", unit="s", above=0.0, doc="duration of the move"),),
    of_joint=(Parameter(name="to", unit="joint", doc="position that is reached"),),
    commands=("position",),
    course=course,
)
''',
)

MODELS = {
    "servo": SERVO, "sensor": SENSOR, "environment": ENVIRONMENT, "command": COMMAND, "guide": GUIDE,
    "metric": METRIC, "integrator": INTEGRATOR,
}  # fmt: skip

TRIAL = """\
// $name.ic: a deck to try the $kind model `$name` in
//
// What is to be seen: $to_see.
//
//   met run $name.ic

deck 2;

arm trial {
    link bar { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}

servo drive $servo

run try {
    arm         = trial;
    servos      { hinge = drive; }$guide
    environment {$environment}
    rates       { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }
    integrator  = $integrator;
    duration    = 2 s;
    record      = [q, qd, tau];

    metric seen = $metric
    require $require;
}
"""

PROJECT = """\
# Offers the $kind model `$name` to MET. Into the Python that runs MET: pip install -e THIS_FOLDER

[build-system]
requires = ["setuptools >= 77"]
build-backend = "setuptools.build_meta"

[project]
name = "$distribution"
version = "0.1.0"
description = "A $kind model for MET"
requires-python = ">=3.11"

[project.entry-points."$group"]
$name = "$module:$declaration"

[tool.setuptools]
py-modules = ["$module"]
"""
