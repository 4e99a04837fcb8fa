"""Transcripts: all of them comes back, a crash costs the last record, and a replay is bit for bit what was."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from hw.bed import BedSample, BedState
from hw.beds.can_deck import bench_at
from hw.beds.replay import ReplayBed, is_transcript
from hw.beds.serial_line import SerialBed
from hw.lines import transcript
from hw.lines.transcript import TranscriptFile, TranscriptRecord, TranscriptWriter
from met.diagnostic import Problem
from tests.hw.conftest import LineBed, refusal, said
from tests.hw.device import Device
from tests.hw.relay import VirtualLine


def written(path: Path, count: int = 20) -> list[TranscriptRecord]:
    records = [TranscriptRecord(1 + n % 4, 0.125 * n, bytes(range(n))) for n in range(count)]
    put = list[bytes]()
    writer = TranscriptWriter(put.append, {"line": "x", "period": 0.001, "first": 3})
    for record in records:
        writer.add(record.kind, record.time, record.data)
    path.write_bytes(b"".join(put))
    return records


def test_what_was_written_is_read(tmp_path: Path) -> None:
    records = written(tmp_path / "t")
    found = transcript.read(tmp_path / "t")
    assert list(found.records) == records
    assert found.header == {"line": "x", "period": 0.001, "first": 3}
    assert found.cut == 0


def test_cut_anywhere_all_whole_records_are_there(tmp_path: Path) -> None:
    records = written(tmp_path / "t")
    data = (tmp_path / "t").read_bytes()
    ends, at = [], len(data)
    for record in reversed(records):
        ends.append(at)
        at -= 15 + len(record.data)
    for size in range(at, len(data) + 1):
        (tmp_path / "cut").write_bytes(data[:size])
        found = transcript.read(tmp_path / "cut")
        whole = sum(end <= size for end in ends)
        assert list(found.records) == records[:whole]
        assert found.cut == size - (ends[len(ends) - whole] if whole else at)


def test_from_a_changed_byte_on_nothing_is_believed(tmp_path: Path) -> None:
    records = written(tmp_path / "t")
    data = bytearray((tmp_path / "t").read_bytes())
    begin = len(data) - sum(15 + len(record.data) for record in records)
    for at in range(begin, len(data), 7):
        changed = bytes(data[:at]) + bytes((data[at] ^ 0x10,)) + bytes(data[at + 1 :])
        (tmp_path / "changed").write_bytes(changed)
        found = transcript.read(tmp_path / "changed")
        assert list(found.records) == records[: len(found.records)]
        assert len(found.records) < len(records) and found.cut > 0


def test_a_record_taken_out_ends_it(tmp_path: Path) -> None:
    records = written(tmp_path / "t")
    data = (tmp_path / "t").read_bytes()
    last = 15 + len(records[-1].data)
    before = 15 + len(records[-2].data)
    (tmp_path / "t").write_bytes(data[: -last - before] + data[-last:])
    assert list(transcript.read(tmp_path / "t").records) == records[:-2]


@pytest.mark.parametrize("data", [b"", b"MET bed transcript 1\n", b"x" * 1000, b"MET bed transcript 2\n" + b"x" * 100])
def test_what_is_no_transcript(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "t").write_bytes(data)
    with pytest.raises(Problem) as caught:
        ReplayBed(tmp_path / "t")
    assert said(caught.value) == (
        f"error[E409]: {tmp_path / 't'} is no transcript of a bed\n = help: give the file that a run with a bed wrote"
    )


def test_a_transcript_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(Problem) as caught:
        ReplayBed(tmp_path / "t")
    assert said(caught.value) == (
        f"error[E409]: {tmp_path / 't'} cannot be read: No such file or directory\n"
        " = help: give the file that a run with a bed wrote"
    )


def test_a_transcript_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "t").touch()
    with pytest.raises(Problem) as caught:
        TranscriptFile(tmp_path / "t")
    assert said(caught.value) == (
        f"error[E409]: {tmp_path / 't'} is there already\n"
        " = help: give another name: what was said to a bed is not overwritten"
    )


def test_a_transcript_that_does_not_say_how_it_was_driven(tmp_path: Path) -> None:
    put = list[bytes]()
    TranscriptWriter(put.append, {"line": "x"})
    (tmp_path / "t").write_bytes(b"".join(put))
    with pytest.raises(Problem) as caught:
        ReplayBed(tmp_path / "t")
    assert said(caught.value) == (
        f"error[E409]: {tmp_path / 't'} does not say how its bed was driven\n"
        " = help: give the transcript of a bed on a serial line"
    )


CHILD = """
import sys
from hw.lines.transcript import TranscriptFile, TranscriptWriter
writer = TranscriptWriter(TranscriptFile(sys.argv[1]), {"line": "x", "period": 0.001, "first": 3})
n = 0
while True:
    writer.add(1, float(n), n.to_bytes(8, "little") * 3)
    print(n, flush=True)
    n += 1
