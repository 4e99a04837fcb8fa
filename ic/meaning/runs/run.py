"""A run resolved: arm, servos, environment, initial state, schedule, metrics and record, in SI, ready for a plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ic.grammar.places import place_of
from ic.grammar.syntax import Call, Name, Word
from ic.language.runs import BALANCED, DURATION, ENVIRONMENT, INITIAL, RATES, RUN, SEED, TOLERANCES, VELOCITY_PRODUCTS
from ic.meaning.checks.failures import check_failures, check_friction
from ic.meaning.checks.idle import remark_beginnings, remark_idle, remark_kinds
from ic.meaning.checks.reading import remark_unread
from ic.meaning.checks.spin import check_spins
from ic.meaning.checks.swings import check_circuits, check_sensor
from ic.meaning.control.guides import (
    Guiding,
    check_guides,
    check_period,
    name_guides,
    resolve_guides,
)
from ic.meaning.control.link_sensors import resolve_link_sensors
from ic.meaning.control.schedule import (
    CONTINUOUS,
    Rate,
    Ticks,
    base_rate,
    check_stability,
    divisor,
    fastest_rate,
    make_schedule,
)
from ic.meaning.control.servos import RATE, Use, check_rest, check_start, fixed_rate, resolve_servos
from ic.meaning.control.substitution import check_brakes, check_ticks, resolve_substitutions
from ic.meaning.control.ticking import Ticking, check_instants, rate_of
from ic.meaning.definitions.merge import Block, Item, as_meant
from ic.meaning.definitions.resolve import Definition
from ic.meaning.expressions.quantity import Value, Values
from ic.meaning.mechanics.arm import Arm, resolve_arm
from ic.meaning.mechanics.bodies import check_moved
from ic.meaning.mechanics.payloads import check_payloads, resolve_payloads
from ic.meaning.parameters.addresses import in_run
from ic.meaning.parameters.models import (
    check_keys,
    find_bare_model,
    find_model,
    refuse_values,
    upon,
    use_model,
    word_of,
)
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.relations import check_names
from ic.meaning.parameters.scope import Scope
from ic.meaning.parameters.tables import tell_named_lists, use_table
from ic.meaning.parameters.unvaried import Unvaried
from ic.meaning.runs.base import INITIAL_OF_BASE, check_base, held_by, initial_base, remark_ground, resolve_base
from ic.meaning.runs.record import read_requirements, resolve_metrics, resolve_record, resolve_requirements
from ic.meaning.runs.tolerances import resolve_tolerances
from ic.text.complaints import an, belongs, known_words
from met import models, units
from met.diagnostic import Label, Place, did_you_mean
from met.frozen import frozen
from met.parameter import WORLD, Parameter
from met.plan import BASE, Base, EnvironmentUse, Payload, Requirement, Schedule, ServoUse, Structure, Tolerance
from met.trace import Real, Scalar
from met.units import PURE

ANY_RATE = 1000  # Hz, where the deck's could not be had
BLOCKS = ("servos", *(block.name for block in (INITIAL, ENVIRONMENT, RATES, TOLERANCES)))
"""Keys of a run that have a block."""


@frozen
class Resolved:
    """A run's structure, requirements and tolerances; its parameters are in the scope.

    stability  h * lambda of every joint whose servo knows it
    """

    structure: Structure
    requirements: tuple[Requirement, ...]
    tolerances: tuple[Tolerance, ...]
    seed: int
    stability: tuple[tuple[str, Real], ...]
    place: Place


def resolve_run(scope: Scope, definition: Definition) -> Resolved | None:
    """The run; None where something of it is wrong, which was told."""
    block = scope.definitions.block(definition)
    if block is None:
        return None
    run = Owner(f"run `{definition.name}`", definition.place, "")
    _check_entries(scope, block, definition)
    block = as_meant(block, RUN.keys, RUN.named)
    comparisons = read_requirements(scope, block)
    arm = _arm(scope, run, block.get("arm"))
    integrator = _integrator(scope, block.get("integrator"))
    seed = _seed(scope, run, block.get("seed"))
    rates = _rates(scope, run, block.get("rates"))
    duration = scope.constant(run, DURATION, block.items["duration"]) if "duration" in block.items else None
    if "duration" not in block.items:
        told = f"{run.label} has no duration"
        scope.complaints.missing(run.place, ("duration",), "D107", told, help="write `duration = 10 s;`")
    if arm is None:
        return None
    scope.gone = arm.lost
    base, arm = resolve_base(scope, block.get("base"), arm)
    name_guides(scope, block)
    uses, scope.lost = resolve_servos(scope, _body(scope, block.get("servos")), arm)
    if block.get("servos") is None and scope.complaints.lacks(run.place, "servos"):
        scope.lost = frozenset(joint.name for joint in arm.moving)
    guides = resolve_guides(scope, block, arm, uses, duration)
    substitutions = resolve_substitutions(scope, block, arm, uses)
    payloads = resolve_payloads(scope, block, arm)
    if arm.whole:
        check_moved(scope, arm.links, arm.joints, payloads)
    sensors = resolve_link_sensors(scope, block, arm, payloads)
    environment, products = _environment(scope, _body(scope, block.get("environment")), arm, base, payloads, duration)
    balanced = _initial(scope, _body(scope, block.get("initial")), arm, uses)
    remark_beginnings(scope, environment)
    initial_base(scope, _body(scope, block.get("initial")), base)
    for use in uses:
        check_rest(scope, use)
        check_start(scope, use)
    schedule, ticks, others = _schedule(scope, run, block, rates, uses, [*guides, *sensors], duration)
    # else a mistake in one of them was told: what depends on it is not looked at, and all else is
    known = integrator is not None and "dynamics" in rates
    integrator = integrator or models.find_own("integrator")["modified_euler"]
    check_ticks(scope, substitutions, ticks, schedule)
    check_brakes(scope, substitutions, environment)
    check_failures(scope, uses, ticks, substitutions, environment, schedule)
    check_friction(scope, uses, environment)
    _keep_settings(scope, block, arm, integrator, rates, schedule)
    fastest = {}
    on_beds = [each.joint for each in substitutions]
    for use in uses:
        if known and use.parameters is not None and use.joint not in on_beds:  # there the motor is no part of the step
            x = fastest_rate(
                scope, use.servo, use.parameters, f"{use.joint}.servo", continuous=ticks[use.joint].continuous
            )
            if x is not None:
                fastest[use.joint] = (use, x)
    stability: dict[str, Real] = {}
    for use, x in sorted(fastest.values(), key=lambda each: -scope.checks.first(each[1])):  # the worst is told
        h_lambda = check_stability(
            scope, f"servo `{use.definition}`", x, schedule, integrator, rates["dynamics"], f"{use.joint}.servo"
        )
        if h_lambda is not None:
            stability[use.joint] = h_lambda
    for sensor in sensors:
        if known and sensor.values:
            check_sensor(
                scope,
                sensor.label,
                models.find("sensor", sensor.model),
                sensor.values,
                schedule,
                integrator,
                rates["dynamics"],
                sensor.path,
            )
    for use in uses if known else ():
        check_circuits(scope, use, schedule, integrator, rates["dynamics"], on_bed=use.joint in on_beds)
    servos = tuple(ServoUse(use.joint, use.definition, use.servo.name, use.command, ticks[use.joint].divisor, use.place,
                            use.words, ticks[use.joint].continuous, use.sensors) for use in uses)  # fmt: skip
    structure = Structure(
        arm.name, arm.links, arm.joints, servos, environment, (), products, integrator.name, schedule, (),
        substitutions, base, payloads, tuple(guide.use(others[guide.path]) for guide in guides),
        tuple(sensor.use(others[sensor.path]) for sensor in sensors), balanced,
    )  # fmt: skip
    check_base(scope, base, structure, _body(scope, block.get("environment")), block.get("base"))
    check_payloads(scope, block, structure)
    if known:
        check_spins(scope, block, structure)
    check_guides(scope, guides, structure)
    metrics = resolve_metrics(scope, block, structure)
    record = resolve_record(scope, run, block.get("record"), structure)
    structure = replace(structure, metrics=metrics, record=record)
    remark_unread(scope, uses, structure)
    scope.setting("record", ", ".join(each.name for each in record) or "none", item=block.get("record"))
    requirements = resolve_requirements(scope, comparisons, structure)
    tolerances = resolve_tolerances(scope, _body(scope, block.get("tolerances")), structure)
    in_order = tuple((joint, stability[joint]) for joint in fastest if joint in stability)
    return Resolved(structure, requirements, tolerances, seed, in_order, definition.place)


def _keep_settings(
    scope: Scope, block: Block, arm: Arm, integrator: Any, rates: Mapping[str, Rate], schedule: Schedule
) -> None:
    """What the run says besides parameters, for who asks; `Scope.constant` and `Scope.word` have kept some."""
    scope.setting("arm", arm.name, item=block.get("arm"))
    scope.setting("integrator", integrator.name, item=block.get("integrator"))
    if "rates.base" not in scope.beside:
        scope.setting("rates.base", schedule.base_hz, "Hz", note="the fastest of the rates")
    if "rates.record" not in scope.beside:
        scope.setting("rates.record", schedule.base_hz / schedule.dynamics, "Hz", note="that of the dynamics")
    if "environment.velocity_products" not in scope.beside:
        scope.setting("environment.velocity_products", "on")
    if "initial.servos" not in scope.beside:
        scope.setting("initial.servos", str(BALANCED.default))
    if "seed" not in scope.beside:
        scope.setting("seed", 0.0, "1")


def _check_entries(scope: Scope, block: Block, definition: Definition) -> None:
    metrics = [item.name for kind in RUN.named for item in block.of_kind(kind)]
    for item in block.items.values():
        if item.kind in RUN.named or (not item.kind and item.name in RUN.keys):
            continue
        if item.kind in RUN.keys:
            scope.complaints.error(
                "D108",
                f"`{item.name}` after `{item.kind}`, which takes no name",
                item.place,
                help=f"write `{item.kind} {'= ...;' if item.body is None else '{ ... }'}`",
            )
        elif item.kind:
            has = (*RUN.keys, *(" ".join(RUN[word].written.split()[:2]) for word in RUN.named), *RUN.statements)
            scope.complaints.error(
                "D108",
                f"no `{item.kind}` in a run",
                item.place,
                help=[*did_you_mean(item.kind, (*RUN.named, *RUN.keys)), known_words("a run has", has)],
            )
        elif item.body is not None:
            adds = f"`metric {item.name} = ...` would add a metric"
            holder = next((key for key in BLOCKS if item.name in _inside(block, key)), None)
            if holder is not None:
                adds = f"write `{holder} {{ {item.name} {{ ... }} }}`: it is there that `{item.name}` stands"
            if not {"bed", "law"}.isdisjoint(item.body.items):
                adds = f"`substitute {item.name} {{ ... }}` would put this joint's motor on a bed"
            if not {"on", "mass", "grapple", "release"}.isdisjoint(item.body.items):
                adds = f"`payload {item.name} {{ ... }}` would add a payload"
            scope.complaints.taken_for(definition.place, item.name, (*metrics, *RUN.keys))
            scope.complaints.error(
                "D109",
                f"nothing named `{item.name}` in run `{definition.name}` to change",
                item.place,
                help=belongs(item.name) or [*did_you_mean(item.name, (*metrics, *RUN.keys)), adds],
            )
        else:
            near = did_you_mean(item.name, (*RUN.keys, *metrics)) if "." not in item.name else ()
            helps = in_run(scope.definitions, block, item, RATES.keys) or [*near, known_words("a run has", RUN.keys)]
            scope.complaints.taken_for(definition.place, item.name, (*RUN.keys, *metrics))
            scope.complaints.error("D109", f"a run has no `{item.name}`", item.place, help=helps)
    for statement in block.statements:
        words = " ".join(word.text for word in statement.words)
        if words != "require":
            scope.complaints.error(
                "D110",
                f"`{words}` in a run",
                statement.place,
                help=["`exclude when` stands in a sweep"]
                if words == "exclude when"
                else ["write `metric NAME = MODEL { of = CHANNEL; }`"]
                if words == "metric"
                else belongs(words)
                or [*did_you_mean(words, ("require", "remove")), "statements of a run: require, remove"],
            )


def _inside(block: Block, key: str) -> list[str]:
    """Names of the entries of a run's block that are blocks, or take one."""
    item = block.get(key)
    body = item.body if item is not None and item.value is None else None
    return [each.name for each in (body or Block()).items.values() if isinstance(each.value, Call | Name) or each.body]


