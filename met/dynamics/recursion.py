"""The recursion: joint accelerations from torques and torques from accelerations, in one pass, joint by joint.

docs/physics.md, section 1; Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 7 and 9. Symbols are the
book's, in the recursion's own frames (`joints`), six-vectors angular over linear; k is the joint's component of a
six-vector (S is 1 there and 0 elsewhere), so that U = IA S is a column and S'a a component.

One formula serves both modes. With r the rotor's inertia and D = S'IA S + r:

                torque mode           acceleration mode
    Dinv        1/D                   0
    e           (tau - S'pA)/D        qdd
    rest        r/D                   1

    handed on:  Ia = IA - U U' Dinv, whose row and column k are rest * U
                pa = pA + Ia c + U e, whose component k is tau - r e + ... in torque mode
    outward:    S'a = e - Dinv sum(U_j a'_j, j != k) + rest * a'_k,  qdd = S'a - a'_k

A rotor that turns about the joint's axis, in the link before the joint, also takes its parent's rotation and gives it
its own: with g its spin, h = (0, 0, g; 0, 0, 0) and U = IA S + h, all of this holds but where IA S itself is meant:

    rest        (r - h_k)/D
    handed on:  column k of Ia is rest * IA S, less U Dinv g in entry (2, k); and the parent takes w x (0, 0, g qd)

A rotor that turns freely about that axis (`FreeRotor`) does not take part in the rotation of its link about it: its
inertia J leaves Ia, the torque on it and w x (0, 0, L) come to pa.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from met.dynamics.floating import Factors, accelerated, factors
from met.dynamics.joints import JointTransform
from met.dynamics.spatial import (
    AT,
    NOTHING,
    ZERO,
    Real,
    Rigid,
    Six,
    Symmetric,
    Vector,
    add,
    add_rigid,
    apply_symmetric,
    choose,
    cross,
    dot,
    is_zero,
    scale,
    shift_motion,
    sub,
    symmetric_sum,
    turn_vector,
    turn_vector_back,
)
from met.dynamics.tree import Tree
from met.frozen import frozen
from met.trace import Mask, Truth, both
from met.trace.primitives import divide
from met.trace.scalar import Scalar

Wrench = tuple[Vector, Vector]
"""Moment about a frame's origin (N m) and force (N), in that frame's axes."""

SINGULAR = 1e-13
"""Share of the outboard inertia (`TreeJoint.reach`) below which D is rounding noise: some hundred roundings."""


class FreeRotor(NamedTuple):
    """A rotor, in the link before a joint, that turns about the joint's axis at a rate of its own: behind an elastic
    gear.

    inertia   J, kg m^2, also part of its link's; 0 while it does not turn against its link
    torque    on it about its axis, N m
    momentum  L, J times its rate against its link, kg m^2/s
    """

    inertia: Real
    torque: Real
    momentum: Real


@frozen
class Solved:
    """Results of one pass. Sequences have one entry a moving joint, in the tree's order of joints.

    qdd         joint accelerations, rad/s^2 (m/s^2): given or solved
    tau         joint torques, N m (N), the rotor's share included: given or solved
    tau_load    tau - rotor * qdd, what the arm takes: the S component of the joint's reaction
    D           S'IA S + rotor, kg m^2 (kg)
    singular    whether the joint is in torque mode and D is nothing: qdd is then undefined
    base_acceleration   of the base frame's origin, angular and linear, base axes: given, or solved where it is free
    base_singular       whether a free base has no inertia in some direction: nothing is then defined

    In the recursion's frames and with regrouped inertia (`tree`), for `effective_inertia`, `reactions`:

    mode, rotor, spin, steps, w (angular velocity), wd and a (angular acceleration; acceleration of the frame's origin
    less gravity), U (column k of IA, and the rotor's spin), D0 (entry k of IA), Dinv, load (wrench that was applied to
    the body), rate (that the joint was given), free_rotors, base (IA_0 of a free one, taken apart); and `about`, the
    angular acceleration about the joint's axis of the link before it, rad/s^2.
    """

    qdd: tuple[Real, ...]
    tau: tuple[Real, ...]
    tau_load: tuple[Real, ...]
    D: tuple[Real, ...]
    singular: tuple[Truth, ...]
    mode: tuple[Truth, ...]
    rotor: tuple[Real, ...]
    spin: tuple[Real, ...]
    steps: tuple[JointTransform, ...]
    w: tuple[Vector, ...]
    wd: tuple[Vector, ...]
    a: tuple[Vector, ...]
    U: tuple[Six, ...]
    D0: tuple[Real, ...]
    Dinv: tuple[Real, ...]
    load: tuple[Wrench, ...]
    rate: tuple[Real, ...]
    free_rotors: tuple[FreeRotor | None, ...]
    about: tuple[Real, ...]
    base_acceleration: Wrench
    base_singular: Truth = False
    base: Factors | None = None


def solve(
    tree: Tree,
    q: Sequence[Real],
    qd: Sequence[Real],
    *,
    tau: Sequence[Real] | None = None,
    qdd: Sequence[Real] | None = None,
    mode: Sequence[Truth] | Truth = True,
    rotor: Sequence[Real] | None = None,
    spin: Sequence[Real] | None = None,
    free_rotors: Sequence[FreeRotor | None] | None = None,
    gravity: Vector = ZERO,
    base_acceleration: tuple[Vector, Vector] = (ZERO, ZERO),
    base_rate: Vector = ZERO,
    wrenches: Mapping[str, Wrench] | None = None,
    velocity_products: bool = True,
) -> Solved:
    """The arm's motion at one instant, each joint in torque mode or in acceleration mode.

    q, qd       positions and rates of the moving joints (`tree.joints`), rad, rad/s (m, m/s)
    tau         torques, N m (N); read where the joint is in torque mode. None: zeros
    qdd         accelerations, rad/s^2 (m/s^2); read where it is in acceleration mode. None: zeros
    mode        True: torque mode; False: acceleration mode; a Mask chooses when the program runs
    rotor       N^2 J_m behind each joint, kg m^2 (kg). None: none
    spin        N J_m of the rotor behind each joint, which turns about the joint's axis in the link before it,
                kg m^2 (kg m): its angular momentum there, for a rate of 1. None: rotors take and give no spin
    free_rotors by joint, rotors that turn otherwise than it does. None: none
    gravity     acceleration of free fall, world axes, m/s^2
    base_acceleration  angular and linear acceleration of the base frame's origin, base axes, rad/s^2, m/s^2: the
                derivative of its velocity (not Featherstone's spatial acceleration). The base's linear velocity has
                no effect on the arm, its angular velocity is `base_rate`, rad/s. Gravity is in base axes then
    wrenches    by link's name: moment about the link frame's origin and force on the link, link axes, N m and N
    velocity_products  False leaves out Coriolis, centrifugal and gyroscopic terms: M qdd + g(q) = tau + J'f

    Where the base moves freely (`Tree.floating`) its acceleration is solved, not given, and velocity products are left
    out only at rest.
    """
    if tree.floating is not None and (
        base_acceleration != (ZERO, ZERO)
        or (not velocity_products and any(not is_zero(rate) for rate in (*qd, *base_rate)))
    ):
        raise ValueError("a free base is given no acceleration, and moves with all velocity products")
    joints = tree.joints
    n = len(joints)
    tau = (0.0,) * n if tau is None else tau
    qdd = (0.0,) * n if qdd is None else qdd
    rotor = (0.0,) * n if rotor is None else rotor
    spin = (0.0,) * n if spin is None else spin
    free_rotors = (None,) * n if free_rotors is None else free_rotors
    modes = tuple(_truth(m) for m in mode) if isinstance(mode, Sequence) else (_truth(mode),) * n
    steps = tree.transforms(q)
    base_w, base_wd, base_a = _base(tree, gravity, base_acceleration, base_rate if velocity_products else ZERO)

    # Base to tips: angular velocities and the accelerations that are products of velocities, c = (c_w, c_a), in the
    # child's frame, and the part `far` that belongs to the offset, in the parent's.
    w: list[Vector] = [ZERO] * n
    c: list[Wrench] = [(ZERO, ZERO)] * n
    far: list[Vector] = [ZERO] * n
    if velocity_products:
        for i in tree.order:
            joint, step = joints[i], steps[i]
            w_parent = base_w if joint.parent < 0 else w[joint.parent]
            far[i] = step.offset_product(w_parent)
            carried = step.lower_rate(w_parent)
            along = (0.0, 0.0, qd[i])
            slide = cross(carried, cross(carried, (0.0, 0.0, step.slide)))
            if joint.kind == "revolute":
                w[i] = add(carried, along)
                turning = cross(carried, along)
                c[i] = (turning, slide)
            else:
                w[i] = carried
                c[i] = (ZERO, add(slide, scale(2.0, cross(carried, along))))

    # Tips to base: articulated inertias and bias wrenches.
    load, base_load = loads_on_bodies(tree, wrenches)
    base_IA: Symmetric = NOTHING
    base_p: Wrench = (ZERO, ZERO)
    IA: list[Symmetric] = [NOTHING] * n
    p: list[Wrench] = [(ZERO, ZERO)] * n
    U: list[Six] = [(0.0,) * 6] * n
    D0: list[Real] = [0.0] * n
    Dinv: list[Real] = [0.0] * n
    rest: list[Real] = [0.0] * n
    e: list[Real] = [0.0] * n
    for i in reversed(tree.order):
        joint, k = joints[i], joints[i].axis
        M = add_rigid(IA[i], joint.dynamic)
        moment, force = p[i]
        if velocity_products:
            gyroscopic, centrifugal = rate_wrench(joint.dynamic, w[i])
            moment, force = add(moment, gyroscopic), add(force, centrifugal)
        pA = (*sub(moment, load[i][0]), *sub(force, load[i][1]))
        IA[i], p[i] = M, (pA[:3], pA[3:])
        column, g = M.column(k), spin[i]
        turns = not is_zero(g)
        U[i] = (*column[:2], column[2] + g, *column[3:]) if turns else column
        D0[i], of_axis = column[k], g if k == 2 else 0.0
        Dinv[i], e[i], rest[i] = _resolve(modes[i], D0[i], rotor[i], of_axis, tau[i] - pA[k], qdd[i])
        if joint.parent < 0 and tree.floating is None:
            continue
        Ia = _handed_on(M, k, U[i], Dinv[i], rest[i], g)
        own = choose(modes[i], tau[i] - rotor[i] * e[i], pA[k] + D0[i] * e[i])
        if turns and k == 2:
            own = own + g * e[i]
        pa = [own if j == k else pA[j] + U[i][j] * e[i] for j in range(6)]
        extra = _apply(Ia, c[i])
        moment, force = add(tuple(pa[:3]), extra[0]), add(tuple(pa[3:]), extra[1])  # type: ignore[arg-type]
        if turns and velocity_products:
            moment = add(moment, cross(w[i], (0.0, 0.0, g * qd[i])))
        free = free_rotors[i]
        if free is not None:
            Ia = Ia._replace(A=(*Ia.A[:5], Ia.A[5] - free.inertia))
            moment = add(moment, (0.0, 0.0, free.torque))
            if velocity_products:
                moment = add(moment, cross(w[i], (0.0, 0.0, free.momentum)))
        raised, moment, force = steps[i].raise_articulated(Ia, moment, force, far[i])
        if joint.parent < 0:
            base_IA = symmetric_sum(base_IA, raised)
            base_p = (add(base_p[0], moment), add(base_p[1], force))
            continue
        IA[joint.parent] = symmetric_sum(IA[joint.parent], raised)
        p[joint.parent] = (add(p[joint.parent][0], moment), add(p[joint.parent][1], force))

    base: Factors | None = None
    base_singular: Truth = False
    if tree.floating is not None:
        base_IA = add_rigid(base_IA, tree.floating.dynamic)
        limits = (SINGULAR * tree.floating.mass, SINGULAR * tree.floating.reach)
        base, base_singular = factors(base_IA, limits)
        gyroscopic, centrifugal = rate_wrench(tree.floating.dynamic, base_w)
        base_wd, base_a = accelerated(
            base, sub(base_load[0], add(base_p[0], gyroscopic)), sub(base_load[1], add(base_p[1], centrifugal))
        )
        base_acceleration = _of_base_frame(tree, gravity, base_rate, base_wd, base_a)

    # Base to tips: the accelerations and the results.
    wd: list[Vector] = [ZERO] * n
    a: list[Vector] = [ZERO] * n
    about: list[Real] = [0.0] * n
    solved: list[tuple[Real, Real, Real]] = [(0.0, 0.0, 0.0)] * n
    for i in tree.order:
        joint, k = joints[i], joints[i].axis
        parent = (base_wd, base_a) if joint.parent < 0 else (wd[joint.parent], a[joint.parent])
        turning, linear = steps[i].lower_acceleration(*parent, far[i])
        before = (*add(turning, c[i][0]), *add(linear, c[i][1]))
        about[i] = before[2]
        others = [j for j in range(6) if j != k]
        through = dot([U[i][j] * Dinv[i] for j in others], [before[j] for j in others])
        own = e[i] - through + rest[i] * before[k]
        after = (*before[:k], own, *before[k + 1 :])
        wd[i], a[i] = after[:3], after[3:]  # type: ignore[assignment]
        qdd_i = choose(modes[i], own - before[k], qdd[i])
        needed = (*p[i][0], *p[i][1])[k] + dot(U[i], after)
        if k == 2 and not is_zero(spin[i]):
            needed = needed - spin[i] * qdd_i  # the rotor feels its parent's rotation alone
        tau_load = choose(modes[i], tau[i] - rotor[i] * qdd_i, needed)
        solved[i] = (qdd_i, choose(modes[i], tau[i], tau_load + rotor[i] * qdd_i), tau_load)

    D = tuple(x + y for x, y in zip(D0, rotor, strict=True))
    return Solved(
        qdd=tuple(s[0] for s in solved),
        tau=tuple(s[1] for s in solved),
        tau_load=tuple(s[2] for s in solved),
        D=D,
        singular=tuple(both(modes[i], D[i] <= SINGULAR * joints[i].reach) for i in range(n)),
        mode=modes,
        rotor=tuple(rotor),
        spin=tuple(spin),
        steps=steps,
        w=tuple(w),
        wd=tuple(wd),
        a=tuple(a),
        U=tuple(U),
        D0=tuple(D0),
        Dinv=tuple(Dinv),
        load=load,
        rate=tuple(qd),
        free_rotors=tuple(free_rotors),
        about=tuple(about),
        base_acceleration=base_acceleration,
        base_singular=base_singular,
        base=base,
    )


def reactions(tree: Tree, solved: Solved) -> tuple[Wrench, ...]:
    """The wrench that each moving joint's link takes from its parent, through the joint: moment about the link
    frame's origin and force, in link axes (the deck's link frame), N m and N.

    Its component along the joint is tau_load, less spin times the parent's angular acceleration about it, which is the
    rotor's and not the link's. Taken from the bodies' own inertia, not from the regrouped one.
    """
    total: list[Wrench] = [(ZERO, ZERO)] * len(tree.joints)
    result: list[Wrench] = list(total)
    for i in reversed(tree.order):
        joint = tree.joints[i]
        m, h, I = joint.body  # noqa: E741
        wd, a = solved.wd[i], solved.a[i]
        moment, force = rate_wrench(joint.body, solved.w[i])
        moment = add(moment, add(apply_symmetric(I, wd), cross(h, a)))
        force = add(force, add(scale(m, a), cross(wd, h)))
        moment = add(total[i][0], sub(moment, solved.load[i][0]))
        force = add(total[i][1], sub(force, solved.load[i][1]))
        R, origin = tree.frames[tree.carried[i]].pose
        result[i] = (turn_vector_back(R, sub(moment, cross(origin, force))), turn_vector_back(R, force))
        if joint.parent >= 0:
            if not is_zero(solved.spin[i]):  # the share of the rotor, which the parent carries
                turning = (0.0, 0.0, solved.spin[i] * solved.qdd[i])
                gyroscopic = cross(solved.w[i], (0.0, 0.0, solved.spin[i] * solved.rate[i]))
                moment = add(moment, add(turning, gyroscopic))
            free = solved.free_rotors[i]
            if free is not None:
                turning = (0.0, 0.0, free.torque - free.inertia * solved.about[i])
                moment = add(moment, add(turning, cross(solved.w[i], (0.0, 0.0, free.momentum))))
            outer = solved.steps[i].raise_force(moment, force)
            before = total[joint.parent]
            total[joint.parent] = (add(before[0], outer[0]), add(before[1], outer[1]))
    return tuple(result)


def rate_wrench(body: Rigid, w: Vector) -> Wrench:
    """Gyroscopic moment w x I w and centrifugal force w x (w x h) of a body about its frame's origin."""
    return cross(w, apply_symmetric(body.I, w)), cross(w, cross(w, body.h))


