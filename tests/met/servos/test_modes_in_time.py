"""A joint's mode may differ from joint to joint, from case to case, and change in time: every instant of each, against
Pinocchio's forward dynamics.
"""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import met.servos
from met import run as engine
from met.parameter import Parameter, Signal
from met.servos import Servo
from met.servos.servo import Drive, JointMotion
from met.trace import both, sin
from tests.ic.small_decks import experiment
from tests.met.tree_deck import GRAVITY, TREE
from tests.oracles.plan_tree import pinocchio

pytestmark = pytest.mark.oracle

ROTOR = 0.3


def drive(p: SimpleNamespace, held: object, states: object, joint: JointMotion) -> Drive:
    """In acceleration mode while first <= t < last, else in torque mode; both numbers change with the motion."""
    return Drive(
        torque=p.size * sin(3.0 * joint.time) - 0.5 * joint.qd,
        rotor=ROTOR,
        given=both(joint.time >= p.first, joint.time < p.last),
        qdd=p.size * sin(5.0 * joint.time) - joint.qd,
        signals={
            "asked": p.size * sin(5.0 * joint.time) - joint.qd,
            "given_torque": p.size * sin(3.0 * joint.time) - 0.5 * joint.qd,
        },
    )


SWITCHING = Servo(
    name="switching",
    doc="A servo of this test.",
    parameters=(
        Parameter(name="first", unit="s", doc="when acceleration mode begins"),
        Parameter(name="last", unit="s", doc="when it ends"),
        Parameter(name="size", default=1.0, doc="size of torque and acceleration"),
    ),
    signals=(
        Signal(name="asked", unit="joint/s^2", doc="acceleration given in acceleration mode"),
        Signal(name="given_torque", unit="effort", doc="torque given in torque mode"),
    ),
    drive=drive,
)

RUN = f"""\
servo switch {{ model = switching; first = 0.1 s; last = 0.3 s; }}
run it {{
    arm = tree;
    servos {{
        turn = switch;  raise = switch {{ first = 0 s; last = 1 s; }};
        push = switch {{ first = 2 s; size = 5; }};  wag = switch {{ last = 0.2 s; size = 2; }};
    }}
    initial {{ turn.q = 0.3 rad; raise.q = -0.7 rad; push.qd = 0.2 m/s; wag.qd = -1 rad/s; }}
    environment {{ gravity = [{", ".join(map(str, GRAVITY))}] m/s^2; }}
    rates {{ dynamics = 200 Hz; record = 200 Hz; }}
    integrator = rk4;  duration = 0.5 s;
    record = [q, qd, qdd, tau, servo.asked, servo.given_torque];
}}
sweep modes of it {{
    zip {{
        turn.servo.first  = [0.1, 0, 0.25, 9, 0] s;
        turn.servo.last   = [0.3, 9, 0.4, 9, 0.1] s;
        raise.servo.first = [0, 0.2, 0.25, 9, 0.1] s;
        push.servo.first  = [2, 0.1, 0.25, 9, 0] s;
        push.servo.last   = [2, 0.4, 0.4, 9, 9] s;
        wag.servo.first   = [0.1, 0.3, 0.25, 9, 0] s;
        wag.servo.last    = [0.2, 0.5, 0.4, 9, 9] s;
    }}
}}
"""


def test_modes_of_each_joint_case_and_instant_are_those_of_forward_dynamics(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(met.servos, "SERVOS", (*met.servos.SERVOS, SWITCHING))
    sweep = experiment(tmp_path, TREE, RUN, select=["modes"])
    found = engine.run(sweep, lanes=4)
    assert found.cause == [""] * 5
    columns = {c.path: c.values for c in sweep.cases.coordinates}
    arm = pinocchio(sweep, gravity=GRAVITY, rotor=[ROTOR] * 4)
    seen = set()
    for case in range(5):
        first = [columns.get(f"{j}.servo.first", np.zeros(5))[case] for j in ("turn", "raise", "push", "wag")]
        last = [columns.get(f"{j}.servo.last", np.ones(5))[case] for j in ("turn", "raise", "push", "wag")]
        q, qd, qdd, tau, asked, torque = (
            found.signals[name][case] for name in ("q", "qd", "qdd", "tau", "servo.asked", "servo.given_torque")
        )
        for row, t in enumerate(found.time):
            given = (t >= np.array(first)) & (t < np.array(last))
            seen.add(tuple(given.tolist()))
            # what is given is given exactly; what is solved for is the other half of the equation of motion
            assert (qdd[row][given] == asked[row][given]).all(), (case, t)
            assert (tau[row][~given] == torque[row][~given]).all(), (case, t)
            expected = arm.accelerations(q[row], qd[row], tau[row], {})
            # rounding: 1e-16 times the arm's condition, some hundreds, and of torques up to 50 N m
            assert np.abs(qdd[row] - expected).max() < 1e-11 * (1.0 + np.abs(tau[row]).max()), (case, t)
    assert len(seen) >= 9, "modes are to differ"
