"""Derivatives of an arm's accelerations by its state, in closed form: inverse dynamics differentiated, solved with the
factors of the mass matrix.

    M dqdd = dtau - (d ID/dq) dq - (d ID/dqd) dqd        ID = M(q) qdd + h(q, qd), at the qdd that was found

The derivatives of ID are those of J. Carpentier and N. Mansard, Analytical Derivatives of Rigid Body Dynamics
Algorithms, RSS 2018, in the terms of S. Singh, R. Russo and P. Wensing, Efficient Analytical Derivatives of Rigid-Body
Dynamics Using Spatial Vector Algebra, IEEE Robotics and Automation Letters 7, 2022: for body i's motion axis S they
need

    psi   the rate of S as a part of the link before it;   psi'  the rate of that, less S x what accelerates the link
    E, p  of a subtree, E = -2 sum m r x v x, p = 2 sum m v: with a rate dw more, Coriolis forces are E dw, dw x p

and with t4 = I S, t3 = 2 (B S + I psi), t2 = 2 B psi + I psi' + S x* f, t1 = 2 B'S of the subtree of j, for i inboard:

    M_ij = S_i't4     dID_i/dq_j = S_i't2     dID_j/dq_i = t1'psi_i + t4'psi'_i
                      dID_i/dqd_j = S_i't3    dID_j/dqd_i = t1'S_i + 2 t4'psi_i

All is in the recursion's own frames, in which S has one component. A frame does not rest: velocities v count from its
origin, and change with it from frame to frame. So those of origins are never asked for, psi and psi' have few
components, and t1 is a moment without a force.

M = L'DL, from tips to base and without a number where two joints are on different branches (Featherstone, 2008,
ch. 8.3). D are those of this elimination: the recursion's own are the same numbers but for rounding, and with them that
rounding grows along a chain, by seven digits to twenty joints. Where a joint is in acceleration mode its 1/D is 0, and
it drops out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from met.dynamics.joints import JointTransform, X, Z
from met.dynamics.recursion import Solved, Wrench, loads_on_bodies
from met.dynamics.spatial import (
    Nine,
    Real,
    Rigid,
    Symmetric,
    Vector,
    add,
    apply_symmetric,
    choose,
    cross,
    dot,
    is_zero,
    lower_vector,
    raise_turned,
    raise_vector,
    rigid_shift,
    rigid_sum,
    scale,
    shift_force,
    sub,
)
from met.dynamics.tree import Tree, each_number
from met.frozen import frozen
from met.trace import Mask
from met.trace.derivative import KnownDerivative, Tangent
from met.trace.nodes import Nodes
from met.trace.primitives import divide
from met.trace.scalar import Scalar

Entries = dict[tuple[int, int], Real]
"""A matrix by (row, column), joints by number; joints on different branches have no entry."""


@frozen
class LinearisedDynamics:
    """The derivative of `recursion.solve` by q, qd, tau, the given accelerations and wrenches, at the solved state; the
    base's motion is given.

    M             mass matrix, without rotors: (i, j) where i is j or inboard of it, kg m^2 (kg)
    by_q, by_qd   of the torques of inverse dynamics, N m/rad, N m s/rad ...
    L             by (outboard, inboard): the unit lower triangle of M = L'DL, M with rotors
    Dinv          by joint, 1/D of it; 0 in acceleration mode
    """

    tree: Tree
    solved: Solved
    M: Entries
    by_q: Entries
    by_qd: Entries
    L: Entries
    Dinv: list[Real]

    def along(
        self,
        q: Sequence[Real],
        qd: Sequence[Real],
        tau: Sequence[Real],
        qdd: Sequence[Real],
        wrenches: Mapping[str, Wrench] | None = None,
    ) -> tuple[list[Real], list[Real]]:
        """The change of `qdd` and `tau_load` of `Solved` for these changes of the arguments of `solve`. tau counts for
        joints in torque mode, qdd for those in acceleration mode; wrenches None: unchanged."""
        solved, joints = self.solved, range(len(self.tree.joints))
        lacking = self._load_torques(wrenches)
        for (i, j), entry in self.by_q.items():
            lacking[i] = lacking[i] - entry * q[j]
        for (i, j), entry in self.by_qd.items():
            lacking[i] = lacking[i] - entry * qd[j]
        prescribed = [choose(solved.mode[i], 0.0, qdd[i]) for i in joints]
        left = [tau[i] + x for i, x in enumerate(self._less_inertia(lacking, prescribed))]
        for i in reversed(self.tree.order):
            for inboard in self._inboard(i):
                left[inboard] = left[inboard] - self.L[i, inboard] * left[i]
        moved: list[Real] = [0.0] * len(joints)
        for i in self.tree.order:
            moved[i] = left[i] * self.Dinv[i]
            for inboard in self._inboard(i):
                moved[i] = moved[i] - self.L[i, inboard] * moved[inboard]
        changes = [choose(solved.mode[i], moved[i], prescribed[i]) for i in joints]
        needed = self._less_inertia(lacking, changes)
        felt = [choose(solved.mode[i], tau[i] - solved.rotor[i] * changes[i], -needed[i]) for i in joints]
        return changes, felt

    def _less_inertia(self, torques: Sequence[Real], qdd: Sequence[Real]) -> list[Real]:
        """Torques less those of the mass matrix, M qdd, by joint."""
        left = list(torques)
        for (i, j), entry in self.M.items():
            left[i] = left[i] - entry * qdd[j]
            if i != j:
                left[j] = left[j] - entry * qdd[i]
        return left

    def _load_torques(self, wrenches: Mapping[str, Wrench] | None) -> list[Real]:
        """Torques of wrenches on links, at the joints, N m (N)."""
        tree = self.tree
        total = list(loads_on_bodies(tree, wrenches)[0])
        torques: list[Real] = [0.0] * len(total)
        for i in reversed(tree.order):
            joint = tree.joints[i]
            torques[i] = (*total[i][0], *total[i][1])[joint.axis]
            if joint.parent >= 0:
                total[joint.parent] = _sum(total[joint.parent], self.solved.steps[i].raise_force(*total[i]))
        return torques

    def _inboard(self, i: int) -> list[int]:
        return _inboard(self.tree, i)


def _inboard(tree: Tree, i: int) -> list[int]:
    """The joints between a joint and the base, the nearest first."""
    inboard: list[int] = []
    while (i := tree.joints[i].parent) >= 0:
        inboard.append(i)
    return inboard


@frozen
class _Subtree:
    """Everything outboard of a frame, about its origin: its bodies as one, E and p (head of this file), and the wrench
    that moves it."""

    body: Rigid
    E: Nine
    p: Vector
    wrench: Wrench

    def shifted(self, d: Vector, b: Vector) -> _Subtree:
        """The subtree about another origin, from which this one is at d and moves at b."""
        body = rigid_shift(self.body, d)
        E = _less(_less(self.E, _two_cross(d, self.p)), _two_cross(scale(2.0, body.h), b))
        moment, force = self.wrench
        for axis in (X, 1, Z):
            moment = shift_force(axis, d[axis], moment, force)
        return _Subtree(body, E, add(self.p, scale(2.0 * self.body.mass, b)), (moment, force))

    def turned(self, axis: int, turn: tuple[Real, Real]) -> _Subtree:
        """The subtree in axes turned about this axis."""
        m, h, J = self.body
        both = raise_turned(axis, turn, Symmetric(J, self.E, (0.0,) * 6))
        h, p, moment, force = (raise_vector(axis, turn, a) for a in (h, self.p, *self.wrench))
        return _Subtree(Rigid(m, h, both.A), both.B, p, (moment, force))

    def with_rigid(self, other: _Subtree) -> _Subtree:
        """The subtree with another one fixed to it."""
        E = tuple(a + b for a, b in zip(self.E, other.E, strict=True))
        return _Subtree(
            rigid_sum(self.body, other.body), E, add(self.p, other.p), _sum(self.wrench, other.wrench)  # type: ignore[arg-type]
        )  # fmt: skip


@frozen
class _Answer:
    """t1 to t4 of a joint's subtree (head of this file), in a frame that is moved towards the base."""

    t1: Vector
    t2: Wrench
    t3: Wrench
    t4: Wrench

    def raised(self, step: JointTransform, far: Vector, near: Vector) -> _Answer:
        """The terms in the parent's frame. far, near: velocity of the child's origin before its slide, in the child's
        axes, and of that place from the parent's origin, in the parent's axes after the swing."""
        t1 = add(self.t1, cross(far, scale(2.0, self.t4[1])))
        t1 = raise_vector(X, step.twist, raise_vector(Z, step.turn, t1))
        force = raise_vector(X, step.twist, raise_vector(Z, step.turn, self.t4[1]))
        t1 = raise_vector(Z, step.swing, add(t1, cross(near, scale(2.0, force))))
        return _Answer(t1, *(step.raise_force(*t) for t in (self.t2, self.t3, self.t4)))


