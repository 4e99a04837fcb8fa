"""Failures found by the program's watch in cases that the program carried to their end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from met.program import plausible
from met.program.build import UNHELD
from met.program.step import FAILURE, TOO_FAST, UNBALANCED


def judge(names: Sequence[str], outputs: np.ndarray) -> None:
    """Write failures into the outputs [case, output], whose names these are: the first failure of each case stays."""
    column = {name: outputs[:, place] for place, name in enumerate(names)}
    failure, of, tick = (column[name] for name in FAILURE)

    def write(first: np.ndarray, cause: float, number: np.ndarray, at: np.ndarray) -> None:
        failure[first], of[first], tick[first] = cause, number[first], at[first]

    if plausible.FAILED_TICK in column:
        at = column[plausible.FAILED_TICK]
        write((at != 0.0) & ((failure == 0.0) | (tick > at)), TOO_FAST, column[plausible.OF], at)
    if UNHELD in column:
        unheld = column[UNHELD]
        write((unheld != 0.0) & ((failure == 0.0) | (tick > 0.0)), UNBALANCED, unheld - 1.0, np.zeros_like(tick))
