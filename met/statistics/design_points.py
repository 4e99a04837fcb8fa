"""Design points, cases that share all chosen values; and parameters that vary in step, as zipped ones do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def design_points(chosen: Sequence[np.ndarray], cases: int) -> np.ndarray:
    """The design point of each case, a number from 0 in the order in which they first appear.

    chosen  what was chosen, an array of a value a case for each coordinate; with none there is one design point
    """
    points = np.zeros(cases, np.int64)
    for values in chosen:
        _, index = np.unique(np.asarray(values), return_inverse=True)
        points = points * (int(index.max(initial=0)) + 1) + index.ravel()
        _, points = np.unique(points, return_inverse=True)
        points = points.ravel()
    _, first, index = np.unique(points, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[index.ravel()])


def in_step(inputs: Sequence[np.ndarray]) -> list[list[int]]:
    """The groups of inputs that rise together over the cases, or one as the other falls; each in the inputs' order.

    inputs  a value a case each; an input that is the same in all cases is in no part
    """
    parts: list[list[int]] = []
    places: list[np.ndarray] = []
    for number, values in enumerate(inputs):
        _, place = np.unique(np.asarray(values, float), return_inverse=True)
        place = place.ravel()
        if not place.any():
            continue
        for part, other in zip(parts, places, strict=True):
            if np.array_equal(place, other) or np.array_equal(place, other.max() - other):
                part.append(number)
                break
        else:
            parts.append([number])
            places.append(place)
    return parts
