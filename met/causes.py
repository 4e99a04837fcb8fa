"""Causes of failed cases, in words: the time, the joint, body or sensor, its place in the deck, and a remedy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from met import models
from met.diagnostic import Place
from met.plan import Experiment
from met.program.plausible import DOUBTFUL, DOUBTFUL_TICK, FAILED, MEASURE, OF
from met.program.step import FAILURE, NOT_FINITE, OUT_OF_RANGE, SINGULAR, TOO_FAST, UNBALANCED
from met.program.unheld import Unheld, unheld


def causes_of(experiment: Experiment, inputs: np.ndarray, outputs: Mapping[str, np.ndarray]) -> list[str]:
    """The causes of failed cases, in words. inputs: of their program, [case, input]; outputs: of it, by name,
    [case]."""
    by_case = [{name: float(column[case]) for name, column in outputs.items()} for case in range(len(inputs))]
    causes = ["" if figures["failure"] == UNBALANCED else _cause_of(experiment, figures) for figures in by_case]
    unbalanced = np.flatnonzero(outputs["failure"] == UNBALANCED)
    if len(unbalanced):
        for case, joints in zip(unbalanced.tolist(), unheld(experiment, inputs[unbalanced]), strict=True):
            causes[case] = _cause_of_balance(experiment, int(outputs["failure.joint"][case]), joints)
    return causes


def _cause_of(experiment: Experiment, outputs: Mapping[str, float]) -> str:
    """The cause, in words, why a case failed after a balanced start. outputs: of its program, by name."""
    failure, number, tick = (outputs[name] for name in FAILURE)
    moving = experiment.structure.moving
    if failure == TOO_FAST:
        name, unit, where = _of_rate(experiment, int(number))
        return (
            f"{_head(experiment, tick)}{name}: it moves faster than {FAILED * outputs[MEASURE]:.3g} {unit}, which "
            f"nothing in the run could make it{where}. {_of_steps(experiment)}"
        )
    if int(number) == len(moving) and experiment.structure.free:
        return _cause_of_base(experiment, failure, tick)
    others = len(moving) + experiment.structure.free + sum(payload.flies for payload in experiment.structure.payloads)
    if int(number) >= others:
        return _cause_of_sensor(experiment, int(number) - others, tick)
    if int(number) >= len(moving):
        return _cause_of_payload(experiment, int(number) - len(moving) - experiment.structure.free, tick)
    joint = moving[int(number)]
    prismatic = joint.kind == "prismatic"
    unit = "kg" if prismatic else "kg m^2"
    head = f"{_head(experiment, tick)}joint {joint.name}: "
    where = _where(joint.place)
    if failure == SINGULAR and joint.loop is not None:
        return (
            f"{head}loop {joint.loop.name} comes to be stretched or folded flat, or its links no longer meet, so that "
            f"joint {joint.loop.leader} does not lead it on{_where(joint.loop.place)}. Keep that joint off there, as "
            f"by a `joint_stop`, or let another one lead. Where it was not near, a step is too long: try a faster "
            f"rate for the dynamics."
        )
    if failure == SINGULAR and tick > 0.0:
        return (
            f"{head}D is not above 0 {unit} any more, so qdd is undefined{where}. At the start it was: usually the "
            f"motion has diverged, and a step is too long for the servo, the arm or what acts on it (try a faster rate "
            f"for the dynamics); or what is outboard has no inertia about this joint in this position."
        )
    if failure == SINGULAR:
        return (
            f"{head}D is not above 0 {unit}, so qdd is undefined. Nothing outboard has inertia about this "
            f"joint{where}. Give the link mass or the servo a rotor inertia."
        )
    if failure == OUT_OF_RANGE:
        return (
            f"{head}a state of its servo is where it can never be{where}: a step is too long for the servo (try a "
            f"faster rate for the dynamics). The bristles of `friction = lugre` want sigma_0 |motor rate|/f_c times "
            f"the step to stay below the integrator's limit."
        )
    assert failure == NOT_FINITE
    what = "the servo, the arm or what acts on its base" if experiment.structure.free else "the servo or the arm"
    return (
        f"{head}position, rate or acceleration is no longer a finite number{where}. Usual reasons: "
        f"{_of_guide(experiment, joint.name)}a step too long for {what} (see the step size of `met plan`; try "
        f"a faster rate for the dynamics), or a model that divides by zero."
    )


def doubt_of(experiment: Experiment, outputs: Mapping[str, float]) -> str:
    """The doubt about a finished case, in words: a rate that hardly any arm could reach."""
    name, unit, where = _of_rate(experiment, int(outputs[OF]))
    return (
        f"{_head(experiment, outputs[DOUBTFUL_TICK])}{name}: it moves faster than {DOUBTFUL * outputs[MEASURE]:.3g} "
        f"{unit}, which hardly anything could make it{where}. {_of_steps(experiment)}"
    )


def _head(experiment: Experiment, tick: float) -> str:
    return f"t = {tick / experiment.structure.schedule.base_hz:g} s: "


def _of_rate(experiment: Experiment, number: int) -> tuple[str, str, str]:
    """The joint or body with this number in the outputs: its name, the unit of its rates, and its place in the deck."""
    structure = experiment.structure
    joints = structure.moving
    if number < len(joints):
        joint = joints[number]
        return f"joint {joint.name}", "m/s" if joint.kind == "prismatic" else "rad/s", _where(joint.place)
    if structure.free and number == len(joints):
        return "the base", "rad/s (m/s)", _where(structure.base.place if structure.base is not None else None)
    payload = [flying for flying in structure.payloads if flying.flies][number - len(joints) - structure.free]
    return f"payload {payload.name}", "rad/s (m/s)", _where(payload.place)


def _where(place: Place | None) -> str:
    return f" ({place.file}:{place.line})" if place else ""


def _of_steps(experiment: Experiment) -> str:
    """The usual reason of a rate that is not finite, and the remedy."""
    schedule = experiment.structure.schedule
    return (
        "Nearly always a step is too long for the servo, the arm or what acts on it, and the motion diverges: try a "
        f"faster rate for the dynamics, which have {schedule.base_hz / schedule.dynamics:g} Hz."
    )


def _cause_of_balance(experiment: Experiment, number: int, joints: Sequence[Unheld]) -> str:
    """The cause of a failed balanced start, in words: servos that cannot hold their joints.

    number: of the first of the joints;  joints: what is known of all that are not held
    """
    joint = experiment.structure.moving[number].name
    by_name = {candidate.joint.name: candidate for candidate in joints}
    if joint in experiment.structure.springs:
        return (
            f"t = 0 s: joint {joint}: it cannot begin balanced: no bend was found at which the boom stands still. It "
            "is so soft that its load bends it far, or buckles it: make it stiffer, or leave `servos = balanced` out."
        )
    if joint not in by_name:
        return f"t = 0 s: joint {joint}: it cannot begin balanced: its servo holds just less than the joint takes."
    weak = by_name[joint]
    return (
        f"t = 0 s: joint {joint}: it cannot begin balanced{_where(weak.servo.place)}: it takes {weak.wanted:.3g} "
        f"{weak.unit}, and its servo can hold {weak.holdable:.3g} {weak.unit}. {weak.reason[0].upper()}"
        f"{weak.reason[1:]}."
    )


def _of_guide(experiment: Experiment, joint: str) -> str:
    """The remark, in words, that the guide which a joint follows gives it no finite number; empty where there is no
    such guide."""
    for use in experiment.structure.guides:
        undefined = models.find("guide", use.model, use.place).undefined
        if joint in use.joints and undefined:
            return f"guide `{use.name}`{_where(use.place)}, which it follows, {undefined}; "
    return ""


def _cause_of_payload(experiment: Experiment, number: int, tick: float) -> str:
    """The cause of a failure by one of the payloads in free flight, in words."""
    payload = [flying for flying in experiment.structure.payloads if flying.flies][number]
    return (
        f"{_head(experiment, tick)}payload {payload.name}: position, rate or acceleration is no longer a finite "
        f"number{_where(payload.place)}. Usual reasons: a step too long for what acts on it (try a faster rate for the "
        f"dynamics), or a model that divides by zero."
    )


def _cause_of_sensor(experiment: Experiment, number: int, tick: float) -> str:
    """The cause of a failure by one of the sensors of links, in words."""
    sensor = experiment.structure.sensors[number]
    return (
        f"{_head(experiment, tick)}sensor {sensor.name}: its filter is no longer a finite number"
        f"{_where(sensor.place)}. Usual reasons: a step too long for its `cutoff` (try a faster rate for the "
        f"dynamics), or numbers that no double holds."
    )


def _cause_of_base(experiment: Experiment, failure: float, tick: float) -> str:
    """The cause of a failure by the free base, in words."""
    base = experiment.structure.base
    head = f"{_head(experiment, tick)}the base: "
    where = _where(base.place) if base is not None else ""
    if failure == SINGULAR and tick > 0.0:
        return (
            f"{head}it moves freely and has no inertia in some direction any more, so its acceleration is "
            f"undefined{where}. At the start it had: usually the motion has diverged, and a step is too long for what "
            f"acts on the base or for a servo (try a faster rate for the dynamics)."
        )
    if failure == SINGULAR:
        return (
            f"{head}it moves freely and has no inertia in some direction, so its acceleration is undefined{where}. "
            f"Give link base mass, and a shape or inertia, that of the rotors it carries among it."
        )
    return (
        f"{head}position, rate or acceleration is no longer a finite number{where}. Usual reasons: a step too long for "
        f"what acts on it (try a faster rate for the dynamics), or a model that divides by zero."
    )
