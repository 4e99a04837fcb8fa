"""Velocity tracking, the default law: torque balance with an observer, and feedback towards the rate that the joint's
own motor would have.

    tau_l = (that of torque_balance_observer) + K (w_ref - w_hat),  K = gain J_bed/T
    w_ref' = N qdd of the balance at w_ref, from rest with friction that sticks

The feedback removes what the balance leaves: errors of the balance add up in the rate of the shaft, but not in w_ref.
It is stable for gains up to about 1 whatever the arm, and up to 0.65 with two ticks of delay.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from met.parameter import Parameter
from met.substitution.law import BAND, OBSERVER, Law, LawInput, LawOutput
from met.substitution.torque_balance import balanced
from met.trace import Real


def give(
    p: Sequence[Any], held: Sequence[Any], inputs: Sequence[LawInput], load: Callable[[Sequence[Real]], Sequence[Real]]
) -> Sequence[tuple[LawOutput, Mapping[str, Real]]]:
    """The torque of each load motor and the acceleration of each joint: balance of all torques, and a pull towards the
    rate that the joint's own motor would have."""
    outputs: list[tuple[LawOutput, Mapping[str, Real]]] = []
    for own, joint in zip(p, inputs, strict=True):
        pull = own.gain * joint.inertia / joint.period * (joint.w_ref - joint.w)
        shared = balanced(joint)
        outputs.append((LawOutput(shared.torque + pull, shared.qdd), {}))
    return outputs


LAW = Law(
    name="velocity_tracking",
    doc=__doc__,
    parameters=(
        Parameter(
            name="gain",
            default=0.3,
            at_least=0.0,
            doc="gain on the rate error, as a share of J_bed/T: the inertia of the shaft divided by the tick",
        ),
        BAND,
        *OBSERVER,
    ),
    observer=True,
    give=give,
)
