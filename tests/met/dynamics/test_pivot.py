"""A joint whose axis passes its link's frame: the same as a bare frame on the axis that carries the link."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from met.dynamics.kinematics import link_motions
from met.dynamics.recursion import reactions
from met.dynamics.spatial import rotation_rpy
from met.dynamics.tree import Body, Tree
from tests.met.dynamics.passes import CLOSE, passed
from tests.oracles.pinocchio_tree import PinocchioTree
from tests.oracles.random_tree import RandomArm, random_tree
from tests.oracles.worst import relative


def with_pivots(arm: RandomArm) -> tuple[Body, ...]:
    """The arm with a pivot for two of three revolute joints, some of them on an axis through the parent's frame."""
    rng = np.random.default_rng(arm.seed)
    made = []
    for body in arm.bodies:
        if body.kind == "revolute" and rng.random() < 0.67:
            back = np.array(rotation_rpy(*body.rpy), float).T @ -np.array(body.at, float)
            point = back if rng.random() < 0.5 else rng.normal(size=3)
            body = replace(body, pivot=tuple(map(float, point)))
        made.append(body)
    return tuple(made)


def without(bodies: tuple[Body, ...]) -> tuple[Body, ...]:
    """The same arm of joints whose axes pass their frames' origins: a body without mass, and the link fixed to it."""
    made: list[Body] = []
    number: dict[int, int] = {-1: -1}
    for b, body in enumerate(bodies):
        parent = number[body.parent]
        if body.pivot == (0.0, 0.0, 0.0):
            made.append(replace(body, parent=parent))
        else:
            R, pivot = np.array(rotation_rpy(*body.rpy), float), np.array(body.pivot)
            at = tuple(map(float, np.array(body.at, float) + R @ pivot))
            made.append(Body(f"{body.name}_axis", body.joint, body.kind, parent, at, body.rpy, body.axis))
            made.append(
                replace(
                    body,
                    joint=f"{body.joint}_fixed",
                    kind="fixed",
                    parent=len(made) - 1,
                    at=tuple(map(float, -pivot)),
                    rpy=(0.0, 0.0, 0.0),
                    pivot=(0.0, 0.0, 0.0),
                )
            )
        number[b] = len(made) - 1
    return tuple(made)


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(40))
def test_accelerations_and_frames_are_those_of_pinocchio_for_the_arm_in_two_bodies(seed: int) -> None:
    arm = random_tree(seed)
    arm = replace(arm, bodies=with_pivots(arm))
    theirs = PinocchioTree(without(arm.bodies), arm.gravity, arm.rotor)
    assert relative(passed(arm, True).qdd, theirs.accelerations(arm.q, arm.qd, arm.tau, arm.wrenches)) < CLOSE
    for name, motion in link_motions(Tree.build(arm.bodies), arm.q, arm.qd).items():
        R, p = theirs.link_pose(arm.q, name)
        np.testing.assert_allclose(np.array(motion.pose.R, float), R, atol=1e-12)  # tens of roundings, metres
        np.testing.assert_allclose(np.array(motion.pose.p, float), p, atol=2e-11)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_reactions_are_those_of_the_arm_in_two_bodies_taken_to_the_links_frame(seed: int) -> None:
    arm = random_tree(seed)
    arm = replace(arm, bodies=with_pivots(arm))
    split = replace(arm, bodies=without(arm.bodies))
    trees = Tree.build(arm.bodies), Tree.build(split.bodies)
    ours, theirs = (reactions(tree, passed(each, True, tree)) for tree, each in zip(trees, (arm, split), strict=True))
    moving = [body for body in arm.bodies if body.kind != "fixed"]
    size = max(np.abs(np.array(wrench, float)).max() for wrench in theirs)
    for body, (moment, force), (other_moment, other_force) in zip(moving, ours, theirs, strict=True):
        np.testing.assert_allclose(np.array(force, float), np.array(other_force, float), atol=1e-10 * size)
        # the axes are one; the link's origin lies at -pivot from the point of the axis
        shifted = np.array(other_moment, float) + np.cross(np.array(body.pivot), np.array(other_force, float))
        np.testing.assert_allclose(np.array(moment, float), shifted, atol=1e-10 * size)
