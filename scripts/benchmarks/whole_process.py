"""What a user waits for: whole commands, from the shell's start of the process to its end."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.benchmark import Benchmark, Target

TITLE = "whole commands, s"

MET = Path(__file__).parents[1] / "met"

# As on a user's machine: compiled bytecode is kept, which doubles the speed of a start and can be switched off.
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def _seconds(*words: str) -> float:
    """Wall time of `scripts/met` with these words, in an empty directory."""
    with tempfile.TemporaryDirectory() as directory:
        begun = time.perf_counter()
        done = subprocess.run([MET, *words], cwd=directory, env=ENVIRONMENT, capture_output=True, text=True)
        seconds = time.perf_counter() - begun
    if done.returncode not in (0, 1):  # 1: a requirement was missed, which is an answer
        raise SystemExit(f"`met {' '.join(words)}` ended with {done.returncode}:\n{done.stderr}")
    return seconds


def _prepared(*words: str) -> Callable[[], Callable[[], float]]:
    return lambda: lambda: _seconds(*words)


BENCHMARKS = (
    Benchmark("version", "met --version: Python and the command's frame", "s", _prepared("--version")),
    Benchmark("check", "met check two_link.ic", "s", _prepared("check", "two_link.ic"), Target(0.25)),
    Benchmark(
        "run", "met run two_link.ic --case '#0' --no-picture", "s",
        _prepared("run", "two_link.ic", "--case", "#0", "--no-picture"), Target(1.0),
    ),
)  # fmt: skip