def _body(scope: Scope, item: Item | None) -> Block:
    if item is None:
        return Block()
    if item.body is None or item.value is not None:
        scope.complaints.error(
            "D111", f"`{item.name}` is a block, not a value", item.place, help=f"write `{item.name} {{ ... }}`"
        )
        return Block()
    return item.body


def _arm(scope: Scope, run: Owner, item: Item | None) -> Arm | None:
    if item is None:
        known = known_words("arms of this deck", scope.definitions.of_kind("arm"))
        scope.complaints.missing(
            run.place, ("arm",), "D112", f"{run.label} has no arm", help=["write `arm = ARM;`", known]
        )
        return None
    name = word_of(item.value)
    if name is None or not isinstance(item.value, Name):
        at = place_of(item.value) if item.value is not None else item.place
        scope.complaints.error("D112", "the name of an arm is needed here", at, help="write `arm = ARM;`")
        return None
    if item.body is not None:
        scope.complaints.error(
            "D112",
            f"a run does not change its arm `{name}`",
            upon(item) or item.place,
            help=f"define `arm NAME like {name} {{ ... }}`, and write `arm = NAME;`",
        )
        return None
    with scope.complaints.gather():
        definition = scope.definitions.find_or_meant("arm", Word(name, item.value.place), scope.complaints)
        return resolve_arm(scope, definition)
    return None


