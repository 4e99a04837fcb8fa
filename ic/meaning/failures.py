"""What environment models do to the servo of a joint (`Environment.servo_of`): that there is one to which they can."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ic.meaning.complaints import known_words
from ic.meaning.schedule import Ticks
from ic.meaning.scope import Scope
from ic.meaning.servos import Use
from met import models
from met.diagnostic import Label, Place
from met.plan import EnvironmentUse, ServoUse, Substitution


def check_failures(
    scope: Scope, uses: Iterable[Use], ticks: Mapping[str, Ticks], found: Iterable[Substitution],
    environment: Iterable[EnvironmentUse],
) -> None:  # fmt: skip
    """Tells of models about servos that are not there, have not what the model is about, or are on a bed."""
    servos = {use.joint: use for use in uses}
    beds = {each.joint: each.place for each in found}
    for use in environment:
        model = models.find("environment", use.model)
        settled = scope.parameters.get(f"environment.{use.name}.{model.servo_of}") if model.servo_of else None
        if settled is None or use.place is None or str(settled.value) in scope.lost:
            continue
        joint, place = str(settled.value), settled.origin.place or use.place
        servo, continuous = servos.get(joint), joint in ticks and ticks[joint].continuous
        wrong = _wrong(scope, use, model, joint, servo, continuous=continuous)
        also = [Label(servo.place, "its servo")] if servo is not None else []
        if wrong is None and joint in beds and model.loose is not None:
            wrong = f"`{use.name}` would let go of joint `{joint}`, whose motor is on a bed", "leave it out", place
            also = [Label(bed, "on a bed")] if (bed := beds[joint]) is not None else []
        if wrong is not None:
            message, help, at = wrong
            scope.complaints.error("D247", message, at or place, also=also, help=help)


def _wrong(
    scope: Scope, use: EnvironmentUse, model: Any, joint: str, servo: Use | None, *, continuous: bool
) -> tuple[str, str, Place | None] | None:
    """What is wrong, its remedy, and where, if not at the joint's name; None: nothing."""
    if servo is None:
        message = f"joint `{joint}` has no servo to which `{use.name}` could do anything"
        return message, "give the joint a servo, or leave it out", None
    label = f"servo `{servo.definition}` ({servo.servo.name}) of joint `{joint}`"
    if (model.gives is not None or model.sees is not None) and not servo.has_law:
        return f"{label} has no law that `{use.name}` could do anything to", "leave it out", None
    if model.gives is not None and servo.servo.full is None:
        known = [name for name, each in models.find_own("servo").items() if each.full is not None]
        return f"{label} has no drive that could run away", known_words("servo models that have one", known), None
    if model.sees is None:
        return None
    head = f"environment.{use.name}"
    of, reads = scope.parameters.get(f"{head}.of"), scope.parameters.get(f"{head}.reads")
    seen = list(models.quantities(ServoUse(joint, "", servo.servo.name, servo.command, 1, words=servo.words)))
    if of is not None and str(of.value) not in seen:
        return f"{label} does not see `{of.value}`", known_words("it sees", seen), of.origin.place
    if continuous and reads is not None and reads.value == "last":
        message = f"the law of joint `{joint}` is continuous: it has no last tick"
        return message, "write `reads = zero;`, or a rate in Hz for the law", reads.origin.place
    return None
