"""A case's bits are its own: whole experiments whose joints stick and slip give them whatever they are compiled for.

Gearbox servos that tick four times a step, gravity, dry friction on every joint; cases of one block split their steps
at different times, some of them twice in a step, and a fifth of the cases has no friction at all. docs/architecture.md,
"What bits depend on".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import ic
from met import run as engine
from met.backends.llvm import kernel
from met.plan import Experiment
from met.program import build
from met.trace.program import Recording
from met.trace.recorder import record
from tests.instruction_sets import ARM, RUNNABLE, WIDE
from tests.oracles.friction_deck import friction_deck

# No multiple of a block: the last one is part full.
CASES = 45
slow = pytest.mark.slow


@dataclass(frozen=True)
class Swung:
    """An experiment's program, and what its cases are to leave: by 8 lanes, alone in one thread, as this machine is."""

    experiment: Experiment
    recording: Recording
    inputs: np.ndarray
    rows: np.ndarray
    outputs: np.ndarray

    @property
    def ticks(self) -> int:
        return self.experiment.structure.schedule.ticks

    def run(self, made: kernel.LlvmKernel, **options: int) -> tuple[np.ndarray, np.ndarray]:
        rows, outputs = made.run(self.inputs, self.ticks, **options)
        assert rows is not None
        return rows, outputs

    def differences(self, rows: np.ndarray | None, outputs: np.ndarray, cases: object = slice(None)) -> int:
        """Numbers of these cases that differ in any bit."""
        assert rows is not None
        pairs = ((rows, self.rows[cases]), (outputs, self.outputs[cases]))
        words = [[np.ascontiguousarray(x).view(np.uint64) for x in pair] for pair in pairs]
        return sum(int(np.count_nonzero(a != b)) for a, b in words)


@pytest.fixture(scope="module", params=[2, pytest.param(7, marks=slow), pytest.param(30, marks=slow)])
def swung(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Swung:
    deck = tmp_path_factory.mktemp("swung") / "deck.ic"
    deck.write_text(friction_deck(request.param, CASES, limbs=request.param == 30))
    experiment = ic.compile(str(deck), select=["many"]).experiments[0]
    recording = record(build(experiment))
    inputs = engine.inputs(experiment, np.arange(CASES))
    rows, outputs = kernel.from_recording(recording, 8).run(inputs, experiment.structure.schedule.ticks, threads=1)
    assert rows is not None
    return Swung(experiment, recording, inputs, rows, outputs)


@pytest.mark.slow
def test_cases_of_one_block_have_events_of_their_own(swung: Swung) -> None:
    """What the other tests rest on: steps split twice in some lanes while others do without; cases with no events."""
    assert len({row.tobytes() for row in swung.rows}) == CASES, "no two cases are alike"
    assert np.isfinite(swung.rows).all() and not swung.outputs[:, 0].any()
    block = kernel.from_recording(swung.recording, 8).block(swung.inputs[:8])
    splits = np.empty((swung.ticks + 1, 8))
    for tick in range(swung.ticks + 1):
        block.step(tick, tick)
        splits[tick] = block.cells()["friction.splits"]
    per_step = np.diff(splits, axis=0)
    assert swung.ticks // swung.experiment.structure.schedule.dynamics == 400
    assert (per_step.max(axis=1) > per_step.min(axis=1)).sum() >= 10, "steps that only some of the lanes split"
    assert (splits[-1] == 0.0).any() and (splits[-1] > 5.0).any()
    print(
        f"{len(swung.experiment.structure.joints)} joints: splits of the first block's cases {splits[-1].tolist()}, "
        f"at most {per_step.max():g} in a step"
    )
    assert ((per_step.max(axis=1) == 2.0) & (per_step.min(axis=1) == 0.0)).any(), "split twice in some, not in others"


@pytest.mark.release
@pytest.mark.parametrize("lanes", [2, 4, 16, 32])
def test_bits_do_not_depend_on_lanes(swung: Swung, lanes: int) -> None:
    assert swung.differences(*swung.run(kernel.from_recording(swung.recording, lanes))) == 0


@pytest.mark.slow
@pytest.mark.parametrize("cpu", RUNNABLE)
def test_bits_do_not_depend_on_the_instruction_set(swung: Swung, cpu: str) -> None:
    made = kernel.from_recording(swung.recording, 8, cpu)
    assert made.machine.width == (2 if ARM else 8 if cpu == WIDE else 4)
    assert swung.differences(*swung.run(made)) == 0


@pytest.mark.release
@pytest.mark.parametrize("level", [0, 1, 3])
def test_bits_do_not_depend_on_optimisation(swung: Swung, level: int) -> None:
    assert swung.differences(*swung.run(kernel.from_recording(swung.recording, 8, level=level))) == 0


def test_bits_do_not_depend_on_threads_order_batches_or_company(swung: Swung) -> None:
    made = kernel.from_recording(swung.recording, 8)
    assert swung.differences(*swung.run(made, threads=2)) == 0
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(CASES)
        assert swung.differences(*made.run(swung.inputs[order], swung.ticks, threads=1), order) == 0
    for cut in (1, 8, 13, 44):
        for part in (slice(0, cut), slice(cut, CASES)):
            assert swung.differences(*made.run(swung.inputs[part], swung.ticks, threads=2), part) == 0
    for case in (0, 2, 17, 44):
        alone = slice(case, case + 1)
        assert swung.differences(*made.run(swung.inputs[alone], swung.ticks), alone) == 0


def test_bits_do_not_depend_on_stretches_or_recording(swung: Swung, monkeypatch: pytest.MonkeyPatch) -> None:
    made = kernel.from_recording(swung.recording, 8)
    _, outputs = made.run(swung.inputs, swung.ticks, record=False)
    assert swung.differences(swung.rows, outputs) == 0
    for ticks in (7, 100):
        monkeypatch.setattr(kernel, "_CALL", ticks)
        for threads in (1, 2):
            assert swung.differences(*swung.run(made, threads=threads)) == 0


@pytest.mark.slow
def test_results_are_put_together_from_the_same_bits(swung: Swung) -> None:
    reference = engine.run(swung.experiment, threads=1, lanes=8)
    columns = np.concatenate([reference.signals[name] for name in ("q", "qd", "qdd", "tau")], axis=2)
    assert swung.differences(np.ascontiguousarray(columns), swung.outputs) == 0
    without = engine.run(swung.experiment, record=False)
    assert without.signals == {} and without.metrics["top"].tobytes() == reference.metrics["top"].tobytes()
    order = np.random.default_rng(3).permutation(CASES)
    shuffled = engine.run(swung.experiment, order, lanes=8)
    for name in ("metrics", "events", "signals"):
        for key, values in getattr(reference, name).items():
            assert getattr(shuffled, name)[key].tobytes() == np.ascontiguousarray(values[order]).tobytes(), key
