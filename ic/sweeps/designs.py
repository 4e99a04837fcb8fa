"""Samples: cases drawn from distributions, when the plan is made; the plan holds the numbers.

    lhs(n)      a Latin hypercube: each parameter's range in n equal parts, one value from each
    sobol(n)    a scrambled Sobol sequence: evenly spread, best where n is a power of 2
    random(n)   independent draws

A design makes n points in the unit cube, a distribution's quantiles turn them into values. Those are rounded to 12
digits in the deck's unit (met/plan/drawing.py). Those of `random` follow one by one from the seed and their numbers,
so that a long sample is computed where it is used; the others are made as a whole, a table.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from ic.grammar.places import place_of
from ic.grammar.syntax import Call, Expression, Setting, Statement, Unit, WithUnit
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.evaluate import PURE, evaluate_number
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value, measure_of
from ic.sweeps.choices import check_constant
from ic.text.complaints import Complaints, known_words
from met import units
from met.diagnostic import Place, Problem, did_you_mean, error
from met.distinct import distinct
from met.frozen import frozen
from met.plan import Design
from met.plan.columns import MOST_SWEPT, CaseValues, listed
from met.plan.drawing import DIGITS, DrawnColumn, drawn_values, within
from met.trace import Scalar

MOST_LISTED = 1_000_000
"""Samples of a design that is drawn as a whole; those of `random` are computed one by one."""

DESIGNS: tuple[Design, ...] = ("lhs", "sobol", "random")
DISTRIBUTIONS: Mapping[str, tuple[str, ...]] = {
    "uniform": ("from", "to"), "loguniform": ("from", "to"), "normal": ("mean", "deviation"),
    "truncated": ("mean", "deviation", "from", "to"),
}  # fmt: skip


@frozen
class DrawnParameter:
    """One parameter that is drawn: its distribution, with arguments in SI. low: the first of them as written."""

    path: str
    place: Place
    distribution: str
    arguments: tuple[float, ...]
    low: Value
    unit: Unit | None

    @property
    def measure(self) -> units.Measure | None:
        return measure_of(self.unit) if self.unit is not None else None

    def values(self, points: np.ndarray) -> np.ndarray:
        """Quantiles at these points of (0, 1), SI, rounded in the deck's unit."""
        return drawn_values(self.distribution, self.arguments, self.measure, points)

    def independent(self, count: int, seed: int, number: int) -> CaseValues:
        """So many draws without regard to one another, those of a long sample computed where they are asked for."""
        unit = self.unit.text if self.unit is not None else ""
        return listed(DrawnColumn(count, seed, self.path, number, self.distribution, self.arguments, unit))


@frozen
class SampleDesign:
    """A `sample` statement as read. warning: message and place of a warning about it."""

    design: Design
    count: int
    seed: int
    parts: tuple[DrawnParameter, ...]
    warning: tuple[str, Place] | None = None

    @property
    def note(self) -> str:
        lasting = ": another count would draw other values" if self.design == "lhs" else ""
        return f"sample {self.design}({self.count}), seed {self.seed}{lasting}"

    def draw(self, number: int) -> list[CaseValues]:
        """The values of each part. number: of the sample in its sweep, from 1. Raises Problem where they are one."""
        found: list[CaseValues]
        if self.design == "random":  # a stream for each path, so that more samples or parameters change no old value
            found = [part.independent(self.count, self.seed, number) for part in self.parts]
        else:
            points = _points(self.design, self.count, len(self.parts), self.seed, number)
            found = [part.values(column) for part, column in zip(self.parts, points.T, strict=True)]
        for part, values in zip(self.parts, found, strict=True):
            looked_at = min(self.count, MOST_LISTED)
            different = len(distinct(values[:looked_at]))
            if 2 * different < looked_at:
                raise Problem(
                    error(
                        "D225",
                        f"`{part.path}` hardly varies: {looked_at} samples have {different} "
                        f"value{'s' * (different != 1)}",
                        part.place,
                        help=[f"values have {DIGITS} digits: draw it from a wider distribution", "or leave it out"],
                    )
                )
        return found


def _points(design: str, count: int, parts: int, seed: int, number: int) -> np.ndarray:
    """Points of the open unit cube, [count, parts], each with regard to the others."""
    from scipy.stats import qmc  # takes most of a second to import

    stream = np.random.Generator(np.random.PCG64([seed, number]))
    sampler = {"lhs": qmc.LatinHypercube, "sobol": qmc.Sobol}[design](parts, rng=stream)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of counts that are no power of 2, for which MET has its own
        drawn = sampler.random(count)
    return within(drawn)


# Reading


