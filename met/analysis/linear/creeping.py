"""Sliding with dry friction so slowly that friction stops it within a step, were it to act the other way.

What slides is linearised as sliding: its friction is a constant force. That is so for moves whose rate is less than its
own; a larger one turns friction around. A rate that friction undoes within one step cannot be told from rest in the
run.
"""

from __future__ import annotations

from collections.abc import Sequence

from met.analysis.linear.abreast import together
from met.analysis.linear.flow import Flow, derive
from met.frozen import frozen
from met.plan.channel import joint_unit
from met.program import cell_names
from met.program.sticking import Sticking


@frozen
class CreepingRate:
    """A sliding rate that hardly differs from rest, of a joint or of a state of its servo, by name; SI, with its
    unit."""

    name: str
    rate: float
    unit: str


def creeping(flows: Sequence[Flow]) -> list[tuple[CreepingRate, ...]]:
    """Joints that creep where each of these flows stands, before its computers tick there."""
    after, found = together(flows, Flow.ticks), [list[CreepingRate]() for _ in flows]
    program = flows[0].program if flows else None
    for each in program.builder.step.sticking if program else ():
        modes = {k: now.modes().get(each.name, 0.0) for k, now in enumerate(after) if now.cells[each.cell] != 0.0}
        slides = [k for k, mode in modes.items() if mode != 0.0]
        on = _slopes([after[k] for k in slides], each, [modes[k] for k in slides])
        back = _slopes([after[k] for k in slides], each, [-modes[k] for k in slides])
        for k, a, b in zip(slides, on, back, strict=True):
            now, schedule = after[k], after[k].program.schedule
            rate, slowing = now.cells[each.cell], 0.5 * abs(a - b)
            if abs(rate) < slowing * schedule.dynamics / schedule.base_hz:
                found[k].append(CreepingRate(each.name, rate, _unit(now, each)))
    return [tuple(of) for of in found]


def _slopes(flows: Sequence[Flow], each: Sticking, modes: Sequence[float]) -> list[float]:
    """d(rate)/dt with these modes of its friction, where flows stand."""
    tried = [flow.copy(tangents=False) for flow in flows]
    for flow, mode in zip(tried, modes, strict=True):
        flow.cells[cell_names.FRICTION_MODE(each.name)] = mode
    cell = cell_names.SLOPE(each.name) if each.state else f"{each.name}.qdd"
    return [flow.cells[cell] for flow in together(tried, derive)]


def _unit(flow: Flow, each: Sticking) -> str:
    joints = flow.program.system.joints
    if each.actuator is None or not each.state:
        return joint_unit("joint/s", next(joint for joint in joints if joint.name == each.name))
    own = next(state.unit for state in each.actuator.parts.states if state.name == each.state)
    return joint_unit(own, joints[each.actuator.index])
