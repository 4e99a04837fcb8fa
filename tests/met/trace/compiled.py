"""C that MET wrote, compiled and run: by gcc and clang here, and for a controller without doubles in an emulator."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from met.backends.c.emit import emit
from met.trace.program import Program
from met.trace.recorder import record

HERE = Path(__file__).parent
STRICT = ("-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror", "-ffp-contract=off")
CONTROLLER = ("-mcpu=cortex-m3", "-mthumb", "-ffreestanding", "-nostdlib", "-static", "-Wl,-e,_start")
# qemu-arm 7.2 cannot start a program on a Cortex-M; a Cortex-A15 runs what is made for one.
EMULATOR = ("qemu-arm", "-cpu", "cortex-a15")
PACKAGES = {
    "gcc": "gcc libc6-dev",
    "clang": "clang libc6-dev",
    "arm-none-eabi-gcc": "gcc-arm-none-eabi",
    "qemu-arm": "qemu-user",
}


def need(*names: str) -> None:
    """Skips the test where a program is missing, with what brings it."""
    missing = [name for name in names if shutil.which(name) is None]
    if missing:
        packages = " ".join(PACKAGES[name] for name in missing)
        pytest.skip(f"no {' and no '.join(missing)}; on Debian or Ubuntu: apt-get install {packages}")


def made(folder: Path, text: str, words: tuple[str, ...], *, include: Path = HERE) -> tuple[str, ...]:
    """The command that runs this C program, compiled by the compiler `words[0]` with the flags that follow."""
    arm = words[0].startswith("arm")
    need(words[0], *(["qemu-arm"] if arm else []))
    (folder / "program.c").write_text(text, encoding="utf-8")
    command = [
        *words,
        *STRICT,
        *(CONTROLLER if arm else ()),
        f"-I{HERE}",
        f"-I{include}",
        "-o",
        folder / "program",
        folder / "program.c",
        *(["-lgcc"] if arm else []),
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return (*(EMULATOR if arm else ()), str(folder / "program"))


def answered(command: tuple[str, ...], question: np.ndarray) -> np.ndarray:
    """The doubles that the program answers to these."""
    done = subprocess.run(command, input=question.astype("<f8").tobytes(), capture_output=True)
    assert done.returncode == 0, done.stderr
    return np.frombuffer(done.stdout, "<f8")


def driver(program: Program) -> str:
    """The program in C, with a `main` that runs it for any number of cases."""
    source = emit(record(program))
    lines = [
        source.text,
        *(
            f"#define {name} {value}"
            for name, value in (
                ("INPUTS", len(program.inputs)),
                ("OUTPUTS", len(program.outputs)),
                ("COLUMNS", program.columns),
                ("DIVISOR", program.record_divisor),
            )
        ),
    ]
    lines += [
        "static met_case now;",
        "static void put_inputs(const double *given)",
        "{",
        *(f"    now.{source.inputs[name]} = given[{i}];" for i, name in enumerate(program.inputs)),
        "}",
        "static void get_outputs(double *outputs)",
        "{",
        *(f"    outputs[{i}] = now.{source.outputs[name]};" for i, name in enumerate(program.outputs)),
        "}",
        '#include "run_program.c"',
        "",
    ]
    return "\n".join(lines)


def run(
    program: Program, cases: np.ndarray, ticks: int, folder: Path, words: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Rows [case, row, column] and outputs [case, output] of a run of the program in C."""
    question = np.column_stack([cases, np.full(len(cases), float(ticks))])
    found = answered(made(folder, driver(program), words), question).reshape(len(cases), -1)
    split = (ticks // program.record_divisor + 1) * program.columns
    return found[:, :split].reshape(len(cases), -1, program.columns), found[:, split:]


def different(ours: np.ndarray, theirs: np.ndarray) -> int:
    """How many numbers are not the same to the last bit; what is not a number is like any other such."""
    assert ours.shape == theirs.shape
    neither = np.isnan(ours) & np.isnan(theirs)
    return int(np.count_nonzero((ours.view(np.int64) != theirs.view(np.int64)) & ~neither))
