"""Stability of a motor on a bed: how heavy, and how light, the arm may be for its law, rate and delay.

The measure is r = J_eff/(N^2 J_m), the arm's inertia at the joint against the rotor's. Each r is a question to the
linear analysis: of the joint's bed, servo and law by themselves, opened where the arm is felt (`linear.bed_loop`). The
loop is stable where no pole of a tick is larger than one. This module adds r of a case as its run begins, for one joint
and for motions of all of them, and the stable range of r around it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from met.analysis.linear.bed_loop import BedLoop, CaseLoop
from met.analysis.linear.margins import STABLE
from met.backends.reference.plain import PlainTape, begun
from met.frozen import frozen
from met.plan import Experiment
from met.program import cells
from met.program.build import Builder
from met.program.system import System
from met.servos.motor import Motor

LIGHTEST, HEAVIEST, STEPS = 0.05, 2000.0, 40
"""Range of r that is searched, wider for an arm that lies outside it; and the number of values, spaced
geometrically."""

NARROW, AT_ONCE = 1e-3, 30
"""Relative accuracy of an end of a range, and the number of r tried side by side to find it."""

_Stretches = tuple[tuple[float, float | None], ...]


@frozen
class Margin:
    """One substituted joint of a case.

    r         of the arm at the start of the run
    together  the largest r of any motion of all substituted joints, an eigenvalue of Lambda/(N^2 J_m); of one joint: r
    least     the smallest of them
    lower     r above which the loop is stable, of the stretch of r around `together`, else of the nearest; 0: any
    limit     r up to which it is, of the same stretch; None: none found up to `searched`; 0: it is stable at no r
    """

    case: int
    joint: str
    law: str
    bed: str
    rate_hz: float
    delay: float
    r: float
    together: float
    least: float
    lower: float
    limit: float | None
    searched: float

    @property
    def heavier(self) -> float | None:
        """The factor by which the arm might be heavier; None where no limit was found."""
        return None if self.limit is None else self.limit / self.together

    @property
    def lighter(self) -> float | None:
        """The factor by which the arm might be lighter; None where it may be as light as any."""
        return self.least / self.lower if self.lower > 0.0 else None

    @property
    def factor(self) -> float | None:
        """The smaller of `heavier` and `lighter`; below 1 where the loop is unstable."""
        return min((factor for factor in (self.heavier, self.lighter) if factor is not None), default=None)

    @property
    def room(self) -> float:
        """The smaller factor, as far as was searched; below any other where the arm's r is no number."""
        room = self.searched / self.together if self.factor is None else self.factor
        return room if room == room else 0.0

    @property
    def too_light(self) -> bool:
        """True where the loop is unstable because the arm is too light."""
        return self.least <= self.lower and not self.too_heavy

    @property
    def too_heavy(self) -> bool:
        """True where the loop is unstable because the arm is too heavy."""
        return self.limit is not None and 0.0 < self.limit <= self.together

    @property
    def stable(self) -> bool:
        """True where the loop is stable with this arm; False where its r is not a number, so that nothing is known."""
        return self.lower < self.least and self.together < (self.searched if self.limit is None else self.limit)


def remedy(margin: Margin) -> str:
    """Help text with a change that may make an unstable joint stable."""
    if margin.too_light:
        return "a lower gain of the servo's rate loop, a faster servo or a heavier arm"
    changed = "lower gains" if margin.limit == 0.0 else "a lighter arm"
    return f"{changed}, a faster servo or another law"


def margins(
    experiment: Experiment,
    cases: Sequence[int] | None = None,
    progress: Callable[[int], None] | None = None,
    *,
    span: tuple[float, float] | None = None,
    reach: float = 1.0,
) -> tuple[tuple[Margin, ...], ...]:
    """The stability margins of all joints whose motors are on beds: one tuple a case (all by default).

    The loop is analysed for each joint alone, and compared with the lightest and the heaviest that the arm is in any
    motion of all of them together: their loops are one through the arm.

    progress  called with the number of cases done so far. Limits are looked for once for all cases that share the
              parameters of servo, bed and law
    span      least and largest r to hold each loop against, such as those of a whole run, in place of the r that the
              arm has at the start of the case
    reach     the search goes on to arms so many times heavier, and lighter, than those, and twice that
    """
    on_beds = BedExperiment(experiment)
    by_case = []
    for done, case in enumerate(range(experiment.cases.count) if cases is None else cases, start=1):
        with np.errstate(all="ignore"):  # a bed with no inertia has no finite loop
            by_case.append(tuple(_margins(on_beds, case, span, reach)))
        if progress is not None:
            progress(done)
    return tuple(by_case)