def linearised(tree: Tree, qd: Sequence[Real], solved: Solved) -> LinearisedDynamics:
    """The derivative of a pass of the recursion, at its solution.

    qd  as it was given; zeros where velocity products were left out
    """
    if tree.floating is not None:
        raise ValueError("a free base is not linearised in closed form")
    joints, n = tree.joints, len(tree.joints)
    whole: list[_Subtree | None] = [None] * n
    M: Entries = {}
    by_q: Entries = {}
    by_qd: Entries = {}
    # by joint, the terms of it and of everything outboard of it, in its frame
    answers: list[dict[int, _Answer]] = [{} for _ in joints]
    for i in reversed(tree.order):
        joint, k = joints[i], joints[i].axis
        outboard = whole[i]
        subtree = _own(tree, solved, i)
        subtree = subtree if outboard is None else outboard.with_rigid(subtree)
        w, wd, a = solved.w[i], solved.wd[i], solved.a[i]
        wx, wy, wz = w
        psi = (wy, -wx, 0.0)
        more = (wd[1] + wx * wz, wy * wz - wd[0], -(wx * wx + wy * wy))
        revolute = joint.kind == "revolute"
        mine = _revolute(subtree, psi, more, a) if revolute else _prismatic(subtree, psi, more)
        answers[i][i] = mine
        for j, answer in answers[i].items():
            (t4, t3, t2) = ((*t[0], *t[1]) for t in (answer.t4, answer.t3, answer.t2))
            M[i, j], by_q[i, j], by_qd[i, j] = t4[k], t2[k], t3[k]
            if i == j:
                continue
            if revolute:
                coriolis = answer.t1[0] * psi[0] + answer.t1[1] * psi[1]
                by_q[j, i] = coriolis + dot(t4[:3], more) + (t4[3] * a[1] - t4[4] * a[0])
                by_qd[j, i] = answer.t1[2] + 2.0 * (t4[0] * psi[0] + t4[1] * psi[1])
            else:
                by_q[j, i] = dot(t4[3:], more)
                by_qd[j, i] = 2.0 * (t4[3] * psi[0] + t4[4] * psi[1])
        parent = joint.parent
        if parent < 0:
            continue
        step = solved.steps[i]
        far = (wy * step.slide, -wx * step.slide, 0.0 if revolute else qd[i])
        near = cross(lower_vector(Z, step.swing, solved.w[parent]), step.offset)
        raised = subtree.shifted((0.0, 0.0, step.slide), far).turned(Z, step.turn).turned(X, step.twist)
        raised = raised.shifted(step.offset, near).turned(Z, step.swing)
        before = whole[parent]
        whole[parent] = raised if before is None else before.with_rigid(raised)
        answers[parent] |= {j: answer.raised(step, far, near) for j, answer in answers[i].items()}
    return LinearisedDynamics(tree, solved, M, by_q, by_qd, *_factor(tree, solved, M))


