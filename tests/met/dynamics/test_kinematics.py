"""Link frames, velocities and wrenches in the world, by the deck's frames."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from met.dynamics.kinematics import jacobian, link_acceleration, link_motions
from met.dynamics.spatial import Pose, rotation_about, rotation_quaternion, rotation_rpy
from met.dynamics.tree import Tree
from met.trace import Formulas, Graph
from met.vectors import quaternion
from tests.oracles.pinocchio_floating import Flight, FloatingPinocchio
from tests.oracles.pinocchio_tree import PinocchioTree
from tests.oracles.random_tree import random_tree

SEEDS = range(30)

# Positions of metres through up to a dozen joints: some tens of roundings.
CLOSE = 1e-12


@pytest.mark.oracle
@pytest.mark.parametrize("seed", SEEDS)
def test_every_links_own_frame_is_where_pinocchio_has_it(seed: int) -> None:
    arm = random_tree(seed)
    theirs = PinocchioTree(arm.bodies, arm.gravity, arm.rotor)
    motions = link_motions(Tree.build(arm.bodies), arm.q, arm.qd)
    assert set(motions) == {body.name for body in arm.bodies}
    for name, motion in motions.items():
        R, p = theirs.link_pose(arm.q, name)
        assert np.allclose(motion.pose.R, R, rtol=0.0, atol=CLOSE), f"seed {seed}, {name}"
        assert np.allclose(motion.pose.p, p, rtol=CLOSE, atol=20 * CLOSE), f"seed {seed}, {name}"


@pytest.mark.oracle
@pytest.mark.parametrize("seed", SEEDS)
def test_links_and_points_of_them_move_as_in_pinocchio(seed: int) -> None:
    arm = random_tree(seed)
    theirs = PinocchioTree(arm.bodies, arm.gravity, arm.rotor)
    point = (0.3, -0.2, 0.5)
    for name, motion in link_motions(Tree.build(arm.bodies), arm.q, arm.qd).items():
        w, v = theirs.link_velocity(arm.q, arm.qd, name)
        R, p = theirs.link_pose(arm.q, name)
        size = 1.0 + np.linalg.norm(w) + np.linalg.norm(v)
        assert np.allclose(motion.rate(), w, rtol=0.0, atol=10 * CLOSE * size), f"seed {seed}, {name}"
        assert np.allclose(motion.velocity(), v, rtol=0.0, atol=10 * CLOSE * size), f"seed {seed}, {name}"
        assert np.allclose(motion.velocity(point), v + np.cross(w, R @ point), rtol=0.0, atol=10 * CLOSE * size)
        assert np.allclose(motion.position(point), p + R @ point, rtol=CLOSE, atol=20 * CLOSE), f"seed {seed}, {name}"


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_the_jacobian_times_the_rates_is_the_points_velocity(seed: int) -> None:
    arm = random_tree(seed)
    tree = Tree.build(arm.bodies)
    name, point = arm.bodies[-1].name, (0.1, 0.4, -0.3)
    motion = link_motions(tree, arm.q, arm.qd)[name]
    columns = np.array(jacobian(tree, arm.q, name, point))
    w, v = np.einsum("i,ijk->jk", np.array(arm.qd), columns)
    assert np.allclose(w, motion.rate(), rtol=0.0, atol=1e-11), f"seed {seed}"
    assert np.allclose(v, motion.velocity(point), rtol=0.0, atol=1e-11 * (1.0 + np.max(np.abs(v)))), f"seed {seed}"


def test_a_force_at_a_point_does_the_work_of_its_wrench() -> None:
    arm = random_tree(11)
    motion = link_motions(Tree.build(arm.bodies), arm.q, arm.qd)[arm.bodies[-1].name]
    force, moment, point = (3.0, -1.0, 2.0), (0.5, 0.25, -1.5), (0.2, -0.7, 0.1)
    own_moment, own_force = motion.wrench(force, moment, point)
    power = np.dot(force, motion.velocity(point)) + np.dot(moment, motion.rate())
    assert np.dot(own_moment, motion.w) + np.dot(own_force, motion.v) == pytest.approx(power, rel=1e-12)


def test_the_base_may_stand_and_move_anywhere() -> None:
    arm = random_tree(5)
    tree = Tree.build(arm.bodies)
    base = Pose(rotation_rpy(0.3, -0.7, 2.0), (1.0, -2.0, 0.5))
    w, v = (0.2, 0.5, -0.3), (1.0, 2.0, 3.0)
    still, moved = link_motions(tree, arm.q, arm.qd), link_motions(tree, arm.q, arm.qd, base, (w, v))
    R = np.array(base.R)
    for name, motion in moved.items():
        assert np.allclose(motion.position(), R @ still[name].position() + base.p, atol=1e-12)
        carried = np.array(v) + np.cross(w, still[name].position()) + np.array(still[name].velocity())
        assert np.allclose(motion.velocity(), R @ carried, atol=1e-11)


def test_rpy_turns_about_the_fixed_axes_x_then_y_then_z() -> None:
    R = np.array(rotation_rpy(math.pi / 2, math.pi / 2, 0.0))
    # y goes to z about x, then to x about y.
    assert np.array_equal(R @ [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    assert np.array_equal(R @ [0.0, 0.0, 1.0], [0.0, -1.0, 0.0])


def test_a_right_angle_leaves_no_rounding_noise() -> None:
    entries = {x for row in rotation_rpy(math.pi / 2, -math.pi, math.pi / 2) for x in row}
    assert entries <= {0.0, 1.0, -1.0}


def test_quaternion_axis_and_angle_and_rpy_name_the_same_turn() -> None:
    half = 0.6
    quaternion = rotation_quaternion(math.cos(half), 0.0, 0.0, math.sin(half))
    assert np.allclose(quaternion, rotation_about((0.0, 0.0, 1.0), 2 * half), rtol=0.0, atol=1e-15)
    assert np.allclose(quaternion, rotation_rpy(0.0, 0.0, 2 * half), rtol=0.0, atol=1e-15)


def rotations() -> np.ndarray:
    """Random ones; half turns about random axes and about the axes; those a little off; none."""
    rng = np.random.default_rng(11)
    quaternions = rng.standard_normal((300, 4))
    quaternions[50:150, 0] = 0.0
    quaternions[100:150, 0] += 1e-9 * rng.standard_normal(50)
    quaternions[150:154] = np.eye(4)
    quaternions[154:204] = np.eye(4)[rng.integers(4, size=50)] + 1e-8 * rng.standard_normal((50, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def test_a_rotations_quaternion_turns_back_into_it() -> None:
    graph = Graph()
    entries = [graph.input(f"{i}{j}") for i in range(3) for j in range(3)]
    traced = Formulas.of(graph, quaternion((tuple(entries[:3]), tuple(entries[3:6]), tuple(entries[6:]))))
    for wxyz in rotations():
        R = np.array(rotation_quaternion(*wxyz))
        found = np.array(quaternion(tuple(map(tuple, R.tolist()))))
        # the entries round at 1e-16, and a root of no less than 1 is taken
        assert abs(found @ found - 1.0) < 1e-15 and found[0] >= 0.0, wxyz
        assert np.abs(np.array(rotation_quaternion(*found)) - R).max() < 2e-15, wxyz
        replayed = traced.replay({f"{i}{j}": R[i, j] for i in range(3) for j in range(3)})
        assert np.array_equal(replayed, found), wxyz


def test_a_rotation_that_is_not_a_number_has_no_quaternion() -> None:
    nan = float("nan")
    assert np.isnan(quaternion(((nan, nan, nan),) * 3)).all()


@pytest.mark.oracle
@pytest.mark.parametrize("seed", SEEDS)
def test_a_point_of_a_link_accelerates_as_in_pinocchio(seed: int) -> None:
    arm = random_tree(seed)
    theirs = PinocchioTree(arm.bodies, arm.gravity, arm.rotor)
    tree, point = Tree.build(arm.bodies), (0.3, -0.2, 0.5)
    for name, motion in link_motions(tree, arm.q, arm.qd).items():
        wd, a = link_acceleration(tree, arm.q, arm.qd, arm.qdd, name)
        found = np.add(a, np.cross(wd, point) + np.cross(motion.w, np.cross(motion.w, point)))
        expected = theirs.link_acceleration(arm.q, arm.qd, arm.qdd, name, point)
        # products of rates of some ten rad/s along a dozen joints
        assert np.allclose(found, expected, rtol=0.0, atol=1e-13 * (1.0 + np.max(np.abs(expected)))), f"seed {seed}"


@pytest.mark.oracle
@pytest.mark.parametrize("seed", SEEDS)
def test_on_a_base_that_moves_too(seed: int) -> None:
    arm, rng = random_tree(seed), np.random.default_rng(seed)
    theirs = FloatingPinocchio(arm.bodies, arm.gravity, arm.rotor)
    w, v, base_wd, base_a = rng.normal(size=(4, 3))
    flight = Flight(np.array(rotation_rpy(*rng.normal(size=3))), rng.normal(size=3), w, v)
    tree, point = Tree.build(arm.bodies), (0.3, -0.2, 0.5)
    moved = link_motions(tree, arm.q, arm.qd, Pose(*map(_rows, (flight.R, flight.p))), (tuple(w), tuple(v)))
    for name, motion in moved.items():
        wd, a = link_acceleration(tree, arm.q, arm.qd, arm.qdd, name, tuple(w), (tuple(base_wd), tuple(base_a)))
        found = np.add(a, np.cross(wd, point) + np.cross(motion.w, np.cross(motion.w, point)))
        expected = theirs.link_acceleration(flight, arm.q, arm.qd, base_wd, base_a, arm.qdd, name, point)
        assert np.allclose(found, expected, rtol=0.0, atol=1e-13 * (1.0 + np.max(np.abs(expected)))), f"seed {seed}"


def _rows(x: np.ndarray) -> Any:
    return tuple(tuple(row) for row in x) if x.ndim > 1 else tuple(x)
