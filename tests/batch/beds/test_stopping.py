"""However a run in real time ends, the bed is in its safe state; and what was recorded of it is in an archive.

The bed is the firmware behind a pseudo-terminal, with a time of its own, on a line as a real one's. What its amplifiers
are told is in its log: the load's current goes first, then the drive's voltage.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from hw import realtime
from hw.bed import BedState, Fault
from hw.beds import emulated
from hw.beds.serial_line import SerialBed
from hw.beds.simulated import config_of
from hw.boards.build import build
from hw.driving import loop
from hw.driving.pace import pace
from hw.recording import records
from met import cli
from met.plan import Experiment
from met.plant import bed_values, plant_c

pytestmark = [pytest.mark.alone, pytest.mark.slow]

slow = pytest.mark.slow
PERIOD = 0.002
DECK = """\
#include <two_link.ic>
run wired like hybrid {
    duration = 300 s;
    remove settle;
    remove volts;
    record = [q, qd, shoulder.bed.load_current];
}
"""
NS = 1e-9
SLACK = 0.010
"""s between a signal that is sent and the process's end, and from the tick that is due to its log."""

# ns, i or v, counts: outputs that changed.
Log = list[tuple[int, str, int]]


class BedHost:
    """The firmware of a deck's bed, behind a terminal."""

    def __init__(self, experiment: Experiment, log: Path) -> None:
        self.values = bed_values(experiment, "shoulder", 0)
        program = build(
            "host", config_of(self.values, PERIOD, lock_step=False), plant_c(experiment, "shoulder", period=PERIOD)
        )
        self._log = log
        self.process = subprocess.Popen([program, "--log", log], stdout=subprocess.PIPE, text=True)
        realtime.put_first(self.process.pid)
        assert self.process.stdout is not None
        self.terminal = self.process.stdout.readline().strip()

    def log(self) -> Log:
        lines = [line.split() for line in self._log.read_text(encoding="utf-8").splitlines()]
        return [(int(ns), output, int(counts)) for ns, _, output, counts in lines]

    def faults(self) -> tuple[BedState, Fault]:
        with SerialBed(self.terminal, period=PERIOD) as bed:
            bed.connect()
            sample = bed.read()
            return sample.state, sample.faults


@contextlib.contextmanager
def begun(here: Path) -> Iterator[BedHost]:
    """It lives as long as the block."""
    found = BedHost(ic.compile("deck.ic", select=["wired"]).experiments[0], here / "log")
    try:
        yield found
    finally:
        found.process.kill()
        found.process.communicate()


@pytest.fixture
def host(here: Path) -> Iterator[BedHost]:
    with begun(here) as found:
        yield found


def command(terminal: str) -> list[str]:
    return [
        sys.executable,
        "-m",
        "met.cli",
        "bed",
        "run",
        "deck.ic",
        "wired",
        "--port",
        terminal,
        "-o",
        "a.h5",
        "--no-picture",
        "--clear",
    ]


