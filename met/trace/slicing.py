"""The part of a recorded program on which some of its outputs depend (a backward slice, Weiser 1981)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from met.trace.nodes import live
from met.trace.program import Branch, CodeSection, RecordedControl, WhileAny


def sections_in(body: Iterable[RecordedControl]) -> Iterator[int]:
    """The numbers of the sections that a body of control runs, in order; one that it runs twice comes twice."""
    for step in body:
        if isinstance(step, Branch):
            yield from sections_in(step.body)
        else:
            yield step.section


def loops_in(body: Iterable[RecordedControl]) -> Iterator[tuple[str, frozenset[int]]]:
    """The loops in a body of control, inner ones too: the cell that controls each, and the sections that it runs."""
    for step in body:
        if isinstance(step, Branch):
            if isinstance(step.condition, WhileAny):
                yield step.condition.cell, frozenset(sections_in(step.body))
            yield from loops_in(step.body)


def slice_roots(
    section: CodeSection, cells: Collection[str], outputs: Collection[int], columns: Collection[int] = ()
) -> list[int]:
    """References of the results of a section that these outputs and columns of a row need, or these cells."""
    return [
        *(ref for cell, ref in section.stores if cell in cells),
        *(ref for number, ref in section.outputs if number in outputs),
        *(ref for column, ref in section.records if column in columns),
    ]


def cells_behind(
    sections: Iterable[CodeSection],
    body: Iterable[RecordedControl],
    outputs: Collection[int],
    columns: Collection[int] = (),
    *,
    known: frozenset[str] = frozenset(),
) -> frozenset[str]:
    """The cells that these outputs and columns of a row depend on, at any tick, through other cells and through the
    cells that control loops.

    known  cells that are not gone into, and not among the answer
    """
    sections = list(sections)
    loops = list(loops_in(body))
    needed: set[str] = set()
    done: dict[int, list[int]] = {}
    while True:
        before = len(needed)
        for number, section in enumerate(sections):
            roots = slice_roots(section, needed, outputs, columns)
            if done.get(number, []) != roots:
                done[number] = roots
                reads = (section.nodes[i][1] for i in live(section.nodes, roots) if section.nodes[i][0] == "cell")
                needed.update(cell for cell in reads if cell not in known)
        needed.update(cell for cell, inside in loops if cell not in known and any(done.get(n) for n in inside))
        if len(needed) == before:
            return frozenset(needed)
