"""Checks of a bench of two drives against a deck: differences of its file and its drives from the deck's model."""

from __future__ import annotations

from collections.abc import Iterator

from hw.drives import DIALECTS
from hw.drives.bench_file import TwoDrives, two_drives
from hw.ports import Opening
from met import models
from met.diagnostic import Diagnostic, Label, Problem, error
from met.frozen import frozen
from met.plan import Experiment, Formula, Substitution

RATE_LOOP_TOLERANCE = 0.1
"""Share of its gains by which a drive's rate loop may differ from the deck's before it is said."""

WEAKER = "beyond it the drive gives less than the law believes, and the run is one of neither motor"
"""The reason for a warning about a drive that is weaker than the deck's motor."""


def bench_at(path: str) -> TwoDrives:
    """The bench of a file. Raises Problem E446."""
    try:
        return two_drives(path)
    except OSError as reason:
        why = (reason.strerror or str(reason)).lower()
        raise Problem(error("E446", f"{path} cannot be read: {why}", help="`can:` takes a bench's file")) from None


def check_deck(path: str, experiment: Experiment, joint: str) -> None:
    """Raise Problem E438 where the drive under test cannot take the commands of the deck's bed model, E444 where the
    filter of the rate, or the load's torque constant, differs from the deck's."""
    bench = bench_at(path)
    _check_told(path, bench, experiment.structure.on_beds[joint])
    held = (
        (bench.filter_at, bench.shaft["filter"], "Hz", "f_cut", "the bench filters the rate at", "`filter`"),
        (bench.load_kt_at, bench.load.figures["kt"], "N*m/A", "kt_load", "the bench's load gives", "`kt` of `[load]`"),
    )
    for place, held_value, unit, name, words, key in held:
        believed = experiment.parameters[f"{joint}.bed.{name}"]
        if place is None or believed.value == held_value:
            continue
        says = f"{believed.value:g} {unit}" if isinstance(believed.value, float) else "varied by a sweep"
        also = [] if believed.origin.place is None else [Label(believed.origin.place, "the deck's")]
        message = f"{words} {held_value:g} {unit}, and the `{name}` of joint `{joint}` is {says}"
        helps = (f"in the deck: `bed = ...({name} = {held_value:g} {unit})`", f"or another {key} in the bench's file")
        raise Problem(error("E444", message, place, also=also, help=helps), {path: bench.text})


def _check_told(path: str, bench: TwoDrives, use: Substitution) -> None:
    """Raise Problem E438 where the deck's bed model sends a rate, and the drive's dialect has none."""
    sends = models.find("bed", use.bed, use.place).drive
    dialect = DIALECTS.get(bench.drive.dialect)
    if sends != "rate" or dialect is None or dialect.takes_rates:
        return
    other = [name for name, model in models.find_own("bed").items() if model.drive != "rate"]
    known = ", ".join(name for name, dialect in DIALECTS.items() if dialect.takes_rates)
    message = (
        f"a drive of dialect `{bench.drive.dialect}` is told no rate, and `{use.bed}` of joint `{use.joint}` sends one"
    )
    helps = (f"bed models for this drive: {', '.join(other)}", f"dialects that are told rates: {known}")
    also = [] if use.place is None else [Label(use.place, "on this bench")]
    raise Problem(error("E438", message, bench.dialect_at, also=also, help=helps), {path: bench.text})


