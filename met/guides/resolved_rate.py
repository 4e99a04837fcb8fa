"""Resolved rate: the joint rates that move a point of a link, and the attitude of the link, along a path in the world.

    v      = path's rate + gain * (path - where it is) - what it does with these joints at rest
    qd     = J' (J J' + lambda^2 I)^-1 v                           (Whitney 1969; damped, Nakamura 1986)
    lambda^2 = max_damping^2 (1 - (sigma/threshold)^2)  where sigma < threshold, else 0
    qd     is made smaller as a whole, if a joint would move faster than its `max_rate`

A rotation counts as the way of a point at the distance `length`, and the way of a prismatic joint as a rotation by that
way over `length`. So J is in metres, and sigma, its smallest singular value, is the velocity of the end in its worst
direction for one rad/s. Below the threshold the rates are damped, so that they stay small through a singularity; the
point then leaves the path by as much as `error` shows, and the gain brings it back. With max_damping = threshold no
joint motion exceeds |v|/threshold. With max_damping = 0, the inverse is the pseudo-inverse.

The path is given by the components that are written, in world axes, as offsets from where point and link begin: x, y, z
of the point; roll, pitch, yaw of the link, R = Rz(yaw) Ry(pitch) Rx(roll). Components that are left out stay 0, so the
link is held in the attitude in which it begins. `guides = position` leaves the attitude free; `xy` and the like guide
two components only.

The error of the path decays as exp(-gain t), but for the lag of the servos, the tick (by a part that is proportional to
its period) and the effect of limits and damping. At a singularity itself no joint moves the point along the direction
that is lost: a path that begins there in that direction does not begin; without damping the case fails.

It is not a planner: it knows neither joint stops nor collisions, and of the motions of a redundant arm it takes the
smallest.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType
from typing import Any

from met.guides.guide import Guide, Sight, Stance, Steered
from met.parameter import ZEROS, Memory, Parameter
from met.trace import Real, Scalar, absolute, maximum, sqrt, where
from met.trace.primitives import divide
from met.vectors import Vector, add, dot, product, rotation_vector, scale, sub, transposed

Rows = list[list[Real]]

RESOLVED = 1e-12
"""Share of the trace of J J' below which the square of a singular value cannot be told from zero: four digits above
rounding."""


def gram(rows: Sequence[Sequence[Real]]) -> Rows:
    """J J' of the rows of J."""
    matrix: Rows = [[0.0] * len(rows) for _ in rows]
    for i, row in enumerate(rows):
        for j in range(i + 1):
            matrix[i][j] = matrix[j][i] = dot(row, rows[j])
    return matrix


def damped(rows: Sequence[Sequence[Real]], square: Rows, damping: Real, task: Sequence[Real]) -> list[Real]:
    """u for the rows of J, its J J', lambda^2 and v.

        u = J' (J J' + lambda^2 I)^-1 v       makes |J u - v|^2 + lambda^2 |u|^2 least

    (Nakamura and Hanafusa, Inverse kinematic solutions with singularity robustness, J. Dyn. Sys. Meas. Control 108,
    1986.) J J' is symmetric and not negative, so it is taken apart without pivoting, L diag(d) L'. Without damping u is
    the pseudo-inverse's, the smallest of all that carry the task out.
    """
    y = _solved(_factors(square, damping), task)
    return [dot([row[k] for row in rows], y) for k in range(len(rows[0]))]


