"""What a hostile review of the firmware and its wire found, mended."""

from __future__ import annotations

import math
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from hw import drivers
from hw.beds import greeting
from hw.boards import build as building
from hw.boards.build import CROSS_COMPILER, Config, build, counted, guard
from hw.ports import Port
from met.diagnostic import Problem
from tests.hw.firmware import wire
from tests.hw.firmware.device import PLAIN, SHAFT, Device
from tests.hw.firmware.line import FREE, PLANT, behind_a_terminal
from tests.hw.firmware.test_faults import WATCHED, Turning
from tests.substitution.hybrid import compiled, deck

# Unsafe outputs


@pytest.mark.compiler
def test_a_load_that_is_cleared_and_driven_again_and_again_takes_no_more_than_it_bears() -> None:
    device = Device()
    device.ready()
    held, squares, ticks = 0, 0, 20_000
    for _ in range(ticks):
        for current in (750, 1500):
            if device.drive(0, current).state != wire.ARMED:
                device.ask(wire.CLEAR)
                device.arm()
                device.drive(0, current)
        for output, counts in device.outputs():
            held = counts if output == "i" else held
        squares += held * held
        device.tick()
        held = 0 if ("i", 0) in device.outputs() else held
    assert math.sqrt(squares / ticks) * 0.002 < 1.05 * PLAIN.continuous_current


@pytest.mark.compiler
def test_a_current_that_flows_between_two_ticks_is_heat() -> None:
    device = Device()
    device.ready()
    for _ in range(20_000):
        for current in (700, 1400, 700, 0):
            device.drive(0, current)
        device.tick()
        device.events()
    assert device.read().faults == wire.HEAT


@pytest.mark.compiler
def test_many_commands_in_one_tick_are_no_way_around_a_slew_limit() -> None:
    device = Device()
    device.ready()
    for voltage in [*range(0, 2001, 400), *range(2000, -2001, -400)]:
        device.drive(voltage, 0)
    assert max(abs(counts) for output, counts in device.outputs() if output == "v") <= 2 * 400


@pytest.mark.compiler
@pytest.mark.parametrize("gap", [3, 8, 14])
@pytest.mark.parametrize("told", [lambda y: 0.0, lambda y: 3.0], ids=["dead", "stuck"])
def test_a_dead_tachometer_is_found_under_a_torque_with_gaps(told: object, gap: int) -> None:
    bed = Turning(told)  # type: ignore[arg-type]
    fastest = 0.0
    for k in range(2000):
        if not bed.tick(20.0 if k % gap else 0.0, 0.0):
            break
        fastest = max(fastest, abs(bed.w))
    assert bed.device.read().faults == wire.DEAD
    assert fastest < 100.0


@pytest.mark.firmware
def test_the_handler_of_faults_needs_nothing_of_the_stack_that_was(tmp_path: Path) -> None:
    if shutil.which(CROSS_COMPILER) is None:
        pytest.skip(f"no {CROSS_COMPILER}; on Debian or Ubuntu: apt-get install gcc-arm-none-eabi")
    words = ["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", str(build("arm", FREE, PLANT))]
    text = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    [body] = re.findall(r"<halt>:\n(.*?)\n\n", text, re.DOTALL)
    assert re.search(r"\bmsr\s+MSP\b", body) and "push" not in body


# Numbers of a bed that are taken, and cannot be


@pytest.mark.parametrize(
    ("name", "value"),
    [("f_cut", math.inf), ("f_cut", -1.0), ("f_cut", 0.0), ("inertia", -6e-5), ("inertia", 0.0), ("f_c", -1.0),
     ("tau_max", -1.0), ("resistance", 0.0), ("kt", math.nan)],
)  # fmt: skip
def test_a_shaft_s_numbers_are_numbers_above_0(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"the shaft's {name} is {value:g}, not a number above 0"):
        guard(replace(WATCHED, shaft=replace(SHAFT, **{name: value})))


def test_no_sum_of_the_guard_leaves_62_bits() -> None:
    """The sum goes on for a lag after it is large enough; what is sure in a tick is less than all torques together."""
    shaft = replace(SHAFT, f_v=0.1, f_cut=0.1)
    config = replace(WATCHED, scales=replace(WATCHED.scales, rate=1e-6), shaft=shaft)
    g, limits = guard(config), counted(config)[0]
    sure = g["most"] + g["current"] * limits["current"] + g["viscous"] * limits["rate"]
    assert g["change"] * 2 ** g["bits"] + sure * (g["lag"] + 2) < 2**62


