"""Environment models that do nothing in a run, or that act from its beginning where that is seldom meant: remarks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from ic.meaning.control.servos import differ_beyond_rounding, unit_written
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters.models import value_place
from ic.meaning.parameters.owner import Settled
from ic.meaning.parameters.scope import Scope
from met import models
from met.diagnostic import Label, Place, leave_out
from met.plan import EnvironmentUse, Joint
from met.trace import Real, Scalar

ENDS = ("q_min", "q_max")
"""The ends of a joint's range, which an arm gives it."""


def at_rest(use: EnvironmentUse) -> str:
    """`nothing`, `weight` or `force`: the largest load of a used model on an arm that stands still."""
    return str(models.find("environment", use.model, use.place).at_rest)


def remark_idle(scope: Scope, environment: Any, item: Item, values: Mapping[str, Any], duration: float) -> bool:
    """Return True, with a warning, if a model has no effect in the whole run by its written constants.

    values  with the bodies that links and payloads are parts of, in the place of their names
    """
    numbers = [x for value in values.values() for x in (value if isinstance(value, tuple) else (value,))]
    if environment.idle is None or any(isinstance(x, Scalar) for x in numbers):
        return False
    idleness = environment.idle(SimpleNamespace(**values), duration)
    if idleness is not None:
        body = item.body or MergedBlock()
        written = [part for name in idleness[0] if (part := body.get(name)) is not None and part.value is not None]
        scope.complaints.remark(
            "D168",
            f"environment `{item.name}` never acts: {idleness[1]}",
            value_place(written[0]) if written else item.place,
            help=leave_out("change that, or leave it out", item.place),
        )
    return idleness is not None


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
                value_place(written),
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
