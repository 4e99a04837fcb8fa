"""Whole runs by which WebAssembly is held against the native kernel: under node, and in a browser."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from benchmarks import decks
from benchmarks.arms import GENERAL, SEVEN, THIRTY, TWO, Arm
from benchmarks.ladder import OTHERS, SERVOS

import ic
from met import backends
from met.frozen import frozen
from met.plan import Experiment
from met.program.build import build
from met.run import inputs
from met.trace.program import Recording
from met.trace.recorder import record

PUBLISHED = (
    ("two_link", "gains"),
    ("two_link", "hybrid"),  # a motor on an emulated bed, with its noise
    ("panda", "swing"),
    ("free_flyer", "flyer_felt"),
    ("station_arm", "station_arm_afloat"),
    ("shuttle_arm", "shuttle_arm_payloads"),
    ("manutec_r3", "manutec_r3_driven"),
    ("ets_vii", "ets_vii_afloat"),
    ("shuttle_booms", "shuttle_stop"),
)
"""Decks that come with MET, and a run or sweep of each."""

LONG = PUBLISHED[5:]
"""Those of them that take long."""

REVERSING: tuple[tuple[Arm, str], ...] = (
    (TWO, "lugre"),
    (SEVEN, "lugre"),
    (SEVEN, "plume, 36 cells"),
    (SEVEN, "wrench_table"),
    (SEVEN, "payload grappled, base free"),
    (THIRTY, "lugre"),
    (GENERAL, "rigid_gearbox"),
    (THIRTY, "tachometer with noise"),
    (THIRTY, "base free"),
)
"""Arms of 2, 7 and 30 joints that reverse, and of each what else there is."""

REVERSING_CASES, REVERSING_TICKS, PUBLISHED_CASES = 3, 100, 2


@frozen
class WholeRun:
    """Some cases of an experiment, from tick 0 to the last one: inputs [case, input]."""

    name: str
    recording: Recording
    inputs: np.ndarray
    last: int

    def native(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and outputs of the native kernel."""
        rows, outputs = backends.load(self.recording).run(self.inputs, self.last)
        assert rows is not None and rows.std() > 0.0
        return rows, outputs


def whole_run(name: str, experiment: Experiment, *, cases: int, ticks: int | None = None) -> WholeRun:
    """As many of an experiment's cases, evenly among all; until its end, or this tick."""
    rows = np.linspace(0, experiment.cases.count - 1, min(cases, experiment.cases.count)).astype(np.int64)
    last = experiment.structure.schedule.ticks if ticks is None else ticks
    return WholeRun(name, record(build(experiment)), inputs(experiment, rows), last)


def published(deck: str, run: str) -> WholeRun:
    (found,) = ic.compile(f"{deck}.ic", select=[run]).experiments
    return whole_run(f"{deck} {run}", found, cases=PUBLISHED_CASES)


def reversing(arm: Arm, model: str) -> WholeRun:
    deck = decks.experiment(arm, "reversing", record=True, variant={**SERVOS, **OTHERS}[model])
    return whole_run(f"{arm.name} {model}", deck, cases=REVERSING_CASES, ticks=REVERSING_TICKS)


def every() -> Iterator[WholeRun]:
    """All of them, one after another."""
    for deck, run in PUBLISHED:
        yield published(deck, run)
    for arm, model in REVERSING:
        yield reversing(arm, model)


def differing(one: np.ndarray, other: np.ndarray) -> int:
    """How many numbers have other bits; all, where there are not as many."""
    if one.shape != other.shape:
        return max(one.size, other.size)
    return int((one.view(np.int64) != other.view(np.int64)).sum())
