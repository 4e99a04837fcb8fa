"""Parts of an arm that belong together: links that are fixed to the base, and the pieces and springs of a boom."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from met.parameter import BASE

if TYPE_CHECKING:
    from met.plan import Joint, Link


def ground(links: Iterable[Link], joints: Iterable[Joint]) -> tuple[str, ...]:
    """The links that do not move against the base: the base, where it is a link, and all links fixed to it."""
    grounded = {BASE}
    fixed = {joint.child: joint.parent for joint in joints if joint.kind == "fixed"}
    while more := {child for child, parent in fixed.items() if parent in grounded} - grounded:
        grounded |= more
    return tuple(link.name for link in links if link.name in grounded)


def way_inward(joints: Iterable[Joint], link: str) -> list[Joint]:
    """The joints between a link and the base, from the link inwards, fixed ones too."""
    carriers = {joint.child: joint for joint in joints}
    way: dict[str, Joint] = {}
    while link in carriers and carriers[link].name not in way:  # a broken tree is reported elsewhere
        way[carriers[link].name] = carriers[link]
        link = carriers[link].parent
    return list(way.values())


def chains(links: Iterable[Link], joints: Iterable[Joint]) -> dict[str, tuple[Joint, ...]]:
    """The joints between the pieces of each boom, from its tip to its root, by the boom's name."""
    carriers = {joint.child: joint for joint in joints}
    by_boom = {}
    for boom in links:
        piece, chain = boom.name, []
        while boom.root and piece != boom.root and piece in carriers:
            chain.append(carriers.pop(piece))
            piece = chain[-1].parent
        if boom.root:
            by_boom[boom.name] = tuple(chain)
    return by_boom


def springs(links: Iterable[Link], joints: Iterable[Joint]) -> frozenset[str]:
    """Names of the joints at which booms bend and twist."""
    return frozenset(joint.name for chain in chains(links, joints).values() for joint in chain if joint.kind != "fixed")


def straightened(links: Iterable[Link], joints: Iterable[Joint]) -> tuple[tuple[Link, ...], tuple[Joint, ...]]:
    """The links and joints with each boom as the rigid link that it is while straight."""
    links, joints = tuple(links), tuple(joints)
    by_boom = chains(links, joints)
    booms = {joint.parent: boom for boom, chain in by_boom.items() for joint in chain}  # by each of their pieces
    own = {joint.name for chain in by_boom.values() for joint in chain}
    return (
        tuple(link for link in links if link.name not in booms),
        tuple(
            replace(joint, parent=booms.get(joint.parent, joint.parent), child=booms.get(joint.child, joint.child))
            for joint in joints
            if joint.name not in own
        ),
    )
