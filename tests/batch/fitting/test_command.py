"""`met fit`: from a log to numbers, to the deck, and what it refuses."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import ic
from met import cli

DECK = """deck 2;
#include <servos/rigid_gearbox.ic>

param mass = 20 kg;

arm swing {
    link bar { mass = mass;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = y; }
}

servo drive like rigid_gearbox { command = rate(sine(amplitude = 0.15 rad/s, frequency = 0.5 Hz)); }

default run work {
    arm      = swing;
    servos   { hinge = drive; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates    { dynamics = 500 Hz;  servos = 500 Hz;  record = 100 Hz; }
    duration = 5 s;
    record   = [q, servo.motor_torque];
}
"""

Say = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The deck, and a log of an arm of 26 kg with f_c = 0.03 N m: `log.csv` with the run's names, `raw.csv` with its
    own."""
    place = tmp_path_factory.mktemp("fit")
    (place / "deck.ic").write_text(DECK)
    settings = ["--set", "mass=26 kg", "--set", "drive.f_c=0.03 N*m"]
    assert cli.main(["run", f"{place}/deck.ic", *settings, "-q", "--no-picture", "-o", f"{place}/real.h5"]) == cli.YES
    assert cli.main(["export", f"{place}/real.h5", "-q", "-o", f"{place}/exact.csv"]) == cli.YES
    lines = [line for line in (place / "exact.csv").read_text().splitlines() if not line.startswith("#")]
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    rows[:, 1:] += 0.01 * rows[:, 1:].std(axis=0) * np.random.default_rng(1).standard_normal(rows[:, 1:].shape)
    write(place / "log.csv", "time [s],hinge.q [rad],hinge.servo.motor_torque [N*m]", rows)
    raw = np.stack([1000.0 * (rows[:, 0] + 7.0), 12.0 - np.degrees(rows[:, 1]), rows[:, 2] / 0.061], axis=1)
    write(place / "raw.csv", "t,angle,current [A]", raw)
    return place


def write(path: Path, head: str, rows: np.ndarray) -> None:
    path.write_text("\n".join([head, *(",".join(repr(float(each)) for each in row) for row in rows)]) + "\n")


RAW = (
    "--zero", "7 s", "--column", "time=t [ms]", "--column", "hinge.q=-angle + 12 [deg]",
    "--column", "hinge.servo.motor_torque=0.061 * current [N*m]",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("log", "options"), [("log.csv", ()), ("raw.csv", RAW)])
def test_numbers_of_the_arm_are_within_their_intervals(
    folder: Path, capsys: Say, log: str, options: tuple[str, ...]
) -> None:
    picture = folder / f"{log}.png"
    arguments = ["fit", f"{folder}/deck.ic", f"{folder}/{log}", "--estimate", "mass", "--estimate", "drive.f_c"]
    arguments += ["--picture", str(picture)]
    assert cli.main([*arguments, *options, "--format", "json"]) == cli.YES
    found = json.loads(capsys.readouterr().out)
    for each, truth in zip(found["parameters"], (26.0, 0.03), strict=True):
        assert each["known"] == "known" and abs(each["fitted"] - truth) <= 1.5 * each["half_interval"] < 0.02 * truth
    assert picture.stat().st_size > 10_000
    assert found["certain"] and not found["doubts"]
    (comparison,) = found["logs"]
    assert all(each["white"] for each in comparison["after"]["residuals"])


@pytest.fixture(scope="module")
def late(folder: Path) -> Path:
    """The log of `folder` with times that are 15 ms late."""
    rows = np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1)
    rows[:, 0] += 0.015
    write(folder / "late.csv", "time [s],hinge.q [rad],hinge.servo.motor_torque [N*m]", rows)
    return folder / "late.csv"


@pytest.mark.slow
def test_a_delay_of_a_log_is_doubted_and_the_remedy_that_is_printed_mends_it(
    folder: Path, late: Path, capsys: Say
) -> None:
    arguments = ["fit", f"{folder}/deck.ic", str(late), "--estimate", "mass", "--estimate", "drive.f_c", "--diff"]
    assert cli.main(arguments) == cli.NO
    said = capsys.readouterr().out
    words = re.search(
        r"doubt: the log seems (\S+) s late: `(--zero \S+ s)'` begins so, and `(--estimate .*)` fits it", said
    )
    assert words is not None and float(words[1]) == pytest.approx(0.015, abs=0.002)
    assert cli.main([*arguments, *shlex.split(f"{words[2]}'")]) == cli.YES
    assert "doubt" not in capsys.readouterr().out
    assert cli.main([*arguments, *shlex.split(words[3]), "--format", "json"]) == cli.YES
    found = json.loads(capsys.readouterr().out)
    for each, truth in zip(found["parameters"], (26.0, 0.03, 0.015), strict=True):
        assert each["known"] == "known" and abs(each["fitted"] - truth) <= 1.5 * each["half_interval"]
    assert not any("delay" in line for line in found["deck"]["diff"])


