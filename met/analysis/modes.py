"""The modes of a linearised step, each with the true mode: which of them the step makes grow, damps, or misses.

An eigenvalue mu of the step's map M belongs to the one of dx/dt = A x whose motion it follows: with the left and right
eigenvectors l and r of M, lambda = l A r/(l r), which is exact where M is a function of A, as of every Runge-Kutta
method. Where eigenvectors fall together, as of a swing at the limit of damping, it is the eigenvalue of A that the
integrator maps nearest to mu. In truth a step multiplies the mode by exp(lambda h).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from met.analysis.step_map import StepMap, linear_step
from met.frozen import frozen
from met.integrators.integrator import Integrator
from met.plan import Schedule

SLOW = 0.01
"""h |lambda| up to which every step follows the mode."""

FAST = 0.5
"""h |lambda| above which a step is long for a mode, though it may be stable: `modified_euler` is then 3 % off in a step
of a decay."""

TELLING = 0.1
"""Share of a mode's size at its start by which the run may differ from the truth."""

TURNS = 0.1
"""Rate of rotation of the arm, as a share of |lambda|, above which a mode is not analysed: it changes while it
swings."""

FITS = 0.01
"""Share of a mode's size by which the run may differ from the truth at a proposed rate, where the mode grows."""

FINEST = 1000
"""Factor on the base rate beyond which no rate is proposed."""

NEAR = 0.1
"""Share by which lambda may differ from the nearest eigenvalue of A; beyond, that eigenvalue is used: semi-implicit
Euler splits a double root."""

TOGETHER = 300.0
"""Sum of |l_i r_i|, where that of l_i r_i is 1, above which eigenvectors count as coincident."""

MANY = 300
"""Number of eigenvectors above which their inverse is taken without singular values, in a fifth of the time."""

LEAST = 1e-7
"""Smallest growth of a step, its logarithm, that differences resolve."""


@frozen
class Mode:
    """One mode of a case's step.

    root    lambda, 1/s;  factor: mu
    turns   whether the arm turns too fast for it to be one, so that only its speed is known
    names   of what is changed;  weights: l_i r_i of each
    """

    lane: int
    case: int
    loose: bool
    root: complex
    factor: complex
    turns: bool
    names: tuple[str, ...]
    weights: np.ndarray

    @property
    def shares(self) -> tuple[tuple[str, float], ...]:
        """The share of each name in the mode, largest first: the sum is 1."""
        sizes = np.abs(self.weights) / np.sum(np.abs(self.weights))
        return tuple((self.names[k], float(sizes[k])) for k in np.argsort(-sizes).tolist())

    @property
    def growth(self) -> float:
        """ln |mu|, the growth of a step."""
        return math.log(abs(self.factor)) if self.factor else -math.inf

    def grown(self, h: float, steps: int) -> float:
        """ln of the growth over the steps of a run, where the mode grows and in truth does not; else 0."""
        if self.turns or self.growth <= LEAST:
            return 0.0
        return max(0.0, steps * (self.growth - max(0.0, h * self.root.real)))

    def grows_in_truth(self, h: float) -> bool:
        """True where at least half of its growth is not due to the step."""
        return 0.0 < self.growth <= 2.0 * h * self.root.real

    def missed(self, h: float, steps: int) -> tuple[float, float, int]:
        """Its size in the run and in truth, as shares of that at its start, and the step after which they differ most;
        (1, 1, 0) of a mode that grows, or does not swing."""
        a, b = -h * self.root.real, -self.growth
        if self.turns or min(a, b) < -LEAST or abs(self.root.imag) <= abs(self.root.real) or not math.isfinite(b):
            return 1.0, 1.0, 0
        a, b = max(a, 0.0), max(b, 0.0)
        k = steps if a == b or min(a, b) == 0.0 else min(steps, max(1, round(math.log(b / a) / (b - a))))
        return math.exp(-k * b), math.exp(-k * a), k


