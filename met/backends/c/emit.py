"""A recorded program as C, as text: one case, for computers that `met.backends.llvm.machine` does not reach.

C11 that asks for no library and no header but stdint.h and float.h, so that it is compiled for a bare controller too.
Each section is a function, each node of its graph a constant of that function, under its number: the same operations,
fused where `met.trace.fuse` fused. So the bits are the kernel's, whatever compiles it, at any level (the sign of a
not-a-number aside), as long as the compiler fuses nothing by itself: -std=c11 -ffp-contract=off.

    static void met_start(met_case *met)             before tick 0, once the inputs are set
    static void met_tick(met_case *met, int64_t k)   tick k; at ticks that are recorded the columns are in met->row
    static void met_end(met_case *met)               sets the outputs

All that lasts of a case is in its struct, so any number of cases can run side by side.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction

from met.backends.c.functions import HEAD, functions
from met.frozen import frozen
from met.trace.nodes import OPERANDS, TRUTHS, Node
from met.trace.primitives import bits_of
from met.trace.program import (
    Branch,
    CodeSection,
    Every,
    RecordedControl,
    Recording,
    RecordSection,
    RunSection,
    Unless0,
    WhileAny,
)

_INFIX = {"mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "and": "&&"}


@frozen
class CSource:
    """A program in C: its text, and the members of its struct that are its inputs, outputs and cells, by their names in
    the program."""

    text: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    cells: Mapping[str, str]


def emit(recording: Recording) -> CSource:
    """The C of a program."""
    return _CEmitter(recording).source()


def literal(value: float) -> str:
    """A finite double in C, exactly: in decimals where few suffice, else in hexadecimal digits."""
    value = float(value)
    short = repr(value)
    if Fraction(short) == Fraction(value):
        return short
    digits, exponent = value.hex().split("p")
    return f"{digits.rstrip('0').rstrip('.')}p{exponent}"


def _members(prefix: str, names: Iterable[str]) -> dict[str, str]:
    """Distinct names of members of the C struct, by the names of the program's numbers."""
    members: dict[str, str] = {}
    for name in names:
        base = member = prefix + "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
        n = 1
        while member in members.values():
            n += 1
            member = f"{base}_{n}"
        members[name] = member
    return members