def _factor(tree: Tree, solved: Solved, M: Entries) -> tuple[Entries, list[Real]]:
    """L and 1/D of M = L'DL, of M with the rotors."""
    left, L = dict(M), Entries()
    Dinv: list[Real] = [0.0] * len(tree.joints)
    for k in reversed(tree.order):
        D = left[k, k] + solved.rotor[k]
        Dinv[k] = choose(solved.mode[k], 1.0 / D if isinstance(D, Scalar) else divide(1.0, D), 0.0)
        inboard = _inboard(tree, k)
        for place, i in enumerate(inboard):
            L[k, i] = left[i, k] * Dinv[k]
            for j in inboard[: place + 1]:
                left[i, j] = left[i, j] - L[k, i] * left[j, k]
    return L, Dinv


def _own(tree: Tree, solved: Solved, i: int) -> _Subtree:
    """The inertia, force and their derivative terms of the body that joint i carries, in its frame, without the joints
    beyond."""
    m, h, J = body = tree.joints[i].dynamic
    w, wd, a = solved.w[i], solved.wd[i], solved.a[i]
    Jw = apply_symmetric(J, w)
    moment = add(add(apply_symmetric(J, wd), cross(h, a)), cross(w, Jw))
    wh = cross(w, h)
    force = add(add(scale(m, a), cross(wd, h)), cross(w, wh))
    moment, force = sub(moment, solved.load[i][0]), sub(force, solved.load[i][1])
    # -2 times the second moments of mass about the origin: 2 J - tr J
    xx, xy, xz, yy, yz, zz = J
    second = (
        (xx - yy - zz, 2.0 * xy, 2.0 * xz),
        (2.0 * xy, yy - xx - zz, 2.0 * yz),
        (2.0 * xz, 2.0 * yz, zz - xx - yy),
    )
    columns = [cross(w, column) for column in second]
    E = tuple(columns[j][i] for i in range(3) for j in range(3))
    return _Subtree(body, E, scale(2.0, wh), (moment, force))  # type: ignore[arg-type]


