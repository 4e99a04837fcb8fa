"""Drives of CiA 402 pass what every bed must, and one that is none that MET knows is found when it is greeted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hw.bed import BedDriver, BedState, Fault
from hw.beds.can_bed import CanBed
from hw.drives.bench_file import two_drives
from hw.players.cia402 import PlayedCia402
from hw.players.player import PlayedBench, PlayedLine
from tests.hw.conftest import refusal
from tests.hw.drives.played import PlayedConformance, bench_file, host_of, played_bench


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


def test_an_object_that_it_has_not_is_named(tmp_path: Path) -> None:
    bed, _, _, drive, _ = bench(tmp_path)
    del drive._node.object_dictionary[0x6502]
    assert refusal(bed.connect) == (
        "error[E404]: drive (node 1) cannot be driven: it refuses object 6502h:0, 0x06020000\n"
        " = help: its documentation says whether it has that object"
    )
