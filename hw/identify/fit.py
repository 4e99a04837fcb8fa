"""The model of a motor bed, and the parameters with which it fits readings, by least squares, with their uncertainty.

Intervals come from groups of moves, not from the residual's variance: what is left is neither white nor of one size,
and as a shaft that stops does so between two substeps, the sum of squares has many small valleys. So each group is
fitted by itself, and how far the groups' answers lie apart says how sure all of them are (batch means; Schmeiser,
Operations Research 30, 1982), with Student's factor for so few.

The model is that of `emulated` under recorded commands, for many sets of parameters at once. Its motors may be out of
line at any angle:

    J w' = tau_m(V, w) + Kt_load i - F_v w - s F_c + e
    e = sin_1 sin(theta) + cos_1 cos(theta) + sin_2 sin(2 theta) + cos_2 cos(2 theta)

theta is read, not computed: what is computed would run away from it.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from scipy.special import stdtrit

from hw.identify.series import Series
from met import backends
from met.backends.backend import Kernel
from met.frozen import frozen
from met.servos.motor import damping, torque
from met.substitution import butterworth, shaft
from met.substitution.emulated import SUBSTEP
from met.trace import cos, sin
from met.trace.program import CallPhase, Phase, Program, Tape, Unless0
from met.trace.recorder import record

MOTOR = ("kt", "resistance", "tau_max", "f_c", "f_v", "inertia", "kt_load", "f_cut")
RIPPLE = ("sin_1", "cos_1", "sin_2", "cos_2")
PARAMETERS = (*MOTOR, *RIPPLE)

LANES = 32

_GIVEN = ("voltage", "current", "time", "angle")


@lru_cache(maxsize=4)
def _kernel(count: int) -> Kernel:
    """The kernel of a bed whose steps have `count` substeps each."""

    def begin(tape: Tape) -> None:
        for name in ("rate", "filtered", "slope"):
            tape.write(name, 0.0 * tape.input("kt"))

    def advance(tape: Tape) -> None:
        """Record one step of the bed's shaft: rate, filtered rate and its slope after the input `time`, s."""
        p = {name: tape.input(name) for name in PARAMETERS}
        h = tape.input("time") / count
        decay = damping(p["kt"], p["resistance"], p["f_v"]) / p["inertia"]
        coefficients = butterworth.over(p["f_cut"], h)
        load, voltage = p["kt_load"] * tape.input("current"), tape.input("voltage")
        w, angle, x = tape.read("rate"), tape.input("angle"), (tape.read("filtered"), tape.read("slope"))
        for _ in range(count):
            ripple = (
                p["sin_1"] * sin(angle)
                + p["cos_1"] * cos(angle)
                + p["sin_2"] * sin(2.0 * angle)
                + p["cos_2"] * cos(2.0 * angle)
            )
            smooth = torque(p["kt"], p["resistance"], p["tau_max"], voltage, w) + load - p["f_v"] * w + ripple
            after = shaft.slid(w, smooth, p["f_c"], inertia=p["inertia"], decay=decay, time=h)
            x = butterworth.along_line(coefficients, x, w, after)
            angle = angle + 0.5 * h * (w + after)
            w = after
        for name, value in (("rate", w), ("filtered", x[0]), ("slope", x[1])):
            tape.write(name, value)

    def read(tape: Tape) -> None:
        """Give out the filtered rate and the drive motor's current, A."""
        kt, w = tape.input("kt"), tape.read("rate")
        drive = torque(kt, tape.input("resistance"), tape.input("tau_max"), tape.input("voltage"), w)
        tape.output("rate", tape.read("filtered"))
        tape.output("drive_current", drive / kt)

    program = Program(
        base_hz=1000.0,
        start=(CallPhase(Phase("begin", begin)),),
        tick=(Unless0((CallPhase(Phase("advance", advance)),)),),
        end=(CallPhase(Phase("read", read)),),
        inputs=(*_GIVEN, *PARAMETERS),
        outputs=("rate", "drive_current"),
    )
    return backends.load(record(program), LANES)


def simulated(series: Series, sets: np.ndarray) -> np.ndarray:
    """The rate (rad/s) and the drive motor's current (A) that the model reads, [channel, step, set].

    sets  parameters [set, parameter] in the order of `PARAMETERS`, at most `LANES` sets
    """
    count = max(1, math.ceil(float(np.median(series.time)) / SUBSTEP - 1e-9))
    block_inputs = np.zeros((LANES, len(_GIVEN) + len(PARAMETERS)))
    block_inputs[:, len(_GIVEN) :] = sets[0]
    block_inputs[: len(sets), len(_GIVEN) :] = sets
    block = _kernel(count).block(block_inputs)
    steps = np.ascontiguousarray(np.column_stack([series.voltage, series.current, series.time, series.angle]))[
        :, :, None
    ]
    inputs, outputs, step = block.inputs[: len(_GIVEN)], block.outputs, block.step
    read = np.empty((len(steps), 2, LANES))
    starts = set(np.flatnonzero(np.diff(series.move, prepend=-1)).tolist())
    for n in range(len(steps)):
        inputs[:] = steps[n]
        if n in starts:
            step(0, 0)
        step(1, 1)
        read[n] = outputs
    return read.transpose(1, 0, 2)[:, :, : len(sets)]


