"""The result of a case from its records: the run is computed again from the rates that were read.

So only the exchanges have to survive a crash, and an archive follows from the traffic on the wire.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hw.driving.driven import CaseKernel
from hw.recording import records
from hw.recording.records import ANSWERED
from met.frozen import frozen
from met.host.files import is_count
from met.program.build import OUTPUTS
from met.run import STOPPED, Prepared

FAILURE, TICK = OUTPUTS.index("failure"), OUTPUTS.index("failure.tick")

HEAD = {"key", "row", "joints", "beds", "tick_hz", "repeats"}
"""Keys that the head of a case's file of records must have."""


@frozen
class CaseResult:
    """The result of one case, made from its records.

    rows     histories [row, column];  outputs: [output];  whole: True where the case reached its end
    seconds  for which it was driven;  exchanges: the records, by bed;  head: of the file of records
    """

    rows: np.ndarray
    outputs: np.ndarray
    whole: bool
    seconds: float
    exchanges: tuple[np.ndarray, ...]
    head: Mapping[str, Any]


def read_rates(recorded: records.Records, beds: int) -> np.ndarray:
    """The rates as the kernel had them, [servo tick, bed]. Where an answer was missing it had the one before."""
    repeats = int(recorded.head["repeats"])
    rows = recorded.rows[: len(recorded.rows) // beds * beds].reshape(-1, beds)
    rates = rows["rate"].copy()
    answered = (rows["flags"] & ANSWERED) != 0
    for bed in range(beds):
        last_answered = np.maximum.accumulate(np.where(answered[:, bed], np.arange(len(rows)), 0))
        rates[:, bed] = rates[last_answered, bed]
    return rates[::repeats]


def check_head(recorded: records.Records) -> None:
    """Raise records.UnsoundRecords where the head of a case's records is damaged, or does not fit the records."""
    head = recorded.head
    if HEAD - set(head):
        raise records.UnsoundRecords("was written by another version of MET")
    joints, beds, hz = head["joints"], head["beds"], head["tick_hz"]
    good = (
        isinstance(joints, list)
        and isinstance(beds, list)
        and len(joints) == len(beds) > 0
        and all(isinstance(joint, str) for joint in joints)
        and all(isinstance(bed, dict) and all(isinstance(word, str) for word in bed.values()) for bed in beds)
        and isinstance(hz, int | float)
        and hz > 0
        and is_count(head["repeats"])
        and head["repeats"] > 0
        and bool((recorded.rows["bed"] < len(joints)).all())
    )
    if not good:
        raise records.UnsoundRecords("has a head that is damaged")


def case_result(path: Path, prepared: Prepared, row: int) -> CaseResult:
    """Make a case's result from its file of records. prepared: the run with its wires open. Raises
    records.UnsoundRecords, OSError."""
    recorded = records.read(path)
    check_head(recorded)
    driven = CaseKernel(prepared, row)
    beds = len(driven.joints)
    if recorded.head["joints"] != list(driven.joints):
        raise records.UnsoundRecords("is of other joints")
    rows, outputs, done = driven.again(read_rates(recorded, beds))
    whole = done == driven.ticks
    if not whole and outputs[FAILURE] == 0.0:
        outputs[FAILURE], outputs[TICK] = STOPPED, float(done + 1)
    last = recorded.rows["ended"][-1] if len(recorded.rows) else 0
    return CaseResult(
        rows,
        outputs,
        whole,
        float(last) * 1e-9,
        tuple(recorded.rows[recorded.rows["bed"] == bed] for bed in range(beds)),
        recorded.head,
    )