def _integrator(scope: Scope, item: Item | None):  # type: ignore[no-untyped-def]  # any package's declaration
    if item is None:
        return models.find_own("integrator")["modified_euler"]
    return find_bare_model(scope, "integrator", item, "write `integrator = {};`: an integrator has no parameters")


def _seed(scope: Scope, run: Owner, item: Item | None) -> int:
    number = scope.constant(run, SEED, item) if item is not None else 0.0
    scope.unvaried["seed"] = Unvaried("is one for the whole sweep", "`repeat 5;` runs each case with other noise")
    if item is None:
        return 0
    if number is not None and not number.is_integer():
        scope.complaints.error(
            "D113", "a seed is a whole number from 0 to 2^53", place_of(item.value) if item.value else item.place
        )
        return 0
    return int(number or 0)


# Environment and initial state


def _environment(
    scope: Scope, body: Block, arm: Arm, base: Base | None, payloads: tuple[Payload, ...], duration: float | None
) -> tuple[tuple[EnvironmentUse, ...], bool]:
    uses = []
    products = True
    for item in body.items.values():
        if item.kind:
            meant = f"{item.name} = {item.kind}" if item.kind in models.available("environment") else "NAME = MODEL"
            scope.complaints.error(
                "D157", f"no `{item.kind}` in an environment", item.place, help=f"write `{meant} {{ ... }}`"
            )
        elif item.name == "velocity_products":
            owner = Owner("the environment", item.place, "environment")
            products = scope.word(owner, VELOCITY_PRODUCTS, item) != "off"
        else:
            use = _environment_use(scope, item, arm, base, payloads, duration)
            if use is not None:
                uses.append(use)
    for statement in body.statements:
        scope.complaints.error(
            "D142",
            f"`{statement.words[0].text}` inside the environment",
            statement.place,
            help="it belongs to a run or a sweep",
        )
    return tuple(uses), products


