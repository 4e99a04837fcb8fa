"""ODrives pass what every bed must, and one that is none that MET knows is found when it is greeted."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hw.bed import BedDriver
from hw.drives.bench_file import two_drives
from hw.drives.drive import CanFrame
from tests.hw.conftest import refusal
from tests.hw.drives.played import PlayedConformance, bench_file, host_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.players.odrive import PlayedOdrive, endpoints
from tests.hw.players.player import PlayedBench


class TestOdrive(PlayedConformance):
    @pytest.fixture
    def bed(self, tmp_path: Path) -> Iterator[BedDriver]:
        with self.opened(tmp_path) as bed:
            yield bed


class TestOdriveToldRates(TestOdrive):
    drive_told = "rate"

    def rate_told(self) -> float:
        drive = self.played.drive
        assert isinstance(drive, PlayedOdrive)
        return drive.rate_told if drive.mode == 2 else float("nan")

    def weaken(self) -> None:
        drive = self.played.drive
        assert isinstance(drive, PlayedOdrive)
        drive.values |= {"axis0.config.torque_soft_max": 0.01, "axis0.config.torque_soft_min": -0.01}


def greeting(folder: Path, change: Callable[[PlayedBench, Path], object]) -> str:
    """What is said where a bench that was changed is greeted."""
    played = played_bench()
    path = bench_file(folder)
    change(played, folder)
    words = refusal(host_of(two_drives(path), PlayedLine(played)).connect)
    assert played.off
    return words.replace(str(folder), "FOLDER")


def odrive(played: PlayedBench) -> PlayedOdrive:
    assert isinstance(played.drive, PlayedOdrive)
    return played.drive


def test_one_that_is_not_there_is_told_from_one_of_another_number(tmp_path: Path) -> None:
    def other_number(played: PlayedBench, folder: Path) -> None:
        played.drive.node = 5

    assert greeting(tmp_path, other_number) == (
        "error[E402]: no odrive answers Get_Version as drive (node 1) on the bus\n"
        " = help: what came has the identifiers 0xA1 (19), 0xA9 (199)\n"
        " = help: 0xA1 looks like the heartbeat of an ODrive, node 5\n"
        " = help: `node` of `[drive]`, and its `dialect`"
    )


def test_a_bus_without_anyone_says_so(tmp_path: Path) -> None:
    line = PlayedLine(played_bench(), lambda frame, from_drive: [] if from_drive else [(0.0, frame)])
    assert refusal(host_of(two_drives(bench_file(tmp_path)), line).connect) == (
        "error[E402]: no odrive answers Get_Version as drive (node 1) on the bus\n"
        " = help: is it switched on, on this bus, at its bitrate? is the bus terminated at both ends?\n"
        " = help: `node` of `[drive]`, and its `dialect`"
    )
    assert line.now() == pytest.approx(2.0)


def test_canopen_on_the_bus_is_recognised(tmp_path: Path) -> None:
    played = played_bench()
    line = PlayedLine(played, lambda frame, out: [(0.0, CanFrame(0x701, b"\x05"))] if out else [])
    words = refusal(host_of(two_drives(bench_file(tmp_path)), line).connect)
    assert " = help: identifiers from 0x701 on are heartbeats of CANopen: `cia402`?\n" in words


def test_firmware_that_does_not_say_its_version_is_found(tmp_path: Path) -> None:
    def old(played: PlayedBench, folder: Path) -> None:
        odrive(played).version = None

    assert greeting(tmp_path, old) == (
        "error[E403]: drive (node 1) is no odrive of a kind that MET knows: it sends heartbeats, and does not say its "
        "version\n"
        " = help: firmware 0.5 and before does not: put 0.6 on it\n"
        " = help: its maker's `odrivetool dfu` does so"
    )


def test_another_firmware_is_found(tmp_path: Path) -> None:
    def newer(played: PlayedBench, folder: Path) -> None:
        odrive(played).version = (2, 4, 4, 58, 0, 7, 1, 0)

    assert greeting(tmp_path, newer) == (
        "error[E403]: drive (node 1) is no odrive of a kind that MET knows: its firmware is 0.7.1\n"
        " = help: MET speaks to firmware 0.6"
    )


def test_a_file_of_another_firmware_s_properties_is_found(tmp_path: Path) -> None:
    def other(played: PlayedBench, folder: Path) -> None:
        (folder / "flat_endpoints.json").write_text(json.dumps(endpoints("0.6.9")))

    assert greeting(tmp_path, other) == (
        "error[E403]: drive (node 1) is no odrive of a kind that MET knows: it has 0.6.10, hardware 4.4.58, and "
        "FOLDER/flat_endpoints.json is for firmware 0.6.9, hardware 4.4.58\n"
        " = help: its maker has flat_endpoints.json for firmware 0.6.10 and hardware 4.4.58"
    )


def _with(**changed: object) -> str:
    """The file of its properties, one of which is changed."""
    found = endpoints()
    found["endpoints"]["axis0.config.enable_watchdog"] |= changed
    return json.dumps(found)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "cannot be read: no such file or directory"),
        ("{", "is no file of its properties"),
        ("[" * 100_000, "is no file of its properties"),
        ('{"endpoints": {}, "fw_version": 1, "hw_version": 2}', "has no `axis0.config.can.heartbeat_msg_rate_ms`"),
        (
            '{"endpoints": {"axis0.config.enable_watchdog": {"id": "x", "type": "bool"}}}',
            "is no file of its properties",
        ),
        (_with(id=70_000), "is no file of its properties"),
        (_with(id=-1), "is no file of its properties"),
        (_with(id=float("inf")), "is no file of its properties"),
        (_with(id=True), "is no file of its properties"),
        (_with(type="uint64"), "is no file of its properties"),
    ],
)
def test_a_file_that_is_none_of_properties_is_refused(tmp_path: Path, text: str | None, said: str) -> None:
    def change(played: PlayedBench, folder: Path) -> None:
        path = folder / "flat_endpoints.json"
        path.unlink()
        if text is not None:
            path.write_text(text)

    words = greeting(tmp_path, change)
    assert words.startswith(f"error[E404]: drive (node 1) cannot be driven: FOLDER/flat_endpoints.json {said}\n")


def test_one_that_drives_is_off_though_its_file_is_refused(tmp_path: Path) -> None:
    played = played_bench()
    line, path = PlayedLine(played), bench_file(tmp_path)
    odrive(played).state = 8
    (tmp_path / "flat_endpoints.json").unlink()
    assert "cannot be read: no such file" in refusal(host_of(two_drives(path), line).connect)
    line.sleep(0.01)  # what was sent arrives
    assert played.off


def test_a_torque_constant_that_is_not_the_file_s_is_found(tmp_path: Path) -> None:
    def other(played: PlayedBench, folder: Path) -> None:
        odrive(played).values["axis0.config.motor.torque_constant"] = 0.04

    assert greeting(tmp_path, other) == (
        "error[E404]: drive (node 1) cannot be driven: its torque constant is 0.04 N*m/A, and the bench file's 0.06\n"
        " = help: what they are told is a torque: the drive makes its current of it by its own constant"
    )


def test_a_watchdog_that_cannot_be_set_is_found(tmp_path: Path) -> None:
    def refuses(played: PlayedBench, folder: Path) -> None:
        odrive(played).refuses.add("axis0.config.watchdog_timeout")

    assert greeting(tmp_path, refuses) == (
        "error[E404]: drive (node 1) cannot be driven: it does not take 0.02 for `axis0.config.watchdog_timeout`, "
        "which is 0.1\n"
        " = help: set it by its maker's tool"
    )


def test_a_limit_that_is_no_number_is_found(tmp_path: Path) -> None:
    def endless(played: PlayedBench, folder: Path) -> None:
        odrive(played).values["axis0.controller.config.vel_limit"] = float("inf")

    assert "cannot be driven: a limit of its is no number above zero\n" in greeting(tmp_path, endless)


def test_a_number_that_no_identifier_has_room_for_is_refused_before_anything_is_sent(tmp_path: Path) -> None:
    sent: list[bool] = []

    def heard(frame: CanFrame, from_drive: bool) -> list[tuple[float, CanFrame]]:
        sent.append(from_drive)
        return [(0.0, frame)]

    line = PlayedLine(played_bench(), heard)
    path = bench_file(tmp_path)
    path.write_text(path.read_text().replace("node        = 1", "node        = 63"))
    assert refusal(host_of(two_drives(path), line).connect) == (
        "error[E404]: drive (node 63) cannot be driven: its number is none of an ODrive\n = help: a number from 0 to 62"
    )
    assert not sent


def test_a_watchdog_that_tells_and_does_not_stop_is_not_taken_for_one(tmp_path: Path) -> None:
    played = played_bench()
    drive = odrive(played)
    drive._failed = lambda error: setattr(drive, "errors", error)  # type: ignore[method-assign]
    with host_of(two_drives(bench_file(tmp_path)), PlayedLine(played)) as bed:
        bed.connect()
        assert refusal(bed.arm).startswith("error[E406]: drive (node 1) still drives 50 ms after the last command")
        assert played.off