def read_sample(
    definitions: Definitions, complaints: Complaints, statement: Statement, paths: Mapping[str, Place], seed: int
) -> SampleDesign:
    """`sample lhs(200) { PATH = uniform(a, b) UNIT; ... }`. paths: what the sweep varies, and where.

    Raises Problem, placed.
    """
    call = statement.value
    if not isinstance(call, Call) or call.body is None:
        raise Problem(
            error(
                "D224",
                "a sample is a design and a block",
                place_of(call),
                help="write `sample lhs(200) { PATH = uniform(a, b) UNIT; }`",
            )
        )
    design = call.name.text
    if design not in DESIGNS:
        raise Problem(
            error(
                "D224",
                f"no design `{design}`",
                call.name.place,
                help=[*did_you_mean(design, DESIGNS), known_words("designs", DESIGNS)],
            )
        )
    if len(call.positional) != 1 or call.named:
        raise Problem(
            error(
                "D224",
                f"`{design}` takes the number of samples",
                call.name.place,
                help=f"write `sample {design}(200) {{ ... }}`",
            )
        )
    names = Names(definitions, {}, watched=set(paths))
    most = MOST_SWEPT if design == "random" else MOST_LISTED
    count = _count(evaluate_number(call.positional[0], names.find), most)
    parts = []
    before = complaints.error_count
    for entry in call.body:
        with complaints.gather():
            if not isinstance(entry, Setting) or entry.words or entry.operator != "=":
                other = [f"leave out `{entry.words[0].text}`"] if isinstance(entry, Setting) and entry.words else []
                raise Problem(
                    error(
                        "D224",
                        "a sample holds `PATH = DISTRIBUTION(...);` and nothing else",
                        entry.place,
                        help=[*other, known_words("distributions", DISTRIBUTIONS)],
                    )
                )
            parts.append(_part(entry, names, paths))
    if complaints.error_count > before:
        raise Problem(())
    if not parts:
        raise Problem(
            error("D224", "this sample is empty", statement.place, help="write `PATH = uniform(a, b) UNIT;` in it")
        )
    warning = None
    if design == "sobol" and count & (count - 1):
        lower = 1 << (count.bit_length() - 1)
        warning = (
            f"{count} points of a Sobol sequence are less even than {lower} or {2 * lower}",
            place_of(call.positional[0]),
        )
    return SampleDesign(design, count, seed, tuple(parts), warning)


def _count(found: Value, most: int) -> int:
    number = found.number
    if (
        isinstance(number, Scalar)
        or found.dimension != PURE
        or not float(number).is_integer()
        or not 1 <= number <= most
    ):
        raise Problem(error("D113", f"a number of samples is a whole number from 1 to {most}", found.place))
    return int(number)


def _part(entry: Setting, names: Names, paths: Mapping[str, Place]) -> DrawnParameter:
    path = ".".join(word.text for word in entry.path)
    unit, call = None, entry.value
    if isinstance(call, WithUnit):
        unit, call = call.unit, call.inner
    if not isinstance(call, Call) or call.name.text not in DISTRIBUTIONS:
        near = did_you_mean(call.name.text, DISTRIBUTIONS) if isinstance(call, Call) else ()
        raise Problem(
            error(
                "D225",
                f"`{path}` is drawn from a distribution",
                place_of(entry.value),
                help=[*near, f"write `{path} = uniform(a, b) UNIT;`", known_words("distributions", DISTRIBUTIONS)],
            )
        )
    name = call.name.text
    wanted = DISTRIBUTIONS[name]
    usage = f"write `{name}({', '.join(wanted)}) UNIT`"
    if len(call.positional) != len(wanted) or call.named or call.body is not None:
        raise Problem(error("D225", f"`{name}` takes {len(wanted)} numbers, in order", call.name.place, help=usage))
    found = [evaluate_number(_in_unit(each, unit), names.find) for each in call.positional]
    check_constant(path, entry, names, paths)
    for other in found[1:]:
        if not units.same(other.dimension, found[0].dimension):
            raise Problem(
                error(
                    "D063",
                    f"`{name}` of {units.text(found[0].dimension)} and {units.text(other.dimension)}",
                    other.place,
                    help="all must be of one dimension",
                )
            )
    arguments = tuple(float(value.number) for value in found)
    _check_arguments(name, arguments, found)
    unit = unit or next((value.unit for value in found if value.unit is not None), None)
    if unit is not None and measure_of(unit).dimension != found[0].dimension:
        unit = None
    return DrawnParameter(path, entry.place, name, arguments, found[0], unit)


def _in_unit(expression: Expression, unit: Unit | None) -> Expression:
    return expression if unit is None else WithUnit(expression, unit, place_of(expression))


def _check_arguments(name: str, arguments: tuple[float, ...], found: list[Any]) -> None:
    if name in ("normal", "truncated") and not arguments[1] > 0.0:
        raise Problem(
            error(
                "D225",
                "a standard deviation is above 0",
                found[1].place,
                help="a parameter that does not vary belongs in the run",
            )
        )
    if name != "normal" and not arguments[-2] < arguments[-1]:
        raise Problem(
            error(
                "D225",
                f"`{name}` goes from a lower to a higher value",
                found[-1].place,
                help="change the two about, or leave the parameter out where they are equal",
            )
        )
    if name == "loguniform" and not arguments[0] * arguments[1] > 0.0:
        raise Problem(
            error(
                "D225",
                "the ends of a loguniform are both above or both below zero",
                found[0].place,
                help="`uniform` has no such limit",
            )
        )
