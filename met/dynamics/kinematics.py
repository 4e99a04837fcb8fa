"""Poses and motions of the links in the world, by their own (the deck's) frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from met.dynamics.floating import accelerated, factors
from met.dynamics.joints import JointTransform
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
    dot,
    is_zero,
    rigid_raise,
    rigid_sum,
    scale,
    sub,
    turn_vector,
    turn_vector_back,
)
from met.dynamics.tree import Tree
from met.frozen import frozen


@frozen
class LinkMotion:
    """A link's frame in the world.

    pose  R_WL and p_WL, m
    w, v  angular velocity of the link, and velocity of its frame's origin, in link axes, rad/s and m/s
    """

    pose: Pose
    w: Vector
    v: Vector

    def position(self, point: Vector = ZERO) -> Vector:
        """World position of a point given in the link frame, m."""
        return add(self.pose.p, turn_vector(self.pose.R, point))

    def velocity(self, point: Vector = ZERO) -> Vector:
        """Velocity in the world of a point fixed to the link, given in the link frame, m/s."""
        return turn_vector(self.pose.R, add(self.v, cross(self.w, point)))

    def rate(self) -> Vector:
        """Angular velocity in world axes, rad/s."""
        return turn_vector(self.pose.R, self.w)

    def to_world(self, vector: Vector) -> Vector:
        """World components of a vector given in link axes."""
        return turn_vector(self.pose.R, vector)

    def to_link(self, vector: Vector) -> Vector:
        """Link components of a vector given in world axes."""
        return turn_vector_back(self.pose.R, vector)

    def wrench(self, force: Vector, moment: Vector = ZERO, point: Vector = ZERO) -> tuple[Vector, Vector]:
        """Moment about the link's origin and force in link axes, as `solve` takes them, of a force (N) and a moment
        (N m) in world axes, the force applied at a point of the link frame."""
        own = self.to_link(force)
        return add(self.to_link(moment), cross(point, own)), own


def link_motions(
    tree: Tree,
    q: Sequence[Real],
    qd: Sequence[Real],
    base: Pose = HERE,
    base_velocity: tuple[Vector, Vector] = (ZERO, ZERO),
) -> dict[str, LinkMotion]:
    """Every link by name. base: the base frame in the world; its angular and linear velocity in its own axes."""
    steps = tree.transforms(q)
    poses = joint_poses(tree, steps, base)
    rates = joint_rates(tree, steps, qd, base_velocity)
    root_pose, root_rates = compose(base, tree.base), fixed_motion(base_velocity, tree.base)
    result = {}
    for name, frame in tree.frames.items():
        outer, motion = (root_pose, root_rates) if frame.joint < 0 else (poses[frame.joint], rates[frame.joint])
        result[name] = LinkMotion(compose(outer, frame.pose), *fixed_motion(motion, frame.pose))
    return result


def joint_poses(tree: Tree, steps: Sequence[JointTransform], base: Pose = HERE) -> tuple[Pose, ...]:
    """The recursion's frames in the world, by joint."""
    poses = [HERE] * len(steps)
    root = compose(base, tree.base)
    for i in tree.order:
        parent = tree.joints[i].parent
        poses[i] = steps[i].below(root if parent < 0 else poses[parent])
    return tuple(poses)


def joint_rates(
    tree: Tree, steps: Sequence[JointTransform], qd: Sequence[Real], base_velocity: tuple[Vector, Vector] = (ZERO, ZERO)
) -> tuple[tuple[Vector, Vector], ...]:
    """Angular velocity and velocity of the origin of the recursion's frames, in their axes, by joint."""
    rates = [(ZERO, ZERO)] * len(steps)
    root = fixed_motion(base_velocity, tree.base)
    for i in tree.order:
        joint = tree.joints[i]
        w, v = steps[i].lower_acceleration(*(root if joint.parent < 0 else rates[joint.parent]), ZERO)
        along = (0.0, 0.0, qd[i])
        rates[i] = (add(w, along), v) if joint.kind == "revolute" else (w, add(v, along))
    return tuple(rates)


