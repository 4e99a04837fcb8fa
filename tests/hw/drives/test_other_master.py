"""Another master of a drive is noticed, and stops the bed: by its frames on the bus, or by what the drive says it was
told. `python -m tests.hw.drives.other_master` has more runs, and honest ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from hw.bed import BedState, Fault
from hw.drives import DIALECTS
from hw.drives.bench_file import two_drives
from hw.drives.checks import AGAIN, DOUBTS, TOLD, SetpointChecks
from hw.drives.drive import CanFrame
from met.substitution.bed import DriveCommand
from tests.hw.conftest import refusal
from tests.hw.drives.other_master import WAYS, commands, interfere, run
from tests.hw.drives.played import bench_file, host_of, line_of, played_bench
from tests.hw.drives.test_faults import DIALECTS as PLAYED

BUSES = [each for each in PLAYED if each != "odrive_ascii"]


@pytest.mark.parametrize("dialect", BUSES)
@pytest.mark.parametrize("way", WAYS)
def test_a_frame_that_commands_a_drive_is_known_and_one_that_asks_is_none(
    tmp_path: Path, dialect: str, way: str
) -> None:
    bench = two_drives(bench_file(tmp_path, dialect))
    drives = [DIALECTS[dialect](entry) for entry in (bench.drive, bench.load)]
    for frame in commands(dialect, way, 1):
        assert [each.is_command(frame) for each in drives] == [True, False]
    if dialect not in ("cia402", "robstride"):  # whose questions are a SYNC, and the setting of a watchdog
        asked = [frame for each in drives for frame in each.query()]
        assert not any(each.is_command(frame) for each in drives for frame in asked)


def test_a_master_on_a_serial_line_is_noticed_by_what_the_drive_was_told(tmp_path: Path) -> None:
    """The torque of the finding: |q| was 5.8 % and |qd| 20 % off, and the run ended well."""
    found = run(tmp_path, "odrive_ascii", "torque", 1)
    assert found.after < 0.6 and not found.later
    assert found.words.endswith(" was commanded by another: its axis0.controller.input_torque is 0.35")


def test_a_master_on_the_bus_is_noticed_by_its_frame_and_the_bed_does_not_arm_until_it_is_cleared(
    tmp_path: Path,
) -> None:
    played = played_bench()
    line = line_of("odrive", played)
    with host_of(two_drives(bench_file(tmp_path)), line) as bed:
        bed.connect()
        bed.arm()
        interfere(line, commands("odrive", "torque", 1), line.now() + 0.01, line.now() + 0.02, 1, heard=True)
        for _ in range(30):
            line.sleep(1e-3)
            sample = bed.exchange(0.0, 0.0)
            if sample is not None and sample.state == BedState.STOPPED:
                break
        assert sample is not None and sample.faults == Fault.OTHER_MASTER and played.off
        assert bed.account()[0] == ("it stopped itself: drive (node 1) was sent a command by another, 0x2E 33 33 b3 3e")
        assert refusal(bed.arm) == (
            "error[E406]: bed `paper` does not arm: it stopped itself: another program or computer commands it\n"
            " = help: drive (node 1) was sent a command by another, 0x2E 33 33 b3 3e\n"
            " = help: find and end it: another run, a maker's tool on another port of a drive, a controller on the bus"
        )
        bed.rest(0.3)
        bed.clear()
        assert bed.arm().state == BedState.ARMED


def test_a_master_is_noticed_before_the_bed_is_armed(tmp_path: Path) -> None:
    played = played_bench("damiao")
    line = line_of("damiao", played)
    with host_of(two_drives(bench_file(tmp_path, "damiao")), line) as bed:
        bed.connect()
        interfere(line, commands("damiao", "torque", 2), line.now(), line.now() + 0.005, 1, heard=True)
        line.sleep(0.01)
        assert bed.read().faults == Fault.OTHER_MASTER
        assert refusal(bed.arm).startswith("error[E406]: bed `paper` does not arm: it stopped itself: another ")
        assert played.off


def test_a_frame_of_the_host_s_that_comes_back_is_no_other_master_s(tmp_path: Path) -> None:
    """As `udp_multicast` has it, and adapters that echo."""
    played = played_bench()
    line = line_of("odrive", played)
    send = line.send

    def echoing(frame: CanFrame) -> None:
        send(frame)
        line._put(frame, True, line.now())

    line.send = echoing  # type: ignore[method-assign]
    with host_of(two_drives(bench_file(tmp_path)), line, 2e-3) as bed:
        bed.connect()
        bed.arm()
        for n in range(50):
            line.sleep(2e-3)
            bed.exchange(0.1 * n, 0.0)
        assert bed.read().state == BedState.ARMED


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("dialect", "heard", "told"),
    [
        *((dialect, True, "voltage") for dialect in PLAYED),
        ("odrive", True, "rate"),
        ("odrive_ascii", True, "rate"),
        ("cia402", True, "rate"),
        ("odrive", False, "voltage"),
        ("cia402", False, "voltage"),
    ],
)
def test_each_way_of_another_master_is_noticed(
    tmp_path: Path, dialect: str, heard: bool, told: DriveCommand, way: str
) -> None:
    """One that arms an ODrive that is armed changes nothing in the run, and is seen only on a bus; afterwards it keeps
    the drive from being seen to stop."""
    found = run(tmp_path, dialect, way, 3, heard=heard, told=told)
    assert found.words
    unheard = dialect == "odrive_ascii" or (dialect == "odrive" and not heard)
    assert found.later == (way == "arm" and unheard)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dialect", "told"), [*((each, "voltage") for each in PLAYED), ("odrive", "rate"), ("odrive_ascii", "rate")]
)
def test_no_honest_run_is_stopped(tmp_path: Path, dialect: str, told: DriveCommand) -> None:
    assert not run(tmp_path, dialect, "", 1, told=told).words


# What a drive says it was told


def test_a_command_of_the_last_ones_and_a_setting_as_it_was_are_right() -> None:
    checks = SetpointChecks()
    checks.begin(("torque",), {"mode": 1.0})
    for n in range(2 * TOLD):
        checks.tell(0.01 * n)
    for n in range(TOLD):
        value = {"torque": 0.01 * (TOLD + n) * (1.0 + 1e-6), "mode": 1.0}[checks.next()]
        assert checks.answered(value, 1e-3 * n) == "" and not checks.doubtful


def test_what_is_neither_is_another_s_once_it_is_seen_again_in_time() -> None:
    checks = SetpointChecks()
    checks.begin(("torque",), {"mode": 1.0})
    checks.tell(0.1)
    assert [checks.next() for _ in range(9)].count("mode") == 3
    while checks.next() != "mode":
        pass
    assert checks.answered(2.0, 0.0) == "" and checks.doubtful
    for _ in range(DOUBTS - 1):  # it is asked for alone, and is right
        assert checks.next() == "mode" and checks.answered(1.0, 1.0) == ""
    while checks.next() != "mode":
        checks.answered(0.1, 2.0)
    assert checks.answered(2.0, AGAIN + 1.0) == ""  # long after the first
    assert checks.next() == "mode" and checks.answered(2.0, AGAIN + 2.0) == "its mode is 2"


def test_the_command_that_goes_with_another_is_0() -> None:
    checks = SetpointChecks()
    checks.begin(("rate", "torque"))
    checks.tell(5.0)
    answers = {"rate": 5.0, "torque": 0.0}
    asked = [(what := checks.next(), checks.answered(answers[what], 0.0))[0] for _ in range(8)]
    assert set(asked) == {"rate", "torque"} and not checks.doubtful
    while checks.next() != "torque":
        pass
    assert checks.answered(0.35, 1.0) == "" and checks.next() == "torque"
    assert checks.answered(0.35, 1.01) == "its torque is 0.35"
