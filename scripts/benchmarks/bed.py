"""A motor in the loop at 1 kHz: the Panda simulated in real time, its shoulder's motor on a bed, which is the bed's
firmware with a time of its own, behind a pseudo-terminal, as a serial line is, and then on a socket, as `--port
firmware` is.

The step is what is computed between a sample and the next command, in this process. The rest is of one minute as `met
bed run` drives it: how late exchanges began, how long they took, and exchanges that began a period late, by cause. A
run that is stopped, for the host was five periods behind, is begun anew until the minute is full, and counted. None of
it is hard real time: it says how this machine did under the load that it had.
"""

from __future__ import annotations

import gc
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path

import numpy as np

import ic
from benchmarks.benchmark import Benchmark, Target, Untaken
from hw import realtime
from hw.beds.simulated import config_of
from hw.boards.build import build
from hw.driving.case import CaseRequest, pace_of
from hw.driving.driven import LANES, CaseKernel
from hw.driving.process import talk
from hw.driving.timing import Timing, timing
from hw.recording import records
from met.plan import Experiment, Plan
from met.plan import file as plan_file
from met.plant import Plant, bed_values, plant_c
from met.run import prepare

TITLE = "a Panda at 1 kHz with its shoulder's motor on a bed, us and counts; no hard real time"

SECONDS, STARTS = 60.0, 30
"""Duration of the loop's measurement, s, and the largest number of starts."""

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
    """The percentile of a step's time, us, for this share of all steps; wall-clock time, so including interruptions."""
    variant_ = experiment(5.0)
    prepared = prepare(variant_, wire=True, late=1, lanes=LANES)
    clock = time.perf_counter_ns

    def measure() -> float:
        driven = CaseKernel(prepared, 0)
        rates, commands = [0.0], [[0.0, 0.0]]
        driven(0, rates, commands)
        times = np.zeros(driven.last, dtype=np.int64)
        gc.disable()
        for e in range(1, driven.last + 1):
            begun = clock()
            driven(e, rates, commands)
            times[e - 1] = clock() - begun
        gc.enable()
        return float(np.quantile(times, share)) * 1e-3

    return measure


def _plant() -> Callable[[], float]:
    """us of a tick of the model of motor and shaft that an emulated bed computes, the call from Python included."""
    plant = Plant(experiment(5.0), "joint2", period=0.001)
    clock = time.perf_counter_ns

    def measure() -> float:
        plant.start(0.0)
        times = np.zeros(20_000, dtype=np.int64)
        for tick in range(len(times)):
            begun = clock()
            plant.tick(5.0, 0.3)
            times[tick] = clock() - begun
        return float(np.median(times)) * 1e-3

    return measure


@contextmanager
def _port_at(line: str, experiment_: Experiment) -> Iterator[str]:
    """The port of a bed with a time of its own, at the other end of a line of this kind."""
    if line == "socket":
        yield "firmware"
        return
    period = pace_of(experiment_).period
    program = build("host", config_of(bed_values(experiment_, "joint2", 0), period, lock_step=False),
                    plant_c(experiment_, "joint2", period=period))  # fmt: skip
    with subprocess.Popen([program], stdout=subprocess.PIPE, text=True) as process:
        realtime.put_first(process.pid)
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


@cache
def _timing_and_stops(line: str) -> tuple[Timing, int]:
    """The results of a minute of the loop, and the number of times it was stopped."""
    experiment_ = experiment(SECONDS)
    plan = plan_file.dumps(Plan("", (experiment_,)))
    wanted, records_of_runs, hz = round(SECONDS * pace_of(experiment_).hz), [], 0.0
    for start in range(STARTS):
        with tempfile.TemporaryDirectory() as folder, _port_at(line, experiment_) as port:
            path = Path(folder) / "one.records"
            messages = list[str]()
            for _ in talk(
                "hw.driving.case",
                CaseRequest(plan=plan, row=0, ports={"joint2": port}, records=str(path)),
                messages.append,
            ):
                pass
            rows = records.read(path)
        hz = rows.head["tick_hz"]
        records_of_runs.append(rows.rows[rows.rows["exchange"] > 0][: wanted - sum(map(len, records_of_runs))])
        if sum(map(len, records_of_runs)) >= wanted:
            return timing(np.concatenate(records_of_runs), hz), start
    raise Untaken(
        f"it was stopped {STARTS} times, each time after {sum(map(len, records_of_runs)) / STARTS / hz:.3g} s or so"
    )


def _loop(line: str) -> tuple[Benchmark, ...]:
    """The loop's figures for a minute over a line."""

    def loop_figure(name: str, doc: str, unit: str, figure: Callable[[Timing, int], float]) -> Benchmark:
        def take() -> Callable[[], float]:
            timing_and_stops = _timing_and_stops(line)
            return lambda: figure(*timing_and_stops)

        return Benchmark(f"bed.{line}.{name}", doc, unit, take, turns=1, slow=True)

    miss = "exchanges in a minute that began a period late"
    return (
        loop_figure("computing.p50", "the same in the loop", "us", lambda times, _: 1e6 * times.computing.median),
        loop_figure("computing.p99", "its 99th percentile", "us", lambda times, _: 1e6 * times.computing.high),
        loop_figure("exchange.p50", f"a command over the {line}, until its answer", "us",
            lambda times, _: 1e6 * times.trip.median),
        loop_figure("exchange.p99", "its 99th percentile", "us", lambda times, _: 1e6 * times.trip.high),
        loop_figure("late.p50", "from when an exchange was due to when it began", "us",
            lambda times, _: 1e6 * times.lateness.median),
        loop_figure("late.p99", "its 99th percentile", "us", lambda times, _: 1e6 * times.lateness.high),
        loop_figure("late.largest", "the largest", "us", lambda times, _: 1e6 * times.lateness.largest),
        loop_figure("missed.woken", f"{miss}: woken too late", "", lambda times, _: times.woken),
        loop_figure("missed.computed", f"{miss}: it computed too long", "", lambda times, _: times.computed),
        loop_figure("missed.waited", f"{miss}: it waited for the answer before", "", lambda times, _: times.waited),
        loop_figure("unanswered", "exchanges in a minute without an answer in time", "",
            lambda times, _: times.unanswered),
        loop_figure("stopped", "times that five periods were missed, and the run stopped", "", lambda _, stops: stops),
    )  # fmt: skip


BENCHMARKS: tuple[Benchmark, ...] = (
    Benchmark("bed.step.p50", "a step of the arm, from a sample to the next command", "us", partial(_step, 0.5),
              Target(5.0)),
    Benchmark("bed.step.p99", "the 99th percentile of 5000 steps", "us", partial(_step, 0.99), Target(60.0)),
    Benchmark("bed.plant", "a tick of the motor's model on an emulated bed, called from Python", "us", _plant,
              Target(3.0)),
    *_loop("terminal"),
    *_loop("socket"),
)  # fmt: skip
