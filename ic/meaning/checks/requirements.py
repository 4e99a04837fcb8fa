"""Warnings about requirements without content: no run can miss or meet them, or the run cannot show their metric."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ic.meaning.checks.bounds import Bounds, channel_bounds
from ic.meaning.checks.constants import constant_values
from ic.meaning.parameters.scope import Scope
from met import models
from met.diagnostic import Label, Place, leave_out
from met.metrics.metric import ROUNDING, Metric
from met.plan import Structure
from met.plan.judged import MetricUse, Requirement
from met.plan.linear_uses import FIGURES


def check_requirements(
    scope: Scope, requirements: Sequence[Requirement], structure: Structure, linear: Sequence[MetricUse] = ()
) -> None:
    """Warn about requirements that are decided before the run, and metrics that this run cannot show. linear: the
    metrics of linear answers"""
    uses = {use.name: use for use in structure.metrics}
    figures = {use.name: FIGURES[use.model] for use in linear}
    for requirement in requirements:
        if requirement.metric in figures:
            if requirement.place is not None:
                figure = figures[requirement.metric]
                _remark_bound(scope, requirement, Bounds(figure.least), figure.name, requirement.place)
            continue
        use = uses[requirement.metric]
        metric: Metric = models.find("metric", use.model, use.place)
        place, duration = requirement.place, structure.schedule.duration
        if place is not None:  # the first one: a single warning is enough
            _ = (
                _remark_bound(scope, requirement, Bounds(metric.least), metric.name, place)
                or _remark_bound(scope, requirement, _bounds(scope, structure, use, metric), metric.name, place)
                or _remark_begin(scope, requirement, use, metric, place)
                or (metric.times and duration < requirement.limit < math.inf)  # only the run shows whether it is seen
                or _remark_window(scope, requirement, use, metric, duration, place)
            )
    _remark_contradictions(scope, requirements)


def _bounds(scope: Scope, structure: Structure, use: MetricUse, metric: Metric) -> Bounds:
    """The bounds of a metric that follow from its channel's."""
    if metric.bounds is None:
        return Bounds()
    channel = channel_bounds(scope, structure, use.of)
    return Bounds(*metric.bounds(channel.least, channel.most), channel.because)


def _remark_bound(scope: Scope, requirement: Requirement, bounds: Bounds, model: str, place: Place) -> bool:
    """Return True, with a warning, if every number within the bounds meets the requirement, or none does."""
    upper, limit, same = requirement.comparison.startswith("<"), requirement.limit, requirement.comparison.endswith("=")
    below = bounds.most < limit or (bounds.most == limit and same is upper)
    above = bounds.least > limit or (bounds.least == limit and same is not upper)
    if not (below or above):
        return False
    because = " by " + ", ".join(f"`{path}`" for path in bounds.because) if bounds.because else ""
    subject = f"`{requirement.metric}`" if bounds.because else f"a metric `{model}`"
    end = f"above {bounds.most + 0.0:.6g}" if below else f"below {bounds.least + 0.0:.6g}"
    scope.complaints.remark(
        "D340",
        f"`require {requirement.text}` cannot be {'missed' if below is upper else 'met'}: "
        f"{subject} is never {end}{because}",
        place,
        help=leave_out("write a limit that it may pass, or leave it out"),
    )
    return True


def _remark_contradictions(scope: Scope, requirements: Iterable[Requirement]) -> None:
    """Report two requirements of which one is always missed, or of which one decides nothing beside the other."""
    lowest: dict[str, Requirement] = {}
    highest: dict[str, Requirement] = {}
    for requirement in requirements:
        upper = requirement.comparison.startswith("<")
        first = (highest if upper else lowest).setdefault(requirement.metric, requirement)
        tighter = (requirement.limit < first.limit) if upper else (requirement.limit > first.limit)
        if tighter:
            (highest if upper else lowest)[requirement.metric] = requirement
        if first is not requirement:
            _remark_looser(scope, *((first, requirement) if tighter else (requirement, first)))
    for name in lowest.keys() & highest.keys():
        low, high = lowest[name], highest[name]
        strict = "=" not in low.comparison or "=" not in high.comparison
        if (low.limit > high.limit or (low.limit == high.limit and strict)) and low.place and high.place:
            scope.complaints.remark(
                "D340",
                f"`require {low.text}` and `require {high.text}` cannot both be met",
                low.place,
                also=[Label(high.place, "the other")],
                help="leave one of them out, or let the limits meet",
            )


def _remark_looser(scope: Scope, looser: Requirement, tighter: Requirement) -> None:
    """Warn of a requirement on all cases that decides nothing beside a tighter one; named ones may be grades."""
    if looser.share is None and tighter.share is None and looser.place and tighter.place and ":" not in looser.text:
        scope.complaints.remark(
            "D340",
            f"`require {looser.text}` decides nothing: `require {tighter.text}` is tighter",
            looser.place,
            also=[Label(tighter.place, "the tighter one")],
            help=[
                leave_out("leave one of them out"),
                "one with a name, `require NAME: ...;`, is replaced by one of the same name in a run `like` this",
            ],
        )


def _remark_window(
    scope: Scope, requirement: Requirement, use: MetricUse, metric: Metric, duration: float, place: Place
) -> bool:
    """Return True, with a warning, for a window that begins or ends after the run's end."""
    windowed = any(parameter.name == "after" for parameter in metric.parameters)
    p = constant_values(scope, f"metrics.{use.name}", metric.parameters) if windowed else None
    after, within = getattr(p, "after", 0.0), getattr(p, "within", math.inf)
    if after <= duration and (within == math.inf or after + within <= duration * (1.0 + ROUNDING)):
        return False
    what = f"begins at {after:.9g} s" if after > duration else f"ends at {after + within:.9g} s"
    scope.complaints.remark(
        "D341",
        f"`require {requirement.text}` looks beyond this run, which ends at {duration:.9g} s: its window {what}",
        place,
        help="let the run last longer, or the window end earlier",
    )
    return True


def _remark_begin(scope: Scope, requirement: Requirement, use: MetricUse, metric: Metric, place: Place) -> bool:
    """Return True, with a warning, for a metric that is undefined at its channel's initial value."""
    first = scope.parameters.get(f"initial.{use.of}")
    p = constant_values(scope, f"metrics.{use.name}", metric.parameters)
    if metric.undefined is None or first is None or not isinstance(first.value, float) or p is None:
        return False
    why = metric.undefined(p, first.value)
    if why:
        scope.complaints.remark(
            "D341",
            f"`require {requirement.text}` cannot be told from this run: `{use.name}` is no number, for {why}",
            place,
            help=f"let `{use.of}` begin elsewhere, or choose another metric",
        )
    return bool(why)
