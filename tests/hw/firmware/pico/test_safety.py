"""What stops a bench, by the image as it is flashed: inputs, sensors, clocks, memory, and how long each takes.

Times are the emulator's, from the event to the pins, and printed: docs/pico.md has them.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from hw.bed import BedState, Capability, Fault, InterlockReason
from hw.boards.pico import pico_image
from hw.boards.pico_bench import SHIPPED, PicoBench, pico_bench
from tests.hw.firmware.pico.emulated import (
    BRAKE_RELEASE,
    DRIVE_ENABLE,
    LED,
    LOAD_ENABLE,
    PULSE,
    STACK_TOP,
    Emulator,
    PicoBed,
    skip_without_tools,
)

pytestmark = [pytest.mark.firmware, pytest.mark.node]

LINES = LOAD_ENABLE | DRIVE_ENABLE | BRAKE_RELEASE


@pytest.fixture(scope="module", autouse=True)
def tools() -> None:
    skip_without_tools()


def cool(bench: PicoBench) -> PicoBench:
    """With motors that are never hot, so that no test waits for them."""
    lock = bench.config.interlock
    assert lock is not None
    config = replace(bench.config, continuous_current=10.0, interlock=replace(lock, drive_continuous=10.0))
    return replace(bench, config=config)


@pytest.fixture
def emulator() -> Iterator[Emulator]:
    with Emulator(pico_image(cool(pico_bench())), motor=True) as emulator:
        emulator.sleep(0.15)
        yield emulator


def turn_key(emulator: Emulator) -> None:
    emulator.bench(key=False)
    emulator.sleep(2e-3)
    emulator.bench(key=True)
    emulator.sleep(2e-3)


@pytest.fixture
def bed(emulator: Emulator) -> Iterator[PicoBed]:
    """Greeted and armed, its key turned, its shaft turning."""
    turn_key(emulator)
    with PicoBed(emulator, 1e-3) as bed:
        about = bed.connect()
        assert about.capabilities & Capability.INTERLOCK
        bed.arm()
        for _ in range(60):
            emulator.sleep(1e-3)
            sample = bed.exchange(3.0, 0.3)
        assert sample is not None and sample.state == BedState.ARMED and sample.rate > 10.0, sample
        assert emulator.told["pins"] & LINES == LINES and emulator.told["level"] != [0, 0, 0, 0]
        yield bed


def off_after(bed: PicoBed, most: float, *, driven: bool = True) -> float:
    """Time until all commands are 0 and the load's amplifier is off, s; commanded on meanwhile."""
    emulator, step, passed = bed.emulator, 0.1e-3, 0.0
    begun = emulator.ask("sleep", us=0)["now"]
    while passed < most:
        for _ in range(10):
            told = emulator.ask("sleep", us=step * 1e6)
            if told["level"] == [0, 0, 0, 0] and not told["pins"] & LOAD_ENABLE:
                return float(told["now"] - begun) * 1e-6
        if driven:
            bed.exchange(3.0, 0.3)
        passed = float(emulator.told["now"] - begun) * 1e-6
    raise AssertionError(f"not off after {most} s: {emulator.told}")


CASES: list[tuple[str, dict[str, Any], InterlockReason, float]] = [
    ("emergency stop's contact opens", {"stop": False}, InterlockReason.STOP, 1.2e-3),
    ("an amplifier is not ready", {"ready": False}, InterlockReason.READY, 1.2e-3),
    ("the key is turned off", {"key": False}, InterlockReason.KEY, 1.2e-3),
    ("the enable is not read back", {"enabled": False}, InterlockReason.READ_BACK, 1.2e-3),
    ("the drive's winding is too warm", {"temperature": 500}, InterlockReason.TEMPERATURE, 4.2e-3),
    ("the thermistor's wire is off", {"temperature": 4095}, InterlockReason.TEMPERATURE, 4.2e-3),
    ("the supply's voltage is too high", {"bus": 2000}, InterlockReason.BUS, 4.2e-3),
    ("the supply's voltage is too low", {"bus": 1000}, InterlockReason.BUS, 4.2e-3),
    ("the converter's reference is off", {"reference": 2100}, InterlockReason.CONVERTER, 4.2e-3),
    ("the load's current is not what it is told", {"adc": {"load": 2600}}, InterlockReason.LOAD, 22e-3),
    ("the encoder stands still", {"encoder": False}, InterlockReason.ENCODER, 0.14),
]


