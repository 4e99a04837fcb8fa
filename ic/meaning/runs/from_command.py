"""Initial positions and rates that commands give: `initial { q = command;  qd = command; }`.

The position is the value of the joint's position command at t = 0. The rate is the slope of that there, or the value
of its rate command. Both are recorded where a sweep varies the course.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType, SimpleNamespace
from typing import Final

from ic.grammar.syntax import Name, place_of
from ic.meaning.control.servos import Use
from ic.meaning.definitions.merge import Item
from ic.meaning.expressions.quantity import Value
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.diagnostic import Label
from met.parameter import Parameter
from met.plan import Joint

COMMAND: Final = "command"
KINDS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType({"q": ("position",), "qd": ("position", "rate")})
"""The kinds of command that determine a joint's initial position (q), and rate (qd)."""

_UNITS: Final = MappingProxyType({"revolute": {"q": "rad", "qd": "rad/s"}, "prismatic": {"q": "m", "qd": "m/s"}})


def is_from_command(scope: Scope, item: Item | None) -> bool:
    """Return True if an initial value is the word `command`; a `let` of that name is its own value."""
    value = item.value if item is not None and item.body is None and not item.appended else None
    return isinstance(value, Name) and value.text == COMMAND and not scope.names.knows(COMMAND)


def value_of_command(scope: Scope, owner: Owner, wanted: Parameter, item: Item, use: Use | None) -> Value | None:
    """The initial value from a command; None where its parameters failed, or it gives none (`gives`)."""
    assert item.value is not None
    if use is None or use.command is None or not gives(use, wanted.name):
        return None
    profile = models.find("command", use.command.model)
    head = f"{use.joint}.servo.command"
    if any(scope.checks.failed(f"{head}.{parameter.name}") for parameter in profile.parameters):
        return None
    parameters = {parameter.name: scope.settled(f"{head}.{parameter.name}") for parameter in profile.parameters}
    known = {name: settled.value for name, settled in parameters.items() if settled is not None}
    if len(known) < len(parameters):
        return None
    value, slope = profile.course(SimpleNamespace(**known), 0.0)
    number = slope if wanted.name == "qd" and use.command.kind == "position" else value
    return Value(number, owner.unit(wanted)[1], place_of(item.value))


def gives(use: Use | None, name: str) -> bool:
    """Return True if the joint's own command determines its initial value of this name, `q` or `qd`."""
    return use is not None and use.command is not None and not use.command.guide and use.command.kind in KINDS[name]


def _command_is_lost(scope: Scope, use: Use | None) -> bool:
    """Return True if the joint's servo has a faulty command (already reported)."""
    servo = scope.definitions.of_kind("servo").get(use.definition) if use is not None and use.command is None else None
    block = scope.definitions.block(servo) if servo is not None else None
    return block is not None and block.get(COMMAND) is not None


def report_others(scope: Scope, name: str, item: Item, joints: Iterable[Joint], uses: Mapping[str, Use]) -> None:
    """Report joints for which the deck asks an initial value from commands that have none."""
    others = [
        joint
        for joint in joints
        if joint.name not in scope.failed_servos
        and not gives(uses.get(joint.name), name)
        and not _command_is_lost(scope, uses.get(joint.name))
    ]
    if not others:
        return
    kinds = " or ".join(KINDS[name])
    first, use = others[0], uses.get(others[0].name)
    why: list[Label] = []
    if use is not None and use.command is not None and use.command.guide:
        why = [Label(use.place, f"it follows guide `{use.command.guide}`, which begins where the joint does")]
    elif use is not None and use.command is not None:
        why = [Label(use.place, f"joint `{first.name}` has a {use.command.kind} command")]
    elif use is not None:
        why = [Label(use.place, f"the servo of joint `{first.name}` takes no command")]
    elif first.place is not None:
        why = [Label(first.place, f"joint `{first.name}` has no servo")]
    names = known_words(f"no {kinds} command moves", [joint.name for joint in others])
    scope.complaints.error(
        "D380",
        f"`{name} = {COMMAND}` takes the {'position' if name == 'q' else 'rate'} from a command, and joint "
        f"`{first.name}` has no {kinds} command of its own",
        place_of(item.value) if item.value is not None else item.place,
        also=why,
        help=[
            f"write `{first.name}.{name} = 0 {_UNITS[first.kind][name]};` beside it",
            *([f"or give `{first.name}` a servo with such a command, in `servos`"] if use is None else []),
            *([names] if len(others) > 1 else []),
        ],
    )
    for joint in others:
        scope.checks.fail(f"initial.{joint.name}.{name}")
