"""Warnings of steps of the dynamics that make the arm swing up, damp what should swing on, or are long for it.

The program itself is linearised (`met.analysis.step_map`), so whatever acts on the arm has its part, with the inertia
that it has at the start. What servos and sensors declare of themselves (D104, D105, D249) holds where it agrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ic.meaning.control.schedule import hz
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.diagnostic import Label, Problem
from met.messages.render import shown_place
from met.plan import Experiment, Formula

if TYPE_CHECKING:
    from met.analysis.loops import Unstable
    from met.analysis.step_size import Fault, Remedy, StepSize

NOTE = "step size: "
"""The beginning of the plan's note on it."""

BEYOND = 1.2
"""Times the figure of what a servo declares of itself, above which the arm's own is reported in its place."""


def check_steps(scope: Scope, experiment: Experiment) -> Experiment:
    """The experiment with a note of its fastest mode; warns of modes that the steps do not follow."""
    complaints, declared = scope.complaints, scope.declared_rates
    known = experiment.structure.integrator in models.find_own("integrator")  # another package's is only recorded
    if not known or not experiment.cases.count or scope.rate_place is None or not experiment.structure.moving:
        complaints.settle()
        return experiment
    from met.analysis.step_size import chosen_cases, remedy, step_size

    rows = [row for figure in declared.values() for row in figure[1]]
    try:
        found = step_size(experiment, chosen_cases(experiment, rows))
    except Problem:  # said where the program is built
        complaints.settle()
        return experiment
    grows = any(each.kind == "grows" for each in found.faults)
    fast = any(each.kind == "fast" for each in found.faults)
    refuted = set()
    if found.finite:
        # a payload that is let go leaves a lighter arm than that of the start
        refuted |= set() if grows or experiment.structure.payloads else {"D104"}
        refuted |= set() if fast else {"D105"}
        refuted |= set() if grows and found.grown <= BEYOND * declared.get("D249", (0.0, ()))[0] else {"D249"}
    kept = complaints.settle(refuted)
    for each in found.faults:
        if _is_told(each, kept, declared, found):
            continue
        better = remedy(experiment, found, each)
        code, message, text, helps = _words(experiment, each, better)
        complaints.remark(
            code,
            message,
            Label(scope.rate_place, text),
            also=list(_places(experiment, each, better)),
            help=[*helps, _where(experiment, each, found)],
        )
    if not any(each.kind == "grows" for each in found.faults):
        for loop in found.loops:
            _remark_loop(scope, experiment, loop)
    return replace(experiment, notes=(*experiment.notes, *_note(experiment, found)))


def _remark_loop(scope: Scope, experiment: Experiment, loop: Unstable) -> None:
    """Warns of the loops of servos that tick, which with this arm are unstable."""
    structure, cases = experiment.structure, experiment.cases
    uses = [use for use in structure.servos if use.joint in loop.joints]
    every = f"a disturbance grows by e in every {loop.every:.3g} s"
    rates = " and ".join(dict.fromkeys(f"{hz(structure.schedule.base_hz / use.divisor)} Hz" for use in uses))
    if len(uses) == 1:
        (use,) = uses
        message = f"the loop of servo `{use.definition}` at {rates} is unstable on joint `{use.joint}`: {every}"
    else:
        joints = ", ".join(f"`{joint}`" for joint in loop.joints)
        message = f"the servo loops of joints {joints} at {rates} are unstable together: {every}"
    slower = "dynamics" if any(use.divisor < structure.schedule.dynamics for use in uses) else "servo"
    case = loop.case
    gains = [
        f"{name} = {float(_value(experiment, path, case)) * loop.gain:.3g} {experiment.parameters[path].unit}"
        for name in ("kp", "ki")
        for path in (f"{uses[0].joint}.servo.{name}",)
        if path in experiment.parameters
    ]
    fits = f"stable up to {loop.gain:.2g} times the gain"
    fits += f": {', '.join(gains)}" if len(uses) == 1 and gains else ""
    start = f"at the start of case #{int(cases.table[case])}" if cases.count > 1 else "at the start"
    place = next((use.place for use in uses if use.place is not None), scope.rate_place)
    scope.complaints.remark(
        "D320",
        message,
        place,
        also=_gain_places(experiment, loop),
        help=[
            fits,
            f"or a faster rate of the {slower}",
            f"reckoned with the arm as it stands {start}, within all limits",
        ],
    )


def _gain_places(experiment: Experiment, loop: Unstable) -> list[Label]:
    """Where the gains of the loops are written."""
    paths = (f"{joint}.servo.kp" for joint in loop.joints)
    places = (experiment.parameters[path].origin.place for path in paths if path in experiment.parameters)
    return [Label(place, "the gain") for place in dict.fromkeys(places) if place is not None]


