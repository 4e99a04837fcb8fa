"""The exact meaning of each node of a graph, over plain floats and over numpy arrays.

Every back end agrees with these definitions bit for bit: IEEE double arithmetic, to nearest, nothing raised.
`fma` is the correctly rounded a*b + c, made here from exact sums and products, so that a replay on any machine gives
the kernel's bits.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from met.trace import philox

_MANTISSA = (1 << 52) - 1
_ONE = 1023 << 52


def bits_of(x: float) -> int:
    """The 64 bits of a double as an unsigned number."""
    return int(struct.unpack("<Q", struct.pack("<d", x))[0])


def of_bits(bits: int) -> float:
    """The double of 64 bits."""
    return float(struct.unpack("<d", struct.pack("<Q", bits & (1 << 64) - 1))[0])


def divide(a: float, b: float) -> float:
    """a / b of IEEE: 1/0 is infinite, 0/0 is NaN; for arrays too, with floating-point errors ignored."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return a / b
    if b != 0.0:
        return a / b
    if a == 0.0 or a != a or b != b:
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def square_root(x: float) -> float:
    """The square root; not-a-number below zero."""
    return math.sqrt(x) if x >= 0.0 else math.nan


def floor(x: float) -> float:
    """The largest whole number that is not greater."""
    return float(np.floor(x))


def rint(x: float) -> float:
    """The nearest whole number, the even one of two equally near."""
    return float(np.rint(x))


def fused(a: float, b: float, c: float) -> float:
    """a*b + c with one rounding."""
    if not (math.isfinite(a) and math.isfinite(b)):
        return a * b + c
    if not math.isfinite(c):
        return c
    from fractions import Fraction  # imported here, since it takes 2 ms, and most starts of MET do not need it

    exact = Fraction(a) * Fraction(b) + Fraction(c)
    if exact == 0:
        return a * b + c if a * b == 0.0 else 0.0
    try:
        return float(exact)
    except OverflowError:
        return math.inf if exact > 0 else -math.inf


def gathered(table: tuple[float, ...], index: float) -> float:
    """Entry number `index` (its whole part, limited to the table); not-a-number for an index that is."""
    if index != index:
        return math.nan
    return table[int(min(max(index, 0.0), len(table) - 1.0))]


def _fused_arrays(a: Any, b: Any, c: Any) -> Any:
    """The fused multiply-add of arrays, a b + c rounded once: exact product and sums, and the small part rounded to odd
    (Boldo and Melquiond 2008)."""
    a, b, c = np.broadcast_arrays(np.float64(a), np.float64(b), np.float64(c))
    product = a * b
    size = np.abs(product)
    big = np.maximum(np.maximum(np.abs(a), np.abs(b)), np.abs(c))
    usual = (big < 1e290) & (size < 1e290) & ((size > 1e-260) | (a == 0.0) | (b == 0.0))
    high, low = _product(a, b, product)
    t_high, t_low = exact_sum(c, low)
    v_high, v_low = exact_sum(high, t_high)
    result = np.asarray(v_high + _odd_sum(t_low, v_low))
    result = np.where((product == 0.0) & (c == 0.0), product + c, result)
    rest = np.asarray(~usual)
    if rest.any():
        result[rest] = [
            fused(*three) for three in zip(a[rest].tolist(), b[rest].tolist(), c[rest].tolist(), strict=True)
        ]
    return result


def exact_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """a + b as a rounded sum and its error (Knuth)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def _product(a: Any, b: Any, product: Any) -> tuple[Any, Any]:
    """a * b as a rounded product and its error (Dekker, Veltkamp)."""
    c = a * 134217729.0
    a_high = c - (c - a)
    c = b * 134217729.0
    b_high = c - (c - b)
    a_low, b_low = a - a_high, b - b_high
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


def _odd_sum(a: Any, b: Any) -> Any:
    """a + b, rounded to the neighbour whose last bit is one where it is not exact."""
    s, e = exact_sum(a, b)
    s = np.ascontiguousarray(s)
    pattern = s.view(np.int64)
    even = (e != 0.0) & ((pattern & 1) == 0)
    outward = (e > 0.0) == (s > 0.0)
    return np.where(even, np.where(outward, pattern + 1, pattern - 1), pattern).view(np.float64)


def _flip(x: float, t: float, n: int) -> float:
    return -x if bits_of(t) >> n & 1 else x


def _pattern(x: Any) -> Any:
    return np.ascontiguousarray(x, dtype=np.float64).view(np.uint64).reshape(np.shape(x))


def _double(pattern: Any) -> Any:
    return np.ascontiguousarray(pattern).view(np.float64).reshape(np.shape(pattern))


def _flip_arrays(x: Any, t: Any, n: int) -> Any:
    return np.where(_pattern(t) >> np.uint64(n) & np.uint64(1), np.negative(x), x)


def _gathered_arrays(table: tuple[float, ...], index: Any) -> Any:
    place = np.clip(np.nan_to_num(index, nan=0.0), 0.0, len(table) - 1.0).astype(np.int64)
    return np.where(np.isnan(index), np.nan, np.array(table)[place])


PLAIN: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": divide,
    "abs": abs,
    "sqrt": square_root,
    "floor": floor,
    "rint": rint,
    "fma": fused,
    "where": lambda mask, a, b: a if mask else b,
    "lt": lambda a, b: bool(a < b),
    "le": lambda a, b: bool(a <= b),
    "eq": lambda a, b: bool(a == b),
    "and": lambda a, b: bool(a and b),
    "bit": lambda x, n: bool(bits_of(x) >> n & 1),
    "flip": _flip,
    "pow2": lambda k: of_bits(bits_of(k + 4503599627371519.0) << 52),
    "exponent": lambda x: float((bits_of(x) >> 52 & 0x7FF) - 1023),
    "significand": lambda x: of_bits(bits_of(x) & _MANTISSA | _ONE),
    "gather": lambda index, table: gathered(table, index),
    "philox": philox.plain,
}
"""Each operation over Python floats and bools; arguments other than operands come last."""

ARRAYS: dict[str, Callable[..., Any]] = PLAIN | {
    "div": np.divide,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "floor": np.floor,
    "rint": np.rint,
    "fma": _fused_arrays,
    "where": np.where,
    "lt": np.less,
    "le": np.less_equal,
    "eq": np.equal,
    "and": np.logical_and,
    "bit": lambda x, n: (_pattern(x) >> np.uint64(n) & np.uint64(1)).astype(bool),
    "flip": _flip_arrays,
    "pow2": lambda k: _double(_pattern(k + 4503599627371519.0) << np.uint64(52)),
    "exponent": lambda x: (_pattern(x) >> np.uint64(52) & np.uint64(0x7FF)).astype(np.float64) - 1023.0,
    "significand": lambda x: _double(_pattern(x) & np.uint64(_MANTISSA) | np.uint64(_ONE)),
    "gather": lambda index, table: _gathered_arrays(table, index),
    "philox": philox.arrays,
}
"""Each operation over numpy arrays (and numpy scalars), to be called with floating-point errors ignored."""
