"""Servo loops that tick: limits of stability against closed forms of sampled systems, and against runs."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.analysis.loops import Loops, closed, frame
from met.analysis.step_map import Linearizer
from met.plan import Experiment
from tests.ic.small_decks import changed, check, experiment

DECK = """\
arm swing {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo drive {
    model = rigid_gearbox;  ratio = 10;  kp = KP V*s/rad;  ki = 0 V/rad;  v_max = 1e9 V;  resistance = 1 ohm;
    kt = 0.5 N*m/A;  tau_max = 1e9 N*m;  j_m = 1e-2 kg*m^2;  command = COMMAND;
}
run hold {
    arm = swing;
    servos { hinge = drive; }
    rates { dynamics = 10 kHz;  servos = 50 Hz; }
    duration = 4 s;
    record = [qd];
}
"""
PERIOD, DECAY = 0.02, 12.5  # T, s; a = N^2 Kt^2/(R (J + N^2 J_m)), 1/s
LIMIT = (1.0 + math.exp(-DECAY * PERIOD)) / (1.0 - math.exp(-DECAY * PERIOD)) * 0.5
"""Of qd+ = e^-aT qd - (1 - e^-aT) (Kp/Kt) qd: kp at which the factor is -1, V s/rad."""


def deck(kp: float, command: str = "rate(0.1 rad/s)") -> str:
    return changed(DECK, ("KP", repr(kp)), ("COMMAND", command))


def loops(experiment: Experiment) -> Loops:
    sampled = Linearizer(experiment, [0]).sampled()
    assert sampled is not None
    return closed(experiment, sampled)


def test_the_factor_of_a_rate_loop_is_that_of_the_closed_form(tmp_path: Path) -> None:
    sampled = Linearizer(experiment(tmp_path, deck(2.0)), [0]).sampled()
    assert sampled is not None
    sizes = np.linalg.eigvals(frame(sampled, 0))
    e = math.exp(-DECAY * PERIOD)
    assert np.abs(sizes - (e - (1.0 - e) * 2.0 / 0.5)).min() < 1e-6


def test_its_limit_is_that_of_the_closed_form(tmp_path: Path) -> None:
    """The gain that is named is where the loop grows by e over the run: a little above the limit."""
    assert loops(experiment(tmp_path, deck(0.99 * LIMIT))).unstable == ()
    (found,) = loops(experiment(tmp_path, deck(2.0 * LIMIT))).unstable
    assert found.joints == ("hinge",) and found.gain == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize("hz", [1000, 50, 25, 10])
def test_it_is_on_the_right_side_of_the_limit_of_runs(hz: int, tmp_path: Path) -> None:
    """Steps shorter than a tick, as long, and longer: then memory goes evenly over the step."""

    def grows(kp: float) -> bool:
        part = changed(deck(kp), ("dynamics = 10 kHz", f"dynamics = {hz} Hz"), ("duration = 4 s", "duration = 20 s"))
        with np.errstate(all="ignore"):
            qd = engine.run(experiment(tmp_path, part)).signals["qd"][0, :: max(1, hz // 50), 0]
        changes = np.abs(np.diff(qd))
        return not changes[-1] < changes[1]

    low, high = 0.01, 20.0
    for _ in range(12):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    for share, count in ((0.95, 0), (1.05, 1)):
        made = experiment(tmp_path, changed(deck(share * high), ("dynamics = 10 kHz", f"dynamics = {hz} Hz")))
        assert len(loops(made).unstable) == count, (share, high)


TWO = """\
arm pair {
    link a { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    link b { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint one revolute { parent = base;  child = a;  axis = z; }
    joint two revolute { parent = base;  child = b;  axis = z; }
}
servo drive {
    model = rigid_gearbox;  ratio = 10;  kp = 1 V*s/rad;  ki = 0 V/rad;  v_max = 24 V;  resistance = 1 ohm;
    kt = 0.5 N*m/A;  tau_max = 10 N*m;  j_m = 1e-2 kg*m^2;  command = rate(0.1 rad/s);
}
servo eager like drive { kp = 9 V*s/rad; }
run hold {
    arm = pair;  servos { one = drive;  two = eager; }
    rates { dynamics = 1 kHz;  servos = 50 Hz; }
    duration = 4 s;  record = [qd];
}
"""


def test_only_the_loop_is_blamed_whose_gain_is_too_large(tmp_path: Path) -> None:
    """Here two loops do not meet: each has the limit of one alone."""
    (found,) = check(tmp_path, TWO, select="all").diagnostics
    assert found.code == "D320" and "on joint `two`" in found.message
    kp = re.search(r"kp = ([0-9.]+) V", found.help[0])
    assert kp is not None and float(kp[1]) == pytest.approx(LIMIT, rel=0.01)
    torque = changed(TWO, ("kp = 9 V*s/rad;", "kp = 9 V*s/rad;  command = torque(1 N*m);"))
    assert check(tmp_path, torque, select="all").diagnostics == ()


def test_a_loop_that_would_swing_up_without_ticks_too_is_not_told(tmp_path: Path) -> None:
    """s^3 + (a + b) s^2 + (c + b k) s + c k, a = 12.5, b = 1.25, c = 750, k = 30: (a + b)(c + b k) < c k."""
    swings = changed(
        deck(0.05, "position(0.1 rad)"),
        ("ki = 0 V/rad", "ki = 30 V/rad;  k_position = 30 1/s"),
        ("servos = 50 Hz", "servos = 5 kHz"),
    )
    assert check(tmp_path, swings, select="all").diagnostics == ()
    qd = engine.run(experiment(tmp_path, swings)).signals["qd"][0, :, 0]
    assert np.abs(qd[-5000:]).max() > 10.0 * np.abs(qd[:5000]).max()