@pytest.mark.parametrize("change", [{"trip": math.inf}, {"scales": replace(PLAIN.scales, voltage=5e-324)}])
def test_what_cannot_be_counted_is_a_value_error(change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="counts, not 1 to 2147483646"):
        counted(replace(PLAIN, **change))  # type: ignore[arg-type]


@pytest.mark.parametrize("hz", [1750, 3500, 3950])
def test_a_deadman_of_20_ms_is_one_that_the_host_takes(hz: int) -> None:
    config = replace(FREE, tick_hz=1.0 / (1.0 / hz), deadman=0.020)
    assert greeting.DEADMAN[0] <= counted(config)[2] <= greeting.DEADMAN[1]


@pytest.mark.compiler
@pytest.mark.parametrize("value", ["converter_in = 6 rad/s", "converter_current = 10 A", "i_max = 1e6 A"])
def test_a_deck_s_bed_that_firmware_cannot_count_is_said(value: str) -> None:
    experiment = compiled(deck(bed=f"emulated({value})"), "on_bench")
    with pytest.raises(Problem) as caught:
        drivers.opened(Port("firmware"), experiment, "shoulder", 0, 1e-3)
    assert [each.code for each in caught.value.diagnostics] == ["E404"]


# What was built


def told_hash(config: Config) -> str:
    text = (build("library", config, PLANT).parent / "config.c").read_text(encoding="utf-8")
    return next(line for line in text.splitlines() if ".firmware" in line)


@pytest.mark.compiler
def test_another_header_is_another_firmware(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path / "cache"))
    sources = tmp_path / "firmware"
    shutil.copytree(building.FIRMWARE, sources)
    monkeypatch.setattr(building, "FIRMWARE", sources)
    before = told_hash(FREE)
    header = sources / "core" / "frame.h"
    header.write_text(header.read_text(encoding="utf-8").replace("#define FRAME_IN 16u", "#define FRAME_IN 15u"))
    assert told_hash(FREE) != before


@pytest.mark.firmware
def test_another_linker_script_is_built_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if shutil.which(CROSS_COMPILER) is None:
        pytest.skip(f"no {CROSS_COMPILER}; on Debian or Ubuntu: apt-get install gcc-arm-none-eabi")
    monkeypatch.setenv("MET_CACHE_DIR", str(tmp_path / "cache"))
    sources = tmp_path / "firmware"
    shutil.copytree(building.FIRMWARE, sources)
    monkeypatch.setattr(building, "FIRMWARE", sources)
    before = build("arm", FREE, PLANT)
    script = sources / "arm" / "lm3s6965.ld"
    script.write_text(script.read_text(encoding="utf-8").replace("stack_size = 16K", "stack_size = 8K"))
    assert build("arm", FREE, PLANT) != before


# Programs that go on


@pytest.mark.alone
@pytest.mark.parametrize("other", [signal.SIGHUP, signal.SIGUSR1])
def test_bed_host_ends_also_where_it_is_to_boot_as_well(other: signal.Signals) -> None:
    with behind_a_terminal(FREE) as (line, process):
        line.greet()
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.05)
        for each in (other, signal.SIGTERM, signal.SIGCONT):
            process.send_signal(each)
        try:
            ended = process.wait(2.0)
        except subprocess.TimeoutExpired:
            ended = None
        assert ended == 0


@pytest.mark.parametrize("frame", [b"\0", b"\x02\x01\0\x01", b"\x01" * 5 + b"\0"])
def test_a_zero_within_a_frame_is_no_frame(frame: bytes) -> None:
    text = f"from hw.protocol.frames import unframed; print(unframed({frame!r}))"
    try:
        said = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=2.0).stdout
    except subprocess.TimeoutExpired:
        said = "nothing"
    assert said == "None\n"


# What no test held before; these pass


@pytest.mark.compiler
def test_frames_dropped_before_an_arming_are_not_noise_after_it() -> None:
    device = Device()
    for _ in range(3):
        device.ready()
        device.raw(b"\x05\x05\0" * 15)
        assert device.read().state == wire.ARMED


@pytest.mark.compiler
def test_half_a_frame_of_before_a_boot_is_forgotten() -> None:
    device = Device()
    device.raw(wire.frame(wire.READ, 1)[:5])
    device.boot()
    assert device.read().status == wire.DISARMED


@pytest.mark.compiler
def test_the_guard_of_the_tachometer_begins_anew_with_an_arming() -> None:
    ticks = Turning(lambda y: 0.0).until_stopped(4.0, 0.0, 200)
    bed = Turning(lambda y: 0.0)
    for _ in range(3):
        bed.device.ready()
        for _ in range(ticks - 2):
            assert bed.tick(4.0, 0.0)
