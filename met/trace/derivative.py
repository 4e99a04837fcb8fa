"""Derivatives of recorded numbers by their inputs, or along a direction: forward, node by node, in the graph itself.

They are taken piece by piece: `where` has the derivative of the chosen operand, so at a kink or a jump that of the side
which the condition takes there; `floor`, `rint`, tables and random numbers have none. The derivative of sin, cos, exp
and the like is that of their polynomials, right to some units in the last place of the function's own size.

For plain functions: record them, and `Formulas.replay` the derivative over floats or arrays.

A recorded computation may come with its derivative (`Nodes.known`): the tangents of its results from those of its
arguments. A plain program is not changed by it, since nodes for derivatives are made only on request.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from met.frozen import frozen
from met.trace.nodes import OPERANDS, TRUTHS, ZERO, Node, Nodes
from met.trace.scalar import Scalar

Tangent = Callable[[int], int]
"""The reference of the derivative of a reference's number."""


@frozen
class KnownDerivative:
    """The derivative of a computation that is in a graph.

    results   references of what it gives
    held      references of what it takes that it has no derivative by: where one of these moves, it is not known
    moves     makes what all directions share in a graph that has the nodes of the one it was recorded in, and gives a
              function that makes the derivatives of the results along one direction
    """

    results: tuple[int, ...]
    held: tuple[int, ...]
    moves: Callable[[Nodes], Callable[[Tangent], Sequence[int]]]


class KnownTangents:
    """Derivatives that a section's recording has in closed form, for one direction after the other."""

    def __init__(self, graph: Nodes, known: Sequence[KnownDerivative]) -> None:
        self._graph, self._known = graph, known
        self._moves: dict[int, Callable[[Tangent], Sequence[int]]] = {}
        self._number_of = {ref >> 1: number for number, derivative in enumerate(known) for ref in derivative.results}

    def at(self, position: int, tangent: Tangent) -> dict[int, int]:
        """By position, the derivatives of all results of the computation that gives a node; none where they are not
        known. tangent: of nodes before it"""
        number = self._number_of.get(position)
        if number is None:
            return {}
        derivative = self._known[number]
        if any(tangent(ref) & -2 != ZERO for ref in derivative.held):
            return {}
        if number not in self._moves:
            self._moves[number] = derivative.moves(self._graph)
        moves = self._moves[number](tangent)
        return {ref >> 1: move ^ (ref & 1) for ref, move in zip(derivative.results, moves, strict=True)}


ROUNDS = 2.0**51
"""A sum with a constant of at least this size is whole, or half of it, by which functions round
(met/trace/elementary.py)."""


def derivative(x: Scalar, name: str) -> Scalar:
    """d x / d `name`, an input of x's graph; its other inputs, cells, tick and time are held."""
    graph = x.graph
    tangents = slopes(graph, graph.live([x.ref]), lambda node: graph.constant(float(node == ("input", name))))
    return Scalar(graph, tangents[x.ref >> 1] ^ (x.ref & 1))


def slopes(
    graph: Nodes,
    order: Iterable[int],
    leaf: Callable[[Node], int],
    straight: Callable[[int], bool] = lambda _: False,
    known: KnownTangents | None = None,
) -> dict[int, int]:
    """References of the derivatives of nodes by position, made in the same graph; that of a truth is 0.

    order     positions of the nodes, each after its operands
    leaf      gives the reference of a leaf's own derivative
    straight  tells of a `floor` or `rint` by its position whether it counts as the straight line through its steps
    known     derivatives that are known in closed form; None: each operation goes by its own rule
    """
    tangents: dict[int, int] = {}
    closed: dict[int, int] = {}

    def tangent(ref: int) -> int:
        return tangents.get(ref >> 1, ZERO) ^ (ref & 1)

    for i in order:
        if known is not None:
            if i not in closed:
                closed |= known.at(i, tangent)
            if i in closed:
                tangents[i] = closed[i]
                continue
        op, *rest = graph.nodes[i]
        operands = [ref for ref in rest[: OPERANDS[op]] if graph.nodes[ref >> 1][0] not in TRUTHS]
        moving = any(tangents[ref >> 1] & -2 != ZERO for ref in operands)
        if op in ("input", "cell"):
            tangents[i] = leaf(graph.nodes[i])
        elif moving and op in STEPS and straight(i):
            tangents[i] = tangents[rest[0] >> 1] ^ (rest[0] & 1)
        elif moving and op in _RULES and not rounds(graph, op, rest):
            numbers = [Scalar(graph, ref) for ref in rest[: OPERANDS[op]]]
            moves = [Scalar(graph, tangents.get(ref >> 1, ZERO) ^ (ref & 1)) for ref in rest[: OPERANDS[op]]]
            tangents[i] = _RULES[op](graph, [*rest[OPERANDS[op] :]], Scalar(graph, 2 * i), numbers, moves).ref
        else:
            tangents[i] = ZERO
    return tangents


