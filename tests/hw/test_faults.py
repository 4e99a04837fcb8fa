"""Lines do to frames what lines do: no wrong answer is taken, and every bed ends where docs/protocol.md says.

At the other end is the model of tests/hw/device.py, or the firmware. `python -m tests.hw.test_faults` prints what
became of 10,000 exchanges of each kind.
"""

from __future__ import annotations

import math
import struct
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from hw.bed import BedSample, BedState, Fault
from hw.beds.replay import ReplayBed
from hw.beds.serial_line import SerialBed
from hw.beds.wire import WireBed
from hw.lines import transcript
from hw.protocol import messages
from met.diagnostic import Problem
from tests.hw import device as model
from tests.hw.conftest import LineBed
from tests.hw.device import Device
from tests.hw.firmware.board import Board
from tests.hw.relay import KINDS, Faults, VirtualLine

PERIOD, MISSED = 1e-3, 5
SHARES = {"cut": 0.004, "reboot": 0.004, "version": 0.004, "stall": 0.004}
"""Of frames, both ways together; else 0.05."""

EPISODE = 400
"""Exchanges from arming to a stop, where nothing goes wrong before."""

DEVICES: dict[str, Callable[..., Device | Board]] = {"model": Device, "firmware": Board}


def answers_of(device: Device | Board, number: int) -> list[tuple[int, int, int]]:
    """Status, tick and rate in counts of all SAMPLEs that the device gave to a number."""
    return [struct.unpack_from("<HIi", answer, 3) for answer in device.answers.get(number, []) if answer[0] == 0x84]


def is_true(device: Device | Board, number: int, sample: BedSample) -> bool:
    """Whether the device did answer so."""
    status = sample.state | sample.greeted << 2 | sample.faults | sample.refused << 13
    return (status, sample.tick, round(sample.rate / device.scales[2])) in answers_of(device, number)


def ended(sample: BedSample | None) -> str:
    """Why whoever drives a bed stops after this answer; nothing where it goes on."""
    if sample is None or (sample.state == BedState.ARMED and sample.greeted):
        return ""
    if not sample.greeted:
        return "reset seen"
    if sample.state == BedState.STOPPED:
        return "stopped itself: " + "|".join(str(each.name) for each in Fault if each in sample.faults)
    return "disarmed"


def drive(bed: WireBed, then: Callable[[BedSample | None], None]) -> str:
    """From greeting it to an end, in a word."""
    try:
        about = bed.connect()
        if abs(bed.read().rate) > about.limits.arming_rate:
            bed.rest(1.0)
        bed.clear()
        bed.arm()
    except Problem as problem:
        return f"not armed: {problem.diagnostics[0].code}"
    missed = 0
    for n in range(EPISODE):
        try:
            sample = bed.exchange(1.0 if n % 20 < 10 else -1.0, 0.1)
        except Problem as problem:
            return f"exchange: {problem.diagnostics[0].code}"
        then(sample)
        if (end := ended(sample)) != "":
            return end
        missed = missed + 1 if sample is None else 0
        if missed == MISSED:
            return "five missed"
    return "done"


def endings(
    kind: str, *, lock_step: bool, exchanges: int, folder: Path, seed: int = 0, of: str = "model"
) -> Counter[str]:
    """How so many exchanges ended, under faults of one kind; what must hold is asserted."""
    device = DEVICES[of](lock_step=lock_step)
    faults = Faults(kind, SHARES.get(kind, 0.05), seed, device)
    lines = [VirtualLine(device, faults)]
    found, logged = Counter[str](), Counter[str]()

    def open_line() -> VirtualLine:
        faults.cut = False  # joined again
        logged.update(lines[-1].seen)
        lines.append(VirtualLine(device, faults, lines[-1].time))
        return lines[-1]

    bed = LineBed(open_line, PERIOD, first=65000, recorded=True)
    bed.patience = 0.9 * PERIOD
    samples, began = list[BedSample | None](), 0.0

    def judge(sample: BedSample | None) -> None:
        nonlocal began
        found["exchanges"] += 1
        found["answered" if sample is not None else "missed"] += 1
        samples.append(sample)
        assert sample is None or is_true(device, bed.number, sample), "a wrong answer was taken"
        began = max(began + PERIOD, lines[-1].time)
        lines[-1].sleep(began - lines[-1].time)

    ends = []
    while found["exchanges"] < exchanges:
        device.commanded.clear()
        ends.append(drive(bed, judge))
        found[ends[-1]] += 1
        assert len(set(device.commanded)) == len(device.commanded), "a command was taken twice"
        confirmed = bed.stop()
        found["stop not confirmed"] += not confirmed
        lines[-1].sleep(0.030)
        # one in lock-step whose line is cut has no time in which its deadman could act
        assert device.state != model.ARMED or (lock_step and not confirmed)
        if not lock_step or confirmed:
            assert device.outputs[-2:] == [("current", 0.0), ("voltage", 0.0)]  # the load first
        found["deadman"] += bool(device.faults & model.DEADMAN)
        if ends[-1] == "not armed: E403":
            device.version = 1
    bed.close()

    path = folder / f"{kind}.transcript"
    path.write_bytes(b"".join(bed.records))
    kept = transcript.read(path)
    logged.update(lines[-1].seen)
    count = Counter(record.kind for record in kept.records)
    assert kept.cut == 0
    assert (count[transcript.SENT], count[transcript.RECEIVED]) == (logged["sent"], logged["received"])

    again, replayed = list[BedSample | None](), ReplayBed(path)
    for end in ends:
        assert drive(replayed, again.append) == end
        replayed.stop()
    assert again == samples
    found.update(faults=faults.count, records=len(kept.records))
    return found


