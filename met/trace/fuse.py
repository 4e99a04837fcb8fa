"""Fused multiply-adds: a product that is used only by sums is fused into them, rounded once instead of twice.

This pass decides every fusion, from the graph alone; no compiler is allowed another. So a case has the same bits
whatever the width, the instruction set or the level of optimisation.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from met.trace.nodes import OPERANDS, Node, live


def fused(nodes: Sequence[Node], roots: Iterable[int], leading: Iterable[int] | None = None) -> list[Node]:
    """The nodes with every product that is used by one sum alone fused into it.

    Positions stay, so references and roots hold. Where both operands of a sum are such products the later one is
    fused. A product used by anything else stays a product for all.

    leading  those of the roots whose sums are decided as if there were no others, so that what is only watched never
             changes what is watched; None: all of them
    """
    result = list(nodes)
    decided: list[int] = []
    if leading is not None:
        leading = list(leading)
        decided = live(nodes, leading)
        _fuse(nodes, decided, leading, decided, result)
    roots = list(roots)
    order = live(nodes, roots)
    if len(order) > len(decided):
        known = frozenset(decided)
        _fuse(nodes, order, roots, [i for i in order if i not in known], result)
    return result


def fused_from(nodes: Sequence[Node], roots: Iterable[int], first: int) -> list[Node]:
    """The nodes with products fused into sums from position `first` on; earlier ones are final."""
    result, roots = list(nodes), list(roots)
    order = live(nodes, roots)
    _fuse(nodes, order, roots, [i for i in order if i >= first], result)
    return result


def _fuse(
    nodes: Sequence[Node], order: Sequence[int], roots: Sequence[int], sums: Sequence[int], result: list[Node]
) -> None:
    """Fuse, in `result`, products into the sums among the positions `sums`.

    order  positions of all nodes that the roots need: a product that two of them take is not fused
    """
    # The uses of each node, and its last user; a product that leaves the section counts as used by others too.
    uses = [0] * len(nodes)
    user = [0] * len(nodes)
    for ref in roots:
        uses[ref >> 1] = 2
    for i in order:
        node = nodes[i]
        for ref in node[1 : 1 + OPERANDS[node[0]]]:
            uses[ref >> 1] += 1
            user[ref >> 1] = i

    def fusable(i: int) -> bool:
        return nodes[i][0] == "mul" and uses[i] == 1 and nodes[user[i]][0] in ("add", "sub")

    for i in sums:
        node = nodes[i]
        if node[0] not in ("add", "sub"):
            continue
        a, b = node[1], node[2] ^ (node[0] == "sub")
        if fusable(b >> 1):
            product, rest = b, a
        elif fusable(a >> 1):
            product, rest = a, b
        else:
            continue
        _, x, y = nodes[product >> 1]
        result[i] = ("fma", x ^ product & 1, y, rest)
