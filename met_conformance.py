"""Tests that every bed must pass. Whoever writes a driver derives a class from one of these, and pytest runs it:

    class TestMine(FreeRunning):
        @pytest.fixture
        def bed(self):
            with MyBed("/dev/ttyUSB0") as bed:
                yield bed

They ask as a host of this package does. What none says - a command beyond a limit, an old number, another session's, a
frame that does not decode, a load driven until it is hot - no test here has said: that a device bears it is for its own
tests, as those of tests/hw/firmware are.

`Conformance` holds for all beds; `LockStep` and `FreeRunning` add what holds for those without and with a time of their
own, `Simulated` what holds for those without a motor. The shaft turns, under a tenth of the limits, in two tests under
three tenths: nothing but the load motor may be on it.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator

import pytest

from hw.bed import About, BedDriver, BedSample, BedState, Capability, Fault
from met.diagnostic import Problem


@contextlib.contextmanager
def refused(code: str) -> Iterator[None]:
    """Expect a Problem of this code, and no other."""
    with pytest.raises(Problem) as caught:
        yield
    assert [each.code for each in caught.value.diagnostics] == [code]


class Conformance:
    """The tests that hold for every bed. period: s from one exchange to the next;  share: of the limits, by which
    the tests move the shaft"""

    period = 1e-3
    share = 0.1

    @pytest.fixture
    def bed(self) -> Iterator[BedDriver]:
        """The bed, not connected, without a fault that is latched, its shaft at rest."""
        raise NotImplementedError

    def outputs(self, bed: BedDriver) -> tuple[float, float] | None:
        """The voltage (V) and current (A) that the amplifiers hold; None where only a meter can see them."""
        return None

    def wait(self, bed: BedDriver, seconds: float) -> None:
        """Say nothing to the bed for `seconds`."""
        time.sleep(seconds)

    # What tests do

    def drive(self, bed: BedDriver, seconds: float, voltage: float = 0.0, current: float = 0.0) -> BedSample:
        """Exchange for `seconds`, or until the bed is no longer armed. Returns its last answer."""
        sample = None
        for _ in range(math.ceil(seconds / self.period)):
            if not self._lock_step:
                self.wait(bed, self.period)
            answer = bed.exchange(voltage, current)
            sample = answer or sample
            if answer is not None and answer.state != BedState.ARMED:
                break
        assert sample is not None, "no answer at all"
        return sample

    def connected(self, bed: BedDriver) -> About:
        about = bed.connect()
        self._lock_step = Capability.LOCK_STEP in about.capabilities
        return about

    def driven(self, bed: BedDriver, **limits: float) -> About:
        """Connect and arm the bed, under these limits."""
        about = self.connected(bed)
        bed.limit(limits)
        bed.arm()
        return about

    def sped(self, bed: BedDriver, about: About) -> BedSample:
        """Turn an armed bed's shaft faster than a limit that was made tighter lets it. Returns the last answer."""
        return self.drive(bed, 1.0, voltage=3.0 * self.share * about.limits.voltage)

    def is_safe(self, bed: BedDriver) -> None:
        held = self.outputs(bed)
        assert held is None or held == (0.0, 0.0)
        assert bed.read().state != BedState.ARMED

    def faulted(self, bed: BedDriver, sample: BedSample, fault: Fault) -> None:
        """Assert that the bed has stopped for this fault alone, and stays so until it is cleared."""
        assert sample.state == BedState.STOPPED
        assert sample.faults & ~Fault.WATCHDOG == fault
        self.is_safe(bed)
        again = bed.exchange(0.0, 0.0)
        assert again is not None and again.refused and again.state == BedState.STOPPED
        assert bed.connect() and bed.read().faults & ~Fault.WATCHDOG == fault  # latched, whoever greets the bed
        with refused("E406"):
            bed.arm()
        bed.rest(3.0)
        cleared = bed.clear()
        assert cleared.state == BedState.DISARMED and not cleared.faults & ~Fault.WATCHDOG
        assert bed.arm().state == BedState.ARMED

    # Who is there

    def test_it_says_who_it_is_and_what_it_can(self, bed: BedDriver) -> None:
        about = self.connected(bed)
        assert about.name and about.name.isprintable() and about.version in (0, 1)
        assert bytes.fromhex(about.firmware) is not None and len(about.firmware) == 16
        assert about.tick_hz > 0.0 and 0.010 <= about.deadman <= 0.020
        scales = about.scales
        said = [scales.voltage, scales.current, scales.rate, *about.limits.__dict__.values()]
        assert all(math.isfinite(x) and x > 0.0 for x in said)

    def test_it_is_disarmed_and_safe_once_it_is_greeted(self, bed: BedDriver) -> None:
        self.connected(bed)
        sample = bed.read()
        assert sample.state == BedState.DISARMED and sample.greeted and not sample.refused
        assert not sample.faults & ~Fault.WATCHDOG
        self.is_safe(bed)

    def test_it_has_the_sensors_that_it_says(self, bed: BedDriver) -> None:
        about, sample = self.connected(bed), bed.read()
        assert (sample.angle is not None) == (Capability.ENCODER in about.capabilities)
        assert (sample.drive_current is not None) == (Capability.DRIVE_CURRENT in about.capabilities)
        assert (sample.acceleration is not None) == (Capability.ACCELEROMETER in about.capabilities)

    def test_nothing_can_be_asked_before_it_is_greeted(self, bed: BedDriver) -> None:
        for ask in (bed.arm, bed.read, bed.clear, lambda: bed.exchange(0.0, 0.0), lambda: bed.limit({"voltage": 1.0})):
            with refused("E401"):
                ask()
        bed.stop()
        bed.close()
        bed.close()

    def test_greeting_it_again_disarms_it(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        self.drive(bed, 0.02, voltage=self.share * about.limits.voltage)
        again = bed.connect()
        assert again == about
        self.is_safe(bed)

    # Arming and commands

    def test_it_arms_with_nothing_commanded(self, bed: BedDriver) -> None:
        self.connected(bed)
        sample = bed.arm()
        assert sample.state == BedState.ARMED and not sample.refused
        assert self.outputs(bed) in (None, (0.0, 0.0))

    def test_a_command_takes_hold_as_whole_counts(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        voltage, current = self.share * about.limits.voltage, self.share * about.limits.current
        sample = self.drive(bed, self.period, voltage, current)
        assert sample.state == BedState.ARMED and not sample.refused
        if (held := self.outputs(bed)) is not None:
            scales = about.scales
            assert held == (
                round(voltage / scales.voltage) * scales.voltage,
                round(current / scales.current) * scales.current,
            )

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("motor", ["drive", "load"])
    def test_the_shaft_turns_the_way_of_a_command(self, bed: BedDriver, motor: str, way: float) -> None:
        about = self.driven(bed)
        voltage = way * self.share * about.limits.voltage if motor == "drive" else 0.0
        current = way * self.share * about.limits.current if motor == "load" else 0.0
        sample = self.drive(bed, 0.1, voltage, current)
        assert way * sample.rate > 0.0
        assert sample.angle is None or way * sample.angle > 0.0

    def test_what_is_read_is_whole_counts_and_its_ticks_go_on(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        before = -1
        for _ in range(20):
            sample = self.drive(bed, self.period, voltage=self.share * about.limits.voltage)
            assert sample.rate == round(sample.rate / about.scales.rate) * about.scales.rate
            assert sample.tick > before or (not self._lock_step and sample.tick == before)
            before = sample.tick

    def test_a_command_is_refused_while_it_is_not_armed(self, bed: BedDriver) -> None:
        about = self.connected(bed)
        sample = bed.exchange(self.share * about.limits.voltage, 0.0)
        assert sample is not None and sample.refused and sample.state == BedState.DISARMED
        self.is_safe(bed)

    def test_it_does_not_arm_twice(self, bed: BedDriver) -> None:
        self.driven(bed)
        with refused("E406"):
            bed.arm()

    def test_reading_changes_nothing(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        self.drive(bed, self.period, voltage=self.share * about.limits.voltage)
        held = self.outputs(bed)
        assert bed.read().state == BedState.ARMED
        assert self.outputs(bed) == held

    # Stopping

    def test_stop_is_safe_and_confirmed(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        self.drive(bed, 0.02, self.share * about.limits.voltage, self.share * about.limits.current)
        assert bed.stop() and bed.stop()
        self.is_safe(bed)
        sample = bed.exchange(0.0, 0.0)
        assert sample is not None and sample.refused and sample.state == BedState.DISARMED

    def test_the_shaft_is_braked_when_it_is_stopped(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        fast = self.drive(bed, 0.2, voltage=self.share * about.limits.voltage)
        left = 1.0 if Capability.COASTS in about.capabilities else 0.2
        assert bed.rest(0.5).rate < left * fast.rate

    def test_leaving_a_with_block_stops_it(self, bed: BedDriver) -> None:
        with pytest.raises(KeyError), bed:
            about = self.driven(bed)
            self.drive(bed, 0.02, voltage=self.share * about.limits.voltage)
            raise KeyError
        assert self.outputs(bed) in (None, (0.0, 0.0))
        self.connected(bed)
        self.is_safe(bed)

    def test_a_shaft_that_turns_is_not_armed(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        for _ in range(200):
            if abs(self.drive(bed, 0.01, voltage=3.0 * self.share * about.limits.voltage).rate) > about.limits.rate / 8:
                break
        bed.stop()
        with refused("E406"):
            bed.arm()
        self.is_safe(bed)

    # What is no command

    @pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 1e300])
    @pytest.mark.parametrize("which", [0, 1])
    def test_no_number_and_no_command_beyond_every_limit_is_sent(
        self, bed: BedDriver, which: int, wrong: float
    ) -> None:
        self.driven(bed)
        with refused("E408"):
            bed.exchange(*((wrong, 0.0) if which == 0 else (0.0, wrong)))
        self.is_safe(bed)

    @pytest.mark.parametrize("which", ["voltage", "current"])
    def test_a_count_beyond_a_limit_is_not_sent_and_the_limit_itself_is(self, bed: BedDriver, which: str) -> None:
        about = self.connected(bed)
        scale = getattr(about.scales, which)
        most = round(self.share * getattr(about.limits, which) / scale)
        bed.limit({which: most * scale})
        bed.arm()
        place = {"voltage": 0, "current": 1}[which]
        command = [0.0, 0.0]
        command[place] = most * scale
        assert self.drive(bed, self.period, *command).state == BedState.ARMED
        command[place] = (most + 1) * scale
        with refused("E408"):
            bed.exchange(*command)
        self.is_safe(bed)

    # Limits

    def test_limits_become_tighter_and_are_its_own_again_when_it_is_greeted(self, bed: BedDriver) -> None:
        about = self.driven(bed, voltage=self.share * self.connected(bed).limits.voltage)
        with refused("E408"):
            bed.exchange(2.0 * self.share * about.limits.voltage, 0.0)
        self.driven(bed)
        assert self.drive(bed, self.period, voltage=2.0 * self.share * about.limits.voltage).state == BedState.ARMED

    def test_limits_never_become_wider(self, bed: BedDriver) -> None:
        own = self.connected(bed).limits
        self.driven(bed, voltage=3.0 * own.voltage, current=3.0 * own.current)
        with refused("E408"):
            bed.exchange(1.5 * own.voltage, 0.0)
        bed.arm()
        with refused("E408"):
            bed.exchange(0.0, 1.5 * own.current)

    def test_limits_are_not_taken_while_it_is_armed(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        with refused("E406"):
            bed.limit({"voltage": self.share * about.limits.voltage})

    @pytest.mark.parametrize("wrong", [-1.0, math.nan, math.inf])
    def test_a_limit_is_a_number_from_zero_on(self, bed: BedDriver, wrong: float) -> None:
        self.connected(bed)
        with refused("E408"):
            bed.limit({"rate": wrong})

    def test_a_shaft_faster_than_its_limit_stops_it(self, bed: BedDriver) -> None:
        about = self.connected(bed)
        most = 4.0 * about.limits.arming_rate
        bed.limit({"rate": most})
        bed.arm()
        sample = self.sped(bed, about)
        assert abs(sample.rate) > most
        with refused("E406"):
            bed.clear()  # for the shaft is fast yet
        self.faulted(bed, sample, Fault.RATE)

    @pytest.mark.parametrize("which", ["voltage", "current"])
    def test_a_command_that_changes_too_fast_stops_it(self, bed: BedDriver, which: str) -> None:
        about = self.connected(bed)
        most = self.share * getattr(about.limits, which)
        # half the change of this test in all the ticks from one command to the next, a late one too
        bed.limit({f"{which}_slew": 0.5 * most / 0.015})
        bed.arm()
        held = {"voltage": 0.0, "current": 0.0}
        assert self.drive(bed, self.period, **held).state == BedState.ARMED
        held[which] = most
        self.faulted(bed, self.drive(bed, self.period, **held), Fault.SLEW)

    # Clearing

    def test_clearing_a_bed_that_is_disarmed_changes_nothing(self, bed: BedDriver) -> None:
        self.connected(bed)
        assert bed.clear().state == BedState.DISARMED

    def test_a_bed_that_is_armed_is_not_cleared(self, bed: BedDriver) -> None:
        self.driven(bed)
        with refused("E406"):
            bed.clear()

    # A plant that is simulated, or is not

    def test_only_a_simulated_plant_is_started_anew(self, bed: BedDriver) -> None:
        about = self.connected(bed)
        if Capability.SIMULATED in about.capabilities:
            assert bed.preset(rate=0.0, seed=1, repeat=2).state == BedState.DISARMED
        else:
            with refused("E406"):
                bed.preset()


class LockStep(Conformance):
    """The tests for a bed without a time of its own."""

    def test_it_advances_by_the_same_ticks_with_each_exchange_and_with_nothing_else(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        start = bed.read().tick
        ticks = round(self.period * about.tick_hz)
        for n in range(1, 30):
            time.sleep(0.001)
            sample = bed.exchange(0.0, 0.0)
            assert sample is not None and sample.tick == start + n * ticks
            assert bed.read().tick == sample.tick

    def test_it_advances_while_it_is_not_armed(self, bed: BedDriver) -> None:
        about = self.connected(bed)
        start = bed.read().tick
        sample = bed.exchange(0.0, 0.0)
        assert sample is not None and sample.refused
        assert sample.tick == start + round(self.period * about.tick_hz)
        assert bed.rest(0.3).tick == sample.tick + round(0.3 * about.tick_hz)

    def test_the_same_commands_make_the_same_samples(self, bed: BedDriver) -> None:
        about = self.connected(bed)
        runs = []
        for _ in range(2):
            bed.preset(rate=0.0, seed=3, repeat=1)
            start = bed.read().tick
            bed.arm()
            samples = [bed.exchange(self.share * about.limits.voltage * math.sin(0.1 * n), 0.0) for n in range(100)]
            runs.append([(s.rate, s.angle, s.tick - start) for s in samples if s is not None])
            bed.rest(2.0)
        assert len(runs[0]) == 100 and runs[0] == runs[1]


class FreeRunning(Conformance):
    """The tests for a bed with a time of its own."""

    def test_it_stays_armed_as_long_as_it_is_spoken_to(self, bed: BedDriver) -> None:
        self.driven(bed)
        assert self.drive(bed, 0.3).state == BedState.ARMED

    def test_silence_stops_it(self, bed: BedDriver) -> None:
        about = self.driven(bed)
        self.drive(bed, 0.01, voltage=self.share * about.limits.voltage)
        self.wait(bed, 2.0 * about.deadman)
        assert self.outputs(bed) in (None, (0.0, 0.0))
        self.faulted(bed, bed.read(), Fault.DEADMAN)

    def test_reading_it_does_not_keep_it_armed(self, bed: BedDriver) -> None:
        self.driven(bed)
        for _ in range(60):
            self.wait(bed, 1e-3)
            sample = bed.read()
        assert sample.state == BedState.STOPPED and sample.faults & Fault.DEADMAN

    def test_its_ticks_are_those_of_its_rate(self, bed: BedDriver) -> None:
        about = self.connected(bed)
        began = bed.read().tick
        self.wait(bed, 0.5)
        assert bed.read().tick - began == pytest.approx(0.5 * about.tick_hz, rel=0.1)


class Simulated(Conformance):
    """The tests for a bed without a motor."""

    def test_a_plant_is_started_at_a_rate(self, bed: BedDriver) -> None:
        about = self.connected(bed)
        rate = 0.5 * about.limits.arming_rate
        assert bed.preset(rate=rate).rate == pytest.approx(rate, abs=about.scales.rate)

    def test_a_plant_is_not_started_while_it_is_armed(self, bed: BedDriver) -> None:
        self.driven(bed)
        with refused("E406"):
            bed.preset(rate=1.0)

    def test_a_plant_started_fast_is_not_armed_until_it_is_slow(self, bed: BedDriver) -> None:
        about = self.connected(bed)
        bed.preset(rate=2.0 * about.limits.arming_rate)
        with refused("E406"):
            bed.arm()
        bed.rest(3.0)
        assert bed.arm().state == BedState.ARMED
