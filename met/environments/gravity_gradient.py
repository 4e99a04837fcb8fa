"""Gravity gradient on an arm in orbit: forces and moments on every link, in addition to the free fall of the orbit
itself.

The world's origin moves on a circular orbit of the radius R, in free fall. rpy rotates the orbit's axes in the world: x
points away from the centre of attraction, y along the flight, z along the normal of the orbit; n = sqrt(mu/R^3).
Gravity is of first order in the distance from the origin: a part dm of a link at x feels dm T x, with

    T = n^2 (3 r r' - 1),     r the direction away from the centre

so a link of mass m, with its centre at c and the second moments J = integral of y y' dm = tr(I)/2 - I about the centre,
feels the force m T c there and the moment of T J, which is 3 n^2 r x I r.

`frame = inertial`: the world does not turn; rpy is the orientation of the orbit's axes at t = 0, and they turn about z
by n t. `frame = orbital`: the world turns with the orbit, as Hill's axes do, and the orbit's axes stand still in it.
The rotation of the world is then included as apparent forces on every part, so that a free body follows the equations
of Clohessy and Wiltshire,

    x'' = 3 n^2 x + 2 n y',     y'' = -2 n x',     z'' = -n^2 z     (in the orbit's axes)

and rates are relative to the turning world. In it, the base of a station that keeps its attitude to the Earth is at
rest.

The orbit is circular. The flattening of the Earth, terms of second order (for arms of tens of metres some 1e-6 of
these), and the attraction between links are left out.
"""

from __future__ import annotations

from typing import Any

from met.environments.environment import Environment, Force, Loads, World
from met.parameter import ZEROS, Parameter
from met.trace import Real, cos, sin, sqrt
from met.vectors import ZERO, Matrix, Vector, add, cross, product, rotation_rpy, scale, transposed, turn_vector


def loads(p: Any, world: World) -> Loads:
    field, turning = _around(p, world)
    return Loads(forces=tuple(_on_link(p, world, link, field, turning) for link in world.links))


def free_fall(p: Any, world: World, position: Vector, velocity: Vector) -> Vector:
    field, turning = _around(p, world)
    return _acceleration(p, field, turning, position, velocity)


def world_rate(p: Any, world: World) -> Vector:
    return _around(p, world)[1] if p.frame == "orbital" else ZERO


def _around(p: Any, world: World) -> tuple[Matrix, Vector]:
    """The acceleration of a resting part per distance from the origin, as a matrix; and the angular velocity of the
    orbit."""
    n = sqrt(p.mu / (p.radius * p.radius * p.radius))
    axes = transposed(rotation_rpy(*p.rpy))
    up, along, normal = axes
    if p.frame == "inertial":
        c, s = cos(n * world.time), sin(n * world.time)
        up = add(scale(c, up), scale(s, along))
    return _field(n, up, normal, turning=p.frame == "orbital"), scale(n, normal)


def _acceleration(p: Any, field: Matrix, turning: Vector, position: Vector, velocity: Vector) -> Vector:
    """Acceleration of a part at this position and velocity, world axes, m/s^2; `field`, `turning`: see `_around`."""
    acceleration = turn_vector(field, position)
    if p.frame == "orbital":
        acceleration = add(acceleration, scale(-2.0, cross(turning, velocity)))
    return acceleration


def _on_link(p: Any, world: World, link: str, field: Matrix, turning: Vector) -> Force:
    """The results `field` and `turning` of `_around`, in the link's terms."""
    mass, com = world.mass(link), world.com(link)
    second = _second_moments(world, link)
    acceleration = _acceleration(p, field, turning, world.position(link, com), world.velocity(link, com))
    spread = product(field, second)
    if p.frame == "orbital":
        coriolis = product(_crossing(scale(-2.0, turning)), _crossing(world.rate(link)))
        spread = _sum(spread, product(coriolis, second))
    moment = (spread[2][1] - spread[1][2], spread[0][2] - spread[2][0], spread[1][0] - spread[0][1])
    return Force(link, force=scale(mass, acceleration), moment=moment, point=com)


def _field(n: Real, up: Vector, normal: Vector, turning: bool) -> Matrix:
    """n^2 (3 r r' - 1), plus n^2 (1 - z z') in a turning world."""
    square = n * n
    rows = []
    for i in range(3):
        row = [3.0 * up[i] * up[j] for j in range(3)]
        row = [x - normal[i] * normal[j] for j, x in enumerate(row)] if turning else row
        row[i] = row[i] if turning else row[i] - 1.0
        rows.append(scale(square, (row[0], row[1], row[2])))
    return rows[0], rows[1], rows[2]


def _second_moments(world: World, link: str) -> Matrix:
    """The integral of y y' dm about the centre of mass, world axes, kg m^2."""
    xx, yy, zz, xy, xz, yz = world.inertia(link)
    half = 0.5 * (xx + yy + zz)
    own = ((half - xx, -xy, -xz), (-xy, half - yy, -yz), (-xz, -yz, half - zz))
    R = world.orientation(link)
    return product(product(R, own), transposed(R))


def _crossing(a: Vector) -> Matrix:
    """The matrix of the cross product a x."""
    return ((0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0))


def _sum(A: Matrix, B: Matrix) -> Matrix:
    return add(A[0], B[0]), add(A[1], B[1]), add(A[2], B[2])


ENVIRONMENT = Environment(
    name="gravity_gradient",
    doc=__doc__,
    at_rest="weight",
    parameters=(
        Parameter(name="radius", unit="m", above=0.0, doc="radius of the orbit, from the centre of attraction"),
        Parameter(
            name="mu",
            unit="m^3/s^2",
            default=3.986004418e14,
            above=0.0,
            doc="gravitational parameter of the central body",
            source="WGS 84, for the Earth",
        ),
        Parameter(
            name="rpy",
            unit="rad",
            shape="vector",
            default=ZEROS,
            doc="rotation of the orbit's axes about the world's fixed x, then y, then z axis; x points up, y along "
            "the flight, z along the normal",
        ),
        Parameter(
            name="frame",
            shape="word",
            words=("inertial", "orbital"),
            doc="`inertial`: the world's axes keep their directions; `orbital`: they turn with the orbit",
        ),
    ),
    loads=loads,
    alone=lambda p: "gravity",
    free_fall=free_fall,
    world_rate=world_rate,
)
