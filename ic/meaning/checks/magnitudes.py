"""Warnings about implausible numbers and bodies: nearly always a unit is missing, or wrong.

Nothing is said of what is merely rare. Each bound is beyond what there is by so much that decks of all sorts pass.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ic.meaning.parameters.owner import XYZ, Settled
from ic.meaning.parameters.scope import Scope
from met.diagnostic import Place
from met.frozen import frozen
from met.plan import BASE, Structure
from met.plan.defaults import INERTIA
from met.trace import Real, Scalar


@frozen
class Magnitude:
    """The sizes that numbers of one kind have: those of this unit whose whole path the pattern matches.

    low, high  smallest and largest that is let pass, SI; 0 passes always
    known      the largest, or smallest, that there is, in words
    """

    unit: str
    pattern: re.Pattern[str]
    low: float
    high: float
    known: str


_BODY = r"(links|payloads)\.[^.]+\."
_VECTOR = r"\.[xyz]"

LENGTHS = Magnitude(
    "m",
    re.compile(rf"[^.]+\.at{_VECTOR}|[^.]+\.dh\.[ad]|{_BODY}((com|at){_VECTOR}|shape\..+)"),
    0.0,
    200.0,
    "the longest links there are have some 60 m",
)
MASSES = Magnitude(
    "kg", re.compile(rf"{_BODY}mass"), 1e-6, 1e7, "links weigh a milligram and more, and the largest some 400 t"
)

MAGNITUDES = (
    LENGTHS,
    MASSES,
    Magnitude("N*m/A", re.compile(r".+"), 0.0, 300.0, "the largest motors have some 100 N*m/A"),
    *(
        Magnitude(
            unit,
            re.compile(
                rf"initial\.[^.]+\.(qd|(rate|velocity){_VECTOR})|payloads\.[^.]+\.(rate|velocity){_VECTOR}"
                r"|[^.]+\.servo\.command(\.(?!max_).+)?"
            ),
            0.0,
            5e4,
            known,
        )
        for unit, known in (("rad/s", "the fastest spindles have some 40,000 rad/s"), ("m/s", "meteors have 70 km/s"))
    ),
)
"""Kinds of numbers. A limit such as `v_max` is not included: decks write any large number for one that is far away."""


THIN, DENSE = 1.0, 1e6
"""Smallest and largest density of a shape, kg/m^3: the lightest solids have 1; the densest have 22,600, and decks draw
a mass as a ball that is far too small."""

HEAVY_ROD = 1e5
"""Largest mass per length of a rod, kg/m: steel of 4 m across."""

SOLIDS = (
    ("kg/m^3", "solids have 1 to 22,600", 10.0, 23e3),
    ("kg/m", "a bar of steel of 1 m across has 6,200", 0.01, 1e4),
)
"""Unit of a solid's density and of a rod's, the existing range in words, and the usual range."""

LESS = (
    ("with 1,000 times less mass", 1e-3, 1.0),
    ("with sizes 10 times larger", 1.0, 0.1),
    ("with sizes 1,000 times larger", 1.0, 1e-3),
)
MORE = (
    ("with 1,000 times more mass", 1e3, 1.0),
    ("with a tenth of the sizes", 1.0, 10.0),
    ("with a thousandth of the sizes", 1.0, 1e3),
)
"""Remedies of a density: words, factors of the mass, and of the density for each size."""

GYRATION, LEAST_GYRATION = 4.0, 10.0
"""Largest radius of gyration relative to an arm's length of links that are judged by their density, and smallest, m: a
larger one is far from usual already (`scales`)."""

SMALLEST_GYRATION = 1e-5
"""Smallest radius of gyration of a body of a milligram or more, m: a ball of lead that has it weighs 5e-11 kg, but
decks have masses that are nearly points. These have equal moments; bodies with other moments are no denser than `DENSE`
as balls. Of 1,766 links of example-robot-data 8 are denser: two have an inertia 1,000 times too small, six of 0."""

IN_OTHER_UNITS = (
    ("mm and g", 1e-3, 1e-3),
    ("mm and kg", 1.0, 1e-3),
    ("cm and g", 1e-3, 1e-2),
    ("cm and kg", 1.0, 1e-2),
)
"""Units of all numbers of a body, with the factors of its mass and of its sizes if it was in them."""

OTHER_UNITS = (1e3, 1e6, 1e9)
"""Factors by which a number is wrong after a wrong prefix."""

OTHER_INERTIAS = ((1e4, "kg*cm^2"), (1e6, "kg*mm^2"), (1e7, "g*cm^2"), (1e9, "g*mm^2"))
"""Factors by which a moment of inertia is wrong if it was in this unit."""

USUAL_GYRATION = 0.4
"""A usual radius of gyration as a share of the arm's length: that of a rod is 0.29 of its own, 0.58 of the way to its
middle."""

OF_BASE = f"links.{BASE}"

MEANT = 'if it is meant so, `allow {} because "...";`'


def check_magnitudes(scope: Scope, structure: Structure) -> None:
    """Warn about implausible numbers and bodies; about several of one kind once, with the worst."""
    by_kind: dict[Magnitude, list[tuple[str, Settled]]] = {}
    for path, settled in (*scope.parameters.items(), *scope.auxiliary.items()):
        for kind in MAGNITUDES:
            if kind.unit == settled.unit and _may_be_beyond(kind, settled) and kind.pattern.fullmatch(path):
                by_kind.setdefault(kind, []).append((path, settled))
    for kind, those in by_kind.items():
        _observe(scope, kind, those)
    bodies = list(_bodies(scope, structure.straight))
    _observe_densities(scope, [body for body in bodies if body.sizes and body.may_be_odd])
    of_their_own = [body for body in bodies if any(moment.origin.kind != "derived" for moment in body.moments)]
    # the inertia of a shape follows from it; a base may be of any size, and so may a payload
    small = [body for body in of_their_own if body.sizes or (body.head.startswith("links.") and body.head != OF_BASE)]
    _observe_inertias(scope, structure, small)


def _observe(scope: Scope, kind: Magnitude, those: list[tuple[str, Settled]]) -> None:
    """Check all numbers of a kind, in all cases."""
    numbers: list[tuple[str, Settled, Real]] = []
    for path, settled in those:
        values = settled.value if isinstance(settled.value, tuple) else (settled.value,)
        numbers += [(path, settled, value) for value in values if not isinstance(value, str)]
    place = numbers[0][1].origin.place
    assert place is not None  # by the selection

    def warn(rows: np.ndarray) -> None:
        """Warn about the most extreme of the numbers that are beyond their kind's bounds (D297). rows: [case, number],
        SI."""
        beyond = np.array([_beyond(kind, column) for column in rows.T]).T
        if not beyond.any() or scope.complaints.error_count:
            return
        worst = np.where(beyond, np.abs(np.log(np.abs(np.where(beyond, rows, 1.0)))), 0.0)
        row, column = np.unravel_index(int(worst.argmax()), worst.shape)
        path, settled, _ = numbers[column]
        value, several = (
            float(rows[row, column]),
            len({numbers[index][0] for index in np.flatnonzero(beyond.any(axis=0))}),
        )
        unit, small, where = settled.unit, abs(value) < kind.low, scope.checks.where(int(row), [numbers[column][2]])
        helps = [
            f"{times:,.0f} times {'more' if small else 'less'} would be {value * factor:.6g} {unit}: "
            "is a unit another, or missing?"
            for times in OTHER_UNITS
            for factor in (times if small else 1.0 / times,)
            if not _beyond(kind, np.array(value * factor))
        ][:1]
        if unit == "kg" and small:
            helps.append("a link without mass is a frame: `mass = 0 kg`")
        scope.complaints.remark(
            "D297",
            f"`{path}` is {value:.6g} {unit}{where}{_others(several)}, and {kind.known}",
            settled.origin.place or place,
            help=[*helps, MEANT.format("D297")],
        )

    scope.checks.observe(tuple(value for _, _, value in numbers), warn, place, needs=tuple(path for path, _ in those))


def _may_be_beyond(kind: Magnitude, settled: Settled) -> bool:
    """True where a number in the deck is beyond the allowed range, or varies."""
    if settled.origin.place is None or settled.origin.kind == "derived" or isinstance(settled.value, str):
        return False
    values = settled.value if isinstance(settled.value, tuple) else (settled.value,)
    return any(isinstance(x, Scalar) or (x != 0.0 and not kind.low <= abs(x) <= kind.high) for x in values)


def _beyond(kind: Magnitude, values: np.ndarray) -> np.ndarray:
    sizes = np.abs(values)
    return np.asarray(np.isfinite(sizes) & (sizes > 0.0) & ((sizes < kind.low) | (sizes > kind.high)))


@frozen
class WeighedBody:
    """A link or a payload with its known properties: mass, inertia (xx, yy, zz, xy, xz, yz) and sizes of its shape.

    name    in words;  head: of its paths
    place   of its shape, or of its inertia
    sizes   of its shape by name, m; empty where it has none
    """

    name: str
    head: str
    place: Place
    mass: Settled
    inertia: tuple[Settled, ...]
    sizes: Mapping[str, Settled]

    @property
    def moments(self) -> tuple[Settled, ...]:
        """The moments about the three axes."""
        return self.inertia[:3]

    @property
    def is_rod(self) -> bool:
        """True of a shape that has no volume."""
        return set(self.sizes) == {"length"}

    def volume(self, sizes: Iterable[Any]) -> Any:
        """The volume, m^3, of a rod the length, m, for sizes in the order of `sizes`: numbers, or arrays of them."""
        ball = set(self.sizes) == {"radius"}
        factor = 4.0 / 3.0 * math.pi if ball else math.pi if "radius" in self.sizes else 1.0
        powers = (3 if ball else 2 if name == "radius" else 1 for name in self.sizes)
        return math.prod((size**power for size, power in zip(sizes, powers, strict=True)), start=factor)

    @property
    def may_be_odd(self) -> bool:
        """True where the density is not that of a solid, or varies."""
        numbers = [self.mass.value, *(size.value for size in self.sizes.values())]
        if any(isinstance(number, Scalar) for number in numbers):
            return True
        volume = self.volume(numbers[1:])
        thin, dense = self.densities
        return volume > 0.0 and not thin * volume <= self.mass.value <= dense * volume

    @property
    def densities(self) -> tuple[float, float]:
        """The smallest and the largest allowed density, kg/m^3, or for a rod kg/m."""
        return (0.0, HEAVY_ROD) if self.is_rod else (THIN, DENSE)


def _bodies(scope: Scope, structure: Structure) -> Iterator[WeighedBody]:
    """Links and payloads with known numbers, but for lumped links, whose numbers are no body's."""
    named = [("link", "links", link.name) for link in structure.links if not link.lumped]
    named += [("payload", "payloads", payload.name) for payload in structure.payloads]
    shapes: dict[str, dict[str, Settled]] = {}
    for path, settled in scope.auxiliary.items():
        owner, shape, size = path.partition(".shape.")
        if shape and settled.unit == "m":
            shapes.setdefault(owner, {})[size] = settled
    for word, group, name in named:
        head = f"{group}.{name}"
        sizes = shapes.get(head, {})
        mass = scope.parameters.get(f"{head}.mass")
        moments = [scope.parameters.get(f"{head}.inertia.{part}") for part in INERTIA]
        written = [*sizes.values(), *moments]
        place = next((number.origin.place for number in written if number is not None and number.origin.place), None)
        if mass is not None and place is not None and None not in moments:
            yield WeighedBody(
                f"{word} `{name}`", head, place, mass, tuple(moment for moment in moments if moment), sizes
            )


