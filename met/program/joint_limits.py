"""Limits of joints: the distance of a joint beyond a limit. Limits are watched, and do not affect the motion."""

from __future__ import annotations

from met.program.system import ReadCell
from met.trace import Real, absolute


def excess(joint: str, limit: str, value: Real, read: ReadCell) -> Real:
    """The distance of a joint beyond a limit of this name and value, in the limit's unit; below 0 within the limit.

    Its position and rate are those of the state, its torque that of the derivative taken last.
    """
    if limit in ("q_min", "q_max"):
        q = read(f"{joint}.q")
        return value - q if limit == "q_min" else q - value
    return absolute(read(f"{joint}.{'qd' if limit == 'qd_max' else 'tau'}")) - value
