"""moteus behind an fdcanusb pass what every bed must, whatever befalls the lines of text; and what is no fdcanusb is
found when it is opened."""

from __future__ import annotations

import os
import random
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hw.bed import BedDriver, BedState
from hw.beds.can_bed import PORT, CanBed
from hw.drives.bench_file import two_drives
from hw.drives.bus import open_bus
from hw.drives.drive import CanFrame
from hw.drives.fdcanusb import LONGEST_LINE, FdcanusbLine, frame_of
from hw.ports import Opening, Port
from met.diagnostic import Problem
from tests.hw.conftest import refusal
from tests.hw.drives.played import PlayedConformance, bench_file, host_on, played_bench
from tests.hw.drives.simulated_lines import PlayedFdcanusbLine, PlayedLine
from tests.hw.drives.spoiling import SHARE, Tally, campaign
from tests.hw.players.fdcanusb import PlayedFdcanusb, PlayedFdcanusbPort
from tests.hw.players.player import play

SETTINGS = {"interface": "fdcanusb", "channel": "PORT"}
Spoilt = list[tuple[float, bytes]]


class TestFdcanusb(PlayedConformance):
    dialect = "moteus"

    def opened(self, folder: Path) -> BedDriver:
        self.played = played_bench("moteus")
        self.line = PlayedLine(self.played)
        bench = two_drives(bench_file(folder, "moteus", "fdcanusb"))
        return host_on(bench, lambda: FdcanusbLine(PlayedFdcanusbLine(self.line), bench.bus))

    @pytest.fixture
    def bed(self, tmp_path: Path) -> Iterator[BedDriver]:
        with self.opened(tmp_path) as bed:
            yield bed


# Lines


@pytest.mark.parametrize(
    ("text", "frame"),
    [
        (b"rcv 0100 2404000A e B F r x-1", CanFrame(0x100, b"\x24\x04\x00\x0a", fd=True, time=1.5)),
        (b"rcv 02007FFD 0102 E b f r t12345 f00", CanFrame(0x2007FFD, b"\1\2", extended=True, time=1.5)),
        (b"rcv 123  e b f R x-1", CanFrame(0x123, remote=True, time=1.5)),
        (b"rcv 7FF 0102 b e r f", CanFrame(0x7FF, b"\1\2", time=1.5)),
    ],
)
def test_a_line_is_the_frame_that_the_maker_s_description_says(text: bytes, frame: CanFrame) -> None:
    assert frame_of(text, 1.5) == frame


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"OK",
        b"rcv 0100 2404000A e B F",  # cut short: the firmware does so where its buffer is full
        b"rcv 0100 2404000 e B F r x-1",
        b"rcv 0100 240rcv 0100 2404000A e B F r x-1",
        b"rcv 0800 24 e B F r x-1",  # more than 11 bits
        b"rcv 20000000 24 E B F r x-1",
        b"rcv 0100 240404040404040404 e B F r x-1",  # 9 bytes: no length of a frame
        b"rcv 0100 240404040404040404040404 e b f r x-1",  # 12 bytes in a classic frame
        b"rcv 0100 24 e B F F x-1",
        b"rcv 0100 24 e B F r y1",
        b"rcv 0100 24 e B F r x-1 rcv",
        b"rcv 0x10 24 e B F r x-1",
        b"\xffcv 0100 24 e B F r x-1",
    ],
)
def test_what_is_no_whole_line_of_a_frame_is_dropped(text: bytes) -> None:
    assert frame_of(text, 0.0) is None


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        (CanFrame(0x8001, b"\x01\x00\x0a\x50", extended=True, fd=True), b"can ext 8001 01000A50 B F r\n"),
        (CanFrame(0x7FF, b"\xff"), b"can std 7FF FF b f r\n"),
    ],
)
def test_a_frame_is_sent_as_the_line_that_the_maker_s_description_says(frame: CanFrame, text: bytes) -> None:
    wire = Wire(b"OK\r\n")
    FdcanusbLine(wire, SETTINGS).send(frame)
    assert wire.sent[-1] == text


