"""The 8-byte frame of the MIT's small motors: position 16 bit, velocity 12, kp 12, kd 12, torque 12, as makers have it.

A number of n bits runs from -most to most, both ends included: 0 is between two of them. With an even number of steps
there is no torque of exactly 0; the smallest is half a step.
"""

from __future__ import annotations

import math

STEPS_16, STEPS_12 = (1 << 16) - 1, (1 << 12) - 1


def packed(position: int, velocity: int, kp: int, kd: int, torque: int) -> bytes:
    """The bytes of a command, its fields in counts."""
    fields = position << 48 | velocity << 36 | kp << 24 | kd << 12 | torque
    return fields.to_bytes(8, "big")


def count_of(value: float, most: float, steps: int) -> int:
    """The count of a value, or the next one towards 0: the command never exceeds the request, except for half a step
    where the request is below that."""
    scaled = (min(max(value, -most), most) + most) / (2.0 * most) * steps
    return math.floor(scaled) if value >= 0.0 else math.ceil(scaled)


def value_of(count: int, most: float, steps: int) -> float:
    """The value of a count."""
    return count * (2.0 * most) / steps - most
