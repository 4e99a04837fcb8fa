"""Running a module of WebAssembly in node, by the script that pages use: each call is a process of its own."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from met.backends.backend import checked_inputs
from met.backends.wasm.module import LANES, WasmModule
from met.frozen import frozen
from met.trace.program import Program, Recording

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
