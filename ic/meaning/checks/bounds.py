"""Bounds of a run's channels that hold whatever the run does: by limits of servos, and by joints that are locked."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product

from ic.meaning.parameters.scope import Scope
from met import models
from met.frozen import frozen
from met.plan import ServoUse, Structure
from met.plan.judged import CHANNEL_INPUT
from met.trace.graph import Formulas
from met.trace.nodes import OPERANDS


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
    on_beds = {substitution.joint for substitution in structure.substitutions}
    uses = [use for use in structure.servos if joint in ("*", use.joint) and use.joint not in on_beds]
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
