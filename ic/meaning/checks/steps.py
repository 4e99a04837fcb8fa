"""Warnings about steps of the dynamics that excite the arm, damp lasting swings, or are long for it.

The program itself is linearised (`met.analysis.step_map`), so everything that acts on the arm is included, with its
inertia at the start. The declarations of servos and sensors themselves (D104, D105, D249) count where they agree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ic.meaning.checks.scale import OTHER_UNITS, Scale
from ic.meaning.checks.step_words import at_the_start, fault_warning, loop_warning, motion_words
from ic.meaning.parameters.scope import Scope
from met import models
from met.diagnostic import Problem
from met.messages.message import shown_place
from met.plan import Experiment
from met.plan.columns import ends
from met.plan.defaults import timing_defaults

if TYPE_CHECKING:
    from met.analysis.memo import AnalysisMemo
    from met.analysis.step_size import Remedy, StepFault, StepSize


FAR = 30.0
"""Factor over a typical multiple, or below it, from which on a number may be to blame for a finding."""

MOST = 2
"""Largest number of numbers that are tried."""


def usual_number(scope: Scope, experiment: Experiment, is_free: Callable[[Experiment], bool]) -> list[str]:
    """A remedy that names the number, of those that are farthest from usual, with whose usual value alone an experiment
    is free of a finding; none where there is no such number. is_free: whether an experiment is"""
    odd = [scale for scale in scope.scales if _distance(scale) > math.log(FAR)]
    for scale in sorted(odd, key=_distance, reverse=True)[:MOST]:
        factor = _factor(scale)
        changed = _changed(experiment, scale.path, factor)
        try:
            free = changed is not None and is_free(changed)
        except Problem:
            continue
        if free:
            times = f"{1.0 / factor:,.0f} times less" if factor < 1.0 else f"{factor:,.0f} times more"
            return [f"`{scale.path}` {scale.words}: with {times}, which is usual, this would not be so"]
    return []


def _factor(scale: Scale) -> float:
    """The factor of the number that makes it usual: that of the first other unit that does, else to the typical one."""
    units = [factor for _, factor in OTHER_UNITS.get(scale.meant, ())]
    needed = float((scale.typical / scale.multiple) ** (1.0 / scale.power))
    return next((unit for unit in units if unit < FAR * needed and needed < FAR * unit), needed)


def _distance(scale: Scale) -> float:
    """The logarithm of the factor between a multiple and the typical one; 0 where none is typical, or where less is
    usual too."""
    if not (scale.typical > 0.0 and scale.multiple > 0.0 and math.isfinite(scale.multiple)):
        return 0.0
    distance = math.log(scale.multiple / scale.typical)
    return abs(distance) if scale.low > 0.0 else max(distance, 0.0)


def _changed(experiment: Experiment, path: str, factor: float) -> Experiment | None:
    """The experiment with a number, or a vector, times a factor: a mass together with its inertia, and also what has
    its number from the same place in the deck, as joints with one servo. None where one of them varies."""
    heads = (f"{path}.", f"{path.removesuffix('mass')}inertia." if path.endswith(".mass") else f"{path}.")
    alike = {name: quantity for name, quantity in experiment.parameters.items() if f"{name}.".startswith(heads)}
    places = {quantity.origin.place for quantity in alike.values()} - {None}
    alike |= {name: quantity for name, quantity in experiment.parameters.items() if quantity.origin.place in places}
    numbers = {name: quantity.value for name, quantity in alike.items() if isinstance(quantity.value, float)}
    if len(numbers) < len(alike):
        return None
    changed = {name: replace(alike[name], value=number * factor) for name, number in numbers.items()}
    return replace(experiment, parameters={**experiment.parameters, **changed})


LARGEST = 700.0
"""The largest logarithm that a number has in double precision, rounded down."""

NOTE = "step size: "
"""The beginning of the plan's note on the step size."""

NOT_LOOKED_AT = f"{NOTE}not looked at, the arm is too large: "
"""The beginning of this note where there was no analysis."""

BEYOND = 1.2
"""Factor over a servo's own figure above which the arm's is reported in its place."""


