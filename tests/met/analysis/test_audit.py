"""Inputs that change nothing, found in numbers and by the program that is recorded."""

from __future__ import annotations

from pathlib import Path

import pytest

from met.analysis import audit
from met.analysis.audit import accelerating, idle_inputs
from tests.ic.small_decks import experiment

DECK = """\
arm swing {
    link bar { mass = 1 kg;  com = [0.1, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    link rest { mass = 1 kg;  com = [0.1, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
    joint wrist revolute { parent = bar;  child = rest;  axis = z;  at = [0.2, 0, 0] m; }
}
servo drive {
    model = rigid_gearbox;  ratio = 10;  kp = 1 V*s/rad;  ki = 0 V/rad;  v_max = 1e9 V;  resistance = 1 ohm;
    kt = 0.5 N*m/A;  tau_max = 1e9 N*m;  j_m = 1e-2 kg*m^2;  command = rate(0.1 rad/s);
}
run hold {
    arm = swing;
    servos { hinge = drive; }
    rates { dynamics = 1 kHz;  servos = 1 kHz; }
    duration = 1 s;
    record = [qd];
}
sweep over of hold { vary drive.ratio = [10, 20];  vary links.rest.mass = [1 kg, 2 kg];
    vary drive.ki = [0 V/rad, 1 V/rad]; }
"""


def test_what_accelerates_at_the_start_has_an_effect_and_of_the_rest_nothing_is_said(tmp_path: Path) -> None:
    made = experiment(tmp_path, DECK, select="over")
    assert accelerating(made) == {"drive.ratio", "links.rest.mass"}  # an integral has not grown yet
    assert idle_inputs(made) == ()


def test_an_arm_of_many_joints_is_not_recorded_where_each_input_accelerates_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = experiment(tmp_path, DECK.replace("vary drive.ki = [0 V/rad, 1 V/rad];", ""), select="over")

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("recorded")

    monkeypatch.setattr(audit, "record", refuse)
    with pytest.raises(AssertionError, match="recorded"):
        idle_inputs(made)
    monkeypatch.setattr(audit, "MANY_JOINTS", 2)
    assert idle_inputs(made) == ()
    with pytest.raises(AssertionError, match="recorded"):  # an integral's gain does nothing at once
        idle_inputs(experiment(tmp_path, DECK, select="over"))
