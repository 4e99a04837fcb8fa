"""`met bed size`: the demands on the two motors of a bed for a joint, and the parts that meet them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from textwrap import wrap
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile
from batch.beds.bed_size import BedSize, bed_size, joint_of
from batch.beds.chosen_bed import on_beds
from batch.beds.sizing import UNITS, Extreme, MotorFigures, PartCheck, PartVerdict
from batch.campaigns.choosing import experiments_named, read_plan
from batch.queries.pool import groups_named
from batch.queries.stability_words import in_words
from batch.terminal.progress import Bar
from hw.motor_parts import parts_list
from ic.printing.columns import columns, count
from met.analysis.margin import remedy
from met.diagnostic import Problem, error
from met.host.sources import names_archive
from met.messages import visible
from met.plan import Experiment, Plan

WORDS = {
    "torque_rms": "torque, continuous",
    "torque_peak": "torque, peak",
    "rate": "rate",
    "power_mean": "power, continuous",
    "power_peak": "power, peak",
    "returned_peak": "returned, peak",
    "returned_energy": "returned in a case",
    "current_rms": "current, continuous",
    "current_peak": "current, peak",
    "voltage": "voltage",
}
WIDTH = 100
RPM = 30.0 / math.pi
ROLES = ("drive", "load")


def size_lines(size: BedSize, *, named: bool, curves: bool = False) -> Iterator[str]:
    """The demands of the cases on both motors of a motor bed, and the parts that fit, in lines. named: whether the
    parts were named;  curves: with the torque-speed curves."""
    figures, several = size.figures, size.experiment.varies
    duration = size.experiment.structure.schedule.duration
    yield (
        f"{size.experiment.name}: a bed for joint `{size.joint}`, {count(figures.cases, 'case')} of {duration:g} s, "
        f"{count(figures.instants, 'instant')} each"
    )
    for role, motor in zip(ROLES, (figures.drive, figures.load), strict=True):
        yield ""
        rows = [[f"{role} motor", "at most", f"order, x {size.margin:g}", "where"]]
        for name, extreme in motor.extremes.items():
            least = size.margin * extreme.value
            also = f" = {_digits(RPM * least)} rpm" if name == "rate" else ""
            unit = UNITS[name]
            rows.append(
                [WORDS[name], _with(extreme.value, unit), _with(least, unit) + also, _where(name, extreme, several)]
            )
        yield from columns(rows, right=(1,))
        if curves:
            yield from _curves(motor)
    yield ""
    yield from columns(list(_rest(size, several)))
    yield ""
    yield from _named(size, several) if named else _listed(size)
    yield ""
    for note in size.notes:
        yield from wrap(note, WIDTH, initial_indent="  ", subsequent_indent="    ")


def _curves(motor: MotorFigures) -> Iterator[str]:
    """The required torque at a rate or above, driving and braking."""
    rows = [["at or above", "driving", "braking"]]
    for rate, driving, braking in zip(motor.rates, *map(motor.envelope, ("driving", "braking")), strict=True):
        rows.append([_with(rate, "rad/s"), _with(driving, "N*m"), _with(braking, "N*m")])
    yield from columns(rows, right=(0, 1, 2), indent="    ")


def _rest(size: BedSize, several: bool) -> Iterator[Sequence[str]]:
    """Rows of figures that belong to both motors."""
    figures, own = size.figures, size.filter.own
    (light, heavy), (least, most) = figures.arm, figures.ratio
    yield (
        "arm at the shaft",
        f"{_with(light.value, 'kg*m^2')} ({_place(light, several)}) to {_with(heavy.value, 'kg*m^2')} "
        f"({_place(heavy, several)})",
    )
    yield "", f"r = {_digits(least.value)} to {_digits(most.value)} of the joint's rotor, {_span(figures.rotor)}"
    whose = "the deck's bed, both rotors" if size.in_deck else "the joint's rotor alone: a load's adds to it"
    yield "shaft", f"{_span(figures.shaft)}, {whose}"
    peak, energy = figures.both["returned_peak"], figures.both["returned_energy"]
    yield "returned", "on a supply each, what is said above, into its brake resistor or capacitors;"
    of_both = f"{_with(peak.value, 'W')}{_in(peak, several)}" if peak.value else "0 W"
    yield "", f"on one supply at most {of_both}, and {_with(energy.value, 'J')} in a case, less what windings take"
    bare, all_of_them = size.bauds
    yield "line", f"{size.exchanges.hz:,g} exchanges a second, for a servo of {size.exchanges.servo_hz:g} Hz:"
    yield "", f"at least {bare} baud, with all sensors {all_of_them}"
    bed = "the deck's bed" if size.in_deck else f"a bed by itself, delay = {own.delay:g}"
    yield "loop", f"{in_words(own)};"
    yield "", bed if own.stable else f"{bed}: NOT STABLE, {remedy(own)} may help"
    yield "filter", _filter(size)


def _filter(size: BedSize) -> str:
    """The cut-offs at which the loop is stable, in words."""
    tried, good = [f_cut for f_cut, _ in size.filter.tried], size.filter.good
    cut_off = f"{size.filter.f_cut:g} Hz here; " if math.isfinite(size.filter.f_cut) else ""
    ends = f"{_digits(tried[0])} to {_digits(tried[-1])} Hz"
    margin = f"with a margin of {size.margin:g} of r"
    if len(good) == len(tried):
        return f"{cut_off}stable {margin} at all of {ends}"
    if not good:
        return f"{cut_off}stable {margin} at none of {ends}"
    words = " to ".join(dict.fromkeys(_digits(end) for end in (good[0], good[-1]))) + " Hz"
    whole = good == tuple(tried[tried.index(good[0]) : tried.index(good[-1]) + 1])
    return f"{cut_off}stable {margin} at {words}{'' if whole else ', not all of them'}, of {ends} that were tried"


def _named(size: BedSize, several: bool) -> Iterator[str]:
    """The verdicts of named parts, check by check."""
    for verdict in size.verdicts:
        yield f"  {verdict.role} {verdict.part.name}: {_verdict(verdict)}"
        rows = [
            [
                check.what,
                _with(check.required, check.unit),
                "of",
                _with(check.has, check.unit),
                f"{100.0 * check.share:.0f} %",
                _in(check.extreme, several).removeprefix(", "),
            ]
            for check in sorted(verdict.checks, key=lambda check: -check.share)
        ]
        yield from columns(rows, right=(1, 3, 4), indent="    ")
        yield f"    source: {verdict.part.source}"
        yield from wrap(verdict.part.note, WIDTH, initial_indent="    ", subsequent_indent="    ")


def _listed(size: BedSize) -> Iterator[str]:
    """All parts by role, fitting ones first and the tightest of them before; then benches, both motors on a shaft."""
    rows = [["part", "", "fits", "what binds"]]
    for role in ROLES:
        of_role = [verdict for verdict in size.verdicts if verdict.role == role]
        for number, verdict in enumerate(sorted(of_role, key=lambda verdict: (not verdict.fits, _order(verdict)))):
            rows.append([role if number == 0 else "", verdict.part.name, _fits(verdict), _binding(verdict)])
    for name, two in size.benches.items():
        worst = max(two, key=lambda verdict: (not verdict.fits, _share(verdict)))
        names = " with ".join(dict.fromkeys(verdict.part.name for verdict in two))
        rows.append([f"bench {name}", names, _fits(worst), f"{worst.role}, {_binding(worst)}"])
    yield from columns(rows)


def _order(verdict: PartVerdict) -> float:
    return -_share(verdict) if verdict.fits else _share(verdict)


def _fits(verdict: PartVerdict) -> str:
    return {True: "yes", False: "NO", None: "?"}[verdict.fits]


def _binding(verdict: PartVerdict) -> str:
    """The figure that binds, or those that its source leaves out."""
    if verdict.fits is None or verdict.binds is None:
        return f"not given: {', '.join(verdict.missing)}"
    return _check(verdict.binds)


def _verdict(verdict: PartVerdict) -> str:
    """The verdict on a part in words, with the check that binds."""
    if verdict.fits is None:
        return f"not known, for its source does not give: {', '.join(verdict.missing)}"
    assert verdict.binds is not None
    return f"{'fits' if verdict.fits else 'DOES NOT FIT'}; what binds is {_check(verdict.binds)}"


def _share(verdict: PartVerdict) -> float:
    return 0.0 if verdict.binds is None else verdict.binds.share


def _check(check: PartCheck) -> str:
    """One check in words: `torque, peak: 0.3 of 1.1 N*m, 27 %`."""
    return f"{check.what}: {_digits(check.required)} of {_with(check.has, check.unit)}, {100.0 * check.share:.0f} %"


def _where(name: str, extreme: Extreme, several: bool) -> str:
    """The place of an extreme in words, `#3, 0.16 s, at 8.77 rad/s`: case, instant and operating point."""
    if extreme.value == 0.0:
        return "never"
    place = _place(extreme, several)
    if extreme.torque is None or extreme.rate is None:
        return place
    point = {
        "torque_peak": f"at {_with(abs(extreme.rate), 'rad/s')}",
        "current_peak": f"at {_with(abs(extreme.rate), 'rad/s')}",
        "rate": f"at {_with(abs(extreme.torque), 'N*m')}",
    }.get(name, f"at {_with(abs(extreme.torque), 'N*m')} and {_with(abs(extreme.rate), 'rad/s')}")
    return f"{place}, {point}"


def _place(extreme: Extreme, several: bool) -> str:
    case, time = f"#{extreme.case}" if several else "", "" if extreme.time is None else f"{extreme.time:.6g} s"
    return ", ".join(part for part in (case, time) if part)


def _in(extreme: Extreme, several: bool) -> str:
    place = _place(extreme, several)
    return f", {place}" if place else ""


def _span(ends: tuple[float, float]) -> str:
    low, high = (_digits(end) for end in ends)
    return f"{low} kg*m^2" if low == high else f"{low} to {high} kg*m^2"


def _digits(value: float) -> str:
    """Four digits; a number that is only rounding is 0."""
    return f"{0.0 if abs(value) < 1e-12 else value:.4g}"


def _with(value: float, unit: str) -> str:
    return f"{_digits(value)} {unit}"


def size_and_tell(
    source: str,
    names: tuple[str, ...],
    *,
    joint: str | None = None,
    margin: float = 1.5,
    drive: str | None = None,
    load: str | None = None,
    parts: str | None = None,
    form: str = "text",
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    settings: tuple[str, ...] = (),
    quiet: bool = False,
    verbose: bool = False,
) -> bool:
    """Print the sizes; True where every part that was named fits. Raises Problem."""
    say: Callable[[str], None] = (lambda _: None) if quiet else visible.say
    listed = parts_list(parts)
    named = {role: listed.motor(name) for role, name in (("drive", drive), ("load", load)) if name is not None}
    silent = quiet or form == "json"
    rows: dict[str, np.ndarray] = {}
    if names_archive(source):
        plan, rows = _of_archive(source, names)
    else:
        plan = read_plan(source, names, defines=defines, include_dirs=include_dirs, settings=settings, quiet=silent)
    experiments = experiments_named(plan, names or None) if joint is not None else _on_beds(plan, names)
    texts = {source.name: source.text for source in plan.sources}
    joints = [joint_of(experiment, joint, texts) for experiment in experiments]
    bar, sizes = None if silent else Bar(), []
    for experiment, joint_ in zip(experiments, joints, strict=True):
        wanted = rows.get(experiment.name)
        if bar is not None:
            bar.begin(experiment.name, experiment.cases.count if wanted is None else len(wanted))
        sizes.append(bed_size(experiment, joint_, margin, named, listed, wanted, None if bar is None else bar.advance))
        if bar is not None:
            bar.end()
    if form == "json":
        visible.say(json.dumps([as_data(size) for size in sizes], indent=1))
    else:
        say("\n\n".join("\n".join(size_lines(size, named=bool(named), curves=verbose)) for size in sizes))
    return not named or all(verdict.fits for size in sizes for verdict in size.verdicts)


def _of_archive(source: str, names: Sequence[str]) -> tuple[Plan, dict[str, np.ndarray]]:
    """The plan in an archive, with the runs that it holds, and the rows of each that it has cases of."""
    with ArchiveFile(source) as file:
        plan, groups = file.plan(), groups_named(file, names)
        cases = {experiment.name: experiment.cases.table for experiment in plan.experiments}
        return plan, {group.name: np.searchsorted(cases[group.name], group.values("case")) for group in groups}


def _on_beds(plan: Plan, names: Sequence[str]) -> Sequence[Experiment]:
    """The experiments with motors on beds. Raises Problem E333, which names `--joint`, where there is none."""
    try:
        return on_beds(plan, names or None)
    except Problem as problem:
        if problem.diagnostics[0].code != "E333":
            raise
        helps = ("a joint that is to be on one is named: `--joint NAME`", *problem.diagnostics[0].help)
        raise Problem(error("E333", "no joint is on a bed here", help=helps)) from None


def as_data(size: BedSize) -> dict[str, Any]:
    """The result of `met bed size` for JSON, SI: what the cases ask of both motors of the bed, and the parts that
    fit."""
    figures = size.figures
    own = size.filter.own
    return {
        "experiment": size.experiment.name,
        "joint": size.joint,
        "in_deck": size.in_deck,
        "margin": size.margin,
        "cases": figures.cases,
        "instants": figures.instants,
        "failed": figures.failed,
        "limited": figures.limited,
        "at_largest_torque": figures.at_most,
        **{
            role: {"figures": _figures(motor.extremes, size.margin), "curve": _curve(motor)}
            for role, motor in (("drive", figures.drive), ("load", figures.load))
        },
        "both": _figures(figures.both, size.margin),
        "arm_inertia": [_extreme(extreme) for extreme in figures.arm],
        "r": [_extreme(extreme) for extreme in figures.ratio],
        "rotor_inertia": list(figures.rotor),
        "shaft_inertia": list(figures.shaft),
        "exchanges_hz": size.exchanges.hz,
        "servo_hz": size.exchanges.servo_hz,
        "least_baud": size.bauds[0],
        "least_baud_all_sensors": size.bauds[1],
        "loop": {
            "law": own.law,
            "bed": own.bed,
            "delay": own.delay,
            "f_cut": size.filter.f_cut if math.isfinite(size.filter.f_cut) else None,
            "stable": own.stable,
            "margin": own.factor,
            "filters": [{"f_cut": f_cut, "stable": stable} for f_cut, stable in size.filter.tried],
        },
        "parts": [_verdict_as_data(verdict) for verdict in size.verdicts],
        "benches": {name: [_verdict_as_data(verdict) for verdict in two] for name, two in size.benches.items()},
        "notes": list(size.notes),
    }


def _verdict_as_data(verdict: PartVerdict) -> dict[str, Any]:
    """The verdict on a motor for a bed, for JSON, SI: the demand of each check beside the part's own figure, and the
    check that binds."""
    binds = verdict.binds
    return {
        "role": verdict.role,
        "part": verdict.part.name,
        "source": verdict.part.source,
        "fits": verdict.fits,
        "binds": None if binds is None else binds.what,
        "missing": list(verdict.missing),
        "checks": [
            {
                "what": check.what,
                "unit": check.unit,
                "asked": check.required,
                "has": check.has,
                "share": check.share,
                "case": check.extreme.case,
                **({} if check.extreme.time is None else {"time": check.extreme.time}),
            }
            for check in verdict.checks
        ],
    }


def _figures(figures: Mapping[str, Extreme], margin: float) -> dict[str, Any]:
    return {name: {**_extreme(extreme), "order": margin * extreme.value} for name, extreme in figures.items()}


def _extreme(extreme: Extreme) -> dict[str, Any]:
    """An extreme as data, without empty fields."""
    return {name: value for name, value in asdict(extreme).items() if value is not None}


def _curve(motor: MotorFigures) -> dict[str, list[float]]:
    return {"rate": motor.rates, **{name: motor.envelope(name) for name in ("driving", "braking")}}
