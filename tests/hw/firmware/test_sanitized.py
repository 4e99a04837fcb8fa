"""The tests of the core once more, on a core that says so where memory or arithmetic is not what C allows."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.hw.firmware import wire
from tests.hw.firmware.device import SANITIZERS
from tests.hw.firmware.line import STEPPED, behind_a_terminal

HERE = Path(__file__).parent
TESTS = ("test_frames.py", "test_states.py", "test_faults.py", "test_lock_step.py", "test_model.py")


@pytest.mark.slow
def test_the_core_s_tests_pass_with_the_address_and_undefined_behaviour_sanitizers() -> None:
    found = [
        subprocess.run(["gcc", f"-print-file-name={name}"], capture_output=True, text=True).stdout.strip()
        for name in ("libasan.so", "libubsan.so")
    ]
    environment = {
        **os.environ,
        "MET_TEST_SANITIZE": "1",
        "LD_PRELOAD": ":".join(found),
        "ASAN_OPTIONS": "detect_leaks=0",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "CC": "gcc",
    }
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider"]
    words += [str(HERE / each) for each in TESTS]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, cwd=HERE.parents[2], timeout=300)
    assert done.returncode == 0, (done.stdout + done.stderr)[-4000:]
    assert " passed" in done.stdout and "skipped" not in done.stdout


@pytest.mark.release
@pytest.mark.compiler
def test_the_program_runs_with_the_sanitizers() -> None:
    with behind_a_terminal(STEPPED, flags=SANITIZERS) as (line, process):
        assert line.arm().state == wire.ARMED
        for k in range(200):
            assert line.step(5 * k, -k, 1 + k % 5).state == wire.ARMED
        assert line.step(2**31 - 1, -(2**31), 255).state == wire.STOPPED
        os.write(line.handle, bytes(range(1, 256)) * 20 + b"\0")
        line.preset(0, 1e300)
        line.step(0, 0, 255)
        line.preset(0, float("nan"))
        process.terminate()
        assert process.wait(5.0) == 0
