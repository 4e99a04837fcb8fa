"""Whole commands as a user waits for them: from the shell's start of the process to its end, with their time and
memory."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks import long_deck
from benchmarks.benchmark import Benchmark, Derived, Target, ratio

TITLE = "whole commands"

MET = Path(__file__).parents[1] / "met"

# As on a user's machine: compiled bytecode is kept, which doubles the speed of a start and can be switched off.
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def run(*words: str, deck: str = "") -> tuple[float, float]:
    """Wall time (s) and memory (MiB) of `scripts/met` with these words, where `deck.ic` is this text and nothing
    else."""
    with tempfile.TemporaryDirectory() as directory:
        if deck:
            Path(directory, "deck.ic").write_text(deck, encoding="utf-8")
        used = timed([MET, *words], directory)
    return used.seconds, used.memory


@dataclass(frozen=True)
class Used:
    """The cost of a process: wall time (s), the largest memory in use (MiB), data read from the disk for it (MiB); and
    its exit status and output."""

    seconds: float
    memory: float
    read: float
    status: int
    text: str


def timed(command: Sequence[str | Path], directory: str | Path, *, status: Sequence[int] = (0, 1)) -> Used:
    """A process from its start to its end. status: that it may end with; another ends the benchmark. 1 is an answer: a
    requirement was missed, archives differ."""
    with tempfile.TemporaryFile() as output:
        begun = time.perf_counter()
        done = subprocess.Popen(command, cwd=directory, env=ENVIRONMENT, stdout=output, stderr=output)
        _, ended, used = os.wait4(done.pid, 0)
        seconds = time.perf_counter() - begun
        done.returncode = os.waitstatus_to_exitcode(ended)
        output.seek(0)
        text = output.read().decode()
    if done.returncode not in status:
        words = " ".join(["met" if word == MET else str(word) for word in command])
        raise SystemExit(f"`{words}` ended with {done.returncode}:\n{text}")
    return Used(seconds, used.ru_maxrss / 1024, used.ru_inblock * BLOCK / 2**20, done.returncode, text)


BLOCK = 512
"""Bytes, in which the kernel counts what is read."""


def _prepared(*words: str) -> Callable[[], Callable[[], float]]:
    return lambda: lambda: run(*words)[0]


def _long(lines: int, which: int) -> Callable[[], Callable[[], float]]:
    """`met check` of a long deck: its seconds (0) or its MiB (1)."""

    def prepare() -> Callable[[], float]:
        deck = long_deck.text(lines)
        return lambda: run("check", "deck.ic", deck=deck)[which]

    return prepare


def _growing(lines: int) -> tuple[Benchmark, Benchmark]:
    doc = f"met check of {lines} lines with two macros each"
    return (
        Benchmark(f"check.{lines}", doc, "s", _long(lines, 0), Target(10.0) if lines == LONGEST else None, 2, True),
        Benchmark(f"memory.{lines}", f"{doc}: memory in use", "MiB", _long(lines, 1),
                  Target(512.0) if lines == LONGEST else None, 1, True),
    )  # fmt: skip


SHORTEST, LONGEST = 2_500, 10_000
LINEAR = 5.0
"""Largest ratio of the times for four times the lines: 4 where the cost is proportional, 16 where it grows with the
square."""


BENCHMARKS: tuple[Benchmark | Derived, ...] = (
    Benchmark("version", "met --version: Python and the command's frame", "s", _prepared("--version")),
    Benchmark(
        "check", "met check two_link.ic, 70 lines with what it includes", "s", _prepared("check", "two_link.ic"),
        Target(0.25),
    ),
    Benchmark(
        "run", "met run two_link.ic --case '#0' --no-picture", "s",
        _prepared("run", "two_link.ic", "--case", "#0", "--no-picture"), Target(1.0),
    ),
    *_growing(SHORTEST), *_growing(5_000), *_growing(LONGEST),
    ratio("check.growth", "times that four times the lines take", over=f"check.{LONGEST}", under=f"check.{SHORTEST}",
          target=Target(LINEAR)),
    ratio("memory.growth", "times that four times the lines need", over=f"memory.{LONGEST}",
          under=f"memory.{SHORTEST}", target=Target(LINEAR)),
)  # fmt: skip
