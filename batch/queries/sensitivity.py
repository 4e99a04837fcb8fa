"""Which varied parameters explain a metric, a failure, or the change of a metric between two archives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.archive.stored import Stored
from batch.queries.signals import deck_unit
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen
from met.statistics.in_step import in_step
from met.statistics.sensitivity import FEWEST, InputShare, dependent, shares

FAILURE = "failure"
"""The name under which failing is asked about: 1 in a case that failed, else 0."""


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


def sensitivities(
    group: ArchiveGroup, names: Sequence[str] = (), before: tuple[ArchiveGroup, np.ndarray, np.ndarray] | None = None
) -> list[Sensitivity]:
    """The sensitivity of metrics to what is varied; of all, and of failing where some cases fail, if none is named.

    before  another group, with the positions in it and in this one of the cases in both: then of the change since
    Raises Problem E361 where it cannot be had, E362 for a name that is no metric's.
    """
    metrics = {variable.name: variable for variable in group.role("metric")}
    if before is not None:
        metrics = {name: each for name, each in metrics.items() if name in before[0].variables}
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
    return [_explained(group, metrics.get(name), inputs, positions, failed, before) for name in names or known]


def _inputs(group: ArchiveGroup, positions: np.ndarray) -> list[VariedInput]:
    """The inputs that vary in these cases, each once. Raises Problem E361 where nothing does, or in too few cases."""
    variables = group.role("coordinate")
    values = [np.asarray(group.values(each.name), float)[positions] for each in variables]
    found = [VariedInput(tuple(variables[i].path for i in part), values[part[0]]) for part in in_step(values)]
    if not found:
        helps = "a sweep varies some: `vary`, `sample`"
        raise Problem(error("E361", f"nothing varies in the cases of `{group.name}`", help=helps))
    if len(positions) < FEWEST:
        message = f"{len(positions):,} cases of `{group.name}` are not enough to tell what explains them"
        raise Problem(error("E361", message, help=f"{FEWEST} at least; some thousands for intervals that are narrow"))
    return found


def _explained(
    group: ArchiveGroup,
    metric: Stored | None,
    inputs: Sequence[VariedInput],
    positions: np.ndarray,
    failed: np.ndarray,
    before: tuple[ArchiveGroup, np.ndarray, np.ndarray] | None,
) -> Sensitivity:
    scale, unit, of = 1.0, "", ""
    if metric is None:
        output, name, of = failed.astype(float), FAILURE, FAILURE
    else:
        (scale, unit), name = deck_unit(metric), metric.name
        output = np.asarray(group.values(name), float)[positions]
        if before is not None:
            with np.errstate(invalid="ignore"):
                output, of = output - np.asarray(before[0].values(name), float)[before[1]], "change"
    finite = np.isfinite(output)
    counted = int(finite.sum())
    values = [each.values[finite] for each in inputs]
    found = shares(values, output[finite]) if counted >= FEWEST else None
    return Sensitivity(
        name=name,
        unit=unit,
        scale=scale,
        of=of,
        cases=counted,
        left=len(output) - counted,
        inputs=tuple(each.name for each in inputs),
        shares=found.inputs if found is not None else (),
        rest=None if found is None else found.rest,
        together=tuple((inputs[i].name, inputs[j].name, size) for i, j, size in dependent(values))
        if found is not None
        else (),
    )
