"""A moving joint: the pose of its child frame in its parent frame, and the transforms from one to the other.

Frames here are the recursion's own, chosen by `tree` so that little is left to compute: the motion is always about
or along z, and from a parent's frame to its child's one goes by

    swing   a turn about z            (nothing, for the first joint on a link)
    offset  a shift (x, y, z)         (along x alone, where Denavit and Hartenberg's common normal exists)
    twist   a turn about x
    turn    a turn about z, by q + angle (revolute) or a fixed one (prismatic)
    slide   a shift along z, fixed (revolute) or slide + q (prismatic)

Accelerations are those of the points at the frames' origins, as an accelerometer that falls freely would be zero:
[wd; a] rather than Featherstone's spatial acceleration, which is [wd; a - w x v]. Linear velocities then occur
nowhere: products of velocities are w x (w x r), w x I w and 2 w x z qd.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from met.dynamics.spatial import (
    NO_INERTIA,
    NO_TURN,
    ZERO,
    Matrix,
    Pose,
    Real,
    Rigid,
    Symmetric,
    Turn,
    Vector,
    add,
    constant,
    cross,
    is_zero,
    lower_vector,
    product,
    raise_shifted,
    raise_turned,
    raise_vector,
    shift_force,
    shift_motion,
    swapped,
    turn_by,
    turn_vector,
)
from met.frozen import frozen

X, Y, Z = 0, 1, 2

Moving = Literal["revolute", "prismatic"]


@frozen
class TreeJoint:
    """A moving joint with the rigid body that it carries (fixed joints outboard merged into it).

    parent   number of the joint that carries the parent link, -1 for the base
    angle    added to q, rad (revolute)
    zero     a turn about z besides, composed with q's
    body     the body's inertia in the joint's frame
    dynamic  what of it the recursion must still know here: the rest is regrouped into the parents, the same motion
             and torques following (Khalil and Dombre, Modeling, Identification and Control of Robots, 2002, ch. 9)
    reach    size of the outboard inertia seen by the joint at q = 0, kg m^2 (kg); 0.0 where cases vary it
    """

    name: str
    kind: Moving
    parent: int
    swing: Turn = NO_TURN
    offset: Vector = ZERO
    twist: Turn = NO_TURN
    angle: float = 0.0
    zero: Turn = NO_TURN
    slide: Real = 0.0
    body: Rigid = NO_INERTIA
    dynamic: Rigid = NO_INERTIA
    reach: float = 0.0

    @property
    def axis(self) -> int:
        """The joint's component of a six-vector: angular z or linear z."""
        return 2 if self.kind == "revolute" else 5

    def at(self, q: Real) -> JointTransform:
        """The transform from the parent frame to the child frame at position q."""
        if self.kind == "prismatic":
            return JointTransform(self.swing, self.offset, self.twist, self.zero, self.slide + q)
        angle = q if is_zero(self.angle) else q + self.angle
        (c, s), (c0, s0) = turn_by(angle), self.zero
        if not (constant(c0) and constant(s0) and (c0, s0) == NO_TURN):
            c, s = c * c0 - s * s0, s * c0 + c * s0
        return JointTransform(self.swing, self.offset, self.twist, (c, s), self.slide)