def _observe_densities(scope: Scope, bodies: Sequence[WeighedBody]) -> None:
    """Check the densities that follow from bodies' shapes and masses."""
    settled = [number for body in bodies for number in (body.mass, *body.sizes.values())]
    ends = np.cumsum([1 + len(body.sizes) for body in bodies]).tolist()

    def warn(rows: np.ndarray) -> None:
        """Warn about the body whose density is the most extreme (D298). rows: [case, number], the mass and the sizes of
        each body, SI."""
        odd_bodies = []
        for body, first, last in zip(bodies, [0, *ends], ends, strict=False):
            mass, sizes = rows[:, first], rows[:, first + 1 : last]
            thin, dense = body.densities
            with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
                densities = mass / body.volume(sizes.T)
            fine = ~(_beyond(MASSES, mass) | _beyond(LENGTHS, sizes).any(axis=1))  # else that is reported
            bad = fine & np.isfinite(densities) & (mass > 0.0) & ((densities < thin) | (densities > dense))
            if bad.any():
                row = int(np.flatnonzero(bad)[np.abs(np.log(densities[bad])).argmax()])
                odd_bodies.append((body, float(densities[row]), _where(scope, body, row, float(mass[row]))))
        if not odd_bodies or scope.complaints.error_count:
            return
        body, density, where = max(odd_bodies, key=lambda candidate: abs(math.log(candidate[1])))
        cures = MORE if density < 1.0 else LESS
        unit, known, least, most = SOLIDS[body.is_rod]
        changed = [(words, density * times * across ** (1 if body.is_rod else 3)) for words, times, across in cures]
        helps = [f"{words} it would be {x:.4g} {unit}: is a unit another?" for words, x in changed if least < x < most]
        scope.complaints.remark(
            "D298",
            f"{body.name} would be of {density:.4g} {unit}{where}{_others(len(odd_bodies))}, and {known}",
            body.place,
            help=[*helps[:1], "look at the units of its mass and of its shape", MEANT.format("D298")],
        )

    _together(scope, settled, warn, bodies)


