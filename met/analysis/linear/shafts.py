"""Shafts of emulated beds, and reference rates of laws, that dry friction holds at rest.

Such a rate is exactly 0, and a small one to either side is gone within the period: it is held, and no state, as that of
a joint that sticks. Without dry friction a small rate goes on; but an emulated bed stops a shaft that would turn back,
for the rest of a substep, so that a push to one side and to the other differ, and there is no derivative at rest.

What slides is linearised as sliding: its friction is a constant force. That is so for moves whose rate is less than its
own; a larger one turns friction around. A rate that friction undoes within one step cannot be told from rest in the
run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from met.analysis.linear.abreast import together
from met.analysis.linear.flow import Flow, derive
from met.frozen import frozen
from met.plan.channel import joint_unit
from met.program import cells
from met.program.cells import REFERENCE_RATE
from met.program.friction import Sticking

SMALL = 1e-9
"""Rate of a shaft, rad/s, that friction undoes within a period where it holds the shaft at all."""

SLOW = 1e-4
"""Rate, rad/s, up to which a shaft counts as standing when resting shafts are sought."""


def held_rates(flow: Flow) -> dict[str, str]:
    """Rates that are held where a period begins, by cell, with the names of their owners."""
    return {cell: name for cell, name in _rates(flow) if flow.cells[cell] == 0.0 and _is_held(flow, cell)}


def bring_to_rest(flow: Flow) -> None:
    """Set the rates of shafts that hardly turn to exactly 0."""
    flow.cells |= {cell: 0.0 for cell, _ in _rates(flow) if abs(flow.cells[cell]) <= SLOW}


def shaft_rates(flow: Flow) -> dict[str, Any]:
    """Rates of the shafts on which motors of joints are tested (their beds), rad/s, by joint; of a `FlowAbreast`,
    [case, 1] or a number each."""
    joints = [actuator.use.joint for actuator, _, _ in flow.program.system.mounted]
    cells = {joint: f"{joint}.bed.shaft_rate" for joint in joints}
    return {joint: flow.cells[cell] for joint, cell in cells.items() if cell in flow.cells}


def loose_beds(flow: Flow) -> list[str]:
    """Joints on motor beds whose shaft stands still for a whole period, though nothing holds it there."""
    rates = {joint: f"{joint}.bed.shaft_rate" for joint in shaft_rates(flow)}
    return [joint for joint, cell in rates.items() if _goes_to_0(flow, cell, 0.0) and not _is_held(flow, cell)]


def _rates(flow: Flow) -> Iterator[tuple[str, str]]:
    """The cells of such rates with their owners by name. A law without a reference rate has none."""
    for actuator, _, _ in flow.program.system.mounted:
        joint = actuator.use.joint
        cells = {f"{joint}.bed.shaft_rate": f"{joint}.bed", REFERENCE_RATE(joint): f"{joint}.law"}
        yield from ((cell, name) for cell, name in cells.items() if cell in flow.cells)


def _is_held(flow: Flow, cell: str) -> bool:
    """True where a small rate, or a rate of 0, is 0 after the period."""
    return all(_goes_to_0(flow, cell, rate) for rate in (0.0, SMALL, -SMALL))


def _goes_to_0(flow: Flow, cell: str, rate: float) -> bool:
    """True where a period that begins with this rate ends with none."""
    moved = flow.copy()
    moved.cells[cell] = rate
    moved.period()
    return moved.cells[cell] == 0.0


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
