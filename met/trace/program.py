"""A program: straight-line phases under a little uniform control flow, over each case's memory.

Control is the same for every case of a block, so it is decided once: by the tick's number, or (`WhileAny`) by whether
any case still asks for more. Memory is cells by name, one number a case, 0 before the first write.

    start      before tick 0 only
    tick       at every tick k = first .. last, both ends
    end        after the last tick; it writes the outputs

`met.trace.recorder.record` records one as sections of nodes. `cells_behind` is the part of them that outputs depend on.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import AbstractContextManager
from functools import cached_property
from typing import Protocol

from met.frozen import frozen
from met.trace.derivative import KnownDerivative
from met.trace.graph import Real, Truth
from met.trace.nodes import Node, live


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


class Tape(Protocol):
    """Memory as the body of a phase reads and writes it; the recorder and the reference each have one."""

    @property
    def tick(self) -> Real:
        """The number k of the base tick."""

    @property
    def time(self) -> Real:
        """k / base_hz, s, by one division."""

    def read(self, name: str) -> Real:
        """Read a cell: the value that this phase wrote, else the former one, 0 at first. A cell that nothing writes is
        an error."""

    def write(self, name: str, value: Real) -> None:
        """Set a cell."""

    def read_mask(self, name: str) -> Truth:
        """True where a cell is not zero."""

    def write_mask(self, name: str, value: Truth) -> None:
        """Set a cell to 1 or 0."""

    def input(self, name: str) -> Real:
        """One of the program's inputs."""

    def record(self, column: int, value: Real) -> None:
        """One column of the row that is being recorded; only in a `RecordPhase`."""

    def output(self, name: str, value: Real) -> None:
        """One of the program's outputs; only in `end`."""

    def part(self, name: str) -> AbstractContextManager[None]:
        """A context whose computations belong to the part of this name, for profiles."""


@frozen
class Phase:
    """A straight piece of computation: `body` reads, computes and writes, without looking at values."""

    name: str
    body: Callable[[Tape], None]


@frozen
class RunPhase:
    """Runs a phase here. Neighbouring `RunPhase`s become one straight piece."""

    phase: Phase


@frozen
class CallPhase:
    """Runs a phase here, as a separate piece whose code exists once however often it is called."""

    phase: Phase


@frozen
class Every:
    """Runs the body at ticks whose number `divisor` divides."""

    divisor: int
    body: tuple[Control, ...]


@frozen
class Unless0:
    """Runs the body at all ticks but tick 0."""

    body: tuple[Control, ...]


@frozen
class WhileAny:
    """Runs the body as long as any case of the block has a cell that is not zero, at most `at_most` times.

    A body runs for the whole block, so it must leave alone (`where`) each case whose cell is zero: then no case
    sees its neighbours.
    """

    cell: str
    at_most: int
    body: tuple[Control, ...]


@frozen
class RecordPhase:
    """Runs a phase that records row k

    divisor, at ticks that `divisor` divides; nothing where no record is kept.
    """

    phase: Phase
    divisor: int


Control = RunPhase | CallPhase | Every | Unless0 | WhileAny | RecordPhase


@frozen
class Program:
    """The program of a kernel: control at the start, at each tick and at the end, inputs, columns of a row, outputs.

    state_outputs  the outputs that tell how the run itself went. What they depend on is the program's state, and its
                   bits are the same whatever else is recorded or put out; None: all outputs and rows are one
    counters       cells that may be read although nothing writes them: they are 0
    """

    base_hz: float
    start: tuple[Control, ...]
    tick: tuple[Control, ...]
    end: tuple[Control, ...]
    inputs: tuple[str, ...] = ()
    columns: int = 0
    outputs: tuple[str, ...] = ()
    state_outputs: tuple[str, ...] | None = None
    counters: tuple[str, ...] = ()

    @cached_property
    def record_divisor(self) -> int:
        """Ticks a row; 1 where nothing is recorded. All `RecordPhase`s of a program have one divisor."""
        divisors = {
            node.divisor for node in walk((*self.start, *self.tick, *self.end)) if isinstance(node, RecordPhase)
        }
        if len(divisors) > 1:
            raise ValueError(f"a program records at one rate, not at every {sorted(divisors)} ticks")
        return divisors.pop() if divisors else 1

    @property
    def loop_cells(self) -> set[str]:
        """The cells that control loops (`WhileAny`)."""
        return {node.cell for node in walk((*self.start, *self.tick, *self.end)) if isinstance(node, WhileAny)}


def walk(body: tuple[Control, ...]) -> Iterator[Control]:
    """All control nodes, outer ones first."""
    for node in body:
        yield node
        if isinstance(node, (Every, Unless0, WhileAny)):
            yield from walk(node.body)


# Parts of a recorded program


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
    cells that control loops: the part of a recorded program on which they depend (a backward slice, Weiser 1981).

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
