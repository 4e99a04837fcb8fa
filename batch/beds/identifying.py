"""`met bed identify`: a bed's parameters from guided moves, with their uncertainty, as a deck to include."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from batch.beds.chosen_bed import chosen_bed
from hw.bed import About, Capability, Limits, Scales
from hw.driving.process import talk
from hw.identify.driving import MovesRequest
from ic.printing.columns import columns
from met import models
from met.analysis.shaft_work import of_cases, scale_of
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host.files import new_file
from met.host.streams import kept
from met.messages import visible
from met.outputs import check_place
from met.plan import Experiment, Formula, Plan, Substitution
from met.plan import file as plan_file
from met.plant import bed_values
from met.substitution.bed_scale import BedScale
from met.unit_parser import written

if TYPE_CHECKING:
    from hw.identify.fit import Estimate, FitResult

UNITS = {
    "kt": "N*m/A",
    "resistance": "ohm",
    "tau_max": "N*m",
    "f_c": "N*m",
    "f_v": "N*m*s/rad",
    "inertia": "kg*m^2",
    "kt_load": "N*m/A",
    "f_cut": "Hz",
}
"""The parameters that are found or given, with their units, in the order of the table."""

OF_SERVO = {"kt": "kt", "resistance": "resistance", "tau_max": "tau_max", "f_c": "f_c", "f_v": "f_v", "inertia": "j_m"}
"""The servo's parameter that is the data sheet's value of each of these parameters."""

MEASURED_BY = ("resistance", "tau_max", "f_c", "f_v", "inertia")
"""The parameters that share the relative error of a given torque constant of the load motor: all torques are measured
by it."""

UNEXPLAINED = 0.1
"""Largest share of the measured rate, rms, that may be left unexplained. With more, the bed does not match the
model."""


@frozen
class DataSheet:
    """The parameters that are assumed before a bed is identified.

    values       SI, by the names of `UNITS`, and `v_max`, V, where the servo has it
    has_kt_load  True where `kt_load` is given by the deck or by the user, and is no default
    """

    values: Mapping[str, float]
    has_kt_load: bool


def sheet_of(experiment: Experiment, joint: str, kt_load: float | None) -> DataSheet:
    """The data sheet of a joint's motor in the first case: the servo's motor, over the scales of the bed where it has
    some, and the bed's other parameters."""
    inputs = {coordinate.path: float(coordinate.values[0]) for coordinate in experiment.cases.coordinates}
    outputs = experiment.formulas.replay(inputs)

    def servo(name: str) -> float:
        value = experiment.parameters[f"{joint}.servo.{name}"].value
        return float(outputs[value.output] if isinstance(value, Formula) else value)  # type: ignore[arg-type]

    bed, scale = bed_values(experiment, joint), _scale_of(experiment, joint)
    values = {name: float(servo(own) / scale.of(UNITS[name])) for name, own in OF_SERVO.items()}
    values |= {"kt_load": bed["kt_load"] if kt_load is None else kt_load, "f_cut": bed["f_cut"]}
    if f"{joint}.servo.v_max" in experiment.parameters:
        values["v_max"] = float(servo("v_max") / scale.voltage)
    origin = experiment.parameters[f"{joint}.bed.kt_load"].origin
    return DataSheet(values, kt_load is not None or origin.place is not None)


def identify_and_tell(
    word: str,
    source: str,
    names: tuple[str, ...],
    *,
    baud: int,
    lock_step: bool,
    kt_load: float | None,
    kt_load_error: float,
    voltage: float | None,
    current: float | None,
    rate: float | None,
    output: str | None,
    form: str,
    quiet: bool = False,
    verbose: bool = False,
    **options: Any,
) -> None:
    """Run `met bed identify`. Raises Problem."""
    say: Callable[[str], None] = (lambda _: None) if quiet or form == "json" else visible.say
    which = chosen_bed(word, source, names, quiet=quiet, **options)
    assert which.experiment is not None
    sheet = sheet_of(which.experiment, which.joint, kt_load)
    deck = Path(output or f"{which.joint}.identified.ic")
    records = deck.parent / f"{deck.stem}.records"
    _check_output(deck, records)
    _check_sheet(sheet, which.joint)
    if which.simulated is None and not sheet.has_kt_load:
        message = f"joint `{which.joint}`: the load motor's constant, by which torques are measured, is nowhere said"
        helps = "`--kt-load '0.072 N*m/A'`, from its data sheet; or `bed = emulated(kt_load = ..., ...)` in the deck"
        raise Problem(error("E424", message, help=helps))
    request = MovesRequest(
        plan=plan_file.dumps(Plan("", (which.experiment,))),
        row=0,
        joint=which.joint,
        port=which.port,
        records=str(records),
        sheet=dict(sheet.values),
        baud=baud,
        lock_step=lock_step,
        voltage=voltage,
        current=current,
        rate=rate,
    )
    records.unlink(missing_ok=True)  # of an attempt that found nothing: there is no deck
    about, ended = _driven(request, say)
    fit = _fitted(records, about, ended, sheet)
    check(fit, about)
    estimates = widened(fit.parameters, kt_load_error / 100.0)
    origin = origin_of(about, ended, estimates)
    with new_file(deck) as file:
        file.write(included(deck, which.experiment, which.joint, estimates, origin).encode())
    with kept(f"{deck} is whole"):
        if form == "json":
            visible.say(json.dumps(as_data(fit, estimates, sheet, deck, records), indent=2))
            return
        for line in table_lines(fit, estimates, sheet):
            say(line)
        say(f"{deck} is a deck to include; what was told and read is in {records}")


