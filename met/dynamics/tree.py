"""The arm as the recursion sees it: moving joints in frames of its own choice, fixed joints merged away.

A `Body` is the description from a deck: a link, the joint that carries it, its place, and its inertia. `Tree.build`
turns bodies into `TreeJoint`s once, so that the work repeated at every instant is as small as the structure allows:

1. Links behind fixed joints become part of the link that carries them (or of the base).
2. Each link frame is turned so that its joint's axis is z. Where the joint that follows is known when the tree is
   built, x is the common normal of both axes and the origin is its foot (Denavit and Hartenberg): a whole change of
   frame is then two turns and two shifts. Rounding noise of right angles is removed, so that they cost nothing.
3. What of a link's inertia moves alike with its parent is handed to the parent (base parameters; Khalil and Dombre,
   2002, ch. 9). Motion and torques are the same; reactions are taken from the bodies' own inertia.

A number that is not a plain Python float (a traced one, or numpy's) varies by case: no choice depends on it, and it is
only used in arithmetic. `Tree.map_numbers` keeps such numbers in a case's memory, so that they are computed once.

Link frames of the deck are found again in `Tree.frames`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, Literal

from met.dynamics.floating import Floating
from met.dynamics.joints import JointTransform, TreeJoint, X, Z
from met.dynamics.spatial import (
    HERE,
    IDENTITY,
    NO_INERTIA,
    NO_TURN,
    ZERO,
    Matrix,
    Pose,
    Real,
    Rigid,
    Turn,
    Vector,
    all_constant,
    choose,
    compose,
    constant,
    cross,
    dot,
    inverse,
    is_zero,
    lower_vector,
    product,
    rigid_about_centre,
    rigid_raise,
    rigid_sum,
    root,
    rotation_rpy,
    scale,
    settled,
    snap_rotation,
    snapped,
    sub,
    transposed,
    turn_vector,
)
from met.frozen import frozen


@frozen
class Body:
    """A link and the joint that carries it; every number may be traced.

    name, joint  of the link, of the joint
    parent       number of the parent link among the bodies, -1 for the base
    at, rpy      joint frame in the parent's link frame: origin (m), turns about fixed x, y, z in that order (rad).
                 The link frame is the joint frame at q = 0
    axis         unit vector in the joint frame, of motion along or about it; not read for a fixed joint
    pivot        a point of a revolute joint's axis, in the joint frame, m: the origin unless the axis passes it by
    mass         kg
    com          centre of mass in the link frame, m
    inertia      xx, yy, zz, xy, xz, yz about the centre of mass in link axes, kg m^2
    """

    name: str
    joint: str
    kind: Literal["revolute", "prismatic", "fixed"]
    parent: int
    at: Vector = ZERO
    rpy: Vector = ZERO
    axis: Vector = (0.0, 0.0, 1.0)
    pivot: Vector = ZERO
    mass: Real = 0.0
    com: Vector = ZERO
    inertia: tuple[Real, Real, Real, Real, Real, Real] = (0.0,) * 6


@frozen
class Frame:
    """A link frame of the deck: the moving joint whose body it belongs to (-1: the base), and its pose there."""

    joint: int
    pose: Pose


@frozen
class Tree:
    """Moving joints, and the way back to the deck's frames.

    joints   in the caller's order, the order of q, qd, tau
    order    their numbers, parents before children
    base     the recursion's base frame in the deck's
    frames   by link's name
    carried  by joint: the link that it carries itself
    floating the base as a body, where it moves freely; None: its motion is given
    """

    joints: tuple[TreeJoint, ...]
    order: tuple[int, ...]
    base: Pose
    frames: dict[str, Frame]
    carried: tuple[str, ...]
    floating: Floating | None = None

    @staticmethod
    def build(bodies: Sequence[Body], moving: Sequence[str] | None = None, *, free: bool = False) -> Tree:
        """The tree of these bodies, in any order; `moving` orders the joints that move (as the bodies, if None).

        free  the base moves freely, with the matter of the links that are fixed to it. Its own link is one: a body
              fixed to the base where the base is
        """
        return _Builder(bodies, moving).tree(free=free).map_numbers(lambda _, value: value)

    def transforms(self, q: Sequence[Real]) -> tuple[JointTransform, ...]:
        """The transform of each joint at its position, q in rad (prismatic: m)."""
        return tuple(joint.at(q[i]) for i, joint in enumerate(self.joints))

    def map_numbers(self, function: Callable[[str, Real], Real]) -> Tree:
        """The tree with function(name, value) for every number that a case may vary.

        A phase that runs once writes them to the case's memory; later phases, building the same tree from the same
        parameters, read them there instead of computing them again.
        """
        return each_number("tree", self, function)


class _Builder:
    """One building of a tree. `within`, `at` and `_own` are poses among link frames, which are the deck's."""

    def __init__(self, bodies: Sequence[Body], moving: Sequence[str] | None) -> None:
        """Find which bodies are rigid with which moving joint, and its place. moving: names of the joints that move, in
        the tree's order; None: all that are not fixed, in the bodies' order"""
        self.bodies = list(bodies)
        self.sorted = _parents_first([body.parent for body in bodies])
        names = [body.joint for body in bodies if body.kind != "fixed"] if moving is None else list(moving)
        by_joint = {body.joint: number for number, body in enumerate(bodies)}
        self.links = [by_joint[name] for name in names]
        number = {link: i for i, link in enumerate(self.links)}
        # Group of each body: the moving joint it is rigid with, and its link frame in that joint's frame, which is
        # the frame of the link that it carries, but for a pivot.
        self.group: list[int] = [-1] * len(self.bodies)
        self.within: list[Pose] = [HERE] * len(self.bodies)
        self.parent = [-1] * len(names)
        self.at: list[Pose] = [HERE] * len(names)
        for b in self.sorted:
            body = self.bodies[b]
            group, pose = (-1, HERE) if body.parent < 0 else (self.group[body.parent], self.within[body.parent])
            pose = compose(pose, Pose(snap_rotation(rotation_rpy(*body.rpy)), body.at))
            pose = Pose(snap_rotation(pose.R), pose.p)
            if body.kind == "fixed":
                self.group[b], self.within[b] = group, pose
            else:
                i = number[b]
                self.group[b], self.parent[i], self.at[i] = i, group, pose
                if body.kind == "revolute" and not all(is_zero(x) for x in body.pivot):
                    x, y, z = body.pivot
                    self.at[i], self.within[b] = _moved_to(pose, body.pivot), Pose(IDENTITY, (-x, -y, -z))
        self.order = tuple(number[b] for b in self.sorted if b in number)
        self.first: dict[int, int] = {}
        for i in self.order:
            self.first.setdefault(self.parent[i], i)

    def tree(self, *, free: bool) -> Tree:
        """The tree of the bodies: each joint's frame in its parent's, and the inertia of what is rigid with it. free:
        whether the base moves freely, so that its own inertia counts."""
        own: list[Pose] = [HERE] * len(self.links)
        base = HERE
        joints: list[TreeJoint | None] = [None] * len(self.links)
        for i in self.order:
            body = self.bodies[self.links[i]]
            own[i] = self._own(i)
            if self.parent[i] < 0 and self.first[-1] == i:
                base = _cleaned(compose(self.at[i], own[i]))
            outer = base if self.parent[i] < 0 else own[self.parent[i]]
            if body.kind == "prismatic" and i not in self.first and all_constant(self.at[i], own[i], outer):
                # Where a sliding frame starts is free: at its parent's origin, there is no offset left.
                start = compose(inverse(self.at[i]), outer)
                own[i] = Pose(own[i].R, start.p)
            swing, offset, twist, zero, slide = _split(compose(inverse(outer), compose(self.at[i], own[i])))
            if i not in self.first and all_constant(zero):
                # Nothing hangs on this frame: turn it until q alone is the turn.
                own[i] = Pose(product(own[i].R, transposed(_about_z(zero))), own[i].p)
                zero = NO_TURN
            angle = 0.0
            if body.kind == "revolute" and all_constant(zero) and 0.0 not in zero:
                angle, zero = math.atan2(zero[1], zero[0]), NO_TURN
            joints[i] = TreeJoint(
                name=body.joint,
                kind=body.kind,  # type: ignore[arg-type]
                parent=self.parent[i],
                swing=swing,
                offset=offset,
                twist=twist,
                angle=angle,
                zero=zero,
                slide=slide,
            )
        frames = {}
        rigid: list[Rigid] = [NO_INERTIA] * len(self.links)
        ground = NO_INERTIA if free else None
        for b, body in enumerate(self.bodies):
            g = self.group[b]
            pose = _cleaned(compose(inverse(base if g < 0 else own[g]), self.within[b]))
            frames[body.name] = Frame(g, pose)
            if g < 0 and ground is None:
                continue
            inertia = rigid_raise(rigid_about_centre(body.mass, body.com, body.inertia), pose)
            if g >= 0:
                rigid[g] = rigid_sum(rigid[g], inertia)
            elif ground is not None:
                ground = rigid_sum(ground, inertia)
        carried = tuple(self.bodies[b].name for b in self.links)
        with_bodies = [replace(joint, body=rigid[i]) for i, joint in enumerate(joints) if joint is not None]
        with_bodies, dynamic = _regrouped(with_bodies, self.order, ground)
        with_bodies, whole = _with_reach(with_bodies, self.order, ground)
        floating = None
        if ground is not None and dynamic is not None and whole is not None:
            mass, xx, yy, zz = (_size(x) for x in (whole.mass, whole.I[0], whole.I[3], whole.I[5]))
            floating = Floating(ground, dynamic, mass, xx + yy + zz)
        return Tree(tuple(with_bodies), self.order, base, frames, carried, floating)

    def _own(self, i: int) -> Pose:
        """The recursion's frame of joint i in the frame of the link that it carries."""
        axis = self.bodies[self.links[i]].axis
        if not all_constant(axis):
            return Pose(_traced_frame_about(axis), ZERO)
        axis = _unit(axis)
        plain = Pose(_frame_about(axis), ZERO)
        if i not in self.first:
            return plain
        child = self.first[i]
        next_axis = self.bodies[self.links[child]].axis
        pose = self.at[child]
        if not all_constant(next_axis, pose.R):
            return plain
        next_direction = turn_vector(pose.R, _unit(next_axis))
        normal = cross(axis, next_direction)
        size = _norm(normal)
        known = all_constant(pose.p)
        far = _norm(pose.p) if known else 0.0
        if size < 1e-9:
            x = sub(pose.p, scale(dot(pose.p, axis), axis)) if known else ZERO
            if _norm(x) <= 1e-9 * far or not known:
                return plain
            return Pose(_frame_with(x, axis), ZERO)
        foot = 0.0
        if known and size > 0.05:
            # at.p + t there is nearest to s axis: solve for s.
            c = dot(axis, next_direction)
            foot = snapped((dot(pose.p, axis) - c * dot(pose.p, next_direction)) / (size * size) + 0.0, far or 1.0)  # type: ignore
            foot = 0.0 if abs(foot) < 1e-14 * far else foot
        return Pose(_frame_with(normal, axis), scale(foot, axis))


