"""Links that bend, `link NAME boom { ... }`, as rigid pieces with springs between them.

A boom of n nodes is a chain of n + 1 rigid pieces. It is divided into n/2 equal lengths, and each bends at the two
points of Gauss's rule, so that a load on the tip bends the chain exactly as far as a uniform beam: what the tip yields
to forces and moments are integrals of polynomials up to the second degree, which that rule has exactly. One spring
behind the middle carries all of the twist. The frames of all pieces are the link's own while the boom is straight.

    NAME_0 ... NAME_n           the pieces, links of the plan; NAME itself is a frame on the last one
    NAME_1y, NAME_1z ...        the springs of each node, revolute joints about the axes across the boom
    NAME_3x                     the spring that twists
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ic.grammar.syntax import List, WithUnit
from ic.language.bodies import BOOM, DAMPING_RATIO, EI, GJ, NODES
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters.owner import XYZ, NotSweepable, Owner
from ic.meaning.parameters.scope import Scope
from met.diagnostic import leave_out
from met.frozen import frozen
from met.plan import Joint, Link, Structure
from met.plan.chains import chains
from met.plan.closing import Loop
from met.trace import Real, minimum, sqrt

GAUSS = ((1.0 - 1.0 / math.sqrt(3.0)) / 2.0, (1.0 + 1.0 / math.sqrt(3.0)) / 2.0)
"""The points of Gauss's rule of two on a length of 1; each has the weight 1/2."""

FIRST_CLAMPED = 3.5160152685
"""Frequency of the first mode of a clamped beam over sqrt(EI/(m L^3)), the square of the least root of
cos(b) cosh(b) = -1."""

DEFAULT_NODES = 4
STIFFNESS, DAMPING = "N*m/rad", "N*m*s/rad"
FOLLOWS_FROM_SHAPE = ("com", "inertia")
KEYS = (*BOOM.keys, *FOLLOWS_FROM_SHAPE)


@frozen
class Spring:
    """A spring of a boom: its joint, the axis about which it turns, and the share of the boom's length that bends
    there."""

    joint: str
    axis: str
    share: float


def resolve_boom(scope: Scope, owner: Owner, item: Item, body: MergedBlock, link: Link) -> tuple[Link | Joint, ...]:
    """The pieces of a boom with their joints, the boom's own frame last; none where there is a mistake (already
    reported). link: the boom as a rigid link, with its numbers entered as parameters"""
    wrong = [body.items[name] for name in FOLLOWS_FROM_SHAPE if body.get(name) is not None]
    for entry in wrong:
        helps = leave_out(f"leave `{entry.name}` out: it follows from the mass and the shape")
        scope.complaints.error("D084", f"a boom is uniform, and this is its `{entry.name}`", entry.place, help=helps)
    if link.shape is None or "along" not in dict(link.shape[1]):
        if not scope.checks.failed(f"{owner.path}.shape"):
            message = f"boom `{link.name}` has no shape that says how long it is and along which axis"
            usage = "write `shape = cylinder(radius = ..., length = ..., along = x);`, or a rod or a box"
            scope.complaints.error("D084", message, item.place, help=usage)
        return ()
    along = XYZ[int(dict(link.shape[1])["along"])]
    across = tuple(axis for axis in XYZ if axis != along)
    stiff = _stiffness(scope, owner, body, across)
    twists = body.get(GJ.name) is not None
    torsion = scope.number(owner, GJ, body.get(GJ.name), record=False) if twists else 1.0
    ratio = scope.number(owner, DAMPING_RATIO, body.get(DAMPING_RATIO.name), record=False)
    nodes = _nodes(scope, owner, body)
    if twists and link.shape[0] == "rod":
        message = f"boom `{link.name}` is a thin rod, which has no inertia to twist with"
        cures = ["write `shape = cylinder(...)` or `box(...)`", leave_out("or leave `GJ` out: it does not twist then")]
        scope.complaints.error("D084", message, body.items[GJ.name].place, help=cures)
        return ()
    mass, length = scope.settled(f"{owner.path}.mass"), _length(scope, owner, link, along)
    failed = wrong or any(scope.checks.failed(owner.join(name)) for name in BOOM.keys)
    if failed or stiff is None or torsion is None or ratio is None or nodes is None or mass is None or length is None:
        return ()
    scope.checks.require(
        (mass.value,),  # type: ignore[arg-type]  # a number
        lambda values: (values[:, 0] == 0.0, []),
        code="D084",
        message=f"boom `{link.name}` has no mass",
        place=item.place,
        help="write its mass: what does not weigh has no modes",
    )
    boom = _Boom(scope, owner, item, link, along, length, mass.value)  # type: ignore[arg-type]  # a number
    springs = list(_springs(link.name, nodes, across, along if twists else None))
    decay = 2.0 * ratio / FIRST_CLAMPED * sqrt(boom.mass * length * length * length / minimum(*stiff))
    for spring in springs:
        beam = torsion if spring.axis == along else stiff[across.index(spring.axis)]
        boom.enter_spring(spring, beam / (spring.share * length), decay)
    return boom.parts(nodes, springs)


