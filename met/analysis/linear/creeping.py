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
from met.program import cells
from met.program.friction import Sticking


@frozen
class CreepingRate:
    """A sliding rate that hardly differs from rest, of a joint or of a state of its servo, by name; SI, with its
    unit."""

    name: str
    rate: float
    unit: str


def creeping(flows: Sequence[Flow]) -> list[tuple[CreepingRate, ...]]:
    """Joints that creep where each of these flows stands, before its computers tick there."""
    after, rates = together(flows, Flow.ticks), [list[CreepingRate]() for _ in flows]
    program = flows[0].program if flows else None
    for sticking in program.builder.step.sticking if program else ():
        modes = {
            k: now.modes().get(sticking.name, 0.0) for k, now in enumerate(after) if now.cells[sticking.cell] != 0.0
        }
        slides = [k for k, mode in modes.items() if mode != 0.0]
        on = _slopes([after[k] for k in slides], sticking, [modes[k] for k in slides])
        back = _slopes([after[k] for k in slides], sticking, [-modes[k] for k in slides])
        for k, a, b in zip(slides, on, back, strict=True):
            now, schedule = after[k], after[k].program.schedule
            rate, slowing = now.cells[sticking.cell], 0.5 * abs(a - b)
            if abs(rate) < slowing * schedule.dynamics / schedule.base_hz:
                rates[k].append(CreepingRate(sticking.name, rate, _unit(now, sticking)))
    return [tuple(case_rates) for case_rates in rates]


def _slopes(flows: Sequence[Flow], sticking: Sticking, modes: Sequence[float]) -> list[float]:
    """d(rate)/dt with these modes of its friction, where flows stand."""
    tried = [flow.copy(tangents=False) for flow in flows]
    for flow, mode in zip(tried, modes, strict=True):
        flow.cells[cells.FRICTION_MODE(sticking.name)] = mode
    cell = cells.SLOPE(sticking.name) if sticking.state else f"{sticking.name}.qdd"
    return [flow.cells[cell] for flow in together(tried, derive)]


def _unit(flow: Flow, sticking: Sticking) -> str:
    joints = flow.program.system.joints
    if sticking.actuator is None or not sticking.state:
        return joint_unit("joint/s", next(joint for joint in joints if joint.name == sticking.name))
    own = next(state.unit for state in sticking.actuator.parts.states if state.name == sticking.state)
    return joint_unit(own, joints[sticking.actuator.index])
