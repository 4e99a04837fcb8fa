"""The checks of a run whose parts are resolved, in order. A new check is a function, and a line of `RUN_CHECKS`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ic.meaning.checks.failures import check_failures, check_friction, remark_unread
from ic.meaning.checks.idle import check_together, remark_beginnings
from ic.meaning.checks.magnitudes import check_magnitudes
from ic.meaning.checks.reach import check_reach
from ic.meaning.checks.requirements import check_requirements
from ic.meaning.checks.sampling import check_sampling
from ic.meaning.checks.scales import check_scales
from ic.meaning.checks.swings import check_circuits, check_sensor, check_spins
from ic.meaning.control.guides import Guiding, check_guides
from ic.meaning.control.schedule import Rate, Ticks, check_stability, fastest_rate
from ic.meaning.control.sensors import Sensing
from ic.meaning.control.servos import Use, check_rest, check_start, commands_of
from ic.meaning.control.substitution import check_brakes, check_runaways, check_ticks
from ic.meaning.definitions.merge import MergedBlock
from ic.meaning.mechanics.arm import ResolvedArm
from ic.meaning.mechanics.bodies import check_moved
from ic.meaning.mechanics.booms import check_places
from ic.meaning.mechanics.payloads import check_payloads
from ic.meaning.parameters.models import body_of
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.base import check_base
from ic.meaning.runs.initial import check_balanced
from met import models
from met.frozen import frozen
from met.plan import Structure
from met.plan.chains import straightened
from met.plan.judged import MetricUse, Requirement


@frozen
class RunParts:
    """A run whose parts are resolved, as its checks see it.

    uses          its servos, each at its joint
    ticks         of the servos, by joint
    dynamics      the rate of the dynamics; None where it, or the integrator, has a mistake
    requirements  on metrics of the run and of its linear answers, which are `linear_metrics`
    """

    scope: Scope
    block: MergedBlock
    arm: ResolvedArm
    structure: Structure
    uses: Sequence[Use]
    ticks: Mapping[str, Ticks]
    integrator: Any
    dynamics: Rate | None
    guides: Sequence[Guiding]
    sensors: Sequence[Sensing]
    requirements: Sequence[Requirement]
    linear_metrics: Sequence[MetricUse]

    def on_bed(self, use: Use) -> bool:
        """True where the motor of a servo's joint is on a bed, and so no part of the dynamics' step."""
        return use.joint in self.structure.on_beds


# What must be free of mistakes for a check to be made


def _always(run: RunParts) -> bool:
    return True


def _arm_is_sound(run: RunParts) -> bool:
    return run.arm.free_of_errors


def _step_is_known(run: RunParts) -> bool:
    return run.dynamics is not None


def _all_is_sound(run: RunParts) -> bool:
    return not run.scope.complaints.error_count


# Checks that are put together here


def _check_beginnings(run: RunParts) -> None:
    """Check the initial state: balanced servos, joint ranges, rest where servos need it, and commands that begin
    elsewhere."""
    initial = body_of(run.scope, run.block.get("initial"))
    check_balanced(run.scope, initial.get("servos"), run.uses, run.structure)
    remark_beginnings(run.scope, run.structure.moving, run.structure.environment)
    commands = commands_of(run.scope)
    for use in run.uses:
        check_rest(run.scope, use)
        check_start(run.scope, use, commands.get(use.joint, {}))


def _check_beds(run: RunParts) -> None:
    """Check the joints whose motors are on beds: their ticks, brakes, and failures that would not reach the drive."""
    substitutions, environment = run.structure.substitutions, run.structure.environment
    check_ticks(run.scope, substitutions, run.ticks, run.structure.schedule)
    check_brakes(run.scope, substitutions, environment)
    check_runaways(run.scope, substitutions, environment)


def _check_steps(run: RunParts) -> None:
    """Check that the integrator's steps can follow the declared rate constants of servos and sensors."""
    scope, schedule, integrator, dynamics = run.scope, run.structure.schedule, run.integrator, run.dynamics
    assert dynamics is not None  # by the check's need
    scope.rate_place = dynamics.place
    fastest = []
    for use in run.uses:
        if use.parameters is not None and not run.on_bed(use):
            continuous = run.ticks[use.joint].continuous
            x = fastest_rate(scope, use.servo, use.parameters, f"{use.joint}.servo", continuous=continuous)
            if x is not None:
                fastest.append((use, x))
    for use, x in sorted(fastest, key=lambda pair: -scope.checks.first(pair[1])):  # the worst is reported
        check_stability(scope, f"servo `{use.definition}`", x, schedule, integrator, dynamics, f"{use.joint}.servo")
    for sensor in run.sensors:
        if sensor.values:
            model = models.find("sensor", sensor.model)
            check_sensor(scope, sensor.label, model, sensor.values, schedule, integrator, dynamics, sensor.path)
    for use in run.uses:
        check_circuits(scope, use, schedule, integrator, dynamics, on_bed=run.on_bed(use))


def _check_base(run: RunParts) -> None:
    environment = body_of(run.scope, run.block.get("environment"))
    check_base(run.scope, run.structure.base, run.structure, environment, run.block.get("base"))


def _check_failures(run: RunParts) -> None:
    check_failures(run.scope, run.uses, run.ticks, run.structure)
    check_friction(run.scope, run.uses, run.structure)


def _check_requirements(run: RunParts) -> None:
    check_requirements(run.scope, run.requirements, run.structure, run.linear_metrics)


@frozen
class RunCheck:
    """A check of a run: what it looks at, and what must be free of mistakes for that."""

    look: Callable[[RunParts], None]
    where: Callable[[RunParts], bool] = _always


RUN_CHECKS = (
    RunCheck(
        lambda run: check_moved(
            run.scope, *straightened(run.arm.links, run.arm.joints), payloads=run.structure.payloads
        ),
        _arm_is_sound,
    ),
    RunCheck(lambda run: check_places(run.scope, run.structure), _arm_is_sound),
    RunCheck(_check_beginnings),
    RunCheck(_check_beds),
    RunCheck(_check_failures),
    RunCheck(_check_steps, _step_is_known),
    RunCheck(_check_base),
    RunCheck(lambda run: check_payloads(run.scope, run.block, run.structure)),
    RunCheck(lambda run: check_spins(run.scope, run.block, run.structure), _step_is_known),
    RunCheck(lambda run: check_guides(run.scope, run.guides, run.structure)),
    RunCheck(lambda run: remark_unread(run.scope, run.uses, run.structure)),
    RunCheck(lambda run: check_sampling(run.scope, run.structure, run.requirements), _all_is_sound),
    RunCheck(lambda run: check_together(run.scope, run.uses, run.structure)),
    RunCheck(lambda run: check_reach(run.scope, run.block, run.structure), _all_is_sound),
    RunCheck(lambda run: check_magnitudes(run.scope, run.structure), _all_is_sound),
    RunCheck(lambda run: check_scales(run.scope, run.structure, run.uses), _all_is_sound),
    RunCheck(_check_requirements, _all_is_sound),
)


def check_run(run: RunParts) -> None:
    """Make all checks of a run whose needs are met."""
    for check in RUN_CHECKS:
        if check.where(run):
            check.look(run)
