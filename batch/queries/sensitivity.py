"""The varied parameters that explain a metric, failures, or the change of a metric between two archives."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.archive.searched import is_search
from batch.archive.stored import Stored
from batch.queries.signals import deck_unit
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen
from met.statistics.design_points import in_step
from met.statistics.saltelli import FEWEST_PAIRS, is_saltelli, saltelli_shares
from met.statistics.sensitivity import FEWEST, InputShare, dependent, shares

UNCLEAR = 0.1
"""Half width of an interval from which on more cases are recommended, and a rest from which on it is mentioned."""

WIDE = 0.5
"""Half width of an interval from which on it says next to nothing."""

ALIKE = "no difference seen"
"""What is said in place of two means that drawn cases do not tell apart."""

FAILURE = "failure"
"""The name of failing as an output: 1 in a case that failed, else 0."""


@frozen
class VariedInput:
    """A varied parameter, or several that vary as one.

    paths  of the parameters;  values: of the first, SI, [case]
    """

    paths: tuple[str, ...]
    values: np.ndarray

    @property
    def name(self) -> str:
        return " with ".join(self.paths)


@frozen
class Sensitivity:
    """The inputs that explain the variance of one output of an experiment.

    name, unit, scale  of the output, and how many SI units its deck's unit is
    of                 what its values are: "" of a metric, else `failure` or `change`
    cases, left        cases that count, and cases that have no finite value
    inputs, shares     by the inputs' order; no shares where the output does not vary
    rest               the share that no input and no pair explains; None without pairs
    together           pairs of inputs that do not vary independently, with the correlation of their ranks
    mean               of the output over the cases that count, SI; not a number where none does
    design             that the cases were made by and whose own estimators were used, `saltelli`; "" of any others
    drawn              whether the inputs' values were drawn at random, so that means over cases scatter
    why                the estimators of a design were not used although its cases are there; "" where that is not so
    """

    name: str
    unit: str
    scale: float
    of: str
    cases: int
    left: int
    inputs: tuple[str, ...]
    shares: tuple[InputShare, ...]
    rest: float | None
    together: tuple[tuple[str, str, float], ...]
    mean: float = float("nan")
    design: str = ""
    why: str = ""
    drawn: bool = False

    @property
    def order(self) -> list[int]:
        """Places of the inputs, those that explain most first."""
        return sorted(range(len(self.shares)), key=lambda i: -(self.shares[i].total or self.shares[i].first))

    def ends(self, share: InputShare, low: str, high: str) -> str:
        """The means at the ends of an input, which are these texts in the output's unit, as one text; `ALIKE` where
        the cases were drawn, and do not tell them apart."""
        if self.drawn and abs(share.high - share.low) <= share.ends_by:
            return ALIKE
        return f"{low} {high} {self.unit if self.unit != '1' else ''}".rstrip()

    @property
    def fewest(self) -> int:
        """The fewest cases of this kind for a result."""
        return FEWEST if not self.design else FEWEST_PAIRS * (len(self.inputs) + 2)


def sensitivities(
    group: ArchiveGroup, names: Sequence[str] = (), before: tuple[ArchiveGroup, np.ndarray, np.ndarray] | None = None
) -> list[Sensitivity]:
    """The sensitivity of metrics to what is varied; of all, and of failing where some cases fail, if none is named.

    before  another group, with the positions in it and in this one of the cases in both: then of the change since
    Raises Problem E361 where it cannot be had, E362 for a name that is no metric's.
    """
    if is_search(group):
        message = f"the cases of `{group.name}` were chosen by its search, and are no sample of what may be"
        remedy = "a sweep draws one: `sweep NAME of RUN { sample random(1000) { PATH = uniform(LOW, HIGH) UNIT; } }`"
        raise Problem(error("E361", message, help=remedy))
    metrics = {variable.name: variable for variable in group.role("metric")}
    if before is not None:
        metrics = {name: metric for name, metric in metrics.items() if name in before[0].variables}
    positions = np.arange(group.count) if before is None else before[2]
    failed = (group.values("status") != 0)[positions]
    known = [*metrics, *([FAILURE] if before is None and 0 < failed.sum() < len(failed) else [])]
    for name in names:
        if name not in known:
            helps = [*did_you_mean(name, known), f"here: {', '.join(known) or 'no metric'}"]
            if name == FAILURE:
                helps = ["all cases failed" if failed.any() else "no case failed"]
            raise Problem(error("E362", f"no metric `{name}` in `{group.name}` to explain", help=helps))
    inputs = _inputs(group, positions)
    designed = _designed(group)
    return [
        _explained(group, metrics.get(name), inputs, positions, failed, before, designed) for name in names or known
    ]


def _designed(group: ArchiveGroup) -> tuple[list[np.ndarray], str]:
    """The varied parameters of each case, where the cases were made by Saltelli's scheme and are complete; else none,
    and the reason where a part of the parameters was drawn so."""
    coordinates = group.role("coordinate")
    designs = {str(variable.attributes.get("design", "")) for variable in coordinates}
    if "saltelli" not in designs:
        return [], ""
    if len(designs) > 1 or ("repeat" in group.variables and group.values("repeat").any()):
        return [], "more varies than was drawn by `saltelli`"
    values = [np.asarray(group.values(variable.name), float) for variable in coordinates]
    if group.count < int(group.attributes.get("cases_in_table", group.count)) or not is_saltelli(values):
        return [], "not all cases of `saltelli` are there"
    return values, ""


def _whole_pairs(finite: np.ndarray, positions: np.ndarray, count: int, width: int) -> np.ndarray:
    """Places among all cases, [pair, width], of the pairs of points whose cases all count. finite: of the cases at
    these positions"""
    counts = np.zeros(count, bool)
    counts[positions[finite]] = True
    return np.arange(count).reshape(-1, width)[counts.reshape(-1, width).all(axis=1)]


def _inputs(group: ArchiveGroup, positions: np.ndarray) -> list[VariedInput]:
    """The inputs that vary in these cases, each once. Raises Problem E361 where nothing varies, or there are too few
    cases."""
    variables = group.role("coordinate")
    values = [np.asarray(group.values(variable.name), float)[positions] for variable in variables]
    varied = [VariedInput(tuple(variables[i].path for i in part), values[part[0]]) for part in in_step(values)]
    if not len(positions):
        raise Problem(error("E361", f"no case of `{group.name}` is in both archives"))
    if not varied:
        helps = "a sweep varies some: `vary`, `sample`"
        raise Problem(error("E361", f"nothing varies in the cases of `{group.name}`", help=helps))
    if len(positions) < FEWEST:
        message = f"{len(positions):,} cases of `{group.name}` are not enough to tell what explains them"
        raise Problem(error("E361", message, help=f"{FEWEST} at least; some thousands for intervals that are narrow"))
    return varied


def _explained(
    group: ArchiveGroup,
    metric: Stored | None,
    inputs: Sequence[VariedInput],
    positions: np.ndarray,
    failed: np.ndarray,
    before: tuple[ArchiveGroup, np.ndarray, np.ndarray] | None,
    designed: tuple[list[np.ndarray], str],
) -> Sensitivity:
    """The shares of one output's variance. metric: None for failing; before: the archive from which a change is
    taken"""
    scale, unit, measure = 1.0, "", ""
    if metric is None:
        output, name, measure = failed.astype(float), FAILURE, FAILURE
    else:
        (scale, unit), name = deck_unit(metric), metric.name
        output = np.asarray(group.values(name), float)[positions]
        if before is not None:
            with np.errstate(invalid="ignore"):
                output, measure = output - np.asarray(before[0].values(name), float)[before[1]], "change"
    finite = np.isfinite(output)
    sampled, why = designed
    if sampled:
        whole = np.full(group.count, np.nan)
        whole[positions] = output
        rows = _whole_pairs(finite, positions, group.count, len(sampled) + 2).ravel()
        names, values, output = (
            [v.path for v in group.role("coordinate")],
            [column[rows] for column in sampled],
            whole[rows],
        )
        enough = len(rows) >= FEWEST_PAIRS * (len(sampled) + 2)
        estimate = saltelli_shares(values, output) if enough else None
    else:
        rows = np.flatnonzero(finite)
        names, values, output = (
            [varied_input.name for varied_input in inputs],
            [varied_input.values[rows] for varied_input in inputs],
            output[rows],
        )
        estimate = shares(values, output) if len(rows) >= FEWEST else None
    together = (
        () if estimate is None or sampled else tuple((names[i], names[j], size) for i, j, size in dependent(values))
    )
    overlapping = {name for name_a, other, _ in together for name in (name_a, other)}
    return Sensitivity(
        name=name,
        unit=unit,
        scale=scale,
        of=measure,
        cases=len(rows),
        left=len(positions) - len(rows),
        inputs=tuple(names),
        shares=tuple(
            share.without_intervals() if name in overlapping else share
            for name, share in zip(names, estimate.inputs, strict=True)
        )
        if estimate is not None
        else (),
        rest=None if estimate is None else estimate.rest,
        together=together,
        mean=float(output.mean()) if len(rows) else float("nan"),
        design="saltelli" if sampled else "",
        why=why,
        drawn=any(variable.attributes.get("design") for variable in group.role("coordinate")),
    )


def share_text(share: float, by: float) -> str:
    """A share and half the width of its interval: `0.94 ± 0.01`; without one, `0.94`."""
    return f"{share:.2f} ± {max(by, 0.005):.2f}" if math.isfinite(by) else f"{share:.2f}"


def total_text(share: InputShare) -> str:
    """The ends of the interval of a share with others, outward: `0.93 .. 0.96`; without one, the share; "" of none."""
    if share.total is None or not math.isfinite(share.total_low):
        return "" if share.total is None else f"{share.total:.2f}"
    return f"{math.floor(share.total_low * 100) / 100:.2f} .. {math.ceil(share.total_high * 100) / 100:.2f}"


def notes_of(sensitivity: Sensitivity) -> Iterator[str]:
    """Sentences on the estimation of the shares, with its caveats."""
    if sensitivity.design:
        yield "by the estimators of `saltelli`; with others: with any number of them, and with noise"
    if sensitivity.why:
        yield f"{sensitivity.why}: estimated as from any cases"
    if sensitivity.rest is not None and sensitivity.rest > UNCLEAR:
        many = "three inputs or more together, of " if len(sensitivity.inputs) > 2 else ""
        yield (
            f"{sensitivity.rest:.2f} of the variance is of {many}noise, or of too few cases: "
            "any input may have part in it"
        )
    widest = max((share.first_by for share in sensitivity.shares if math.isfinite(share.first_by)), default=0.0)
    if widest > WIDE:
        yield "these intervals say next to nothing: of few cases, or some make up most of the variance"
    elif widest > UNCLEAR and sensitivity.design:
        yield "not enough cases for narrow intervals: four times as many halve them"
    elif widest > UNCLEAR:
        cases = float(f"{sensitivity.cases * (widest / UNCLEAR) ** 2:.1g}")
        yield f"few cases: it takes about {cases:,.0f} for shares alone within ± {UNCLEAR}"
    for name_a, other, size in sensitivity.together:
        how = f"rank correlation {size:+.2f}" if abs(size) > UNCLEAR else "some values of one go with some of the other"
        yield f"{name_a} and {other} do not vary independently ({how}): their shares overlap, and have no interval"