def _environment_use(
    scope: Scope, item: Item, arm: Arm, base: Base | None, payloads: tuple[Payload, ...], duration: float | None
) -> EnvironmentUse | None:
    owner = Owner(f"environment `{item.name}`", item.place, f"environment.{item.name}", homes=item.homes)
    name = word_of(item.value)
    if item.name == "gravity" and name in (None, "gravity", *scope.definitions.lets):
        owner = replace(owner, short="g")
    is_value = item.name == "gravity" and (name is None or name in scope.definitions.lets)
    if item.value is not None and is_value:
        gravity = models.find_own("environment")["gravity"]
        with scope.complaints.gather():
            found = scope.written(item)
            if isinstance(found, Value):
                size = "9.81" if isinstance(found.number, Scalar) else f"{abs(found.number):g}"
                scope.complaints.error(
                    "D071",
                    "`gravity` is a list of 3 numbers",
                    found.place,
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
    body = item.body or Block()
    # a payload called `world` was told of, and is no reason to tell of those that mean the ground
    bodies = [*(link.name for link in arm.links), *(each.name for each in payloads if each.name != WORLD)]
    lost = (*arm.lost, *(each.name for each in payloads if each.name == WORLD))
    known = {"joint": [joint.name for joint in arm.moving], "link": bodies}
    named = check_names(scope, owner, environment.parameters, body, arm=arm.name, known=known, lost=lost)
    about = next((named[p.name] for p in environment.parameters if p.names == "joint" and p.name in named), None)
    if about is not None:  # what the unit words `joint` and `effort` mean
        kinds = {joint.name: joint.kind for joint in arm.moving}
        if about not in kinds:  # which was told: without its joint, nothing can be said of the model's units
            check_keys(scope, body, [each.name for each in environment.written], owner)
            scope.checks.fail(owner.path)
            return EnvironmentUse(item.name, environment.name, None, item.place)
        owner = replace(owner, joint=kinds[about])
    lists = [each for each in environment.parameters if each.shape == "list" and environment.from_file]
    if tell_named_lists(scope, owner, lists, body):
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
            extra=[each.name for each in environment.written[len(environment.parameters) :]],
        )
    if values is not None:
        held = held_by(arm, payloads)
        words = {p.name: held.get(values[p.name], values[p.name]) for p in environment.parameters if p.names == "link"}
        if not (duration is not None and remark_idle(scope, environment, item, {**values, **words}, duration)):
            remark_ground(scope, item, arm, base, environment, values, payloads)
            remark_kinds(scope, environment, item, arm)
    return EnvironmentUse(item.name, environment.name, None, item.place)


