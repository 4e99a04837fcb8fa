"""A recorded program as a module of WebAssembly, and the description by which a caller runs it.

The code is the LLVM back end's text, two cases a block, which a register of WebAssembly holds. A module calls an exact
multiply-add of its own (`met.backends.wasm.fma`); where a machine fuses by itself, which `kernel.js` finds out, the
calls are overwritten by its instruction. Both give the same bits.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from met.backends.backend import checked_inputs
from met.backends.llvm import emit as llvm_text
from met.backends.llvm import machine
from met.backends.llvm.entry import ENTRY
from met.backends.wasm import fma, link
from met.frozen import frozen
from met.host import cache
from met.trace.program import Program, Recording

LANES = 2

KERNEL_JS = Path(__file__).with_name("kernel.js")
"""The script that runs a module, in a page and in node."""

_FUSED = "@llvm.fma.v2f64"
_ATTRIBUTES = ("noinline nounwind willreturn memory(none)", "noinline nounwind")
_LIBRARY = (
    "declare double @llvm.fabs.f64(double)",
    "declare ptr @malloc(i64)",
    "declare void @free(ptr)",
)


@frozen
class WasmModule:
    """A program in WebAssembly. recording: of the program; code: the module; heap: the first free byte of its memory.

    cached  whether it was found in the cache rather than made;  fma_calls: places where it multiplies and adds
    """

    recording: Recording
    code: bytes
    heap: int
    fma_calls: int
    cached: bool

    @property
    def description(self) -> dict[str, Any]:
        """Description of the module for its callers, as JSON has it.

        module   SHA-256 of the module;  entry, heap: its function, and the first byte of memory that is free
        lanes    cases a block;  numbers are doubles, [block][number][lane], from a multiple of 64 bytes on
        inputs, cells, outputs   names of the numbers of a case, in the order of memory
        columns  numbers of a row;  record_divisor: ticks a row;  base_hz: ticks a second
        """
        program = self.recording.program
        return {
            "module": hashlib.sha256(self.code).hexdigest(),
            "entry": ENTRY,
            "heap": self.heap,
            "lanes": LANES,
            "base_hz": program.base_hz,
            "record_divisor": program.record_divisor,
            "columns": program.columns,
            "inputs": list(program.inputs),
            "cells": list(self.recording.cells),
            "outputs": list(program.outputs),
        }


def text(recording: Recording) -> str:
    """The program as LLVM IR, with all functions that it calls."""
    ir = llvm_text.emit(recording, LANES, vector=LANES, width=LANES)
    lines = [
        line for line in ir.splitlines() if line not in _LIBRARY and not line.startswith(f"declare {_VECTOR} {_FUSED}(")
    ]
    ir = "\n".join(lines).replace(_FUSED, f"@{fma.NAME}")
    numbers = [len(llvm_text.ATTRIBUTES) + n for n in range(len(_ATTRIBUTES))]
    parts = [ir, fma.function(f"#{numbers[0]}"), _memory(f"#{numbers[1]}")]
    fabs = f"declare {_VECTOR} @llvm.fabs.v2f64({_VECTOR})"
    if fabs not in lines:
        parts.append(fabs)
    parts += [f"attributes #{n} = {{ {words} }}" for n, words in zip(numbers, _ATTRIBUTES, strict=True)]
    return "\n".join([*parts, ""])


_VECTOR = "<2 x double>"


def _memory(attributes: str) -> str:
    """The functions `malloc` and `free`, for the one block of memory that an entry may ask for, always of the same
    size: memory grows once, and the block is kept."""
    return f"""\
