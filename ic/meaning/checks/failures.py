"""Checks of environment models that act on a joint's servo, and of sensors and failures that no servo's law reads.

`Environment.servo_of` declares that a model affects a servo, `Environment.friction_joint` additional friction.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from types import SimpleNamespace
from typing import Any

from ic.meaning.checks.idle import constant_value
from ic.meaning.control.schedule import Ticks
from ic.meaning.control.servos import Use
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.analysis.probe import accelerates, of_law, reads
from met.diagnostic import Label, Place, leave_out
from met.frozen import frozen
from met.instants import has_come
from met.plan import EnvironmentUse, Joint, ServoUse, Structure
from met.plan.following import leaders
from met.plan.uses import quantities


@frozen
class ServoFailure:
    """A model that affects the servo of a joint, or adds friction to the joint; place: of the joint's name."""

    use: EnvironmentUse
    model: Any
    joint: str
    place: Place


def check_failures(
    scope: Scope,
    uses: Iterable[Use],
    ticks: Mapping[str, Ticks],
    structure: Structure,
) -> None:
    """Report models about servos that are missing, lack the affected part, or are on a bed."""
    servos = {use.joint: use for use in uses}
    beds = structure.on_beds
    joints = {joint.name: joint for joint in structure.moving}
    sound = []
    for failure in _about(scope, structure.environment, "servo_of"):
        use, model, joint, place = failure.use, failure.model, failure.joint, failure.place
        servo, continuous = servos.get(joint), joint in ticks and ticks[joint].continuous
        wrong = _wrong(scope, use, model, joint, servo, continuous=continuous)
        lead = leaders(joint, joints)[0] if joint in joints and joints[joint].follows else ""
        if wrong and lead and (servo is None or (not servo.has_law and lead in servos and servos[lead].has_law)):
            wrong = wrong[0], f"name joint `{lead}`, which leads it, or leave it out", wrong[2]
        also = [Label(servo.place, "its servo")] if servo is not None else []
        if wrong is None and joint in beds and model.decoupling is not None:
            wrong = f"`{use.name}` would let go of joint `{joint}`, whose motor is on a bed", "leave it out", place
            also = [Label(bed, "on a bed")] if (bed := beds[joint].place) is not None else []
        if wrong is not None:
            message, help, mistake_place = wrong
            helps = leave_out(help, use.place) if "leave it out" in help else help
            scope.complaints.error("D247", message, mistake_place or place, also=also, help=helps)
        elif servo is not None:
            sound.append(failure)
            _check_full(scope, failure, servo)
            if not continuous:
                schedule = structure.schedule
                _remark_between_ticks(scope, failure, ticks[joint].divisor / schedule.base_hz, schedule.duration)
    _remark_overlaps(scope, sound)


def check_friction(scope: Scope, uses: Iterable[Use], structure: Structure) -> None:
    """Report friction on a joint with a prescribed acceleration, where it would have no effect, and on a joint that
    follows such a one, one on a bed, or several."""
    servos = {use.joint: use for use in uses}
    brakes = list(_about(scope, structure.environment, "friction_joint"))
    rubbing = {failure.joint: failure.place for failure in brakes}
    for joint, use in servos.items():
        friction = scope.parameters.get(f"{joint}.servo.friction")
        if friction is not None and (not isinstance(friction.value, float) or friction.value != 0.0):
            rubbing[joint] = friction.origin.place or use.place
    for follower in structure.moving:
        if follower.follows and follower.name in rubbing:
            _check_follower(scope, follower, rubbing[follower.name], servos, structure)
    for failure in brakes:
        servo = servos.get(failure.joint)
        if servo is not None and servo.parameters is not None and accelerates(servo.bare, servo.parameters):
            label = f"servo `{servo.definition}` ({servo.servo.name})"
            scope.complaints.error(
                "D291",
                f"`{failure.use.name}` puts friction on joint `{failure.joint}`, which {label} tells its acceleration",
                failure.place,
                also=[Label(servo.place, "its servo")],
                help=leave_out(
                    "leave it out for this joint: no friction slows down or holds what is told its acceleration",
                    failure.use.place,
                ),
            )


def _check_follower(
    scope: Scope, follower: Joint, place: Place, servos: Mapping[str, Use], structure: Structure
) -> None:
    """Report dry friction of a follower that would not act: where no torque of its leader's feels it."""
    leading = leaders(follower.name, {joint.name: joint for joint in structure.moving})
    reason = "it follows more than one joint" if len(leading) > 1 else ""
    for name in leading:
        servo = servos.get(name)
        if name in structure.on_beds:
            reason = f"the motor of joint `{name}`, which leads it, is on a bed"
        elif servo is not None and servo.parameters is not None and accelerates(servo.bare, servo.parameters):
            label = f"servo `{servo.definition}` ({servo.servo.name})"
            reason = f"{label} tells joint `{name}`, which leads it, its acceleration"
    if reason:
        message = f"joint `{follower.name}` has dry friction, and {reason}"
        helps = leave_out("leave the friction out: nothing would feel it")
        if len(leading) > 1:
            helps = leave_out("put the friction on the joints that lead, and leave it out here")
        scope.complaints.error("D213", message, place, help=helps)


