"""Energy and momentum against Pinocchio, the balance of power, and what a run without losses keeps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from met.dynamics.kinematics import Energy, energy, link_motions
from met.dynamics.recursion import solve
from met.dynamics.tree import Tree
from met.integrators import INTEGRATORS
from met.integrators.integrator import Integrator, Motion, Slope
from tests.met.dynamics.passes import CLOSE, forest, pinocchio, stand
from tests.oracles.random_tree import RandomArm, random_tree
from tests.oracles.worst import Worst, relative

SEEDS = range(30)


@pytest.mark.oracle
def test_energy_and_momentum_agree_with_pinocchio() -> None:
    kinetic, momentum = Worst("kinetic energy"), Worst("momentum")
    for arm, tree in forest():
        theirs = pinocchio(arm)
        ours = energy(tree, arm.q, arm.qd, gravity=arm.gravity)
        expected, _ = theirs.energy(arm.q, arm.qd)
        kinetic.see(abs(ours.kinetic - expected) / expected, f"seed {arm.seed}")
        both = np.concatenate(theirs.momentum(arm.q, arm.qd))
        momentum.see(relative((*ours.angular, *ours.linear), both), f"seed {arm.seed}")
    kinetic.below(CLOSE)
    momentum.below(CLOSE)


@pytest.mark.oracle
def test_potential_energy_differs_between_places_as_in_pinocchio() -> None:
    # Pinocchio counts links fixed to the base as well: a difference between two places does not.
    worst = Worst("potential energy")
    for arm, tree in forest():
        theirs, zero = pinocchio(arm), (0.0,) * arm.n
        ours = [energy(tree, q, zero, gravity=arm.gravity).potential for q in (arm.q, zero)]
        expected = [theirs.energy(q, zero)[1] for q in (arm.q, zero)]
        size = max(map(abs, ours)) + max(map(abs, expected))
        worst.see(abs((ours[0] - ours[1]) - (expected[0] - expected[1])) / size, f"seed {arm.seed}")
    worst.below(CLOSE)


def test_a_rotor_stores_energy_and_no_momentum() -> None:
    arm = random_tree(4)
    tree = Tree.build(arm.bodies)
    bare = energy(tree, arm.q, arm.qd)
    ours = energy(tree, arm.q, arm.qd, rotor=(2.0,) * arm.n)
    assert ours.kinetic == pytest.approx(bare.kinetic + sum(v * v for v in arm.qd), rel=1e-14)
    assert (ours.linear, ours.angular) == (bare.linear, bare.angular)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_energy_grows_by_the_power_of_torques_and_wrenches(seed: int) -> None:
    arm = random_tree(seed)
    tree = Tree.build(arm.bodies)
    now = solve(
        tree,
        arm.q,
        arm.qd,
        tau=arm.tau,
        qdd=arm.qdd,
        mode=arm.mode,
        rotor=arm.rotor,
        gravity=arm.gravity,
        wrenches=arm.wrenches,
    )
    motions = link_motions(tree, arm.q, arm.qd)
    power = float(np.dot(now.tau, arm.qd))
    for name, (moment, force) in arm.wrenches.items():
        power += float(np.dot(moment, motions[name].w) + np.dot(force, motions[name].v))

    h = 1e-4 / (1.0 + max(map(abs, now.qdd))) ** 0.5

    def total(t: float) -> float:
        q, qd, qdd = (np.array(x, float) for x in (arm.q, arm.qd, now.qdd))
        there = energy(
            tree, tuple(q + t * qd + t * t / 2 * qdd), tuple(qd + t * qdd), rotor=arm.rotor, gravity=arm.gravity
        )
        return float(there.kinetic + there.potential)

    # The derivative by differences of order four: h^4 against rounding of the energy over h.
    rate = (8.0 * (total(h) - total(-h)) - (total(2 * h) - total(-2 * h))) / (12.0 * h)
    tolerance = 1e-7 * abs(power) + 1e-11 * abs(total(0.0)) / h
    assert abs(rate - power) < tolerance, f"seed {seed}: {rate} against {power}"


def floating(seed: int) -> RandomArm:
    """A random arm of four joints on six free ones without matter: no wrench of the base's reaches it."""
    arm = random_tree(seed, 4)
    none = (0.0,) * 6
    bodies = (*stand(), *(replace(body, parent=body.parent + 6) for body in arm.bodies))
    adrift = (0.3, -0.2, 0.5, 0.4, -0.6, 0.2)
    return replace(arm, bodies=bodies, rotor=none + arm.rotor, q=none + arm.q, qd=adrift + arm.qd)


def travelled(arm: RandomArm, tree: Tree, integrator: Integrator, h: float, steps: int) -> Iterator[Energy]:
    """Energy and momentum at every instant of a run without torques or wrenches."""

    def slope(_: float, there: Motion) -> Slope:
        return Slope(there.qd, solve(tree, there.q, there.qd, rotor=arm.rotor, gravity=arm.gravity).qdd)

    y = Motion(arm.q, arm.qd)
    for step in range(steps + 1):
        yield energy(tree, y.q, y.qd, rotor=arm.rotor, gravity=arm.gravity)
        if step < steps:
            y = integrator.advance(slope, h, y, slope(0.0, y))


def halved(integrator: Integrator) -> tuple[int, int]:
    """Steps of a run and of one twice as fine; so few where the order is high that rounding stays far below."""
    steps = 200 // integrator.order**2
    return steps, 2 * steps


def order(coarse: float, fine: float) -> float:
    """The power of the step with which an error falls, from a halving."""
    return math.log2(coarse / fine)


@pytest.mark.release
@pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda integrator: integrator.name)
def test_a_run_without_losses_keeps_energy_to_the_integrators_order(integrator: Integrator) -> None:
    found = []
    for seed in range(5):
        arm = random_tree(seed, 2 + seed)
        tree = Tree.build(arm.bodies)
        lost = []
        for steps in halved(integrator):
            run = travelled(arm, tree, integrator, 0.2 / steps, steps)
            total = [float(now.kinetic + now.potential) for now in run]
            lost.append(max(abs(x - total[0]) for x in total))
        found.append(order(*lost))
    print(f"{integrator.name}: energy is kept to the orders {[round(x, 2) for x in found]}")
    # Of a smooth motion the error's next term is a step's share of the first.
    assert min(found) > integrator.order - 0.2, found


@pytest.mark.release
@pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda integrator: integrator.name)
def test_an_arm_that_floats_keeps_momentum_to_the_integrators_order(integrator: Integrator) -> None:
    found = []
    for seed in range(4):
        arm = replace(floating(seed), gravity=(0.0, 0.0, 0.0))
        tree = Tree.build(arm.bodies)
        lost = []
        for steps in halved(integrator):
            run = travelled(arm, tree, integrator, 0.2 / steps, steps)
            total = np.array([(*now.linear, *now.angular) for now in run])
            lost.append(float(np.max(np.abs(total - total[0]))))
        found.append(order(*lost))
    print(f"{integrator.name}: momentum is kept to the orders {[round(x, 2) for x in found]}")
    assert min(found) > integrator.order - 0.2, found
