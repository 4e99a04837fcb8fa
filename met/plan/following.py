"""Joints that follow others: the joints that lead one, by way of others too."""

from __future__ import annotations

from collections.abc import Mapping

from met.plan import Joint


def followed(name: str, joints: Mapping[str, Joint]) -> list[str]:
    """The names of a joint and of all that it follows, by way of others too, each once."""
    found = [name]
    for each in found:
        for leader in joints[each].follows if each in joints else ():
            if leader not in found:
                found.append(leader)
    return found


def leaders(name: str, joints: Mapping[str, Joint]) -> list[str]:
    """The names of the joints that lead a joint, and follow none themselves; its own where it follows none."""
    return [each for each in followed(name, joints) if not joints[each].follows]


def follows_itself(name: str, joints: Mapping[str, Joint]) -> bool:
    """True for a joint that follows itself by way of others."""
    return any(name in joints[each].follows for each in followed(name, joints) if each in joints)
