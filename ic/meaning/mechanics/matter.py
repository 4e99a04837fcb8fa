"""Mass, centre and inertia of a link or payload, as numbers or by a uniform solid."""

from __future__ import annotations

from dataclasses import replace

from ic.language.bodies import COM, INERTIA, MASS
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.mechanics.bodies import check_body
from ic.meaning.mechanics.shapes import SHAPES, Solid
from ic.meaning.parameters import not_sweepable
from ic.meaning.parameters.models import check_keys, refuse_values, value_place, word_of
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from met.diagnostic import did_you_mean
from met.parameter import Parameter
from met.trace import Real

MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")

Shape = tuple[str, tuple[tuple[str, float], ...]]
"""A shape as in a plan: kind, and numbers in SI."""


def use_matter(
    scope: Scope, owner: Owner, kind: str, name: str, body: MergedBlock, *, lumped: bool = False
) -> Shape | None:
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
            value_place(item),
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
    if item is not None or solid is None:
        scope.vector(owner, replace(_of_kind(COM, kind), default=(0.0, 0.0, 0.0)), item)
        return
    scope.not_sweepable[owner.join("com")] = not_sweepable.several([owner.join(f"com.{axis}") for axis in "xyz"])
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
    scope.not_sweepable[owner.join("inertia")] = not_sweepable.several(
        [owner.join(f"inertia.{moment}") for moment in MOMENTS]
    )
    return tuple(
        scope.derived(owner, f"inertia.{name}", value, "kg*m^2", f"uniform {solid.kind} of the {kind}'s mass")
        for name, value in zip(MOMENTS, solid.inertia(mass), strict=True)
    )
