"""A case's records made into what a shard holds of it: the run is computed again from the rates that were read.

So nothing but the exchanges has to outlive a crash, and an archive follows from what was on the wire.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hw import records
from hw.driven import Driven
from hw.records import ANSWERED
from met.frozen import frozen
from met.program.build import OUTPUTS
from met.run import STOPPED, Prepared

FAILURE, TICK = OUTPUTS.index("failure"), OUTPUTS.index("failure.tick")

HEAD = {"key", "row", "joints", "beds", "tick_hz", "repeats"}
"""Of a case's records."""


@frozen
class Made:
    """rows: histories [row, column];  outputs: [output];  whole: whether the case reached its end
    seconds: how long it was driven;  exchanges: the records, by bed;  head: what stands before them"""

    rows: np.ndarray
    outputs: np.ndarray
    whole: bool
    seconds: float
    exchanges: tuple[np.ndarray, ...]
    head: Mapping[str, Any]


def read_rates(found: records.Records, beds: int) -> np.ndarray:
    """Rates as the kernel had them, [servo tick, bed]: where no answer came, the one before."""
    repeats = int(found.head["repeats"])
    rows = found.rows[: len(found.rows) // beds * beds].reshape(-1, beds)
    rates = rows["rate"].copy()
    answered = (rows["flags"] & ANSWERED) != 0
    for bed in range(beds):
        at = np.maximum.accumulate(np.where(answered[:, bed], np.arange(len(rows)), 0))
        rates[:, bed] = rates[at, bed]
    return rates[::repeats]


def made(path: Path, prepared: Prepared, row: int) -> Made:
    """What a case's records say. prepared: with its wires open. Raises records.Unsound, OSError."""
    found = records.read(path)
    if HEAD - set(found.head):
        raise records.Unsound("was written by another version of MET")
    driven = Driven(prepared, row)
    beds = len(driven.joints)
    rows, outputs, done = driven.again(read_rates(found, beds))
    whole = done == driven.ticks
    if not whole and outputs[FAILURE] == 0.0:
        outputs[FAILURE], outputs[TICK] = STOPPED, float(done + 1)
    last = found.rows["ended"][-1] if len(found.rows) else 0
    return Made(rows, outputs, whole, float(last) * 1e-9,
                tuple(found.rows[found.rows["bed"] == bed] for bed in range(beds)), found.head)  # fmt: skip