def _observe_inertias(scope: Scope, structure: Structure, bodies: Sequence[WeighedBody]) -> None:
    """Check that bodies are no denser and no thinner than solids by their inertia alone."""
    if not bodies:
        return
    paths = [f"{joint.name}.at" for joint in structure.joints] + [f"links.{link.name}.com" for link in structure.links]
    vectors = [scope.parameters.get(f"{path}.{axis}") for path in paths for axis in XYZ]
    if None in vectors:
        return
    settled = [number for body in bodies for number in (body.mass, *body.inertia, *body.sizes.values())]
    ends = np.cumsum([7 + len(body.sizes) for body in bodies]).tolist()

    def warn(rows: np.ndarray) -> None:
        """Warn about the body that is the thinnest by its inertia, and about the smallest (D298). rows: [case, number],
        mass, inertia and sizes of each body, then the vectors whose lengths add up to the arm's, SI."""
        with np.errstate(over="ignore"):  # an arm of 1e200 m overflows to infinity, which is reported
            arm = np.sqrt((rows[:, ends[-1] :].reshape(len(rows), -1, 3) ** 2).sum(axis=2)).sum(axis=1)
        by_remark: dict[Remark, list[tuple[float, WeighedBody, OddBody, str]]] = {}
        for body, first, last in zip(bodies, [0, *ends], ends, strict=False):
            mass, inertia, sizes = rows[:, first], rows[:, first + 1 : first + 7], rows[:, first + 7 : last]
            largest = inertia[:, :3].max(axis=1)
            with np.errstate(over="ignore", invalid="ignore"):  # a body of 1e-320 kg likewise
                radius = np.sqrt(np.maximum(largest, 0.0) / np.where(mass > 0.0, mass, np.inf))
                length = np.sqrt((sizes * sizes).sum(axis=1)) if body.sizes else arm
                density = _ellipsoid_density(mass, inertia)
            thin = (radius > LEAST_GYRATION) & (radius <= GYRATION * length) & (density > 0.0) & (density < THIN)
            thin &= not body.sizes
            with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
                ball = mass / (4.0 / 3.0 * math.pi * (2.5**0.5 * radius) ** 3)  # density of one that is as hard to turn
            dense = (ball > DENSE) & (inertia[:, :3].min(axis=1) < largest)  # equal ones stand for a point
            tiny = (radius > 0.0) & (mass >= MASSES.low) & ((radius < SMALLEST_GYRATION) | dense)
            kinds: list[tuple[Remark, np.ndarray, np.ndarray]] = [
                (_too_thin, thin, 1.0 / np.where(thin, density, 1.0)),
                (_too_small, tiny, 1.0 / np.where(tiny, radius, 1.0)),
            ]
            for remark, bad, excess in kinds:
                if bad.any():
                    row = int(np.where(bad, excess, 0.0).argmax())
                    numbers = (float(array[row]) for array in (radius, length, largest, mass, density))
                    odd = OddBody(body.sizes, *numbers)
                    where = _where(scope, body, row, odd.mass)
                    by_remark.setdefault(remark, []).append((float(excess[row]), body, odd, where))
        if scope.complaints.error_count:
            return
        for remark, those in by_remark.items():
            _, body, odd, where = max(those, key=lambda candidate: candidate[0])
            beside, helps = remark(odd)
            scope.complaints.remark(
                "D298",
                f"{body.name} has the inertia of a body of {odd.radius:.4g} m (its radius of gyration){where}"
                f"{_others(len(those))}, and {beside}",
                next((moment.origin.place for moment in body.moments if moment.origin.place), body.place),
                help=[*helps[:1], "look at the units of its mass and of its inertia", MEANT.format("D298")],
            )

    _together(scope, [*settled, *(vector for vector in vectors if vector is not None)], warn, bodies)


