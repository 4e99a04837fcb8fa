"""How accelerations move with an arm's state: the closed form against Pinocchio's, and against the recorded recursion
differentiated operation by operation, which knows none of its formulas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from met.dynamics.linearised import LinearisedDynamics, linearised, tell
from met.dynamics.recursion import Solved, solve
from met.dynamics.tree import Body, Tree
from met.trace.derivative import KnownTangents, slopes
from met.trace.fuse import fused
from met.trace.graph import Formulas, Graph
from met.trace.nodes import live
from met.trace.scalar import Scalar
from tests.met.dynamics.passes import forest, passed
from tests.met.dynamics.test_dynamics_traced import Recorder, panda_like, tree_of_thirty
from tests.oracles.pinocchio_tree import PinocchioTree
from tests.oracles.random_tree import RandomArm, random_tree
from tests.oracles.worst import Worst, relative

CLOSE = 1e-9
"""Share of the largest entry of a matrix: inverses of mass matrices of up to thirty joints and light links lose some
five digits, ours and theirs; measured worst 1.3e-11."""

Moves = Sequence[Sequence[float]]


def unit_moves(n: int, parts: int) -> list[Moves]:
    """Moves of one number alone, each of `parts` vectors of n."""
    return [tuple(tuple(map(float, row)) for row in one) for one in np.eye(n * parts).reshape(-1, parts, n)]


def jacobian(of: LinearisedDynamics, parts: int = 4) -> np.ndarray:
    """[(qdd, tau_load), (q, qd, tau, qdd given)]"""
    n = len(of.tree.joints)
    moves = [(*move, *[(0.0,) * n] * (4 - parts)) for move in unit_moves(n, parts)]
    return np.array([[x for part in of.along(*move) for x in part] for move in moves]).T


@pytest.mark.oracle
def test_accelerations_move_as_pinocchio_says() -> None:
    worst = Worst("d qdd / d(q, qd, tau) against computeABADerivatives, share of the largest entry")
    for arm, tree in forest():
        ours = jacobian(linearised(tree, arm.qd, passed(arm, True, tree)), 3)[: arm.n]
        bodies = depth_first(arm.bodies)
        names = [joint.name for joint in tree.joints]
        places = [names.index(body.joint) for body in bodies if body.kind != "fixed"]
        q, qd, tau, rotor = (tuple(x[i] for i in places) for x in (arm.q, arm.qd, arm.tau, arm.rotor))
        theirs = PinocchioTree(bodies, arm.gravity, rotor).acceleration_slopes(q, qd, tau, arm.wrenches)
        for some, other in zip(np.split(ours, 3, axis=1), theirs, strict=True):
            # of a single joint the rates move nothing, and rounding remains: so a part is held against all as well
            size = max(np.abs(other).max(), 1e-6 * np.abs(ours).max())
            worst.see(np.abs(some[np.ix_(places, places)] - other).max() / size, f"seed {arm.seed}, {arm.n} joints")
    worst.below(CLOSE)


@pytest.mark.oracle
@pytest.mark.parametrize("joints", [40, 60])
def test_rounding_does_not_grow_along_a_chain(joints: int) -> None:
    """Of rods alike, without rotors: the random trees branch early, and none is so deep."""
    bodies = tuple(
        Body(
            f"rod{i}", f"hinge{i}", "revolute", i - 1, at=(0.5, 0.0, 0.0) if i else (0.0, 0.0, 0.0),
            mass=1.0, com=(0.25, 0.0, 0.0), inertia=(0.0, 0.02, 0.02, 0.0, 0.0, 0.0),
        )
        for i in range(joints)
    )  # fmt: skip
    gravity, still = (0.0, -9.81, 0.0), (0.0,) * joints
    q, qd = (tuple(first - step * (i % 4) for i in range(joints)) for first, step in ((0.3, 0.4), (0.5, 0.3)))
    tree = Tree.build(bodies)
    ours = jacobian(linearised(tree, qd, solve(tree, q, qd, gravity=gravity)), 3)[:joints]
    theirs = PinocchioTree(bodies, gravity, still).acceleration_slopes(q, qd, still, {})
    for some, other in zip(np.split(ours, 3, axis=1), theirs, strict=True):
        np.testing.assert_allclose(some, other, rtol=0, atol=CLOSE * np.abs(other).max())


def test_a_result_that_two_passes_share_moves_the_others_of_the_second_with_what_that_was_given() -> None:
    """Of two joints on branches of their own, of which the second pass gives one another torque, by what the first one
    found: the same nodes of a graph are what the other joint does in both."""
    bodies = tuple(
        Body(f"rod{i}", f"hinge{i}", "revolute", -1, axis=(0.0, 1.0, 0.0), mass=1.0, com=(0.3, 0.0, 0.0),
             inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0)) for i in range(2)
    )  # fmt: skip
    tree, graph = Tree.build(bodies), Graph()
    values = {"q0": 0.3, "q1": 0.5, "tau0": 0.1, "tau1": 0.7}
    q, tau = (tuple(graph.input(f"{name}{i}") for i in range(2)) for name in ("q", "tau"))

    def passed_with(tau: tuple[Scalar, Scalar]) -> Solved:
        given: dict[str, Any] = {
            "q": q, "qd": (0.0, 0.0), "tau": tau, "qdd": (0.0, 0.0), "mode": (True, True), "rotor": (0.0, 0.0),
            "gravity": (0.0, 0.0, -9.81), "wrenches": {}, "velocity_products": True,
        }  # fmt: skip
        found = solve(tree, **given)
        tell(tree, given, found)
        return found

    first = passed_with(tau)
    second = passed_with((tau[0], tau[1] - 0.5 * first.qdd[1]))
    results = [Scalar(graph, scalar(Recorder(), x)) for x in second.qdd]
    assert results[0].ref == scalar(Recorder(), first.qdd[0])
    order = graph.live([each.ref for each in results])
    for name in values:
        moved = [
            slopes(graph, order, lambda node, name=name: graph.constant(float(node == ("input", name))), known=known)
            for known in (None, KnownTangents(graph, graph.known))
        ]
        alike = [Scalar(graph, each[x.ref >> 1] ^ (x.ref & 1)) for each in moved for x in results]
        by_operation, told = np.reshape(Formulas.of(graph, alike).replay(values), (2, 2))
        np.testing.assert_allclose(told, by_operation, rtol=1e-13)


def depth_first(bodies: Sequence[Body]) -> tuple[Body, ...]:
    """The bodies so that each subtree is in one piece, as Pinocchio's derivatives silently take for granted."""
    found: list[Body] = []

    def visit(number: int, parent: int) -> None:
        found.append(replace(bodies[number], parent=parent))
        own = len(found) - 1
        for other, body in enumerate(bodies):
            if body.parent == number:
                visit(other, own)

    for number, body in enumerate(bodies):
        if body.parent < 0:
            visit(number, -1)
    return tuple(found)