@pytest.mark.slow
def test_zero_may_be_of_one_of_several_logs(folder: Path, late: Path, capsys: Say) -> None:
    arguments = ["fit", f"{folder}/deck.ic", f"{folder}/log.csv", str(late), "--estimate", "mass", "--format", "json"]
    arguments += ["--estimate", "drive.f_c", "--zero", "0 s", "--zero"]
    assert cli.main([*arguments, f"{late}=15 ms"]) == cli.YES
    found = json.loads(capsys.readouterr().out)
    assert all(each["white"] for log in found["logs"] for each in log["after"]["residuals"])
    assert cli.main([*arguments, f"{folder}/log.csv=15 ms"]) == cli.NO


@pytest.mark.slow
def test_of_a_log_with_another_clock_the_beginning_that_is_printed_mends_it(folder: Path, capsys: Say) -> None:
    rows = np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1)
    rows[:, 0] += 1.7e9
    write(folder / "epoch.csv", "time [s],hinge.q [rad],hinge.servo.motor_torque [N*m]", rows)
    arguments = ["fit", f"{folder}/deck.ic", f"{folder}/epoch.csv", "--estimate", "mass"]
    assert cli.main(arguments) == cli.BAD_INPUT
    words = re.search(r"if the run begins with the log: `(--zero .*)`", capsys.readouterr().err)
    assert words is not None
    assert cli.main([*arguments, "--identifiable", *shlex.split(words[1])]) == cli.YES


@pytest.mark.slow
def test_fitted_numbers_are_written_into_the_deck_with_their_intervals(folder: Path, capsys: Say) -> None:
    copy = folder / "fitted.ic"
    arguments = ["fit", f"{folder}/deck.ic", f"{folder}/log.csv", "--estimate", "mass", "--write", "-o", str(copy)]
    assert cli.main([*arguments, "--estimate", "drive.f_c", "--estimate", "drive.kp"]) == cli.YES
    said = capsys.readouterr().out
    assert f"{copy}: written" in said
    assert re.search(r"// chosen by a fit to log.csv, mass \+- \S+ kg\n", copy.read_text())
    both = r"// chosen by a fit to log.csv, drive.f_c \+- \S+ N\*m, drive.kp \+- \S+ V\*s/rad\n"
    assert re.search(both, copy.read_text())
    (experiment,) = ic.compile(copy).experiments
    assert experiment.parameters["links.bar.mass"].value == pytest.approx(26.0, rel=0.01)
    sweep = said[said.index("sweep fitted of work") : said.index("---")]
    copy.write_text(copy.read_text() + sweep)
    assert len(ic.compile(copy, select=["fitted"]).experiments[0].cases.coordinates) == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("column", "doubt"),
    [
        ("hinge.servo.motor_torque=-hinge.servo.motor_torque", "sign turned"),
        ("hinge.servo.motor_torque=1000*hinge.servo.motor_torque", "1,000"),
        ("hinge.q=57.29577951308232*hinge.q", "deg"),
        ("time=1.02*time", "times divided by 1.0"),
    ],
)
def test_a_doubtful_log_writes_nothing(folder: Path, capsys: Say, column: str, doubt: str) -> None:
    arguments = ["fit", f"{folder}/deck.ic", f"{folder}/log.csv", "--estimate", "mass", "--column", column, "--diff"]
    assert cli.main(arguments) == cli.NO
    said = capsys.readouterr().out
    assert "doubt: " in said and doubt in said and "so nothing is written into the deck" in said


@pytest.mark.slow
def test_a_second_log_of_the_same_motion_would_make_errors_smaller_by_the_root_of_two(
    folder: Path, capsys: Say
) -> None:
    arguments = ["fit", f"{folder}/deck.ic", f"{folder}/log.csv", "--estimate", "mass", "--identifiable"]
    assert cli.main([*arguments, "--motion", "work", "--format", "json"]) == cli.YES
    found = json.loads(capsys.readouterr().out)
    (error,), (with_it,) = [each["deviation"] for each in found["parameters"]], found["motions"]["work"]
    assert with_it == pytest.approx(error / 2.0**0.5, rel=0.03)


