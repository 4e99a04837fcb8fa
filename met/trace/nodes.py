"""The record of a computation: nodes in order of creation, each made once.

A node is a tuple, operation first, then operands, then what is no operand (a table, a bit's number). An operand is a
reference: twice the node's position, plus one for its negative (a mask's opposite). What the graph does to what it is
given, and nothing else:

    constants are computed;  x + 0, x * 1, x / 1 are x;  x * 0 is 0, even where x is infinite or not a number
    signs are pulled out (a + -b is a - b, -a * b is -(a * b)), so zeros may differ in sign from the plain result
    x + x is 2 * x;  a quotient by a power of two is a product;  where(c, a, a) is a
    commutative operands are ordered and equal nodes are one

x - x stays: it is not a number where x is infinite. Nothing is reassociated, so each result is the plain one's,
bit for bit (zeros' signs aside) until `met.trace.fuse` fuses products into sums.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any, Self

import numpy as np

from met.trace.primitives import ARRAYS, PLAIN

Node = tuple[Any, ...]

OPERANDS = {
    "const": 0,
    "input": 0,
    "cell": 0,
    "tick": 0,
    "time": 0,
    "false": 0,
    "abs": 1,
    "sqrt": 1,
    "floor": 1,
    "rint": 1,
    "bit": 1,
    "pow2": 1,
    "exponent": 1,
    "significand": 1,
    "gather": 1,
    "add": 2,
    "sub": 2,
    "mul": 2,
    "div": 2,
    "lt": 2,
    "le": 2,
    "eq": 2,
    "and": 2,
    "flip": 2,
    "fma": 3,
    "where": 3,
    "philox": 6,
}
"""Operations with the number of operands of each, which stand at positions 1, 2, 3 of the node."""

LEAVES = frozenset(name for name, count in OPERANDS.items() if count == 0)
TRUTHS = frozenset({"false", "lt", "le", "eq", "and", "bit"})

ZERO, ONE, FALSE, TRUE = 0, 2, 4, 5
"""References that every graph has; the negative of FALSE is TRUE."""


class Nodes:
    """Nodes made so far, and the rules by which new ones are made (head of this file), all by reference."""

    __slots__ = ("_constants", "_literals", "_refs", "known", "nodes")

    def __init__(self) -> None:
        self.known: list[Any] = []  # of `met.trace.derivative`
        self.nodes: list[Node] = [("const", 0.0), ("const", 1.0), ("false",)]
        self._refs: dict[Node, int] = {}
        self._literals: dict[float, int] = {0.0: ZERO, 1.0: ONE}
        self._constants: dict[int, float] = {0: 0.0, 1: 1.0}

    @classmethod
    def of(cls, nodes: Iterable[Node]) -> Self:
        """The graph of nodes that were made in another one, at the same positions."""
        graph = cls()
        for i, node in islice(enumerate(nodes), len(graph.nodes), None):
            graph.nodes.append(node)
            if node[0] != "const":
                graph._refs.setdefault(node, 2 * i)
            elif node[1] == node[1]:
                graph._constants[i] = node[1]
                graph._literals.setdefault(node[1], 2 * i)
            else:
                graph._constants[i] = node[1]
                graph._refs.setdefault(("nan",), 2 * i)
        return graph

    # Making nodes

    def make(self, *node: Any) -> int:
        """The reference of a non-constant node, made unless it exists already."""
        ref = self._refs.get(node)
        if ref is None:
            ref = 2 * len(self.nodes)
            self.nodes.append(node)
            self._refs[node] = ref
        return ref

    def constant(self, value: float) -> int:
        """The reference of a number that is known already."""
        value = float(value)
        sign = int(math.copysign(1.0, value) < 0.0)
        value = abs(value)
        ref = self._literals.get(value) if value == value else self._refs.get(("nan",))
        if ref is None:
            ref = 2 * len(self.nodes)
            self._constants[len(self.nodes)] = value
            self.nodes.append(("const", value))
            if value == value:
                self._literals[value] = ref
            else:
                self._refs[("nan",)] = ref
        return ref | sign

    def truth(self, value: bool) -> int:
        """The reference of a truth value that is known already."""
        return TRUE if value else FALSE

    def value(self, ref: int) -> float | None:
        """The number of a reference, where it is known already."""
        value = self._constants.get(ref >> 1)
        return value if value is None or not ref & 1 else -value

    def _fold(self, op: str, *refs: int) -> int | None:
        """A constant's reference where all operands are constants."""
        values = [self.value(ref) for ref in refs]
        if None in values:
            return None
        result = PLAIN[op](*values)
        return self.truth(result) if op in TRUTHS else self.constant(result)

    def add(self, a: int, b: int) -> int:
        """A reference to a + b; to a constant or simpler operation where one will do. Signs are in the last bit of
        references."""
        if a > b:
            a, b = b, a
        if a < 2:
            return b
        constants = self._constants
        if a >> 1 in constants and b >> 1 in constants:
            return self.constant(self.value(a) + self.value(b))  # type: ignore[operator]
        if a == b:
            return self.mul(a, self.constant(2.0))
        sign = a & 1
        if sign == b & 1:
            return self.make("add", a & -2, b & -2) | sign
        return self.make("sub", a & -2, b & -2) | sign

    def mul(self, a: int, b: int) -> int:
        """A reference to a b; to a constant or an operand where one will do."""
        sign = (a ^ b) & 1
        a &= -2
        b &= -2
        if a > b:
            a, b = b, a
        if a <= ONE:
            return ZERO if a == ZERO else b | sign
        constants = self._constants
        if a >> 1 in constants and b >> 1 in constants:
            return self.constant(constants[a >> 1] * constants[b >> 1]) | sign
        return self.make("mul", a, b) | sign

    def div(self, a: int, b: int) -> int:
        """A reference to a/b; to a product where b is a constant power of two."""
        sign = (a ^ b) & 1
        a &= -2
        b &= -2
        divisor = self._constants.get(b >> 1)
        if divisor is not None:
            if a >> 1 in self._constants:
                return self.constant(PLAIN["div"](self._constants[a >> 1], divisor)) ^ sign
            if math.isfinite(divisor) and math.frexp(divisor)[0] == 0.5 and 2.0**-1000 < divisor < 2.0**1000:
                return self.mul(a, self.constant(1.0 / divisor)) ^ sign
        return self.make("div", a, b) | sign

    def unary(self, op: str, a: int) -> int:
        """A reference to an operation on one number: abs, sqrt, floor, rint, pow2, exponent or significand."""
        folded = self._fold(op, a)
        if folded is not None:
            return folded
        if op == "abs":
            a &= -2
            if self.nodes[a >> 1][0] in ("abs", "sqrt"):
                return a
        elif op == "rint":
            return self.make(op, a & -2) | a & 1
        return self.make(op, a)

    def fma(self, a: int, b: int, c: int) -> int:
        """A reference to a*b + c, rounded once; to a simpler operation where one of them is 0 or 1."""
        if (a & -2) == ZERO or (b & -2) == ZERO:
            return c
        if (c & -2) == ZERO:
            return self.mul(a, b)
        if (a & -2) == ONE:
            return self.add(b ^ a & 1, c)
        if (b & -2) == ONE:
            return self.add(a ^ b & 1, c)
        folded = self._fold("fma", a, b, c)
        if folded is not None:
            return folded
        sign = c & 1
        turned = (a ^ b) & 1 ^ sign
        a, b = sorted((a & -2, b & -2))
        return self.make("fma", a | turned, b, c & -2) | sign

    def less(self, op: str, a: int, b: int) -> int:
        """a < b ("lt") or a <= b ("le")."""
        if a & b & 1:
            a, b = b ^ 1, a ^ 1
        if op == "lt" and a == b:
            return FALSE
        folded = self._fold(op, a, b)
        if folded is None:
            folded = self._chosen_compare(op, a, b)
        return self.make(op, a, b) if folded is None else folded

    def equal(self, a: int, b: int) -> int:
        """A reference to the truth of a = b."""
        if a > b:
            a, b = b, a
        if a & 1:
            a, b = a ^ 1, b ^ 1
        folded = self._fold("eq", a, b)
        if folded is None:
            folded = self._chosen_compare("eq", a, b)
        return self.make("eq", a, b) if folded is None else folded

    def _chosen_compare(self, op: str, a: int, b: int) -> int | None:
        """A comparison of where(mask, constant, constant) with a constant is the mask, its opposite or known."""
        for chosen, other in ((a, b), (b, a)):
            node, limit = self.nodes[chosen >> 1], self.value(other)
            if limit is None or node[0] != "where":
                continue
            arms = [self.value(node[i] ^ chosen & 1) for i in (2, 3)]
            if None in arms:
                continue
            yes, no = (PLAIN[op](arm, limit) if chosen == a else PLAIN[op](limit, arm) for arm in arms)
            return self.truth(yes) if yes == no else node[1] ^ no
        return None

    def both(self, a: int, b: int) -> int:
        """A reference to the truth that both hold: a new node, or a, b or FALSE where that is the same.

        FALSE and TRUE are the two least references, so only the lesser of a and b can be one of them.
        """
        if a > b:
            a, b = b, a
        if a == FALSE or a ^ b == 1:
            return FALSE
        if a in (TRUE, b):
            return b
        return self.make("and", a, b)

    def where(self, mask: int, a: int, b: int) -> int:
        """A reference to a where the mask holds, else to b."""
        if mask & -2 == FALSE:
            return a if mask & 1 else b
        if mask & 1:
            mask, a, b = mask ^ 1, b, a
        for _ in range(2):
            node = self.nodes[a >> 1]
            if node[0] == "where" and node[1] == mask:
                a = node[2] ^ a & 1
            node = self.nodes[b >> 1]
            if node[0] == "where" and node[1] == mask:
                b = node[3] ^ b & 1
        if a == b:
            return a
        if self.nodes[a >> 1][0] in TRUTHS:
            return self.both(self.both(mask, a) ^ 1, self.both(mask ^ 1, b) ^ 1) ^ 1
        sign = a & b & 1
        return self.make("where", mask, a ^ sign, b ^ sign) | sign

    def bit(self, a: int, n: int) -> int:
        """Bit n of a double's pattern, 63 its sign."""
        value = self.value(a)
        return self.make("bit", a, n) if value is None else self.truth(PLAIN["bit"](value, n))

    def flip(self, a: int, b: int, n: int) -> int:
        """a, or -a where bit n of b's pattern is set."""
        if self.value(b) is not None:
            return a ^ PLAIN["bit"](self.value(b), n)
        if a >> 1 == b >> 1 and n == 63:
            return self.unary("abs", a) ^ (a ^ b) & 1
        return self.make("flip", a & -2, b, n) | a & 1

    def gather(self, table: tuple[float, ...], index: int) -> int:
        value = self.value(index)
        return self.make("gather", index, table) if value is None else self.constant(PLAIN["gather"](value, table))

    def philox(self, *operands: Any) -> int:
        """Word number `operands[6]`, 0 to 3, of what Philox4x32-10 makes of four counter words and two key words."""
        *refs, word = operands
        values = [self.value(ref) for ref in refs]
        if None in values:
            return self.make("philox", *refs, word)
        return self.constant(PLAIN["philox"](*values, word))

    # Reading

    def live(self, roots: Iterable[int]) -> list[int]:
        """Positions of all nodes that the references need, in order of creation."""
        return live(self.nodes, roots)

    def show(self, ref: int) -> str:
        """One value as text: its node, with operands by number."""
        return ("~" if self.nodes[ref >> 1][0] in TRUTHS else "-") * (ref & 1) + show(self.nodes, ref >> 1)

    def __str__(self) -> str:
        return "\n".join(f"%{i} = {show(self.nodes, i)}" for i in range(len(self.nodes)))


