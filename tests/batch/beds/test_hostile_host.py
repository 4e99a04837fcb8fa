"""What a hostile review of the host's side found: however a run ends, whatever a bed answers, whatever is asked."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.beds.executor import OnBeds, Ports
from batch.beds.running import timing_lines, timings
from hw.bed import BedSample, BedState, Fault
from hw.lines import transcript
from hw.protocol import messages
from hw.protocol.frames import unframed
from hw.recording import records
from hw.recording.writer import recording
from met import cli
from met.diagnostic import Problem
from tests.hw.device import DISARMED, RATE, STOPPED, Device, payload

pytestmark = [pytest.mark.alone, pytest.mark.slow]

DECK = """\
#include <two_link.ic>
run wired like nominal {
    rates    { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 0.2 s;
    record   = [q, qd, shoulder.bed.load_current];
    remove settle;
    remove volts;
    substitute shoulder { bed = emulated(faults = typical);  law = velocity_tracking; }
}
sweep tuning of wired { vary gearbox.kp = [0.01, 0.02] V*s/rad; }
run late like wired { shoulder { bed = emulated(faults = typical, delay = 1); } }
sweep rested of late { vary gearbox.kp = [0.01, 0.02] V*s/rad; }
run both like wired { substitute elbow { bed = emulated;  law = velocity_tracking; } }
run long like wired { duration = 60 s; }
servo smooth like gearbox { f_v = 0 N*m*s/rad; }
run sheet like wired { servos { shoulder = smooth;  elbow = gearbox; } }
"""
MET = [sys.executable, "-m", "met.cli", "bed"]
Take = Callable[[Device, bytes], bytes]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deck.ic").write_text(DECK)
    return tmp_path


def met(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*MET, *words], capture_output=True, text=True)


def run(name: str, port: str, *words: str, output: str = "a.h5") -> subprocess.CompletedProcess[str]:
    return met("run", "deck.ic", name, "--port", port, "-o", output, "--no-picture", *words)


@contextlib.contextmanager
def served(device: Device, take: Take = Device.take) -> Iterator[str]:
    """The port of a device on a socket; take: makes the answer to a frame."""
    path = Path("line").absolute()
    path.unlink(missing_ok=True)
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(path))
    listener.listen(1)
    listener.settimeout(0.1)
    closing = threading.Event()

    def serve() -> None:
        while not closing.is_set():
            try:
                line, _ = listener.accept()
            except TimeoutError:
                continue
            with line, contextlib.suppress(OSError):  # the other end may be gone
                while data := line.recv(4096):
                    for frame in data.split(b"\0")[:-1]:
                        line.sendall(take(device, frame + b"\0"))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield f"unix://{path}"
    finally:
        closing.set()
        thread.join(1.0)
        listener.close()


def kind(frame: bytes) -> int:
    found = payload(frame[:-1])
    assert found is not None
    return found[0]


def children(pid: int) -> list[int]:
    """Of a process, and theirs."""
    found = []
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        found += [int(child), *children(int(child))]
    return found


def named(pid: int, word: bytes) -> list[int]:
    return [each for each in children(pid) if word in Path(f"/proc/{each}/cmdline").read_bytes()]


# However it ends


def test_a_bed_that_does_not_stop_is_told() -> None:
    def deaf(device: Device, frame: bytes) -> bytes:
        return b"" if kind(frame) == messages.StopMessage.kind else device.take(frame)

    device = Device()
    with served(device, deaf) as port:
        done = run("wired", port, "--lock-step")
    assert device.state != DISARMED
    assert done.returncode == cli.NO
    assert "bed `model` does not confirm that it stopped" in done.stdout


def test_an_interrupt_while_it_rests_ends_it_at_once_and_arms_nothing(here: Path) -> None:
    process = subprocess.Popen(
        [
            *MET,
            "run",
            "deck.ic",
            "rested",
            "--port",
            "firmware",
            "--rest",
            "60 s",
            "--transcripts",
            "k",
            "-o",
            "a.h5",
            "--no-picture",
        ],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    second = here / "k" / "rested.1.shoulder.transcript"
    while not second.exists() or second.stat().st_size < 400:
        assert process.poll() is None
        time.sleep(0.02)
    time.sleep(1.0)
    os.killpg(process.pid, signal.SIGINT)
    asked_at = time.monotonic()
    assert process.wait() == 130
    took = time.monotonic() - asked_at
    kinds = set[type]()
    if second.exists():
        sent = [unframed(each.data[:-1]) for each in transcript.read(second).records if each.kind == transcript.SENT]
        kinds = {type(messages.host_message(each)[1]) for each in sent if each is not None}  # type: ignore[index]
    assert messages.ArmMessage not in kinds
    assert took < 30.0  # it would rest for 60 s


def test_an_orphan_stops_whoever_takes_its_parent_s_place(here: Path) -> None:
    """The parent is killed before the process hears signals; a subreaper, such as `systemd --user`, takes it."""
    (here / "slow.py").write_text("""\
import sys, time
from pathlib import Path
time.sleep(1.0)
from hw.driving import process
stop = process.listening()
time.sleep(0.1)
Path("heard").write_text(str(stop()))
""")
    (here / "starts.py").write_text("""\
from dataclasses import dataclass
from hw.driving.process import talk
@dataclass
class Asked:
    pass
list(talk("slow", Asked(), print))
""")
    ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)
    try:
        paths = os.pathsep.join([str(here), *sys.path])
        starts = subprocess.Popen([sys.executable, "starts.py"], env={**os.environ, "PYTHONPATH": paths})
        while not (found := children(starts.pid)):
            time.sleep(0.005)
        time.sleep(0.2)
        starts.kill()
        starts.wait()
        os.waitpid(found[0], 0)
    finally:
        ctypes.CDLL(None).prctl(36, 0, 0, 0, 0)
    assert Path("heard").read_text() == "True"


def test_a_run_in_a_container_is_not_asked_to_stop() -> None:
    inside = ["unshare", "-pf", "--mount-proc"]
    try:
        able = subprocess.run([*inside, "true"], capture_output=True).returncode == 0
    except FileNotFoundError:
        able = False
    if not able:
        pytest.skip("no leave to make a namespace of processes")
    words = ["run", "deck.ic", "wired", "--port", "emulated", "-o", "a.h5", "--no-picture"]
    done = subprocess.run([*inside, *MET, *words], capture_output=True, text=True)
    assert done.returncode == cli.YES, done.stdout


def test_a_writer_that_is_gone_ends_the_run(here: Path) -> None:
    record = records.packed(0, 0, 0, (0, 0, 0, 0), 0.0, 0.0, BedSample(BedState.ARMED, True, Fault(0), False, 0, 0.0))
    count = 0
    with pytest.raises(Problem) as told, recording(here / "r.records", {}, 2000) as put:
        while not (found := named(os.getpid(), b"hw.recording.writer")):  # it has a name once it is begun
            time.sleep(0.01)
        [writer] = found
        os.kill(writer, signal.SIGKILL)
        time.sleep(0.2)
        for count in range(2000):  # noqa: B007
            put(record)
    assert count < 200
    assert told.value.diagnostics[0].message == f"cannot write {here}/r.records: its process ended with -9"


def test_an_emulator_ends_with_who_drives_it(here: Path) -> None:
    process = subprocess.Popen(
        [*MET, "run", "deck.ic", "long", "--port", "qemu", "--lock-step", "-o", "a.h5", "--no-picture"],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    path = here / "a.h5.campaign" / "beds" / "0-0.records"
    while not path.exists() or path.stat().st_size < 10_000:
        if process.poll() is not None:
            pytest.skip("no emulator, or no compiler for it")
        time.sleep(0.02)
    [emulator] = named(process.pid, b"qemu-system-arm")
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    time.sleep(1.0)
    with contextlib.suppress(ProcessLookupError):
        state = (
            Path(f"/proc/{emulator}/stat").read_text().rpartition(")")[2].split()[0]
            if Path(f"/proc/{emulator}").exists()
            else "X"
        )
        if state not in "XZ":
            os.kill(emulator, signal.SIGKILL)
            raise AssertionError("it goes on")


def test_an_interrupt_of_identify_is_one() -> None:
    process = subprocess.Popen(
        [*MET, "identify", "deck.ic", "wired", "--port", "firmware", "--lock-step"],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    while not Path("shoulder.identified.records").exists():
        assert process.poll() is None
        time.sleep(0.02)
    time.sleep(0.5)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait() == 130


# What a bed answers


def test_a_bed_that_stops_itself_at_the_last_exchange_is_a_failed_case() -> None:
    steps = 0

    def at_last(device: Device, frame: bytes) -> bytes:
        nonlocal steps
        steps += kind(frame) == messages.StepMessage.kind
        if steps == 200 and device.state != STOPPED:
            device.stop(RATE)
        return device.take(frame)

    with served(Device(), at_last) as port:
        done = run("wired", port, "--lock-step")
    assert done.returncode == cli.NO
    assert "the bed stopped itself: rate" in done.stdout


def test_scales_of_what_is_not_there_are_valid_json() -> None:
    device = Device()
    device.scales = (*device.scales[:4], float("nan"), float("inf"))
    with served(device) as port:
        said = met("probe", "--port", port, "--format", "json").stdout

    def no_number(word: str) -> None:
        raise ValueError(word)

    assert json.loads(said, parse_constant=no_number)["scales"]["drive_current"] is None


def test_a_bed_that_ticks_more_slowly_than_it_is_asked_is_told() -> None:
    device = Device(lock_step=False, tick_hz=100.0)
    with served(device) as port:
        done = run("late", port)
    assert done.stderr.startswith("error[E405]: bed `model` ticks at 100 Hz, and would be spoken to at 1000 Hz\n")


# What is told, and what is kept


def rows_of(count: int, hz: float, *, silent: int = 0) -> np.ndarray:
    rows = np.zeros(count, records.LAYOUT)
    rows["exchange"], rows["tick"], rows["flags"] = np.arange(count), np.arange(count), records.ANSWERED
    rows["due"] = rows["began"] = rows["ended"] = np.arange(count) * round(1e9 / hz)
    rows["flags"][1 : 1 + silent] = 0
    return rows


def known(*cases: np.ndarray, hz: tuple[float, ...], lock_step: bool) -> OnBeds:
    executor = OnBeds(Ports({"shoulder": "line"}, 921600, lock_step))
    for n, (rows, each) in enumerate(zip(cases, hz, strict=True)):
        head = {"joints": ["shoulder"], "beds": [{"name": "one", "firmware": "00"}], "tick_hz": each}
        executor.known.add(n, 0, head, [rows])
    return executor


def test_beds_of_runs_at_other_rates_have_each_its_own_ticks() -> None:
    found = known(rows_of(200, 1000.0), rows_of(200, 500.0), hz=(1000.0, 500.0), lock_step=False)
    assert abs(timings(found)["shoulder"].drift) < 1e-6


def test_exchanges_without_an_answer_are_told_in_lock_step() -> None:
    assert "unanswered: 3" in "\n".join(
        timing_lines(known(rows_of(200, 1000.0, silent=3), hz=(1000.0,), lock_step=True))
    )


def test_rest_does_not_change_the_bits_of_a_simulated_bed() -> None:
    assert run("tuning", "emulated", output="a.h5").returncode == cli.YES
    assert run("tuning", "emulated", "--rest", "1 s", output="b.h5").returncode == cli.YES
    assert batch.diff("a.h5", "b.h5").verdict == "identical"


# Transcripts


def test_a_transcript_of_a_transcript_is_refused() -> None:
    assert run("wired", "firmware", "--lock-step", "--transcripts", "k").returncode == cli.YES
    done = run("wired", "k/wired.0.shoulder.transcript", "--transcripts", "again", output="b.h5")
    assert done.returncode == cli.BAD_INPUT and "error[E409]" in done.stderr
    assert not list(Path().glob("again/*"))


@pytest.mark.parametrize("header", [b"{", json.dumps({"period": 1e-3, "first": float("inf")}).encode()])
def test_a_header_that_is_none_is_told(header: bytes) -> None:
    body = struct.pack("<BdH", transcript.HEADER, 0.0, len(header)) + header
    Path("t").write_bytes(transcript.MAGIC + body + zlib.crc32(body).to_bytes(4, "little"))
    done = run("wired", "t")
    assert done.returncode == cli.BAD_INPUT and done.stderr.startswith("error[E409]: t ")


# What is asked


def test_two_joints_on_one_line_are_told() -> None:
    words = ("--port", f"elbow=unix://{Path('line').absolute()}", "--lock-step")
    with served(Device()) as port:
        done = run("both", f"shoulder={port}", *words)
    assert done.stderr.startswith("error[E418]: joints `shoulder` and `elbow` have one port: unix://")


def test_a_joint_that_is_on_no_bed_is_told() -> None:
    done = run("wired", "shuolder=emulated")
    assert (
        done.stderr
        == """\
error[E418]: port `shuolder=emulated`: joint `shuolder` is on no bed here
 = help: on a bed here: `shoulder`

1 error
"""
    )


def test_a_baud_rate_that_cannot_be_is_told() -> None:
    ours, theirs = os.openpty()
    try:
        assert cli.main(["bed", "probe", "--port", os.ttyname(theirs), "--baud", "4000000000"]) == cli.BAD_INPUT
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_data_sheet_without_friction_is_told_before_a_shaft_turns(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bed", "identify", "deck.ic", "sheet", "--port", "emulated"]) == cli.BAD_INPUT
    assert "error[E424]: joint `shoulder`: the search cannot begin at f_v = 0 N*m*s/rad" in capsys.readouterr().err
