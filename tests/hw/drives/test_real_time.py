"""Played drives on buses of python-can, in real time: in this process, and in one of their own.

`python -m tests.hw.drives.test_real_time 60` prints what 60 s of exchanges at the highest rate came to; of the dialects
that are named after it, where any are.
"""

from __future__ import annotations

import contextlib
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from hw.bed import BedState
from hw.beds.can_bed import CanBed
from hw.drives.bench_file import two_drives
from hw.drives.bus import open_bus
from hw.realtime import put_first
from met.substitution.bed import DriveCommand
from tests.hw.drives.driving import driving_command
from tests.hw.drives.played import bench_file, host_on, played_bench
from tests.hw.players.fdcanusb import played_bus
from tests.hw.players.player import play

pytestmark = pytest.mark.alone

DIALECTS = (
    *("odrive", "damiao", "moteus", "cia402", "robstride", "odrive_ascii", "moteus behind an fdcanusb"),
    *("odrive told rates", "cia402 told rates"),
)
RATES = " told rates"
GROUP = "239.74.163.2"
"""Multicast group, of this machine alone, in whose place a bus is."""


def file_for(folder: Path, dialect: str, interface: str, channel: str) -> Path:
    """A bench file of a dialect on a bus; of one behind an adapter, on its pseudo-terminal in the folder."""
    name, _, adapter = dialect.removesuffix(RATES).partition(" behind an ")
    return bench_file(folder, name, adapter or interface, str(folder / "line") if adapter else channel)


@contextmanager
def on_virtual_bus(folder: Path, dialect: str) -> Iterator[CanBed]:
    """The host's side of a bench that is played by a thread of this process, on python-can's virtual bus."""
    bench = two_drives(file_for(folder, dialect, "virtual", "bench"))
    played, ended = played_bench(bench.drive.dialect), threading.Event()
    theirs = played_bus(bench.bus)
    thread = threading.Thread(target=play, args=(theirs, played, ended.is_set), daemon=True)
    thread.start()
    try:
        told: DriveCommand = "rate" if dialect.endswith(RATES) else "voltage"
        with host_on(bench, lambda: open_bus(bench.bus), drive=told) as bed:
            yield bed
    finally:
        ended.set()
        thread.join()
        theirs.close()
    assert played.off


def exchanged(bed: CanBed, seconds: float) -> tuple[int, list[float], list[float]]:
    """Drive a bed at its highest rate. Returns how many exchanges had no answer, and of all: how late they began, and
    how long they took, s. Where it stops itself, as it does where the machine is busy, it is armed anew."""
    command = driving_command(bed.connect())
    period = bed.period
    bed.patience = 2.0 * period
    bed.arm()
    missed, late, took = 0, [], []
    begun = time.perf_counter()
    for n in range(1, round(seconds / period)):
        due = begun + n * period
        if (left := due - time.perf_counter()) > 0.0:
            time.sleep(left)
        now = time.perf_counter()
        sample = bed.exchange(command, 0.1)
        late.append(now - due)
        took.append(time.perf_counter() - now)
        if sample is None:
            missed += 1
        elif sample.state != BedState.ARMED:
            while abs(bed.rest(0.5).rate) > 4.0:
                pass
            bed.clear()
            bed.arm()
            begun = time.perf_counter() - n * period
    return missed, late, took


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_bus_within_a_process_carries_exchanges(tmp_path: Path, dialect: str) -> None:
    with on_virtual_bus(tmp_path, dialect) as bed:
        missed, late, _ = exchanged(bed, 1.0)
    assert len(late) == round(1.0 / bed.period) - 1 and missed < len(late) / 2


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_host_that_is_killed_leaves_the_drives_off_within_their_watchdog(tmp_path: Path, dialect: str) -> None:
    # where the machine was busy the bed may have stopped by itself just before
    after = next((each for each in (stopped_after(tmp_path, dialect) for _ in range(25)) if each > 0.0), None)
    if after is None:
        pytest.skip("the machine is too busy: 25 times the bed had stopped by itself")
    assert after < 0.020 + 0.005 + 0.05, after  # a tick of the player's, and a busy machine's delay


def stopped_after(folder: Path, dialect: str) -> float:
    """The time from the death of a host to the last of the drives being off, both processes of their own, s; below 0
    where the bed had stopped by itself before."""
    path = file_for(folder, dialect, "udp_multicast", GROUP)
    player = subprocess.Popen([sys.executable, "-m", "tests.hw.players", str(path)], stdout=subprocess.PIPE, text=True)
    put_first(player.pid)
    assert player.stdout is not None
    host = None
    try:
        assert player.stdout.readline() == "ready\n"
        told = ["rate"] if dialect.endswith(RATES) else []
        command = [sys.executable, "-m", "tests.hw.drives.driving", str(path), *told]
        host = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert host.stdout is not None
        found = host.stdout.readline()
        assert found, "the host did not come to drive"
        host.kill()
        killed = time.clock_gettime(time.CLOCK_MONOTONIC)
        host.wait()
        time.sleep(0.5)
    finally:
        said = ""
        for each in (host, player):
            if each is not None:
                each.terminate()
                said = each.communicate()[0]
    return float(said.split()[-1]) - killed if "ARMED" in found else -1.0


def _figures(seconds: float, dialects: Sequence[str] = DIALECTS) -> None:
    with contextlib.suppress(OSError):  # threads too
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    for dialect in dialects:
        with tempfile.TemporaryDirectory() as name:
            with on_virtual_bus(Path(name), dialect) as bed:
                missed, late, took = exchanged(bed, seconds)
            print(
                f"{dialect}: {len(late):,} exchanges at {1.0 / bed.period:g} Hz, {missed} without an answer; "
                f"late median {1e6 * statistics.median(late):.0f} us, "
                f"p99 {1e6 * statistics.quantiles(late, n=100)[98]:.0f} us; "
                f"took median {1e6 * statistics.median(took):.0f} us, "
                f"p99 {1e6 * statistics.quantiles(took, n=100)[98]:.0f} us"
            )
            afters = [1e3 * stopped_after(Path(name), dialect) for _ in range(5)]
            print(f"{dialect}: off {', '.join(f'{each:.1f}' for each in afters)} ms after the host was killed")


if __name__ == "__main__":
    _figures(float(sys.argv[1]), sys.argv[2:] or DIALECTS)