def _initial(scope: Scope, body: Block, arm: Arm, uses: Sequence[Use]) -> bool:
    """What a run says of its start; whether its servos begin balanced."""
    known = dict.fromkeys(("q", "qd"), "")
    known |= {f"{joint.name}.{name}": "" for joint in arm.moving for name in ("q", "qd")}
    known["servos"] = ""
    of_base = dict.fromkeys(INITIAL_OF_BASE if any(link.name == BASE for link in arm.links) else (), "")
    for item in body.items.values():
        if not item.kind and item.name.partition(".")[0] in arm.lost:
            continue
        if item.kind or item.name not in (*known, *INITIAL_OF_BASE):
            there = (*known, *of_base)
            scope.complaints.error(
                "D114",
                f"no initial `{item.name}`",
                item.place,
                help=[*did_you_mean(item.name, there), known_words("there is", there)],
            )
    for name, unit in (("q", "joint"), ("qd", "joint/s")):
        wanted = Parameter(name=name, unit=unit, default=0.0, doc=f"initial {name}")
        general = body.get(name)
        listed: Values | None = None
        if general is not None:
            with scope.complaints.gather():
                found = scope.written(general)
                listed = found if isinstance(found, Values) else None
            if listed is not None and arm.lost:
                continue
            if listed is not None and len(listed.items) != len(arm.moving):
                given, moving = len(listed.items), len(arm.moving)
                told = f"{given} number{'s' * (given != 1)} for {moving} joint{'s' * (moving != 1)}"
                names = ", ".join(joint.name for joint in arm.moving)
                helps = f"one for each moving joint, in the arm's order, or one for all: {names}"
                scope.complaints.error("D071", told, listed.place, help=helps)
                continue
        for n, joint in enumerate(arm.moving):
            own = body.get(f"{joint.name}.{name}")
            owner = Owner(
                f"joint `{joint.name}`",
                (own or general).place if own or general else joint.place,  # type: ignore
                f"initial.{joint.name}",
                joint=joint.kind,
            )
            value = listed.items[n] if listed is not None and own is None else None
            if isinstance(value, Values):
                scope.complaints.error("D071", "a list inside a list", value.place)
                continue
            if general is not None and own is None and listed is None and _mixed(scope, owner, wanted, general, arm):
                break
            scope.number(owner, wanted, own or general, value=value)
    return _balanced(scope, body.get("servos"), uses)


