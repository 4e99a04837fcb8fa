"""A drive that keeps what it was told has no torque to go on with when it is enabled: none is told before."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from hw.drives.bench_file import two_drives
from hw.drives.drive import CanFrame
from tests.hw.drives.played import bench_file, host_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.players.damiao import PlayedDamiao
from tests.hw.players.player import PlayedBench
from tests.hw.players.robstride import PlayedRobstride

STEP = 1e-3
"""N m, more than half a step of either dialect's torque."""


def keeping(dialect: str, takes_off: bool) -> PlayedBench:
    """Two drives that keep what they were told while they are off."""
    played = played_bench(dialect)
    for each in played.drives:
        assert isinstance(each, PlayedDamiao | PlayedRobstride)
        each.keeps, each.takes_off = True, takes_off
    return played


def drive_and_leave(folder: Path, played: PlayedBench, dialect: str, *, stopped: bool) -> None:
    """Drive a bench by a torque of 0.2 N m. stopped: by its host; else that is dead, and its watchdogs stop it."""
    line = PlayedLine(played)
    bed = host_of(two_drives(bench_file(folder, dialect)), line, drive="torque")
    bed.connect()
    bed.arm()
    for n in range(40):
        line.sleep(1e-3)
        bed.exchange(0.2 if n % 2 else -0.2, 0.0)
    assert abs(played.drive.output.value) == pytest.approx(0.2, abs=STEP)
    if stopped:
        bed.stop()
    line.sleep(5.0)
    assert played.off


def torques_of_arming(folder: Path, played: PlayedBench, dialect: str) -> list[float]:
    """What the drive's bridge gives after each frame that comes to it, while another host arms the bench, N m."""
    found: list[float] = []
    drive = played.drive
    receive = drive.receive

    def noted(frame: CanFrame, now: float) -> Sequence[CanFrame]:
        answers = receive(frame, now)
        found.append(abs(drive.output.value))
        return answers

    drive.receive = noted  # type: ignore[method-assign]
    with host_of(two_drives(bench_file(folder, dialect)), PlayedLine(played), drive="torque") as bed:
        bed.connect()
        bed.clear()
        bed.arm()
        drive.receive = receive  # type: ignore[method-assign]
    return found


@pytest.mark.parametrize("dialect", ["damiao", "robstride"])
def test_one_that_takes_no_torque_while_it_is_off_was_told_none_when_it_was_stopped(
    tmp_path: Path, dialect: str
) -> None:
    played = keeping(dialect, takes_off=False)
    drive_and_leave(tmp_path, played, dialect, stopped=True)
    assert max(torques_of_arming(tmp_path, played, dialect)) < STEP


@pytest.mark.parametrize("dialect", ["damiao", "robstride"])
def test_one_whose_host_died_is_told_no_torque_before_it_is_enabled(tmp_path: Path, dialect: str) -> None:
    played = keeping(dialect, takes_off=True)
    drive_and_leave(tmp_path, played, dialect, stopped=False)
    assert max(torques_of_arming(tmp_path, played, dialect)) < STEP


@pytest.mark.parametrize("dialect", ["damiao", "robstride"])
def test_one_whose_host_died_and_that_takes_none_while_it_is_off_has_it_for_one_frame(
    tmp_path: Path, dialect: str
) -> None:
    """The page says so: no order of frames can mend it."""
    played = keeping(dialect, takes_off=False)
    drive_and_leave(tmp_path, played, dialect, stopped=False)
    assert sum(each > STEP for each in torques_of_arming(tmp_path, played, dialect)) == 1