@frozen
class OddBody:
    """The numbers of a body with an odd inertia: radius of gyration, length of its arm or shape, largest moment, mass,
    density as a solid ellipsoid; SI. sizes: of its shape, empty where it has none"""

    sizes: Mapping[str, Settled]
    radius: float
    length: float
    largest: float
    mass: float
    density: float


Remark = Callable[[OddBody], tuple[str, list[str]]]
"""What an odd body is compared with, and remedies."""


def _unlikely(radius: float, odd: OddBody) -> float:
    """The distance of a radius of gyration, m, from a usual one of such an arm or shape, as a ratio's logarithm; 0
    where nothing is usual."""
    usual = USUAL_GYRATION * odd.length
    return abs(math.log(radius / usual)) if radius > 0.0 and 0.0 < usual < math.inf else 0.0


def _too_thin(odd: OddBody) -> tuple[str, list[str]]:
    """The density of a body too large for its mass, on an arm that is as large, and the units that would explain it."""
    unit, known, least, most = SOLIDS[0]
    helps = [
        f"it would be of {odd.radius * across:.4g} m, {odd.mass * lighter:.4g} kg and {denser:.4g} {unit}, were all "
        f"its numbers in {units}"
        for units, lighter, across in IN_OTHER_UNITS
        if least < (denser := odd.density * lighter / across**3) < most
    ]
    return f"would be of {odd.density:.4g} {unit}; {known}", helps


