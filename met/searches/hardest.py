"""A search for the case that hurts most: the optimiser's points as cases, each only once."""

from __future__ import annotations

import numpy as np

from met import optimisers
from met.plan.searches import Search


class HardestCase:
    """Method of a search for the worst case (`SearchMethod`). A point that is rounded to a former case gets that case's
    worth."""

    def __init__(self, search: Search) -> None:
        self._search = search
        self._optimiser = optimisers.hardest(len(search.parameters), search.seed, search.at_most)
        self._known: dict[bytes, float] = {}
        self._batch: list[bytes] = []
        self._new: list[bytes] = []

    def ask(self) -> np.ndarray:
        """Coordinates of the next generation's cases (`SearchMethod.ask`)."""
        left = self._search.at_most - len(self._known)
        while left > 0:
            cases = self._search.values(self._optimiser.ask())
            if not len(cases):
                break
            self._batch = [case.tobytes() for case in cases]
            first = {key: place for place, key in reversed(list(enumerate(self._batch)))}
            places = sorted(place for key, place in first.items() if key not in self._known)
            if len(places) > left:
                break
            self._new = [self._batch[place] for place in places]
            if places:
                return cases[places]
            self._pass_on()
        return np.empty((0, len(self._search.parameters)))

    def tell(self, values: np.ndarray) -> None:
        """Take the worths of the cases that were asked last (`SearchMethod.tell`)."""
        self._known.update(zip(self._new, values.tolist(), strict=True))
        self._pass_on()

    def _pass_on(self) -> None:
        self._optimiser.tell(np.array([self._known[key] for key in self._batch]))
