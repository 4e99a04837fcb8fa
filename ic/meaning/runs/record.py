"""The channels that a run records, and messages about unknown names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from ic.grammar.syntax import Binary, Call, Expression, List, Name, Unary, WithUnit, place_of
from ic.meaning.definitions.merge import Item
from ic.meaning.parameters.owner import NotSweepable, Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import counted, known_words
from met import models
from met.diagnostic import Help, Label, Place, did_you_mean, nearest, write
from met.plan import Recorded, Structure
from met.plan.channel import FAMILIES, Channel, carries, recordable
from met.plan.closing import in_loops

COMPUTED = (Binary, Call, Unary, WithUnit)
"""Expressions that could be a signal."""

OF_SERVO = frozenset({"servo", "bed", "law"})
"""Heads of channels that a joint has only with a servo, or with its motor on a bed."""


def resolve_record(
    scope: Scope, run: Owner, item: Item | None, structure: Structure, channels: Mapping[str, Channel]
) -> tuple[Recorded, ...]:
    """The variables that are recorded, in the deck's order. channels: of the structure and of `names_in_record`."""
    scope.not_sweepable["record"] = NotSweepable("is one for the whole sweep", "record all that any case needs")
    if item is None:
        scope.complaints.missing(
            run.place,
            ("record",),
            "D124",
            f"{run.label} records nothing",
            help=write(
                "record = [q, qd, tau];",
                "write `record = [q, qd, tau];`, or `record = [];` where metrics are all you want",
                where="inside",
            ),
        )
        return ()
    names_written = [name for expression in (item.value, *item.appended) for name in _names(scope, item, expression)]
    names = {name.text for name in names_written}
    known = recordable(structure, known=channels, wanted=names)
    if not names <= known.keys():
        known = recordable(structure, known=channels)  # for suggestions
    by_name: dict[str, tuple[Recorded, Place]] = {}
    for name in names_written:
        variables = known.get(name.text)
        if variables is None and scope.failed_servos and not OF_SERVO.isdisjoint(word.text for word in name.path):
            continue
        if variables is None and of_lost(scope, name, structure):
            continue
        if (
            variables is None
            and scope.failed_parts
            and (name.path[0].text in scope.failed_parts or not structure.moving)
        ):
            continue
        if variables is None:
            scope.complaints.error(
                "D125", f"no channel `{name.text}`", name.place, help=nearest_channels(name, known, structure)
            )
        for variable in variables or ():
            if variable.name in by_name:
                scope.complaints.error(
                    "D040",
                    f"`{variable.name}` is recorded twice",
                    name.place,
                    also=[Label(by_name[variable.name][1], "first")],
                    help="leave one out",
                )
            else:
                by_name[variable.name] = (variable, name.place)
    return tuple(recorded for recorded, _ in by_name.values())


def names_in_record(item: Item | None) -> list[str]:
    """The names in a record, as far as it is a list of names."""
    lists = [] if item is None else [item.value, *item.appended]
    return [
        name.text for listed in lists if isinstance(listed, List) for name in listed.items if isinstance(name, Name)
    ]


def of_lost(scope: Scope, name: Name, structure: Structure) -> bool:
    """Return True if this is a channel of a link, a guide or a link's sensor that failed (already reported); of a boom
    also one of its springs or pieces."""
    words = [word.text for word in name.path]
    lost = {
        "links": scope.failed_parts | {word for word in words[1:2] if word.rpartition("_")[0] in scope.failed_parts},
        "guides": set(scope.guides) - {guide.name for guide in structure.guides},
        "sensors": scope.sensors - {sensor.name for sensor in structure.sensors},
    }.get(words[0], set())
    of_spring = words[0].rpartition("_")[0] in scope.failed_parts
    return of_spring or (bool(lost) and (len(words) == 1 or words[1] in lost))


def _names(scope: Scope, item: Item, expression: Expression | None) -> Iterator[Name]:
    """The names of channels in a `record`, one by one; what is no name is reported (D124), and `none` has none."""
    if isinstance(expression, Name) and expression.text == "none":
        return
    items: Iterable[Expression] = expression.items if isinstance(expression, List) else ()
    if not isinstance(expression, List):
        scope.complaints.error(
            "D124",
            "a record is a list of channels",
            place_of(expression) if expression else item.place,
            help="write `record = [q, qd, tau];`",
        )
    for element in items:
        if isinstance(element, Name):
            yield element
        else:
            scope.complaints.error(
                "D124",
                "a record is a list of channels; this is none",
                place_of(element),
                help=[
                    "write `record = [q, qd, tau];`",
                    *(
                        ["give it a name: `signal NAME = ...;`, and record `signals.NAME`"]
                        * isinstance(element, COMPUTED)
                    ),
                ],
            )


