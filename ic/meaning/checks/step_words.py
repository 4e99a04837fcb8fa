"""The words of warnings about steps and ticks that are too long for the arm, at a check and at instants of a run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from ic.meaning.checks.scale import inside
from ic.meaning.control.schedule import hz
from ic.text.complaints import known_words
from met.diagnostic import Diagnostic, Label, Place
from met.plan import Experiment, Formula

if TYPE_CHECKING:
    from met.analysis.blame import Unstable
    from met.analysis.step_size import Remedy, StepFault


def fault_warning(
    experiment: Experiment, fault: StepFault, better: Remedy, place: Place | None, where: str
) -> Diagnostic:
    """A warning about a mode that the step does not follow: D317, D318 or D319.

    place of the rate, or of the run; where: the state concerned, in words
    """
    code, message, text, helps = _words(experiment, fault, better)
    label = None if place is None else Label(place, text)
    return Diagnostic(code, message, label, tuple(_places(experiment, fault, better)), (*helps, where), "warning")


def at_the_start(experiment: Experiment, case: int) -> str:
    """The instant at which a case begins, in words; case: row of the case table."""
    return "at the start" + (f" of {_case(experiment, case)}" if experiment.cases.count > 1 else "")


def from_instants(experiment: Experiment, case: int, time: float, until: float | None = None) -> str:
    """An instant of a case, with the duration of the finding if it is known, in words; in s from the start of the
    run."""
    of_case = f" of {_case(experiment, case)}" if experiment.cases.count > 1 else ""
    return f"at t = {time:.4g} s{of_case}" + (f", and so it is until {until:.4g} s" if until is not None else "")


def _case(experiment: Experiment, case: int) -> str:
    return f"case #{int(experiment.cases.table[case])}"


EDGE = 0.98
"""Share of a stable gain that is told, so that a deck which takes it, with its gains rounded apart, is stable."""


def loop_warning(experiment: Experiment, loop: Unstable, place: Place | None, where: str) -> Diagnostic:
    """A warning about servo loops that are unstable with this arm: by their ticks, D320, or without them, D322.

    place where no servo has one; where: the pose and the case, in words
    """
    structure = experiment.structure
    uses = [use for use in structure.servos if use.joint in loop.joints]
    every = f"a disturbance grows by e in every {loop.every:.3g} s"
    ticking = ""
    if loop.ticks:
        rates = " and ".join(dict.fromkeys(f"{hz(structure.schedule.base_hz / use.divisor)} Hz" for use in uses))
        ticking = f" at {rates}"
    if loop.weak:
        message = f"the loop of servo `{uses[0].definition}` is too weak to hold joint `{uses[0].joint}`: {every}"
    elif len(uses) == 1:
        by_itself = "" if loop.ticks else " by itself"
        message = (
            f"the loop of servo `{uses[0].definition}`{ticking} is unstable{by_itself} "
            f"on joint `{uses[0].joint}`: {every}"
        )
    else:
        joints = ", ".join(f"`{joint}`" for joint in loop.joints)
        message = f"the servo loops of joints {joints}{ticking} are unstable together: {every}"
    helps = [_fitting(experiment, loop)]
    if loop.sensed:
        helps.append("stable if the law saw what is so: a sensor with less lag or delay, in place of the one it has")
    if loop.ticks:
        slower = "dynamics" if any(use.divisor < structure.schedule.dynamics for use in uses) else "servo"
        helps.append(f"or a faster rate of the {slower}")
    helps.append(f"reckoned with the arm {where}, within all limits{' and without dry friction' if loop.rubs else ''}")
    place = next((use.place for use in uses if use.place is not None), place)
    label = None if place is None else Label(place)
    code = "D320" if loop.ticks else "D322"
    return Diagnostic(code, message, label, tuple(_gain_places(experiment, loop)), tuple(helps), "warning")


def _fitting(experiment: Experiment, loop: Unstable) -> str:
    """The gains with which an unstable loop of a servo would be stable, in words."""
    joint, share = loop.joints[0], loop.gain
    if loop.parameters:
        several = [_bound(experiment, loop.case, f"{joint}.servo.{name}", x) for name, x in loop.parameters.items()]
        return f"stable with {' or '.join(several)}, {'each alone' if several[1:] else 'all else as it is'}"
    if share is not None and math.isnan(share):
        return "how much of the gain is stable was not searched for: the arm is too large"
    if share is None:
        return "no share of the gain is stable"
    share = float(inside(share * EDGE if share < 1.0 else share / EDGE, share, 2))
    gains = [
        _value_of(experiment, loop.case, path, share)
        for path in (f"{joint}.servo.{name}" for name in ("kp", "ki"))
        if path in experiment.parameters and len(loop.joints) == 1
    ]
    fits = f"stable {'up to' if share < 1.0 else 'from'} {share:g} times the gain"
    return f"{fits}: {', '.join(gains)}" if gains else fits


def _bound(experiment: Experiment, case: int, path: str, share: float) -> str:
    """A share of a parameter's value in a case, up to which or from which on the finding holds, in words."""
    return f"{_value_of(experiment, case, path, share)} and {'less' if share < 1.0 else 'more'}"


def _value_of(experiment: Experiment, case: int, path: str, share: float) -> str:
    """A share of a parameter's value in a case, in a deck's notation."""
    value, parameter = float(_value(experiment, path, case)) * share, experiment.parameters[path]
    return f"{path.rpartition('.')[2]} = {inside(value, share, 3)} {parameter.unit}"


def _gain_places(experiment: Experiment, loop: Unstable) -> Iterator[Label]:
    """The places of the loops' gains, and the sensors without which the loops would be stable."""
    names = tuple(loop.parameters) or ("kp",)
    paths = (f"{joint}.servo.{name}" for joint in loop.joints for name in names)
    places = (experiment.parameters[path].origin.place for path in paths if path in experiment.parameters)
    for place in dict.fromkeys(places):
        if place is not None:
            yield Label(place, "the gain")
    for use in experiment.structure.servos if loop.sensed else ():
        for sensor in use.sensors if use.joint in loop.joints else ():
            if sensor.place is not None:
                yield Label(sensor.place, "through this its law sees")


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
    """The servo of the joint, and the environment model without which the mode would be followed."""
    structure = experiment.structure
    for use in structure.servos:
        if use.joint == fault.joint and use.place is not None:
            yield Label(use.place, f"its servo, `{use.definition}`")
    for model in structure.environment:
        if model.name == better.cause and model.place is not None:
            yield Label(model.place, "without this it would not be so")


def _others(better: Remedy, head: str) -> list[str]:
    """Other integrators that suffice at the same rate, if there are any."""
    return [known_words(head, (f"`integrator = {name};`" for name in better.others))] if better.others else []


def motion_words(root: complex) -> str:
    """The motion of a mode, in words."""
    if abs(root.imag) > 1e-3 * abs(root.real):
        return f"swings with {_hertz(root)}"
    return f"{'grows' if root.real > 0.0 else 'decays'} with {abs(root):.3g} 1/s"