class Wire:
    """A line that answers each command with the same bytes, and says others besides."""

    def __init__(self, answer: bytes) -> None:
        self.answer, self.sent, self.coming, self.time = answer, list[bytes](), list[bytes](), 0.0
        self.closed = False

    def now(self) -> float:
        return self.time

    def send(self, frame: bytes) -> None:
        self.sent.append(frame)
        if frame != b"\n":
            self.coming.append(self.answer)

    def receive(self, until: float) -> bytes:
        if self.coming:
            self.time += 1e-5
            return self.coming.pop(0)
        self.time = max(self.time, until)
        return b""

    def sleep(self, seconds: float) -> None:
        self.time += seconds

    def close(self) -> None:
        self.closed = True


def test_the_speeds_that_the_file_says_are_set_before_it_goes_on_its_bus() -> None:
    wire = Wire(b"OK\r\n")
    FdcanusbLine(wire, {**SETTINGS, "bitrate": 500000, "data_bitrate": 2000000})
    assert wire.sent == [
        b"\n",
        b"can off\n",
        b"conf set can.bitrate 500000\n",
        b"conf set can.fd_bitrate 2000000\n",
        b"can on\n",
    ]


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"", "nothing came"),
        (b"\x07", "`?` came"),  # of slcan: an error
        (b"invalid property\r\n", "`invalid property` came"),  # of an ODrive's text
        (b"ERR unknown command\r\n", "`ERR unknown command` came"),
        (b"\x1b[31m\xff\r\n", "`?[31m\ufffd` came"),
    ],
)
def test_what_is_no_fdcanusb_is_found_when_it_is_opened(answer: bytes, said: str) -> None:
    wire = Wire(answer)
    words = refusal(lambda: FdcanusbLine(wire, SETTINGS))
    assert words == (
        f"error[E400]: no fdcanusb answers `can off` on PORT: {said}\n"
        " = help: `channel` of `[bus]`: the adapter's device, such as /dev/fdcanusb or /dev/ttyACM0\n"
        " = help: an adapter of another kind has another `interface`: slcan, socketcan, pcan ..."
    )
    assert wire.closed and wire.time < 2.5


def test_a_speed_that_it_does_not_take_is_found() -> None:
    adapter = PlayedFdcanusb()
    del adapter.settings["can.fd_bitrate"]
    line = PlayedFdcanusbLine(PlayedLine(played_bench("moteus")))
    line.adapter = adapter
    words = refusal(lambda: FdcanusbLine(line, {**SETTINGS, "data_bitrate": 5000000}))
    assert words.startswith(
        "error[E400]: no fdcanusb answers `conf set can.fd_bitrate 5000000` on PORT: `ERR error setting` came\n"
    )


def test_what_it_says_in_pieces_and_between_garbage_is_taken_line_by_line() -> None:
    wire = Wire(b"OK\r\n")
    line = FdcanusbLine(wire, SETTINGS)
    wire.coming = [b"rcv 01", b"00 24 e B F", b" r x-1\r", b"\nrcv 0200 25 e B F r x-1\r\n\xff\x00r", b"cv\r\nrcv 03"]
    found = [line.receive(wire.time + 0.01) for _ in range(3)]
    assert [None if each is None else (each.id, each.data) for each in found] == [
        (0x100, b"\x24"),
        (0x200, b"\x25"),
        None,
    ]
    wire.coming = [b"x" * 300] * 40
    assert line.receive(wire.time + 0.01) is None and len(line._rest) <= LONGEST_LINE + 1
    wire.coming = [b"\r\nrcv 0400 26 e B F r x-1\r\n"]
    last = line.receive(wire.time + 0.01)
    assert last is not None and last.id == 0x400


FRAME = b"rcv 0100 24 e B F r x-1\r\n"


def test_what_the_bus_carries_while_it_is_opened_is_no_answer() -> None:
    wire = Wire(FRAME + b"what\r\nOK\r\n")
    FdcanusbLine(wire, SETTINGS)
    assert wire.sent[-1] == b"can on\n"


def test_a_frame_before_the_ok_of_a_command_answers_the_one_before() -> None:
    """It came soon after the last OK, however late it is read."""
    wire = Wire(b"OK\r\n")
    line = FdcanusbLine(wire, SETTINGS)
    line.send(CanFrame(1, b"1"))
    assert line.receive(wire.time) is None
    answered, wire.answer = wire.time, b""
    wire.sleep(5e-3)
    line.send(CanFrame(1, b"1"))
    wire.coming = [FRAME]
    found = line.receive(wire.time + 1e-3)
    assert found is not None and found.time == pytest.approx(answered + 7e-4, abs=1e-9)


