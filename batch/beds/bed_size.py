"""The sizes of a bed for one joint of an experiment: its motors' figures, line, filter, and verdicts of parts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from batch.beds.sizing import BedFigures, Candidate, MotorFigures, PartVerdict, gather, judge_part
from hw.bed import Capability
from hw.beds.serial_line import least_baud
from hw.driving.pace import Pace, pace
from hw.motor_parts import Bench, MotorPart, PartsList
from met.analysis.margin import Margin, margins
from met.analysis.shaft_work import not_for_a_bed, on_bed, servo_of, shaft_work
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen
from met.plan import Experiment, Origin, Quantity
from met.plan.columns import row_at

TRIED = 9
"""Number of cut-offs that are tried, spaced geometrically from a hundredth of the servo's rate to half of it."""


@frozen
class FilterRange:
    """The loop with the bed's own filter, and with others.

    own      the tightest margin with the bed's filter, held against the arms of the run;  f_cut: the filter's, Hz
    tried    cut-offs, Hz, and whether the loop is stable there with the margin that was asked
    """

    own: Margin
    f_cut: float
    tried: tuple[tuple[float, bool], ...]

    @property
    def good(self) -> tuple[float, ...]:
        return tuple(f_cut for f_cut, stable in self.tried if stable)


def filter_range(
    experiment: Experiment, joint: str, rows: Sequence[int], ratio: tuple[float, float], margin: float
) -> FilterRange:
    """The filters of the rate with which a joint's motor bed is stable.

    rows   cases to examine
    ratio  smallest and largest r (arm's inertia against the rotor's) over a run; if other joints are on beds too, r is
           that of all their motions at the start instead
    """
    alone = len(experiment.structure.substitutions) == 1
    path = f"{joint}.bed.f_cut"

    def tightest(variant: Experiment) -> Margin:
        """The margin of the joint in the case in which the arm is nearest to the stability limit."""
        cases = margins(variant, rows, span=ratio if alone else None, reach=margin)
        return min(
            (margin for case in cases for margin in case if margin.joint == joint), key=lambda margin: margin.room
        )

    own = tightest(experiment)
    value = experiment.parameters[path].value
    tried = []
    for f_cut in np.geomspace(0.01 * own.rate_hz, 0.5 * own.rate_hz, TRIED).tolist():
        parameters = {**experiment.parameters, path: Quantity(f_cut, "Hz", Origin("default"))}
        tightest_margin = tightest(replace(experiment, parameters=parameters))
        tried.append((f_cut, tightest_margin.stable and tightest_margin.room >= margin))
    return FilterRange(own, float(value) if isinstance(value, float | int) else float("nan"), tuple(tried))


ALL_SENSORS = Capability.ENCODER | Capability.DRIVE_CURRENT | Capability.ACCELEROMETER


@frozen
class BedSize:
    """The sizes of a bed for one joint of an experiment.

    experiment  as the deck has it;  bedded: the same with the joint on a bed, which is the deck's where it has one
    margin      the factor by which more is ordered than is asked
    verdicts    of the parts that were named; without, of all, and benches: of each both motors on one shaft
    notes       what is not in the figures, and what makes them doubtful
    """

    experiment: Experiment
    bedded: Experiment
    joint: str
    margin: float
    figures: BedFigures
    exchanges: Pace
    filter: FilterRange
    verdicts: tuple[PartVerdict, ...]
    benches: Mapping[str, tuple[PartVerdict, PartVerdict]]
    notes: tuple[str, ...]

    @property
    def in_deck(self) -> bool:
        """True where the deck has the joint on a bed."""
        return self.bedded is self.experiment

    @property
    def bauds(self) -> tuple[int, int]:
        """The lowest baud rates of a serial line: with the tachometer alone, and with all sensors of the wire's
        protocol."""
        return least_baud(Capability(0), self.exchanges.period), least_baud(ALL_SENSORS, self.exchanges.period)


def joint_of(experiment: Experiment, name: str | None, texts: Mapping[str, str] | None = None) -> str:
    """The joint of a bed: the named one, else the only one on a bed. Raises Problem E440.

    texts  of the deck's files, by name, to show a line of
    """
    on = [use.joint for use in experiment.structure.substitutions]
    if name is None:
        if len(on) > 1:
            which = "one at a time: " + " or ".join(f"`--joint {joint_name}`" for joint_name in on)
            raise Problem(error("E440", f"`{experiment.name}` has {len(on)} joints on beds: which?", help=which))
        return on[0]
    servos = [use.joint for use in experiment.structure.servos]
    use = servo_of(experiment, name)
    if use is None:
        in_experiment = any(joint.name == name for joint in experiment.structure.joints)
        message = f"joint `{name}` of `{experiment.name}` has no servo" if in_experiment else f"no joint `{name}`"
        helps = (
            *(() if in_experiment else did_you_mean(name, servos)),
            f"joints that have a servo: {', '.join(servos)}",
        )
        raise Problem(error("E440", message, help=helps))
    wrong = not_for_a_bed(experiment, use)
    if wrong is not None:
        message = f"the servo of joint `{name}` {wrong[0]}"
        raise Problem(error("E440", message, use.place, help=wrong[1]), texts)
    return name


