"""Resolution of a run: arm, servos, environment, initial state, schedule, metrics and record, in SI, ready for a
plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ic.grammar.syntax import Call, Name, Word
from ic.language.runs import DURATION, ENVIRONMENT, INITIAL, RATES, RUN, SEED, TOLERANCES
from ic.meaning.control.guides import name_guides, resolve_guides
from ic.meaning.control.sensors import resolve_link_sensors
from ic.meaning.control.servos import resolve_servos
from ic.meaning.control.substitution import resolve_substitutions
from ic.meaning.definitions.merge import WITH, Item, MergedBlock, with_meant_names
from ic.meaning.definitions.resolve import Definition
from ic.meaning.mechanics.arm import ResolvedArm, resolve_arm
from ic.meaning.mechanics.payloads import resolve_payloads
from ic.meaning.parameters.addresses import OF_JOINT, in_run
from ic.meaning.parameters.models import body_of, find_bare_model, overriding_place, refuse_statements, word_of
from ic.meaning.parameters.owner import NotSweepable, Owner
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.allowances import ALLOW
from ic.meaning.runs.base import base_meshes, initial_base, resolve_base, resolve_run_keys
from ic.meaning.runs.expressions import resolve_signals
from ic.meaning.runs.initial import resolve_environment, resolve_initial
from ic.meaning.runs.linear import resolve_linear, resolve_linear_metrics
from ic.meaning.runs.metrics import resolve_metrics
from ic.meaning.runs.rates import resolve_rates, resolve_schedule
from ic.meaning.runs.record import names_in_record, resolve_record
from ic.meaning.runs.requirements import metrics_over_time, read_requirements, resolve_requirements
from ic.meaning.runs.run_checks import RunParts, check_run
from ic.meaning.runs.step_errors import resolve_step_errors
from ic.meaning.runs.tolerances import resolve_tolerances
from ic.text.complaints import known_words, where_it_belongs
from met.diagnostic import Place, did_you_mean, write
from met.frozen import frozen
from met.integrators import DEFAULT_INTEGRATOR
from met.plan import Allowance, Cases, Experiment, Schedule, Structure
from met.plan.judged import LinearUse, MetricUse, Requirement, StepErrorLimit, Tolerance
from met.trace import Formulas

BLOCKS = ("servos", *(block.name for block in (INITIAL, ENVIRONMENT, RATES, TOLERANCES)))
"""Keys of a run that have a block."""


@frozen
class Resolved:
    """A run's structure, requirements and tolerances; its parameters are in the scope.

    settings   keys of the run that the experiment keeps beside its structure, by field
    linear     answers that it asks for, and metrics of them
    """

    structure: Structure
    requirements: tuple[Requirement, ...]
    step_errors: tuple[StepErrorLimit, ...]
    tolerances: tuple[Tolerance, ...]
    seed: int
    place: Place
    settings: Mapping[str, Any]
    linear: tuple[LinearUse, ...] = ()
    linear_metrics: tuple[MetricUse, ...] = ()


def resolve_run(scope: Scope, definition: Definition) -> Resolved | None:
    """The run; None where it has a mistake (already reported)."""
    block = scope.definitions.block(definition)
    if block is None:
        return None
    run = Owner(f"run `{definition.name}`", definition.place, "")
    _check_entries(scope, block, definition)
    block = with_meant_names(block, RUN.keys, RUN.named)
    block, required = metrics_over_time(scope, block)
    comparisons = read_requirements(scope, block, required)
    arm = _arm(scope, run, block.get("arm"))
    integrator = _integrator(scope, block.get("integrator"))
    seed = _seed(scope, run, block.get("seed"))
    rates = resolve_rates(scope, run, block.get("rates"))
    duration = scope.constant(run, DURATION, block.items["duration"]) if "duration" in block.items else None
    if "duration" not in block.items:
        message = f"{run.label} has no duration"
        helps = write("duration = 10 s;", where="inside")
        scope.complaints.missing(run.place, ("duration",), "D107", message, help=helps)
    if arm is None:
        return None
    scope.failed_parts = arm.failed
    base_looks = base_meshes(scope, arm)
    base, arm = resolve_base(scope, block.get("base"), arm)
    name_guides(scope, block)
    uses, scope.failed_servos = resolve_servos(scope, body_of(scope, block.get("servos")), arm)
    if block.get("servos") is None and scope.complaints.is_known_to_lack(run.place, "servos"):
        scope.failed_servos = frozenset(joint.name for joint in arm.moving)
    guides = resolve_guides(scope, block, arm, uses, duration)
    substitutions = resolve_substitutions(scope, block, arm, uses)
    payloads = resolve_payloads(scope, block, arm)
    sensors = resolve_link_sensors(scope, block, arm, payloads)
    environment = resolve_environment(scope, body_of(scope, block.get("environment")), arm, base, payloads, duration)
    initial = body_of(scope, block.get("initial"))
    resolve_initial(scope, initial, arm, uses)
    keys = resolve_run_keys(scope, run, block, Structure)
    initial_base(scope, initial, base)
    schedule, ticks, others = resolve_schedule(scope, run, block, rates, uses, [*guides, *sensors], duration)
    dynamics = rates.get("dynamics") if integrator is not None else None
    integrator = integrator or DEFAULT_INTEGRATOR
    _keep_settings(scope, block, arm, integrator, schedule)
    servos = tuple(
        replace(
            use.bare,
            divisor=ticks[use.joint].divisor,
            continuous=ticks[use.joint].continuous,
            sensors=use.sensors,
        )
        for use in uses
    )
    structure = Structure(
        arm=arm.name.rpartition(".")[2],  # as its own deck calls it
        links=arm.links,
        joints=arm.joints,
        servos=servos,
        environment=environment,
        metrics=(),
        integrator=integrator.name,
        schedule=schedule,
        record=(),
        substitutions=substitutions,
        base=base,
        payloads=payloads,
        guides=tuple(guide.use(others[guide.path]) for guide in guides),
        sensors=tuple(sensor.use(others[sensor.path]) for sensor in sensors),
        base_meshes=base_looks,
        **keys,
    )
    signals = resolve_signals(scope, block, structure, names_in_record(block.get("record")))
    structure = replace(structure, expressions=tuple(signals.expressions))
    record = resolve_record(scope, run, block.get("record"), structure, signals.known)
    metrics, watched = resolve_metrics(scope, block, signals)
    structure = replace(structure, metrics=metrics, record=record, expressions=(*structure.expressions, *watched))
    linear = resolve_linear(scope, block, structure)
    linear_metrics = resolve_linear_metrics(scope, block, structure, linear)
    scope.keep_setting("record", ", ".join(recorded.name for recorded in record) or "none", item=block.get("record"))
    requirements = resolve_requirements(scope, comparisons, structure, linear_metrics)
    step_errors = resolve_step_errors(scope, block, structure, linear_metrics)
    check_run(
        RunParts(
            scope, block, arm, structure, uses, ticks, integrator, dynamics, guides, sensors, requirements,
            linear_metrics,
        )
    )  # fmt: skip
    tolerances = resolve_tolerances(scope, body_of(scope, block.get("tolerances")), structure, linear_metrics)
    settings = resolve_run_keys(scope, run, block, Experiment)
    return Resolved(
        structure, requirements, step_errors, tolerances, seed, definition.place, settings, linear, linear_metrics
    )


def _keep_settings(scope: Scope, block: MergedBlock, arm: ResolvedArm, integrator: Any, schedule: Schedule) -> None:
    """Keep a run's settings for `met explain`, besides those kept by `Scope.constant` and `Scope.word`."""
    scope.keep_setting("arm", arm.name, item=block.get("arm"))
    scope.keep_setting("integrator", integrator.name, item=block.get("integrator"))
    if "rates.base" not in scope.auxiliary:
        scope.keep_setting("rates.base", schedule.base_hz, "Hz", note="the fastest of the rates")
    if "rates.record" not in scope.auxiliary:
        scope.keep_setting("rates.record", schedule.base_hz / schedule.dynamics, "Hz", note="that of the dynamics")
    if "seed" not in scope.auxiliary:
        scope.keep_setting("seed", 0.0, "1")


