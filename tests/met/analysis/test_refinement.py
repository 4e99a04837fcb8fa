"""A refined experiment has shorter steps: it converges, and what ticks does so at the same instants."""

from __future__ import annotations

import numpy as np
import pytest

import ic
from met import run as engine
from met.analysis.step_error import refine
from met.plan import Experiment
from tests.oracles.random_deck import random_deck


def experiment(text: str) -> Experiment:
    return ic.compile(text=text).experiments[0]


def signals(of: Experiment) -> dict[str, np.ndarray]:
    return engine.run(of).signals


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 11, 12])
def test_the_error_falls_with_the_square_of_the_step(seed: int) -> None:
    of = experiment(random_deck(seed, friction=False))
    q = {factor: signals(refine(of, factor))["q"] for factor in (4, 8, 16)}
    coarse, fine = (np.abs(q[factor] - q[2 * factor]).max() for factor in (4, 8))
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)


def test_one_step_for_one_is_the_experiment_itself() -> None:
    of = experiment(random_deck(5))
    assert refine(of, 1) == of
    with pytest.raises(ValueError, match="a step cannot be parted in 0"):
        refine(of, 0)


NOISY = """#include <two_link.ic>
servo seen like gearbox { sensor qd = tachometer { noise = 0.01 rad/s; } }
run noisy like nominal {
    servos { shoulder = seen; elbow = seen; }
    rates { dynamics = 50 Hz; servos = 100 Hz; record = 50 Hz; }
    record = [qd, shoulder.servo.sensor.qd];
    duration = 2 s;
    remove settle; remove volts;
}
"""


@pytest.mark.slow
def test_noise_is_drawn_at_the_same_instants() -> None:
    [of] = ic.compile(text=NOISY, select=["noisy"]).experiments

    def noise(factor: int) -> np.ndarray:
        seen = signals(refine(of, factor))
        return seen["shoulder.servo.sensor.qd"][0] - seen["qd"][0, :, 0]

    assert noise(1).std() == pytest.approx(0.01, rel=0.2)
    for factor in (2, 4):
        np.testing.assert_allclose(noise(factor), noise(1), rtol=0.0, atol=1e-12)


def test_factors_that_do_not_divide_the_step_make_the_base_rate_faster() -> None:
    of = experiment(random_deck(7))
    schedule = of.structure.schedule
    for factor in (2, 3, 4, 6):
        refined = refine(of, factor).structure
        assert refined.schedule.step == pytest.approx(schedule.step / factor, rel=1e-15)
        assert refined.schedule.duration == pytest.approx(schedule.duration, rel=1e-15)
        assert refined.schedule.rows == schedule.rows
        for before, now in zip(of.structure.servos, refined.servos, strict=True):
            assert now.divisor / refined.schedule.base_hz == pytest.approx(before.divisor / schedule.base_hz, rel=1e-15)
