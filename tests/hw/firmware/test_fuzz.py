"""The core under a fuzzer: any bytes, ticks and sensors, with the sanitizers on (fuzz_frames.c says what must hold)."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from hw.bed import Capability
from hw.boards.build import FIRMWARE, WARNINGS, config_c
from hw.boards.interlock import Interlock
from tests.hw.firmware import wire
from tests.hw.firmware.device import HERE, LOCK_STEP, PLAIN, SENSORS, SHAFT
from tests.hw.firmware.test_interlock import LOCK

pytestmark = pytest.mark.slow

SECONDS = int(os.environ.get("MET_FUZZ_SECONDS", "15"))
"""For each of three beds: 45 s together. An hour: MET_FUZZ_SECONDS=1200, with `-o faulthandler_timeout=0`."""

HANGS_SECONDS = 60
"""After which an input is one that never ends."""

FUZZED = ("-g", "-O1", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all")


def seeds() -> list[bytes]:
    """Scripts of fuzz_frames.c that get to where it matters: armed, with outputs, and out again."""

    def ask(kind: int, body: bytes = b"") -> bytes:
        payload = bytes([kind, 0, 0]) + body
        return bytes([0x60 | len(payload)]) + payload

    begun = ask(wire.HELLO, b"\1") + ask(wire.ARM, bytes(4))
    drive, step = (ask(kind, struct.pack("<iiB", 100, -50, last)) for kind, last in ((wire.DRIVE, 0), (wire.STEP, 3)))
    fast = b"\xc0" + struct.pack(">i", 4000) + b"\x80"
    return [
        begun + drive + b"\x85" + drive + ask(wire.STOP),
        begun + step + step + ask(wire.READ) + b"\x9f" + ask(wire.CLEAR),
        begun + fast + drive,
        ask(wire.HELLO, b"\1") + ask(wire.LIMIT, struct.pack("<Bi", 3, 50)) + ask(wire.ARM, bytes(4)) + drive,
        begun + b"\x03\5\5\0" * 16,
        ask(wire.PRESET, bytes([0]) + struct.pack("<d", 1.0)) + ask(wire.PRESET, bytes([9]) + bytes(8)),
        turn_key() + begun + drive + b"\x80" + drive + b"\xc6\0\0\0\x1e" + b"\x80" + ask(wire.CLEAR),
        turn_key() + begun + drive + b"\xc5\0\0\1\0" + b"\x80",
    ]


def turn_key() -> bytes:
    """Of the interlock: off and on, with the lines read back as they are."""
    return b"\xc6\0\0\0\x13\x80\xc6\0\0\0\x1b\x80"


@pytest.fixture(scope="module")
def clang() -> str:
    if shutil.which("clang") is None:
        pytest.skip("no clang, whose libFuzzer this needs; on Debian or Ubuntu: apt-get install clang libclang-rt-dev")
    return "clang"


@pytest.mark.release
@pytest.mark.parametrize(
    ("capabilities", "lock"),
    [(SENSORS, None), (SENSORS | LOCK_STEP, None), (SENSORS, LOCK)],
    ids=["free", "lock-step", "interlock"],
)
def test_nothing_that_comes_over_the_line_breaks_a_bed(
    clang: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    capabilities: Capability,
    lock: Interlock | None,
) -> None:
    bed = replace(PLAIN, capabilities=capabilities, shaft=SHAFT, interlock=lock)
    (tmp_path / "config.c").write_text(config_c(bed, plant=False))
    sources = [*sorted((FIRMWARE / "core").glob("*.c")), HERE / "fuzz_frames.c", tmp_path / "config.c"]
    words = [clang, *WARNINGS, *FUZZED, f"-I{FIRMWARE / 'core'}", *map(str, sources), "-o", str(tmp_path / "fuzz")]
    built = subprocess.run(words, capture_output=True, text=True)
    assert built.returncode == 0, f"{built.stderr}\non Debian or Ubuntu: apt-get install clang libclang-rt-14-dev"
    corpus = tmp_path / "corpus"
    corpus.mkdir()
    for k, seed in enumerate(seeds()):
        (corpus / str(k)).write_bytes(seed)
    words = [str(tmp_path / "fuzz"), f"-max_total_time={SECONDS}", "-max_len=600", "-print_final_stats=1"]
    words += [f"-timeout={HANGS_SECONDS}", str(corpus)]
    # libFuzzer stops at 2 GiB, and Linux counts to a new process what its parent held: a shell between holds little.
    words = ["/bin/sh", "-c", '"$0" "$@"; exit $?', *words]
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, timeout=SECONDS + 4 * HANGS_SECONDS)
    assert done.returncode == 0, done.stderr[-4000:]
    runs = next(line.split()[-1] for line in done.stderr.splitlines() if "number_of_executed_units" in line)
    with capsys.disabled():
        print(f"\nfuzzed: {runs} runs in {SECONDS} s, {len(list(corpus.iterdir()))} kept")
    assert int(runs) > 100 * SECONDS
