"""The paper's test, and heavier arms, through the firmware: the plant is the deck's own, and no guard speaks up.

The arm runs in met's kernel with its bed outside; what the kernel tells the wire goes through frames to the core, and
the core's samples go back.
"""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hw.bed import Capability, Scales
from hw.boards.build import Config, build
from met.backends.llvm import kernel
from met.plan import Experiment
from met.plant import Plant, plant_c
from met.program import build as build_kernel
from met.run import inputs
from tests.hw.firmware import wire
from tests.hw.firmware.device import Device
from tests.hw.firmware.line import FREE, behind_a_terminal, under_qemu
from tests.substitution.hybrid import REVERSING, compiled, deck, loads

SCALES = Scales(40.0 / 4096, 6.0 / 4096, 800.0 / 4096, 1e-3, 1e-3, 1.0)
"""Those of the emulated bed's converters, faults typical."""

# A rate, a voltage and a current in counts: one tick of the wire.
Exchange = Callable[[int, int], int]


def driven(experiment: Experiment, exchange: Exchange, ticks: int, *, case: int = 0) -> list[tuple[int, int, int]]:
    """Voltage, current and the rate after them, in counts, of each tick of a run that has its bed behind `exchange`."""
    split = build_kernel(experiment, wire=True)
    block = kernel.compile(split).block(np.column_stack([inputs(experiment, np.array([case])), [[0.0]]]))
    told = [split.outputs.index(f"wire:shoulder.{name}") for name in ("voltage", "current")]
    at = split.inputs.index("wire:shoulder.rate")
    found = []
    rate = 0
    for k in range(ticks + 1):
        if k:
            voltage = round(block.outputs.item(told[0], 0) / SCALES.voltage)
            current = round(block.outputs.item(told[1], 0) / SCALES.current)
            rate = exchange(voltage, current)
            found.append((voltage, current, rate))
        block.inputs[at, :] = rate * SCALES.rate
        block.step(k, k)
    return found


def in_process(experiment: Experiment, case: int = 0) -> Exchange:
    plant = Plant(experiment, "shoulder", case=case)
    plant.start(0.0)
    return lambda voltage, current: round(plant.tick(voltage * SCALES.voltage, current * SCALES.current) / SCALES.rate)


def stepped(config: Config, plant: str) -> Exchange:
    """The firmware as a library, by STEP."""
    lib = ctypes.CDLL(str(build("library", config, plant)))
    lib.board_send.restype = ctypes.c_size_t
    lib.board_boot(0)
    out, number = ctypes.create_string_buffer(1024), 0

    def ask(kind: int, body: bytes) -> bytes:
        nonlocal number
        number = (number + 1) & 0xFFFF
        line = wire.frame(kind, number, body)
        lib.board_receive(line, ctypes.c_size_t(len(line)))
        count = lib.board_send(out, ctypes.c_size_t(1024))
        return out.raw[:count]

    hello = wire.told(wire.payloads(ask(wire.HELLO, b"\1"))[0])
    assert isinstance(hello, wire.Hello)
    ask(wire.ARM, struct.pack("<I", hello.session))

    def exchange(voltage: int, current: int) -> int:
        [payload] = wire.payloads(ask(wire.STEP, struct.pack("<iiB", voltage, current, 1)))
        found = wire.told(payload)
        assert isinstance(found, wire.Sample)
        assert found.status == wire.ARMED | wire.GREETED
        return found.rate

    return exchange


def lock_step(hz: float) -> Config:
    return replace(FREE, tick_hz=hz, scales=SCALES, capabilities=Capability.ENCODER | Capability.LOCK_STEP)


@pytest.mark.compiler
@pytest.mark.parametrize("faults", ["none", "typical"])
def test_20_s_of_the_paper_s_test_over_the_wire_are_those_of_the_plant_in_process(faults: str) -> None:
    experiment = compiled(deck(bed=f"emulated(faults = {faults})", duration=20.0), "on_bench")
    plant = plant_c(experiment, "shoulder")
    here = driven(experiment, in_process(experiment), 20000)
    over_the_wire = driven(experiment, stepped(lock_step(1000.0), plant), 20000)
    assert over_the_wire == here
    assert max(rate for _, _, rate in here) * SCALES.rate == pytest.approx(0.03 * 1570.0, rel=0.15)


