"""The environment of a run, its models and their parameters; and its initial state.

Where a command gives it, the position is the value of the joint's position command at t = 0. The rate is the slope of
that there, or the value of its rate command. Both are recorded where a sweep varies the course.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType, SimpleNamespace
from typing import Final

from ic.grammar.syntax import Name, place_of
from ic.language.runs import ENVIRONMENT, INITIAL
from ic.meaning.checks.idle import at_rest, remark_idle, remark_kinds
from ic.meaning.control.servos import Use
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.expressions.quantity import Value, ValueList
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.mechanics.loops import begin_followers, leaders_in_words
from ic.meaning.parameters.models import (
    check_keys,
    find_model,
    refuse_statements,
    refuse_values,
    report_named_lists,
    use_model,
    use_table,
    word_of,
)
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.relations import check_names
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.base import INITIAL_OF_BASE, fixed_to, remark_ground
from ic.text.complaints import counted, known_words
from met import models, units
from met.diagnostic import Label, did_you_mean, leave_out
from met.parameter import WORLD, Parameter
from met.plan import BASE, Base, EnvironmentUse, Joint, Payload, Structure
from met.trace import Scalar
from met.units import ONE, PURE


def resolve_environment(
    scope: Scope,
    body: MergedBlock,
    arm: ResolvedArm,
    base: Base | None,
    payloads: tuple[Payload, ...],
    duration: float | None,
) -> tuple[EnvironmentUse, ...]:
    """The environment models of a run, in the deck's order; their numbers are settled in the scope."""
    uses = []
    for item in body.items.values():
        if item.kind:
            meant = f"{item.name} = {item.kind}" if item.kind in models.available("environment") else "NAME = MODEL"
            scope.complaints.error(
                "D157", f"no `{item.kind}` in an environment", item.place, help=f"write `{meant} {{ ... }}`"
            )
        elif item.name not in ENVIRONMENT.keys:
            use = _environment_use(scope, item, arm, base, payloads, duration)
            if use is not None:
                uses.append(use)
    refuse_statements(scope, body, "the environment")
    return tuple(uses)


