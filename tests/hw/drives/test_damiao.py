"""Damiao's drives pass what every bed must, and one that is none that MET knows is found when it is greeted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hw.bed import BedDriver, BedState, Fault
from hw.beds.can_bed import CanBed
from hw.drives.bench_file import two_drives
from hw.drives.mit import STEPS_12, STEPS_16, count_of, packed, value_of
from tests.hw.conftest import refusal
from tests.hw.drives.played import HalfStepConformance, bench_file, go, host_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.players.damiao import PlayedDamiao
from tests.hw.players.player import PlayedBench


class TestDamiao(HalfStepConformance):
    dialect, torque_step = "damiao", 2.0 / STEPS_12

    @pytest.fixture
    def bed(self, tmp_path: Path) -> Iterator[BedDriver]:
        with self.opened(tmp_path) as bed:
            yield bed


def test_a_frame_is_laid_out_as_the_protocol_says() -> None:
    """16, 12, 12, 12, 12 bits, the first the highest: the bytes of an example worked by hand."""
    assert packed(0x1234, 0xABC, 0xDEF, 0x567, 0x89A).hex() == "1234abcdef56789a"
    assert count_of(12.5, 12.5, STEPS_16) == STEPS_16 and count_of(-12.5, 12.5, STEPS_16) == 0
    assert value_of(0, 10.0, STEPS_12) == -10.0 and value_of(STEPS_12, 10.0, STEPS_12) == pytest.approx(10.0, rel=1e-15)


@pytest.mark.parametrize("value", [-10.0, -3.3, -0.003, 0.0, 1e-9, 0.0024, 0.0025, 7.7, 10.0, 99.0])
def test_what_is_told_is_never_more_than_what_was_asked_for(value: float) -> None:
    step = 20.0 / STEPS_12
    told = value_of(count_of(value, 10.0, STEPS_12), 10.0, STEPS_12)
    assert abs(told) <= max(abs(value), 0.5001 * step) and abs(told - max(min(value, 10.0), -10.0)) <= step


def bench(folder: Path) -> tuple[CanBed, PlayedLine, PlayedBench, PlayedDamiao]:
    played = played_bench("damiao")
    line = PlayedLine(played)
    assert isinstance(played.drive, PlayedDamiao)
    return host_of(two_drives(bench_file(folder, "damiao")), line), line, played, played.drive


@pytest.mark.slow
def test_its_angle_goes_on_where_its_range_ends(tmp_path: Path) -> None:
    bed, line, played, _ = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        go(bed, line, 2.0, 3.0)
        assert bed._state == BedState.ARMED and played.shaft.angle > 4 * 12.5
        assert bed.read().angle == pytest.approx(played.shaft.angle, abs=0.2)


def test_its_rate_is_known_to_a_step(tmp_path: Path) -> None:
    bed, line, played, _ = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        go(bed, line, 1.0, 3.0)
        sample = bed.exchange(3.0, 0.0)
        assert sample is not None and abs(sample.rate - played.shaft.rate) <= 560.0 / STEPS_12


def test_an_angle_that_stays_at_the_end_of_its_range_stops_the_bed(tmp_path: Path) -> None:
    bed, line, played, _ = bench(tmp_path)
    for each in played.drives:
        assert isinstance(each, PlayedDamiao)
        each.wraps = False
    with bed:
        bed.connect()
        bed.arm()
        go(bed, line, 2.0, 3.0)
        assert played.off and bed._faults == Fault.DISAGREEMENT
        assert 12.5 < played.shaft.angle < 17.0


def greeting(folder: Path, change: Callable[[PlayedDamiao], object]) -> str:
    bed, _, _, drive = bench(folder)
    change(drive)
    return refusal(bed.connect)


def test_one_that_is_not_there_is_found(tmp_path: Path) -> None:
    words = greeting(tmp_path, lambda drive: setattr(drive, "node", 3))
    assert words.startswith("error[E402]: no damiao answers what its register 14 is as drive (node 1) on the bus\n")


@pytest.mark.parametrize(
    ("register", "said"), [(9, "400 for register 9, which is 0"), (10, "1 for register 10, which is 2")]
)
def test_a_register_that_does_not_take_what_it_is_set_to_is_found(tmp_path: Path, register: int, said: str) -> None:
    words = greeting(tmp_path, lambda drive: drive.refuses.add(register))
    assert words.startswith(f"error[E404]: drive (node 1) cannot be driven: it does not take {said}\n")


def test_ranges_that_are_no_numbers_are_found(tmp_path: Path) -> None:
    words = greeting(tmp_path, lambda drive: drive.registers.update({23: -1.0}))
    assert "cannot be driven: what its fields or its overvoltage stand for is no number above zero\n" in words


def test_an_odrive_that_is_taken_for_one_is_recognised(tmp_path: Path) -> None:
    line = PlayedLine(played_bench("odrive"))
    words = refusal(host_of(two_drives(bench_file(tmp_path, "damiao")), line).connect)
    assert " = help: 0x21 looks like the heartbeat of an ODrive, node 1\n" in words


def test_a_drive_that_has_lost_its_settings_is_not_armed(tmp_path: Path) -> None:
    """Its watchdog's time was not saved: it says so by going on driving."""
    bed, _, played, drive = bench(tmp_path)
    with bed:
        bed.connect()
        drive.registers[9] = 0
        assert "drive (node 1) still drives 50 ms after the last command" in refusal(bed.arm)
        assert played.off