def _check_entries(scope: Scope, block: MergedBlock, definition: Definition) -> None:
    """Report entries and statements that a run does not have (D108 to D110), each with what may have been meant."""
    metrics = [item.name for kind in RUN.named if kind != WITH for item in block.of_kind(kind)]
    for item in block.items.values():
        if item.kind == WITH and (item.value is None or item.detail):
            example = "write `with PATH = VALUE;`, such as `with links.boom.mass = 7 kg;`"
            scope.complaints.error("D108", "`with` sets one path to one value", item.place, help=example)
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
            if holder == "servos" and not {*OF_JOINT}.difference(["tau_max"]).isdisjoint(item.body.items):
                adds = f"it is the arm's: `arm OTHER like ARM {{ {item.name} {{ ... }} }}`, and `arm = OTHER;` here"
            if item.name in RUN.named:
                adds = f"write `{RUN[item.name].written}`"
            if not {"bed", "law"}.isdisjoint(item.body.items):
                adds = f"`substitute {item.name} {{ ... }}` would put this joint's motor on a bed"
            if not {"on", "mass", "grapple", "release"}.isdisjoint(item.body.items):
                adds = f"`payload {item.name} {{ ... }}` would add a payload"
            scope.complaints.note_misspelling(definition.place, item.name, (*metrics, *RUN.keys))
            scope.complaints.error(
                "D109",
                f"nothing named `{item.name}` in run `{definition.name}` to change",
                item.place,
                help=where_it_belongs(item.name) or [*did_you_mean(item.name, (*metrics, *RUN.keys)), adds],
            )
        else:
            near = did_you_mean(item.name, (*RUN.keys, *metrics)) if "." not in item.name else ()
            helps = in_run(scope.definitions, block, item, RATES.keys) or [*near, known_words("a run has", RUN.keys)]
            scope.complaints.note_misspelling(definition.place, item.name, (*RUN.keys, *metrics))
            scope.complaints.error("D109", f"a run has no `{item.name}`", item.place, help=helps)
    for key in ("servos", "initial", "rates"):
        within = block.get(key)
        if within is not None and within.body is not None:
            refuse_statements(scope, within.body, f"`{key}`")
    for statement in block.statements:
        words = " ".join(word.text for word in statement.words)
        if words != "require" and statement.words[0].text != ALLOW:
            scope.complaints.error(
                "D110",
                f"`{words}` in a run",
                statement.place,
                help=["`exclude when` stands in a sweep"]
                if words == "exclude when"
                else ["write `metric NAME = MODEL { of = CHANNEL; }`"]
                if words == "metric"
                else where_it_belongs(words)
                or [
                    *did_you_mean(words, ("require", ALLOW, "remove")),
                    known_words("statements of a run", ("require", ALLOW, "remove")),
                ],
            )


