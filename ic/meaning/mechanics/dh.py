"""Denavit-Hartenberg numbers of a joint, `dh = classic(...)` or `dh = craig(...)`, as the joint's frame in a plan.

With q the coordinate of the joint, which is added to theta of a revolute joint or to d of a prismatic one, the link's
frame in the parent link's frame is

    classic     Rz(theta) Tz(d) Tx(a) Rx(alpha)     the joint moves about or along the parent's z
    craig       Rx(alpha) Tx(a) Rz(theta) Tz(d)     the joint moves about or along the link's z

A plan has the place of the link's frame at q = 0 (`at`, `rpy`), the axis in that frame, and, for a classic revolute
joint, whose axis passes the link's frame at the distance a, a point of the axis (`pivot`).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ic.grammar.syntax import Call, place_of
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters.models import check_keys, word_of
from ic.meaning.parameters.owner import XYZ, Owner, follows, several
from ic.meaning.parameters.scope import Scope
from met.diagnostic import Label, did_you_mean, leave_out, write
from met.frozen import frozen
from met.parameter import Parameter
from met.trace import Real, Scalar, atan2, cos, sin

NUMBERS = (
    Parameter(name="a", unit="m", default=0.0, doc="length of the link, along x"),
    Parameter(name="alpha", unit="rad", default=0.0, doc="twist of the link, about x"),
    Parameter(name="d", unit="m", default=0.0, doc="offset along z; q is added to it if the joint is prismatic"),
    Parameter(name="theta", unit="rad", default=0.0, doc="angle about z; q is added to it if the joint is revolute"),
)
OTHER_NAMES = {"standard": "classic", "distal": "classic", "modified": "craig", "proximal": "craig"}
USAGE = "write `dh = classic(a = ..., alpha = ..., d = ..., theta = ...)`, or `craig(...)`"
INSTEAD = ("at", "rpy", "axis")
NOISE = 1e-15  # of sines and cosines of right angles, whose size is 1: cos(pi/2) is 6e-17 in doubles

Three = tuple[Real, Real, Real]


@frozen
class JointFrame:
    """The frame of a joint as in a plan: origin (m) and turns about fixed x, y, z (rad) of the link's frame at q = 0,
    in the parent's; the axis, a unit vector, and a point of it (m), both in the link's frame at q = 0."""

    at: Three
    rpy: Three
    axis: Three
    pivot: Three


def classic(a: Real, alpha: Real, d: Real, theta: Real) -> JointFrame:
    (c, s), (c_alpha, s_alpha) = _turn(theta), _turn(alpha)
    return JointFrame((a * c, a * s, d), (alpha, 0.0, theta), (0.0, s_alpha, c_alpha), (-a, 0.0, 0.0))


def craig(a: Real, alpha: Real, d: Real, theta: Real) -> JointFrame:
    """Rx(alpha) Rz(theta) as Rz(yaw) Ry(pitch) Rx(roll).

    yaw turns the first column over the x axis; pitch and roll are those of the rest, Rz(-yaw) R, so that the three fit
    to rounding also where the first column is vertical and yaw is any.
    """
    (c, s), (c_alpha, s_alpha) = _turn(theta), _turn(alpha)
    yaw = atan2(c_alpha * s, c)
    c_yaw, s_yaw = cos(yaw), sin(yaw)
    pitch = atan2(-(s_alpha * s), c * c_yaw + c_alpha * s * s_yaw)
    roll = atan2(s_alpha * c_yaw, c_alpha * c * c_yaw + s * s_yaw)
    return JointFrame((a, -(s_alpha * d), c_alpha * d), (roll, pitch, yaw), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))


CONVENTIONS: dict[str, Callable[[Real, Real, Real, Real], JointFrame]] = {"classic": classic, "craig": craig}


def _turn(angle: Real) -> tuple[Real, Real]:
    """Cosine and sine of an angle, with rounding noise at right angles set to 0."""
    if isinstance(angle, Scalar):
        return cos(angle), sin(angle)
    parts = (math.cos(angle), math.sin(angle))
    return (0.0 if abs(parts[0]) < NOISE else parts[0]), (0.0 if abs(parts[1]) < NOISE else parts[1])


def use_dh(scope: Scope, owner: Owner, kind: str, item: Item, body: MergedBlock) -> None:
    """Enter the joint's frame from its Denavit-Hartenberg numbers, whose paths are `JOINT.dh.a` and so on."""
    _refuse_others(scope, owner, item, body)
    convention = _convention(scope, item)
    if convention is None:
        scope.checks.fail(owner.join("dh"))
        return
    inner = Owner(f"the dh of {owner.label}", item.place, owner.join("dh"), homes=owner.homes, call=True)
    numbers = item.body or MergedBlock()
    check_keys(scope, numbers, [wanted.name for wanted in NUMBERS], inner)
    scope.not_sweepable[owner.join("dh")] = several(_numbers(owner))
    entered = [scope.number(inner, wanted, numbers.get(wanted.name), record=False) for wanted in NUMBERS]
    values = [value for value in entered if value is not None]
    if len(values) < len(NUMBERS):
        return
    frame = CONVENTIONS[convention](*values)
    parts = [("at", frame.at, "m"), ("rpy", frame.rpy, "rad")]
    if kind != "fixed":
        parts.append(("axis", frame.axis, "1"))
    if kind == "revolute" and any(isinstance(x, Scalar) or x != 0.0 for x in frame.pivot):
        parts.append(("pivot", frame.pivot, "m"))
    for part, three, unit in parts:
        for axis, value in zip(XYZ, three, strict=True):
            scope.keep_derived(owner.join(f"{part}.{axis}"), value, unit, item, f"Denavit-Hartenberg, {convention}")


def _refuse_others(scope: Scope, owner: Owner, item: Item, body: MergedBlock) -> None:
    """Report other entries for the joint's frame beside `dh`; and note why results of `dh` cannot vary directly."""
    for name in INSTEAD:
        other = body.get(name)
        if other is not None:
            scope.complaints.error(
                "D181",
                f"{owner.label} has both `dh` and `{name}`",
                other.place,
                also=[Label(item.place, "the Denavit-Hartenberg numbers")],
                help=leave_out(
                    f"`dh` says all of the joint's frame: leave `{name}` out (`remove {name};` where a base has it)"
                ),
            )
        for path in (name, *(f"{name}.{axis}" for axis in XYZ)):
            scope.not_sweepable[owner.join(path)] = follows(owner.join("dh"), _numbers(owner))


def _numbers(owner: Owner) -> list[str]:
    """The paths of the numbers of a joint's `dh`."""
    return [owner.join(f"dh.{wanted.name}") for wanted in NUMBERS]


def _convention(scope: Scope, item: Item) -> str | None:
    """Name of the convention; None where it is unknown or its numbers have no names (already reported)."""
    name = word_of(item.value)
    if name in CONVENTIONS:
        if isinstance(item.value, Call) and item.value.positional:
            scope.complaints.error(
                "D180", f"`{name}` takes its numbers by name", place_of(item.value.positional[0]), help=USAGE
            )
            return None
        return name
    meant = OTHER_NAMES.get(name or "")
    helps = [write(meant, old=name)] if meant else list(did_you_mean(name, CONVENTIONS)) if name else []
    message = f"no Denavit-Hartenberg convention `{name}`" if name else "the name of a convention is needed here"
    scope.complaints.error("D180", message, item.value_place, help=[*helps, USAGE])
    return None
