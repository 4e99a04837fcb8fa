"""`met bed size`: the demands on the two motors of a bed for a joint, and the parts that meet them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile
from batch.beds.bed_size import BedSize, bed_size, joint_of
from batch.beds.chosen_bed import on_beds
from batch.beds.size_table import size_lines
from batch.beds.sizing import Extreme, MotorFigures, PartVerdict
from batch.campaigns.choosing import experiments_named, read_plan
from batch.queries.pool import groups_named
from batch.terminal.progress import Bar
from hw.motor_parts import parts_list
from met.diagnostic import Problem, error
from met.host.sources import names_archive
from met.messages import visible
from met.plan import Experiment, Plan


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
    try:
        return on_beds(plan, names or None)
    except Problem as problem:
        if problem.diagnostics[0].code != "E333":
            raise
        helps = ("a joint that is to be on one is named: `--joint NAME`", *problem.diagnostics[0].help)
        raise Problem(error("E333", "no joint is on a bed here", help=helps)) from None


def as_data(size: BedSize) -> dict[str, Any]:
    """The sizes for programs, SI."""
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