def _environment_use(
    scope: Scope, item: Item, arm: ResolvedArm, base: Base | None, payloads: tuple[Payload, ...], duration: float | None
) -> EnvironmentUse | None:
    """The model of an entry of `environment`; None where it has a mistake, which is reported."""
    owner = Owner(f"environment `{item.name}`", item.place, f"environment.{item.name}", homes=item.homes)
    name = word_of(item.value)
    if item.name == "gravity" and name in (None, "gravity", *scope.definitions.lets):
        owner = replace(owner, short="g")
    is_value = item.name == "gravity" and (name is None or name in scope.definitions.lets)
    if item.value is not None and is_value:
        gravity = models.find_own("environment")["gravity"]
        with scope.complaints.gather():
            value = scope.evaluate(item)
            if isinstance(value, Value):
                size = "9.81" if isinstance(value.number, Scalar) else ONE.decimal(abs(value.number))
                scope.complaints.error(
                    "D071",
                    "`gravity` is a list of 3 numbers",
                    value.place,
                    help=f"write `gravity = [0, 0, -{size}] m/s^2;`",
                )
                return None
        scope.vector(replace(owner, label="gravity", called="`gravity`"), gravity.parameters[0], item)
        return EnvironmentUse(item.name, gravity.name, None, item.place)
    if item.value is None:
        scope.complaints.error(
            "D158",
            f"no environment model `{item.name}` to change",
            item.place,
            help=[
                f"`{item.name} = MODEL {{ ... }}` would add one",
                known_words("models", sorted(models.available("environment"))),
            ],
        )
        return None
    environment = find_model(scope, "environment", name, place_of(item.value))
    if environment is None or refuse_values(scope, item.value, [p.name for p in environment.written]):
        return None
    body = item.body or MergedBlock()
    # a payload called `world` is already reported, and is no reason to report uses that mean the ground
    bodies = [*(link.name for link in arm.links), *(payload.name for payload in payloads if payload.name != WORLD)]
    failed = (*arm.failed, *(payload.name for payload in payloads if payload.name == WORLD))
    known = {"joint": [joint.name for joint in arm.moving if joint.name not in arm.springs], "link": bodies}
    named = check_names(scope, owner, environment.parameters, body, arm=arm.name, known=known, failed=failed)
    about = next((named[p.name] for p in environment.parameters if p.names == "joint" and p.name in named), None)
    if about is not None:  # the meaning of the unit words `joint` and `effort`
        kinds = {joint.name: joint.kind for joint in arm.moving}
        if about not in kinds:  # already reported: without its joint, nothing can be said of the model's units
            check_keys(scope, body, [parameter.name for parameter in environment.written], owner)
            scope.checks.fail(owner.path)
            return EnvironmentUse(item.name, environment.name, None, item.place)
        owner = replace(owner, joint=kinds[about])
    lists = [parameter for parameter in environment.parameters if parameter.shape == "list" and environment.from_file]
    if report_named_lists(scope, owner, lists, body):
        scope.checks.fail(owner.path)
        return EnvironmentUse(item.name, environment.name, None, item.place)
    if environment.from_file and body.get("file") is not None:
        values = use_table(scope, owner, environment, body)
    else:
        values = use_model(
            scope,
            owner,
            environment.parameters,
            body,
            extra=[parameter.name for parameter in environment.written[len(environment.parameters) :]],
        )
    if values is not None:
        held = fixed_to(arm, payloads)
        words = {p.name: held.get(values[p.name], values[p.name]) for p in environment.parameters if p.names == "link"}
        if not (duration is not None and remark_idle(scope, environment, item, {**values, **words}, duration)):
            remark_ground(scope, item, arm, base, environment, values, payloads)
            remark_kinds(scope, environment, item, arm)
    slides = owner.joint == "prismatic" and any("effort" in signal.unit for signal in environment.signals)
    return EnvironmentUse(item.name, environment.name, None, item.place, slides)


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
        item.value_place,
        also=why,
        help=[
            f"write `{first.name}.{name} = 0 {_UNITS[first.kind][name]};` beside it",
            *([f"or give `{first.name}` a servo with such a command, in `servos`"] if use is None else []),
            *([names] if len(others) > 1 else []),
        ],
    )
    for joint in others:
        scope.checks.fail(f"initial.{joint.name}.{name}")


def resolve_initial(scope: Scope, body: MergedBlock, arm: ResolvedArm, uses: Sequence[Use]) -> None:
    """Settle the initial state of all joints; those that follow others begin where these put them.

    uses  their servos, whose commands may give it
    """
    servos = {use.joint: use for use in uses}
    springs = [joint for joint in arm.moving if joint.name in arm.springs]
    of_joints = [f"{joint.name}.{name}" for joint in (*arm.independent, *springs) for name in ("q", "qd")]
    known = dict.fromkeys(("q", "qd", *of_joints, *INITIAL.keys))
    of_base = INITIAL_OF_BASE if any(link.name == BASE for link in arm.links) else ()
    for item in body.items.values():
        if not item.kind and item.name.partition(".")[0] in arm.failed:
            continue
        if item.kind or item.name not in (*known, *INITIAL_OF_BASE):
            beginnings = (*known, *of_base)
            first = item.name.partition(".")[0]
            follows = next((joint.follows for joint in arm.moving if joint.name == first), ())
            scope.complaints.error(
                "D114",
                f"no initial `{item.name}`",
                item.place,
                help=f"`{first}` begins where {leaders_in_words(follows)} would have it: set that"
                if follows
                else [*did_you_mean(item.name, beginnings), known_words("there is", beginnings)],
            )
    for name, unit in (("q", "joint"), ("qd", "joint/s")):
        wanted = Parameter(name=name, unit=unit, default=0.0, doc=f"initial {name}")
        general = body.get(name)
        listed: ValueList | None = None
        commanded = is_from_command(scope, general)
        if general is not None and commanded:
            alone = [joint for joint in arm.independent if body.get(f"{joint.name}.{name}") is None]
            report_others(scope, name, general, alone, servos)
        elif general is not None:
            with scope.complaints.gather():
                general_value = scope.evaluate(general)
                listed = general_value if isinstance(general_value, ValueList) else None
            if listed is not None and arm.failed:
                continue
            if listed is not None and len(listed.items) != len(arm.independent):
                message = f"{counted(len(listed.items), 'number')} for {counted(len(arm.independent), 'joint')}"
                names = ", ".join(joint.name for joint in arm.independent)
                helps = f"one for each moving joint, in the arm's order, or one for all: {names}"
                scope.complaints.error("D071", message, listed.place, help=helps)
                continue
        for n, joint in enumerate(arm.independent):
            own = body.get(f"{joint.name}.{name}")
            owner = Owner(
                f"joint `{joint.name}`",
                (own or general).place if own or general else joint.place,  # type: ignore
                f"initial.{joint.name}",
                joint=joint.kind,
            )
            if own is not None and is_from_command(scope, own):
                report_others(scope, name, own, [joint], servos)
            written = own or general
            if written is not None and is_from_command(scope, written):
                taken = value_of_command(scope, owner, wanted, written, servos.get(joint.name))
                if taken is None:
                    scope.checks.fail(owner.join(name))
                else:
                    scope.number(owner, wanted, written, value=taken)
                continue
            value = listed.items[n] if listed is not None and own is None else None
            if isinstance(value, ValueList):
                scope.complaints.error("D071", "a list inside a list", value.place)
                continue
            if general is not None and own is None and listed is None and _mixed(scope, owner, wanted, general, arm):
                break
            scope.number(owner, wanted, written, value=value)
        for joint in springs:
            own = body.get(f"{joint.name}.{name}")
            place = own.place if own is not None else joint.place
            owner = Owner(f"joint `{joint.name}`", place, f"initial.{joint.name}", joint=joint.kind)  # type: ignore
            scope.number(owner, wanted, own)
    begin_followers(scope, arm.joints)


