"""Sliding with dry friction so slowly that friction stops it within a step, were it to act the other way.

What slides is linearised as sliding: its friction is a constant force. That is so for moves whose rate is less than its
own; a larger one turns friction around. Where the rate is so small that one step's slowing by friction undoes it, the
run tells it from rest by nothing else.
"""

from __future__ import annotations

from met.analysis.linear.flow import Flow
from met.frozen import frozen
from met.plan.channel import joint_unit
from met.program import cell_names
from met.program.sticking import Sticking


@frozen
class CreepingRate:
    """A rate that is as good as none: of a joint, or of a state of its servo, by name; SI, with its unit."""

    name: str
    rate: float
    unit: str


def creeping(flow: Flow) -> tuple[CreepingRate, ...]:
    """Joints that creep where a flow stands, before its computers tick there."""
    now = flow.copy()
    now.ticks()
    program = now.program
    step = program.schedule.dynamics / program.schedule.base_hz
    found = []
    for each in program.builder.step.sticking:
        mode = now.modes().get(each.name, 0.0)
        rate = now.cells[each.cell]
        if mode == 0.0 or rate == 0.0:
            continue
        slowing = 0.5 * abs(_slope(now, each, mode) - _slope(now, each, -mode))
        if abs(rate) < slowing * step:
            found.append(CreepingRate(each.name, rate, _unit(now, each)))
    return tuple(found)


def _slope(flow: Flow, each: Sticking, mode: float) -> float:
    """d(rate)/dt with this mode of its friction."""
    tried = flow.copy()
    tried.tangents = {}
    tried.cells[cell_names.FRICTION_MODE(each.name)] = mode
    (number,) = (k for k, section in enumerate(flow.program.recording.sections) if section.name == "derive")
    tried.run(number)
    return tried.cells[cell_names.SLOPE(each.name) if each.state else f"{each.name}.qdd"]


def _unit(flow: Flow, each: Sticking) -> str:
    joints = flow.program.system.joints
    if each.actuator is None or not each.state:
        return joint_unit("joint/s", next(joint for joint in joints if joint.name == each.name))
    own = next(state.unit for state in each.actuator.parts.states if state.name == each.state)
    return joint_unit(own, joints[each.actuator.index])
