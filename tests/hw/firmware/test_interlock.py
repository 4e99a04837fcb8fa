"""The interlock of the core, by what its port was told: inputs that latch, lines, what is watched without a host."""

from __future__ import annotations

import ctypes
from dataclasses import replace

import pytest

from hw.bed import Capability, InterlockReason
from hw.boards.interlock import Interlock, interlock_counts
from tests.hw.firmware import wire
from tests.hw.firmware.device import PLAIN, Device

pytestmark = pytest.mark.compiler

LOCK = Interlock(
    key=True,
    settle=0.005,
    hold=0.3,
    drive_heat=0.05,
    drive_continuous=1.0,
    warmest=3000,
    bus=(100, 200),
    angle=(-3.0, 3.0),
    f_cut=50.0,
    angle_floor=0.02,
    load_off=0.2,
    load_time=0.01,
)
"""Of `PLAIN` with a tick of 1 ms: settles in 5, holds for 300, compares over 64; 3000 counts of angle each way."""

CONFIG = replace(
    PLAIN,
    capabilities=Capability.ENCODER | Capability.DRIVE_CURRENT,
    limits=replace(PLAIN.limits, heat=20.0),
    interlock=LOCK,
)
STOP, READY, ENABLED, KEY, CONVERTER = (1 << k for k in range(5))
SOUND = STOP | READY | CONVERTER
LOAD, DRIVE, BRAKE = 1, 2, 4
ALL = LOAD | DRIVE | BRAKE
SAFE = [("i", 0), ("v", 0)]


class Inputs(ctypes.Structure):
    _fields_ = [
        ("lines", ctypes.c_uint32),
        ("temperature", ctypes.c_int32),
        ("bus", ctypes.c_int32),
        ("clock", ctypes.c_uint32),
        ("beats", ctypes.c_uint32),
        ("lost_step", ctypes.c_bool),
    ]


class Locked(Device):
    """A bed with an interlock whose inputs are all sound, its key turned, its motors cooled."""

    def __init__(self, lock: Interlock = LOCK) -> None:
        super().__init__(replace(CONFIG, interlock=lock))
        self.inputs = Inputs.in_dll(self.lib, "fake_inputs")
        ctypes.memset(ctypes.addressof(self.inputs), 0, ctypes.sizeof(self.inputs))
        self.set("fake_reads_back", 1)
        self.set("fake_pace", 1000)
        self.set("fake_beat", 1)
        self.inputs.lines, self.inputs.temperature, self.inputs.bus = SOUND, 2000, 150
        self.boot()
        self.tick(20)
        self.turn_key()
        self.tick(40)

    def set(self, name: str, value: int) -> None:
        ctypes.c_int32.in_dll(self.lib, name).value = value

    def close(self, lines: int) -> None:
        self.inputs.lines |= lines

    def open(self, lines: int) -> None:
        self.inputs.lines &= ~lines

    def turn_key(self) -> None:
        self.open(KEY)
        self.tick()
        self.close(KEY)
        self.tick()

    def why(self) -> InterlockReason:
        found = self.read()
        return InterlockReason(found.more[-1])

    def lines(self) -> list[int]:
        """The interlock's lines as the port was told, each change once."""
        told = [counts for output, counts in self.events() if output == "l"]
        return [each for k, each in enumerate(told) if k == 0 or each != told[k - 1]]

    def held(self, ticks: int, voltage: int = 0, current: int = 0) -> wire.Sample:
        """Driven for so many ticks."""
        for _ in range(ticks):
            sample = self.drive(voltage, current)
            if sample.state != wire.ARMED:
                break
            self.tick()
        return self.read()


@pytest.fixture
def device() -> Locked:
    return Locked()


@pytest.fixture
def armed(device: Locked) -> Locked:
    device.ready()
    return device


# Arming


def test_hello_tells_the_interlock_and_a_sample_ends_with_its_reasons(device: Locked) -> None:
    assert device.greet().capabilities & 1 << 6
    assert len(device.read().more) == 3 and device.why() == InterlockReason(0)


