"""Pinocchio's free-flyer: the same arm on a base that moves freely, the base's own body among the bodies.

A body that is fixed to the base has parent -1. Configurations are the base's pose and the joints' positions; velocities
and accelerations of the base are ours: of the frame's origin, angular and linear, base axes, the linear acceleration
the derivative of the velocity (Pinocchio's is spatial: it lacks w x v).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from met.dynamics.tree import Body
from tests.oracles.package import Package
from tests.oracles.pinocchio_tree import classical, on_joints

pin = Package("pinocchio")

Array = np.ndarray


@dataclass(frozen=True)
class Flight:
    """Where a base is and how it moves: R and p in the world; w and v in base axes."""

    R: Array
    p: Array
    w: Array
    v: Array


class FloatingPinocchio:
    """Pinocchio's model of some bodies (parents before children) on a free-flyer."""

    def __init__(self, bodies: Sequence[Body], gravity: Sequence[float], rotor: Sequence[float]) -> None:
        model = pin.Model()
        model.gravity.linear = np.array(gravity, float)
        root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
        joint_of: list[int] = []
        placed: list[pin.SE3] = []
        self.names = [body.joint for body in bodies if body.kind != "fixed"]
        for body in bodies:
            at = pin.SE3(pin.rpy.rpyToMatrix(*map(float, body.rpy)), np.array(body.at, float))
            joint, pose = (
                (root, pin.SE3.Identity()) if body.parent < 0 else (joint_of[body.parent], placed[body.parent])
            )
            if body.kind == "fixed":
                joint_of.append(joint)
                placed.append(pose * at)
            else:
                made = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}
                axis = np.array(body.axis, float)
                joint_of.append(model.addJoint(joint, made[body.kind](axis), pose * at, body.joint))
                placed.append(pin.SE3.Identity())
            xx, yy, zz, xy, xz, yz = body.inertia
            J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], float)
            inertia = pin.Inertia(float(body.mass), np.array(body.com, float), J)
            model.appendBodyToJoint(joint_of[-1], inertia, placed[-1])
        self.model, self.joint_of, self.placed = model, joint_of, placed
        self.link = {body.name: b for b, body in enumerate(bodies)}
        joints = [model.joints[model.getJointId(name)] for name in self.names]
        self.at = [joint.idx_v for joint in joints]
        self.q_at = [joint.idx_q for joint in joints]
        armature = np.zeros(model.nv)
        armature[self.at] = rotor
        model.armature = armature
        self.data = model.createData()

    def configuration(self, base: Flight, q: Sequence[float]) -> Array:
        """Pinocchio's q."""
        theirs = np.zeros(self.model.nq)
        theirs[:3] = base.p
        theirs[3:7] = pin.Quaternion(base.R).coeffs()
        theirs[self.q_at] = q
        return theirs

    def velocity(self, angular: Sequence[float], linear: Sequence[float], ours: Sequence[float]) -> Array:
        """Pinocchio's v, or what goes with it: the base's linear part first."""
        theirs = np.zeros(self.model.nv)
        theirs[:3], theirs[3:6] = linear, angular
        theirs[self.at] = ours
        return theirs

    def accelerations(self, base, q, qd, tau, wrenches) -> tuple[Array, Array, Array]:
        """Forward dynamics: angular and linear acceleration of the base, qdd."""
        v = self.velocity(base.w, base.v, qd)
        forces = self.velocity(np.zeros(3), np.zeros(3), tau)
        a = pin.aba(self.model, self.data, self.configuration(base, q), v, forces, on_joints(self, wrenches))
        return a[3:6], a[:3] + np.cross(base.w, base.v), a[self.at]

    def link_acceleration(self, base, q, qd, wd, a, qdd, name: str, point: Sequence[float]) -> Array:
        """Acceleration of a point of a link, in link axes. wd, a: of the base frame, base axes."""
        v = self.velocity(base.w, base.v, qd)
        given = self.velocity(wd, np.array(a) - np.cross(base.w, base.v), qdd)
        pin.forwardKinematics(self.model, self.data, self.configuration(base, q), v, given)
        return classical(self, name, point)

    def forces(self, base, q, qd, wd, a, qdd, wrenches) -> tuple[Array, Array]:
        """Inverse dynamics: the wrench that the base would need (moment over force), and the joints' torques."""
        v = self.velocity(base.w, base.v, qd)
        given = self.velocity(wd, np.array(a) - np.cross(base.w, base.v), qdd)
        found = pin.rnea(self.model, self.data, self.configuration(base, q), v, given, on_joints(self, wrenches))
        return np.concatenate([found[3:6], found[:3]]), found[self.at]

    def energy(self, base, q, qd) -> tuple[float, float]:
        """Kinetic energy without rotors, potential energy, J."""
        armature = self.model.armature.copy()
        self.model.armature = np.zeros(self.model.nv)
        at = self.configuration(base, q)
        kinetic = pin.computeKineticEnergy(self.model, self.data, at, self.velocity(base.w, base.v, qd))
        self.model.armature = armature
        return float(kinetic), float(pin.computePotentialEnergy(self.model, self.data, at))

    def momentum(self, base, q, qd) -> tuple[Array, Array]:
        """Angular momentum about the world's origin, linear momentum."""
        pin.forwardKinematics(self.model, self.data, self.configuration(base, q), self.velocity(base.w, base.v, qd))
        total = pin.Force.Zero()
        for j in range(1, self.model.njoints):
            total += self.data.oMi[j].act(self.model.inertias[j] * self.data.v[j])
        return np.array(total.angular), np.array(total.linear)
