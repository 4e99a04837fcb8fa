"""Joints that follow others: the joints that lead one, by way of others too."""

from __future__ import annotations

from collections.abc import Mapping

from met.plan import Joint


def followed(name: str, joints: Mapping[str, Joint]) -> list[str]:
    """The names of a joint and of all that it follows, by way of others too, each once."""
    names = [name]
    for current in names:
        for leader in joints[current].follows if current in joints else ():
            if leader not in names:
                names.append(leader)
    return names


def leaders(name: str, joints: Mapping[str, Joint]) -> list[str]:
    """The names of the joints that lead a joint, and follow none themselves; its own where it follows none."""
    return [leader for leader in followed(name, joints) if not joints[leader].follows]


def follows_itself(name: str, joints: Mapping[str, Joint]) -> bool:
    """True for a joint that follows itself by way of others."""
    return any(name in joints[other].follows for other in followed(name, joints) if other in joints)
