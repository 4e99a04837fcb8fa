"""Energy and momentum against Pinocchio, and the balance of power."""

from __future__ import annotations

import numpy as np
import pytest

from met.dynamics.energy import energy
from met.dynamics.kinematics import link_motions
from met.dynamics.recursion import solve
from met.dynamics.tree import Tree
from tests.oracles.pinocchio_tree import PinocchioTree
from tests.oracles.random_tree import random_tree

SEEDS = range(30)


@pytest.mark.parametrize("seed", SEEDS)
def test_energy_and_momentum_agree_with_pinocchio(seed: int) -> None:
    arm = random_tree(seed)
    theirs = PinocchioTree(arm.bodies, arm.gravity, arm.rotor)
    ours = energy(Tree.build(arm.bodies), arm.q, arm.qd, gravity=arm.gravity)
    kinetic, _ = theirs.energy(arm.q, arm.qd)
    angular, linear = theirs.momentum(arm.q, arm.qd)
    assert ours.kinetic == pytest.approx(kinetic, rel=1e-11), f"seed {seed}"
    size = np.max(np.abs(angular)) + np.max(np.abs(linear))
    assert np.allclose(ours.angular, angular, rtol=0.0, atol=1e-11 * size), f"seed {seed}"
    assert np.allclose(ours.linear, linear, rtol=0.0, atol=1e-11 * size), f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_potential_energy_differs_between_places_as_in_pinocchio(seed: int) -> None:
    # Pinocchio counts links fixed to the base as well: a difference between two places does not.
    arm = random_tree(seed)
    theirs = PinocchioTree(arm.bodies, arm.gravity, arm.rotor)
    tree, zero = Tree.build(arm.bodies), (0.0,) * arm.n
    ours = [energy(tree, q, zero, gravity=arm.gravity).potential for q in (arm.q, zero)]
    expected = [theirs.energy(q, zero)[1] for q in (arm.q, zero)]
    size = max(map(abs, ours)) + max(map(abs, expected))
    assert abs((ours[0] - ours[1]) - (expected[0] - expected[1])) < 1e-12 * size, f"seed {seed}"


def test_a_rotor_stores_energy_and_no_momentum() -> None:
    arm = random_tree(4)
    tree = Tree.build(arm.bodies)
    bare = energy(tree, arm.q, arm.qd)
    ours = energy(tree, arm.q, arm.qd, rotor=(2.0,) * arm.n)
    assert ours.kinetic == pytest.approx(bare.kinetic + sum(v * v for v in arm.qd), rel=1e-14)
    assert (ours.linear, ours.angular) == (bare.linear, bare.angular)


@pytest.mark.parametrize("seed", SEEDS)
def test_energy_grows_by_the_power_of_torques_and_wrenches(seed: int) -> None:
    arm = random_tree(seed)
    tree = Tree.build(arm.bodies)
    now = solve(tree, arm.q, arm.qd, tau=arm.tau, qdd=arm.qdd, mode=arm.mode, rotor=arm.rotor, gravity=arm.gravity,
                wrenches=arm.wrenches)
    motions = link_motions(tree, arm.q, arm.qd)
    power = float(np.dot(now.tau, arm.qd))
    for name, (moment, force) in arm.wrenches.items():
        power += float(np.dot(moment, motions[name].w) + np.dot(force, motions[name].v))

    h = 1e-4 / (1.0 + max(map(abs, now.qdd))) ** 0.5

    def total(t: float) -> float:
        q, qd, qdd = (np.array(x, float) for x in (arm.q, arm.qd, now.qdd))
        there = energy(tree, tuple(q + t * qd + t * t / 2 * qdd), tuple(qd + t * qdd), rotor=arm.rotor,
                       gravity=arm.gravity)
        return float(there.kinetic + there.potential)

    # The derivative by differences of order four: h^4 against rounding of the energy over h.
    rate = (8.0 * (total(h) - total(-h)) - (total(2 * h) - total(-2 * h))) / (12.0 * h)
    tolerance = 1e-7 * abs(power) + 1e-11 * abs(total(0.0)) / h
    assert abs(rate - power) < tolerance, f"seed {seed}: {rate} against {power}"
