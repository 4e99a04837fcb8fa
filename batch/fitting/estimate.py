"""Estimation of a deck's numbers from logs: weighted least squares of the output error, through the runs themselves.

A run is simulated with its controllers, friction and delays, and what it computes is compared with what was measured.
The numbers are moved by Levenberg's and Marquardt's steps until the weighted squares are least. Slopes are differences
of runs to both sides, over half of what the logs can tell: so decisions at ticks, such as breaking away, count by what
they change on average. Where parameters leave less of a mark together, that is tried along their own direction. A
signal's weight is the inverse of its residual's rms, and smaller where the residual is alike for long; it is found
again until it stays.

Intervals come from the scores of stretches of the logs (White, Econometrica 48, 1980; Liang and Zeger, Biometrika 73,
1986), so that they also hold where residuals are correlated in time or over signals, and are at least those of white
noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from copy import copy
from functools import cached_property

import numpy as np
from scipy import stats

from batch.fitting.logged import LoggedRuns
from batch.measured.paired import autocorrelation, usual_rows
from met.diagnostic import Problem, error
from met.frozen import frozen

STARTS, TRIED = 2, 32
"""Number of fits from elsewhere, and of random values among which these begin."""

FAR = 0.5
"""Standard deviation of such values: of the logarithm, or in sizes of the parameter."""

LOOSE = 3.0
"""Standard deviation, in sizes, with which a parameter without a prior is held to the deck's value, so that what the
logs do not tell does not run away. It counts nowhere else."""

DAMPING = tuple(10.0**power for power in range(-6, 7, 2))
"""Levenberg's and Marquardt's factors that each step tries, of the squares of the scaled slopes."""

POLISHED = (0.5, -0.5, 1.0, -1.0, 2.0, -2.0, 4.0, -4.0)
"""Moves, in standard deviations along each direction, that are tried before a descent ends: events at other ticks make
the squares rough, so that slopes alone may end too early."""

MOST_STEPS, MOST_ROUNDS = 40, 12
"""Largest number of steps, and of times that weights are found."""

CONVERGED, ENDED = 1e-3, 0.1
"""Decrease of half the weighted squares below which slopes have done what they can: a change by a twentieth of what
noise does; and that by such moves below which a descent ends."""

STEADY = 0.01
"""Change of a signal's rms below which its weight stays."""

LEAST_RMS = 1e-6
"""Least rms of a residual that weights count with, as a share of the signal's largest number."""

LEAST_NOISE = 1e-3
"""Least rms of a signal's noise, as a share of its spread, with which errors are foretold."""

CHANGE = 0.5
"""Size of the differences that slopes are made of, in standard deviations of the parameter by itself."""

PROBED = tuple(10.0**power for power in range(-12, 7))
"""Sizes, SI, that are tried of a parameter that is 0."""

MOST_CHANGE = 0.1
"""Largest difference for a slope, in sizes of its parameter."""

SIDES, EVENT = (1.0, -1.0, 0.125, -0.125), 1.5
"""Differences for a slope, in its step; and by how much the largest of them may exceed the smallest without an event
on its way."""

WEAK, TURNED = 0.5, 3
"""Singular value, of slopes that each have the length 1, below which differences are taken along its own direction; and
how often at most."""

ELSEWHERE, AS_GOOD = 25.0, 2.0
"""Change of the squares, as slopes predict it, from which on values are elsewhere; and by how much half of the squares
may be larger there, for the values to be as good."""

CONFIDENCE = 0.95
"""Confidence of intervals."""


@frozen
class Prior:
    """A normal distribution of a parameter that is known before a fit, SI."""

    mean: float
    deviation: float


@frozen
class Fit:
    """Estimated numbers, [path], SI.

    values          fitted;  size: of each, what counts as a large change
    deviation       standard errors; not-a-number of a parameter at its limit
    covariance      of the estimates, [path, path];  factor: times a deviation is half of a 95 % interval
    wider           of each deviation, how much larger it is than white noise would make it
    at_limit        whether values above or below are not allowed;  held: whether neither is
    slopes          of the weighted residuals, [number, path], with the priors' rows last
    residuals       [number];  weights: their inverse rms, 0 for outliers
    steps           how many there were;  converged: whether they ended by themselves
    rival           other values from elsewhere that explain the logs as well, or None
    """

    values: np.ndarray
    size: np.ndarray
    deviation: np.ndarray
    covariance: np.ndarray
    factor: float
    wider: np.ndarray
    at_limit: np.ndarray
    held: np.ndarray
    slopes: np.ndarray
    residuals: np.ndarray
    weights: np.ndarray
    steps: int
    converged: bool
    rival: np.ndarray | None

    @property
    def outliers(self) -> int:
        """Number of measured numbers that are left out."""
        return int(np.sum(self.weights == 0.0))