def _value(experiment: Experiment, path: str, case: int) -> float:
    """A parameter's value in a case."""
    value: Any = experiment.parameters[path].value
    if not isinstance(value, Formula):
        return float(value)
    inputs = {each.path: each.values for each in experiment.cases.coordinates}
    return float(np.asarray(experiment.formulas.replay(inputs)[value.output])[case])


def _is_told(
    fault: Fault, kept: frozenset[str], declared: dict[str, tuple[float, tuple[int, ...]]], found: StepSize
) -> bool:
    """True where what a servo or sensor declares of itself has said it."""
    if "D104" in kept:
        return True
    if fault.kind == "grows":
        return "D249" in kept
    if fault.kind == "fast" and any(each.kind != "fast" for each in found.faults):
        return True
    return fault.kind == "fast" and "D105" in kept and fault.figure <= BEYOND * declared.get("D105", (0.0, ()))[0]


def _words(experiment: Experiment, fault: Fault, better: Remedy) -> tuple[str, str, str, list[str]]:
    """Code, message, the label at the rate, and help."""
    structure = experiment.structure
    h, integrator, root = structure.schedule.step, structure.integrator, fault.mode.root
    rate = "no rate that is sensible" if better.rate is None else f"{hz(better.rate)} Hz"
    step = f"h = {h:g} s, h * lambda = {h * abs(root):.3g}"
    if fault.kind == "grows":
        every = f"{h / fault.figure:.3g} s"
        message = f"{fault.owner} {_motion(root)}, and this step of {integrator} makes that grow: by e in every {every}"
        helps = [f"the slowest rate at which it does not: {rate}", *_others(better, "at this rate it does not with")]
        return "D317", message, step, helps
    if fault.kind == "misses":
        less = "damps" if fault.figure < fault.truth else "does not damp"
        message = (
            f"{fault.owner} swings with {_hertz(root)}, and this step of {integrator} {less} that: after "
            f"{fault.after:.3g} s {fault.figure:.2g} of it is left, and in truth {fault.truth:.2g}"
        )
        helps = [f"the slowest rate that follows it: {rate}", *_others(better, "at this rate it is followed by")]
        return "D318", message, step, helps
    message = f"{fault.owner} is fast for the dynamics' step: h * lambda = {fault.figure:.3g}"
    helps = [f"it {_motion(root)}, and a step is true to the motion below 0.5: the slowest rate that fits is {rate}"]
    return "D319", message, f"h = {h:g} s", helps


def _hertz(root: complex) -> str:
    return f"{abs(root.imag) / (2.0 * math.pi):.3g} Hz"


def _places(experiment: Experiment, fault: Fault, better: Remedy) -> Iterator[Label]:
    """The servo of the joint, and the environment model without which it would not be so."""
    structure = experiment.structure
    for use in structure.servos:
        if use.joint == fault.joint and use.place is not None:
            yield Label(use.place, f"its servo, `{use.definition}`")
    for each in structure.environment:
        if each.name == better.cause and each.place is not None:
            yield Label(each.place, "without this it would not be so")


def _where(experiment: Experiment, fault: Fault, found: StepSize) -> str:
    """Which state this is about, in words, and what was not looked at."""
    cases = experiment.cases
    where = "at the start"
    if cases.count > 1:
        where += f" of case #{int(cases.table[fault.mode.case])}"
    if fault.mode.loose:
        where = f"in the pose {where.removeprefix('at ')}".replace("pose the", "pose of the")
        where += ", at rest, with no drive and nothing held by friction"
    left = cases.count - len(found.cases)
    return f"reckoned {where}" + (f"; {left} of {cases.count} cases were not looked at" if left > 0 else "")


def _note(experiment: Experiment, found: StepSize) -> Iterator[str]:
    """The fastest mode of the first case, what a step makes of it, and the line of the servo of its joint."""
    if found.mode is None:
        yield f"{NOTE}nothing changes by more than 1 % in a step"
        return
    h, mode = experiment.structure.schedule.step, found.mode
    truth = math.exp(h * mode.root.real)
    lines = (use.place for use in experiment.structure.servos if use.joint == found.joint)
    where = next((f" ({each.file}:{each.line})" for each in map(shown_place, filter(None, lines))), "")
    yield (
        f"{NOTE}{found.owner} {_motion(mode.root)}: h * lambda = {h * abs(mode.root):.3g}, and a step makes "
        f"{abs(mode.factor):.3g} of it, in truth {truth:.3g}{where}"
    )


def _others(better: Remedy, head: str) -> list[str]:
    """Other integrators that do at the same rate, if there are any."""
    return [known_words(head, (f"`integrator = {name};`" for name in better.others))] if better.others else []


def _motion(root: complex) -> str:
    """What a mode does, in words."""
    if abs(root.imag) > 1e-3 * abs(root.real):
        return f"swings with {_hertz(root)}"
    return f"{'grows' if root.real > 0.0 else 'decays'} with {abs(root):.3g} 1/s"
