"""Energy along the run of a deck: an arm without losses keeps it to its integrator's order."""

from __future__ import annotations

import math

import numpy as np
import pytest

import ic
from met import run as engine
from met.dynamics.tree import Body
from met.integrators import INTEGRATORS
from met.integrators.integrator import Integrator
from tests.met.tree_deck import GRAVITY, TREE
from tests.oracles import plan_tree
from tests.oracles.dense import DenseArm

pytestmark = pytest.mark.slow

# All servos of the deck keep energy: a joint without one, a rotor, and one with a spring as well.
SPRING = 30.0
FREE = """
servo turned  { model = passive;  rotor = 0.8 kg*m^2; }
servo sprung  { model = passive;  rotor = 2 kg;  stiffness = 30 N/m; }
run free {
    arm = tree;  servos { turn = turned;  push = sprung; }  environment { gravity = GRAVITY m/s^2; }
    initial { turn.q = 0.3 rad;  turn.qd = 0.5 rad/s;  raise.q = -0.4 rad;  push.q = 0.1 m;  wag.qd = -1 rad/s; }
    integrator = INTEGRATOR;
    rates { dynamics = RATE Hz;  record = 50 Hz; }
    duration = 1 s;
    record = [q, qd];
}
"""


def energy(bodies: list[Body], rotor: tuple[float, ...], q: np.ndarray, qd: np.ndarray) -> float:
    """Kinetic energy with rotors, and potential energy of gravity and the spring, J."""
    dense = DenseArm(bodies, GRAVITY, rotor)
    still = np.zeros(len(q))
    weighed = sum(
        body.mass * (link.p + link.R @ np.array(body.com))
        for body, link in zip(bodies, dense.links(q, still, still), strict=True)
    )
    return float(qd @ dense.mass_matrix(q) @ qd / 2.0 - np.dot(GRAVITY, weighed) + SPRING * q[2] ** 2 / 2.0)


@pytest.mark.release
@pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda integrator: integrator.name)
def test_an_arm_without_losses_keeps_energy_to_its_integrators_order(integrator: Integrator) -> None:
    lost = []
    for rate in (400, 800):
        text = TREE + FREE.replace("GRAVITY", str(list(GRAVITY))).replace("INTEGRATOR", integrator.name)
        experiment = ic.compile(text=text.replace("RATE", str(rate))).experiments[0]
        run = engine.run(experiment)
        assert run.cause == [""] and [joint.name for joint in experiment.structure.moving][2] == "push"
        rows = zip(run.signals["q"][0], run.signals["qd"][0], strict=True)
        bodies = plan_tree.bodies(experiment)
        total = np.array([energy(bodies, (0.8, 0.0, 2.0, 0.0), q, qd) for q, qd in rows])
        lost.append(float(np.max(np.abs(total - total[0]))))
    order = math.log2(lost[0] / lost[1])
    print(f"{integrator.name}: {lost[1]:.2g} J lost at 800 Hz, order {order:.2f}")
    # Of a smooth motion the error's next term is a step's share of the first.
    assert order > integrator.order - 0.1
