"""Fused multiply-adds: a product that only sums take is fused into them, rounded once instead of twice.

This pass decides every fusion, from the graph alone; no compiler is allowed another. So a case has the same bits
whatever the width, the instruction set or the level of optimisation.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from met.trace.graph import OPERANDS, Node, live


def fused(nodes: Sequence[Node], roots: Iterable[int]) -> list[Node]:
    """The nodes with every product that is used by sums alone fused into them.

    Positions stay, so references and roots hold. Where both operands of a sum are such products the later one is
    fused. A product used by anything else stays a product for all.
    """
    roots = list(roots)
    result = list(nodes)
    order = live(nodes, roots)
    outside = {ref >> 1 for ref in roots}
    users: dict[int, list[int]] = {}
    for i in order:
        node = nodes[i]
        for ref in node[1:1 + OPERANDS[node[0]]]:
            users.setdefault(ref >> 1, []).append(i)

    def fusable(i: int) -> bool:
        if nodes[i][0] != "mul" or i in outside:
            return False
        using = users[i]
        return len(using) == 1 and nodes[using[0]][0] in ("add", "sub")

    for i in order:
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
    return result
