"""Whatever befalls the frames of a bus, no answer is taken that is wrong, and no drive is left driving.

`python -m tests.hw.drives.campaigns` runs five times as many exchanges of each.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from hw.bed import Fault
from hw.drives.bench_file import two_drives
from tests.hw.drives.played import bench_file, host_of, line_of, period_of, played_bench
from tests.hw.drives.spoiling import FAULTS, Spoiler, Tally, campaign

DIALECTS = ("odrive", "damiao", "moteus", "cia402", "robstride", "odrive_ascii")


def through(folder: Path, dialect: str, kind: str, exchanges: int) -> tuple[Tally, Spoiler]:
    """What comes of so many exchanges under a fault; the bed is off afterwards."""
    played, spoiler = played_bench(dialect), Spoiler(kind, 1)
    line = line_of(dialect, played, spoiler)
    with host_of(two_drives(bench_file(folder, dialect)), line) as bed:
        tally = campaign(bed, line, played, spoiler, exchanges, period=period_of(dialect))
    assert played.off
    return tally, spoiler


@pytest.mark.slow
@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("kind", FAULTS)
def test_no_wrong_answer_is_taken(tmp_path: Path, dialect: str, kind: str) -> None:
    tally, spoiler = through(tmp_path, dialect, kind, 400)
    assert spoiler.befell >= 2 and tally.answered >= 100
    assert tally.wrong == 0, tally


@pytest.mark.release
@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("kind", FAULTS)
def test_no_wrong_answer_of_two_thousand_is_taken(tmp_path: Path, dialect: str, kind: str) -> None:
    tally, spoiler = through(tmp_path, dialect, kind, 2000)
    assert spoiler.befell >= 6 and tally.answered >= 200
    assert tally.wrong == 0, tally


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dialect", "fault"),
    [
        ("odrive", Fault.DRIVE),
        ("damiao", Fault.DRIVE),
        ("moteus", Fault.DISAGREEMENT),
        ("robstride", Fault.DEADMAN),
    ],
)
def test_a_drive_that_has_rebooted_stops_the_bed(tmp_path: Path, dialect: str, fault: Fault) -> None:
    """A moteus drives again at the next command: that its angle has begun anew tells it, where it had gone round."""
    tally, spoiler = through(tmp_path, dialect, "reboot", 1000)
    assert spoiler.befell > 5 and tally.stops > 0 and tally.faults == fault
    assert fault != Fault.DRIVE or tally.stops >= spoiler.befell - 1
