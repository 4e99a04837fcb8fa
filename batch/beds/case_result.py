"""The result of a case from its records, computed again from the rates that were read; a campaign's records.

So only the exchanges have to survive a crash, and an archive follows from the traffic on the wire.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
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


@frozen
class CaseRecords:
    """The records of one case. tick_hz: rate of its beds' ticks, Hz;  exchanges: by joint"""

    tick_hz: float
    exchanges: Mapping[str, np.ndarray]


class CampaignRecords:
    """The records of all cases of a campaign that were driven, in this run or an earlier one.

    cases  by the numbers of experiment and row
    beds   by joint, name and firmware of the beds that it was on
    """

    def __init__(self, joints: Iterable[str]) -> None:
        self.cases: dict[tuple[int, int], CaseRecords] = {}
        self.beds: dict[str, list[dict[str, str]]] = {joint: [] for joint in joints}

    def add(self, experiment: int, row: int, head: Mapping[str, Any], exchanges: Sequence[np.ndarray]) -> None:
        """Add a case. head: of its file of records;  exchanges: its records, bed by bed."""
        by_joint = dict(zip(head["joints"], exchanges, strict=True))
        self.cases[experiment, row] = CaseRecords(float(head["tick_hz"]), by_joint)
        for joint, about in zip(head["joints"], head["beds"], strict=True):
            if about not in self.beds.setdefault(joint, []):
                self.beds[joint].append(about)

    def add_all(self, folder: Path) -> None:
        """Add the cases in a folder that are not known yet."""
        for path in sorted(folder.glob("*.records")):
            experiment, _, row = path.stem.partition("-")
            if not (experiment.isdecimal() and row.isdecimal()) or (int(experiment), int(row)) in self.cases:
                continue
            with contextlib.suppress(records.UnsoundRecords, OSError):
                recorded = records.read(path)
                if recorded.head:
                    check_head(recorded)
                    rows = [recorded.rows[recorded.rows["bed"] == bed] for bed in range(len(recorded.head["joints"]))]
                    self.add(int(experiment), int(row), recorded.head, rows)

    def of(self, joint: str) -> list[tuple[float, np.ndarray]]:
        """The rate of ticks (Hz) and the records of each case on a joint's bed."""
        return [(case.tick_hz, case.exchanges[joint]) for case in self.cases.values() if joint in case.exchanges]


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