def _parents_first(parents: Sequence[int]) -> list[int]:
    """Numbers of the bodies, each after its parent, chains kept together."""
    children: dict[int, list[int]] = {}
    for b, parent in enumerate(parents):
        children.setdefault(parent, []).append(b)
    result: list[int] = []
    stack = list(reversed(children.get(-1, [])))
    while stack:
        b = stack.pop()
        result.append(b)
        stack.extend(reversed(children.get(b, [])))
    if len(result) != len(parents):
        raise ValueError("the bodies do not form a tree: a chain of parents never comes to the base")
    return result


def _split(pose: Pose) -> tuple[Turn, Vector, Turn, Turn, Real]:
    """The swing, offset, twist, zero and slide with which a joint's frame at q = 0 has this pose in its parent's
    frame."""
    R, p = _cleaned(pose)
    swing = _direction(-R[1][2], R[0][2])
    if all_constant(R) and swing[0] < 0.0:
        swing = (-swing[0], -swing[1])
    # Columns of R seen from the swung frame: the third is (0, -sin, cos) of the twist.
    column = [lower_vector(Z, swing, (R[0][j], R[1][j], R[2][j])) for j in range(3)]
    twist = (column[2][2], -column[2][1])
    flat = [lower_vector(X, twist, column[j]) for j in range(2)]
    zero = (flat[0][0], flat[0][1])
    offset = lower_vector(Z, swing, p)
    slide: Real = 0.0
    if all_constant(R):
        swing, twist, zero = (_clean_turn(turn) for turn in (swing, twist, zero))
    if all_constant(R, p):
        far = _norm(p)
        offset = _clean_vector(offset, far)
        if abs(float(twist[1])) > 0.05 and offset[1] != 0.0:
            # Slide along the child's axis to where the offset has no y.
            slid = -offset[1] / twist[1]
            other = _clean_vector((offset[0], 0.0, offset[2] - twist[0] * slid), far + abs(slid))  # type: ignore
            if other[2] == 0.0 or offset[2] != 0.0:
                offset, slide = other, slid
        elif twist[1] == 0.0 and offset[2] != 0.0:
            slide = offset[2] * twist[0]
            offset = (offset[0], offset[1], 0.0)
    return swing, offset, twist, zero, slide


