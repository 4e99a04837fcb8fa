"""Stability of a motor on a bed: how heavy, and how light, the arm may be for its law, rate and delay.

The measure is r = J_eff/(N^2 J_m), the arm's inertia at the joint against the rotor's. The loop of bed, filter,
converter-free wire, servo and law is taken round once by the functions that run it, at a steady rate of the shaft where
no limit is reached and no friction changes its sign: there it is an affine map from tick to tick. It is stable where no
eigenvalue of its matrix, found by differences, is larger than one. So there is no second model that could differ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from met.analysis.lanes import LaneTape
from met.backends.reference.plain import PlainTape, follow
from met.frozen import frozen
from met.plan import Experiment
from met.program import cell_names
from met.program.build import Builder
from met.program.control.substituted import Mounted
from met.program.system import System
from met.servos.servo import Setpoint

GROWS = 1.0 + 1e-6
"""Eigenvalues above it grow; the slow modes of a servo with a heavy arm come that near to one."""

SETTLED = 1e-12
"""Share of its entries by which a turn changes the observer's covariance once no more turns are made."""

LIGHTEST, HEAVIEST, STEPS = 0.05, 2000.0, 40
"""Range of r that is searched, wider for an arm that lies outside it; and how many values, a constant share apart."""

_Stretches = tuple[tuple[float, float | None], ...]

# ends of the names of angles, which only add up and come back to nothing
_ANGLES = ("angle",)


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
        return min((each for each in (self.heavier, self.lighter) if each is not None), default=None)

    @property
    def room(self) -> float:
        """`factor`, as far as was searched; nothing has less than an arm whose r is no number."""
        found = self.searched / self.together if self.factor is None else self.factor
        return found if found == found else 0.0

    @property
    def too_light(self) -> bool:
        """True where the loop is unstable because the arm is too light."""
        return self.least <= self.lower and not self.too_heavy

    @property
    def too_heavy(self) -> bool:
        return self.limit is not None and 0.0 < self.limit <= self.together

    @property
    def stable(self) -> bool:
        """True where the loop is stable with this arm; False where its r is no number, so that nothing is known."""
        return self.lower < self.least and self.together < (self.searched if self.limit is None else self.limit)


def remedy(one: Margin) -> str:
    """Help that may make an unstable joint stable."""
    if one.too_light:
        return "a lower gain of the servo's rate loop, a faster servo or a heavier arm"
    changed = "lower gains" if one.limit == 0.0 else "a lighter arm"
    return f"{changed}, a faster servo or another law"


def margins(
    experiment: Experiment,
    cases: Sequence[int] | None = None,
    progress: Callable[[int], None] | None = None,
    *,
    span: tuple[float, float] | None = None,
    reach: float = 1.0,
) -> tuple[tuple[Margin, ...], ...]:
    """Every substituted joint of an experiment: one tuple a case (all by default).

    The loop is taken round for each joint by itself, and held against the lightest and the heaviest that the arm is in
    any motion of all of them together: their loops are one through the arm.

    progress  called with the number of cases done so far. Limits are looked for once for all cases that share the
              parameters of servo, bed and law
    span      least and largest r to hold each loop against, such as those of a whole run, in place of the r that the
              arm has at the start of the case
    reach     the search goes on to arms so many times heavier, and lighter, than those, and twice that
    """
    plain = _faultless(experiment)
    known: dict[tuple[Any, ...], _Known] = {}
    found = []
    for done, case in enumerate(range(experiment.cases.count) if cases is None else cases, start=1):
        with np.errstate(all="ignore"):  # a bed with no inertia has no finite loop
            found.append(tuple(_margins(plain, case, known, span, reach)))
        if progress is not None:
            progress(done)
    return tuple(found)


def rotor_inertias(experiment: Experiment, case: int) -> np.ndarray:
    """N^2 J_m of the substituted joints of a case, kg m^2 (prismatic: kg): [joint]."""
    builder, tape = _begun(_faultless(experiment), case)
    motors = [builder.step.beds.motor(tape, each) for each in builder.step.beds.mounted]
    return np.array([float(each.ratio * each.ratio * each.inertia) for each in motors])


