"""The figures of `met bed size`: the demands on a bed's two motors over all cases of a run, and the parts that meet
them.

Torques are on the shaft. A figure is the largest of all cases, with its case and instant. Only instants are examined,
not the time between them. A mean or an energy is of one case, from its begin to its end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from hw.motor_parts import MotorPart
from met.analysis.shaft_work import ShaftWork
from met.frozen import frozen

UNITS: Mapping[str, str] = {
    "torque_rms": "N*m",
    "heat": "N*m",
    "torque_peak": "N*m",
    "rate": "rad/s",
    "power_mean": "W",
    "power_peak": "W",
    "returned_peak": "W",
    "returned_energy": "J",
    "current_rms": "A",
    "current_peak": "A",
    "voltage": "V",
}
"""Figures of a motor and their units, SI. heat: the constant torque that heats the winding as much as the case does at
its hottest, when the case is run again and again"""

ROUNDING = 1e-9
"""Relative difference below which two values of a figure count as equal."""

ENVELOPE = 12
"""Number of rates of the torque-speed curve, evenly spaced up to the largest."""


@frozen
class Extreme:
    """The largest value of a figure over all cases, SI.

    case  position of the case;  time: s, None of a figure of a whole case
    torque, rate  of the motor at that instant, N m, rad/s; None likewise
    """

    value: float
    case: int
    time: float | None = None
    torque: float | None = None
    rate: float | None = None


class Largest:
    """The largest values so far, by name, updated block by block."""

    def __init__(self) -> None:
        self.extremes: dict[str, Extreme] = {}

    def of_cases(self, name: str, values: np.ndarray, work: ShaftWork) -> None:
        """Take the values of cases. values: [case]"""
        if np.isfinite(values).any():
            row = int(np.nanargmax(values))
            self._keep(name, Extreme(float(values[row]), int(work.case[row])))

    def of_instants(self, name: str, values: np.ndarray, work: ShaftWork, torque: np.ndarray | None = None) -> None:
        """Take the values at instants. values: [case, instant]; torque: of the motor, which is reported with them"""
        if not np.isfinite(values).any():
            return
        most = float(np.nanmax(values))
        # the first instant with the value but for rounding, so that a constant rate is reported where it is reached
        row, k = np.unravel_index(int(np.argmax(values >= most - ROUNDING * abs(most))), values.shape)
        point = () if torque is None else (float(torque[row, k]), float(work.rate[row, k]))
        self._keep(name, Extreme(most, int(work.case[row]), float(work.time[k]), *point))

    def _keep(self, name: str, extreme: Extreme) -> None:
        """Keep an extreme where it is the largest so far, but for rounding."""
        if name not in self.extremes or extreme.value > self.extremes[name].value + ROUNDING * abs(
            self.extremes[name].value
        ):
            self.extremes[name] = extreme


def over_case(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """The integral over each case by trapezoids, up to its end, [case]. values: [case, instant]"""
    pieces = 0.5 * (values[:, 1:] + values[:, :-1]) * np.diff(time)
    return np.asarray(np.nansum(pieces, 1))


def root_mean_square(values: np.ndarray) -> np.ndarray:
    """The root of the mean square over a case's instants, as in the metric `rms`, [case]."""
    count = np.isfinite(values).sum(1)
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.nansum(values * values, 1) / np.where(count, count, np.nan))


def hottest(torque: np.ndarray, time: np.ndarray, constant: float) -> np.ndarray:
    """The steady torque that heats a winding as much as each case at its hottest, [case].

    Heat goes with the square of the torque, and the winding follows it as a low-pass of order 1 with its thermal time
    constant (s). The case is run again and again, so it begins as warm as it ends.
    """
    from scipy.signal import lfilter

    if len(time) < 2:
        return np.abs(torque).max(1)
    step, squares = float(time[1] - time[0]), np.nan_to_num(torque[:, :-1] ** 2)
    share = -math.expm1(-step / constant)
    course = lfilter([share], [1.0, share - 1.0], squares, axis=1)
    after = step * np.arange(1, squares.shape[1] + 1) / constant
    begin = course[:, -1] / -math.expm1(-after[-1])
    return np.asarray(np.sqrt((course + begin[:, None] * np.exp(-after)).max(1)))


