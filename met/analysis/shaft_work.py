"""The work of a bed's two motors: torques, rate and acceleration of their shaft, in cases of a run.

Of a joint whose motor is on a bed already, the simulated bed says it, at the ticks of its servo:

    w = bed.shaft_rate,  w' = N qdd,  tau_m = tau_m(bed.drive_voltage, w),  tau_l = law.torque

Where the drive is told a torque, tau_m is that, and the voltage the one that gives it; where it is told a rate, tau_m
is what its own loop gave as the tick came, `bed.motor_torque`. w' and tau_l are over their scales, where the bed's
motor is of another size than the joint's: all is of the bed's own size.

Of any other joint, the joint itself does, at the instants of the dynamics: the load motor gives what the arm takes,

    w = servo.motor_rate,  w' = N qdd,  tau_m = servo.motor_torque,  tau_l = -tau_load/N + (J_b - J_m) w'

with J_b, the inertia of the bed's shaft, that of the joint's rotor J_m (docs/physics.md, section 11). On a shaft of
another inertia, the load motor gives tau_l + (J - J_b) w' for the same motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from met import models
from met.frozen import frozen
from met.plan import Experiment, Formula, Origin, Quantity, ServoUse, Substitution
from met.plan.channel import recordable
from met.run import prepare, run
from met.servos.motor import Motor
from met.substitution import bed_scale
from met.substitution.bed import DriveCommand
from met.substitution.bed_scale import BedScale

BLOCK_BYTES = 128 << 20
"""Size of the histories that are held at once; a single case may exceed it."""

OF_JOINT = ("qdd", "servo.motor_rate", "servo.motor_torque", "servo.voltage", "tau_load", "J_eff")
ELECTRICAL = {"kt": "N*m/A", "resistance": "ohm"}
"""Quantities of a bed's motor that follow from its servo's motor and the scale where its model does not declare
them."""

OF_BED = ("qdd", "bed.shaft_rate", "law.torque", "J_eff")


@frozen
class ShaftWork:
    """The work of some cases, [case, instant]; not-a-number after a case has failed. Shaft side.

    case          positions in the table of the sweep, [case];  time: of the instants, s, [instant]
    rate          w, rad/s;  acceleration: w', rad/s^2
    drive         torque of the drive motor, before friction, N m;  voltage: on it, V
    load          torque of the load motor on a shaft of the inertia `shaft`, N m
    arm           inertia of the arm at the shaft, J_eff/N^2, kg m^2
    rotor         inertia J_m of the joint's rotor, kg m^2, [case];  shaft: inertia J_b of the bed's shaft, [case];
                  arm and rotor over the scale of inertia, where the bed has one
    kt            torque constant of the drive motor, N m/A, [case];  kt_load: of the load motor, None where no deck
                  says which
    strongest     largest torque of the drive motor, N m, [case]
    failed        [case]: True where it did not reach its end
    limited       [case]: ticks at which the load's amplifier was at its limit, so that the load motor gave less
    """

    case: np.ndarray
    time: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    drive: np.ndarray
    voltage: np.ndarray
    load: np.ndarray
    arm: np.ndarray
    rotor: np.ndarray
    shaft: np.ndarray
    kt: np.ndarray
    kt_load: np.ndarray | None
    strongest: np.ndarray
    failed: np.ndarray
    limited: np.ndarray

    def load_on(self, inertia: float | np.ndarray) -> np.ndarray:
        """The load motor's torque on a shaft of another inertia (kg m^2), N m, [case, instant]."""
        return self.load + (np.broadcast_to(inertia, self.shaft.shape) - self.shaft)[:, None] * self.acceleration


def servo_of(experiment: Experiment, joint: str) -> ServoUse | None:
    """The joint's servo; None where it has none."""
    return next((use for use in experiment.structure.servos if use.joint == joint), None)


