"""A case that comes to something that is no number ends, says why, and leaves its neighbours every bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import ic
from met import run as engine
from met.plan import Cases, Experiment

# Two blocks of 16 lanes, the second part full.
LANES, CASES = 16, 21

DECK = """
servo swinging {
    model = rigid_gearbox;
    ratio = 120;  kp = 0.1 V*s/rad;  ki = 0.5 V/rad;  v_max = 20 V;  resistance = 2 ohm;  kt = 0.06 N*m/A;
    tau_max = 0.3 N*m;  j_m = 5e-4 kg*m^2;  f_c = 0.02 N*m;  f_v = 1e-5 N*m*s/rad;
    command = rate(sine(amplitude = 0.5 rad/s, frequency = 2 Hz));
}
arm three {
    link upper { mass = 1 kg; shape = rod(length = 0.4 m, along = x); }
    link lower { mass = 1 kg; shape = rod(length = 0.4 m, along = x); }
    link tip   { mass = 1 kg; shape = rod(length = 0.2 m, along = x); }
    joint shoulder revolute { parent = base;  child = upper; axis = y; }
    joint elbow    revolute { parent = upper; child = lower; axis = y; at = [0.4, 0, 0] m; }
    joint wrist    revolute { parent = lower; child = tip;   axis = z; at = [0.4, 0, 0] m; }
}
run swung {
    arm = three;  servos { shoulder = swinging; elbow = swinging; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates { base = 1 kHz; dynamics = 250 Hz; servos = 1 kHz; record = 250 Hz; }
    duration = 0.6 s;
    record = [q, qd, qdd, tau, shoulder.servo.voltage];
    metric top = max { of = elbow.qd; }
    require top < 100 rad/s;
}
sweep many of swung {
    zip {
        swinging.f_c = linspace(0, 0.04, 21) N*m;
        swinging.f_v = linspace(1e-5, 2e-5, 21) N*m*s/rad;
        swinging.kp = linspace(0.05, 0.15, 21) V*s/rad;
        swinging.resistance = linspace(1.9, 2.1, 21) ohm;
        swinging.command.amplitude = linspace(-0.5, 1, 21) rad/s;
        initial.elbow.q = linspace(-1, 1, 21) rad;
        initial.wrist.qd = linspace(-1, 1, 21) rad/s;
        links.tip.mass = linspace(0.5, 1.5, 21) kg;
    }
}
"""

NO_NUMBER = (
    "position, rate or acceleration is no longer a finite number ({file}:{line}). Usual reasons: a step too long for "
    "the servo or the arm (see the step size of `met plan`; try a faster rate for the dynamics), or a model "
    "that divides by zero."
)
NO_INERTIA = (
    "D is not above 0 kg m^2, so qdd is undefined. Nothing outboard has inertia about this joint ({file}:{line}). Give "
    "the link mass or the servo a rotor inertia."
)

Swept = tuple[engine.Prepared, tuple[np.ndarray, np.ndarray]]


@pytest.fixture(scope="module")
def swept() -> Swept:
    """The sweep and what its cases leave where all is well: rows and outputs."""
    prepared = engine.prepare(ic.compile(text=DECK, select=["many"]).experiments[0], lanes=LANES)
    run = engine.run(prepared, threads=1)
    assert not run.status.any() and len(run.case) == CASES
    assert (run.events["splits"] > 0).sum() >= 15, "while a case is bad its neighbours are to have friction's events"
    return prepared, ran(prepared, prepared.experiment)


def ran(prepared: engine.Prepared, experiment: Experiment) -> tuple[np.ndarray, np.ndarray]:
    """Rows and outputs of the prepared kernel for an experiment's cases."""
    inputs = engine.inputs(experiment, np.arange(CASES))
    rows, outputs = prepared.kernel.run(inputs, experiment.structure.schedule.ticks, threads=1)
    return rows, outputs


def changed(experiment: Experiment, case: int, path: str, value: float) -> Experiment:
    """The experiment with another value of one case, past all checks of decks and plans."""
    coordinates = []
    for coordinate in experiment.cases.coordinates:
        values = np.array(coordinate.values)
        if coordinate.path == path:
            values[case] = value
        coordinates.append(replace(coordinate, values=values))
    assert any(coordinate.path == path for coordinate in coordinates)
    return replace(experiment, cases=Cases(experiment.cases.count, tuple(coordinates), experiment.cases.seed))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "value", "joint", "why", "line"),
    [
        # an input that is no number, wherever it is read first
        ("swinging.f_c", np.nan, "shoulder", NO_NUMBER, 12),
        ("swinging.kp", np.nan, "shoulder", NO_NUMBER, 12),
        ("swinging.command.amplitude", np.nan, "shoulder", NO_NUMBER, 12),
        ("initial.elbow.q", np.nan, "shoulder", NO_NUMBER, 12),
        ("initial.wrist.qd", np.nan, "shoulder", NO_NUMBER, 12),
        ("links.tip.mass", np.nan, "shoulder", NO_NUMBER, 12),
        ("links.tip.mass", np.inf, "shoulder", NO_NUMBER, 12),
        # squares of rates that overflow at once, and rates that grow from step to step until they do
        ("initial.wrist.qd", 1e200, "shoulder", NO_NUMBER, 12),
        ("swinging.f_v", 1e3, "shoulder", NO_NUMBER, 12),
        # 0/0 in the motor, 1/0 in the recursion
        ("swinging.resistance", 0.0, "shoulder", NO_NUMBER, 12),
        ("links.tip.mass", 0.0, "wrist", NO_INERTIA, 14),
    ],
)
def test_a_case_without_numbers_ends_with_its_cause_in_whatever_lane_and_no_neighbour_changes(
    swept: Swept, path: str, value: float, joint: str, why: str, line: int
) -> None:
    prepared, clean = swept
    place = prepared.experiment.structure.moving[0].place
    assert place is not None
    one = engine.run(replace(prepared, experiment=changed(prepared.experiment, 7, path, value)), threads=1)
    time, _, said = one.cause[7].partition(" s: ")
    assert said == f"joint {joint}: {why.format(file=place.file, line=line)}"
    assert one.status.tolist() == [int(other == 7) for other in range(CASES)] and one.cause.count("") == CASES - 1
    # Rates that grow need their time: the case ends at the first row that it has no numbers for, and not before.
    last = one.n_valid[7]
    assert float(time.removeprefix("t = ")) == pytest.approx(last / 250.0) and (last > 3) == (value == 1e3)
    for values in one.signals.values():
        assert np.isfinite(values[7, :last]).all() and np.isnan(values[7, last:]).all()
    assert np.isnan(one.metrics["top"][7]) and not one.met["top < 100 rad/s"][7]

    for case in range(CASES):
        rows, outputs = ran(prepared, changed(prepared.experiment, case, path, value))
        others = np.arange(CASES) != case
        assert outputs[case, 0] != 0.0, case
        assert rows[others].tobytes() == clean[0][others].tobytes(), case
        assert outputs[others].tobytes() == clean[1][others].tobytes(), case