def of_the_record(arm: RandomArm, tree: Tree, mode: Any) -> np.ndarray:
    """The Jacobian of the recorded recursion, operation by operation: as `jacobian`, then by each link's wrench."""
    record = Recorder()
    given = [record.many(name, getattr(arm, name)) for name in ("q", "qd", "tau", "qdd")]
    wrenches = {
        name: tuple(record.many(f"{name}.{k}", part) for k, part in enumerate(wrench))
        for name, wrench in arm.wrenches.items()
    }
    q, qd, tau, qdd = given
    found = solve(
        tree, q, qd, tau=tau, qdd=qdd, mode=mode, rotor=arm.rotor, gravity=arm.gravity, wrenches=wrenches
    )  # fmt: skip
    results = [Scalar(record.graph, scalar(record, x)) for x in (*found.qdd, *found.tau_load)]
    order = record.graph.live([each.ref for each in results])
    rows = []
    for name in record.values:
        moved = slopes(record.graph, order, lambda node, name=name: record.graph.constant(float(node[1] == name)))
        rows.append([Scalar(record.graph, moved[each.ref >> 1] ^ (each.ref & 1)) for each in results])
    flat = Formulas.of(record.graph, [each for row in rows for each in row]).replay(record.values)
    return np.array(flat).reshape(len(rows), len(results)).T


def scalar(record: Recorder, x: Any) -> int:
    return x.ref if isinstance(x, Scalar) else record.graph.constant(x)


def by_wrenches(arm: RandomArm, of: LinearisedDynamics) -> np.ndarray:
    still = (0.0,) * arm.n
    rows = []
    for name in arm.wrenches:
        for e in np.eye(6):
            move = {name: (tuple(map(float, e[:3])), tuple(map(float, e[3:])))}
            rows.append([x for part in of.along(still, still, still, still, move) for x in part])
    return np.array(rows).reshape(-1, 2 * arm.n).T


