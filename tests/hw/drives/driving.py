"""A host that drives a bench until it is killed: `python -m tests.hw.drives.driving BENCH.toml`. It says `driving`
once the shaft is fast, and when its last command was sent, s of the monotonic clock, every 100 exchanges."""

from __future__ import annotations

import sys
import time

from hw.bed import About
from hw.beds.can_bed import PORT
from hw.ports import Opening, Port
from hw.realtime import take_precedence
from tests.hw.drives.played import KT


def driving_voltage(about: About) -> float:
    """A voltage at which the shaft of the tests' bench comes to half its largest rate, and to 3 V at most, V."""
    return min(3.0, 0.5 * KT * about.limits.rate)


def main(path: str) -> None:
    bed = PORT.open(Opening(Port(f"can:{path}"), period=2e-3))
    with bed:
        voltage = driving_voltage(bed.connect())
        take_precedence()
        bed.patience = 0.01
        bed.arm()
        begun, said = time.perf_counter(), False
        for n in range(1, 30_000):
            while time.perf_counter() < begun + n * 2e-3:
                time.sleep(2e-4)
            sample = bed.exchange(voltage, 0.1)
            if n >= 100 and sample is not None and not said:
                said = True
                print("driving", sample.rate, sample.state.name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