def link_acceleration(
    tree: Tree,
    q: Sequence[Real],
    qd: Sequence[Real],
    qdd: Sequence[Real],
    link: str,
    base_rate: Vector = ZERO,
    base_acceleration: tuple[Vector, Vector] = (ZERO, ZERO),
) -> tuple[Vector, Vector]:
    """Angular acceleration of a link, and acceleration of its frame's origin, in link axes, rad/s^2, m/s^2.

    All products of velocities are included, so it holds for any motion. base_rate, base_acceleration: the base frame's
    angular velocity; its angular acceleration and that of its origin; in its own axes.
    """
    steps = tree.transforms(q)
    frame = tree.frames[link]
    way: list[int] = []
    i = frame.joint
    while i >= 0:
        way.insert(0, i)
        i = tree.joints[i].parent
    w = turn_vector_back(tree.base.R, base_rate)
    wd, a = fixed_acceleration(base_rate, base_acceleration, tree.base)
    for i in way:
        kind, step = tree.joints[i].kind, steps[i]
        carried = step.lower_rate(w)
        wd, a = step.lower_acceleration(wd, a, step.offset_product(w))
        a = add(a, cross(carried, cross(carried, (0.0, 0.0, step.slide))))
        along, faster = (0.0, 0.0, qd[i]), (0.0, 0.0, qdd[i])
        if kind == "revolute":
            w = add(carried, along)
            wd = add(add(wd, cross(carried, along)), faster)
        else:
            w = carried
            a = add(add(a, scale(2.0, cross(carried, along))), faster)
    return fixed_acceleration(w, (wd, a), frame.pose)


def jacobian(
    tree: Tree, q: Sequence[Real], link: str, point: Vector = ZERO, base: Pose = HERE
) -> tuple[tuple[Vector, Vector], ...]:
    """For each joint, the angular velocity of the link and the velocity of a point of it (link frame, m), in world
    axes, for each unit of that joint's rate. Zeros for joints that do not carry the link. base: as in `link_motions`.
    """
    steps = tree.transforms(q)
    poses = joint_poses(tree, steps, base)
    frame = tree.frames[link]
    columns: list[tuple[Vector, Vector]] = [(ZERO, ZERO)] * len(tree.joints)
    outer = compose(base, tree.base) if frame.joint < 0 else poses[frame.joint]
    world_pose = compose(outer, frame.pose)
    target = add(world_pose.p, turn_vector(world_pose.R, point))
    i = frame.joint
    while i >= 0:
        joint = tree.joints[i]
        R, p = poses[i]
        axis = (R[0][2], R[1][2], R[2][2])
        columns[i] = (axis, cross(axis, sub(target, p))) if joint.kind == "revolute" else (ZERO, axis)
        i = joint.parent
    return tuple(columns)


def base_answers(tree: Tree, q: Sequence[Real], base: Pose = HERE) -> tuple[tuple[Vector, Vector], ...]:
    """For each joint, the angular velocity of a free base and the velocity of its origin, world axes, for each unit of
    that joint's rate, where no external force acts: the base's part of the generalized Jacobian.

        H V_b + sum_i h_i qd_i = P      V_b the base's twist, P the momentum, H of all bodies together

    so for each joint V_b changes by -H^-1 h_i for each unit of its rate (Umetani and Yoshida, Resolved motion rate
    control of space manipulators with generalized Jacobian matrix, IEEE Trans. Robotics Autom. 5, 1989). h_i is the
    momentum of all that joint i carries, as it moves with unit rate. Rotors have none, as in `energy`.

    The tree floats; base: its frame in the world.
    """
    assert tree.floating is not None
    about_origin = Pose(base.R, ZERO)  # everything about the base's origin
    steps = tree.transforms(q)
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
        w, v = accelerated(LDL, *momentum(body, (angular, linear)))
        answers.append((scale(-1.0, w), scale(-1.0, v)))
    return tuple(answers)