def _direction(x: Real, y: Real) -> Turn:
    """The direction (x, y) as a unit vector; (1, 0) where it has no length."""
    size = x * x + y * y
    nothing = size < 1e-30
    length = root(choose(nothing, 1.0, size))
    return choose(nothing, 1.0, x / length), choose(nothing, 0.0, y / length)


def _regrouped(
    joints: list[TreeJoint], order: Sequence[int], ground: Rigid | None
) -> tuple[list[TreeJoint], Rigid | None]:
    """The joints with `dynamic`: from tips to base, inertia that the joint's motion does not see goes to the parent;
    and the base's body with its share (None: it is not needed)."""
    result = list(joints)
    gathered = [joint.body for joint in joints]
    for i in reversed(order):
        joint = joints[i]
        m, h, (xx, xy, xz, yy, yz, zz) = gathered[i]
        if joint.kind == "revolute":
            dynamic = Rigid(0.0, (h[0], h[1], 0.0), (_less(xx, yy), xy, xz, 0.0, yz, zz))
            moved = Rigid(m, (0.0, 0.0, h[2]), (yy, 0.0, 0.0, yy, 0.0, 0.0))
        else:
            dynamic = Rigid(m, h, (0.0,) * 6)
            moved = Rigid(0.0, ZERO, gathered[i].I)
        result[i] = replace(joint, dynamic=dynamic)
        if joint.parent >= 0:
            gathered[joint.parent] = rigid_sum(gathered[joint.parent], rigid_raise(moved, joint.at(0.0).pose()))
        elif ground is not None:
            ground = rigid_sum(ground, rigid_raise(moved, joint.at(0.0).pose()))
    return result, ground