def _check_sheet(sheet: DataSheet, joint: str) -> None:
    """Raise Problem E424 where a parameter of the data sheet is not a number above 0, so that the search cannot
    begin."""
    for name, unit in UNITS.items():
        if not 0.0 < sheet.values[name] < math.inf:
            message = f"joint `{joint}`: the search cannot begin at {name} = {sheet.values[name]:g} {unit}"
            raise Problem(error("E424", message, help="write in the deck what it is about; it may be off by 30 %"))


def _check_output(deck: Path, records: Path) -> None:
    """Raise Problem E305 where the deck cannot be written or exists already, or where the records would replace
    something that is not a regular file."""
    check_place(deck, code="E305", inside=deck / "identified.ic")
    wrong, helps = "", "give another name with `-o`"
    if deck.suffix != ".ic":
        wrong, helps = f"cannot write {deck}: it is to be a deck, which ends in .ic", f"`-o {deck.with_suffix('.ic')}`"
    elif os.path.lexists(deck):
        wrong, helps = f"{deck} is there already: it is not written over", f"{helps}, or remove it"
    elif os.path.lexists(records) and (records.is_symlink() or not records.is_file()):
        wrong = f"cannot write {records}: it is not a regular file"
    if wrong:
        raise Problem(error("E305", wrong, help=helps))


def check(fit: FitResult, about: About) -> None:
    """Raise Problem E423 where the bed does not behave like the model."""
    left = float((fit.residual**2).mean() ** 0.5)
    worst = int(fit.residual.argmax())
    if not fit.settled:
        message = f"bed `{about.name}`: no parameters were settled on in the time that the search is given"
        raise Problem(error("E423", message, help="begin nearer: the servo's motor in the deck is where it begins"))
    if not left < UNEXPLAINED * fit.rate:
        message = (
            f"bed `{about.name}` does not do what a motor bed does: {left:.3g} of {fit.rate:.3g} rad/s, rms, "
            f"are left unexplained, most in move {worst + 1}"
        )
        helps = (
            "look whether voltage, current and rate have their signs and scales, and whether the servo's motor in "
            "the deck is the one on the bed"
        )
        raise Problem(error("E423", message, help=helps))


def widened(parameters: Mapping[str, Estimate], kt_load_error: float) -> dict[str, Estimate]:
    """The estimates, with the error of a given torque constant added to their intervals. kt_load_error: half of its own
    95 % interval, as a share"""
    from hw.identify.fit import Estimate

    if parameters["kt_load"].is_fitted or not kt_load_error:
        return dict(parameters)
    out = {}
    for name, estimate in parameters.items():
        half = math.log(estimate.high / estimate.value)
        if (estimate.is_fitted and name in MEASURED_BY) or name == "kt_load":
            half = math.hypot(half, math.log1p(kt_load_error))
        out[name] = Estimate(
            estimate.value, estimate.value * math.exp(-half), estimate.value * math.exp(half), estimate.is_fitted
        )
    return out