def test_a_frame_is_read_to_its_end_and_no_empty_reading_ends_the_wait() -> None:
    wire = Wire(b"OK\r\n")
    line = FdcanusbLine(wire, SETTINGS)
    wire.coming = [b"", FRAME]
    assert line.receive(wire.time + 1e-3) is not None, "before the end of the wait"
    wire.coming = [FRAME[:9], FRAME[9:]]
    assert line.receive(wire.time) is not None, "whose beginning has come in time"


def test_an_adapter_that_was_switched_on_anew_ends_the_run(tmp_path: Path) -> None:
    wire = Wire(b"OK\r\n")
    line = FdcanusbLine(wire, SETTINGS)
    wire.answer = b"ERR invalid data\r\n"
    line.send(CanFrame(1, b"1"))
    assert line.receive(wire.time) is None and line.refused == 1
    wire.answer = b"ERR not in BusOn state\r\n"
    line.send(CanFrame(1, b"1"))
    assert refusal(lambda: line.receive(wire.time)) == (
        "error[E401]: the fdcanusb on PORT is off its bus: it was switched on anew, or the bus has errors\n"
        " = help: the drives stop themselves when they hear nothing for the time of their watchdog\n"
        " = help: look at the adapter, the cable and its two terminators, then start again"
    )


def test_drives_that_need_frames_without_data_are_refused(tmp_path: Path) -> None:
    played = played_bench("odrive")
    bench = two_drives(bench_file(tmp_path, "odrive", "fdcanusb"))
    bed = host_on(bench, lambda: FdcanusbLine(PlayedFdcanusbLine(PlayedLine(played)), bench.bus))
    assert refusal(bed.connect) == (
        "error[E404]: an fdcanusb, on bench, cannot send a frame without data, as these drives need\n"
        " = help: moteus, Damiao and RobStride need none; for the others another adapter"
    )


# What befalls the text


