"""Energy and momentum of the arm, from the bodies' own inertia."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from met.dynamics.kinematics import fixed_motion, joint_poses, joint_rates
from met.dynamics.spatial import (
    HERE,
    ZERO,
    Pose,
    Real,
    Vector,
    add,
    apply_symmetric,
    compose,
    cross,
    dot,
    is_zero,
    scale,
    sub,
    turn_vector,
)
from met.dynamics.tree import Tree


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
    steps = tuple(joint.at(q[i]) for i, joint in enumerate(tree.joints))
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
        momentum = sub(scale(m, v), cross(h, w))
        turning = add(apply_symmetric(I, w), cross(h, v))
        kinetic = kinetic + 0.5 * (dot(w, turning) + dot(v, momentum))
        turned = turn_vector(R, momentum)
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
