"""Dynamics the long way round: every link's motion in the world by numpy, then virtual work, then linear algebra.

Nothing is shared with met.dynamics but the description of the bodies. Slow, and as plain as can be:

    tau = sum over links of Jv'(m a_c - m g - f) + Jw'(I wd + w x I w - n) + rotor qdd
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from met.dynamics.tree import Body

Array = np.ndarray
Wrenches = Mapping[str, tuple[Sequence[float], Sequence[float]]]


def rotation(axis: Array, angle: float) -> Array:
    """Rodrigues."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)


@dataclass
class LinkState:
    """A link in the world: frame, rates, acceleration of the frame's origin; columns of J are per joint."""

    R: Array
    p: Array
    w: Array
    v: Array
    wd: Array
    a: Array
    Jw: Array
    Jv: Array


class DenseArm:
    """Bodies (parents before children) on a base at rest."""

    def __init__(self, bodies: Sequence[Body], gravity: Sequence[float] = (0.0, 0.0, 0.0),
                 rotor: Sequence[float] | None = None, wrenches: Wrenches | None = None) -> None:
        self.bodies = bodies
        self.n = sum(body.kind != "fixed" for body in bodies)
        self.g = np.array(gravity, float)
        self.rotor = np.zeros(self.n) if rotor is None else np.array(rotor, float)
        self.wrenches = wrenches or {}

    def links(self, q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]) -> list[LinkState]:
        """Every body's state."""
        zero, none = np.zeros(3), np.zeros((3, self.n))
        ground = LinkState(np.eye(3), zero, zero, zero, zero, zero, none, none)
        result: list[LinkState] = []
        i = 0
        for body in self.bodies:
            up = ground if body.parent < 0 else result[body.parent]
            roll, pitch, yaw = map(float, body.rpy)
            at = rotation(np.eye(3)[2], yaw) @ rotation(np.eye(3)[1], pitch) @ rotation(np.eye(3)[0], roll)
            R = up.R @ at
            axis = R @ np.array(body.axis, float)
            r = up.R @ np.array(body.at, float)
            if body.kind == "prismatic":
                r = r + axis * q[i]
            Jw, Jv = up.Jw.copy(), up.Jv - _skew(r) @ up.Jw
            w, wd = up.w, up.wd
            v = up.v + np.cross(w, r)
            a = up.a + np.cross(wd, r) + np.cross(w, np.cross(w, r))
            if body.kind == "revolute":
                R = rotation(axis, q[i]) @ R
                Jw[:, i] = axis
                wd = wd + axis * qdd[i] + np.cross(w, axis * qd[i])
                w = w + axis * qd[i]
            elif body.kind == "prismatic":
                Jv[:, i] = axis
                v = v + axis * qd[i]
                a = a + axis * qdd[i] + 2.0 * np.cross(w, axis * qd[i])
            i += body.kind != "fixed"
            result.append(LinkState(R, up.p + r, w, v, wd, a, Jw, Jv))
        return result

    def torques(self, q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]) -> Array:
        """Inverse dynamics, N m (N), rotors included."""
        tau = self.rotor * np.array(qdd, float)
        for body, link in zip(self.bodies, self.links(q, qd, qdd), strict=True):
            c, J, a_c = self._matter(body, link)
            Jc = link.Jv - _skew(c) @ link.Jw
            tau += Jc.T @ (body.mass * (a_c - self.g)) + link.Jw.T @ (J @ link.wd + np.cross(link.w, J @ link.w))
            if body.name in self.wrenches:
                moment, force = (link.R @ np.array(x, float) for x in self.wrenches[body.name])
                tau -= link.Jv.T @ force + link.Jw.T @ moment
        return tau

    def mass_matrix(self, q: Sequence[float]) -> Array:
        """M(q) with the rotors on its diagonal, by unit accelerations."""
        still = np.zeros(self.n)
        h = self.torques(q, still, still)
        return np.column_stack([self.torques(q, still, row) - h for row in np.eye(self.n)])

    def bias(self, q: Sequence[float], qd: Sequence[float]) -> Array:
        """h(q, qd): torques at no acceleration, gravity and wrenches included."""
        return self.torques(q, qd, np.zeros(self.n))

    def momentum_rate(self, q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]) -> tuple[Array, Array]:
        """d/dt of angular momentum about the world's origin and of linear momentum, of all links."""
        angular, linear = np.zeros(3), np.zeros(3)
        for body, link in zip(self.bodies, self.links(q, qd, qdd), strict=True):
            c, J, a_c = self._matter(body, link)
            linear += body.mass * a_c
            angular += np.cross(link.p + c, body.mass * a_c) + J @ link.wd + np.cross(link.w, J @ link.w)
        return angular, linear

    def applied(self, q: Sequence[float]) -> tuple[Array, Array]:
        """Moment about the world's origin and force of gravity and wrenches on all links."""
        angular, linear = np.zeros(3), np.zeros(3)
        still = np.zeros(self.n)
        for body, link in zip(self.bodies, self.links(q, still, still), strict=True):
            c, _, _ = self._matter(body, link)
            weight = body.mass * self.g
            linear += weight
            angular += np.cross(link.p + c, weight)
            if body.name in self.wrenches:
                moment, force = (link.R @ np.array(x, float) for x in self.wrenches[body.name])
                linear += force
                angular += moment + np.cross(link.p, force)
        return angular, linear

    @staticmethod
    def _matter(body: Body, link: LinkState) -> tuple[Array, Array, Array]:
        """Centre of mass from the link's origin, inertia about it, its acceleration; world axes."""
        xx, yy, zz, xy, xz, yz = map(float, body.inertia)
        c = link.R @ np.array(body.com, float)
        J = link.R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ link.R.T
        return c, J, link.a + np.cross(link.wd, c) + np.cross(link.w, np.cross(link.w, c))


def effective_inertia(
    M: Array, h: Array, tau: Array, qdd: Array, mode: Sequence[bool], rotor: Array, i: int
) -> tuple[float, float]:
    """(J_eff, b) at joint i from M (rotors included) and h, by eliminating the other torque-mode joints.

    The joints in acceleration mode keep their qdd; those in torque mode their tau.
    """
    T = [j for j in range(len(qdd)) if mode[j] and j != i]
    A = [j for j in range(len(qdd)) if not mode[j] and j != i]
    J, b = M[i, i] - rotor[i], h[i] + M[i, A] @ qdd[A]
    if T:
        inner, across = M[np.ix_(T, T)], M[i, T]
        J -= across @ np.linalg.solve(inner, across)
        b += across @ np.linalg.solve(inner, tau[T] - h[T] - M[np.ix_(T, A)] @ qdd[A])
    return float(J), float(b)


def mixed(M: Array, h: Array, tau: Array, qdd: Array, mode: Sequence[bool]) -> tuple[Array, Array]:
    """(qdd, tau) with each joint's unknown solved for; M holds the rotors."""
    T = [j for j in range(len(qdd)) if mode[j]]
    A = [j for j in range(len(qdd)) if not mode[j]]
    found = np.array(qdd, float)
    if T:
        found[T] = np.linalg.solve(M[np.ix_(T, T)], tau[T] - h[T] - M[np.ix_(T, A)] @ found[A])
    return found, M @ found + h


def _skew(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
