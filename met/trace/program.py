"""A program: straight-line phases under a little uniform control flow, over each case's memory.

Control is the same for every case of a block, so it is decided once: by the tick's number, or (`WhileAny`) by whether
any case still asks for more. Memory is cells by name, one number a case, 0 before the first write.

    start      before tick 0 only
    tick       at every tick k = first .. last, both ends
    end        after the last tick; it writes the outputs
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cached_property
from typing import Protocol

from met.frozen import frozen
from met.trace.fuse import fused
from met.trace.graph import Graph, Node, Real, Truth, live
from met.trace.scalar import Mask, Scalar


class Tape(Protocol):
    """What a phase's body reads from and writes to; the recorder and the reference each have one."""

    @property
    def tick(self) -> Real:
        """The number k of the base tick."""

    @property
    def time(self) -> Real:
        """k / base_hz, s, by one division."""

    def read(self, name: str) -> Real:
        """A cell: what this phase wrote, else what it held before; 0 where nothing ever wrote it."""

    def write(self, name: str, value: Real) -> None:
        """Sets a cell."""

    def read_mask(self, name: str) -> Truth:
        """Whether a cell is not zero."""

    def write_mask(self, name: str, value: Truth) -> None:
        """Sets a cell to 1 or 0."""

    def input(self, name: str) -> Real:
        """One of the program's inputs."""

    def record(self, column: int, value: Real) -> None:
        """One column of the row that is being recorded; only in a `Record`."""

    def output(self, name: str, value: Real) -> None:
        """One of the program's outputs; only in `end`."""

    def part(self, name: str) -> AbstractContextManager[None]:
        """What is computed in here belongs to the part of this name, for whoever asks what costs how much."""


@frozen
class Phase:
    """A straight piece of computation: `body` reads, computes and writes, without looking at values."""

    name: str
    body: Callable[[Tape], None]


@frozen
class Run:
    """A phase, at this point. Neighbouring `Run`s become one straight piece."""

    phase: Phase


@frozen
class Call:
    """A phase, at this point, whose code is there once however often it is called: it stays a piece of its own."""

    phase: Phase


@frozen
class Every:
    """The body at ticks whose number `divisor` divides."""

    divisor: int
    body: tuple[Control, ...]


@frozen
class Unless0:
    """The body at all ticks but tick 0."""

    body: tuple[Control, ...]


@frozen
class WhileAny:
    """The body as long as any case of the block has a cell that is not zero, at most `at_most` times.

    A body runs for the whole block, so it must leave alone (`where`) each case whose cell is zero: then no case
    sees its neighbours.
    """

    cell: str
    at_most: int
    body: tuple[Control, ...]


@frozen
class Record:
    """A phase that records row k // divisor, at ticks that `divisor` divides; nothing where no record is kept."""

    phase: Phase
    divisor: int


Control = Run | Call | Every | Unless0 | WhileAny | Record


@frozen
class Program:
    """What a kernel runs: control at the start, at each tick and at the end, inputs, columns of a row, outputs."""

    base_hz: float
    start: tuple[Control, ...]
    tick: tuple[Control, ...]
    end: tuple[Control, ...]
    inputs: tuple[str, ...] = ()
    columns: int = 0
    outputs: tuple[str, ...] = ()

    @property
    def record_divisor(self) -> int:
        """Ticks a row; 1 where nothing is recorded. All `Record`s of a program have one divisor."""
        divisors = {node.divisor for node in walk((*self.start, *self.tick, *self.end)) if isinstance(node, Record)}
        if len(divisors) > 1:
            raise ValueError(f"a program records at one rate, not at every {sorted(divisors)} ticks")
        return divisors.pop() if divisors else 1


def walk(body: tuple[Control, ...]) -> Iterator[Control]:
    """All control nodes, outer ones first."""
    for node in body:
        yield node
        if isinstance(node, (Every, Unless0, WhileAny)):
            yield from walk(node.body)


@frozen
class Section:
    """Consecutive phases as one recorded piece. References are into `nodes`; what is not live is to be ignored.

    stores    (cell, reference), in order of writing; the value a cell has afterwards
    records   (column, reference);  outputs (number of the output, reference)
    parts     (position of the node that a part begins at, its name): the phase's, then those of `Tape.part` in it
    """

    name: str
    nodes: tuple[Node, ...]
    stores: tuple[tuple[str, int], ...]
    records: tuple[tuple[int, int], ...]
    outputs: tuple[tuple[int, int], ...]
    parts: tuple[tuple[int, str], ...] = ()

    @property
    def roots(self) -> list[int]:
        """References of all that the section leaves behind."""
        return [ref for _, ref in (*self.stores, *self.records, *self.outputs)]

    @cached_property
    def order(self) -> list[int]:
        """Positions of the live nodes, in order of creation."""
        return live(self.nodes, self.roots)


