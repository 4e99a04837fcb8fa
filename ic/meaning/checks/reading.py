"""Warnings about sensors, and failures of sensors, that no servo's law reads."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import Any

from ic.meaning.control.servos import Use
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.analysis.probe import of_law, reads
from met.diagnostic import leave_out
from met.plan import ServoUse, Structure
from met.plan.uses import quantities


def remark_unread(scope: Scope, uses: Iterable[Use], structure: Structure) -> None:
    """Report sensors that no law uses and nothing records, and dead ones that no law would notice."""
    servos = {servo.joint: servo for servo in structure.servos}
    known: dict[Hashable, frozenset[str] | None] = {}  # many joints have one law
    by_use: list[tuple[Use, frozenset[str] | None]] = []
    for use in uses:
        read = None
        if use.parameters is not None:
            law = of_law(servos[use.joint], use.parameters)
            read = known[law] = known[law] if law in known else reads(servos[use.joint], use.parameters)
        by_use.append((use, read))
    # a sensor of a definition is seen where the law of one of its joints sees it, or is not known
    every = [(sensor, read) for use, read in by_use for sensor in servos[use.joint].sensors]
    seen_at = {sensor.place for sensor, read in every if read is None or sensor.of in read}
    for use, read in by_use:
        if read is None:
            continue
        servo = servos[use.joint]
        label = f"the law of servo `{use.definition}` ({servo.model})"
        under = f" under a {servo.command.kind} command" if servo.command is not None else ""
        seen = [quantity for quantity in quantities(servo) if quantity in read]
        helps = known_words(f"it reads{under}", seen) if seen else f"it reads nothing of its joint{under}"
        for sensor in servo.sensors:
            if sensor.place is not None and sensor.place not in seen_at and not _is_used(structure, servo, sensor.of):
                scope.complaints.remark(
                    "D290",
                    f"sensor `{sensor.of}` changes nothing: {label} does not read `{sensor.of}`",
                    sensor.place,
                    help=[
                        helps,
                        leave_out(f"leave it out, or record it: `record += [{servo.joint}.servo.sensor.{sensor.of}];`"),
                    ],
                )
        for name, hidden in _dead(scope, structure, use.joint):
            if str(hidden.value) not in read and hidden.origin.place is not None:
                scope.complaints.remark(
                    "D168",
                    f"environment `{name}` never acts: {label} does not read `{hidden.value}`",
                    hidden.origin.place,
                    help=[helps, "change that, or leave it out"],
                )


def _is_used(structure: Structure, servo: ServoUse, quantity: str) -> bool:
    """Return True if this sensor's reading of the quantity is recorded, watched by a metric or in an expression."""
    path = f"{servo.joint}.servo.sensor.{quantity}"
    channels = [channel for record in structure.record for channel in record.channels]
    channels += [channel for expression in structure.expressions for channel in expression.channels]
    return any(
        f"{channel}.".startswith(f"{path}.") for channel in (*channels, *(metric.of for metric in structure.metrics))
    )


def _dead(scope: Scope, structure: Structure, joint: str) -> Iterable[tuple[str, Any]]:
    """Models that hide a quantity from the law of this joint: their names, and the quantity."""
    for use in structure.environment:
        model, head = models.find("environment", use.model), f"environment.{use.name}"
        about, hidden = scope.parameters.get(f"{head}.{model.servo_of}"), scope.parameters.get(f"{head}.of")
        if model.replaced_reading is not None and about is not None and about.value == joint and hidden is not None:
            yield use.name, hidden