def _balanced(scope: Scope, item: Item | None, uses: Sequence[Use]) -> bool:
    """Whether servos begin balanced; a remark where none of them can."""
    if item is None:
        return False
    balanced = scope.word(Owner("the initial state", item.place, "initial"), BALANCED, item) == "balanced"
    if balanced and not any(use.servo.balance for use in uses):
        able = [name for name, model in models.available("servo").items() if model.balance]
        scope.complaints.remark(
            "D248",
            "no servo of this run can begin balanced: this changes nothing",
            item.place,
            help=known_words("models that can", able),
        )
    return balanced


def _mixed(scope: Scope, owner: Owner, wanted: Parameter, general: Item, arm: Arm) -> bool:
    """Whether one value for all joints has not this joint's unit, since others move otherwise; tells that."""
    if len({joint.kind for joint in arm.moving}) < 2:
        return False
    with scope.complaints.gather():
        found = scope.written(general)
        unit, dimension = scope.unit(owner, wanted)
        if isinstance(found, Value) and found.dimension != PURE and not units.same(found.dimension, dimension):
            scope.complaints.error(
                "D061",
                f"`{wanted.name}` of {owner.label}, which is {owner.joint}, is in {unit}, and this is in "
                f"{units.text(found.dimension)}",
                found.place,
                help=[
                    f"write it joint by joint: `{owner.path.removeprefix('initial.')}.{wanted.name} = 0 {unit};`",
                    "or leave it out: without it all joints begin at 0",
                ],
            )
            return True
    return False


# Rates


def _rates(scope: Scope, run: Owner, item: Item | None) -> dict[str, Rate]:
    rates: dict[str, Rate] = {}
    if item is None:
        scope.complaints.missing(
            run.place,
            ("rates",),
            "D115",
            f"{run.label} has no rates",
            help="write `rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }`",
        )
        return rates
    body = _body(scope, item)
    owner = Owner("`rates`", item.place, "rates")
    for part in body.items.values():
        if part.kind or part.name not in RATES.keys:
            scope.complaints.taken_for(item.place, part.name, RATES.keys)
            scope.complaints.error(
                "D116",
                f"no rate `{part.name}`",
                part.place,
                help=[*did_you_mean(part.name, RATES.keys), known_words("rates", RATES.keys)],
            )
            continue
        rate = fixed_rate(scope, owner, part, f"`{part.name}`", part.name, continuous=part.name == "servos")
        if rate is not None:
            rates[part.name] = rate
    if "dynamics" not in body.items and item.body is not None:
        scope.complaints.missing(
            item.place, ("dynamics",), "D117", "no rate of the dynamics", help="write `dynamics = 1 kHz;`"
        )
    return rates


