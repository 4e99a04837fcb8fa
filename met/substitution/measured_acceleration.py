"""The baseline: the load torque is J_eff times the measured acceleration, which is the difference of two readings.

    a = (y_k - y_{k-1})/T,  low-pass at will;   tau_l = -(Lambda a/N + b_0)/N + (J_bed - J_m) a

It is stable only while the arm is light compared with the rotor: the lag of the filter and the delay of the loop set
the limit, and a better estimate of the acceleration lowers it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from met.parameter import Memory, Parameter
from met.substitution.law import Law, LawInput, LawOutput
from met.trace import Real, exp


def give(
    p: Sequence[Any], held: Sequence[Any], inputs: Sequence[LawInput], load: Callable[[Sequence[Real]], Sequence[Real]]
) -> Sequence[tuple[LawOutput, Mapping[str, Real]]]:
    """The torque of each load motor and the acceleration of each joint, from the difference of two readings of the
    shaft's rate, low-passed."""
    shaft = []
    for own, memory, joint in zip(p, held, inputs, strict=True):
        new = (joint.rate - joint.before) / joint.period
        share = 1.0 - exp(-2.0 * math.pi * own.low_pass * joint.period)
        shaft.append(memory.acceleration + share * (new - memory.acceleration))
    qdd = [a / joint.motor.ratio for a, joint in zip(shaft, inputs, strict=True)]
    outputs = []
    for a, joint_a, joint, taken in zip(shaft, qdd, inputs, load(qdd), strict=True):
        torque = -taken / joint.motor.ratio + (joint.inertia - joint.motor.inertia) * a
        outputs.append((LawOutput(torque, joint_a), {"acceleration": a}))
    return outputs


LAW = Law(
    name="measured_acceleration",
    doc=__doc__,
    parameters=(
        Parameter(
            name="low_pass",
            unit="Hz",
            default=math.inf,
            above=1e-9,
            doc="cut-off frequency of a low-pass on the acceleration; inf: no filter",
        ),
    ),
    balance="none",
    memory=(Memory(name="acceleration", unit="rad/s^2", doc="measured acceleration of the shaft"),),
    give=give,
)
