"""Optimisers for searches and tunings: points of the unit cube to try, a generation at a time.

They know nothing of decks and cases. What they ask for follows from the dimension, the seed, the number of points and
what they were told, to the bit, on every machine: so a campaign that was cut off is told its archive and goes on.
"""

from __future__ import annotations

from met.optimisers.optimiser import Optimiser
from met.optimisers.tuning import RestartedAdaptation
from met.optimisers.worst_case import WorstCaseSearch


def hardest(dimension: int, seed: int, at_most: int) -> Optimiser:
    """A search for the least value with at most this many points; it ends early where it has found -inf."""
    return WorstCaseSearch(dimension, seed, at_most)


def tuner(dimension: int, seed: int, at_most: int) -> Optimiser:
    """CMA-ES, from the middle of the cube, with this many candidates."""
    return RestartedAdaptation(dimension, seed, at_most)