@pytest.mark.release
@pytest.mark.parametrize("joints", range(1, 8))
def test_any_modes_and_wrenches_move_as_the_recorded_recursion_does(joints: int) -> None:
    worst = Worst("qdd and tau_load by all that is given, share of the largest entry")
    for seed in range(6):
        arm = random_tree(700 + seed, joints)
        tree = Tree.build(arm.bodies)
        for mode in (False, arm.mode):
            of = linearised(tree, arm.qd, passed(arm, mode, tree))
            ours = np.hstack([jacobian(of), by_wrenches(arm, of)])
            worst.see(relative(ours, of_the_record(arm, tree, mode)), f"seed {arm.seed}, {mode}")
    worst.below(CLOSE)


@pytest.mark.release
def test_modes_decided_when_the_program_runs_give_what_modes_decided_before_do() -> None:
    worst = Worst("masks against truths, share of the largest entry")
    for arm, tree in forest()[:12]:
        record = Recorder()
        q, qd, tau, qdd = (record.many(name, getattr(arm, name)) for name in ("q", "qd", "tau", "qdd"))
        modes = record.many("mode", [float(mode) for mode in arm.mode])
        found = solve(
            tree, q, qd, tau=tau, qdd=qdd, mode=[mode > 0.5 for mode in modes], rotor=arm.rotor, gravity=arm.gravity,
            wrenches=arm.wrenches,
        )  # fmt: skip
        of = linearised(tree, qd, found)
        entries = [x for move in unit_moves(arm.n, 4) for part in of.along(*move) for x in part]
        recorded = [Scalar(record.graph, scalar(record, x)) for x in entries]
        masked = np.reshape(record.replayed(recorded), (4 * arm.n, 2 * arm.n)).T
        worst.see(relative(masked, jacobian(linearised(tree, arm.qd, passed(arm, arm.mode, tree)))), f"seed {arm.seed}")
    worst.below(CLOSE)


@pytest.mark.slow
def test_without_velocity_products_rates_move_nothing() -> None:
    for arm, tree in forest()[:30]:
        found = passed(arm, True, tree, velocity_products=False)
        of = jacobian(linearised(tree, (0.0,) * arm.n, found))
        assert not of[: arm.n, arm.n : 2 * arm.n].any()
        slow = passed(arm, True, tree, velocity_products=True)
        assert arm.n < 3 or jacobian(linearised(tree, arm.qd, slow))[: arm.n, arm.n : 2 * arm.n].any()


@pytest.mark.slow
def test_joints_on_different_branches_have_no_entry() -> None:
    for arm, tree in forest()[:60]:
        of = linearised(tree, arm.qd, passed(arm, True, tree))

        def related(i: int, j: int, tree: Tree = tree) -> bool:
            def inboard(k: int, other: int) -> bool:
                while k >= 0 and k != other:
                    k = tree.joints[k].parent
                return k == other

            return inboard(i, j) or inboard(j, i)

        pairs = {(i, j) for i in range(arm.n) for j in range(arm.n) if related(i, j)}
        assert set(of.by_q) == set(of.by_qd) == pairs


def operations(bodies: Sequence[Body]) -> tuple[int, int]:
    """Operations of an evaluation with a rotor at each joint, and of one with its whole Jacobian."""
    record = Recorder()
    n = len(bodies)
    q, qd, tau = (record.many(name, (0.0,) * n) for name in ("q", "qd", "tau"))
    tree = Tree.build(bodies)
    found: Solved = solve(tree, q, qd, tau=tau, rotor=[0.3] * n, gravity=(0.0, 0.0, -9.81))
    of = linearised(tree, qd, found)
    entries = [x for move in unit_moves(n, 3) for x in of.along(*move, (0.0,) * n)[0] if isinstance(x, Scalar)]

    def count(outputs: Sequence[Any]) -> int:
        roots = [x.ref for x in outputs]
        nodes = fused(record.graph.nodes, roots)
        return sum(nodes[i][0] not in ("const", "input") for i in live(nodes, roots))

    return count(found.qdd), count([*found.qdd, *entries])


# Counted when it was written, beside 1,237 and 6,872 of the evaluation alone; by operation of the recursion, one
# direction after the other, the seven joints' took 10,100 without tau.
@pytest.mark.slow
@pytest.mark.parametrize(("arm", "at_most"), [(panda_like, 3_840), (tree_of_thirty, 50_700)])
def test_a_whole_jacobian_costs_no_more_operations_than_it_did(arm: Any, at_most: int) -> None:
    alone, whole = operations(arm())
    assert alone < whole <= at_most
