"""Frames on a bus take the time that ISO 11898-1 says, and a bus that is not there is an error with a remedy."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from hw.bed import BedDriver
from hw.beds.can_bed import PORT
from hw.drives.bus import PythonCanLine
from hw.drives.drive import CanFrame, Talk, on_bus
from hw.ports import Opening, Port
from tests.hw.conftest import refusal
from tests.hw.drives.played import bench_file


@pytest.mark.parametrize(("length", "bits"), [(0, 47 + 8), (4, 47 + 32 + 16), (8, 47 + 64 + 24)])
def test_a_classic_frame_is_its_bits_and_all_that_can_be_stuffed(length: int, bits: int) -> None:
    """47 bits and 8 a byte, of which 34 and 8 a byte may be stuffed, every fourth (Davis and others, 2007)."""
    assert on_bus(CanFrame(1, bytes(length))) == pytest.approx(bits * 1e-6)


def test_a_frame_of_can_fd_has_its_data_at_the_faster_rate() -> None:
    slow, fast = on_bus(CanFrame(1, bytes(64), fd=True), 1e6, 1e6), on_bus(CanFrame(1, bytes(64), fd=True), 1e6, 5e6)
    assert 64 * 8 * 1e-6 < slow < 1.4 * 64 * 8 * 1e-6
    assert 33e-6 + 64 * 8 / 5e6 < fast < 50e-6 + 1.4 * 64 * 8 / 5e6
    assert on_bus(CanFrame(1 << 20, bytes(8), extended=True)) > on_bus(CanFrame(1, bytes(8)))


def test_frames_go_over_a_bus_with_the_time_at_which_they_came() -> None:
    ours, theirs = (PythonCanLine({"interface": "virtual", "channel": "frames"}) for _ in range(2))
    sent = [
        CanFrame(0x7FF, b"12345678"),
        CanFrame(0x12345678, b"", extended=True),
        CanFrame(5, remote=True),
        CanFrame(6, bytes(48), fd=True),
    ]
    for each in sent[:3]:
        before = ours.now()
        ours.send(each)
        found = theirs.receive(theirs.now() + 1.0)
        assert found is not None and before - 1e-3 <= found.time <= theirs.now()
        assert (found.id, found.data, found.extended, found.remote) == (each.id, each.data, each.extended, each.remote)
    assert theirs.receive(theirs.now() + 0.01) is None
    ours.close()
    theirs.close()


def opened(path: Path) -> BedDriver:
    return PORT.open(Opening(Port(f"can:{path}")))


def test_a_bus_that_cannot_be_opened_says_why(tmp_path: Path) -> None:
    words = refusal(opened(bench_file(tmp_path, interface="socketcan", channel="no-can")).connect)
    assert words.startswith("error[E400]: CAN bus socketcan:no-can cannot be opened: ")
    assert "\n = help: is the interface up? `ip link set can0 up type can bitrate 1000000`\n" in words
    words = refusal(opened(bench_file(tmp_path, interface="nothing")).connect)
    assert words.startswith("error[E400]: CAN bus nothing:bench cannot be opened: Unknown interface type")


def test_without_python_can_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "can", None)
    assert refusal(opened(bench_file(tmp_path)).connect) == (
        "error[E449]: a bench on a CAN bus needs python-can, which is not here\n"
        " = help: `pip install python-can`; with `scripts/met`, `.venv/bin/pip install python-can`"
    )


def test_a_port_without_its_file_or_with_a_dialect_of_no_one_is_refused(tmp_path: Path) -> None:
    missing = tmp_path / "none.toml"
    assert refusal(lambda: opened(missing)) == (
        f"error[E446]: {missing} cannot be read: no such file or directory\n = help: `can:` takes a bench's file"
    )
    path = bench_file(tmp_path)
    path.write_text(path.read_text().replace('"odrive"', '"odirve"'))
    assert f"error[E446]: {path}: no dialect `odirve`\n = help: did you mean `odrive`?\n" in refusal(
        lambda: opened(path)
    )


@pytest.mark.parametrize("role", ["drive", "load"])
def test_drives_whose_watchdog_could_not_be_proved_are_refused_with_the_reason(tmp_path: Path, role: str) -> None:
    path = bench_file(tmp_path)
    first, second = path.read_text().split("[load]")
    if role == "drive":
        first = first.replace('"odrive"', '"cubemars"')
    else:
        second = second.replace('"odrive"', '"cubemars"')
    path.write_text(f"{first}[load]{second}")
    assert refusal(lambda: opened(path)) == (
        f"error[E446]: {path}: CubeMars' AK drives are not driven: their manual tells of no watchdog in MIT mode, and "
        "no answer of theirs says whether they drive\n"
        " = help: a drive that goes on without its host is not armed, and no watchdog could be proved\n"
        " = help: RobStride and Damiao have motors of that kind, with a watchdog: `robstride`, `damiao`"
    )


def test_no_transcript_is_kept_of_a_bus(tmp_path: Path) -> None:
    port = Port(f"can:{bench_file(tmp_path)}", transcript=str(tmp_path / "kept"))
    assert refusal(lambda: PORT.open(Opening(port))).startswith("error[E409]: no transcript is kept of a CAN bus\n")


def test_an_interface_that_fails_in_a_way_of_its_own_is_refused() -> None:
    """As Kvaser's does without its library: by a NameError."""
    pytest.importorskip("can")
    words = refusal(lambda: PythonCanLine({"interface": "kvaser", "channel": 0}))
    assert words.startswith("error[E400]: CAN bus kvaser:0 cannot be opened: ")


class _NeverQuiet:
    """A bus on which there is always another frame, in steps of 10 us."""

    def __init__(self) -> None:
        self.time, self.frames = 0.0, 0

    def now(self) -> float:
        return self.time

    def send(self, frame: CanFrame) -> None: ...

    def receive(self, until: float) -> CanFrame | None:
        self.time, self.frames = self.time + 1e-5, self.frames + 1
        assert self.frames < 10_000, "it is listened to for ever"
        return CanFrame(0x555, b"12", time=self.time)

    def sleep(self, seconds: float) -> None: ...

    def close(self) -> None: ...


def test_a_bus_that_is_never_quiet_is_left_when_the_time_is_over() -> None:
    line = _NeverQuiet()
    talk = Talk(line, ())
    assert not talk.pump(1e-3)
    assert line.time < 5e-3
    talk.drain()
    assert line.time < 1e-2
