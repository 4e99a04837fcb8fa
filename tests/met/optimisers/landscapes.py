"""Functions of the unit cube with known minima, as optimisers are compared on; points are [point, dimension]."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from met.optimisers.optimiser import Optimiser

Landscape = Callable[[np.ndarray], np.ndarray]

DAMPING = 0.005
"""Damping ratio of the resonances: half the power at 1 % of the frequency."""


def place(dimension: int) -> np.ndarray:
    """Where the minimum is, off the middle and off the walls."""
    return 0.3 + 0.4 * np.random.default_rng(5).random(dimension)


def sphere(points: np.ndarray) -> np.ndarray:
    return ((10.0 * (points - place(points.shape[1]))) ** 2).sum(axis=1)


def ellipsoid(points: np.ndarray) -> np.ndarray:
    """Axes of 1 to 100, turned out of the cube's."""
    n = points.shape[1]
    turn, _ = np.linalg.qr(np.random.default_rng(n).normal(size=(n, n)))
    scales = 10.0 ** (4 * np.arange(n) / max(1, n - 1))
    return (((10.0 * (points - place(n))) @ turn) ** 2 * scales).sum(axis=1)


def rosenbrock(points: np.ndarray) -> np.ndarray:
    z = 4.0 * points - 2.0
    return (100 * (z[:, 1:] - z[:, :-1] ** 2) ** 2 + (1 - z[:, :-1]) ** 2).sum(axis=1)


def rastrigin(points: np.ndarray) -> np.ndarray:
    z = 10.0 * (points - place(points.shape[1]))
    return (10 + z**2 - 10 * np.cos(2 * np.pi * z)).sum(axis=1)


def ackley(points: np.ndarray) -> np.ndarray:
    z = 30.0 * (points - place(points.shape[1]))
    near = -20 * np.exp(-0.2 * np.sqrt((z**2).mean(axis=1)))
    return near - np.exp(np.cos(2 * np.pi * z).mean(axis=1)) + 20 + np.e


def corner(points: np.ndarray) -> np.ndarray:
    """Falls towards a corner of the cube, as worst cases often do."""
    return points.sum(axis=1)


def plateau(points: np.ndarray) -> np.ndarray:
    """The sphere with its minimum near the border of what is penalised, and failures on another side."""
    where = place(points.shape[1])
    penalised = points[:, 0] + points[:, 1] > where[0] + where[1] + 0.02
    values = np.where(penalised, 1e9, sphere(points))
    return np.where(points[:, -1] < where[-1] - 0.15, np.inf, values)


def resonance(points: np.ndarray) -> np.ndarray:
    """Less the amplification of an oscillator driven at a fixed frequency. Its own grows with a mix of all
    coordinates, and meets the other at the mix 0.8. The largest is 100."""
    mix = np.random.default_rng(points.shape[1] + 100).random(points.shape[1]) + 0.2
    own = 0.5 + (points @ (mix / mix.sum())) / 1.6
    return -amplification(1.0 / own)


def resonance_and_trend(points: np.ndarray) -> np.ndarray:
    """Less the amplification where coordinate 0 sets the frequency, and a trend of a third of it by the others."""
    trend = np.random.default_rng(points.shape[1]).normal(size=points.shape[1])
    trend[0] = 0.0
    others = points @ trend / max(np.abs(trend).sum(), 1e-9)
    return -amplification(1.0 / (0.6 + 0.6 * points[:, 0])) - 30.0 * others


def peak_beside_a_hill(points: np.ndarray) -> np.ndarray:
    """A peak of height 1 that is 1 % wide in two coordinates, beside a broad hill of height 0.5 elsewhere."""
    where = 0.25 + 0.5 * np.random.default_rng(points.shape[1]).random(points.shape[1])
    off = (((points[:, :2] - where[:2]) / 0.005) ** 2).sum(axis=1)
    hill = np.exp(-((points - (1 - where)) ** 2).mean(axis=1) / 0.08)
    return -1.0 / (1.0 + off) - 0.5 * hill


def amplification(ratio: np.ndarray) -> np.ndarray:
    return np.asarray(1.0 / np.sqrt((1 - ratio**2) ** 2 + (2 * DAMPING * ratio) ** 2))


def least(optimiser: Optimiser, landscape: Landscape) -> float:
    """The least value that an optimiser finds with its points."""
    found = np.inf
    while len(points := optimiser.ask()):
        values = landscape(points)
        found = min(found, float(values.min()))
        optimiser.tell(values)
    return found


def least_of_random(dimension: int, seed: int, count: int, landscape: Landscape) -> float:
    return float(landscape(np.random.default_rng(seed).random((count, dimension))).min())