def test_lines_are_off_from_boot_on_and_all_on_when_it_arms(device: Locked) -> None:
    assert set(device.lines()) == {0}
    device.ready()
    device.boot()
    assert device.lines() == [0]
    device = Locked()
    device.greet()
    device.events()
    device.arm()
    assert device.lines() == [0, ALL]


def test_before_its_first_tick_it_does_not_arm(device: Locked) -> None:
    device.boot()
    device.greet()
    assert device.arm().refused and device.why() == InterlockReason.TICK


def test_it_arms_only_after_a_person_has_turned_the_key_off_and_on() -> None:
    device = Locked()
    device.close(KEY)
    device.boot()
    device.tick(10)
    device.greet()
    assert device.arm().refused and device.why() == InterlockReason.KEY  # it was on when power came
    device.open(KEY)
    device.tick()
    assert device.arm().refused
    device.close(KEY)
    device.tick()
    assert device.arm().state == wire.ARMED


def test_a_key_is_good_for_many_cases_and_for_none_after_a_fault(armed: Locked) -> None:
    for _ in range(3):
        armed.held(3)
        armed.ask(wire.STOP)
        armed.tick(3)
        assert armed.arm().state == wire.ARMED
    armed.tick(15)  # the deadman
    assert armed.ask(wire.CLEAR).state == wire.DISARMED
    assert armed.arm().refused and armed.why() == InterlockReason.KEY
    armed.turn_key()
    assert armed.arm().state == wire.ARMED


def test_a_key_that_is_turned_off_stops_it(armed: Locked) -> None:
    armed.held(3, 100, 50)
    armed.open(KEY)
    armed.events()
    armed.tick()
    assert armed.read().state == wire.STOPPED and armed.why() == InterlockReason.KEY


def test_without_a_key_none_is_asked_for() -> None:
    device = Locked(replace(LOCK, key=False))
    device.open(KEY)
    device.tick()
    device.ready()


# Inputs


@pytest.mark.parametrize(("line", "reason"), [(STOP, InterlockReason.STOP), (READY, InterlockReason.READY),
                                               (CONVERTER, InterlockReason.CONVERTER)])  # fmt: skip
def test_an_input_that_opens_stops_within_the_tick_and_stays_so(
    armed: Locked, line: int, reason: InterlockReason
) -> None:
    armed.held(3, 100, 50)
    armed.events()
    armed.open(line)
    armed.tick()
    assert armed.outputs() == SAFE
    armed.close(line)
    armed.tick(50)
    sample = armed.read()
    assert (sample.state, sample.faults) == (wire.STOPPED, wire.INTERLOCK)
    assert armed.why() == reason


@pytest.mark.parametrize("line", [STOP, READY, CONVERTER])
def test_an_input_latches_in_every_state_and_is_not_cleared_while_it_is_open(device: Locked, line: int) -> None:
    device.greet()
    device.open(line)
    device.tick()
    device.close(line)
    device.tick()
    assert device.read().state == wire.STOPPED and device.arm().refused
    device.open(line)
    device.tick()
    assert device.ask(wire.CLEAR).refused
    device.close(line)
    device.tick()
    assert device.ask(wire.CLEAR).state == wire.DISARMED
    assert device.arm().refused  # until the key is turned
    device.turn_key()
    assert device.arm().state == wire.ARMED


def test_lines_that_are_not_read_back_stop_it_after_they_have_settled(armed: Locked) -> None:
    armed.set("fake_reads_back", 0)
    armed.open(ENABLED)
    assert armed.held(5).state == wire.ARMED
    assert armed.held(1).state == wire.STOPPED and armed.why() == InterlockReason.READ_BACK


def test_a_contact_that_is_welded_is_found_when_lines_go_off(armed: Locked) -> None:
    armed.held(3)
    armed.set("fake_reads_back", 0)
    armed.ask(wire.STOP)
    armed.tick(5)
    assert armed.read().state == wire.DISARMED
    armed.tick(1)
    assert armed.read().state == wire.STOPPED and armed.why() == InterlockReason.READ_BACK


# Coming to rest


