"""Motion that runs away numerically: the case fails, or is done and doubtful, with time and joint; no bit moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.program import plausible
from tests.ic.small_decks import experiment

DAMPED = """\
arm rail {{
    link cart {{ mass = 1 kg; shape = box(size = [0.1, 0.1, 0.1] m); }}
    joint slide prismatic {{ parent = base; child = cart; axis = x; }}
}}
run it {{
    arm = rail;  initial {{ slide.qd = 1 m/s; }}
    environment {{ drag = joint_damping {{ sliding = {damping}; }} }}
    rates {{ dynamics = 100 Hz; record = 100 Hz; }}  duration = {steps}0 ms;
    record = [qd];  metric late = final {{ of = slide.qd; }}
}}
"""
"""A cart that damping stops: with a step h its rate is multiplied by 1 - z + z^2/2 each step of modified
Euler, z = h c/m, which grows beyond 1 where z is above 2."""


def cart(steps: int, z: float) -> str:
    return DAMPED.format(damping=f"{100 * z!r} N*s/m", steps=steps)


GROWING = 2.2


def steps_to(times: float) -> float:
    """Steps after which the rate of the cart that grows is so many times its first."""
    return float(np.log(times) / np.log(1.0 - GROWING + 0.5 * GROWING**2))


def test_a_case_that_runs_away_fails_at_the_time_when_it_passes_what_any_arm_has(tmp_path: Path) -> None:
    found = engine.run(experiment(tmp_path, cart(320, GROWING)))
    assert found.status.tolist() == [engine.FAILED] and np.isnan(found.metrics["late"][0])
    first = steps_to(1e9)
    tick = int(np.ceil(first / 32)) * 32
    assert found.n_valid.tolist() == [tick]
    assert found.cause[0] == (
        f"t = {tick / 100:g} s: joint slide: it moves faster than 1e+09 m/s, which nothing in the run could make it "
        f"({tmp_path}/deck.ic:3). Nearly always a step is too long for the servo, the arm or what acts on it, and the "
        "motion diverges: try a faster rate for the dynamics, which have 100 Hz."
    )
    assert not found.warning[0]


def test_between_three_orders_and_six_a_case_is_done_and_doubtful(tmp_path: Path) -> None:
    assert steps_to(1e6) < 80 < steps_to(1e9)
    found = engine.run(experiment(tmp_path, cart(80, GROWING)))
    assert found.status.tolist() == [engine.DONE] and found.metrics["late"][0] > 1e6
    assert (
        found.warning[0].startswith("t = ")
        and "joint slide: it moves faster than 1e+06 m/s, which hardly" in (found.warning[0])
    )


def test_below_that_nothing_is_said(tmp_path: Path) -> None:
    assert steps_to(1e6) > 64
    found = engine.run(experiment(tmp_path, cart(64, GROWING)))
    assert found.status.tolist() == [engine.DONE] and found.warning == [""] and found.metrics["late"][0] > 1e4


def test_what_begins_fast_may_be_faster(tmp_path: Path) -> None:
    """The measure is the case's own: the rate with which it begins, where that is above 1,000 rad/s."""
    deck = cart(64, GROWING).replace("slide.qd = 1 m/s", "slide.qd = 7000 m/s")
    found = engine.run(experiment(tmp_path, deck))
    assert found.metrics["late"][0] > 1e9 and found.status.tolist() == [engine.DONE]
    assert "faster than 7e+06 m/s" in found.warning[0]


def test_a_sound_run_is_left_alone(tmp_path: Path) -> None:
    found = engine.run(experiment(tmp_path, cart(100, 1.9)))
    assert found.status.tolist() == [engine.DONE] and found.warning == [""]


@pytest.mark.parametrize(("steps", "apart"), [(320, 32), (5000, 25), (2000, 25), (7, 16), (1001, 16), (992, 32)])
def test_the_last_look_is_at_the_end_where_that_fits(steps: int, apart: int, tmp_path: Path) -> None:
    made = experiment(tmp_path, cart(steps, 1.0))
    assert plausible.divisor(made.structure.schedule) == apart * made.structure.schedule.dynamics


def test_the_watch_is_no_part_of_what_decides_the_motion(tmp_path: Path) -> None:
    """A program for a real bed has no watch, and is the same otherwise where no motor is on a bed."""
    made = experiment(tmp_path, cart(20, 1.0))
    watched, bare = engine.prepare(made), engine.prepare(made, wire=True)
    assert set(plausible.OUTPUTS) <= set(watched.program.outputs)
    assert not set(plausible.OUTPUTS) & set(bare.program.outputs)
    assert watched.code_key == bare.code_key and watched.result_keys == bare.result_keys
    assert watched.work_key != bare.work_key
