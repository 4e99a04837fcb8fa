"""A payload: a rigid body that flies freely, or is a part of the link that has grappled it (docs/physics.md).

The grapple is a plastic impact: it lasts no time, and after it body and link move as one. With I_p the body's spatial
inertia, dV its velocity less that of the link where it is caught, and J the link's Jacobian there, the joint rates jump
by

    (M + J' I_p J) d(qd) = J' I_p dV

which is one pass of the recursion with the body on the link, no velocities, and the `blow` I_p dV as the wrench. So
momentum is kept to rounding, and 1/2 dV' (J M^-1 J' + I_p^-1)^-1 dV of the kinetic energy is lost. Not an impact that
rebounds, nor one that takes time: the forces of the capture are not known from it.
"""

from __future__ import annotations

from dataclasses import replace

from met.dynamics.floating import accelerated, factors
from met.dynamics.kinematics import Energy, LinkMotion, fixed_motion, momentum
from met.dynamics.recursion import Wrench, rate_wrench
from met.dynamics.spatial import (
    NOTHING,
    ZERO,
    Pose,
    Real,
    Rigid,
    Vector,
    add,
    add_rigid,
    compose,
    cross,
    dot,
    inverse,
    rigid_raise,
    rigid_sum,
    scale,
    sub,
    turn_vector,
)
from met.dynamics.tree import Tree

Twist = tuple[Vector, Vector]
"""Angular velocity and velocity of a frame's origin, in that frame's axes, rad/s and m/s."""


def in_tree(tree: Tree, link: str, body: Rigid, pose: Pose) -> Rigid:
    """A body with this pose in a link's frame, expressed in the recursion's frame of the joint that carries the
    link."""
    return rigid_raise(body, compose(tree.frames[link].pose, pose))


def loaded(tree: Tree, link: str, body: Rigid) -> Tree:
    """The tree with a body on a link, as from `in_tree`; without mass, the same tree. On a link that is fixed to a base
    whose motion is given, the body does not change the arm's motion."""
    number = tree.frames[link].joint
    if number >= 0:
        joint = tree.joints[number]
        more = replace(joint, body=rigid_sum(joint.body, body), dynamic=rigid_sum(joint.dynamic, body))
        return replace(tree, joints=(*tree.joints[:number], more, *tree.joints[number + 1 :]))
    if tree.floating is None:
        return tree
    base = tree.floating
    return replace(tree, floating=replace(base, body=rigid_sum(base.body, body), dynamic=rigid_sum(base.dynamic, body)))


def free_acceleration(body: Rigid, w: Vector, wrench: Wrench, gravity: Vector) -> Wrench:
    """Angular acceleration of a body that moves freely, and that of its frame's origin, rad/s^2 and m/s^2.

    All in the body's frame: angular velocity w, rad/s; moment about its origin and force, N m and N; gravity, m/s^2
    """
    moment, force = wrench
    gyroscopic, centrifugal = rate_wrench(body, w)
    LDL, _ = factors(add_rigid(NOTHING, body), (0.0, 0.0))
    wd, a = accelerated(LDL, sub(moment, gyroscopic), sub(force, centrifugal))
    return wd, add(a, gravity)


def twist_against(body: LinkMotion, link: LinkMotion) -> Twist:
    """dV: the motion of a body relative to the link's material at the body's frame, in the body's axes."""
    w, v = fixed_motion((link.w, link.v), compose(inverse(link.pose), body.pose))
    return sub(body.w, w), sub(body.v, v)


def raised(wrench: Wrench, pose: Pose) -> Wrench:
    """A wrench about the origin of a frame with this pose in another frame, moved to the other's origin and axes."""
    moment, force = (turn_vector(pose.R, part) for part in wrench)
    return add(moment, cross(pose.p, force)), force


def energy_of(body: Rigid, motion: LinkMotion, gravity: Vector = ZERO) -> Energy:
    """Energy and momentum of one body, as `energy` has those of an arm; gravity in world axes, m/s^2."""
    spin, linear = momentum(body, (motion.w, motion.v))
    kinetic: Real = 0.5 * (dot(motion.w, spin) + dot(motion.v, linear))
    R, p = motion.pose
    along = turn_vector(R, linear)
    weighed = add(scale(body.mass, p), turn_vector(R, body.h))
    return Energy(kinetic, -dot(gravity, weighed), along, add(turn_vector(R, spin), cross(p, along)))