def not_for_a_bed(experiment: Experiment, use: ServoUse) -> tuple[str, str] | None:
    """The reason why a servo's motor cannot be tested on a motor bed, as words after `the servo of joint NAME`, and a
    remedy; None where it can."""
    model = models.find("servo", use.model, use.place)
    if not models.has_motor(model):
        known = sorted(name for name, servo in models.available("servo").items() if models.has_motor(servo))
        return f"({use.model}) has no motor that a bed could take the place of", f"models that have: {', '.join(known)}"
    only = model.motor_only
    if only is not None and (word := dict(use.words).get(only[0], only[1][0])) not in only[1]:
        return f"has `{only[0]} = {word}`, which no bed has", f"write `{only[0]} = {only[1][0]};` in the servo"
    if use.continuous:
        return "is continuous, and on a bed a servo ticks", "write a rate in Hz"
    if use.sensors:
        return "has a sensor, and on a bed the sensor is the bed's", "leave the sensor out in this run"
    first = next(iter(experiment.structure.substitutions), None)
    other = None if first is None else servo_of(experiment, first.joint)
    if other is not None and other.divisor != use.divisor:
        own_hz, two = (experiment.structure.schedule.base_hz / servo.divisor for servo in (use, other))
        same = "give both the same rate, or size a bed in a run of its own"
        return f"ticks at {own_hz:g} Hz, and that of `{other.joint}`, which is on a bed, at {two:g} Hz", same
    for model_use in experiment.structure.environment:
        named = models.find("environment", model_use.model, model_use.place).friction_joint
        path = f"environment.{model_use.name}.{named}"
        if named and path in experiment.parameters and experiment.parameters[path].value == use.joint:
            return (
                f"has friction from `{model_use.name}`, and on a bed friction is the bed's",
                "leave it out in this run",
            )
    return None


