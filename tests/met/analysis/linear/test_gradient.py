"""Gradients of metrics are those of the program that runs: by differences of the kernel, and refused on edges."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.simulation.simulation import Simulation
from ic.driver.given_values import given_run
from met import backends, models
from met import run as engine
from met.analysis.linear import gradient
from met.analysis.linear.gradient import GradientProgram, MetricGradients
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import Experiment
from met.program.build import METRIC
from tests.ic.small_decks import ARM, RUN, SERVO, changed, experiment
from tests.met.program.test_followers import GROUPS
from tests.met.small_models import EVERY, smallest

SWAY = """\
arm swing {
    link bar { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    link tip { mass = 1 kg;  shape = rod(length = 0.5 m, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
    joint wrist revolute { parent = bar;  child = tip;  at = [1, 0, 0] m;  axis = z; }
}
servo drive {
    model = rigid_gearbox;
    ratio = 100;  kp = 0.1 V*s/rad;  ki = 1 V/rad;  v_max = 24 V;  resistance = 1 ohm;  kt = 0.05 N*m/A;
    tau_max = 1 N*m;  j_m = 1e-4 kg*m^2;  f_c = 0.03 N*m;  f_v = 1e-4 N*m*s/rad;
    command = rate(sine(amplitude = 0.5 rad/s, frequency = 1 Hz));
}
run sway {
    arm = swing;
    servos { hinge = drive;  wrist = drive; }
    rates { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }
    duration = 5.1 s;
    record = [];
    metric settle = settling_time { of = hinge.q;  target = 0 rad;  within = 0.1 rad; }
    metric shake = rms { of = wrist.qd; }
    metric top = peak { of = hinge.servo.voltage; }
    metric last = final { of = wrist.q; }
}
"""
NUMBERS = {
    "drive.kp": (0.1, "V*s/rad"),
    "drive.ki": (1.0, "V/rad"),
    "drive.f_c": (0.03, "N*m"),
    "links.bar.mass": (2.0, "kg"),
    "links.tip.mass": (1.0, "kg"),
    "hinge.servo.command.amplitude": (0.5, "rad/s"),
}


def varied(text: str, numbers: Mapping[str, tuple[float, str]]) -> Experiment:
    return given_run("", text=text).vary(numbers).experiment


def by_richardson(program: GradientProgram, number: int, share: float) -> dict[str, float]:
    """Gradients of the first case by differences of the program without tangents, twice, extrapolated."""
    kernel, made = backends.load(program.recording), program.experiment
    given, names = engine.inputs(made, np.array([0])), program.recording.program.outputs

    def difference(step: float) -> np.ndarray:
        sides = np.repeat(given, 2, axis=0)
        sides[:, number] += [step, -step]
        _, found = kernel.run(sides, made.structure.schedule.ticks, record=False)
        with np.errstate(invalid="ignore"):  # of what is infinite
            return (found[0] - found[1]) / (2.0 * step)

    step = share * abs(given[0, number])
    once, again = difference(step), difference(0.5 * step)
    found = (4.0 * again - once) / 3.0
    return {use.name: found[names.index(METRIC + use.name)] for use in made.structure.metrics}


@pytest.mark.slow
def test_they_are_those_of_settling_peak_rms_and_a_window_through_20_sticks() -> None:
    """Both joints stick where they turn around, ten times each: by extrapolated differences to 1e-6."""
    late = "metric late = peak { of = wrist.qd;  after = 2.2 s;  within = 2 s; }\n    metric last"
    program = GradientProgram(varied(changed(SWAY, ("metric last", late)), NUMBERS))
    found = program.of([0])
    assert not found.why_not
    outputs = program.recording.program.outputs
    _, ran = backends.load(program.recording).run(
        engine.inputs(program.experiment, np.array([0])), program.experiment.structure.schedule.ticks, record=False
    )
    assert ran[0, outputs.index("friction.splits")] == 20.0
    for number in range(len(found.paths)):
        expected = by_richardson(program, number, 1e-4)
        for metric, name in enumerate(found.metrics):
            assert found.slope[0, metric, number] == pytest.approx(expected[name], rel=1e-6), (name, number)


@pytest.mark.slow
def test_they_are_those_of_ratios_and_masses_of_joints_that_follow_others() -> None:
    numbers = {"slide.ratio": (0.1, "m/rad"), "slide.offset": (0.3, "m"), "links.rack.mass": (1.0, "kg")}
    # without the wrist's friction: with it, differences jump where the wrist comes to rest in another step
    text = changed(GROUPS.partition("sweep")[0], ("  friction = 0.1 N*m;", ""))
    program = GradientProgram(varied(text, numbers))
    found = program.of([0])
    assert not found.why_not
    for number in range(len(found.paths)):
        expected = by_richardson(program, number, 2e-4)
        for metric, name in enumerate(found.metrics):
            assert found.slope[0, metric, number] == pytest.approx(expected[name], rel=1e-8), (name, number)


COAST = """\
run coast {
    arm = swing;
    initial { hinge.qd = 0.1 rad/s; }
    rates { dynamics = 1 kHz;  record = 100 Hz; }
    duration = 10.5 s;
    record = [];
    metric settle = settling_time { of = hinge.q;  target = 1 rad;  band = 0 %;  within = 0.1 rad; }
}
"""


@pytest.mark.slow
def test_they_are_those_of_a_run_whose_motor_comes_to_its_limit_again_and_again() -> None:
    """The hinge's voltage is cut at each turn, at ticks: by extrapolated differences that move none, to 1e-5."""
    text = changed(SWAY, ("v_max = 24 V", "v_max = 2.5 V"), ("duration = 5.1 s", "duration = 2.1 s"))
    numbers = {path: NUMBERS[path] for path in ("drive.kp", "links.tip.mass")} | {"drive.v_max": (2.5, "V")}
    program = GradientProgram(varied(text, numbers))
    found = program.of([0], ["shake", "last"])
    outputs = program.recording.program.outputs
    _, ran = backends.load(program.recording).run(
        engine.inputs(program.experiment, np.array([0])), program.experiment.structure.schedule.ticks, record=False
    )
    assert ran[0, outputs.index("at_limit:hinge.servo.v_max")] > 100.0
    assert not found.why_not
    for number in range(len(found.paths)):
        expected = by_richardson(program, number, 1e-6)
        for metric, name in enumerate(found.metrics):
            assert found.slope[0, metric, number] == pytest.approx(expected[name], rel=1e-5), (name, number)


@pytest.mark.parametrize("rate", [0.1, 0.0997])
def test_a_settling_time_is_told_between_samples(rate: float) -> None:
    """A bar that coasts at a rate is within 0.1 rad of 1 rad from 0.9 rad over that rate on, as long as it runs."""
    made = varied(ARM + COAST, {"initial.hinge.qd": (rate, "rad/s")})
    found = GradientProgram(made).of([0])
    assert found.value[0, 0] == pytest.approx(0.9 / rate, rel=1e-12)
    assert found.slope[0, 0, 0] == pytest.approx(-0.9 / rate**2, rel=1e-12)
    assert -1e-9 <= engine.run(made).metrics["settle"][0] - found.value[0, 0] <= 1e-3


def refusals(found: MetricGradients) -> dict[tuple[str, str], str]:
    return {(found.metrics[metric], found.paths[number]): words for (_, metric, number), words in found.why_not.items()}


@pytest.mark.slow
def test_a_metric_that_counts_and_a_number_that_only_decides_when_are_refused() -> None:
    text = changed(
        SWAY,
        ("sine(amplitude = 0.5 rad/s, frequency = 1 Hz)", "step(to = 0.5 rad/s, at = 0.2 s)"),
        ("metric last", "metric slow = share_of_time { of = hinge.qd < 0.2 rad/s; }\n    metric last"),
    )
    numbers = {"drive.kp": (0.1, "V*s/rad"), "hinge.servo.command.at": (0.2, "s")}
    found = GradientProgram(varied(text, numbers)).of([0], ["slow", "last", "top"])
    told = refusals(found)
    assert told[("slow", "drive.kp")] == "it moves in steps alone, of a sample or of a count"
    assert told[("top", "hinge.servo.command.at")] == "it moves in steps alone, of a sample or of a count"
    assert ("last", "drive.kp") not in told
    assert np.isnan(found.slope[0, 0, 0]) and np.isfinite(found.slope[0, 1, 0])


@pytest.mark.slow
def test_a_case_on_an_edge_says_so() -> None:
    """The voltage's limit is just what the law asks for at its peak: more of it changes nothing, less does."""
    free = GradientProgram(varied(SWAY, {"drive.v_max": (24.0, "V")})).of([0], ["top", "shake"])
    assert free.slope[0].tolist() == [[0.0], [0.0]] and not free.why_not
    peak = float(free.value[0, 0])
    found = GradientProgram(varied(SWAY, {"drive.v_max": (peak, "V")})).of([0], ["top", "shake"])
    assert refusals(found)[("top", "drive.v_max")].startswith("on an event's edge: within 1e-06 of the number ")
    below = GradientProgram(varied(SWAY, {"drive.v_max": (0.9 * peak, "V")})).of([0], ["top"])
    assert below.slope[0, 0, 0] == pytest.approx(1.0, rel=1e-12) and not below.why_not


@pytest.mark.slow
def test_a_case_that_fails_or_never_settles_has_none() -> None:
    text = changed(SWAY, ("within = 0.1 rad", "within = 0.001 rad"), ("target = 0 rad", "target = 1 rad"))
    found = GradientProgram(varied(text, {"drive.kp": (0.1, "V*s/rad")})).of([0], ["settle", "shake"])
    assert refusals(found) == {("settle", "drive.kp"): "the metric is infinite"}


@pytest.mark.release
@pytest.mark.parametrize(
    ("kind", "name"), [each if each[0] == "metric" else pytest.param(*each, marks=pytest.mark.slow) for each in EVERY]
)
def test_every_model_has_them_or_a_reason(kind: models.Kind, name: str, tmp_path: Path) -> None:
    """Of two joints whose servos tick twice a step: what has no reason agrees with differences of the kernel."""
    made = experiment(tmp_path, smallest(kind, name).put(tmp_path).deck(), select=["cases"])
    if not made.structure.metrics:
        pytest.skip("it has no metric")
    program = GradientProgram(made)
    found = program.of([0])
    for number in range(len(found.paths)):
        expected = by_richardson(program, number, 1e-5)
        for metric, of in enumerate(found.metrics):
            if (0, metric, number) not in found.why_not:
                size = abs(found.value[0, metric] / (engine.inputs(made, np.array([0]))[0, number] or 1.0))
                assert found.slope[0, metric, number] == pytest.approx(expected[of], rel=1e-4, abs=1e-6 * size)


@pytest.mark.slow
def test_they_come_as_a_dataset_of_a_sweep_and_of_a_simulation(tmp_path: Path) -> None:
    path = tmp_path / "sway.ic"
    sweep = "sweep gains of sway { vary drive.kp = [0.1, 0.12] V*s/rad;  vary drive.ki = [1, 2] V/rad; }\n"
    path.write_text(SWAY + sweep)
    of_sweep = batch.gradient(path, "gains", cases=["#2", "#3"], metrics=["shake"])
    assert of_sweep.slope.dims == ("case", "metric", "number") and of_sweep.case.values.tolist() == [2, 3]
    assert of_sweep.number.values.tolist() == ["drive.kp", "drive.ki"]
    assert of_sweep.number_unit.values.tolist() == ["V*s/rad", "V/rad"] and of_sweep.unit.values.tolist() == ["rad/s"]
    simulation = Simulation(path, run="sway")
    made = simulation.gradient({"drive.kp": 0.12, "drive.ki": [1.0, 2.0]}, metrics="shake")
    np.testing.assert_allclose(made.slope, of_sweep.slope, rtol=1e-12)
    np.testing.assert_array_equal(made.value, of_sweep.value)
    assert (made.why_not == "").all()


@pytest.mark.slow
def test_many_cases_are_run_some_at_a_time(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    sweep = (
        "sweep gains of sway { vary drive.kp = [0.1, 0.12, 0.14] V*s/rad;  vary hinge.servo.v_max = [3.9, 24] V; }\n"
    )
    made = experiment(tmp_path, SWAY.replace("duration = 5.1 s", "duration = 0.6 s"), sweep, select=["gains"])
    program = GradientProgram(made)
    whole = program.of(range(6))
    monkeypatch.setattr(gradient, "MOST_LANES", 20)  # two cases
    parts = program.of(range(6))
    np.testing.assert_array_equal(parts.slope, whole.slope)
    np.testing.assert_array_equal(parts.value, whole.value)
    assert parts.why_not == whole.why_not and parts.why_not
    assert program.of([]).slope.shape == (0, 4, 2)


def refused(of: Callable[[], object]) -> str:
    with pytest.raises(Problem) as problem:
        of()
    return render(problem.value.diagnostics, problem.value.sources, colour=False)


def test_a_metric_that_is_not_there_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sway.ic"
    path.write_text(SWAY)
    said = refused(lambda: Simulation(path).gradient({"drive.kp": 0.1}, metrics="shale"))
    assert said.startswith("error[D379]: `sway` has no metric `shale`\n")
    assert "help: did you mean `shake`?\n" in said
    said = refused(lambda: batch.gradient(path))
    assert said.startswith("error[D379]: no number of `sway` varies, so there is nothing to take a gradient by\n")
    assert "help: ask about a sweep: its numbers are those\n" in said
    asks = "linear loop { open = hinge.servo.voltage; } require phase_margin(loop) > 1 deg;"
    made = experiment(tmp_path, ARM, SERVO, RUN.replace("duration", f"{asks} duration", 1))
    said = refused(lambda: GradientProgram(made).of([0], ["loop_phase_margin"]))
    assert said.startswith("error[D379]: `loop_phase_margin` is a metric of a linear answer, which has no gradient\n")
    made = experiment(tmp_path, ARM, SERVO, RUN)
    said = refused(lambda: GradientProgram(made).of([0]))
    assert said.startswith("error[D379]: `hold` has no metric, of which there could be a gradient\n")
    assert "help: a `metric` entry of the run names one\n" in said
