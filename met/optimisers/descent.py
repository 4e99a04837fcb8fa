"""Descent by exact slopes to the least of a worst value: sequential quadratic programming in a trust region.

The function to minimise is the largest of pieces, each a smooth function with hinges w max(0, h) added: such are the
worst of several plants, and the price of values near a limit or beyond it. Each step solves the problem with all
functions linearised, and one curvature for all, that of the Lagrangian by Powell's damped BFGS (Nocedal and Wright,
*Numerical Optimization*, 2006, procedures 18.2 and 18.5). At a corner where as many pieces and hinges meet as there are
dimensions it needs no curvature, and in a smooth valley few pieces.

A step is found by Mehrotra's predictor and corrector (SIAM J. Optimization 2 (1992) 575) on the reduced equations, for
tens of unknowns. Library solvers add in an order that depends on the processor, and a search that branches on their
results would run other cases.
"""

from __future__ import annotations

import math

import numpy as np

from met.frozen import frozen
from met.optimisers.arithmetic import added, lower_factor, total

QUADRATIC_STEPS = 60
"""Largest number of steps; a dozen are usual."""

EXACT = 1e-11
"""Residuals and gap at which it has converged, for numbers of the size of 1."""

LARGEST = 1e15
"""Largest multiplier; larger ones mean that the limits leave no point."""

SHORT = 0.995
"""The share of the way to the nearest limit that a step goes."""