SWEEP = """
servo wider like drive { command = rate(sine(amplitude = 0.05 rad/s, frequency = 0.5 Hz)); }
run wide like work {
    servos { hinge = wider; }
    metric reach = max { of = hinge.q; };
    require reach < 0.17 rad;
}
sweep moves of wide {
    vary wider.command.amplitude = [0.05, 0.15, 0.3, 0.4] rad/s;
    vary wider.command.frequency = [0.5, 1] Hz;
}
sweep steps of wide { vary rates.dynamics = [500, 1000] Hz; }
sweep masses of wide { vary mass = [10, 20] kg; }
sweep far of wide { vary wider.command.amplitude = [5, 6] rad/s; }
sweep same of work { vary drive.command.amplitude = [0.1, 0.2] rad/s; }
"""
TOLD = ("--estimate", "mass", "--estimate", "drive.kp", "--identifiable")


@pytest.mark.slow
def test_the_best_motion_of_a_sweep_is_that_of_the_least_error_and_is_run_and_written_alone(
    folder: Path, capsys: Say
) -> None:
    deck, copy = folder / "moves.ic", folder / "chosen.ic"
    deck.write_text(DECK + SWEEP)
    arguments = ["fit", str(deck), f"{folder}/log.csv", *TOLD, "--format", "json"]
    motions = ["--motion", "moves", "--write", "-o", str(copy)]
    assert cli.main([*arguments, *motions]) == cli.YES
    found = json.loads(capsys.readouterr().out)
    (chosen,), (best,) = found["chosen"], found["motions"].values()
    assert chosen["cases"] == 8 and chosen["judged"] == 7  # 0.4 rad/s at 0.5 Hz reaches 0.19 rad
    starts, worst = [each["deck"] for each in found["parameters"]], {}
    for amplitude, frequency in ((0.3, 0.5), (0.4, 1), (0.15, 0.5), (0.05, 1)):
        settings = (f"wider.command.amplitude={amplitude} rad/s", f"wider.command.frequency={frequency} Hz")
        by_hand, command = folder / "by_hand.ic", f"amplitude = {amplitude} rad/s, frequency = {frequency} Hz"
        by_hand.write_text(deck.read_text().replace("amplitude = 0.05 rad/s, frequency = 0.5 Hz", command))
        assert cli.main(["fit", str(by_hand), *arguments[2:], "--motion", "wide"]) == cli.YES
        (errors,) = json.loads(capsys.readouterr().out)["motions"].values()
        worst[settings] = max(error / start for error, start in zip(errors, starts, strict=True))
    assert tuple(chosen["set"]) == min(worst, key=lambda each: worst[each])
    largest = max(error / start for error, start in zip(best, starts, strict=True))
    assert largest == pytest.approx(min(worst.values()), 0.02)
    amplitude, frequency = (each.rpartition("=")[2] for each in chosen["set"])
    assert f"sine(amplitude = {amplitude}, frequency = {frequency})" in copy.read_text()
    settings = [word for each in chosen["set"] for word in ("--set", each)]
    assert cli.main(["run", str(deck), "wide", *settings, "-q", "--no-picture", "-o", f"{folder}/w.h5"]) == cli.YES


@pytest.mark.slow
def test_a_fit_that_leaves_most_of_what_was_measured_is_doubted(folder: Path, capsys: Say) -> None:
    arguments = ["fit", f"{folder}/deck.ic", f"{folder}/log.csv", "--estimate", "mass", "--estimate", "drive.f_c"]
    assert cli.main([*arguments, "--set", "drive.command.amplitude=0.02 rad/s", "--diff"]) == cli.NO
    said = capsys.readouterr().out
    assert "of what was measured in most channels: is the log of this run, and of an arm like this?" in said
    assert "so nothing is written into the deck" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--motion", "steps"), "`steps` varies `rates.dynamics`, which decides the program"),
        (("--motion", "masses"), "`masses` varies `mass`, which is estimated"),
        (("--motion", "far"), "no case of `far` ends within limits and requirements"),
        (("--motion", "wide", "--write"), "--identifiable writes the best motion of one sweep"),
        (("--motion", "same", "--write"), "with this motion, `work` is no longer the run of its log"),
    ],
)
def test_sweeps_that_are_no_choice_of_motions_are_refused(
    folder: Path, capsys: Say, options: tuple[str, ...], message: str
) -> None:
    deck = folder / "moves.ic"
    deck.write_text(DECK + SWEEP)
    assert cli.main(["fit", str(deck), f"{folder}/log.csv", *TOLD, *options]) == cli.BAD_INPUT
    assert message in capsys.readouterr().err