"""


@pytest.mark.slow
def test_a_killed_writer_loses_nothing_that_was_written(tmp_path: Path) -> None:
    words = [sys.executable, "-c", CHILD, str(tmp_path / "t")]
    child = subprocess.Popen(words, stdout=subprocess.PIPE, cwd=Path(__file__).parents[2])
    assert child.stdout is not None
    child.stdout.readline()
    time.sleep(0.2)
    os.kill(child.pid, signal.SIGKILL)
    told = int(child.stdout.read().split()[-1])
    child.wait()
    child.stdout.close()
    found = transcript.read(tmp_path / "t")
    assert len(found.records) >= told + 1
    assert [int.from_bytes(each.data[:8], "little") for each in found.records] == list(range(len(found.records)))


# Replay


def run(bed: SerialBed | ReplayBed | LineBed, count: int = 50, other: int = -1) -> list[BedSample | None]:
    bed.connect()
    bed.limit({"voltage": 5.0})
    samples: list[BedSample | None] = [bed.preset(rate=1.0, seed=4), bed.arm()]
    for n in range(count):
        voltage = 0.02 * n if n != other else 1.25
        samples.append(bed.exchange(voltage, -0.001 * n))
    bed.stop()
    samples.append(bed.rest(0.1))
    return samples


@pytest.fixture
def recorded(tmp_path: Path, on_pty: Callable[..., str]) -> tuple[Path, list[BedSample | None]]:
    path = tmp_path / "run.transcript"
    file = TranscriptFile(path)
    with SerialBed(on_pty(Device(capabilities=0b111)), period=1e-3, transcript=file) as bed:
        bed.patience = 1.0
        samples = run(bed)
    file.close()
    return path, samples


def test_a_transcript_replays_to_the_same_bits(recorded: tuple[Path, list[BedSample | None]]) -> None:
    path, samples = recorded
    with ReplayBed(path) as bed:
        assert run(bed) == samples
    assert None not in samples and any(sample is not None and sample.state == BedState.ARMED for sample in samples)


def test_what_was_asked_otherwise_is_told(recorded: tuple[Path, list[BedSample | None]]) -> None:
    path, _ = recorded
    first = int(transcript.read(path).header["first"])
    at = first + 1 + 1 + 3 + 1 + 31  # HELLO, LIMIT, PRESET, ARM, and 31 exchanges
    with ReplayBed(path) as bed, pytest.raises(Problem) as caught:
        run(bed, other=30)
    assert said(caught.value) == (
        f"error[E407]: {path}: after tick 30 of the bed STEP {at % 65536} of 1.25 V and -0.029296875 A is asked; "
        "then it was "
        f"STEP {at % 65536} of 0.595703125 V and -0.029296875 A\n"
        " = help: a transcript is replayed by what made it: the same deck, case and version of MET"
    )


def test_a_replay_that_goes_on_longer_is_told(recorded: tuple[Path, list[BedSample | None]]) -> None:
    path, _ = recorded
    with ReplayBed(path) as bed:
        run(bed)
        with pytest.raises(Problem) as caught:
            bed.read()
    last = (int(transcript.read(path).header["first"]) + 60) % 65536
    assert said(caught.value).splitlines()[0] == (
        f"error[E407]: {path}: after tick 150 of the bed READ {last} is asked; then it was STOP {last}"
    )


def test_a_run_that_crashed_replays_to_its_end(recorded: tuple[Path, list[BedSample | None]]) -> None:
    path, _ = recorded
    data = path.read_bytes()
    path.write_bytes(data[:2000])
    with ReplayBed(path) as bed, pytest.raises(Problem) as caught:
        assert bed.transcript.cut > 0
        run(bed)
    assert said(caught.value) == (
        f"error[E401]: {path} ends after tick 17 of the bed, where an answer is waited for\n"
        " = help: it was broken off there, or another deck or case made it"
    )


def test_a_disk_that_is_full_is_told_once_and_the_bed_is_stopped() -> None:
    class Full:
        room = 30

        def __call__(self, data: bytes) -> None:
            Full.room -= 1
            if Full.room < 0:
                raise OSError(28, os.strerror(28))

    device = Device()
    bed = LineBed(lambda: VirtualLine(device, None))
    bed._writer = TranscriptWriter(Full(), {})
    bed.connect()
    bed.arm()
    with pytest.raises(Problem) as caught:
        for _ in range(100):
            bed.exchange(1.0, 0.0)
    assert said(caught.value) == (
        "error[E409]: the transcript of the bed cannot be written: No space left on device\n"
        " = help: make room for it, or give another place"
    )
    assert device.voltage == pytest.approx(1.0, abs=0.01)
    assert bed.stop()
    assert device.voltage == 0.0


def test_a_port_that_gives_nothing_is_no_transcript_and_a_bench_is_no_large_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As /proc/kmsg, which says that it is a regular file."""
    path = tmp_path / "a"
    path.write_bytes(bytes(1 << 17))
    assert refusal(lambda: bench_at(str(path))) == (
        f"error[E446]: {path} cannot be read: it has more than 65,536 bytes\n = help: `can:` takes a bench's file"
    )

    def nothing(_: object) -> None:
        raise BlockingIOError(11, "it has nothing to give, and no end")

    monkeypatch.setattr("hw.beds.replay.open_regular", nothing)
    assert not is_transcript(str(path))