class _CEmitter:
    """Writer of one program's C text."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.program = recording.program
        self.inputs = _members("in_", self.program.inputs)
        self.cells = _members("cell_", recording.cells)
        self.outputs = _members("out_", self.program.outputs)
        self.names = [
            f"met_{n}_{_members('', [section.name])[section.name]}" for n, section in enumerate(recording.sections)
        ]
        self.called: set[str] = set()
        self.tables: dict[tuple[float, ...], str] = {}
        self.timed = any(section.nodes[i][0] == "time" for section in recording.sections for i in section.order)

    def source(self) -> CSource:
        """The whole C text of the program, with the names of its inputs, outputs and cells."""
        sections = [self._section(n, section) for n, section in enumerate(self.recording.sections)]
        entries = [self._start(), self._tick(), self._end()]
        tables = [
            f"static const uint64_t {name}[] = {{{', '.join(_pattern(x) for x in table)}}};\n"
            for table, name in self.tables.items()
        ]
        parts = [HEAD, functions(self.called), self._memory(), *tables, *sections, *entries]
        return CSource("\n".join(part for part in parts if part), self.inputs, self.outputs, self.cells)

    def _memory(self) -> str:
        """The C struct of a case: inputs, cells, outputs and the row."""
        members = [*self.inputs.values(), *self.cells.values(), *self.outputs.values()]
        if self.program.columns:
            members.append(f"row[{self.program.columns}]")
        lines = "".join(f"    double {member};\n" for member in members)
        now = "tick, time" if self.timed else "tick"
        return f"typedef struct {{\n    double {now};\n{lines}}} met_case;\n"

    # Control

    def _start(self) -> str:
        zero = [f"    met->{member} = 0.0;" for member in self.cells.values()]
        return _function("met_start(met_case *met)", [*self._now("0.0"), *zero, *self._steps(self.recording.start, 1)])

    def _tick(self) -> str:
        return _function(
            "met_tick(met_case *met, int64_t k)", [*self._now("(double)k"), *self._steps(self.recording.tick, 1)]
        )

    def _end(self) -> str:
        return _function("met_end(met_case *met)", [*self._steps(self.recording.end, 1)])

    def _now(self, tick: str) -> list[str]:
        """Lines that give the tick's number, and its time where it is needed."""
        time = [f"    met->time = met->tick / {literal(self.program.base_hz)};"] if self.timed else []
        return [f"    met->tick = {tick};", *time]

    def _steps(self, body: Sequence[RecordedControl], depth: int) -> Iterator[str]:
        """The C lines of a phase's steps: calls of sections, rows that are recorded at their ticks, and branches,
        `depth` deep."""
        pad = "    " * depth
        for node in body:
            match node:
                case RunSection(section):
                    yield f"{pad}{self.names[section]}(met);"
                case RecordSection(section, divisor):
                    yield f"{pad}if (k % {divisor} == 0) {self.names[section]}(met);"
                case Branch(condition, inner):
                    match condition:
                        case Every(divisor):
                            head = f"if (k % {divisor} == 0)"
                        case Unless0():
                            head = "if (k != 0)"
                        case WhileAny(cell, at_most):
                            n = f"n{depth}"
                            head = f"for (int64_t {n} = 0; {n} < {at_most} && met->{self.cells[cell]} != 0.0; {n}++)"
                    yield from [f"{pad}{head} {{", *self._steps(inner, depth + 1), f"{pad}}}"]

    # One straight piece

    def _section(self, number: int, section: CodeSection) -> str:
        """The C function of a section: a constant for each node, then the stores to cells, row and outputs."""
        nodes = section.nodes
        lines: list[str] = []
        drawn: dict[tuple[int, ...], str] = {}
        for i in section.order:
            node = nodes[i]
            op = node[0]
            if op in ("const", "false"):
                continue
            if op == "philox" and node[1:7] not in drawn:
                drawn[node[1:7]] = f"r{i}"
                lines += [f"    double r{i}[4];", f"    {self._call('philox', nodes, node, f'r{i}')};"]
            value = f"{drawn[node[1:7]]}[{node[7]}]" if op == "philox" else self._value(nodes, node)
            lines.append(f"    const {'int' if op in TRUTHS else 'double'} v{i} = {value};")
        for place, ref in (
            *((self.cells[name], ref) for name, ref in section.stores),
            *((f"row[{column}]", ref) for column, ref in section.records),
            *((self.outputs[self.program.outputs[n]], ref) for n, ref in section.outputs),
        ):
            lines.append(f"    met->{place} = {self._expression(nodes, ref)};")
        return _function(f"{self.names[number]}(met_case *met)", lines)

    def _value(self, nodes: Sequence[Node], node: Node) -> str:
        """The C expression of a node that is not a constant."""
        op = node[0]
        if op == "input":
            return f"met->{self.inputs[node[1]]}"
        if op == "cell":
            return f"met->{self.cells[node[1]]}"
        if op in ("tick", "time"):
            return f"met->{op}"
        operands = [self._expression(nodes, ref) for ref in node[1 : 1 + OPERANDS[op]]]
        if op in _INFIX:
            return f" {_INFIX[op]} ".join(operands)
        if op in ("add", "sub"):
            self.called.add("add")
            return f"met_add({operands[0]}, {self._expression(nodes, node[2] ^ (op == 'sub'))})"
        if op == "where":
            return "{} ? {} : {}".format(*operands)
        if op == "gather":
            table = self.tables.setdefault(node[2], f"met_table_{len(self.tables)}")
            self.called.add(op)
            return f"met_gather({table}, {literal(len(node[2]) - 1.0)}, {operands[0]})"
        return self._call(op, nodes, node)

    def _call(self, op: str, nodes: Sequence[Node], node: Node, *more: str) -> str:
        """A call of the function for a node, with its operands and further arguments."""
        self.called.add(op)
        count = OPERANDS[op]
        words = [self._expression(nodes, ref) for ref in node[1 : 1 + count]]
        if op in ("bit", "flip"):
            words.append(str(node[1 + count]))
        return f"met_{op}({', '.join([*words, *more])})"

    def _expression(self, nodes: Sequence[Node], ref: int) -> str:
        """The C expression of a reference, including its sign."""
        node = nodes[ref >> 1]
        if node[0] == "const":
            value = -node[1] if ref & 1 else node[1]
            if math.isfinite(value):
                return literal(value)
            self.called.add("of")
            return f"met_of({_pattern(value)})"
        if node[0] == "false":
            return str(ref & 1)
        return ("!" if node[0] in TRUTHS else "-") * (ref & 1) + f"v{ref >> 1}"


def _pattern(value: float) -> str:
    """The bits of a double."""
    return f"UINT64_C(0x{bits_of(value):016X})"


def _function(head: str, lines: Sequence[str]) -> str:
    return "\n".join([f"static void {head}", "{", *(lines or ["    (void)met;"]), "}", ""])