def bed_size(
    experiment: Experiment,
    joint: str,
    margin: float,
    named: Mapping[str, MotorPart],
    listed: PartsList,
    rows: np.ndarray | None = None,
    progress: Callable[[int], None] | None = None,
) -> BedSize:
    """The demands of all cases, or of those of some rows of the case table, on the two motors of a joint's motor bed.
    Raises Problem.

    named     parts by `drive` and `load`; none: all that are listed
    progress  called with the number of cases done so far
    """
    use = servo_of(experiment, joint)
    assert use is not None
    exchanges = pace(experiment.structure.schedule.base_hz / use.divisor)
    candidates = _candidates(named, listed)
    benches = {} if named else {name: _bench(bench, listed) for name, bench in listed.benches.items()}
    everyone = [*candidates, *(candidate for two in benches.values() for candidate in two)]
    figures = gather(shaft_work(experiment, joint, rows, progress), everyone)
    if figures is None:
        message = f"no case of `{experiment.name}` came to its first instant: there is nothing to size a bed by"
        raise Problem(error("E443", message, help="`met run` says why its cases fail"))
    bedded = on_bed(experiment, joint, delay=exchanges.late(False))
    lightest, heaviest = figures.ratio
    ends = sorted({row_at(experiment.cases.table, extreme.case) or 0 for extreme in figures.ratio})
    return BedSize(
        experiment=experiment,
        bedded=bedded,
        joint=joint,
        margin=margin,
        figures=figures,
        exchanges=exchanges,
        filter=filter_range(bedded, joint, ends, (lightest.value, heaviest.value), margin),
        verdicts=tuple(judge_part(candidate, margin) for candidate in candidates),
        benches={name: (judge_part(a, margin), judge_part(b, margin)) for name, (a, b) in benches.items()},
        notes=tuple(_notes(experiment, joint, figures, candidates)),
    )


def _candidates(named: Mapping[str, MotorPart], listed: PartsList) -> list[Candidate]:
    """The candidate parts: the named ones, else all, each as drive and as load."""
    if not named:
        return [Candidate(role, MotorFigures(motor)) for role in ("drive", "load") for motor in listed.motors.values()]
    beside = named["drive"].figure("inertia") if "drive" in named else None
    return [Candidate(role, MotorFigures(part), beside) for role, part in named.items()]


def _bench(bench: Bench, listed: PartsList) -> tuple[Candidate, Candidate]:
    drive, load = listed.motor(bench.drive), listed.motor(bench.load)
    return Candidate("drive", MotorFigures(drive)), Candidate("load", MotorFigures(load), drive.figure("inertia"))


def _notes(experiment: Experiment, joint: str, figures: BedFigures, candidates: Sequence[Candidate]) -> Iterator[str]:
    """Sentences on what the sizing of a motor bed leaves out, and on cases in which a motor was at its limit."""
    use, schedule = servo_of(experiment, joint), experiment.structure.schedule
    assert use is not None
    yield "all of it is simulated: no real bed has been driven with this version"
    on = experiment.structure.on_beds.get(joint)
    scaled = on is not None and on.scaled
    if on is not None:
        yield "friction, noise and converters of the bed are in the figures as far as the deck's bed has them"
        if scaled:
            yield "the bed is scaled: all figures are of its own motors, and arm and rotor as these feel them"
    else:
        yield "friction, noise and converters of a bed are not in the figures: in the deck this joint is on none"
        if use.divisor < schedule.dynamics:
            times = schedule.dynamics // use.divisor
            yield f"the servo ticks {times} times a step of the dynamics, and one of them alone is seen"
    yield "a part's rotor is on the shaft with it; a coupling and a brake are not"
    if any(candidate.role == "drive" for candidate in candidates):
        whose = "bed" if scaled else "servo"
        yield f"a drive of other constants moves the joint otherwise: write its own into the {whose}, and ask again"
    if any(candidate.part.figure("resistance") for candidate in candidates):
        yield "voltages of parts are of resistance and back-EMF, without inductance and what heat does to both"
    if figures.at_most:
        yield (
            f"the drive motor was at the largest torque of the deck's motor in {figures.at_most} of {figures.cases} "
            "cases: a stronger one would have moved the joint otherwise"
        )
    if figures.limited:
        yield (
            f"the load's amplifier was at its limit in {figures.limited} of {figures.cases} cases, whose motion is "
            "then not that of a load that is strong enough: raise `i_max` in the deck, and ask again"
        )
    if figures.failed:
        yield f"{figures.failed} of {figures.cases} cases did not reach their end: what they had until then counts"
