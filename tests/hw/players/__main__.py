"""Two played drives on a real bus in real time: `python -m tests.hw.players BENCH.toml`, until it is interrupted.

It plays the drive and the load of the bench file, on a shaft with a little friction. It prints `ready`, and each time
that all drives have stopped, `off` with the time, s of the monotonic clock.
"""

from __future__ import annotations

import signal
import sys
import time

from hw.drives.bench_file import TwoDrives, two_drives
from met.diagnostic import Problem
from met.messages.render import render
from tests.hw.players import PLAYED
from tests.hw.players.fdcanusb import played_bus
from tests.hw.players.player import PlayedBench, play
from tests.hw.players.shaft import InertiaShaft

F_C, F_V = 0.002, 2e-4
"""Friction of the played shaft: as shares of the torque that the drive under test may give, and of that a rad/s."""


def bench_of(bench: TwoDrives, period: float = 5e-4) -> PlayedBench:
    """Played drives from a bench file."""
    figures, most = bench.drive.figures, bench.drive.figures["torque_max"]
    shaft = InertiaShaft(
        inertia=bench.shaft["inertia"],
        kt=figures["kt"],
        resistance=figures["resistance"],
        f_c=F_C * most,
        f_v=F_V * most,
        period=period,
    )
    drive, load = (PLAYED[entry.dialect](entry.node, entry.sense) for entry in (bench.drive, bench.load))
    return PlayedBench(shaft, drive, load)


def main(path: str) -> int:
    asked: list[int] = []
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, lambda number, frame: asked.append(number))
    try:
        bench = two_drives(path)
        line = played_bus(bench.bus)
    except Problem as problem:
        print(render(problem.diagnostics, problem.sources), file=sys.stderr)
        return 2
    except OSError as reason:
        print(f"{path}: {reason.strerror}", file=sys.stderr)
        return 2
    played, driving = bench_of(bench), False

    def stopped() -> bool:
        nonlocal driving
        if driving and played.off:
            print(f"off {time.clock_gettime(time.CLOCK_MONOTONIC):.6f}", flush=True)
        driving = not played.off
        return bool(asked)

    print("ready", flush=True)
    play(line, played, stopped)
    line.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]) if len(sys.argv) == 2 else "python -m tests.hw.players BENCH.toml")
