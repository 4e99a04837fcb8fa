"""Environment models that do nothing in a run, or that act from its beginning where that is seldom meant: remarks."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from ic.meaning.control.servos import differ_beyond_rounding, unit_written
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters.models import value_place
from ic.meaning.parameters.scope import Scope
from met import models
from met.diagnostic import Label, leave_out
from met.plan import EnvironmentUse
from met.trace import Scalar


def remark_idle(scope: Scope, environment: Any, item: Item, values: Mapping[str, Any], duration: float) -> bool:
    """Return True, with a warning, if a model has no effect in the whole run by its written constants.

    values  with the bodies that links and payloads are parts of, in the place of their names
    """
    numbers = [x for value in values.values() for x in (value if isinstance(value, tuple) else (value,))]
    if environment.idle is None or any(isinstance(x, Scalar) for x in numbers):
        return False
    found = environment.idle(SimpleNamespace(**values), duration)
    if found is not None:
        body = item.body or MergedBlock()
        written = [part for name in found[0] if (part := body.get(name)) is not None and part.value is not None]
        scope.complaints.remark(
            "D168",
            f"environment `{item.name}` never acts: {found[1]}",
            value_place(written[0]) if written else item.place,
            help=leave_out("change that, or leave it out", item.place),
        )
    return found is not None


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


def remark_beginnings(scope: Scope, uses: tuple[EnvironmentUse, ...]) -> None:
    """Report a joint that begins outside of the ends between which a model keeps it. To be called after the initial
    state."""
    for use in uses:
        model = models.find("environment", use.model)
        found = {name: scope.parameters.get(f"environment.{use.name}.{name}") for name in model.initial_range}
        joint = next(
            (
                str(settled.value)
                for each in model.parameters
                if each.names == "joint" and (settled := scope.parameters.get(f"environment.{use.name}.{each.name}"))
            ),
            None,
        )
        begins = scope.parameters.get(f"initial.{joint}.q")
        if begins is None or use.place is None or len(found) != 2 or None in found.values():
            continue
        ends = [each for each in found.values() if each is not None]
        place = begins.origin.place or next((each.origin.place for each in ends if each.origin.place), use.place)
        also, shown = [Label(use.place, "this one")], unit_written([begins, *ends], begins.unit)

        def warn(
            values: np.ndarray,
            use: EnvironmentUse = use,
            joint: str | None = joint,
            place: Any = place,
            also: list[Label] = also,
            shown: tuple[str, float] = shown,
        ) -> None:
            q, lower, upper = values.T
            below, above = (
                (q < lower) & differ_beyond_rounding(q, lower),
                (q > upper) & differ_beyond_rounding(q, upper),
            )
            beyond = np.flatnonzero(below | above)
            if beyond.size:
                (q, lower, upper), unit = values[beyond[0]] / shown[1], shown[0]
                which = f"below {lower:g} {unit}" if q < lower else f"above {upper:g} {unit}"
                scope.complaints.remark(
                    "D294",
                    f"joint `{joint}` begins at {q:g} {unit}, beyond an end of `{use.name}`: {which}",
                    place,
                    also=also,
                    help="the run begins with what drives it back: begin within, or move the end",
                )

        scope.checks.observe(
            (begins.value, *(each.value for each in ends)),  # type: ignore[arg-type]
            warn,
            place,
            needs=(f"initial.{joint}.q", f"environment.{use.name}"),
        )
