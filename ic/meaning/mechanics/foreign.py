"""Joints that MET does not have, of other formats or closing a chain: their messages and remedies."""

from __future__ import annotations

from ic.grammar.syntax import Name, spell
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters.owner import XYZ
from ic.meaning.parameters.scope import Scope
from met.diagnostic import Place
from met.plan import BASE, Joint

BUSHING = ((1e5, "revolute"), (1e3, "prismatic"))
"""Stiffness of a bushing that closes a chain of links of some kg, N/m, then N m/rad; and the kind of joint that has it
also along, or about, its axis."""

SINGULAR = ", except where the middle one of these is at 90 deg: there they are singular"
OTHER_KINDS = {
    "floating": f"three prismatic and three revolute joints do the same{SINGULAR}",
    "planar": "two prismatic joints and a revolute one do the same",
    "spherical": f"three revolute joints do the same{SINGULAR}",
    "ball": f"three revolute joints do the same{SINGULAR}",
}


def refuse_foreign_joint(scope: Scope, item: Item, arm: str, block: MergedBlock) -> bool:
    """Return True, with an error, if a joint is of a kind that MET does not have.

    arm, block: the name of its arm, and all that this holds
    """
    kind = item.detail[0].text if item.detail else ""
    where = "in the arm's block, " if scope.definitions.robot_files.hold(item.place) else ""
    if kind in OTHER_KINDS:
        helps = [f"{OTHER_KINDS[kind]}; put links of `mass = 0 kg` between them"]
        if where:
            helps.append(f"{where}`remove {item.name};` makes room for them")
        on_base = [other for other in block.of_kind("joint") if _link(other, "parent") == BASE]
        base = block.get(f"link {BASE}")
        if (
            kind == "floating"
            and on_base == [item]
            and (base is None or scope.definitions.robot_files.hold(base.place))
        ):
            weighs = base or scope.definitions.base_from_file(arm)
            helps = [_free_base(item, where, f"link {BASE} {{ mass = 0 kg; }}" if weighs else "")]
        scope.complaints.error(
            "D212",
            f"joint `{item.name}` is {kind}, and joints are revolute, prismatic or fixed",
            item.detail[0].place,
            help=helps,
        )
        return True
    return False


def how_to_close(scope: Scope, joint: Joint, place: Place) -> list[str]:
    """The helps for a joint that closes a chain: a bushing that leaves free what the joint does."""
    of_file = scope.definitions.robot_files.hold(place)
    removal = f"in the arm's block, `remove {joint.name};`" if of_file else f"leave `{joint.name}` out"
    at, rpy, axis = ([_number(scope, f"{joint.name}.{key}.{part}") for part in XYZ] for key in ("at", "rpy", "axis"))
    along = [k for k in range(3) if axis[k] != 0.0]
    if joint.kind == "fixed":
        along = []
    elif len(along) != 1:  # about no axis of the frame
        return [f"a stiff `bushing` of the run's `environment` closes a chain (`met doc bushing`): {removal}"]
    stiff, turning = ([size * (k not in along or kind == joint.kind) for k in range(3)] for size, kind in BUSHING)
    keys = [("to_at", at, "m"), ("to_rpy", rpy, "rad"), ("stiffness", stiff, "N/m")]
    keys += [("damping", [stiffness * 1e-3 for stiffness in stiff], "N*s/m"), ("turning", turning, "N*m/rad")]
    keys += [("turning_damping", [stiffness * 1e-3 for stiffness in turning], "N*m*s/rad")]
    to = "" if joint.parent == BASE else f"  to = {joint.parent};"
    numbers = "".join(
        f"  {key} = [{', '.join(map(_spelled, three))}] {unit};" for key, three, unit in keys if any(three)
    )
    bushing = f"{joint.name} = bushing {{ link = {joint.child};{to}{numbers} }}"
    return [f"a stiff `bushing` closes a chain: {removal}", f"then, in the run's `environment`: `{bushing}`"]


def _spelled(value: float) -> str:
    return repr(value).removesuffix(".0")


def _number(scope: Scope, path: str) -> float:
    """A parameter's value; 0 where there is none, or the deck varies it."""
    settled = scope.parameters.get(path)
    return settled.value if settled is not None and isinstance(settled.value, float) else 0.0


def _free_base(item: Item, where: str, weightless: str) -> str:
    """The help for a floating joint that is the only one on the base. weightless: entry of a base without mass"""
    body = item.body or MergedBlock()
    child = _link(item, "child") or "..."
    frame = [(key, entry.value) for key in ("at", "rpy") if (entry := body.get(key)) is not None]
    placing = "".join(f"  {key} = {spell(value)};" for key, value in frame if value is not None)
    entries = [f"remove {item.name};"] if where else []
    entries += [
        f"joint {item.name} fixed {{ parent = {BASE};  child = {child};{placing} }}",
        *filter(None, (weightless,)),
    ]
    return f"{where}`{'  '.join(entries)}`, and in the run `base = free;`: base and `{child}` then float as one"


def _link(joint: Item, end: str) -> str | None:
    """The link that a joint has as its parent or child, as written."""
    entry = joint.body.get(end) if joint.body is not None else None
    return entry.value.text if entry is not None and isinstance(entry.value, Name) else None
