"""Environment models that do nothing in a run or act from its beginning, and models that contradict each other."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from ic.meaning.control.servos import Use, differ_beyond_rounding, unit_written
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters.models import idleness
from ic.meaning.parameters.owner import XYZ, Settled
from ic.meaning.parameters.scope import Scope
from met import models
from met.analysis.probe import accelerates
from met.diagnostic import Label, Place, leave_out
from met.environments.environment import Environment
from met.parameter import WORLD, Parameter
from met.plan import EnvironmentUse, Joint, Structure
from met.plan.chains import way_inward
from met.trace import Real, Scalar


def constant_value(scope: Scope, path: str) -> Any:
    """A parameter's value: a number or a word; None where it varies, or is unknown."""
    settled = scope.settled(path)
    return None if settled is None or isinstance(settled.value, Scalar) else settled.value


def constant_values(scope: Scope, head: str, declared: Iterable[Parameter]) -> SimpleNamespace | None:
    """The values of a model's parameters, as attributes of their names; None where one varies, or is unknown.
    Those that are there only under some words are left out.

    head  path of the model's use, such as `environment.stop`
    """
    values: dict[str, Any] = {}
    for parameter in (parameter for parameter in declared if parameter.only is None):
        path = f"{head}.{parameter.name}"
        if parameter.shape == "vector":
            parts = tuple(constant_value(scope, f"{path}.{axis}") for axis in XYZ)
            values[parameter.name] = None if None in parts else parts
        else:
            values[parameter.name] = constant_value(scope, path)
    return None if None in values.values() else SimpleNamespace(**values)


ENDS = ("q_min", "q_max")
"""The ends of a joint's range, which an arm gives it."""


def at_rest(use: EnvironmentUse) -> str:
    """`nothing`, `weight` or `force`: the largest load of a used model on an arm that stands still."""
    return str(models.find("environment", use.model, use.place).at_rest)


def remark_idle(scope: Scope, environment: Any, item: Item, values: Mapping[str, Any], duration: float) -> bool:
    """Return True, with a warning, if a model has no effect in the whole run by its written constants.

    values  with the bodies that links and payloads are parts of, in the place of their names
    """
    idle = idleness(environment, values, duration)
    if idle is not None:
        keys, why = idle
        body = item.body or MergedBlock()
        written = [part for name in keys if (part := body.get(name)) is not None and part.value is not None]
        scope.complaints.remark(
            "D168",
            f"environment `{item.name}` never acts: {why}",
            written[0].value_place if written else item.place,
            help=leave_out("change that, or leave it out", item.place),
        )
    return idle is not None


def remark_kinds(scope: Scope, environment: Any, item: Item, arm: ResolvedArm) -> None:
    """Report numbers for joints of a kind (`Parameter.joints`) that the arm does not have."""
    kinds = {joint.kind for joint in arm.moving}
    for parameter in environment.parameters:
        written = (item.body or MergedBlock()).get(parameter.name)
        if parameter.joints and parameter.joints not in kinds and written is not None and not arm.failed:
            scope.complaints.remark(
                "D168",
                f"`{parameter.name}` of environment `{item.name}` changes nothing: no "
                f"joint of arm `{arm.name}` is {parameter.joints}",
                written.value_place,
                help=leave_out("leave it out"),
            )


def remark_beginnings(scope: Scope, joints: Iterable[Joint], uses: Iterable[EnvironmentUse]) -> None:
    """Report joints that begin outside of their range, or of the ends between which a model keeps them. To be called
    after the initial state."""
    for joint in joints:
        ends = [scope.parameters.get(f"{joint.name}.{end}", scope.auxiliary.get(f"{joint.name}.{end}")) for end in ENDS]
        help = "begin within it, or move the end: the range of a joint holds nothing, and is only watched"
        _observe_beginning(scope, joint.name, ends, f"joint:{joint.name}", "its range", joint.place, help)
    for use in uses:
        model = models.find("environment", use.model)
        joint_parameters = [parameter.name for parameter in model.parameters if parameter.names == "joint"]
        named = [
            settled for name in joint_parameters if (settled := scope.parameters.get(f"environment.{use.name}.{name}"))
        ]
        if named and len(model.initial_range) == 2:
            ends = [scope.parameters.get(f"environment.{use.name}.{name}") for name in model.initial_range]
            help = "the run begins with what drives it back: begin within, or move the end"
            needs = f"environment.{use.name}"
            _observe_beginning(scope, str(named[0].value), ends, needs, f"an end of `{use.name}`", use.place, help)


