"""The firmware built for a Cortex-M3 and run by QEMU: it answers, and in lock-step it is what the host's build is."""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from hw.boards.build import CROSS_COMPILER, EMULATOR, build
from met.plant import plant_c
from tests.hw.firmware import wire
from tests.hw.firmware.line import FREE, STEPPED, Line, behind_a_terminal, under_qemu
from tests.substitution.hybrid import compiled, deck

pytestmark = [pytest.mark.firmware, pytest.mark.alone]


@pytest.fixture(scope="module", autouse=True)
def tools() -> None:
    packages = {CROSS_COMPILER: "gcc-arm-none-eabi", EMULATOR: "qemu-system-arm"}
    missing = [name for name in packages if shutil.which(name) is None]
    if missing:
        pytest.skip(
            f"no {' and no '.join(missing)}; on Debian or Ubuntu: "
            f"apt-get install {' '.join(packages[name] for name in missing)}"
        )


def moved(line: Line, steps: int) -> list[wire.Sample]:
    """Samples under commands that wander."""
    found, rng = [line.arm()], random.Random(7)
    voltage = current = 0
    for k in range(steps):
        voltage = int(0.97 * max(-1500, min(1500, voltage + rng.randint(-300, 300))))
        current = max(-600, min(600, current + rng.randint(-80, 80)))
        found.append(line.step(voltage, current, 1 + k % 3))
    return found


def test_in_lock_step_it_has_the_bits_of_the_build_for_this_machine(tmp_path: Path) -> None:
    with behind_a_terminal(STEPPED) as (line, _):
        here = moved(line, 1000)
    with under_qemu(STEPPED, tmp_path) as line:
        there = moved(line, 1000)
    assert [each.state for each in there] == [wire.ARMED] * 1001
    assert there == here
    assert max(abs(each.rate) for each in there) > 100


def test_hello_is_the_same_but_for_session_and_firmware(tmp_path: Path) -> None:
    with behind_a_terminal(FREE) as (line, _):
        here = line.greet()
    with under_qemu(FREE, tmp_path) as line:
        there = line.greet()
    assert there.firmware != here.firmware  # another board's sources
    assert {**vars(there), "session": 0, "firmware": b""} == {**vars(here), "session": 0, "firmware": b""}


def test_free_running_it_ticks_by_its_own_clock_and_the_deadman_stops_it(tmp_path: Path) -> None:
    with under_qemu(FREE, tmp_path) as line:
        shares = []
        for _ in range(10):  # an emulator that has to wait loses ticks
            first, begun = line.ask(wire.READ).tick, time.monotonic()
            time.sleep(0.5)
            ticks, passed = line.ask(wire.READ).tick - first, time.monotonic() - begun
            shares.append(1e-3 * ticks / passed)
            if shares[-1] > 0.9:
                break
        assert shares[-1] > 0.9 and max(shares) < 1.1, shares
        assert line.arm().state == wire.ARMED
        armed = line.drive(100, 50)
        time.sleep(0.3)
        sample = line.ask(wire.READ)
        assert (sample.faults, sample.state) == (wire.DEADMAN, wire.STOPPED)
        assert sample.tick > armed.tick + 15


def test_a_session_is_another_number_after_each_boot(tmp_path: Path) -> None:
    sessions = []
    for k in range(3):
        (tmp_path / str(k)).mkdir()
        with under_qemu(STEPPED, tmp_path / str(k)) as line:
            sessions.append(line.greet().session)
    assert len(set(sessions)) == 3


def test_a_flood_of_garbage_does_not_hold_up_the_deadman(tmp_path: Path) -> None:
    with under_qemu(FREE, tmp_path) as line:
        line.arm()
        begun = line.drive(100, 50).tick
        for _ in range(40):
            os.write(line.handle, b"\x55" * 2000)
        os.write(line.handle, b"\0")
        sample = line.ask(wire.READ)
        assert sample.faults & (wire.DEADMAN | wire.NOISE)
        assert sample.tick >= begun


def stack(folder: Path, entries: dict[str, int]) -> int:
    """Bytes of the deepest chain of calls from each of these functions, together, with what an interrupt pushes.

    From gcc's -fcallgraph-info=su: nodes with their own bytes, edges between them; what is not in them (libgcc) counts
    as 64. The core calls through a pointer what is in a plant's or an interlock's port alone.
    """
    called = (":advance", ":preset", ":read_inputs", ":set_lines")
    own: dict[str, int] = {}
    calls: dict[str, set[str]] = {}
    for path in folder.glob("*.ci"):
        text = path.read_text(encoding="utf-8")
        for name, label in re.findall(r'node: \{ title: "([^"]+)" label: "([^"]*)"', text):
            size = re.search(r"(\d+) bytes", label)
            own[name] = max(own.get(name, 0), int(size[1]) if size else 64)
        for caller, callee in re.findall(r'sourcename: "([^"]+)" targetname: "([^"]+)"', text):
            calls.setdefault(caller, set()).add(callee)

    def deepest(name: str, above: tuple[str, ...]) -> int:
        assert name not in above, f"recursion: {above}"
        if name == "__indirect_call":
            return max(deepest(each, above) for each in own if each.endswith(called))
        return own.get(name, 64) + max((deepest(each, (*above, name)) for each in calls.get(name, ())), default=0)

    return sum(deepest(name, ()) + pushed for name, pushed in entries.items())


def test_it_fits_the_board_and_recurses_nowhere(capsys: pytest.CaptureFixture[str]) -> None:
    """With a deck's plant, all faults on."""
    plant = plant_c(compiled(deck(bed="emulated(faults = typical)"), "on_bench"), "shoulder")
    elf = build("arm", FREE, plant, flags=("-fcallgraph-info=su",))
    done = subprocess.run(["arm-none-eabi-size", elf], capture_output=True, text=True, check=True)
    text, data, bss = (int(word) for word in done.stdout.splitlines()[1].split()[:3])
    depth = stack(elf.parent, {"lm3s6965_main": 0, "lm3s6965_line": 32, "lm3s6965_timer": 32})
    with capsys.disabled():
        print(f"\nARM: text {text}, data {data}, bss {bss} of which stack 16384, stack used at most {depth} bytes")
    assert text < 32 * 1024 and data + bss < 20 * 1024
    assert 500 < depth < 8192
