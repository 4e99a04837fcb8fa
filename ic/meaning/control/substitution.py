"""Motors on beds: `substitute JOINT { bed = ...; law = ...; }`, the models' parameters, scales, and checks across
joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ic.grammar.syntax import Call, Expression, place_of
from ic.language.runs import BED, LAW, SCALE, SCALE_OF_INERTIA
from ic.meaning.control.schedule import Ticks
from ic.meaning.control.servos import Use, moving_kind
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.parameters.models import (
    body_of,
    check_keys,
    find_model,
    refuse_values,
    use_model,
    word_of,
)
from ic.meaning.parameters.owner import Owner, chosen
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words, with_article
from met import models
from met.diagnostic import Label, Place, leave_out
from met.parameter import Parameter
from met.plan import EnvironmentUse, Origin, Schedule, Substitution
from met.substitution import bed_scale
from met.substitution.bed_scale import BedScale

DEFAULTS: dict[models.Kind, str] = {"bed": BED, "law": LAW}
RATES = ("rate", "position")
"""Kinds of a joint's command with which a servo's law has a rate to command a drive."""
SLOWEST_BED_HZ = 10.0
"""Lowest rate of exchanges with a bed: its shaft is computed in steps of 250 us, each of them recorded."""
USAGE = "write `substitute JOINT { bed = BED(...);  law = LAW(...); }`"


def resolve_substitutions(
    scope: Scope, block: MergedBlock, arm: ResolvedArm, uses: list[Use]
) -> tuple[Substitution, ...]:
    """Each joint whose motor is on a bed (a real or emulated test bench) with its bed's and its law's model, in the
    arm's order; joints that failed join `scope.failed_servos`."""
    servos = {use.joint: use for use in uses}
    by_joint: dict[str, tuple[Substitution, Place]] = {}
    for item in block.of_kind("substitute"):
        with scope.complaints.gather():
            substitution = _substitution(scope, item, arm, servos)
            if substitution is not None:
                by_joint[item.name] = substitution
                continue
        scope.checks.fail(f"{item.name}.bed")
        scope.checks.fail(f"{item.name}.law")
        scope.failed_servos |= {item.name}
    in_order = [by_joint[joint.name] for joint in arm.joints if joint.name in by_joint]
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


def check_ticks(
    scope: Scope, substitutions: tuple[Substitution, ...], ticks: Mapping[str, Ticks], schedule: Schedule
) -> None:
    """Check that the servos of joints on motor beds tick, and all at the same instants."""
    for use in substitutions:
        if ticks[use.joint].continuous and use.place is not None:
            scope.complaints.error(
                "D106",
                f"the servo of joint `{use.joint}` is continuous, and its motor is on a bed",
                use.place,
                help="a bed's servo ticks: write a rate in Hz",
            )
        elif schedule.base_hz / ticks[use.joint].divisor < SLOWEST_BED_HZ and use.place is not None:
            rate = schedule.base_hz / ticks[use.joint].divisor
            scope.complaints.error(
                "D367",
                f"the servo of joint `{use.joint}` ticks at {rate:g} Hz, too seldom for a motor on a bed",
                use.place,
                help=f"give it {SLOWEST_BED_HZ:g} Hz or more: between two ticks the shaft goes on with what it was "
                "told last",
            )
    for use in substitutions[1:]:
        rates = [schedule.base_hz / ticks[other.joint].divisor for other in (use, substitutions[0])]
        if rates[0] != rates[1] and use.place is not None and substitutions[0].place is not None:
            scope.complaints.error(
                "D178",
                f"the servo of joint `{use.joint}` ticks at {rates[0]:g} Hz, and that of joint "
                f"`{substitutions[0].joint}`, whose motor is on a bed too, at {rates[1]:g} Hz",
                use.place,
                also=[Label(substitutions[0].place, f"{rates[1]:g} Hz")],
                help=[
                    "all substituted joints of a run are solved together: give their servos the same `rate`",
                    "or substitute them in two runs",
                ],
            )


def check_brakes(scope: Scope, substitutions: tuple[Substitution, ...], environment: Iterable[EnvironmentUse]) -> None:
    """Check that no model puts dry friction on a joint whose motor is on a bed, since its friction is the real
    motor's."""
    for use in environment:
        friction_joint = models.find("environment", use.model).friction_joint
        joint = scope.parameters.get(f"environment.{use.name}.{friction_joint}") if friction_joint else None
        for other in substitutions:
            if joint is not None and joint.value == other.joint and use.place is not None and other.place is not None:
                message = f"`{use.name}` puts friction on joint `{other.joint}`, whose motor is on a bed"
                scope.complaints.error(
                    "D244",
                    message,
                    use.place,
                    also=[Label(other.place, "on a bed")],
                    help=leave_out("leave it out: on a bed, friction is the bed's"),
                )


