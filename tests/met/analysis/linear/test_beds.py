"""Poles of a motor on a bed cross the unit circle where `met margin` says that its law is no longer stable."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ic
from met.analysis.linear.answers import LinearQuestion
from met.analysis.margin import margins
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


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("rate", ["100 Hz", pytest.param("1 kHz", marks=pytest.mark.slow)])
@pytest.mark.parametrize("law", ["measured_acceleration", "bare"])
def test_the_limit_of_a_law_is_where_a_pole_leaves_the_unit_circle(
    law: str, rate: str, delay: int, tmp_path: Path
) -> None:
    deck = DECK.replace("LAW", law).replace("RATE", rate).replace("DELAY", str(delay))
    (tmp_path / "deck.ic").write_text(deck)
    (made,) = ic.compile(tmp_path / "deck.ic", select=["loads"]).experiments
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