def _too_small(odd: OddBody) -> tuple[str, list[str]]:
    """The size that a body with next to no inertia is compared with, and the units that would explain it."""
    helps = [
        f"it would be of {odd.radius * math.sqrt(times):.4g} m, were it {odd.largest * times:.4g} kg*m^2: was it "
        f"converted from {unit} twice?"
        for times, unit in sorted(
            OTHER_INERTIAS, key=lambda other_unit: _unlikely(odd.radius * math.sqrt(other_unit[0]), odd)
        )
        if 0.05 * odd.length <= odd.radius * math.sqrt(times) <= 2.0 * odd.length
    ]
    return (
        f"weighs {odd.mass:.4g} kg, more than any solid of that size; a point mass has `inertia = [0, 0, 0] kg*m^2`",
        helps,
    )


def _ellipsoid_density(mass: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """The density of the solid ellipsoids of these masses and moments xx, yy, zz, xy, xz, yz, kg/m^3; infinite for flat
    ones, and for moments of no body."""
    xx, yy, zz, xy, xz, yz = inertia.T
    half = (xx + yy + zz) / 2.0
    x, y, z = half - xx, half - yy, half - zz  # second moments of mass: a diagonal element is m a^2/5
    volume = x * (y * z - yz * yz) - xy * (xy * z + yz * xz) - xz * (xy * yz + y * xz)
    least = np.sqrt(np.maximum(volume, 0.0)) * (4.0 / 3.0 * math.pi)
    with np.errstate(divide="ignore"):
        return np.where((mass > 0.0) & (least > 0.0), mass * (mass / 5.0) ** 1.5 / least, np.inf)


def _where(scope: Scope, body: WeighedBody, row: int, mass: float) -> str:
    """A remark on the case in which a body is so, with its mass; empty where it is so in all cases."""
    numbers = [number.value for number in (body.mass, *body.inertia, *body.sizes.values())]
    case = scope.checks.where(row, numbers)
    return f"{case} ({mass:.4g} kg)" if case else ""


def _others(count: int) -> str:
    """A remark that others are so too, besides the reported one."""
    return f", and {count - 1} more {'is' if count == 2 else 'are'} so" if count > 1 else ""


def _together(
    scope: Scope, settled: Sequence[Settled], warn: Callable[[np.ndarray], None], bodies: Sequence[WeighedBody]
) -> None:
    """Check bodies once the cases are known, all of them in one call of `warn`."""
    if bodies:
        values: tuple[Real, ...] = tuple(number.value for number in settled)  # type: ignore[misc]  # they are numbers
        scope.checks.observe(values, warn, bodies[0].place, needs=tuple(body.head for body in bodies))
