"""Dynamics the long way round: every link's motion in the world by numpy, then virtual work, then linear algebra.

Nothing is shared with met.dynamics but the description of the bodies. Slow, and as plain as can be:

    tau = sum over links of Jv'(m a_c - m g - f) + Jw'(I wd + w x I w - n) + rotor qdd
    M   = sum over links of Jv'm Jv + Jw'I Jw + rotor on the diagonal

In numpy's longest floats (64 bits of mantissa on x86-64): sums over thirty links and elimination on M lose four digits
or five, and those would be counted against the recursion, which does not lose them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from met.dynamics.tree import Body

Array = np.ndarray
Wrenches = Mapping[str, tuple[Sequence[float], Sequence[float]]]
LONG = np.longdouble


def rotation(axis: Array, angle: float) -> Array:
    """Rodrigues."""
    x, y, z = axis
    K = _skew(np.array([x, y, z], LONG))
    angle = LONG(angle)
    return np.eye(3, dtype=LONG) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)


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
    """Bodies (parents before children) on a base at rest, or on one that moves as `base` says (its J are not read)."""

    def __init__(
        self,
        bodies: Sequence[Body],
        gravity: Sequence[float] = (0.0, 0.0, 0.0),
        rotor: Sequence[float] | None = None,
        wrenches: Wrenches | None = None,
        base: LinkState | None = None,
    ) -> None:
        self.bodies = bodies
        self.base = base
        self.n = sum(body.kind != "fixed" for body in bodies)
        self.g = np.array(gravity, LONG)
        self.rotor = np.zeros(self.n, LONG) if rotor is None else np.array(rotor, LONG)
        self.wrenches = wrenches or {}

    def links(self, q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]) -> list[LinkState]:
        """Every body's state."""
        zero, none = np.zeros(3, LONG), np.zeros((3, self.n), LONG)
        ground = LinkState(np.eye(3, dtype=LONG), zero, zero, zero, zero, zero, none, none)
        if self.base is not None:
            ground = replace(self.base, Jw=none, Jv=none)
        result: list[LinkState] = []
        i = 0
        for body in self.bodies:
            up = ground if body.parent < 0 else result[body.parent]
            roll, pitch, yaw = body.rpy
            at = rotation(np.eye(3)[2], yaw) @ rotation(np.eye(3)[1], pitch) @ rotation(np.eye(3)[0], roll)
            R = up.R @ at
            axis = R @ np.array(body.axis, LONG)
            r = up.R @ np.array(body.at, LONG)
            if body.kind == "prismatic":
                r = r + axis * q[i]
            Jw, Jv = up.Jw.copy(), up.Jv - _skew(r) @ up.Jw
            w, wd = up.w, up.wd
            v = up.v + np.cross(w, r)
            a = up.a + np.cross(wd, r) + np.cross(w, np.cross(w, r))
            if body.kind == "revolute":
                # In the link's own axes: turned about the axis in the world, R's loss of a right angle would feed
                # on itself, and thirty joints would make 1e-10 of it.
                R = R @ rotation(np.array(body.axis, LONG), q[i])
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
        tau = self.rotor * np.array(qdd, LONG)
        for body, link in zip(self.bodies, self.links(q, qd, qdd), strict=True):
            c, J, a_c = self._matter(body, link)
            Jc = link.Jv - _skew(c) @ link.Jw
            tau += Jc.T @ (body.mass * (a_c - self.g)) + link.Jw.T @ (J @ link.wd + np.cross(link.w, J @ link.w))
            if body.name in self.wrenches:
                moment, force = (link.R @ np.array(x, LONG) for x in self.wrenches[body.name])
                tau -= link.Jv.T @ force + link.Jw.T @ moment
        return tau

    def mass_matrix(self, q: Sequence[float]) -> Array:
        """M(q) with the rotors on its diagonal, from the kinetic energy of the links."""
        still = np.zeros(self.n, LONG)
        M = np.diag(self.rotor)
        for body, link in zip(self.bodies, self.links(q, still, still), strict=True):
            c, J, _ = self._matter(body, link)
            Jc = link.Jv - _skew(c) @ link.Jw
            M = M + LONG(body.mass) * (Jc.T @ Jc) + link.Jw.T @ J @ link.Jw
        return M

    def bias(self, q: Sequence[float], qd: Sequence[float]) -> Array:
        """h(q, qd): torques at no acceleration, gravity and wrenches included."""
        return self.torques(q, qd, np.zeros(self.n, LONG))

    def momentum_rate(self, q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]) -> tuple[Array, Array]:
        """d/dt of angular momentum about the world's origin and of linear momentum, of all links."""
        angular, linear = np.zeros(3, LONG), np.zeros(3, LONG)
        for body, link in zip(self.bodies, self.links(q, qd, qdd), strict=True):
            c, J, a_c = self._matter(body, link)
            linear += body.mass * a_c
            angular += np.cross(link.p + c, body.mass * a_c) + J @ link.wd + np.cross(link.w, J @ link.w)
        return angular, linear

    def applied(self, q: Sequence[float]) -> tuple[Array, Array]:
        """Moment about the world's origin and force of gravity and wrenches on all links."""
        angular, linear = np.zeros(3, LONG), np.zeros(3, LONG)
        still = np.zeros(self.n, LONG)
        for body, link in zip(self.bodies, self.links(q, still, still), strict=True):
            c, _, _ = self._matter(body, link)
            weight = body.mass * self.g
            linear += weight
            angular += np.cross(link.p + c, weight)
            if body.name in self.wrenches:
                moment, force = (link.R @ np.array(x, LONG) for x in self.wrenches[body.name])
                linear += force
                angular += moment + np.cross(link.p, force)
        return angular, linear

    @staticmethod
    def _matter(body: Body, link: LinkState) -> tuple[Array, Array, Array]:
        """Centre of mass from the link's origin, inertia about it, its acceleration; world axes."""
        xx, yy, zz, xy, xz, yz = body.inertia
        c = link.R @ np.array(body.com, LONG)
        J = link.R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], LONG) @ link.R.T
        return c, J, link.a + np.cross(link.wd, c) + np.cross(link.w, np.cross(link.w, c))


