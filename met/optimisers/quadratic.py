"""A convex quadratic function's least value within linear limits, by an interior point method, to the same bits on
every machine.

Mehrotra's predictor and corrector (SIAM J. Optimization 2 (1992) 575) on the reduced equations, for tens of unknowns.
Library solvers add in an order that depends on the processor, and a search that branches on their results would run
other cases.
"""

from __future__ import annotations

import numpy as np

from met.optimisers.arithmetic import added, lower_factor, total

STEPS = 60
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
    for _ in range(STEPS):
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