def _revolute(subtree: _Subtree, psi: Vector, more: Vector, a: Vector) -> _Answer:
    """The terms t1 to t4 (head of this file) of a joint that turns about z; psi, more: the angular parts of psi and
    psi'."""
    (m, h, J), E, p = subtree.body, subtree.E, subtree.p
    along = (a[1], -a[0], 0.0)
    rows = (E[0:3], E[3:6], E[6:9])
    n, f = subtree.wrench
    of_rates = (dot(rows[0], psi), dot(rows[1], psi), dot(rows[2], psi)), cross(psi, p)
    of_accelerations = (
        add(apply_symmetric(J, more), cross(h, along)),
        add(scale(m, along), cross(more, h)),
    )
    turned: Wrench = ((-n[1], n[0], 0.0), (-f[1], f[0], 0.0))
    twice = scale(2.0, psi)
    return _Answer(
        t1=rows[2],
        t2=_sum(_sum(of_rates, of_accelerations), turned),
        t3=(
            add((E[2], E[5], E[8]), apply_symmetric(J, twice)),
            add((-p[1], p[0], 0.0), cross(twice, h)),
        ),
        t4=((J[2], J[4], J[5]), (-h[1], h[0], 0.0)),
    )


def _prismatic(subtree: _Subtree, psi: Vector, more: Vector) -> _Answer:
    """The terms t1 to t4 (head of this file) of a joint that slides along z; psi, more: the linear parts of psi and
    psi'."""
    (m, h, _), p, f = subtree.body, subtree.p, subtree.wrench[1]
    twice = scale(2.0, psi)
    return _Answer(
        t1=(p[1], -p[0], 0.0),
        t2=(add(cross(h, more), (-f[1], f[0], 0.0)), scale(m, more)),
        t3=(cross(h, twice), scale(m, twice)),
        t4=((h[1], -h[0], 0.0), (0.0, 0.0, m)),
    )


