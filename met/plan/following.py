"""Joints that follow others: the joints that lead one, by way of others too."""

from __future__ import annotations

from collections.abc import Mapping

from met.plan import Joint


def followed(name: str, joints: Mapping[str, Joint]) -> list[str]:
    """The names of a joint and of all joints from which its position follows, also by way of others, each once."""
    names = [name]
    for current in names:
        for leader in joints[current].follows if current in joints else ():
            if leader not in names:
                names.append(leader)
    return names


def leaders(name: str, joints: Mapping[str, Joint]) -> list[str]:
    """The names of the joints that move by themselves and from which a joint's position follows; its own name where it
    moves by itself."""
    return [leader for leader in followed(name, joints) if not joints[leader].follows]


def follows_itself(name: str, joints: Mapping[str, Joint]) -> bool:
    """True for a joint whose position would follow from its own, by way of others."""
    return any(name in joints[other].follows for other in followed(name, joints) if other in joints)