def check_runaways(
    scope: Scope, substitutions: tuple[Substitution, ...], environment: Iterable[EnvironmentUse]
) -> None:
    """Check that no model replaces the outputs of a servo whose rate loop is the drive's: they do not reach the
    drive."""
    on_rate = {use.joint: use for use in substitutions if models.find("bed", use.bed).drive == "rate"}
    for use in environment:
        model = models.find("environment", use.model)
        if model.replaced_outputs is None or not model.servo_of:
            continue
        joint = scope.parameters.get(f"environment.{use.name}.{model.servo_of}")
        on_bed = None if joint is None else on_rate.get(str(joint.value))
        if on_bed is not None and use.place is not None and on_bed.place is not None:
            message = f"`{use.name}` replaces the voltage of joint `{on_bed.joint}`, and `{on_bed.bed}` sends a rate"
            helps = leave_out("leave it out: what the drive does with its rate is the drive's")
            scope.complaints.error("D368", message, use.place, also=[Label(on_bed.place, "on a bed")], help=helps)


def _substitution(
    scope: Scope, item: Item, arm: ResolvedArm, servos: Mapping[str, Use]
) -> tuple[Substitution, Place] | None:
    """The models of a joint's bed and law, and the place that names the law; None where something failed (already
    reported)."""
    if item.name in arm.failed:
        return None
    if item.value is not None or item.detail:
        place = item.detail[0].place if item.detail else item.value_place
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
                f"put the motor of `{leaders[0]}`, which it follows, on a bed"
                if (leaders := next(joint.follows for joint in arm.moving if joint.name == item.name))
                else f"give it one: `servos {{ {item.name} = SERVO; }}`",
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
            f"{' or '.join(f'`{other_word}`' for other_word in only[1])} alone",
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
            also=[Label(sensor.place, "the sensor") for sensor in use.sensors if sensor.place],
            help="leave the sensor out in this run: `remove QUANTITY;`, or a servo `like` it without",
        )
        return None
    block = item.body or MergedBlock()
    check_keys(scope, block, (*DEFAULTS, SCALE.name), Owner(f"`substitute {item.name}`", item.place, ""))
    scaled, scale = block.get(SCALE.name), None
    if scaled is not None:
        scale = _scale(scope, item.name, scaled)
        if scale is None:
            return None
    bed, law = (_model(scope, part_kind, block.get(part_kind), item) for part_kind in DEFAULTS)
    for part_kind, model in (("bed", bed), ("law", law)):
        if model is None:
            continue
        part = block.get(part_kind)
        owner = Owner(
            f"{part_kind} `{model.name}` of joint `{item.name}`",
            (part or item).place,
            f"{item.name}.{part_kind}",
            homes=(part or item).homes,
            joint=kind,  # type: ignore[arg-type]
            call=True,
        )
        scope.not_sweepable[f"{owner.path}.model"] = chosen(owner.path, "models")
        body = (part.body if part is not None else None) or MergedBlock()
        if part_kind == "bed":
            _use_bed(scope, owner, model, body, use, scale)
            if scale is not None and scaled is not None:
                _check_strength(scope, owner, use, scale, scaled)
        else:
            use_model(scope, owner, model.parameters, body)
    if bed is None or law is None:
        return None
    if bed.drive == "rate" and not _has_rate(scope, item, block, bed, use):
        return None
    named = block.get("law")
    place = _name_place(named.value) if named is not None and named.value is not None else item.place
    return Substitution(item.name, bed.name, law.name, item.place, scaled=scale is not None), place


def _has_rate(scope: Scope, item: Item, block: MergedBlock, bed: Any, use: Use) -> bool:
    """True where the servo's law has a rate loop that a bed's drive may replace, and its command gives it a rate;
    otherwise that was reported."""
    named = block.get("bed")
    place = item.place if named is None or named.value is None else _name_place(named.value)
    sentence = f"`{bed.name}` tells the drive of joint `{item.name}` a rate"
    beds = models.find_own("bed").items()
    sends = [f"`{name}` sends {with_article(model.drive)}" for name, model in beds if model.drive != "rate"]
    other = f"or another bed: {', '.join(sends)}"
    if use.servo.rate_loop is None or use.servo.rate_wanted is None:
        known = [
            name for name, servo in models.available("servo").items() if servo.rate_loop and models.has_motor(servo)
        ]
        message = (
            f"{sentence}, and servo `{use.definition}` ({use.servo.name}) has no rate loop that could be the drive's"
        )
        helps = [known_words("servo models that have one", sorted(known)), other]
    elif use.command is not None and use.command.kind not in RATES:
        message = f"{sentence}, and the joint's command is {with_article(use.command.kind)}"
        helps = [f"command it by {' or '.join(with_article(kind) for kind in RATES)}", other]
    else:
        return True
    scope.complaints.error("D368", message, place, also=[Label(use.place, "its servo")], help=helps)
    return False


def _name_place(value: Expression) -> Place:
    """The place of a model's name alone."""
    return value.name.place if isinstance(value, Call) else place_of(value)


def _model(scope: Scope, kind: models.Kind, item: Item | None, around: Item) -> Any:
    """The model of a motor bed or of a law, the default where none is named; None where that failed (already
    reported)."""
    if item is None or item.value is None:
        return models.find(kind, DEFAULTS[kind], around.place)
    model = find_model(scope, kind, word_of(item.value), _name_place(item.value))
    if model is None or refuse_values(scope, item.value, [p.name for p in models.written(model)]):
        return None
    return model