def momentum(body: Rigid, twist: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
    """I V of a body: angular momentum about its frame's origin and momentum, in its axes, kg m^2/s and kg m/s."""
    w, v = twist
    return add(apply_symmetric(body.I, w), cross(body.h, v)), sub(scale(body.mass, v), cross(body.h, w))


def fixed_acceleration(w: Vector, acceleration: tuple[Vector, Vector], inner: Pose) -> tuple[Vector, Vector]:
    """The acceleration of a frame fixed, at the given pose, to one that turns at w; in its own axes."""
    wd, a = acceleration
    linear = add(a, add(cross(wd, inner.p), cross(w, cross(w, inner.p))))
    return turn_vector_back(inner.R, wd), turn_vector_back(inner.R, linear)


def fixed_motion(motion: tuple[Vector, Vector], inner: Pose) -> tuple[Vector, Vector]:
    """The motion of a frame fixed to the moving one at the given pose, in its own axes."""
    w, v = motion
    return turn_vector_back(inner.R, w), turn_vector_back(inner.R, add(v, cross(w, inner.p)))


class Energy(NamedTuple):
    """Energy and momentum of all bodies that the joints move; and of the base, with links fixed to it, where it moves
    freely.

    kinetic    J, 1/2 rotor qd^2 included, and what the rotation of the links that carry `momenta` adds to these
    potential  J, of uniform gravity, zero at the world's origin
    linear     momentum, world axes, kg m/s
    angular    momentum about the world's origin, world axes, kg m^2/s; `momenta` included
    """

    kinetic: Real
    potential: Real
    linear: Vector
    angular: Vector


def energy(
    tree: Tree,
    q: Sequence[Real],
    qd: Sequence[Real],
    *,
    rotor: Sequence[Real] | None = None,
    momenta: Sequence[Real] | None = None,
    gravity: Vector = ZERO,
    base: Pose = HERE,
    base_velocity: tuple[Vector, Vector] = (ZERO, ZERO),
) -> Energy:
    """Energy and momentum at a state; rotor as in `recursion.solve`, gravity in world axes (m/s^2), base as in
    `kinematics.link_motions`.

    momenta  by joint: angular momentum about its axis of what turns there in the link before it, against that link,
             kg m^2/s; None: none
    """
    steps = tree.transforms(q)
    bodies = [joint.body for joint in tree.joints]
    poses = list(joint_poses(tree, steps, base))
    rates = list(joint_rates(tree, steps, qd, base_velocity))
    if tree.floating is not None:
        bodies.append(tree.floating.body)
        poses.append(compose(base, tree.base))
        rates.append(fixed_motion(base_velocity, tree.base))
    kinetic: Real = 0.0
    weighed, linear, angular = ZERO, ZERO, ZERO
    for i, ((m, h, I), (R, p), (w, v)) in enumerate(zip(bodies, poses, rates, strict=True)):  # noqa: E741
        own_momentum = sub(scale(m, v), cross(h, w))
        turning = add(apply_symmetric(I, w), cross(h, v))
        kinetic = kinetic + 0.5 * (dot(w, turning) + dot(v, own_momentum))
        turned = turn_vector(R, own_momentum)
        linear = add(linear, turned)
        angular = add(angular, add(turn_vector(R, turning), cross(p, turned)))
        weighed = add(weighed, add(scale(m, p), turn_vector(R, h)))
        if rotor is not None and i < len(rotor):
            kinetic = kinetic + 0.5 * (rotor[i] * (qd[i] * qd[i]))
        if momenta is not None and i < len(momenta) and not is_zero(momenta[i]):
            of_link = w[2] - qd[i] if tree.joints[i].kind == "revolute" else w[2]
            kinetic = kinetic + momenta[i] * of_link
            angular = add(angular, turn_vector(R, (0.0, 0.0, momenta[i])))
    return Energy(kinetic, -dot(gravity, weighed), linear, angular)
