"""The energy of an arm along a run, from what it records; with what springs hold, it stays or does not."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from met import run as engine
from met.dynamics.spatial import rotation_quaternion
from tests.ic.small_decks import experiment
from tests.met.environments.worlds import Link
from tests.met.tree_deck import TREE

LINKS = ("boom", "side", "tool")
RUN = """\
run free {
    arm = tree;
    initial { turn.q = 0.3 rad; turn.qd = 0.5 rad/s; raise.q = -0.4 rad; push.q = 0.1 m; wag.qd = -1 rad/s; }
    environment { MODEL }
    integrator = INTEGRATOR;  rates { dynamics = RATE Hz; record = 50 Hz; }  duration = 1 s;
    record = [q, energy.kinetic, links.boom.position, links.boom.orientation, links.side.position,
              links.side.orientation, links.tool.position, links.tool.orientation];
}
"""
Placed = dict[str, Link]


def kept(tmp_path: Path, model: str, potential: Callable[[Placed], float], integrator: str, rate: int) -> np.ndarray:
    """Kinetic energy of the tree and what the model holds where its links are, at each row, J."""
    text = RUN.replace("MODEL", model).replace("INTEGRATOR", integrator).replace("RATE", str(rate))
    found = engine.run(experiment(tmp_path, TREE, text))
    assert found.cause == [""] and np.ptp(found.signals["q"][0], axis=0).min() > 0.02, "all joints move"
    held = []
    for row in range(len(found.time)):
        links = {
            name: Link(
                np.array(rotation_quaternion(*found.signals[f"links.{name}.orientation"][0, row].tolist())),
                found.signals[f"links.{name}.position"][0, row],
            )
            for name in LINKS
        }
        held.append(potential(links))
    return np.asarray(found.signals["energy.kinetic"][0, :].reshape(len(held)) + np.array(held))


def order_of_loss(tmp_path: Path, model: str, potential: Callable[[Placed], float], integrator: str) -> float:
    """How the energy that is lost or gained falls when steps are halved."""
    lost = []
    for rate in (400, 800):
        energy = kept(tmp_path, model, potential, integrator, rate)
        lost.append(float(np.abs(energy - energy[0]).max()))
    order = math.log2(lost[0] / lost[1])
    print(f"{integrator}: {lost[1]:.2g} J lost of {energy[0]:.3g} J at 800 Hz, order {order:.2f}")
    assert lost[1] < 2e-4 * abs(energy[0])
    return order
