"""What a motor feels, against linear algebra on the mass matrix."""

from __future__ import annotations

import numpy as np
import pytest

from met.dynamics.effective_inertia import effective_inertia
from met.dynamics.tree import Tree
from tests.met.dynamics.passes import forest, passed
from tests.oracles import dense
from tests.oracles.random_tree import random_tree
from tests.oracles.worst import Worst

# In acceleration mode J is the difference D0 - s of (12). Where a joint inboard yields about nearly the same axis J is
# a thousandth of D0, and s = U'Yp U again a difference of terms a thousand times larger: six digits go with the method.
# In torque mode there is no difference, and none go.
CLOSE = 1e-9


@pytest.mark.release
def test_inertia_and_torque_felt_agree_with_linear_algebra_in_every_mode() -> None:
    # J as a share of itself, b as a share of the torques that it is the difference of.
    held, yielding = Worst("J_eff against M, acceleration mode"), Worst("J_eff against M, torque mode")
    bias = Worst("b against M")
    for arm, tree in forest():
        whole = dense.DenseArm(arm.bodies, arm.gravity, arm.rotor, arm.wrenches)
        M, h, rotor = whole.mass_matrix(arm.q), whole.bias(arm.q, arm.qd), np.array(arm.rotor)
        for mode in ((True,) * arm.n, (False,) * arm.n, arm.mode):
            ours = passed(arm, mode, tree)
            expected = dense.effective_inertia(M, h, np.array(arm.tau), np.array(arm.qdd), mode, rotor)
            for i, ((J, b), (J_dense, b_dense)) in enumerate(zip(effective_inertia(tree, ours), expected, strict=True)):
                where = f"seed {arm.seed}, joint {i}, mode {mode}"
                (yielding if mode[i] else held).see(abs(J - J_dense) / J_dense, where)
                bias.see(abs(b - b_dense) / (abs(ours.tau_load[i]) + abs(J * ours.qdd[i])), where)
    held.below(CLOSE)
    yielding.below(1e-12)
    bias.below(CLOSE)


@pytest.mark.release
def test_a_joints_own_rotor_and_own_mode_are_not_felt() -> None:
    worst = Worst("J_eff with another rotor or mode of its own")
    for arm, tree in forest():
        i = arm.seed % arm.n
        J, _ = effective_inertia(tree, passed(arm, arm.mode, tree))[i]
        other_rotor = tuple(3.0 * x + 1.0 if j == i else x for j, x in enumerate(arm.rotor))
        other_mode = tuple(not m if j == i else m for j, m in enumerate(arm.mode))
        for there in (passed(arm, arm.mode, tree, rotor=other_rotor), passed(arm, other_mode, tree)):
            worst.see(abs(effective_inertia(tree, there)[i][0] - J) / J, f"seed {arm.seed}, joint {i}")
    worst.below(CLOSE)


@pytest.mark.slow
def test_torque_felt_is_affine_in_the_joints_acceleration() -> None:
    worst = Worst("tau_load against J_eff qdd + b")
    for arm, tree in forest():
        i = arm.seed % arm.n
        held = tuple(False if j == i else m for j, m in enumerate(arm.mode))
        J, b = effective_inertia(tree, passed(arm, held, tree))[i]
        ours = passed(arm, held, tree, qdd=tuple(7.0 if j == i else x for j, x in enumerate(arm.qdd)))
        worst.see(abs(ours.tau_load[i] - (J * 7.0 + b)) / (abs(J) * 7.0 + abs(b)), f"seed {arm.seed}, joint {i}")
    worst.below(CLOSE)


def test_the_papers_eq_7_holds_where_all_inboard_joints_are_held() -> None:
    arm = random_tree(3, 6)
    mode = (False, False, False, True, True, True)
    tree = Tree.build(arm.bodies)
    ours = passed(arm, mode, tree)
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
