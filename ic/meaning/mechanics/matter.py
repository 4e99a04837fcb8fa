"""Mass, centre and inertia of a link or payload, as numbers or by a uniform solid.

A rod, a box and a cylinder begin at the link frame's origin and extend along one of its axes; a sphere is centred
there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from ic.language.bodies import COM, INERTIA, MASS
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.bodies import check_body
from ic.meaning.parameters.models import check_keys, refuse_values, word_of
from ic.meaning.parameters.owner import Owner, several
from ic.meaning.parameters.scope import Scope
from met.diagnostic import did_you_mean
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
    """Three numbers by axis: `own` on the axis `along`, `across` on the others."""
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
    """The solid cylinder of unit mass with these sizes, m, from the frame's origin along an axis (0, 1, 2)."""
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


MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")

DrawnShape = tuple[str, tuple[tuple[str, float], ...]]
"""A shape as in a plan: kind, and numbers in SI."""


def use_matter(
    scope: Scope, owner: Owner, kind: str, name: str, body: MergedBlock, *, lumped: bool = False
) -> DrawnShape | None:
    """Enter mass, centre and inertia as parameters, and check that they are a body's; returns its shape, if it has one.

    kind    what it is in words: "link" or "payload"
    lumped  whether its numbers are an identified set, of which only finite ones are asked
    """
    mass = scope.number(owner, _of_kind(MASS, kind), body.get("mass"))
    solid = _shape(scope, owner, body.get("shape"))
    _com(scope, owner, kind, body.get("com"), solid)
    inertia = _inertia(scope, owner, kind, body.get("inertia"), solid, mass)
    if inertia is not None:
        check_body(scope, owner, kind, name, body.get("inertia"), inertia, mass, lumped=lumped)
    if solid is None:
        return None
    return solid.kind, tuple((name, scope.checks.first(value)) for name, value in solid.numbers)


def _of_kind(wanted: Parameter, kind: str) -> Parameter:
    return replace(wanted, doc=wanted.doc.format(kind))


def _shape(scope: Scope, owner: Owner, item: Item | None) -> Solid | None:
    """The shape of a link or payload with its sizes, m; None where there is none, or a mistake, which is reported."""
    if item is None:
        return None
    name = word_of(item.value)
    if name is None or name not in SHAPES:
        helps = did_you_mean(name, SHAPES) if name else ()
        shapes = (f"{known}({', '.join(p.name for p in shape.parameters)})" for known, shape in SHAPES.items())
        scope.complaints.error(
            "D088",
            f"no shape `{name}`" if name else "a shape is needed here",
            item.value_place,
            help=[*helps, f"shapes: {', '.join(shapes)}"],
        )
        scope.checks.fail(f"{owner.path}.shape")
        return None
    kind = SHAPES[name]
    if refuse_values(scope, item.value, [p.name for p in kind.parameters]):
        scope.checks.fail(f"{owner.path}.shape")
        return None
    inner = Owner(f"the {name} of {owner.label}", item.place, f"{owner.path}.shape", homes=owner.homes, call=True)
    body = item.body or MergedBlock()
    check_keys(scope, body, [p.name for p in kind.parameters], inner)
    numbers: dict[str, Real] = {}
    along, good = "x", True
    for wanted in kind.parameters:
        entry = body.get(wanted.name)
        if wanted.shape == "word":
            word = scope.word(inner, wanted, entry)
            along, good = word or along, good and word is not None
        elif wanted.shape == "vector":
            vector = scope.vector(inner, wanted, entry, record=False)
            good = good and vector is not None
            numbers |= {f"{wanted.name}_{axis}": x for axis, x in zip("xyz", vector or (), strict=False)}
        else:
            number = scope.number(inner, wanted, entry, record=False)
            good = good and number is not None
            if number is not None:
                numbers[wanted.name] = number
    return kind.solid(numbers, "xyz".index(along)) if good else None


def _com(scope: Scope, owner: Owner, kind: str, item: Item | None, solid: Solid | None) -> None:
    """Enter the centre of mass: as written, else the middle of the shape, else 0."""
    if item is not None or solid is None:
        scope.vector(owner, replace(_of_kind(COM, kind), default=(0.0, 0.0, 0.0)), item)
        return
    scope.not_sweepable[owner.join("com")] = several([owner.join(f"com.{axis}") for axis in "xyz"])
    for axis, value in zip("xyz", solid.com, strict=True):
        scope.derived(owner, f"com.{axis}", value, "m", f"middle of the {solid.kind}")


def _inertia(
    scope: Scope, owner: Owner, kind: str, item: Item | None, solid: Solid | None, mass: Real | None
) -> tuple[Real, ...] | None:
    """The moments xx, yy, zz, xy, xz, yz, kg m^2: as written, or of the shape; None where there are none (reported)."""
    if item is not None:
        return scope.vector(owner, _of_kind(INERTIA, kind), item, names=MOMENTS, short=3)
    if solid is None:
        if isinstance(mass, float) and mass == 0.0:
            return tuple(scope.derived(owner, f"inertia.{name}", 0.0, "kg*m^2", "without mass") for name in MOMENTS)
        if not scope.checks.failed(f"{owner.path}.shape"):
            scope.complaints.missing(
                owner.place,
                ("shape", "inertia"),
                "D089",
                f"{owner.label} has no inertia",
                help=[
                    "write a shape, such as `shape = rod(length = 1 m, along = x);`",
                    "or `inertia = [xx, yy, zz] kg*m^2;`, about the centre of mass",
                ],
            )
        return None
    if mass is None:
        scope.checks.fail(owner.join("inertia"))
        return None
    scope.not_sweepable[owner.join("inertia")] = several([owner.join(f"inertia.{moment}") for moment in MOMENTS])
    return tuple(
        scope.derived(owner, f"inertia.{name}", value, "kg*m^2", f"uniform {solid.kind} of the {kind}'s mass")
        for name, value in zip(MOMENTS, solid.inertia(mass), strict=True)
    )
