"""Remedies for a path written as an entry: `elbow.servo.kp` is `servos { elbow { kp = ...; } }` in a run."""

from __future__ import annotations

from ic.grammar.syntax import spell
from ic.language.bodies import JOINT, LINK
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.parameters.models import word_of
from met.diagnostic import Help, write

OF_JOINT = (*JOINT.keys, "pivot")


def in_run(definitions: Definitions, block: MergedBlock, item: Item, rates: tuple[str, ...]) -> list[str]:
    """The remedy for a path that stands in a run's block as an entry; none where it names nothing known.

    block the run's; rates: the names of a run's rates
    """
    return _in_its_block(block, item, _of_path(definitions, block, item, rates))


def _of_path(definitions: Definitions, block: MergedBlock, item: Item, rates: tuple[str, ...]) -> list[str]:
    """Remedies for an entry of a run that is written as a path, by what the path's words name; none where they name
    nothing."""
    joints, links, arm = _of_arm(definitions, block)
    value = spell(item.value) if item.value is not None else "..."
    match item.name.split("."):
        case ["servos", joint, key] | [joint, "servo", key] if joint in joints:
            return [_write(item, f"servos {{ {joint} {{ {key} = {value}; }} }}")]
        case [joint, "servo"] | ["servos", joint] if joint in joints:
            return [_write(item, f"servos {{ {joint} = {value}; }}")]
        case [joint, "q" | "qd" as key] | ["initial", joint, "q" | "qd" as key] if joint in joints:
            return [_write(item, f"initial {{ {joint}.{key} = {value}; }}")]
        case ["environment", model, key]:
            return [_write(item, f"environment {{ {model} {{ {key} = {value}; }} }}")]
        case ["links", thing, key] if thing in links and key in LINK.keys:
            return [_write(item, f"with {item.name} = {value};")]
        case [name] if name in definitions.lets:
            return [_write(item, f"with {name} = {value};")]
        case [servo, _] if servo in definitions.of_kind("servo"):
            return [_write(item, f"with {item.name} = {value};")]
        case [thing, key] if (thing in joints and key in OF_JOINT) or (thing in links and key in LINK.keys):
            changed = f"`arm OTHER like {arm} {{ {thing} {{ {key} = {value}; }} }}`"
            return [f"it is the arm's: {changed}, and `arm = OTHER;` here"]
        case [rate] if rate in rates:
            return [_write(item, f"rates {{ {rate} = {value}; }}")]
        case ["rates" | "tolerances" | "initial" | "environment" as head, *rest] if len(rest) == 1:
            return [_write(item, f"{head} {{ {rest[0]} = {value}; }}")]
        case ["tolerances", *rest]:
            return [_write(item, f"tolerances {{ {'.'.join(rest)} = {value}; }}")]
    return []


def in_arm(item: Item, known: list[str]) -> list[str]:
    """The remedy for a path that stands in an arm's block as an entry. known: names of its links and joints."""
    value = spell(item.value) if item.value is not None else "..."
    words = item.name.removeprefix("links.").split(".")
    if len(words) == 2 and words[0] in known and item.body is None:
        return [_write(item, f"{words[0]} {{ {words[1]} = {value}; }}")]
    return []


def _in_its_block(block: MergedBlock, item: Item, helps: list[str]) -> list[str]:
    """The help that says to write `servos { ... }`, or, where the same text has that block already, what to write in
    it."""
    for help in helps:
        head, _, inner = help.removeprefix("write `").partition(" { ")
        entry = block.get(head) if inner else None
        if entry is not None and entry.body is not None and entry.homes == item.homes:
            inner = inner.removesuffix(" }`")
            instead = ", in place of what is there" if entry.body.get(inner.split()[0]) is not None else ""
            return [f"write `{inner}` in the run's `{head} {{ ... }}`{instead}"]
    return helps


def _write(item: Item, entry: str) -> Help:
    """The help that says to write an entry in place of the item's, with its value if there is one."""
    return write(entry, where="entry") if item.value is not None and not item.appended else Help(f"write `{entry}`")


def _of_arm(definitions: Definitions, block: MergedBlock) -> tuple[list[str], list[str], str]:
    """The joints, the links and the name of the run's arm; empty where it has none."""
    named = block.get("arm")
    arm = definitions.of_kind("arm").get(word_of(named.value) or "") if named is not None else None
    body = definitions.block(arm) if arm is not None else None
    if arm is None or body is None:
        return [], [], ""
    return [joint.name for joint in body.of_kind("joint")], [link.name for link in body.of_kind("link")], arm.name