def _two_cross(x: Vector, y: Vector) -> Nine:
    """The matrix of x cross (y cross .), y x' - x'y 1."""
    away = [is_zero(e) for e in x], [is_zero(e) for e in y]
    if all(away[0]) or all(away[1]):
        return (0.0,) * 9
    e = [[y[i] * x[j] for j in range(3)] for i in range(3)]
    return (
        -(e[1][1] + e[2][2]), e[0][1], e[0][2],
        e[1][0], -(e[0][0] + e[2][2]), e[1][2],
        e[2][0], e[2][1], -(e[0][0] + e[1][1]),
    )  # fmt: skip


def _less(A: Nine, B: Nine) -> Nine:
    return tuple(a - b for a, b in zip(A, B, strict=True))  # type: ignore[return-value]


def _sum(a: Wrench, b: Wrench) -> Wrench:
    return add(a[0], b[0]), add(a[1], b[1])


MOVING = ("q", "qd", "tau", "qdd", "wrenches")
"""The arguments of `recursion.solve` by which its derivative is known, by name."""


def tell(tree: Tree, arguments: Mapping[str, Any], solved: Solved) -> None:
    """Give the graph in which `recursion.solve` was recorded the derivative of its results (`met.trace.derivative`).

    arguments  those of `solve`, by name, `velocity_products` with them
    """
    moving = {name: arguments[name] for name in MOVING}
    scalars = _scalars(moving)
    if tree.floating is not None or not scalars:
        return
    held = _scalars({"tree": tree} | {name: value for name, value in arguments.items() if name not in MOVING})
    # a result that existed before the arguments belongs to another pass, which knows less, or was given
    last = max(x.ref >> 1 for x in (*scalars, *held))
    results = (
        *solved.qdd,
        *(x if mode is not True else 0.0 for x, mode in zip(solved.tau_load, solved.mode, strict=True)),
    )
    places = [place for place, x in enumerate(results) if isinstance(x, Scalar) and x.ref >> 1 > last]
    if not places:
        return
    if not arguments["velocity_products"]:
        moving["qd"] = (0.0,) * len(tree.joints)

    def moves(graph: Nodes) -> Callable[[Tangent], list[int]]:
        """The derivatives of the recursion's results in a graph, as a function of a tangent (the direction of a
        derivative)."""
        in_graph = _in_graph((tree, moving, solved), graph)
        derivative = linearised(in_graph[0], in_graph[1]["qd"], in_graph[2])

        def along(tangent: Tangent) -> list[int]:
            move = {name: _tangents(graph, value, tangent) for name, value in in_graph[1].items()}
            ends = [x for part in derivative.along(**move) for x in part]
            return [x.ref if isinstance(x, Scalar) else graph.constant(x) for x in (ends[place] for place in places)]

        return along

    refs = tuple(x.ref for x in (results[place] for place in places) if isinstance(x, Scalar))
    scalars[0].graph.known.append(KnownDerivative(refs, tuple(x.ref for x in held), moves))


def _scalars(value: Any) -> list[Scalar]:
    """The recorded numbers in nested dataclasses, tuples and dictionaries."""
    by_ref: dict[int, Scalar] = {}

    def see(_: str, x: Any) -> Any:
        if isinstance(x, Scalar):
            by_ref[x.ref] = x
        return x

    each_number("", value, see)
    return list(by_ref.values())


def _in_graph(value: Any, graph: Nodes) -> Any:
    """The value with its numbers moved to another graph that has the nodes of the first one."""
    return each_number("", value, lambda _, x: type(x)(graph, x.ref) if isinstance(x, (Scalar, Mask)) else x)


def _tangents(graph: Nodes, value: Any, tangent: Tangent) -> Any:
    """The tangents of the numbers in nested tuples and dictionaries."""
    if isinstance(value, dict):
        return {name: _tangents(graph, part, tangent) for name, part in value.items()}
    if isinstance(value, tuple):
        return tuple(_tangents(graph, part, tangent) for part in value)
    return Scalar(graph, tangent(value.ref)) if isinstance(value, Scalar) else 0.0
