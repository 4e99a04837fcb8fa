"""A bed of two drives proves their watchdogs, takes an answer only where both agree, and stops where it must."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import ic
from batch.beds.probe import ProbeResult, lines
from hw.bed import BedState, Capability, Fault
from hw.beds.can_bed import CanBed
from hw.drivers import check_model, opened
from hw.drives.bench_file import two_drives
from hw.ports import Port
from met.substitution.bed import DriveCommand
from tests.hw.conftest import refusal
from tests.hw.drives.played import INERTIA, KT, RESISTANCE, bench_file, host_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.players.odrive import PlayedOdrive
from tests.hw.players.player import PlayedBench


class Bench:
    """A bed of two played ODrives, and all of it."""

    def __init__(self, folder: Path, edit: Callable[[str], str] = lambda text: text, period: float = 1e-3) -> None:
        path = bench_file(folder)
        path.write_text(edit(path.read_text()))
        self.played: PlayedBench = played_bench()
        self.line = PlayedLine(self.played)
        self.bed: CanBed = host_of(two_drives(path), self.line, period)

    @property
    def drive(self) -> PlayedOdrive:
        assert isinstance(self.played.drive, PlayedOdrive)
        return self.played.drive

    @property
    def load(self) -> PlayedOdrive:
        assert isinstance(self.played.load, PlayedOdrive)
        return self.played.load

    def go(self, seconds: float, voltage: float = 0.0, current: float = 0.0) -> None:
        for _ in range(round(seconds / 1e-3)):
            self.line.sleep(1e-3)
            sample = self.bed.exchange(voltage, current)
            if sample is not None and sample.state != BedState.ARMED:
                return


@pytest.fixture
def on(tmp_path: Path) -> Iterator[Callable[..., Bench]]:
    made = []

    def make(*edits: tuple[str, str], period: float = 1e-3) -> Bench:
        def edit(text: str) -> str:
            for old, new in edits:
                assert old in text
                text = text.replace(old, new, 1)
            return text

        made.append(Bench(tmp_path, edit, period))
        return made[-1]

    yield make
    for each in made:
        each.bed.close()
        assert each.played.off


@pytest.mark.slow
def test_it_is_told_what_an_armature_would_take(on: Callable[..., Bench]) -> None:
    """The shaft goes as one with a motor of kt and resistance: to the rate where back-EMF and friction balance."""
    bench = on()
    bench.bed.connect()
    bench.bed.arm()
    bench.go(1.5, voltage=3.0)
    drag = KT * KT / RESISTANCE + 1e-4
    final = (KT * 3.0 / RESISTANCE - 1e-3) / drag
    assert bench.played.shaft.rate == pytest.approx(final, rel=1e-3)
    bench.go(0.3, voltage=3.0, current=-0.5)
    decay = math.exp(-drag / INERTIA * 0.3)
    assert bench.played.shaft.rate == pytest.approx(final - KT * 0.5 / drag * (1.0 - decay), rel=5e-3)


def test_each_arming_sees_both_watchdogs_stop_their_drive(on: Callable[..., Bench]) -> None:
    bench = on()
    about = bench.bed.connect()
    for _ in range(3):
        begun = bench.line.now()
        bench.bed.arm()
        first, second = bench.bed.proved
        assert first is not None and 0.5 * about.deadman < first < about.deadman + 0.006
        assert second is not None and 0.5 * about.deadman < second < about.deadman + 0.006
        assert bench.line.now() - begun < 0.1
        bench.bed.stop()


@pytest.mark.parametrize("role", ["drive", "load"])
def test_a_drive_whose_watchdog_does_nothing_is_not_armed(on: Callable[..., Bench], role: str) -> None:
    bench = on()
    bench.bed.connect()
    getattr(bench, role).watches = False
    words = refusal(bench.bed.arm)
    assert words == (
        f"error[E406]: {role} (node {1 if role == 'drive' else 2}) still drives 50 ms after the last command, without "
        "torque, and its watchdog was to stop it after 20 ms\n"
        " = help: it is not armed; look whether its watchdog is switched on\n"
        " = help: nothing else stops it without a host\n"
        " = help: another program or computer that commands it feeds its watchdog, too"
    )
    assert bench.played.off and bench.bed.read().state == BedState.DISARMED


def test_a_host_that_dies_leaves_both_drives_off_within_their_watchdog(on: Callable[..., Bench]) -> None:
    bench = on()
    about = bench.bed.connect()
    bench.bed.arm()
    bench.go(0.1, voltage=5.0, current=0.5)
    died = bench.line.now()
    while not bench.played.off:
        bench.line.sleep(1e-4)
    assert bench.line.now() - died <= about.deadman + 1e-3


def test_a_coupling_that_slips_stops_the_bed(on: Callable[..., Bench]) -> None:
    bench = on()
    bench.bed.connect()
    bench.bed.arm()
    bench.go(0.1, voltage=5.0)
    bench.played.slip = 0.3
    bench.go(0.1, voltage=5.0)
    sample = bench.bed.read
    assert bench.played.off
    assert refusal(sample).startswith("error[E406]: bed `paper`: the two drives do not agree about the shaft\n")


def test_a_load_that_counts_the_other_way_round_is_found_before_the_shaft_is_fast(on: Callable[..., Bench]) -> None:
    bench = on(("reversed      = true", "reversed      = false"))
    bench.bed.connect()
    bench.bed.arm()
    bench.go(0.5, voltage=2.0)
    assert bench.played.off and abs(bench.played.shaft.rate) < 10.0
    assert bench.bed._faults == Fault.DISAGREEMENT


@pytest.mark.parametrize("whose", ["the bench's", "the drive's"])
def test_a_supply_that_rises_stops_the_bed(on: Callable[..., Bench], whose: str) -> None:
    bench = on()
    bench.bed.connect()
    bench.bed.arm()
    bench.go(0.05, voltage=5.0)
    bench.load.values["vbus_voltage"] = 41.0 if whose == "the bench's" else 57.0
    bench.go(0.05, voltage=5.0)
    sample = bench.bed.read()
    assert sample.state == BedState.STOPPED and bench.played.off
    assert sample.faults == {"the bench's": Fault.SUPPLY, "the drive's": Fault.DRIVE}[whose]
    assert {"the bench's": " = help: 41 V\n", "the drive's": "supply over voltage\n"}[whose] in refusal(bench.bed.arm)


def test_what_a_drive_gives_back_is_summed_up(on: Callable[..., Bench]) -> None:
    bench = on()
    bench.bed.connect()
    bench.bed.arm()
    bench.go(0.5, voltage=4.0)
    assert bench.bed.returned < 0.01
    before = 0.5 * INERTIA * bench.played.shaft.rate**2
    bench.go(0.3, voltage=2.0)  # long against the 20 ms after which a drive says its power again
    assert 0.3 * before < bench.bed.returned < 1.2 * before  # of the 0.75 that half the rate leaves


def test_a_drive_that_stops_itself_stops_the_bed_and_says_why(on: Callable[..., Bench]) -> None:
    bench = on()
    bench.bed.connect()
    bench.bed.arm()
    bench.go(0.05, voltage=5.0)
    bench.drive._failed(1 << 13)
    bench.go(0.05, voltage=5.0)
    assert bench.played.off
    assert refusal(bench.bed.arm) == (
        "error[E406]: bed `paper` does not arm: it stopped itself: a drive stopped itself\n"
        " = help: drive (node 1): motor too hot\n"
        " = help: its maker's tool says why: a current, a temperature, its encoder"
    )


def test_a_load_that_is_hot_stops_the_bed_and_has_to_cool(on: Callable[..., Bench]) -> None:
    bench = on(('"9 A^2*s"', '"1 A^2*s"'))
    bench.bed.connect()
    bench.bed.arm()
    for n in range(500):
        bench.go(1e-3, current=3.0 if n // 10 % 2 else -3.0)
    sample = bench.bed.read()
    assert (sample.state, sample.faults) == (BedState.STOPPED, Fault.HEAT) and bench.played.off
    assert "the load motor has not cooled down" in refusal(bench.bed.clear)
    bench.bed.rest(1.0)
    assert bench.bed.clear().state == BedState.DISARMED


def test_the_limits_are_the_tighter_of_the_file_s_and_the_drives(on: Callable[..., Bench]) -> None:
    bench = on()
    bench.load.values["axis0.config.motor.current_soft_max"] = 2.5
    bench.drive.values["axis0.controller.config.vel_limit"] = 10.0
    about = bench.bed.connect()
    assert about.limits.current == pytest.approx(2.5, rel=1e-6)
    assert about.limits.rate == pytest.approx(20.0 * math.pi, rel=1e-6)
    assert Capability.COASTS in about.capabilities


def test_the_rate_is_behind_the_filter_that_the_file_says(on: Callable[..., Bench]) -> None:
    """As a Butterworth low-pass of order 2 makes it of the rates that were read, in straight lines between them; here
    integrated in small steps."""
    bench = on(('rate_max = "380 rad/s"', 'rate_max = "380 rad/s"\nfilter = "50 Hz"'))
    bench.bed.connect()
    bench.bed.arm()
    corner, y, slope = 2.0 * math.pi * 50.0, 0.0, 0.0
    time, rate = bench.bed._sides[0].time, bench.bed._sides[0].rate
    for n in range(100):
        bench.go(1e-3, voltage=8.0 * math.sin(0.2 * n), current=0.3)
        side, steps = bench.bed._sides[0], 6000  # of the first order: three times as many have a third of the error
        step = (side.time - time) / steps
        for k in range(steps):
            there = rate + (k + 0.5) / steps * (side.rate - rate)
            slope += step * (corner * corner * (there - y) - math.sqrt(2.0) * corner * slope)
            y += step * slope
        time, rate = side.time, side.rate
    assert bench.bed._sample().rate == pytest.approx(y, abs=1e-3) and abs(rate - y) > 1.0


def test_frames_that_do_not_fit_into_a_period_are_refused(on: Callable[..., Bench]) -> None:
    bench = on(period=0.5e-3)
    assert refusal(bench.bed.connect) == (
        "error[E405]: the frames of an exchange take 114% of its period of 0.5 ms on the bus, and 80% is the most\n"
        " = help: a lower rate of the servo, or a faster bus"
    )
    assert bench.line.closed


@pytest.mark.parametrize("time", ["9 ms", "50 ms"])
def test_a_watchdog_is_10_to_20_ms(on: Callable[..., Bench], time: str) -> None:
    bench = on(
        ('kt          = "0.06 N*m/A"', f'kt = "0.06 N*m/A"\nwatchdog = "{time}"'),
        ("heat ", f'watchdog = "{time}"\nheat '),
    )
    assert refusal(bench.bed.connect).startswith(f"error[E404]: bed `paper` would stop {time.split()[0]} ms late\n")


def test_a_drive_that_says_that_it_stopped_stops_the_other_though_that_does_not_answer(
    on: Callable[..., Bench],
) -> None:
    bench = on()
    bench.bed.connect()
    bench.bed.arm()
    bench.go(0.05, voltage=3.0, current=0.5)
    load = bench.load.node << 5
    bench.line.spoil = lambda frame, from_drive: [] if from_drive and frame.id & ~0x1F == load else [(0.0, frame)]
    bench.drive._failed(1 << 12)
    sample, begun = None, bench.line.now()
    while sample is None and bench.line.now() < begun + 8e-3:
        bench.line.sleep(1e-3)
        sample = bench.bed.exchange(3.0, 0.5)
    assert sample is not None and sample.state == BedState.STOPPED and sample.faults == Fault.DRIVE
    assert bench.played.off


def test_it_says_what_went_back_to_the_supply(on: Callable[..., Bench]) -> None:
    bench = on()
    bench.bed.connect()
    bench.bed.arm()
    bench.go(0.5, voltage=4.0)
    bench.go(0.05, voltage=-4.0)
    bench.bed.stop()
    assert bench.bed.account() == (f"the drives gave {bench.bed.returned:.3g} J back to the supply",)
    bench.bed._drives[0].power = None
    said = f"the load, which alone says it, gave {bench.bed.returned:.3g} J back to the supply"
    assert bench.bed.account() == (said,)
    bench.bed._drives[1].power = None
    assert bench.bed.account() == ("neither drive says its power: what went back to the supply is not known",)


def test_a_torque_is_told_as_it_is_sent_up_to_the_largest(tmp_path: Path) -> None:
    played, path = played_bench(), bench_file(tmp_path)
    line = PlayedLine(played)
    with host_of(two_drives(path), line, drive="torque") as bed:
        about = bed.connect()
        assert (about.drive, about.limits.voltage, about.version) == ("torque", 0.8, 0)
        bed.arm()
        line.sleep(1e-3)
        bed.exchange(0.05, 0.0)
        assert played.drive.output.value == pytest.approx(0.05, rel=1e-5)
        line.sleep(1e-3)
        bed.exchange(0.6, 0.0)
        assert played.drive.output.value == pytest.approx(0.4, rel=1e-6)
        words = refusal(lambda: bed.exchange(0.9, 0.0))
        assert words.startswith("error[E408]: a torque of 0.9 N*m for bed `paper` is beyond the limit of 0.799999 N*m;")
    assert played.off


DECK = """\
#include <two_link.ic>
run bench like nominal {
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    substitute shoulder { bed = torque_drive(delay = 1, f_cut = 80 Hz, kt_load = 0.06 N*m/A); }
}
sweep cuts of bench { vary shoulder.bed.f_cut = [50, 80] Hz; }
"""


@pytest.mark.slow
def test_a_filter_that_is_not_the_deck_s_is_refused(tmp_path: Path) -> None:
    path = bench_file(tmp_path)
    text = path.read_text().replace('rate_max = "380 rad/s"', 'rate_max = "380 rad/s"\nfilter   = "50 Hz"')
    path.write_text(text)
    (tmp_path / "deck.ic").write_text(DECK)
    bench, cuts = ic.compile(tmp_path / "deck.ic", select=["bench", "cuts"]).experiments
    words = refusal(lambda: check_model(f"can:{path}", bench, "shoulder")).replace(str(tmp_path), "FOLDER")
    assert words == (
        "error[E444]: the bench filters the rate at 50 Hz, and the `f_cut` of joint `shoulder` is 80 Hz\n"
        "  --> FOLDER/bench.toml:10:1\n"
        "   |\n"
        '10 | filter   = "50 Hz"\n'
        "   | ^^^^^^^^^^^^^^^^^^\n"
        "  ::: FOLDER/deck.ic:4:65  the deck's\n"
        "   = help: in the deck: `bed = ...(f_cut = 50 Hz)`\n"
        "   = help: or another `filter` in the bench's file"
    )
    assert "the `f_cut` of joint `shoulder` is varied by a sweep\n" in refusal(
        lambda: check_model(f"can:{path}", cuts, "shoulder")
    )
    path.write_text(text.replace("50 Hz", "80 Hz"))
    check_model(f"can:{path}", bench, "shoulder")
    path.write_text(text.replace("50 Hz", "80 Hz").replace('0.06 N*m/A"\ncurrent', '0.07 N*m/A"\ncurrent'))
    assert refusal(lambda: check_model(f"can:{path}", bench, "shoulder")).startswith(
        "error[E444]: the bench's load gives 0.07 N*m/A, and the `kt_load` of joint `shoulder` is 0.06 N*m/A\n"
    )


def test_a_bench_without_a_filter_says_whose_the_deck_s_has_to_be(tmp_path: Path) -> None:
    path = bench_file(tmp_path)
    (experiment,) = ic.compile(text=DECK, select=["bench"]).experiments
    check_model(f"can:{path}", experiment, "shoulder")
    bed = opened(Port(f"can:{path}"), experiment, "shoulder", 0, 1e-3)
    (warning,) = bed.warnings
    assert (warning.severity, warning.message) == (
        "warning",
        "the bench has no filter: the deck's `f_cut`, 80 Hz, has to be that of the drive's own rate",
    )
    assert warning.help == (f'else `filter = "80 Hz"` in `[shaft]` of {path}',)
    assert opened(Port(f"can:{path}"), None, "", 0, 1e-3).warnings == ()


def test_probe_has_words_for_what_a_bench_of_drives_is(tmp_path: Path) -> None:
    path = bench_file(tmp_path)
    kinds: dict[DriveCommand, str] = {
        "voltage": "drive torque of an armature at a voltage",
        "torque": "drive torque",
        "rate": "drive rate",
    }
    for kind, told in kinds.items():
        with host_of(two_drives(path), PlayedLine(played_bench()), drive=kind) as bed:
            about = bed.connect()
            rows = list(lines(ProbeResult("can:bench.toml", about, bed.read(), (), 0, 0.0, (), bed.remarks)))
        assert rows[1].endswith(", of what both drives say of themselves; they speak no protocol of MET's")
        assert rows[2] == (
            f"  has       {told}, load torque by a current, rate as the drive tells it, encoder, "
            "a shaft that coasts when it is stopped"
        )