STILL = """
arm planar {
    link upper { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    joint shoulder revolute { parent = base; child = upper; axis = z; }
}
run drifting { arm = planar;  rates { dynamics = 100 Hz; record = 100 Hz; }  duration = 0.1 s;  record = [q, qd]; }
sweep starts of drifting { zip { initial.shoulder.q = [0, 1, 2] rad; initial.shoulder.qd = [0, 1, 2] rad/s; } }
"""


@pytest.mark.parametrize("path", ["initial.shoulder.q", "initial.shoulder.qd"])
def test_a_state_that_no_acceleration_depends_on_hides_nothing(path: str) -> None:
    experiment = ic.compile(text=STILL, select=["starts"]).experiments[0]
    run = engine.run(changed(experiment, 1, path, np.nan))
    assert run.status.tolist() == [0, 1, 0] and run.n_valid.tolist() == [11, 0, 11]
    assert np.isnan(run.signals["qd"][1]).all() and np.isfinite(run.signals["q"][[0, 2]]).all()


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_constants_that_overflow_say_nothing_while_a_program_is_made() -> None:
    """They are folded as a kernel would compute them: infinity, and no warning of numpy's beside what MET prints."""
    made = engine.run(
        engine.prepare(
            ic.compile(
                text=DECK.replace(
                    "sine(amplitude = 0.5 rad/s, frequency = 2 Hz)",
                    "trapezoid(to = 1e200 rad/s, max_rate = 1e-200 rad/s^2, max_acceleration = 1e-300 rad/s^3)",
                ),
                select=["swung"],
            ).experiments[0]
        )
    )
    assert made.status.tolist() == [0]