def least_singular_value(square: Rows) -> Real:
    """The smallest singular value of J, from J J': never more than it is, and at most 7 % less.

    The largest eigenvalue b of B = (J J')^-1 from traces, b^4 <= m + s sqrt(n - 1) with m and s the mean and deviation
    of the eigenvalues of B^4 (Wolkowicz and Styan, Bounds for eigenvalues using traces, Lin. Alg. Appl. 29, 1980): no
    iteration, and exact where one singular value is much smaller than the others. A value below 1e-6 of the largest
    may come out as 0.
    """
    n = len(square)
    trace: Real = sum((square[i][i] for i in range(n)), 0.0)
    size = where(trace > 0.0, trace, 1.0)
    factors = _factors([[entry / size for entry in row] for row in square], RESOLVED)
    columns = [_solved(factors, [1.0 if i == k else 0.0 for i in range(n)]) for k in range(n)]
    fourth = gram(gram(columns))
    mean = sum((fourth[i][i] for i in range(n)), 0.0) * (1.0 / n)
    spread = maximum(sum((dot(row, row) for row in fourth), 0.0) * (1.0 / n) - mean * mean, 0.0)
    largest = sqrt(sqrt(mean + sqrt(float(n - 1) * spread)))
    return sqrt(size * maximum(1.0 / largest - RESOLVED, 0.0))


def _factors(square: Rows, more: Real) -> tuple[Rows, list[Real]]:
    """L (rows below the diagonal) and 1/d of the matrix with `more` added to its diagonal."""
    L: Rows = []
    inverse: list[Real] = []
    for i, entries in enumerate(square):
        row: list[Real] = []
        scaled: list[Real] = []  # L_ij d_j
        for j in range(i):
            below = entries[j]
            for k in range(j):
                below = below - scaled[k] * L[j][k]
            scaled.append(below)
            row.append(below * inverse[j])
        pivot = entries[i] + more
        for low, high in zip(row, scaled, strict=True):
            pivot = pivot - low * high
        L.append(row)
        inverse.append(1.0 / pivot if isinstance(pivot, Scalar) else divide(1.0, pivot))
    return L, inverse


def _solved(factors: tuple[Rows, list[Real]], right: Sequence[Real]) -> list[Real]:
    """The solution x of L D L' x = right, from L and the inverse of D."""
    L, inverse = factors
    x: list[Real] = []
    for i, value in enumerate(right):
        for j in range(i):
            value = value - L[i][j] * x[j]
        x.append(value)
    x = [value * part for value, part in zip(x, inverse, strict=True)]
    for i in reversed(range(len(x))):
        for j in range(i + 1, len(x)):
            x[i] = x[i] - L[j][i] * x[j]
    return x


POSE = ("x", "y", "z", "roll", "pitch", "yaw")
GUIDED = MappingProxyType(
    {
        "pose": POSE,
        "position": POSE[:3],
        "xy": ("x", "y"),
        "xz": ("x", "z"),
        "yz": ("y", "z"),
    }
)
"""Components of the path, by the word for the guided quantity."""


def components(p: Any) -> tuple[str, ...]:
    return GUIDED[p.guides]


