"""The values that models compute with while a program is recorded: `Scalar`, a number, and `Mask`, a truth value.

Both are small handles: a graph and a reference into it. A reference is twice a node's position, plus one where the
value is the node's negative (for a mask: its opposite), so that signs cost nothing and sharing sees through them.
Operations that need the value at once (`if`, `float()`, an index) are refused at the model's own line, with E200.
"""

from __future__ import annotations

from typing import Any, NoReturn

from met.trace.nodes import Nodes
from met.trace.refusal import RECORDS, refuse


class Scalar:
    """A number that is recorded rather than computed."""

    __slots__ = ("graph", "ref")

    def __init__(self, graph: Nodes, ref: int) -> None:
        self.graph = graph
        self.ref = ref

    def _other(self, other: Any) -> int | None:
        """The reference of an operand; None where it is not a number."""
        if other.__class__ is Scalar:
            if other.graph is not self.graph:
                raise ValueError("two graphs meet in one operation")
            return other.ref
        if isinstance(other, (float, int)) and not isinstance(other, bool):
            return self.graph.constant(other)
        if getattr(other, "ndim", None) == 0 and not isinstance(other, Scalar):
            return self.graph.constant(float(other))
        if isinstance(other, (bool, Mask)):
            refuse("arithmetic with a truth value", "where(condition, x, 0.0) says what a condition times x means")
        return None

    def __add__(self, other: Any) -> Scalar:
        b = self._other(other)
        return NotImplemented if b is None else Scalar(self.graph, self.graph.add(self.ref, b))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Scalar:
        b = self._other(other)
        return NotImplemented if b is None else Scalar(self.graph, self.graph.add(self.ref, b ^ 1))

    def __rsub__(self, other: Any) -> Scalar:
        b = self._other(other)
        return NotImplemented if b is None else Scalar(self.graph, self.graph.add(b, self.ref ^ 1))

    def __mul__(self, other: Any) -> Scalar:
        b = self._other(other)
        return NotImplemented if b is None else Scalar(self.graph, self.graph.mul(self.ref, b))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Scalar:
        b = self._other(other)
        return NotImplemented if b is None else Scalar(self.graph, self.graph.div(self.ref, b))

    def __rtruediv__(self, other: Any) -> Scalar:
        b = self._other(other)
        return NotImplemented if b is None else Scalar(self.graph, self.graph.div(b, self.ref))

    def __neg__(self) -> Scalar:
        return Scalar(self.graph, self.ref ^ 1)

    def __pos__(self) -> Scalar:
        return self

    def __abs__(self) -> Scalar:
        return Scalar(self.graph, self.graph.unary("abs", self.ref))

    def __pow__(self, power: Any) -> Scalar:
        """The whole power of a number, by multiplications. Refuses powers that are not whole, and those beyond 16."""
        if isinstance(power, float) and power.is_integer():
            power = int(power)
        if not isinstance(power, int) or isinstance(power, bool) or abs(power) > 16:
            refuse(f"a power of {power!r}", "powers are whole numbers up to 16; else sqrt(x) or exp(y * log(x))")
        graph, result, square, n = self.graph, None, self.ref, abs(power)
        while n:
            if n & 1:
                result = square if result is None else graph.mul(result, square)
            n >>= 1
            square = graph.mul(square, square) if n else square
        if result is None:
            return Scalar(graph, graph.constant(1.0))
        return Scalar(graph, result if power > 0 else graph.div(graph.constant(1.0), result))

    def __rpow__(self, base: Any) -> NoReturn:
        refuse("a power with a recorded exponent", "exp(y * log(x))")

    def _remainder(self, *_: Any) -> NoReturn:
        refuse("`%` or `//` with a recorded number", "met.trace.floor: x - y * floor(x / y)")

    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = __rdivmod__ = _remainder

    def __lt__(self, other: Any) -> Mask:
        b = self._other(other)
        return NotImplemented if b is None else Mask(self.graph, self.graph.less("lt", self.ref, b))

    def __le__(self, other: Any) -> Mask:
        b = self._other(other)
        return NotImplemented if b is None else Mask(self.graph, self.graph.less("le", self.ref, b))

    def __gt__(self, other: Any) -> Mask:
        b = self._other(other)
        return NotImplemented if b is None else Mask(self.graph, self.graph.less("lt", b, self.ref))

    def __ge__(self, other: Any) -> Mask:
        b = self._other(other)
        return NotImplemented if b is None else Mask(self.graph, self.graph.less("le", b, self.ref))

    def __eq__(self, other: Any) -> Mask:  # type: ignore[override]
        b = self._other(other)
        return NotImplemented if b is None else Mask(self.graph, self.graph.equal(self.ref, b))

    def __ne__(self, other: Any) -> Mask:  # type: ignore[override]
        b = self._other(other)
        return NotImplemented if b is None else Mask(self.graph, self.graph.equal(self.ref, b) ^ 1)

    __hash__ = None  # type: ignore[assignment]

    def __array_ufunc__(self, ufunc: Any, method: str, *operands: Any, **options: Any) -> Any:
        """Let numpy's own numbers stand left of an operator; numpy's functions are refused."""
        name = {
            "add": "__radd__",
            "subtract": "__rsub__",
            "multiply": "__rmul__",
            "true_divide": "__rtruediv__",
            "divide": "__rtruediv__",
            "less": "__gt__",
            "less_equal": "__ge__",
            "greater": "__lt__",
            "greater_equal": "__le__",
            "equal": "__eq__",
            "not_equal": "__ne__",
        }.get(ufunc.__name__)
        if name is None or method != "__call__" or len(operands) != 2 or getattr(operands[0], "ndim", 1) != 0:
            refuse(f"numpy's `{ufunc.__name__}` of a recorded number", function=ufunc.__name__)
        return getattr(self, name)(float(operands[0]))

    def __repr__(self) -> str:
        return self.graph.show(self.ref)

    def __bool__(self) -> NoReturn:
        refuse("the truth of a recorded number", truth=True)

    def __float__(self) -> NoReturn:
        refuse("a plain number from a recorded one", RECORDS)

    def __int__(self) -> NoReturn:
        refuse("a whole number from a recorded one", "met.trace.floor or rint, which record")

    def __index__(self) -> NoReturn:
        refuse(
            "an index or a count from a recorded number",
            "gather(table, index) looks up a table; where(condition, a, b) chooses between two values",
        )

    def __round__(self, digits: int | None = None) -> NoReturn:
        refuse("rounding of a recorded number", "met.trace.rint")

    def __trunc__(self) -> NoReturn:
        refuse("truncation of a recorded number", "met.trace.floor")

    __floor__ = __ceil__ = __trunc__

    def __complex__(self) -> NoReturn:
        refuse("a complex number from a recorded one")

    def __iter__(self) -> NoReturn:
        refuse("iteration over a recorded number")


