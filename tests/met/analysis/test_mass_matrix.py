"""Mass matrices at poses of a range: against the long way round, and the kinetic energy."""

from __future__ import annotations

import numpy as np

from met.analysis.mass_matrix import mass_matrices
from met.dynamics.kinematics import energy
from met.dynamics.tree import Tree
from tests.oracles import dense
from tests.oracles.random_tree import random_tree

ARMS = [random_tree(seed, moving) for seed, moving in ((1, 1), (2, 3), (3, 6), (4, 8))]


def test_the_mass_matrices_of_random_arms_are_those_of_the_long_way_round() -> None:
    for arm in ARMS:
        poses = np.array([arm.q, np.roll(arm.q, 1)])
        found = mass_matrices(Tree.build(arm.bodies), poses, arm.rotor, (0.0,) * arm.n)
        for q, M in zip(poses, found, strict=True):
            expected = np.array(dense.DenseArm(arm.bodies, rotor=arm.rotor).mass_matrix(q), float)
            assert np.abs(M - expected).max() <= 1e-13 * np.abs(expected).max(), arm.seed


def test_on_a_free_base_the_mass_matrix_is_that_of_the_kinetic_energy_with_the_spin_of_rotors() -> None:
    for arm in ARMS:
        random = np.random.default_rng(arm.seed)
        tree = Tree.build(arm.bodies, free=True)
        u, spin = random.normal(size=6 + arm.n), random.uniform(0.0, 0.1, arm.n)
        (M,) = mass_matrices(tree, np.array([arm.q]), arm.rotor, spin.tolist())
        w, v, qd = u[:3], u[3:6], u[6:]
        moving = energy(
            tree, arm.q, tuple(qd), rotor=arm.rotor, momenta=tuple(spin * qd), base_velocity=(tuple(w), tuple(v))
        )
        assert np.array_equal(M, M.T) or np.abs(M - M.T).max() <= 1e-15 * np.abs(M).max()
        assert abs(u @ M @ u / 2.0 - moving.kinetic) <= 1e-12 * abs(moving.kinetic), arm.seed
