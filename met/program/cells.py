"""The memory of a case: its cells, their names, and the functions by which phases read and write them.

Channels are cells under their own paths (`shoulder.q`, `shoulder.servo.voltage`; `met.plan.channel`). The families
here are the engine's own: a colon keeps their names apart from paths.
"""

from __future__ import annotations

import linecache
import traceback
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from met.diagnostic import Place, Problem, did_you_mean, error
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.parameter import Parameter
from met.trace import Real, Truth, where
from met.trace.program import Tape


@frozen
class CellFamily:
    """Cells of one kind; called with the joint, state or index of one of them, it gives that cell's name.

    pattern  of the names, `{}` where a joint, a state, a payload or an index stands
    holds    what such a cell holds
    unit     of that, on a prismatic joint the unit in brackets
    """

    pattern: str
    holds: str
    unit: str

    def __call__(self, *names: object) -> str:
        return self.pattern.format(*names)


# Friction, by joint or by a state of its servo.
HAS_FRICTION = CellFamily("rubs:{}", "1 where there is dry friction in this case, else 0", "1")
FRICTION_MODE = CellFamily("friction:{}", "0 where it sticks, else the sign of the sliding", "1")
HOLDING = CellFamily("need:{}", "torque, or slope of a state, that dry friction must hold where it sticks", "N m (N)")

# The step under way, by channel or state.
SLOPE = CellFamily("slope:{}", "slope of a state at the instant", "the state's over s")
STAGE_SLOPE = CellFamily("k{}:{}", "slope of a rate or state at a settled stage, by the stage's number", "over s")
FIRST = CellFamily("first:{}", "memory of a servo as the step under way began", "the channel's")
BEFORE = CellFamily("before:{}", "rate or state as the step under way began", "the channel's")
CARRY = CellFamily("carry:{}", "slope with which a rate or state is carried forward between instants", "over s")

# Servos, by joint and quantity.
SEEN = CellFamily("saw:{}.{}", "what the law saw at its last tick", "the quantity's")

# Guides, by joint (rate, position) or by guide (time, frame).
GUIDE_RATE = CellFamily("guide:{}.rate", "rate that the guide asks of the joint", "rad/s (m/s)")
GUIDE_POSITION = CellFamily("guide:{}.position", "position that the guide asks of the joint", "rad (m)")
GUIDE_TIME = CellFamily("guide:{}.time", "time of the guide's last tick", "s")
GUIDE_FRAME = CellFamily("guide:{}.{}", "guided frame where a run begins: rows R00 ... R22, then x, y, z", "1; m")

# Payloads that fly for a time, by name.
PAYLOAD_STAGE = CellFamily("payload:{}:stage", "FLYING, CARRIED or RELEASED (met.program.motion.payloads)", "1")
PAYLOAD_POSE = CellFamily("payload:{}:held.{}", "pose in the link's frame: rows of R, then p", "1; m")
PAYLOAD_BODY = CellFamily(
    "payload:{}:body.{}", "mass, moments and inertia in the recursion's frame", "kg; kg m; kg m^2"
)
GRAPPLING = CellFamily("payload:{}:grappling", "1 at the instant of its grapple, else 0", "1")
GRAPPLED = CellFamily("payload:{}:grappled.{}", "a figure of its grapple (met.plan.outputs), 0: none", "the figure's")
AGAINST = CellFamily(
    "payload:{}:against.{}", "as it was grappled: its w and v against the link, and the link's there", "rad/s; m/s"
)
RELEASING = CellFamily("payload:{}:releasing", "1 at the instant of its release, else 0", "1")

# Bodies that move freely, by their prefix; their coordinates are `met.program.motion.bodies.FreeBody.coordinates`.
BODY_ORIENTATION = CellFamily("{}:orientation.{}", "unit quaternion at the step's beginning, w x y z", "1")

# Limits, by the path of the parameter that sets one, and by metric.
AT_LIMIT = CellFamily("at_limit:{}", "steps that began at the limit", "1")
EXCESS = CellFamily("excess:{}", "largest excess over a limit of a joint so far", "of the limit")
EXTREME_AT = CellFamily("extreme:{}:at_limit", "number of the limit where the metric's extreme fell, 0: none", "1")

# Motors on beds, by joint; the shaft's side of the gearbox but for Lambda and b_0.
READ = CellFamily("{}:read", "filtered rate of the shaft that was read at this tick", "rad/s")
READ_BEFORE = CellFamily("{}:before", "filtered rate that was read at the tick before", "rad/s")
SHAFT_RATE = CellFamily("{}:w", "rate of the shaft: the observer's, else the filtered one", "rad/s")
REFERENCE_RATE = CellFamily("{}:w_ref", "rate that the joint's own motor would have", "rad/s")
SHAFT_ANGLE = CellFamily("{}:angle", "angle of the shaft, the integral of its rate", "rad")
COVARIANCE = CellFamily("{}:P.{}.{}", "covariance of the observer's state, lower triangle", "products of its units")
OBSERVER_GAIN = CellFamily("{}:gain.{}", "gain of the observer on the surprise in a reading", "over rad/s")
OBSERVED = CellFamily("{}:observer.{}", "state of the observer: w, y, z, d (met.substitution.observer)", "rad/s; N m")
ARM_INERTIA = CellFamily("{}:Lambda.{}", "Lambda of tau_load = Lambda qdd + b_0, by both joints", "kg m^2 (kg)")
ARM_TORQUE = CellFamily("{}:b_0", "b_0 of the joint", "N m (N)")
GIVEN = CellFamily("{}:given", "acceleration that the law gives the joint", "rad/s^2 (m/s^2)")
GIVEN_FIRST = CellFamily("{}:given.first", "the same where the step under way began", "rad/s^2 (m/s^2)")
QUEUED = CellFamily("{}:queue.{}.{}", "voltage or current asked so many ticks ago, less one", "V; A")
SENT = CellFamily("{}:sent.{}", "voltage or current that goes over the wire now", "V; A")
RATE_WANTED = CellFamily("{}:rate_wanted", "rate of the joint that a drive's own rate loop is given", "rad/s (m/s)")
LOOP_INTEGRAL = CellFamily("{}:loop.integral", "integral of a drive's own rate loop, as it is believed", "rad")


