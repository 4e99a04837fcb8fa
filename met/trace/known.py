"""Results of a recorded computation whose derivative is known in closed form, in place of operation by operation.

A recorded computation may come with its derivative (`Nodes.known`): the tangents of its results from those of its
arguments. A plain program is not changed by it, since nodes for derivatives are made only on request.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from met.frozen import frozen
from met.trace.nodes import ZERO, Nodes

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
