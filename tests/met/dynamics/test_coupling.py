"""Joints that follow others: against dense linear algebra with G'MG, closed forms, and what must hold by itself."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from met.dynamics.coupling import Ratios, solve_coupled
from met.dynamics.recursion import solve
from met.dynamics.tree import Body, Tree
from met.trace import Formulas, Graph
from tests.met.dynamics.test_free_base import flight, floated, vector
from tests.oracles.dense import DenseArm
from tests.oracles.random_tree import RandomArm, random_tree
from tests.oracles.worst import Worst

LONG = np.longdouble


def grouped(arm: RandomArm) -> tuple[Ratios, np.ndarray]:
    """Random groups over half of an arm's joints: one leader with followers, and one of two leaders where it has the
    joints for it; also as a matrix, [joint, leader]."""
    rng = np.random.default_rng(500 + arm.seed)
    order = [int(i) for i in rng.permutation(arm.n)]
    rows: list[dict[int, float]] = [{} for _ in range(arm.n)]
    first, second = order[0], order[1]
    rows[first][first] = 1.0
    for i in order[2 : 2 + max(1, arm.n // 4)]:
        rows[i][first] = float(rng.uniform(-3.0, 3.0))
    if arm.n >= 5:
        rows[second][second] = 1.0
        rows[order[-1]] = {first: float(rng.uniform(-2.0, 2.0)), second: float(rng.uniform(-2.0, 2.0))}
    matrix = np.zeros((arm.n, arm.n), LONG)
    for i, row in enumerate(rows):
        for j, ratio in row.items():
            matrix[i, j] = ratio
    return tuple(rows), matrix


def reference(arm: RandomArm, rows: Ratios, G: np.ndarray, mode: Sequence[bool]) -> np.ndarray:
    """All accelerations, by elimination on P'MP: P has the columns of G, and ones for joints of no group."""
    dense = DenseArm(arm.bodies, arm.gravity, arm.rotor, arm.wrenches)
    M, h = dense.mass_matrix(arm.q), dense.torques(arm.q, arm.qd, [0.0] * arm.n)
    free, prescribed = [], np.zeros(arm.n, LONG)
    for i, row in enumerate(rows):
        if row and i not in row:
            continue
        column = G[:, i] if row else np.eye(arm.n, dtype=LONG)[i]
        if mode[i]:
            free.append(column)
        else:
            prescribed += column * arm.qdd[i]
    P = np.array(free, LONG).T.reshape(arm.n, len(free))
    A, b = P.T @ M @ P, P.T @ (np.array(arm.tau, LONG) - h - M @ prescribed)
    x = np.linalg.solve(A.astype(float), b.astype(float))
    x = x + np.linalg.solve(A.astype(float), (b - A @ x).astype(float))
    return (P @ x + prescribed).astype(float)


def ours(arm: RandomArm, rows: Ratios, mode: Sequence[bool], tree: Tree | None = None, **changed: object):  # type: ignore[no-untyped-def]
    loads = {"tau": arm.tau, "qdd": arm.qdd, "rotor": arm.rotor, "gravity": arm.gravity, "wrenches": arm.wrenches}
    return solve_coupled(
        tree or Tree.build(arm.bodies), rows, **{"q": arm.q, "qd": arm.qd, "mode": tuple(mode), **loads, **changed}
    )


def _agree(seeds: Sequence[int]) -> None:
    worst, balance = Worst("coupled qdd against G'MG"), Worst("torques at the leaders")
    for seed in seeds:
        arm = random_tree(seed, 3 + seed % 10)
        rows, G = grouped(arm)
        mode = arm.mode
        solved = ours(arm, rows, mode)
        expected = reference(arm, rows, G, mode)
        worst.see(float(np.abs(solved.qdd - expected).max() / np.abs(expected).max()), f"seed {seed}")
        torques = np.array(solve(Tree.build(arm.bodies), arm.q, arm.qd, qdd=solved.qdd, mode=False, rotor=arm.rotor,
                                 gravity=arm.gravity, wrenches=arm.wrenches).tau)  # fmt: skip
        for i, row in enumerate(rows):
            if row and i not in row:
                continue
            column = G[:, i].astype(float) if row else np.eye(arm.n)[i]
            left = column @ torques - column @ np.array(solved.tau)
            balance.see(abs(left) / np.abs(torques).max(), f"seed {seed}, joint {i}")
            assert solved.tau[i] == arm.tau[i] or not mode[i]
    worst.below(1e-13)
    balance.below(1e-13)


def test_coupled_accelerations_are_those_of_the_projected_mass_matrix() -> None:
    _agree(range(12))


@pytest.mark.slow
def test_coupled_accelerations_of_three_hundred_trees() -> None:
    _agree(range(100, 400))