class Mask:
    """A truth value that is recorded rather than computed."""

    __slots__ = ("graph", "ref")

    def __init__(self, graph: Nodes, ref: int) -> None:
        self.graph = graph
        self.ref = ref

    def _other(self, other: Any) -> int | None:
        """The reference of a truth value to join with; None for anything else."""
        if other.__class__ is Mask:
            if other.graph is not self.graph:
                raise ValueError("two graphs meet in one operation")
            return other.ref
        if isinstance(other, bool) or type(other).__name__ in ("bool", "bool_"):
            return self.graph.truth(bool(other))
        return None

    def __and__(self, other: Any) -> Mask:
        b = self._other(other)
        return NotImplemented if b is None else Mask(self.graph, self.graph.both(self.ref, b))

    __rand__ = __and__

    def __or__(self, other: Any) -> Mask:
        b = self._other(other)
        return NotImplemented if b is None else Mask(self.graph, self.graph.both(self.ref ^ 1, b ^ 1) ^ 1)

    __ror__ = __or__

    def __xor__(self, other: Any) -> Mask:
        b = self._other(other)
        if b is None:
            return NotImplemented
        both = self.graph.both
        return Mask(self.graph, both(both(self.ref, b ^ 1) ^ 1, both(self.ref ^ 1, b) ^ 1) ^ 1)

    __rxor__ = __ne__ = __xor__  # type: ignore[assignment]

    def __eq__(self, other: Any) -> Mask:  # type: ignore[override]
        differ = self.__xor__(other)
        return NotImplemented if differ is NotImplemented else ~differ

    __hash__ = None  # type: ignore[assignment]

    def __invert__(self) -> Mask:
        return Mask(self.graph, self.ref ^ 1)

    def __repr__(self) -> str:
        return self.graph.show(self.ref)

    def __bool__(self) -> NoReturn:
        refuse("the truth of a recorded condition", truth=True)

    def _number(self, *_: Any) -> NoReturn:
        refuse("arithmetic with a truth value", "where(condition, x, 0.0) says what a condition times x means")

    __float__ = __int__ = __index__ = _number
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __neg__ = _number

    def __array_ufunc__(self, ufunc: Any, method: str, *operands: Any, **options: Any) -> Any:
        """Let numpy's own truth values stand left of `&`, `|` and `^`."""
        name = {"bitwise_and": "__and__", "bitwise_or": "__or__", "bitwise_xor": "__xor__"}.get(ufunc.__name__)
        if name is None or method != "__call__" or len(operands) != 2 or getattr(operands[0], "ndim", 1) != 0:
            refuse(f"numpy's `{ufunc.__name__}` of a recorded condition", "both, either, not_, where")
        return getattr(self, name)(bool(operands[0]))
