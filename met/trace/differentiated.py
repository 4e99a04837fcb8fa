"""Differentiation of a recorded program: another one that also computes tangents of its outputs by some inputs.

An input NAME that moves has a second one, `d:NAME`, its tangent; a cell and an output likewise. A case of the new
program is a case of the first one with a direction, so directions stand in lanes as cases do, and every back end runs
them. The numbers of the first program are computed by the same operations, with the same bits: its sums are fused as
they are there, and those of tangents after them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import replace

from met.frozen import frozen
from met.trace import check
from met.trace.fuse import fused_from
from met.trace.nodes import OPERANDS
from met.trace.program import WhileAny, walk
from met.trace.recorder import used_cells, without_dead_stores
from met.trace.recording import CodeSection, Recording
from met.trace.tangents import HEAD, Straight, moved_by, moving_nodes, with_tangents


def differentiated(recording: Recording, inputs: Collection[str], straight: Straight) -> Recording:
    """The program with tangents of everything that moves with these inputs. No phase is recorded again; an output that
    does not move has the tangent 0."""
    program = recording.program
    moving = moving_cells(recording, inputs, straight)
    made = [_section(one, moving, inputs, straight, len(program.outputs)) for one in recording.sections]
    asked = {node.cell for node in walk((*program.start, *program.tick, *program.end)) if isinstance(node, WhileAny)}
    sections = without_dead_stores(made, asked)
    found = Recording(
        replace(
            program,
            inputs=(*program.inputs, *(HEAD + name for name in program.inputs if name in inputs)),
            outputs=(*program.outputs, *(HEAD + name for name in program.outputs)),
            columns=0,
        ),
        tuple(sections),
        recording.start,
        recording.tick,
        recording.end,
        used_cells(sections, asked),
    )
    if check.wanted():
        check.check(found)
    return found


def moving_cells(recording: Recording, inputs: Collection[str], straight: Straight) -> frozenset[str]:
    """The cells that move with these inputs at any tick."""
    found: set[str] = set()
    return _closed(recording, found, lambda section: moved_by(section, found, inputs, straight))


@frozen
class Dependence:
    """The outputs that move with an input, and those that change with it at all, if only in steps; by their names."""

    moves: frozenset[str]
    changes: frozenset[str]


def dependence(recording: Recording, name: str, straight: Straight) -> Dependence:
    """The outputs of a program that depend on one of its inputs."""
    outputs = recording.program.outputs
    moving = moving_cells(recording, (name,), straight)
    changing: set[str] = set()
    _closed(recording, changing, lambda section: _stored(section, _changing(section, changing, name)))

    def of(reached: Callable[[CodeSection], bytearray]) -> frozenset[str]:
        ends = ((section, reached(section)) for section in recording.sections if section.outputs)
        return frozenset(outputs[number] for section, at in ends for number, ref in section.outputs if at[ref >> 1])

    return Dependence(
        of(lambda section: moving_nodes(section, moving, (name,), straight)),
        of(lambda section: _changing(section, changing, name)),
    )


def _closed(recording: Recording, found: set[str], more: Callable[[CodeSection], Iterable[str]]) -> frozenset[str]:
    """All cells that follow from those found before, section by section; a section is examined again only where it
    reads a new one."""
    reads = [{one.nodes[i][1] for i in one.order if one.nodes[i][0] == "cell"} for one in recording.sections]
    waiting = list(range(len(recording.sections)))
    while waiting:
        before = set(found)
        for number in waiting:
            found |= set(more(recording.sections[number]))
        new = found - before
        waiting = [number for number, cells in enumerate(reads) if cells & new]
    return frozenset(found)


def _stored(section: CodeSection, at: bytearray) -> Iterator[str]:
    return (cell for cell, ref in section.stores if at[ref >> 1])


def _changing(section: CodeSection, cells: Collection[str], name: str) -> bytearray:
    """By position, 1 for each live node that depends on these cells or on the input, through truths too."""
    found = bytearray(len(section.nodes))
    for i in section.order:
        op, *rest = section.nodes[i]
        if op == "cell":
            found[i] = rest[0] in cells
        elif op == "input":
            found[i] = rest[0] == name
        else:
            found[i] = any(found[ref >> 1] for ref in rest[: OPERANDS[op]])
    return found


def _section(
    section: CodeSection,
    moving: Collection[str],
    inputs: Collection[str],
    straight: Straight,
    outputs: int,
) -> CodeSection:
    """A section with tangents as stores and outputs of their own; a cell whose new value does not move gets the tangent
    0, since it may have had another."""
    found = with_tangents(section, moving, straight, inputs)
    tangents, of_outputs = dict(found.tangents), dict(found.output_tangents)
    stores = (
        *section.stores,
        *((HEAD + cell, tangents.get(cell, 0)) for cell, _ in section.stores if cell in moving),
    )
    ends = (*section.outputs, *((outputs + number, of_outputs.get(number, 0)) for number, _ in section.outputs))
    roots = [ref for _, ref in (*stores, *ends)]
    nodes = fused_from(found.nodes, roots, len(section.nodes))
    return CodeSection(section.name, tuple(nodes), stores, (), ends, section.parts)