def _schedule(
    scope: Scope,
    run: Owner,
    block: Block,
    rates: dict[str, Rate],
    uses: list[Use],
    ticking: Sequence[Ticking],
    duration: float | None,
) -> tuple[Schedule, dict[str, Ticks], dict[str, int]]:
    """The schedule, when each servo's law acts, and base ticks a tick of guides and of links' sensors, by path."""
    dynamics = rates.get("dynamics")
    rates_item = block.get("rates")
    body = rates_item.body if rates_item is not None else None
    for use in uses:
        if use.rate is None and use.has_law and body is not None and "servos" not in body.items:
            assert rates_item is not None
            scope.complaints.missing(
                rates_item.place,
                ("servos",),
                "D118",
                "no rate of the servos",
                help="write `servos = 1 kHz;`, or a `rate` in each servo's definition",
            )
    if dynamics is None:  # which was told: nothing is said of rates, and what does not depend on them is looked at
        ticks = {use.joint: Ticks(1, continuous=False) for use in uses}
        return Schedule(ANY_RATE, 1, 1, ANY_RATE), ticks, dict.fromkeys((each.path for each in ticking), 1)
    shared = rates.get("servos")
    own = [rate for rate in (*(use.rate for use in uses), *(each.rate for each in ticking)) if rate is not None]
    others = [rate for rate in (shared, *own) if rate is not None and rate.hz != CONTINUOUS]
    record = rates.get("record") or dynamics
    base = base_rate([dynamics, record, *others], rates.get("base"))
    item = block.get("duration")
    written = "base" in rates
    schedule = make_schedule(
        scope.complaints,
        dynamics,
        record,
        base,
        others,
        duration,
        place_of(item.value or Name((), item.place)) if item is not None else run.place,
        base_written=written,
    )
    ticks = {}
    everyone = [dynamics, record, *others]
    for use in uses:
        rate = use.rate or (shared if use.has_law else None) or dynamics
        continuous = rate.hz == CONTINUOUS
        if continuous and use.servo.clocked:
            scope.complaints.error(
                "D106",
                f"the law of `{use.servo.name}` needs a clock: it cannot be continuous",
                rate.place,
                also=[Label(use.place, "used here")],
                help="write a rate in Hz",
            )
        for sensor in use.sensors if continuous else ():
            if models.find("sensor", sensor.model).clocked and sensor.place is not None:
                reads = f"{an(sensor.model, quoted=True)} reads at ticks"
                scope.complaints.error(
                    "D106",
                    f"{reads}, and the law of joint `{use.joint}` is continuous",
                    sensor.place,
                    also=[Label(rate.place, "continuous")],
                    help="write a rate in Hz, or `low_pass` for a sensor that is analog",
                )
        if continuous:
            rate = dynamics
        ticks[use.joint] = Ticks(divisor(scope.complaints, rate, base, everyone, written=written), continuous)
    own_ticks = dict.fromkeys((each.path for each in ticking), schedule.dynamics)
    for each in (each for each in ticking if each.ticks):
        rate_of_own = rate_of(scope, each, shared)
        if rate_of_own is not None:
            own_ticks[each.path] = divisor(scope.complaints, rate_of_own, base, everyone, written=written)
            check_instants(scope, each, own_ticks[each.path], schedule.dynamics, rate_of_own, dynamics)
            if isinstance(each, Guiding):
                check_period(scope, each, rate_of_own)
    if record.hz > dynamics.hz:
        scope.complaints.remark(
            "D167",
            f"`record` is faster than the dynamics: rows repeat, {record.hz / dynamics.hz:g} for each step",
            record.place,
            also=[Label(dynamics.place, "a step of the dynamics")],
            help="record at the rate of the dynamics, or slower",
        )
    if shared is not None and shared.hz != CONTINUOUS and not uses:
        divisor(scope.complaints, shared, base, everyone, written=written)
    return schedule, ticks, own_ticks


__all__ = ["RATE", "Call", "Resolved", "resolve_run"]
