"""The initial state of a run: positions and rates of joints, and servos that begin balanced."""

from __future__ import annotations

from collections.abc import Sequence

from ic.language.runs import INITIAL
from ic.meaning.checks.idle import at_rest
from ic.meaning.control.servos import Use
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.expressions.quantity import Value, ValueList
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.mechanics.following import begin_followers, leaders_in_words
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.base import INITIAL_OF_BASE
from ic.meaning.runs.from_command import is_from_command, report_others, value_of_command
from ic.text.complaints import known_words
from met import models, units
from met.diagnostic import did_you_mean, leave_out
from met.parameter import Parameter
from met.plan import BASE, Structure
from met.units import PURE


def resolve_initial(scope: Scope, body: MergedBlock, arm: ResolvedArm, uses: Sequence[Use]) -> None:
    """Settle the initial state of all joints; those that follow others begin where these put them.

    uses  their servos, whose commands may give it
    """
    servos = {use.joint: use for use in uses}
    known = dict.fromkeys(("q", "qd"), "")
    springs = [joint for joint in arm.moving if joint.name in arm.springs]
    known |= {f"{joint.name}.{name}": "" for joint in (*arm.independent, *springs) for name in ("q", "qd")}
    known |= dict.fromkeys(INITIAL.keys, "")
    of_base = dict.fromkeys(INITIAL_OF_BASE if any(link.name == BASE for link in arm.links) else (), "")
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
                count, moving = len(listed.items), len(arm.independent)
                message = f"{count} number{'s' * (count != 1)} for {moving} joint{'s' * (moving != 1)}"
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
