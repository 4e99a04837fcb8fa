"""A recorded program as data: straight sections of operations, and the control that runs them.

`met.trace.recorder.record` makes one from a program; `met.trace.fuse`, `met.trace.slicing` and the back ends use it.
"""

from __future__ import annotations

from functools import cached_property

from met.frozen import frozen
from met.trace.known import KnownDerivative
from met.trace.nodes import Node, live
from met.trace.program import Every, Program, Unless0, WhileAny


@frozen
class CodeSection:
    """Consecutive phases as one recorded piece. References are into `nodes`; nodes that are not live are ignored.

    stores    (cell, reference), in order of writing; the value a cell has afterwards
    records   (column, reference);  outputs (number of the output, reference)
    parts     (position of the node that a part begins at, its name): the phase's, then those of `Tape.part` in it
    known     derivatives that are known in closed form
    """

    name: str
    nodes: tuple[Node, ...]
    stores: tuple[tuple[str, int], ...]
    records: tuple[tuple[int, int], ...]
    outputs: tuple[tuple[int, int], ...]
    parts: tuple[tuple[int, str], ...] = ()
    known: tuple[KnownDerivative, ...] = ()

    @property
    def roots(self) -> list[int]:
        """References of all results of the section."""
        return [ref for _, ref in (*self.stores, *self.records, *self.outputs)]

    @cached_property
    def order(self) -> list[int]:
        """Positions of the live nodes, in order of creation."""
        return live(self.nodes, self.roots)


@frozen
class RunSection:
    """Control of a recorded program: runs the section of that number."""

    section: int


@frozen
class RecordSection:
    """Control of a recorded program: a section that records, at ticks that `divisor` divides."""

    section: int
    divisor: int


@frozen
class Branch:
    """Control of a recorded program: an `Every`, `Unless0` or `WhileAny` (`condition`, its body unused)."""

    condition: Every | Unless0 | WhileAny
    body: tuple[RecordedControl, ...]


RecordedControl = RunSection | RecordSection | Branch


@frozen
class Recording:
    """A recorded program: its sections, the control over them, and the cells, in the order of memory."""

    program: Program
    sections: tuple[CodeSection, ...]
    start: tuple[RecordedControl, ...]
    tick: tuple[RecordedControl, ...]
    end: tuple[RecordedControl, ...]
    cells: tuple[str, ...]
