"""Uniform solids, as links are drawn and weighed: where their centre is and what inertia they have about it.

A rod, a box and a cylinder begin at the link frame's origin and extend along one of its axes; a sphere is centred
there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from met.frozen import frozen
from met.parameter import Parameter
from met.trace import Real

Three = tuple[Real, Real, Real]
Six = tuple[Real, Real, Real, Real, Real, Real]

ALONG = Parameter(
    name="along", shape="word", words=("x", "y", "z"), doc="axis of the link along which the shape extends"
)


@frozen
class Solid:
    """A shape with its sizes: centre of mass (m, link frame), and inertia about it (kg m^2) from the mass (kg).

    moments  inertia xx, yy, zz per kg; the axes of a shape are the link's, so there are no products
    """

    kind: str
    numbers: tuple[tuple[str, Real], ...]
    com: Three
    moments: Three

    def inertia(self, mass: Real) -> Six:
        xx, yy, zz = self.moments
        return (mass * xx, mass * yy, mass * zz, 0.0, 0.0, 0.0)


@frozen
class Shape:
    parameters: tuple[Parameter, ...]
    solid: Callable[[Mapping[str, Real], int], Solid]


def _size(name: str, doc: str) -> Parameter:
    return Parameter(name=name, unit="m", above=0.0, doc=doc)


def _turned(along: int, own: Real, across: Real) -> Three:
    """`own` on the axis `along`, `across` on the others."""
    x, y, z = (own if axis == along else across for axis in range(3))
    return (x, y, z)


def _numbers(values: Mapping[str, Real], along: int | None) -> tuple[tuple[str, Real], ...]:
    """Sizes in SI and the axis as 0, 1 or 2."""
    return (*values.items(), *((("along", float(along)),) if along is not None else ()))


def rod(p: Mapping[str, Real], along: int) -> Solid:
    """A thin rod."""
    square = p["length"] * p["length"] / 12.0
    return Solid("rod", _numbers(p, along), _turned(along, p["length"] / 2.0, 0.0), _turned(along, 0.0, square))


def box(p: Mapping[str, Real], along: int) -> Solid:
    size = (p["size_x"], p["size_y"], p["size_z"])
    xx, yy, zz = (side * side / 12.0 for side in size)
    return Solid("box", _numbers(p, along), _turned(along, size[along] / 2.0, 0.0), (yy + zz, xx + zz, xx + yy))


def cylinder(p: Mapping[str, Real], along: int) -> Solid:
    radius = p["radius"] * p["radius"]
    across = radius / 4.0 + p["length"] * p["length"] / 12.0
    return Solid(
        "cylinder", _numbers(p, along), _turned(along, p["length"] / 2.0, 0.0), _turned(along, radius / 2.0, across)
    )


def sphere(p: Mapping[str, Real], along: int) -> Solid:
    moment = p["radius"] * p["radius"] * 0.4
    return Solid("sphere", _numbers(p, None), (0.0, 0.0, 0.0), (moment, moment, moment))


SHAPES: Mapping[str, Shape] = {
    "rod": Shape((_size("length", "length of the rod"), ALONG), rod),
    "box": Shape(
        (
            Parameter(name="size", unit="m", above=0.0, shape="vector", doc="lengths of the edges along x, y and z"),
            Parameter(name="along", shape="word", words=("x", "y", "z"), default="x", doc=ALONG.doc),
        ),
        box,
    ),
    "cylinder": Shape(
        (_size("radius", "radius of the cylinder"), _size("length", "length of the cylinder"), ALONG), cylinder
    ),
    "sphere": Shape((_size("radius", "radius of the sphere"),), sphere),
}