def shaft_work(
    experiment: Experiment,
    joint: str,
    rows: np.ndarray | None = None,
    progress: Callable[[int], None] | None = None,
) -> Iterator[ShaftWork]:
    """The work of a joint's motor and of its load, a block of cases at a time. Raises Problem.

    rows  of the case table, rising; all of them by default.  progress: called with the number of cases done so far
    """
    prepared = prepare(_recording(experiment, joint, _names(experiment, joint)))
    case_bytes = max(1, prepared.experiment.structure.history_bytes)
    size = max(1, BLOCK_BYTES // case_bytes)
    wanted = np.arange(experiment.cases.count) if rows is None else rows
    for first in range(0, len(wanted), size):
        block = wanted[first : first + size]
        report = None if progress is None else lambda done, before=first: progress(before + done)
        yield _block(experiment, joint, run(prepared, block, progress=report), block)


def _recording(experiment: Experiment, joint: str, names: Sequence[str]) -> Experiment:
    """The experiment with these channels of a joint as its only records, at each instant at which they change."""
    structure = experiment.structure
    use = servo_of(experiment, joint)
    assert use is not None
    paths = [f"{joint}.{name}" for name in names]
    known = recordable(structure, paths)
    record = tuple(known[path][0] for path in paths)
    every = use.divisor if joint in structure.on_beds else structure.schedule.dynamics
    schedule = replace(structure.schedule, record=every)
    return replace(experiment, structure=replace(structure, record=record, schedule=schedule))


def drive_of(use: Substitution) -> DriveCommand:
    """The quantity that the drive of a joint's motor bed is commanded: a voltage, a torque or a rate."""
    drive: DriveCommand = models.find("bed", use.bed, use.place).drive
    return drive


def _names(experiment: Experiment, joint: str) -> tuple[str, ...]:
    """The channels of a joint that the work of its motors is computed from."""
    use = experiment.structure.on_beds.get(joint)
    if use is None:
        return OF_JOINT
    drive = drive_of(use)
    return (*OF_BED, "bed.motor_torque" if drive == "rate" else f"bed.drive_{drive}")


def _block(experiment: Experiment, joint: str, results: Any, rows: np.ndarray) -> ShaftWork:
    """The work of a joint's two motors on a bed in these rows of the case table. results: of a run that recorded the
    signals of `_names`."""
    signals = {name: results.signals[f"{joint}.{name}"] for name in _names(experiment, joint)}
    use = experiment.structure.on_beds.get(joint)
    motor = motor_of(experiment, joint, rows)
    ratio = motor["ratio"][:, None]
    scale = scale_of(experiment, joint, rows)
    if use is not None:
        bed = motor | {name: motor[name] / of_cases(scale.of(unit)) for name, unit in ELECTRICAL.items()}
        bed |= {
            name: parameter(experiment, path, rows)
            for name in ("inertia", "kt_load", "kt", "resistance", "tau_max")
            if (path := f"{joint}.bed.{name}") in experiment.parameters
        }
        rate, load = signals["bed.shaft_rate"], signals["law.torque"] / scale.torque
        kt, resistance, most = (bed[name][:, None] for name in ("kt", "resistance", "tau_max"))
        if drive_of(use) == "voltage":
            voltage = signals["bed.drive_voltage"]
            drive = np.clip(kt / resistance * (voltage - kt * rate), -most, most)
        else:
            drive = (
                signals["bed.motor_torque"]
                if drive_of(use) == "rate"
                else np.clip(signals["bed.drive_torque"], -most, most)
            )
            voltage = resistance / kt * drive + kt * rate
    else:
        bed = motor
        rate, voltage, drive = signals["servo.motor_rate"], signals["servo.voltage"], signals["servo.motor_torque"]
        load = -signals["tau_load"] / ratio
    return ShaftWork(
        case=np.asarray(experiment.cases.table[rows]),
        time=results.time,
        rate=rate,
        acceleration=ratio * signals["qdd"] / scale.rate,
        drive=drive,
        voltage=voltage,
        load=load,
        arm=signals["J_eff"] / ratio**2 / scale.inertia,
        rotor=motor["inertia"] / of_cases(scale.inertia),
        shaft=bed["inertia"],
        kt=bed["kt"],
        kt_load=bed.get("kt_load"),
        strongest=bed["tau_max"],
        failed=results.status != 0,
        limited=results.limited,
    )


def scale_of(experiment: Experiment, joint: str, rows: np.ndarray) -> BedScale:
    """The scales between a joint's motor and the one on its bed, each [case, 1]; 1 where the deck has none."""
    use = experiment.structure.on_beds.get(joint)
    if use is None or not use.scaled:
        return BedScale()
    names = (declared.name for declared in bed_scale.PARAMETERS)
    return BedScale(*(parameter(experiment, f"{joint}.bed.scale.{name}", rows)[:, None] for name in names))  # type: ignore[arg-type]


def of_cases(scale: Any) -> np.ndarray:
    """A scale of [case, 1], or of all cases, as [case], or [1]."""
    return np.ravel(scale)


def motor_of(experiment: Experiment, joint: str, rows: np.ndarray) -> dict[str, np.ndarray]:
    """The motor of a joint's servo (met.servos.motor.Motor), by the names of its numbers, each [case]."""
    use = servo_of(experiment, joint)
    assert use is not None
    head = f"{joint}.servo."
    numbers = {
        path.removeprefix(head): parameter(experiment, path, rows)
        for path, quantity in experiment.parameters.items()
        if path.startswith(head) and isinstance(quantity.value, float | int | Formula)
    }
    motor: Motor = models.find("servo", use.model, use.place).motor(SimpleNamespace(**numbers))
    return {field.name: np.asarray(getattr(motor, field.name)) for field in fields(motor)}


def parameter(experiment: Experiment, path: str, rows: np.ndarray) -> np.ndarray:
    """The values of a parameter in cases of these rows, SI, [case]."""
    value = experiment.parameters[path].value
    if isinstance(value, Formula):
        return np.asarray(experiment.column(value)[rows], float)
    assert isinstance(value, float | int)
    return np.full(len(rows), float(value))


def on_bed(experiment: Experiment, joint: str, *, delay: int) -> Experiment:
    """The experiment with the joint's motor on an emulated motor bed without faults, with all defaults; unchanged where
    the deck has a bed. The law is that of the other joints on beds, where there are some."""
    if joint in experiment.structure.on_beds:
        return experiment
    from met.substitution import BEDS, LAWS

    others = experiment.structure.substitutions
    bed = BEDS[0]
    law = models.find("law", others[0].law) if others else LAWS[0]
    parameters = dict(experiment.parameters)
    for owner, model in (("bed", bed), ("law", law)):
        for declared in model.parameters:
            path, own = f"{joint}.{owner}.{declared.name}", f"{joint}.servo.{declared.of_servo}"
            if declared.shape == "text":
                continue
            if declared.of_servo and own in experiment.parameters:
                parameters[path] = experiment.parameters[own]
            elif declared.default is not None:
                value = float(delay) if path.endswith(".bed.delay") else declared.default
                parameters[path] = Quantity(value, declared.unit, Origin("default"))
    use = Substitution(joint, bed.name, law.name)
    structure = replace(experiment.structure, substitutions=(*others, use))
    return replace(experiment, structure=structure, parameters=parameters)