class TextSpoiler:
    """One fault of a line of text, befalling lines by chance. kind: of `TEXT_FAULTS`"""

    def __init__(self, kind: str, seed: int) -> None:
        self.kind, self.random = kind, random.Random(f"{kind} {seed}")
        self.befell, self.on = 0, False

    def __call__(self, text: bytes, from_adapter: bool) -> Spoilt:
        if not self.on or self.random.random() >= SHARE:
            return [(0.0, text)]
        if self.kind == "altered" and not from_adapter:  # a command that is altered holds for a period, and is not seen
            return [(0.0, text)]
        self.befell += 1
        return TEXT_FAULTS[self.kind](self, text)

    def lost(self, text: bytes) -> Spoilt:
        return []

    def garbage(self, text: bytes) -> Spoilt:
        return [(0.0, self.random.randbytes(self.random.randrange(1, 40)) + text)]

    def garbage_line(self, text: bytes) -> Spoilt:
        return [(0.0, self.random.randbytes(self.random.randrange(1, 400)) + b"\r\n"), (0.0, text)]

    def split(self, text: bytes) -> Spoilt:
        """In two pieces, the second of them late."""
        at = self.random.randrange(len(text))
        return [(0.0, text[:at]), (self.random.uniform(0.0, 5e-3), text[at:])]

    def cut_short(self, text: bytes) -> Spoilt:
        return [(0.0, text[: self.random.randrange(len(text))] + b"\r\n")]

    def without_end(self, text: bytes) -> Spoilt:
        """It becomes one with the next."""
        return [(0.0, text[: self.random.randrange(len(text) - 1)])]

    def doubled(self, text: bytes) -> Spoilt:
        return [(0.0, text), (0.0, text)]

    def altered(self, text: bytes) -> Spoilt:
        data = bytearray(text)
        for _ in range(self.random.randint(1, 4)):
            data[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
        return [(0.0, bytes(data))]

    def late(self, text: bytes) -> Spoilt:
        return [(self.random.uniform(2e-4, 6e-3), text)]


TEXT_FAULTS: dict[str, Callable[[TextSpoiler, bytes], Spoilt]] = {
    name: getattr(TextSpoiler, name)
    for name in (
        "lost",
        "garbage",
        "garbage_line",
        "split",
        "cut_short",
        "without_end",
        "doubled",
        "altered",
        "late",
    )
}


def through(folder: Path, kind: str, exchanges: int) -> tuple[Tally, TextSpoiler]:
    """What comes of so many exchanges under a fault of the text; the bed is off afterwards."""
    played, spoiler = played_bench("moteus"), TextSpoiler(kind, 1)
    line = PlayedFdcanusbLine(PlayedLine(played), spoiler)
    bench = two_drives(bench_file(folder, "moteus", "fdcanusb"))
    with host_on(bench, lambda: FdcanusbLine(line, bench.bus)) as bed:
        tally = campaign(bed, line, played, spoiler, exchanges)
    assert played.off
    return tally, spoiler


@pytest.mark.release
@pytest.mark.parametrize("kind", TEXT_FAULTS)
def test_no_wrong_answer_is_taken_of_lines_that_are_spoilt(tmp_path: Path, kind: str) -> None:
    tally, spoiler = through(tmp_path, kind, 400)
    assert spoiler.befell >= 10 and tally.answered >= 100
    assert tally.wrong == 0, tally


@pytest.mark.release
@pytest.mark.parametrize("kind", TEXT_FAULTS)
def test_no_wrong_answer_is_taken_of_two_thousand_exchanges(tmp_path: Path, kind: str) -> None:
    tally, spoiler = through(tmp_path, kind, 2000)
    assert spoiler.befell >= 20 and tally.answered >= 200
    assert tally.wrong == 0, tally


# A pseudo-terminal


def test_a_host_finds_drives_behind_a_pseudo_terminal(tmp_path: Path) -> None:
    path = tmp_path / "fdcanusb"
    bench = two_drives(bench_file(tmp_path, "moteus", "fdcanusb", str(path)))
    played, ended = played_bench("moteus"), threading.Event()
    port = PlayedFdcanusbPort(str(path))
    thread = threading.Thread(target=play, args=(port, played, ended.is_set), daemon=True)
    thread.start()
    try:
        with PORT.open(Opening(Port(f"can:{tmp_path / 'bench.toml'}"))) as bed:
            assert isinstance(bed, CanBed)
            about = bed.connect()
            assert about.name == "paper" and bed.read().state == BedState.DISARMED
            assert dict(bed.remarks)["bus"].startswith(f"fdcanusb {path}: 4 frames an exchange")
        port_taken = refusal(lambda: open_bus({**bench.bus, "channel": str(tmp_path / "none")}))
        assert port_taken.startswith(f"error[E400]: {tmp_path / 'none'} cannot be opened: no such file or directory\n")
    finally:
        ended.set()
        thread.join()
        port.close()
    assert not os.path.lexists(path) and played.off


def test_a_player_covers_no_file(tmp_path: Path) -> None:
    path = tmp_path / "mine"
    path.write_text("mine")
    with pytest.raises(Problem, match=r"E400: no fdcanusb can be played at .*mine: something is there"):
        PlayedFdcanusbPort(str(path))
    assert path.read_text() == "mine"


class _Babbling:
    """A line on which there is always more, and an adapter that says nothing else. step: s that each reading takes"""

    def __init__(self, said: bytes, step: float = 1e-5) -> None:
        self.said, self.step, self.time, self.reads = said, step, 0.0, 0

    def now(self) -> float:
        return self.time

    def send(self, frame: bytes) -> None:
        if frame.startswith((b"can o", b"conf")):
            self.reads = -1

    def receive(self, until: float) -> bytes:
        self.time += self.step
        if self.reads < 0:
            self.reads = 0
            return b"OK\r\n"
        self.reads += 1
        assert self.reads < 10_000, "it is read for ever"
        return self.said if self.time > 2.5 else b""

    def sleep(self, seconds: float) -> None:
        self.time += seconds

    def close(self) -> None:
        pass


@pytest.mark.slow
@pytest.mark.parametrize("said", [b"x" * 4096, b"rcv 0100 24 e B F r x-1 and more\r\n" * 100, b"\n" * 4096])
def test_a_line_that_is_never_quiet_is_left_when_the_time_is_over(said: bytes) -> None:
    line = _Babbling(said)
    adapter = FdcanusbLine(line, SETTINGS)
    line.time = 3.0
    assert adapter.receive(3.001) is None and line.time < 3.0015
    assert adapter.receive(-1.0) is None
    assert len(adapter._rest) <= LONGEST_LINE + 1


def test_what_an_adapter_never_answers_is_not_kept() -> None:
    line = _Babbling(b"")
    adapter = FdcanusbLine(line, SETTINGS)
    for _ in range(1000):
        line.sleep(1e-3)
        adapter.send(CanFrame(1, b"1"))
    assert len(adapter._sent) <= 12
