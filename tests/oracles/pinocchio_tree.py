"""The same arm in Pinocchio: bodies in, joint torques and accelerations out, in our order of joints.

`crba` is not used: it is silently wrong where joints were not added depth-first. `aba` and `rnea` are right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from met.dynamics.tree import Body
from tests.oracles.package import Package

pin = Package("pinocchio")


def on_joints(arm: Any, wrenches: Mapping[str, tuple[Sequence[float], Sequence[float]]]) -> pin.StdVec_Force:
    """External wrenches (moment about a link's origin, force, link axes) on Pinocchio's joints."""
    total = [pin.Force.Zero() for _ in range(arm.model.njoints)]
    for name, (moment, force) in wrenches.items():
        b = arm.link[name]
        total[arm.joint_of[b]] += arm.placed[b].act(pin.Force(np.array(force, float), np.array(moment, float)))
    result = pin.StdVec_Force()
    result.extend(total)
    return result


def classical(arm: Any, name: str, point: Sequence[float]) -> np.ndarray:
    """Acceleration of a point of a link, link axes, of the motion that Pinocchio's `forwardKinematics` was given.

    Pinocchio's accelerations are spatial: that of a point lacks w x v.
    """
    b = arm.link[name]
    there = arm.placed[b] * pin.SE3(np.eye(3), np.array(point, float))
    v, a = (there.actInv(each[arm.joint_of[b]]) for each in (arm.data.v, arm.data.a))
    return np.array(a.linear + np.cross(v.angular, v.linear))


class PinocchioTree:
    """Pinocchio's model of some bodies (parents before children)."""

    def __init__(self, bodies: Sequence[Body], gravity: Sequence[float], rotor: Sequence[float]) -> None:
        model = pin.Model()
        model.gravity.linear = np.array(gravity, float)
        joint_of: list[int] = []
        placed: list[pin.SE3] = []
        self.names = [body.joint for body in bodies if body.kind != "fixed"]
        for body in bodies:
            at = pin.SE3(pin.rpy.rpyToMatrix(*map(float, body.rpy)), np.array(body.at, float))
            joint, pose = (0, pin.SE3.Identity()) if body.parent < 0 else (joint_of[body.parent], placed[body.parent])
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
            model.appendBodyToJoint(
                joint_of[-1], pin.Inertia(float(body.mass), np.array(body.com, float), J), placed[-1]
            )
        self.model, self.joint_of, self.placed = model, joint_of, placed
        self.link = {body.name: b for b, body in enumerate(bodies)}
        self.at = [model.joints[model.getJointId(name)].idx_v for name in self.names]
        armature = np.zeros(model.nv)
        armature[self.at] = rotor
        model.armature = armature
        self.data = model.createData()

    def vector(self, ours: Sequence[float]) -> np.ndarray:
        """Joint numbers in Pinocchio's order."""
        theirs = np.zeros(self.model.nv)
        theirs[self.at] = ours
        return theirs

    def accelerations(self, q, qd, tau, wrenches) -> np.ndarray:
        """Forward dynamics, rotor inertia included."""
        v = self.vector
        return pin.aba(self.model, self.data, v(q), v(qd), v(tau), on_joints(self, wrenches))[self.at]

    def acceleration_slopes(self, q, qd, tau, wrenches) -> tuple[np.ndarray, ...]:
        """The derivatives of `accelerations` by q, qd and tau, [joint, joint]."""
        v, at = self.vector, np.ix_(self.at, self.at)
        found = pin.computeABADerivatives(self.model, self.data, v(q), v(qd), v(tau), on_joints(self, wrenches))
        return tuple(np.array(each)[at] for each in found)

    def torques(self, q, qd, qdd, wrenches) -> np.ndarray:
        """Inverse dynamics, rotor inertia included."""
        v = self.vector
        return pin.rnea(self.model, self.data, v(q), v(qd), v(qdd), on_joints(self, wrenches))[self.at]

    def link_pose(self, q, name: str) -> tuple[np.ndarray, np.ndarray]:
        """R and p of a link's frame in the world."""
        pin.forwardKinematics(self.model, self.data, self.vector(q))
        b = self.link[name]
        pose = self.data.oMi[self.joint_of[b]] * self.placed[b]
        return pose.rotation, pose.translation

    def link_velocity(self, q, qd, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Angular velocity of a link and velocity of its frame's origin, in the world."""
        pin.forwardKinematics(self.model, self.data, self.vector(q), self.vector(qd))
        b = self.link[name]
        twist = self.placed[b].actInv(self.data.v[self.joint_of[b]])
        R = (self.data.oMi[self.joint_of[b]] * self.placed[b]).rotation
        return R @ twist.angular, R @ twist.linear

    def link_acceleration(self, q, qd, qdd, name: str, point: Sequence[float]) -> np.ndarray:
        """Acceleration of a point of a link, in link axes."""
        pin.forwardKinematics(self.model, self.data, *(self.vector(x) for x in (q, qd, qdd)))
        return classical(self, name, point)

    def reactions(self, q, qd, qdd, wrenches) -> list[tuple[np.ndarray, np.ndarray]]:
        """Moment about the child link's origin and force that each moving joint transmits, in link axes."""
        self.torques(q, qd, qdd, wrenches)
        forces = [self.data.f[self.model.getJointId(name)] for name in self.names]
        return [(np.array(force.angular), np.array(force.linear)) for force in forces]

    def energy(self, q, qd) -> tuple[float, float]:
        """Kinetic energy without rotors, potential energy, J."""
        v = self.vector
        armature = self.model.armature.copy()
        self.model.armature = np.zeros(self.model.nv)
        kinetic = pin.computeKineticEnergy(self.model, self.data, v(q), v(qd))
        self.model.armature = armature
        return float(kinetic), float(pin.computePotentialEnergy(self.model, self.data, v(q)))

    def momentum(self, q, qd) -> tuple[np.ndarray, np.ndarray]:
        """Angular momentum about the world's origin, linear momentum."""
        v = self.vector
        pin.forwardKinematics(self.model, self.data, v(q), v(qd))
        total = pin.Force.Zero()
        for j in range(1, self.model.njoints):
            total += self.data.oMi[j].act(self.model.inertias[j] * self.data.v[j])
        return np.array(total.angular), np.array(total.linear)