def _less(a: Real, b: Real) -> Real:
    """a - b; 0 where the difference of two constants is only rounding."""
    if constant(a) and constant(b) and abs(a - b) <= 4e-16 * max(abs(a), abs(b)):
        return 0.0
    return a - b


def _with_reach(
    joints: list[TreeJoint], order: Sequence[int], ground: Rigid | None
) -> tuple[list[TreeJoint], Rigid | None]:
    """The joints with `reach`, where no case varies it; and all bodies at q = 0 combined, about the base."""
    result = list(joints)
    composite = [joint.body for joint in joints]
    for i in reversed(order):
        joint, body = joints[i], composite[i]
        size = body.I[5] if joint.kind == "revolute" else body.mass
        result[i] = replace(joint, reach=_size(size))
        if joint.parent >= 0:
            composite[joint.parent] = rigid_sum(composite[joint.parent], rigid_raise(body, joint.at(0.0).pose()))
        elif ground is not None:
            ground = rigid_sum(ground, rigid_raise(body, joint.at(0.0).pose()))
    return result, ground


def _size(x: Real) -> float:
    """A number that is at least 0; 0.0 where cases vary it."""
    return max(float(x), 0.0) if constant(x) else 0.0


def _frame_about(axis: Vector) -> Matrix:
    """A rotation whose z is the constant unit axis; a permutation of axes where possible."""
    x, y, z = (float(e) for e in axis)
    if abs(z) == 1.0:
        return IDENTITY if z > 0.0 else ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
    if abs(x) == 1.0 or abs(y) == 1.0:
        return _frame_with((0.0, 0.0, 1.0), axis)
    return snap_rotation(_traced_frame_about(axis))


