"""Optimisers that ask for a generation of points of the unit cube at a time, whoever computes what these are worth."""

from __future__ import annotations

import numpy as np

from met.searching.evolution import Evolution
from met.searching.optimiser import Optimiser


def hardest(dimension: int, seed: int, at_most: int) -> Optimiser:
    """The optimiser that finds the least value anywhere in the cube, within so many points."""
    return Evolution(dimension, seed, at_most)


def tuner(dimension: int, seed: int, at_most: int, start: np.ndarray | None = None) -> Optimiser:
    """The optimiser that tunes, within so many candidates. start: a good candidate, where one is known."""
    return Evolution(dimension, seed, at_most, start)


__all__ = ["Optimiser", "hardest", "tuner"]
