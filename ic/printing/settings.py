"""Settings of a run besides its parameters, under their deck names: `rates.dynamics`, `elbow.servo.model`."""

from __future__ import annotations

from met import models
from met.diagnostic import Place
from met.plan import Experiment, Origin, Quantity, Structure
from met.plan.run_keys import RunKey, run_keys


def kept_keys(experiment: Experiment) -> list[tuple[RunKey, str | float]]:
    """The keys of a run that the plan keeps as one word or number each, with a deck's value, in SI."""
    holders = ((Structure, experiment.structure), (Experiment, experiment))
    return [(key, key.in_deck(getattr(holder, field))) for cls, holder in holders for field, key in run_keys(cls)]


def settings(experiment: Experiment) -> dict[str, Quantity]:
    """The settings by path, from the plan alone, which keeps the places of some of them."""
    structure = experiment.structure
    schedule = structure.schedule
    quantities: dict[str, Quantity] = {}

    def word(path: str, text: str, place: Place | None = None) -> None:
        quantities[path] = Quantity(text, "", Origin("deck", place))

    def number(path: str, value: float, unit: str, note: str = "") -> None:
        quantities[path] = Quantity(value, unit, Origin("derived" if note else "deck", note=note))

    word("arm", structure.arm)
    if structure.base is not None:
        word("base", structure.base.kind, structure.base.place)
        for course in structure.base.courses:
            word(f"base.{course.component}.model", course.model, structure.base.place)
    for joint in structure.joints:
        word(f"{joint.name}.parent", joint.parent, joint.place)
        word(f"{joint.name}.child", joint.child, joint.place)
        if joint.follows:
            word(f"{joint.name}.follows", ", ".join(joint.follows), joint.place)
    for use in structure.servos:
        word(f"{use.joint}.servo", use.definition, use.place)
        word(f"{use.joint}.servo.model", use.model, use.place)
        if use.continuous:
            word(f"{use.joint}.servo.rate", "continuous", use.place)
        elif models.find("servo", use.model).control is not None:
            number(f"{use.joint}.servo.rate", schedule.base_hz / use.divisor, "Hz", f"{use.divisor} base ticks a tick")
    for on_bed in structure.substitutions:
        word(f"{on_bed.joint}.bed.model", on_bed.bed, on_bed.place)
        word(f"{on_bed.joint}.law.model", on_bed.law, on_bed.place)
    for payload in structure.payloads:
        word(f"payloads.{payload.name}.on", payload.link, payload.place)
    for guide in structure.guides:
        word(f"guides.{guide.name}.model", guide.model, guide.place)
        if models.find("guide", guide.model).steer is not None:
            ticks = f"{guide.divisor} base ticks a tick"
            number(f"guides.{guide.name}.rate", schedule.base_hz / guide.divisor, "Hz", ticks)
    for sensor in structure.sensors:
        word(f"sensors.{sensor.name}.model", sensor.model, sensor.place)
        ticks = f"{sensor.divisor} base ticks a tick"
        number(f"sensors.{sensor.name}.rate", schedule.base_hz / sensor.divisor, "Hz", ticks)
    for environment in structure.environment:
        word(f"environment.{environment.name}.model", environment.model, environment.place)
    for key, value in kept_keys(experiment):
        quantities[key.path] = Quantity(value, "" if isinstance(value, str) else key.parameter.unit, Origin("deck"))
    number("rates.base", schedule.base_hz, "Hz")
    number("rates.dynamics", schedule.base_hz / schedule.dynamics, "Hz", f"{schedule.dynamics} base ticks a step")
    number("rates.record", schedule.base_hz / schedule.record, "Hz", f"{schedule.record} base ticks a row")
    word("integrator", structure.integrator)
    number("duration", schedule.duration, "s", f"{schedule.ticks} base ticks")
    word("record", ", ".join(recorded.name for recorded in structure.record) or "none")
    number("seed", float(experiment.cases.seed), "1")
    for answer in experiment.linear:
        head = f"linear.{answer.name}"
        if answer.pose is None:
            number(f"{head}.at", answer.at, "s")
        else:
            word(f"{head}.at", "equilibrium", answer.place)
        for entry, paths in (("inputs", answer.inputs), ("outputs", answer.outputs), ("open", answer.opened)):
            if paths:
                word(f"{head}.{entry}", ", ".join(paths), answer.place)
    for metric in experiment.metrics:
        word(f"metrics.{metric.name}.model", metric.model, metric.place)
        word(f"metrics.{metric.name}.of", metric.of, metric.place)
    return quantities
