"""The one number of a run that is far from usual, and with whose usual value a finding about the run is gone."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from ic.meaning.checks.scale import OTHER_UNITS, Scale
from ic.meaning.parameters.scope import Scope
from met.diagnostic import Problem
from met.plan import Experiment

FAR = 30.0
"""Factor over a typical multiple, or below it, from which on a number may be to blame for a finding."""

MOST = 2
"""Largest number of numbers that are tried."""


def usual_number(scope: Scope, experiment: Experiment, is_free: Callable[[Experiment], bool]) -> list[str]:
    """A remedy that names the number, of those that are farthest from usual, with whose usual value alone an experiment
    is free of a finding; none where there is no such number. is_free: whether an experiment is"""
    odd = [scale for scale in scope.scales if _distance(scale) > math.log(FAR)]
    for scale in sorted(odd, key=_distance, reverse=True)[:MOST]:
        factor = _factor(scale)
        changed = _changed(experiment, scale.path, factor)
        try:
            free = changed is not None and is_free(changed)
        except Problem:
            continue
        if free:
            times = f"{1.0 / factor:,.0f} times less" if factor < 1.0 else f"{factor:,.0f} times more"
            return [f"`{scale.path}` {scale.words}: with {times}, which is usual, this would not be so"]
    return []


def _factor(scale: Scale) -> float:
    """The factor of the number that makes it usual: that of the first other unit that does, else to the typical one."""
    units = [factor for _, factor in OTHER_UNITS.get(scale.meant, ())]
    needed = float((scale.typical / scale.multiple) ** (1.0 / scale.power))
    return next((unit for unit in units if unit < FAR * needed and needed < FAR * unit), needed)


def _distance(scale: Scale) -> float:
    """The logarithm of the factor between a multiple and the typical one; 0 where none is typical, or where less is
    usual too."""
    if not (scale.typical > 0.0 and scale.multiple > 0.0 and math.isfinite(scale.multiple)):
        return 0.0
    distance = math.log(scale.multiple / scale.typical)
    return abs(distance) if scale.low > 0.0 else max(distance, 0.0)


def _changed(experiment: Experiment, path: str, factor: float) -> Experiment | None:
    """The experiment with a number, or a vector, times a factor: a mass together with its inertia, and also what has
    its number from the same place in the deck, as joints with one servo. None where one of them varies."""
    heads = (f"{path}.", f"{path.removesuffix('mass')}inertia." if path.endswith(".mass") else f"{path}.")
    alike = {name: quantity for name, quantity in experiment.parameters.items() if f"{name}.".startswith(heads)}
    places = {quantity.origin.place for quantity in alike.values()} - {None}
    alike |= {name: quantity for name, quantity in experiment.parameters.items() if quantity.origin.place in places}
    numbers = {name: quantity.value for name, quantity in alike.items() if isinstance(quantity.value, float)}
    if len(numbers) < len(alike):
        return None
    changed = {name: replace(alike[name], value=number * factor) for name, number in numbers.items()}
    return replace(experiment, parameters={**experiment.parameters, **changed})
