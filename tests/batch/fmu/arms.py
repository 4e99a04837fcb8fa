"""Decks of FMUs, and what `met run` makes of their cases."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from batch.fmu.package import Fmu as Packed
from batch.fmu.package import fmu_of
from met import run as engine
from met.plan import Experiment
from tests.batch.fmu.master import Fmu, Instance
from tests.ic.small_decks import experiment

SHORT = """\
#include <two_link.ic>
run brief like nominal {
    duration = 2 s;  remove settle;
    rates { dynamics = 50 Hz;  servos = 200 Hz;  record = 25 Hz; }
    environment { push = wrench { link = lower;  force = [1, 0, 0] N; } }
    record += [links.lower.position];
}
sweep tuned of brief {
    zip {
        links.lower.mass = [15, 20, 25] kg;
        gearbox.kp = [0.01, 0.02, 0.03] V*s/rad;
        shoulder.servo.command.value = [0.1, 0.2, 1.5] rpm;
        environment.push.force.y = [0, 2, -3] N;
    }
}
run silent like brief { record = [];  remove volts; }
sweep seeded of nominal { vary gearbox.kp = [0.01, 0.02] V*s/rad; }
"""
"""Servos that tick between instants of the dynamics, rows further apart than both, and all kinds of variables."""

NAMES = ("links.lower.mass", "gearbox.kp", "shoulder.servo.command.value", "environment.push.force.y")


@cache
def deck(folder: Path, name: str = "tuned", text: str = SHORT) -> Experiment:
    return experiment(folder, text, select=[name])


@cache
def packed(folder: Path, name: str = "tuned", text: str = SHORT, version: int = 3) -> Packed:
    return fmu_of(deck(folder, name, text), version)


def load(packed: Packed, folder: Path, compiler: tuple[str, ...] = ()) -> Fmu:
    """The loaded FMU; without a compiler the test is skipped."""
    if shutil.which("cc") is None:
        pytest.skip("no cc; on Debian or Ubuntu: apt-get install gcc libc6-dev")
    assert packed.platform, packed.why_none
    return Fmu(packed.data, folder / "unpacked", compiler)


def begin_case(instance: Instance, found: Experiment, case: int) -> None:
    """Set the parameters of a case, and initialize."""
    names = [*(each.path for each in found.cases.coordinates), *found.cases.noise]
    for name, value in zip(names, engine.inputs(found, np.array([case]))[0], strict=True):
        assert instance.set(name, value) == 0
    assert instance.enter() == 0 and instance.leave() == 0, instance.messages


def run_rows(found: Experiment, case: int) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """Times [row], recorded numbers [row, column] and metrics of a case, as `met run` has them."""
    run = engine.run(found, [case])
    rows = [run.signals[each.name][0].reshape(len(run.time), -1) for each in found.structure.record]
    return run.time, np.concatenate(rows, axis=1), {name: float(of[0]) for name, of in run.metrics.items()}


def run_sanitized(script: str, packed: Packed, folder: Path, compiler: str) -> None:
    """Run a script that prints `done` with the sanitizers of a compiler, without which the test is skipped. Its
    arguments: the FMU, a folder to unpack it, and the command that compiles its sources."""
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}; on Debian or Ubuntu: apt-get install {compiler}")
    (folder / "arm.fmu").write_bytes(packed.data)
    flags = ("-std=c11", "-ffp-contract=off", "-O1", "-g", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow",
             "-Werror", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")  # fmt: skip
    library = "libasan.so" if compiler == "gcc" else f"libclang_rt.asan-{platform.machine()}.so"
    found = subprocess.run([compiler, f"-print-file-name={library}"], capture_output=True, text=True, check=True)
    if not Path(found.stdout.strip()).is_absolute():
        pytest.skip(f"{compiler} has no {library}")
    shared = ("-shared-libasan",) if compiler == "clang" else ()
    done = subprocess.run(
        [sys.executable, "-c", script, folder / "arm.fmu", folder / "unpacked", compiler, *flags, *shared],
        env={"LD_PRELOAD": found.stdout.strip(), "PYTHONPATH": ":".join(sys.path), "ASAN_OPTIONS": "detect_leaks=0",
             "PATH": "/usr/bin:/bin", "PYTHONMALLOC": "malloc"},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0 and done.stdout == "done\n", done.stderr[-3000:]
