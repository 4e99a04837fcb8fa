"""A host that drives a bench until it is killed: `python -m tests.hw.drives.driving BENCH.toml [rate]`. It says
`driving` once the shaft is fast. With `rate` the drive under test is told rates."""

from __future__ import annotations

import sys
import time

from hw.bed import About
from hw.drives.bench_file import two_drives
from hw.drives.bus import open_bus
from hw.realtime import take_precedence
from met.substitution.bed import DriveCommand
from tests.hw.drives.played import KT, host_on


def driving_command(about: About) -> float:
    """A voltage at which the shaft of the tests' bench comes to half its largest rate, and to 3 V at most, V; of one
    that is told rates, 50 rad/s, the rate of 3 V."""
    return 50.0 if about.drive == "rate" else min(3.0, 0.5 * KT * about.limits.rate)


def main(path: str, told: DriveCommand = "voltage") -> None:
    bench = two_drives(path)
    with host_on(bench, lambda: open_bus(bench.bus), 2e-3, told) as bed:
        command = driving_command(bed.connect())
        take_precedence()
        bed.patience = 0.01
        bed.arm()
        begun, said = time.perf_counter(), False
        for n in range(1, 30_000):
            while time.perf_counter() < begun + n * 2e-3:
                time.sleep(2e-4)
            sample = bed.exchange(command, 0.1)
            if n >= 100 and sample is not None and not said:
                said = True
                print("driving", sample.rate, sample.state.name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], "rate" if sys.argv[2:] == ["rate"] else "voltage")
