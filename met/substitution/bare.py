"""Torque balance exactly as in eq. 10 of the paper: friction is left out of the balance.

The bed's friction then acts 1 + r times too strongly, with r = J_eff/(N^2 J_m). The law is here to show this;
`torque_balance` has it right.
"""

from __future__ import annotations

from met.substitution.law import Law
from met.substitution.torque_balance import give

LAW = Law(name="bare", doc=__doc__, balance="bare", give=give)
