"""ODrives on serial lines pass what every bed must, whatever befalls their text; and what is none that MET knows is
found when it is greeted."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from hw.bed import BedDriver, BedState, Fault
from hw.beds.can_bed import PORT, CanBed
from hw.drives.bench_file import two_drives
from hw.drives.drive import CanFrame
from hw.drives.odrive_lines import OWED, USB_ANSWER, OdriveLines, checked, on_lines, summed
from hw.ports import Opening, Port
from met.diagnostic import Problem
from tests.hw.conftest import refusal
from tests.hw.drives.played import PlayedConformance, bench_file, host_line, host_of, line_of, period_of, played_bench
from tests.hw.drives.spoiling import Tally, campaign
from tests.hw.drives.test_fdcanusb import TEXT_FAULTS, TextSpoiler
from tests.hw.players.odrive_ascii import PlayedOdriveAscii, PlayedOdrivePorts
from tests.hw.players.player import PlayedBench, play

ASCII = "odrive_ascii"


class TestOdriveAscii(PlayedConformance):
    dialect = ASCII

    @pytest.fixture
    def bed(self, tmp_path: Path) -> Iterator[BedDriver]:
        with self.opened(tmp_path) as bed:
            yield bed


class TestOdriveAsciiToldRates(TestOdriveAscii):
    drive_told = "rate"

    def rate_told(self) -> float:
        drive = self.played.drive
        assert isinstance(drive, PlayedOdriveAscii)
        return drive.rate_told if drive.mode == 2 else float("nan")

    def weaken(self) -> None:
        drive = self.played.drive
        assert isinstance(drive, PlayedOdriveAscii)
        drive.values |= {"axis0.config.torque_soft_max": 0.01, "axis0.config.torque_soft_min": -0.01}


# Lines


def test_a_line_s_checksum_is_that_of_the_maker_s_example() -> None:
    assert summed(b"r vbus_voltage") == b"r vbus_voltage *93\n"
    assert checked(b"r vbus_voltage *93") == b"r vbus_voltage"


def test_no_line_of_which_a_bit_is_wrong_is_taken() -> None:
    line = summed(b"-12.500000 3.062500")[:-1]
    assert checked(line) is not None
    for at in range(len(line)):
        for bit in range(8):
            assert checked(line[:at] + bytes([line[at] ^ 1 << bit]) + line[at + 1 :]) is None, (at, bit)


@pytest.mark.parametrize("line", [b"", b"24.0", b"24.0*", b"*", b"24.0*4x", b"24.0*-1", b"24.0*1000", b"24.0*\xb2"])
def test_a_line_without_a_checksum_is_none(line: bytes) -> None:
    assert checked(line) is None


def test_a_played_drive_drops_commands_whose_checksum_is_wrong_and_answers_as_it_is_asked() -> None:
    drive = PlayedOdriveAscii(1)
    drive.receive(CanFrame(1, summed(b"w axis0.controller.config.control_mode 1")), 0.0)
    for text in (b"c 0 0.1 *1\n", b"c 0 0.1*x\n", b"c 0 0.1 *300\n"):
        assert not drive.receive(CanFrame(1, text), 0.0)
    assert drive.torque == 0.0
    drive.receive(CanFrame(1, summed(b"c 0 0.1") + b"r vbus_v"), 0.0)
    assert drive.torque == 0.1
    (answer,) = drive.receive(CanFrame(1, b"oltage\nf 0 ; a comment\n" + summed(b"r axis0.nothing")), 0.0)
    plain, feedback, last = answer.data.splitlines()
    assert (plain, feedback) == (b"24.000000", b"0.000000 0.000000")
    assert checked(last) == b"invalid property"


class Wires:
    """Lines whose drives say what a test says, when it does."""

    def __init__(self) -> None:
        self.time, self.sent, self.coming = 0.0, list[tuple[int, bytes]](), deque[CanFrame]()

    def now(self) -> float:
        return self.time

    def send(self, frame: CanFrame) -> None:
        self.sent.append((frame.id, frame.data.partition(b" *")[0].strip()))

    def receive(self, until: float) -> CanFrame | None:
        if self.coming and self.coming[0].time <= max(until, self.time):
            frame = self.coming.popleft()
            self.time = max(self.time, frame.time)
            return frame
        self.time = max(self.time, until)
        return None

    def say(self, text: bytes, at: float, node: int = 1) -> None:
        self.coming.append(CanFrame(node, summed(text), time=at))

    def sleep(self, seconds: float) -> None:
        self.time += seconds

    def close(self) -> None: ...


def asked(wires: Wires) -> tuple[OdriveLines, Callable[[bytes], None]]:
    lines = OdriveLines(wires, (1, 2))
    wires.sent.clear()
    return lines, lambda text: lines.send(CanFrame(1, text))


def test_a_drive_is_asked_one_question_at_a_time_and_told_at_once() -> None:
    """A drive throws away an answer while the one before it is still being sent."""
    wires = Wires()
    lines, send = asked(wires)
    for text in (b"r a", b"r b", b"f 0", b"c 0 1", b"r b", b"f 0"):
        send(text)
    assert wires.sent == [(1, b"r a"), (1, b"c 0 1")]
    wires.say(b"7", 1e-4)
    wires.say(b"0.5 -0.25", 3e-4)
    found = [lines.receive(1e-3) for _ in range(3)]
    assert [None if each is None else each.data for each in found] == [b"r a\n7", b"f 0\n0.5 -0.25", None]
    assert wires.sent[2:] == [(1, b"f 0"), (1, b"r b")]  # feedback goes first, and nothing twice


def test_an_answer_says_between_when_it_was_so() -> None:
    wires = Wires()
    lines, send = asked(wires)
    wires.time = 2.0
    send(b"f 0")
    wires.say(b"1 2", 2.0 + 4e-4)
    found = lines.receive(3.0)
    assert found is not None
    assert found.time == pytest.approx(2.0 + 2e-4) and found.time_unsure == pytest.approx(2e-4)


def test_feedback_that_is_late_does_not_count_and_is_asked_for_again() -> None:
    wires = Wires()
    lines, send = asked(wires)
    send(b"f 0")
    send(b"r a")
    wires.say(b"1 2", 1.01 * lines.late)
    wires.say(b"5", 1.5 * lines.late)
    found = lines.receive(0.01)
    assert found is not None and found.data == b"r a\n5"
    assert lines.fastest(1) == pytest.approx(0.49 * lines.late)
    assert wires.sent == [(1, b"f 0"), (1, b"r a"), (1, b"f 0")]  # asked for again


def test_a_question_whose_answer_is_lost_is_followed_by_the_next_when_it_can_no_more_come() -> None:
    wires = Wires()
    lines, send = asked(wires)
    send(b"f 0")
    send(b"r a")
    assert lines.receive(0.99 * OWED * lines.late) is None and wires.sent == [(1, b"f 0")]
    assert lines.receive(1.01 * OWED * lines.late) is None and wires.sent == [(1, b"f 0"), (1, b"r a")]


def test_what_is_no_answer_to_what_was_asked_is_dropped() -> None:
    wires = Wires()
    lines, send = asked(wires)
    send(b"f 0")
    wires.say(b"8", 1e-4)
    wires.say(b"1 2", 1e-4, node=2)
    wires.coming.append(CanFrame(1, b"x" * 400, time=1e-4))
    wires.coming.append(CanFrame(1, b"\r\n", time=1e-4))
    wires.coming.append(CanFrame(3, b"1 2\n", time=1e-4))
    wires.say(b"3 4", 2e-4)
    found = lines.receive(1e-3)
    assert found is not None and found.data == b"f 0\n3 4"


def test_lines_of_usb_take_their_answers_and_those_of_uarts_their_bits() -> None:
    frames = [CanFrame(node, text) for node in (1, 2) for text in (b"c 0 0.1", b"f 0", b"1 2")]
    assert on_lines(frames, None) == USB_ANSWER
    bits = 10 * sum(len(summed(frame.data)) + 1 for frame in frames[:3])
    assert on_lines(frames, 115200) == pytest.approx(bits / 115200 + 2e-4)


# Who is there


def greeting(folder: Path, change: Callable[[PlayedOdriveAscii], object], said: bytes | None = None) -> str:
    """What is said where a bench whose drive was changed is greeted. said: what it says in the place of its answers"""
    played = played_bench(ASCII)
    assert isinstance(played.drive, PlayedOdriveAscii)
    change(played.drive)

    def spoil(frame: CanFrame, from_drive: bool) -> list[tuple[float, CanFrame]]:
        if not from_drive or frame.id != 1 or said is None:
            return [(0.0, frame)]
        return [(0.0, replace(frame, data=said))] if said else []

    words = refusal(host_of(two_drives(bench_file(folder, ASCII)), line_of(ASCII, played, spoil)).connect)
    assert played.off
    return words.replace(str(folder), "FOLDER")


def unchanged(drive: PlayedOdriveAscii) -> None: ...


def test_a_line_on_which_nobody_answers_says_so(tmp_path: Path) -> None:
    assert greeting(tmp_path, unchanged, b"") == (
        "error[E402]: no odrive_ascii answers `r fw_version_major` as drive (FOLDER/ttyDrive)\n"
        " = help: is it switched on? its line may have another name since it was plugged in: `ls /dev/serial/by-id`\n"
        " = help: its USB line speaks ASCII where `config.usb_cdc_protocol` says so, a UART `config.uart0_protocol`\n"
        " = help: `port` of `[drive]`, and its `dialect`"
    )


@pytest.mark.parametrize("said", [b"ERR unknown command\r\n", b"0\r\n"])
def test_a_line_of_something_else_is_told(tmp_path: Path, said: bytes) -> None:
    assert greeting(tmp_path, unchanged, said) == (
        "error[E402]: no odrive_ascii answers `r fw_version_major` as drive (FOLDER/ttyDrive)\n"
        f" = help: what came is `{said.decode().strip()}`: no answer with a checksum\n"
        " = help: is this the line of an ODrive?\n"
        " = help: `port` of `[drive]`, and its `dialect`"
    )


@pytest.mark.parametrize("firmware", [(0, 5, 6), (0, 7, 1), (1, 0, 0)])
def test_another_firmware_is_found(tmp_path: Path, firmware: tuple[int, int, int]) -> None:
    def other(drive: PlayedOdriveAscii) -> None:
        drive.firmware = firmware

    assert greeting(tmp_path, other) == (
        "error[E403]: drive (FOLDER/ttyDrive) is no odrive_ascii of a kind that MET knows: its firmware is "
        f"{'.'.join(str(each) for each in firmware)}\n"
        " = help: MET speaks to firmware 0.6"
    )


def test_a_property_that_it_has_not_is_found(tmp_path: Path) -> None:
    def lacks(drive: PlayedOdriveAscii) -> None:
        del drive.values["config.dc_bus_overvoltage_trip_level"]

    assert greeting(tmp_path, lacks) == (
        "error[E403]: drive (FOLDER/ttyDrive) is no odrive_ascii of a kind that MET knows: it answers `invalid "
        "property` to `r config.dc_bus_overvoltage_trip_level`\n"
        " = help: MET speaks to firmware 0.6"
    )


def test_a_torque_constant_that_is_not_the_file_s_is_found(tmp_path: Path) -> None:
    def other(drive: PlayedOdriveAscii) -> None:
        drive.values["axis0.config.motor.torque_constant"] = 0.04

    assert greeting(tmp_path, other) == (
        "error[E404]: drive (FOLDER/ttyDrive) cannot be driven: its torque constant is 0.04 N*m/A, and the bench "
        "file's 0.06\n"
        " = help: what they are told is a torque: the drive makes its current of it by its own constant"
    )


def test_a_watchdog_that_cannot_be_set_is_found(tmp_path: Path) -> None:
    assert greeting(tmp_path, lambda drive: drive.refuses.add("axis0.config.enable_watchdog")) == (
        "error[E404]: drive (FOLDER/ttyDrive) cannot be driven: it does not take 1 for "
        "`axis0.config.enable_watchdog`, which is 0\n"
        " = help: set it by its maker's tool"
    )


def test_a_line_that_is_too_slow_is_found(tmp_path: Path) -> None:
    played = played_bench(ASCII)
    line = line_of(ASCII, played, lambda frame, from_drive: [(1.5e-3 * from_drive, frame)])
    words = refusal(host_of(two_drives(bench_file(tmp_path, ASCII)), line).connect)
    assert words.replace(str(tmp_path), "FOLDER") == (
        "error[E404]: drive (FOLDER/ttyDrive) cannot be driven: an answer of its takes 2.05 ms, and 1.6 ms is the "
        "most\n"
        " = help: no hub between, another USB port of the computer\n"
        " = help: a UART, at 921600 bits a second"
    )


# What it does


def armed(folder: Path) -> tuple[CanBed, PlayedBench]:
    played = played_bench(ASCII)
    line = line_of(ASCII, played)
    bed = host_of(two_drives(bench_file(folder, ASCII)), line)
    bed.connect()
    bed.arm()
    return bed, played


def test_what_its_watchdog_did_is_told_by_its_own_words(tmp_path: Path) -> None:
    bed, played = armed(tmp_path)
    with bed:
        bed.exchange(1.0, 0.1)
        bed._talk.line.sleep(0.03)
        assert played.off
        drive = bed._drives[0]
        bed._talk.ask(drive.query(), lambda: drive.starved)
        assert drive.errors == "watchdog expired"
        assert bed.read().faults == Fault.DEADMAN


def test_a_drive_that_stops_by_itself_stops_the_bed_with_the_reason(tmp_path: Path) -> None:
    bed, played = armed(tmp_path)
    assert isinstance(played.load, PlayedOdriveAscii)
    with bed:
        for n in range(50):
            if n == 20:
                played.load._failed(1 << 13)
            bed._talk.line.sleep(2e-3)
            sample = bed.exchange(1.0, 0.1)
            if sample is not None and sample.state == BedState.STOPPED:
                break
        assert sample is not None and sample.faults == Fault.DRIVE and n <= 24
        assert bed._why == f"load ({tmp_path / 'ttyLoad'}): motor too hot"
    assert played.off


def test_a_watchdog_that_does_nothing_is_found_before_it_is_armed(tmp_path: Path) -> None:
    played = played_bench(ASCII)
    assert isinstance(played.load, PlayedOdriveAscii)
    played.load.watches = False
    with host_of(two_drives(bench_file(tmp_path, ASCII)), line_of(ASCII, played)) as bed:
        bed.connect()
        assert "still drives 50 ms after the last command" in refusal(bed.arm)
    assert played.off


def test_its_supply_and_power_are_watched(tmp_path: Path) -> None:
    bed, _ = armed(tmp_path)
    with bed:
        for _ in range(20):
            bed._talk.line.sleep(2e-3)
            bed.exchange(1.0, 0.1)
        assert [drive.supply for drive in bed._drives] == [24.0, 24.0]
        assert all(drive.power is not None for drive in bed._drives)
        assert "supply 24 V" in dict(bed.remarks)["drive"]


def test_a_uart_that_is_too_slow_for_its_rate_is_told(tmp_path: Path) -> None:
    path = bench_file(tmp_path, ASCII)
    path.write_text(path.read_text().replace('"serial"\n', '"serial"\nbaud = 115200\n'))
    bench = two_drives(path)
    line = line_of(ASCII, played_bench(ASCII))
    bed = CanBed(bench, tuple(host_of(bench, line)._drives), lambda: host_line(bench, line), period=2e-3)
    assert refusal(bed.connect).startswith("error[E405]: the frames of an exchange take ")


# What befalls the text


def through(folder: Path, kind: str, exchanges: int) -> tuple[Tally, TextSpoiler]:
    """What comes of so many exchanges under a fault of the text; the bed is off afterwards."""
    played, spoiler = played_bench(ASCII), TextSpoiler(kind, 1)

    def spoil(frame: CanFrame, from_drive: bool) -> list[tuple[float, CanFrame]]:
        return [(later, replace(frame, data=data)) for later, data in spoiler(frame.data, from_drive)]

    line = line_of(ASCII, played, spoil)
    with host_of(two_drives(bench_file(folder, ASCII)), line) as bed:
        tally = campaign(bed, line, played, spoiler, exchanges, period=period_of(ASCII))
    assert played.off
    return tally, spoiler


@pytest.mark.release
@pytest.mark.parametrize("kind", TEXT_FAULTS)
def test_no_wrong_answer_is_taken_of_lines_that_are_spoilt(tmp_path: Path, kind: str) -> None:
    tally, spoiler = through(tmp_path, kind, 600)
    assert spoiler.befell >= 10 and tally.answered >= 100
    assert tally.wrong == 0, tally


@pytest.mark.release
@pytest.mark.parametrize("kind", TEXT_FAULTS)
def test_no_wrong_answer_is_taken_of_two_thousand_exchanges(tmp_path: Path, kind: str) -> None:
    tally, spoiler = through(tmp_path, kind, 2000)
    assert spoiler.befell >= 20 and tally.answered >= 200
    assert tally.wrong == 0, tally


# Pseudo-terminals


def test_a_host_finds_drives_behind_pseudo_terminals(tmp_path: Path) -> None:
    bench = two_drives(bench_file(tmp_path, ASCII))
    played, ended = played_bench(ASCII), threading.Event()
    ports = PlayedOdrivePorts(bench.bus["ports"])
    thread = threading.Thread(target=play, args=(ports, played, ended.is_set), daemon=True)
    thread.start()
    try:
        with PORT.open(Opening(Port(f"can:{tmp_path / 'bench.toml'}"))) as bed:
            assert isinstance(bed, CanBed)
            assert bed.connect().name == "paper" and bed.read().state == BedState.DISARMED
            assert dict(bed.remarks)["bus"].endswith("ttyLoad: 10 lines an exchange, 1.6 ms there")
    finally:
        ended.set()
        thread.join()
        ports.close()
    assert not os.path.lexists(tmp_path / "ttyDrive") and played.off
    with PORT.open(Opening(Port(f"can:{tmp_path / 'bench.toml'}"))) as bed:
        assert refusal(bed.connect).startswith(f"error[E400]: {tmp_path / 'ttyDrive'} cannot be opened: no such file")


def test_a_player_covers_no_file(tmp_path: Path) -> None:
    path = tmp_path / "mine"
    path.write_text("mine")
    with pytest.raises(Problem, match=r"E400: no ODrive can be played at .*mine: something is there"):
        PlayedOdrivePorts({1: str(tmp_path / "free"), 2: str(path)})
    assert path.read_text() == "mine" and not os.path.lexists(tmp_path / "free")