def test_the_load_is_off_at_once_and_the_drive_and_brake_when_the_shaft_is_slow(armed: Locked) -> None:
    armed.sensors.rate = 100
    armed.held(3, 100, 50)
    armed.events()
    armed.ask(wire.STOP)
    armed.tick(50)
    assert armed.lines() == [DRIVE | BRAKE]
    armed.sensors.rate = 20
    armed.tick()
    assert armed.lines() == [0]


def test_a_shaft_that_turns_on_is_braked_after_the_hold_however_often_it_is_told_to_stop(armed: Locked) -> None:
    armed.sensors.rate = 100
    armed.held(3)
    armed.events()
    for _ in range(1000):
        armed.ask(wire.STOP)
    armed.tick(299)
    assert armed.lines() == [DRIVE | BRAKE]
    armed.tick(2)
    assert armed.lines()[-1] == 0


# What is watched


def test_the_drive_s_i2t_stops_it_and_it_is_cleared_at_half(armed: Locked) -> None:
    armed.sensors.drive_current = 400  # 2 A, 3 A^2 above what it bears for ever: 0.05 A^2 s last for 17 ms
    armed.held(16)
    assert armed.read().state == wire.ARMED
    armed.held(2)
    assert armed.read().state == wire.STOPPED and armed.why() == InterlockReason.DRIVE_HEAT
    armed.sensors.drive_current = 0
    armed.tick(20)
    assert armed.ask(wire.CLEAR).refused
    armed.tick(10)
    assert armed.ask(wire.CLEAR).state == wire.DISARMED


def test_both_motors_count_as_hot_after_a_boot(device: Locked) -> None:
    device.boot()
    device.tick()
    device.turn_key()
    device.ready()
    device.sensors.drive_current = 300
    device.held(3)
    assert device.why() == InterlockReason.DRIVE_HEAT
    device = Locked()
    device.boot()
    device.tick(2)
    device.turn_key()
    device.ready()
    for current in (700, 1400, 1400, 1400):
        device.drive(0, current)
        device.tick()
    assert device.read().faults & wire.HEAT


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [("temperature", 3001, InterlockReason.TEMPERATURE), ("temperature", 2**31 - 1, InterlockReason.TEMPERATURE),
     ("bus", 99, InterlockReason.BUS), ("bus", 201, InterlockReason.BUS)],
)  # fmt: skip
def test_temperature_and_supply_stop_it(armed: Locked, name: str, value: int, reason: InterlockReason) -> None:
    armed.held(3, 100, 50)
    setattr(armed.inputs, name, value)
    armed.tick()
    assert armed.read().state == wire.STOPPED and armed.why() == reason


def test_temperature_and_supply_do_not_latch_a_bed_that_rests_but_it_does_not_arm(device: Locked) -> None:
    device.greet()
    device.inputs.temperature = 3001
    device.tick()
    assert device.arm().refused and device.why() == InterlockReason.TEMPERATURE
    device.inputs.temperature = 3000
    device.tick()
    assert device.arm().state == wire.ARMED


@pytest.mark.parametrize("angle", [3001, -3001])
def test_a_shaft_beyond_its_angle_stops_it(armed: Locked, angle: int) -> None:
    armed.sensors.angle = 3000 if angle > 0 else -3000
    armed.tick()
    assert armed.read().state == wire.ARMED
    armed.sensors.angle = angle
    armed.tick()
    assert armed.why() & InterlockReason.ANGLE
    assert armed.ask(wire.CLEAR).refused


def turned(device: Locked, ticks: int, rate: float, told: float) -> None:
    """The shaft turned at so many counts of angle a tick, its tachometer reading so many counts."""
    angle = float(device.sensors.angle)
    for _ in range(ticks):
        angle += rate
        device.sensors.angle, device.sensors.rate = round(angle), round(told)
        device.drive(0, 0)
        device.tick()
        if device.read().state != wire.ARMED:
            return


NO_ANGLE = replace(LOCK, angle=None)


@pytest.mark.parametrize("told", [1000.0, -1000.0])
def test_an_encoder_that_goes_as_the_tachometer_says_is_sound(told: float) -> None:
    device = Locked(NO_ANGLE)
    device.ready()
    turned(device, 1000, told * 0.1, told)  # 0.1 rad/s a count over 1 ms is 0.1 count of 1 mrad
    assert device.read().state == wire.ARMED