def _frame_with(x: Vector, axis: Vector) -> Matrix:
    """A rotation whose z is the constant unit axis and whose x is along the given vector across it."""
    x = _unit(x)
    return snap_rotation(transposed((x, cross(axis, x), axis)))


def _traced_frame_about(axis: Vector) -> Matrix:
    """A rotation whose z is the unit axis, without a choice that depends on it (Duff et al., 2017)."""
    x, y, z = axis
    s = choose(z >= 0.0, 1.0, -1.0)
    k = -1.0 / (s + z)
    b = x * y * k
    return ((1.0 + s * x * x * k, b, x), (s * b, s + y * y * k, y), (-(s * x), -y, z))


def _about_z(turn: Turn) -> Matrix:
    c, s = turn
    return ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))


def _norm(a: Vector) -> float:
    return math.sqrt(sum(float(x) * float(x) for x in a))


def _unit(a: Vector) -> Vector:
    size = _norm(a)
    return (snapped(float(a[0]) / size), snapped(float(a[1]) / size), snapped(float(a[2]) / size))


def _cleaned(pose: Pose) -> Pose:
    """The pose with right angles exact and lost digits of its origin dropped, where it is constant."""
    return Pose(snap_rotation(pose.R), _clean_vector(pose.p, _norm(pose.p)) if all_constant(pose.p) else pose.p)


def _moved_to(pose: Pose, point: Vector) -> Pose:
    """The frame with its origin moved to a point given in it; cancelling terms cancel exactly."""
    p = compose(pose, Pose(IDENTITY, point)).p
    return Pose(pose.R, _clean_vector(p, _norm(pose.p) + _norm(point)) if all_constant(p) else p)


def _clean_vector(a: Vector, size: float) -> Vector:
    x, y, z = (0.0 if abs(float(e)) < 4e-15 * size else float(e) for e in a)
    return (x, y, z)


def _clean_turn(turn: Turn) -> Turn:
    return (snapped(float(turn[0])), snapped(float(turn[1])))


def each_number(name: str, value: Any, function: Callable[[str, Real], Real]) -> Any:
    """Rebuild nested dataclasses, tuples and dictionaries with the function applied to non-constant numbers."""
    if is_dataclass(value) and not isinstance(value, type):
        changed = {f.name: each_number(f"{name}.{f.name}", getattr(value, f.name), function) for f in fields(value)}
        return type(value)(**changed)
    if isinstance(value, dict):
        return {key: each_number(f"{name}.{key}", item, function) for key, item in value.items()}
    if isinstance(value, tuple):
        items = [each_number(f"{name}.{number}", item, function) for number, item in enumerate(value)]
        return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
    if value is None or isinstance(value, str) or constant(value):
        return value
    value = settled(value)
    return value if constant(value) else function(name, value)