@pytest.mark.firmware
def test_so_they_are_from_a_cortex_m3(tmp_path: Path) -> None:
    """3 s, by the emulator's pace."""
    experiment = compiled(deck(bed="emulated(faults = typical)", duration=20.0), "on_bench")
    plant = plant_c(experiment, "shoulder")
    here = driven(experiment, in_process(experiment), 3000)
    with under_qemu(lock_step(1000.0), tmp_path, plant=plant) as line:
        line.arm()
        assert driven(experiment, lambda voltage, current: line.step(voltage, current).rate, 3000) == here


@pytest.mark.compiler
def test_behind_a_terminal_too() -> None:
    experiment = compiled(deck(bed="emulated(faults = typical)", duration=20.0), "on_bench")
    plant = plant_c(experiment, "shoulder")
    here = driven(experiment, in_process(experiment), 1000)
    with behind_a_terminal(lock_step(1000.0), plant=plant) as (line, _):
        line.arm()
        assert driven(experiment, lambda voltage, current: line.step(voltage, current).rate, 1000) == here


@pytest.mark.release
@pytest.mark.compiler
@pytest.mark.parametrize(
    ("law", "command"),
    [
        ("velocity_tracking", REVERSING),
        ("torque_balance_observer", REVERSING),
        ("torque_balance", "slow"),
        ("bare", REVERSING),
        ("velocity_tracking", "0 * slow"),
    ],
)
@pytest.mark.parametrize("faults", ["none", "typical"])
def test_no_guard_speaks_up_in_a_run_however_heavy_the_arm(law: str, command: str, faults: str) -> None:
    """r of 0.5, 1.5, 5 and 20; 1 kHz; starts, reversals, and standing still."""
    bed, heavy = f"emulated(faults = {faults})", loads((0.5, 1.5, 5.0, 20.0))
    text = deck(bed=bed, law=law, command=command, duration=5.0, swept=heavy)
    experiment = compiled(text, "bench")
    config = replace(FREE, scales=SCALES, capabilities=Capability(0))
    for case in range(4):
        plant, device = in_process(experiment, case), Device(config)
        device.ready()

        def exchange(voltage: int, current: int, plant: Exchange = plant, device: Device = device) -> int:
            sample = device.drive(voltage, current)
            assert sample.status == wire.ARMED | wire.GREETED, sample
            device.sensors.rate = plant(voltage, current)
            device.tick()
            device.events()
            return device.sensors.rate

        driven(experiment, exchange, 4000, case=case)


@pytest.mark.release
@pytest.mark.compiler
@pytest.mark.parametrize(("sign", "fault"), [(0, wire.DEAD), (-1, wire.REVERSED)])
@pytest.mark.parametrize("law", ["velocity_tracking", "torque_balance_observer"])
def test_a_wrong_tachometer_is_found_in_the_loop_before_the_shaft_is_fast(law: str, sign: int, fault: int) -> None:
    """r of 0.5 to 20, at most a third of the rate's limit; laws that believe the tachometer (README of hw/firmware)."""
    text = deck(bed="emulated(faults = typical)", law=law, duration=5.0, swept=loads((0.5, 1.5, 5.0, 20.0)))
    experiment = compiled(text, "bench")
    for case in range(4):
        plant, device = Plant(experiment, "shoulder", case=case), Device(replace(FREE, scales=SCALES))
        plant.start(0.0)
        device.ready()

        def exchange(voltage: int, current: int, plant: Plant = plant, device: Device = device) -> int:
            if device.drive(voltage, current).state == wire.ARMED:
                rate = plant.tick(voltage * SCALES.voltage, current * SCALES.current)
                device.sensors.rate = sign * round(rate / SCALES.rate)
                device.tick()
                device.events()
            return device.sensors.rate

        driven(experiment, exchange, 2000, case=case)
        assert device.read().faults == fault
        assert abs(plant.shaft_rate) < 120.0