def check_balanced(scope: Scope, item: Item | None, uses: Sequence[Use], structure: Structure) -> None:
    """Warn where servos should begin balanced and none of them can, or there is no load; and of positions that a deck
    gives the springs of booms, which begin where their loads hold them. item: the entry that asks for it"""
    if not structure.balanced or item is None:
        return
    for spring in sorted(structure.springs):
        begins = scope.parameters.get(f"initial.{spring}.q")
        if begins is not None and begins.origin.place is not None:
            scope.complaints.remark(
                "D248",
                f"`{spring}.q` changes nothing: with `servos = balanced` a boom begins where its load holds it",
                begins.origin.place,
                help=leave_out("leave it out, or `servos = balanced`"),
            )
    if not any(use.servo.balance for use in uses) and not structure.springs:
        able = [name for name, model in models.available("servo").items() if model.balance]
        scope.complaints.remark(
            "D248",
            "no servo of this run can begin balanced: this changes nothing",
            item.place,
            help=known_words("models that can", able),
        )
    elif structure.base is None and all(at_rest(use) == "nothing" for use in structure.environment):
        scope.complaints.remark(
            "D248",
            "the servos begin balanced, and there is no load: no gravity and nothing else acts on the arm",
            item.place,
            help=["on the ground write `environment { gravity = [0, 0, -9.81] m/s^2; }`", leave_out("or leave it out")],
        )


def _mixed(scope: Scope, owner: Owner, wanted: Parameter, general: Item, arm: ResolvedArm) -> bool:
    """Return True, with an error, if the value for all joints lacks this joint's unit, since others move
    differently."""
    if len({joint.kind for joint in arm.independent}) < 2:
        return False
    with scope.complaints.gather():
        value = scope.evaluate(general)
        unit, dimension = owner.unit(wanted)
        if isinstance(value, Value) and value.dimension != PURE and not units.same(value.dimension, dimension):
            scope.complaints.error(
                "D061",
                f"`{wanted.name}` of {owner.label}, which is {owner.joint}, is in {unit}, and this is in "
                f"{units.text(value.dimension)}",
                value.place,
                help=[
                    f"write it joint by joint: `{owner.path.removeprefix('initial.')}.{wanted.name} = 0 {unit};`",
                    "or leave it out: without it all joints begin at 0",
                ],
            )
            return True
    return False
