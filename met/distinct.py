"""The distinct values of an array.

numpy's `unique` finds them by a hash table since its version 2.3, in one call that no interrupt ends: of three million
integers in order 20 times slower than sorting them (2.4.6: 16 s beside 0.8 s).
"""

from __future__ import annotations

import numpy as np


def distinct(values: np.ndarray) -> np.ndarray:
    """The distinct values of an array of any shape, ascending; not-a-number once, last."""
    ordered = np.sort(values, axis=None)
    new = np.ones(len(ordered), dtype=bool)
    new[1:] = ordered[1:] != ordered[:-1]
    if ordered.dtype.kind == "f":
        first = np.searchsorted(ordered, np.nan)
        new[first + 1 :] = False
    return ordered[new]