def _stiffness(scope: Scope, owner: Owner, body: MergedBlock, across: tuple[str, ...]) -> tuple[Real, Real] | None:
    """EI about the two axes across the boom."""
    item = body.get(EI.name)
    written = item.value.inner if item is not None and isinstance(item.value, WithUnit) else item and item.value
    if isinstance(written, List):
        two = replace(EI, shape="vector")
        return scope.vector(owner, two, item, names=across, record=False)  # type: ignore[return-value]  # two numbers
    both = scope.number(owner, EI, item, record=False)
    return None if both is None else (both, both)


def _nodes(scope: Scope, owner: Owner, body: MergedBlock) -> int | None:
    """The number of nodes at which a boom bends; None where it has a mistake, which is reported (D084)."""
    item = body.get(NODES.name)
    if item is None:
        scope.keep_setting(owner.join(NODES.name), float(DEFAULT_NODES), "1")
        return DEFAULT_NODES
    number = scope.constant(owner, NODES, item)
    if number is not None and number % 2.0:
        helps = ["write 2, 4, 6 or 8", "they stand in pairs, so that a load on the tip bends the boom exactly"]
        scope.complaints.error("D084", "a boom bends at an even number of nodes", item.place, help=helps)
        return None
    return None if number is None else int(number)


def _length(scope: Scope, owner: Owner, link: Link, along: str) -> Real | None:
    """The length of the boom's shape, m."""
    assert link.shape is not None
    size = scope.settled(f"{owner.path}.shape.{f'size.{along}' if link.shape[0] == 'box' else 'length'}")
    return None if size is None else size.value  # type: ignore[return-value]  # a number