def _inside(block: MergedBlock, key: str) -> list[str]:
    """Names of the entries of a run's block that are blocks, or take one."""
    item = block.get(key)
    body = item.body if item is not None and item.value is None else None
    return [
        entry.name
        for entry in (body or MergedBlock()).items.values()
        if isinstance(entry.value, Call | Name) or entry.body
    ]


def _arm(scope: Scope, run: Owner, item: Item | None) -> ResolvedArm | None:
    """The arm that a run names, resolved; None where it names none or the arm has a mistake, which is reported
    (D112)."""
    if item is None:
        known = known_words("arms of this deck", scope.definitions.of_kind("arm"))
        scope.complaints.missing(
            run.place, ("arm",), "D112", f"{run.label} has no arm", help=["write `arm = ARM;`", known]
        )
        return None
    name = scope.definitions.definition_named(item.value) or word_of(item.value)
    if name is None or not isinstance(item.value, Name):
        message = "the name of an arm is needed here"
        scope.complaints.error("D112", message, item.value_place, help="write `arm = ARM;`")
        return None
    if item.body is not None:
        scope.complaints.error(
            "D112",
            f"a run does not change its arm `{name}`",
            overriding_place(item) or item.place,
            help=f"define `arm NAME like {name} {{ ... }}`, and write `arm = NAME;`",
        )
        return None
    with scope.complaints.gather():
        definition = scope.definitions.find_or_meant("arm", Word(name, item.value.place), scope.complaints)
        return resolve_arm(scope, definition)
    return None


def _integrator(scope: Scope, item: Item | None):  # type: ignore[no-untyped-def]  # any package's declaration
    if item is None:
        return DEFAULT_INTEGRATOR
    return find_bare_model(scope, "integrator", item, "write `integrator = {};`: an integrator has no parameters")


def _seed(scope: Scope, run: Owner, item: Item | None) -> int:
    """The seed of a run's noise, 0 where it has none; a wrong one is reported (D113)."""
    number = scope.constant(run, SEED, item) if item is not None else 0.0
    scope.not_sweepable["seed"] = NotSweepable(
        "is one for the whole sweep", "`repeat 5;` runs each case with other noise"
    )
    if item is None:
        return 0
    if number is not None and not number.is_integer():
        scope.complaints.error("D113", "a seed is a whole number from 0 to 2^53", item.value_place)
        return 0
    return int(number or 0)


# Environment and initial state


def experiment(
    scope: Scope, name: str, place: Place, resolved: Resolved, cases: Cases, allowances: tuple[Allowance, ...] = ()
) -> Experiment:
    """The experiment of this name; `scope` holds the parameters of the run that was resolved."""
    parameters, outputs = scope.quantities()
    formulas = Formulas.of(scope.graph, outputs) if outputs else Formulas()
    return Experiment(
        name,
        resolved.structure,
        parameters,
        formulas,
        cases,
        resolved.requirements,
        place,
        tuple(scope.notes),
        tolerances=resolved.tolerances,
        allowances=allowances,
        step_errors=resolved.step_errors,
        linear=resolved.linear,
        linear_metrics=resolved.linear_metrics,
        **resolved.settings,
    )