def least_within(
    curvature: np.ndarray, slope: np.ndarray, rows: np.ndarray, limits: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """The z with the least z'Hz / 2 + c'z where A z <= b, and the multiplier of each row; None where none is found.

    curvature  H, [n, n], positive semidefinite;  slope: c, [n];  rows: A, [row, n], which bound z;  limits: b, [row]
    """
    z, multipliers = np.zeros(len(slope)), np.ones(len(limits))
    slack = np.maximum(limits, 1.0)
    for _ in range(QUADRATIC_STEPS):
        steepness = _product(curvature, z) + slope + _product(rows.T, multipliers)
        excess = _product(rows, z) + slack - limits
        gap = total(slack * multipliers) / len(limits)
        if max(float(np.abs(steepness).max()), float(np.abs(excess).max()), gap) < EXACT:
            return z, multipliers
        if float(multipliers.max()) > LARGEST:
            return None
        weights = multipliers / slack
        factor = lower_factor(curvature + added(weights[:, None, None] * rows[:, :, None] * rows[:, None, :]))
        if factor is None:
            return None
        equations = factor, rows, slack, multipliers, steepness, excess
        _, slack_move, multiplier_move = _moves(*equations, slack * multipliers)
        reach = min(_reach(slack, slack_move), _reach(multipliers, multiplier_move))
        after = total((slack + reach * slack_move) * (multipliers + reach * multiplier_move)) / len(limits)
        centre = gap * (after / gap) * (after / gap) * (after / gap)
        move, slack_move, multiplier_move = _moves(
            *equations, slack * multipliers + slack_move * multiplier_move - centre
        )
        reach = SHORT * min(_reach(slack, slack_move), _reach(multipliers, multiplier_move))
        z, slack, multipliers = z + reach * move, slack + reach * slack_move, multipliers + reach * multiplier_move
    return None


def _moves(
    factor: np.ndarray,
    rows: np.ndarray,
    slack: np.ndarray,
    multipliers: np.ndarray,
    steepness: np.ndarray,
    excess: np.ndarray,
    complements: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newton's step of the unknowns, the slacks and the multipliers, which takes these residuals to 0."""
    right = -steepness - _product(rows.T, (multipliers * excess - complements) / slack)
    move = _solved(factor, right)
    slack_move = -excess - _product(rows, move)
    return move, slack_move, -(complements + multipliers * slack_move) / slack


def _reach(values: np.ndarray, move: np.ndarray) -> float:
    """The share of a move, at most 1, after which the first of these values would be 0."""
    falls = move < 0.0
    return float(min(1.0, (values[falls] / -move[falls]).min(initial=1.0)))


def _product(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return added((matrix * vector[None, :]).T) if matrix.shape[1] else np.zeros(len(matrix))


def _solved(factor: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution x of L L' x = right."""
    out = right.copy()
    for i in range(len(out)):
        out[i] /= factor[i, i]
        out[i + 1 :] -= factor[i + 1 :, i] * out[i]
    for i in reversed(range(len(out))):
        out[i] /= factor[i, i]
        out[:i] -= factor[i, :i] * out[i]
    return out


RADIUS = 0.1
"""Largest first step of a coordinate, in edges of the cube; no step is longer than LONGEST."""

LONGEST = 0.3

FINEST = 1e-5
"""The descent ends where no step of this length improves: on the edge of an event, beyond which the slopes do not
hold."""

CONVERGED = 1e-5
"""The descent has converged where the linearised functions promise an improvement of no more than this share."""

STEPS = 60
"""Largest number of points that are asked for."""

ON = 1e-9
"""A move that ends nearer to a bound than this ends on it."""

GOOD, POOR = 0.75, 0.25
"""Shares of the promised improvement above which the next step may be twice as long, and below which it is half as
long."""


@frozen
class LocalModel:
    """A function of the unit cube at a point: the largest of the pieces, each with the hinges on it.

    pieces  [piece];  piece_slopes: [piece, dimension]
    hinges  [hinge];  hinge_slopes: [hinge, dimension];  piece_of: [hinge], the number of its piece;  weights: [hinge]
    """

    pieces: np.ndarray
    piece_slopes: np.ndarray
    hinges: np.ndarray
    hinge_slopes: np.ndarray
    piece_of: np.ndarray
    weights: np.ndarray

    @property
    def value(self) -> float:
        """The function's value at the point."""
        return self.after(np.zeros(self.piece_slopes.shape[1]))

    def after(self, move: np.ndarray) -> float:
        """The function's value after a move, [dimension]."""
        values = self.pieces + added((self.piece_slopes * move).T)
        if len(self.hinges):
            np.add.at(
                values, self.piece_of, self.weights * np.maximum(0.0, self.hinges + added((self.hinge_slopes * move).T))
            )
        return float(values.max())

    def lagrangian_slope(self, multipliers: np.ndarray) -> np.ndarray:
        """The slope of pieces and hinges weighted by these multipliers, [piece, then hinge]; [dimension]."""
        return added(np.concatenate([self.piece_slopes, self.hinge_slopes]) * multipliers[:, None])


class SlopeDescent:
    """A descent over the unit cube that tries one point at a time, from a given first one.

    point      [dimension], the best so far;  worth: of it: smaller is better
    converged  whether the slopes there promise nothing more
    """

    def __init__(self, point: np.ndarray, worth: float, model: LocalModel) -> None:
        self.point, self.worth, self.converged = np.array(point, float), worth, False
        self._model, self._radius, self._left = model, RADIUS, STEPS
        self._curvature = np.zeros((len(point), len(point)))
        self._move, self._promise = np.zeros(len(point)), 0.0
        self._multipliers = np.zeros(len(model.pieces) + len(model.hinges))

    def ask(self) -> np.ndarray:
        """The next point, [1, dimension]; [0, dimension] after the end."""
        none = np.empty((0, len(self.point)))
        while self._left > 0 and self._radius >= FINEST:
            self._left -= 1
            solution = step(self._model, self._curvature, np.maximum(-self.point, -self._radius),
                         np.minimum(1.0 - self.point, self._radius))  # fmt: skip
            if solution is None:
                self._radius *= POOR
                continue
            self._move, self._multipliers = solution
            bent = 0.5 * total(self._move * added((self._curvature * self._move[None, :]).T))
            self._promise = self._model.value - self._model.after(self._move) - bent
            if not self._promise > CONVERGED * abs(self._model.value):
                self.converged = True
                return none
            return np.clip(self.point + self._move, 0.0, 1.0)[None]
        return none

    def tell(self, worth: float, model: LocalModel | None) -> None:
        """Take the worth of the point that was asked last, and the local model there; None where it has no slopes."""
        length = float(np.abs(self._move).max())
        if model is not None and len(model.pieces) + len(model.hinges) == len(self._multipliers):
            change = model.lagrangian_slope(self._multipliers) - self._model.lagrangian_slope(self._multipliers)
            self._curvature = updated(self._curvature, self._move, change)
        if model is None or not worth < self.worth:
            self._radius = POOR * length
            return
        ratio = (self._model.value - model.value) / self._promise
        if ratio < POOR:
            self._radius = 0.5 * length
        elif ratio > GOOD and length > 0.9 * self._radius:
            self._radius = min(2.0 * self._radius, LONGEST)
        self.point, self.worth, self._model = np.clip(self.point + self._move, 0.0, 1.0), worth, model


def step(
    model: LocalModel, curvature: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """The best move between two bounds, [dimension], by the linearised functions and the curvature, with the
    multipliers of pieces and hinges; None where none is found."""
    n, pieces = len(low), len(model.pieces)
    size = abs(model.value) or 1.0
    reach = added((np.abs(model.hinge_slopes) * np.maximum(-low, high)).T) if len(model.hinges) else np.zeros(0)
    near = np.flatnonzero(model.hinges + reach > 0.0)
    unknowns = n + 1 + len(near)
    piece_rows = np.zeros((pieces, unknowns))
    piece_rows[:, :n], piece_rows[:, n] = model.piece_slopes / size, -1.0
    piece_rows[model.piece_of[near], n + 1 + np.arange(len(near))] = model.weights[near] / size
    hinge_rows = np.zeros((len(near), unknowns))
    hinge_rows[:, :n] = model.hinge_slopes[near]
    hinge_rows[:, n + 1 :] = -np.eye(len(near))
    ends = np.zeros((2 * n + len(near), unknowns))
    ends[:n, :n], ends[n : 2 * n, :n] = np.eye(n), -np.eye(n)
    ends[2 * n :, n + 1 :] = -np.eye(len(near))
    limits = np.concatenate([-model.pieces / size, -model.hinges[near], high, -low, np.zeros(len(near))])
    whole = np.zeros((unknowns, unknowns))
    whole[:n, :n] = curvature / size
    slope = np.zeros(unknowns)
    slope[n] = 1.0
    solution = least_within(whole, slope, np.concatenate([piece_rows, hinge_rows, ends]), limits)
    if solution is None:
        return None
    multipliers = np.zeros(pieces + len(model.hinges))
    multipliers[:pieces] = solution[1][:pieces]
    multipliers[pieces + near] = solution[1][pieces : pieces + len(near)] * size
    move = np.where(solution[0][:n] - low < ON, low, np.where(high - solution[0][:n] < ON, high, solution[0][:n]))
    return move, multipliers


def updated(curvature: np.ndarray, move: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The curvature after a move along which the slope changed by `change`, by damped BFGS; positive semidefinite."""
    square, along = total(move * move), total(move * change)
    if not (square > 0.0 and math.isfinite(along)):
        return curvature
    if not curvature.any():
        if along <= 0.0:
            return curvature
        curvature = along / square * np.eye(len(move))
    bent = added((curvature * move[None, :]).T)
    before = total(move * bent)
    if not before > 0.0:
        return curvature
    share = 1.0 if along >= 0.2 * before else 0.8 * before / (before - along)
    mixed = share * change + (1.0 - share) * bent
    out = curvature - bent[:, None] * bent[None, :] / before + mixed[:, None] * mixed[None, :] / total(move * mixed)
    return np.asarray(out) if np.isfinite(out).all() else curvature