def test_a_group_on_a_free_base_balances() -> None:
    worst = Worst("torques that a free base's coupled joints lack")
    for seed in (3, 5):
        arm, base = floated(random_tree(seed, 6)), flight(seed)
        tree = Tree.build(arm.bodies, free=True)
        rows, G = grouped(arm)
        given = {"gravity": vector(base.R.T @ np.array(arm.gravity)), "base_rate": vector(base.R.T @ base.w)}
        solved = ours(arm, rows, arm.mode, tree, **given)
        again = solve(tree, arm.q, arm.qd, qdd=solved.qdd, mode=False, rotor=arm.rotor, wrenches=arm.wrenches, **given)
        torques = np.array(again.tau)
        whole = np.concatenate(again.base_acceleration)
        off = np.abs(whole - np.concatenate(solved.base_acceleration)).max()
        worst.see(float(off / np.abs(whole).max()), f"seed {arm.seed}")
        for i, row in enumerate(rows):
            if i in row and arm.mode[i]:
                left = G[:, i].astype(float) @ (torques - np.array(arm.tau))
                worst.see(abs(left) / np.abs(torques).max(), f"seed {arm.seed}, joint {i}")
    worst.below(1e-13)


def test_geared_discs_have_the_inertia_of_both() -> None:
    # J = J1 + k^2 J2
    discs = [Body(f"d{i}", f"j{i}", "revolute", -1, mass=1.0, inertia=(1.0, 1.0, J, 0.0, 0.0, 0.0)) for i, J in
             enumerate((0.3, 0.7))]  # fmt: skip
    solved = solve_coupled(Tree.build(discs), ({0: 1.0}, {0: -2.5}), q=(0.2, 0.0), qd=(1.0, -2.5), tau=(4.0, 0.0))
    assert solved.qdd[0] == pytest.approx(4.0 / (0.3 + 2.5**2 * 0.7), rel=1e-15)
    assert solved.qdd[1] == -2.5 * solved.qdd[0]


def test_a_rack_and_its_pinion_are_one_inertia() -> None:
    bodies = (
        Body("pinion", "turn", "revolute", -1, mass=2.0, inertia=(0.1, 0.1, 0.05, 0.0, 0.0, 0.0)),
        Body("rack", "slide", "prismatic", -1, mass=3.0, axis=(1.0, 0.0, 0.0)),
    )
    solved = solve_coupled(
        Tree.build(bodies), ({0: 1.0}, {0: 0.04}), q=(0.0, 0.0), qd=(0.0, 0.0), tau=(1.0, 0.0), gravity=(-5.0, 0.0, 0.0)
    )
    assert solved.qdd[0] == pytest.approx((1.0 - 0.04 * 3.0 * 5.0) / (0.05 + 3.0 * 0.04**2), rel=1e-14)
    assert solved.tau_load[1] == pytest.approx(3.0 * (solved.qdd[1] + 5.0), rel=1e-14)


def test_a_parallelogram_is_its_closed_form() -> None:
    # Upper arm at a, crank at b, rod between: the forearm turns with the crank. Coordinates a and b are of both.
    la, d, rng = 0.9, 0.25, np.random.default_rng(4)

    def bar(mass: float, com: float, J: float) -> dict[str, object]:
        return {"mass": mass, "com": (com, 0.0, 0.0), "inertia": (1e-3, J, J, 0.0, 0.0, 0.0)}

    tree = Tree.build(
        (
            Body("upper", "a", "revolute", -1, **bar(8.0, 0.4, 0.6)),  # type: ignore[arg-type]
            Body("fore", "f", "revolute", 0, at=(la, 0.0, 0.0), **bar(4.0, 0.3, 0.3)),  # type: ignore[arg-type]
            Body("crank", "b", "revolute", -1, **bar(3.0, -0.1, 0.05)),  # type: ignore[arg-type]
            Body("rod", "r", "revolute", 2, at=(-d, 0.0, 0.0), **bar(2.0, la / 2, 0.15)),  # type: ignore[arg-type]
        )
    )
    rows: Ratios = ({0: 1.0}, {0: -1.0, 2: 1.0}, {2: 1.0}, {0: 1.0, 2: -1.0})
    worst = Worst("a parallelogram against its closed form")
    for _ in range(20):
        a, b, va, vb, ta, tb = rng.normal(size=6)
        q, qd = ([x, y - x, y, x - y] for x, y in ((a, b), (va, vb)))
        solved = solve_coupled(tree, rows, q=q, qd=qd, tau=(ta, 0.0, tb, 0.0), gravity=(0.0, -9.81, 0.0))
        A = 0.6 + 8.0 * 0.4**2 + 0.15 + 2.0 * la**2 / 4.0 + 4.0 * la**2
        B = 0.05 + 3.0 * 0.1**2 + 0.3 + 4.0 * 0.3**2 + 2.0 * d * d
        C = 4.0 * la * 0.3 - 2.0 * la / 2.0 * d
        M = np.array([[A, C * math.cos(a - b)], [C * math.cos(a - b), B]])
        h = np.array([C * math.sin(a - b) * vb * vb, -C * math.sin(a - b) * va * va])
        g = 9.81 * np.array([(3.2 + la + 4.0 * la) * math.cos(a), (-0.3 - 2.0 * d + 1.2) * math.cos(b)])
        expected = np.linalg.solve(M, np.array([ta, tb]) - h - g)
        worst.see(float(np.abs(np.array(solved.qdd)[[0, 2]] - expected).max() / np.abs(expected).max()), "")
    worst.below(1e-13)