@work = private global ptr null
define private ptr @malloc(i64 %bytes) {attributes} {{
  %kept = load ptr, ptr @work
  %there = icmp ne ptr %kept, null
  br i1 %there, label %old, label %new
old:
  ret ptr %kept
new:
  %more = add i64 %bytes, {link.PAGE - 1}
  %pages = lshr i64 %more, {link.PAGE.bit_length() - 1}
  %count = trunc i64 %pages to i32
  %page = call i32 @llvm.wasm.memory.grow.i32(i32 0, i32 %count)
  %none = icmp eq i32 %page, -1
  br i1 %none, label %full, label %grown
full:
  call void @llvm.trap()
  unreachable
grown:
  %begin = shl i32 %page, {link.PAGE.bit_length() - 1}
  %made = inttoptr i32 %begin to ptr
  store ptr %made, ptr @work
  ret ptr %made
}}
define private void @free(ptr %memory) {attributes} {{
  ret void
}}
declare i32 @llvm.wasm.memory.grow.i32(i32, i32)
declare void @llvm.trap()"""


def compiled(recording: Recording, *, quick: bool = False) -> WasmModule:
    """The module of a program, from the cache where it is there. quick: compiled in half the time, a fifth slower, with
    the same bits."""
    return _linked(recording, *cache.cached(*_object(recording, quick)))


def begun(recording: Recording, *, quick: bool = False) -> Callable[[], WasmModule]:
    """Start to compile in a thread; the returned function waits for `compiled`'s result. LLVM does not hold Python's
    lock."""
    with_one = ThreadPoolExecutor(1)
    future = with_one.submit(cache.cached, *_object(recording, quick))
    with_one.shutdown(wait=False)
    return lambda: _linked(recording, *future.result())


def _object(recording: Recording, quick: bool) -> tuple[str, Callable[[], bytes]]:
    """The name of a program's object in the cache, and the function that compiles it."""
    target, level = machine.wasm32(), machine.QUICK if quick else None
    source = text(recording)
    of_level = ["quick"] if quick else []
    parts = [llvm_text.numbered(source), machine.versions(), target.cpu, target.features, target.triple, *of_level]
    return cache.key(*parts), lambda: machine.assemble(source, target, level=level)


def _linked(recording: Recording, obj: bytes, cached: bool) -> WasmModule:
    linked = link.link(obj, ENTRY, fma.NAME)
    return WasmModule(recording, linked.code, linked.heap, linked.fma_calls, cached)


_SCRIPT = Path(__file__).with_name("node.js")
# largest number of row values that one process writes
_ROWS = 1 << 24


@frozen
class NodeRun:
    """Results of a module. rows [case, row, column], outputs [case, output], state [cell, lane]; fused: whether the
    machine's multiply-add was used; compile_ms, run_ms: time to begin, and of each run."""

    rows: np.ndarray
    outputs: np.ndarray
    state: np.ndarray
    fused: bool
    compile_ms: float
    run_ms: tuple[float, ...]


def ask(
    module: WasmModule,
    inputs: np.ndarray,
    first: int,
    last: int,
    *,
    state: np.ndarray | None = None,
    record: bool = True,
    machine: bool | None = None,
    times: int = 1,
) -> NodeRun:
    """Run ticks first to last of some cases. inputs [case, input], state [cell, lane].

    machine  True for the machine's multiply-add, False for the module's; None for the machine's where it proves right
    times    how often, for who measures
    Raises RuntimeError where there is no node, or it fails.
    """
    program = shutil.which("node")
    if program is None:
        raise RuntimeError("there is no `node` here, which runs WebAssembly")
    question: dict[str, Any] = {
        "description": module.description,
        "first": first,
        "last": last,
        "record": record,
        "cases": len(inputs),
        "machine": machine,
        "bytes": len(module.code),
        "state": state is not None,
        "times": times,
    }
    data = json.dumps(question).encode() + b"\n" + module.code + np.ascontiguousarray(inputs, "<f8").tobytes()
    if state is not None:
        data += np.ascontiguousarray(state, "<f8").tobytes()
    done = subprocess.run([program, str(_SCRIPT)], input=data, capture_output=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"node refuses the module:\n{done.stderr.decode(errors='replace')}")
    report = json.loads(done.stderr.decode().splitlines()[-1])
    numbers = np.frombuffer(done.stdout, "<f8")
    own_program, cells = module.recording.program, len(module.recording.cells)
    rows = _rows(own_program, first, last) if record else 0
    split = len(inputs) * rows * own_program.columns
    until = split + len(inputs) * len(own_program.outputs)
    return NodeRun(
        numbers[:split].reshape(len(inputs), rows, own_program.columns),
        numbers[split:until].reshape(len(inputs), len(own_program.outputs)),
        numbers[until:].reshape(cells, LANES),
        report["fused"],
        report["compile_ms"],
        tuple(report["run_ms"]),
    )


