"""A value or a course in time, where a deck allows either: a command, a base's motion, a guide's path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ic.grammar.syntax import Call, Expression, Name, place_of
from ic.meaning.control.trajectories import use_file, with_file_named
from ic.meaning.control.wraps import warn_of_wraps
from ic.meaning.definitions.merge import Item, MergedBlock, open_call
from ic.meaning.expressions.remedies import components
from ic.meaning.parameters.models import find_model, refuse_values, use_model, word_of
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from met import models
from met.commands.profile import Profile
from met.diagnostic import Place
from met.instants import ROUNDING


def use_course(
    scope: Scope,
    spot: Owner,
    inner: Expression,
    item: Item,
    *,
    doc: str,
    column: str,
    kind: str = "joint",
    body: MergedBlock | None = None,
) -> str | None:
    """A value, or a course in time, entered in the scope under the path of `spot`: its model; None where there is none.

    item    the entry that says it, whose expression is, or holds, `inner`;  body: what of the course is written apart
    doc     what a value means;  column: of a CSV file, unless one is named: the name of the joint, or what `kind` says
    """
    name = word_of(inner) if isinstance(inner, Call) else None
    if name is None or name in ("sqrt", "sin", "cos", "min", "max"):
        constant = models.find_own("command")["constant"]
        (value,) = constant.parameters
        scope.number(spot, replace(value, doc=doc), item, expression=inner)
        return "constant"
    assert isinstance(inner, Call)
    profile = find_model(scope, "command", name, inner.name.place)
    if profile is None:
        return None
    inner = with_file_named(inner) if profile.from_file else inner
    if refuse_values(scope, inner, [p.name for p in profile.written]):
        return None
    _, named = open_call(inner, None, scope.complaints)
    inside = {
        key: replace(part, homes=item.homes, overrides=item.overrides)
        for key, part in (named or MergedBlock()).items.items()
    }
    apart = body or MergedBlock()
    opened = replace(
        apart,
        items=inside | dict(apart.items),
        statements=(*(named or MergedBlock()).statements, *apart.statements),
        pending=(*(named or MergedBlock()).pending, *apart.pending),
    )
    course = replace(spot, label=f"`{name}`", called=None, place=inner.name.place, call=True)
    if profile.from_file:
        use_file(scope, course, profile, opened, column, kind)
        return profile.name
    values = use_model(scope, course, profile.parameters, opened)
    if values is not None and profile.shortest is not None:
        _check_room(scope, course, profile, values, opened)
    if values is not None and {"times", "values"} <= values.keys():
        _check_wraps(scope, course, profile, values, opened)
    return profile.name


def _check_wraps(scope: Scope, owner: Owner, profile: Profile, values: Mapping[str, Any], body: MergedBlock) -> None:
    """Warn where angles that a deck lists over time are those of a wrapped log."""
    declared = next(parameter for parameter in profile.parameters if parameter.name == "values")
    times, angles = values["times"], values["values"]
    if owner.unit(declared)[0] == "rad" and len(times) == len(angles):
        written = components(body.get("values"), len(angles))

        def place(n: int) -> Place:
            expression = written[n]
            return owner.place if expression is None else place_of(expression)

        warn_of_wraps(scope, f"`values` of {owner.label}", times, angles, place)


def _check_room(scope: Scope, owner: Owner, profile: Profile, values: Mapping[str, Any], body: MergedBlock) -> None:
    """Check that a course made of parts has the time for all of them, in every case."""
    assert profile.shortest is not None
    path, item = owner.join("over"), body.get("over")
    try:
        least = profile.shortest(SimpleNamespace(**values))
    except ZeroDivisionError:  # a number that is out of its range, which is reported
        return

    def test(times: np.ndarray) -> tuple[np.ndarray, list[str]]:
        bad = ~(times[:, 0] >= times[:, 1] * (1.0 - ROUNDING))
        return bad, [f"this is {over:.9g} s, and {needed:.9g} s are needed" for over, needed in times[bad][:1]]

    scope.checks.require(
        (values["over"], least),
        test,
        code="D384",
        message=f"`over` of {owner.label} is too short for the way up and down",
        place=place_of(item.value) if item is not None and item.value is not None else owner.place,
        help="write a longer one, or a larger `slope`",
        path=path,
        needs=tuple(owner.join(name) for name in values),
    )


def course_named(scope: Scope, inner: Expression) -> Expression:
    """The course that a single name stands for, without parameters."""
    if isinstance(inner, Name) and inner.text in models.available("command") and not scope.names.is_value(inner):
        return Call(inner, (), (), None, inner.place)
    return inner