def node_places(nodes: int) -> tuple[float, ...]:
    """The places of a boom's nodes, as shares of its length from the root."""
    return tuple((piece + point) / (nodes / 2) for piece in range(nodes // 2) for point in GAUSS)


def _springs(name: str, nodes: int, across: tuple[str, ...], along: str | None) -> Sequence[Spring]:
    """The springs of a boom, from its root to its tip. along: the axis about which it twists, if it does"""
    springs = []
    for node in range(1, nodes + 1):
        springs += [Spring(f"{name}_{node}{axis}", axis, 1.0 / nodes) for axis in across]
        if along is not None and node == nodes // 2 + 1:
            springs.append(Spring(f"{name}_{node}{along}", along, 1.0))
    return springs


@frozen
class _Boom:
    """A boom and its numbers, whose parts are entered in a scope.

    link  as a rigid one;  along: its axis;  length in m;  mass in kg
    """

    scope: Scope
    owner: Owner
    item: Item
    link: Link
    along: str
    length: Real
    mass: Real

    def parts(self, nodes: int, springs: Sequence[Spring]) -> tuple[Link | Joint, ...]:
        """The pieces and joints, entered; the boom's own frame last."""
        name, ends = self.link.name, (0.0, *node_places(nodes), 1.0)
        parts: list[Link | Joint] = [self._piece(0, *ends[:2])]
        parent = f"{name}_0"
        for node in range(1, nodes + 1):
            node_springs = [spring for spring in springs if spring.joint == f"{name}_{node}{spring.axis}"]
            for spring in node_springs:
                last = spring is node_springs[-1]
                child = f"{name}_{node}" if last else f"{name}_{node}_{spring.axis}"
                parts.append(self._piece(node, *ends[node : node + 2]) if last else self._frame(child))
                parts.append(self._joint(spring.joint, "revolute", parent, child))
                self._enter(f"{spring.joint}.axis", [float(axis == spring.axis) for axis in XYZ], "1")
                self._enter(f"{spring.joint}.pivot", self._on_axis(ends[node] * self.length), "m")
                parent = child
        parts.append(self._joint(f"{name}_tip", "fixed", parent, name))
        return (*parts, Link(name, self.link.place, None, root=f"{name}_0"))

    def enter_spring(self, spring: Spring, stiffness: Real, decay: Real) -> None:
        """Enter the stiffness of a spring, N m/rad, and its damping, `decay` seconds times that."""
        note = f"a spring of boom `{self.link.name}`"
        beam = (GJ if spring.axis == self.along else EI).name
        for name, value, unit, source in (
            ("stiffness", stiffness, STIFFNESS, beam),
            ("damping", stiffness * decay, DAMPING, DAMPING_RATIO.name),
        ):
            path = f"{spring.joint}.servo.{name}"
            self.scope.keep_derived(path, value, unit, self.item, note)
            self.scope.not_sweepable[path] = NotSweepable(
                "follows from the boom", one_of=f"`{self.owner.join(source)}`"
            )

    def _piece(self, number: int, begin: float, end: float) -> Link:
        """The piece between two shares of the length, uniform, with the rotary inertia of the cross-section."""
        name, share = f"{self.link.name}_{number}", end - begin
        mass, long = self.mass * share, self.length * share
        own: list[Real] = []
        for axis in XYZ:
            whole = self.scope.parameters[f"{self.owner.path}.inertia.{axis}{axis}"].value
            thin = 0.0 if axis == self.along else self.mass * (self.length * self.length - long * long) / 12.0
            own.append(share * (whole - thin))  # type: ignore[operator]  # numbers
        self._enter_matter(name, mass, self._on_axis((begin + end) / 2.0 * self.length), own)
        kind, sizes = self.link.shape or ("", ())
        size = "length" if kind != "box" else f"size_{self.along}"
        drawn = tuple((key, self.scope.checks.first(long) if key == size else value) for key, value in sizes)
        return Link(name, self.link.place, (kind, drawn))

    def _frame(self, name: str) -> Link:
        self._enter_matter(name, 0.0, (0.0,) * 3, (0.0,) * 3)
        return Link(name, self.link.place)

    def _joint(self, name: str, kind: str, parent: str, child: str) -> Joint:
        for vector, unit in (("at", "m"), ("rpy", "rad")):
            self._enter(f"{name}.{vector}", (0.0,) * 3, unit)
        return Joint(name, kind, parent, child, self.link.place)  # type: ignore[arg-type]  # of two kinds

    def _enter_matter(self, name: str, mass: Real, com: Sequence[Real], moments: Sequence[Real]) -> None:
        """Enter mass, centre of mass and moments of inertia of a boom's piece, SI."""
        head = f"links.{name}"
        self._keep(f"{head}.mass", mass, "kg")
        self._enter(f"{head}.com", com, "m")
        for moment, value in zip(("xx", "yy", "zz", "xy", "xz", "yz"), (*moments, 0.0, 0.0, 0.0), strict=True):
            self._keep(f"{head}.inertia.{moment}", value, "kg*m^2")

    def _on_axis(self, way: Real) -> list[Real]:
        return [way if axis == self.along else 0.0 for axis in XYZ]

    def _enter(self, path: str, vector: Sequence[Real], unit: str) -> None:
        for axis, value in zip(XYZ, vector, strict=True):
            self._keep(f"{path}.{axis}", value, unit)

    def _keep(self, path: str, value: Real, unit: str) -> None:
        self.scope.keep_derived(path, value, unit, self.item, f"of boom `{self.link.name}`")


def check_names(scope: Scope, item: Item, parts: Sequence[Link | Joint | Loop], arm: MergedBlock) -> None:
    """Report what the arm calls as a boom's piece or spring is called. item: the boom; parts: its own"""
    own = {part.name for part in parts} - {item.name}
    for other in arm.items.values():
        if other.name in own:
            message = f"boom `{item.name}` has a part `{other.name}` of its own"
            scope.complaints.error("D084", message, other.place, help="give one of the two another name")


PLACES = {"link": ("at", "point"), "to": ("to_at", "to_point"), "nozzle_link": ("nozzle",)}
"""The parameters of models that name a link, with those that are places on it."""


def check_places(scope: Scope, structure: Structure) -> None:
    """Check that what stands on a boom is at its tip, for the boom's frame moves with its last piece."""
    things = [(f"joint `{joint.name}`", f"{joint.name}.at", joint.parent, joint.place) for joint in structure.joints]
    for payload in structure.payloads:
        things.append((f"payload `{payload.name}`", f"payloads.{payload.name}.at", payload.link, payload.place))
    for head, group in (("environment", structure.environment), ("sensors", structure.sensors)):
        for use in group:
            path = f"{head}.{use.name}"
            for key, places in PLACES.items():
                named = scope.parameters.get(f"{path}.{key}")
                if named is not None and isinstance(named.value, str) and not _is_moment_alone(scope, path):
                    things += [(f"`{use.name}`", f"{path}.{place}", named.value, use.place) for place in places]
    shapes = {link.name: dict(link.shape[1]) for link in structure.links if link.shape is not None}
    for boom, chain in chains(structure.links, structure.joints).items():
        along = XYZ[int(shapes[chain[-1].parent]["along"])]
        springs = [f"{joint.name}.pivot.{along}" for joint in reversed(chain) if joint.kind != "fixed"]
        nodes = [scope.parameters[path].value for path in springs]
        for words, path, link, place in things:
            offset = scope.parameters.get(f"{path}.{along}")
            if link == boom and offset is not None and place is not None and path != f"{chain[0].name}.at":
                scope.checks.require(
                    (offset.value, *nodes),  # type: ignore[arg-type]  # numbers
                    partial(_before_the_tip, boom),
                    code="D084",
                    message=f"{words} is on boom `{boom}`, and not at its tip",
                    place=offset.origin.place or place,
                    help=f"what is on `{boom}` moves with its tip: name the piece that is there, or the link before it",
                )


def _is_moment_alone(scope: Scope, path: str) -> bool:
    """True of a wrench without a force in any case, which acts on a boom wherever it is."""
    forces = [setting.value for key, setting in scope.parameters.items() if key.startswith(f"{path}.force")]
    return bool(forces) and all(not any(force) if isinstance(force, tuple) else _is_zero(force) for force in forces)


def _is_zero(value: Real | str) -> bool:
    return isinstance(value, float) and value == 0.0


def _before_the_tip(boom: str, values: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The rows [n, 1 + springs], a place on a boom and those of its springs, m, whose place is before the last
    spring, as a mask; and the piece that is there in words."""
    bad, causes = values[:, 0] < values[:, -1], []
    for row in np.flatnonzero(bad)[:1]:
        place, nodes = values[row, 0], np.unique(values[row, 1:])
        piece = int(np.searchsorted(nodes, place, side="right"))
        causes.append(f"{place:.4g} m is on piece `{boom}_{piece}`; the tip is the piece beyond {nodes[-1]:.4g} m")
    return bad, causes
