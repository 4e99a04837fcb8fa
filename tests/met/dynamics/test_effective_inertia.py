"""What a motor feels, against linear algebra on the mass matrix."""

from __future__ import annotations

import numpy as np
import pytest

from met.dynamics.effective_inertia import effective_inertia
from met.dynamics.recursion import Solved, solve
from met.dynamics.tree import Tree
from tests.oracles import dense
from tests.oracles.random_tree import RandomArm, random_tree

SEEDS = range(40)


def passed(arm: RandomArm, mode: tuple[bool, ...], rotor: tuple[float, ...]) -> tuple[Tree, Solved]:
    tree = Tree.build(arm.bodies)
    return tree, solve(tree, arm.q, arm.qd, tau=arm.tau, qdd=arm.qdd, mode=mode, rotor=rotor, gravity=arm.gravity,
                       wrenches=arm.wrenches)


@pytest.mark.parametrize("seed", SEEDS)
def test_inertia_and_torque_felt_agree_with_linear_algebra_in_every_mode(seed: int) -> None:
    arm = random_tree(seed)
    rng = np.random.default_rng(seed)
    for mode in ((True,) * arm.n, (False,) * arm.n, arm.mode, tuple(bool(x) for x in rng.random(arm.n) < 0.5)):
        tree, ours = passed(arm, mode, arm.rotor)
        whole = dense.DenseArm(arm.bodies, arm.gravity, arm.rotor, arm.wrenches)
        M, h = whole.mass_matrix(arm.q), whole.bias(arm.q, arm.qd)
        tau, qdd = np.array(ours.tau), np.array(ours.qdd)
        size = np.max(np.abs(h)) + np.max(np.abs(M @ qdd))
        for i, (J, b) in enumerate(effective_inertia(tree, ours)):
            J_dense, b_dense = dense.effective_inertia(M, h, tau, qdd, mode, np.array(arm.rotor), i)
            # J is what is left of M_ii after the others yield, a thousandth at times, and M has the rounding of unit
            # accelerations: 1e-12 was the worst of a hundred trees.
            assert abs(J - J_dense) < 1e-10 * J_dense, f"seed {seed}, joint {i}, mode {mode}"
            assert abs(b - b_dense) < 1e-11 * size, f"seed {seed}, joint {i}, mode {mode}"


@pytest.mark.parametrize("seed", SEEDS)
def test_a_joints_own_rotor_and_own_mode_are_not_felt(seed: int) -> None:
    arm = random_tree(seed)
    i = seed % arm.n
    J, _ = effective_inertia(*passed(arm, arm.mode, arm.rotor))[i]
    other_rotor = tuple(3.0 * x + 1.0 if j == i else x for j, x in enumerate(arm.rotor))
    other_mode = tuple(not m if j == i else m for j, m in enumerate(arm.mode))
    # The two ways to J round differently; J may be a thousandth of D.
    assert effective_inertia(*passed(arm, arm.mode, other_rotor))[i][0] == pytest.approx(J, rel=1e-10), f"seed {seed}"
    assert effective_inertia(*passed(arm, other_mode, arm.rotor))[i][0] == pytest.approx(J, rel=1e-10), f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_torque_felt_is_affine_in_the_joints_acceleration(seed: int) -> None:
    arm = random_tree(seed)
    i = seed % arm.n
    held = tuple(False if j == i else m for j, m in enumerate(arm.mode))
    J, b = effective_inertia(*passed(arm, held, arm.rotor))[i]
    pushed = RandomArm(**{**vars(arm), "qdd": tuple(7.0 if j == i else x for j, x in enumerate(arm.qdd))})
    _, ours = passed(pushed, held, arm.rotor)
    size = abs(J) * 7.0 + abs(b)
    assert abs(ours.tau_load[i] - (J * 7.0 + b)) < 1e-10 * size, f"seed {seed}"


def test_the_papers_eq_7_holds_where_all_inboard_joints_are_held() -> None:
    arm = random_tree(3, 6)
    mode = (False, False, False, True, True, True)
    tree, ours = passed(arm, mode, arm.rotor)
    chain = [i for i in range(6) if not any(mode[j] for j in _inboard(tree, i))]
    found = effective_inertia(tree, ours)
    assert chain
    for i in chain:
        assert found[i][0] == pytest.approx(ours.D0[i], rel=1e-13)


def _inboard(tree: Tree, i: int) -> list[int]:
    result = []
    while tree.joints[i].parent >= 0:
        i = tree.joints[i].parent
        result.append(i)
    return result
