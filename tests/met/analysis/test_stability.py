"""Stability margins at poses that cases pass, against those of linear answers, and what has none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import ic
from met.analysis.linear.answers import linear
from met.analysis.passed import Passed
from met.analysis.stability import least_margins, margins_at_start
from met.plan import Experiment
from met.plan.searches import LeastMargins

DECK = """
arm two {
    link upper { mass = 6 kg;  shape = rod(length = 0.6 m, along = x); }
    link lower { mass = 3 kg;  shape = rod(length = 0.5 m, along = x); }
    joint shoulder revolute { parent = base;  child = upper;  axis = z; }
    joint elbow revolute { parent = upper;  child = lower;  axis = z;  at = [0.6, 0, 0] m; }
}
servo geared {
    model = compliant_gearbox;  ratio = 100;  stiffness = 8000 N*m/rad;  damping = 8 N*m*s/rad;
    kp = 0.05 V*s/rad;  ki = 0.5 V/rad;  k_position = 6 1/s;  v_max = 48 V;
    resistance = 1.2 ohm;  kt = 0.08 N*m/A;  tau_max = 3 N*m;  j_m = 1.5e-4 kg*m^2;
    sensor qd = tachometer { filter = butterworth;  cutoff = 80 Hz;  delay = 1; }
    command = position(0 rad);
}
servo rigid {
    model = rigid_gearbox;  ratio = 80;  kp = 0.05 V*s/rad;  ki = 0.5 V/rad;  k_position = 6 1/s;  v_max = 48 V;
    resistance = 1.2 ohm;  kt = 0.08 N*m/A;  tau_max = 3 N*m;  j_m = 1e-4 kg*m^2;  f_c = FRICTION N*m;
    command = position(0 rad);
}
run hold {
    arm = two;  servos { shoulder = geared;  elbow = rigid; }
    rates { dynamics = 4 kHz;  servos = 500 Hz; }  duration = 0.1 s;  record = [q];
}
sweep more of hold { vary geared.kp = [0.05, 0.2, 1] V*s/rad; }
"""

LAWS = ["shoulder.servo.voltage", "elbow.servo.voltage"]


def experiment(run: str, *changes: tuple[str, str], friction: str = "0") -> Experiment:
    """A run or sweep of the deck, with texts in it changed."""
    text = DECK.replace("FRICTION", friction)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return ic.compile(text=text, select=run).experiments[0]


def at_start(of: Experiment, cases: Sequence[int]) -> Passed:
    """The starts of some cases, of which the position of the elbow is given."""
    return Passed(np.array(cases), np.zeros(len(cases), int), {"elbow.q": np.linspace(0.0, 1.5, len(cases))})


@pytest.mark.slow
def test_margins_are_those_of_linear_answers_where_no_friction_holds_the_arm() -> None:
    of = experiment("hold")
    found = least_margins(of, at_start(of, [0]))
    assert isinstance(found, LeastMargins)
    loops = linear(of, opened=LAWS).loops
    single: list[Any] = [loop.margins for loop in loops[:2]]
    gains = [1.0 / each for each, _ in (loop.gains for loop in loops) if each]
    gains += [each for _, each in (loop.gains for loop in loops) if each]
    assert found.disk == pytest.approx(min(each.disk for each in single), rel=1e-4)
    assert found.delay == pytest.approx(min(each.delay for each in single), rel=1e-4)
    assert found.gain == pytest.approx(min(gains), rel=1e-4)
    assert (found.joints, found.case, found.loops, found.poses) == (("shoulder",), 0, 2, 1)


@pytest.mark.slow
def test_dry_friction_is_released() -> None:
    smooth, rough = experiment("hold"), experiment("hold", friction="5")
    first, second = least_margins(smooth, at_start(smooth, [0])), least_margins(rough, at_start(rough, [0]))
    assert isinstance(first, LeastMargins) and isinstance(second, LeastMargins)
    assert second.disk == pytest.approx(first.disk, rel=1e-4)
    assert second.delay == pytest.approx(first.delay, rel=1e-3)


@pytest.mark.slow
def test_the_least_of_all_cases_and_poses_is_told_and_an_unstable_loop_has_none() -> None:
    of = experiment("more")
    found = least_margins(of, at_start(of, [0, 1]))
    assert isinstance(found, LeastMargins)
    each = [
        least_margins(of, Passed(np.array([k]), np.zeros(1, int), {"elbow.q": np.array([1.5 * k])})) for k in (0, 1)
    ]
    disks = [one.disk for one in each if isinstance(one, LeastMargins)]
    assert found.disk == pytest.approx(min(disks), rel=1e-9) and found.case == int(np.argmin(disks))
    assert (found.cases, found.poses) == (2, 2)
    unstable = least_margins(of, at_start(of, [0, 1, 2]))
    assert isinstance(unstable, LeastMargins)
    assert (unstable.disk, unstable.gain, unstable.delay) == (0.0, 1.0, 0.0)
    assert (unstable.case, unstable.joints) == (2, ("shoulder", "elbow"))
    start = margins_at_start(of, [0, 1, 2], 0.1)
    assert start is not None and start[2] == 0.0
    own = least_margins(of, Passed(np.array([0]), np.zeros(1, int), {}))
    assert isinstance(own, LeastMargins) and own.disk <= start[0] < 1.05 * own.disk
    more = margins_at_start(of, [0], 1.95)  # 79 times the gain of both is too much
    assert more is not None and more[0] == start[0]


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ([("command = position(0 rad);\n}\nrun", "command = position(0 rad);  rate = continuous;\n}\nrun")],
         "the law of joint `elbow` is continuous"),
        ([("command = position(0 rad);", "command = torque(0 N*m);")], "no law closes a loop over the arm"),
    ],
)  # fmt: skip
def test_a_reason_stands_where_there_is_no_margin(changes: list[tuple[str, str]], why: str) -> None:
    of = experiment("hold", *changes)
    assert least_margins(of, at_start(of, [0])) == why


@pytest.mark.slow
def test_a_loop_that_ticks_twice_in_a_frame_has_the_disk_of_its_ticks() -> None:
    """The elbow's servo is slower, and acts on an arm of its own: the shoulder's loop stays as it was."""
    apart = ("parent = upper;  child = lower", "parent = base;  child = lower")
    same = experiment("hold", apart)
    slower = experiment("hold", apart, ("tau_max = 3 N*m;  j_m = 1e-4", "tau_max = 3 N*m;  rate = 250 Hz;  j_m = 1e-4"))
    first, second = (least_margins(each, at_start(each, [0])) for each in (same, slower))
    assert isinstance(first, LeastMargins) and isinstance(second, LeastMargins)
    assert first.joints == second.joints == ("shoulder",)
    assert second.disk == pytest.approx(first.disk, rel=1e-3)
    assert second.gain == pytest.approx(first.gain, rel=1e-3)
    assert math.isnan(second.delay)


def test_a_delay_or_gain_that_nothing_limits_is_infinite() -> None:
    of = experiment(
        "hold", ("6 1/s", "0.001 1/s"), ("kp = 0.05", "kp = 1e-9"), ("ki = 0.5 V/rad;  k", "ki = 0 V/rad;  k")
    )
    found = least_margins(of, at_start(of, [0]))
    assert isinstance(found, LeastMargins) and found.delay == math.inf
