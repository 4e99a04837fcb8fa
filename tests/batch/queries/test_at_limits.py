"""Limits in an archive: what is said of the time at them, of requirements judged there, and of joints beyond theirs."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.summary import summarise
from batch.queries.warnings import campaign_warnings
from batch.report.contents.gathering import gather
from batch.report.html.page import page
from batch.terminal.show import show
from met import run as engine
from met.cli import main
from met.diagnostic import Diagnostic, Problem
from met.plan import Plan

DECK = """\
arm bar {
    link boom { mass = 3 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = boom; axis = z; }
}
servo drive {
    model = rigid_gearbox;  ratio = 10;  kp = 1 V*s/rad;  ki = 0 V/rad;  v_max = 1000 V;  resistance = 1 ohm;
    kt = 0.1 N*m/A;  tau_max = 0.5 N*m;  j_m = 0.01 kg*m^2;
}
run it {
    arm = bar;
    servos { hinge = drive { command = torque(table(times = [0, 0.5, 0.501, 2] s, values = [10, 10, 1, 1] N*m)); } }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 2 s;  record = [q, qd];
    metric pull = peak { of = hinge.tau; }
    require pull < 100 N*m;
}
sweep motors of it { vary drive.tau_max = [0.2, 0.5, 2] N*m; }
run allowed like it { allow D344 because "the motor is what it is"; }
run coasting {
    arm = bar;  initial { hinge.qd = 1 rad/s; }
    rates { dynamics = 1 kHz;  record = 100 Hz; }  duration = 2 s;  record = [q];
}
arm short like bar { hinge { q_min = -1 rad;  q_max = 1.5 rad;  qd_max = 0.5 rad/s; } }
run beyond like coasting { arm = short; }
sweep ranges of beyond { vary hinge.q_max = [1, 3] rad; }
run judged like beyond { metric room = min { of = limits.margin; }  require room > 0; }
"""


def made(folder: Path, run: str, verify: str = "none") -> tuple[Path, Plan]:
    plan = ic.compile(text=DECK, select=[run])
    return batch.run(plan, output=folder / "a.h5", verify=verify).path, plan  # type: ignore[arg-type]


def warned(path: Path, plan: Plan) -> list[Diagnostic]:
    with ArchiveFile(path) as file:
        return campaign_warnings(file.groups, {each.name: each for each in plan.experiments})


@pytest.mark.slow
def test_a_requirement_whose_extreme_fell_at_a_limit_is_warned_of_with_both_places(tmp_path: Path) -> None:
    [found] = warned(*made(tmp_path, "it"))
    assert (found.code, found.severity) == ("D344", "warning")
    assert found.message == (
        "the peak of hinge.tau that `require pull < 100 N*m` judges fell while `hinge.servo.tau_max` was reached"
    )
    assert found.at is not None and found.at.place.line == 15
    assert [(label.place.line, label.text) for label in found.also] == [(7, "the limit")]
    assert found.help == ("raise `hinge.servo.tau_max`, or ask for a motion that does not come to it",)


@pytest.mark.slow
def test_of_a_campaign_there_is_one_warning_with_the_count_and_the_worst_case(tmp_path: Path) -> None:
    """10 N m at the joint are 1 N m at the motor: two of three motors are too weak."""
    path, plan = made(tmp_path, "motors")
    [found] = warned(path, plan)
    assert found.message.endswith("was reached, in 2 of 3 cases, worst in #1")
    with ArchiveFile(path) as file:
        [summary] = summarise(file)
    [at_limit] = [each for each in summary.limits if each.limit == "hinge.servo.tau_max"]
    assert (at_limit.cases, at_limit.row) == (2, 0)
    assert at_limit.largest == pytest.approx(0.25, abs=0.0006)  # until 0.501 s, the least steep part of the table


@pytest.mark.slow
def test_a_report_says_it_beside_the_verdict_with_its_line_and_what_to_do(tmp_path: Path) -> None:
    path, _ = made(tmp_path, "it")
    with ArchiveFile(path) as file:
        report = gather(file)
    [[said]] = [verdict.warnings for verdict in report.verdicts]
    assert (said.code, said.help) == (
        "D344",
        ("raise `hinge.servo.tau_max`, or ask for a motion that does not come to it",),
    )
    assert said.spot is not None and said.spot.line == 15
    html = page(report)
    beside = html[html.index('id="verdict"') : html.index("What was run</h2>")]
    assert "Warning D344" in beside and "was reached.</p>" in beside and 'href="#f0-15"' in beside
    path, _ = made(tmp_path, "allowed")
    with ArchiveFile(path) as file:
        assert gather(file).verdicts[0].warnings == ()


@pytest.mark.slow
def test_what_a_run_allows_is_not_warned_of(tmp_path: Path) -> None:
    assert warned(*made(tmp_path, "allowed")) == []


@pytest.mark.slow
def test_a_joint_beyond_its_limits_is_warned_of_once_with_what_else_is_passed(tmp_path: Path) -> None:
    """From 0 at 1 rad/s for 2 s, beyond 1.5 rad by 0.5 rad in the end, and 0.5 rad/s too fast all the time."""
    path, plan = made(tmp_path, "beyond")
    [found] = warned(path, plan)
    assert found.code == "D345" and found.at is not None and found.at.place.line == 23
    assert found.message.startswith("joint `hinge` passes its limit `q_max` by 0.5 rad, for 2")
    assert found.help[1] == "also passed: `hinge.qd_max`"
    data = batch.open(path)
    assert data["excess.hinge.q_max"].values[0] == pytest.approx(0.5, abs=1e-9)
    assert data["excess.hinge.q_max"].attrs["units"] == "rad"
    assert data["excess.hinge.qd_max"].values.tolist() == [0.5]
    assert data["excess.hinge.q_min"].values.tolist() == [0.0]
    assert data["at_limit.hinge.q_max"].values[0] == pytest.approx(0.25, abs=0.0006)
    assert data["at_limit.hinge.qd_max"].values.tolist() == [1.0]


@pytest.mark.slow
def test_limits_may_vary(tmp_path: Path) -> None:
    path, _ = made(tmp_path, "ranges")
    assert batch.open(path)["excess.hinge.q_max"].values.tolist() == pytest.approx([1.0, 0.0], abs=1e-9)


@pytest.mark.slow
def test_what_a_requirement_judges_is_not_warned_of_besides(tmp_path: Path) -> None:
    path, plan = made(tmp_path, "judged")
    assert warned(path, plan) == []
    data = batch.open(path)
    assert data["room"].values[0] == pytest.approx(-1.0)  # 0.5 rad/s beyond 0.5 rad/s
    assert data["met"].values.tolist() == [[0]]


@pytest.mark.slow
def test_cases_that_are_at_a_limit_for_most_of_the_time_are_counted(tmp_path: Path) -> None:
    asked = DECK.replace("times = [0, 0.5, 0.501, 2] s", "times = [0, 1.5, 1.501, 2] s")
    path = batch.run(ic.compile(text=asked, select=["motors"]), output=tmp_path / "a.h5", verify="none").path
    with ArchiveFile(path) as file:
        [said] = [line for line in show(file).splitlines() if "share of the time at hinge" in line]
    assert said.endswith(" % at most, in #0; not 0 in 2 of 3 cases, more than half in 2")


@pytest.mark.slow
def test_show_and_its_json_list_the_limits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, _ = made(tmp_path, "motors")
    with ArchiveFile(path) as file:
        lines = show(file).splitlines()
    [said] = [line for line in lines if "share of the time at hinge" in line]  # to v_max no case came
    assert said.startswith("  share of the time at hinge.servo.tau_max: 25") and said.endswith(
        " % at most, in #0; not 0 in 2 of 3 cases"
    )
    assert main(["show", str(path), "--format", "json"]) == 0
    data = json.loads(capsys.readouterr().out)["experiments"][0]
    assert [each["limit"] for each in data["limits"]] == [
        "hinge.servo.v_max",
        "hinge.servo.tau_max",
        "hinge.servo.command.times",
    ]
    assert [each["code"] for each in data["warnings"]] == ["D344"]


@pytest.mark.slow
def test_an_archive_with_a_number_of_a_limit_that_is_none_is_refused(tmp_path: Path) -> None:
    path, _ = made(tmp_path, "it")
    with h5py.File(path, "r+") as file:
        file["extreme_at.pull"][...] = 9
    with pytest.raises(Problem, match="E302"), ArchiveFile(path) as file:
        summarise(file)


@pytest.mark.slow
@pytest.mark.parametrize("deck", ["two_link", "panda", "puma_560", "manutec_r3", "stanford_arm", "shuttle_arm"])
def test_no_shipped_deck_is_warned_of(deck: str) -> None:
    for experiment in ic.compile(f"{deck}.ic").experiments:
        found = engine.run(experiment, record=False)
        assert not any(np.any(number) for number in found.extreme_at.values())
        assert not any(np.any(excess) for excess in found.excess.values())
