"""Servos on joints: the definition with the use's overrides, its model's parameters, its command and rate."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np

from ic.grammar.syntax import Call, Expression, Name, Number, String, WithUnit, Word, place_of
from ic.language.unit_words import after_number
from ic.meaning.control.courses import course_named, use_course
from ic.meaning.control.schedule import Rate, fixed_rate
from ic.meaning.control.sensors import use_sensor, without_sensors
from ic.meaning.control.shared_servos import use_shared, with_other_joints
from ic.meaning.definitions.merge import Item, MergedBlock, overlay, refuse_block
from ic.meaning.expressions.quantity import measure_of
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.mechanics.loops import leaders_in_words
from ic.meaning.parameters.models import (
    check_keys,
    find_bare_model,
    find_model,
    use_model,
    word_of,
    words_chosen,
)
from ic.meaning.parameters.owner import Owner, Settled, chosen
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from ic.text.files import add_include, library_defines
from met import models
from met.diagnostic import Label, Place, Problem, did_you_mean, error, leave_out, meant
from met.frozen import frozen
from met.parameter import Parameter
from met.plan import Command, Joint, SensorUse, ServoUse
from met.plan.channel import COMMAND_UNIT
from met.trace import Scalar, where
from met.unit_parser import parse_unit

APART, DIGITS = 1e-9, 1e-5
"""Positions are equal within APART (rad or m: far above rounding of a deck's numbers, far below visible differences)
and a unit of the sixth digit: so many are printed, and a position copied from there counts as equal."""

NOT_PARAMETERS = ("model", "command", "rate")
EXAMPLE_SETPOINTS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "revolute": {"rate": "0.03 rad/s", "position": "30 deg", "torque": "2 N*m", "acceleration": "0.1 rad/s^2"},
        "prismatic": {"rate": "0.03 m/s", "position": "0.1 m", "torque": "2 N", "acceleration": "0.1 m/s^2"},
    }
)
"""Examples of setpoints, by kind of joint and of command, for messages that show how a command is written."""

MODEL_NOT_COMMAND = "write `model = {};`, and its parameters beside it"


@frozen
class Use:
    """A servo on a joint. rate None: the run's `rates.servos`. parameters None: some failed (already reported).

    words    those on which parts of the model depend
    sensors  through which its law sees
    """

    joint: str
    definition: str
    servo: Any
    command: Command | None
    rate: Rate | None
    parameters: dict[str, Any] | None
    place: Place
    words: tuple[tuple[str, str], ...] = ()
    sensors: tuple[SensorUse, ...] = ()

    @property
    def has_law(self) -> bool:
        return self.servo.control is not None

    @property
    def command_kind(self) -> str:
        """The kind of its command, such as `position`; "" of a servo without one."""
        return self.command.kind if self.command is not None else ""

    @property
    def bare(self) -> ServoUse:
        """The servo as a plan has it, without its rate and its sensors."""
        return ServoUse(self.joint, self.definition, self.servo.name, self.command, 1, self.place, self.words)


def resolve_servos(scope: Scope, body: MergedBlock, arm: ResolvedArm) -> tuple[list[Use], frozenset[str]]:
    """Every servo of the run, in the order of the arm's joints; and the joints whose servo failed or may belong to an
    unknown name (already reported)."""
    uses = {joint.name: _spring(scope, joint) for joint in arm.moving if joint.name in arm.springs}
    body = with_other_joints(body, arm, scope.complaints)
    _note_kinds(scope, body, arm)
    for item in body.items.values():
        with scope.complaints.gather():
            use: Use | None = use_shared(scope, item, arm, _use)
            if use is not None and not _is_taken(scope, item, arm, use):
                uses[use.joint] = use
    moving = [joint.name for joint in arm.moving]
    failed = [item.name for item in body.items.values() if item.name not in uses]
    lost = frozenset(
        name
        for item in failed
        for name in (item, item if item in moving else meant(item, moving))
        if name is not None and name not in uses
    )
    return [uses[joint.name] for joint in arm.joints if joint.name in uses], lost


def _spring(scope: Scope, joint: Joint) -> Use:
    """The servo of a boom's spring, whose stiffness and damping are the boom's."""
    assert joint.place is not None  # joints from a deck have one
    servo, owner = models.find("servo", "passive"), Owner(f"joint `{joint.name}`", joint.place, f"{joint.name}.servo")
    others = [parameter for parameter in servo.parameters if f"{owner.path}.{parameter.name}" not in scope.parameters]
    parameters = use_model(scope, owner, others, MergedBlock()) or {}
    parameters |= {parameter.name: scope.parameters[owner.join(parameter.name)].value for parameter in servo.parameters}
    return Use(joint.name, "boom", servo, None, None, parameters, joint.place)


def _is_taken(scope: Scope, item: Item, arm: ResolvedArm, use: Use) -> bool:
    """Return True, with an error, if a servo is on a spring of a boom, or drives or holds a joint that follows
    another."""
    if item.name in arm.springs:
        message = f"joint `{item.name}` is a spring of a boom, so it has no servo"
        scope.complaints.error("D213", message, item.place, help=leave_out("leave it out"))
        return True
    leaders = next((joint.follows for joint in arm.joints if joint.name == item.name), ())
    if not leaders or use.servo.is_passive:
        return False
    scope.complaints.error(
        "D213",
        f"joint `{item.name}` follows {leaders_in_words(leaders)}, so no `{use.servo.name}` drives it",
        item.place,
        help=[f"write `{leaders[0]} = ...;`: what drives that joint moves both", leave_out("leave this servo out")],
    )
    return True


def _note_kinds(scope: Scope, body: MergedBlock, arm: ResolvedArm) -> None:
    """Note, for every servo definition and its bases, the kinds of joints that it moves in this run."""
    for item in body.items.values():
        kind, definition = arm.kind(item.name), scope.definitions.of_kind("servo").get(word_of(item.value) or "")
        if kind is not None and kind != "fixed" and definition is not None:
            for home in scope.definitions.homes(definition):
                scope.joint_kinds.setdefault(home, set()).add(kind)


def _use(scope: Scope, item: Item, arm: ResolvedArm) -> Use | None:
    """The servo of a joint with this joint's values; None where it has a mistake, which is reported."""
    if item.name in arm.failed and not item.kind:
        return None
    kind = moving_kind(scope, item, arm, "so no servo can move it")
    if kind is None:
        return None
    name = scope.definitions.definition_named(item.value) or word_of(item.value)
    if name is None or (isinstance(item.value, Call) and item.value.positional):
        scope.complaints.error(
            "D146",
            f"the servo of joint `{item.name}` is the name of a servo definition",
            item.value_place,
            help=f"write `{item.name} = SERVO;` or `{item.name} = SERVO {{ kp = ...; }}`",
        )
        return None
    assert item.value is not None
    place = item.value.name.place if isinstance(item.value, Call) else item.value.place
    if name not in scope.definitions.of_kind("servo") and name in models.find_own("servo"):
        file = library_defines("servo", name)
        include = [add_include(file, place, "a servo of this name")] if file else []
        scope.complaints.error(
            "D147",
            f"`{name}` is a servo model; a servo definition is needed here",
            place,
            help=[*include, f"`servo NAME {{ model = {name}; ... }}`, and `{item.name} = NAME;`"],
        )
        return None
    definition = scope.definitions.find_or_meant("servo", Word(name, place), scope.complaints)
    block = scope.definitions.block(definition)
    if block is None:
        return None
    overridden = item.body is not None and bool(item.body.items or item.body.pending)
    if item.body is not None:
        block = overlay(block, item.body, scope.complaints)
    label = f"servo `{name}` on joint `{item.name}`" if overridden else f"servo `{name}`"
    owner = Owner(
        label,
        definition.place,
        f"{item.name}.servo",
        homes=scope.definitions.homes(definition),
        local="",
        joint=kind,  # type: ignore[arg-type]
    )
    model = block.get("model")
    if model is None:
        _report_no_model(scope, block, owner, place)
        return None
    servo = find_bare_model(scope, "servo", model, MODEL_NOT_COMMAND)
    if servo is None:
        return None
    sensed, block = list(block.of_kind("sensor")), without_sensors(block)
    parameters = use_model(scope, owner, servo.parameters, block, NOT_PARAMETERS)
    command = use_command(scope, owner, servo, block.get("command"), place)
    if command is not None:
        _check_needed(scope, owner, servo, command, block, place)
    rate = None
    if servo.control is None and block.get("rate") is not None:
        scope.complaints.error(
            "D150",
            f"the model `{servo.name}` has no computer that ticks, so no rate",
            block.items["rate"].place,
            help=leave_out("leave `rate` out"),
        )
    elif block.get("rate") is not None:
        rate = fixed_rate(
            scope, replace(owner, path=f"{item.name}.servo"), block.items["rate"], f"servo `{name}`", continuous=True
        )
    scope.keep_setting(f"{item.name}.servo.model", servo.name, item=model)
    scope.not_sweepable[f"{item.name}.servo.model"] = chosen(f"{item.name}.servo", "definitions")
    words = words_chosen([parameter for parameter in servo.parameters if parameter.name in servo.deciding], block)
    bare = ServoUse(item.name, name, servo.name, command, 1, words=words)
    sensors = tuple(use for sensor_item in sensed if (use := use_sensor(scope, owner, bare, sensor_item)) is not None)
    return Use(item.name, name, servo, command, rate, parameters, item.place, words, sensors)


def _report_no_model(scope: Scope, block: MergedBlock, owner: Owner, used: Place) -> None:
    """Report a servo without a model, or the entry that may have been meant for it."""
    known = known_words("servo models", sorted(models.find_own("servo")))
    for item in block.items.values():
        if not item.kind and (helps := did_you_mean(item.name, ("model",))):
            scope.complaints.error("D141", f"{owner.label} has no `{item.name}`", item.place, help=[*helps, known])
            return
    scope.complaints.error(
        "D148",
        f"{owner.label} has no model",
        owner.place,
        also=[Label(used, "used here")],
        help=["write `model = MODEL;`", known],
    )


def moving_kind(scope: Scope, item: Item, arm: ResolvedArm, so: str) -> str | None:
    """The kind of the joint that an entry names; None where it is unknown or fixed (already reported). so: the message
    where it is fixed"""
    kind = arm.kind(item.name) if item.kind in ("", "substitute") else None
    definition = scope.definitions.of_kind("arm").get(arm.name)
    if kind is None and definition is not None and scope.complaints.is_known_to_lack(definition.place):
        return None  # an entry of the arm could not be read, which may have been this joint
    if kind is None:
        moving = [joint.name for joint in arm.moving]
        scope.complaints.error(
            "D144",
            f"no joint `{item.name}` in arm `{arm.name}`",
            item.place,
            help=[*did_you_mean(item.name, moving), known_words("joints", moving)],
        )
        scope.complaints.note_lost_names(item.name)  # what else names it follows from this
    if kind == "fixed":
        scope.complaints.error(
            "D145",
            f"joint `{item.name}` is fixed, {so}",
            item.place,
            also=[Label(place, "fixed here") for j in arm.joints if j.name == item.name and (place := j.place)],
            help=leave_out("leave it out, or make the joint revolute or prismatic"),
        )
        return None
    return kind


def _check_needed(scope: Scope, owner: Owner, servo: Any, command: Command, block: MergedBlock, used: Place) -> None:
    """Report each parameter that this kind of command needs and that neither deck, sweep nor command line gives."""
    item = block.get("command")
    place = place_of(item.value) if item is not None and item.value is not None else used
    for parameter in servo.parameters:
        settled = scope.parameters.get(owner.join(parameter.name))
        has_value = block.get(parameter.name) is not None or (settled is not None and settled.origin.kind != "default")
        if command.kind in parameter.needed_for and not has_value:
            message = f"{owner.label} needs `{parameter.name}` under a {command.kind} command"
            scope.complaints.missing(
                owner.place,
                (parameter.name,),
                "D160",
                message,
                place,
                help=f"write `{parameter.name} = ... {owner.unit(parameter)[0]};`: {parameter.doc}",
            )
        elif command.kind in parameter.needed_for and parameter.above_where_needed is not None:
            _check_above(scope, owner, parameter, command, parameter.above_where_needed)


def _check_above(scope: Scope, owner: Owner, parameter: Parameter, command: Command, bound: float) -> None:
    """Check that a number without effect under other commands is above its bound under this one, in every case."""
    path = owner.join(parameter.name)
    settled = scope.parameters.get(path)
    if settled is None or settled.origin.place is None or isinstance(settled.value, str | tuple):
        return
    unit = after_number(settled.unit)
    limit = f"above {bound:g}{unit}"

    def test(values: np.ndarray) -> tuple[np.ndarray, list[str]]:
        bad = values[:, 0] <= bound
        return bad, [f"this is {x:g}{unit}" for x in values[bad, 0][:1]]

    scope.checks.require(
        (settled.value,),
        test,
        code="D077",
        place=settled.origin.place,
        path=f"{path}.needed",
        needs=(path,),
        message=f"{owner.what(parameter)} must be {limit} under a {command.kind} command",
        help=f"write a number {limit} ({parameter.doc})",
    )


def check_rest(scope: Scope, use: Use) -> None:
    """Check that a joint whose servo must begin at rest does, in every case. To be called after the initial state."""
    path = f"initial.{use.joint}.qd"
    begins = scope.parameters.get(path)
    if use.servo.at_rest is None or use.parameters is None or begins is None or begins.origin.place is None:
        return
    with scope.complaints.gather():
        rate = where(use.servo.at_rest(SimpleNamespace(**use.parameters)), begins.value, 0.0)
        scope.checks.require(
            (rate,),
            lambda values: (values[:, 0] != 0.0, [f"this is {x:g} {begins.unit}" for x in values[:, 0] if x][:1]),
            code="D119",
            message=f"joint `{use.joint}` begins with a rate, and servo `{use.definition}` ({use.servo.name}) needs it "
            "at rest",
            place=begins.origin.place,
            help=(leave_out(f"leave `{use.joint}.qd` out of `initial`"), "or give the joint another servo"),
            path=f"{path}.rest",
            needs=(path, f"{use.joint}.servo"),
        )


def commands_of(scope: Scope) -> dict[str, dict[str, Settled]]:
    """The parameters of the commands of a run's joints: by joint, then by name."""
    by_joint: dict[str, dict[str, Settled]] = {}
    for path, quantity in scope.parameters.items():
        joint, of_command, name = path.partition(".servo.command.")
        if of_command:
            by_joint.setdefault(joint, {})[name] = quantity
    return by_joint


STEPS = ("constant", "step", "pulse")
"""Commands that jump, so that a jump at the start is no surprise."""

FAR = 0.02
"""Distance between a joint and the beginning of its command that a servo with a motor makes up unnoticed, rad (m)."""


def check_start(scope: Scope, use: Use, parameters: Mapping[str, Settled]) -> None:
    """Warn where a joint does not begin at its command: one whose servo follows regardless of the arm, and any other
    whose command is a motion and not a step. parameters: the command's parameters by name"""
    command = use.command
    if command is None or command.kind != "position" or scope.complaints.errors:
        return
    if not use.servo.follows and command.model in STEPS:
        return
    begins = scope.parameters.get(f"initial.{use.joint}.q")
    profile = models.find_own("command").get(command.model)  # another package's is called only to be recorded
    values = [parameter.value for parameter in parameters.values()]
    if begins is None or profile is None or {p.name for p in profile.parameters} - set(parameters):
        return
    if not isinstance(begins.value, (int, float)) or any(isinstance(value, Scalar) for value in values):
        return  # a sweep varies one of them
    unit, scale = unit_written([*parameters.values(), begins], begins.unit)
    value, _ = profile.course(SimpleNamespace(**{name: parameter.value for name, parameter in parameters.items()}), 0.0)
    far = use.servo.follows or abs(value - begins.value) > FAR
    if far and differ_beyond_rounding(value, begins.value):
        by_use = sorted(
            parameters.values(), key=lambda parameter: parameter.unit == "s"
        )  # of a table its values before their instants
        places = [parameter.origin.place for parameter in by_use if parameter.origin.place is not None]
        also = [] if begins.origin.place is None else [Label(begins.origin.place, "the joint begins here")]
        scope.complaints.remark(
            "D169",
            f"the command of joint `{use.joint}` begins at {value / scale:g} {unit}, and the joint at "
            f"{begins.value / scale:g} {unit}: it jumps",
            places[0] if places else use.place,
            also=also,
            help=f"write `{use.joint}.q = command;` in `initial`, or begin the command elsewhere",
        )


def differ_beyond_rounding(a: Any, b: Any) -> Any:
    """Return True, for each pair, if two positions or arrays of them differ by more than rounding."""
    return np.abs(a - b) > APART + DIGITS * np.maximum(np.abs(a), np.abs(b))


def unit_written(several: Iterable[Settled], wanted: str) -> tuple[str, float]:
    """The unit that the deck wrote first of the dimension of `wanted`, and its size; `wanted`, in SI, where none is."""
    dimension = parse_unit(wanted).dimension
    for quantity in several:
        written = quantity.expression.unit if isinstance(quantity.expression, (Number, WithUnit)) else None
        if written is not None and measure_of(written).dimension == dimension:
            return written.text, measure_of(written).scale
    return wanted, 1.0


def use_command(scope: Scope, owner: Owner, servo: Any, item: Item | None, used: Place) -> Command | None:
    """The command of a servo, entered in the scope; None where it takes none, or has a mistake (reported)."""
    known = ", ".join(f"{kind}(...)" for kind in servo.commands)
    if item is None:
        if servo.commands:
            scope.complaints.missing(
                owner.place,
                ("command",),
                "D149",
                f"{owner.label} has no command",
                used,
                help=[
                    f"write `command = {servo.commands[0]}(...);`, in the definition or for this joint",
                    f"{servo.name} takes {known}",
                ],
            )
        return None
    call = item.value
    place = item.value_place
    if not servo.commands:
        helps = leave_out("leave `command` out")
        scope.complaints.error("D150", f"the model `{servo.name}` takes no command", place, help=helps)
        return None
    word = word_of(call)
    if word is not None and word not in COMMAND_UNIT and word in models.available("command"):
        kind = "position" if "position" in servo.commands else servo.commands[0]
        scope.complaints.error(
            "D152",
            f"`{word}` is a course in time, and a command is of a kind",
            place,
            help=[f"write `{kind}({word}(...))`", f"{servo.name} takes {known}"],
        )
        return None
    if not isinstance(call, Call) or item.body is not None or len(call.positional) != 1:
        first = servo.commands[0]
        scope.complaints.error(
            "D151",
            "a command is its kind and one value or course in time",
            item.upon or place,
            help=f"{servo.name} takes {known}: `{first}({EXAMPLE_SETPOINTS[owner.joint][first]})` or "
            f"`{first}(step(to = ...))`",
        )
        return None
    kind = call.name.text
    if kind not in servo.commands:
        scope.complaints.error(
            "D152",
            f"the model `{servo.name}` takes no command `{kind}`",
            call.name.place,
            help=[*did_you_mean(kind, servo.commands), f"it takes {known}"],
        )
        return None
    if isinstance(call.positional[0], Name) and scope.guides:
        guide = call.positional[0].text
        if guide in scope.guides:
            return Command(kind, "", guide)
        _check_known(scope, call.positional[0])
    inner = _argument(scope, call)
    label = f"the command of {owner.label}"
    spot = replace(
        owner,
        label=label,
        called=label,
        place=place,
        path=f"{owner.path}.command",
        local="command",
        homes=item.homes,
        command=kind,
    )
    assert kind in COMMAND_UNIT
    value = replace(item, name="command")
    model = use_course(scope, spot, inner, value, doc=f"{kind} asked", column=owner.path.removesuffix(".servo"))
    return None if model is None else Command(kind, model)


def _argument(scope: Scope, command: Call) -> Expression:
    """The expression of a command's value or trajectory; a name alone is that trajectory without parameters. Raises
    Problem."""
    inner = command.positional[0]
    if isinstance(inner, String):
        raise Problem(
            error(
                "D151",
                "a command is about a value or a course in time, and this is text",
                inner.place,
                help=f"write `{command.name.text}(trajectory(...))` for a column of a CSV file",
            )
        )
    return course_named(scope, inner)


def _check_known(scope: Scope, inner: Name) -> None:
    """Raise Problem D278 for an unknown name, where a command may also follow a guide."""
    if len(inner.path) > 1 or scope.names.is_value(inner) or inner.text in models.available("command"):
        return
    raise Problem(
        error(
            "D278",
            f"no guide, value or course in time `{inner.text}`",
            inner.place,
            help=[
                *did_you_mean(inner.text, [*scope.guides, *scope.definitions.lets]),
                known_words("guides of this run", scope.guides),
            ],
        )
    )


def is_guide(scope: Scope, inner: Expression) -> bool:
    """Return True if this expression names a guide of one of the deck's runs, or may name one of those to come: a used
    deck's servos come without its runs."""
    if isinstance(inner, Name) and inner.roof and len(inner.path) == 1 and not scope.names.is_value(inner):
        return True
    return any(run.get(f"guide {word_of(inner)}") is not None for run in scope.definitions.run_blocks())


def check_servo_definition(scope: Scope, name: str) -> None:
    """Check a servo definition as far as that is possible without a joint: its model and its keys."""
    definition = scope.definitions.of_kind("servo")[name]
    block = scope.definitions.block(definition)
    if block is None:
        return
    with scope.complaints.gather():
        model = block.get("model")
        owner = Owner(f"servo `{name}`", definition.place, "")
        if model is None:
            return
        servo = find_bare_model(scope, "servo", model, MODEL_NOT_COMMAND)
        for sensor in block.of_kind("sensor"):
            if sensor.value is not None:
                find_model(scope, "sensor", word_of(sensor.value), place_of(sensor.value))
        block = without_sensors(block)
        if servo is not None:
            known = [*(p.name for p in servo.parameters), *NOT_PARAMETERS]
            check_keys(scope, block, known, owner)
            command = block.get("command")
            if (
                command is not None
                and isinstance(command.value, Call)
                and len(command.value.positional) == 1
                and command.value.name.text in COMMAND_UNIT
            ):
                inner = _argument(scope, command.value)
                if not isinstance(inner, Call) and not is_guide(scope, inner):
                    scope.names.evaluate(inner)
            words = {p.name: p for p in servo.parameters if p.shape == "word"}
            for entry in filter(None, map(block.get, ("rate", "command"))):
                refuse_block(entry)
            for key, item in block.items.items():
                if key in NOT_PARAMETERS or key not in known or item.value is None:
                    continue
                if key in words:
                    scope.word(owner, words[key], item)
                    continue
                try:
                    scope.evaluate(item)
                except Problem as problem:
                    if item.upon is not None or not (isinstance(item.value, Name) and servo.parameters):
                        scope.complaints.add(*problem.diagnostics)
