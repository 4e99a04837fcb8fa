"""Arms that stand still with a motor on an emulated bed: friction holds the shaft, and one that it does not hold has no
derivative."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met.analysis.linear.answers import of_deck
from met.analysis.linear.jacobian import period_map
from met.analysis.linear.standing import settled
from met.diagnostic import Problem
from tests.ic.small_decks import experiment
from tests.met.analysis.linear.oracles import at_instant

DECK = """\
#include <servos/rigid_gearbox.ic>
arm turner {
    link bar { mass = 20 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = -y; }
}
servo drive like rigid_gearbox { command = position(0 rad);  k_position = 5 1/s; }
run there {
    arm = turner;  servos { hinge = drive; }
    environment { g = gravity { g = [0, 0, -9.81] m/s^2; } }
    substitute hinge { bed = emulated;  law = velocity_tracking; }
    rates { base = 1 kHz;  dynamics = 1 kHz;  servos = 1 kHz; }  duration = 2 s;  record = [q];
    linear up { at = equilibrium(q = [0.3] rad);  open = hinge.servo.voltage; }
}
run smooth like there { servos { hinge { f_c = 0 N*m; } } }
run by_torque like there { servos { hinge { command = torque(0 N*m); } } }
run weak like there { hinge { bed = emulated(i_max = 0.5 A);  law = velocity_tracking; } }
run faulty like there { hinge { bed = emulated(tachometer = 0.1 rad/s);  law = velocity_tracking; } }
"""
LAWS = ["velocity_tracking", "torque_balance_observer", "torque_balance", "bare", "measured_acceleration"]


@pytest.mark.release
@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("law", LAWS)
def test_an_arm_on_a_bed_that_is_put_there_stays_and_moves_as_its_map_says(
    law: str, delay: int, tmp_path: Path
) -> None:
    deck = DECK.replace("emulated;  law = velocity_tracking", f"emulated(delay = {delay});  law = {law}")
    asked = of_deck(experiment(tmp_path, deck, select=["there"]))
    program = asked.program
    (flow,) = settled(program, [at_instant(program, 0, program.begin(0.0))])
    assert flow is not None
    later = flow.copy()
    for _ in range(300):
        later.ticks()
        later.finish()
    assert max(abs(later.cells[name] - flow.cells[name]) for name in program.states) < 1e-9
    assert flow.cells["hinge:angle"] == pytest.approx(1570.0 * 0.3, rel=1e-12)
    drive = 0.061 / 2.05 * flow.cells["hinge.bed.drive_voltage"]
    assert abs(drive + 0.072 * flow.cells["hinge.bed.load_current"]) < 0.0205, "more than friction holds"
    assert abs(1570.0 * drive - 20.0 * 9.81 * 0.5 * np.cos(0.3)) < 1570.0 * 0.0205
    found = period_map(program, flow)
    assert found.held[0] == "hinge.bed" and "hinge.bed.shaft_rate" not in found.states
    assert asked.of(0).loops[0].returns is False
    for place, name in enumerate(found.states):
        ends = []
        for size in (1e-6, -1e-6):
            moved = flow.copy()
            moved.cells[name] += size
            moved.ticks()
            moved.finish()
            ends.append(np.array([moved.cells[each] for each in found.states]))
        np.testing.assert_allclose((ends[0] - ends[1]) / 2e-6, found.A[:, place], atol=1e-6, rtol=1e-6)


def _refused(folder: Path, run: str) -> str:
    with pytest.raises(Problem) as refused:
        of_deck(experiment(folder, DECK, select=[run])).of(0)
    (said,) = refused.value.diagnostics
    assert said.code == "D377" and said.at is not None
    return said.message


@pytest.mark.slow
def test_a_shaft_that_no_friction_holds_has_no_derivative_at_rest(tmp_path: Path) -> None:
    assert _refused(tmp_path, "smooth") == (
        "`smooth` has no operating point in this pose: no dry friction, `f_c`, holds the shaft of the bed of `hinge`, "
        "and an emulated bed stops a shaft that would turn back for the rest of a substep, so that there is no "
        "derivative at rest"
    )


@pytest.mark.release
@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("law", LAWS)
def test_a_bed_whose_servo_is_commanded_a_torque_stands_by_the_one_that_bears_the_weight(
    law: str, delay: int, tmp_path: Path
) -> None:
    """Not by friction's share, which is less than the weight here."""
    deck = DECK.replace("emulated;  law = velocity_tracking", f"emulated(delay = {delay});  law = {law}")
    asked = of_deck(experiment(tmp_path, deck, select=["by_torque"]))
    (flow,) = settled(asked.program, [at_instant(asked.program, 0, asked.program.begin(0.0))])
    assert flow is not None
    weight = 20.0 * 9.81 * 0.5 * np.cos(0.3)
    assert weight > 2.0 * 1570.0 * 0.0205
    assert flow.cells["added:hinge.servo.command"] == pytest.approx(weight, rel=1e-12)
    assert period_map(asked.program, flow).held[0] == "hinge.bed"
    later = flow.copy()
    for _ in range(300):
        later.ticks()
        later.finish()
    assert max(abs(later.cells[name] - flow.cells[name]) for name in asked.program.states) < 1e-9


@pytest.mark.slow
def test_a_bed_whose_load_motor_is_too_weak_is_told_of_with_what_limits_it(tmp_path: Path) -> None:
    """0.036 N m of 0.0597 that the weight asks of it, of which friction takes 0.0205; 1 A does."""
    told = _refused(tmp_path, "weak")
    assert told.endswith(
        ": the load motor of its bed is at its limit, `hinge.bed.i_max` times `hinge.bed.kt_load`, and does not give "
        "the torque of the arm"
    ), told
    deck = DECK.replace("i_max = 0.5 A", "i_max = 1 A")
    asked = of_deck(experiment(tmp_path, deck, select=["weak"]))
    assert settled(asked.program, [at_instant(asked.program, 0, asked.program.begin(0.0))]) != [None]


@pytest.mark.slow
def test_a_bed_with_noise_does_not_stand_still(tmp_path: Path) -> None:
    assert _refused(tmp_path, "faulty") == (
        "`faulty` has no operating point in this pose: its beds have faults, with which nothing comes to rest or goes "
        "evenly: `hinge.bed.tachometer`"
    )