ALWAYS = {"done", "not armed: E402", "not armed: E406"}
"""Ends that every fault may have: nothing; no answer to what was asked three times; an answer to ARM that was lost, and
the deadman after it."""

ENDS = {
    "drop": {"five missed"},
    "truncate": {"five missed"},
    "duplicate": {"disarmed"},  # by a HELLO that came twice
    "delay": {"five missed", "disarmed"},
    "stall": {"five missed"},
    "cut": {"exchange: E401", "not armed: E401"},
    "reboot": {"reset seen"},
    "version": {"reset seen", "not armed: E403"},
}
"""The others, by kind."""

MUST = {
    "stall": {"five missed"},
    "cut": {"exchange: E401"},
    "reboot": {"reset seen"},
    "version": {"reset seen", "not armed: E403"},
}


def judged(kind: str, lock_step: bool, exchanges: int, folder: Path, of: str) -> None:
    found = endings(kind, lock_step=lock_step, exchanges=exchanges, folder=folder, of=of)
    ends = {end for end in found if end in {"done", "five missed", "reset seen", "disarmed"} or ":" in end}
    assert ends <= ALWAYS | ENDS.get(kind, set())
    assert ends >= MUST.get(kind, {"done"})
    assert found["faults"] >= 3
    assert found["answered"] + found["missed"] == found["exchanges"] >= exchanges
    if kind in ("stall", "cut") and not lock_step:
        assert found["deadman"] >= 1


@pytest.mark.release
@pytest.mark.parametrize("lock_step", [True, False], ids=["lock-step", "free"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_line_with_faults(kind: str, lock_step: bool, tmp_path: Path) -> None:
    judged(kind, lock_step, 2000, tmp_path, "model")


@pytest.mark.release
@pytest.mark.parametrize("of", DEVICES)
@pytest.mark.parametrize("lock_step", [True, False], ids=["lock-step", "free"])
@pytest.mark.parametrize("kind", KINDS)
def test_thousands_of_exchanges(kind: str, lock_step: bool, of: str, tmp_path: Path) -> None:
    judged(kind, lock_step, 5000, tmp_path, of)


def test_without_a_look_at_the_numbers_wrong_answers_would_be_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bed: list[LineBed] = []
    make, answered = LineBed.__init__, messages.bed_answer

    def noted(self: LineBed, *words: Any, **more: Any) -> None:
        make(self, *words, **more)
        bed.append(self)

    def any_number(payload: bytes, sensors: int) -> tuple[int, messages.Answer] | None:
        found = answered(payload, sensors)
        return None if found is None else (bed[0].number, found[1])

    monkeypatch.setattr(LineBed, "__init__", noted)
    monkeypatch.setattr(messages, "bed_answer", any_number)
    with pytest.raises(AssertionError, match="a wrong answer was taken"):
        endings("delay", lock_step=True, exchanges=2000, folder=tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["drop", "flip", "duplicate", "delay", "reorder", "split", "garbage"])
def test_faults_among_real_bytes(kind: str, on_pty: Callable[..., str]) -> None:
    device = Device()
    with SerialBed(on_pty(device, Faults(kind, 0.03, 1, device)), period=PERIOD) as bed:
        bed.patience = 0.02
        bed.connect()
        bed.arm()
        found = [bed.exchange(0.1 * math.sin(0.1 * n), 0.0) for n in range(300)]
        taken = [sample for sample in found if sample is not None]
        assert len(taken) > 200 and all(sample.state == BedState.ARMED for sample in taken)
        given = {answer for number in device.answers for answer in answers_of(device, number)}
        assert {(1 | 4, sample.tick, round(sample.rate / device.scales[2])) for sample in taken} <= given
        assert [sample.tick for sample in taken] == sorted({sample.tick for sample in taken})
        assert bed.stop()
    assert device.state == model.DISARMED and (device.voltage, device.current) == (0.0, 0.0)


if __name__ == "__main__":
    for of, lock_step, kind in product(DEVICES, (True, False), sys.argv[1:] or KINDS):
        with tempfile.TemporaryDirectory() as folder:
            found = endings(kind, lock_step=lock_step, exchanges=10_000, folder=Path(folder), of=of)
        print(of, "lock-step" if lock_step else "free", kind, dict(found), flush=True)