def _about(scope: Scope, environment: Iterable[EnvironmentUse], which: str) -> Iterable[ServoFailure]:
    """The models of this sort about joints that can be checked. which: the field that names the parameter"""
    for use in environment:
        model = models.find("environment", use.model)
        named = getattr(model, which)
        settled = scope.parameters.get(f"environment.{use.name}.{named}") if named else None
        if settled is not None and use.place is not None and str(settled.value) not in scope.failed_servos:
            yield ServoFailure(use, model, str(settled.value), settled.origin.place or use.place)


def _wrong(
    scope: Scope, use: EnvironmentUse, model: Any, joint: str, servo: Use | None, *, continuous: bool
) -> tuple[str, str, Place | None] | None:
    """The mistake, its remedy, and its place if it is not at the joint's name; None where there is no mistake."""
    if servo is None:
        message = f"joint `{joint}` has no servo to which `{use.name}` could do anything"
        return message, "give the joint a servo, or leave it out", None
    label = f"servo `{servo.definition}` ({servo.servo.name}) of joint `{joint}`"
    if model.decoupling is not None and servo.servo.at_rest is not None:
        message = f"{label} holds a joint that is at rest, and `{use.name}` would give it one that moves"
        return message, f"leave it out: `release` lets a {servo.servo.name} joint go, and a `brake` stops one", None
    if (model.replaced_outputs is not None or model.replaced_reading is not None) and not servo.has_law:
        return f"{label} has no law that `{use.name}` could do anything to", "leave it out", None
    if model.replaced_outputs is not None and servo.servo.full is None:
        known = [name for name, servo_model in models.find_own("servo").items() if servo_model.full is not None]
        own = servo.servo.name in models.find_own("servo")
        remedy = (
            known_words("servo models that have one", known)
            if own
            else (f"declare `full` in the model `{servo.servo.name}`: the law's outputs at full drive")
        )
        return f"{label} has no drive that could run away", remedy, None
    if model.replaced_reading is None:
        return None
    head = f"environment.{use.name}"
    quantity, reads = scope.parameters.get(f"{head}.of"), scope.parameters.get(f"{head}.reads")
    seen = list(quantities(ServoUse(joint, "", servo.servo.name, servo.command, 1, words=servo.words)))
    if quantity is not None and str(quantity.value) not in seen:
        return f"{label} does not see `{quantity.value}`", known_words("it sees", seen), quantity.origin.place
    if continuous and reads is not None and reads.value == "last":
        message = f"the law of joint `{joint}` is continuous: it has no last tick"
        return message, "write `reads = zero;`, or a rate in Hz for the law", reads.origin.place
    return None


def _check_full(scope: Scope, failure: ServoFailure, servo: Use) -> None:
    """Report a failure that drives a joint with all that its servo can give, where that has no limit (D292)."""
    if failure.model.replaced_outputs is None or servo.servo.full is None or servo.parameters is None:
        return
    numbers = servo.parameters

    def endless(values: Mapping[str, Any]) -> bool:
        full = servo.servo.full(SimpleNamespace(**values)).values()
        return any(isinstance(x, float) and math.isinf(x) for x in full)

    if endless(numbers):
        lacking = [
            parameter
            for parameter in servo.servo.parameters
            if numbers.get(parameter.name) == math.inf and not endless({**numbers, parameter.name: 1.0})
        ]
        scope.complaints.error(
            "D292",
            f"`{failure.use.name}` would drive joint `{failure.joint}` with all that servo "
            f"`{servo.definition}` ({servo.servo.name}) can give, and that has no limit",
            failure.place,
            also=[Label(servo.place, "its servo")],
            help=[
                f"write `{parameter.name} = ... {parameter.unit};` in the servo: {parameter.doc}"
                for parameter in lacking
            ],
        )


def _window(scope: Scope, failure: ServoFailure) -> tuple[float, float] | None:
    """The window in which it acts, from and until, s; None where that varies, or the model has no such window."""
    begins, ends = (constant_value(scope, f"environment.{failure.use.name}.{name}") for name in ("from", "until"))
    return (begins, ends) if isinstance(begins, float) and isinstance(ends, float) else None


def _remark_between_ticks(scope: Scope, failure: ServoFailure, period: float, duration: float) -> None:
    """Report a window between two ticks of the law, which never sees it."""
    window, model = _window(scope, failure), failure.model
    if window is None or (model.replaced_outputs is None and model.replaced_reading is None):
        return
    begins, ends = window
    if not 0.0 <= begins < min(ends, duration):
        return
    tick = math.floor(begins / period)
    while not has_come(tick * period, begins):
        tick += 1
    if has_come(tick * period, ends):
        settled = scope.parameters[f"environment.{failure.use.name}.from"]
        scope.complaints.remark(
            "D168",
            f"environment `{failure.use.name}` never acts: the law of joint `{failure.joint}` ticks at "
            f"{(tick - 1) * period:.9g} s and at {tick * period:.9g} s, and not in between",
            settled.origin.place or failure.place,
            help=leave_out("change that, or leave it out", failure.use.place),
        )


