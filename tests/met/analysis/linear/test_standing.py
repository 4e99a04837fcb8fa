"""An operating point is where an arm stands still: a run that begins there stays, and a motor too weak has none."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.analysis.linear import metrics
from met.analysis.linear.answers import LinearQuestion, of_deck
from met.analysis.linear.flow import Flow
from met.analysis.linear.standing import settled
from met.diagnostic import Problem
from tests.ic.small_decks import experiment
from tests.met.analysis.linear.oracles import at_instant

ARM = """\
arm pair {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link rod { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = -y; }
    joint knee revolute { parent = bar; child = rod; axis = -y; at = [1, 0, 0] m; }
}
servo geared {
    model = compliant_gearbox; ratio = 100; stiffness = 5000 N*m/rad; damping = 5 N*m*s/rad;
    kp = 0.05 V*s/rad; ki = 0.5 V/rad; k_position = 6 1/s; v_max = 48 V; resistance = 1 ohm; kt = 0.1 N*m/A;
    tau_max = 3 N*m; j_m = 1e-4 kg*m^2; command = position(0.5 rad);
}
servo rigid {
    model = rigid_gearbox; ratio = 100; kp = 0.05 V*s/rad; ki = 0.5 V/rad; v_max = 48 V; resistance = 1 ohm;
    kt = 0.1 N*m/A; tau_max = 3 N*m; j_m = 1e-4 kg*m^2; command = rate(0.4 rad/s);
}
servo loose { model = passive; }
run hold {
    arm = pair; servos { hinge = geared; knee = rigid; }
    environment { g = gravity { g = [0, 0, -9.81] m/s^2; } }
    rates { dynamics = 2 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 0.5 s; record = [q, hinge.servo.deflection, hinge.servo.voltage];
    initial { hinge.q = 10 deg; knee.qd = 0.3 rad/s; }
    linear up { at = equilibrium(q = [30, -60] deg); open = [hinge.servo.voltage, knee.servo.voltage];
        outputs = [q, qdd, hinge.servo.deflection, hinge.servo.voltage]; }
    linear first { at = equilibrium; open = hinge.servo.voltage; }
    metric room = phase_margin { of = up; }
}
run slow like hold { rates { dynamics = 500 Hz; } }
run weak like hold { servos { hinge { tau_max = 0.1 N*m; } } }
run limp like hold { servos { knee = loose; } up { open = hinge.servo.voltage; } }
sweep loads of hold { vary links.rod.mass = [1, 3, 40] kg; }
run there like hold {
    initial { hinge.q = 30 deg; knee.q = -60 deg; knee.qd = 0 rad/s; servos = balanced; }
    servos { hinge = geared { command = position(30 deg); }; knee = rigid { command = rate(0 rad/s); }; }
    linear now { open = [hinge.servo.voltage, knee.servo.voltage]; }
}
"""


def solved(folder: Path, run: str, block: str) -> tuple[LinearQuestion, Flow]:
    """A question, and the flow where its arm stands."""
    asked = of_deck(experiment(folder, ARM, select=[run]), block)
    (found,) = settled(asked.program, [at_instant(asked.program, 0, 0)])
    assert found is not None
    return asked, found


@pytest.mark.release
@pytest.mark.parametrize("run", ["hold", "slow"])
def test_an_arm_that_is_put_there_stays_for_a_thousand_periods(tmp_path: Path, run: str) -> None:
    """In all that it remembers, and its joints are where they are asked for."""
    asked, flow = solved(tmp_path, run, "up")
    later = flow.copy()
    for _ in range(1000 * asked.program.ticks):
        later.ticks()
        later.finish()
    assert max(abs(later.cells[name] - flow.cells[name]) for name in asked.program.states) < 1e-9
    assert [flow.cells["hinge.q"], flow.cells["knee.q"]] == pytest.approx(np.radians([30.0, -60.0]), abs=1e-15)


def test_a_law_behind_a_gear_is_asked_for_what_it_sees(tmp_path: Path) -> None:
    """The position at the motor: the joint's, and what its gear is wound up by."""
    _, flow = solved(tmp_path, "hold", "up")
    assert flow.cells["added:hinge.servo.command"] == pytest.approx(flow.cells["hinge.servo.deflection"], rel=1e-9)
    assert abs(flow.cells["added:knee.servo.command"]) < 1e-12


def test_the_gear_bends_by_the_weight(tmp_path: Path) -> None:
    """The deflection is the torque of gravity by the stiffness, in closed form."""
    _, flow = solved(tmp_path, "hold", "up")
    bar = 2.0 * 0.5 * math.cos(math.radians(30.0))
    rod = math.cos(math.radians(30.0)) + 0.5 * math.cos(math.radians(-30.0))
    assert abs(flow.cells["hinge.servo.deflection"]) == pytest.approx(9.81 * (bar + rod) / 5000.0, rel=1e-10)
    assert flow.cells["knee.q"] == pytest.approx(math.radians(-60.0)) and abs(flow.cells["knee.qd"]) < 1e-12


def test_without_a_pose_it_is_where_the_run_begins(tmp_path: Path) -> None:
    flow = at_instant(of_deck(experiment(tmp_path, ARM, select=["hold"]), "first").program, 0, 0)
    assert flow.cells["hinge.q"] == math.radians(10.0) and flow.cells["knee.qd"] == 0.0


def test_a_motor_too_weak_has_none(tmp_path: Path) -> None:
    """It names the joint, what it takes in closed form, what there is, and the limit."""
    with pytest.raises(Problem) as refused:
        of_deck(experiment(tmp_path, ARM, select=["weak"]), "up").of(0)
    (said,) = refused.value.diagnostics
    takes = 9.81 * (2.0 * 0.5 + 1.5) * math.cos(math.radians(30.0))
    assert said.code == "D377" and said.at is not None
    assert said.message == (
        f"`weak` has no operating point in this pose: `hinge` takes {takes:.3g} N m, and its servo can hold 10 N m: "
        "`tau_max`, 0.1 N*m, is too little: raise it or the gear's ratio, or lighten what the joint carries"
    )


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.02])
def test_a_servo_that_is_commanded_a_torque_is_commanded_the_weight(friction: float, tmp_path: Path) -> None:
    """In closed form, also where the weight is more than its friction holds."""
    pushed = ARM.replace("command = rate(0.4 rad/s)", f"f_c = {friction} N*m; command = torque(0 N*m)")
    asked = of_deck(experiment(tmp_path, pushed, select=["hold"]), "up")
    (flow,) = settled(asked.program, [at_instant(asked.program, 0, 0)])
    weight = 9.81 * 0.5 * math.cos(math.radians(-30.0))
    assert weight > 100.0 * friction and flow is not None
    assert flow.cells["added:knee.servo.command"] == pytest.approx(weight, rel=1e-9)


