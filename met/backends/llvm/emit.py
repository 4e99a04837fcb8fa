"""A recorded program as LLVM IR, as text.

One lane is one case: every value is a vector of `lanes` doubles, every section straight-line code over it. Nothing that
could change results is left to the compiler: no fast-math flag, no contraction; a fused multiply-add is an `llvm.fma`
that `met.trace.fuse` asked for. So the bits are the same for any width, instruction set and level.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from met.backends.llvm.entry import ENTRY, entry, number, spread
from met.backends.llvm.philox import PhiloxWriter
from met.backends.llvm.pieces import CUT_ABOVE, LONGEST, SHORTEST, Piece, cut
from met.backends.llvm.pieces import check as check_pieces
from met.trace import check
from met.trace.nodes import OPERANDS, TRUTHS, Node
from met.trace.program import CodeSection, Recording

_CALLS = {"sqrt": "llvm.sqrt", "floor": "llvm.floor", "rint": "llvm.roundeven", "abs": "llvm.fabs", "fma": "llvm.fma"}
_ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
# of functions: large ones, and small or seldom called ones; of the entry
_WIDE = 'nounwind "prefer-vector-width"="512"'
ATTRIBUTES = (f"alwaysinline {_WIDE}", f"noinline {_WIDE}", "noinline", _WIDE)
_COMPARE = {"lt": "olt", "le": "ole", "eq": "oeq"}


def emit(
    recording: Recording,
    lanes: int,
    *,
    vector: int | None = None,
    width: int = 8,
    inline: bool = True,
    above: int = CUT_ABOVE,
    shortest: int = SHORTEST,
    longest: int = LONGEST,
) -> str:
    """The IR of a program. The parameters affect speed alone.

    lanes   cases a block
    vector  cases that one value of the code holds; a block of several takes each piece of code for one after the
            other, so that they hide each other's latency without sharing registers. By default all of a block
    width   doubles in one register of the machine it is for
    inline  whether short code may be put in its caller's place; never where its time alone is asked for
    above, shortest, longest   operations of a section that is cut, and of its pieces (met/backends/llvm/pieces.py)
    """
    return _LlvmEmitter(recording, lanes, vector or lanes, width, inline, (above, shortest, longest)).text()


_NAME = re.compile(r"[%@][\w.$#-]+|^[\w.$-]+(?=:)", re.MULTILINE)
_REMARK = re.compile(r"  ;.*")
_KEPT = ("@llvm.", "@malloc", "@free", f"@{ENTRY}", "@section.", "@table.")


class _Numbers(dict[str, str]):
    """Names in a function, numbered in order of appearance.

    symbols  what stands for the module's own names: one table for all functions. Names of LLVM and of C stay, and
             those that are numbers as they are written
    """

    def __init__(self, symbols: dict[str, str]) -> None:
        self.symbols = symbols
        self.locals: dict[str, str] = {}

    def __missing__(self, name: str) -> str:
        """The short name of a symbol, local or label that is met for the first time."""
        if name.startswith(_KEPT):
            number = name
        elif name[0] == "@":
            number = self.symbols.setdefault(name, f"@{len(self.symbols)}")
        else:  # a label is written with and without its sign
            bare = name.removeprefix("%")
            number = name[: len(name) - len(bare)] + self.locals.setdefault(bare, str(len(self.locals)))
        self[name] = number
        return number


def numbered(text: str) -> str:
    """The text of a module without comments, its names replaced by numbers: the part that determines the generated
    code.

    The code of sections has numbers for names as it is written, and is nearly all of the text.
    """
    symbols: dict[str, str] = {}

    def of(part: str) -> str:
        """A function's IR with its names replaced by numbers; a section has numbers already."""
        if part.startswith("private void @section."):
            return _REMARK.sub("", part)
        names = _Numbers(symbols)
        return _NAME.sub(lambda match: names[match[0]], part)

    return "\ndefine ".join(map(of, text.split("\ndefine ")))


def _remark(name: str) -> str:
    """A comment at the end of a line of IR, for readers: the name of its subject."""
    return f"  ; {name}" if name.isprintable() and name else ""


