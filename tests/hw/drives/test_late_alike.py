"""An old answer is never taken for a new one, though both drives' answers be late alike: frames have no numbers, so it
is counted what each drive was asked and has answered."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from hw.beds.can_bed import CanBed
from hw.drives.bench_file import two_drives
from hw.drives.drive import OWED, REMEMBERED, CanDrive, CanFrame
from hw.drives.odrive import ESTIMATES, OdriveDrive
from met.substitution.bed import DriveCommand
from tests.hw.drives.played import bench_file, host_of, line_of, period_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.drives.spoiling import Spoilt, Tally, campaign

LATE = [5e-4 * n for n in range(1, 11)]
"""Times by which answers are late, s."""

OTHERS = ["damiao", "moteus", "cia402", "robstride"]


class LateAlike:
    """A fault of all that both drives say within one in ten periods: it is late by the same time, s."""

    kind = "late alike"

    def __init__(self, late: float, seed: int) -> None:
        self.late, self.random, self.on, self.befell = late, random.Random(seed), False, 0
        self.line: PlayedLine | None = None
        self._period, self._befalls = -1, False

    def __call__(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        assert self.line is not None
        if not self.on or not from_drive:
            return [(0.0, frame)]
        if self._period != (period := int(self.line.now() / 1e-3)):
            self._period, self._befalls = period, self.random.random() < 0.1
        self.befell += self._befalls
        return [(self.late if self._befalls else 0.0, frame)]


def through(folder: Path, dialect: str, told: DriveCommand, late: float, seed: int, exchanges: int) -> Tally:
    """What comes of exchanges whose answers are late alike, from another phase of the command with each seed."""
    played, spoiler = played_bench(dialect), LateAlike(late, seed)
    spoiler.line = line = line_of(dialect, played, spoiler)
    line.sleep(0.031 * seed)
    with host_of(two_drives(bench_file(folder, dialect)), line, drive=told) as bed:
        tally = campaign(bed, line, played, spoiler, exchanges, 60.0 if told == "rate" else 6.0, period_of(dialect))
    assert played.off and spoiler.befell > exchanges / 50
    return tally


@pytest.mark.release
@pytest.mark.parametrize("told", ["voltage", "rate"])
@pytest.mark.parametrize("late", LATE)
@pytest.mark.parametrize("exchanges", [300, pytest.param(2000, marks=pytest.mark.slow)])
def test_odrives_that_are_late_alike_are_not_taken_for_new(
    tmp_path: Path, told: DriveCommand, late: float, exchanges: int
) -> None:
    tally = through(tmp_path, "odrive", told, late, int(late / 5e-4), exchanges)
    assert tally.answered > exchanges / 2 and tally.wrong == 0, tally


@pytest.mark.slow
@pytest.mark.parametrize("dialect", OTHERS)
@pytest.mark.parametrize("late", [2e-3, 2.5e-3, 3e-3])
@pytest.mark.parametrize("exchanges", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_drives_of_any_dialect_that_are_late_alike_are_not_taken_for_new(
    tmp_path: Path, dialect: str, late: float, exchanges: int
) -> None:
    tally = through(tmp_path, dialect, "voltage", late, 3, exchanges)
    assert tally.answered > exchanges / 3 and tally.wrong == 0, tally


class Driven:
    """An armed bed of two played ODrives, of whose answers some are lost. lost: number of a node, and whether its next
    answer is"""

    def __init__(self, folder: Path) -> None:
        self.lost = {1: False, 2: False}
        self.played = played_bench()
        self.line = PlayedLine(self.played, self._spoil)
        self.bed: CanBed = host_of(two_drives(bench_file(folder)), self.line)
        self.bed.connect()
        self.bed.patience = 2e-3
        self.bed.arm()

    def _spoil(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        node = frame.id >> 5
        if from_drive and frame.id & 0x1F == ESTIMATES and self.lost[node]:
            self.lost[node] = False
            return []
        return [(0.0, frame)]

    def answered(self, exchanges: int) -> list[bool]:
        """Whether each of so many exchanges is answered."""
        found, due = [], self.line.now()
        for _ in range(exchanges):
            due += 1e-3
            self.line.sleep(max(0.0, due - self.line.now()))
            found.append(self.bed.exchange(2.0, 0.0) is not None)
        return found


@pytest.fixture
def driven(tmp_path: Path) -> Driven:
    return Driven(tmp_path)


def test_an_answer_that_is_lost_costs_one_exchange(driven: Driven) -> None:
    """The other drive owes nothing, and tells how new what this one says is."""
    for node in (1, 2, 1):
        driven.lost[node] = True
        assert driven.answered(10) == [False] + 9 * [True]
        assert not driven.bed._drives[2 - node].owed
        driven.answered(30)
    driven.bed.close()


def test_answers_that_are_lost_to_both_are_waited_for_before_drives_are_asked_again(driven: Driven) -> None:
    driven.lost = {1: True, 2: True}
    found = driven.answered(40)
    missed = found.index(True)
    assert 1e-3 * missed == pytest.approx(OWED, abs=3e-3) and all(found[missed:])
    driven.bed.close()


def test_what_is_owed_is_forgotten_when_it_never_comes(driven: Driven) -> None:
    drive = driven.bed._drives[0]
    driven.lost[1] = True
    driven.answered(1)
    asked = drive.owed[0]
    assert drive.owes(asked + 0.999 * OWED) and not drive.owes(asked + 1.001 * OWED)
    driven.bed.close()


def a_drive(folder: Path, change: Callable[[CanDrive], object] = lambda drive: None) -> CanDrive:
    drive = OdriveDrive(two_drives(bench_file(folder)).drive)
    change(drive)
    return drive


def test_an_answer_that_is_an_earlier_one_again_is_old_where_the_shaft_turns(tmp_path: Path) -> None:
    drive = a_drive(tmp_path)
    assert not drive.has_said("one", 3.0, 1.000) and not drive.has_said("two", 3.0, 1.001)
    assert drive.has_said("one", 3.0, 1.002) and drive.has_said("two", 3.0, 1.002)
    assert not drive.has_said("three", 0.0, 1.003) and not drive.has_said("three", 0.0, 1.004)
    for n in range(REMEMBERED):
        drive.has_said(n, 3.0, 1.01)
    assert not drive.has_said("one", 3.0, 1.02)


def test_an_answer_of_a_shaft_at_rest_is_old_where_it_has_turned_since(tmp_path: Path) -> None:
    """As it begins to turn both drives' may be frames of before, alike: nothing else tells."""
    drive = a_drive(tmp_path)
    assert not any(drive.has_said("rest", 0.0, 1.0 + 1e-3 * n) for n in range(9))
    assert not drive.has_said("turns", 1.09, 1.009)
    assert drive.has_said("rest", 0.0, 1.010) and drive.has_said("rest", 0.0, 1.011)
    assert not drive.has_said("rest elsewhere", 0.0, 1.012) and not drive.has_said("rest elsewhere", 0.0, 1.013)


def test_an_answer_is_not_old_where_the_shaft_may_have_turned_by_less_than_a_step(tmp_path: Path) -> None:
    drive = a_drive(tmp_path, lambda drive: setattr(drive, "steps", (4e-4, 2e-2)))
    drive.has_said("one", 0.42, 1.0)  # 0.4 rad/s at least
    assert not drive.has_said("one", 0.42, 1.00099)
    assert drive.has_said("one", 0.42, 1.00099 + 0.00101)


def table(folder: Path) -> None:
    """Print what comes of two ODrives that are late alike: `python -m tests.hw.drives.test_late_alike`."""
    kinds: tuple[DriveCommand, ...] = ("voltage", "rate")
    for told in kinds:
        for late in LATE:
            found = [through(folder, "odrive", told, late, seed, 600) for seed in range(4)]
            answered, wrong = sum(each.answered for each in found), sum(each.wrong for each in found)
            worst = max(each.worst for each in found)
            print(
                f"{told:8} {1e3 * late:3.1f} ms answered {answered:5,} wrong {wrong} worst {worst:.3f} rad/s",
                flush=True,
            )


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        table(Path(name))
