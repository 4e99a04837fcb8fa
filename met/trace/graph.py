"""The record of a computation as models see it, a graph whose inputs are scalars, and its formulas as plain data.

`met.trace.nodes` says what the record does to what it is given.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from met.frozen import frozen
from met.trace.nodes import FALSE, OPERANDS, TRUTHS, Node, Nodes, evaluate
from met.trace.scalar import Mask, Scalar

Real = float | Scalar
Truth = bool | Mask


class Graph(Nodes):
    """Nodes made so far, with inputs as scalars that models compute with."""

    __slots__ = ()

    def input(self, name: str) -> Scalar:
        """A number that each case brings."""
        return Scalar(self, self.make("input", name))


def _spelled(node: Node) -> Node:
    """A node with its numbers as JSON can hold them: non-finite ones as words."""
    if node[0] == "const" and not math.isfinite(node[1]):
        return ("const", repr(node[1]))
    if node[0] == "gather":
        return (*node[:2], tuple(x if math.isfinite(x) else repr(x) for x in node[2]))
    return node


@frozen
class Formulas:
    """Formulas as plain data, which a plan stores, and which are replayed over floats, arrays or scalars.

    inputs   names, in order of first use
    nodes    as in a graph, numbered from 0, without dead ones: ("const", number, "inf" or "nan"), ("input", name)
    outputs  references into the nodes
    """

    inputs: tuple[str, ...] = ()
    nodes: tuple[Node, ...] = ()
    outputs: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Turn lists from JSON into tuples again."""
        object.__setattr__(self, "inputs", tuple(self.inputs))
        object.__setattr__(
            self,
            "nodes",
            tuple(tuple(tuple(part) if isinstance(part, list) else part for part in node) for node in self.nodes),
        )
        object.__setattr__(self, "outputs", tuple(self.outputs))

    @staticmethod
    def of(graph: Graph, outputs: Iterable[Real]) -> Formulas:
        """The part of a graph that the outputs need; an output may be a plain number."""
        refs = [x.ref if isinstance(x, (Scalar, Mask)) else graph.constant(x) for x in outputs]
        order = graph.live(refs)
        number = {i: 2 * n for n, i in enumerate(order)}
        nodes = []
        for i in order:
            node = graph.nodes[i]
            count = OPERANDS[node[0]]
            if node[0] in ("cell", "tick", "time"):
                raise ValueError("formulas are made of inputs; a program's memory and time are not theirs")
            operands = (number[ref >> 1] | ref & 1 for ref in node[1 : 1 + count])
            nodes.append(_spelled((node[0], *operands, *node[1 + count :])))
        inputs = tuple(node[1] for node in nodes if node[0] == "input")
        return Formulas(inputs, tuple(nodes), tuple(number[ref >> 1] | ref & 1 for ref in refs))

    def replay(self, values: Mapping[str, Any]) -> list[Any]:
        """The outputs from values by name: floats, numpy arrays of one shape, or scalars being recorded."""
        nodes = [
            ("const", float(node[1]))
            if node[0] == "const"
            else (*node[:2], tuple(map(float, node[2])))
            if node[0] == "gather"
            else node
            for node in self.nodes
        ]
        graph = next((x.graph for x in values.values() if isinstance(x, Scalar)), None)
        if graph is not None:
            return _respliced(graph, nodes, self.outputs, values)
        arrays = any(isinstance(values[name], np.ndarray) for name in self.inputs)
        with np.errstate(all="ignore"):
            results = evaluate(nodes, range(len(nodes)), lambda node: values[node[1]], arrays=arrays)
        truths = [nodes[ref >> 1][0] in TRUTHS for ref in self.outputs]
        return [
            results[ref >> 1] if not ref & 1 else ~np.bool_(results[ref >> 1]) if truth else -results[ref >> 1]
            for ref, truth in zip(self.outputs, truths, strict=True)
        ]


def _respliced(graph: Nodes, nodes: Sequence[Node], outputs: Sequence[int], values: Mapping[str, Any]) -> list[Any]:
    """Outputs of a recorded formula, made again in another graph. values: what stands there for its inputs, by name."""
    makers: dict[str, Any] = {
        "add": graph.add,
        "sub": lambda a, b: graph.add(a, b ^ 1),
        "mul": graph.mul,
        "div": graph.div,
        "fma": graph.fma,
        "where": graph.where,
        "eq": graph.equal,
        "and": graph.both,
        "bit": graph.bit,
        "flip": graph.flip,
        "philox": graph.philox,
        "gather": lambda index, table: graph.gather(table, index),
        "const": graph.constant,
        "false": lambda: FALSE,
    }
    refs: list[int] = []
    for node in nodes:
        op, count = node[0], OPERANDS[node[0]]
        operands = [refs[ref >> 1] ^ ref & 1 for ref in node[1 : 1 + count]]
        if op == "input":
            value = values[node[1]]
            refs.append(value.ref if isinstance(value, Scalar) else graph.constant(value))
        elif op in ("lt", "le"):
            refs.append(graph.less(op, *operands))
        elif op in makers:
            refs.append(makers[op](*operands, *node[1 + count :]))
        else:
            refs.append(graph.unary(op, *operands))
    kinds = [Mask if nodes[ref >> 1][0] in TRUTHS else Scalar for ref in outputs]
    return [kind(graph, refs[ref >> 1] ^ ref & 1) for kind, ref in zip(kinds, outputs, strict=True)]