def rotor_inertias(experiment: Experiment, case: int) -> np.ndarray:
    """N^2 J_m of the substituted joints of a case, kg m^2 (prismatic: kg): [joint]."""
    on_beds = BedExperiment(experiment)
    return np.array([_rotor(motor) for motor in on_beds.motors(on_beds.begun(case))])


def ends_of_motion(Lambda: np.ndarray, rotors: np.ndarray) -> tuple[float, float]:
    """The smallest and the largest r (arm's inertia against the rotor's) of any motion of the joints on beds;
    not-a-number where the arm has no finite inertia.

    Lambda: [..., joint, joint] kg m^2;  rotors: [joint] N^2 J_m, kg m^2
    """
    ratios = Lambda / rotors[:, None]
    if not np.isfinite(ratios).all():
        return np.nan, np.nan
    # of a matrix that is similar to a symmetric one: real but for rounding
    motions = np.linalg.eigvals(ratios).real
    return float(motions.min()), float(motions.max())


@frozen
class _Known:
    """A loop with its results so far: the stretches of r in which it is stable (from 0: any; to None: as far as
    searched), and whether it grows at the r of arms so far."""

    loop: CaseLoop
    stretches: _Stretches
    grows: dict[float, bool]

    @classmethod
    def of(cls, loop: CaseLoop, lightest: float, heaviest: float, own: Sequence[float]) -> _Known:
        """The results for a loop whose first arms have these r."""
        looked_at = np.geomspace(lightest, heaviest, STEPS).tolist()
        growing = grow(loop, [*looked_at, *own])
        ranges = stretches(loop, looked_at, growing[:STEPS])
        return cls(loop, ranges, dict(zip(own, growing[STEPS:], strict=True)))


class BedExperiment:
    """An experiment whose beds have no faults, since their noise and converters would be taken for slopes, and no
    current limit, at which there is no slope; with the results for its loops."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = _faultless(experiment)
        self.builder = Builder(System(self.experiment))
        self.program = self.builder.program()
        self.beds = self.builder.step.beds
        self.loops: dict[str, BedLoop] = {}
        self.known: dict[tuple[Any, ...], _Known] = {}

    def loop(self, joint: str, case: int, motor: Motor) -> CaseLoop:
        """The loop of a joint in a case."""
        if joint not in self.loops:
            self.loops[joint] = BedLoop(self.experiment, joint)
        return self.loops[joint].of_case(self.inputs_of(case), motor)

    def inputs_of(self, case: int) -> dict[str, float]:
        """The kernel's inputs of a case. Any value serves as its noise seed, since its motor beds have no faults
        here."""
        cases = self.experiment.cases
        values = {coordinate.path: float(coordinate.values[case]) for coordinate in cases.coordinates}
        return values | dict.fromkeys(cases.noise, 0.0)

    def begun(self, case: int) -> PlainTape:
        """A case after its first tick, in plain numbers; the loop for an observer's covariance runs only once."""
        return begun(self.program, self.inputs_of(case), settled=np.inf)

    def motors(self, tape: PlainTape) -> list[Motor]:
        """The motors of the joints whose motors are on beds, in the arm's order."""
        return [self.beds.motor(tape, mounted) for mounted in self.beds.mounted]


def _rotor(motor: Motor) -> float:
    return float(motor.ratio * motor.ratio * motor.inertia)


def _margins(on_beds: BedExperiment, case: int, span: tuple[float, float] | None, reach: float) -> Iterator[Margin]:
    """The stability margin of each joint on a bed in one case, as its run begins. span, reach: as `margins` has
    them."""
    experiment, builder, beds, known = on_beds.experiment, on_beds.builder, on_beds.beds, on_beds.known
    tape = on_beds.begun(case)
    names = [mounted.joint for mounted in beds.mounted]
    Lambda = np.array([[float(tape.read(cells.ARM_INERTIA(a, b))) for b in names] for a in names])
    motors = on_beds.motors(tape)
    rotors = np.array([_rotor(motor) for motor in motors])
    least, together = ends_of_motion(Lambda, rotors) if span is None else span
    for mounted, motor, r in zip(beds.mounted, motors, (Lambda.diagonal() / rotors).tolist(), strict=True):
        heads = (f"{mounted.joint}.servo.", f"{mounted.joint}.bed.", f"{mounted.joint}.law.")
        own = [path for path in experiment.parameters if path.startswith(heads) and ".command." not in path]
        # Its own r is always among those searched. Whether a loop grows beyond them is not known.
        lightest, heaviest = LIGHTEST, HEAVIEST
        if least > 0.0 and together < np.inf:
            lightest, heaviest = min(lightest, 0.5 * least / reach), max(heaviest, 2.0 * reach * together)
        key = (mounted.joint, lightest, heaviest, *(builder.system.value(path, tape.read) for path in own))
        if key not in known:
            loop = on_beds.loop(mounted.joint, case, motor)
            known[key] = _Known.of(loop, lightest, heaviest, _finite(least, together))
        lower, limit = _around(known[key], (least, together), (lightest, heaviest))
        delay = float(builder.system.value(f"{mounted.joint}.bed.delay", tape.read))
        rate_hz = builder.schedule.base_hz / beds.divisor
        yield Margin(
            case,
            mounted.joint,
            mounted.law.name,
            mounted.bed.name,
            rate_hz,
            delay,
            r,
            together,
            least,
            lower,
            limit,
            heaviest,
        )