def _scale(scope: Scope, joint: str, item: Item) -> BedScale | None:
    """The scales between a joint's motor and the one on its bed; None where one of them is wrong (already reported)."""
    before = scope.complaints.error_count
    body, path = body_of(scope, item), f"{joint}.bed.{SCALE.name}"
    owner = Owner(f"the scale of joint `{joint}`'s bed", item.place, path, homes=item.homes)
    values = use_model(scope, owner, bed_scale.PARAMETERS, body, (SCALE_OF_INERTIA.name,))
    written = body.get(SCALE_OF_INERTIA.name)
    if values is None or scope.complaints.error_count > before:
        return None
    if written is not None:
        inertia = scope.number(owner, SCALE_OF_INERTIA, written, record=False)
        own = owner.join(SCALE_OF_INERTIA.name)
        if inertia is not None:
            scope.checks.require(
                (inertia, values["torque"], values["rate"]),
                _not_its_quotient,
                code="D365",
                message=f"`inertia` of {owner.label} is not that of its torque and rate",
                place=written.value_place,
                path=own,
                needs=tuple(owner.join(parameter.name) for parameter in bed_scale.PARAMETERS),
                help="leave it out: with one time for both, inertia is torque over rate",
            )
    return None if scope.complaints.error_count > before else BedScale(**values)


def _not_its_quotient(table: np.ndarray) -> tuple[np.ndarray, list[str]]:
    follows = table[:, 1] / table[:, 2]
    bad = ~(np.abs(table[:, 0] - follows) <= 1e-9 * follows)
    return bad, [f"it is {x[1]:g}/{x[2]:g} = {x[1] / x[2]:g}" for x in table[bad][:1]]


def _check_strength(scope: Scope, owner: Owner, use: Use, scale: BedScale, scaled: Item) -> None:
    """Warn where the motor on the bed reaches its largest torque before the joint's own would (D366)."""
    path, servo_path = owner.join("tau_max"), f"{use.joint}.servo.tau_max"
    own, joints = scope.parameters.get(path), scope.parameters.get(servo_path)
    if own is None or joints is None:
        return
    place = own.origin.place if own.origin.kind == "deck" and own.origin.place is not None else scaled.place
    values: tuple[Any, ...] = (own.value, joints.value, scale.torque)

    def warn(table: np.ndarray) -> None:
        """Warn about the first case in which the motor on the bed is weaker than the joint's (D366). table: [case, 3],
        the largest torque of each of the two, N m, and the scale of torque between them."""
        weak = np.flatnonzero(table[:, 0] * table[:, 2] < (1.0 - 1e-9) * table[:, 1])
        if not weak.size:
            return
        most, wanted, times = table[weak[0]]
        where = scope.checks.where(int(weak[0]), values)
        scope.complaints.remark(
            "D366",
            f"the bed's motor of joint `{use.joint}` gives {most:g} N*m at most{where}, which stands for "
            f"{most * times:g} N*m, and the joint's motor gives {wanted:g} N*m",
            place,
            help=[
                "beyond that torque the run is one of a weaker motor; where it stays below, nothing is lost",
                f"a stronger motor on the bed, or `torque = {wanted / most:g};` in its `scale`, by which inertias grow "
                "too",
            ],
        )

    scope.checks.observe(values, warn, place, needs=(path, servo_path, f"{owner.path}.{SCALE.name}.torque"))


def _use_bed(scope: Scope, owner: Owner, bed: Any, body: MergedBlock, use: Use, scale: BedScale | None = None) -> None:
    """Enter every parameter of a motor bed: as in the deck, else from the word of its faults, the servo's value, or the
    default. A bed with a `scale` divides the servo's value by it, so that its motor is an exact model of the
    joint's."""
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
        known = wanted.of_servo and models.parameter(use.servo, wanted.of_servo) is not None
        if item is None and known and (scale is None or wanted.unit in bed_scale.POWERS):
            over = None if scale is None else scale.of(wanted.unit)
            scope.copied(owner, wanted, f"{use.joint}.servo.{wanted.of_servo}", over)
        elif item is None and wanted.name in preset:
            _preset(scope, owner, replace(wanted, default=preset[wanted.name]), faults)
        else:
            use_model(scope, owner, (wanted,), MergedBlock({wanted.name: item} if item is not None else {}))


def _preset(scope: Scope, owner: Owner, wanted: Parameter, faults: Item | None) -> None:
    """The value of a parameter from the word written as `faults`, which is its origin."""
    scope.number(owner, wanted, None)
    settled = scope.parameters.get(owner.join(wanted.name))
    if settled is not None and settled.origin.kind == "default" and faults is not None and faults.value is not None:
        note = f"by `{models.FAULTS}`"
        settled.origin = Origin("deck", place_of(faults.value), faults.overrides, note)
        settled.expression = faults.value
