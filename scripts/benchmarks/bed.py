"""A motor in the loop at 1 kHz: the Panda simulated in real time, its shoulder's motor on a bed behind a
pseudo-terminal, which is the bed's firmware with a time of its own.

The step is what is computed between a sample and the next command, in this process. The rest is of one minute as `met
bed run` drives it: how late exchanges began, how long they took, and exchanges that began a period late, by cause. A
run that is stopped, for the host was five periods behind, is begun anew until the minute is full, and counted. None of
it is hard real time: it says how this machine did under the load that it had.
"""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import cache, partial
from pathlib import Path

import numpy as np

import ic
from benchmarks.benchmark import Benchmark, Target, Untaken
from hw import records
from hw.case import Asked, pace_of
from hw.driven import LANES, Driven
from hw.timing import Timing, timing
from met import plan_file
from met.plan import Experiment, Plan
from met.run import prepare

TITLE = "a Panda at 1 kHz with its shoulder's motor on a bed, us and counts; no hard real time"

SECONDS, STARTS = 60.0, 30
"""Of the loop's figures; and how often it is begun at most."""

DECK = """#include <panda.ic>
run one like reach {{
    duration = {seconds:g} s;  record = [];
    remove settle;  remove past;  remove sag;  remove effort;  remove volts;
    substitute joint2 {{ bed = emulated(delay = 1, faults = typical);  law = velocity_tracking; }}
}}
"""


def experiment(seconds: float) -> Experiment:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bed.ic"
        path.write_text(DECK.format(seconds=seconds), encoding="utf-8")
        return ic.compile(path, select=["one"]).experiments[0]


def _step(share: float) -> Callable[[], float]:
    """us of a step, of which this share of all takes no longer; the clock's, so with whatever comes between."""
    made = experiment(5.0)
    prepared = prepare(made, wire=True, late=1, lanes=LANES)
    clock = time.perf_counter_ns

    def measure() -> float:
        driven = Driven(prepared, 0)
        rates, told = [0.0], [[0.0, 0.0]]
        driven(0, rates, told)
        times = np.zeros(driven.last, dtype=np.int64)
        gc.disable()
        for e in range(1, driven.last + 1):
            begun = clock()
            driven(e, rates, told)
            times[e - 1] = clock() - begun
        gc.enable()
        return float(np.quantile(times, share)) * 1e-3

    return measure


@cache
def _kept() -> tuple[Timing, int]:
    """What the loop made of a minute, and how often it was stopped."""
    made = experiment(SECONDS)
    plan = plan_file.dumps(Plan("", (made,)))
    wanted, found, hz = round(SECONDS * pace_of(made).hz), [], 0.0
    for start in range(STARTS):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "one.records"
            asked = Asked(plan=plan, row=0, ports={"joint2": "firmware"}, records=str(path))
            command = [sys.executable, "-m", "hw.case"]
            done = subprocess.run(command, input=json.dumps(asdict(asked)), capture_output=True, text=True)
            last = json.loads(done.stdout.splitlines()[-1]) if done.stdout else {}
            if "ended" not in last:
                why = last.get("wrong", {}).get("diagnostics", [{"message": done.stderr[-200:]}])[0]["message"]
                raise Untaken(why)
            rows = records.read(path)
        hz = rows.head["tick_hz"]
        found.append(rows.rows[rows.rows["exchange"] > 0][: wanted - sum(map(len, found))])
        if sum(map(len, found)) >= wanted:
            return timing(np.concatenate(found), hz), start
    raise Untaken(f"it was stopped {STARTS} times, each time after {sum(map(len, found)) / STARTS / hz:.3g} s or so")


def _loop(figure: Callable[[Timing, int], float]) -> Callable[[], float]:
    kept = _kept()
    return lambda: figure(*kept)


def _one(name: str, doc: str, unit: str, figure: Callable[[Timing, int], float]) -> Benchmark:
    return Benchmark(f"bed.{name}", doc, unit, partial(_loop, figure), turns=1, slow=True)


_MISS = "exchanges in a minute that began a period late"

BENCHMARKS: tuple[Benchmark, ...] = (
    Benchmark("bed.step.p50", "a step of the arm, from a sample to the next command", "us", partial(_step, 0.5),
              Target(5.0)),
    Benchmark("bed.step.p99", "the 99th percentile of 5000 steps", "us", partial(_step, 0.99), Target(60.0)),
    _one("computing.p50", "the same in the loop", "us", lambda kept, _: 1e6 * kept.computing.median),
    _one("computing.p99", "its 99th percentile", "us", lambda kept, _: 1e6 * kept.computing.high),
    _one("exchange.p50", "a command over the pseudo-terminal, until its answer", "us",
         lambda kept, _: 1e6 * kept.trip.median),
    _one("exchange.p99", "its 99th percentile", "us", lambda kept, _: 1e6 * kept.trip.high),
    _one("late.p50", "from when an exchange was due to when it began", "us",
         lambda kept, _: 1e6 * kept.lateness.median),
    _one("late.p99", "its 99th percentile", "us", lambda kept, _: 1e6 * kept.lateness.high),
    _one("late.largest", "the largest", "us", lambda kept, _: 1e6 * kept.lateness.largest),
    _one("missed.woken", f"{_MISS}: woken too late", "", lambda kept, _: kept.woken),
    _one("missed.computed", f"{_MISS}: it computed too long", "", lambda kept, _: kept.computed),
    _one("missed.waited", f"{_MISS}: it waited for the answer before", "", lambda kept, _: kept.waited),
    _one("unanswered", "exchanges in a minute without an answer in time", "", lambda kept, _: kept.unanswered),
    _one("stopped", "times that five periods were missed, and the run stopped", "", lambda _, stops: stops),
)  # fmt: skip
