"""Sections of a recorded program with tangents: graphs that also compute the tangents of all their results.

A cell NAME that moves has a second one, `d:NAME`, its tangent: a number for one direction, an array for several at
once, with which the same operations compute (forward mode, A. Griewank and A. Walther, Evaluating Derivatives, 2008,
ch. 3). Values that cannot move have none, so the graph is sparse, and nodes that two tangents share exist once. At a
comparison whose sides are equal the derivative may differ from the other side; such places are listed.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import cached_property
from typing import Any

from met.frozen import frozen
from met.trace.derivative import STEPS, KnownTangents, rounds, sign_of, slopes
from met.trace.nodes import OPERANDS, TRUTHS, ZERO, Node, Nodes, live
from met.trace.primitives import PLAIN
from met.trace.program import CodeSection

HEAD = "d:"
"""Prefix of the name of a cell: the cell of its tangent."""

MOVES = frozenset({"add", "sub", "mul", "div", "fma", "sqrt", "abs", "flip", "where", "significand"})
"""Operations whose result moves with their operands; `met.trace.derivative` has their rules."""

SIGN = 63
"""Number of the bit that is a double's sign."""


@frozen
class Kink:
    """A place in a section where two numbers are equal, and the derivative, or for a sign the number itself, may differ
    from the other side.

    sides   references of the two;  move: of the tangent of their difference
    nodes   positions of what goes by their order, the opposite of which is the other side
    """

    sides: tuple[int, int]
    move: int
    nodes: tuple[int, ...]


@frozen
class TangentSection:
    """A section with tangents: `stores`, `records` and `outputs` as `CodeSection` has them, and their tangents by the
    same names.

    A store whose tangent is always 0 is in `stores` only; its tangent's cell must be deleted.
    """

    name: str
    nodes: tuple[Node, ...]
    stores: tuple[tuple[str, int], ...]
    tangents: tuple[tuple[str, int], ...]
    records: tuple[tuple[int, int], ...]
    record_tangents: tuple[tuple[int, int], ...]
    outputs: tuple[tuple[int, int], ...]
    output_tangents: tuple[tuple[int, int], ...]
    kinks: tuple[Kink, ...]

    @cached_property
    def roots(self) -> list[int]:
        """References of all results, and of the numbers that its kinks compare."""
        several = (
            self.stores, self.tangents, self.records, self.record_tangents, self.outputs, self.output_tangents,
        )  # fmt: skip
        roots = [ref for pairs in several for _, ref in pairs]
        return roots + [ref for kink in self.kinks for ref in (*kink.sides, kink.move)]

    @cached_property
    def order(self) -> list[int]:
        """Positions of the live nodes, in order of creation."""
        return live(self.nodes, self.roots)

    @cached_property
    def last_uses(self) -> Mapping[int, list[int]]:
        """By position of a live node, the nodes that are not used after it."""
        last = {ref >> 1: i for i in self.order for ref in self.nodes[i][1 : 1 + OPERANDS[self.nodes[i][0]]]}
        by_node: dict[int, list[int]] = {}
        for node in last.keys() - {ref >> 1 for ref in self.roots}:
            by_node.setdefault(last[node], []).append(node)
        return by_node

    @cached_property
    def plain_order(self) -> list[int]:
        """Positions of the nodes that are live where nothing moves, so that no tangent is needed."""
        return live(self.nodes, [ref for pairs in (self.stores, self.records, self.outputs) for _, ref in pairs])


Straight = Callable[[CodeSection, int], bool]
"""A test of a `floor` or `rint` in a section, by its position: True if it counts as the straight line through its
steps, as in a converter; otherwise it has no derivative."""


def moved_by(
    section: CodeSection, moving: Collection[str], inputs: Collection[str] = (), straight: Straight | None = None
) -> frozenset[str]:
    """The cells to which a section stores numbers that move with these cells and inputs. straight: None: steps count as
    straight lines."""
    moves = moving_nodes(section, moving, inputs, straight)
    return frozenset(cell for cell, ref in section.stores if moves[ref >> 1])


def moving_nodes(
    section: CodeSection, moving: Collection[str], inputs: Collection[str] = (), straight: Straight | None = None
) -> bytearray:
    """By position, 1 for each live node of a section that moves with these cells and inputs, as for `moved_by`."""
    nodes = section.nodes
    marks = bytearray(len(nodes))
    for i in section.order:
        op, *rest = nodes[i]
        if op == "cell":
            marks[i] = rest[0] in moving
        elif op == "input":
            marks[i] = rest[0] in inputs
        elif op in MOVES or (op in STEPS and (straight is None or straight(section, i))):
            marks[i] = any(marks[ref >> 1] for ref in rest[: OPERANDS[op]])
    return marks