def live(nodes: Sequence[Node], roots: Iterable[int]) -> list[int]:
    """Positions of all nodes that the references need, in order of creation."""
    needed = bytearray(len(nodes))
    last = -1
    for ref in roots:
        needed[ref >> 1] = 1
        last = max(last, ref >> 1)
    for i in range(last, -1, -1):  # a node stands after its operands
        if needed[i]:
            node = nodes[i]
            for ref in node[1 : 1 + OPERANDS[node[0]]]:
                needed[ref >> 1] = 1
    return [i for i, need in enumerate(needed) if need]


def show(nodes: Sequence[Node], i: int) -> str:
    """One node as text, its operands by number."""
    node = nodes[i]
    count = OPERANDS[node[0]]
    words = [("~" if nodes[ref >> 1][0] in TRUTHS else "-") * (ref & 1) + f"%{ref >> 1}" for ref in node[1 : 1 + count]]
    return " ".join([str(node[0]), *words, *(str(rest) for rest in node[1 + count :])])


def evaluate(nodes: Sequence[Node], order: Iterable[int], leaf: Any, *, arrays: bool) -> dict[int, Any]:
    """Values of nodes by position, over floats or over arrays; `leaf(node)` gives inputs, cells and the like."""
    table = ARRAYS if arrays else PLAIN
    values: dict[int, Any] = {}
    for i in order:
        node = nodes[i]
        op = node[0]
        count = OPERANDS[op]
        if count == 0:
            values[i] = node[1] if op == "const" else False if op == "false" else leaf(node)
            continue
        operands = []
        for ref in node[1 : 1 + count]:
            value = values[ref >> 1]
            if ref & 1:
                value = np.logical_not(value) if nodes[ref >> 1][0] in TRUTHS else -value
            operands.append(value)
        values[i] = table[op](*operands, *node[1 + count :])
    return values