def ends_of_motion(Lambda: np.ndarray, rotors: np.ndarray) -> tuple[float, float]:
    """The smallest and the largest r of any motion of the substituted joints; not numbers where it is none.

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
    """One loop's results: the stretches of r in which it is stable (from 0: any; to None: as far as searched), and
    whether it grows at the r of arms so far."""

    stretches: _Stretches
    grows: dict[float, bool]

    @classmethod
    def of(cls, loop: _Loop, lightest: float, heaviest: float, own: Sequence[float]) -> _Known:
        """The results for a loop whose first arms have these r."""
        looked_at = np.geomspace(lightest, heaviest, STEPS).tolist()
        growing = loop.grow([*looked_at, *own])
        return cls(loop.stretches(looked_at, growing[:STEPS]), dict(zip(own, growing[STEPS:], strict=True)))


def _margins(
    experiment: Experiment,
    case: int,
    known: dict[tuple[Any, ...], _Known],
    span: tuple[float, float] | None,
    reach: float,
) -> Iterator[Margin]:
    builder, tape = _begun(experiment, case)
    beds = builder.step.beds
    # All of them first: a loop is taken round over the same cells, with loads of its own.
    names = [each.joint for each in beds.mounted]
    Lambda = np.array([[float(tape.read(cell_names.ARM_INERTIA(a, b))) for b in names] for a in names])
    loops = [_Loop(builder, tape, each) for each in beds.mounted]
    rotors = np.array([loop.rotor for loop in loops])
    least, together = ends_of_motion(Lambda, rotors) if span is None else span
    for each, loop, r in zip(beds.mounted, loops, (Lambda.diagonal() / rotors).tolist(), strict=True):
        heads = (f"{each.joint}.servo.", f"{each.joint}.bed.", f"{each.joint}.law.")
        own = [path for path in experiment.parameters if path.startswith(heads) and ".command." not in path]
        # Its own r is always among those searched. Where a loop grows, or not, beyond them is not known.
        lightest, heaviest = LIGHTEST, HEAVIEST
        if least > 0.0 and together < np.inf:
            lightest, heaviest = min(lightest, 0.5 * least / reach), max(heaviest, 2.0 * reach * together)
        key = (each.joint, lightest, heaviest, *(builder.system.value(path, tape.read) for path in own))
        if key not in known:
            known[key] = _Known.of(loop, lightest, heaviest, _finite(least, together))
        lower, limit = _around(known[key], loop, (least, together), (lightest, heaviest))
        delay = float(builder.system.value(f"{each.joint}.bed.delay", tape.read))
        rate_hz = builder.schedule.base_hz / beds.divisor
        yield Margin(
            case, each.joint, each.law.name, each.bed.name, rate_hz, delay, r, together, least, lower, limit, heaviest
        )


def _around(
    known: _Known, loop: _Loop, own: tuple[float, float], searched: tuple[float, float]
) -> tuple[float, float | None]:
    """The stretch around the heavier of the arm's own r, else the nearest to it; (0, 0): there is none.

    At its own r it is as the loop is there, also where the search has gone past a narrow stretch.
    """
    stretches = known.stretches
    numbers = _finite(*own)
    unknown = [r for r in numbers if r not in known.grows]
    if unknown:
        known.grows.update(zip(unknown, loop.grow(unknown), strict=True))
    if any(known.grows[r] == any(_holds(each, r) for each in stretches) for r in numbers):
        looked_at = sorted({*np.geomspace(*searched, STEPS).tolist(), *numbers})
        stretches = loop.stretches(looked_at, loop.grow(looked_at))

    def near(stretch: tuple[float, float | None]) -> float:
        lower, limit = stretch
        if own[1] <= lower:
            return own[1] / lower if lower > 0.0 else 1.0
        return 1.0 if limit is None else min(1.0, limit / own[1])

    return max(stretches, key=near, default=(0.0, 0.0))


def _finite(*own: float) -> list[float]:
    """Those r of an arm for which a loop can be looked at, rising."""
    return sorted({r for r in own if 0.0 < r < np.inf})


def _holds(stretch: tuple[float, float | None], r: float) -> bool:
    lower, limit = stretch
    return lower < r and (limit is None or r < limit)


def _faultless(experiment: Experiment) -> Experiment:
    """The experiment with beds that have no faults, whose noise and converters would be taken for slopes, and whose
    current has no limit, at which there is none."""
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


def _begun(experiment: Experiment, case: int) -> tuple[Builder, LaneTape]:
    """The program after its first tick, in plain numbers, on a tape that takes arrays from then on."""
    builder = Builder(System(experiment))
    program = builder.program()
    values = {each.path: float(each.values[case]) for each in experiment.cases.coordinates}
    # of what noise is a case's own, any will do: beds are without faults here
    tape = PlainTape(program, values | dict.fromkeys(experiment.cases.noise, 0.0), 1)
    with np.errstate(all="ignore"):
        follow(tape, program.start, settled=SETTLED)
        follow(tape, program.tick)
    lanes = LaneTape(program.base_hz, {name: np.asarray(value) for name, value in tape.inputs.items()}, 1)
    lanes.cells.update(tape.cells)
    return builder, lanes


class _Noting(dict[str, Any]):
    """Cells that note which of them are written."""

    def __init__(self, cells: Mapping[str, Any]) -> None:
        super().__init__(cells)
        self.written: set[str] = set()

    def __setitem__(self, name: str, value: Any) -> None:
        self.written.add(name)
        super().__setitem__(name, value)


class _Loop:
    """The loop of one joint at a tick, over the cells of a tape."""

    def __init__(self, builder: Builder, tape: LaneTape, each: Mounted) -> None:
        self.builder, self.tape, self.each = builder, tape, each
        self.beds = builder.step.beds.alone(each)
        self.motor = self.beds.motor(tape, each)
        self.rotor = float(self.motor.ratio * self.motor.ratio * self.motor.inertia)
        # back-EMF alone then takes half of the torque there is
        self.rate = 0.5 * float(self.motor.tau_max * self.motor.resistance / (self.motor.kt * self.motor.kt))
        own = (f"{each.joint}:", f"{each.joint}.bed.", f"{each.joint}.law.", f"{each.actuator.path}.")
        cells = {name: value for name, value in tape.cells.items() if name.startswith(own)}
        tape.k = self.beds.divisor
        tape.cells = _Noting(tape.cells)
        self._around(cells, np.float64(self.rotor))
        # Under a position command the angle acts back; else it only adds up.
        back = cell_names.SHAFT_ANGLE(each.joint) if each.actuator.command_kind == "position" else ""
        written = tape.cells.written
        self.names = [name for name in cells if name in written and (name == back or not name.endswith(_ANGLES))]
        # The shaft turns on at one rate, and nothing else is under way.
        tape.cells.update(dict.fromkeys(self.names, np.float64(0.0)))
        tape.write(f"{each.joint}.qd", self.rate / self.motor.ratio)
        tape.write(f"{each.joint}.q", 0.0)
        self.beds.start(tape)
        self.start = {name: float(tape.cells[name]) for name in cells}
        self.cells = dict(tape.cells)

    def _around(self, cells: Mapping[str, Any], load: Any) -> dict[str, Any]:
        """The cells a tick later, with an arm of this inertia on the joint (kg m^2; kg); both may be arrays."""
        tape, joint, actuator = self.tape, self.each.joint, self.each.actuator
        tape.cells.update(cells)
        tape.cells.update({cell_names.ARM_INERTIA(joint, joint): load, cell_names.ARM_TORQUE(joint): np.float64(0.0)})
        self.beds.advance(tape)
        self.beds.read(tape)
        q, qd = self.beds.seen(tape, actuator) or (0.0, 0.0)
        self.builder.compute(tape, actuator, self.builder.seen(actuator, q, qd, self._asked(), tape.time))
        self.beds.act(tape)
        return {name: tape.cells[name] for name in cells}

    def _asked(self) -> Setpoint:
        """The command, of the deck's kind, under which the shaft turns on at the steady rate."""
        rate = self.rate / self.motor.ratio
        kind = self.each.actuator.command_kind
        value = {"position": self.beds.period * rate, "rate": rate}.get(kind, 0.0)
        return Setpoint(kind, value, rate if kind == "position" else 0.0)

    def radii(self, ratios: Sequence[float]) -> np.ndarray:
        """The largest size of an eigenvalue of the map from tick to tick, at each r: all of them and all differences at
        once."""
        count, n = len(ratios), len(self.names)
        start = np.array([self.start[name] for name in self.names])
        sizes = 1e-4 * np.maximum(1.0, np.abs(start))
        moved = np.repeat(start[:, None, None], count, 1) + np.hstack([np.zeros((n, 1)), np.diag(sizes)])[:, None, :]
        cells: dict[str, Any] = {**self.start, **dict(zip(self.names, moved.reshape(n, -1), strict=True))}
        self.tape.cells = dict(self.cells)
        with np.errstate(all="ignore"):
            ends = self._around(cells, np.repeat(np.asarray(ratios) * self.rotor, n + 1))
            after = np.array([np.broadcast_to(ends[name], count * (n + 1)) for name in self.names])
            after = after.reshape(n, count, n + 1)
            maps = np.moveaxis((after[..., 1:] - after[..., :1]) / sizes, 1, 0)
        found = np.full(count, np.inf)
        numbers = np.isfinite(maps).all((1, 2))
        found[numbers] = np.abs(np.linalg.eigvals(maps[numbers])).max(1)
        return found

    def grow(self, ratios: Sequence[float]) -> list[bool]:
        """Tells of each r whether the loop grows there."""
        return (self.radii(ratios) > GROWS).tolist()

    def stretches(self, looked_at: Sequence[float], growing: Sequence[bool]) -> _Stretches:
        """The ranges of r in which the loop does not grow, rising, to a hundredth of r.

        A range begins at 0 where the loop does not grow at the smallest r that was looked at, and ends at None where it
        does not at the largest. looked_at: rising; growing: of each of them
        """
        found: list[tuple[float, float | None]] = []
        lower = 0.0
        for (low, high), (before, after) in zip(pairwise(looked_at), pairwise(growing), strict=True):
            if before == after:
                continue
            between = [low, high]
            while between[1] > 1.005 * between[0]:
                middles = [(a * b) ** 0.5 for a, b in pairwise(between)]
                between = [r for two in zip(between, middles, strict=False) for r in two] + [high]
            first = [*self.grow(between[1:-1]), after].index(after)
            end = (between[first] * between[first + 1]) ** 0.5
            if after:
                found.append((lower, end))
            else:
                lower = end
        return (*found, (lower, None)) if not growing[-1] else tuple(found)