def rounds(graph: Nodes, op: str, operands: Sequence[int]) -> bool:
    """True where a node is a sum that rounds to whole numbers, or halves."""
    added = {"add": operands[:2], "sub": operands[:2], "fma": operands[2:3]}.get(op, [])
    return any(abs(value) >= ROUNDS for ref in added if (value := graph.value(ref)) is not None)


STEPS = ("floor", "rint")
"""Operations that give whole numbers: a converter's steps."""

Rule = Callable[[Nodes, list[int], Scalar, list[Scalar], list[Scalar]], Scalar]
"""A function (graph, further arguments of the node, the node, its operands, their derivatives) -> the node's
derivative."""


def _flip(graph: Nodes, sign: Scalar, move: Scalar, bit: int) -> Scalar:
    return Scalar(graph, graph.flip(move.ref, sign.ref, bit))


def sign_of(graph: Nodes, chosen: Sequence[int]) -> int | None:
    """The reference of the number whose sign a `where` of these operands is (1, -1, or the number itself where it is
    0): the sign jumps there, and is constant elsewhere. None: it is not a sign."""
    mask, above, rest = chosen
    condition, inner = graph.nodes[mask >> 1], graph.nodes[rest >> 1]
    if mask & 1 or condition[:2] != ("lt", ZERO) or graph.value(above) is None or inner[0] != "where" or inner[1] & 1:
        return None
    x, below = condition[2], inner[2] ^ (rest & 1)
    same = graph.nodes[inner[1] >> 1] in (("lt", x, ZERO), ("lt", ZERO, x ^ 1)) and inner[3] ^ (rest & 1) == x
    return int(x) if same and graph.value(below) is not None else None


def _choice(graph: Nodes, x: list[Scalar], dx: list[Scalar]) -> Scalar:
    if sign_of(graph, [operand.ref for operand in x]) is not None:
        return Scalar(graph, ZERO)
    return Scalar(graph, graph.where(x[0].ref, dx[1].ref, dx[2].ref))


_RULES: dict[str, Rule] = {
    "add": lambda g, _, y, x, dx: dx[0] + dx[1],
    "sub": lambda g, _, y, x, dx: dx[0] - dx[1],
    "mul": lambda g, _, y, x, dx: dx[0] * x[1] + x[0] * dx[1],
    "fma": lambda g, _, y, x, dx: dx[0] * x[1] + x[0] * dx[1] + dx[2],
    "div": lambda g, _, y, x, dx: (dx[0] - y * dx[1]) / x[1],
    "sqrt": lambda g, _, y, x, dx: dx[0] / (2.0 * y),
    "abs": lambda g, _, y, x, dx: _flip(g, x[0], dx[0], 63),
    "flip": lambda g, rest, y, x, dx: _flip(g, x[1], dx[0], rest[0]),
    "where": lambda g, _, y, x, dx: _choice(g, x, dx),
    "significand": lambda g, _, y, x, dx: dx[0] * (y / x[0]),
}
"""Rules of differentiation by operation. Operations without a rule have no derivative, or one only between jumps."""