def table_lines(fit: FitResult, estimates: Mapping[str, Estimate], sheet: DataSheet) -> list[str]:
    """The lines of the result for people."""
    rows = [["", "found", "95 % interval", "", "data sheet", "off by"]]
    for name, unit in UNITS.items():
        estimate, believed = estimates[name], sheet.values[name]
        share = f"{100.0 * math.log(estimate.high / estimate.value):.2g} %"
        off = "given"
        if estimate.is_fitted:
            off = f"{math.log(estimate.value / believed) / math.log(estimate.high / estimate.value):+.3g}"
        interval = (
            f"{digits(estimate, estimate.low)} to {digits(estimate, estimate.high)}"
            if estimate.high > estimate.low
            else ""
        )
        rows.append(
            [
                name,
                f"{digits(estimate, estimate.value)} {unit}",
                interval,
                share if interval else "",
                f"{believed:.6g}",
                off,
            ]
        )
    left = float((fit.residual**2).mean() ** 0.5)
    out = columns(rows, right=(3, 4, 5))
    out.append("`off by`: found less the data sheet's, in halves of the interval")
    out += [f"given, not found: {reason}" for reason in reasons(fit)]
    out.append(
        f"left unexplained: {left:.3g} of {fit.rate:.3g} rad/s, rms; misalignment {fit.ripple[0]:.2g} N m once a "
        f"turn and {fit.ripple[1]:.2g} N m twice, rms; at its largest torque {fit.limited:.0%} of the time"
    )
    return out


def reasons(fit: FitResult) -> Iterator[str]:
    """The reasons, in words, why parameters were not found."""
    missing = [name for name, estimate in fit.parameters.items() if not estimate.is_fitted]
    if "kt_load" in missing:
        yield (
            "kt_load, by which torques are measured, for the bed does not measure its drive's current; kt, "
            "found as back-EMF, does not depend on it"
        )
    rest = [name for name in missing if name != "kt_load"]
    if rest:
        yield (
            f"{' and '.join(rest)}, which the moves do not tell: the drive was at its largest torque "
            f"{fit.limited:.0%} of the time (`--voltage` more); what is found holds for what is "
            "given"
        )


def digits(estimate: Estimate, value: float) -> str:
    """A number to two digits of half its interval; to six digits where it was given."""
    half = estimate.high - estimate.value
    if half <= 0.0:
        return f"{value:.6g}"
    after = max(1, math.floor(math.log10(estimate.value)) - math.floor(math.log10(half)) + 2)
    return f"{value:#.{after}g}".removesuffix(".")


def origin_of(about: About, ended: Mapping[str, Any], estimates: Mapping[str, Estimate]) -> list[str]:
    """The comment at the head of the deck about the source of its numbers."""
    reference = (
        "drive current as the bed measures it"
        if estimates["kt_load"].is_fitted
        else (f"the load motor's {digits(estimates['kt_load'], estimates['kt_load'].value)} N m/A, which was given")
    )
    return [
        f"Found by `met bed identify` on bed `{about.name}`, firmware {about.firmware}, in {len(ended['began'])} moves",
        f"of {ended['seconds']:.3g} s altogether, with the 95 % interval of each. Torques are measured by",
        f"{reference}.",
    ]


def included(
    deck: Path, experiment: Experiment, joint: str, estimates: Mapping[str, Estimate], origin: Sequence[str]
) -> str:
    """The text of the deck to include, formatted as `met fmt` does."""
    from ic.formatting.formatter import formatted

    head = re.sub(r"\W", "_", joint)
    use = experiment.structure.on_beds[joint]
    [servo] = (servo for servo in experiment.structure.servos if servo.joint == joint)
    bed = [*(f"{name} = {head}_{name}" for name in UNITS), *_believed(experiment, use)]
    scale = _scale_of(experiment, joint)
    times = {name: "" if (by := scale.of(UNITS[name])) == 1.0 else f" * {by:.12g}" for name in OF_SERVO}
    scales = f"torque = {scale.torque:.12g};  rate = {scale.rate:.12g};  voltage = {scale.voltage:.12g};"
    motor = (f"{own} = {head}_{name}{times[name]}; " for name, own in OF_SERVO.items())
    uses = (
        [
            f"substitute {joint} {{",
            f"    bed = {use.bed}(",
            *_packed([f"{argument}," for argument in bed[:-1]] + bed[-1:], 8),
            "    );",
            f"    law = {use.law};",
            *([f"    scale {{ {scales} }}"] if use.scaled else []),
            "}",
        ],
        [f"servo found like {servo.definition} {{", *_packed(motor, 4), "}"],
    )
    lines = [
        "#pragma once",
        f"// {deck.name}: the motor bed of joint {joint}",
        "//",
        *(f"// {line}" for line in origin),
        "//",
        "// The bed in a run, and its motor in a servo that is like another:",
        "//",
        *(f"//     {line}" for use in uses for line in use),
        "",
    ]
    wide = max(map(len, UNITS))
    for name, unit in UNITS.items():
        estimate = estimates[name]
        remark = (
            f"{digits(estimate, estimate.low)} to {digits(estimate, estimate.high)}"
            if estimate.high > estimate.low
            else ""
        )
        if not estimate.is_fitted:
            remark = f"given, not found; {remark}".removesuffix("; ")
        assigned = f"{digits(estimate, estimate.value)} {unit};"
        lines.append(f"let {head}_{name:<{wide}} = {assigned:<26} // {remark}")
    return formatted(str(deck), "\n".join(lines) + "\n")


