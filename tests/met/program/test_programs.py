"""Programs of whole decks: kernel and plain floats agree, rates and instants, friction that a sweep takes away."""

from __future__ import annotations

import numpy as np
import pytest

import ic
from met import run as engine
from met.backends.reference.plain import execute
from met.plan import Experiment
from met.program import build
from met.program.build import METRIC
from tests.oracles.random_deck import random_deck


def compiled(text: str, select: str | None = None) -> Experiment:
    plan = ic.compile(text=text, select=[select] if select else None)
    return plan.experiments[0]


@pytest.mark.release
@pytest.mark.parametrize("seed", range(24))
def test_kernel_and_plain_floats_agree_on_random_decks(seed: int) -> None:
    experiment = compiled(random_deck(seed))
    run = engine.run(experiment)
    assert run.status[0] == engine.DONE, (seed, run.cause)
    rows, out = execute(build(experiment), {}, experiment.structure.schedule.ticks)
    kernel = np.concatenate([run.signals[name][0] for name in ("q", "qd", "qdd", "tau")], axis=1)
    size = np.abs(rows).max(axis=0) + np.abs(rows).max() * 1e-3
    # rounding (1e-16) grows along 400 steps of a driven arm by the factor that neighbouring motions part: up to 1e5
    assert np.abs(kernel - rows).max() / size.max() < 1e-10, seed
    assert (np.abs(kernel - rows).max(axis=0) < 1e-9 * size).all(), seed
    for name in ("peak", "size"):
        assert run.metrics[name][0] == pytest.approx(out[METRIC + name], rel=1e-9, abs=1e-12), seed
    for name, count in run.events.items():
        assert count[0] == out[f"friction.{name}"], (seed, name)


@pytest.mark.slow
def test_a_run_records_both_ends_and_holds_between_ticks() -> None:
    text = """
    #include <two_link.ic>
    run fine like nominal {
        rates { base = 400 Hz; dynamics = 25 Hz; servos = 100 Hz; record = 200 Hz; }
        duration = 1 s;
        record = [q, shoulder.servo.voltage];
    }
    """
    run = engine.run(compiled(text, "fine"))
    assert run.time[0] == 0.0 and run.time[-1] == 1.0 and len(run.time) == 201
    q, voltage = run.signals["q"][0], run.signals["shoulder.servo.voltage"][0]
    assert (q[:8] == q[0]).all() and (q[8] != q[0]).all(), "q moves at the dynamics' ticks: 8 rows apart"
    assert voltage[0] == voltage[1] != voltage[2], "the servo ticks at 100 Hz: every second row"
    moved = [i for i in range(1, 201) if voltage[i] != voltage[i - 1]]
    assert all(i % 2 == 0 for i in moved) and len(moved) >= 99


@pytest.mark.slow
def test_a_failed_case_says_when_and_where_and_the_others_go_on() -> None:
    text = """
    #include <two_link.ic>
    run spun like nominal { environment { velocity_products = on; } duration = 1 s; }
    sweep some of spun { vary initial.elbow.qd = [0, 1e200, 0.1] rad/s; }
    """
    run = engine.run(compiled(text, "some"))
    assert run.status.tolist() == [engine.DONE, engine.FAILED, engine.DONE]
    assert run.cause[1].startswith("t = 0 s: joint shoulder: position, rate or acceleration is no longer a finite ")
    assert "two_link.ic>:" in run.cause[1]
    assert run.n_valid.tolist() == [26, 0, 26]
    assert np.isnan(run.signals["q"][1]).all() and np.isfinite(run.signals["q"][[0, 2]]).all()
    assert np.isnan(run.metrics["settle"][1])


REVERSING = """
#include <two_link.ic>
let f = 0 N*m;
servo swinging like gearbox { f_c = 0 N*m; command = rate(sine(amplitude = 0.2 rad/s, frequency = 0.7 Hz)); }
run swing like nominal {
    servos { shoulder = swinging; elbow = swinging; }
    rates { base = 1200 Hz; dynamics = 400 Hz; servos = 300 Hz; record = 100 Hz; }
    duration = 2 s;
}
"""


@pytest.mark.slow
def test_a_case_whose_friction_a_sweep_puts_to_zero_has_none() -> None:
    plain = engine.run(compiled(REVERSING, "swing"))
    swept = "sweep levels of swing { vary swinging.f_c = [0.0205, 0, 0.01] N*m; }"
    run = engine.run(compiled(REVERSING + swept, "levels"))
    assert run.events["splits"][1] == 0 and run.events["splits"][0] > 0
    for name in ("q", "qd", "tau"):
        size = np.abs(plain.signals[name]).max()
        assert np.abs(run.signals[name][1] - plain.signals[name][0]).max() < 1e-12 * size, "rounding alone"


@pytest.mark.slow
def test_a_servo_that_ticks_between_instants_sees_the_state_carried_forward() -> None:
    coarse = engine.run(compiled(REVERSING, "swing")).signals["qd"][0]
    finer = REVERSING.replace("dynamics = 400", "dynamics = 1200")
    fine = engine.run(compiled(finer, "swing")).signals["qd"][0]
    # 9.4e-4 measured; 3.8e-3 where such a servo saw the state of the instant before
    assert np.abs(coarse - fine).max() < 1.5e-3 * np.abs(fine).max()


@pytest.mark.slow
def test_a_step_at_a_whole_number_of_milliseconds_is_not_a_tick_late() -> None:
    text = """
    #include <two_link.ic>
    servo jumping like gearbox { command = rate(step(to = slow, at = 700 ms)); }
    run jump like nominal {
        servos { shoulder = jumping; elbow = jumping; }  rates { dynamics = 1 kHz; servos = 1 kHz; record = 1 kHz; }
        duration = 0.71 s;  record = [shoulder.servo.command];
    }
    """
    command = engine.run(compiled(text, "jump")).signals["shoulder.servo.command"][0]
    assert np.flatnonzero(command)[0] == 700
