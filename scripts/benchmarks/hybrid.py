"""Runs with a motor on the emulated bed: ns per step and case of 10,000 hybrid cases, and what the bed adds.

The two-link arm of the 1989 test at 1 kHz, 10,000 gains, the shoulder's motor on the bed. A step has the bed's
substeps, the observer, the question what the arm is to the joint, the law, and the arm with the joint's acceleration
given.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

import ic
from benchmarks.benchmark import Benchmark, Derived
from met.backends.llvm import kernel
from met.program import build
from met.run import inputs

TITLE = "10,000 hybrid cases: the two-link arm at 1 kHz, one or both motors on a bed, ns per step and case, one core"

CASES, STEPS = 10_000, 200

MOUNTED = {
    "pure": ("", "no motor on a bed"),
    "velocity_tracking": ("substitute shoulder { }", "the default law"),
    "torque_balance": ("substitute shoulder { law = torque_balance; }", "torque balance"),
    "measured_acceleration": ("substitute shoulder { law = measured_acceleration; }", "the baseline"),
    "faults": ("substitute shoulder { bed = emulated(faults = typical); }", "default law, typical faults"),
    "both": ("substitute shoulder { }  substitute elbow { }", "default law, both motors on beds"),
}

DECK = """#include <two_link.ic>
run one like nominal {{
    rates {{ dynamics = 1 kHz;  servos = 1 kHz;  record = 1 kHz; }}
    duration = 1 s;  remove settle;  remove volts;  record = [];  {mounted}
}}
sweep gains_of_one of one {{ vary gearbox.kp = linspace(0.015, 0.03, {cases}) V*s/rad; }}
"""


def _hybrid(mounted: str) -> Callable[[], float]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hybrid.ic"
        path.write_text(DECK.format(mounted=mounted, cases=CASES), encoding="utf-8")
        experiment = ic.compile(path, select=["gains_of_one"]).experiments[0]
    compiled = kernel.compile(build(experiment))
    cases = inputs(experiment, np.arange(CASES))

    def measure() -> float:
        begun = time.thread_time()
        compiled.run(cases, STEPS, record=False, threads=1)
        return (time.thread_time() - begun) * 1e9 / (CASES * STEPS)

    return measure


BENCHMARKS: tuple[Benchmark | Derived, ...] = (
    *(Benchmark(f"hybrid.{name}", doc, "ns", partial(_hybrid, text)) for name, (text, doc) in MOUNTED.items()),
    *(
        Derived(f"hybrid.bed.{name}", f"what the bed adds: {doc}", "ns", (f"hybrid.{name}", "hybrid.pure"),
                lambda with_bed, without: with_bed - without)
        for name, (_, doc) in MOUNTED.items() if name != "pure"
    ),
)  # fmt: skip