def with_tangents(
    section: CodeSection,
    moving: Collection[str],
    straight: Straight,
    inputs: Collection[str] = (),
) -> TangentSection:
    """The section with the tangents of everything that moves with these cells and inputs; tangents of inputs are
    inputs, and those of cells are cells, with the prefix `HEAD`."""
    graph = Nodes.of(section.nodes)

    def leaf(node: Node) -> int:
        moves = node[1] in (moving if node[0] == "cell" else inputs)
        return graph.make(node[0], HEAD + node[1]) if moves else ZERO

    slope_refs = slopes(graph, section.order, leaf, lambda i: straight(section, i), KnownTangents(graph, section.known))

    def tangent(ref: int) -> int:
        return slope_refs.get(ref >> 1, ZERO) ^ (ref & 1)

    def moved(pairs: Iterable[tuple[Any, int]]) -> tuple[tuple[Any, int], ...]:
        return tuple((name, tangent(ref)) for name, ref in pairs if tangent(ref) & -2 != ZERO)

    tangents, record_tangents, output_tangents = map(moved, (section.stores, section.records, section.outputs))
    kinks = _kinks(graph, section.order, slope_refs, [ref for _, ref in (*tangents, *record_tangents)])
    return TangentSection(
        section.name, tuple(graph.nodes), section.stores, tangents, section.records, record_tangents,
        section.outputs, output_tangents, kinks,
    )  # fmt: skip


def _kinks(graph: Nodes, order: Iterable[int], slope_refs: Mapping[int, int], roots: Iterable[int]) -> tuple[Kink, ...]:
    """The kinks on which these tangents depend: comparisons by size, and the bit of a sign; and all signs of moving
    numbers, which jump. A test of two numbers for equality is not a kink: it keeps a quotient from 0/0 where it has a
    limit."""
    needed = frozenset(live(graph.nodes, roots))
    kinks, of_sign = [], dict[int, list[int]]()
    for i in order:
        op, *rest = graph.nodes[i]
        x = sign_of(graph, rest) if op == "where" else None
        if x is not None and (slope_refs.get(x >> 1, ZERO) & -2) != ZERO:
            kinks.append(Kink((x, ZERO), slope_refs[x >> 1] ^ (x & 1), (rest[0] >> 1,)))
    for i in sorted(needed):
        op, *rest = graph.nodes[i]
        if op in ("lt", "le"):
            sides = (rest[0], rest[1])
            a, b = (slope_refs.get(ref >> 1, ZERO) ^ (ref & 1) for ref in sides)
            move = graph.add(a, b ^ 1)
            if move & -2 != ZERO:
                kinks.append(Kink(sides, move, (i,)))
        elif op == "flip" and rest[2] == SIGN and not rounds(graph, op, rest):
            of_sign.setdefault(rest[1] & -2, []).append(i)
        elif op == "bit" and rest[1] == SIGN:
            of_sign.setdefault(rest[0] & -2, []).append(i)
    for ref, nodes in of_sign.items():
        move = slope_refs.get(ref >> 1, ZERO)
        if move & -2 != ZERO:
            kinks.append(Kink((ref, ZERO), move, tuple(nodes)))
    return tuple(kinks)


PRODUCTS: Mapping[str, Callable[..., Any]] = {**PLAIN, "fma": lambda a, b, c: a * b + c}
"""The operations over plain numbers and arrays of tangents, with products and sums rounded separately."""


def values(
    section: TangentSection, leaf: Callable[[Node], Any], opposite: Collection[int] = (), *, plain: bool = False
) -> Callable[[int], Any]:
    """The value of each reference of a section: numbers are floats, tangents floats or arrays.

    leaf      gives what a cell, an input, the tick and the time are
    plain     whether numbers alone are asked for, and no tangents
    opposite  positions of nodes of kinks that take the other side
    """
    nodes = section.nodes
    node_values: list[Any] = [None] * len(nodes)
    for i in section.plain_order if plain else section.order:
        node = nodes[i]
        op, count = node[0], OPERANDS[node[0]]
        if count == 0:
            node_values[i] = node[1] if op == "const" else False if op == "false" else leaf(node)
            continue
        operands = []
        for ref in node[1 : 1 + count]:
            value = node_values[ref >> 1]
            if ref & 1:
                value = (not value) if nodes[ref >> 1][0] in TRUTHS else -value
            operands.append(value)
        value = PRODUCTS[op](*operands, *node[1 + count :])
        if i in opposite:
            value = (not value) if op in TRUTHS else -value
        node_values[i] = value

    def value_of(ref: int) -> Any:
        return -node_values[ref >> 1] if ref & 1 else node_values[ref >> 1]

    return value_of