@frozen
class Straight:
    """Control of a recorded program: the section of that number, here."""

    section: int


@frozen
class Recorded:
    """Control of a recorded program: a section that records, at ticks that `divisor` divides."""

    section: int
    divisor: int


@frozen
class Block:
    """Control of a recorded program: an `Every`, `Unless0` or `WhileAny` (`condition`, its body unused)."""

    condition: Every | Unless0 | WhileAny
    body: tuple[Step, ...]


Step = Straight | Recorded | Block


@frozen
class Recording:
    """A recorded program: its sections, the control over them, and the cells, in the order of memory."""

    program: Program
    sections: tuple[Section, ...]
    start: tuple[Step, ...]
    tick: tuple[Step, ...]
    end: tuple[Step, ...]
    cells: tuple[str, ...]


class RecordingTape:
    """A `Tape` that records into a graph."""

    def __init__(self, program: Program, where: str) -> None:
        self.graph = Graph()
        self.program = program
        self.where = where
        self.written: dict[str, Scalar] = {}
        self.records: dict[int, Scalar] = {}
        self.outputs: dict[int, Scalar] = {}
        self.parts: list[tuple[int, str]] = []

    def _scalar(self, value: Real) -> Scalar:
        if isinstance(value, Scalar):
            if value.graph is not self.graph:
                raise ValueError("a value of another phase: pass it on through a cell")
            return value
        return Scalar(self.graph, self.graph.constant(value))

    @property
    def tick(self) -> Real:
        return Scalar(self.graph, self.graph.make("tick"))

    @property
    def time(self) -> Real:
        return Scalar(self.graph, self.graph.make("time"))

    def read(self, name: str) -> Real:
        value = self.written.get(name)
        return Scalar(self.graph, self.graph.make("cell", name)) if value is None else value

    def write(self, name: str, value: Real) -> None:
        self.written[name] = self._scalar(value)

    def read_mask(self, name: str) -> Truth:
        return self.read(name) != 0.0

    def write_mask(self, name: str, value: Truth) -> None:
        graph = self.graph
        ref = value.ref if isinstance(value, Mask) else graph.truth(bool(value))
        self.written[name] = Scalar(graph, graph.where(ref, graph.constant(1.0), graph.constant(0.0)))

    def input(self, name: str) -> Real:
        if name not in self.program.inputs:
            raise ValueError(f"the program has no input {name!r}")
        return self.graph.input(name)

    def record(self, column: int, value: Real) -> None:
        if self.where != "record" or not 0 <= column < self.program.columns:
            raise ValueError(f"column {column} of {self.program.columns} recorded in a {self.where} phase")
        self.records[column] = self._scalar(value)

    def output(self, name: str, value: Real) -> None:
        if self.where != "end":
            raise ValueError(f"output {name!r} written before the end")
        self.outputs[self.program.outputs.index(name)] = self._scalar(value)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        outer = self.parts[-1][1] if self.parts else ""
        self.parts.append((len(self.graph.nodes), f"{outer}/{name}" if outer else name))
        yield
        self.parts.append((len(self.graph.nodes), outer))