def running(terminal: str, here: Path, *words: str) -> subprocess.Popen[str]:
    """`met bed run`, once it has exchanged 300 times and the drive turns. A machine that is busy for 10 ms ends a run,
    which then is begun anew."""
    path = here / "a.h5.campaign" / "beds" / "0-0.records"
    for _ in range(30):
        process = subprocess.Popen(
            [*command(terminal), *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        while not path.exists() or path.stat().st_size < 300 * records.SIZE:
            if process.poll() is not None:
                break
            time.sleep(0.01)
        else:
            return process
        said, complaint = process.communicate()
        assert process.returncode == cli.NO and re.search("no answer|behind|deadman", said), complaint
        for left in (here / "a.h5", *(here / "kept").glob("*")):
            left.unlink()
    raise AssertionError("this machine is too busy for exchanges at 500 Hz")


def test_a_host_that_is_killed_leaves_safe_outputs_and_all_of_its_records(here: Path) -> None:
    """Within the deadman's time; where the bed's own process was not woken then, once more."""
    for _ in range(5):
        with begun(here) as host:
            late = killed(host, here)
            if late < emulated.DEADMAN + PERIOD + SLACK:
                break
        for left in (here / "a.h5", here / "a.h5.run.json", here / "log"):
            left.unlink()
    else:
        raise AssertionError(f"safe {late:.3f} s after the kill")


def killed(host: BedHost, here: Path) -> float:
    """s from the kill to the last output that changed."""
    process = running(host.terminal, here)
    path = here / "a.h5.campaign" / "beds" / "0-0.records"
    at = time.monotonic_ns()
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    size = -1
    while size != path.stat().st_size:  # the writer, in a session of its own, puts the rest on the disk
        size = path.stat().st_size
        time.sleep(0.5)
    log = host.log()
    assert [each[1:] for each in log[-2:]] == [("i", 0), ("v", 0)]
    assert host.faults() == (BedState.STOPPED, Fault.DEADMAN)

    found = records.read(path)
    assert found.rows["exchange"].tolist() == list(range(len(found.rows))) and len(found.rows) >= 290  # and a head
    # of the commands that reached an output the last is recorded, or was under way
    told = [counts for _, output, counts in log[:-2] if output == "v"]
    assert round(float(found.rows["voltage"][-1]) / host.values["converter_voltage"]) in told[-2:]

    done = subprocess.run(command(host.terminal), capture_output=True, text=True)
    assert done.returncode == cli.NO, done.stderr
    data = batch.open("a.h5")
    assert int(data.status[0]) == 1 and "the host was gone" in str(data.cause.values[0])
    assert abs(int(data.n_valid[0]) - len(found.rows) / 20) <= 2  # 500 exchanges a second, 25 rows
    assert len(host.log()) == len(log)  # it was not driven again
    held = data["shoulder.bed.load_current"].values[0, : int(data.n_valid[0])]
    assert np.isfinite(held).all() and np.abs(held).max() > 0.01
    return (log[-1][0] - at) * NS


@pytest.mark.parametrize(
    ("how", "status"),
    [
        ("Ctrl-C", 130),
        *(pytest.param(*each, marks=slow) for each in (("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", -1))),
    ],
)
def test_a_host_that_is_told_to_end_stops_its_bed(host: BedHost, here: Path, how: str, status: int) -> None:
    """By STOP, before a deadman would; where this machine was too busy for that, once more."""
    for _ in range(5):
        process = running(host.terminal, here)
        if how == "Ctrl-C":  # a terminal tells all of its foreground processes
            os.killpg(process.pid, signal.SIGINT)
        else:
            process.send_signal(signal.Signals[how])
        _, complaint = process.communicate(timeout=30.0)
        assert "Traceback" not in complaint
        assert [each[1:] for each in host.log()[-2:]] == [("i", 0), ("v", 0)]
        if host.faults() == (BedState.DISARMED, Fault(0)) and process.returncode == status:
            break
        shutil.rmtree(here / "a.h5.campaign", ignore_errors=True)
        (here / "a.h5").unlink(missing_ok=True)
        with SerialBed(host.terminal, period=PERIOD) as bed:
            bed.connect()
            bed.rest(1.0)
            bed.clear()
    else:
        raise AssertionError((process.returncode, host.faults(), complaint))


@slow
def test_a_case_s_process_that_is_killed_is_told_and_the_bed_stops(host: BedHost, here: Path) -> None:
    process = running(host.terminal, here)
    [driver] = [
        int(pid) for pid in _children(process.pid) if b"hw.driving.case" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
    os.kill(driver, signal.SIGKILL)
    said, complaint = process.communicate(timeout=30.0)
    assert process.returncode == cli.NO, complaint
    assert "the host was gone" in said
    assert [each[1:] for each in host.log()[-2:]] == [("i", 0), ("v", 0)]
    assert host.faults() == (BedState.STOPPED, Fault.DEADMAN)


def _children(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()


def test_an_exception_in_the_middle_stops_the_bed(host: BedHost) -> None:
    class Wrong(Exception):
        pass

    def compute(e: int, rates: object, told: list[list[float]]) -> None:
        told[0][:] = [1.0, 0.05]
        if e == 50:
            raise Wrong

    with SerialBed(host.terminal, period=PERIOD) as bed:
        bed.patience = 0.05
        bed.connect()
        with pytest.raises(Wrong):
            loop.drive([bed], compute, pace(100.0), 100, lambda record: None, lock_step=False)
        assert bed.read().state in (BedState.DISARMED, BedState.STOPPED)
        log = host.log()
    assert any(output == "v" and counts > 0 for _, output, counts in log)
    assert [each[1:] for each in log[-2:]] == [("i", 0), ("v", 0)]


def test_a_run_in_real_time_is_replayed_from_its_transcript(host: BedHost, here: Path) -> None:
    (here / "deck.ic").write_text(DECK.replace("300 s", "1 s"), encoding="utf-8")
    (here / "kept").mkdir()
    words = ["--transcripts", "kept"]
    done = subprocess.run([*command(host.terminal), *words], capture_output=True, text=True)
    assert done.returncode in (cli.YES, cli.NO), done.stderr  # a busy machine may end it
    replayed(here)


@slow
def test_a_line_that_is_lost_is_said_and_replayed_as_it_was(host: BedHost, here: Path) -> None:
    (here / "kept").mkdir()
    process = running(host.terminal, here, "--transcripts", "kept")
    host.process.kill()
    told, complaint = process.communicate(timeout=30.0)
    assert process.returncode == cli.NO and f"the line to the bed on {host.terminal} was lost: " in told, complaint
    replayed(here)


def replayed(here: Path) -> None:
    """a.h5 again, from its transcript."""
    [transcript] = (here / "kept").iterdir()
    again = ["b.h5" if word == "a.h5" else word for word in command(str(transcript))]
    done = subprocess.run(again, capture_output=True, text=True)
    assert done.returncode in (cli.YES, cli.NO), done.stderr
    one, other = batch.open("a.h5"), batch.open("b.h5")
    assert int(one.n_valid[0]) >= 10 and one.n_valid.values == other.n_valid.values
    assert one.cause.values.tolist() == other.cause.values.tolist()
    for name in ("q", "qd", "shoulder.bed.load_current"):
        assert one[name].values.tobytes() == other[name].values.tobytes()
