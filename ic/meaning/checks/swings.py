"""Warnings about steps that are too long for oscillations in a servo or sensor, or for bodies that spin.

The figure h lambda is about decay, and a swing has roots off the real axis, where integrators have other limits: the
methods of order 2 and 1 let an undamped swing grow at any step, slowly or fast. So the integrator itself is run. Its
step takes (x, x') to M (x, x'), and with r the largest size of M's eigenvalues a swing grows by r^n in n steps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ic.meaning.control.schedule import Rate, check_stability, evaluate_declared, hz, slowest_that_fits
from ic.meaning.control.servos import Use
from ic.meaning.definitions.merge import MergedBlock
from ic.meaning.parameters.owner import XYZ
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import models
from met.diagnostic import Label, Place
from met.integrators.integrator import Motion, Slope
from met.plan import BASE, Schedule, Structure
from met.plan.uses import sensor_parts
from met.trace import Real

GROWS = float(np.log(1.1))  # ln of the growth over a run, above which a warning is given: by a tenth
FINEST = 1000  # times the base rate: beyond, no rate is proposed


def growth(integrator: Any, h: float, a: Any, b: Any) -> Any:
    """ln of the factor of one step of h s for a swing with these coefficients (1/s^2, 1/s), numbers or arrays of
    them."""

    def slope(_: float, y: Motion) -> Slope:
        return Slope((), (), (y.x[1], -a * y.x[0] - b * y.x[1]))

    with np.errstate(all="ignore"):  # a step far too long is reported elsewhere
        columns = []
        for start in ((1.0, 0.0), (0.0, 1.0)):
            y = Motion((), (), start)
            columns.append(integrator.advance(slope, h, y, slope(0.0, y)).x)
        (m11, m21), (m12, m22) = columns
        half, det = 0.5 * (m11 + m22), m11 * m22 - m12 * m21
        off = half * half - det
        size = np.where(off < 0.0, np.sqrt(np.abs(det)), np.abs(half) + np.sqrt(np.maximum(off, 0.0)))
        return np.log(size)


def check_swing(
    scope: Scope,
    label: str,
    swing: tuple[Real, Real],
    schedule: Schedule,
    integrator: Any,
    dynamics: Rate,
    path: str,
    *,
    held: bool,
) -> None:
    """Warn where the integrator's steps make a swing x'' = -a x - b x' grow over the run (D249).

    label  what swings, in words;  path: of what it belongs to
    held   whether a and b are those with the joint standing still
    """
    known = models.find_own("integrator")
    if integrator not in known.values():  # another package's is called only to be recorded
        return
    steps, h = schedule.ticks // schedule.dynamics, schedule.step

    def warn(values: np.ndarray) -> None:
        """Warn where the steps make the swing x'' = -a x - b x' grow by more than a tenth over the run in some case
        (D249). values: [case, 2], a in 1/s^2 and b in 1/s."""
        grown = steps * growth(integrator, h, values[:, 0], values[:, 1])
        grown = np.where(np.isfinite(grown), grown, 0.0)
        if (grown > GROWS).any():
            a, b = map(float, values[int(np.argmax(grown))])
            scope.note_rate("D249", float(np.max(grown)), int(np.argmax(grown)))
            every = h / (float(np.max(grown)) / steps)
            still = [
                f"integrator = {name};"
                for name, other in known.items()
                if name != integrator.name and steps * growth(other, h, a, b) <= GROWS
            ]
            enough = _enough(integrator, h, steps, a, b)
            helps = [f"the slowest rate at which it does not: {_slowest(schedule, integrator, a, b)}"]
            if still:
                helps.append(
                    known_words("at this rate it does not with", (f"`{integrator_name}`" for integrator_name in still))
                )
            if enough is not None:
                helps.append(f"or damp it: of x'' = -a x - b x', b is {b:.3g} 1/s, and {enough:.3g} 1/s would do")
            scope.complaints.remark(
                "D249",
                f"{label} swings, and this step of {integrator.name} makes that grow: by e in every {every:.3g} s",
                Label(dynamics.place, f"h = {h:g} s"),
                help=[*helps, *(["reckoned with the joint held: a gear swings faster against a light one"] * held)],
            )

    scope.checks.observe(swing, warn, dynamics.place, needs=(path,))


def _enough(integrator: Any, h: float, steps: int, a: float, b: float) -> float | None:
    """The smallest damping b, 1/s, with which the swing does not grow over the run; None where none suffices."""
    low, high = b, max(b, np.sqrt(a))
    if steps * growth(integrator, h, a, high) > GROWS:
        return None
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if steps * growth(integrator, h, a, middle) > GROWS else (low, middle)
    return float(high)


def _slowest(schedule: Schedule, integrator: Any, a: float, b: float) -> str:
    """The slowest rate of the dynamics, faster than the present one, at which the swing does not grow over the run; in
    words."""
    for per_second, steps in _finer(schedule):
        if steps * growth(integrator, 1.0 / per_second, a, b) <= GROWS:
            return f"{hz(per_second)} Hz"
    return "none that is sensible"


def _finer(schedule: Schedule) -> Iterator[tuple[float, int]]:
    """Rates that fit the run, from the next faster one on, Hz, and steps of the run."""
    for n in range(schedule.dynamics - 1, 0, -1):
        if schedule.ticks % n == 0:
            yield schedule.base_hz / n, schedule.ticks // n
    for times in range(2, FINEST + 1):
        yield schedule.base_hz * times, schedule.ticks * times


def check_circuits(
    scope: Scope, use: Use, schedule: Schedule, integrator: Any, dynamics: Rate, *, on_bed: bool
) -> None:
    """Check the oscillations of a servo and its sensors, and the sensors' filters, at the dynamics' step.

    on_bed  whether the motor is on a bed, and so no part of the step
    """
    path, servo = f"{use.joint}.servo", use.servo
    if servo.swings is not None and not on_bed and use.parameters is not None:
        swings = evaluate_declared(scope, servo.swings, use.parameters, path, use.command_kind or "none")
        for what, swing in (swings or {}).items():
            label = f"the {what} of servo `{use.definition}`"
            check_swing(scope, label, swing, schedule, integrator, dynamics, path, held=True)
    for sensor in use.sensors:
        own, label = f"{path}.sensor.{sensor.of}", f"sensor `{sensor.of}` of servo `{use.definition}`"
        values = {
            p.name: scope.parameters[f"{own}.{p.name}"].value
            for p in sensor_parts(sensor, "parameters")
            if f"{own}.{p.name}" in scope.parameters
        }
        check_sensor(scope, label, models.find("sensor", sensor.model), values, schedule, integrator, dynamics, own)


def check_sensor(
    scope: Scope,
    label: str,
    sensor: Any,
    values: Mapping[str, Any],
    schedule: Schedule,
    integrator: Any,
    dynamics: Rate,
    path: str,
) -> None:
    """Check the filter of a sensor at the dynamics' step. label: the sensor in words; path: of its parameters"""
    rate = evaluate_declared(scope, sensor.fastest, values, path)
    if rate is not None:
        check_stability(
            scope,
            label,
            rate,
            schedule,
            integrator,
            dynamics,
            path,
            meaning="the rate constant of the sensor's filter, 2 pi cutoff",
        )
    swing = evaluate_declared(scope, sensor.swing, values, path)
    if swing is not None:
        check_swing(scope, f"the filter of {label}", swing, schedule, integrator, dynamics, path, held=False)


