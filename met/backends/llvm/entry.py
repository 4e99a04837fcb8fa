"""The entry of a program's machine code, as LLVM IR text: blocks, ticks, control and rows around the sections.

    void met_run(inputs, state, rows, outputs, blocks, first, last, cases, row_stride, state_stride)

inputs, state, outputs are [block][slot][lane], aligned to 64 bytes; blocks that keep no state may share one
(`state_stride`, in bytes, is then 0). rows is [case][row][column], `row_stride` doubles a case, or null; `cases` of
them are there, and lanes beyond repeat the last. outputs may be null: `end` is then not run.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from met.trace.program import Branch, Every, RecordedControl, Recording, RecordSection, RunSection, Unless0, WhileAny

ENTRY = "met_run"

# doubles of each case that are gathered before they are spread over the cases' own rows: a few cache lines each
_TILE = 64
# bytes of scratch and tile together up to which they stand on the stack: a thread's may be 512 KiB in all, and a row of
# 100,000 columns takes 12 MiB
_STACK = 1 << 18


def number(value: float) -> str:
    """A double in IR, exactly."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


class _Entry:
    """Writer of the entry function. `calls` are the symbols of each section's pieces."""

    def __init__(
        self, recording: Recording, calls: Sequence[Sequence[str]], lanes: int, vector: int, scratch: int
    ) -> None:
        """lanes: cases a block; vector: cases that a call of a section computes; scratch: doubles of memory that pieces
        share, a case"""
        self.recording = recording
        self.program = recording.program
        self.calls = calls
        self.lanes = lanes
        self.parts = range(lanes // vector)
        self.part_bytes = 8 * vector
        self.scratch = scratch
        self.state = {name: slot for slot, name in enumerate(recording.cells)}
        self.row_bytes = 8 * lanes * self.program.columns
        self.tile_rows = max(1, _TILE // self.program.columns) if self.program.columns else 1
        self.lines: list[str] = []
        self.counters: list[str] = []
        self.labels = 0
        self.now = ("0", "0.0", "0.0")
        # depth of code that seldom runs: its sections are called, not inlined, which compiles in half the time
        self.rare = 0

    def put(self, *lines: str) -> None:
        self.lines.extend(lines)

    def label(self, word: str) -> str:
        self.labels += 1
        return f"{word}.{self.labels}"

    def guarded(self, condition: str, word: str, body: Callable[[], None]) -> None:
        """Write a body that runs only where a condition (a name of IR) holds."""
        inside, after = self.label(word), self.label("after")
        self.put(f"  br i1 {condition}, label %{inside}, label %{after}", f"{inside}:")
        body()
        self.put(f"  br label %{after}", f"{after}:")

    def call(self, section: int, row: str = "null") -> None:
        """Write the calls of a section's pieces, for each part of the lanes. row: the pointer to where a recorded row
        goes."""
        _, tick, time = self.now
        rows = [row] * len(self.parts)
        if row != "null":
            for part in self.parts:
                rows[part] = f"{row}.{part}"
                self.put(f"  {rows[part]} = getelementptr i8, ptr {row}, i64 {part * self.part_bytes}")
        apart = " #2" if self.rare else ""
        for symbol in self.calls[section]:
            for part in self.parts:
                self.put(
                    f"  call void {symbol}(ptr %state.{part}, ptr %inputs.{part}, ptr %scratch.{part}, "
                    f"ptr {rows[part]}, ptr %outputs.{part}, double {tick}, double {time}){apart}"
                )

    def due(self, divisor: int) -> str:
        """IR of a condition: the divisor divides the tick's number."""
        n = self.label("due")
        self.put(f"  %{n}.rest = urem i64 {self.now[0]}, {divisor}", f"  %{n} = icmp eq i64 %{n}.rest, 0")
        return f"%{n}"

    def steps(self, body: Iterable[RecordedControl]) -> None:
        """Write a body of the program's control: sections, rows and branches."""
        for node in body:
            match node:
                case RunSection(section):
                    self.call(section)
                case RecordSection():
                    self.record(node)
                case Branch(Every(divisor), inner):
                    self.guarded(self.due(divisor), "every", partial(self.steps, inner))
                case Branch(Unless0(), inner):
                    n = self.label("later")
                    self.put(f"  %{n} = icmp ne i64 {self.now[0]}, 0")
                    self.guarded(f"%{n}", "unless0", partial(self.steps, inner))
                case Branch(WhileAny() as condition, inner):
                    self.while_any(condition, inner)

    def while_any(self, condition: WhileAny, body: tuple[RecordedControl, ...]) -> None:
        """Write the loop of a body that runs while the condition's cell is not 0 in any lane, `at_most` times."""
        n = self.label("w")
        vector = f"<{self.lanes} x double>"
        self.counters.append(f"  %{n}.p = alloca i64")
        self.put(
            f"  store i64 0, ptr %{n}.p",
            f"  br label %ask.{n}",
            f"ask.{n}:",
            f"  %{n}.count = load i64, ptr %{n}.p",
            f"  %{n}.left = icmp ult i64 %{n}.count, {condition.at_most}",
            f"  %{n}.cell = getelementptr i8, ptr %state.b, i64 {8 * self.lanes * self.state[condition.cell]}",
            f"  %{n}.value = load {vector}, ptr %{n}.cell, align {min(64, 8 * self.lanes)}",
            f"  %{n}.lanes = fcmp une {vector} %{n}.value, zeroinitializer",
            f"  %{n}.bits = bitcast <{self.lanes} x i1> %{n}.lanes to i{self.lanes}",
            f"  %{n}.any = icmp ne i{self.lanes} %{n}.bits, 0",
            f"  %{n} = and i1 %{n}.left, %{n}.any",
            f"  br i1 %{n}, label %do.{n}, label %after.{n}",
            f"do.{n}:",
            f"  %{n}.next = add i64 %{n}.count, 1",
            f"  store i64 %{n}.next, ptr %{n}.p",
        )
        self.rare += 1
        self.steps(body)
        self.rare -= 1
        self.put(f"  br label %ask.{n}", f"after.{n}:")

    def record(self, node: RecordSection) -> None:
        """Write the recording of a row at its ticks, into a tile (rows of all lanes side by side) that is flushed when
        it is full."""
        n = self.label("row")
        due = self.due(node.divisor)
        self.put(f"  %{n} = and i1 {due}, %recording")

        def body() -> None:
            """Write the call of the section, whose row goes into the tile behind those that are there."""
            self.put(
                f"  %{n}.filled = load i64, ptr %filled",
                f"  %{n}.offset = mul i64 %{n}.filled, {self.row_bytes}",
                f"  %{n}.place = getelementptr i8, ptr %tile, i64 %{n}.offset",
            )
            self.call(node.section, f"%{n}.place")

        self.guarded(f"%{n}", "record", body)

    def row_done(self) -> None:
        """Count a row, and spread the tile when it is full."""
        due = self.due(self.program.record_divisor)
        self.put(f"  %row = and i1 {due}, %recording")

        def body() -> None:
            """Count the row, and flush the tile where it is full."""
            self.put(
                "  %row.filled = load i64, ptr %filled",
                "  %row.more = add i64 %row.filled, 1",
                "  store i64 %row.more, ptr %filled",
                f"  %row.full = icmp eq i64 %row.more, {self.tile_rows}",
            )
            self.guarded("%row.full", "full", lambda: self.flush(str(self.tile_rows * self.program.columns)))

        self.guarded("%row", "recorded", body)

    def flush(self, count: str) -> None:
        """Write the copying of the tile's rows, which are of all lanes side by side, into the rows of each case. count:
        the doubles of a lane in it"""
        n = self.label("flush")
        self.put(
            f"  %{n}.to = load ptr, ptr %target",
            f"  call void @spread(ptr %tile, i64 {count}, ptr %{n}.to, i64 %stride, i64 %most)",
            f"  %{n}.bytes = shl i64 {count}, 3",
            f"  %{n}.next = getelementptr i8, ptr %{n}.to, i64 %{n}.bytes",
            f"  store ptr %{n}.next, ptr %target",
            "  store i64 0, ptr %filled",
        )

    def text(self) -> str:
        """The IR text of the entry: for each block, the start if the first tick is 0, all ticks with their rows, and
        the end if outputs are asked for."""
        base_hz = number(self.program.base_hz)
        slots = (("inputs", len(self.program.inputs)), ("outputs", len(self.program.outputs)))
        self.put("  br label %block", "block:", "  %b = phi i64 [ 0, %entry ], [ %b.next, %block.end ]")
        for name, count in slots:
            self.put(
                f"  %{name}.offset = mul i64 %b, {8 * self.lanes * count}",
                f"  %{name}.b = getelementptr i8, ptr %{name}, i64 %{name}.offset",
            )
        self.put(
            "  %state.offset = mul i64 %b, %state.stride",
            "  %state.b = getelementptr i8, ptr %state, i64 %state.offset",
        )
        for part in self.parts:
            for name in ("state.b", "inputs.b", "outputs.b", "scratch"):
                self.put(
                    f"  %{name.removesuffix('.b')}.{part} = getelementptr i8, ptr %{name}, i64 {part * self.part_bytes}"
                )
        self.put(
            f"  %case = mul i64 %b, {self.lanes}",
            "  %case.offset = mul i64 %case, %stride",
            "  %rows.b = getelementptr double, ptr %rows, i64 %case.offset",
            "  store ptr %rows.b, ptr %target",
            "  store i64 0, ptr %filled",
            "  %behind = sub i64 %cases, %case",
            "  %most = sub i64 %behind, 1",
            "  %fresh = icmp eq i64 %first, 0",
        )
        self.rare += 1
        self.guarded("%fresh", "start", self._start)
        self.rare -= 1
        self.put(
            "  %some = icmp sle i64 %first, %last",
            "  br label %ticks",
            "ticks:",
            "  br i1 %some, label %tick.head, label %ticks.end",
            "tick.head:",
            "  %k = phi i64 [ %first, %ticks ], [ %k.next, %tick.end ]",
            "  %tick = sitofp i64 %k to double",
            f"  %time = fdiv double %tick, {base_hz}",
        )
        self.now = ("%k", "%tick", "%time")
        self.steps(self.recording.tick)
        if self.program.columns:
            self.row_done()
        self.put(
            "  br label %tick.end",
            "tick.end:",
            "  %k.next = add i64 %k, 1",
            "  %again = icmp sle i64 %k.next, %last",
            "  br i1 %again, label %tick.head, label %ticks.end",
            "ticks.end:",
        )
        if self.program.columns:
            self.put(
                "  %rest.rows = load i64, ptr %filled",
                f"  %rest = mul i64 %rest.rows, {self.program.columns}",
                "  %rest.any = icmp ne i64 %rest, 0",
            )
            self.guarded("%rest.any", "rest", lambda: self.flush("%rest"))
        self.now = ("%last", "%tick.last", "%time.last")
        self.rare += 1
        self.guarded("%ending", "end", lambda: self.steps(self.recording.end))
        self.put(
            "  br label %block.end",
            "block.end:",
            "  %b.next = add i64 %b, 1",
            "  %more = icmp slt i64 %b.next, %blocks",
            "  br i1 %more, label %block, label %out",
            "out:",
        )
        work, done = self._work()
        self.put(*done, "  ret void", "}")
        head = [
            f"define void @{ENTRY}(ptr noalias readonly %inputs, ptr noalias %state, ptr noalias %rows, "
            "ptr noalias %outputs, i64 %blocks, i64 %first, i64 %last, i64 %cases, i64 %stride, "
            "i64 %state.stride) #3 {",
            "entry:",
            *work,
            "  %filled = alloca i64",
            "  %target = alloca ptr",
            *self.counters,
            "  %recording = icmp ne ptr %rows, null",
            "  %ending = icmp ne ptr %outputs, null",
            "  %tick.last = sitofp i64 %last to double",
            f"  %time.last = fdiv double %tick.last, {base_hz}",
        ]
        return "\n".join([*head, *self.lines])

    def _work(self) -> tuple[list[str], list[str]]:
        """Lines that allocate `scratch` and `tile`, aligned to 64 bytes, and lines that free them."""
        tile = max(1, self.tile_rows * self.program.columns) * self.lanes
        scratch = -(-max(1, self.scratch) * self.lanes // 8) * 8
        if 8 * (scratch + tile) <= _STACK:
            return [
                f"  %scratch = alloca [{scratch} x double], align 64",
                f"  %tile = alloca [{tile} x double], align 64",
            ], []
        return [
            f"  %work = call ptr @malloc(i64 {8 * (scratch + tile) + 64})",
            "  %work.past = ptrtoint ptr %work to i64",
            "  %work.low = and i64 %work.past, 63",
            "  %work.skip = sub i64 64, %work.low",
            "  %scratch = getelementptr i8, ptr %work, i64 %work.skip",
            f"  %tile = getelementptr i8, ptr %scratch, i64 {8 * scratch}",
        ], ["  call void @free(ptr %work)"]

    def _start(self) -> None:
        """Write what happens before tick 0: all cells 0, then the program's start."""
        if self.state:
            self.put(
                "  call void @llvm.memset.p0.i64(ptr align 64 %state.b, i8 0, "
                f"i64 {8 * self.lanes * len(self.state)}, i1 false)"
            )
        self.steps(self.recording.start)


def entry(recording: Recording, calls: Sequence[Sequence[str]], lanes: int, vector: int, scratch: int) -> str:
    """The IR text of the function that runs a program: blocks, ticks, control and rows.

    calls    symbols of each section's pieces, which take `vector` of a block's lanes
    scratch  slots that pieces share
    """
    text = _Entry(recording, calls, lanes, vector, scratch).text()
    return (
        text + "\ndeclare void @llvm.memset.p0.i64(ptr, i8, i64, i1)\ndeclare ptr @malloc(i64)\ndeclare void @free(ptr)"
    )


def spread(lanes: int, width: int) -> str:
    """The function that turns a tile, [value][lane], into each case's own row of values.

    Squares of `width` values and lanes are transposed in registers; the rest is copied one by one. Lanes beyond the
    last case (`most`) write the same values to the same place as that case.
    """
    lines = [
        "define private void @spread(ptr noalias readonly %tile, i64 %count, ptr %to, i64 %stride, i64 %most) #1 {",
        "entry:",
        f"  %whole = and i64 %count, {-width}",
        "  br label %group",
        "group:",
        "  %g = phi i64 [ 0, %entry ], [ %g.next, %done ]",
        "  %g.bytes = shl i64 %g, 3",
        "  %from = getelementptr i8, ptr %tile, i64 %g.bytes",
    ]
    for j in range(width):
        lines += [
            f"  %lane.{j} = add i64 %g, {j}",
            f"  %there.{j} = call i64 @llvm.umin.i64(i64 %lane.{j}, i64 %most)",
            f"  %offset.{j} = mul i64 %there.{j}, %stride",
            f"  %to.{j} = getelementptr double, ptr %to, i64 %offset.{j}",
        ]
    lines += _squares(lanes, width)
    return "\n".join(
        [
            *lines,
            "done:",
            f"  %g.next = add i64 %g, {width}",
            f"  %g.more = icmp ult i64 %g.next, {lanes}",
            "  br i1 %g.more, label %group, label %out",
            "out:",
            "  ret void",
            "}",
            "declare i64 @llvm.umin.i64(i64, i64)",
        ]
    )


def _squares(lanes: int, width: int) -> list[str]:
    """The loop over all values of the lanes at `from`: squares first, then the rest one by one."""
    vector = f"<{width} x double>"
    lines = [
        "  br label %ask",
        "ask:",
        "  %i = phi i64 [ 0, %group ], [ %i.next, %do ]",
        "  %go = icmp ult i64 %i, %whole",
        "  br i1 %go, label %do, label %more",
        "do:",
        f"  %i.bytes = mul i64 %i, {8 * lanes}",
        "  %square = getelementptr i8, ptr %from, i64 %i.bytes",
    ]
    names = []
    for j in range(width):
        names.append(f"%a1.{j}")
        lines += [
            f"  %p{j} = getelementptr i8, ptr %square, i64 {8 * lanes * j}",
            f"  {names[-1]} = load {vector}, ptr %p{j}, align {8 * width}",
        ]
    s = 1
    while s < width:
        turned = list(names)
        low = ", ".join(f"i32 {width + j - s if j & s else j}" for j in range(width))
        high = ", ".join(f"i32 {width + j if j & s else j + s}" for j in range(width))
        for j in (j for j in range(width) if not j & s):
            for mask, to in ((low, j), (high, j + s)):
                turned[to] = f"%a{2 * s}.{to}"
                lines.append(
                    f"  {turned[to]} = shufflevector {vector} {names[j]}, {vector} {names[j + s]}, "
                    f"<{width} x i32> <{mask}>"
                )
        names = turned
        s *= 2
    for j in range(width):
        lines += [
            f"  %q{j} = getelementptr double, ptr %to.{j}, i64 %i",
            f"  store {vector} {names[j]}, ptr %q{j}, align 8",
        ]
    lines += [
        f"  %i.next = add i64 %i, {width}",
        "  br label %ask",
        "more:",
        "  %t = phi i64 [ %whole, %ask ], [ %t.next, %one ]",
        "  %left = icmp ult i64 %t, %count",
        "  br i1 %left, label %one, label %done",
        "one:",
        f"  %t.bytes = mul i64 %t, {8 * lanes}",
        "  %row = getelementptr i8, ptr %from, i64 %t.bytes",
    ]
    for j in range(width):
        lines += [
            f"  %l{j} = getelementptr double, ptr %row, i64 {j}",
            f"  %x{j} = load double, ptr %l{j}, align 8",
            f"  %s{j} = getelementptr double, ptr %to.{j}, i64 %t",
            f"  store double %x{j}, ptr %s{j}, align 8",
        ]
    return [*lines, "  %t.next = add i64 %t, 1", "  br label %more"]
