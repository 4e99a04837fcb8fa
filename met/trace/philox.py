"""Philox4x32-10, the generator under the noise, over integers and over arrays, which agree to the bit.

Ten rounds make four words of 32 bits from a counter of four words and a key of two: the same operands, the same words,
whatever was drawn before. From Salmon, Moraes, Dror and Shaw, *Parallel Random Numbers: As Easy as 1, 2, 3* (SC11).

Words are whole numbers in [0, 2^32), held in doubles; a zero may have either sign. Where an operand is anything else
the result is not-a-number, so NaN never becomes a valid draw.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

# multipliers of words 0 and 2 of the counter, and increments of the key's words for each round (both of the paper)
MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
GROWTH = (0x9E3779B9, 0xBB67AE85)
ROUNDS = 10

LOW = (1 << 32) - 1


def _rounds(words: Sequence[Any], kind: Callable[[int], Any]) -> tuple[Any, Any, Any, Any]:
    """The four words, over Python's integers (`kind` is int) or over arrays of np.uint64."""
    c0, c1, c2, c3, k0, k1 = words
    low, half = kind(LOW), kind(32)
    multiplier, growth = ([kind(x) for x in pair] for pair in (MULTIPLIERS, GROWTH))
    for _ in range(ROUNDS):
        p0, p1 = c0 * multiplier[0], c2 * multiplier[1]
        c0, c1, c2, c3 = (p1 >> half) ^ c1 ^ k0, p1 & low, (p0 >> half) ^ c3 ^ k1, p0 & low
        k0, k1 = (k0 + growth[0]) & low, (k1 + growth[1]) & low
    return c0, c1, c2, c3


def plain(*operands: Any) -> float:
    """One of Philox's four words for a counter of four words and a key of two; the last operand says which."""
    *words, n = operands
    if not all(0.0 <= x <= LOW and x == int(x) for x in words):
        return float("nan")
    return float(_rounds([int(x) for x in words], int)[n])


def arrays(*operands: Any) -> Any:
    """Philox's words as `plain` gives them, over numbers or arrays."""
    *words, n = operands
    values = np.broadcast_arrays(*(np.float64(x) for x in words))
    valid = np.logical_and.reduce([(x >= 0.0) & (x <= LOW) & (x == np.floor(x)) for x in values])
    result = _rounds([np.where(valid, x, 0.0).astype(np.uint64) for x in values], np.uint64)[n]
    return np.where(valid, result.astype(np.float64), np.nan)