def _resolve(mode: Truth, D0: Real, rotor: Real, spin: Real, u: Real, qdd: Real) -> tuple[Real, Real, Real]:
    """Dinv, e and rest of one joint (head of this file); spin: h_k."""
    if mode is False:
        return 0.0, qdd, 1.0
    D = D0 + rotor
    Dinv = 1.0 / D if isinstance(D, Scalar) else divide(1.0, D)
    return (
        choose(mode, Dinv, 0.0),
        choose(mode, u * Dinv, qdd),
        choose(mode, (rotor if is_zero(spin) else rotor - spin) * Dinv, 1.0),
    )


def _handed_on(M: Symmetric, k: int, U: Six, Dinv: Real, rest: Real, spin: Real) -> Symmetric:
    """Ia: the part of IA that resists the parent."""
    g = [x * Dinv for x in U]
    column = U if is_zero(spin) else M.column(k)

    def entry(i: int, j: int) -> Real:
        """The element (i, j) of Ia, the part of the 6x6 inertia that resists the parent."""
        if k in (i, j):
            other = i + j - k
            share = rest * column[other]
            return share - g[k] * spin if other == 2 and not is_zero(spin) else share
        if j < 3:
            old = M.A[AT[i][j]]
        else:
            old = M.B[3 * i + j - 3] if i < 3 else M.C[AT[i - 3][j - 3]]
        return old - g[i] * U[j]

    upper = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    return Symmetric(
        tuple(entry(i, j) for i, j in upper),  # type: ignore[arg-type]
        tuple(entry(i, j) for i in range(3) for j in range(3, 6)),  # type: ignore[arg-type]
        tuple(entry(i + 3, j + 3) for i, j in upper),  # type: ignore[arg-type]
    )