def _remark_overlaps(scope: Scope, failures: Iterable[ServoFailure]) -> None:
    """Report two models of one sort that affect the same part of a joint at once: the later one wins."""
    known = models.find_own("environment").values()  # another package's model may affect an earlier one on purpose
    before: dict[tuple[str, str, Any], list[tuple[ServoFailure, tuple[float, float]]]] = {}
    for failure in failures:
        window, model = _window(scope, failure), failure.model
        if window is None or (model.replaced_outputs is None and model.replaced_reading is None) or model not in known:
            continue
        quantity = scope.parameters.get(f"environment.{failure.use.name}.of")
        same = before.setdefault((failure.joint, model.name, quantity.value if quantity is not None else None), [])
        for earlier, (begins, ends) in same:
            first, last = max(begins, window[0], 0.0), min(ends, window[1])
            if first < last:
                when = f"from {first:g} s" + (f" until {last:g} s" if math.isfinite(last) else " on")
                also = [Label(earlier.use.place, "this one")] if earlier.use.place is not None else []
                scope.complaints.remark(
                    "D293",
                    f"`{earlier.use.name}` does nothing {when}: `{failure.use.name}` acts on the same of joint "
                    f"`{failure.joint}` then, and stands later",
                    failure.place,
                    also=also,
                    help="let one end before the other begins",
                )
        same.append((failure, window))


def remark_unread(scope: Scope, uses: Iterable[Use], structure: Structure) -> None:
    """Report sensors that no law uses and nothing records, and dead ones that no law would notice."""
    servos = {servo.joint: servo for servo in structure.servos}
    known: dict[Hashable, frozenset[str] | None] = {}  # many joints have one law
    by_use: list[tuple[Use, frozenset[str] | None]] = []
    for use in uses:
        read = None
        if use.parameters is not None:
            law = of_law(servos[use.joint], use.parameters)
            read = known[law] = known[law] if law in known else reads(servos[use.joint], use.parameters)
        by_use.append((use, read))
    # a sensor of a definition is seen where the law of one of its joints sees it, or is not known
    every = [(sensor, read) for use, read in by_use for sensor in servos[use.joint].sensors]
    seen_at = {sensor.place for sensor, read in every if read is None or sensor.of in read}
    for use, read in by_use:
        if read is None:
            continue
        servo = servos[use.joint]
        label = f"the law of servo `{use.definition}` ({servo.model})"
        under = f" under a {servo.command.kind} command" if servo.command is not None else ""
        seen = [quantity for quantity in quantities(servo) if quantity in read]
        helps = known_words(f"it reads{under}", seen) if seen else f"it reads nothing of its joint{under}"
        for sensor in servo.sensors:
            if sensor.place is not None and sensor.place not in seen_at and not _is_used(structure, servo, sensor.of):
                scope.complaints.remark(
                    "D290",
                    f"sensor `{sensor.of}` changes nothing: {label} does not read `{sensor.of}`",
                    sensor.place,
                    help=[
                        helps,
                        leave_out(f"leave it out, or record it: `record += [{servo.joint}.servo.sensor.{sensor.of}];`"),
                    ],
                )
        for name, hidden in _dead(scope, structure, use.joint):
            if str(hidden.value) not in read and hidden.origin.place is not None:
                scope.complaints.remark(
                    "D168",
                    f"environment `{name}` never acts: {label} does not read `{hidden.value}`",
                    hidden.origin.place,
                    help=[helps, "change that, or leave it out"],
                )


def _is_used(structure: Structure, servo: ServoUse, quantity: str) -> bool:
    """Return True if this sensor's reading of the quantity is recorded, watched by a metric or in an expression."""
    path = f"{servo.joint}.servo.sensor.{quantity}"
    channels = [channel for record in structure.record for channel in record.channels]
    channels += [channel for expression in structure.expressions for channel in expression.channels]
    return any(
        f"{channel}.".startswith(f"{path}.") for channel in (*channels, *(metric.of for metric in structure.metrics))
    )


def _dead(scope: Scope, structure: Structure, joint: str) -> Iterable[tuple[str, Any]]:
    """Models that hide a quantity from the law of this joint: their names, and the quantity."""
    for use in structure.environment:
        model, head = models.find("environment", use.model), f"environment.{use.name}"
        about, hidden = scope.parameters.get(f"{head}.{model.servo_of}"), scope.parameters.get(f"{head}.of")
        if model.replaced_reading is not None and about is not None and about.value == joint and hidden is not None:
            yield use.name, hidden
