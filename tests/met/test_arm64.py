"""Code made for arm64, run in an emulator: the same bits as here, for whole runs with friction.

The object is MET's, from the text that every machine's code is made from; a small C program calls it under
`qemu-aarch64`. What an emulator cannot show is how fast an arm64 processor is.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import ic
from met.backends.llvm import kernel
from met.backends.llvm import machine as llvm
from met.backends.llvm.emit import emit
from met.program.build import build
from met.run import inputs
from met.trace import atan2, cos, exp, floor, fma, gather, log, rint, sin, sqrt, tanh, where
from met.trace.noise import Stream, normal
from met.trace.program import Phase, Program, RecordPhase, RunPhase, Tape
from met.trace.recorder import record as recorded

pytestmark = pytest.mark.slow

COMPILER, EMULATOR = "aarch64-linux-gnu-gcc", "qemu-aarch64"
DRIVER = Path(__file__).with_name("run_kernel.c")


@pytest.fixture(scope="module")
def tools() -> None:
    missing = [name for name in (COMPILER, EMULATOR) if shutil.which(name) is None]
    if missing:
        pytest.skip(
            f"no {' and no '.join(missing)}; on Debian or Ubuntu: "
            "apt-get install qemu-user gcc-aarch64-linux-gnu libc6-dev-arm64-cross"
        )


def run_on_arm64(
    program: Program, cases: np.ndarray, ticks: int, folder: Path, *, cpu: str, lanes: int, level: int | None
) -> tuple[np.ndarray, np.ndarray]:
    """Rows [case, row, column] and outputs [case, output] of a run in the emulator."""
    recording = recorded(program)
    target = llvm.arm64(cpu)
    text = emit(recording, lanes, vector=min(lanes, target.width), width=target.width)
    (folder / "kernel.o").write_bytes(llvm.assemble(text, target, level=level))
    words = [COMPILER, "-static", "-O1", "-o", folder / "run", DRIVER, folder / "kernel.o"]
    made = subprocess.run(words, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    rows = ticks // program.record_divisor + 1
    shape = (
        len(cases),
        lanes,
        len(program.inputs),
        len(recording.cells),
        len(program.outputs),
        ticks,
        rows,
        program.columns,
    )
    (folder / "question").write_bytes(np.array(shape, "<i8").tobytes() + cases.astype("<f8").tobytes())
    done = subprocess.run([EMULATOR, folder / "run", folder / "question", folder / "answer"], capture_output=True)
    assert done.returncode == 0, done.stderr
    found = np.frombuffer((folder / "answer").read_bytes(), "<f8")
    split = len(cases) * rows * program.columns
    return found[:split].reshape(len(cases), rows, program.columns), found[split:].reshape(len(cases), -1)


def same_bits(
    program: Program, cases: np.ndarray, ticks: int, folder: Path, *, cpu: str, lanes: int, level: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Asserts that all rows and outputs of a run here and there agree to the last bit, and gives them back.

    What is not a number agrees with any other: the sign of 0/0 is not the standard's, x86 sets it and arm64 does not.
    """
    theirs = run_on_arm64(program, cases, ticks, folder, cpu=cpu, lanes=lanes, level=level)
    rows, outputs = kernel.compile(program).run(cases, ticks)
    assert rows is not None
    for ours, other in zip((rows, outputs), theirs, strict=True):
        neither = np.isnan(ours) & np.isnan(other)
        different = (ours.view(np.int64) != other.view(np.int64)) & ~neither
        assert not different.any(), f"{different.sum()} of {different.size} numbers differ, first {different.argmax()}"
    return rows, outputs


@pytest.mark.release
@pytest.mark.parametrize(("cpu", "lanes", "level"), [("generic", 4, None), ("neoverse-n1", 8, 3), ("generic", 2, 0)])
@pytest.mark.parametrize(("deck", "name"), [("two_link.ic", "gains"), ("panda.ic", "swing")])
def test_a_whole_run_with_friction_has_the_same_bits(
    tools: None, tmp_path: Path, deck: str, name: str, cpu: str, lanes: int, level: int
) -> None:
    experiment = ic.compile(deck, select=[name]).experiments[0]
    program = build(experiment)
    cases = inputs(experiment, np.arange(experiment.cases.count))
    rows, outputs = same_bits(
        program, cases, experiment.structure.schedule.ticks, tmp_path, cpu=cpu, lanes=lanes, level=level
    )
    assert np.isfinite(rows).all() and rows.std() > 0.0
    if name == "swing":  # joints turn back, so friction has split steps
        assert outputs[:, program.outputs.index("friction.splits")].min() > 0


@pytest.mark.parametrize("cpu", ["generic", "neoverse-n1"])
def test_every_operation_has_the_same_bits(tools: None, tmp_path: Path, cpu: str) -> None:
    """Elementary functions, tables, masks, noise and what is not finite, over values of every size."""

    def row(t: Tape) -> None:
        x = t.input("x") * (1.0 + t.time)
        size = abs(x)
        for column, value in enumerate((
            sin(x), cos(x), exp(x * 0.01), log(size), sqrt(x), tanh(x), floor(x), x / (x - x), 1.0 / x,
            gather((0.5, -1.0, 2.0, 1e300), floor(x)), where(x > 1.0, x, -x), x * 0.1 + 0.3, rint(x), fma(x, 0.3, 1.0),
            atan2(x, size - 1.0), normal(Stream(floor(size), 1.0, "sensor"), t.tick),
        )):  # fmt: skip
            t.record(column, value)

    def end(t: Tape) -> None:
        t.output("x", t.input("x"))

    program = Program(7.0, (), (RecordPhase(Phase("row", row), 1),), (RunPhase(Phase("end", end)),), ("x",), 16, ("x",))
    rng = np.random.default_rng(3)
    some = rng.standard_normal(90) * 10.0 ** rng.uniform(-9, 4, 90)
    special = [0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, -1e308, 0.5, 1.5, 2.5]
    same_bits(program, np.array([*some, *special])[:, None], 6, tmp_path, cpu=cpu, lanes=8)
