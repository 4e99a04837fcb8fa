"""Motors on beds: `substitute JOINT { bed = ...; law = ...; }`, the models' parameters, and that joints go together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from ic.grammar.places import place_of
from ic.grammar.syntax import Call, Expression
from ic.language.runs import BED, LAW
from ic.meaning.control.schedule import Ticks
from ic.meaning.control.servos import Use, moving_kind
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters import not_sweepable
from ic.meaning.parameters.models import check_keys, find_model, refuse_values, use_model, word_of
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.diagnostic import Label, Place, leave_out
from met.parameter import Parameter
from met.plan import EnvironmentUse, Origin, Schedule, Substitution

DEFAULTS: dict[models.Kind, str] = {"bed": BED, "law": LAW}
USAGE = "write `substitute JOINT { bed = BED(...);  law = LAW(...); }`"


def resolve_substitutions(
    scope: Scope, block: MergedBlock, arm: ResolvedArm, uses: list[Use]
) -> tuple[Substitution, ...]:
    """Every joint whose motor is on a bed, in the arm's order; those that failed join `scope.failed_servos`."""
    servos = {use.joint: use for use in uses}
    found: dict[str, tuple[Substitution, Place]] = {}
    for item in block.of_kind("substitute"):
        with scope.complaints.gather():
            made = _substitution(scope, item, arm, servos)
            if made is not None:
                found[item.name] = made
                continue
        scope.checks.fail(f"{item.name}.bed")
        scope.checks.fail(f"{item.name}.law")
        scope.failed_servos |= {item.name}
    in_order = [found[joint.name] for joint in arm.joints if joint.name in found]
    for use, place in in_order[1:]:
        first, also = in_order[0]
        if use.law != first.law:
            scope.complaints.error(
                "D177",
                f"joint `{use.joint}` has the law `{use.law}`, and joint `{first.joint}` has `{first.law}`",
                place,
                also=[Label(also, f"`{first.law}`")],
                help=[
                    "all substituted joints of a run are solved together, by one law: write the same for each",
                    "or substitute them in two runs",
                ],
            )
    return tuple(use for use, _ in in_order)


def check_ticks(scope: Scope, found: tuple[Substitution, ...], ticks: Mapping[str, Ticks], schedule: Schedule) -> None:
    """The servos of substituted joints tick, and together."""
    for use in found:
        if ticks[use.joint].continuous and use.place is not None:
            scope.complaints.error(
                "D106",
                f"the servo of joint `{use.joint}` is continuous, and its motor is on a bed",
                use.place,
                help="a bed's servo ticks: write a rate in Hz",
            )
    for use in found[1:]:
        rates = [schedule.base_hz / ticks[each.joint].divisor for each in (use, found[0])]
        if rates[0] != rates[1] and use.place is not None and found[0].place is not None:
            scope.complaints.error(
                "D178",
                f"the servo of joint `{use.joint}` ticks at {rates[0]:g} Hz, and that of joint "
                f"`{found[0].joint}`, whose motor is on a bed too, at {rates[1]:g} Hz",
                use.place,
                also=[Label(found[0].place, f"{rates[1]:g} Hz")],
                help=[
                    "all substituted joints of a run are solved together: give their servos the same `rate`",
                    "or substitute them in two runs",
                ],
            )


def check_brakes(scope: Scope, found: tuple[Substitution, ...], environment: Iterable[EnvironmentUse]) -> None:
    """No model puts dry friction on a joint whose motor is on a bed: there friction is the bed's."""
    for use in environment:
        friction_joint = models.find("environment", use.model).friction_joint
        joint = scope.parameters.get(f"environment.{use.name}.{friction_joint}") if friction_joint else None
        for each in found:
            if joint is not None and joint.value == each.joint and use.place is not None and each.place is not None:
                message = f"`{use.name}` puts friction on joint `{each.joint}`, whose motor is on a bed"
                scope.complaints.error(
                    "D244",
                    message,
                    use.place,
                    also=[Label(each.place, "on a bed")],
                    help=leave_out("leave it out: on a bed, friction is the bed's"),
                )


