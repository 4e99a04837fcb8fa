"""Samples: cases drawn from distributions, when the plan is made; the plan holds the numbers.

    lhs(n)      a Latin hypercube: each parameter's range in n equal parts, one value from each
    sobol(n)    a scrambled Sobol sequence: evenly spread, best where n is a power of 2
    random(n)   independent draws
    saltelli(n) n times the d + 2 cases from which first-order and total indices of d parameters are estimated: a point
                a of a scrambled Sobol sequence, a with one coordinate after the other from a second point b, and b
                (A. Saltelli et al., Computer Physics Communications 181 (2010) 259-270)

A design makes n points in the unit cube, a distribution's quantiles turn them into values. Those are rounded to 12
digits in the deck's unit (met/plan/drawing.py). Those of `random` follow one by one from the seed and their numbers,
so that a long sample is computed where it is used; the others are made as a whole, a table.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ic.grammar.settings import path_of
from ic.grammar.syntax import Call, Expression, Name, Setting, Statement, Unit, WithUnit, place_of
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.evaluate import evaluate_number
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value, as_whole, measure_of, unit_of_plan
from ic.sweeps.choices import check_constant
from ic.text.complaints import Complaints, known_words
from met import units
from met.diagnostic import Place, Problem, did_you_mean, error
from met.distinct import distinct
from met.frozen import frozen
from met.plan import Design
from met.plan.columns import MOST_SWEPT, CaseValues, listed
from met.plan.drawing import DIGITS, DrawnColumn, drawn_values, within
from met.statistics.saltelli import FEWEST_PAIRS

UNTIL_SHOWN, AT_MOST = "until_shown", "at_most"
"""Words in place of a number of samples."""

MOST_LISTED = 1_000_000
"""Largest number of samples of a design that is drawn as a whole; those of `random` are computed one by one."""

DESIGNS: tuple[Design, ...] = ("lhs", "sobol", "random", "saltelli")
DISTRIBUTIONS: Mapping[str, tuple[str, ...]] = {
    "uniform": ("from", "to"), "loguniform": ("from", "to"), "normal": ("mean", "deviation"),
    "truncated": ("mean", "deviation", "from", "to"),
}  # fmt: skip


@frozen
class DrawnParameter:
    """One drawn parameter: its distribution, with arguments in SI. low: the first of them as written."""

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
        """Independent draws, `count` of them; those of a long sample are computed on demand."""
        unit = self.unit.text if self.unit is not None else ""
        return listed(DrawnColumn(count, seed, self.path, number, self.distribution, self.arguments, unit))


@frozen
class SampleDesign:
    """A `sample` statement as read. warning: message, place and help of one about it; until_shown: place where it is
    written that cases are run only until the requirements are decided: then `count` is the most."""

    design: Design
    count: int
    seed: int
    parts: tuple[DrawnParameter, ...]
    warning: tuple[str, Place, str] | None = None
    until_shown: Place | None = None

    @property
    def note(self) -> str:
        """The sample in words, with its seed, for the plan."""
        about = ": another count would draw other values" if self.design == "lhs" else ""
        if self.design == "saltelli":
            about = f": {self.count} times {len(self.parts) + 2} cases"
        count = f"{UNTIL_SHOWN}, {AT_MOST} = {self.count}" if self.until_shown is not None else f"{self.count}"
        return f"sample {self.design}({count}), seed {self.seed}{about}"

    def draw(self, number: int) -> list[CaseValues]:
        """The values of each part. number: of the sample in its sweep, from 1. Raises Problem where two are equal."""
        drawn: list[CaseValues]
        if self.design == "random":  # a stream for each path, so that more samples or parameters change no old value
            drawn = [part.independent(self.count, self.seed, number) for part in self.parts]
        else:
            points = _points(self.design, self.count, len(self.parts), self.seed, number)
            drawn = [part.values(column) for part, column in zip(self.parts, points.T, strict=True)]
        for part, values in zip(self.parts, drawn, strict=True):
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
        return list(_saltelli(drawn)) if self.design == "saltelli" else drawn


def _saltelli(drawn: Sequence[CaseValues]) -> Iterator[CaseValues]:
    """The values of each part in the cases of Saltelli's scheme, from those at its points: all a, then all b.

    The cases of a pair of points stand together: a, then a with the value of the first part from b, of the second ...,
    then b.
    """
    for place, values in enumerate(drawn):
        a, b = np.split(np.asarray(values), 2)
        cases = np.repeat(a[:, None], len(drawn) + 2, axis=1)
        cases[:, place + 1] = cases[:, -1] = b
        yield cases.ravel()


def _points(design: str, count: int, parts: int, seed: int, number: int) -> np.ndarray:
    """Points of the open unit cube, [count, parts], which depend on each other; for `saltelli` twice as many, all first
    points of pairs before all second ones."""
    from scipy.stats import qmc  # takes most of a second to import

    stream = np.random.Generator(np.random.PCG64([seed, number]))
    pairs = design == "saltelli"
    method = qmc.LatinHypercube if design == "lhs" else qmc.Sobol
    sampler = method(parts * (2 if pairs else 1), rng=stream)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of counts that are no power of 2, for which MET has its own
        drawn = sampler.random(count)
    return within(np.concatenate(np.split(drawn, 2, axis=1)) if pairs else drawn)


# Reading


def read_sample(
    definitions: Definitions, complaints: Complaints, statement: Statement, paths: Mapping[str, Place], seed: int
) -> SampleDesign:
    """Read the entry `sample lhs(200) { PATH = uniform(a, b) UNIT; ... }` of a sweep. paths: what the sweep varies, and
    where.

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
    names = Names(definitions, {}, watched=set(paths))
    until_shown = _until_shown(call, definitions)
    if until_shown is None and (len(call.positional) != 1 or call.named):
        raise Problem(
            error(
                "D224",
                f"`{design}` takes the number of {'points' if design == 'saltelli' else 'samples'}",
                call.name.place,
                help=f"write `sample {design}({256 if design in ('sobol', 'saltelli') else 200}) {{ ... }}`",
            )
        )
    most = MOST_SWEPT if design == "random" else MOST_LISTED
    written = call.positional[0] if until_shown is None else call.named[0][1]
    count = as_whole(evaluate_number(written, names.find), "a number of samples", 1, most, f"{most}")
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
    if design == "saltelli" and len(parts) < 2:
        helps = "draw more of them, or write `sample random(N) { ... }`"
        message = "`saltelli` shares a metric's variance out among parameters, and there is one"
        raise Problem(error("D224", message, call.name.place, help=helps))
    warning = None
    if design in ("sobol", "saltelli") and count & (count - 1):
        lower = 1 << (count.bit_length() - 1)
        warning = (
            f"{count} points of a Sobol sequence are less even than {lower} or {2 * lower}",
            place_of(call.positional[0]),
            "take a power of 2",
        )
    if design == "saltelli" and count < FEWEST_PAIRS:
        warning = (
            f"{count} points are too few for indices: {count * (len(parts) + 2)} cases that say nothing of them",
            place_of(call.positional[0]),
            f"take {FEWEST_PAIRS} or more, a power of 2; of some thousands the intervals are narrow",
        )
    return SampleDesign(design, count, seed, tuple(parts), warning, until_shown)