LOST_A_TURN = 0.01
"""Share of the energy of a tumbling body that a turn may lose or gain without a warning."""

FIRST, HIGHER = 1.6, 5.0
"""Error coefficients: an integrator of order p has an error of up to (h rate/HIGHER)^p of the energy of a body that
tumbles for each radian, and h rate/FIRST where p is 1: measured, of bodies whose centre of mass is as far from their
frame as they are large (docs/physics.md, section 3)."""


def check_spins(scope: Scope, block: MergedBlock, structure: Structure) -> None:
    """Warn about free bodies that turn too far in a step for the integrator, from their angular velocity at the start
    (D300)."""
    integrator, schedule = models.find("integrator", structure.integrator), structure.schedule
    limit = (FIRST if integrator.order == 1 else HIGHER) * (LOST_A_TURN / (2.0 * math.pi)) ** (1.0 / integrator.order)
    for label, path, place in _spinning(block, structure):
        paths = tuple(f"{path}.{axis}" for axis in XYZ)
        settled = [setting.value for name in paths if (setting := scope.parameters.get(name)) is not None]

        def warn(rows: np.ndarray, label: str = label, place: Place = place) -> None:
            """Warn where a body turns too far in a step of the dynamics from the start (D300). rows: [case, 3], its
            angular velocity, rad/s."""
            fastest = float(np.max(np.sqrt((rows * rows).sum(axis=1))))
            if schedule.step * fastest > limit:
                fits = slowest_that_fits(schedule, limit)(fastest)
                scope.complaints.remark(
                    "D300",
                    f"{label} turns by {schedule.step * fastest:.3g} rad in a step of the dynamics",
                    Label(place, f"h = {schedule.step:g} s"),
                    help=[
                        f"below {limit:.2g} rad a step a body that tumbles keeps its energy to {LOST_A_TURN:.0%} a "
                        f"turn with {integrator.name}: the slowest rate that fits is {fits}",
                        "a steady spin about a principal axis through the frame's origin needs less",
                    ],
                )

        if len(settled) == len(paths):
            scope.checks.observe(tuple(settled), warn, place, needs=paths)  # type: ignore[arg-type]


def _spinning(block: MergedBlock, structure: Structure) -> Iterator[tuple[str, str, Place]]:
    """Free bodies that spin from the start: in words, with the path and the place of their angular velocity."""
    if structure.base is not None and structure.free:
        initial = block.get("initial")
        written = initial.body.get(f"{BASE}.rate") if initial is not None and initial.body is not None else None
        place = written.value_place if written is not None else structure.base.place
        assert place is not None  # a moving base comes from a deck
        yield "the base", f"initial.{BASE}.rate", place
    items = {item.name: item for item in block.of_kind("payload")}
    for payload in structure.payloads:
        if payload.grappled:
            item = items[payload.name]
            written = item.body.get("rate") if item.body is not None else None
            yield f"payload `{payload.name}`", f"payloads.{payload.name}.rate", (written or item).value_place