def _substitution(
    scope: Scope, item: Item, arm: ResolvedArm, servos: Mapping[str, Use]
) -> tuple[Substitution, Place] | None:
    """The joint's bed and law, and the place that names the law; None where something failed (already reported)."""
    if item.name in arm.failed:
        return None
    if item.value is not None or item.detail:
        place = item.detail[0].place if item.detail else place_of(item.value) if item.value is not None else item.place
        scope.complaints.error("D179", "`substitute` takes the name of one joint, and a block", place, help=USAGE)
        return None
    kind = moving_kind(scope, item, arm, "so it has no motor")
    if kind is None or item.name in scope.failed_servos:
        return None
    use = servos.get(item.name)
    if use is None:
        scope.complaints.error(
            "D175",
            f"joint `{item.name}` has no servo, so it has no motor that a bed could take the place of",
            item.place,
            help=[
                f"give it one: `servos {{ {item.name} = SERVO; }}`",
                known_words(
                    "joints whose servos have a motor",
                    [use.joint for use in servos.values() if models.has_motor(use.servo)],
                ),
            ],
        )
        return None
    if not models.has_motor(use.servo):
        known = [name for name, servo in models.available("servo").items() if models.has_motor(servo)]
        scope.complaints.error(
            "D176",
            f"servo `{use.definition}` ({use.servo.name}) of joint `{item.name}` has no motor that a bed could "
            "take the place of",
            item.place,
            also=[Label(use.place, "its servo")],
            help=known_words("servo models that have a motor", sorted(known)),
        )
        return None
    only = use.servo.motor_only
    if only is not None and (word := dict(use.words).get(only[0], only[1][0])) not in only[1]:
        scope.complaints.error(
            "D176",
            f"the servo of joint `{item.name}` has `{only[0]} = {word}`, and a motor on a bed has "
            f"{' or '.join(f'`{each}`' for each in only[1])} alone",
            item.place,
            also=[Label(use.place, "its servo")],
            help=f"write `{only[0]} = {only[1][0]};`, or leave the joint to its servo",
        )
        return None
    if use.sensors:
        scope.complaints.error(
            "D246",
            f"the servo of joint `{item.name}` has a sensor, and its motor is on a bed, which has its own",
            item.place,
            also=[Label(each.place, "the sensor") for each in use.sensors if each.place],
            help="leave the sensor out in this run: `remove QUANTITY;`, or a servo `like` it without",
        )
        return None
    block = item.body or MergedBlock()
    check_keys(scope, block, DEFAULTS, Owner(f"`substitute {item.name}`", item.place, ""))
    bed, law = (_model(scope, each, block.get(each), item) for each in DEFAULTS)
    for each, model in (("bed", bed), ("law", law)):
        if model is None:
            continue
        part = block.get(each)
        owner = Owner(
            f"{each} `{model.name}` of joint `{item.name}`",
            (part or item).place,
            f"{item.name}.{each}",
            homes=(part or item).homes,
            joint=kind,  # type: ignore[arg-type]
            call=True,
        )
        scope.not_sweepable[f"{owner.path}.model"] = not_sweepable.chosen(f"vary `{owner.path}` over models")
        body = (part.body if part is not None else None) or MergedBlock()
        if each == "bed":
            _use_bed(scope, owner, model, body, use)
        else:
            use_model(scope, owner, model.parameters, body)
    if bed is None or law is None:
        return None
    named = block.get("law")
    place = _name_place(named.value) if named is not None and named.value is not None else item.place
    return Substitution(item.name, bed.name, law.name, item.place), place


def _name_place(value: Expression) -> Place:
    """The place of a model's name, without what stands behind it."""
    return value.name.place if isinstance(value, Call) else place_of(value)


def _model(scope: Scope, kind: models.Kind, item: Item | None, around: Item) -> Any:
    """The model of a bed or a law, the default where none is named; None where that failed (already reported)."""
    if item is None or item.value is None:
        return models.find(kind, DEFAULTS[kind], around.place)
    model = find_model(scope, kind, word_of(item.value), _name_place(item.value))
    if model is None or refuse_values(scope, item.value, [p.name for p in models.written(model)]):
        return None
    return model


def _use_bed(scope: Scope, owner: Owner, bed: Any, body: MergedBlock, use: Use) -> None:
    """Every parameter of a bed: what the deck writes, else the word's of its faults, the servo's, the default."""
    written = models.written(bed)
    check_keys(scope, body, [p.name for p in written], owner)
    faults, preset = None, {}
    for wanted in written:
        if wanted.name == models.FAULTS and wanted.shape == "word":
            faults = body.get(wanted.name)
            preset = bed.presets.get(scope.word(owner, wanted, faults), {})
    for wanted in bed.parameters:
        item = body.get(wanted.name)
        if wanted.shape == "text":
            continue
        if item is None and wanted.of_servo and models.parameter(use.servo, wanted.of_servo) is not None:
            scope.copied(owner, wanted, f"{use.joint}.servo.{wanted.of_servo}")
        elif item is None and wanted.name in preset:
            _preset(scope, owner, replace(wanted, default=preset[wanted.name]), faults)
        else:
            use_model(scope, owner, (wanted,), MergedBlock({wanted.name: item} if item is not None else {}))


def _preset(scope: Scope, owner: Owner, wanted: Parameter, faults: Item | None) -> None:
    """A parameter that the word written as `faults` sets; its origin is that word."""
    scope.number(owner, wanted, None)
    settled = scope.parameters.get(owner.join(wanted.name))
    if settled is not None and settled.origin.kind == "default" and faults is not None and faults.value is not None:
        note = f"by `{models.FAULTS}`"
        settled.origin = Origin("deck", place_of(faults.value), faults.overrides, note)
        settled.expression = faults.value
