"""Optimisers for searches and tunings: points of the unit cube to try, a generation at a time.

They know nothing of decks and cases. The points that they ask for depend only on the dimension, the seed, the number of
points and the values so far, to the bit, on every machine: so an interrupted campaign replays its archive and goes on.
"""

from __future__ import annotations

from met.optimisers.covariance import RestartedAdaptation
from met.optimisers.optimiser import Optimiser
from met.optimisers.worst_case import WorstCaseSearch


def hardest(dimension: int, seed: int, at_most: int) -> Optimiser:
    """A search for the least value with at most this many points; it ends early once it has found -inf."""
    return WorstCaseSearch(dimension, seed, at_most)


def tuner(dimension: int, seed: int, at_most: int) -> Optimiser:
    """A CMA-ES tuner that starts from the middle of the cube, with this many candidates."""
    return RestartedAdaptation(dimension, seed, at_most)