def _around(known: _Known, own: tuple[float, float], searched: tuple[float, float]) -> tuple[float, float | None]:
    """The range of r in which the loop is stable around the heavier end of the arm's own r, else the nearest to it; (0,
    0) where there is none.

    At its own r it is as the loop is there, also where the search has gone past a narrow stretch.
    """
    ranges = known.stretches
    numbers, loop = _finite(*own), known.loop
    unknown = [r for r in numbers if r not in known.grows]
    if unknown:
        known.grows.update(zip(unknown, grow(loop, unknown), strict=True))
    if any(known.grows[r] == any(_holds(stretch, r) for stretch in ranges) for r in numbers):
        looked_at = sorted({*np.geomspace(*searched, STEPS).tolist(), *numbers})
        ranges = stretches(loop, looked_at, grow(loop, looked_at))

    def near(stretch: tuple[float, float | None]) -> float:
        """The nearness of a range of r to the arm's own, from 0 to 1 (within)."""
        lower, limit = stretch
        if own[1] <= lower:
            return own[1] / lower if lower > 0.0 else 1.0
        return 1.0 if limit is None else min(1.0, limit / own[1])

    return max(ranges, key=near, default=(0.0, 0.0))


def _finite(*own: float) -> list[float]:
    """The r of an arm at which a loop can be analysed, ascending."""
    return sorted({r for r in own if 0.0 < r < np.inf})


def _holds(stretch: tuple[float, float | None], r: float) -> bool:
    lower, limit = stretch
    return lower < r and (limit is None or r < limit)


def grow(loop: CaseLoop, ratios: Sequence[float]) -> list[bool]:
    """A truth for each r: whether the loop grows there."""
    return (loop.radii(ratios) > 1.0 + STABLE).tolist()


def stretches(loop: CaseLoop, looked_at: Sequence[float], growing: Sequence[bool]) -> _Stretches:
    """The ranges of r, the arm's inertia at the joint against the rotor's, in which a bed's loop does not grow, rising,
    to a thousandth of r.

    A range begins at 0 where the loop does not grow at the smallest r that was looked at, and ends at None where it
    does not at the largest. looked_at: rising; growing: of each of them
    """
    ranges: list[tuple[float, float | None]] = []
    lower = 0.0
    for (low, high), (before, after) in zip(pairwise(looked_at), pairwise(growing), strict=True):
        if before == after:
            continue
        while high > (1.0 + NARROW) * low:
            between = np.geomspace(low, high, AT_ONCE + 2).tolist()
            first = [*grow(loop, between[1:-1]), after].index(after)
            low, high = between[first], between[first + 1]
        end = (low * high) ** 0.5
        if after:
            ranges.append((lower, end))
        else:
            lower = end
    return (*ranges, (lower, None)) if not growing[-1] else tuple(ranges)


def _faultless(experiment: Experiment) -> Experiment:
    """The experiment with beds that have no faults, since their noise and converters would be taken for slopes, and no
    current limit, at which there is no slope."""
    from met import models

    parameters = dict(experiment.parameters)
    for use in experiment.structure.substitutions:
        bed = models.find("bed", use.bed, use.place)
        for name in {name for preset in bed.presets.values() for name in preset}:
            path = f"{use.joint}.bed.{name}"
            parameters[path] = replace(parameters[path], value=0.0)
        if any(parameter.name == "i_max" for parameter in bed.parameters):
            path = f"{use.joint}.bed.i_max"
            parameters[path] = replace(parameters[path], value=np.inf)
    return replace(experiment, parameters=parameters)
