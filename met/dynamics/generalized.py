"""The motion of a free base due to joint rates where no external force acts: its part of the generalized Jacobian.

    H V_b + sum_i h_i qd_i = P          V_b the base's twist, P the momentum, H of all bodies together

so for each joint V_b changes by -H^-1 h_i for each unit of its rate (Umetani and Yoshida, Resolved motion rate control
of space manipulators with generalized Jacobian matrix, IEEE Trans. Robotics Autom. 5, 1989). h_i is the momentum of all
that joint i carries, as it moves with unit rate. Rotors have none, as in `energy`.
"""

from __future__ import annotations

from collections.abc import Sequence

from met.dynamics.floating import accelerated, factors
from met.dynamics.kinematics import joint_poses
from met.dynamics.spatial import (
    HERE,
    NOTHING,
    ZERO,
    Pose,
    Real,
    Rigid,
    Vector,
    add,
    add_rigid,
    apply_symmetric,
    compose,
    cross,
    rigid_raise,
    rigid_sum,
    scale,
    sub,
)
from met.dynamics.tree import Tree


def base_answers(tree: Tree, q: Sequence[Real], base: Pose = HERE) -> tuple[tuple[Vector, Vector], ...]:
    """For each joint, the angular velocity of the base and the velocity of its origin, world axes, for each unit of
    that joint's rate. The tree floats; base: its frame in the world."""
    assert tree.floating is not None
    about_origin = Pose(base.R, ZERO)  # everything about the base's origin
    steps = tuple(joint.at(q[i]) for i, joint in enumerate(tree.joints))
    poses = joint_poses(tree, steps, about_origin)
    carried = [rigid_raise(joint.body, pose) for joint, pose in zip(tree.joints, poses, strict=True)]
    whole = rigid_raise(tree.floating.body, compose(about_origin, tree.base))
    for i in reversed(tree.order):
        parent = tree.joints[i].parent
        if parent < 0:
            whole = rigid_sum(whole, carried[i])
        else:
            carried[parent] = rigid_sum(carried[parent], carried[i])
    LDL, _ = factors(add_rigid(NOTHING, whole), (0.0, 0.0))
    answers = []
    for joint, (R, p), body in zip(tree.joints, poses, carried, strict=True):
        axis = (R[0][2], R[1][2], R[2][2])
        angular, linear = (axis, cross(p, axis)) if joint.kind == "revolute" else (ZERO, axis)
        w, v = accelerated(LDL, *_momentum(body, angular, linear))
        answers.append((scale(-1.0, w), scale(-1.0, v)))
    return tuple(answers)


def _momentum(body: Rigid, w: Vector, v: Vector) -> tuple[Vector, Vector]:
    """Angular momentum about the origin, and momentum, of a body with angular velocity w and velocity v of its point at
    the origin."""
    return add(apply_symmetric(body.I, w), cross(body.h, v)), sub(scale(body.mass, v), cross(body.h, w))