def _until_shown(call: Call, definitions: Definitions) -> Place | None:
    """The place of `until_shown` in `random(until_shown, at_most = 50000)`; None where a number is written, which may
    have that name. Raises Problem D224, D351."""
    named = {word.text for word, _ in call.named}
    word = call.positional[0] if len(call.positional) == 1 else None
    written = isinstance(word, Name) and word.text == UNTIL_SHOWN
    if not named and written and UNTIL_SHOWN in definitions.lets:
        return None
    usage = f"write `sample random({UNTIL_SHOWN}, {AT_MOST} = 50000) {{ ... }}`"
    meant = did_you_mean(word.text, [UNTIL_SHOWN]) if isinstance(word, Name) and not written else []
    if isinstance(word, Name) and meant and word.text not in definitions.lets:
        raise Problem(error("D224", f"`{word.text}` is no number of samples", place_of(word), help=[*meant, usage]))
    if named & {AT_MOST} and not written:
        message = f"`{AT_MOST}` goes with `{UNTIL_SHOWN}`, and not with a number of samples"
        raise Problem(error("D224", message, call.named[0][0].place, help=[usage, "or leave it out"]))
    if word is None or not written:
        return None
    if call.name.text != "random":
        message = f"`{call.name.text}` does not draw cases each without regard to the others, so it shows nothing early"
        helps = [usage, f"or `sample {call.name.text}(200) {{ ... }}`, which runs all of them"]
        raise Problem(error("D351", message, call.name.place, help=helps))
    if named != {AT_MOST} or len(call.named) > 1:
        message = f"`{UNTIL_SHOWN}` takes the most cases of a design point, `{AT_MOST}`, and nothing else"
        raise Problem(error("D224", message, place_of(word), help=usage))
    return place_of(word)


def _part(entry: Setting, names: Names, paths: Mapping[str, Place]) -> DrawnParameter:
    """One line of a `sample`: the parameter with its distribution. Raises Problem D225."""
    path = path_of(entry)
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
    values = [evaluate_number(in_unit(argument, unit), names.find) for argument in call.positional]
    check_constant(path, entry, names, paths)
    for other in values[1:]:
        if not units.same(other.dimension, values[0].dimension):
            raise Problem(
                error(
                    "D063",
                    f"`{name}` of {units.text(values[0].dimension)} and {units.text(other.dimension)}",
                    other.place,
                    help="all must be of one dimension",
                )
            )
    arguments = tuple(float(value.number) for value in values)
    _check_arguments(name, arguments, values)
    unit = unit or next((value.unit for value in values if value.unit is not None), None)
    shown = unit_of_plan(unit, values[0].dimension)
    return DrawnParameter(path, entry.place, name, arguments, values[0], shown)


def in_unit(expression: Expression, unit: Unit | None) -> Expression:
    """An expression with the unit after a call."""
    return expression if unit is None else WithUnit(expression, unit, place_of(expression))


def _check_arguments(name: str, arguments: tuple[float, ...], values: list[Any]) -> None:
    """Raise Problem D225 where a distribution cannot have these arguments."""
    if name in ("normal", "truncated") and not arguments[1] > 0.0:
        raise Problem(
            error(
                "D225",
                "a standard deviation is above 0",
                values[1].place,
                help="a parameter that does not vary belongs in the run",
            )
        )
    if name != "normal" and not arguments[-2] < arguments[-1]:
        raise Problem(
            error(
                "D225",
                f"`{name}` goes from a lower to a higher value",
                values[-1].place,
                help="change the two about, or leave the parameter out where they are equal",
            )
        )
    if name == "loguniform" and not arguments[0] * arguments[1] > 0.0:
        raise Problem(
            error(
                "D225",
                "the ends of a loguniform are both above or both below zero",
                values[0].place,
                help="`uniform` has no such limit",
            )
        )