def _apply(M: Symmetric, x: Wrench) -> Wrench:
    """M x for a six-vector in two halves."""
    angular, linear = x
    B = M.B
    rows = (B[0:3], B[3:6], B[6:9])
    return (
        add(apply_symmetric(M.A, angular), turn_vector(rows, linear)),
        add(turn_vector_back(rows, angular), apply_symmetric(M.C, linear)),
    )


def _truth(mode: object) -> Truth:
    if isinstance(mode, np.ndarray):  # of lanes, where a step is linearised
        return mode  # type: ignore[return-value]
    return mode if isinstance(mode, Mask) else bool(mode)


def _base(tree: Tree, gravity: Vector, acceleration: tuple[Vector, Vector], rate: Vector) -> tuple[Vector, ...]:
    """Angular velocity and acceleration of the recursion's base frame, and its origin's acceleration less gravity."""
    R, p = tree.base
    wd, a = acceleration
    a = add(
        shift_motion(0, p[0], wd, shift_motion(1, p[1], wd, shift_motion(2, p[2], wd, a))), cross(rate, cross(rate, p))
    )
    return turn_vector_back(R, rate), turn_vector_back(R, wd), turn_vector_back(R, sub(a, gravity))


def _of_base_frame(tree: Tree, gravity: Vector, rate: Vector, wd: Vector, a: Vector) -> Wrench:
    """The inverse of `_base`: the deck's base frame from the recursion's; rate in the deck's base axes."""
    R, p = tree.base
    wd, a = turn_vector(R, wd), add(turn_vector(R, a), gravity)
    return wd, sub(a, add(cross(wd, p), cross(rate, cross(rate, p))))


def loads_on_bodies(tree: Tree, wrenches: Mapping[str, Wrench] | None) -> tuple[tuple[Wrench, ...], Wrench]:
    """Sum of the given wrenches on each joint's body, about its frame's origin and in its axes; and on a free base."""
    total: list[Wrench] = [(ZERO, ZERO)] * len(tree.joints)
    base: Wrench = (ZERO, ZERO)
    for name, (moment, force) in (wrenches or {}).items():
        frame = tree.frames[name]
        if frame.joint < 0 and tree.floating is None:
            continue
        R, p = frame.pose
        force = turn_vector(R, force)
        moment = add(turn_vector(R, moment), cross(p, force))
        before = base if frame.joint < 0 else total[frame.joint]
        after = (add(before[0], moment), add(before[1], force))
        if frame.joint < 0:
            base = after
        else:
            total[frame.joint] = after
    return tuple(total), base