def _scale_of(experiment: Experiment, joint: str) -> BedScale:
    """The scales of a joint's bed in the first case."""
    scale = scale_of(experiment, joint, np.array([0]))
    return BedScale(*(float(of_cases(quantity)[0]) for quantity in (scale.torque, scale.rate, scale.voltage)))


def _believed(experiment: Experiment, use: Substitution) -> list[str]:
    """The other parameters of the bed that the deck writes."""
    quantities = {
        path.rpartition(".")[2]: quantity
        for path, quantity in experiment.parameters.items()
        if path.startswith(f"{use.joint}.bed.") and ".scale." not in path and quantity.origin.kind == "deck"
    }
    own = [
        f"{name} = {written(quantity.value, quantity.unit)}"
        for name, quantity in quantities.items()
        if name not in UNITS and not quantity.origin.note and isinstance(quantity.value, float)
    ]
    faults = [
        f"faults = {word}"
        for word, values in models.find("bed", use.bed).presets.items()
        if values and all(name in quantities and quantities[name].origin.note for name in values)
    ]
    return own + faults


def _packed(words: Iterable[str], indent: int) -> list[str]:
    """Words joined into lines, without breaking one."""
    lines = [" " * indent]
    for word in words:
        if len(lines[-1]) + len(word) > 105:
            lines.append(" " * indent)
        lines[-1] += f"{word} "
    return [line.rstrip() for line in lines]


def as_data(
    fit: FitResult, estimates: Mapping[str, Estimate], sheet: DataSheet, deck: Path, records: Path
) -> dict[str, Any]:
    """The result of `met bed identify` for JSON, SI: estimated parameters with their intervals beside the data
    sheet's."""
    return {
        "deck": str(deck),
        "records": str(records),
        "parameters": {
            name: {
                "value": estimate.value,
                "low": estimate.low,
                "high": estimate.high,
                "found": estimate.is_fitted,
                "unit": UNITS[name],
                "data_sheet": sheet.values[name],
            }
            for name in UNITS
            for estimate in [estimates[name]]
        },
        "residual": float((fit.residual**2).mean() ** 0.5),
        "rate": fit.rate,
        "misalignment": list(fit.ripple),
        "limited": fit.limited,
    }


def _driven(request: MovesRequest, say: Callable[[str], None]) -> tuple[About, dict[str, Any]]:
    """Lead the bed through the moves. Returns its description and the record of the moves. Raises Problem, and
    KeyboardInterrupt once the bed is stopped."""
    about: About | None = None
    record = dict[str, Any]()
    for line in talk("hw.identify.driving", request, lambda words: say(f"  {words}"), until="ended"):
        if "about" in line:
            about, most = _about(line["about"]), line["peaks"]
            say(
                f"bed `{about.name}`, firmware {about.firmware}: moves up to {most['voltage']:.3g} V, "
                f"{most['current']:.3g} A and {most['rate']:.3g} rad/s, a minute or so"
            )
        record = line.get("ended", record)
    assert about is not None
    return about, record


def _about(data: Mapping[str, Any]) -> About:
    """A bed's description from JSON."""
    return About(
        **{
            **data,
            "capabilities": Capability(data["capabilities"]),
            "scales": Scales(**data["scales"]),
            "limits": Limits(**data["limits"]),
        }
    )


def _fitted(path: Path, about: About, ended: Mapping[str, Any], sheet: DataSheet) -> FitResult:
    """The parameters of a bed, fitted to the records of its moves. ended: what the moves' process said at its end.
    Raises Problem E413 for records that cannot be read."""
    from hw.identify.fit import fitted
    from hw.identify.moves import groups, guided
    from hw.identify.series import series
    from hw.recording import records

    try:
        rows = records.read(path).rows
    except (records.UnsoundRecords, OSError) as reason:
        raise Problem(error("E413", f"the records of the moves {reason}", help="run it again")) from None
    what = series(rows, about, ended["began"], lock_step=ended["lock_step"])
    return fitted(what, groups(guided(1.0)), sheet.values)
