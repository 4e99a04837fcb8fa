"""What must hold of the recursion by itself, whatever the arm: docs/physics.md, section 9."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from met.dynamics.recursion import reactions, solve
from met.dynamics.tree import Body, Tree
from tests.met.dynamics.passes import CLOSE, forest, passed, pinocchio, stand
from tests.oracles.dense import DenseArm, rotation
from tests.oracles.random_tree import RandomArm, random_tree
from tests.oracles.two_link_lagrange import Rods, mass_matrix, velocity_torque
from tests.oracles.worst import Worst, relative


@pytest.mark.release
@pytest.mark.oracle
def test_qdd_given_back_in_acceleration_mode_returns_the_same_motion_and_torques() -> None:
    motion, torques = Worst("qdd given back: qdd"), Worst("qdd given back: tau")
    for arm, tree in forest():
        free = passed(arm, True, tree)
        # tau comes from terms as large as the inertia's and the bias torques, which may cancel.
        bias = pinocchio(arm).torques(arm.q, arm.qd, np.zeros(arm.n), arm.wrenches)
        size = max(np.max(np.abs(bias)), np.max(np.abs(free.tau)))
        random = np.random.default_rng(arm.seed)
        subsets = [random.random(arm.n) < share for share in (0.2, 0.5, 0.8)]
        for subset in [*subsets, np.zeros(arm.n, bool)]:
            back = passed(arm, tuple(map(bool, subset)), tree, qdd=free.qdd)
            motion.see(relative(back.qdd, free.qdd), f"seed {arm.seed}")
            torques.see(np.max(np.abs(np.subtract(back.tau, free.tau))) / size, f"seed {arm.seed}")
    motion.below(CLOSE)
    torques.below(CLOSE)


@pytest.mark.release
def test_renumbering_branches_changes_nothing_beyond_rounding() -> None:
    motion, torques = Worst("renumbered: qdd"), Worst("renumbered: tau")
    for arm, tree in forest():
        # Any order will do, children before parents even: parents are named by number.
        order = list(np.random.default_rng(arm.seed).permutation(len(arm.bodies)))
        number = {int(b): k for k, b in enumerate(order)}
        shuffled = [replace(arm.bodies[b], parent=number.get(arm.bodies[b].parent, -1)) for b in order]
        names = [body.joint for body in arm.bodies if body.kind != "fixed"]
        ours, before = passed(arm, arm.mode, Tree.build(shuffled, names)), passed(arm, arm.mode, tree)
        motion.see(relative(ours.qdd, before.qdd), f"seed {arm.seed}")
        torques.see(relative(ours.tau, before.tau), f"seed {arm.seed}")
    motion.below(CLOSE)
    torques.below(CLOSE)


@pytest.mark.release
def test_joints_are_given_back_in_the_order_asked_for() -> None:
    for arm, tree in forest():
        turned = [body.joint for body in arm.bodies if body.kind != "fixed"][::-1]
        back = {key: getattr(arm, key)[::-1] for key in ("q", "qd", "tau", "qdd", "mode", "rotor")}
        reverse = Tree.build(arm.bodies, turned)
        assert [joint.name for joint in reverse.joints] == turned
        ours = passed(replace(arm, **back), back["mode"], reverse)
        assert ours.qdd[::-1] == passed(arm, arm.mode, tree).qdd, f"seed {arm.seed}"


@pytest.mark.release
def test_cutting_a_link_in_two_at_a_fixed_joint_changes_nothing_beyond_rounding() -> None:
    motion, torques, borne = Worst("cut: qdd"), Worst("cut: tau"), Worst("cut: reactions")
    for arm, tree in forest():
        bodies = _cut(arm, int(np.random.default_rng(arm.seed).integers(len(arm.bodies))))
        other = Tree.build(bodies)
        ours, before = passed(arm, arm.mode, other), passed(arm, arm.mode, tree)
        motion.see(relative(ours.qdd, before.qdd), f"seed {arm.seed}")
        torques.see(relative(ours.tau, before.tau), f"seed {arm.seed}")
        for i, (now, then) in enumerate(zip(reactions(other, ours), reactions(tree, before), strict=True)):
            borne.see(relative(np.concatenate(now), np.concatenate(then)), f"seed {arm.seed}, joint {i}")
    motion.below(CLOSE)
    torques.below(CLOSE)
    borne.below(CLOSE)


def test_without_velocity_products_an_arm_moves_as_one_at_rest() -> None:
    arm = random_tree(5, 6)
    tree = Tree.build(arm.bodies)
    without = passed(arm, arm.mode, tree, velocity_products=False)
    still = passed(replace(arm, qd=(0.0,) * arm.n), arm.mode, tree)
    assert (without.qdd, without.tau) == (still.qdd, still.tau)
    assert relative(passed(arm, arm.mode, tree).qdd, still.qdd) > 1e-3


@pytest.mark.slow
def test_momentum_changes_by_gravity_wrenches_and_what_the_base_gives() -> None:
    worst = Worst("d(momentum)/dt against the external wrench")
    for plain, _ in forest():
        arm = _without_ground(plain)
        tree = Tree.build(arm.bodies)
        ours = passed(arm, arm.mode, tree)
        dense = DenseArm(arm.bodies, arm.gravity, arm.rotor, arm.wrenches)
        links = dense.links(arm.q, arm.qd, ours.qdd)
        carried = {body.joint: link for body, link in zip(arm.bodies, links, strict=True)}
        given = np.concatenate(dense.applied(arm.q))
        for i, (moment, force) in enumerate(reactions(tree, ours)):
            if tree.joints[i].parent < 0:
                link = carried[tree.joints[i].name]
                pushed = link.R @ np.array(force)
                given += np.concatenate([link.R @ np.array(moment) + np.cross(link.p, pushed), pushed])
        rate = np.concatenate(dense.momentum_rate(arm.q, arm.qd, ours.qdd))
        worst.see(relative(rate, given), f"seed {arm.seed}")
    worst.below(CLOSE)


@pytest.mark.slow
def test_a_base_that_accelerates_is_a_gravity_that_points_back() -> None:
    for arm, tree in forest():
        up = tuple(-x for x in arm.gravity)
        ours = passed(arm, arm.mode, tree, gravity=(0.0, 0.0, 0.0), base_acceleration=((0.0, 0.0, 0.0), up))
        assert ours.qdd == passed(arm, arm.mode, tree).qdd, f"seed {arm.seed}"


@pytest.mark.release
def test_a_base_that_moves_is_six_more_joints_in_acceleration_mode() -> None:
    motion, torques, borne = Worst("moving base: qdd"), Worst("moving base: tau"), Worst("moving base: reactions")
    for arm, tree in forest():
        random = np.random.default_rng(arm.seed)
        at, rate, push = (tuple(map(float, random.standard_normal(6))) for _ in range(3))
        bearing = stand()
        platform = DenseArm(bearing).links(at, rate, push)[-1]
        bodies = [*bearing, *(replace(body, parent=body.parent + 6) for body in arm.bodies)]
        none = (0.0,) * 6
        added = replace(
            arm, q=at + arm.q, qd=rate + arm.qd, qdd=push + arm.qdd, tau=none + arm.tau, rotor=none + arm.rotor
        )
        standing = Tree.build(bodies)
        carried = passed(added, (False,) * 6 + arm.mode, standing)

        def own(vector: np.ndarray, R: np.ndarray = platform.R) -> tuple[float, ...]:
            return tuple(map(float, R.T @ vector))

        ours = passed(
            arm,
            arm.mode,
            tree,
            gravity=own(np.array(arm.gravity)),
            base_rate=own(platform.w),
            base_acceleration=(own(platform.wd), own(platform.a)),
        )
        motion.see(relative(ours.qdd, carried.qdd[6:]), f"seed {arm.seed}")
        torques.see(relative(ours.tau, carried.tau[6:]), f"seed {arm.seed}")
        for i, (now, then) in enumerate(zip(reactions(tree, ours), reactions(standing, carried)[6:], strict=True)):
            borne.see(relative(np.concatenate(now), np.concatenate(then)), f"seed {arm.seed}, joint {i}")
    motion.below(CLOSE)
    torques.below(CLOSE)
    borne.below(CLOSE)


@pytest.mark.parametrize("q2", [-2.5, 0.0, 0.4, math.pi / 2])
def test_planar_two_link_arm_obeys_lagrange(q2: float) -> None:
    rods = Rods()
    inertia = tuple(m * length**2 / 12.0 for m, length in ((rods.mass_1, rods.length_1), (rods.mass_2, rods.length_2)))
    bodies = [
        Body(
            "upper",
            "one",
            "revolute",
            -1,
            mass=rods.mass_1,
            com=(rods.length_1 / 2, 0.0, 0.0),
            inertia=(0.0, inertia[0], inertia[0], 0.0, 0.0, 0.0),
        ),
        Body(
            "lower",
            "two",
            "revolute",
            0,
            at=(rods.length_1, 0.0, 0.0),
            mass=rods.mass_2,
            com=(rods.length_2 / 2, 0.0, 0.0),
            inertia=(0.0, inertia[1], inertia[1], 0.0, 0.0, 0.0),
        ),
    ]
    qd, tau, rotor = np.array([0.8, -1.3]), np.array([5.0, -2.0]), np.array([157.26, 157.26])
    expected = np.linalg.solve(mass_matrix(rods, q2) + np.diag(rotor), tau - velocity_torque(rods, q2, qd))
    ours = solve(Tree.build(bodies), (0.3, q2), tuple(qd), tau=tuple(tau), rotor=tuple(rotor))
    # Two by two and well conditioned: some tens of roundings.
    assert relative(ours.qdd, expected) < 1e-13


def _cut(arm: RandomArm, cut: int) -> list[Body]:
    """The bodies with all matter of one moved to a new one behind a fixed joint, described in the new one's frame."""
    random = np.random.default_rng(1000 + arm.seed)
    whole = arm.bodies[cut]
    at, rpy = tuple(map(float, random.standard_normal(3))), tuple(map(float, random.uniform(-3.0, 3.0, 3)))
    x, y, z = np.eye(3)
    R = rotation(z, rpy[2]) @ rotation(y, rpy[1]) @ rotation(x, rpy[0])
    xx, yy, zz, xy, xz, yz = whole.inertia
    J = R.T @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R
    entries = tuple(float(J[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    com = tuple(map(float, R.T @ (np.array(whole.com) - np.array(at))))
    rest = Body("rest", "cut", "fixed", cut, at, rpy, mass=whole.mass, com=com, inertia=entries)
    bodies = [*arm.bodies, rest]
    bodies[cut] = replace(whole, mass=0.0, com=(0.0, 0.0, 0.0), inertia=(0.0,) * 6)
    return bodies


def _without_ground(arm: RandomArm) -> RandomArm:
    """The arm with links fixed to the base made weightless and free of wrenches: what they bear is the base's."""
    ground: set[int] = {-1}
    for b, body in enumerate(arm.bodies):
        if body.kind == "fixed" and body.parent in ground:
            ground.add(b)
    bodies = tuple(replace(body, mass=0.0) if b in ground else body for b, body in enumerate(arm.bodies))
    names = {arm.bodies[b].name for b in ground if b >= 0}
    return replace(arm, bodies=bodies, wrenches={k: v for k, v in arm.wrenches.items() if k not in names})
