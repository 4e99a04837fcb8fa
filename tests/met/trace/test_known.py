"""A derivative that is told in closed form is taken in place of operation by operation, where all is known by it."""

from __future__ import annotations

from collections.abc import Callable

from met.trace.derivative import KnownDerivative, Tangent
from met.trace.graph import Graph
from met.trace.nodes import Nodes
from met.trace.program import CodeSection
from met.trace.scalar import Scalar
from met.trace.tangents import HEAD, values, with_tangents


def told(factor: float = 2.0) -> CodeSection:
    """z = x x + y, of which is told `factor` x dx by x alone; 2 is right."""
    graph = Graph()
    x, y = (Scalar(graph, graph.make("cell", name)) for name in "xy")
    z = x * x + y

    def moves(graph: Nodes) -> Callable[[Tangent], list[int]]:
        twice = graph.mul(graph.constant(factor), x.ref)
        return lambda tangent: [graph.mul(twice, tangent(x.ref))]

    graph.known.append(KnownDerivative((z.ref,), (y.ref,), moves))
    return CodeSection("a", tuple(graph.nodes), (("z", z.ref), ("less", z.ref ^ 1)), (), (), (), tuple(graph.known))


def moved(section: CodeSection, *moving: str) -> dict[str, float]:
    made = with_tangents(section, moving, lambda section, position: False)
    cells = {"x": 3.0, "y": 5.0, HEAD + "x": 1.0, HEAD + "y": 1.0}
    of = values(made, lambda node: cells[node[1]])
    return {cell: of(ref) for cell, ref in made.tangents}


def test_what_is_told_is_taken() -> None:
    assert moved(told(), "x") == {"z": 6.0, "less": -6.0}
    assert moved(told(factor=10.0), "x") == {"z": 30.0, "less": -30.0}


def test_where_something_moves_that_it_has_no_derivative_by_it_is_not_taken() -> None:
    assert moved(told(factor=10.0), "x", "y") == {"z": 7.0, "less": -7.0}
    assert moved(told(factor=10.0), "y") == {"z": 1.0, "less": -1.0}