@pytest.mark.parametrize(("rate", "told"), [(0.0, 1000.0), (100.0, 0.0), (100.0, -1000.0), (100.0, 800.0)])
def test_an_encoder_or_tachometer_that_stands_still_turns_back_or_is_a_fifth_off_stops_it(
    rate: float, told: float
) -> None:
    device = Locked(NO_ANGLE)
    device.ready()
    turned(device, 130, rate, told)
    assert device.read().state == wire.STOPPED and device.why() == InterlockReason.ENCODER


def test_an_encoder_is_compared_over_the_ends_of_its_counts() -> None:
    device = Locked(NO_ANGLE)
    device.sensors.angle = 2**31 - 1000
    device.tick(70)
    device.ready()
    angle = 2**31 - 1000
    for _ in range(200):
        angle += 100
        device.sensors.angle = (angle + 2**31) % 2**32 - 2**31
        device.sensors.rate = 1000
        device.drive(0, 0)
        device.tick()
    assert device.read().state == wire.ARMED


def test_a_tachometer_may_be_late_by_its_filter_while_the_rate_changes() -> None:
    device = Locked(NO_ANGLE)
    device.ready()
    late, true, angle = 0.0, 0.0, 0.0
    for k in range(1000):
        true = min(3000.0, true + 12.0) if k < 500 else max(0.0, true - 12.0)
        late += (true - late) / 4.5  # a filter of order 1, 4.5 ms
        angle += 0.1 * true
        device.sensors.angle, device.sensors.rate = round(angle), round(late)
        device.drive(0, 0)
        device.tick()
    assert device.read().state == wire.ARMED


def test_a_step_that_the_encoder_lost_stops_it(armed: Locked) -> None:
    armed.inputs.lost_step = True
    armed.tick()
    assert armed.read().state == wire.STOPPED and armed.why() == InterlockReason.ENCODER


def test_a_load_whose_current_is_not_what_it_is_told_stops_it_after_its_time(armed: Locked) -> None:
    armed.measures_load(True)
    armed.sensors.load_current = 150
    armed.held(40, 0, 50)
    assert armed.read().state == wire.ARMED  # 0.2 A off, just what it may be
    armed.sensors.load_current = 151
    armed.held(9, 0, 50)
    assert armed.read().state == wire.ARMED
    armed.held(2, 0, 50)
    assert armed.read().state == wire.STOPPED and armed.why() == InterlockReason.LOAD


@pytest.mark.parametrize(("pace", "stops"), [(500, False), (1500, False), (499, True), (1501, True), (0, True)])
def test_a_tick_that_is_too_early_or_too_late_by_the_other_clock_stops_it(
    armed: Locked, pace: int, stops: bool
) -> None:
    armed.held(3, 100, 50)
    armed.set("fake_pace", pace)
    armed.tick()
    assert (armed.read().state == wire.STOPPED) is stops
    assert armed.why() == (InterlockReason.TICK if stops else InterlockReason(0))


def test_a_main_program_that_stands_still_stops_it(armed: Locked) -> None:
    armed.held(3, 100, 50)
    armed.set("fake_beat", 0)
    armed.tick(4)
    assert armed.read().state == wire.ARMED
    armed.tick(1)
    assert armed.read().state == wire.STOPPED and armed.why() == InterlockReason.MAIN


def test_a_fault_of_the_core_stops_it_besides_and_switches_the_lines(armed: Locked) -> None:
    armed.held(3, 100, 50)
    armed.events()
    armed.tick(15)
    assert armed.read().faults == wire.DEADMAN
    assert armed.lines() == [0]


# Numbers


def test_what_cannot_be_counted_is_said() -> None:
    for change, said in (
        ({"angle_floor": 1e9}, "the interlock's floor is 1e+12, which is out of range"),
        ({"bus": (-1, 5)}, "the interlock's bus least is -1, which is out of range"),
    ):
        with pytest.raises(ValueError) as found:
            interlock_counts(replace(LOCK, **change), 1000.0, PLAIN.scales, 20, CONFIG.capabilities)  # type: ignore[arg-type]
        assert str(found.value) == said
