"""Warnings of models that cannot both hold: a stop and a servo that no torque stops, two models of one thing."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace

from ic.meaning.control.servos import Use
from ic.meaning.parameters.scope import Scope
from met import models
from met.analysis.probe import accelerates
from met.diagnostic import Label
from met.plan import EnvironmentUse, Structure
from met.trace import Scalar


def check_together(scope: Scope, uses: Iterable[Use], structure: Structure) -> None:
    """Warn of environment models that the servos, or each other, contradict."""
    servos = {use.joint: use for use in uses}
    for load in structure.environment:
        _remark_stop(scope, load, servos)
    _remark_alone(scope, structure.environment)


def _remark_stop(scope: Scope, load: EnvironmentUse, servos: dict[str, Use]) -> None:
    """Report a model that would keep a joint between two ends, where the servo goes on whatever the torque."""
    model = models.find("environment", load.model, load.place)
    named = next((each.name for each in model.parameters if each.names == "joint"), None)
    settled = scope.parameters.get(f"environment.{load.name}.{named}") if model.initial_range and named else None
    servo = servos.get(str(settled.value)) if settled is not None else None
    place = (settled.origin.place if settled is not None else None) or load.place
    if servo is None or servo.parameters is None or servo.servo.at_rest is not None or place is None:
        return
    if accelerates(servo.bare, servo.parameters):
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


def _remark_alone(scope: Scope, environment: Iterable[EnvironmentUse]) -> None:
    """Report two models that both give what only one should (`Environment.alone`)."""
    first: dict[str, EnvironmentUse] = {}
    for load in environment:
        model = models.find("environment", load.model, load.place)
        values = {
            each.name: _value(scope, f"environment.{load.name}.{each.name}", each.shape == "vector")
            for each in model.parameters
        }
        if model.alone is None or load.place is None or None in values.values():
            continue
        what = model.alone(SimpleNamespace(**values))
        before = first.setdefault(what, load)
        if what and before is not load:
            scope.complaints.remark(
                "D338",
                f"`{before.name}` and `{load.name}` both give {what}: what they do adds up",
                load.place,
                also=[Label(before.place, "this one")] if before.place is not None else [],
                help="leave one of them out",
            )


def _value(scope: Scope, path: str, vector: bool) -> object:
    """A parameter's constant; None where it varies or is unknown."""
    if vector:
        parts = [_value(scope, f"{path}.{axis}", False) for axis in "xyz"]
        return None if None in parts else tuple(parts)
    settled = scope.parameters.get(path)
    return None if settled is None or isinstance(settled.value, Scalar) else settled.value