def test_a_servo_that_is_commanded_a_torque_may_be_too_weak(tmp_path: Path) -> None:
    pushed = ARM.replace("command = rate(0.4 rad/s)", "f_c = 0.02 N*m; command = torque(0 N*m)")
    with pytest.raises(Problem) as refused:
        weak = pushed.replace("weak like hold { servos { hinge", "weak like hold { servos { knee").replace(
            "0.1", "0.01"
        )
        of_deck(experiment(tmp_path, weak, select=["weak"]), "up").of(0)
    (said,) = refused.value.diagnostics
    takes = 9.81 * 0.5 * math.cos(math.radians(-30.0))
    assert said.message == (
        f"`weak` has no operating point in this pose: `knee` takes {takes:.3g} N m, and its servo can hold 3 N m: "
        "`tau_max`, 0.01 N*m, is too little: raise it or the gear's ratio, or lighten what the joint carries"
    )


def test_a_torque_of_a_law_that_is_continuous_is_not_sought(tmp_path: Path) -> None:
    pushed = ARM.replace("command = rate(0.4 rad/s)", "rate = continuous; command = torque(0 N*m)")
    pushed = pushed.replace("[hinge.servo.voltage, knee.servo.voltage]", "hinge.servo.voltage")
    with pytest.raises(Problem) as refused:
        of_deck(experiment(tmp_path, pushed, select=["hold"]), "up").of(0)
    (said,) = refused.value.diagnostics
    assert said.code == "D377" and said.message.startswith("`hold` has no operating point in this pose: `knee` begins")
    assert said.message.endswith(
        "and the torque that would hold it is not sought: the law of its servo is `continuous`, so give it a `rate`"
    )


def test_what_no_servo_holds_has_none(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="`knee` begins to move, by") as refused:
        of_deck(experiment(tmp_path, ARM, select=["limp"]), "up").of(0)
    assert refused.value.diagnostics[0].code == "D377"


@pytest.mark.slow
def test_metrics_of_a_sweep_are_of_the_operating_point_of_each_case(tmp_path: Path) -> None:
    """One of three loads is too heavy: it has no number, and says why."""
    made = engine.prepare(experiment(tmp_path, ARM, select=["loads"]))
    rows = np.arange(3)
    found = engine.results(made, rows, *metrics.compute(made, rows, record=False))
    for case in (0, 1):
        answer = of_deck(made.experiment, "up").of(case)
        assert found.metrics["room"][case] == min(loop.margins.phase for loop in answer.loops if loop.margins)
    assert np.isnan(found.metrics["room"][2]) and found.warning[:2] == ["", ""]
    assert found.warning[2] == (
        "no answer of `up` at equilibrium: its servos cannot hold it there, or something moves that no servo holds"
    )


def test_a_joint_that_sticks_there_is_held(tmp_path: Path) -> None:
    rubs = ARM.replace("command = rate(0.4 rad/s)", "f_c = 0.02 N*m; command = rate(0.4 rad/s)")
    answer = of_deck(experiment(tmp_path, rubs, select=["hold"]), "up").of(0)
    assert answer.held == ("knee",) and answer.stands and answer.where == "where it stands still"
    assert answer.loops[0].margins is not None and not answer.loops[1].returns


def test_what_moves_freely_has_none(tmp_path: Path) -> None:
    free = ARM.replace("link bar", "link base { mass = 20 kg; shape = sphere(radius = 0.3 m); }\n    link bar", 1)
    free = free.replace("arm = pair; servos", "arm = pair; base = free; servos")
    with pytest.raises(Problem, match="has no operating point in this pose: `base` moves freely"):
        of_deck(experiment(tmp_path, free, select=["hold"]), "up").of(0)
