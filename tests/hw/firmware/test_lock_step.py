"""A device in lock-step: time is what STEP says, and it passes in every state."""

from __future__ import annotations

import struct
from dataclasses import replace

import pytest

from tests.hw.firmware import wire
from tests.hw.firmware.device import LOCK_STEP, PLAIN, Device

pytestmark = pytest.mark.compiler

SAFE = [("i", 0), ("v", 0)]
TICK = [("a", 0), ("k", 0)]


@pytest.fixture
def device() -> Device:
    return Device(replace(PLAIN, capabilities=LOCK_STEP))


def test_a_step_sets_the_outputs_and_then_advances_the_plant_tick_by_tick(device: Device) -> None:
    device.ready()
    sample = device.step(100, 50, 3)
    assert device.events() == [("i", 50), ("v", 100), *TICK * 3]
    assert (sample.state, sample.tick) == (wire.ARMED, 3)


def test_the_answer_is_the_sample_at_the_end(device: Device) -> None:
    device.ready()
    device.sensors.rate = 33
    assert device.step(100, 50, 2).rate == 33


def test_no_time_passes_but_in_a_step(device: Device) -> None:
    device.ready()
    for _ in range(100):
        device.read()
    device.limit(0, 1)
    assert device.read().tick == 0
    assert device.events() == []


def test_steps_are_fed_by_steps(device: Device) -> None:
    device.ready()
    for _ in range(50):
        assert device.step(100, 50, 14).state == wire.ARMED


def test_the_deadman_stops_within_a_long_step(device: Device) -> None:
    device.ready()
    sample = device.step(100, 50, 255)
    assert (sample.tick, sample.status) == (255, wire.STOPPED | wire.GREETED | wire.DEADMAN)
    events = device.events()
    assert events[: 2 + 29] == [("i", 50), ("v", 100), *TICK * 14, ("a", 0)]
    assert events[31:] == [*SAFE, ("k", 0), *[("a", 0), *SAFE, ("k", 0)] * 240]


def test_slew_is_over_the_ticks_of_the_step_before(device: Device) -> None:
    device.ready()
    device.step(400, 0, 2)
    device.step(1200, 0, 1)
    assert device.step(1601, 0, 1).faults == wire.SLEW


def test_the_ticks_of_a_step_that_stops_pass_under_the_safe_outputs(device: Device) -> None:
    device.ready()
    sample = device.step(2001, 50, 2)
    assert (sample.status, sample.tick) == (wire.STOPPED | wire.GREETED | wire.RANGE | wire.SLEW, 2)
    assert device.events() == [*SAFE, *[("a", 0), *SAFE, ("k", 0)] * 2]


def test_a_step_that_is_refused_lets_time_pass_so_that_a_shaft_comes_to_rest(device: Device) -> None:
    device.greet()
    device.events()
    assert device.step(100, 50, 2).status == wire.DISARMED | wire.GREETED | wire.REFUSED
    assert device.events() == [("a", 0), *SAFE, ("k", 0)] * 2
    device.arm()
    device.sensors.rate = 4000
    assert device.step(100, 50).faults == wire.RATE
    assert device.ask(wire.CLEAR).refused
    device.sensors.rate = 20
    assert device.step(0, 0, 9).refused
    assert device.ask(wire.CLEAR).state == wire.DISARMED


def test_a_step_that_is_not_new_lets_no_time_pass(device: Device) -> None:
    device.ready()
    device.step(100, 50, 2)
    device.events()
    again = device.ask(wire.STEP, struct.pack("<iiB", 100, 50, 2), device.number)
    assert (again.tick, again.refused, device.events()) == (2, False, [])


# PRESET


def preset(device: Device, which: int, bits: bytes = struct.pack("<d", 1.5)) -> wire.Sample:
    found: wire.Sample = device.ask(wire.PRESET, bytes([which]) + bits)
    return found


def test_a_preset_goes_to_the_plant_and_the_sample_is_of_after_it(device: Device) -> None:
    device.sensors.rate = 12
    assert preset(device, 0).rate == 12
    assert [event for event in device.events() if event[0] == "p"] == [("p", 0)]


def test_what_the_plant_does_not_take_is_refused(device: Device) -> None:
    assert preset(device, 3).refused
    assert preset(device, 0, b"\xff" * 8).refused
    assert not preset(device, 2).refused


def test_a_preset_is_for_a_disarmed_device(device: Device) -> None:
    device.ready()
    assert preset(device, 0).status == wire.ARMED | wire.GREETED | wire.REFUSED
    device.step(100, 50, 15)
    assert preset(device, 0).status == wire.STOPPED | wire.GREETED | wire.DEADMAN | wire.REFUSED
    assert [event for event in device.events() if event[0] == "p"] == []
