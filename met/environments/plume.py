"""A thruster's plume on a rectangular plate that is fixed to a link: force and moment of the gas while the thruster
fires.

The gas moves straight from a point in all directions in front of the nozzle, at one speed, with the dynamic pressure

    q = K cos(theta)^n / r^2,     K = (n + 2) share thrust/(4 pi),     theta the angle from the nozzle's axis     (P1)

and none behind the nozzle's plane. With this K, the momentum that the plume carries along the axis is `share` times the
thrust: the integral of 2 q cos(theta) over the half space is 4 pi K/(n + 2). On a surface whose normal N is turned
towards the nozzle, with u the direction of the gas there and s = -u.N the sine of its incidence, the force on an area A
is

    A q s [2 sigma_t (u + s N) - (2 (2 - sigma_n) s + sqrt(pi) sigma_n reemission) N]                              (P2)

free molecular flow, so fast that its own thermal motion does not matter (Schaaf and Chambre 1961), with accommodation
coefficients sigma_n, sigma_t for normal and tangential momentum. sigma_n = 1, sigma_t = 0 is Newton's law of dense
hypersonic flow. The plate is a rectangle around the origin of its frame, which `at` and `rpy` place in the link's
frame; its width is along x, its height along y, and its front looks along z.

The sum over the plate is taken over the directions in which the nozzle sees it: s dA/r^2 is the solid angle, so nothing
grows without bound, however near the plate is. With d the distance of the nozzle from the plate's plane, D its distance
from the plate along z and y only, x = D tan(a) the distance from the nozzle along the plate's x, and b the angle of the
gas to the plane across y,

    s dA/r^2 = d (D^2 + x^2)/(D (d^2 + x^2)) cos(b) da db                                                         (P3)

Each side is divided into `cells`, narrow where the plume is dense: even in k = z/sqrt(1 + z^2), with z the angle, a or
b, from the direction in which the plate is nearest to the plume's axis, divided by 3/sqrt(n + 1). Each cell has a point
of Gauss's rule. 6 cells leave out at most 3 % of the plume's momentum, however near the plate is
(docs/environments.md).

`switches` may stand in a CSV file, `file = "fire.csv"`, in its only column, `time`, one in each row.

Nothing is in the way of the gas: no part of the arm shades another, and gas that is turned back hits nothing. The model
is not made for a plate so near that the plume does not seem to come from a point, nor for gas so dense that it
accumulates in front of the plate. The velocity of the link is neglected against that of the gas.
"""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from functools import cache
from typing import Any

from met.environments import firing
from met.environments.environment import Environment, Force, Jet, Loads, Plate, World
from met.parameter import WORLD, ZEROS, Parameter
from met.trace import Real, absolute, atan2, clip, cos, exp, log, maximum, minimum, sin, sqrt, where
from met.vectors import (
    ZERO,
    Vector,
    add,
    cross,
    dot,
    product,
    rotation_rpy,
    scale,
    sub,
    turn_vector,
    turn_vector_back,
)

DIGITS = 40  # far more than a double has, so that the doubles are the nearest ones, and the same on every machine


@cache
def gauss(count: int) -> tuple[tuple[float, float], ...]:
    """Points in (-1, 1), rising, and their weights, which sum to 2 (Abramowitz and Stegun 25.4.29)."""
    points = []
    with localcontext() as context:
        context.prec = DIGITS
        for i in reversed(range(count)):
            x = Decimal(math.cos(math.pi * (i + 0.75) / (count + 0.5)))
            for _ in range(6):  # Newton from four digits: each doubles them
                value, slope = _legendre(count, x)
                x -= value / slope
            slope = _legendre(count, x)[1]
            points.append((float(x), float(2 / ((1 - x * x) * slope * slope))))
    return tuple(points)


def _legendre(count: int, x: Decimal) -> tuple[Decimal, Decimal]:
    """P_n(x) and its slope."""
    before, value = Decimal(1), x
    for k in range(2, count + 1):
        before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
    return value, count * (x * value - before) / (x * x - 1)


FLAT = 1e-9  # m: a nozzle in the plate's plane counts as so far before it, where its gas comes in flat