def modes(step_map: StepMap, integrator: Integrator) -> Iterator[Mode]:
    """All modes that are not slow, of all lanes; of a pair, the one with positive frequency."""
    h = step_map.h
    lanes = np.flatnonzero(np.isfinite(step_map.slope).all((1, 2)))
    truths = np.linalg.eigvals(step_map.slope[lanes])
    wanted = np.any(np.abs(truths) * h > SLOW, axis=1)
    lanes, truths = lanes[wanted], truths[wanted]
    A = step_map.slope[lanes]
    with np.errstate(all="ignore"):
        M = step_map.step[lanes] if step_map.step is not None else linear_step(integrator, A, step_map.positions, h)
    numbers = np.isfinite(M).all((1, 2))
    lanes, truths, A, M = (array[numbers] for array in (lanes, truths, A, M))
    if not lanes.size:
        return
    factors, right = np.linalg.eig(M)
    left = _inverse(right)
    weights = left * np.swapaxes(right, 1, 2)
    sums = weights.sum(2)
    with np.errstate(all="ignore"):
        roots = ((left @ A) * np.swapaxes(right, 1, 2)).sum(2) / sums
        apart = np.abs(weights).sum(2) < TOGETHER * np.abs(sums)
    forward = factors.imag >= 0.0
    together = np.flatnonzero((forward & ~apart).any(1))
    answers = {}
    for place, found_roots, found_factors in zip(together.tolist(), *_answers(A[together], integrator, h), strict=True):
        answers[place] = found_roots, found_factors
    for place, lane in enumerate(lanes.tolist()):
        for i in np.flatnonzero(forward[place]).tolist():
            root, factor = complex(roots[place, i]), complex(factors[place, i])
            if not apart[place, i]:
                root = complex(answers[place][0][np.argmin(np.abs(answers[place][1] - factor))])
            nearest = complex(truths[place][np.argmin(np.abs(truths[place] - root))])
            if abs(nearest - root) > NEAR * abs(root):
                root = nearest
            if not max(abs(root) * h, abs(factor - 1.0)) > SLOW:
                continue
            turns = bool(step_map.rate[lane] > TURNS * abs(root))
            case, loose = int(step_map.case[lane]), bool(step_map.loose[lane])
            yield Mode(lane, case, loose, root, factor, turns, step_map.names, weights[place, i])


def _inverse(right: np.ndarray) -> np.ndarray:
    """The left eigenvectors of these right ones, [lane, any, any]; of many, without the factorisation that costs most,
    where they allow it."""
    if right.shape[-1] > MANY:
        with contextlib.suppress(np.linalg.LinAlgError):
            left = np.linalg.inv(right)
            if np.isfinite(left).all():
                return left
    return np.linalg.pinv(right)


def _answers(A: np.ndarray, integrator: Integrator, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues of A, [lane, any], each with the integrator's factor for it: as of a swing, or of a lone state."""
    if not len(A):
        return np.zeros((0, 0)), np.zeros((0, 0))
    roots = np.linalg.eigvals(A)
    swings = np.zeros((*roots.shape, 2, 2))
    swings[..., 0, 1] = 1.0
    with np.errstate(all="ignore"):
        swings[..., 1, 0], swings[..., 1, 1] = -(np.abs(roots) ** 2), 2.0 * roots.real
        motions = linear_step(integrator, swings, 1, h)
        lone = linear_step(integrator, roots.real[..., None, None], 0, h)[..., 0]
    finite = np.isfinite(motions).all(axis=(-2, -1))  # steps of the fastest ones may overflow
    factors = np.linalg.eigvals(np.where(finite[..., None, None], motions, 0.0))
    factors = np.where(finite[..., None], factors, np.inf)
    every = np.concatenate([factors, np.where(roots.imag[..., None] == 0.0, lone, np.inf)], axis=-1)
    every[roots.imag < 0.0] = np.inf
    return np.repeat(roots, 3, axis=1), every.reshape(len(A), -1)


def of_lane(step_map: StepMap, lane: int, h: float) -> StepMap:
    """One lane alone, whose step is of h s."""
    own = slice(lane, lane + 1)
    return replace(
        step_map,
        case=step_map.case[own],
        loose=step_map.loose[own],
        slope=step_map.slope[own],
        step=None,
        rate=step_map.rate[own],
        h=h,
    )


def finer(schedule: Schedule) -> list[tuple[float, int]]:
    """Rates of the dynamics that fit the run, from the next faster one on, Hz, and the steps of the run."""
    divisors = (n for n in range(schedule.dynamics - 1, 0, -1) if schedule.ticks % n == 0)
    rates = [(schedule.base_hz / n, schedule.ticks // n) for n in divisors]
    return rates + [(schedule.base_hz * times, schedule.ticks * times) for times in range(2, FINEST + 1)]


def slowest(
    step_map: StepMap, mode: Mode, integrator: Integrator, schedule: Schedule, *, follows: bool
) -> float | None:
    """The slowest faster rate of the dynamics at which no mode of the lane grows, Hz; None: none that is sensible.

    follows  whether it is to follow all that swings over the run, and to have no mode that is fast
    """
    rates = finer(schedule)
    low, high = 0, len(rates)
    while low < high:
        middle = (low + high) // 2
        hz, steps = rates[middle]
        h = 1.0 / hz
        at_rate = of_lane(step_map, mode.lane, h)
        if all(_fits(other, h, steps, follows) for other in modes(at_rate, integrator)):
            high = middle
        else:
            low = middle + 1
    return rates[low][0] if low < len(rates) else None


def _fits(mode: Mode, h: float, steps: int, follows: bool) -> bool:
    """True where a mode grows by no more than it may in `steps` steps of h s; follows: and is followed by them"""
    if mode.grown(h, steps) > np.log1p(FITS):
        return False
    run, truth, _ = mode.missed(h, steps)
    return not follows or (abs(run - truth) <= TELLING and h * abs(mode.root) <= FAST * (1.0 + 1e-6))