def _observe_beginning(
    scope: Scope,
    joint: str,
    ends: Sequence[Settled | None],
    needs: str,
    owner: str,
    owner_place: Place | None,
    help: str,
) -> None:
    """Report a joint that begins beyond one of two ends. owner: whose they are, in words;  owner_place: its
    place"""
    begins = scope.parameters.get(f"initial.{joint}.q")
    known = [settled for settled in (begins, *ends) if settled is not None]
    if begins is None or owner_place is None or len(known) < 3:
        return
    place = next((settled.origin.place for settled in known if settled.origin.place), owner_place)
    unit, scale = unit_written(known, begins.unit)

    def warn(values: np.ndarray) -> None:
        """Warn where a joint begins beyond an end at which a model of the environment acts (D294). values: [case, 3],
        position and both ends, SI."""
        q, lower, upper = values.T
        below = (q < lower) & differ_beyond_rounding(q, lower)
        above = (q > upper) & differ_beyond_rounding(q, upper)
        beyond = np.flatnonzero(below | above)
        if beyond.size:
            q, lower, upper = values[beyond[0]] / scale
            which = f"below {lower:g} {unit}" if q < lower else f"above {upper:g} {unit}"
            scope.complaints.remark(
                "D294",
                f"joint `{joint}` begins at {q:g} {unit}, beyond {owner}: {which}",
                place,
                also=[Label(owner_place, "this one")],
                help=help,
            )

    values: tuple[Real, ...] = tuple(settled.value for settled in known)  # type: ignore[misc]  # they are numbers
    scope.checks.observe(values, warn, place, needs=(f"initial.{joint}.q", needs))


INSTANTS = 1000
"""Number of instants of a run at which a command is examined."""


def check_together(scope: Scope, uses: Iterable[Use], structure: Structure) -> None:
    """Warn of environment models that the servos, or each other, contradict."""
    servos = {use.joint: use for use in uses}
    for load in structure.environment:
        _remark_stop(scope, load, servos, structure.schedule.duration)
        _remark_hold(scope, load, servos, structure)
    _remark_alone(scope, structure.environment)


def _remark_stop(scope: Scope, load: EnvironmentUse, servos: dict[str, Use], duration: float) -> None:
    """Report a model that would keep a joint between two ends, where the servo moves on against any torque; not where
    its positions, during the run, are all between them."""
    model = models.find("environment", load.model, load.place)
    named = next((parameter.name for parameter in model.parameters if parameter.names == "joint"), None)
    settled = scope.parameters.get(f"environment.{load.name}.{named}") if model.initial_range and named else None
    servo = servos.get(str(settled.value)) if settled is not None else None
    place = (settled.origin.place if settled is not None else None) or load.place
    if servo is None or servo.parameters is None or servo.servo.at_rest is not None or place is None:
        return
    if accelerates(servo.bare, servo.parameters) and not _stays_between(scope, load, model, servo, duration):
        scope.complaints.remark(
            "D337",
            f"`{load.name}` cannot stop joint `{servo.joint}`: servo `{servo.definition}` ({servo.servo.name}) tells "
            "it its acceleration, and goes on through an end",
            place,
            also=[Label(servo.place, "its servo")],
            help=[
                "give the joint a servo that has a torque, or leave the stop out",
                f"or watch the joint, and require that it stays within: "
                f"`metric most = max {{ of = {servo.joint}.q; }}`",
            ],
        )