def test_a_recorded_pass_with_masks_gives_the_numbers_of_a_plain_one() -> None:
    arm = random_tree(77, 7)
    rows, _ = grouped(arm)
    graph = Graph()
    named = {f"{name}{i}": x for name in ("q", "qd", "tau", "s") for i, x in
             enumerate(arm.mode if name == "s" else getattr(arm, name))}  # fmt: skip
    traced = {name: graph.input(name) for name in named}
    part = {name: tuple(traced[f"{name}{i}"] for i in range(arm.n)) for name in ("q", "qd", "tau", "s")}
    mode = tuple(x != 0.0 for x in part.pop("s"))
    solved = ours(arm, rows, mode, **part)  # type: ignore[arg-type]
    results = (*solved.qdd, *solved.tau, *solved.tau_load)
    found = Formulas.of(graph, results).replay({name: float(x) for name, x in named.items()})
    plain = ours(arm, rows, arm.mode)
    np.testing.assert_allclose(found, (*plain.qdd, *plain.tau, *plain.tau_load), rtol=1e-10, atol=1e-10)


@pytest.mark.oracle
def test_accelerations_are_those_of_pinocchios_mimic_joints() -> None:
    """By its mass matrix, and by the torques that it needs for ours; it has no forward dynamics of mimic joints.

    The matrix is that of its rnea, column by column: in one of these trees, 53, its crba differs from that by 0.3 %.
    """
    from tests.met.dynamics.test_linearised import depth_first
    from tests.oracles.pinocchio_tree import PinocchioTree, pin

    worst, needed = Worst("qdd against M of Pinocchio"), Worst("torques by Pinocchio's rnea for these")
    for seed in range(60):
        arm = random_tree(seed, 3 + seed % 8)
        bodies, rng = depth_first(arm.bodies), np.random.default_rng(seed)
        names = [body.joint for body in bodies if body.kind != "fixed"]
        ours_at = {name: i for i, name in enumerate(body.joint for body in arm.bodies if body.kind != "fixed")}
        leader, follower = sorted(int(i) for i in rng.permutation(arm.n)[:2])
        a, b, ratio = ours_at[names[leader]], ours_at[names[follower]], float(rng.uniform(-3.0, 3.0))
        rows: list[dict[int, float]] = [{} for _ in range(arm.n)]
        rows[a], rows[b] = {a: 1.0}, {a: ratio}
        q, qd = list(arm.q), list(arm.qd)
        q[b], qd[b] = ratio * q[a], ratio * qd[a]
        solved = solve_coupled(Tree.build(arm.bodies), tuple(rows), q=q, qd=qd, tau=arm.tau, gravity=arm.gravity)
        model = PinocchioTree(bodies, arm.gravity, (0.0,) * arm.n).model
        ids = [model.getJointId(names[i]) for i in (leader, follower)]
        model = pin.transformJointIntoMimic(model, *ids, ratio, 0.0)
        at = {ours_at[name]: model.joints[model.getJointId(name)] for name in names if ours_at[name] != b}
        Q, V, A, T = np.zeros(model.nq), np.zeros(model.nv), np.zeros(model.nv), np.zeros(model.nv)
        for i, joint in at.items():
            Q[joint.idx_q], V[joint.idx_v], A[joint.idx_v] = q[i], qd[i], solved.qdd[i]
            T[joint.idx_v] = arm.tau[i] + ratio * arm.tau[b] * (i == a)
        data = model.createData()
        still = np.zeros(model.nv)
        rest, weight = pin.rnea(model, data, Q, V, still), pin.rnea(model, data, Q, still, still)
        M = np.array([pin.rnea(model, data, Q, still, unit) - weight for unit in np.eye(model.nv)]).T
        expected = np.linalg.solve(M, T - rest)
        worst.see(float(np.abs(expected - A).max() / np.abs(expected).max()), f"seed {seed}")
        needed.see(float(np.abs(pin.rnea(model, data, Q, V, A) - T).max() / np.abs(T).max()), f"seed {seed}")
    worst.below(1e-12)
    needed.below(1e-12)
