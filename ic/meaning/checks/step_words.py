"""The words of warnings of steps and ticks that are too long for the arm: at a check, and of instants of a run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from ic.meaning.control.schedule import hz
from ic.text.complaints import known_words
from met.diagnostic import Diagnostic, Label, Place
from met.plan import Experiment, Formula

if TYPE_CHECKING:
    from met.analysis.loops import Unstable
    from met.analysis.step_size import Remedy, StepFault


def fault_warning(
    experiment: Experiment, fault: StepFault, better: Remedy, place: Place | None, where: str
) -> Diagnostic:
    """A warning of a mode that the step does not follow: D317, D318 or D319.

    place  of the rate, or of the run;  where: the state that this is about, in words
    """
    code, message, text, helps = _words(experiment, fault, better)
    label = None if place is None else Label(place, text)
    return Diagnostic(code, message, label, tuple(_places(experiment, fault, better)), (*helps, where), "warning")


def at_the_start(experiment: Experiment, case: int) -> str:
    """The instant at which a case begins, in words; case: row of the case table."""
    return "at the start" + (f" of {_case(experiment, case)}" if experiment.cases.count > 1 else "")


def from_instants(experiment: Experiment, case: int, at: float, until: float | None = None) -> str:
    """An instant of a case and how long it stays so, where that is known, in words; in s from the start of the run."""
    of = f" of {_case(experiment, case)}" if experiment.cases.count > 1 else ""
    return f"at t = {at:.4g} s{of}" + (f", and so it is until {until:.4g} s" if until is not None else "")


def _case(experiment: Experiment, case: int) -> str:
    return f"case #{int(experiment.cases.table[case])}"


def loop_warning(experiment: Experiment, loop: Unstable, place: Place | None, where: str) -> Diagnostic:
    """A warning of loops of servos that tick, which with this arm are unstable.

    place  where no servo has one;  where: in which pose of which case, in words
    """
    structure = experiment.structure
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
    place = next((use.place for use in uses if use.place is not None), place)
    helps = (fits, f"or a faster rate of the {slower}", f"reckoned with the arm {where}, within all limits")
    label = None if place is None else Label(place)
    return Diagnostic("D320", message, label, tuple(_gain_places(experiment, loop)), helps, "warning")


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
    return float(experiment.column(value)[case])


def _words(experiment: Experiment, fault: StepFault, better: Remedy) -> tuple[str, str, str, list[str]]:
    """Code, message, the label at the rate, and help."""
    structure = experiment.structure
    h, integrator, root = structure.schedule.step, structure.integrator, fault.mode.root
    rate = "no rate that is sensible" if better.rate is None else f"{hz(better.rate)} Hz"
    step = f"h = {h:g} s, h * lambda = {h * abs(root):.3g}"
    if fault.kind == "grows":
        every = f"{h / fault.figure:.3g} s"
        message = (
            f"{fault.owner} {motion_words(root)}, and this step of {integrator} makes that grow: by e in every {every}"
        )
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
    helps = [
        f"it {motion_words(root)}, and a step is true to the motion below 0.5: the slowest rate that fits is {rate}"
    ]
    return "D319", message, f"h = {h:g} s", helps


def _hertz(root: complex) -> str:
    return f"{abs(root.imag) / (2.0 * math.pi):.3g} Hz"


def _places(experiment: Experiment, fault: StepFault, better: Remedy) -> Iterator[Label]:
    """The servo of the joint, and the environment model without which it would not be so."""
    structure = experiment.structure
    for use in structure.servos:
        if use.joint == fault.joint and use.place is not None:
            yield Label(use.place, f"its servo, `{use.definition}`")
    for each in structure.environment:
        if each.name == better.cause and each.place is not None:
            yield Label(each.place, "without this it would not be so")


def _others(better: Remedy, head: str) -> list[str]:
    """Other integrators that do at the same rate, if there are any."""
    return [known_words(head, (f"`integrator = {name};`" for name in better.others))] if better.others else []


def motion_words(root: complex) -> str:
    """The motion of a mode, in words."""
    if abs(root.imag) > 1e-3 * abs(root.real):
        return f"swings with {_hertz(root)}"
    return f"{'grows' if root.real > 0.0 else 'decays'} with {abs(root):.3g} 1/s"
