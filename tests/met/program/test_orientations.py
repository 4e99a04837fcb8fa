"""Recorded orientations do not jump between q and -q, by the case alone; what a metric sees of one is without a jump
too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.backends.reference.plain import execute
from met.program.build import build
from tests.ic.small_decks import changed, experiment
from tests.met.program.free_flyers import ARM
from tests.met.program.free_flyers import RUN as FREE

DECK = """
arm top {
    link rod { mass = 1 kg;  shape = rod(length = 1 m, along = x); }
    link tip { mass = 1 kg;  shape = box(size = [0.1, 0.2, 0.3] m); }
    joint spin revolute { parent = base;  child = rod;  axis = z; }
    joint lean revolute { parent = rod;   child = tip;  axis = y;  at = [1, 0, 0] m;  rpy = [20, 30, -40] deg; }
}
run turning {
    arm      = top;
    initial  { spin.q = 170 deg;  spin.qd = 9 rad/s;  lean.qd = -5 rad/s; }
    rates    { dynamics = 200 Hz;  record = 50 Hz; }
    duration = 3 s;
    record   = [q, links.rod.orientation, links.tip.orientation];
}
"""
SWEEP = "sweep starts of turning { vary initial.spin.q = linspace(0, 540, 13) deg; }"
TURNED = ("links.rod.orientation", "links.tip.orientation")


def jumps(q: np.ndarray) -> int:
    """How often a quaternion (..., row, 4) is turned by more than a right angle from the row before it."""
    return int((np.sum(q[..., 1:, :] * q[..., :-1, :], axis=-1) < 0.0).sum())


def test_a_recorded_orientation_turns_on_through_half_turns(tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, DECK))
    for name in TURNED:
        assert jumps(run.signals[name]) == 0, name
        assert run.signals[name][0, 0, 0] >= 0.0
    spin = run.signals["q"][0, :, 0]
    assert spin[-1] > 6 * np.pi  # so a quaternion with w >= 0 would jump three times
    closed = np.stack([np.cos(spin / 2), 0 * spin, 0 * spin, np.sin(spin / 2)], axis=1)
    np.testing.assert_allclose(run.signals[TURNED[0]][0], closed, rtol=0, atol=1e-12)


def test_the_first_row_of_a_case_has_w_of_at_least_0(tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, DECK, SWEEP, select="starts"))
    for name in TURNED:
        assert (run.signals[name][:, 0, 0] >= 0.0).all(), name
        assert jumps(run.signals[name]) == 0, name


@pytest.mark.slow
def test_the_bits_of_an_orientation_are_the_case_s_own(tmp_path: Path) -> None:
    every = experiment(tmp_path, DECK, SWEEP, select="starts")
    together = engine.run(every)
    for cases, lanes in (([7], None), ([12, 3], 2), ([5, 6, 7], 4)):
        some = engine.run(every, cases, lanes=lanes)
        for name in TURNED:
            assert some.signals[name].tobytes() == together.signals[name][cases].tobytes()


@pytest.mark.slow
def test_kernel_and_plain_floats_turn_the_same_way(tmp_path: Path) -> None:
    made = experiment(tmp_path, DECK)
    rows, _ = execute(build(made), {}, made.structure.schedule.ticks)
    run = engine.run(made)
    kernel = np.concatenate([run.signals[name][0].reshape(len(rows), -1) for name in ("q", *TURNED)], axis=1)
    np.testing.assert_allclose(kernel, rows, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_one_component_is_that_of_the_whole(tmp_path: Path) -> None:
    whole = engine.run(experiment(tmp_path, DECK))
    part = engine.run(experiment(tmp_path, DECK.replace(TURNED[1], TURNED[1] + ".w")))
    assert part.signals[TURNED[1] + ".w"].tobytes() == whole.signals[TURNED[1]][..., 0].tobytes()


def test_a_metric_changes_no_bit_of_what_is_recorded_and_sees_it_without_a_jump(tmp_path: Path) -> None:
    plain = engine.run(experiment(tmp_path, DECK))
    metric = "    metric end = final { of = links.rod.orientation.w; }\n"
    watched = engine.run(experiment(tmp_path, DECK.replace("    duration", metric + "    duration")))
    for name in TURNED:
        assert watched.signals[name].tobytes() == plain.signals[name].tobytes()
    assert watched.metrics["end"][0] == plain.signals[TURNED[0]][0, -1, 0]


@pytest.mark.slow
def test_rows_between_instants_hold_the_last_one(tmp_path: Path) -> None:
    run = engine.run(
        experiment(
            tmp_path, changed(DECK, ("dynamics = 200 Hz;  record = 50 Hz", "dynamics = 100 Hz;  record = 200 Hz"))
        )
    )
    for name in TURNED:
        q = run.signals[name][0]
        assert (q[:-1:2] == q[1::2]).all() and jumps(q) == 0
        assert len(np.unique(q, axis=0)) == 301


@pytest.mark.slow
def test_what_turns_more_than_half_a_turn_from_row_to_row_is_as_near_the_row_before_as_can_be(tmp_path: Path) -> None:
    slow = changed(
        DECK,
        ("record = 50 Hz", "record = 2 Hz"),
        ("    duration", "    metric end = final { of = links.rod.orientation.w; }\n    duration"),
    )
    run = engine.run(experiment(tmp_path, slow))
    assert np.ptp(run.signals["q"][0, :2, 0]) > np.pi
    for name in TURNED:
        assert jumps(run.signals[name]) == 0


@pytest.mark.slow
def test_a_base_that_tumbles_does_not_jump_either(tmp_path: Path) -> None:
    fast = changed(FREE, ("base.rate", "base.rate = [4, 2, -3] rad/s;  // "))
    run = engine.run(experiment(tmp_path, ARM, "", fast))
    q = run.signals["links.base.orientation"]
    assert (q[..., 0] < 0.0).any(), "it never passes half a turn"
    assert jumps(q) == 0
