"""Warnings of numbers and bodies of a size that is not found: nearly always a unit that is missing, or another's.

Nothing is said of what is merely rare. Each bound is beyond what there is by so much that decks of all sorts pass.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np

from ic.meaning.parameters.owner import XYZ, Settled
from ic.meaning.parameters.scope import Scope
from met.diagnostic import Place
from met.frozen import frozen
from met.plan import BASE, Structure
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
    Magnitude("m/s^2", re.compile(rf"environment\.[^.]+\.g{_VECTOR}"), 0.0, 300.0, "the Sun's surface has 274 m/s^2"),
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
"""Kinds of numbers. A limit such as `v_max` is none of them: decks write any large number for one that is far away."""

BY_UNIT: dict[str, list[Magnitude]] = {}
for _kind in MAGNITUDES:
    BY_UNIT.setdefault(_kind.unit, []).append(_kind)

THIN, DENSE = 0.1, 1e6
"""kg/m^3 of a shape: the lightest solids have 1, and a shape may stand for something hollow; the densest have 22,600,
and decks draw a mass as a ball that is far too small."""

HEAVY_ROD = 1e5
"""kg/m of a rod: steel of 4 m across."""

SOLIDS = (
    ("kg/m^3", "solids have 1 to 22,600", 10.0, 23e3),
    ("kg/m", "a bar of steel of 1 m across has 6,200", 0.01, 1e4),
)
"""Unit of a solid's density and of a rod's, what there is in words, and what is usual."""

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
"""Cures of a density: words, factors of the mass, and of the density for each size."""

GYRATION, LEAST_GYRATION = 10.0, 10.0
"""Times the arm's length, and m: a radius of gyration that is above both is of no link of it."""

OTHER_UNITS = (1e3, 1e6, 1e9)
"""What a number is too large or small by where a prefix went wrong."""

OTHER_INERTIAS = ((1e4, "kg*cm^2"), (1e6, "kg*mm^2"), (1e7, "g*cm^2"), (1e9, "g*mm^2"))
"""What a moment of inertia is too large by where it was in this unit."""

MEANT = 'if it is meant so, `allow {} because "...";`'


def check_magnitudes(scope: Scope, structure: Structure) -> None:
    """Warn of numbers and of bodies that nothing is like; of many of one kind once, with the worst."""
    if scope.complaints.error_count:
        return
    found: dict[Magnitude, list[tuple[str, Settled]]] = {}
    for path, settled in (*scope.parameters.items(), *scope.auxiliary.items()):
        for kind in BY_UNIT.get(settled.unit, ()):
            if _may_be_beyond(kind, settled) and kind.pattern.fullmatch(path):
                found.setdefault(kind, []).append((path, settled))
    for kind, those in found.items():
        _observe(scope, kind, those)
    for name, head in _bodies(structure):
        _observe_density(scope, name, head)
    _observe_inertias(scope, structure)


def _observe(scope: Scope, kind: Magnitude, those: list[tuple[str, Settled]]) -> None:
    """Look at all numbers of a kind, in all cases."""
    numbers: list[tuple[str, Settled, Real]] = []
    for path, settled in those:
        values = settled.value if isinstance(settled.value, tuple) else (settled.value,)
        numbers += [(path, settled, value) for value in values if not isinstance(value, str)]
    place = numbers[0][1].origin.place
    assert place is not None  # by what is looked at

    def warn(rows: np.ndarray) -> None:
        beyond = np.array([_beyond(kind, column) for column in rows.T]).T
        if not beyond.any() or scope.complaints.error_count:
            return
        worst = np.where(beyond, np.abs(np.log(np.abs(np.where(beyond, rows, 1.0)))), 0.0)
        row, column = np.unravel_index(int(worst.argmax()), worst.shape)
        path, settled, _ = numbers[column]
        value, several = float(rows[row, column]), len({numbers[at][0] for at in np.flatnonzero(beyond.any(axis=0))})
        more = f", and {several - 1} more {'is' if several == 2 else 'are'} so" if several > 1 else ""
        unit, small = settled.unit, abs(value) < kind.low
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
            f"`{path}` is {value:.6g} {unit}{more}, and {kind.known}",
            settled.origin.place or place,
            help=[*helps, MEANT.format("D297")],
        )

    scope.checks.observe(tuple(value for _, _, value in numbers), warn, place, needs=tuple(path for path, _ in those))


def _may_be_beyond(kind: Magnitude, settled: Settled) -> bool:
    """True where a number that the deck wrote is beyond what passes, or varies."""
    if settled.origin.place is None or settled.origin.kind == "derived" or isinstance(settled.value, str):
        return False
    values = settled.value if isinstance(settled.value, tuple) else (settled.value,)
    return any(isinstance(x, Scalar) or (x != 0.0 and not kind.low <= abs(x) <= kind.high) for x in values)


def _beyond(kind: Magnitude, values: np.ndarray) -> np.ndarray:
    sizes = np.abs(values)
    return np.asarray(np.isfinite(sizes) & (sizes > 0.0) & ((sizes < kind.low) | (sizes > kind.high)))