def nearest_channels(name: Name, known: dict[str, tuple[Recorded, ...]], structure: Structure) -> list[str]:
    """The remedy for an unknown channel: why there is none, or similar channels of the same joint or link, else of all;
    vectors and families as a whole."""
    why = _why_none([word.text for word in name.path], structure)
    if why:
        return [why]
    first, *others = (word.text for word in name.path)
    turned = ".".join((*others, first))
    ending = [path for path in known if path.endswith(f".{name.text}")]
    if turned in known and others:
        return [_did_you_mean(name, turned)]
    if len(ending) == 1:
        return [_did_you_mean(name, ending[0])]
    if first == "sensors" and structure.sensors:
        sensors = [path for path in known if path.startswith("sensors.")]
        return [*did_you_mean(name.text, sensors), known_words("sensors of links", sensors)]
    whole = [path for path in known if path.rpartition(".")[0] not in known]
    head = ".".join(word.text for word in name.path[:2]) if first in ("links", "payloads") else first
    own = [path for path in whole if path.startswith(head + ".")]
    if own:
        rests = [path.removeprefix(f"{head}.") for path in known if path.startswith(f"{head}.")]
        near = nearest(name.text.removeprefix(f"{head}."), rests)  # all that begins with the joint looks alike
        meant = [] if near is None else [_did_you_mean(name, f"{head}.{near}")]
        return [*meant, known_words(f"channels of `{head}`", own)]
    joints = [path for path in whole if known[path][0].joints and not path.startswith("links.")]
    arm = [path for path in whole if path in FAMILIES and not known[path][0].joints]
    links = [path for path in whole if path.startswith("links.")]
    some = [link for link in links if link.split(".")[1] == links[0].split(".")[1]]
    payloads = [f"payloads.{payload.name}" for payload in structure.payloads[:1]]
    of_payload = [path for path in whole for payload in payloads if path.startswith(f"{payload}.")]
    return [
        *did_you_mean(name.text, known),
        known_words("channels of all joints", joints),
        known_words("channels of the arm, and of a link", [*arm, *some]),
        *([known_words("channels of a payload", of_payload)] if of_payload else []),
    ]


def _did_you_mean(name: Name, near: str) -> Help:
    return write(near, f"did you mean `{near}`?", old=name.text)


def _why_none(words: list[str], structure: Structure) -> str:
    """The reason why a fixed joint, a servo or a joint has no such channel; "" where that is not the cause."""
    if words[0] in {joint.name for joint in structure.joints if joint.kind == "fixed"}:
        return (
            f"joint `{words[0]}` is fixed: its two links move as one body, and nothing is computed between them; "
            "what they take shows in the reaction of the moving joint that carries them"
        )
    looped = in_loops(structure.joints)
    if words[0] in looped and words[1:2] == ["reaction"]:
        return (
            f"how the joints of loop `{looped[words[0]].name}` share its load is not computed; a joint that carries "
            "the whole loop has a reaction"
        )
    if len(words) > 1 and words[-2] == "servo":
        return _under_a_word(words, structure)
    moving, links = ({part.name for part in group} for group in (structure.moving, structure.links))
    if len(words) < 5 or (words[0], words[2]) != ("links", "jacobian") or words[3] not in FAMILIES["jacobian"]:
        return ""
    link, joint = words[1], words[4]
    if link not in links or joint not in moving or carries(structure, link, joint):
        return ""
    return f"joint `{joint}` does not carry link `{link}`, so it does not move it"


def _under_a_word(words: list[str], structure: Structure) -> str:
    """The word of its model under which a servo would have this channel; "" where there is none."""
    for use in structure.servos:
        model = models.find("servo", use.model, use.place)
        parts = (part for group in models.HELD for part in getattr(model, group, ()) if part.name == words[-1])
        only = next((part.only for part in parts if part.only is not None), None)
        if only is not None and words[0] in ("servo", use.joint):
            needed = " or ".join(f"`{only[0]} = {word};`" for word in only[1])
            return f"the servo of joint `{use.joint}` ({use.model}) has it with {needed}"
    return ""


def not_one(name: Name, structure: Structure) -> tuple[str, list[str]]:
    """The message and remedies for a name of several channels: the channels, or a similar name."""
    known = recordable(structure, [name.text])
    if name.text not in known:
        return f"no channel `{name.text}`", nearest_channels(name, known, structure)
    numbers = [f"`{path}`" for variable in known[name.text] for path in variable.channels]
    return f"`{name.text}` is {counted(len(numbers), 'channel')}", [
        known_words("a metric watches one of them", numbers)
    ]
