"""RobStrides pass what every bed must, and one that is none that MET knows is found when it is greeted."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hw.bed import BedDriver, BedState, Fault
from hw.beds.can_bed import CanBed
from hw.drives.bench_file import DriveEntry, two_drives
from hw.drives.drive import CanFrame
from hw.drives.mit import STEPS_16
from hw.drives.robstride import RobstrideDrive
from tests.hw.conftest import refusal
from tests.hw.drives.played import HalfStepConformance, bench_file, go, host_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.players.player import PlayedBench
from tests.hw.players.robstride import PlayedRobstride


class TestRobstride(HalfStepConformance):
    dialect, torque_step = "robstride", 11.0 / STEPS_16

    @pytest.fixture
    def bed(self, tmp_path: Path) -> Iterator[BedDriver]:
        with self.opened(tmp_path) as bed:
            yield bed


def one(node: int = 0x7F, model: str = "RS00") -> RobstrideDrive:
    return RobstrideDrive(DriveEntry("drive", "robstride", node, 1, {"watchdog": 0.020}, model=model))


def test_frames_are_those_of_the_manual_s_example() -> None:
    """Reading loc_kp of drive 0x7F: kind 17, host 0xFD (RS00 User Manual, 4.1.14)."""
    asked = one()._asks(0x701E)
    assert (asked.id, asked.data.hex(), asked.extended) == (0x1100FD7F, "1e70000000000000", True)
    drive = one()
    assert drive.take(CanFrame(0x11007FFD, bytes.fromhex("1e7000000000f041"), extended=True))
    assert drive._answered[0x701E] == bytes.fromhex("0000f041")


def test_a_torque_is_in_the_identifier_and_an_answer_in_16_bits() -> None:
    """Worked by hand from the manual of an RS00: 14 N m, 33 rad/s and 4 pi rad are 65535, their opposites 0."""
    drive = one(1)
    drive._rate_max, drive._torque_max = drive._ranges()
    (most,), (least,) = drive.command(99.0), drive.command(-99.0)
    assert (most.id, least.id) == (0x01FFFF01, 0x01000001)
    assert most.data.hex() == "7fff7fff00000000" and most.extended
    (half,) = drive.command(7.0)
    assert half.id == 0x01BFFF01  # 0.75 of 65535, towards 0
    assert drive.take(CanFrame(0x028001FD, bytes.fromhex("ffff0000ffff0131"), extended=True, time=2.0))
    assert drive.reading is not None
    assert drive.reading.angle == pytest.approx(4.0 * math.pi) and drive.reading.rate == -33.0
    assert drive.stated == 2.0


@pytest.mark.parametrize(
    "frame",
    [
        CanFrame(0x028002FD, bytes(8), extended=True),  # another drive's
        CanFrame(0x028001FE, bytes(8), extended=True),  # to somebody else
        CanFrame(0x02C001FD, bytes(8), extended=True),  # a mode that there is not
        CanFrame(0x028001FD, bytes(7), extended=True),
        CanFrame(0x0A8001FD, bytes(8), extended=True),
        CanFrame(0x1B, bytes(8)),
    ],
)
def test_what_is_no_answer_of_its_is_not_taken(frame: CanFrame) -> None:
    drive = one(1)
    assert not drive.take(frame) and drive.reading is None and drive.stated == 0.0


def test_an_old_frame_of_a_shaft_that_turns_is_not_taken() -> None:
    drive = one(1)
    drive._rate_max, drive._torque_max = drive._ranges()
    drive.steps = 8.0 * math.pi / STEPS_16, 2.0 * 33.0 / STEPS_16

    def said(angle: int, rate: int, ms: float) -> bool:
        data = struct.pack(">HHHH", angle, rate, 0, 0)
        return drive.take(CanFrame(0x028001FD, data, extended=True, time=1e-3 * ms))

    assert all(said(30000 + n, 40000, n) for n in range(10))
    assert said(30009, 40000, 9.01)  # it turns by 0.07 mrad meanwhile, and a step is 0.38
    assert not said(30009, 40000, 10) and not said(30003, 40000, 10) and said(30003, 40001, 10)
    assert said(100, 32768, 11) and said(101, 32768, 12) and said(100, 32768, 13)  # at rest it may say the same


def bench(folder: Path) -> tuple[CanBed, PlayedLine, PlayedBench, PlayedRobstride]:
    played = played_bench("robstride")
    line = PlayedLine(played)
    assert isinstance(played.drive, PlayedRobstride)
    return host_of(two_drives(bench_file(folder, "robstride")), line), line, played, played.drive


def test_it_says_what_it_is_and_what_a_step_is(tmp_path: Path) -> None:
    bed, _, _, _ = bench(tmp_path)
    with bed:
        about = bed.connect()
        said = dict(bed.remarks)
    assert said["drive"] == (
        "node 1, robstride 0.3.1.44, RS05 524f425354524901; in steps of 0.000168 N*m, 0.000384 rad, 0.00153 rad/s; "
        "supply 24 V"
    )
    assert said["bus"] == "virtual bench: 4 frames an exchange, 0.64 ms on the bus at most"
    assert about.deadman == 0.020 and about.limits.rate == pytest.approx(45.0)


@pytest.mark.slow
def test_its_angle_goes_on_where_its_range_ends(tmp_path: Path) -> None:
    bed, line, played, _ = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        go(bed, line, 2.0, 1.5)
        assert bed._state == BedState.ARMED and played.shaft.angle > 4.0 * math.pi
        assert bed.read().angle == pytest.approx(played.shaft.angle, abs=0.05)


def test_an_angle_that_stays_at_the_end_of_its_range_stops_the_bed(tmp_path: Path) -> None:
    bed, line, played, _ = bench(tmp_path)
    for each in played.drives:
        assert isinstance(each, PlayedRobstride)
        each.wraps = False
    with bed:
        bed.connect()
        bed.arm()
        go(bed, line, 2.0, 1.5)
        assert played.off and bed._faults == Fault.DRIVE and played.shaft.angle < 13.0
        assert " = help: drive (node 1): its angle stays at the end of its range\n" in refusal(bed.arm)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (lambda drive: drive.fail(1 << 4), "overload"),
        (lambda drive: drive.fail(1 << 2), "too hot"),
        (lambda drive: drive.parameters.update({0x701C: 61.0}), "supply over voltage"),
        (lambda drive: drive.fail(0, 1 << 20), "fault 0x100000"),
    ],
)
def test_a_fault_stops_both_and_is_said(tmp_path: Path, fault: Callable[[PlayedRobstride], object], said: str) -> None:
    bed, line, played, drive = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        go(bed, line, 0.05, 2.0)
        fault(drive)
        go(bed, line, 0.05, 2.0)
        assert played.off and bed._faults == Fault.DRIVE
        assert f" = help: drive (node 1): {said}\n" in refusal(bed.arm)
        drive.parameters[0x701C] = 24.0
        bed.rest(3.0)
        assert bed.clear().state == BedState.DISARMED and bed.arm().state == BedState.ARMED


def test_one_that_begins_anew_in_a_run_stops_the_bed_and_has_its_watchdog_again(tmp_path: Path) -> None:
    bed, line, played, drive = bench(tmp_path)
    with bed:
        bed.connect()
        bed.arm()
        go(bed, line, 0.05, 1.0)
        drive.reboot()
        go(bed, line, 0.05, 1.0)
        assert played.off and bed._faults == Fault.DEADMAN
        assert "drive (node 1): it heard nothing for too long, or has begun anew\n" in refusal(bed.arm)
        bed.rest(3.0)
        bed.clear()
        bed.arm()
        assert drive.parameters[0x7028] == 400


def test_one_whose_watchdog_does_nothing_is_not_armed(tmp_path: Path) -> None:
    bed, _, played, drive = bench(tmp_path)
    with bed:
        bed.connect()
        drive.watches = False
        assert refusal(bed.arm).startswith("error[E406]: drive (node 1) still drives 50 ms after the last command")
        assert played.off


def greeting(folder: Path, change: Callable[[PlayedRobstride], object], edit: tuple[str, str] = ("", "")) -> str:
    _, line, played, drive = bench(folder)
    change(drive)
    path = folder / "bench.toml"
    path.write_text(path.read_text().replace(*edit, 1))
    words = refusal(host_of(two_drives(path), line).connect)
    assert played.off
    return words


def test_one_that_is_not_there_is_found(tmp_path: Path) -> None:
    words = greeting(tmp_path, lambda drive: setattr(drive, "node", 3))
    assert words.startswith("error[E402]: no robstride answers what its identity is as drive (node 1) on the bus\n")


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ("", "the bench file does not say which model it is"),
        ('model = "RS5"', "there is no model `RS5`"),
    ],
)
def test_a_file_that_does_not_say_the_model_is_refused(tmp_path: Path, model: str, said: str) -> None:
    words = greeting(tmp_path, lambda drive: None, ('model = "RS05"', model))
    assert words.startswith(
        f"error[E404]: drive (node 1) cannot be driven: {said}, by which its frames mean other numbers\n"
    )
    assert '`model = "RS02"` in `[drive]`: RS00, RS01, ' in words


def test_a_limit_of_torque_that_the_model_cannot_have_is_found(tmp_path: Path) -> None:
    assert greeting(tmp_path, lambda drive: drive.parameters.update({0x700B: 17.0})) == (
        "error[E404]: drive (node 1) cannot be driven: its limit of torque is 17 N*m, and an RS05 has 5.5 N*m at most\n"
        " = help: `model` of `[drive]` is another, or its parameter 0x700B was changed"
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda drive: setattr(drive, "version", None),
            "error[E403]: drive (node 1) is no robstride of a kind that MET knows: it does not say its firmware's "
            "version\n",
        ),
        (
            lambda drive: drive.parameters.pop(0x7028),
            "error[E404]: drive (node 1) cannot be driven: it has no parameter 0x7028\n",
        ),
        (
            lambda drive: drive.refuses.add(0x7028),
            "error[E404]: drive (node 1) cannot be driven: it does not take 400 for its parameter 0x7028, which is 0\n",
        ),
        (
            lambda drive: drive.refuses.add(0x7005),
            "error[E404]: drive (node 1) cannot be driven: it does not take 0 for its parameter 0x7005, which is 5\n",
        ),
    ],
)
def test_firmware_that_lacks_what_is_needed_is_found(
    tmp_path: Path, change: Callable[[PlayedRobstride], object], said: str
) -> None:
    assert greeting(tmp_path, change) == f"{said} = help: put its maker's newest firmware on it"


def test_another_range_of_the_angle_is_found(tmp_path: Path) -> None:
    """Of firmware before that which lets an angle go round."""

    def older(drive: PlayedRobstride) -> None:
        drive.angle_max, drive.zero = 12.5, -6.0

    words = greeting(tmp_path, older)
    assert words.startswith(
        "error[E403]: drive (node 1) is no robstride of a kind that MET knows: its angle in a frame is 0.0315 rad off "
        "what its parameter says\n"
    )


def test_canopen_in_its_place_is_recognised(tmp_path: Path) -> None:
    line = PlayedLine(
        played_bench("robstride"), lambda frame, out: [(0.0, CanFrame(0x701, b"\x05"))] if out else [(0.0, frame)]
    )
    words = refusal(host_of(two_drives(bench_file(tmp_path, "robstride")), line).connect)
    assert " = help: identifiers from 0x701 on are heartbeats of CANopen: `cia402`?\n" in words


def test_one_that_runs_with_a_fault_counts_as_on(tmp_path: Path) -> None:
    """Where it is not stopped the bed does not confirm that it is off."""
    played = played_bench("robstride")
    drive = played.drive
    assert isinstance(drive, PlayedRobstride)
    line = PlayedLine(played)
    with host_of(two_drives(bench_file(tmp_path, "robstride")), line) as bed:
        bed.connect()
        bed.arm()
        drive.faults = 4
        stops = [frame.id for frame in bed._drives[0].idle()]
        line.spoil = lambda frame, from_drive: [] if frame.id in stops else [(0.0, frame)]
        assert not bed.stop()
        line.spoil = lambda frame, from_drive: [(0.0, frame)]
        assert bed.stop() and played.off
