"""What links look like, by files of meshes: no number follows from them.

    mesh = "upper.stl";
    mesh = placed("upper.stl", at = [0, 0, 0.1] m, rpy = [0, 0, 90] deg, scale = [0.001, 0.001, 0.001]);
    mesh = ["shell.stl", placed("cover.stl", at = [0, 0, 0.2] m)];

A file that is not there costs a warning and leaves the link its other looks: decks are passed on without their meshes.
"""

from __future__ import annotations

from collections.abc import Iterator

from ic.grammar.syntax import Call, Expression, List, String, place_of
from ic.meaning.definitions.merge import Item, MergedBlock, open_call
from ic.meaning.parameters.models import check_keys, word_of
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from met.diagnostic import Problem
from met.parameter import ZEROS, Parameter
from met.plan import Mesh
from met.trace import Scalar

PLACED = "placed"
USAGE = 'write `mesh = "FILE.stl";`, or `placed("FILE.stl", at = [0, 0, 0] m)`, or a list of such'
PLACING = (
    Parameter(name="at", unit="m", shape="vector", default=ZEROS, doc="origin of the mesh, in the link's frame"),
    Parameter(name="rpy", unit="rad", shape="vector", default=ZEROS, doc="rotation of the mesh, fixed x-y-z"),
    Parameter(
        name="scale", unit="1", shape="vector", default=(1.0, 1.0, 1.0), doc="factors that make metres of its numbers"
    ),
)


def link_meshes(scope: Scope, owner: Owner, item: Item | None) -> tuple[Mesh, ...]:
    """The meshes of a link's `mesh`. Mistakes are reported; a mesh that has one is left out."""
    if item is None:
        return ()
    written = list(_written(scope, item))
    return tuple(
        mesh
        for number, (value, body) in enumerate(written)
        if (mesh := _mesh(scope, owner, item, f".{number}" * (len(written) > 1), value, body)) is not None
    )


def _written(scope: Scope, item: Item) -> Iterator[tuple[Expression | None, MergedBlock]]:
    """The files as written, each with the block of its `placed`."""
    for value in (item.value, *item.appended):
        for part in value.items if isinstance(value, List) else (value,):
            if part is item.value:
                yield part, item.body or MergedBlock()
            elif part is not None:
                call, body = open_call(part, item.homes[-1] if item.homes else None, scope.complaints)
                yield call, body or MergedBlock()


def _mesh(
    scope: Scope, owner: Owner, item: Item, number: str, value: Expression | None, body: MergedBlock
) -> Mesh | None:
    """One mesh file of a body with where it is placed (m, rad, scale); None where it has a mistake, which is reported
    (D076, D122). A file that cannot be read is a warning (D219), and the body is drawn without it."""
    place = item.place if value is None else place_of(value)
    named = value.positional[0] if isinstance(value, Call) and len(value.positional) == 1 else value
    if not isinstance(named, String) or (named is not value and word_of(value) != PLACED):
        scope.complaints.error("D076", f"`mesh` of {owner.label} is the name of a file, in quotes", place, help=USAGE)
        return None
    inner = Owner(f"a mesh of {owner.label}", place, f"{owner.path}.mesh{number}", homes=owner.homes, call=True)
    check_keys(scope, body, [wanted.name for wanted in PLACING], inner)
    placing: dict[str, tuple[float, ...]] = {}
    for wanted in PLACING:
        vector = scope.vector(inner, wanted, body.get(wanted.name), record=False)
        if any(isinstance(x, Scalar) for x in vector or ()):
            message, cure = f"`{wanted.name}` of {inner.label} varies with the sweep", "a mesh is the same in all cases"
            scope.complaints.error("D122", message, place, help=cure)
        elif vector is not None:
            placing[wanted.name] = tuple(float(x) for x in vector)
    if len(placing) < len(PLACING):
        return None
    try:
        file, sha256 = scope.definitions.mesh_files.digest(named)
    except Problem as problem:
        for fault in problem.diagnostics:
            helps = (*fault.help, f"{owner.label} is drawn without it")
            scope.complaints.remark("D219", fault.message, fault.at, help=helps)
        file, sha256 = named.value, ""
    return Mesh(file, sha256, **placing)
