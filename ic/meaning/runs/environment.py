"""The environment of a run: its models and their parameters, with warnings about models without effect."""

from __future__ import annotations

from dataclasses import replace

from ic.grammar.syntax import place_of
from ic.language.runs import ENVIRONMENT
from ic.meaning.checks.idle import remark_idle, remark_kinds
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.expressions.quantity import Value
from ic.meaning.mechanics.arm import ResolvedArm
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
from ic.meaning.runs.base import fixed_to, remark_ground
from ic.text.complaints import known_words
from met import models
from met.parameter import WORLD
from met.plan import Base, EnvironmentUse, Payload
from met.trace import Scalar
from met.units import ONE


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