def check_steps(scope: Scope, experiment: Experiment, memo: AnalysisMemo) -> Experiment:
    """The experiment with a note on its fastest mode; warns about modes that the steps do not follow."""
    complaints, declared = scope.complaints, scope.declared_rates
    known = experiment.structure.integrator in models.find_own("integrator")  # another package's is only recorded
    if not known or not experiment.cases.count or scope.rate_place is None or not experiment.structure.moving:
        complaints.settle()
        return experiment

    from met.analysis.step_size import MOST_STATES, TooLarge, chosen_cases, remedy, step_size

    # environment models act from the start and in full: what they do later, the steps must follow too
    full = replace(experiment, parameters={**experiment.parameters, **timing_defaults(experiment)})
    rows = chosen_cases(experiment, [row for figure in declared.values() for row in figure[1]])
    looked: list[StepSize] = []

    def look() -> StepSize:
        looked.append(step_size(full, rows, memo, most=MOST_STATES))
        return looked[0]

    try:
        findings = memo.answer("steps", full, lambda: look().without_matrices(), rows)
    except Problem:  # reported where the program is built
        complaints.settle()
        return experiment
    except TooLarge as reason:
        complaints.settle()
        return replace(experiment, notes=(*experiment.notes, f"{NOT_LOOKED_AT}{reason}"))
    grows = any(fault.kind == "grows" for fault in findings.faults)
    fast = any(fault.kind == "fast" for fault in findings.faults)
    refuted = set()
    if findings.finite:
        # a released payload leaves a lighter arm than that of the start
        refuted |= set() if grows or experiment.structure.payloads else {"D104"}
        refuted |= set() if fast else {"D105"}
        refuted |= set() if grows and findings.grown <= BEYOND * declared.get("D249", (0.0, ()))[0] else {"D249"}
    codes = complaints.settle(refuted)
    for step_fault in findings.faults:
        if _is_reported(step_fault, codes, declared, findings) or _is_of_loops(step_fault, findings):
            continue

        def better_step(fault: StepFault = step_fault) -> Remedy:
            return remedy(full, (looked[0] if looked else look()).map, fault)

        better = memo.answer(f"remedy for what {step_fault.kind}", full, better_step, rows)
        complaints.pass_on(
            fault_warning(experiment, step_fault, better, scope.rate_place, _where(experiment, step_fault, findings))
        )
    if "D104" not in codes and not any(
        fault.kind == "grows" and not _is_of_loops(fault, findings) for fault in findings.faults
    ):

        def find_usual() -> list[str]:
            return usual_number(scope, full, lambda changed: not step_size(changed, rows).loops)

        reported = [loop for loop in findings.loops if not experiment.allows("D320" if loop.ticks else "D322")]
        far = any(loop.parameters or loop.gain is None or not NEAR < loop.gain < 1.0 / NEAR for loop in reported)
        blamed = memo.answer("usual number", full, find_usual, rows) if far else []
        for loop in findings.loops:
            start = at_the_start(experiment, loop.case)
            warning = loop_warning(experiment, loop, scope.rate_place, f"as it stands {start}")
            complaints.pass_on(replace(warning, help=(*blamed, *warning.help)))
    return replace(experiment, notes=(*experiment.notes, *_note(experiment, findings)))


NEAR = 0.3
"""Share of their gain from which on loops are so near to be stable that no other number is looked for."""


def _is_reported(
    fault: StepFault, codes: frozenset[str], declared: dict[str, tuple[float, tuple[int, ...]]], findings: StepSize
) -> bool:
    """True where the declaration of a servo or sensor has reported it."""
    if "D104" in codes:
        return True
    if fault.kind == "grows":
        return "D249" in codes
    if fault.kind == "fast" and any(other.kind != "fast" for other in findings.faults):
        return True
    return fault.kind == "fast" and "D105" in codes and fault.figure <= BEYOND * declared.get("D105", (0.0, ()))[0]


def _is_of_loops(fault: StepFault, findings: StepSize) -> bool:
    """True where a mode truly grows, and unstable loops explain it."""
    return bool(findings.loops) and fault.kind == "grows" and fault.mode.grows_in_truth(findings.map.h)


def _where(experiment: Experiment, fault: StepFault, findings: StepSize) -> str:
    """The state concerned, in words, with the cases that were not examined."""
    cases = experiment.cases
    where = at_the_start(experiment, fault.mode.case)
    if fault.mode.loose:
        where = f"in the pose {where.removeprefix('at ')}".replace("pose the", "pose of the")
        where += ", at rest, with no drive and nothing held by friction"
    left = cases.count - len(findings.cases)
    return f"reckoned {where}" + (f"; {left:,} of {cases.count:,} cases were not looked at" if left > 0 else "")


def _note(experiment: Experiment, findings: StepSize) -> Iterator[str]:
    """The fastest mode of the first case, its growth in a step, the line of its joint's servo; and the examined
    cases."""
    looked = _looked_at(experiment, findings.cases)
    if findings.mode is None:
        yield f"{NOTE}nothing changes by more than 1 % in a step{looked}"
        return
    h, mode = experiment.structure.schedule.step, findings.mode
    grown = h * mode.root.real
    truth = math.exp(grown) if grown < LARGEST else math.inf
    lines = (use.place for use in experiment.structure.servos if use.joint == findings.joint)
    where = next((f" ({place.file}:{place.line})" for place in map(shown_place, filter(None, lines))), "")
    yield (
        f"{NOTE}{findings.owner} {motion_words(mode.root)}: h * lambda = {h * abs(mode.root):.3g}, and a step makes "
        f"{abs(mode.factor):.3g} of it, in truth {truth:.3g}{where}{looked}"
    )


def _looked_at(experiment: Experiment, rows: Sequence[int]) -> str:
    """The examined cases in words; "" where these are all."""
    cases = experiment.cases
    if len(rows) >= cases.count:
        return ""
    both = [
        np.ptp(coordinate.values[list(rows)]) == np.ptp(coordinate.values[list(ends(coordinate.values))])
        for coordinate in cases.coordinates
    ]
    subject = "all that varies" if all(both) else f"{sum(both)} of the {len(both)} that vary"
    those = f", with the least and the largest of {subject}" if any(both) else ""
    return f"; looked at {len(rows)} of {cases.count:,} cases{those}: the others are left to the run"