def loads(p: Any, world: World) -> Loads:
    """Force and moment of the gas on the plate, and where `reaction` is on the thrust on the nozzle's link, N and N m
    in the world."""
    fires = firing.share(p, world)
    turn = product(world.orientation(p.link), rotation_rpy(*p.rpy))
    nozzle = sub(world.position(p.nozzle_link, p.nozzle), world.position(p.link, p.at))
    axis = world.to_world(p.nozzle_link, scale(1.0 / sqrt(dot(p.axis, p.axis)), p.axis))
    force, moment = on_plate(p, turn_vector_back(turn, nozzle), turn_vector_back(turn, axis))
    strength = fires * ((p.exponent + 2.0) * p.share * p.thrust / (4.0 * math.pi))
    felt = Force(p.link, scale(strength, turn_vector(turn, force)), scale(strength, turn_vector(turn, moment)), p.at)
    if p.reaction == "off":
        return Loads(forces=(felt,))
    return Loads(forces=(felt, Force(p.nozzle_link, scale(-fires * p.thrust, axis), point=p.nozzle)))


def jet(p: Any, world: World) -> Jet:
    """The jet of gas and the plate, for pictures."""
    R = rotation_rpy(*p.rpy)
    width, height = turn_vector(R, (p.width, 0.0, 0.0)), turn_vector(R, (0.0, p.height, 0.0))
    plate = Plate(p.link, p.at, width, height)
    return Jet(p.nozzle_link, p.nozzle, p.axis, firing.share(p, world), p.exponent, plate)


def on_plate(p: Any, nozzle: Vector, axis: Vector) -> tuple[Vector, Vector]:
    """Force and moment about the plate's middle, in the plate's axes, of a plume with K = 1 (N, N m for each N).

    nozzle, axis  where the plume comes from, m, and its unit direction, in the plate's frame
    """
    behind = nozzle[2] < 0.0
    side: Real = where(behind, -1.0, 1.0)  # the side of the plate, by its z, from which the gas comes
    far = maximum(FLAT, absolute(nozzle[2]))
    toward = -side * axis[2]
    narrow = 3.0 / sqrt(p.exponent + 1.0)
    aside = clip(0.0, -0.5 * p.height - nozzle[1], 0.5 * p.height - nozzle[1])
    nearest = sqrt(far * far + aside * aside)
    ahead = far * toward + aside * axis[1]
    latitude = atan2(axis[1], sqrt(axis[0] * axis[0] + toward * toward))
    force, moment = ZERO, ZERO
    for a, width in _cells(p, p.width, nozzle[0], nearest, atan2(axis[0] * nearest, ahead), narrow):
        x = nearest * sin(a) / cos(a)
        away = sqrt(far * far + x * x)
        solid = far * (nearest * nearest + x * x) / (nearest * away * away)
        cosine, sine = far / away, x / away
        for b, height in _cells(p, p.height, nozzle[1], away, latitude, narrow):
            u = (sine * cos(b), sin(b), -side * cosine * cos(b))
            r = away / cos(b)
            near = minimum(1.0, r * r / (p.closest * p.closest))
            part = scale(solid * width * height * near * cos(b), _on_direction(p, u, side, axis))
            force = add(force, part)
            moment = add(moment, cross((nozzle[0] + x, nozzle[1] + r * sin(b), 0.0), part))
    felt = 1.0 if p.sides == "both" else where(behind, 0.0, 1.0)
    return scale(felt, force), scale(felt, moment)


def _cells(p: Any, length: Real, nozzle: Real, away: Real, dense: Real, narrow: Real) -> list[tuple[Real, Real]]:
    """Angles under which the nozzle sees points of a side of the plate, and the width of angle that each stands for,
    rad.

    nozzle  where it is along the side, from its middle;  away: its distance from the line of the side, m
    dense   the angle about which they are close together;  narrow: how close
    """
    low, high = -0.5 * length - nozzle, 0.5 * length - nozzle
    begin = atan2(low, away)
    whole = atan2(length * away, away * away + low * high)  # the difference, which keeps its digits far away
    middle = clip(dense, begin, begin + whole)
    z, dz = (begin - middle) / narrow, whole / narrow
    far, farther = sqrt(1.0 + z * z), sqrt(1.0 + (z + dz) * (z + dz))
    k = z / far
    dk = dz * (1.0 + far * farther - z * (z + dz)) / (far * farther * (far + farther))
    cells = []
    for point, weight in gauss(int(p.cells)):
        node = k + dk * (0.5 + 0.5 * point)
        rest = 1.0 - node * node
        root = sqrt(rest)
        cells.append((middle + narrow * node / root, 0.5 * weight * dk * narrow / (rest * root)))
    return cells


