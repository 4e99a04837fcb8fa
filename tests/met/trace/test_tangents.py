"""Graphs with tangents give the derivatives of what sections compute, sparsely, and tell where two sides meet."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from met.trace import Scalar, absolute, clip, cos, exp, maximum, sin, sqrt, where
from met.trace.graph import Graph
from met.trace.nodes import Nodes
from met.trace.program import CodeSection
from met.trace.tangents import HEAD, moved_by, values, with_tangents


def section(made: Callable[[Any, Any], dict[str, Any]]) -> CodeSection:
    """What is computed of the cells x and y, as a section that stores it by name."""
    graph = Graph()
    found = made(Scalar(graph, graph.make("cell", "x")), Scalar(graph, graph.make("cell", "y")))
    stores = tuple((name, value.ref) for name, value in found.items())
    return CodeSection("a", tuple(graph.nodes), stores, (), ())


def never(_: CodeSection, __: int) -> bool:
    return False


def jacobian(of: CodeSection, x: float, y: float, opposite: tuple[int, ...] = ()) -> dict[str, Any]:
    """Tangents of what it stores, by x and by y."""
    held = {"x": x, "y": y, HEAD + "x": np.array([1.0, 0.0]), HEAD + "y": np.array([0.0, 1.0])}
    made = with_tangents(of, {"x", "y"}, never)
    with np.errstate(all="ignore"):
        value = values(made, lambda node: held[node[1]], opposite)
    return {name: value(ref) for name, ref in made.tangents}


def test_tangents_are_the_closed_forms_derivatives() -> None:
    found = jacobian(section(lambda x, y: {"a": sin(x) * exp(y) / x, "b": sqrt(x * x + cos(y))}), 0.7, 0.3)
    s, c, e, root = math.sin(0.7), math.cos(0.7), math.exp(0.3), math.sqrt(0.49 + math.cos(0.3))
    np.testing.assert_allclose(found["a"], [e * (c / 0.7 - s / 0.49), s * e / 0.7], rtol=1e-14)
    np.testing.assert_allclose(found["b"], [0.7 / root, -math.sin(0.3) / (2.0 * root)], rtol=1e-14)


def test_what_does_not_move_has_no_tangent() -> None:
    of = section(lambda x, y: {"a": x * 2.0, "b": y + 1.0, "c": where(x > 0.0, 1.0, 2.0), "d": x * 0.0})
    assert moved_by(of, {"x"}) == {"a"}
    assert [name for name, _ in with_tangents(of, {"x"}, never).tangents] == ["a"]


def test_what_two_tangents_need_is_made_once() -> None:
    one, two = (
        with_tangents(section(lambda x, y, n=n: {f"a{k}": sin(x * y) for k in range(n)}), {"x", "y"}, never)
        for n in (1, 2)
    )
    assert len(one.order) == len(two.order)


def test_a_graph_of_nodes_goes_on_where_they_end() -> None:
    graph = Graph()
    x = graph.input("x")
    y = x * 3.0 + math.nan
    again = Nodes.of(graph.nodes)
    assert again.nodes == graph.nodes or str(again) == str(graph)
    assert Scalar(again, x.ref) * 3.0 + math.nan is not None
    assert (Scalar(again, x.ref) * 3.0).ref == (x * 3.0).ref and len(again.nodes) == len(graph.nodes)
    assert y.graph is graph


@pytest.mark.parametrize(
    ("made", "sides"),
    [
        (lambda x, y: {"a": maximum(x, y)}, ([1.0, 0.0], [0.0, 1.0])),
        (lambda x, y: {"a": absolute(x - y)}, ([1.0, -1.0], [-1.0, 1.0])),
        (lambda x, y: {"a": clip(x, -2.0, 0.5)}, ([1.0, 0.0], [0.0, 0.0])),
    ],
)
def test_at_a_kink_the_derivative_of_each_side_is_given(made: Any, sides: Any) -> None:
    of = section(made)
    (kink, *rest) = with_tangents(of, {"x", "y"}, never).kinks
    nodes = tuple(node for each in (kink, *rest) for node in each.nodes)
    found = {
        tuple(np.broadcast_to(jacobian(of, 0.5, 0.5, opposite).get("a", 0.0), 2).tolist())
        for opposite in ((), *((node,) for node in nodes))
    }
    assert {tuple(side) for side in sides} <= found


def test_steps_of_a_converter_count_as_their_straight_line_where_that_is_asked_for() -> None:
    from met.trace import rint

    of = section(lambda x, _: {"a": 0.25 * rint(x / 0.25)})
    assert not with_tangents(of, {"x"}, never).tangents
    made = with_tangents(of, {"x"}, lambda *_: True)
    value = values(made, lambda node: {"x": 0.3, HEAD + "x": 1.0}[node[1]])
    assert [value(ref) for _, ref in made.tangents] == [1.0]
