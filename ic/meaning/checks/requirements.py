"""Warnings about requirements without content: no run can miss or meet them, or the run cannot show their metric."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import product

from ic.meaning.checks.idle import constant_values
from ic.meaning.parameters.scope import Scope
from met import models
from met.diagnostic import Label, Place, leave_out
from met.frozen import frozen
from met.metrics.metric import ROUNDING, Metric
from met.plan import ServoUse, Structure
from met.plan.judged import CHANNEL_INPUT, FIGURES, MetricUse, Requirement
from met.trace.graph import Formulas
from met.trace.nodes import OPERANDS


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


@frozen
class Bounds:
    """The least and the most that a number can be, and the parameters, by path, from which that follows."""

    least: float = -math.inf
    most: float = math.inf
    because: tuple[str, ...] = ()

    def __neg__(self) -> Bounds:
        return Bounds(-self.most, -self.least, self.because)

    def __or__(self, other: Bounds) -> Bounds:
        """The bounds of what may be either."""
        because = tuple(dict.fromkeys([*self.because, *other.because]))
        return Bounds(min(self.least, other.least), max(self.most, other.most), because)


def channel_bounds(scope: Scope, structure: Structure, path: str) -> Bounds:
    """The bounds of a channel, `*.servo.voltage` of all joints included; infinite where none are known."""
    expression = next((candidate for candidate in structure.expressions if candidate.name == path), None)
    if expression is not None:
        return _of_formula(expression.formula, lambda channel: channel_bounds(scope, structure, channel))
    joint, _, name = path.partition(".")
    uses = [use for use in structure.servos if joint in ("*", use.joint) and use.joint not in structure.on_beds]
    if not uses or (joint == "*" and len(uses) < len(structure.moving)):
        return Bounds()
    bounds = _of_joint(scope, uses[0], name)
    for use in uses[1:]:
        bounds |= _of_joint(scope, use, name)
    return bounds


def _of_joint(scope: Scope, use: ServoUse, name: str) -> Bounds:
    """The bounds of one joint's channel, by its name behind the joint's."""

    def number(path: str) -> float | None:
        settled = scope.parameters.get(path)
        return settled.value if settled is not None and isinstance(settled.value, float) else None

    head = f"{use.joint}.servo"
    servo = models.find("servo", use.model)
    for signal in (*servo.outputs, *servo.signals):
        limit = number(f"{head}.{signal.limit}") if signal.limit and name == f"servo.{signal.name}" else None
        if limit is not None:
            return Bounds(-limit, limit, (f"{head}.{signal.limit}",))
    if use.model == "rigid_gearbox" and name == "tau" and number(f"{head}.f_v") == 0.0:
        ratio, most, friction = number(f"{head}.ratio"), number(f"{head}.tau_max"), number(f"{head}.f_c")
        if ratio is not None and most is not None and friction is not None and f"{head}.f_s" not in scope.parameters:
            torque = ratio * (most + friction)
            return Bounds(-torque, torque, tuple(f"{head}.{parameter}" for parameter in ("ratio", "tau_max", "f_c")))
    if use.model == "locked" and number(f"{head}.release") == math.inf and name in ("q", "qd", "qdd"):
        start = number(f"initial.{use.joint}.q") if name == "q" else 0.0
        return Bounds() if start is None else Bounds(start, start, (head,))
    return Bounds()


def _of_formula(formula: Formulas, of_channel: Callable[[str], Bounds]) -> Bounds:
    """The bounds of an expression of channels, by interval arithmetic; infinite behind any other operation."""
    node_bounds: list[Bounds] = []

    def operand(ref: int) -> Bounds:
        return -node_bounds[ref >> 1] if ref & 1 else node_bounds[ref >> 1]

    for node in formula.nodes:
        a, b, c = ([operand(ref) for ref in node[1 : 1 + OPERANDS[node[0]]]] + [Bounds()] * 3)[:3]
        match node[0]:
            case "const":
                node_bounds.append(Bounds(float(node[1]), float(node[1])))
            case "input" if node[1].startswith(CHANNEL_INPUT):
                node_bounds.append(of_channel(node[1].removeprefix(CHANNEL_INPUT)))
            case "add":
                node_bounds.append(_sum(a, b))
            case "sub":
                node_bounds.append(_sum(a, -b))
            case "mul":
                node_bounds.append(_product(a, b))
            case "fma":
                node_bounds.append(_sum(_product(a, b), c))
            case "abs":
                node_bounds.append(Bounds(max(a.least, -a.most, 0.0), max(-a.least, a.most), a.because))
            case "where":
                node_bounds.append(b | c)
            case _:
                node_bounds.append(Bounds())
    return operand(formula.outputs[0])


def _sum(a: Bounds, b: Bounds) -> Bounds:
    return Bounds(a.least + b.least, a.most + b.most, (a | b).because)


def _product(a: Bounds, b: Bounds) -> Bounds:
    ends = [x * y for x, y in product((a.least, a.most), (b.least, b.most))]
    return Bounds() if any(math.isnan(x) for x in ends) else Bounds(min(ends), max(ends), (a | b).because)
