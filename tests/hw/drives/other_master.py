"""Another master on a drive's line: `python -m tests.hw.drives.other_master`.

It commands one of two drives that a host drives, every 10 ms, in one of five ways: a rate, a torque, to arm it, to
disarm it, or a limit. A campaign has 20 runs of each way, and 200 without another master, of each dialect. It prints
how many were noticed, after how long, and how many of the others were stopped. The exit status is 1 where one was.
"""

from __future__ import annotations

import heapq
import math
import random
import struct
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from hw.bed import BedState
from hw.beds.can_bed import CanBed
from hw.drives import cia402, damiao, moteus, robstride
from hw.drives.bench_file import two_drives
from hw.drives.drive import CanFrame
from hw.drives.odrive_lines import summed
from met.diagnostic import Problem
from met.frozen import frozen
from met.substitution.bed import DriveCommand
from tests.hw.drives.played import bench_file, host_of, line_of, period_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.drives.test_faults import DIALECTS
from tests.hw.players.odrive import FIRST, PROPERTIES

WAYS = ("rate", "torque", "arm", "disarm", "limit")
PERIOD, JITTER = 0.01, 0.001
"""Time from one command of the other master's to the next, and by how much it is longer at times, s."""

ASKED = ("odrive", "odrive_ascii")
"""Dialects of which a period of the highest rate has room to ask what a drive was told; in twice that others have."""

LONGEST, HONEST = 3.0, 0.6
"""Time for which a bench is driven that another master commands, and one that none does, s."""

TORQUE = 0.35
"""Torque that the other master commands, N m."""


def commands(dialect: str, way: str, node: int) -> Sequence[CanFrame]:
    """What another master sends to a drive."""
    return {
        "odrive": _of_odrive,
        "odrive_ascii": _of_odrive_ascii,
        "damiao": _of_damiao,
        "moteus": _of_moteus,
        "robstride": _of_robstride,
        "cia402": _of_cia402,
    }[dialect](way, node)


def _of_odrive(way: str, node: int) -> Sequence[CanFrame]:
    limit = FIRST + next(n for n, (path, _) in enumerate(PROPERTIES) if path == "axis0.config.torque_soft_max")
    command, data = {
        "rate": (0x0D, struct.pack("<ff", 5.0, 0.0)),
        "torque": (0x0E, struct.pack("<f", TORQUE)),
        "arm": (0x07, struct.pack("<I", 8)),
        "disarm": (0x07, struct.pack("<I", 1)),
        "limit": (0x04, struct.pack("<BHBf", 1, limit, 0, 0.05)),
    }[way]
    return (CanFrame(node << 5 | command, data),)


def _of_odrive_ascii(way: str, node: int) -> Sequence[CanFrame]:
    text = {
        "rate": b"v 0 5 0",
        "torque": b"c 0 %g" % TORQUE,
        "arm": b"w axis0.requested_state 8",
        "disarm": b"w axis0.requested_state 1",
        "limit": b"w axis0.config.torque_soft_max 0.05",
    }[way]
    return (CanFrame(node, summed(text)),)


