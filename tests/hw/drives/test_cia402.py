"""Drives of CiA 402 pass what every bed must, and one that is none that MET knows is found when it is greeted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hw.bed import BedDriver, BedState, Fault
from hw.beds.can_bed import CanBed
from hw.drives.bench_file import two_drives
from hw.drives.drive import CanFrame
from tests.hw.conftest import refusal
from tests.hw.drives.played import PlayedConformance, bench_file, host_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.players.cia402 import PlayedCia402
from tests.hw.players.player import PlayedBench


class TestCia402(PlayedConformance):
    dialect = "cia402"

    @pytest.fixture
    def bed(self, tmp_path: Path) -> Iterator[BedDriver]:
        with self.opened(tmp_path) as bed:
            yield bed


class TestCia402ToldRates(TestCia402):
    drive_told = "rate"

    def rate_told(self) -> float:
        drive = self.played.drive
        assert isinstance(drive, PlayedCia402)
        return drive.rate_told if drive.value(0x6060) == 9 else float("nan")

    def weaken(self) -> None:
        drive = self.played.drive
        assert isinstance(drive, PlayedCia402)
        drive.set_value(0x6072, 0, 50)


def bench(folder: Path) -> tuple[CanBed, PlayedLine, PlayedBench, PlayedCia402, PlayedCia402]:
    played = played_bench("cia402")
    line = PlayedLine(played)
    assert isinstance(played.drive, PlayedCia402) and isinstance(played.load, PlayedCia402)
    return host_of(two_drives(bench_file(folder, "cia402")), line), line, played, played.drive, played.load


def test_its_limits_and_steps_are_those_of_its_objects(tmp_path: Path) -> None:
    bed, _, _, _, load = bench(tmp_path)
    load.set_value(0x6072, 0, 500)
    with bed:
        about = bed.connect()
        assert about.limits.current == pytest.approx(0.5 * 0.2 / 0.06)
        assert about.scales.current == pytest.approx(1e-3 * 0.2 / 0.06)
        bed.arm()
        assert (load.value(0x6060), load.value(0x1016, 1), load.value(0x6007)) == (10, 127 << 16 | 20, 1)


@pytest.mark.parametrize(("unit", "step"), [(0x00B44700, 0.105), (0xFDB44700, 0.000105)])
def test_its_rate_is_in_the_unit_that_it_says(tmp_path: Path, unit: int, step: float) -> None:
    bed, line, played, drive, load = bench(tmp_path)
    drive.set_value(0x60A9, 0, unit)
    load.set_value(0x60A9, 0, unit)
    with bed:
        bed.connect()
        bed.arm()
        for _ in range(300):
            line.sleep(1e-3)
            sample = bed.exchange(3.0, 0.0)
        assert sample is not None and abs(sample.rate - played.shaft.rate) <= step + 1e-4
        assert played.shaft.rate > 20.0


def test_each_arming_sees_both_fail_by_the_missing_heartbeat(tmp_path: Path) -> None:
    bed, line, played, drive, load = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        assert (drive.status, load.status) == (0x27, 0x27)
        line.sleep(0.05)
        assert played.off and (drive.error, load.error) == (0x8130, 0x8130)
        assert bed.read().faults == Fault.DEADMAN


def test_one_that_misses_no_heartbeat_is_not_armed(tmp_path: Path) -> None:
    bed, _, played, drive, _ = bench(tmp_path)
    with bed:
        bed.connect()
        drive.watches = False
        assert refusal(bed.arm).startswith("error[E406]: drive (node 1) still drives 50 ms after the last command")
        assert played.off


def test_a_fault_in_a_run_stops_both_and_is_said(tmp_path: Path) -> None:
    bed, line, played, drive, _ = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        for n in range(50):
            line.sleep(1e-3)
            if n == 20:
                for frame in drive.fail(0x3210):
                    line._put(frame, True, line.now())
            sample = bed.exchange(3.0, 0.0)
            if sample is not None and sample.state != BedState.ARMED:
                break
        assert played.off and bed._faults == Fault.DRIVE
        assert " = help: drive (node 1): error 0x3210\n" in refusal(bed.arm)


def test_one_that_drives_when_it_is_greeted_is_off_before_its_mode_is_changed(tmp_path: Path) -> None:
    bed, line, played, drive, _ = bench(tmp_path)
    for index, value in ((0x6060, 9), (0x6061, 9)):
        drive.set_value(index, 0, value)
    drive.status, drive.rate_told = 0x27, 50.0
    line.sleep(0.1)
    assert played.shaft.rate > 1.0
    changed: list[int] = []
    line.spoil = lambda frame, from_drive: (
        (changed.append(drive.status) if frame.data[:3] == b"\x2f\x60\x60" else None) or [(0.0, frame)]
    )
    bed.connect()
    assert len(changed) == 2 and 0x27 not in changed and played.off


def test_one_that_stays_in_another_mode_is_not_armed(tmp_path: Path) -> None:
    """It would go on with the rate that it was told last."""
    bed, _, played, drive, _ = bench(tmp_path)
    drive.set_value(0x6061, 0, 9)
    drive.refuses.add(0x6061)
    with bed:
        bed.connect()
        assert refusal(bed.arm) == (
            "error[E406]: drive (node 1) does not begin to drive: it is in mode 9, and not in 10\n"
            " = help: is it calibrated? its maker's tool says what it lacks"
        )
        assert played.off


def test_a_mode_that_changes_in_a_run_stops_both(tmp_path: Path) -> None:
    bed, line, played, drive, _ = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        drive.set_value(0x6061, 0, 9)
        line.sleep(1e-3)
        sample = bed.exchange(1.0, 0.0)
        assert sample is not None and sample.state == BedState.STOPPED and played.off


@pytest.mark.parametrize("index", [0x6007, 0x6060])
def test_a_setting_that_it_does_not_take_is_found(tmp_path: Path, index: int) -> None:
    bed, _, _, drive, _ = bench(tmp_path)
    drive.refuses.add(index)
    words = refusal(bed.connect)
    assert words.startswith("error[E404]: drive (node 1) cannot be driven: it does not take ")
    assert f" for object {index:04X}h:0, which is 0\n = help: set it by its maker's tool" in words


def test_one_told_rates_that_keeps_a_larger_torque_than_the_bench_bears_is_refused(tmp_path: Path) -> None:
    bed, _, _, drive, _ = bench(tmp_path)
    bed._kind = "rate"
    drive.set_value(0x6072, 0, 3000)
    drive.refuses.add(0x6072)
    assert " it does not take 2000 for object 6072h:0, which is 3000\n" in refusal(bed.connect)


def test_one_that_has_stopped_does_not_drive_again_by_itself(tmp_path: Path) -> None:
    """An emergency stop that is pressed and let go while the other drive is not heard."""
    bed, line, _, drive, load = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        line.spoil = lambda frame, from_drive: [] if frame.id == 0x280 + load.node else [(0.0, frame)]
        drive.status, drive.torque = 0x40, 0.0
        for _ in range(8):
            line.sleep(1e-3)
            bed.exchange(1.0, 0.0)
            assert drive.status == 0x40


def test_an_emergency_from_before_is_not_why_a_drive_stops_when_its_watchdog_is_proved(tmp_path: Path) -> None:
    bed, line, _, _, load = bench(tmp_path)
    with bed:
        bed.connect()
        assert bed._drives[1].take(CanFrame(0x80 + load.node, bytes.fromhex("2580000000000000")))
        bed.arm()
        line.sleep(1e-3)
        assert bed.exchange(0.0, 0.0) is not None


def test_one_whose_steps_of_rate_hide_a_shaft_that_turns_is_refused(tmp_path: Path) -> None:
    bed, _, _, drive, _ = bench(tmp_path)
    drive.set_value(0x60A9, 0, 0x00B40300)
    assert refusal(bed.connect) == (
        "error[E404]: bed `paper` has its rate in steps of 6.28 rad/s, more than `arming_rate`\n"
        " = help: a finer unit of velocity in the drive: a shaft that turns would pass for one at rest"
    )


def test_no_torque_is_told_that_its_frame_cannot_hold(tmp_path: Path) -> None:
    bed, line, _, drive, _ = bench(tmp_path)
    bed._kind = "torque"
    drive.set_value(0x6076, 0, 10)
    drive.set_value(0x6072, 0, 60_000)
    with bed:
        bed.connect()
        bed.arm()
        line.sleep(1e-3)
        bed.exchange(0.39, 0.0)
        assert drive.torque == pytest.approx(0.32767)


def test_a_unit_of_velocity_in_which_its_speed_has_no_room_is_refused(tmp_path: Path) -> None:
    bed, _, _, drive, _ = bench(tmp_path)
    drive.set_value(0x60A9, 0, 0xF7B40300)
    assert refusal(bed.connect) == (
        "error[E404]: drive (node 1) cannot be driven: its largest speed, 628.3 rad/s, is more than 32 bits hold in "
        "its unit\n = help: set object 60A9h to thousandths of a turn a minute, 0xFDB44700"
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda drive: drive.set_value(0x1000, 0, 0x00020191),
            "error[E403]: drive (node 1) is no cia402 of a kind that MET knows: its device profile is 401, and a",
        ),
        (
            lambda drive: drive.set_value(0x6502, 0, 0x1ED),
            "error[E403]: drive (node 1) is no cia402 of a kind that MET knows: it has no cyclic synchronous torque",
        ),
        (
            lambda drive: drive.set_value(0x60A9, 0, 0x00010300),
            "error[E404]: drive (node 1) cannot be driven: its unit of velocity is 0x00010300\n",
        ),
        (
            lambda drive: drive.set_value(0x6076, 0, 0),
            "error[E404]: drive (node 1) cannot be driven: a limit or a unit of its is 0\n",
        ),
        (
            lambda drive: setattr(drive, "node", 9),
            "error[E402]: no cia402 answers object 1000h:0 as drive (node 1) on the bus\n",
        ),
    ],
)
def test_one_that_is_not_known_is_found(tmp_path: Path, change: Callable[[PlayedCia402], None], said: str) -> None:
    bed, _, _, drive, _ = bench(tmp_path)
    change(drive)
    assert refusal(bed.connect).startswith(said)


OFFSETS = {0x60B1: 300, 0x60B2: -250}
"""Turns a minute and thousandths of the rated torque that a drive adds to what it is told."""


def test_offsets_that_were_saved_are_added_to_nothing(tmp_path: Path) -> None:
    """They are set to 0 when it is greeted, and again before it is armed."""
    for kind in ("torque", "rate"):
        bed, line, played, drive, _ = bench(tmp_path)
        bed._kind = kind  # type: ignore[assignment]
        drive.saved |= OFFSETS
        drive.reboot()
        with bed:
            bed.connect()
            assert [drive.value(index) for index in OFFSETS] == [0, 0]
            for index, value in OFFSETS.items():
                drive.set_value(index, 0, value)
            bed.arm()
            assert [drive.value(index) for index in OFFSETS] == [0, 0]
            for _ in range(20):
                line.sleep(1e-3)
                bed.exchange(0.0, 0.0)
            assert played.shaft.rate == 0.0 and drive.status == 0x27


@pytest.mark.parametrize(("index", "found"), OFFSETS.items())
def test_an_offset_that_stays_is_refused(tmp_path: Path, index: int, found: int) -> None:
    bed, _, _, drive, _ = bench(tmp_path)
    drive.set_value(index, 0, found)
    drive.refuses.add(index)
    assert refusal(bed.connect) == (
        "error[E404]: drive (node 1) cannot be driven: it does not take 0 for "
        f"object {index:04X}h:0, which is {found}\n"
        " = help: set it by its maker's tool"
    )


def test_a_drive_without_offsets_has_none(tmp_path: Path) -> None:
    bed, line, played, drive, _ = bench(tmp_path)
    for index in OFFSETS:
        del drive._node.object_dictionary[index]
    with bed:
        bed.connect()
        bed.arm()
        line.sleep(1e-3)
        assert bed.exchange(0.0, 0.0) is not None and played.shaft.rate == 0.0


def test_an_object_that_it_has_not_is_named(tmp_path: Path) -> None:
    bed, _, _, drive, _ = bench(tmp_path)
    del drive._node.object_dictionary[0x6502]
    assert refusal(bed.connect) == (
        "error[E404]: drive (node 1) cannot be driven: it refuses object 6502h:0, 0x06020000\n"
        " = help: its documentation says whether it has that object"
    )
