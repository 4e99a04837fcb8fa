"""Parameters that vary in step: each value of one comes with one value of the other, as zipped ones do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def in_step(inputs: Sequence[np.ndarray]) -> list[list[int]]:
    """The groups of inputs that rise together, or one as the other falls; each in the inputs' order.

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
