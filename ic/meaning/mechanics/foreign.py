"""Joints of other formats that MET does not have: their messages and remedies."""

from __future__ import annotations

from ic.grammar.syntax import Name
from ic.meaning.definitions.merge import Item
from ic.meaning.mechanics.bodies import written_elsewhere
from ic.meaning.parameters.scope import Scope

OTHER_KINDS = {
    "floating": "three prismatic and three revolute joints",
    "planar": "two prismatic joints and a revolute one",
    "spherical": "three revolute joints",
    "ball": "three revolute joints",
}


def refuse_foreign_joint(scope: Scope, item: Item) -> bool:
    """Return True, with an error, if a joint is of a kind that MET does not have, or follows another joint."""
    kind = item.detail[0].text if item.detail else ""
    there = "in the arm's block, " if written_elsewhere(scope, item.place) else ""
    if kind in OTHER_KINDS:
        helps = [f"{OTHER_KINDS[kind]} do the same, with links of `mass = 0 kg` between them"]
        if there:
            helps.append(f"{there}`remove {item.name};` makes room for them")
        scope.complaints.error(
            "D212",
            f"joint `{item.name}` is {kind}, and joints are revolute, prismatic or fixed",
            item.detail[0].place,
            help=helps,
        )
        return True
    mimic = item.body.get("mimic") if item.body is not None else None
    if mimic is not None:
        other = f"`{mimic.value.text}`" if isinstance(mimic.value, Name) else "another"
        free = "leave `mimic` out: the joint then moves by itself"
        if there:
            free = f"{there}`{item.name} {{ remove mimic; }}` lets it move by itself"
        held = f"`remove {item.name};  joint {item.name} fixed {{ ... }}` holds it where it is at q = 0"
        scope.complaints.error(
            "D213", f"joint `{item.name}` follows {other}, which is not in this version", mimic.place, help=[free, held]
        )
        return True
    return False