class MotorFigures:
    """The figures of one motor, collected block by block: of the deck's motor, or of a part in its place."""

    def __init__(self, part: MotorPart | None = None) -> None:
        self.part, self.largest = part, Largest()
        self._corners = {"driving": np.zeros((0, 2)), "braking": np.zeros((0, 2))}

    @property
    def extremes(self) -> dict[str, Extreme]:
        """The known figures by the names of `UNITS`."""
        return {name: self.largest.extremes[name] for name in UNITS if name in self.largest.extremes}

    def see(
        self, work: ShaftWork, torque: np.ndarray, kt: np.ndarray | None = None, voltage: np.ndarray | None = None
    ) -> None:
        """Add a block. torque: of this motor, N m, [case, instant]; kt: N m/A, [case]; voltage: V"""
        keep, power = self.largest, torque * work.rate
        keep.of_cases("torque_rms", root_mean_square(torque), work)
        keep.of_instants("torque_peak", np.abs(torque), work, torque)
        keep.of_instants("rate", np.abs(work.rate), work, torque)
        keep.of_instants("power_peak", np.maximum(power, 0.0), work, torque)
        keep.of_instants("returned_peak", np.maximum(-power, 0.0), work, torque)
        keep.of_cases("returned_energy", over_case(np.maximum(-power, 0.0), work.time), work)
        lasts = np.maximum(over_case(np.ones_like(power) + 0.0 * power, work.time), np.finfo(float).tiny)
        keep.of_cases("power_mean", over_case(np.maximum(power, 0.0), work.time) / lasts, work)
        if self.part is not None:
            kt, voltage = self._of_part(work, torque, self.part)
        if kt is not None:
            current = torque / kt[:, None]
            keep.of_cases("current_rms", root_mean_square(current), work)
            keep.of_instants("current_peak", np.abs(current), work, torque)
        if voltage is not None:
            keep.of_instants("voltage", np.abs(voltage), work, torque)
        for name, in_quadrants in (("driving", power >= 0.0), ("braking", power <= 0.0)):
            points = np.stack([np.abs(work.rate)[in_quadrants], np.abs(torque)[in_quadrants]], 1)
            self._corners[name] = corners(np.concatenate([self._corners[name], points]))

    def _of_part(
        self, work: ShaftWork, torque: np.ndarray, part: MotorPart
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Torque constants and voltages of a part, as far as its source gives them."""
        kt, resistance, constant = (part.figure(name) for name in ("kt", "resistance", "thermal_time"))
        if constant is not None:
            self.largest.of_cases("heat", hottest(torque, work.time, constant), work)
        if kt is None:
            return None, None
        voltage = None if resistance is None else resistance / kt * torque + kt * work.rate
        return np.full(len(work.case), kt), voltage

    @property
    def rates(self) -> list[float]:
        """The rates at which `envelope` is given, rad/s, rising."""
        fastest = max((float(points[:, 0].max()) for points in self._corners.values() if len(points)), default=0.0)
        return [float(rate) for rate in np.linspace(0.0, fastest, ENVELOPE)]

    def envelope(self, name: str) -> list[float]:
        """The required torque-speed curve, `driving` or `braking`: the largest torque (N m) at each of `rates` or any
        above; 0 where there is none."""
        points = self._corners[name]
        above = (points[points[:, 0] >= rate * (1.0 - ROUNDING), 1] for rate in self.rates)
        return [float(torques.max(initial=0.0)) for torques in above]


def corners(points: np.ndarray) -> np.ndarray:
    """The points of [point, (rate, torque)] that no other exceeds in both, by falling rate."""
    ordered = points[np.lexsort((-points[:, 1], -points[:, 0]))]
    if not len(ordered):
        return ordered
    before = np.concatenate([[-1.0], np.maximum.accumulate(ordered[:, 1])[:-1]])
    return ordered[ordered[:, 1] > before]


@frozen
class BedFigures:
    """The demands on a bed of one joint over all cases of an experiment.

    drive, load  the motors, on the deck's shaft
    both         of both together, what a common supply has: `returned_peak`, W, and `returned_energy`, J
    arm          least and largest inertia of the arm at the shaft, kg m^2;  ratio: the same over that of the rotor, r
    rotor, shaft inertia of the joint's rotor and of the bed's shaft, least and largest, kg m^2
    cases, instants, failed, limited, at_most  how many cases, instants of each, cases that did not reach their end,
                 cases in which the load's amplifier was at its limit, and in which the drive was at its largest torque
    """

    drive: MotorFigures
    load: MotorFigures
    both: Mapping[str, Extreme]
    arm: tuple[Extreme, Extreme]
    ratio: tuple[Extreme, Extreme]
    rotor: tuple[float, float]
    shaft: tuple[float, float]
    cases: int
    instants: int
    failed: int
    limited: int
    at_most: int


@frozen
class Candidate:
    """A candidate part for one motor of the bed. beside: inertia of the other motor's rotor on the shaft, kg m^2; None:
    that of the joint's"""

    role: str
    figures: MotorFigures
    beside: float | None = None

    @property
    def part(self) -> MotorPart:
        assert self.figures.part is not None
        return self.figures.part

    def see(self, work: ShaftWork) -> None:
        """Add a block: the load motor's own rotor is on the shaft, and replaces a part of the arm."""
        if self.role == "drive":
            self.figures.see(work, work.drive)
        else:
            beside = work.rotor if self.beside is None else self.beside
            self.figures.see(work, work.load_on(beside + (self.part.figure("inertia") or 0.0)))


def gather(blocks: Iterable[ShaftWork], candidates: Sequence[Candidate] = ()) -> BedFigures | None:
    """The figures over all blocks; None where no case has any instant."""
    drive, load, rest = MotorFigures(), MotorFigures(), Largest()
    ends: dict[str, list[float]] = {"rotor": [], "shaft": []}
    cases = instants = failed = limited = at_most = 0
    for work in blocks:
        drive.see(work, work.drive, work.kt, work.voltage)
        load.see(work, work.load, work.kt_load)
        power = (work.drive + work.load) * work.rate
        rest.of_instants("returned_peak", np.maximum(-power, 0.0), work)
        rest.of_cases("returned_energy", over_case(np.maximum(-power, 0.0), work.time), work)
        for name, values in (("arm", work.arm), ("ratio", work.arm / work.rotor[:, None])):
            rest.of_instants(f"{name}+", values, work)
            rest.of_instants(f"{name}-", -values, work)
        for candidate in candidates:
            candidate.see(work)
        ends["rotor"] += [float(work.rotor.min()), float(work.rotor.max())]
        ends["shaft"] += [float(work.shaft.min()), float(work.shaft.max())]
        cases, instants = cases + len(work.case), len(work.time)
        failed, limited = failed + int(work.failed.sum()), limited + int((work.limited > 0).sum())
        at_most += int((np.abs(work.drive) >= work.strongest[:, None]).any(1).sum())
    figures = rest.extremes
    if "arm+" not in figures or "torque_peak" not in drive.extremes:
        return None

    def least_and_most(name: str) -> tuple[Extreme, Extreme]:
        least = figures[f"{name}-"]
        return Extreme(-least.value, least.case, least.time), figures[f"{name}+"]

    return BedFigures(
        drive=drive,
        load=load,
        both={name: figures[name] for name in ("returned_peak", "returned_energy")},
        arm=least_and_most("arm"),
        ratio=least_and_most("ratio"),
        rotor=(min(ends["rotor"]), max(ends["rotor"])),
        shaft=(min(ends["shaft"]), max(ends["shaft"])),
        cases=cases,
        instants=instants,
        failed=failed,
        limited=limited,
        at_most=at_most,
    )


CHECKS = (
    ("torque, continuous", "torque_rms", "torque_rated"),
    ("torque, as it heats", "heat", "torque_rated"),
    ("torque, peak", "torque_peak", "torque_peak"),
    ("rate", "rate", "rate_max"),
    ("current, continuous", "current_rms", "current_rated"),
    ("current, peak", "current_peak", "current_peak"),
    ("voltage", "voltage", "voltage"),
)
"""The checks of a part: in words, the required figure (`UNITS`), and the part's figure (hw.motor_parts.FIGURES)."""


@frozen
class PartCheck:
    """One figure of a part against the required one, margin included, SI. extreme: where that occurs"""

    what: str
    unit: str
    required: float
    has: float
    extreme: Extreme

    @property
    def share(self) -> float:
        """The required share of the part's figure; above 1 it does not fit."""
        return self.required / self.has


@frozen
class PartVerdict:
    """A part's verdict. missing: unknown figures that would be needed, in words"""

    role: str
    part: MotorPart
    checks: tuple[PartCheck, ...]
    missing: tuple[str, ...]

    @property
    def binds(self) -> PartCheck | None:
        """The check by which the part has the least to spare."""
        return max(self.checks, key=lambda check: check.share, default=None)

    @property
    def fits(self) -> bool | None:
        """True if all checks fit; None where it is not known, since its source leaves out too much."""
        if self.binds is not None and self.binds.share > 1.0:
            return False
        return None if self.missing else True


def judge_part(candidate: Candidate, margin: float) -> PartVerdict:
    """Compare a part with its required figures times the margin."""
    figures, part, checks = candidate.figures.extremes, candidate.part, []
    for what, name, own in CHECKS:
        has = part.figure(own)
        if has is not None and name in figures:
            checks.append(PartCheck(what, UNITS[name], margin * figures[name].value, has, figures[name]))
    checked = {check.what for check in checks}
    missing = [name for name in ("torque, continuous", "rate") if name not in checked]
    if not checked & {"torque, peak", "current, peak", "voltage"}:
        missing.insert(1, "torque, peak")
    if candidate.role == "load" and part.figure("inertia") is None:
        missing.append("inertia of its rotor")
    return PartVerdict(candidate.role, part, tuple(checks), tuple(missing))
