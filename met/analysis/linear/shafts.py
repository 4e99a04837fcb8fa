"""Shafts of emulated beds, and reference rates of laws, that dry friction holds at rest.

Such a rate is exactly 0, and a small one to either side is gone within the period: it is held, and no state, as that of
a joint that sticks. Without dry friction a small rate goes on; but an emulated bed stops a shaft that would turn back,
for the rest of a substep, so that a push to one side and to the other differ, and there is no derivative at rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from met.analysis.linear.flow import Flow
from met.program.cells import REFERENCE_RATE

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
    """Rates of the shafts of beds, rad/s, by joint; of a `FlowAbreast`, [case, 1] or a number each."""
    joints = [actuator.use.joint for actuator, _, _ in flow.program.system.mounted]
    cells = {joint: f"{joint}.bed.shaft_rate" for joint in joints}
    return {joint: flow.cells[cell] for joint, cell in cells.items() if cell in flow.cells}


def loose_beds(flow: Flow) -> list[str]:
    """Joints whose bed's shaft stands where a period begins, and does for all of it, though nothing holds it there."""
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
