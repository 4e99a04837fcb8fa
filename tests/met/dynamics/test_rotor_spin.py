"""Rotors that turn with their joints on a free base: against rotors that are bodies of their own in Pinocchio.

There each rotor is a body on the link before its joint, without mass, with an inertia about the joint's axis alone, and
its turn is tied to the joint's: velocities are G times those of base and joints. Here it is a part of that link, and
has a spin.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from met.dynamics.effective_inertia import effective_inertia
from met.dynamics.kinematics import energy
from met.dynamics.recursion import FreeRotor, Solved, reactions, solve
from met.dynamics.tree import Body, Tree
from tests.met.dynamics import passes
from tests.met.dynamics.passes import CLOSE
from tests.met.dynamics.test_free_base import Flight, flight, floated, passed, pose, vector, whole
from tests.oracles import dense
from tests.oracles.pinocchio_floating import FloatingPinocchio
from tests.oracles.random_tree import RandomArm, random_tree, random_trees
from tests.oracles.worst import Worst, relative


@cache
def fleet() -> tuple[tuple[RandomArm, Tree, Flight, np.ndarray, FloatingPinocchio, np.ndarray], ...]:
    """75 arms on free bases, as ours and as theirs: the arm, its tree, the base's motion, N J_m, their model, G."""
    made = []
    for bare in random_trees()[::4]:
        random = np.random.default_rng(9000 + bare.seed)
        ratio = random.choice([-1.0, 1.0], bare.n) * 10.0 ** random.uniform(0.0, 2.5, bare.n)
        J = 10.0 ** random.uniform(-4.0, 0.0, bare.n) / np.maximum(1.0, abs(ratio))
        floating = floated(bare)
        moving = [body for body in floating.bodies if body.kind != "fixed"]
        spare = [rotor(body, i, float(J[i])) for i, body in enumerate(moving)]
        held = tuple(replace(body, kind="fixed") for body in spare)
        arm = replace(floating, bodies=(*floating.bodies, *held), rotor=tuple(map(float, ratio * ratio * J)))
        theirs = FloatingPinocchio((*floating.bodies, *spare), arm.gravity, (0.0,) * (2 * arm.n))
        G = np.zeros((6 + 2 * arm.n, 6 + arm.n))
        G[: 6 + arm.n] = np.eye(6 + arm.n)
        G[6 + arm.n :, 6:] = np.diag(ratio)
        made.append((arm, Tree.build(arm.bodies, free=True), flight(arm.seed), ratio * J, theirs, G))
    return tuple(made)


