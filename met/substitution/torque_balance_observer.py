"""Torque balance with an observer, which estimates the rate of the shaft and the torque that the data sheet does not
explain.

    as `torque_balance`, with the observer's rate and unknown torque d in `net`; the arm gets qdd of the balance

d is shared between bed and arm as the motor's torque is, so the run follows the motor that is on the bed, not its data
sheet.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from met.substitution.law import BAND, OBSERVER, Law, LawInput, LawOutput
from met.substitution.torque_balance import balanced
from met.trace import Real


def give(
    p: Sequence[Any], held: Sequence[Any], inputs: Sequence[LawInput], load: Callable[[Sequence[Real]], Sequence[Real]]
) -> Sequence[tuple[LawOutput, Mapping[str, Real]]]:
    return [(balanced(joint), {}) for joint in inputs]


LAW = Law(name="torque_balance_observer", doc=__doc__, parameters=(BAND, *OBSERVER), observer=True, give=give)
