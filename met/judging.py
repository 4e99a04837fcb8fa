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
    failure, subject, tick = (column[name] for name in FAILURE)

    def write(first: np.ndarray, cause: float, number: np.ndarray, ticks: np.ndarray) -> None:
        failure[first], subject[first], tick[first] = cause, number[first], ticks[first]

    if plausible.FAILED_TICK in column:
        failed_tick = column[plausible.FAILED_TICK]
        write(
            (failed_tick != 0.0) & ((failure == 0.0) | (tick > failed_tick)),
            TOO_FAST,
            column[plausible.OF],
            failed_tick,
        )
    if UNHELD in column:
        unheld = column[UNHELD]
        write((unheld != 0.0) & ((failure == 0.0) | (tick > 0.0)), UNBALANCED, unheld - 1.0, np.zeros_like(tick))