def rotor(body: Body, number: int, J: float) -> Body:
    """The rotor of a body's joint, on the link before it."""
    second = J * np.outer(body.axis, body.axis)
    inertia = tuple(float(second[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return Body(
        f"rotor{number}", f"turn{number}", "revolute", body.parent, at=body.at, rpy=body.rpy, axis=body.axis,
        inertia=inertia,
    )  # fmt: skip


def turned(arm: RandomArm, tree: Tree, base: Flight, spin: np.ndarray, mode: object = True, **words: object) -> Solved:
    return passed(arm, tree, base, mode, spin=tuple(map(float, spin)), **words)


def of_theirs(
    arm: RandomArm, base: Flight, theirs: FloatingPinocchio, G: np.ndarray, rates: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """M and h over base (angular, linear) and joints, and what else G has columns of, the rotors in both:
    M a + h = (0, tau). rates: of joints and rotors, rad/s; None: the arm's, and its rotors turn with its joints."""
    q, qd = (*arm.q, *(0.0,) * arm.n), G[6:, 6:] @ arm.qd if rates is None else rates

    def forces(a: np.ndarray) -> np.ndarray:
        return np.concatenate(theirs.forces(base, q, qd, a[:3], a[3:6], a[6:], arm.wrenches))

    bias = forces(np.zeros(len(G)))
    still, gravity = Flight(base.R, base.p, np.zeros(3), np.zeros(3)), theirs.model.gravity.linear.copy()
    theirs.model.gravity.linear = np.zeros(3)
    M = np.array([np.concatenate(theirs.forces(still, q, 0.0 * qd, a[:3], a[3:6], a[6:], {})) for a in np.eye(len(G))])
    theirs.model.gravity.linear = gravity
    return G.T @ M.T @ G, G.T @ bias


@pytest.mark.oracle
def test_accelerations_are_those_of_rotors_that_are_bodies_of_their_own() -> None:
    worst, apart = Worst("rotors on a free base: accelerations"), 0.0
    for arm, tree, base, spin, theirs, G in fleet():
        M, h = of_theirs(arm, base, theirs, G)
        expected = np.linalg.solve(M, np.concatenate([np.zeros(6), arm.tau]) - h)
        ours = whole(turned(arm, tree, base, spin))
        worst.see(relative(ours, expected), f"seed {arm.seed}")
        apart = max(apart, relative(whole(passed(arm, tree, base)), expected))
    worst.below(CLOSE)
    assert apart > 0.1  # without their spin


@pytest.mark.oracle
def test_torques_in_mixed_modes_are_those_of_rotors_that_are_bodies_of_their_own() -> None:
    worst = Worst("rotors on a free base: torques in mixed modes")
    for arm, tree, base, spin, theirs, G in fleet():
        M, h = of_theirs(arm, base, theirs, G)
        for mode in (arm.mode, (False,) * arm.n):
            ours = turned(arm, tree, base, spin, mode)
            needed = M @ whole(ours) + h
            size = np.max(np.abs(h)) + np.max(np.abs(M * whole(ours)))
            worst.see(np.max(np.abs(needed - np.concatenate([np.zeros(6), ours.tau]))) / size, f"seed {arm.seed}")
            given = turned(arm, tree, base, spin, True, tau=ours.tau)
            worst.see(0.01 * relative(whole(given), whole(ours)), f"seed {arm.seed}, torques given back")
    worst.below(CLOSE)


@pytest.mark.oracle
def test_inertia_felt_is_that_with_rotors_that_are_bodies_of_their_own() -> None:
    worst = Worst("rotors on a free base: J_eff and b")
    for arm, tree, base, spin, theirs, G in fleet():
        M, h = of_theirs(arm, base, theirs, G)
        behind = np.array((0.0,) * 6 + arm.rotor)
        for mode in ((True,) * arm.n, (False,) * arm.n, arm.mode):
            ours = turned(arm, tree, base, spin, mode)
            given = [np.array((0.0,) * 6 + each) for each in (arm.tau, arm.qdd)]
            expected = dense.effective_inertia(M, h, *given, (True,) * 6 + mode, behind)[6:]
            found = effective_inertia(tree, ours)
            for i, ((J, b), (J_dense, b_dense)) in enumerate(zip(found, expected, strict=True)):
                where = f"seed {arm.seed}, joint {i}, mode {mode}"
                worst.see(abs(J - J_dense) / (abs(J_dense) + arm.rotor[i]), where)
                # the dense b is a difference of torques that hold the rotor's share
                size = abs(ours.tau[i]) + (arm.rotor[i] + abs(J)) * abs(ours.qdd[i])
                worst.see(abs(b - b_dense) / size, where)
    worst.below(1e-9)


@pytest.mark.oracle
def test_energy_and_momentum_are_those_of_rotors_that_are_bodies_of_their_own() -> None:
    worst = Worst("rotors on a free base: energy and momentum")
    for arm, tree, base, spin, theirs, G in fleet():
        ours = energy(
            tree, arm.q, arm.qd, rotor=arm.rotor, momenta=tuple(map(float, spin * arm.qd)), gravity=arm.gravity,
            base=pose(base), base_velocity=(vector(base.w), vector(base.v)),
        )  # fmt: skip
        q, qd = (*arm.q, *(0.0,) * arm.n), G[6:, 6:] @ arm.qd
        kinetic = theirs.energy(base, q, qd)[0]
        worst.see(abs(ours.kinetic - kinetic) / kinetic, f"seed {arm.seed}, kinetic energy")
        both = np.concatenate(theirs.momentum(base, q, qd))
        worst.see(relative((*ours.angular, *ours.linear), both), f"seed {arm.seed}, momentum")
    worst.below(CLOSE)


@pytest.mark.oracle
def test_rotors_behind_elastic_gears_turn_as_bodies_of_their_own() -> None:
    worst, own = Worst("free rotors on a free base: the arm"), Worst("free rotors on a free base: themselves")
    for arm, tree, base, spin, theirs, G in fleet():
        random = np.random.default_rng(9500 + arm.seed)
        free = np.flatnonzero(random.random(arm.n) < 0.5)
        ratio = np.diag(G[6 + arm.n :, 6:])
        J, torque, rate = spin / ratio, random.normal(0.0, 3.0, arm.n), random.normal(0.0, 20.0, arm.n)
        # columns of G: base and joints, with the rotors that turn with them; then the free rotors
        wide = np.hstack([G, np.eye(len(G))[:, 6 + arm.n + free]])
        wide[6 + arm.n + free, 6 + free] = 0.0
        turns = np.isin(np.arange(arm.n), free)
        M, h = of_theirs(arm, base, theirs, wide, np.concatenate([arm.qd, np.where(turns, rate, ratio * arm.qd)]))
        expected = np.linalg.solve(M, np.concatenate([np.zeros(6), arm.tau, torque[free]]) - h)
        bound = replace(arm, rotor=tuple(np.where(turns, 0.0, arm.rotor)))
        rotors = [
            FreeRotor(float(J[i]), float(torque[i]), float(J[i] * rate[i])) if turns[i] else None for i in range(arm.n)
        ]
        ours = turned(bound, tree, base, np.where(turns, 0.0, spin), True, free_rotors=rotors)
        worst.see(relative(whole(ours), expected[: 6 + arm.n]), f"seed {arm.seed}")
        found = [torque[i] / J[i] - ours.about[i] for i in free]
        if len(free):
            own.see(relative(found, expected[6 + arm.n :]), f"seed {arm.seed}")
    worst.below(CLOSE)
    own.below(CLOSE)


def test_a_spin_is_refused_nowhere_and_felt_on_a_base_that_is_given() -> None:
    # What turns with a joint loads the joint before it, whatever carries the arm.
    bodies = [
        Body("one", "first", "revolute", -1, inertia=(1.0,) * 3 + (0.0,) * 3),
        Body("two", "second", "revolute", 0, inertia=(1.0,) * 3 + (0.0,) * 3),
    ]
    solved = solve(Tree.build(bodies), (0.0, 0.0), (0.0, 0.0), tau=(0.0, 2.0), spin=(0.0, 0.5), rotor=(0.0, 5.0))
    # (2, 1 + 0.5; 1 + 0.5, 1 + 5) qdd = (0, 2)
    assert np.allclose(solved.qdd, np.linalg.solve([[2.0, 1.5], [1.5, 6.0]], [0.0, 2.0]), rtol=1e-15)


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_on_a_base_at_rest_rotors_are_bodies_of_their_own_to_plain_linear_algebra(seed: int) -> None:
    """In mixed modes; those behind elastic gears turn by themselves. What a joint bears is its load."""
    bare, random = random_tree(seed, 5), np.random.default_rng(seed)
    ratio, J = random.choice([-1.0, 1.0], 5) * random.uniform(1.0, 30.0, 5), random.uniform(0.01, 0.1, 5)
    torque, rate, elastic = random.normal(0.0, 3.0, 5), random.normal(0.0, 20.0, 5), np.arange(5) == seed
    moving = [body for body in bare.bodies if body.kind != "fixed"]
    spare = [rotor(body, i, float(J[i])) for i, body in enumerate(moving)]
    theirs = dense.DenseArm((*bare.bodies, *spare), bare.gravity, wrenches=bare.wrenches)
    # columns of G: the joints, with the rotors that turn with them; then the elastic ones
    G = np.vstack([np.eye(5, 6), np.hstack([np.diag(np.where(elastic, 0.0, ratio)), np.eye(5)[:, elastic]])])
    q, qd = (*bare.q, *(0.0,) * 5), G @ (*bare.qd, *rate[elastic])
    M, h = G.T @ theirs.mass_matrix(q) @ G, G.T @ theirs.bias(q, qd)
    arm = replace(
        bare,
        bodies=(*bare.bodies, *(replace(body, kind="fixed") for body in spare)),
        rotor=tuple(np.where(elastic, 0.0, ratio * ratio * J)),
    )
    spin = tuple(map(float, np.where(elastic, 0.0, ratio * J)))
    rotors = [FreeRotor(J[i], torque[i], J[i] * rate[i]) if elastic[i] else None for i in range(5)]
    tree = Tree.build(arm.bodies)
    for mode in ((True,) * 5, (False,) * 5, arm.mode):
        given = np.array((*arm.tau, *torque[elastic])), np.array((*arm.qdd, 0.0))
        qdd, tau = dense.mixed(M, h, *given, (*mode, True))
        ours = passes.passed(arm, mode, tree, spin=spin, free_rotors=rotors)
        assert relative(ours.qdd, qdd[:5]) < CLOSE and relative(ours.tau, tau[:5]) < CLOSE
        assert (torque / J - ours.about)[elastic] == pytest.approx(float(qdd[5]), rel=1e-10)
        for i, (body, (moment, force)) in enumerate(zip(moving, reactions(tree, ours), strict=True)):
            own = np.dot(body.axis, moment if body.kind == "revolute" else force)
            load = ours.tau_load[i] - spin[i] * ours.about[i]  # the rest is what turns the rotor along with its link
            assert abs(own - load) < CLOSE * max(map(abs, (*moment, *force)))