class JointTransform(NamedTuple):
    """The five shifts and rotations of a joint at one position (see the head of this file)."""

    swing: Turn
    offset: Vector
    twist: Turn
    turn: Turn
    slide: Real

    def lower_rate(self, w: Vector) -> Vector:
        """The parent's angular velocity in child axes."""
        return lower_vector(Z, self.turn, lower_vector(X, self.twist, lower_vector(Z, self.swing, w)))

    def offset_product(self, w: Vector) -> Vector:
        """w x (w x offset), in the parent's axes after the swing; w is the parent's."""
        swung = lower_vector(Z, self.swing, w)
        return cross(swung, cross(swung, self.offset))

    def lower_acceleration(self, wd: Vector, a: Vector, product_of_rates: Vector) -> tuple[Vector, Vector]:
        """The parent's acceleration at the child's origin, in child axes; `product_of_rates` is offset_product's."""
        wd, a = lower_vector(Z, self.swing, wd), lower_vector(Z, self.swing, a)
        for axis in (X, Y, Z):
            a = shift_motion(axis, self.offset[axis], wd, a)
        a = add(a, product_of_rates)
        wd, a = lower_vector(X, self.twist, wd), lower_vector(X, self.twist, a)
        wd, a = lower_vector(Z, self.turn, wd), lower_vector(Z, self.turn, a)
        return wd, shift_motion(Z, self.slide, wd, a)

    def raise_force(self, moment: Vector, force: Vector) -> tuple[Vector, Vector]:
        """A wrench about the child's origin, in child axes, moved to the parent's origin and axes."""
        moment = shift_force(Z, self.slide, moment, force)
        moment, force = raise_vector(Z, self.turn, moment), raise_vector(Z, self.turn, force)
        moment, force = raise_vector(X, self.twist, moment), raise_vector(X, self.twist, force)
        return self._raise_offset(moment, force)

    def raise_articulated(
        self, M: Symmetric, moment: Vector, force: Vector, product_of_rates: Vector
    ) -> tuple[Symmetric, Vector, Vector]:
        """An articulated inertia and its bias wrench in the parent's frame.

        The acceleration `offset_product` acts on the inertia too; its wrench is added to the bias half way.
        """
        M = raise_turned(X, self.twist, raise_turned(Z, self.turn, raise_shifted(Z, self.slide, M)))
        moment = shift_force(Z, self.slide, moment, force)
        moment, force = raise_vector(Z, self.turn, moment), raise_vector(Z, self.turn, force)
        moment, force = raise_vector(X, self.twist, moment), raise_vector(X, self.twist, force)
        B, C = M.B, M.C
        moment = add(moment, turn_vector((B[0:3], B[3:6], B[6:9]), product_of_rates))
        force = add(force, turn_vector(((C[0], C[1], C[2]), (C[1], C[3], C[4]), (C[2], C[4], C[5])), product_of_rates))
        for axis in (X, Y, Z):
            M = raise_shifted(axis, self.offset[axis], M)
        moment, force = self._raise_offset(moment, force)
        return raise_turned(Z, self.swing, M), moment, force

    def lower_mobility(self, Y6: Symmetric) -> Symmetric:
        """X Y X': the parent's mobility at the child's origin, a map from wrench to acceleration."""
        # Linear over angular, a mobility moves like an inertia shifted the other way.
        M = swapped(raise_turned(Z, _back(self.swing), Y6))
        for axis in (X, Y, Z):
            M = raise_shifted(axis, -self.offset[axis], M)
        M = raise_turned(Z, _back(self.turn), raise_turned(X, _back(self.twist), M))
        return swapped(raise_shifted(Z, -self.slide, M))

    def pose(self) -> Pose:
        """The child frame in the parent frame."""
        R: Matrix = tuple(  # type: ignore[assignment]
            raise_vector(Z, self.swing, raise_vector(X, self.twist, raise_vector(Z, self.turn, axis)))
            for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        )
        R = ((R[0][0], R[1][0], R[2][0]), (R[0][1], R[1][1], R[2][1]), (R[0][2], R[1][2], R[2][2]))
        slid = raise_vector(X, self.twist, (0.0, 0.0, self.slide))
        return Pose(R, raise_vector(Z, self.swing, add(self.offset, slid)))

    def below(self, outer: Pose) -> Pose:
        """The child frame in the frame in which the parent frame has the pose `outer`."""
        own = self.pose()
        return Pose(product(outer.R, own.R), add(outer.p, turn_vector(outer.R, own.p)))

    def _raise_offset(self, moment: Vector, force: Vector) -> tuple[Vector, Vector]:
        for axis in (X, Y, Z):
            moment = shift_force(axis, self.offset[axis], moment, force)
        return raise_vector(Z, self.swing, moment), raise_vector(Z, self.swing, force)


def _back(turn: Turn) -> Turn:
    return (turn[0], -turn[1])
