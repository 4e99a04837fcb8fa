"""The recursion against Pinocchio, against linear algebra, and against what must hold of itself."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from met.dynamics.recursion import Solved, reactions, solve
from met.dynamics.tree import Body, Tree
from tests.oracles.dense import DenseArm, mixed
from tests.oracles.pinocchio_tree import PinocchioTree
from tests.oracles.random_tree import RandomArm, random_tree
from tests.oracles.two_link_lagrange import Rods, mass_matrix, velocity_torque

SEEDS = range(50)

# Both sides round at 1e-16; up to 12 joints, with an inertia matrix whose entries span some four decades, cost three
# to four digits more. Measured worst over 700 seeds: 1e-13.
CLOSE = 1e-11


def relative(ours: object, theirs: object) -> float:
    """Largest difference as a share of the largest entry."""
    a, b = np.asarray(ours, float), np.asarray(theirs, float)
    return float(np.max(np.abs(a - b)) / max(np.max(np.abs(b)), 1e-300))


def solved(arm: RandomArm, mode: object, **changed: object) -> Solved:
    tree = changed.pop("tree", None) or Tree.build(arm.bodies)
    given = {"tau": arm.tau, "qdd": arm.qdd, "rotor": arm.rotor, "gravity": arm.gravity, "wrenches": arm.wrenches}
    return solve(tree, arm.q, arm.qd, mode=mode, **{**given, **changed})


def pinocchio(arm: RandomArm) -> PinocchioTree:
    return PinocchioTree(arm.bodies, arm.gravity, arm.rotor)


@pytest.mark.parametrize("seed", SEEDS)
def test_accelerations_agree_with_pinocchio(seed: int) -> None:
    arm = random_tree(seed)
    theirs = pinocchio(arm).accelerations(arm.q, arm.qd, arm.tau, arm.wrenches)
    assert relative(solved(arm, True).qdd, theirs) < CLOSE, f"seed {seed}"


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
        assert relative(solved(arm, True).qdd, expected) < CLOSE, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_torques_agree_with_pinocchio(seed: int) -> None:
    arm = random_tree(seed)
    theirs = pinocchio(arm).torques(arm.q, arm.qd, arm.qdd, arm.wrenches)
    assert relative(solved(arm, False).tau, theirs) < CLOSE, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_mixed_modes_are_consistent_with_inverse_dynamics(seed: int) -> None:
    arm = random_tree(seed)
    ours = solved(arm, arm.mode)
    theirs = pinocchio(arm).torques(arm.q, arm.qd, ours.qdd, arm.wrenches)
    assert relative(ours.tau, theirs) < CLOSE, f"seed {seed}"
    for i in range(arm.n):
        assert (ours.tau[i] == arm.tau[i]) if arm.mode[i] else (ours.qdd[i] == arm.qdd[i]), f"seed {seed}, joint {i}"


@pytest.mark.parametrize("seed", SEEDS)
def test_mixed_modes_agree_with_linear_algebra(seed: int) -> None:
    arm = random_tree(seed)
    dense = DenseArm(arm.bodies, arm.gravity, arm.rotor, arm.wrenches)
    M, h = dense.mass_matrix(arm.q), dense.bias(arm.q, arm.qd)
    qdd, tau = mixed(M, h, np.array(arm.tau), np.array(arm.qdd), arm.mode)
    ours = solved(arm, arm.mode)
    # Unit accelerations leave M with the rounding of h, a hundred times larger here than M's own.
    assert relative(ours.qdd, qdd) < 1e-10, f"seed {seed}"
    assert relative(ours.tau, tau) < 1e-10, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_qdd_given_back_in_acceleration_mode_returns_the_same_motion_and_torques(seed: int) -> None:
    arm = random_tree(seed)
    free = solved(arm, True)
    subset = tuple(bool(x) for x in np.random.default_rng(seed).random(arm.n) < 0.5)
    back = solved(arm, subset, qdd=free.qdd)
    assert relative(back.qdd, free.qdd) < CLOSE, f"seed {seed}"
    scale = pinocchio(arm).torques(arm.q, arm.qd, np.zeros(arm.n), arm.wrenches)
    # tau comes from terms as large as the bias torques, which may cancel.
    assert np.max(np.abs(np.subtract(back.tau, free.tau))) < CLOSE * max(np.max(np.abs(scale)), 10.0), f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_tau_load_is_tau_less_the_rotors_share(seed: int) -> None:
    arm = random_tree(seed)
    ours = solved(arm, arm.mode)
    bare = PinocchioTree(arm.bodies, arm.gravity, [0.0] * arm.n)
    assert relative(ours.tau_load, bare.torques(arm.q, arm.qd, ours.qdd, arm.wrenches)) < CLOSE, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_without_velocity_products_only_rates_in_the_equation_of_motion_are_gone(seed: int) -> None:
    arm = random_tree(seed)
    ours = solved(arm, arm.mode, velocity_products=False)
    theirs = pinocchio(arm).torques(arm.q, np.zeros(arm.n), ours.qdd, arm.wrenches)
    assert relative(ours.tau, theirs) < CLOSE, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_reactions_agree_with_pinocchio_in_the_links_own_frames(seed: int) -> None:
    arm = random_tree(seed)
    tree = Tree.build(arm.bodies)
    ours = solved(arm, arm.mode, tree=tree)
    theirs = pinocchio(arm)
    for i, (moment, force) in enumerate(reactions(tree, ours)):
        expected = np.concatenate(theirs.reaction(arm.q, arm.qd, ours.qdd, arm.wrenches, tree.joints[i].name))
        assert relative((*moment, *force), expected) < CLOSE, f"seed {seed}, joint {i}"
        body = next(body for body in arm.bodies if body.joint == tree.joints[i].name)
        along = np.dot(body.axis, moment if body.kind == "revolute" else force)
        assert abs(along - ours.tau_load[i]) < CLOSE * np.max(np.abs(expected)), f"seed {seed}, joint {i}"


@pytest.mark.parametrize("seed", SEEDS)
def test_renumbering_branches_changes_nothing_beyond_rounding(seed: int) -> None:
    arm = random_tree(seed)
    # Any order will do, children before parents even: parents are named by number.
    order = list(np.random.default_rng(seed).permutation(len(arm.bodies)))
    number = {int(b): k for k, b in enumerate(order)}
    shuffled = [replace(arm.bodies[b], parent=number.get(arm.bodies[b].parent, -1)) for b in order]
    names = [body.joint for body in arm.bodies if body.kind != "fixed"]
    ours = solved(arm, arm.mode, tree=Tree.build(shuffled, names))
    before = solved(arm, arm.mode)
    assert relative(ours.qdd, before.qdd) < CLOSE, f"seed {seed}"
    assert relative(ours.tau, before.tau) < CLOSE, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_joints_are_given_back_in_the_order_asked_for(seed: int) -> None:
    arm = random_tree(seed)
    names = [body.joint for body in arm.bodies if body.kind != "fixed"]
    turned = list(reversed(names))
    tree = Tree.build(arm.bodies, turned)
    assert [joint.name for joint in tree.joints] == turned
    back = {key: tuple(reversed(getattr(arm, key))) for key in ("q", "qd", "tau", "qdd", "mode", "rotor")}
    ours = solved(replace(arm, **back), back["mode"], tree=tree)
    assert relative(ours.qdd[::-1], solved(arm, arm.mode).qdd) < CLOSE, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_cutting_a_link_in_two_at_a_fixed_joint_changes_nothing_beyond_rounding(seed: int) -> None:
    arm = random_tree(seed)
    rng = np.random.default_rng(1000 + seed)
    cut = int(rng.integers(len(arm.bodies)))
    whole = arm.bodies[cut]
    at, rpy = tuple(map(float, rng.standard_normal(3))), tuple(map(float, rng.uniform(-3.0, 3.0, 3)))
    # All matter of the link goes to a new one behind a fixed joint, described in the new one's frame.
    R = _rotation(*rpy)
    xx, yy, zz, xy, xz, yz = whole.inertia
    J = R.T @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R
    entries = tuple(float(J[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    com = tuple(float(x) for x in R.T @ (np.array(whole.com) - np.array(at)))
    rest = Body("rest", "cut", "fixed", cut, at, rpy, mass=whole.mass, com=com, inertia=entries)
    bodies = [*arm.bodies, rest]
    bodies[cut] = replace(whole, mass=0.0, com=(0.0, 0.0, 0.0), inertia=(0.0,) * 6)
    ours = solved(arm, arm.mode, tree=Tree.build(bodies))
    before = solved(arm, arm.mode)
    assert relative(ours.qdd, before.qdd) < CLOSE, f"seed {seed}, cut {cut}"
    assert relative(ours.tau, before.tau) < CLOSE, f"seed {seed}, cut {cut}"


@pytest.mark.parametrize("seed", SEEDS)
def test_momentum_changes_by_gravity_wrenches_and_what_the_base_gives(seed: int) -> None:
    arm = random_tree(seed)
    arm = _without_ground(arm)
    tree = Tree.build(arm.bodies)
    ours = solved(arm, arm.mode, tree=tree)
    dense = DenseArm(arm.bodies, arm.gravity, arm.rotor, arm.wrenches)
    links = dense.links(arm.q, arm.qd, ours.qdd)
    given = np.concatenate(dense.applied(arm.q))
    for i, (moment, force) in enumerate(reactions(tree, ours)):
        if tree.joints[i].parent < 0:
            link = links[next(b for b, body in enumerate(arm.bodies) if body.joint == tree.joints[i].name)]
            pushed = link.R @ np.array(force)
            given += np.concatenate([link.R @ np.array(moment) + np.cross(link.p, pushed), pushed])
    rate = np.concatenate(dense.momentum_rate(arm.q, arm.qd, ours.qdd))
    assert relative(rate, given) < CLOSE, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_a_base_that_accelerates_is_a_gravity_that_points_back(seed: int) -> None:
    arm = random_tree(seed)
    up = tuple(-x for x in arm.gravity)
    ours = solved(arm, arm.mode, gravity=(0.0, 0.0, 0.0), base_acceleration=((0.0, 0.0, 0.0), up))
    assert ours.qdd == solved(arm, arm.mode).qdd, f"seed {seed}"


@pytest.mark.parametrize("seed", SEEDS)
def test_a_base_that_turns_is_one_more_joint_in_acceleration_mode(seed: int) -> None:
    arm = random_tree(seed, kinds=("revolute", "prismatic"))
    w, wd = 0.7, -1.9
    axis = (0.6, 0.0, 0.8)
    turntable = Body("table", "turn", "revolute", -1, axis=axis)
    bodies = [turntable, *(replace(body, parent=body.parent + 1) for body in arm.bodies)]
    added = {"q": (0.0, *arm.q), "qd": (w, *arm.qd), "qdd": (wd, *arm.qdd), "tau": (0.0, *arm.tau),
             "rotor": (0.0, *arm.rotor)}
    carried = solved(replace(arm, **added), (False, *arm.mode), tree=Tree.build(bodies))
    ours = solved(arm, arm.mode, base_rate=tuple(w * x for x in axis),
                  base_acceleration=(tuple(wd * x for x in axis), (0.0, 0.0, 0.0)))
    assert relative(ours.qdd, carried.qdd[1:]) < CLOSE, f"seed {seed}"
    assert relative(ours.tau, carried.tau[1:]) < CLOSE, f"seed {seed}"


@pytest.mark.parametrize("q2", [-2.5, 0.0, 0.4, math.pi / 2])
def test_planar_two_link_arm_obeys_lagrange(q2: float) -> None:
    rods = Rods()
    inertia = tuple(m * length**2 / 12.0 for m, length in ((rods.mass_1, rods.length_1), (rods.mass_2, rods.length_2)))
    bodies = [
        Body("upper", "one", "revolute", -1, mass=rods.mass_1, com=(rods.length_1 / 2, 0.0, 0.0),
             inertia=(0.0, inertia[0], inertia[0], 0.0, 0.0, 0.0)),
        Body("lower", "two", "revolute", 0, at=(rods.length_1, 0.0, 0.0), mass=rods.mass_2,
             com=(rods.length_2 / 2, 0.0, 0.0), inertia=(0.0, inertia[1], inertia[1], 0.0, 0.0, 0.0)),
    ]
    qd, tau, rotor = np.array([0.8, -1.3]), np.array([5.0, -2.0]), np.array([157.26, 157.26])
    expected = np.linalg.solve(mass_matrix(rods, q2) + np.diag(rotor), tau - velocity_torque(rods, q2, qd))
    ours = solve(Tree.build(bodies), (0.3, q2), tuple(qd), tau=tuple(tau), rotor=tuple(rotor))
    # Two by two and well conditioned: some tens of roundings.
    assert relative(ours.qdd, expected) < 1e-13


def test_a_joint_with_nothing_outboard_is_singular_in_torque_mode_only() -> None:
    bodies = [Body("arm", "shoulder", "revolute", -1, mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1, 0, 0, 0)),
              Body("nothing", "wrist", "revolute", 0, at=(1.0, 0.0, 0.0), rpy=(0.3, 0.2, 0.1))]
    tree = Tree.build(bodies)

    def singular(mode: tuple[bool, bool], rotor: tuple[float, float] = (0.0, 0.0)) -> tuple[bool, ...]:
        return tuple(map(bool, solve(tree, (0.1, 0.2), (0.3, 0.4), tau=(1.0, 1.0), mode=mode, rotor=rotor).singular))

    assert singular((True, True)) == (False, True)
    assert singular((True, False)) == (False, False)
    assert singular((True, True), rotor=(0.0, 1e-6)) == (False, False)


def test_inertia_that_lies_on_the_axis_is_none_to_the_joint() -> None:
    # The wrist's only load is a mass point on the axes of both wrist joints: nothing to turn.
    bodies = [Body("arm", "shoulder", "revolute", -1, mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1, 0, 0, 0)),
              Body("yoke", "roll", "revolute", 0, at=(1.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0)),
              Body("point", "pitch", "revolute", 1, axis=(0.0, 1.0, 0.0), mass=3.0)]
    tree = Tree.build(bodies)
    for mode, expected in (((True, True, False), (False, True, False)), ((True, False, True), (False, False, True))):
        ours = solve(tree, (0.1, 0.2, 0.7), (0.3, 0.4, 0.5), tau=(1.0, 0.0, 0.0), mode=mode)
        assert tuple(map(bool, ours.singular)) == expected


def _without_ground(arm: RandomArm) -> RandomArm:
    """The arm with links fixed to the base made weightless and free of wrenches: what they bear is the base's."""
    ground: set[int] = {-1}
    for b, body in enumerate(arm.bodies):
        if body.kind == "fixed" and body.parent in ground:
            ground.add(b)
    bodies = tuple(replace(body, mass=0.0) if b in ground else body for b, body in enumerate(arm.bodies))
    names = {arm.bodies[b].name for b in ground if b >= 0}
    return replace(arm, bodies=bodies, wrenches={k: v for k, v in arm.wrenches.items() if k not in names})


def _rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(x), math.sin(x)) for x in (roll, pitch, yaw))
    return (np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
            @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]]))
