"""The functions that models use, over plain numbers and over recorded ones.

Over floats (and arrays) they give the plain result of IEEE arithmetic and never raise: sin(inf) and sqrt(-1) are not
numbers, and neither is tan of an angle beyond 2^48 rad. Over scalars they are recorded; sin, cos and their like become
primitives, so that every back end has the same bits (met/trace/elementary.py). Plain results are np.float64, so that a
model's further arithmetic does not raise either (1.0 / floor(0.5) is infinite). Not-a-number survives `minimum`,
`maximum` and `clip`: a limit never hides it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from met.trace import elementary
from met.trace.graph import Real, Truth
from met.trace.nodes import Nodes
from met.trace.primitives import ARRAYS, PLAIN
from met.trace.refusal import refuse
from met.trace.scalar import Mask, Scalar


def _graph_of(*values: Any) -> Nodes | None:
    """The graph in which the values are recorded; None where all are plain."""
    for value in values:
        if value.__class__ is Scalar or value.__class__ is Mask:
            return value.graph
    return None


def _ref(graph: Nodes, value: Any) -> int:
    """A number's or a truth value's reference in the graph."""
    if value.__class__ is Scalar or value.__class__ is Mask:
        if value.graph is not graph:
            raise ValueError("two graphs meet in one operation")
        return value.ref
    if isinstance(value, (bool, np.bool_)):
        return graph.truth(bool(value))
    return graph.constant(value)


def _plain(name: str, *values: Any) -> Any:
    """The plain form of a primitive, for numbers or arrays."""
    if any(isinstance(value, np.ndarray) for value in values):
        with np.errstate(all="ignore"):
            return ARRAYS[name](*values)
    return np.float64(PLAIN[name](*values))


def _elementary(
    record: Callable[[Scalar], Scalar],
    plain: Callable[[float], float],
    array: Callable[[Any], Any],
    farthest: float = math.inf,
) -> Callable[[Real], Real]:
    """A function of one number in its three forms; not-a-number beyond `farthest`."""

    def function(x: Any) -> Any:
        """The function of a recorded number, an array or a plain number; not-a-number beyond `farthest`."""
        if x.__class__ is Scalar:
            return record(x)
        if isinstance(x, np.ndarray):
            with np.errstate(all="ignore"):
                return np.where(abs(x) > farthest, np.nan, array(x))
        try:
            return np.float64(plain(x) if abs(x) <= farthest else math.nan)
        except ValueError:
            return np.float64(-math.inf if plain is math.log and x == 0.0 else math.nan)
        except OverflowError:
            return np.float64(math.inf)

    function.__name__ = function.__qualname__ = record.__name__
    function.__doc__ = record.__doc__
    return function


sin = _elementary(elementary.sin, math.sin, np.sin)
cos = _elementary(elementary.cos, math.cos, np.cos)
tan = _elementary(elementary.tan, math.tan, np.tan, elementary.FARTHEST)
exp = _elementary(elementary.exp, math.exp, np.exp)
log = _elementary(elementary.log, math.log, np.log)
tanh = _elementary(elementary.tanh, math.tanh, np.tanh)
asin = _elementary(elementary.asin, math.asin, np.arcsin)
acos = _elementary(elementary.acos, math.acos, np.arccos)
atan = _elementary(elementary.atan, math.atan, np.arctan)


def atan2(y: Real, x: Real) -> Real:
    """The angle of the point (x, y), rad, in [-pi, pi]."""
    graph = _graph_of(y, x)
    if graph is not None:
        return elementary.atan2(Scalar(graph, _ref(graph, y)), Scalar(graph, _ref(graph, x)))
    if isinstance(y, np.ndarray) or isinstance(x, np.ndarray):
        return np.arctan2(y, x)
    return np.float64(math.atan2(y, x))


def _unary(op: str, doc: str) -> Callable[[Real], Real]:
    """A function of one number, recorded or plain, that models call by the name `op`."""

    def function(x: Any) -> Any:
        if x.__class__ is Scalar:
            return Scalar(x.graph, x.graph.unary(op, x.ref))
        return _plain(op, x)

    function.__name__ = function.__qualname__ = op
    function.__doc__ = doc
    return function


sqrt = _unary("sqrt", "The square root; not a number below zero.")
floor = _unary("floor", "The greatest whole number that is not greater than x.")
rint = _unary("rint", "The nearest whole number, the even one of two.")


def absolute(x: Real) -> Real:
    """The size of a number, as `abs` gives it."""
    size: Any = abs(x)
    return size


def fma(a: Real, b: Real, c: Real) -> Real:
    """a*b + c, rounded once, in every back end."""
    graph = _graph_of(a, b, c)
    if graph is None:
        return _plain("fma", a, b, c)
    return Scalar(graph, graph.fma(_ref(graph, a), _ref(graph, b), _ref(graph, c)))


def where(condition: Any, a: Any, b: Any) -> Any:
    """a where the condition holds, else b: numbers or conditions. Both are computed; one is kept."""
    if condition.__class__ is Mask:
        graph = condition.graph
        x, y = _ref(graph, a), _ref(graph, b)
        kind = Mask if isinstance(a, (bool, np.bool_, Mask)) else Scalar
        return kind(graph, graph.where(condition.ref, x, y))
    if condition.__class__ is Scalar:
        refuse("where() with a number for a condition", "a comparison: where(x != 0.0, a, b)")
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b)
    chosen = a if condition else b
    return np.float64(chosen) if isinstance(chosen, (float, int)) and not isinstance(chosen, bool) else chosen


def minimum(a: Real, b: Real) -> Real:
    """The lesser of two; not-a-number where either is."""
    return _extreme(a, b, lambda x, y: x < y)


def maximum(a: Real, b: Real) -> Real:
    """The greater of two; not-a-number where either is."""
    return _extreme(a, b, lambda x, y: x > y)


def _extreme(a: Any, b: Any, better: Callable[[Any, Any], Any]) -> Any:
    """a where it is better or not-a-number, else b; where one is a constant, one comparison suffices."""
    if _is_number(a):
        a, b = b, a
    if _is_number(b):
        return where(better(b, a), b, a)
    return where(either(better(a, b), is_nan(a)), a, b)


def _is_number(x: Any) -> bool:
    """True where x is known already, and is not NaN."""
    if x.__class__ is Scalar:
        x = x.graph.value(x.ref)
    return isinstance(x, (float, int)) and x == x


def clip(x: Real, low: Real, high: Real) -> Real:
    """x limited to the range from low to high; not-a-number where x is. The limits must be numbers, low <= high."""
    x = where(x < low, low, x)
    return where(x > high, high, x)


def sign(x: Real) -> Real:
    """1, -1, or x itself where it is zero or not-a-number."""
    return where(x > 0.0, 1.0, where(x < 0.0, -1.0, x))


def is_nan(x: Real) -> Truth:
    """True where x is not a number."""
    return x != x


def isfinite(x: Real) -> Truth:
    """True where x is neither NaN nor infinite."""
    size: Any = abs(x)
    return size < math.inf


def not_(a: Truth) -> Truth:
    """The opposite of a condition."""
    if isinstance(a, (Mask, np.ndarray)):
        return ~a
    return not a


def both(a: Truth, b: Truth) -> Truth:
    """True where both conditions hold."""
    return a & b


def either(a: Truth, b: Truth) -> Truth:
    """True where one of two conditions holds, or both."""
    return a | b


def all_of(conditions: Iterable[Truth]) -> Truth:
    """True where every condition holds."""
    result: Truth = True
    for condition in conditions:
        result = result & condition
    return result


def any_of(conditions: Iterable[Truth]) -> Truth:
    """True where any condition holds."""
    result: Truth = False
    for condition in conditions:
        result = result | condition
    return result


def gather(table: tuple[float, ...], index: Real) -> Real:
    """Entry number `index` of a table of constants: its whole part, held within the table.

    Not-a-number where the index is.
    """
    table = tuple(map(float, table))
    if not table:
        raise ValueError("a table has at least one entry")
    if index.__class__ is Scalar:
        return Scalar(index.graph, index.graph.gather(table, index.ref))
    if isinstance(index, np.ndarray):
        return ARRAYS["gather"](index, table)
    return np.float64(PLAIN["gather"](index, table))


def philox(c0: Real, c1: Real, c2: Real, c3: Real, k0: Real, k1: Real, word: int) -> Real:
    """Word number `word`, 0 to 3, of the result of Philox4x32-10 for a counter and a key (met/trace/philox.py).

    All are whole numbers in [0, 2^32); not a number where one is not.
    """
    operands = (c0, c1, c2, c3, k0, k1)
    graph = _graph_of(*operands)
    if graph is None:
        return _plain("philox", *operands, word)
    return Scalar(graph, graph.philox(*(_ref(graph, x) for x in operands), word))
