"""The table of states, each line on what the amplifiers are told: in order, the load's current (i) and the drive's
voltage (v), in counts."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.hw.firmware import wire
from tests.hw.firmware.device import Device

pytestmark = pytest.mark.compiler

SAFE = [("i", 0), ("v", 0)]


@pytest.fixture
def device() -> Device:
    return Device()


@pytest.fixture
def driving(device: Device) -> Device:
    """Armed, with 1 V and 0.1 A out."""
    device.ready()
    device.drive(100, 50)
    assert device.outputs() == [("i", 50), ("v", 100)]
    return device


def test_the_safe_state_is_the_first_thing_that_a_boot_does(device: Device) -> None:
    assert device.events() == SAFE
    assert device.read().status == wire.DISARMED


def test_the_safe_state_is_written_again_at_each_tick_that_is_not_armed(device: Device) -> None:
    device.tick(2)
    assert device.events() == SAFE + [*SAFE, ("k", 0)] * 2


def test_the_watchdog_is_kicked_once_a_tick_and_at_its_end(driving: Device) -> None:
    driving.tick(3)
    assert driving.events() == [("k", 0)] * 3
    driving.tick(20)
    events = driving.events()
    assert [event for event in events if event[0] == "k"] == [("k", 0)] * 20
    assert events[-3:] == [*SAFE, ("k", 0)]


def test_armed_is_zero_commands_until_one_comes(device: Device) -> None:
    device.greet()
    device.events()
    assert device.arm().status == wire.ARMED | wire.GREETED
    assert device.outputs() == SAFE
    device.tick(5)
    assert device.outputs() == []


def test_commands_reach_the_outputs_as_they_are_and_are_held(device: Device) -> None:
    device.ready()
    for voltage, current in ((100, -50), (-300, 700), (0, 0), (1, -1)):
        device.drive(voltage, current)
        device.tick(3)
        assert device.outputs() == [("i", current), ("v", voltage)]


# Arming


def test_it_arms_only_after_hello(device: Device) -> None:
    sample = device.arm()
    assert (sample.status, device.arm(0).status) == (wire.DISARMED | wire.REFUSED, wire.DISARMED | wire.REFUSED)
    device.drive(100, 50)
    assert set(device.outputs()) == set(SAFE)


def test_it_arms_only_by_this_session_s_number(device: Device) -> None:
    device.greet()
    for wrong in (0, 0xC0FFEF, 0xEEFFC000):
        assert device.arm(wrong).status == wire.DISARMED | wire.GREETED | wire.REFUSED
    assert device.arm().state == wire.ARMED


@pytest.mark.parametrize(
    ("rate", "arms"), [(20, True), (-20, True), (21, False), (-21, False), (-(2**31), False), (2**31 - 1, False)]
)
def test_it_arms_only_while_the_shaft_is_slow(device: Device, rate: int, arms: bool) -> None:
    device.greet()
    device.sensors.rate = rate
    device.tick()
    sample = device.arm()
    assert (sample.state == wire.ARMED, sample.refused) == (arms, not arms)
    device.drive(100, 50)
    assert (("v", 100) in device.outputs()) == arms


def test_arming_again_is_refused_and_feeds_no_deadman(driving: Device) -> None:
    driving.tick(10)
    assert driving.arm().status == wire.ARMED | wire.GREETED | wire.REFUSED
    assert driving.outputs() == []
    driving.tick(5)
    assert driving.outputs() == SAFE


def test_a_session_of_before_a_reboot_does_not_arm(driving: Device) -> None:
    driving.boot(session=0xBEEF)
    driving.greet()
    assert driving.arm(0xC0FFEE).refused
    driving.drive(100, 50)
    assert set(driving.outputs()) == set(SAFE)


# Disarmed and stopped take no commands


def test_nothing_reaches_an_output_while_disarmed(device: Device) -> None:
    device.greet()
    device.events()
    assert device.drive(100, 50).status == wire.DISARMED | wire.GREETED | wire.REFUSED
    assert device.drive(10**6, -(10**6)).faults == 0
    assert device.outputs() == []


def stopped(device: Device) -> None:
    device.tick(15)
    assert device.read().status == wire.STOPPED | wire.GREETED | wire.DEADMAN
    device.events()


def test_nothing_reaches_an_output_while_stopped(driving: Device) -> None:
    stopped(driving)
    sample = driving.drive(100, 50)
    assert sample.status == wire.STOPPED | wire.GREETED | wire.DEADMAN | wire.REFUSED
    assert driving.arm().refused
    driving.drive(100, 50)
    assert driving.outputs() == []


def test_clear_and_only_then_arm_lets_commands_through_again(driving: Device) -> None:
    stopped(driving)
    assert driving.ask(wire.CLEAR).status == wire.DISARMED | wire.GREETED
    assert driving.drive(100, 50).refused
    assert driving.arm().state == wire.ARMED
    driving.drive(100, 50)
    assert driving.outputs()[-2:] == [("i", 50), ("v", 100)]


@pytest.mark.parametrize(("rate", "clears"), [(20, True), (21, False), (-21, False)])
def test_clear_waits_for_the_shaft(driving: Device, rate: int, clears: bool) -> None:
    stopped(driving)
    driving.sensors.rate = rate
    driving.tick()
    sample = driving.ask(wire.CLEAR)
    assert (sample.state, sample.refused) == ((wire.DISARMED, False) if clears else (wire.STOPPED, True))
    assert (sample.faults == 0) == clears


def test_clear_of_nothing_changes_nothing(device: Device) -> None:
    assert device.ask(wire.CLEAR).status == wire.DISARMED


def test_clear_is_refused_while_armed(driving: Device) -> None:
    assert driving.ask(wire.CLEAR).status == wire.ARMED | wire.GREETED | wire.REFUSED
    assert driving.outputs() == []


def test_a_drive_acts_before_the_next_tick_and_is_answered_with_the_last() -> None:
    device = Device()
    device.ready()
    device.tick(3)
    device.events()
    device.sensors.rate = 77
    sample = device.drive(100, 50)
    assert device.outputs() == [("i", 50), ("v", 100)]
    assert (sample.tick, sample.rate, sample.state) == (3, 0, wire.ARMED)
    device.tick()
    assert (device.read().tick, device.read().rate) == (4, 77)
    assert device.drive(2001, 50).state == wire.STOPPED  # as it is after the frame


# Ways out of armed


@pytest.mark.parametrize("leave", [lambda d: d.ask(wire.STOP), lambda d: d.greet()], ids=["stop", "hello"])
def test_stop_and_hello_disarm_at_once(driving: Device, leave: Callable[[Device], object]) -> None:
    leave(driving)
    assert driving.outputs() == SAFE
    assert driving.read().status == wire.DISARMED | wire.GREETED
    assert driving.drive(100, 50).refused
    assert driving.outputs() == []


@pytest.mark.parametrize("kind", [wire.STOP, wire.HELLO])
def test_stop_and_hello_leave_what_is_latched(driving: Device, kind: int) -> None:
    stopped(driving)
    if kind == wire.STOP:
        assert not driving.ask(wire.STOP).refused
    else:
        driving.greet()
    assert driving.read().status == wire.STOPPED | wire.GREETED | wire.DEADMAN


def test_read_and_limit_change_no_output(driving: Device) -> None:
    driving.read()
    driving.limit(0, 1)
    assert driving.outputs() == []
    assert driving.drive(100, 50).state == wire.ARMED


# Limits of a session


def test_a_limit_is_made_tighter_and_never_wider(device: Device) -> None:
    own = (2000, 1500, 3500, 400, 750)
    assert device.limit(0, 500) == (500, *own[1:])
    assert device.limit(0, 600) == (600, *own[1:])  # of the device's own and the one asked for
    assert device.limit(0, 10**9) == own
    for which, count in enumerate(own):
        assert device.limit(which, count + 1)[which] == count
        assert device.limit(which, 0)[which] == 0
        assert device.limit(which, -1)[which] == 0
        assert device.limit(which, -(2**31))[which] == 0
    for which in (5, 6, 255):
        assert device.limit(which, 1) == (0,) * 5
    device.greet()
    assert device.limit(9, 1) == own


def test_only_a_disarmed_device_takes_a_limit(driving: Device) -> None:
    own = (2000, 1500, 3500, 400, 750)
    assert driving.limit(0, 10) == own
    stopped(driving)
    assert driving.limit(0, 10) == own
    driving.ask(wire.CLEAR)
    assert driving.limit(0, 10) == (10, *own[1:])


@pytest.mark.parametrize(
    ("which", "limit", "within", "beyond", "fault"),
    [(0, 60, (60, 0), (61, 0), wire.RANGE), (1, 60, (0, -60), (0, -61), wire.RANGE),
     (3, 60, (-60, 0), (-61, 0), wire.SLEW), (4, 60, (0, 60), (0, 61), wire.SLEW)],
)  # fmt: skip
def test_a_tighter_limit_is_in_force_at_the_output(
    device: Device, which: int, limit: int, within: tuple[int, int], beyond: tuple[int, int], fault: int
) -> None:
    device.greet()
    device.limit(which, limit)
    device.arm()
    device.events()
    assert device.drive(*within).state == wire.ARMED
    device.drive(0, 0)
    assert device.drive(*beyond).faults == fault
    assert device.outputs() == [("i", within[1]), ("v", within[0]), *SAFE, *SAFE]


def test_a_tighter_rate_is_in_force(device: Device) -> None:
    device.greet()
    device.limit(2, 100)
    device.arm()
    device.drive(100, 50)
    device.sensors.rate = 101
    device.events()
    device.tick()
    assert device.outputs() == SAFE
    assert device.read().faults == wire.RATE


def test_a_reset_by_the_watchdog_is_told_until_the_next_boot() -> None:
    device = Device(by_watchdog=True)
    assert device.events() == SAFE
    assert device.read().status == wire.WATCHDOG | wire.DISARMED
    device.greet()
    assert device.ask(wire.CLEAR).status == wire.WATCHDOG | wire.GREETED
    assert device.arm().status == wire.WATCHDOG | wire.GREETED | wire.ARMED
    device.boot()
    assert device.read().status == wire.DISARMED


def test_the_tick_counts_from_the_boot() -> None:
    device = Device()
    device.tick(1000)
    assert device.read().tick == 1000
    device.boot()
    device.tick(2)
    assert device.read().tick == 2