def fastest(p: Any) -> Real:
    return p.gain


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why the damping never acts, with the parameters that say so."""
    if p.max_damping > 0.0 and p.threshold == 0.0:
        return ("max_damping", "threshold"), "is never damped: no singular value is below a `threshold` of 0 m"
    return None


def steer(p: Any, joints: Sequence[Any], seen: Sight) -> Steered:
    """The rates that the guide commands its joints at its tick, with its memory: the errors of position (m) and
    attitude (rad), the least singular value and the damping (m), and the share of the rates that limits leave."""
    rows = [POSE.index(name) for name in GUIDED[p.guides]]
    turns = p.guides == "pose"
    answers = p.jacobian == "generalized"
    away, turned = _behind(seen.wanted, seen.arm.stance(answers=answers))
    arm = seen.arm if p.loop == "closed" else seen.asked
    stance = arm.stance(answers=answers)
    behind, aside = _behind(seen.wanted, stance)
    v = sub(add(seen.wanted.v, scale(p.gain, behind)), stance.v)
    w = sub(add(seen.wanted.w, scale(p.gain, aside)), stance.w)
    task = _chosen(rows, v, w, p.length)

    units = [p.length if slides else 1.0 for slides in seen.slides]  # for a joint's share in |u|
    columns = [
        [unit * part for part in _chosen(rows, linear, angular, p.length)]
        for unit, (angular, linear) in zip(units, arm.columns(answers=answers), strict=True)
    ]
    J = [[column[k] for column in columns] for k in range(len(rows))]
    square = gram(J)
    sigma = least_singular_value(square)
    low = sigma < p.threshold
    share = sigma / where(low, p.threshold, 1.0)
    damping = where(low, p.max_damping * p.max_damping * (1.0 - share * share), 0.0)
    rates = [unit * u for unit, u in zip(units, damped(J, square, damping, task), strict=True)]

    most: Real = 1.0
    for rate, joint in zip(rates, joints, strict=True):
        most = maximum(most, absolute(rate) / joint.max_rate)
    left = 1.0 / most
    return Steered(
        [left * rate for rate in rates],
        {
            "error": sqrt(sum((away[row] * away[row] for row in rows if row < 3), 0.0)),
            "turn_error": sqrt(dot(turned, turned)) if turns else 0.0,
            "manipulability": sigma,
            "damping": sqrt(damping),
            "share": left,
        },
    )


def _behind(wanted: Stance, stance: Stance) -> tuple[Vector, Vector]:
    """The error of a frame against its path: displacement, m, and turn (axis times angle), rad, world axes."""
    return sub(wanted.p, stance.p), rotation_vector(product(wanted.R, transposed(stance.R)))


def _chosen(rows: Sequence[int], linear: Vector, angular: Vector, length: Real) -> list[Real]:
    """The guided components of a motion, its rotations as lengths at `length`."""
    whole = (*linear, *scale(length, angular))
    return [whole[row] for row in rows]


GUIDE = Guide(
    name="resolved_rate",
    doc=__doc__,
    parameters=(
        Parameter(name="link", shape="word", names="link", doc="link that is guided"),
        Parameter(
            name="point", unit="m", shape="vector", default=ZEROS, doc="guided point of the link, in the link's frame"
        ),
        Parameter(
            name="guides",
            shape="word",
            words=tuple(GUIDED),
            default="pose",
            doc="guided components: position and attitude (`pose`), the position, or two of its coordinates",
        ),
        Parameter(
            name="max_damping",
            unit="m",
            at_least=0.0,
            doc="damping lambda at a singularity; 0: no damping",
            source="Nakamura and Hanafusa 1986; its growth: Chiaverini, IEEE Trans. Robotics Autom. 13, 1997",
        ),
        Parameter(
            name="threshold",
            unit="m",
            at_least=0.0,
            doc="smallest singular value of J below which the rates are damped",
        ),
        Parameter(name="gain", unit="1/s", default=1.0, at_least=0.0, doc="gain of the guide: rate per path error"),
        Parameter(
            name="length", unit="m", default=1.0, above=0.0, doc="length that counts as much as a rotation of 1 rad"
        ),
        Parameter(
            name="loop",
            shape="word",
            words=("closed", "open"),
            default="closed",
            doc="joint positions that the guide starts from: the actual ones (`closed`), or those that it has "
            "commanded (`open`)",
        ),
        Parameter(
            name="jacobian",
            shape="word",
            words=("arm", "generalized"),
            default="arm",
            doc="on a free base: J as if the base were held (`arm`), or with the base's reaction to the arm "
            "(`generalized`)",
            source="Umetani and Yoshida, IEEE Trans. Robotics Autom. 5, 1989 (generalized)",
        ),
    ),
    of_joint=(Parameter(name="max_rate", unit="joint/s", default=float("inf"), above=0.0, doc="largest rate"),),
    components=components,
    commands=("rate", "position"),
    memory=(
        Memory(name="error", unit="m", doc="distance of the guided point from the path, in the guided components"),
        Memory(
            name="turn_error",
            unit="rad",
            doc="angle between the attitude of the link and that of the path; 0 if the attitude is not guided",
        ),
        Memory(name="manipulability", unit="m", doc="smallest singular value of J, or up to 7 % less"),
        Memory(name="damping", unit="m", doc="damping lambda of the joint rates"),
        Memory(name="share", unit="1", doc="share of the joint rates that remains within the limits `max_rate`"),
    ),
    error="error",
    fastest=fastest,
    steer=steer,
    idle=idle,
    undefined="at a singularity where its `max_damping` is 0 m",
)
