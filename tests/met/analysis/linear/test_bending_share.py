"""The bandwidth of a command, and that as a share of the first bending mode, against closed forms and held joints."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.analysis.linear import metrics
from met.analysis.linear.answers import LinearQuestion
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, messages
from tests.met.analysis.linear.test_linear_metrics import KP, STIFF, SWEPT, answers, pole_and_gain, with_entries
from tests.met.program.test_bending import BOOM, LOADED

MOTOR = "ratio = 100;  kt = 0.1 N*m/A;  resistance = 0.5 ohm;  j_m = 6e-5 kg*m^2;  command = position(0 rad);  "
LOOP = "kp = 0.5 V*s/rad;  ki = 1 V/rad;  k_position = 0.3 1/s;  v_max = 1000 V;  tau_max = 100 N*m;  "
CURRENT = "kp = 1 A*s/rad;  ki = 1 A/rad;  k_position = 0.3 1/s;  k_current = 1 V/A;  ki_current = 100 V/(A*s);  "
FILTERED = "sensor qd = tachometer { filter = butterworth;  cutoff = 0.02 Hz; }  "
DRIVES = {
    "rigid": f"model = rigid_gearbox;  {MOTOR}{LOOP}",
    "filtered": f"model = rigid_gearbox;  {MOTOR}{LOOP}{FILTERED}",
    "elastic": f"model = compliant_gearbox;  {MOTOR}{LOOP}stiffness = 20 N*m/rad;  damping = 5 N*m*s/rad;",
    "cascade": f"model = cascade;  {MOTOR}{CURRENT}gear = rigid;  inductance = 5 mH;",
    "elastic cascade": f"model = cascade;  {MOTOR}{CURRENT}inductance = 5 mH;  stiffness = 2e4 N*m/rad;",
}
ASKED = "linear swing { inputs = root.servo.command;  outputs = root.q; }"


@pytest.mark.slow
@pytest.mark.parametrize("drive", DRIVES)
def test_the_first_bending_mode_is_that_of_an_arm_whose_joints_are_locked(tmp_path: Path, drive: str) -> None:
    """Whatever the motor, its gear and its filters: the joint is held, so they take no part."""
    locked = LinearQuestion(experiment(tmp_path, changed(BOOM, LOADED))).of(0)
    driven = changed(BOOM, LOADED, ("root = locked", "root = drive"), ("rates {", "rates { servos = 1 kHz;"))
    servo = f"servo drive {{ {DRIVES[drive]} }}\n"
    found = LinearQuestion(experiment(tmp_path, servo, driven)).of(0)
    assert found.bending == pytest.approx(locked.natural[0].hz, rel=1e-6)
    assert locked.bending == pytest.approx(locked.natural[0].hz, rel=1e-12)


def test_a_joint_without_a_computer_is_not_held(tmp_path: Path) -> None:
    """A bearing at the root: the first mode is that of a hinged boom."""
    hinged = LinearQuestion(experiment(tmp_path, changed(BOOM, LOADED, ("root = locked", "root = bearing")))).of(0)
    swings = [pole.hz for pole in hinged.natural if dict(pole.shares).get("root.q", 0.0) < 1.0]
    assert hinged.bending == pytest.approx(min(swings), rel=1e-9)


@pytest.mark.slow
def test_a_requirement_of_the_share_decides_by_the_gain(tmp_path: Path) -> None:
    required = "    metric band = bandwidth { of = swing; }\n    require bending_share(swing) < 50 %;\n"
    driven = changed(BOOM, LOADED, ("root = locked", "root = drive"), ("rates {", "rates { servos = 1 kHz;"))
    driven = changed(driven, ("duration = 1 s;", "duration = 10 ms;"))
    servo = f"servo drive {{ {DRIVES['rigid']} }}\n"
    sweep = "sweep gains of hang { vary drive.k_position = [0.03, 0.4, 30] 1/s; }\n"
    deck = (servo, with_entries(driven, f"    {ASKED}\n", required), sweep)
    made = engine.prepare(experiment(tmp_path, *deck, select=["gains"]))
    found = engine.results(made, np.arange(3), *metrics.compute(made, np.arange(3), threads=1, record=False))
    first = LinearQuestion(experiment(tmp_path, changed(BOOM, LOADED))).of(0).natural[0].hz
    np.testing.assert_allclose(found.metrics["swing_bending_share"][:2], found.metrics["band"][:2] / first, rtol=1e-6)
    assert found.metrics["band"][0] == pytest.approx(0.03 / (2.0 * math.pi), rel=0.02), "a slow loop is one pole"
    assert found.met["bending_share(swing) < 50 %"].tolist() == [True, False, False]


def test_the_bandwidth_of_a_rate_loop_is_that_of_its_pole(tmp_path: Path) -> None:
    """y = k/(z - p) of u, with p = a - k: |z - p|^2 = 2 (1 - p)^2."""
    asked = "    linear loop { at = 0.5 s;  inputs = hinge.servo.command;  outputs = hinge.qd; }\n"
    asked += "    metric band = bandwidth { of = loop; }\n"
    run = with_entries(RUN, asked)
    a, b = pole_and_gain()
    sweep = SWEPT.replace("3.2]", f"3.2, {0.01005 * (1.0 + a) / b!r}]")
    found = answers(tmp_path, ARM, STIFF, run, sweep, select="gains")
    for case, kp in enumerate(KP):
        p = a - 100.0 * kp * b
        cosine = (1.0 + p * p - 2.0 * (1.0 - p) ** 2) / (2.0 * p)
        expected = math.acos(cosine) / (2e-3 * math.pi) if abs(cosine) < 1.0 else math.inf
        assert found.metrics["band"][case] == pytest.approx(expected, rel=1e-8)
    assert found.metrics["band"][len(KP)] == 0.0, "it is unstable"


def test_a_position_has_no_bandwidth_for_a_rate(tmp_path: Path) -> None:
    asked = "    linear loop { at = 0.5 s;  inputs = hinge.servo.command;  outputs = hinge.q; }\n"
    run = with_entries(RUN, asked, "    require bandwidth(loop) > 1 Hz;\n")
    found = answers(tmp_path, ARM, STIFF, run, SWEPT, select="gains")
    assert np.isnan(found.metrics["loop_bandwidth"]).all()
    assert found.warning[0].endswith("its output is nothing, or has no end, for an input that stays")


def test_a_share_needs_a_way_and_a_boom(tmp_path: Path) -> None:
    way = "    linear loop { inputs = hinge.servo.command;  outputs = hinge.qd; }\n"
    run = with_entries(RUN, way, "    require bending_share(loop) < 50 %;\n")
    assert "a `bending_share` is of an arm with a boom, and `swing` has none" in messages(
        check(tmp_path, ARM, SERVO, run)
    )
    run = with_entries(RUN, way.replace("hinge.qd", "[q, qd]"), "    require bandwidth(loop) > 1 Hz;\n")
    said = messages(check(tmp_path, ARM, SERVO, run))
    assert "error[D376]: `linear loop` has not one input and one output, so it has no `bandwidth`" in said
    assert "write one of each in it: `inputs = hinge.servo.command;  outputs = hinge.q;`" in said
    assert codes(tmp_path, ARM, SERVO, changed(run, ("outputs = [q, qd];", "outputs = hinge.q;"))) == []