def effective_inertia(
    M: Array, h: Array, tau: Array, qdd: Array, mode: Sequence[bool], rotor: Array
) -> list[tuple[float, float]]:
    """(J_eff, b) at every joint from M (rotors included) and h, all other joints keeping their modes.

    Of tau and qdd what is given is read: qdd in acceleration mode, tau in torque mode. With T the joints in torque
    mode, J_i = M_ii - M_iT M_TT^-1 M_Ti where i is not of T; where it is, 1/J_i is the diagonal entry of M_TT^-1.
    """
    qdd, tau = mixed(M, h, tau, qdd, mode)
    T = [j for j in range(len(qdd)) if mode[j]]
    inverse = eliminate(M[np.ix_(T, T)], np.eye(len(T), dtype=LONG))
    result = []
    for i in range(len(qdd)):
        J = 1.0 / inverse[T.index(i), T.index(i)] if mode[i] else M[i, i] - M[i, T] @ inverse @ M[T, i]
        J = J - rotor[i]
        result.append((float(J), float(tau[i] - rotor[i] * qdd[i] - J * qdd[i])))
    return result


def mixed(M: Array, h: Array, tau: Array, qdd: Array, mode: Sequence[bool]) -> tuple[Array, Array]:
    """(qdd, tau) with each joint's unknown solved for; M holds the rotors."""
    T = [j for j in range(len(qdd)) if mode[j]]
    A = [j for j in range(len(qdd)) if not mode[j]]
    found = np.array(qdd, LONG)
    if T:
        right = tau[T] - h[T] - M[np.ix_(T, A)] @ found[A]
        found[T] = eliminate(M[np.ix_(T, T)], right[:, None])[:, 0]
    return found, M @ found + h


def eliminate(A: Array, B: Array) -> Array:
    """A^-1 B of a symmetric positive definite A, by Gauss: numpy's own solver knows no long floats."""
    A, B = np.array(A, LONG), np.array(B, LONG)
    for k in range(len(A)):
        share = A[k + 1 :, k : k + 1] / A[k, k]
        A[k + 1 :, k:] -= share * A[k, k:]
        B[k + 1 :] -= share * B[k]
    for k in reversed(range(len(A))):
        B[k] = (B[k] - A[k, k + 1 :] @ B[k + 1 :]) / A[k, k]
    return B


def _skew(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]], LONG)
