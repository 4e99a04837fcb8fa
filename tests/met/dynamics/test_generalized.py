"""What a free base answers to its arm: no momentum comes of it, and Pinocchio's free-flyer says the same."""

from __future__ import annotations

import numpy as np
import pytest

from met.dynamics.kinematics import base_answers, energy
from met.dynamics.spatial import Pose
from tests.met.dynamics.test_free_base import fleet, vector
from tests.oracles.pinocchio_floating import Flight, FloatingPinocchio


@pytest.mark.release
def test_the_answer_leaves_no_momentum() -> None:
    worst = 0.0
    for arm, tree, flight in fleet()[::5]:
        pose = Pose(tuple(map(vector, flight.R)), vector(flight.p))
        for i, (w, v) in enumerate(base_answers(tree, arm.q, pose)):
            rates = [float(k == i) for k in range(len(arm.q))]
            own = vector(flight.R.T @ np.array(w)), vector(flight.R.T @ np.array(v))
            alone = energy(tree, arm.q, rates, base=pose)
            both = energy(tree, arm.q, rates, base=pose, base_velocity=own)
            size = np.abs([*alone.linear, *alone.angular]).max() + 1e-12
            worst = max(worst, np.abs([*both.linear, *both.angular]).max() / size)
    assert worst < 1e-11  # poses of some metres, inertias over three decades


@pytest.mark.oracle
def test_pinocchio_finds_none_either() -> None:
    worst = 0.0
    for arm, tree, flight in fleet()[::15]:
        pose = Pose(tuple(map(vector, flight.R)), vector(flight.p))
        oracle = FloatingPinocchio(arm.bodies, (0.0, 0.0, 0.0), np.zeros(len(arm.q)))
        answers = np.array(base_answers(tree, arm.q, pose), float)  # joint, (angular, linear), axis
        w, v = np.tensordot(np.array(arm.qd), answers, 1)
        moved = Flight(flight.R, flight.p, flight.R.T @ w, flight.R.T @ v)
        angular, linear = oracle.momentum(moved, arm.q, arm.qd)
        held = oracle.momentum(Flight(flight.R, flight.p, np.zeros(3), np.zeros(3)), arm.q, arm.qd)
        size = np.abs(held).max() + 1e-12
        worst = max(worst, np.abs([*angular, *linear]).max() / size)
    assert worst < 1e-10
