"""Poles of a motor on a bed cross the unit circle where `met margin` says that its law is no longer stable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import ic
from met.analysis.linear.answers import LinearQuestion
from met.analysis.margin import BedExperiment, margins
from met.diagnostic import Problem
from met.plan import Experiment

DECK = """\
#include <servos/rigid_gearbox.ic>
let load = 157.2606 kg*m^2;
arm turner {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [load, load, load]; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo drive like rigid_gearbox { command = rate(0.03 rad/s); }
run there {
    arm = turner;  servos { hinge = drive; }  initial { hinge.qd = 0.03 rad/s; }
    substitute hinge { bed = emulated(delay = DELAY);  law = LAW; }
    rates { base = RATE;  dynamics = RATE;  servos = RATE; }  duration = 2 s;  record = [q];
    allow D105 because "rates that are a test's own";
}
sweep loads of there { vary load = [1, 2] kg*m^2; }
"""


def with_loads(made: Experiment, loads: list[float]) -> Experiment:
    (coordinate,) = made.cases.coordinates
    cases = replace(made.cases, count=len(loads), coordinates=(replace(coordinate, values=np.array(loads)),))
    return replace(made, cases=cases)


@pytest.mark.release
@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("rate", ["100 Hz", pytest.param("1 kHz", marks=pytest.mark.slow)])
@pytest.mark.parametrize("law", ["measured_acceleration", "bare"])
def test_the_limit_of_a_law_is_where_a_pole_leaves_the_unit_circle(law: str, rate: str, delay: int) -> None:
    deck = DECK.replace("LAW", law).replace("RATE", rate).replace("DELAY", str(delay))
    (made,) = ic.compile(text=deck, select=["loads"]).experiments
    rotor = 1570.0**2 * 6.38e-5
    ((found,),) = margins(with_loads(made, [rotor]))
    if found.limit is None:
        sides = [("stable", found.searched * 0.5)]
    else:
        sides = [("stable", 0.999 * found.limit), ("grows", 1.001 * found.limit)]
    question = LinearQuestion(with_loads(made, [r * rotor for _, r in sides]))
    for case, (wanted, r) in enumerate(sides):
        largest = max(abs(pole.z) for pole in question.of(case).poles)
        assert (largest > 1.0 + 1e-7) == (wanted == "grows"), (r, largest)


OTHER = (
    DECK.replace(
        "rigid_gearbox { command",
        "rigid_gearbox { ratio = 100;  kp = 0.1 V*s/rad;  ki = 1 V/rad;  v_max = 24 V;  resistance = 1 ohm;"
        "  kt = 1 N*m/A;  tau_max = 1 N*m;  j_m = 1e-4 kg*m^2;  f_c = 0 N*m;  f_v = 0 N*m*s/rad;  command",
    )
    .replace("initial { hinge.qd = 0.03 rad/s; }", "")
    .replace("0.03 rad/s", "1e-4 rad/s")
)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["torque_balance", "bare"])
def test_a_motor_that_is_far_from_what_its_law_takes_it_for_is_as_in_the_whole_program(law: str) -> None:
    """Where the load would turn the shaft back within a tick, which an emulated bed does not do, the loop is looked at
    while the shaft is driven on; such light arms were told stable, and runs of them swing up."""
    deck = OTHER.replace("LAW", law).replace("RATE", "1 kHz").replace("delay = DELAY", "kt = 0.065 N*m/A")
    (made,) = ic.compile(text=deck, select=["loads"]).experiments
    loads = [0.05, 0.3, 1.0, 2.0, 3.0, 3.8, 4.05, 4.1, 8.0]  # r: N^2 J_m is 1
    question = LinearQuestion(with_loads(made, loads), at=0.001)
    largest = [max(abs(pole.z) for pole in question.of(case).poles) for case in range(len(loads))]
    assert [each > 1.0 for each in largest] == (
        [True, True, True, True, True, False, False, True, True] if law == "torque_balance" else [True] * 9
    ), "a run of each settles, or swings up"
    beds = BedExperiment(with_loads(made, loads))
    tape = beds.begun(0)
    loop = beds.loop("hinge", 0, beds.motors(tape)[0])
    np.testing.assert_allclose(loop.radii(loads), largest, rtol=1e-6)


@pytest.mark.slow
def test_a_tick_in_which_the_shaft_of_a_bed_turns_back_has_no_derivative() -> None:
    """As an emulated bed stops it for the rest of a substep: nothing of its rate comes out of that tick."""
    deck = OTHER.replace("LAW", "torque_balance").replace("RATE", "1 kHz").replace("delay = DELAY", "kt = 0.065 N*m/A")
    turning = deck.replace("servos { hinge = drive; }", "servos { hinge = drive; }  initial { hinge.qd = 1e-4 rad/s; }")
    (made,) = ic.compile(text=turning, select=["loads"]).experiments
    with pytest.raises(Problem, match="the shaft of the bed of `hinge` stops, or turns back") as refused:
        LinearQuestion(with_loads(made, [1.0]), at=0.001).of(0)
    assert refused.value.diagnostics[0].code == "D370"
