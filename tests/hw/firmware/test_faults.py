"""Every fault, by what the amplifiers are told within the tick, and that it stays until it is cleared."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace

import pytest

from hw.boards.build import Config, Shaft, guard
from tests.hw.firmware import wire
from tests.hw.firmware.device import PLAIN, SENSORS, SHAFT, Device
from tests.hw.firmware.wire import frame

pytestmark = pytest.mark.compiler

SAFE = [("i", 0), ("v", 0)]
SENSING = replace(PLAIN, capabilities=SENSORS)
STEEP = replace(PLAIN, limits=replace(PLAIN.limits, voltage_slew=4e4, current_slew=6e3, heat=10.0))
WATCHED = replace(STEEP, shaft=SHAFT)


@pytest.fixture
def device() -> Device:
    """Armed, with 1 V and 0.1 A out, sensors of all kinds."""
    found = Device(SENSING)
    found.ready()
    found.drive(100, 50)
    found.events()
    return found


FAULTS: dict[str, tuple[Callable[[Device], object], int]] = {
    "no command": (lambda d: d.tick(15), wire.DEADMAN),
    "too much voltage": (lambda d: d.drive(2001, 50), wire.RANGE | wire.SLEW),
    "too little voltage": (lambda d: d.drive(-2001, 50), wire.RANGE | wire.SLEW),
    "the least there is": (lambda d: d.drive(-(2**31), 50), wire.RANGE | wire.SLEW),
    "the most there is": (lambda d: d.drive(100, 2**31 - 1), wire.RANGE | wire.SLEW),
    "too much current": (lambda d: d.drive(100, 1501), wire.RANGE | wire.SLEW),
    "too little current": (lambda d: d.drive(100, -1501), wire.RANGE | wire.SLEW),
    "voltage too soon": (lambda d: d.drive(501, 50), wire.SLEW),
    "voltage too soon down": (lambda d: d.drive(-301, 50), wire.SLEW),
    "current too soon": (lambda d: d.drive(100, 801), wire.SLEW),
    "current too soon down": (lambda d: d.drive(100, -701), wire.SLEW),
    "shaft too fast": (lambda d: sensed(d, rate=3501), wire.RATE),
    "shaft too fast backwards": (lambda d: sensed(d, rate=-3501), wire.RATE),
    "a rate that could not be read": (lambda d: sensed(d, rate=2**31 - 1), wire.RATE),
    "the least rate there is": (lambda d: sensed(d, rate=-(2**31)), wire.RATE),
    "load's current": (lambda d: sensed(d, load_current=1651), wire.CURRENT),
    "load's current back": (lambda d: sensed(d, load_current=-1651), wire.CURRENT),
    "drive's current": (lambda d: sensed(d, drive_current=801), wire.CURRENT),
    "drive's current back": (lambda d: sensed(d, drive_current=-801), wire.CURRENT),
    "frames that do not decode": (lambda d: d.raw(b"\x05\x05\0" * 16), wire.NOISE),
}


def sensed(d: Device, **sensors: int) -> None:
    d.measures_load("load_current" in sensors)
    for name, counts in sensors.items():
        setattr(d.sensors, name, counts)
    d.tick()


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_makes_the_outputs_safe_within_the_tick_and_stays(device: Device, name: str) -> None:
    act, fault = FAULTS[name]
    act(device)
    assert device.outputs() == SAFE  # the load first; nothing of a command that is wrong
    assert device.read().status == wire.STOPPED | wire.GREETED | fault
    sensed(device, rate=0, load_current=0, drive_current=0)
    assert device.drive(1, 1).refused
    assert device.arm().refused
    assert set(device.outputs()) == set(SAFE)
    assert device.read().faults == fault
    assert device.ask(wire.CLEAR).status == wire.DISARMED | wire.GREETED
    assert device.arm().state == wire.ARMED


@pytest.mark.parametrize(
    "within",
    [
        lambda d: d.tick(14),
        lambda d: d.drive(500, 50),
        lambda d: d.drive(-300, 50),
        lambda d: d.drive(100, 800),
        lambda d: d.drive(100, -700),
        lambda d: sensed(d, rate=3500),
        lambda d: sensed(d, rate=-3500),
        lambda d: sensed(d, load_current=1650),
        lambda d: sensed(d, drive_current=-800),
        lambda d: d.raw(b"\x05\x05\0" * 15),
    ],
)
def test_at_its_limit_nothing_stops(device: Device, within: Callable[[Device], object]) -> None:
    within(device)
    assert device.read().status == wire.ARMED | wire.GREETED
    assert SAFE[0] not in device.outputs()


def test_a_current_that_is_not_measured_is_no_fault() -> None:
    device = Device(PLAIN)
    device.ready()
    sensed(device, drive_current=10**6)
    assert device.read().state == wire.ARMED


def test_faults_of_one_tick_are_all_told() -> None:
    device = Device(SENSING)
    device.ready()
    device.tick(14)
    sensed(device, rate=4000, load_current=1700)
    assert device.read().faults == wire.DEADMAN | wire.RATE | wire.CURRENT


def test_without_an_armed_bed_there_are_no_faults() -> None:
    device = Device(SENSING)
    device.greet()
    sensed(device, rate=4000, load_current=5000, drive_current=5000)
    device.tick(100)
    device.raw(b"\x05\x05\0" * 64)
    assert device.read().status == wire.DISARMED | wire.GREETED


# Deadman


def test_the_deadman_runs_from_arming() -> None:
    device = Device()
    device.ready()
    device.tick(14)
    assert device.outputs() == []
    device.tick()
    assert device.outputs() == SAFE


FOOD: dict[str, Callable[[Device], object]] = {
    "READ": lambda d: d.read(),
    "LIMIT": lambda d: d.limit(0, 100),
    "ARM": lambda d: d.arm(),
    "CLEAR": lambda d: d.ask(wire.CLEAR),
    "a DRIVE of before": lambda d: d.drive(100, 50, number=d.number),
    "an older one": lambda d: d.drive(100, 50, number=(d.number - 20) & 0xFFFF),
    "a STEP": lambda d: d.raw(frame(wire.STEP, d.number + 1, struct.pack("<iiB", 100, 50, 1))),
    "half a DRIVE": lambda d: d.raw(frame(wire.DRIVE, d.number + 1, struct.pack("<iiB", 100, 50, 0))[:9]),
    "empty frames": lambda d: d.raw(bytes(40)),
}


@pytest.mark.parametrize("name", FOOD)
def test_nothing_but_a_new_drive_feeds_the_deadman(device: Device, name: str) -> None:
    for _ in range(14):
        device.tick()
        FOOD[name](device)
    device.events()
    device.tick()
    assert device.outputs() == SAFE
    device.raw(b"\0")
    assert device.read().faults == wire.DEADMAN


def test_each_new_drive_feeds_the_deadman_also_if_it_says_the_same(device: Device) -> None:
    for _ in range(10):
        device.tick(14)
        device.drive(100, 50)
    assert device.read().state == wire.ARMED


# Slew


def test_a_command_may_change_by_the_slew_times_the_ticks_since_the_last(device: Device) -> None:
    device.tick(3)
    assert device.drive(100 + 3 * 400, 50).state == wire.ARMED
    device.tick(2)
    assert device.drive(1300 - 801, 50).faults == wire.SLEW


def test_the_first_command_is_measured_from_zero() -> None:
    for voltage, state in ((400, wire.ARMED), (401, wire.STOPPED)):
        device = Device()
        device.ready()
        assert device.drive(voltage, 0).state == state


def test_slew_is_measured_from_what_was_taken(device: Device) -> None:
    device.ask(wire.STOP)
    device.arm()
    assert device.drive(450, 0).faults == wire.SLEW  # from 0, not from 100


# Heat of the load


def heated(device: Device, current: int, ticks: int) -> int:
    """Ticks until it stops, commands on the way."""
    for k in range(ticks):
        device.drive(0, current)
        device.tick()
        if device.outputs()[-2:] == SAFE:
            return k + 1
    return 0


def hot() -> Device:
    device = Device()
    device.ready()
    device.drive(0, 700)
    device.tick(2)
    device.events()
    return device


def test_a_current_that_the_load_bears_for_ever_never_stops_it() -> None:
    assert heated(hot(), 750, 3000) == 0


def test_a_larger_current_stops_it_when_its_heat_is_used_up() -> None:
    # 1 A^2 s, used up by 2^2 - 1.5^2 A^2
    ticks = heated(hot(), 1000, 3000)
    assert ticks == 572 and abs(ticks * 1e-3 * (2.0**2 - 1.5**2) - 1.0) < 2e-3


def test_the_heat_is_that_of_the_measured_current() -> None:
    device = hot()
    device.measures_load(True)
    device.sensors.load_current = -1000
    assert heated(device, 1, 3000) == 572


def test_a_hot_load_stops_again_until_it_has_cooled() -> None:
    device = hot()
    assert heated(device, 1000, 3000) == 572
    assert device.read().faults == wire.HEAT
    device.tick(222)  # not quite half of it has gone
    assert device.ask(wire.CLEAR).status == wire.STOPPED | wire.GREETED | wire.HEAT | wire.REFUSED
    device.tick()
    assert device.ask(wire.CLEAR).status == wire.DISARMED | wire.GREETED
    device.arm()
    device.drive(0, 700)
    device.tick(1)
    assert 280 < heated(device, 1000, 3000) < 292


def test_heat_beyond_all_measure_stays_heat() -> None:
    device = hot()
    device.measures_load(True)
    device.sensors.load_current = -(2**31)
    device.tick(5)
    assert device.read().faults == wire.HEAT | wire.CURRENT


# Noise on the line


def test_noise_is_counted_among_the_last_64_frames(device: Device) -> None:
    for _ in range(20):  # 15 of 64, again and again
        assert device.raw(b"\x05\x05\0" * 15) == b""
        for _ in range(49):
            device.tick(0)
            device.read()
        device.drive(100, 50)
    assert device.read().state == wire.ARMED


def test_the_sixteenth_bad_frame_of_64_stops_it(device: Device) -> None:
    device.raw(b"\x05\x05\0" * 15)
    for _ in range(48):
        device.read()
    assert device.raw(b"\x05\x05\0") == b""
    assert device.outputs() == SAFE
    assert device.read().faults == wire.NOISE


def test_noise_of_before_arming_does_not_count() -> None:
    device = Device()
    device.raw(b"\x05\x05\0" * 63)
    device.ready()
    device.raw(b"\x05\x05\0" * 15)
    assert device.read().state == wire.ARMED


@pytest.mark.parametrize(
    "bad",
    [
        b"\x05\x05\0",
        b"\1" * 40 + b"\0",
        frame(77, 1),
        frame(wire.READ, 1, b"x"),
        frame(wire.STEP, 1, bytes(8) + b"\1"),
        frame(wire.DRIVE, 1, bytes(8) + b"\1"),
        frame(wire.PRESET, 1, bytes(9)),
    ],
)
def test_whatever_is_dropped_is_noise(device: Device, bad: bytes) -> None:
    device.raw(bad * 16)
    assert device.outputs() == SAFE
    assert device.read().faults == wire.NOISE


# The tachometer


class Turning:
    """A bed with such a shaft, stepped by hand: its tachometer tells `told(rate)`, and the core believes `config`."""

    def __init__(self, told: Callable[[float], float], config: Config = WATCHED, shaft: Shaft = SHAFT) -> None:
        self.device = Device(config)
        self.told, self.shaft, self.scales = told, shaft, config.scales
        self.w = self.y = self.slope = 0.0
        self.device.ready()

    def tick(self, voltage: float, current: float) -> bool:
        """One tick under V and A; whether it is armed still."""
        sample = self.device.drive(round(voltage / self.scales.voltage), round(current / self.scales.current))
        if sample.state != wire.ARMED:
            return False
        h, s, wc = 1e-5, self.shaft, 6.283185307179586 * self.shaft.f_cut
        for _ in range(100):
            drive = max(-s.tau_max, min(s.tau_max, s.kt / s.resistance * (voltage - s.kt * self.w)))
            smooth = drive + s.kt_load * current - s.f_v * self.w
            if self.w == 0.0 and abs(smooth) <= s.f_c:
                net = 0.0
            else:
                net = smooth - (s.f_c if (self.w or smooth) > 0.0 else -s.f_c)
            after = self.w + h * net / s.inertia
            self.w = 0.0 if self.w * after < 0.0 else after
            self.slope += h * (wc * wc * (self.w - self.y) - 1.4142135623730951 * wc * self.slope)
            self.y += h * self.slope
        self.device.sensors.rate = round(self.told(self.y) / self.scales.rate)
        self.device.tick()
        return True

    def until_stopped(self, voltage: float, current: float, ticks: int) -> int:
        for k in range(ticks):
            if not self.tick(voltage, current):
                return k
        return 0


@pytest.mark.parametrize("voltage", [4.0, -4.0, 3.0])
@pytest.mark.parametrize(
    ("told", "fault"),
    [
        (lambda y: 0.0, wire.DEAD),
        (lambda y: 3.0, wire.DEAD),
        (lambda y: -y, wire.REVERSED),
        (lambda y: -0.5 * y, wire.REVERSED),
    ],
)
def test_a_tachometer_that_does_not_tell_the_truth_stops_the_bed(
    voltage: float, told: Callable[[float], float], fault: int
) -> None:
    bed = Turning(told)
    ticks = bed.until_stopped(voltage, 0.0, 200)
    assert 0 < ticks < 100
    assert bed.device.outputs()[-2:] == SAFE
    assert bed.device.read().faults == fault
    assert abs(bed.w) < 100.0


def test_the_load_motor_alone_shows_a_dead_tachometer_too() -> None:
    bed = Turning(lambda y: 0.0)
    assert 0 < bed.until_stopped(0.0, 1.4, 200) < 100
    assert bed.device.read().faults == wire.DEAD


def test_a_tachometer_that_dies_on_the_way_stops_the_bed() -> None:
    bed = Turning(lambda y: y)
    for _ in range(300):
        assert bed.tick(4.0, 0.0)
    bed.told = lambda y: 0.0
    assert 0 < bed.until_stopped(4.0, 0.0, 300) < 150
    assert bed.device.read().faults & (wire.DEAD | wire.REVERSED)


@pytest.mark.parametrize("told", [lambda y: y, lambda y: 0.9 * y, lambda y: y + 0.3])
def test_a_sound_one_lets_it_run_through_starts_stops_and_turns(told: Callable[[float], float]) -> None:
    bed = Turning(told)
    for voltage, current in (
        (4.0, 0.0),
        (-4.0, 0.0),
        (0.0, 0.0),
        (4.0, -1.4),
        (0.0, 1.4),
        (3.0, -0.4),
        (0.6, 0.0),
        (0.0, 0.0),
    ):
        for _ in range(250):
            assert bed.tick(voltage, current), (voltage, current, bed.device.read())


def test_a_shaft_that_friction_or_the_load_motor_holds_is_no_dead_tachometer() -> None:
    bed = Turning(lambda y: y)
    for voltage, current in ((0.68, 0.0), (4.0, -1.4), (1.0, -0.4), (4.0, -1.75)):
        for _ in range(500):
            assert bed.tick(voltage, current)
    assert bed.w == 0.0 or abs(bed.w) < 100.0


@pytest.mark.parametrize("factor", [0.5, 1.5, 2.5])
def test_a_shaft_of_another_inertia_is_no_dead_tachometer(factor: float) -> None:
    bed = Turning(lambda y: y, shaft=replace(SHAFT, inertia=SHAFT.inertia * factor))
    for voltage, current, ticks in ((4, 0, 250), (-4, 0, 250), (0, 0, 100), (0, 2.9, 40), (0, -2.9, 80), (0, 2.9, 40)):
        for _ in range(ticks):
            assert bed.tick(voltage, current), (voltage, current, bed.device.read())


def test_a_motor_weaker_than_its_data_sheet_that_the_load_holds_is_no_dead_tachometer() -> None:
    bed = Turning(lambda y: y, shaft=replace(SHAFT, kt=0.8 * SHAFT.kt))
    for _ in range(500):
        assert bed.tick(5.0, -1.389)
    assert bed.w == 0.0


def test_a_shaft_that_turns_steadily_in_thick_grease_is_no_dead_tachometer() -> None:
    thick = replace(SHAFT, f_v=4e-4)
    bed = Turning(lambda y: y, replace(WATCHED, shaft=thick), thick)
    for _ in range(500):
        assert bed.tick(15.0, 0.0)
    assert bed.w == pytest.approx(192.0, abs=2.0)


def test_a_filter_slower_than_its_data_sheet_is_no_dead_tachometer() -> None:
    smooth = replace(SHAFT, f_c=0.0)
    bed = Turning(lambda y: y, replace(WATCHED, shaft=smooth), replace(smooth, f_cut=20.0))
    for voltage in (0.3, 6.0, -6.0, 0.0, 2.0, -8.0):
        for _ in range(100):
            assert bed.tick(voltage, 0.0)


LIGHT = replace(SHAFT, inertia=1.2e-6, f_c=0.002)
FINE = replace(WATCHED, shaft=LIGHT, scales=replace(WATCHED.scales, voltage=2.0**-20, current=2.0**-20, rate=2.0**-20))


@pytest.mark.parametrize(("told", "fault"), [(lambda y: y, 0), (lambda y: 0.0, wire.DEAD), (lambda y: -y, wire.DEAD)])
def test_a_light_shaft_in_fine_counts_is_watched_like_one_in_coarse_ones(
    told: Callable[[float], float], fault: int
) -> None:
    """A count of rate is 1e-6 rad/s, of which a tick may be 10^8: with fewer bits of a fraction. Such a shaft has its
    new rate before the filter shows it, so that one that is reversed is told as dead."""
    assert guard(FINE)["bits"] == 21
    ends = []
    for config in (FINE, replace(FINE, scales=WATCHED.scales)):
        bed = Turning(told, config, LIGHT)
        stopped = [bed.until_stopped(voltage, 0.0, 100) for voltage in (0.5, 2.0, -1.0, 0.0, 4.0)]
        assert bed.device.read().faults == fault
        ends.append(stopped[0])
    assert ends[0] == ends[1] and bool(ends[0]) == bool(fault)


def test_without_a_shaft_s_data_nobody_watches() -> None:
    bed = Turning(lambda y: 0.0, STEEP)
    assert bed.until_stopped(4.0, 0.0, 300) == 0
