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
from met.trace.program import CodeSection, Recording
from met.trace.recorder import used_cells, without_dead_stores
from met.trace.tangents import HEAD, Straight, moved_by, moving_nodes, with_tangents


def differentiated(recording: Recording, inputs: Collection[str], straight: Straight) -> Recording:
    """The program with tangents of everything that moves with these inputs. No phase is recorded again; an output that
    does not move has the tangent 0."""
    program = recording.program
    moving = moving_cells(recording, inputs, straight)
    tangent_sections = [
        _section(section, moving, inputs, straight, len(program.outputs)) for section in recording.sections
    ]
    condition_cells = program.loop_cells
    sections = without_dead_stores(tangent_sections, condition_cells)
    tangent_recording = Recording(
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
        used_cells(sections, condition_cells),
    )
    if check.wanted():
        check.check(tangent_recording)
    return tangent_recording


def moving_cells(recording: Recording, inputs: Collection[str], straight: Straight) -> frozenset[str]:
    """The cells that move with these inputs at any tick."""
    cells: set[str] = set()
    return _closed(recording, cells, lambda section: moved_by(section, cells, inputs, straight))


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
        return frozenset(
            outputs[number] for section, marks in ends for number, ref in section.outputs if marks[ref >> 1]
        )

    return Dependence(
        of(lambda section: moving_nodes(section, moving, (name,), straight)),
        of(lambda section: _changing(section, changing, name)),
    )


def _closed(recording: Recording, cells: set[str], more: Callable[[CodeSection], Iterable[str]]) -> frozenset[str]:
    """The set `cells`, enlarged in place until no section of the program adds a cell to it.

    more  the cells that a section adds, which it finds from the same set as it is then

    A section is examined again only where it reads a cell that is new.
    """
    reads = [
        {section.nodes[i][1] for i in section.order if section.nodes[i][0] == "cell"} for section in recording.sections
    ]
    waiting = list(range(len(recording.sections)))
    while waiting:
        before = set(cells)
        for number in waiting:
            cells |= set(more(recording.sections[number]))
        new = cells - before
        waiting = [number for number, cells_read in enumerate(reads) if cells_read & new]
    return frozenset(cells)


def _stored(section: CodeSection, marks: bytearray) -> Iterator[str]:
    return (cell for cell, ref in section.stores if marks[ref >> 1])


def _changing(section: CodeSection, cells: Collection[str], name: str) -> bytearray:
    """By position, 1 for each live node that depends on these cells or on the input, through truths too."""
    marks = bytearray(len(section.nodes))
    for i in section.order:
        op, *rest = section.nodes[i]
        if op == "cell":
            marks[i] = rest[0] in cells
        elif op == "input":
            marks[i] = rest[0] == name
        else:
            marks[i] = any(marks[ref >> 1] for ref in rest[: OPERANDS[op]])
    return marks


def _section(
    section: CodeSection,
    moving: Collection[str],
    inputs: Collection[str],
    straight: Straight,
    outputs: int,
) -> CodeSection:
    """A section with tangents as stores and outputs of their own; a cell whose new value does not move gets the tangent
    0, since it may have had another."""
    moved = with_tangents(section, moving, straight, inputs)
    tangents, of_outputs = dict(moved.tangents), dict(moved.output_tangents)
    stores = (
        *section.stores,
        *((HEAD + cell, tangents.get(cell, 0)) for cell, _ in section.stores if cell in moving),
    )
    ends = (*section.outputs, *((outputs + number, of_outputs.get(number, 0)) for number, _ in section.outputs))
    roots = [ref for _, ref in (*stores, *ends)]
    nodes = fused_from(moved.nodes, roots, len(section.nodes))
    return CodeSection(section.name, tuple(nodes), stores, (), ends, section.parts)
