"""A host that drives a bench until it is killed: `python -m tests.hw.drives.driving BENCH.toml`. It says `driving`
once the shaft is fast, and when its last command was sent, s of the monotonic clock, every 100 exchanges."""

from __future__ import annotations

import sys
import time

from hw.beds.can_bed import PORT
from hw.ports import Opening, Port
from hw.realtime import take_precedence


def main(path: str) -> None:
    bed = PORT.open(Opening(Port(f"can:{path}"), period=2e-3))
    with bed:
        bed.connect()
        take_precedence()
        bed.patience = 0.01
        bed.arm()
        begun = time.perf_counter()
        for n in range(1, 30_000):
            while time.perf_counter() < begun + n * 2e-3:
                time.sleep(2e-4)
            sample = bed.exchange(5.0, 0.2)
            if n == 100 and sample is not None:
                print("driving", sample.rate, sample.state.name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