STEP = 1e-3
"""Step of a parameter's logarithm by which derivatives are taken. It is large, for over the moves the times at which
the shaft stops average out."""

FLOOR = 1e-3
"""Half an interval is at least this share of its value, and added to in squares: what the model leaves out, such as a
torque that is uneven under load, moves all groups alike (by 0.1 % with typical faults)."""

LIMITED = 0.01
"""Share of the time at which the drive must be at its largest torque, for that to be found."""

VAGUE = 1.0
"""Half an interval of the logarithm, from which on a parameter counts as not found."""

AWAY = 0.01
"""Distance, in the parameters' logarithms, from which each group's fit begins, so that no two end in the same local
minimum."""

FIRST = 2
"""Number of groups that are fitted together first, from the data sheet's parameters."""

_TURNS = 30
_DAMPINGS = 10.0 ** np.arange(-6.0, 4.0)


@frozen
class Estimate:
    """A parameter that was found or given. value: SI;  low, high: ends of its 95 % interval, or the value itself
    where it was given"""

    value: float
    low: float
    high: float
    is_fitted: bool


@frozen
class FitResult:
    """parameters: by name, of the motor and the bed;  ripple: rms of the misalignment's torque, N m, once, twice a turn
    residual   rms of what was read less what is simulated, rad/s, by move;  rate: rms of what was read, rad/s
    limited    share of the time at which the drive was at its largest torque
    settled    whether the search came to an end
    """

    parameters: Mapping[str, Estimate]
    ripple: tuple[float, float]
    residual: np.ndarray
    rate: float
    limited: float
    settled: bool


def fitted(series: Series, groups: Sequence[int], start: Mapping[str, float]) -> FitResult:
    """The parameters of a bed (a motor and a load on one shaft) with which its model reads what the moves measured.

    groups  of each move, from 0 on;  start: parameters to begin with, of `MOTOR`

    Each group of moves is fitted by itself. The spread of their answers gives the intervals, and from their mean all
    moves are fitted together. A parameter that the moves do not tell keeps its start: `kt_load`, unless the drive
    motor's current was measured; `tau_max`, where the drive was hardly ever at its largest torque, and without that
    current `f_v` too; and each whose interval is wider than `VAGUE`.
    """
    measured = series.drive_current is not None
    sought = [name for name in MOTOR if name != "kt_load" or measured]
    parts = [series.of([move for move, its in enumerate(groups) if its == group]) for group in range(max(groups) + 1)]
    some = series.of([move for move, its in enumerate(groups) if its < FIRST])
    search = _Search(some, start)
    search.settle(sought)
    search.settle([*sought, *RIPPLE])
    limited = search.limited()
    unseen: list[str] = []
    if limited < LIMITED:
        unseen = ["tau_max"] if measured else ["tau_max", "f_v"]
    while True:
        if unseen:
            sought = [name for name in sought if name not in unseen]
            search.put(unseen, start)
            search.settle([*sought, *RIPPLE])
        settled, chance = True, np.random.default_rng(0)
        places = []
        for part in parts:
            local = search.over(part, chance.uniform(-AWAY, AWAY, len(PARAMETERS)), [*sought, *RIPPLE])
            settled = local.settle([*sought, *RIPPLE]) and settled
            places.append(local.place)
        factor = stdtrit(len(parts) - 1, 0.975) / math.sqrt(len(parts))
        half = dict(zip(PARAMETERS, (factor * np.std(places, axis=0, ddof=1)).tolist(), strict=True))
        unseen = [name for name in sought if not half[name] < VAGUE]
        if not unseen:
            break
    search = search.over(series, np.mean(places, axis=0) - search.place, [*sought, *RIPPLE])
    values = search.values()
    estimates = {}
    for name in MOTOR:
        value, wide = start[name], 1.0
        if name in sought:
            value, wide = values[name], math.exp(math.hypot(half[name], FLOOR))
        estimates[name] = Estimate(value, value / wide, value * wide, name in sought)
    ripple = [math.hypot(values[f"sin_{n}"], values[f"cos_{n}"]) / math.sqrt(2.0) for n in (1, 2)]
    residual = search.residual()
    counts = np.bincount(series.move, ~np.isnan(series.rate), minlength=series.moves)
    by_move = np.sqrt(np.bincount(series.move, residual**2, minlength=series.moves) / counts)
    rate = float(np.sqrt(np.nanmean(series.rate**2)))
    return FitResult(estimates, (ripple[0], ripple[1]), by_move, rate, limited, settled)


