"""An external drive: the torque of its command, with the inertia of what gives it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import ic
from met import run as engine
from tests.ic.small_decks import ARM, experiment

RUN = """\
servo pushed { model = external;  rotor = 0.1 kg*m^2;  command = torque(3 N*m); }
run it {
    arm = swing;  servos { hinge = pushed; }
    initial { hinge.qd = -2 rad/s; }
    rates { dynamics = 100 Hz;  servos = 50 Hz;  record = 50 Hz; }
    integrator = rk4;  duration = 2 s;  record = [q, qd, tau];
}
"""


def test_a_constant_torque_gives_a_constant_acceleration(tmp_path: Path) -> None:
    found = engine.run(experiment(tmp_path, ARM, RUN))
    q, qd, tau = (found.signals[name][0, :, 0] for name in ("q", "qd", "tau"))
    inertia, t = 2.0 / 3.0 + 0.1, found.time  # of the rod about its end, and the rotor
    # rk4 is exact here: what is left is rounding, of 200 steps
    np.testing.assert_allclose(qd, -2.0 + 3.0 / inertia * t, rtol=0, atol=1e-12)
    np.testing.assert_allclose(q, -2.0 * t + 1.5 / inertia * t**2, rtol=0, atol=1e-12)
    assert (tau == 3.0).all()


def test_a_run_has_nobody_else_to_give_the_torque(tmp_path: Path) -> None:
    deck = tmp_path / "deck.ic"
    deck.write_text(ARM + RUN.replace("  command = torque(3 N*m);", ""), encoding="utf-8")
    (found,) = ic.check(deck).diagnostics
    assert (found.code, found.message) == ("D149", "servo `pushed` has no command")
    assert found.help == ("write `command = torque(...);`, in the definition or for this joint",
                          "external takes torque(...)")  # fmt: skip