@pytest.mark.release
@pytest.mark.parametrize(("change", "reason", "most"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_what_goes_wrong_stops_the_bench_in_time_and_is_told(
    bed: PicoBed, change: dict[str, Any], reason: InterlockReason, most: float, capsys: pytest.CaptureFixture[str]
) -> None:
    bed.emulator.bench(**change)
    passed = off_after(bed, most + 2e-3)
    with capsys.disabled():
        print(f"\noff after {1e3 * passed:.1f} ms: {reason.name}")
    assert passed <= most
    sample = bed.read()
    assert (sample.state, sample.faults) == (BedState.STOPPED, Fault.INTERLOCK)
    assert sample.interlock is not None and reason in sample.interlock


@pytest.mark.parametrize(
    ("change", "fault", "most"),
    [
        ({"turned": 380.0}, Fault.RATE, 12e-3),
        ({"adc": {"rate": 4095}}, Fault.RATE, 1.2e-3),
        ({"adc": {"drive": 3000}}, Fault.CURRENT, 1.2e-3),
        ({"adc": {"load": 2800}}, Fault.CURRENT, 1.2e-3),
    ],
    ids=["the shaft is too fast", "the tachometer's wire is off", "the drive's current", "the load's current"],
)
def test_overspeed_and_currents_need_no_host(
    bed: PicoBed, change: dict[str, Any], fault: Fault, most: float, capsys: pytest.CaptureFixture[str]
) -> None:
    bed.emulator.bench(**change)
    passed = off_after(bed, most + 2e-3)
    with capsys.disabled():
        print(f"\noff after {1e3 * passed:.1f} ms: {fault.name}")
    assert passed <= most
    assert bed.read().faults & fault


def test_a_tachometer_that_stands_still_is_found_by_torque_or_by_the_encoder(
    bed: PicoBed, capsys: pytest.CaptureFixture[str]
) -> None:
    bed.emulator.bench(tachometer=False)
    passed = off_after(bed, 0.14)
    with capsys.disabled():
        print(f"\noff after {1e3 * passed:.1f} ms: {bed.read().faults!r}")
    assert bed.read().faults in (Fault.TACHOMETER_DEAD, Fault.INTERLOCK, Fault.TACHOMETER_DEAD | Fault.INTERLOCK)


def test_silence_stops_it_within_the_deadman_and_a_tick(bed: PicoBed, capsys: pytest.CaptureFixture[str]) -> None:
    passed = off_after(bed, 20e-3, driven=False)
    with capsys.disabled():
        print(f"\noff after {1e3 * passed:.1f} ms: DEADMAN")
    assert 13e-3 < passed <= 15.2e-3
    assert bed.read().faults == Fault.DEADMAN


def test_the_drive_holds_0_v_until_the_shaft_is_slow_and_then_the_brake_closes(bed: PicoBed) -> None:
    bed.stop()
    lines = []
    for _ in range(200):
        told = bed.emulator.sleep(2e-3)
        lines.append((told["pins"] & LINES, abs(told["rate"])))
    held = [rate for on, rate in lines if on == DRIVE_ENABLE | BRAKE_RELEASE]
    assert held and lines[-1][0] == 0 and {on for on, _ in lines} == {0, DRIVE_ENABLE | BRAKE_RELEASE}
    closed = next(rate for on, rate in lines if on == 0)
    assert closed < 3.0


def test_the_pulse_changes_with_each_tick_and_not_without(bed: PicoBed) -> None:
    levels = [bed.emulator.sleep(1e-3)["pins"] & PULSE for _ in range(8)]
    assert all(a != b for a, b in pairwise(levels))


def test_a_processor_that_hangs_is_reset_and_the_next_session_is_told(
    bed: PicoBed, capsys: pytest.CaptureFixture[str]
) -> None:
    emulator = bed.emulator
    begun = emulator.told["now"]
    emulator.ask("hang")
    while emulator.ask("sleep", us=100)["resets"] == 0:
        assert emulator.told["now"] - begun < 10e3
    assert emulator.told["enables"] == 0  # all pins are inputs, which resistors pull down
    with capsys.disabled():
        print(f"\nreset after {1e-3 * (emulator.told['now'] - begun):.1f} ms without a tick")
    emulator.sleep(0.15)
    about = bed.connect()
    sample = bed.read()
    assert about.capabilities & Capability.WATCHDOG and sample.faults == Fault.WATCHDOG
    assert emulator.told["level"] == [0, 0, 0, 0] and emulator.told["pins"] & LINES == 0


def test_a_change_of_both_wires_of_the_encoder_at_once_stops_it(bed: PicoBed) -> None:
    bed.emulator.ask("glitch")
    assert off_after(bed, 2e-3) <= 1.2e-3
    assert bed.read().interlock == InterlockReason.ENCODER


def test_a_reset_by_the_rom_after_flashing_is_none_by_the_watchdog() -> None:
    flash = pico_image(pico_bench())
    with Emulator(flash, motor=True) as emulator:
        emulator.ask("boot", flash=flash.hex(), by_watchdog=True, stack=STACK_TOP)
        emulator.sleep(0.15)
        with PicoBed(emulator, 1e-3) as bed:
            bed.connect()
            assert bed.read().faults == Fault(0)


def test_an_encoder_counts_both_ways(emulator: Emulator) -> None:
    with PicoBed(emulator, 1e-3) as bed:
        bed.connect()
        for way in (1.0, -1.0, 1.0):
            before = bed.read().angle
            emulator.bench(turned=way * 40.0)
            emulator.sleep(0.05)
            emulator.bench(turned=0.0)
            emulator.sleep(2e-3)
            after = bed.read().angle
            assert before is not None and after is not None
            assert after - before == pytest.approx(way * 2.0, abs=0.02)
            assert after == pytest.approx(emulator.told["angle"], abs=0.004)


@pytest.mark.release
@pytest.mark.parametrize("rate", [40.0, -40.0])
def test_without_a_tachometer_the_rate_is_the_encoder_s(tmp_path: Path, rate: float) -> None:
    lines = SHIPPED.read_text(encoding="utf-8").splitlines()
    path = tmp_path / "bench.toml"
    path.write_text("\n".join(line for line in lines if not line.startswith("rate_range")), encoding="utf-8")
    bench = pico_bench(path)
    with Emulator(pico_image(bench), motor=True, turned=rate, tachometer=False) as emulator:
        emulator.sleep(0.15)
        with PicoBed(emulator, 1e-3) as bed:
            bed.connect()
            assert bed.read().rate == pytest.approx(rate, abs=bench.config.scales.rate)


# Boot


def damaged(flash: bytes, at: int) -> bytes:
    return flash[:at] + bytes([flash[at] ^ 0x10]) + flash[at + 1 :]


@pytest.mark.release
@pytest.mark.parametrize("at", [0x10C, 0x140, 0x400, 0x1000, -1])
def test_an_image_with_a_bit_that_changed_drives_no_pin(at: int) -> None:
    flash = pico_image(pico_bench())
    with Emulator(damaged(flash, at % len(flash)), motor=True) as emulator:
        told = emulator.sleep(0.3)
        assert told["enables"] == 0 and told["deepest"] == 0


@pytest.mark.release
@pytest.mark.parametrize("at", [0x20000000, 0x20001FFC, 0x20002800])
def test_ram_with_a_bit_that_sticks_drives_no_pin(at: int) -> None:
    with Emulator(pico_image(pico_bench()), motor=True, stuck=[at, 8]) as emulator:
        told = emulator.sleep(0.3)
        assert told["enables"] == 0 and told["deepest"] == 0


def test_it_is_up_in_time_and_says_so_by_its_light() -> None:
    with Emulator(pico_image(pico_bench()), motor=True) as emulator:
        while not emulator.sleep(1e-3)["pins"] & LED:
            assert emulator.told["now"] < 0.2e6 and emulator.told["pins"] & LINES == 0


def test_from_power_on_it_does_not_arm_without_a_key(emulator: Emulator) -> None:
    with PicoBed(emulator, 1e-3) as bed:
        bed.connect()
        assert bed.read().interlock == InterlockReason.KEY
        turn_key(emulator)
        assert bed.arm().state == BedState.ARMED


# Time and stack


def test_the_longest_path_of_a_tick_and_of_the_line(bed: PicoBed, capsys: pytest.CaptureFixture[str]) -> None:
    """Instructions and cycles from an interrupt's first to its last; the program runs from RAM, without wait states."""
    emulator = bed.emulator
    emulator.ask("spans")
    for k in range(100):
        emulator.sleep(1e-3)
        bed.exchange(3.0 * math.sin(0.3 * k), 0.3)
    bed.connect()  # HELLO
    emulator.bench(stop=False, ready=False, temperature=4095, bus=0)
    emulator.sleep(5e-3)
    emulator.ask("bytes", data=(b"\xff" * 40 + struct.pack("<5B", 1, 2, 3, 4, 0)).hex())
    spans = emulator.sleep(5e-3)["spans"]
    with capsys.disabled():
        print(f"\ntick: {spans['15']}, line: {spans['36']} (instructions, cycles); stack {emulator.told['deepest']}")
    assert spans["15"][1] < 6000 and spans["36"][1] < 60000
    assert emulator.told["deepest"] < 2048