def warnings(bench: TwoDrives, path: str, opening: Opening) -> Iterator[Diagnostic]:
    """Warnings about permissible differences of the bench from the deck: E444."""
    if opening.experiment is None:
        return
    if bench.filter_at is None:
        cut = opening.bed_values()["f_cut"]
        message = f"the bench has no filter: the deck's `f_cut`, {cut:g} Hz, has to be that of the drive's own rate"
        remedy = (f'else `filter = "{cut:g} Hz"` in `[shaft]` of {path}',)
        yield Diagnostic("E444", message, help=remedy, severity="warning")
    most, believed = bench.drive.figures["torque_max"], believed_torque(opening)
    if most < (1.0 - 1e-9) * believed and bench.torque_at is not None:
        message = (
            f"the bench's drive gives {most:g} N*m at most, and the motor of joint `{opening.joint}` {believed:g} N*m"
        )
        origin = opening.experiment.parameters[f"{opening.joint}.servo.tau_max"].origin
        also = () if origin.place is None else (Label(origin.place, "the deck's"),)
        helps = (
            WEAKER,
            "a larger `torque_max` of `[drive]`, if drive and shaft bear it, or a smaller `tau_max` in the deck",
        )
        yield Diagnostic("E444", message, Label(bench.torque_at), also, helps, "warning")


def believed_torque(opening: Opening) -> float:
    """The largest torque that the law takes the bed's motor to give, N m of the bed's size."""
    return _value(opening, "servo.tau_max") / _value(opening, "bed.scale.torque", 1.0)


def torque_warning(who: str, own: float, believed: float) -> Diagnostic:
    """The warning that a drive's own largest torque is below that of the deck's motor, both N m. who: the drive in
    words"""
    message = f"the {who} gives {own:.4g} N*m at most by its own limits, and the motor of the deck {believed:g} N*m"
    helps = (WEAKER, "larger limits in the drive, if it and the shaft bear them, or a smaller `tau_max` in the deck")
    return Diagnostic("E444", message, help=helps, severity="warning")


@frozen
class BelievedLoop:
    """The rate loop that a deck takes for the drive's, as torques of the bed's size.

    gain       N m s/rad on the error;  integral: N m/rad on its integral
    back_emf   N m s/rad by which the motor brakes besides, which no loop over a current loop does
    """

    gain: float
    integral: float
    back_emf: float


def believed_loop(opening: Opening) -> BelievedLoop | None:
    """The loop of the servo in the case that is opened; None where the deck sends no rate."""
    if opening.drive != "rate":
        return None
    kt = _value(opening, "servo.kt")
    size = _value(opening, "bed.scale.rate", 1.0) / _value(opening, "bed.scale.torque", 1.0)
    stiff = kt / _value(opening, "servo.resistance") * size
    return BelievedLoop(stiff * _value(opening, "servo.kp"), stiff * _value(opening, "servo.ki"), stiff * kt)


def loop_warning(who: str, gain: float, integral: float, believed: BelievedLoop) -> Diagnostic | None:
    """A warning where the rate loop of a drive differs from the deck's.

    who  the drive in words;  gain: N m s/rad;  integral: N m/rad
    """
    near = abs(gain - believed.gain) <= RATE_LOOP_TOLERANCE * gain
    near &= abs(integral - believed.integral) <= RATE_LOOP_TOLERANCE * integral
    if near and believed.back_emf <= RATE_LOOP_TOLERANCE * gain:
        return None
    message = (
        f"the rate loop of the {who} has {gain:.4g} N*m*s/rad and {integral:.4g} N*m/rad, and the deck takes it for "
        f"one of {believed.gain:.4g} and {believed.integral:.4g}, with a back-EMF of {believed.back_emf:.4g} N*m*s/rad"
    )
    helps = (
        "the servo's `kp` and `ki` times kt/R are to be the drive's, and its R so large that kt^2/R is none",
        "what the drive does otherwise the law has to find: else a larger `drift`",
    )
    return Diagnostic("E444", message, help=helps, severity="warning")


def _value(opening: Opening, name: str, default: float | None = None) -> float:
    """A number of the joint in the opened case, SI; the default where there is none."""
    experiment, path = opening.simulated(), f"{opening.joint}.{name}"
    if path not in experiment.parameters and default is not None:
        return default
    value = experiment.parameters[path].value
    if isinstance(value, Formula):
        inputs = {coordinate.path: float(coordinate.values[opening.row]) for coordinate in experiment.cases.coordinates}
        value = experiment.formulas.replay(inputs)[value.output]
    assert isinstance(value, float | int)
    return float(value)