def record(program: Program, *, fuse: bool = True) -> Recording:
    """Runs every phase once over recorded numbers.

    Stores that no phase and no condition ever reads are dropped with all that only they need; then, unless `fuse` is
    false, products are fused into sums (`met.trace.fuse`).
    """
    sections: list[Section] = []
    made: dict[tuple[tuple[int, ...], str], int] = {}

    def section(phases: list[Phase], where: str) -> int:
        key = (tuple(map(id, phases)), where)
        if key not in made:
            tape = RecordingTape(program, where)
            for phase in phases:
                with tape.part(phase.name):
                    phase.body(tape)
            made[key] = len(sections)
            names = list(dict.fromkeys(phase.name for phase in phases))
            sections.append(Section(
                "+".join(names[:3] + ["..."] * (len(names) > 3)), tuple(tape.graph.nodes),
                tuple((name, value.ref) for name, value in tape.written.items()
                      if tape.graph.nodes[value.ref >> 1] != ("cell", name) or value.ref & 1),
                tuple((column, value.ref) for column, value in sorted(tape.records.items())),
                tuple((number, value.ref) for number, value in sorted(tape.outputs.items())), tuple(tape.parts)))
        return made[key]

    def steps(body: tuple[Control, ...], where: str) -> tuple[Step, ...]:
        result: list[Step] = []
        waiting: list[Phase] = []

        def flush() -> None:
            if waiting:
                result.append(Straight(section(waiting, where)))
                waiting.clear()

        for node in _flat(body):
            if isinstance(node, Run):
                waiting.append(node.phase)
                continue
            flush()
            if isinstance(node, Call):
                result.append(Straight(section([node.phase], where)))
            elif isinstance(node, Record):
                if where != "tick":
                    raise ValueError(f"{node.phase.name} records in `{where}`; rows belong to ticks")
                result.append(Recorded(section([node.phase], "record"), node.divisor))
            else:
                result.append(Block(node, steps(node.body, where)))
        flush()
        return tuple(result)

    _refuse_nested_records(program)
    start, tick, end = (steps(body, where) for body, where in
                        ((program.start, "start"), (program.tick, "tick"), (program.end, "end")))
    _check_complete(program, sections)
    asked = {node.cell for node in walk((*program.start, *program.tick, *program.end)) if isinstance(node, WhileAny)}
    kept = _without_dead_stores(sections, asked)
    if fuse:
        kept = [_fused(one) for one in kept]
    return Recording(program, tuple(kept), start, tick, end, _cells(kept, asked))


def _flat(body: tuple[Control, ...]) -> Iterator[Control]:
    """The body, with what stands in an `Every(1, ...)` in its place."""
    for node in body:
        if isinstance(node, Every) and node.divisor == 1:
            yield from _flat(node.body)
        else:
            yield node


def _refuse_nested_records(program: Program) -> None:
    """A row has all its columns at every `divisor`th tick, so a `Record` depends on nothing else."""
    for node in walk((*program.start, *_flat(program.tick), *program.end)):
        if isinstance(node, (Every, Unless0, WhileAny)) and any(isinstance(inner, Record) for inner in walk(node.body)):
            raise ValueError("a Record stands within another condition; its own divisor says when it records")


def _check_complete(program: Program, sections: list[Section]) -> None:
    columns = {column for one in sections for column, _ in one.records}
    missing = sorted(set(range(program.columns)) - columns)
    if missing:
        raise ValueError(f"no phase records columns {missing}")
    missing = sorted(set(range(len(program.outputs))) - {number for one in sections for number, _ in one.outputs})
    if missing:
        raise ValueError(f"no phase writes the outputs {[program.outputs[number] for number in missing]}")
    if program.record_divisor < 1:
        raise ValueError("a record divisor is at least 1")


def _without_dead_stores(sections: list[Section], asked: set[str]) -> list[Section]:
    """The sections without stores to cells that nothing live reads."""
    read = set(asked)
    kept = [_storing(one, read) for one in sections]
    while True:
        now = {one.nodes[i][1] for one in kept for i in one.order if one.nodes[i][0] == "cell"} | asked
        if now == read:
            return kept
        more = now - read
        read |= now
        kept = [_storing(one, read) if any(name in more for name, _ in one.stores) else old
                for one, old in zip(sections, kept, strict=True)]


def _storing(section: Section, read: set[str]) -> Section:
    """The section with its stores to these cells alone."""
    stores = tuple(store for store in section.stores if store[0] in read)
    return Section(section.name, section.nodes, stores, section.records, section.outputs, section.parts)


def _fused(section: Section) -> Section:
    nodes = fused(section.nodes, section.roots)
    return Section(section.name, tuple(nodes), section.stores, section.records, section.outputs, section.parts)


def _cells(sections: list[Section], asked: set[str]) -> tuple[str, ...]:
    """Every cell in use, in order of first use over the program, so that neighbours in time are in memory."""
    names: dict[str, None] = {}
    for one in sections:
        for i in one.order:
            if one.nodes[i][0] == "cell":
                names.setdefault(one.nodes[i][1])
        for name, _ in one.stores:
            names.setdefault(name)
    for name in sorted(asked):
        names.setdefault(name)
    return tuple(names)
