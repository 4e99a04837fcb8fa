"""The recursion against Pinocchio and against linear algebra on the mass matrix, and where it has no answer."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from met.dynamics.recursion import reactions, solve
from met.dynamics.tree import Body, Tree
from tests.met.dynamics.passes import CLOSE, forest, passed, pinocchio
from tests.oracles.dense import DenseArm, mixed
from tests.oracles.random_tree import random_tree
from tests.oracles.worst import Worst, relative


@pytest.mark.release
@pytest.mark.oracle
def test_accelerations_agree_with_pinocchio() -> None:
    # As a share of the arm's largest acceleration.
    worst = Worst("qdd against aba")
    for arm, tree in forest():
        theirs = pinocchio(arm).accelerations(arm.q, arm.qd, arm.tau, arm.wrenches)
        worst.see(relative(passed(arm, True, tree).qdd, theirs), f"seed {arm.seed}")
    worst.below(CLOSE)


@pytest.mark.oracle
@pytest.mark.parametrize("size", [1e-14, 1e-10, 1e-7, 1e-4, 1e-2])
def test_axes_that_are_almost_parallel_cost_no_digits(size: float) -> None:
    # Their common normal may be a kilometre away. Right angles written with eight digits are the usual case.
    for seed in range(20):
        arm = random_tree(seed)
        rng = np.random.default_rng(seed)
        bodies = []
        for body in arm.bodies:
            right = rng.choice([0.0, math.pi / 2, math.pi], 3) + size * rng.standard_normal(3)
            bodies.append(replace(body, rpy=tuple(map(float, right)), axis=(0.0, 0.0, 1.0)))
        arm = replace(arm, bodies=tuple(bodies))
        theirs = pinocchio(arm)
        expected = theirs.accelerations(arm.q, arm.qd, arm.tau, arm.wrenches)
        assert relative(passed(arm, True).qdd, expected) < CLOSE, f"seed {seed}"


@pytest.mark.oracle
def test_torques_agree_with_pinocchio() -> None:
    worst = Worst("tau against rnea")
    for arm, tree in forest():
        theirs = pinocchio(arm).torques(arm.q, arm.qd, arm.qdd, arm.wrenches)
        worst.see(relative(passed(arm, False, tree).tau, theirs), f"seed {arm.seed}")
    worst.below(CLOSE)


@pytest.mark.oracle
def test_mixed_modes_agree_with_pinocchio_both_ways() -> None:
    inverse, forward = Worst("mixed modes: tau against rnea"), Worst("mixed modes: qdd against aba")
    for arm, tree in forest():
        ours, theirs = passed(arm, arm.mode, tree), pinocchio(arm)
        inverse.see(relative(ours.tau, theirs.torques(arm.q, arm.qd, ours.qdd, arm.wrenches)), f"seed {arm.seed}")
        forward.see(relative(ours.qdd, theirs.accelerations(arm.q, arm.qd, ours.tau, arm.wrenches)), f"seed {arm.seed}")
        for i in range(arm.n):
            given, back = ((arm.qdd, ours.qdd), (arm.tau, ours.tau))[arm.mode[i]]
            assert given[i] == back[i], f"seed {arm.seed}, joint {i}"
    inverse.below(CLOSE)
    forward.below(CLOSE)


@pytest.mark.release
def test_mixed_modes_agree_with_linear_algebra() -> None:
    accelerations, torques = Worst("mixed modes: qdd against M"), Worst("mixed modes: tau against M")
    for arm, tree in forest():
        dense = DenseArm(arm.bodies, arm.gravity, arm.rotor, arm.wrenches)
        M, h = dense.mass_matrix(arm.q), dense.bias(arm.q, arm.qd)
        qdd, tau = mixed(M, h, np.array(arm.tau), np.array(arm.qdd), arm.mode)
        ours = passed(arm, arm.mode, tree)
        accelerations.see(relative(ours.qdd, qdd), f"seed {arm.seed}")
        torques.see(relative(ours.tau, tau), f"seed {arm.seed}")
    accelerations.below(CLOSE)
    torques.below(CLOSE)


@pytest.mark.oracle
def test_tau_load_is_tau_less_the_rotors_share() -> None:
    worst = Worst("tau_load against rnea without rotors")
    for arm, tree in forest():
        ours = passed(arm, arm.mode, tree)
        bare = pinocchio(replace(arm, rotor=(0.0,) * arm.n))
        worst.see(relative(ours.tau_load, bare.torques(arm.q, arm.qd, ours.qdd, arm.wrenches)), f"seed {arm.seed}")
    worst.below(CLOSE)


@pytest.mark.oracle
def test_without_velocity_products_only_rates_in_the_equation_of_motion_are_gone() -> None:
    worst = Worst("velocity products off: tau against rnea at rest")
    for arm, tree in forest():
        ours = passed(arm, arm.mode, tree, velocity_products=False)
        theirs = pinocchio(arm).torques(arm.q, np.zeros(arm.n), ours.qdd, arm.wrenches)
        worst.see(relative(ours.tau, theirs), f"seed {arm.seed}")
    worst.below(CLOSE)


@pytest.mark.oracle
def test_reactions_agree_with_pinocchio_in_the_links_own_frames() -> None:
    # Each as a share of its own largest component, moment or force.
    worst, along = Worst("reactions against rnea"), Worst("their component along the joint against tau_load")
    for arm, tree in forest():
        ours = passed(arm, arm.mode, tree)
        theirs = pinocchio(arm).reactions(arm.q, arm.qd, ours.qdd, arm.wrenches)
        bodies = {body.joint: body for body in arm.bodies}
        for i, (moment, force) in enumerate(reactions(tree, ours)):
            expected = np.concatenate(theirs[i])
            worst.see(relative((*moment, *force), expected), f"seed {arm.seed}, joint {i}")
            body = bodies[tree.joints[i].name]
            own = np.dot(body.axis, moment if body.kind == "revolute" else force)
            along.see(abs(own - ours.tau_load[i]) / np.max(np.abs(expected)), f"seed {arm.seed}, joint {i}")
    worst.below(CLOSE)
    along.below(CLOSE)


def test_a_joint_with_nothing_outboard_is_singular_in_torque_mode_only() -> None:
    bodies = [
        Body("arm", "shoulder", "revolute", -1, mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1, 0, 0, 0)),
        Body("nothing", "wrist", "revolute", 0, at=(1.0, 0.0, 0.0), rpy=(0.3, 0.2, 0.1)),
    ]
    tree = Tree.build(bodies)

    def singular(mode: tuple[bool, bool], rotor: tuple[float, float] = (0.0, 0.0)) -> tuple[bool, ...]:
        return tuple(map(bool, solve(tree, (0.1, 0.2), (0.3, 0.4), tau=(1.0, 1.0), mode=mode, rotor=rotor).singular))

    assert singular((True, True)) == (False, True)
    assert singular((True, False)) == (False, False)
    assert singular((True, True), rotor=(0.0, 1e-6)) == (False, False)


def test_inertia_that_lies_on_the_axis_is_none_to_the_joint() -> None:
    # The wrist's only load is a mass point on the axes of both wrist joints: nothing to turn.
    bodies = [
        Body("arm", "shoulder", "revolute", -1, mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1, 0, 0, 0)),
        Body("yoke", "roll", "revolute", 0, at=(1.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0)),
        Body("point", "pitch", "revolute", 1, axis=(0.0, 1.0, 0.0), mass=3.0),
    ]
    tree = Tree.build(bodies)
    for mode, expected in (((True, True, False), (False, True, False)), ((True, False, True), (False, False, True))):
        ours = solve(tree, (0.1, 0.2, 0.7), (0.3, 0.4, 0.5), tau=(1.0, 0.0, 0.0), mode=mode)
        assert tuple(map(bool, ours.singular)) == expected
