"""What a bed's noise and bits depend on: the case, and nothing that it runs with.

Both joints of two_link.ic on beds with all faults, reversing, in a sweep of which no two cases are alike.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from met import run as engine
from met.backends.llvm import kernel
from met.backends.reference.plain import execute
from met.plan import Cases, Experiment
from met.program import build
from met.trace.program import Recording
from met.trace.recorder import record
from tests.substitution.hybrid import compiled, deck

slow = pytest.mark.slow
CASES = 21
TURNING = "table(times = [0, 0.1995, 0.2, 0.5] s, values = [slow, slow, -slow, -slow])"
VARIED = """
    zip {
        shoulder.law.gain      = linspace(0.1, 0.5, 21);
        shoulder.bed.kt        = linspace(0.055, 0.067, 21) N*m/A;
        shoulder.bed.delay     = [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0];
        elbow.bed.f_c          = linspace(0, 0.04, 21) N*m;
        links.upper.mass       = linspace(10, 400, 21) kg;
    }
"""
SIGNALS = "record += [shoulder.bed.filtered, shoulder.law.unknown_torque];  seed = 7;"


def made(bed: str = "emulated(faults = typical)", duration: float = 0.5) -> Experiment:
    return compiled(
        deck(("shoulder", "elbow"), command=TURNING, duration=duration, bed=bed, swept=VARIED, hybrid=SIGNALS), "bench"
    )


@pytest.fixture(scope="module")
def recorded() -> tuple[Experiment, Recording, np.ndarray]:
    """The experiment, its recording, and the rows of its cases by 8 lanes in one thread."""
    experiment = made()
    recording = record(build(experiment))
    rows = ran(experiment, kernel.from_recording(recording, 8), threads=1)
    assert np.isfinite(rows).all() and len({row.tobytes() for row in rows}) == CASES
    return experiment, recording, rows


def ran(experiment: Experiment, of: kernel.LlvmKernel, cases: np.ndarray | None = None, **options: int) -> np.ndarray:
    inputs = engine.inputs(experiment, np.arange(CASES) if cases is None else cases)
    rows, _ = of.run(inputs, experiment.structure.schedule.ticks, **options)
    assert rows is not None
    return rows


@pytest.mark.release
@pytest.mark.parametrize("lanes", [4, pytest.param(2, marks=slow), pytest.param(16, marks=slow)])
def test_bits_of_hybrid_cases_do_not_depend_on_lanes(
    recorded: tuple[Experiment, Recording, np.ndarray], lanes: int
) -> None:
    experiment, recording, rows = recorded
    assert ran(experiment, kernel.from_recording(recording, lanes)).tobytes() == rows.tobytes()


@pytest.mark.slow
def test_bits_of_hybrid_cases_do_not_depend_on_threads_order_or_company_and_come_again(
    recorded: tuple[Experiment, Recording, np.ndarray],
) -> None:
    experiment, recording, rows = recorded
    again = kernel.from_recording(recording, 8)
    assert ran(experiment, again, threads=2).tobytes() == rows.tobytes()
    order = np.random.default_rng(1).permutation(CASES)
    assert ran(experiment, again, order).tobytes() == rows[order].tobytes()
    for case in (0, 7, 20):
        assert ran(experiment, again, np.array([case])).tobytes() == rows[[case]].tobytes()


@pytest.mark.slow
def test_a_bed_without_numbers_ends_its_case_only(recorded: tuple[Experiment, Recording, np.ndarray]) -> None:
    experiment, recording, rows = recorded
    of = kernel.from_recording(recording, 8)
    columns = [each.name for each in experiment.structure.record]
    for path in ("shoulder.bed.kt", "elbow.bed.f_c", "shoulder.law.gain"):
        coordinates = tuple(
            replace(each, values=np.where(np.arange(CASES) == 9, np.nan, each.values)) if each.path == path else each
            for each in experiment.cases.coordinates
        )
        assert sum(int(np.isnan(each.values).sum()) for each in coordinates) == 1
        broken = replace(experiment, cases=Cases(CASES, coordinates, experiment.cases.seed))
        others = np.arange(CASES) != 9
        assert ran(broken, of)[others].tobytes() == rows[others].tobytes(), path
        run = engine.run(broken, lanes=8)
        assert run.status.tolist() == [int(case == 9) for case in range(CASES)], path
        assert "no longer a finite number" in run.cause[9], run.cause[9]
        print(f"{path}: {run.cause[9][:60]} ... after {run.n_valid[9]} rows of {columns}")


@pytest.mark.release
@pytest.mark.parametrize(("cases", "duration"), [([8], 0.05), ([1, 19], 0.25)])
def test_the_kernel_computes_what_the_plain_run_does(cases: list[int], duration: float) -> None:
    """All faults but converters, which would take the last bit of a sum for a whole step.

    1e-9 of the largest: the plain run takes sines from the platform and fuses nothing; what differs dies away.
    """
    bed = "emulated(faults = typical, converter_in = 0 rad/s, converter_voltage = 0 V, converter_current = 0 A)"
    experiment = made(bed, duration)
    program = build(experiment)
    rows = ran(experiment, kernel.compile(program), np.array(cases))
    for row, values in zip(rows, engine.inputs(experiment, np.array(cases)), strict=True):
        plain, _ = execute(program, values, experiment.structure.schedule.ticks)
        share = (np.abs(row - plain).max(axis=0) / np.abs(plain).max(axis=0)).max()
        print(f"kernel against plain run: {share:.2g}")
        assert share < 1e-9


def still(seed: int, gain: str) -> engine.Run:
    """Both joints told to stay where they are: the shafts stand still, and what the filter shows is noise alone."""
    text = deck(
        ("shoulder", "elbow"),
        command="0 rad/s",
        duration=0.2,
        bed="emulated(faults = typical)",
        swept=f"vary told.kp = {gain} V*s/rad;  vary shoulder.law.gain = [0.1, 0.3];",
        hybrid=f"record += [bed.filtered];  seed = {seed};",
    )
    return engine.run(compiled(text, "bench"))


@pytest.mark.release
def test_noise_is_the_same_whatever_the_gain_and_another_for_each_joint_and_seed() -> None:
    """A noise of 0.1 rad/s behind the filter: 50 Hz of the 500 Hz that there are leave about a third of it."""
    run = still(7, "[0.01, 0.02]")
    assert not run.signals["shoulder.bed.shaft_rate"].any() and not run.signals["elbow.bed.shaft_rate"].any()
    noise = run.signals["bed.filtered"]
    assert noise.shape[0] == 4 and all(case.tobytes() == noise[0].tobytes() for case in noise)
    assert 0.02 < noise[0].std() < 0.06
    assert abs(np.corrcoef(noise[0].T)[0, 1]) < 0.5, "joints apart"
    assert still(7, "[0.015, 0.02]").signals["bed.filtered"].tobytes() == noise.tobytes()
    assert np.abs(still(8, "[0.01, 0.02]").signals["bed.filtered"] - noise).max() > 0.02
