"""moteus pass what every bed must, and one that is none that MET knows is found when it is greeted."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hw.bed import BedDriver, BedState, Capability, Fault
from hw.beds.can_bed import CanBed
from hw.drives.bench_file import two_drives
from hw.drives.drive import CanFrame
from hw.drives.moteus import MoteusDrive, answered, asked_for, number, padded, written
from tests.hw.conftest import refusal
from tests.hw.drives.played import PlayedConformance, bench_file, go, host_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.players.moteus import PlayedMoteus
from tests.hw.players.player import PlayedBench


class TestMoteus(PlayedConformance):
    dialect = "moteus"

    @pytest.fixture
    def bed(self, tmp_path: Path) -> Iterator[BedDriver]:
        with self.opened(tmp_path) as bed:
            yield bed


def test_a_frame_is_what_the_maker_s_example_is() -> None:
    """The example of mjbots' description of the protocol: position mode, three values, two questions."""
    frame = written(0, 0x00, 10) + written(1, 0x20, 0x60, 0x120, -176) + bytes([0x14, 4, 0]) + asked_for(0, 0x0D, 3)
    assert frame.hex() == "01000a07206000200150ff140400130d" and padded(frame) == frame
    found = answered(bytes.fromhex("2404000a005000000170ff230d181400"))
    assert found == {0: 10, 1: 80, 2: 256, 3: -144, 13: 24, 14: 20, 15: 0}


@pytest.mark.parametrize("text", ["2f00", "2404", "99", "2b80", "2480808080808080", "300102ff"])
def test_an_answer_that_breaks_off_is_none(text: str) -> None:
    assert answered(bytes.fromhex(text)) is None


def test_errors_of_an_answer_are_passed_over_and_long_numbers_have_two_bytes() -> None:
    assert answered(bytes.fromhex("308002012100075050")) == {0: 7}
    assert number(0x102) == bytes([0x82, 0x02]) and number(0x7F) == b"\x7f"
    assert len(padded(bytes(33))) == 48 and padded(b"")[:1] == b""


def bench(folder: Path) -> tuple[CanBed, PlayedLine, PlayedBench, PlayedMoteus, PlayedMoteus]:
    played = played_bench("moteus")
    line = PlayedLine(played)
    assert isinstance(played.drive, PlayedMoteus) and isinstance(played.load, PlayedMoteus)
    return host_of(two_drives(bench_file(folder, "moteus")), line), line, played, played.drive, played.load


def test_it_brakes_where_it_is_stopped(tmp_path: Path) -> None:
    bed, line, _, drive, load = bench(tmp_path)
    with bed:
        assert Capability.COASTS not in bed.connect().capabilities
        bed.arm()
        go(bed, line, 0.3, 5.0)
        bed.stop()
        assert (drive.mode, load.mode) == (15, 0)
        assert abs(bed.rest(0.5).rate) < 1.0


def test_a_fault_at_rest_is_not_forgotten_by_arming(tmp_path: Path) -> None:
    """Stopping a moteus clears its fault: so it is not stopped to be armed before somebody has said so."""
    bed, _, played, _, load = bench(tmp_path)
    with bed:
        bed.connect()
        load.fail(35)
        assert refusal(bed.arm) == (
            "error[E406]: bed `paper` does not arm: it stopped itself: a drive stopped itself\n"
            " = help: load (node 2): encoder\n"
            " = help: its maker's tool says why: a current, a temperature, its encoder"
        )
        assert load.fault == 35 and played.off
        assert bed.read().faults == Fault.DRIVE
        bed.clear()
        assert load.mode == 0
        assert bed.arm().state == BedState.ARMED


def test_a_fault_in_a_run_stops_both_and_stays(tmp_path: Path) -> None:
    bed, line, played, drive, _ = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        go(bed, line, 0.05, 5.0)
        drive.fail(33)
        go(bed, line, 0.05, 5.0)
        assert played.off and drive.fault == 33
        assert " = help: drive (node 1): gate driver\n" in refusal(bed.arm)


def test_each_command_carries_its_largest_torque_and_its_time(tmp_path: Path) -> None:
    seen: list[dict[int, float]] = []
    bed, line, _, drive, _ = bench(tmp_path)
    obey = drive._obey
    drive._obey = lambda told, now: (seen.append(told), obey(told, now))[1]  # type: ignore[method-assign]
    with bed:
        bed.connect()
        bed.arm()
        go(bed, line, 0.01, 20.0)
    told = [each for each in seen if each.get(0) == 10][-1]
    assert told[0x25] == pytest.approx(0.4, rel=1e-6) and told[0x27] == pytest.approx(0.020, rel=1e-6)
    assert told[0x22] == pytest.approx(0.4, rel=1e-6) and math.isnan(told[0x20])
    assert (told[0x23], told[0x24], told[0x2B]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda drive: setattr(drive, "about", (4, 0x010304, 9)),
            "error[E403]: drive (node 1) is no moteus of a kind that MET knows: its register map is of version 9\n",
        ),
        (
            lambda drive: setattr(drive, "node", 7),
            "error[E402]: no moteus answers what model it is as drive (node 1) on the bus\n",
        ),
    ],
)
def test_one_that_is_not_known_is_found(tmp_path: Path, change: Callable[[PlayedMoteus], None], said: str) -> None:
    bed, _, _, drive, _ = bench(tmp_path)
    change(drive)
    assert refusal(bed.connect).startswith(said)


def test_one_whose_watchdog_does_nothing_is_not_armed(tmp_path: Path) -> None:
    bed, _, played, _, load = bench(tmp_path)
    with bed:
        bed.connect()
        load.watches = False
        assert refusal(bed.arm).startswith("error[E406]: load (node 2) still drives 50 ms after the last command")
        assert played.off


@pytest.mark.parametrize("power", [-math.inf, math.inf, math.nan])
def test_a_power_that_is_no_number_is_none_that_was_said(tmp_path: Path, power: float) -> None:
    """Else a bed would tell that its drives gave infinite energy back."""
    drive = MoteusDrive(two_drives(bench_file(tmp_path, "moteus")).drive)
    state = struct.pack("<BBfff", 0x2F, 0x00, 10.0, 0.1, 0.2) + struct.pack("<BBf", 0x2D, 0x07, power)
    state += struct.pack("<BBf", 0x2D, 0x0D, 24.0) + struct.pack("<BBb", 0x21, 0x0F, 0)
    assert drive.take(CanFrame(drive.node << 8, padded(state), fd=True))
    assert drive.supply == 24.0 and drive.power is None
