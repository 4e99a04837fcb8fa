"""Philox4x32-10, the generator under the noise, in three forms that agree to the bit: integers, arrays, LLVM IR.

Ten rounds make four words of 32 bits from a counter of four words and a key of two: the same operands, the same words,
whatever was drawn before. From Salmon, Moraes, Dror and Shaw, *Parallel Random Numbers: As Easy as 1, 2, 3* (SC11).

Words are whole numbers in [0, 2^32), held in doubles; a zero may have either sign. Where an operand is anything else
the result is not a number, so what is no number never becomes a draw.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

# what words 0 and 2 of the counter are multiplied by, and what the key's words grow by each round (both of the paper)
MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
GROWTH = (0x9E3779B9, 0xBB67AE85)
ROUNDS = 10

_LOW = (1 << 32) - 1
# the pattern of 2^52: added to it, a whole number below 2^52 stands in the lowest bits of the sum's pattern
_SHIFT_BITS = 0x433 << 52


def _rounds(words: Sequence[Any], kind: Callable[[int], Any]) -> tuple[Any, Any, Any, Any]:
    """The four words, over Python's integers (`kind` is int) or over arrays of np.uint64."""
    c0, c1, c2, c3, k0, k1 = words
    low, half = kind(_LOW), kind(32)
    multiplier, growth = ([kind(x) for x in pair] for pair in (MULTIPLIERS, GROWTH))
    for _ in range(ROUNDS):
        p0, p1 = c0 * multiplier[0], c2 * multiplier[1]
        c0, c1, c2, c3 = (p1 >> half) ^ c1 ^ k0, p1 & low, (p0 >> half) ^ c3 ^ k1, p0 & low
        k0, k1 = (k0 + growth[0]) & low, (k1 + growth[1]) & low
    return c0, c1, c2, c3


def plain(*operands: Any) -> float:
    """Of four words of a counter and two of a key, and of 0 to 3 for which: that of the four results."""
    *words, n = operands
    if not all(0.0 <= x <= _LOW and x == int(x) for x in words):
        return float("nan")
    return float(_rounds([int(x) for x in words], int)[n])


def arrays(*operands: Any) -> Any:
    """The same, each word a number or an array."""
    *words, n = operands
    values = np.broadcast_arrays(*(np.float64(x) for x in words))
    valid = np.logical_and.reduce([(x >= 0.0) & (x <= _LOW) & (x == np.floor(x)) for x in values])
    result = _rounds([np.where(valid, x, 0.0).astype(np.uint64) for x in values], np.uint64)[n]
    return np.where(valid, result.astype(np.float64), np.nan)


class Written:
    """The rounds over one set of operands, as LLVM IR over vectors of `lanes` doubles; `word` gives each of the four.

    put       takes each line
    label     what every name made here begins with
    operands  values of IR: four words of the counter, two of the key

    Integers have 64 bits, of which the low 32 count; so each product is one `vpmuludq`. They are made by a sum rather
    than a conversion, whose result is undefined out of range, and an operand is a word if it comes back unchanged.
    """

    def __init__(self, put: Callable[[str], None], label: str, operands: Sequence[str], lanes: int) -> None:
        self.put = put
        self.label = label
        self.made = 0
        self.doubles, self.integers, self.truths = (f"<{lanes} x {kind}>" for kind in ("double", "i64", "i1"))
        words, valid = [], "splat (i1 true)"
        for x in operands:
            shifted = self._op(f"fadd {self.doubles} {x}, splat (double 0x{_SHIFT_BITS:X})")
            pattern = self._op(f"bitcast {self.doubles} {shifted} to {self.integers}")
            words.append(pattern)
            same = self._op(f"fcmp oeq {self.doubles} {x}, {self._double(pattern)}")
            valid = self._op(f"and {self.truths} {valid}, {same}")
        self.valid = valid
        self.words = self._rounds(*words)

    def word(self, n: int) -> str:
        """Word n as a double; not a number where an operand is no word."""
        value = self._double(self.words[n])
        nan = "splat (double 0x7FF8000000000000)"
        return self._op(f"select {self.truths} {self.valid}, {self.doubles} {value}, {self.doubles} {nan}")

    def _op(self, text: str) -> str:
        name = f"%{self.label}.{self.made}"
        self.made += 1
        self.put(f"  {name} = {text}")
        return name

    def _low(self, x: str) -> str:
        return self._op(f"and {self.integers} {x}, splat (i64 {_LOW})")

    def _double(self, x: str) -> str:
        """The number in the low 32 bits."""
        pattern = self._op(f"or {self.integers} {self._low(x)}, splat (i64 {_SHIFT_BITS})")
        shifted = self._op(f"bitcast {self.integers} {pattern} to {self.doubles}")
        return self._op(f"fsub {self.doubles} {shifted}, splat (double 0x{_SHIFT_BITS:X})")

    def _rounds(self, c0: str, c1: str, c2: str, c3: str, k0: str, k1: str) -> tuple[str, str, str, str]:
        """The same rounds over vectors; high halves of words hold anything, and are taken off before a product."""
        bits, op = self.integers, self._op
        for n in range(ROUNDS):
            if n:
                k0, k1 = (op(f"add {bits} {k}, splat (i64 {by})") for k, by in ((k0, GROWTH[0]), (k1, GROWTH[1])))
            p0, p1 = (op(f"mul {bits} {self._low(c)}, splat (i64 {by})")
                      for c, by in ((c0, MULTIPLIERS[0]), (c2, MULTIPLIERS[1])))
            h0, h1 = (op(f"lshr {bits} {p}, splat (i64 32)") for p in (p0, p1))
            c0, c2 = (op(f"xor {bits} {op(f'xor {bits} {h}, {c}')}, {k}") for h, c, k in ((h1, c1, k0), (h0, c3, k1)))
            c1, c3 = p1, p0
        return c0, c1, c2, c3
