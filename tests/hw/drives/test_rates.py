"""Drives that are told rates: they close the rate loop within the bench's torque, stop by their watchdogs in that mode,
and what a deck believes otherwise of them is said."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from hw.bed import BedState, Fault
from hw.beds.can_bed import CanBed
from hw.beds.can_deck import BelievedLoop, loop_warning
from hw.drivers import check_model, opened
from hw.drives import DIALECTS
from hw.drives.bench_file import two_drives
from hw.ports import Port
from met.messages.render import render
from met.plan import Experiment
from tests.hw.conftest import refusal
from tests.hw.drives.played import KT, bench_file, host_of, line_of, period_of, played_bench
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.drives.spoiling import FAULTS, Spoiler, Tally, campaign
from tests.hw.players.cia402 import PlayedCia402
from tests.hw.players.odrive import PlayedOdrive
from tests.hw.players.player import PlayedBench

TOLD = [name for name, each in DIALECTS.items() if each.takes_rates]
"""Dialects that are told rates."""

DECK = """\
#include <two_link.ic>
servo looped like gearbox {
    resistance = 2000 ohm;  kt = 0.06 N*m/A;  kp = 0.01/0.06*2000 V*s/rad;  ki = 0.05/0.06*2000 V/rad;  v_max = 1e6 V;
}
run bench like nominal {
    servos { shoulder = looped; }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    substitute shoulder { bed = rate_drive(delay = 1, kt_load = 0.06 N*m/A); }
}
run weak like bench { servos { shoulder { tau_max = 0.5 N*m; } } }
run other like bench { servos { shoulder { kp = 0.02/0.06*2000 V*s/rad; } } }
run torques like bench { shoulder { bed = torque_drive(delay = 1, kt_load = 0.06 N*m/A); } }
"""


def bed_of(folder: Path, dialect: str) -> tuple[CanBed, PlayedBench, PlayedLine]:
    played = played_bench(dialect)
    line = line_of(dialect, played)
    return host_of(two_drives(bench_file(folder, dialect)), line, drive="rate"), played, line


def experiment(folder: Path, name: str) -> Experiment:
    (folder / "deck.ic").write_text(DECK)
    (found,) = ic.compile(folder / "deck.ic", select=[name]).experiments
    return found


@pytest.mark.slow
@pytest.mark.parametrize("dialect", TOLD)
def test_the_drive_brings_its_shaft_to_the_rate_that_it_is_told(tmp_path: Path, dialect: str) -> None:
    bed, played, line = bed_of(tmp_path, dialect)
    with bed:
        assert bed.connect().drive == "rate"
        bed.arm()
        sample = None
        for _ in range(1500):
            line.sleep(1e-3)
            sample = bed.exchange(-30.0, 0.2)
        assert sample is not None and sample.state == BedState.ARMED
        assert sample.rate == pytest.approx(-30.0, abs=0.15)  # a turn a minute is 0.1 rad/s
        assert played.shaft.rate == pytest.approx(-30.0, abs=0.15)
        # friction and the load's 0.012 N m are the drive's to give
        assert played.drive.output.value == pytest.approx(-1e-3 - 30e-4 - 0.2 * KT, rel=0.1)
    assert played.off


@pytest.mark.parametrize("dialect", TOLD)
def test_its_loop_asks_for_no_more_torque_than_the_bench_bears(tmp_path: Path, dialect: str) -> None:
    bed, played, line = bed_of(tmp_path, dialect)
    most = 0.0
    with bed:
        bed.connect()
        bed.arm()
        for told in (60.0, -60.0) * 3:
            for _ in range(20):
                line.sleep(1e-3)
                bed.exchange(told, 0.0)
                most = max(most, abs(played.drive.output.value))
    assert 0.39 < most <= 0.4 * (1.0 + 1e-6)  # a float of 32 bits


@pytest.mark.parametrize("dialect", TOLD)
def test_a_rate_beyond_the_limit_is_not_sent(tmp_path: Path, dialect: str) -> None:
    bed, played, _ = bed_of(tmp_path, dialect)
    with bed:
        about = bed.connect()
        assert about.limits.voltage == 380.0
        bed.arm()
        words = refusal(lambda: bed.exchange(390.0, 0.0))
        assert words.startswith("error[E408]: a rate of 390 rad/s for bed `paper` is beyond the limit of ")
        assert played.off
        bed.limit({"voltage": 50.0})
        bed.arm()
        # of which there are whole numbers of the steps in which rates are told
        assert " is beyond the limit of " in refusal(lambda: bed.exchange(50.2, 0.0))
        bed.arm()
        bed.exchange(49.9, 0.0)
    assert played.off


@pytest.mark.parametrize("dialect", TOLD)
def test_a_tighter_limit_of_the_rate_is_one_of_the_rates_that_are_told(tmp_path: Path, dialect: str) -> None:
    """Else a shaft that follows what it is told would stop the bed."""
    bed, played, line = bed_of(tmp_path, dialect)
    with bed:
        bed.connect()
        bed.limit({"rate": 30.0})
        bed.arm()
        line.sleep(1e-3)
        sample = bed.exchange(29.8, 0.0)
        assert sample is not None and sample.state == BedState.ARMED
        line.sleep(1e-3)
        words = refusal(lambda: bed.exchange(30.2, 0.0))
        assert words.startswith("error[E408]: a rate of 30.2 rad/s for bed `paper` is beyond the limit of ")
        assert played.off
        bed.limit({"voltage": 10.0, "rate": 20.0})
        bed.arm()
        assert " is beyond the limit of " in refusal(lambda: bed.exchange(11.0, 0.0))
    assert played.off


@pytest.mark.slow
@pytest.mark.parametrize("dialect", TOLD)
def test_each_arming_proves_the_watchdog_of_a_drive_that_closes_its_loop(tmp_path: Path, dialect: str) -> None:
    bed, played, line = bed_of(tmp_path, dialect)
    with bed:
        about = bed.connect()
        bed.arm()
        assert len(bed.proved) == 2
        for _ in range(200):
            line.sleep(1e-3)
            bed.exchange(40.0, 0.0)
        assert played.drive.output.value != 0.0
        line.sleep(1.5 * about.deadman)
        assert played.off  # whatever its loop would do
        stopped = bed.read()
        assert stopped.state == BedState.STOPPED and stopped.faults == Fault.DEADMAN
        bed.rest(5.0)
        bed.clear()
        played.drive.watches = False  # type: ignore[attr-defined]
        assert "still drives" in refusal(bed.arm)
    assert played.off


def through(folder: Path, dialect: str, kind: str, exchanges: int) -> tuple[Tally, Spoiler]:
    """What comes of so many exchanges under a fault while rates are told; the bed is off afterwards."""
    played, spoiler = played_bench(dialect), Spoiler(kind, 1)
    line = line_of(dialect, played, spoiler)
    with host_of(two_drives(bench_file(folder, dialect)), line, drive="rate") as bed:
        tally = campaign(bed, line, played, spoiler, exchanges, 60.0, period_of(dialect))
    assert played.off
    return tally, spoiler


@pytest.mark.release
@pytest.mark.parametrize("dialect", TOLD)
@pytest.mark.parametrize("kind", FAULTS)
@pytest.mark.parametrize("exchanges", [400, pytest.param(2000, marks=pytest.mark.slow)])
def test_no_wrong_answer_is_taken(tmp_path: Path, dialect: str, kind: str, exchanges: int) -> None:
    tally, spoiler = through(tmp_path, dialect, kind, exchanges)
    assert spoiler.befell >= 2 and tally.answered >= 100
    assert tally.wrong == 0, tally


def test_an_odrive_s_limits_of_torque_are_set_and_its_gains_are_read(tmp_path: Path) -> None:
    bed, played, _ = bed_of(tmp_path, "odrive")
    with bed:
        bed.connect()
        assert isinstance(played.drive, PlayedOdrive)
        values = played.drive.values
        assert values["axis0.config.torque_soft_max"] == -values["axis0.config.torque_soft_min"] == pytest.approx(0.4)
        assert dict(bed.remarks)["loop"] == "of rate, the drive's own: 0.01 N*m*s/rad, 0.05 N*m/rad, at most 0.4 N*m"
        assert played.load.values["axis0.config.torque_soft_max"] == pytest.approx(0.18)  # type: ignore[attr-defined]


def test_an_odrive_s_largest_torque_is_not_that_of_a_session_before(tmp_path: Path) -> None:
    """It stays until the drive is switched off. Here a bench of 0.1 N m was told rates, and is then one of 0.4 N m."""
    played, path = played_bench("odrive"), bench_file(tmp_path, "odrive")
    text = path.read_text()
    path.write_text(text.replace('"0.4 N*m"', '"0.1 N*m"').replace('"3 A"', '"1 A"').replace('"2 A"', '"0.5 A"'))
    with host_of(two_drives(path), PlayedLine(played), drive="rate") as bed:
        bed.connect()
    for each, most in zip(played.drives, (0.1, 0.06), strict=True):
        assert isinstance(each, PlayedOdrive)
        assert each.values["axis0.config.torque_soft_max"] == pytest.approx(most)
    path.write_text(text)
    line = PlayedLine(played)
    with host_of(two_drives(path), line, drive="torque") as bed:
        bed.connect()
        bed.arm()
        line.sleep(1e-3)
        bed.exchange(-0.3, 2.5)
        assert played.drive.output.value == pytest.approx(-0.3, rel=1e-6)
        assert played.load.output.value == pytest.approx(2.5 * KT, rel=1e-6)
    for each, most in zip(played.drives, (0.4, 0.18), strict=True):
        assert isinstance(each, PlayedOdrive)
        values = each.values
        assert values["axis0.config.torque_soft_max"] == -values["axis0.config.torque_soft_min"] == pytest.approx(most)


def test_an_odrive_that_lost_its_settings_has_them_again_before_it_is_armed(tmp_path: Path) -> None:
    """Its own are a watchdog, another mode, and a loop that may ask for all that its current gives."""
    bed, played, line = bed_of(tmp_path, "odrive")
    drive = played.drive
    assert isinstance(drive, PlayedOdrive)
    drive.saved |= {
        "axis0.config.enable_watchdog": True,
        "axis0.config.watchdog_timeout": 0.02,
        "axis0.config.can.heartbeat_msg_rate_ms": 5,
    }
    most = 0.0
    with bed:
        bed.connect()
        drive.reboot()
        assert drive.values["axis0.config.torque_soft_max"] == float("inf")
        bed.arm()
        assert drive.mode == 2
        for _ in range(40):
            line.sleep(1e-3)
            bed.exchange(300.0, 0.0)
            most = max(most, drive.output.value)
    assert 0.39 < most <= 0.4 * (1.0 + 1e-6)


def test_a_mode_that_does_not_reach_an_odrive_is_not_that_of_the_session_before(tmp_path: Path) -> None:
    """One that was told 60 rad/s when its host died, and is told torques by the next, whose frames of the mode are
    lost."""
    bed, played, line = bed_of(tmp_path, "odrive")
    drive = played.drive
    assert isinstance(drive, PlayedOdrive)
    bed.connect()
    bed.arm()
    for _ in range(200):
        line.sleep(1e-3)
        bed.exchange(60.0, 0.0)
    line.sleep(5.0)
    assert played.off and played.shaft.rate == 0.0 and (drive.mode, drive.rate_told) == (2, pytest.approx(60.0))
    lossy = PlayedLine(played, lambda frame, from_drive: [] if frame.id & 0x1F == 0x0B else [(0.0, frame)])
    with host_of(two_drives(bench_file(tmp_path, "odrive")), lossy, drive="torque") as bed:
        bed.connect()
        bed.clear()
        bed.arm()
        lossy.sleep(0.01)
        assert drive.state == 8 and drive.mode == 1 and played.shaft.rate == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("dialect", TOLD)
@pytest.mark.parametrize("by", ["fault", "host", "silence"])
def test_a_drive_that_has_stopped_keeps_no_rate_that_it_was_told(tmp_path: Path, dialect: str, by: str) -> None:
    """Else it would go on with that rate from when it is armed until its first command comes."""
    bed, played, line = bed_of(tmp_path, dialect)
    drive = played.drive
    assert isinstance(drive, PlayedOdrive | PlayedCia402)
    with bed:
        bed.connect()
        bed.arm()
        for _ in range(50):
            line.sleep(1e-3)
            bed.exchange(60.0, 0.0)
        assert drive.rate_told == pytest.approx(60.0, abs=0.1)
        if by == "fault":
            played.slip = 1.0
            for _ in range(6):
                line.sleep(1e-3)
                bed.exchange(60.0, 0.0)
        elif by == "silence":
            line.sleep(8.0)
            bed.read()
            bed.clear()
        else:
            bed.stop()
        line.sleep(1e-3)
        assert played.off and drive.rate_told == 0.0


def test_an_odrive_whose_mode_cannot_be_set_is_refused(tmp_path: Path) -> None:
    bed, played, _ = bed_of(tmp_path, "odrive")
    assert isinstance(played.drive, PlayedOdrive)
    played.drive.refuses.add("axis0.controller.config.control_mode")
    assert refusal(bed.connect) == (
        "error[E404]: drive (node 1) cannot be driven: it does not take 2 for "
        "`axis0.controller.config.control_mode`, which is 3\n"
        " = help: set it by its maker's tool"
    )


def test_an_odrive_whose_loop_has_no_gain_is_refused(tmp_path: Path) -> None:
    bed, played, _ = bed_of(tmp_path, "odrive")
    assert isinstance(played.drive, PlayedOdrive)
    played.drive.values["axis0.controller.config.vel_gain"] = 0.0
    assert refusal(bed.connect) == (
        "error[E404]: drive (node 1) cannot be driven: its rate loop has no gain above zero\n"
        " = help: axis0.controller.config.vel_gain, axis0.controller.config.vel_integrator_gain: set them"
    )


@pytest.mark.slow
def test_a_dialect_that_is_told_no_rate_is_refused_at_the_bench_s_file(tmp_path: Path) -> None:
    path = bench_file(tmp_path, "damiao")
    words = refusal(lambda: check_model(f"can:{path}", experiment(tmp_path, "bench"), "shoulder"))
    assert words.replace(str(tmp_path), "FOLDER") == (
        "error[E438]: a drive of dialect `damiao` is told no rate, and `rate_drive` of joint `shoulder` sends one\n"
        "  --> FOLDER/bench.toml:15:1\n"
        "   |\n"
        '15 | dialect     = "damiao"\n'
        "   | ^^^^^^^^^^^^^^^^^^^^^^\n"
        "  ::: FOLDER/deck.ic:8:5  on this bench\n"
        "   = help: bed models for this drive: emulated, torque_drive\n"
        f"   = help: dialects that are told rates: {', '.join(TOLD)}"
    )
    check_model(f"can:{path}", experiment(tmp_path, "torques"), "shoulder")
    line = PlayedLine(played_bench("damiao"))
    assert refusal(host_of(two_drives(path), line, drive="rate").connect) == (
        "error[E438]: drive (node 1) of bed `paper` is told no rate\n"
        f" = help: dialects that are told rates: {', '.join(TOLD)}"
    )


@pytest.mark.slow
def test_a_bench_weaker_than_the_deck_s_motor_is_told_at_its_torque(tmp_path: Path) -> None:
    path = bench_file(tmp_path)
    weak, bench = (
        opened(Port(f"can:{path}"), experiment(tmp_path, name), "shoulder", 0, 1e-3) for name in ("weak", "bench")
    )
    (said,) = (each for each in weak.warnings if "N*m at most" in each.message)
    text = (tmp_path / "deck.ic").read_text()
    assert render([said], {str(path): path.read_text(), str(tmp_path / "deck.ic"): text}).replace(
        str(tmp_path), "FOLDER"
    ) == (
        "warning[E444]: the bench's drive gives 0.4 N*m at most, and the motor of joint `shoulder` 0.5 N*m\n"
        "  --> FOLDER/bench.toml:20:1\n"
        "   |\n"
        '20 | torque_max  = "0.4 N*m"\n'
        "   | ^^^^^^^^^^^^^^^^^^^^^^^\n"
        "  ::: FOLDER/deck.ic:10:53  the deck's\n"
        "   = help: beyond it the drive gives less than the law believes, and the run is one of neither motor\n"
        "   = help: a larger `torque_max` of `[drive]`, if drive and shaft bear it, or a smaller `tau_max` in the deck"
        "\n\n1 warning\n"
    )
    assert not any("N*m at most" in each.message for each in bench.warnings)


@pytest.mark.slow
def test_a_drive_weaker_than_the_deck_s_motor_by_its_own_limits_is_told_when_it_is_greeted(tmp_path: Path) -> None:
    path, played = bench_file(tmp_path), played_bench()
    drive = played.drive
    assert isinstance(drive, PlayedOdrive)
    said = {}
    for amperes in (10.0, 3.0, 2.0):
        drive.values["axis0.config.motor.current_soft_max"] = amperes
        bed = opened(Port(f"can:{path}"), experiment(tmp_path, "bench"), "shoulder", 0, 1e-3)
        assert isinstance(bed, CanBed)
        line = PlayedLine(played)
        bed._open = lambda line=line: line  # type: ignore[misc]
        with bed:
            bed.connect()
            said[amperes] = [render([each], {}) for each in bed.warnings if "own limits" in each.message]
    assert said == {
        10.0: [],
        3.0: [],  # 0.18 N m: less than the file's, and more than the deck's
        2.0: [
            "warning[E444]: the drive (node 1) gives 0.12 N*m at most by its own limits, and the motor of the deck "
            "0.144 N*m\n"
            " = help: beyond it the drive gives less than the law believes, and the run is one of neither motor\n"
            " = help: larger limits in the drive, if it and the shaft bear them, or a smaller `tau_max` in the deck\n\n"
            "1 warning\n"
        ],
    }


@pytest.mark.slow
def test_a_loop_that_is_not_the_deck_s_is_told_when_the_drive_is_greeted(tmp_path: Path) -> None:
    path, line = bench_file(tmp_path), PlayedLine(played_bench())
    said = {}
    for name in ("bench", "other"):
        bed = opened(Port(f"can:{path}"), experiment(tmp_path, name), "shoulder", 0, 1e-3)
        assert isinstance(bed, CanBed)
        bed._open = lambda: line
        with bed:
            bed.connect()
            said[name] = [each.message for each in bed.warnings if "rate loop" in each.message]
    assert said == {
        "bench": [],
        "other": [
            "the rate loop of the drive (node 1) has 0.01 N*m*s/rad and 0.05 N*m/rad, and the deck takes it for one of "
            "0.02 and 0.05, with a back-EMF of 1.8e-06 N*m*s/rad"
        ],
    }


def test_a_back_emf_that_a_loop_over_a_current_loop_has_not_is_told() -> None:
    assert loop_warning("drive", 0.01, 0.05, BelievedLoop(0.01, 0.05, 1e-4)) is None
    told = loop_warning("drive", 0.01, 0.05, BelievedLoop(0.01, 0.05, 2e-3))
    assert told is not None and told.help[0] == (
        "the servo's `kp` and `ki` times kt/R are to be the drive's, and its R so large that kt^2/R is none"
    )