def state(
    tape: Tape, joints: Sequence[str], states: Sequence[str], copy: str = "", without: Collection[str] = ()
) -> Motion:
    """The arm's state, or its copy under this prefix. without: joints whose cells are not read, but taken as 0."""
    return Motion(
        tuple(0.0 if joint in without else tape.read(f"{copy}{joint}.q") for joint in joints),
        tuple(0.0 if joint in without else tape.read(f"{copy}{joint}.qd") for joint in joints),
        tuple(tape.read(f"{copy}{name}") for name in states),
    )


def store(tape: Tape, active: Truth, joints: Sequence[str], states: Sequence[str], y: Motion, copy: str = "") -> None:
    """Write y as the state, or as its copy under this prefix, where active."""
    for joint, q, qd in zip(joints, y.q, y.qd, strict=True):
        keep(tape, active, f"{copy}{joint}.q", q)
        keep(tape, active, f"{copy}{joint}.qd", qd)
    for name, x in zip(states, y.x, strict=True):
        keep(tape, active, f"{copy}{name}", x)


def keep(tape: Tape, active: Truth, name: str, value: Real) -> None:
    """Write where active; other cases of the block keep their value."""
    tape.write(name, value if active is True else where(active, value, tape.read(name)))


def count(tape: Tape, event: Truth, name: str) -> None:
    """Increment a counter of an event where it happens."""
    keep(tape, event, name, tape.read(name) + 1.0)


T = TypeVar("T")

Read = Callable[[str], Any]
"""A function from a parameter's path to its value: a number (float or traced), a list or a word."""


class NamedValues:
    """Numbers by name. Reading a name that the model does not declare is reported as a mistake of the model's author,
    with its place."""

    __slots__ = ("_numbers", "_owner")

    def __init__(self, owner: str, numbers: Mapping[str, Any]) -> None:
        self._owner = owner
        self._numbers = dict(numbers)

    def __getattr__(self, name: str) -> Any:
        """The number of a name that the model has declared. Raises Problem E211 for another."""
        try:
            return self._numbers[name]
        except KeyError:
            pass
        if name.startswith("__"):
            raise AttributeError(name)
        declared = ", ".join(self._numbers) or "nothing"
        message = f"{self._owner} reads `{name}`, which it does not declare"
        raise Problem(error("E211", message, help=f"declared: {declared}"))


def parameters(owner: str, prefix: str, declared: Iterable[Parameter], read: Read) -> NamedValues:
    """The declared parameters of a model in use under the path `prefix`."""
    numbers: dict[str, Any] = {}
    for parameter in declared:
        path = f"{prefix}.{parameter.name}"
        if parameter.shape == "vector":
            numbers[parameter.name] = tuple(read(f"{path}.{axis}") for axis in "xyz")
        else:
            numbers[parameter.name] = read(path)
    return NamedValues(owner, numbers)


class Passing(BaseException):
    """Raised by the engine to leave a model's function before its end: no mistake of the model's."""


def answer(owner: str, function: Callable[..., T], *arguments: Any) -> T:
    """The answer of a model's function. Whatever it raises is reported at the model's own line, Problem E213,
    `sys.exit` too; only an interrupt, which comes from the user, passes."""
    try:
        with np.errstate(all="ignore"):  # constants may give NaN or infinity, as runs may: they go into the program
            return function(*arguments)
    except (Problem, Passing, KeyboardInterrupt):
        raise
    except BaseException as reason:  # a model's errors, of whatever kind, are for its author to read
        frames = traceback.extract_tb(reason.__traceback__)
        # the first frame is this function's own, the next one the model's, unless it called nothing written in Python
        own = [frame for frame in frames[1:] if frame.filename == frames[1].filename] or frames
        frame = own[-1]
        place = Place(frame.filename, frame.lineno or 1, (frame.colno or 0) + 1)
        if frame.end_colno is not None and frame.colno is not None and frame.end_lineno == frame.lineno:
            place = replace(place, length=max(frame.end_colno - frame.colno, 1))
        name = getattr(getattr(function, "func", function), "__name__", type(function).__name__)
        message = f"{owner}: `{name}` raises {type(reason).__name__}{f': {reason}' if str(reason) else ''}"
        sources = {frame.filename: "".join(linecache.getlines(frame.filename))}
        raise Problem(error("E213", message, place, help="mend the model, or tell its author"), sources) from reason


def returned(
    owner: str, what: str, numbers: Mapping[str, Real], declared: Iterable[str], *, all_of_them: bool = True
) -> Mapping[str, Real]:
    """The answer of a model's function, checked to hold exactly the names that the model declares, or some of them."""
    names = list(declared)
    missing = [name for name in names if name not in numbers] if all_of_them else []
    unknown = [name for name in numbers if name not in names]
    if missing or unknown:
        listed = ", ".join(numbers) or "nothing"
        message = f"{owner}: {what} gave back {listed}; declared are {', '.join(names) or 'none'}"
        remedy = "give back every declared name and no other" if all_of_them else "give back declared names alone"
        raise Problem(
            error("E212", message, help=[*(near for name in unknown for near in did_you_mean(name, names)), remedy])
        )
    return numbers