def _bodies(structure: Structure) -> Iterator[tuple[str, str]]:
    """Links and payloads that have a shape: in words, and the head of their paths."""
    for link in structure.links:
        if link.shape is not None:
            yield f"link `{link.name}`", f"links.{link.name}"
    for payload in structure.payloads:
        if payload.shape is not None:
            yield f"payload `{payload.name}`", f"payloads.{payload.name}"


def _observe_density(scope: Scope, name: str, head: str) -> None:
    """Look at what a body of this shape and mass would be made of."""
    sizes = {
        path.removeprefix(f"{head}.shape."): settled
        for path, settled in scope.auxiliary.items()
        if path.startswith(f"{head}.shape.") and settled.unit == "m"
    }
    mass = scope.parameters.get(f"{head}.mass")
    place = next((each.origin.place for each in sizes.values() if each.origin.place), None)
    if mass is None or place is None:
        return
    is_rod = set(sizes) == {"length"}
    constant = 4.0 / 3.0 * math.pi if set(sizes) == {"radius"} else math.pi if "radius" in sizes else 1.0
    powers = np.array([3 if set(sizes) == {"radius"} else 2 if each == "radius" else 1 for each in sizes])
    thin, dense = (0.0, HEAVY_ROD) if is_rod else (THIN, DENSE)

    def warn(rows: np.ndarray) -> None:
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            densities = rows[:, 0] / (constant * np.prod(rows[:, 1:] ** powers, axis=1))
        fine = ~(_beyond(MASSES, rows[:, 0]) | _beyond(LENGTHS, rows[:, 1:]).any(axis=1))  # else that is told
        bad = fine & np.isfinite(densities) & (rows[:, 0] > 0.0) & ((densities < thin) | (densities > dense))
        if not bad.any() or scope.complaints.error_count:
            return
        density = float(densities[bad][np.abs(np.log(densities[bad])).argmax()])
        cures = MORE if density < thin else LESS
        unit, known, least, most = SOLIDS[is_rod]
        changed = [(words, density * times * across ** (1 if is_rod else 3)) for words, times, across in cures]
        helps = [f"{words} it would be {x:.4g} {unit}: is a unit another?" for words, x in changed if least < x < most]
        scope.complaints.remark(
            "D298",
            f"{name} would be of {density:.4g} {unit}, and {known}",
            place,
            help=[*helps[:1], "look at the units of its mass and of its shape", MEANT.format("D298")],
        )

    _direct(scope, [mass, *sizes.values()], warn, place, head)


def _observe_inertias(scope: Scope, structure: Structure) -> None:
    """Look at links' radii of gyration beside the length of the arm."""
    lengths = [f"{joint.name}.at" for joint in structure.joints]
    lengths += [f"links.{link.name}.com" for link in structure.links]
    vectors = [scope.parameters.get(f"{path}.{axis}") for path in lengths for axis in XYZ]
    for link in structure.links:
        paths = ("mass", *(f"inertia.{axis}{axis}" for axis in XYZ))
        own = [scope.parameters.get(f"links.{link.name}.{path}") for path in paths]
        place = next((each.origin.place for each in own[1:] if each is not None and each.origin.place), None)
        if link.name == BASE or place is None or None in own or None in vectors or link.shape is not None:
            continue

        def warn(rows: np.ndarray, name: str = link.name, place: Place = place) -> None:
            mass, largest = rows[:, 0], rows[:, 1:4].max(axis=1)
            length = np.sqrt((rows[:, 4:].reshape(len(rows), -1, 3) ** 2).sum(axis=2)).sum(axis=1)
            radius = np.sqrt(largest / np.where(mass > 0.0, mass, np.inf))
            bad = (length > 0.0) & (radius > np.maximum(GYRATION * length, LEAST_GYRATION))
            if not bad.any() or scope.complaints.error_count:
                return
            row = int(np.where(bad, radius, 0.0).argmax())
            helps = [
                f"it would be of {radius[row] / math.sqrt(times):.4g} m, were it in {unit}: "
                f"`{largest[row]:.6g} {unit}` is {largest[row] / times:.4g} kg*m^2"
                for times, unit in OTHER_INERTIAS
                if radius[row] / math.sqrt(times) <= 2.0 * length[row]
            ][:1]
            scope.complaints.remark(
                "D298",
                f"link `{name}` has the inertia of a body of {radius[row]:.4g} m (its radius of gyration), and its arm "
                f"is {length[row]:.4g} m long",
                place,
                help=[*helps, "look at the units of its mass and of its inertia", MEANT.format("D298")],
            )

        _direct(scope, [*own, *vectors], warn, place, f"links.{link.name}")


def _direct(scope: Scope, those: list[Settled | None], warn: object, place: Place, head: str) -> None:
    values = tuple(each.value for each in those if each is not None)
    scope.checks.observe(values, warn, place, needs=(head,))  # type: ignore[arg-type]
