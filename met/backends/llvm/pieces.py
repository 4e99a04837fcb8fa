"""Cutting of a section into pieces that a compiler handles well, and the places of values between them.

One function of many thousands of operations ruins register allocation and takes long to compile. So a long section
becomes several functions of some hundred operations, cut where the fewest values are alive; those cross through scratch
memory. Values that come from memory anyway are read again in each piece. Pieces this short also let a processor overlap
one part of a block with the next (`emit`'s `vector`): 405 to 317 ns at 30 joints, 79 to 69 at 7.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from met.trace.nodes import LEAVES, OPERANDS
from met.trace.program import CodeSection

# operations above which a section is cut, and the bounds of a piece
CUT_ABOVE = 500
SHORTEST = 120
LONGEST = 250
# operations up to which a piece may be put in its caller's place
SMALL = 300


@dataclass
class Piece:
    """Consecutive operations of a section.

    body     (number in the section, node's position), in order
    saved    node's position -> scratch slot, of values that earlier pieces kept
    keep     the same, of values that later pieces will ask for
    stores   number in the section -> what is stored once that operation is done: (kind, where, reference)
    tail     what is stored at the piece's end, all values taken before the first store
    slots    scratch slots that the section needs in all
    """

    body: list[tuple[int, int]]
    saved: dict[int, int] = field(default_factory=dict)
    keep: dict[int, int] = field(default_factory=dict)
    stores: dict[int, list[tuple[str, Any, int]]] = field(default_factory=dict)
    tail: list[tuple[str, Any, int]] = field(default_factory=list)
    slots: int = 0
    small: bool = True


def operations(section: CodeSection) -> list[int]:
    """Positions of the live nodes that have to be computed."""
    return [i for i in section.order if section.nodes[i][0] not in LEAVES]


def cut(section: CodeSection, above: int = CUT_ABOVE, shortest: int = SHORTEST, longest: int = LONGEST) -> list[Piece]:
    """The section cut into pieces of `shortest` to `longest` operations, each to be one function; a single piece if it
    has no more than `above`."""
    nodes = section.nodes
    body = operations(section)
    number = {i: n for n, i in enumerate(body)}
    bounds = _bounds(section, body, number, shortest, longest) if len(body) > above else [0, len(body)]
    piece_of = [p for p, (a, b) in enumerate(pairwise(bounds)) for _ in range(a, b)]
    pieces = [Piece([(n, body[n]) for n in range(a, b)]) for a, b in pairwise(bounds)]
    last = len(pieces) - 1

    # when each cell's old value is loaded for the last time: at its first use in the last piece that uses it
    loaded: dict[str, int] = {}
    seen: set[tuple[int, str]] = set()
    for n, i in enumerate(body):
        for ref in nodes[i][1 : 1 + OPERANDS[nodes[i][0]]]:
            node = nodes[ref >> 1]
            if node[0] == "cell" and (piece_of[n], node[1]) not in seen:
                seen.add((piece_of[n], node[1]))
                loaded[node[1]] = n
    all_stores: list[tuple[str, Any, int]] = [
        *(("cell", name, ref) for name, ref in section.stores),
        *(("record", column, ref) for column, ref in section.records),
        *(("output", slot, ref) for slot, ref in section.outputs),
    ]
    at_end = {nodes[ref >> 1][1] for _, _, ref in all_stores if nodes[ref >> 1][0] == "cell"}

    last_use: dict[int, int] = {}
    for n, i in enumerate(body):
        for ref in nodes[i][1 : 1 + OPERANDS[nodes[i][0]]]:
            if ref >> 1 in number:
                last_use[ref >> 1] = max(last_use.get(ref >> 1, 0), piece_of[n])
    for kind, where, ref in all_stores:
        defined = number.get(ref >> 1, -1)
        when = max(defined, loaded.get(where, -1)) if kind == "cell" else defined
        if defined < 0 or (kind == "cell" and where in at_end):
            pieces[last].tail.append((kind, where, ref))
            if defined >= 0:
                last_use[ref >> 1] = last
        else:
            pieces[piece_of[when]].stores.setdefault(when, []).append((kind, where, ref))
            last_use[ref >> 1] = max(last_use.get(ref >> 1, 0), piece_of[when])
    _assign_scratch(pieces, body, piece_of, last_use)
    for piece in pieces:
        piece.small = len(pieces) == 1 and len(body) <= SMALL
    return pieces


def check(section: CodeSection, pieces: list[Piece]) -> None:
    """Raise ValueError where the pieces do not add up to the section: an operation or a store is missing, or a piece
    takes a value that it does not have."""
    nodes = section.nodes
    if [i for piece in pieces for _, i in piece.body] != operations(section):
        raise ValueError(f"{section.name}: its pieces are not its operations, once and in order")
    held: dict[int, int] = {}
    for number, piece in enumerate(pieces):
        computed: set[int] = set()

        def taken(ref: int, piece: Piece = piece, computed: set[int] = computed, number: int = number) -> None:
            i = ref >> 1
            if nodes[i][0] not in LEAVES and i not in computed and held.get(piece.saved.get(i, -1)) != i:
                raise ValueError(f"{section.name}: piece {number} takes node {i}, which it does not have")

        for n, i in piece.body:
            for ref in nodes[i][1 : 1 + OPERANDS[nodes[i][0]]]:
                taken(ref)
            computed.add(i)
            if i in piece.keep:
                held[piece.keep[i]] = i
            for _, _, ref in piece.stores.get(n, ()):
                taken(ref)
        for _, _, ref in piece.tail:
            taken(ref)
    stores = [store for piece in pieces for group in (*piece.stores.values(), piece.tail) for store in group]
    if sorted(ref for _, _, ref in stores) != sorted(section.roots):
        raise ValueError(f"{section.name}: its pieces do not store what it stores")


def _bounds(section: CodeSection, body: list[int], number: dict[int, int], shortest: int, longest: int) -> list[int]:
    """Positions at which a section is cut: each piece ends where the fewest values cross, within its bounds."""
    nodes = section.nodes
    change = [0] * (len(body) + 2)
    last_use = list(range(len(body)))
    for n, i in enumerate(body):
        for ref in nodes[i][1 : 1 + OPERANDS[nodes[i][0]]]:
            if ref >> 1 in number:
                last_use[number[ref >> 1]] = n
    for n, use in enumerate(last_use):
        change[n + 1] += 1
        change[use + 1] -= 1
    crossing, alive = [], 0
    for step in change:
        alive += step
        crossing.append(alive)
    bounds = [0]
    while len(body) - bounds[-1] > longest:
        low = bounds[-1] + shortest
        high = min(bounds[-1] + longest, len(body) - 1)
        bounds.append(min(range(low, high + 1), key=lambda n: (crossing[n], -n)))
    return [*bounds, len(body)]


def _assign_scratch(pieces: list[Piece], body: list[int], piece_of: list[int], last_use: dict[int, int]) -> None:
    """A slot for each value that crosses between pieces, free again after the last piece that uses it."""
    free: list[int] = []
    slots = 0
    ending: dict[int, list[int]] = {}
    for p, piece in enumerate(pieces):
        for _, i in piece.body:
            until = last_use.get(i, p)
            if until > p:
                if free:
                    slot = free.pop()
                else:
                    slot, slots = slots, slots + 1
                piece.keep[i] = slot
                ending.setdefault(until, []).append(slot)
                for later in pieces[p + 1 : until + 1]:
                    later.saved[i] = slot
        free.extend(sorted(ending.pop(p, ()), reverse=True))
    for piece in pieces:
        piece.slots = slots