def _stays_between(scope: Scope, load: EnvironmentUse, model: Environment, servo: Use, duration: float) -> bool:
    """True where a joint begins at rest between the ends, and its position command never leaves them."""
    command = servo.command
    if command is None or command.kind != "position" or command.guide:
        return False
    profile = models.find("command", command.model)
    course = constant_values(scope, f"{servo.joint}.servo.command", profile.parameters)
    lower, upper = (constant_value(scope, f"environment.{load.name}.{name}") for name in model.initial_range)
    begins, moves = (constant_value(scope, f"initial.{servo.joint}.{part}") for part in ("q", "qd"))
    if course is None or None in (lower, upper, begins) or moves != 0.0:
        return False
    with np.errstate(all="ignore"):
        commanded = np.append(profile.course(course, np.linspace(0.0, duration, INSTANTS))[0], begins)
    return bool(np.all((commanded > lower) & (commanded < upper)))


def _remark_hold(scope: Scope, load: EnvironmentUse, servos: Mapping[str, Use], structure: Structure) -> None:
    """Report a model that would hold two bodies, where servos prescribe the motion of all joints between them: then it
    has no effect."""
    model = models.find("environment", load.model, load.place)
    if model.holds is None or load.place is None:
        return
    if model.may_be_load and any(_is_of_torques(use.of) for use in structure.metrics):
        return
    p = constant_values(scope, f"environment.{load.name}", model.parameters)
    if p is None:
        return
    bodies = [str(getattr(p, name)) for name in model.holds(p)]
    between = _joints_between(structure, bodies) if bodies else None
    if not between or any(joint not in servos for joint in between):
        return
    prescribed = [servos[joint] for joint in between]
    if any(use.parameters is None or not accelerates(use.bare, use.parameters) for use in prescribed):
        return
    using = next((use for use in prescribed if use.servo.at_rest is None), None)
    if using is not None:
        scope.complaints.remark(
            "D296",
            f"`{load.name}` holds nothing: servo `{using.definition}` ({using.servo.name}) tells joint `{using.joint}` "
            f"its acceleration{_and_others(len(prescribed) - 1)}, and what holds `{bodies[0]}` gives way to it",
            load.place,
            also=[Label(using.place, "its servo")],
            help=[
                "give the joint a servo that has a torque, or leave this out",
                'if what it takes is what the run is about, `allow D296 because "...";`',
            ],
        )


def _and_others(count: int) -> str:
    if not count:
        return ""
    return f", as {count} other joint{'s are' if count > 1 else ' is'} told"


def _is_of_torques(channel: str) -> bool:
    """True for a channel, or an expression, of the torque of a joint or its motor."""
    return not {"tau", "torque", "reaction", "current", "power"}.isdisjoint(re.split(r"\W+", channel))


def _joints_between(structure: Structure, bodies: list[str]) -> list[str] | None:
    """The moving joints between two bodies, or between one and the ground; None where a free base or a payload is
    involved."""
    ends = [*bodies, WORLD][:2]
    if (structure.free and WORLD in ends) or any(payload.name in ends for payload in structure.payloads):
        return None
    first, second = (way_inward(structure.joints, body) for body in ends)
    apart = [joint for joint in (*first, *second) if (joint in first) != (joint in second)]
    return [joint.name for joint in apart if joint.kind != "fixed"]


def _remark_alone(scope: Scope, environment: Iterable[EnvironmentUse]) -> None:
    """Warn (D338) of two models of the environment that give the same quantity, for what they do adds up.

    `alone` of a model's declaration names the quantity from its values, or is "" for none. Models whose values vary are
    passed over.
    """
    first: dict[str, EnvironmentUse] = {}
    for load in environment:
        model = models.find("environment", load.model, load.place)
        p = constant_values(scope, f"environment.{load.name}", model.parameters)
        if model.alone is None or load.place is None or p is None:
            continue
        what = model.alone(p)
        before = first.setdefault(what, load)
        if what and before is not load:
            scope.complaints.remark(
                "D338",
                f"`{before.name}` and `{load.name}` both give {what}: what they do adds up",
                load.place,
                also=[Label(before.place, "this one")] if before.place is not None else [],
                help="leave one of them out",
            )