class _Search:
    """A search for least squares, at one place among the parameters: the logarithms of `MOTOR`, then `RIPPLE` in
    units of the dry friction that the search began with."""

    def __init__(self, series: Series, start: Mapping[str, float]) -> None:
        self._series = series
        self._unit = start["f_c"]
        self.place = np.array([*(math.log(start[name]) for name in MOTOR), *(0.0 for _ in RIPPLE)])
        self._weights = [1.0, 0.0]
        self._free: list[int] = []

    def values(self) -> dict[str, float]:
        return dict(zip(PARAMETERS, self._sets(self.place[None, :])[0].tolist(), strict=True))

    def put(self, names: Sequence[str], values: Mapping[str, float]) -> None:
        for name in names:
            self.place[PARAMETERS.index(name)] = math.log(values[name])

    def settle(self, names: Sequence[str]) -> bool:
        """Go to the nearest minimum over these parameters, by Levenberg's and Marquardt's method. Returns True where
        it was reached."""
        self._free = [PARAMETERS.index(name) for name in names]
        self._weigh()
        for _ in range(_TURNS):
            residual, slopes = self._linear()
            square, pull = slopes.T @ slopes, slopes.T @ residual
            scale = np.maximum(np.diag(square), 1e-12 * np.diag(square).max())
            steps = [-np.linalg.solve(square + np.diag(damping * scale), pull) for damping in _DAMPINGS]
            steps = [step * min(1.0, 0.5 / max(np.abs(step).max(), 1e-300)) for step in steps]
            places = np.repeat(self.place[None, :], len(steps), axis=0)
            places[:, self._free] += steps
            sums = (self._residuals(places) ** 2).sum(axis=0)
            best = int(np.argmin(sums))
            before = float(residual @ residual)
            if not sums[best] < before:
                return True
            self.place = places[best]
            if before - sums[best] < 1e-3 * before or np.abs(steps[best]).max() < 0.1 * FLOOR:
                return True
        return False

    def over(self, series: Series, away: np.ndarray, names: Sequence[str]) -> _Search:
        """The same search over another series, from a start `away` from this one in these parameters."""
        search = copy.copy(self)
        free = [PARAMETERS.index(name) for name in names]
        search._series, search.place = series, self.place.copy()
        search.place[free] += away[free]
        return search

    def residual(self) -> np.ndarray:
        """Simulated less measured rate at each step, rad/s."""
        read = simulated(self._series, self._sets(self.place[None, :]))
        return _off(read[0, :, :1], self._series.rate)[:, 0]

    def limited(self) -> float:
        """Share of the time for which the drive is at its largest torque."""
        read = simulated(self._series, self._sets(self.place[None, :]))
        values = self.values()
        drive = np.abs(read[1, :, 0]) * values["kt"]
        return float(np.mean(drive > values["tau_max"] * (1.0 - 1e-9)))

    def _sets(self, places: np.ndarray) -> np.ndarray:
        count = len(MOTOR)
        return np.column_stack([np.exp(places[:, :count]), places[:, count:] * self._unit])

    def _weigh(self) -> None:
        """Weigh rate and drive current by the inverse of their residuals."""
        if self._series.drive_current is None:
            return
        read = simulated(self._series, self._sets(self.place[None, :]))[:, :, 0]
        measured = (self._series.rate, self._series.drive_current)
        spreads = [
            float(np.std(_off(channel[:, None], column))) for channel, column in zip(read, measured, strict=True)
        ]
        self._weights = [1.0 / max(spread, 1e-9) for spread in spreads]

    def _residuals(self, places: np.ndarray) -> np.ndarray:
        """Weighted residuals [channel and step, place]."""
        read = simulated(self._series, self._sets(places))
        residuals = [self._weights[0] * _off(read[0], self._series.rate)]
        if self._series.drive_current is not None:
            residuals.append(self._weights[1] * _off(read[1], self._series.drive_current))
        return np.concatenate(residuals)

    def _linear(self) -> tuple[np.ndarray, np.ndarray]:
        """The residuals at this place, and their slopes by each free parameter."""
        count = len(self._free)
        assert 2 * count < LANES
        places = np.repeat(self.place[None, :], 2 * count + 1, axis=0)
        for n, parameter in enumerate(self._free):
            places[1 + 2 * n, parameter] += STEP
            places[2 + 2 * n, parameter] -= STEP
        residuals = self._residuals(places)
        return residuals[:, 0], (residuals[:, 1::2] - residuals[:, 2::2]) / (2.0 * STEP)


def _off(read: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Simulated less measured values [step, set]; 0 where nothing was measured."""
    return np.nan_to_num(read - measured[:, None], nan=0.0)
