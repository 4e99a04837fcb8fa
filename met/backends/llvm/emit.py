"""A recorded program as LLVM IR, as text.

One lane is one case: every value is a vector of `lanes` doubles, every section straight-line code over it. Where
results could depend on the compiler nothing is left to it: no fast-math flag, no contraction; a fused multiply-add is
an `llvm.fma` that `met.trace.fuse` asked for. So the bits are the same for any width, instruction set and level.
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
from met.trace.nodes import OPERANDS, TRUTHS
from met.trace.recording import CodeSection, Recording

_CALLS = {"sqrt": "llvm.sqrt", "floor": "llvm.floor", "rint": "llvm.roundeven", "abs": "llvm.fabs", "fma": "llvm.fma"}
_ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
# of functions: small, large and seldom called ones; of the entry
_WIDE = 'nounwind "prefer-vector-width"="512"'
_ATTRIBUTES = (f"alwaysinline {_WIDE}", f"noinline {_WIDE}", "noinline", _WIDE)
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
    """The IR of a program. All of this is a matter of speed alone.

    lanes   cases a block
    vector  cases that one value of the code holds; a block of several takes each piece of code for one after the
            other, so that they hide each other's latency without sharing registers. By default all of a block
    width   doubles in one register of the machine it is for
    inline  whether short code may be put in its caller's place; never where its time alone is asked for
    above, shortest, longest   operations of a section that is cut, and of its pieces (met/backends/llvm/pieces.py)
    """
    return _LlvmEmitter(recording, lanes, vector or lanes, width, inline, (above, shortest, longest)).text()


_NAME = re.compile(r'[%@](?:"[^"]*"|[\w.$#-]+)|^[\w.$-]+(?=:)|  ;.*', re.MULTILINE)
_KEPT = ("@llvm.", "@malloc", "@free", f"@{ENTRY}")


class _Numbers(dict[str, str]):
    """Names in a function, numbered in order of appearance.

    symbols  what stands for the module's own names: one table for all functions. Names of LLVM and of C stay
    """

    def __init__(self, symbols: dict[str, str]) -> None:
        self.symbols = symbols
        self.locals: dict[str, str] = {}

    def __missing__(self, name: str) -> str:
        if name.startswith("  ;"):
            number = ""
        elif name.startswith(_KEPT):
            number = name
        elif name[0] == "@":
            number = self.symbols.setdefault(name, f"@{len(self.symbols)}")
        else:  # a label is written with and without its sign
            bare = name.removeprefix("%")
            number = name[: len(name) - len(bare)] + self.locals.setdefault(bare, str(len(self.locals)))
        self[name] = number
        return number


def numbered(text: str) -> str:
    """The text of a module without remarks, its names replaced by numbers: what decides the code that it becomes."""
    symbols: dict[str, str] = {}

    def of(part: str) -> str:
        names = _Numbers(symbols)
        return _NAME.sub(lambda match: names[match[0]], part)

    return "\ndefine ".join(map(of, text.split("\ndefine ")))


def _remark(name: str) -> str:
    """A comment of a line of IR: the name of what it is about, for readers."""
    return f"  ; {name}" if name.isprintable() and name else ""


class _LlvmEmitter:
    """Writes one module."""

    def __init__(
        self, recording: Recording, lanes: int, vector: int, width: int, inline: bool, sizes: tuple[int, int, int]
    ) -> None:
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
        names: set[str] = set()
        for section in self.recording.sections:
            name = base = "".join(c if c.isascii() and (c.isalnum() or c in "._+") else "_" for c in section.name)
            n = 1
            while name in names:
                n += 1
                name = f"{base}.{n}"
            names.add(name)
            pieces = cut(section, *self.sizes)
            if check.wanted():
                check_pieces(section, pieces)
            self.scratch = max(self.scratch, max(piece.slots for piece in pieces))
            self.calls.append([])
            for i, piece in enumerate(pieces):
                symbol = f'@"{name}"' if len(pieces) == 1 else f'@"{name}#{i}"'
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
                *(f"attributes #{n} = {{ {words} }}" for n, words in enumerate(_ATTRIBUTES)),
                "",
            ]
        )

    def _intrinsic(self, name: str, result: str, *arguments: str) -> str:
        self.declared.setdefault(name, f"declare {result} @{name}({', '.join(arguments)})")
        return f"@{name}"

    # One straight piece

    def _function(self, symbol: str, section: CodeSection, piece: Piece) -> str:
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

        def slot(base: str, i: int, label: str) -> str:
            put(f"  %{label} = getelementptr i8, ptr %{base}, i64 {8 * self.lanes * i}")
            return f"%{label}"

        def load(base: str, i: int, label: str, name: str = "") -> str:
            place = slot(base, i, f"{label}.p")
            put(f"  %{label} = load {V}, ptr {place}, align {self.align}{_remark(name)}")
            return f"%{label}"

        def plain(i: int) -> str:
            """The value at position i, loaded or spread over the lanes where it is not there yet."""
            value = have.get(i)
            if value is not None:
                return value
            node = nodes[i]
            op = node[0]
            if op == "const":
                value = f"splat (double {number(node[1])})"
            elif op == "false":
                value = "zeroinitializer"
            elif op == "input":
                value = load("inputs", self.inputs[node[1]], f"v{i}", node[1])
            elif op == "cell":
                value = load("state", self.state[node[1]], f"v{i}", node[1])
            elif op in ("tick", "time"):
                put(f"  %v{i}.s = insertelement {V} poison, double %{op}, i64 0")
                put(f"  %v{i} = shufflevector {V} %v{i}.s, {V} poison, <{L} x i32> zeroinitializer")
                value = f"%v{i}"
            elif op in TRUTHS:
                held = load("scratch", piece.kept[i], f"v{i}.d")
                put(f"  %v{i} = fcmp une {V} {held}, zeroinitializer")
                value = f"%v{i}"
            else:
                value = load("scratch", piece.kept[i], f"v{i}")
            have[i] = value
            return value

        def of(ref: int) -> str:
            """The value of a reference, sign and all."""
            i = ref >> 1
            if not ref & 1:
                return plain(i)
            value = turned.get(i)
            if value is None:
                op = nodes[i][0]
                if op == "const":
                    value = f"splat (double {number(-nodes[i][1])})"
                elif op == "false":
                    value = "splat (i1 true)"
                elif op in TRUTHS:
                    put(f"  %n{i} = xor {truth} {plain(i)}, splat (i1 true)")
                    value = f"%n{i}"
                else:
                    put(f"  %n{i} = fneg {V} {plain(i)}")
                    value = f"%n{i}"
                turned[i] = value
            return value

        def pattern(value: str, label: str) -> str:
            put(f"  %{label} = bitcast {V} {value} to {bits}")
            return f"%{label}"

        def compute(i: int) -> None:
            node = nodes[i]
            op = node[0]
            operands = [of(ref) for ref in node[1 : 1 + OPERANDS[op]]]
            to = f"%v{i}"
            if op in _ARITHMETIC:
                put(f"  {to} = {_ARITHMETIC[op]} {V} {operands[0]}, {operands[1]}")
            elif op in _CALLS:
                call = self._intrinsic(f"{_CALLS[op]}.{suffix}", V, *[V] * len(operands))
                put(f"  {to} = call {V} {call}({', '.join(f'{V} {x}' for x in operands)})")
            elif op in _COMPARE:
                put(f"  {to} = fcmp {_COMPARE[op]} {V} {operands[0]}, {operands[1]}")
            elif op == "and":
                put(f"  {to} = and {truth} {operands[0]}, {operands[1]}")
            elif op == "where":
                put(f"  {to} = select {truth} {operands[0]}, {V} {operands[1]}, {V} {operands[2]}")
            elif op == "bit":
                mask = 1 << node[2] if node[2] < 63 else -1 << 63
                put(f"  %v{i}.a = and {bits} {pattern(operands[0], f'v{i}.i')}, splat (i64 {mask})")
                put(f"  {to} = icmp ne {bits} %v{i}.a, zeroinitializer")
            elif op == "flip":
                x, t = pattern(operands[0], f"v{i}.i"), pattern(operands[1], f"v{i}.t")
                put(f"  %v{i}.l = shl {bits} {t}, splat (i64 {63 - node[3]})")
                put(f"  %v{i}.a = and {bits} %v{i}.l, splat (i64 {-1 << 63})")
                put(f"  %v{i}.x = xor {bits} {x}, %v{i}.a")
                put(f"  {to} = bitcast {bits} %v{i}.x to {V}")
            elif op == "pow2":
                put(f"  %v{i}.s = fadd {V} {operands[0]}, splat (double {number(4503599627371519.0)})")
                put(f"  %v{i}.l = shl {bits} {pattern(f'%v{i}.s', f'v{i}.i')}, splat (i64 52)")
                put(f"  {to} = bitcast {bits} %v{i}.l to {V}")
            elif op == "exponent":
                put(f"  %v{i}.l = lshr {bits} {pattern(operands[0], f'v{i}.i')}, splat (i64 52)")
                put(f"  %v{i}.a = and {bits} %v{i}.l, splat (i64 2047)")
                put(f"  %v{i}.o = or {bits} %v{i}.a, splat (i64 {0x433 << 52})")
                put(f"  %v{i}.d = bitcast {bits} %v{i}.o to {V}")
                put(f"  {to} = fsub {V} %v{i}.d, splat (double {number(4503599627371519.0)})")
            elif op == "significand":
                put(f"  %v{i}.a = and {bits} {pattern(operands[0], f'v{i}.i')}, splat (i64 {(1 << 52) - 1})")
                put(f"  %v{i}.o = or {bits} %v{i}.a, splat (i64 {1023 << 52})")
                put(f"  {to} = bitcast {bits} %v{i}.o to {V}")
            elif op == "philox":
                refs, word = node[1:7], node[7]
                if refs not in drawn:
                    drawn[refs] = PhiloxWriter(put, f"r{i}", operands, L)
                to = drawn[refs].word(word)
            else:
                assert op == "gather", op
                gather(i, operands[0], node[2])
            have[i] = to

        def gather(i: int, index: str, table: tuple[float, ...]) -> None:
            symbol = self.tables.setdefault(table, f"@table.{len(self.tables)}")
            top = number(len(table) - 1.0)
            put(f"  %v{i}.c = fcmp ogt {V} {index}, zeroinitializer")
            put(f"  %v{i}.l = select {truth} %v{i}.c, {V} {index}, {V} zeroinitializer")
            put(f"  %v{i}.e = fcmp olt {V} %v{i}.l, splat (double {top})")
            put(f"  %v{i}.h = select {truth} %v{i}.e, {V} %v{i}.l, {V} splat (double {top})")
            put(f"  %v{i}.i = fptosi {V} %v{i}.h to <{L} x i32>")
            put(f"  %v{i}.p = getelementptr double, ptr {symbol}, <{L} x i32> %v{i}.i")
            call = self._intrinsic(f"llvm.masked.gather.{suffix}.v{L}p0", V, f"<{L} x ptr>", "i32", truth, V)
            put(f"  %v{i}.g = call {V} {call}(<{L} x ptr> %v{i}.p, i32 8, {truth} splat (i1 true), {V} poison)")
            put(f"  %v{i}.n = fcmp uno {V} {index}, {index}")
            put(f"  %v{i} = select {truth} %v{i}.n, {V} splat (double {number(float('nan'))}), {V} %v{i}.g")

        def keep(i: int) -> None:
            value = have[i]
            if nodes[i][0] in TRUTHS:
                put(f"  %v{i}.k = select {truth} {value}, {V} splat (double {number(1.0)}), {V} zeroinitializer")
                value = f"%v{i}.k"
            put(f"  store {V} {value}, ptr {slot('scratch', piece.keep[i], f'v{i}.q')}, align {self.align}")

        def leave(stores: Iterable[tuple[str, Any, int]]) -> None:
            ready = [(kind, where, of(ref)) for kind, where, ref in stores]
            for kind, where, value in ready:
                base, i = {
                    "cell": ("state", self.state.get(where)),
                    "record": ("row", where),
                    "output": ("outputs", where),
                }[kind]
                assert i is not None
                name = _remark(where if kind == "cell" else "")
                put(f"  store {V} {value}, ptr {slot(base, i, f'{base}.{i}')}, align {self.align}{name}")

        for position, i in piece.body:
            compute(i)
            if i in piece.keep:
                keep(i)
            leave(piece.stores.get(position, ()))
        leave(piece.tail)
        attributes = "#0" if piece.small and self.inline else "#1"
        return "\n".join(
            [
                f"define private void {symbol}(ptr noalias %state, ptr noalias readonly %inputs, ptr noalias %scratch, "
                f"ptr noalias %row, ptr noalias %outputs, double %tick, double %time) {attributes} {{",
                *lines,
                "  ret void",
                "}",
            ]
        )