def _of_damiao(way: str, node: int) -> Sequence[CanFrame]:
    if way == "rate":
        return (CanFrame(0x200 + node, struct.pack("<f", 5.0)),)
    if way == "limit":
        return (CanFrame(damiao.REGISTERS, struct.pack("<HBBf", node, damiao.WRITE, damiao.TMAX, 0.5)),)
    torque = damiao.packed(damiao.STEPS_16 // 2, damiao.STEPS_12 // 2, 0, 0, 3500)
    data = {"torque": torque, "arm": damiao.ENABLE, "disarm": damiao.DISABLE}[way]
    return (CanFrame(node, data),)


def _of_moteus(way: str, node: int) -> Sequence[CanFrame]:
    mode = moteus.written(moteus.INT8, moteus.MODE, moteus.STOPPED if way == "disarm" else moteus.DRIVING)
    rest = {
        "rate": moteus.written(moteus.FLOAT, moteus.TARGET, math.nan, 5.0),
        "torque": moteus.written(moteus.FLOAT, moteus.TORQUE, TORQUE, 0.0, 0.0)
        + moteus.written(moteus.FLOAT, moteus.INTEGRAL_SCALE, 0.0),
        "limit": moteus.written(moteus.FLOAT, 0x025, 0.05),
    }.get(way, b"")
    return (CanFrame(0x200 | node, moteus.padded(mode + rest), extended=True, fd=True),)


def _of_robstride(way: str, node: int) -> Sequence[CanFrame]:
    kind, middle, data = {
        "rate": (robstride.TELL, 0x7FFF, struct.pack(">HHHH", 0x7FFF, 0x9000, 0, 0x1000)),
        "torque": (robstride.TELL, 0x8800, struct.pack(">HHHH", 0x7FFF, 0x7FFF, 0, 0)),
        "arm": (robstride.ENABLE, 0x01, bytes(8)),
        "disarm": (robstride.STOP, 0x01, bytes(8)),
        "limit": (robstride.WRITE, 0x01, struct.pack("<HHf", robstride.TORQUE_LIMIT, 0, 0.5)),
    }[way]
    return (CanFrame(kind << 24 | middle << 8 | node, data, extended=True),)


def _of_cia402(way: str, node: int) -> Sequence[CanFrame]:
    if way in ("rate", "limit"):
        head, value = {"rate": ((0x23, 0x60FF, 0), "<i"), "limit": ((0x2B, 0x6072, 0), "<h")}[way]
        data = (struct.pack("<BHB", *head) + struct.pack(value, 50)).ljust(8, b"\0")
        return (CanFrame(cia402.SDO_ASK + node, data),)
    control, torque = {"torque": (cia402.ENABLE, 1500), "arm": (cia402.ENABLE, 0), "disarm": (0, 0)}[way]
    return (CanFrame(cia402.RPDO1 + node, struct.pack("<Hi", control, torque)),)  # as long as of a rate


def interfere(line: PlayedLine, frames: Sequence[CanFrame], at: float, until: float, seed: int, *, heard: bool) -> None:
    """Let another master send frames on a played line from one time to another, s. heard: False where it is on another
    port of the drive, so that the host's line does not carry its frames."""
    chance = random.Random(seed)
    while at < until:
        for frame in frames:
            heapq.heappush(line._events, (at, next(line._order), False, frame))
            if heard:
                heapq.heappush(line._events, (at, next(line._order), True, frame))
        at += PERIOD + chance.uniform(0.0, JITTER)


@frozen
class Outcome:
    """What came of a run. after: s from the other master's first command until the bed had stopped, infinite where it
    has not;  words: why;  later: True where it was noticed only after the run"""

    after: float
    words: str = ""
    later: bool = False


def run(
    folder: Path, dialect: str, way: str, seed: int, *, heard: bool = True, told: DriveCommand = "voltage"
) -> Outcome:
    """Drive a bench into which another master commands one of its drives, and arm it again afterwards. way: "" for no
    other master"""
    chance = random.Random(f"{dialect} {way} {seed}")
    played = played_bench(dialect)
    line = line_of(dialect, played)
    period = period_of(dialect) if heard or dialect in ASKED else 2.0 * period_of(dialect)
    with host_of(two_drives(bench_file(folder, dialect)), line, period, drive=told) as bed:
        line.sleep(chance.uniform(0.0, 0.05))
        bed.connect()
        bed.patience = 2.0 * period
        bed.arm()
        begins = line.now() + chance.uniform(0.1, 0.2)
        if way:
            frames = commands(dialect, way, chance.choice((1, 2)))
            serial = dialect == "odrive_ascii"
            interfere(line, frames, begins, begins + LONGEST + 0.5, seed, heard=heard and not serial)
        share = min(1.0, bed._require_about().limits.rate / 110.0)
        amplitude, hz = share * chance.uniform(2.0, 6.0) * (10.0 if told == "rate" else 1.0), chance.uniform(1.0, 4.0)
        due = line.now()
        for _ in range(round((LONGEST if way else HONEST) / period)):
            due += period
            line.sleep(max(0.0, due - line.now()))
            phase = 2.0 * math.pi * hz * due
            sample = bed.exchange(amplitude * math.sin(phase), share * math.sin(0.7 * phase))
            if sample is not None and sample.state != BedState.ARMED:
                return _noticed(bed, line, begins)
        if not bed.stop():
            return Outcome(line.now() - begins, "it does not stop", later=True)
        return _armed_again(bed, line, begins)


def _noticed(bed: CanBed, line: PlayedLine, begins: float) -> Outcome:
    return Outcome(line.now() - begins, bed._why or repr(bed._faults))


def _armed_again(bed: CanBed, line: PlayedLine, begins: float) -> Outcome:
    try:
        bed.rest(0.2)
        while bed.read().state == BedState.DISARMED and abs(bed.read().rate) > bed._require_about().limits.arming_rate:
            bed.rest(0.5)
        bed.arm()
    except Problem as problem:
        return Outcome(line.now() - begins, problem.diagnostics[0].message, later=True)
    return Outcome(math.inf)


TOLD: tuple[DriveCommand, ...] = ("voltage", "rate")
CASES: tuple[tuple[str, bool, DriveCommand], ...] = (
    *(("odrive_ascii", True, told) for told in TOLD),
    *((dialect, False, told) for dialect in ("odrive", "cia402") for told in TOLD),
    *((dialect, True, "voltage") for dialect in DIALECTS if dialect != "odrive_ascii"),
    *((dialect, True, "rate") for dialect in ("odrive", "cia402")),
)
"""Dialect, whether the host hears the other master's frames on the bus, and what the drive under test is told."""


def main(runs: int = 20, honest: int = 200) -> int:
    alarms = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for dialect, heard, told in CASES:
            of = f"{dialect}{'' if heard else ', another port'}"
            for way in WAYS:
                found = [run(folder, dialect, way, seed, heard=heard, told=told) for seed in range(runs)]
                during = [1e3 * each.after for each in found if not each.later and math.isfinite(each.after)]
                later = sum(each.later for each in found)
                times = f"after {median(during):.0f} ms, at most {max(during):.0f} ms" if during else ""
                print(
                    f"{of:27} {told:8} {way:7} noticed {len(during):3} of {runs}, {later:2} later {times}", flush=True
                )
            if heard:
                stopped = [run(folder, dialect, "", seed, told=told).words for seed in range(honest)]
                alarms += len(false := [each for each in stopped if each])
                print(f"{of:27} {told:8} none    stopped {len(false):3} of {honest} {false[:2]}", flush=True)
    return 1 if alarms else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
