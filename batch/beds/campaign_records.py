"""The records of a campaign's cases: the beds on which they were driven, and every exchange with them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.beds.case_result import check_head
from hw.recording import records
from met.frozen import frozen


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
            if not (experiment.isdecimal() and row.isdecimal()):
                continue
            if (int(experiment), int(row)) in self.cases:
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