class _LlvmEmitter:
    """Writer of one module."""

    def __init__(
        self, recording: Recording, lanes: int, vector: int, width: int, inline: bool, sizes: tuple[int, int, int]
    ) -> None:
        """lanes: cases a block; vector: cases that one value of the code holds; width: doubles of a register; inline,
        sizes: as of `emit` and `cut`"""
        self.recording = recording
        self.lanes = lanes
        self.count = vector
        self.width = min(width, lanes)
        self.inline = inline
        self.sizes = sizes
        self.vector = f"<{vector} x double>"
        self.align = min(64, 8 * vector)
        self.state = {name: slot for slot, name in enumerate(recording.cells)}
        self.inputs = {name: slot for slot, name in enumerate(recording.program.inputs)}
        self.tables: dict[tuple[float, ...], str] = {}
        self.declared: dict[str, str] = {}
        self.functions: list[str] = []
        self.calls: list[list[str]] = []
        self.scratch = 0

    def text(self) -> str:
        """The IR text of the module: tables, a function for each piece of a section, and the entry that calls them."""
        for n, section in enumerate(self.recording.sections):
            pieces = cut(section, *self.sizes)
            if check.wanted():
                check_pieces(section, pieces)
            self.scratch = max(self.scratch, max(piece.slots for piece in pieces))
            self.calls.append([])
            for i, piece in enumerate(pieces):
                symbol = f"@section.{n}" if len(pieces) == 1 else f"@section.{n}.{i}"
                self.calls[-1].append(symbol)
                self.functions.append(self._function(symbol, section, piece))
        tables = [
            f"{symbol} = private unnamed_addr constant [{len(table)} x double] "
            f"[{', '.join('double ' + number(x) for x in table)}], align 64"
            for table, symbol in self.tables.items()
        ]
        rows = [spread(self.lanes, self.width)] if self.recording.program.columns else []
        main = entry(self.recording, self.calls, self.lanes, self.count, self.scratch)
        return "\n".join(
            [
                *tables,
                *self.functions,
                *rows,
                main,
                *self.declared.values(),
                *(f"attributes #{n} = {{ {words} }}" for n, words in enumerate(ATTRIBUTES)),
                "",
            ]
        )

    def _intrinsic(self, name: str, result: str, *arguments: str) -> str:
        self.declared.setdefault(name, f"declare {result} @{name}({', '.join(arguments)})")
        return f"@{name}"

    # One straight piece

    def _function(self, symbol: str, section: CodeSection, piece: Piece) -> str:
        """The IR text of the function of one piece of a section. Values that other pieces need pass through the scratch
        memory."""
        nodes = section.nodes
        lines: list[str] = []
        put = lines.append
        V, L = self.vector, self.count
        bits = f"<{L} x i64>"
        truth = f"<{L} x i1>"
        suffix = f"v{L}f64"
        have: dict[int, str] = {}
        turned: dict[int, str] = {}
        drawn: dict[tuple[int, ...], PhiloxWriter] = {}

        def op(text: str, remark: str = "") -> str:
            """Write an instruction; returns the name of its result, which is the number of its line."""
            name = f"%v{len(lines)}"
            put(f"  {name} = {text}{remark}")
            return name

        def slot(base: str, i: int) -> str:
            return op(f"getelementptr i8, ptr %{base}, i64 {8 * self.lanes * i}")

        def load(base: str, i: int, name: str = "") -> str:
            return op(f"load {V}, ptr {slot(base, i)}, align {self.align}", _remark(name))

        def plain(i: int) -> str:
            """The value at position i, loaded or spread over the lanes if it is not there yet."""
            value = have.get(i)
            if value is not None:
                return value
            node = nodes[i]
            kind = node[0]
            if kind == "const":
                value = f"splat (double {number(node[1])})"
            elif kind == "false":
                value = "zeroinitializer"
            elif kind == "input":
                value = load("inputs", self.inputs[node[1]], node[1])
            elif kind == "cell":
                value = load("state", self.state[node[1]], node[1])
            elif kind in ("tick", "time"):
                first = op(f"insertelement {V} poison, double %{kind}, i64 0")
                value = op(f"shufflevector {V} {first}, {V} poison, <{L} x i32> zeroinitializer")
            elif kind in TRUTHS:
                value = op(f"fcmp une {V} {load('scratch', piece.saved[i])}, zeroinitializer")
            else:
                value = load("scratch", piece.saved[i])
            have[i] = value
            return value

        def of(ref: int) -> str:
            """The value of a reference, including its sign."""
            i = ref >> 1
            if not ref & 1:
                return plain(i)
            value = turned.get(i)
            if value is None:
                kind = nodes[i][0]
                if kind == "const":
                    value = f"splat (double {number(-nodes[i][1])})"
                elif kind == "false":
                    value = "splat (i1 true)"
                elif kind in TRUTHS:
                    value = op(f"xor {truth} {plain(i)}, splat (i1 true)")
                else:
                    value = op(f"fneg {V} {plain(i)}")
                turned[i] = value
            return value

        def pattern(value: str) -> str:
            return op(f"bitcast {V} {value} to {bits}")

        def computed(node: Node) -> str:
            """Write the instructions of an operation; returns the name of its result."""
            kind = node[0]
            operands = [of(ref) for ref in node[1 : 1 + OPERANDS[kind]]]
            if kind in _ARITHMETIC:
                return op(f"{_ARITHMETIC[kind]} {V} {operands[0]}, {operands[1]}")
            if kind in _CALLS:
                call = self._intrinsic(f"{_CALLS[kind]}.{suffix}", V, *[V] * len(operands))
                return op(f"call {V} {call}({', '.join(f'{V} {x}' for x in operands)})")
            if kind in _COMPARE:
                return op(f"fcmp {_COMPARE[kind]} {V} {operands[0]}, {operands[1]}")
            if kind == "and":
                return op(f"and {truth} {operands[0]}, {operands[1]}")
            if kind == "where":
                return op(f"select {truth} {operands[0]}, {V} {operands[1]}, {V} {operands[2]}")
            if kind == "bit":
                mask = 1 << node[2] if node[2] < 63 else -1 << 63
                masked = op(f"and {bits} {pattern(operands[0])}, splat (i64 {mask})")
                return op(f"icmp ne {bits} {masked}, zeroinitializer")
            if kind == "flip":
                value, sign = pattern(operands[0]), pattern(operands[1])
                shifted = op(f"shl {bits} {sign}, splat (i64 {63 - node[3]})")
                masked = op(f"and {bits} {shifted}, splat (i64 {-1 << 63})")
                flipped = op(f"xor {bits} {value}, {masked}")
                return op(f"bitcast {bits} {flipped} to {V}")
            if kind == "pow2":
                total = op(f"fadd {V} {operands[0]}, splat (double {number(4503599627371519.0)})")
                shifted = op(f"shl {bits} {pattern(total)}, splat (i64 52)")
                return op(f"bitcast {bits} {shifted} to {V}")
            if kind == "exponent":
                shifted = op(f"lshr {bits} {pattern(operands[0])}, splat (i64 52)")
                masked = op(f"and {bits} {shifted}, splat (i64 2047)")
                joined = op(f"or {bits} {masked}, splat (i64 {0x433 << 52})")
                number_of = op(f"bitcast {bits} {joined} to {V}")
                return op(f"fsub {V} {number_of}, splat (double {number(4503599627371519.0)})")
            if kind == "significand":
                masked = op(f"and {bits} {pattern(operands[0])}, splat (i64 {(1 << 52) - 1})")
                joined = op(f"or {bits} {masked}, splat (i64 {0x3FF << 52})")
                return op(f"bitcast {bits} {joined} to {V}")
            if kind == "philox":
                refs, word = node[1:7], node[7]
                if refs not in drawn:
                    drawn[refs] = PhiloxWriter(op, operands, L)
                return drawn[refs].word(word)
            assert kind == "gather", kind
            return gathered(operands[0], node[2])

        def gathered(index: str, table: tuple[float, ...]) -> str:
            """Write the look-up of a table of constants at a floating index, held within the table; not-a-number where
            the index is."""
            symbol = self.tables.setdefault(table, f"@table.{len(self.tables)}")
            top = number(len(table) - 1.0)
            above = op(f"fcmp ogt {V} {index}, zeroinitializer")
            low = op(f"select {truth} {above}, {V} {index}, {V} zeroinitializer")
            below = op(f"fcmp olt {V} {low}, splat (double {top})")
            held = op(f"select {truth} {below}, {V} {low}, {V} splat (double {top})")
            whole = op(f"fptosi {V} {held} to <{L} x i32>")
            place = op(f"getelementptr double, ptr {symbol}, <{L} x i32> {whole}")
            call = self._intrinsic(f"llvm.masked.gather.{suffix}.v{L}p0", V, f"<{L} x ptr>", "i32", truth, V)
            inside = op(f"call {V} {call}(<{L} x ptr> {place}, i32 8, {truth} splat (i1 true), {V} poison)")
            nan = op(f"fcmp uno {V} {index}, {index}")
            return op(f"select {truth} {nan}, {V} splat (double {number(float('nan'))}), {V} {inside}")

        def keep(i: int) -> None:
            """Write the store of a value that later pieces need, into its slot of the scratch memory; truths as 0 and
            1."""
            value = have[i]
            if nodes[i][0] in TRUTHS:
                value = op(f"select {truth} {value}, {V} splat (double {number(1.0)}), {V} zeroinitializer")
            place = slot("scratch", piece.keep[i])
            put(f"  store {V} {value}, ptr {place}, align {self.align}")

        def leave(stores: Iterable[tuple[str, Any, int]]) -> None:
            """Write the stores to cells, row and outputs, after all of their values are there."""
            ready = [(kind, where, of(ref)) for kind, where, ref in stores]
            for kind, where, value in ready:
                base, i = {
                    "cell": ("state", self.state.get(where)),
                    "record": ("row", where),
                    "output": ("outputs", where),
                }[kind]
                assert i is not None
                name = _remark(where if kind == "cell" else "")
                place = slot(base, i)
                put(f"  store {V} {value}, ptr {place}, align {self.align}{name}")

        for position, i in piece.body:
            have[i] = computed(nodes[i])
            if i in piece.keep:
                keep(i)
            leave(piece.stores.get(position, ()))
        leave(piece.tail)
        attributes = "#0" if piece.small and self.inline else "#1"
        return "\n".join(
            [
                f"define private void {symbol}(ptr noalias %state, ptr noalias readonly %inputs, ptr noalias %scratch, "
                f"ptr noalias %row, ptr noalias %outputs, double %tick, double %time) {attributes} {{"
                f"{_remark(section.name)}",
                *lines,
                "  ret void",
                "}",
            ]
        )
