"""Servo definitions that no run uses: each is tried on a joint, so that its mistakes are told before it is used."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ic.grammar.syntax import Call, Entry, Expression, List, Setting
from ic.language import OF_A_RUN
from ic.meaning.control.sensors import without_sensors
from ic.meaning.control.servos import NOT_PARAMETERS, is_guide, use_command
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.parameters.models import use_model, word_of
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import Complaints
from met import models
from met.diagnostic import Diagnostic
from met.plan import JointKind

KINDS: tuple[JointKind, ...] = ("revolute", "prismatic")


def servos_in_use(definitions: Definitions) -> frozenset[str]:
    """The servo definitions that a run has, or a sweep chooses, and those that these are like."""
    servos = definitions.of_kind("servo")
    own = [item.body for block in definitions.run_blocks() if (item := block.get("servos")) is not None]
    values = [item.value for body in own if body is not None for item in body.items.values()]
    for kind in OF_A_RUN:
        for definition in definitions.of_kind(kind).values():
            values += _values(definition.group.body)
    names = (definitions.definition_named(value) or word_of(value) for value in values)
    used = [servos[name] for name in names if name is not None and name in servos]
    return frozenset(home for used_servo in used for home in definitions.homes(used_servo))


def _values(entries: Iterable[Entry]) -> Iterator[Expression]:
    """The expressions that entries choose among, such as `vary hinge.servo = [first, second];`, through blocks."""
    for entry in entries:
        value = getattr(entry, "value", None)
        yield from value.items if isinstance(value, List) else ()
        yield from _values(getattr(entry, "body", None) or ())


def check_on_a_joint(scope: Scope, name: str) -> None:
    """Report what is wrong with a servo definition on a joint of either kind, except for what it lacks: that may be
    written where it is used."""
    definition = scope.definitions.of_kind("servo")[name]
    block = scope.definitions.block(definition)
    model = word_of(item.value) if block is not None and (item := block.get("model")) is not None else None
    if block is None or model not in models.available("servo"):
        return  # already reported, or to be written where it is used
    servo, block = models.find("servo", model, definition.place), without_sensors(block)
    command = block.get("command")
    inner = command.value.positional[:1] if command is not None and isinstance(command.value, Call) else ()
    reports: list[tuple[Diagnostic, ...]] = []
    for joint in KINDS:
        complaints = Complaints()
        lacking = (*NOT_PARAMETERS, *(parameter.name for parameter in servo.parameters))
        complaints.known_missing |= {(definition.place, entry) for entry in lacking}
        trial = Scope(scope.definitions.reporting_to(complaints), complaints)
        homes = scope.definitions.homes(definition)
        owner = Owner(f"servo `{definition.name}`", definition.place, "a.servo", homes, "", joint)
        with complaints.gather():
            use_model(trial, owner, servo.parameters, block, NOT_PARAMETERS)
        with complaints.gather():
            if not any(is_guide(scope, part) or _is_of_a_file(part) for part in inner):
                use_command(trial, owner, servo, command, definition.place)
        if not complaints.errors:
            return
        reports.append(complaints.errors)
    scope.complaints.add(*min(reports, key=len))


def _is_of_a_file(inner: Expression) -> bool:
    """Return True for a command from a CSV file, which is read by the joint's name."""
    body = inner.body or () if isinstance(inner, Call) else ()
    words = [word for word, _ in inner.named] if isinstance(inner, Call) else []
    words += [setting.path[-1] for setting in body if isinstance(setting, Setting)]
    return any(word.text == "file" for word in words)