def noise_of(logs: LoggedRuns) -> np.ndarray:
    """The rms of the noise of each signal, by its second differences (von Neumann), [signal]; `LEAST_NOISE` of its
    spread at least, for of a smooth or filtered signal these tell nothing."""
    noises = []
    for run in logs.runs:
        for number in range(len(run.channels)):
            measured = run.measured[run.channel_of == number]
            curved = np.diff(measured, 2)
            rms = float(np.sqrt(np.mean(curved**2) / 6.0)) if len(curved) else 0.0
            noises.append(max(rms, LEAST_NOISE * float(np.std(measured)), 1e-300))
    return np.array(noises)


class Fitter:
    """The search for numbers with which runs compute what logs measured.

    logs      the runs beside their logs;  start: the deck's values, SI, [path]
    priors    by path
    progress  called with the number of runs so far

    Raises Problem E480 where the runs fail as they are.
    """

    def __init__(
        self,
        logs: LoggedRuns,
        start: np.ndarray,
        priors: Mapping[str, Prior],
        progress: Callable[[int], None] = lambda _: None,
    ) -> None:
        """Run the deck's own values, and take weights, sizes and differences from their residuals. Raises Problem
        E480."""
        self.logs, self.start, self._progress = logs, start, progress
        self._mean = np.array([priors[path].mean if path in priors else 0.0 for path in logs.paths])
        self._pull = np.array([1.0 / priors[path].deviation if path in priors else 0.0 for path in logs.paths])
        self.runs = self.steps = 0
        self._loose = np.zeros(len(start))
        self._first = self._residuals(start[None, :])[0]
        if not np.isfinite(self._first).all():
            raise _fails(logs, start)
        self._floor = self._least_rms()
        self.weights = self._weighed(self._first)
        self.size = self._sizes()
        self._loose = np.where(self._pull > 0.0, 0.0, 1.0 / (LOOSE * self.size))
        self._step = self._probed()

    def fit(self) -> Fit:
        """The fit from the deck's values and from elsewhere, the best of them."""
        ends = [self._minimised(begin) for begin in (self.start, *self._elsewhere())]
        values, cost, converged = min(ends, key=lambda end: end[1])
        for _ in range(MOST_ROUNDS):
            before = self.weights
            self.weights = self._weighed(self._residuals(values[None, :])[0], settled=True)
            values, cost, converged = self._minimised(values)
            both = (before > 0.0) & (self.weights > 0.0)
            if np.all(np.abs(before[both] / self.weights[both] - 1.0) < STEADY):
                break
        residuals, slopes = self._slopes(values)
        return self._answer(values, residuals, slopes, converged, self._rival(ends, values, cost, slopes))

    @cached_property
    def held(self) -> np.ndarray:
        """True for each parameter that cannot be moved up or down by itself, since the deck refuses all values beside
        its own, [path]."""
        moves = np.diag(1e-6 * self.size)
        refused = self.logs.refused(np.vstack([self.start + moves, self.start - moves]))
        return np.array(np.all(refused.reshape(2, -1), axis=0))

    def slopes_at_start(self, noise: np.ndarray) -> np.ndarray:
        """The slopes at the deck's values, of residuals weighted by the inverse of a noise, with the priors' rows last,
        [number, path]. noise: rms of each signal"""
        self.weights = 1.0 / noise[self.logs.signal_of]
        self._step = self._probed()
        return self._weighted(self._slopes(self.start)[1])

    def promised_slopes(self, motion: LoggedRuns, noise: np.ndarray) -> np.ndarray:
        """The slopes of runs that are not logged, at the deck's values, weighted by the inverse of a noise, [number,
        path]. Their differences begin at the size of the last ones. noise: rms of each signal"""
        fitter = copy(self)
        fitter.logs, fitter.weights = motion, 1.0 / noise[motion.signal_of]
        fitter._slopes(self.start)
        return np.asarray(fitter.weights[:, None] * fitter._slopes(self.start)[1])

    # Numbers of runs

    def _residuals(self, values: np.ndarray) -> np.ndarray:
        """Residuals of runs with these values, [trial, number]; the runs are counted."""
        residuals = self.logs.residuals(values)
        self.runs += len(values) * len(self.logs.runs)
        self._progress(self.runs)
        return residuals

    def _costs(self, residuals: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Half of the weighted squares, priors included, [case]; infinite where a case fails."""
        squares = np.sum((self.weights * residuals) ** 2, axis=1)
        squares = np.where(np.isfinite(squares), squares, np.inf)
        pulled = np.sum((self._pull * (values - self._mean)) ** 2 + (self._loose * (values - self.start)) ** 2, axis=1)
        return np.asarray(0.5 * (squares + pulled))

    def _least_rms(self) -> np.ndarray:
        """The least rms that residuals of each signal count with, a share of its largest measured number, [signal]."""
        signal = self.logs.signal_of
        largest = np.zeros(int(signal.max()) + 1)
        np.maximum.at(largest, signal, np.abs(self.logs.measured))
        return np.maximum(LEAST_RMS * largest, 1e-300)

    def _weighed(self, residuals: np.ndarray, *, settled: bool = False) -> np.ndarray:
        """The weights of numbers by their signals' rms, [number]. settled: residuals of a fit, whose outliers get none
        as long as they are few, and of which those that are alike for long count as fewer"""
        signal, weights = self.logs.signal_of, np.zeros(len(residuals))
        for number, floor in enumerate(self._floor):
            (rows,) = np.nonzero(signal == number)
            own = residuals[rows]
            if not len(own):
                continue
            alike = 1.0
            if settled:
                usual = usual_rows(own)
                rows, own = rows[usual], own[usual]
                alike = _memory(own)
            weights[rows] = 1.0 / (max(float(np.sqrt(np.mean(own**2))), floor) * math.sqrt(alike))
        return weights

    # Sizes of parameters, and of the differences for slopes

    def _sizes(self) -> np.ndarray:
        """The size of a large change of each parameter: its value; of one that is 0 its prior's deviation, or what
        changes the weighted residuals by as much as they are."""
        with np.errstate(divide="ignore"):
            size = np.where(self.start != 0.0, np.abs(self.start), np.where(self._pull > 0.0, 1.0 / self._pull, 0.0))
        for place in np.flatnonzero((size == 0.0) | ~np.isfinite(size)):
            size[place] = self._step_from_zero(int(place))
        return size

    def _step_from_zero(self, place: int) -> float:
        """The size of a change of a parameter whose value is 0, SI: the first of `PROBED` by which the squared changes
        of the weighted residuals add up to a hundredth of their number."""
        squares = self._squared_changes(place, np.array(PROBED))
        large = np.flatnonzero(squares >= 0.01 * np.count_nonzero(self.weights))
        return PROBED[int(large[0])] if len(large) else 1.0

    def _probed(self) -> np.ndarray:
        """First differences for slopes: those by which the residuals change by `CHANGE` of what noise does, by a ladder
        of powers of ten, [path]."""
        ladder = 10.0 ** np.arange(-7.0, 0.0)
        step = self.size.copy()
        for place in range(len(step)):
            change = np.sqrt(self._squared_changes(place, ladder * self.size[place]))
            large = np.flatnonzero(change >= CHANGE)
            step[place] *= ladder[int(large[0])] if len(large) else ladder[-1]
        return step

    def _squared_changes(self, place: int, moves: np.ndarray) -> np.ndarray:
        """By how much the weighted residuals change where a parameter moves by each of these, SI, up or down: the
        larger sum of squares, [move]; 0 where both fail."""
        values = np.tile(self.start, (2 * len(moves), 1))
        values[:, place] += np.concatenate([moves, -moves])
        squares = np.sum((self.weights * (self._residuals(values) - self._first)) ** 2, axis=1)
        return np.asarray(np.where(np.isfinite(squares), squares, 0.0).reshape(2, -1).max(axis=0))

    def _slopes(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residuals and their slopes, [number], [number, path]. Differences are by `CHANGE` of the deviations that
        the last slopes gave: first those of each parameter by itself, then those of changes of several that leave less
        of a mark together. Small differences would hide that, since events leave marks of their own."""
        middle, changes = self._changes(values, np.diag(self._step))
        slopes = np.where(np.isfinite(changes), changes, 0.0) / self._step
        for _ in range(TURNED):
            scale = np.linalg.norm(self._weighted(slopes), axis=0)
            scale[scale == 0.0] = 1.0
            _, singular, right = np.linalg.svd(self._weighted(slopes) / scale, full_matrices=False)
            weak = singular < WEAK
            with np.errstate(divide="ignore"):
                far = np.minimum(CHANGE / singular, MOST_CHANGE / np.abs(right / scale / self.size).max(axis=1))[weak]
            moves = far[:, None] * right[weak] / scale
            _, changes = self._changes(values, moves)
            lacks = np.where(np.isfinite(changes), changes - slopes @ moves.T, 0.0) / far
            slopes = slopes + lacks @ (right[weak] * scale)
            if np.all(np.linalg.norm(self.weights[:, None] * lacks, axis=0) * far < 0.5 * CHANGE):
                break
        with np.errstate(divide="ignore"):
            wanted = CHANGE / np.linalg.norm(self._weighted(slopes), axis=0)
        self._step = np.clip(wanted, 1e-7 * self.size, MOST_CHANGE * self.size)
        return middle, slopes

    def _changes(self, values: np.ndarray, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residuals, [number], and by how much each move changes them, [number, move]: the mean of differences near
        and far on both sides, without those that are refused or have an event on their way; not-a-number where all are.
        moves: of values, [move, path]"""
        residuals = self._residuals(np.vstack([values, *(values + side * moves for side in SIDES)]))
        middle, moved = residuals[0], residuals[1:].reshape(len(SIDES), len(moves), residuals.shape[1])
        changes = np.full((len(middle), len(moves)), np.nan)
        for place in range(len(moves)):
            sides = (moved[:, place] - middle) / np.array(SIDES)[:, None]
            sizes = np.linalg.norm(self.weights * sides, axis=1)
            sides, sizes = sides[np.isfinite(sizes)], sizes[np.isfinite(sizes)]
            if len(sizes):
                changes[:, place] = sides[sizes <= EVENT * sizes.min()].mean(axis=0)
        return middle, changes

    def _weighted(self, slopes: np.ndarray) -> np.ndarray:
        return np.vstack([self.weights[:, None] * slopes, np.diag(self._pull)])

    # The search

    def _elsewhere(self) -> np.ndarray:
        """The values at which other fits begin: those of the better quarter of random values that are farthest apart,
        SI, [start, path]."""
        draws = FAR * np.random.default_rng(0).standard_normal((TRIED, len(self.start)))
        values = self._values_of(draws)
        costs = self._costs(self._residuals(values), values)
        good = [place for place in np.argsort(costs, kind="stable")[: TRIED // 4] if np.isfinite(costs[place])]
        chosen = [np.zeros(len(self.start))]
        while good and len(chosen) <= STARTS:
            apart = [min(float(np.linalg.norm(draws[place] - draw)) for draw in chosen) for place in good]
            chosen.append(draws[good.pop(int(np.argmax(apart)))])
        return self._values_of(np.array(chosen[1:]).reshape(-1, len(self.start)))

    def _values_of(self, draws: np.ndarray) -> np.ndarray:
        return np.where(self.start != 0.0, self.start * np.exp(draws), self.size * np.abs(draws))

    def _minimised(self, values: np.ndarray) -> tuple[np.ndarray, float, bool]:
        """The values at the end of a descent, half of their squares, and whether it ended by itself."""
        cost = np.inf
        for _ in range(MOST_STEPS):
            self.steps += 1
            residuals, slopes = self._slopes(values)
            cost = float(self._costs(residuals[None, :], values[None, :])[0])
            pulls = self._pull * (values - self._mean), self._loose * (values - self.start)
            pulled = np.concatenate([self.weights * residuals, *pulls])
            weighted = np.vstack([self._weighted(slopes), np.diag(self._loose)])
            scale = np.linalg.norm(weighted, axis=0)
            scale[scale == 0.0] = np.inf
            left, singular, right = np.linalg.svd(weighted / scale, full_matrices=False)
            along = singular * (left.T @ pulled)
            moves = np.array([right.T @ (along / (singular**2 + damping)) / scale for damping in DAMPING])
            before, (values, cost) = cost, self._best(values, cost, values - moves)
            if before - cost < CONVERGED:
                known = singular > 1e-9 * singular[0]
                along_each = [right[known] / singular[known, None] / scale, np.diag(1.0 / scale)]
                sides = np.vstack([direction * move for move in POLISHED for direction in along_each])
                before, (values, cost) = cost, self._best(values, cost, values + sides)
                if before - cost < ENDED:
                    return values, cost, True
        return values, cost, False

    def _best(self, values: np.ndarray, cost: float, trials: np.ndarray) -> tuple[np.ndarray, float]:
        """The best of values and trials, with half of its squares."""
        trials = self._allowed(values, trials)
        costs = self._costs(self._residuals(trials), trials)
        best = int(np.argmin(costs))
        return (trials[best], float(costs[best])) if costs[best] < cost else (values, cost)

    def _allowed(self, values: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """Trials with each number that its parameter cannot have moved towards its value as far as needed, [trial,
        path]."""
        trials, shares = trials.copy(), np.linspace(0.0, 1.0, 65)
        for row in np.flatnonzero(self.logs.refused(trials)):
            for place in range(len(values)):
                low, high = values[place], trials[row, place]
                for _ in range(3):
                    ladder = np.tile(values, (len(shares), 1))
                    ladder[:, place] = low + shares * (high - low)
                    bad = np.flatnonzero(self.logs.refused(ladder))
                    if not len(bad) or bad[0] == 0:
                        break
                    low, high = ladder[bad[0] - 1, place], ladder[bad[0], place]
                    trials[row, place] = low
        return trials

    def _rival(
        self, ends: list[tuple[np.ndarray, float, bool]], values: np.ndarray, cost: float, slopes: np.ndarray
    ) -> np.ndarray | None:
        """An end of another descent that explains the logs as well, and is elsewhere by what the slopes say."""
        weighted = self._weighted(slopes)
        for end, _, _ in ends:
            if float(np.sum((weighted @ (end - values)) ** 2)) > ELSEWHERE:
                other, its_cost, converged = self._minimised(end)
                elsewhere = float(np.sum((weighted @ (other - values)) ** 2)) > ELSEWHERE
                if converged and elsewhere and its_cost < cost + AS_GOOD:
                    return other
        return None

    # What the fit is worth

    def _answer(
        self, values: np.ndarray, residuals: np.ndarray, slopes: np.ndarray, converged: bool, rival: np.ndarray | None
    ) -> Fit:
        """The fit that ends at these values, SI [path], with its covariance, and which of the values are at their
        limits."""
        weighted, least = self._weighted(slopes), 1e-6 * self.size
        beside = np.vstack([values + np.diag(least), values - np.diag(least)])
        at_limit = np.array(np.any(self.logs.refused(beside).reshape(2, -1), axis=0))
        free = np.flatnonzero(~at_limit & (np.linalg.norm(weighted, axis=0) > 0.0))
        covariance = np.full((len(values), len(values)), np.nan)
        factor, wider = 2.0, np.ones(len(values))
        if len(free):
            scale = np.linalg.norm(weighted[:, free], axis=0)
            inverse = np.linalg.pinv((weighted[:, free] / scale).T @ (weighted[:, free] / scale), rcond=1e-14)
            inverse = inverse / np.outer(scale, scale)
            scored = self.weights[:, None] * slopes[:, free] * (self.weights * residuals)[:, None]
            stretch = self.logs.stretch_of
            scores = np.zeros((int(stretch.max()) + 1, len(free)))
            np.add.at(scores, stretch, scored)
            many = len(scores)
            meat = scores.T @ scores * many / max(1, many - len(free)) + np.diag(self._pull[free] ** 2)
            clustered = inverse @ meat @ inverse
            wider[free] = np.sqrt(np.maximum(1.0, np.diag(clustered) / np.diag(inverse)))
            covariance[np.ix_(free, free)] = inverse * np.outer(wider[free], wider[free])
            factor = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, max(1, many - len(free))))
        return Fit(
            values,
            self.size,
            np.sqrt(np.diag(covariance)),
            covariance,
            factor,
            wider,
            at_limit,
            self.held,
            weighted,
            residuals,
            self.weights,
            self.steps,
            converged,
            rival,
        )


def _memory(residuals: np.ndarray) -> float:
    """Number of residuals that count as one: their integrated autocorrelation, up to the first lag at which there is
    none (Geyer, Statistical Science 7, 1992); 1 of white noise."""
    correlation = autocorrelation(residuals)
    if correlation[-1] == 1.0:
        return 1.0
    none = np.flatnonzero(correlation < 2.0 / math.sqrt(len(residuals)))
    return max(1.0, 2.0 * float(np.sum(correlation[: int(none[0]) if len(none) else None])) - 1.0)


def _fails(logs: LoggedRuns, start: np.ndarray) -> Problem:
    """The error that a run fails with the deck's values (E480)."""
    for run in logs.runs:
        if not np.isfinite(run.computed(start[None, :])).all():
            message = f"`{run.deck_run.name}` fails with the deck's values: {run.cause(start)}"
            helps = "a fit begins where the run goes through: `--set` other values, or a shorter `duration`"
            return Problem(error("E480", message, run.deck_run.experiment.place, help=helps))
    raise AssertionError
