"""Recording of a program: every phase runs once over numbers that record the computations."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from met.trace import check
from met.trace.fuse import fused
from met.trace.graph import Graph, Real, Truth
from met.trace.program import (
    Branch,
    CallPhase,
    CodeSection,
    Control,
    Every,
    Phase,
    Program,
    RecordedControl,
    Recording,
    RecordPhase,
    RecordSection,
    RunPhase,
    RunSection,
    Unless0,
    WhileAny,
    cells_behind,
    slice_roots,
    walk,
)
from met.trace.scalar import Mask, Scalar


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
        """A value as a number of this recording. Raises ValueError for one of another phase."""
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
        """A block whose operations are recorded as a part of this name."""
        outer = self.parts[-1][1] if self.parts else ""
        self.parts.append((len(self.graph.nodes), f"{outer}/{name}" if outer else name))
        yield
        self.parts.append((len(self.graph.nodes), outer))


class SectionRecorder:
    """The sections of a program, each recorded when it is first used.

    sections  those that were recorded so far
    """

    def __init__(self, program: Program) -> None:
        self.program = program
        self.sections: list[CodeSection] = []
        self._section_numbers: dict[tuple[tuple[int, ...], str], int] = {}

    def steps(self, body: tuple[Control, ...], where: str) -> tuple[RecordedControl, ...]:
        """A body with its phases recorded, neighbours in one section; where: start, tick or end."""
        result: list[RecordedControl] = []
        waiting: list[Phase] = []

        def flush() -> None:
            if waiting:
                result.append(RunSection(self._section(waiting, where)))
                waiting.clear()

        for node in _flat(body):
            if isinstance(node, RunPhase):
                waiting.append(node.phase)
                continue
            flush()
            if isinstance(node, CallPhase):
                result.append(RunSection(self._section([node.phase], where)))
            elif isinstance(node, RecordPhase):
                if where != "tick":
                    raise ValueError(f"{node.phase.name} records in `{where}`; rows belong to ticks")
                result.append(RecordSection(self._section([node.phase], "record"), node.divisor))
            else:
                result.append(Branch(node, self.steps(node.body, where)))
        flush()
        return tuple(result)

    def _section(self, phases: list[Phase], where: str) -> int:
        """The number of the section of these phases."""
        key = (tuple(map(id, phases)), where)
        if key not in self._section_numbers:
            tape = RecordingTape(self.program, where)
            for phase in phases:
                with tape.part(phase.name):
                    phase.body(tape)
            self._section_numbers[key] = len(self.sections)
            names = list(dict.fromkeys(phase.name for phase in phases))
            self.sections.append(
                CodeSection(
                    "+".join(names[:3] + ["..."] * (len(names) > 3)),
                    tuple(tape.graph.nodes),
                    tuple(
                        (name, value.ref)
                        for name, value in tape.written.items()
                        if tape.graph.nodes[value.ref >> 1] != ("cell", name) or value.ref & 1
                    ),
                    tuple((column, value.ref) for column, value in sorted(tape.records.items())),
                    tuple((number, value.ref) for number, value in sorted(tape.outputs.items())),
                    tuple(tape.parts),
                    tuple(tape.graph.known),
                )
            )
        return self._section_numbers[key]


def record(program: Program, *, fuse: bool = True) -> Recording:
    """Record a program by running every phase once over recorded numbers.

    Stores that no phase and no condition ever reads are dropped, with everything that only they need; then, unless
    `fuse` is false, products are fused into sums (`met.trace.fuse`).
    """
    recorder = SectionRecorder(program)
    _refuse_nested_records(program)
    start, tick, end = (
        recorder.steps(body, where)
        for body, where in ((program.start, "start"), (program.tick, "tick"), (program.end, "end"))
    )
    sections = recorder.sections
    _check_complete(program, sections)
    condition_cells = program.loop_cells
    live_sections = without_dead_stores(sections, condition_cells)
    _check_written(program, live_sections, condition_cells)
    cells = used_cells(live_sections, condition_cells)
    if check.wanted():
        check.check(Recording(program, tuple(live_sections), start, tick, end, cells))
    if fuse:
        live_sections = _fused(live_sections, program, (*start, *tick, *end))
    recording = Recording(program, tuple(live_sections), start, tick, end, cells)
    if check.wanted():
        check.check(recording)
    return recording


def _flat(body: tuple[Control, ...]) -> Iterator[Control]:
    """The body with the contents of each `Every(1, ...)` in its place."""
    for node in body:
        if isinstance(node, Every) and node.divisor == 1:
            yield from _flat(node.body)
        else:
            yield node


def _refuse_nested_records(program: Program) -> None:
    """Raise where a `RecordPhase` depends on more than its divisor: a row has all its columns at every `divisor`th
    tick."""
    for node in walk((*program.start, *_flat(program.tick), *program.end)):
        if isinstance(node, (Every, Unless0, WhileAny)) and any(
            isinstance(inner, RecordPhase) for inner in walk(node.body)
        ):
            raise ValueError("a Record stands within another condition; its own divisor says when it records")


def _check_complete(program: Program, sections: list[CodeSection]) -> None:
    """Check that each column and each output of the program is set by a phase. Raises ValueError."""
    columns = {column for section in sections for column, _ in section.records}
    missing = sorted(set(range(program.columns)) - columns)
    if missing:
        raise ValueError(f"no phase records columns {missing}")
    missing = sorted(
        set(range(len(program.outputs))) - {number for section in sections for number, _ in section.outputs}
    )
    if missing:
        raise ValueError(f"no phase writes the outputs {[program.outputs[number] for number in missing]}")
    if program.record_divisor < 1:
        raise ValueError("a record divisor is at least 1")


def _check_written(program: Program, sections: list[CodeSection], condition_cells: set[str]) -> None:
    """Raise ValueError where a cell is read that nothing writes: a misspelt name would be 0 for ever."""
    written = {cell for section in sections for cell, _ in section.stores}.union(program.counters)
    for section in sections:
        for i in section.order:
            if section.nodes[i][0] == "cell" and section.nodes[i][1] not in written:
                raise ValueError(f"{section.name!r} reads the cell {section.nodes[i][1]!r}, which nothing writes")
    for cell in sorted(condition_cells - written):
        raise ValueError(f"a loop goes by the cell {cell!r}, which nothing writes")


def without_dead_stores(sections: list[CodeSection], condition_cells: set[str]) -> list[CodeSection]:
    """The sections without stores to cells that nothing live reads."""
    read = set(condition_cells)
    live_sections = [_storing(section, read) for section in sections]
    while True:
        now = {
            section.nodes[i][1] for section in live_sections for i in section.order if section.nodes[i][0] == "cell"
        } | condition_cells
        if now == read:
            return live_sections
        more = now - read
        read |= now
        live_sections = [
            _storing(section, read) if any(name in more for name, _ in section.stores) else old
            for section, old in zip(sections, live_sections, strict=True)
        ]


def _storing(section: CodeSection, read: set[str]) -> CodeSection:
    """The section with stores to these cells only."""
    stores = tuple(store for store in section.stores if store[0] in read)
    if stores == section.stores:
        return section
    return replace(section, stores=stores)


def _fused(sections: list[CodeSection], program: Program, body: tuple[RecordedControl, ...]) -> list[CodeSection]:
    """The sections with products fused into sums; in those of the state, as if nothing but the state were computed."""
    outputs: frozenset[int] = frozenset()
    cells: frozenset[str] = frozenset()
    if program.state_outputs is not None:
        outputs = frozenset(program.outputs.index(name) for name in program.state_outputs)
        cells = cells_behind(sections, body, outputs)
    result = []
    for section in sections:
        leading = None if program.state_outputs is None else slice_roots(section, cells, outputs)
        nodes = fused(section.nodes, section.roots, leading)
        result.append(replace(section, nodes=tuple(nodes)))
    return result


def used_cells(sections: list[CodeSection], condition_cells: set[str]) -> tuple[str, ...]:
    """Every cell in use, in order of first use over the program, so that neighbours in time are in memory."""
    names: dict[str, None] = {}
    for section in sections:
        for i in section.order:
            if section.nodes[i][0] == "cell":
                names.setdefault(section.nodes[i][1])
        for name, _ in section.stores:
            names.setdefault(name)
    for name in sorted(condition_cells):
        names.setdefault(name)
    return tuple(names)