def _rows(program: Program, first: int, last: int) -> int:
    """Number of rows recorded by ticks first to last, both included."""
    divisor = program.record_divisor
    return max(0, last // divisor - -(-first // divisor) + 1)


@frozen
class WasmKernel:
    """A module that node runs, as a `met.backends.backend.Kernel`."""

    module: WasmModule
    lanes: int = LANES
    vector: int = LANES
    processor: str = "wasm32"

    @property
    def recording(self) -> Recording:
        return self.module.recording

    @property
    def program(self) -> Program:
        return self.module.recording.program

    @property
    def cached(self) -> bool:
        return self.module.cached

    @property
    def code_bytes(self) -> int:
        return len(self.module.code)

    @property
    def functions(self) -> int:
        return len(self.module.recording.sections)

    def run(
        self,
        inputs: np.ndarray,
        ticks: int,
        record: bool = True,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> tuple[np.ndarray | None, np.ndarray]:
        """Run cases in node, as `Kernel.run` of met.backends.backend: inputs [case, input] to rows [case, row, column]
        and outputs [case, output]. threads is not used."""
        program = self.program
        inputs = checked_inputs(program, inputs)
        rows = np.empty((len(inputs), _rows(program, 0, ticks), program.columns)) if record else None
        outputs = np.empty((len(inputs), len(program.outputs)))
        some = max(1, _ROWS // max(1, _rows(program, 0, ticks) * program.columns)) if record else max(1, len(inputs))
        for begin in range(0, len(inputs), some):
            part = slice(begin, begin + some)
            node_run = ask(self.module, inputs[part], 0, ticks, record=record)
            if rows is not None:
                rows[part] = node_run.rows
            outputs[part] = node_run.outputs
            if progress is not None:
                progress(min(begin + some, len(inputs)))
        return rows, outputs

    def block(self, inputs: np.ndarray) -> WasmBlock:
        return WasmBlock(self.module, inputs)


class WasmBlock:
    """At most two cases that are stepped call by call, as a `met.backends.backend.Block`."""

    def __init__(self, module: WasmModule, inputs: np.ndarray) -> None:
        case_inputs = np.atleast_2d(np.asarray(inputs, dtype=np.float64))
        program = module.recording.program
        if not 1 <= len(case_inputs) <= LANES or case_inputs.shape[1] != len(program.inputs):
            raise ValueError(f"inputs of shape {case_inputs.shape} for {LANES} lanes, {len(program.inputs)} inputs")
        self.module = module
        self.inputs = np.ascontiguousarray(case_inputs.T)
        self.state = np.zeros((len(module.recording.cells), LANES))
        self.outputs = np.zeros((len(program.outputs), len(case_inputs)))

    def step(self, first: int, last: int) -> None:
        self._take(ask(self.module, self.inputs.T, first, last, state=self.state, record=False))

    def recorded(self, first: int, last: int) -> np.ndarray:
        node_run = ask(self.module, self.inputs.T, first, last, state=self.state)
        self._take(node_run)
        return node_run.rows.copy()

    def _take(self, node_run: NodeRun) -> None:
        self.state[:], self.outputs[:] = node_run.state, node_run.outputs.T

    def cells(self) -> Mapping[str, np.ndarray]:
        return {name: self.state[slot] for slot, name in enumerate(self.module.recording.cells)}