@pytest.mark.slow
def test_what_a_log_cannot_tell_is_said_and_not_written(folder: Path, capsys: Say) -> None:
    arguments = ["fit", f"{folder}/deck.ic", f"{folder}/log.csv", "--set", "duration=0.3 s"]
    tied = ["--estimate", "links.bar.mass", "--estimate", "links.bar.com.x", "--estimate", "drive.kt"]
    assert cli.main([*arguments, *tied, "--identifiable"]) == cli.NO
    said = capsys.readouterr().out
    assert "tied to others" in said and "leaves no mark in the logs: links.bar.mass by" in said
    before = (folder / "deck.ic").read_text()
    assert cli.main([*arguments[:3], *tied[:4], "--set", "duration=0.05 s", "--diff"]) == cli.NO
    said = capsys.readouterr().out
    assert "not all numbers are known, or a log is doubtful, so nothing is written into the deck" in said
    assert "longer than what is fitted" not in said  # it is longer than the run
    assert (folder / "deck.ic").read_text() == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--estimate", "ms"), "no parameter `ms`"),
        (("--estimate", "hinge.servo.command"), "`hinge.servo.command` is no number, and a fit moves numbers"),
        (("--estimate", "hinge.servo.command"), "it has `hinge.servo.command.amplitude`, `hinge.servo.command.freq"),
        (("--estimate", "drive.command"), "`drive.command` is no number"),
        (("--estimate", "hinge.servo"), "`hinge.servo` is no number"),
        (("--estimate", "environment.gravity"), "vary one of them: `environment.gravity.x`"),
        (("--estimate", "links.*.weight"), "no parameter of `work` is like `links.*.weight`"),
        (("--estimate", "links.*.weight"), "deck.ic links --run work` lists those of `links`"),
        (("--estimate", "links.*"), "a fit cannot move all that is like `links.*`: not `links.bar.com.y`"),
        (("--estimate", "links.*"), "estimate of these: links.bar.mass, links.bar.com.x, links.bar.com.z, links.bar.i"),
        (("--estimate", "duration"), "`duration` decides the program"),
        (("--estimate", "integrator"), "`integrator` is no number"),
        (("--estimate", "mass", "--prior", "mass=20"), "is not what is known of a parameter"),
        (("--estimate", "mass", "--prior", "mass=normal(20, 1) N"), "`mass` is not in N"),
        (("--estimate", "mass", "--prior", "mass=normal(20, -1) kg"), "is no distribution"),
        (("--estimate", "mass", *("--prior", "mass=normal(20, 1) kg") * 2), "`mass` has two priors"),
        (("--estimate", "links.bar.com"), "`links.bar.com`"),
        (("--estimate", "mass", "--zero", "9 s"), "has one of the run beside it"),
        (("--estimate", "mass", "--zero", "other.csv=9 s"), "`other.csv` is no log of this command"),
        (("--estimate", "mass", "--zero", "late"), "`late` is no instant"),
        (("--estimate", "delay of other.csv"), "`other.csv` is no log of this command"),
        (("--estimate", "mass", "--column", "hinge.q"), "is no column of a log for a channel"),
        (("--estimate", "mass", "--column", "hinge.w=hinge.q"), "does not record `hinge.w`"),
        (("--estimate", "mass", "--column", "time=-time"), "times of `time` would fall"),
        (("--estimate", "mass", *("--column", "hinge.q=-hinge.q") * 2), "`hinge.q` has two columns"),
        (("--estimate", "mass", "--column", "hinge.q=angle"), "has no column `angle`"),
        (("--estimate", "mass", "--column", "hinge.q=hinge.q + 1e999"), "is no column of a log for a channel"),
        (("--estimate", "mass", "--vary", "mass=[1, 2] kg"), "--vary is for sweeps"),
        (("--estimate", "mass", "--motion", "work"), "--motion is for --identifiable"),
        (("--estimate", "mass", "--identifiable", "--motion", "wok"), "no run `wok` in this deck"),
        (("--estimate", "mass", "-o", "other.ic"), "-o is the file for --write"),
    ],
)
def test_mistakes_are_refused(folder: Path, capsys: Say, options: tuple[str, ...], message: str) -> None:
    assert cli.main(["fit", f"{folder}/deck.ic", f"{folder}/log.csv", *options]) == cli.BAD_INPUT
    said = capsys.readouterr().err
    assert message in said and "(given)" not in said