def idle(p: Any, duration: float) -> tuple[tuple[str, ...], str] | None:
    """The reason why these numbers make the model do nothing in a run of this length, with the parameters that say
    so."""
    if p.thrust == 0.0:
        return ("thrust",), "it has no thrust"
    if p.share == 0.0 and p.reaction == "off":
        return ("share",), "its gas has no momentum"
    return firing.idle(p, duration)


def _on_direction(p: Any, u: Vector, side: Real, axis: Vector) -> Vector:
    """The force of the gas that comes along u, for each solid angle and K ((P2) of this file's head), in the plate's
    axes."""
    cosine = dot(u, axis)
    behind = cosine <= 0.0
    dense = where(behind, 0.0, exp(p.exponent * log(where(behind, 1.0, cosine))))
    s = -side * u[2]
    along = 2.0 * p.sigma_t
    push = 2.0 * (2.0 - p.sigma_n) * s + math.sqrt(math.pi) * p.sigma_n * p.reemission
    x, y, z = scale(along, add(u, (0.0, 0.0, side * s)))
    return scale(dense, (x, y, z - side * push))


ENVIRONMENT = Environment(
    name="plume",
    doc=__doc__,
    from_file=True,
    parameters=(
        Parameter(name="link", shape="word", names="link", doc="link that the plate is fixed to"),
        Parameter(name="at", unit="m", shape="vector", default=ZEROS, doc="middle of the plate, in the link's frame"),
        Parameter(
            name="rpy",
            unit="rad",
            shape="vector",
            default=ZEROS,
            doc="rotation of the plate's frame about the link's fixed x, then y, then z axis; its z axis is the "
            "normal of the plate's front",
        ),
        Parameter(name="width", unit="m", above=0.0, doc="length of the plate along its x axis"),
        Parameter(name="height", unit="m", above=0.0, doc="length of the plate along its y axis"),
        Parameter(
            name="cells",
            default=6.0,
            at_least=1.0,
            at_most=40.0,
            whole=True,
            decides=True,
            doc="number of parts into which each side of the plate is divided, as seen from the nozzle",
        ),
        Parameter(
            name="sides",
            shape="word",
            words=("front", "both"),
            default="front",
            doc="sides of the plate on which gas acts: `front` only, or `both`",
        ),
        Parameter(
            name="sigma_n",
            default=1.0,
            at_least=0.0,
            at_most=1.0,
            doc="accommodation of normal momentum: 0 for reflection as by a mirror, 1 for diffuse re-emission",
            source="assumption",
        ),
        Parameter(
            name="sigma_t",
            default=1.0,
            at_least=0.0,
            at_most=1.0,
            doc="accommodation of tangential momentum: 0 if none of it stays on the plate, 1 if all of it does",
            source="assumption",
        ),
        Parameter(
            name="reemission",
            default=0.0,
            at_least=0.0,
            doc="most probable thermal speed at the plate's temperature, sqrt(2 R T), divided by the speed of the gas",
        ),
        Parameter(
            name="nozzle_link",
            shape="word",
            names="link",
            words=(WORLD,),
            default=WORLD,
            doc="link that the nozzle is fixed to, or `world`: the ground",
        ),
        Parameter(name="nozzle", unit="m", shape="vector", doc="position of the nozzle, in the frame of `nozzle_link`"),
        Parameter(
            name="axis",
            shape="vector",
            direction=True,
            doc="direction of the plume, in the axes of `nozzle_link`",
        ),
        Parameter(name="thrust", unit="N", at_least=0.0, doc="thrust while the thruster fires"),
        Parameter(
            name="exponent",
            at_least=0.0,
            doc="exponent n of the cosine law; (pi/(2 theta_limit))^2 2/(gamma - 1) fits the law of Simons (1972) "
            "near the axis",
        ),
        Parameter(
            name="share",
            default=1.0,
            at_least=0.0,
            doc="momentum of the plume divided by the thrust; 4 pi q r^2/((n + 2) thrust) if q is measured on the "
            "axis at the distance r",
        ),
        Parameter(
            name="closest",
            unit="m",
            default=0.01,
            above=0.0,
            doc="distance from the nozzle within which the pressure does not increase further",
        ),
        Parameter(
            name="reaction",
            shape="word",
            words=("off", "on"),
            default="off",
            doc="whether the thrust also acts on `nozzle_link`; it has no effect on the ground",
        ),
        *firing.FIRING,
    ),
    loads=loads,
    jet=jet,
    idle=idle,
    pushed_links=lambda p: ("link",) if p.reaction == "off" else ("link", "nozzle_link"),
)
