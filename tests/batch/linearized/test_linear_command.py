"""`met linear` prints poles, modes and margins; its exit status says whether opened loops are stable."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

import ic
from batch.cli.linear import linear
from batch.linearized import picture
from batch.terminal.linear import answered
from met.analysis.linear.answers import Linearized, LinearQuestion
from met.diagnostic import Problem
from tests.batch.linearized.test_linear_data import DECK
from tests.docs.mended_servo import met


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "deck.ic").write_text(DECK)
    return tmp_path


@pytest.mark.release
def test_what_is_printed_is_whole(folder: Path) -> None:
    said = met(folder, "linear", "deck.ic", "--at", "0.5 s", "--open", "hinge.servo.voltage", status=0)
    lines = said.splitlines()
    assert lines[0] == "hold: linear at t = 0.5 s, a period of 2 ms, 3 states"
    assert lines[2] == "poles of the program"
    assert lines[3].split() == ["z", "Hz", "damping", "by", "e", "in", "who", "takes", "part"]
    assert lines[4].split() == ["1.000000", "0", "-", "stays", "hinge", "100", "%", "(q)"]
    assert lines[8] == "loop of hinge.servo.voltage"
    assert [line.split()[0] for line in lines[9:]] == ["gain", "phase", "delay", "disk"]


@pytest.mark.release
def test_programs_get_the_same_as_numbers(folder: Path) -> None:
    told = json.loads(
        met(folder, "linear", "deck.ic", "--at", "0.5", "--open", "hinge.servo.voltage", "--format", "json", status=0)
    )  # fmt: skip
    assert told["states"] == ["hinge.q", "hinge.qd", "hinge.servo.integral"] and told["period"] == 0.002
    (loop,) = told["loops"]
    assert loop["stable"] and loop["gain_up"] > 1.0 and 0.0 < loop["phase"] < 3.2
    assert len(told["poles"]) == 3


@pytest.mark.release
def test_an_opened_loop_that_is_unstable_is_exit_status_1(folder: Path) -> None:
    text = DECK.replace("command = rate", "kp = 3 V*s/rad;  v_max = 1e6 V;  tau_max = 1e6 N*m;  command = rate")
    (folder / "deck.ic").write_text(text)
    said = met(folder, "linear", "deck.ic", "--open", "hinge.servo.voltage", status=1)
    assert said.endswith("loop of hinge.servo.voltage\n  unstable as it is: a pole above grows\n")


def test_a_word_that_is_no_instant_is_refused(folder: Path) -> None:
    said = CliRunner().invoke(linear, [str(folder / "deck.ic"), "--at", "2 kg"])
    assert said.exit_code == 2 and "`2 kg` is no instant: write `2 s` or `250 ms`" in said.output
    said = CliRunner().invoke(linear, [str(folder / "deck.ic"), "--at", "equilibrium"])
    assert said.exit_code == 2 and "a `linear` block of the run has `at = equilibrium;`" in said.output


OPEN = ("--open", "hinge.servo.voltage")


def swept(folder: Path) -> str:
    text = DECK.replace(
        "command = rate", "kp = 0.02 V*s/rad;  f_c = 0 N*m;  v_max = 1e6 V;  tau_max = 1e6 N*m;  command = rate"
    )
    (folder / "deck.ic").write_text(text + "sweep gains of hold { vary drive.kp = [0.02, 0.5, 2.5] V*s/rad; }\n")
    return "deck.ic"


@pytest.mark.slow
def test_all_cases_of_a_sweep_have_a_row_each_and_the_tightest_is_named(folder: Path) -> None:
    said = met(folder, "linear", swept(folder), "gains", "--all-cases", *OPEN, status=1)
    lines = said.splitlines()
    assert lines[0] == "gains: linear at t = 0 s, 3 cases" and lines[2] == "loop of hinge.servo.voltage"
    assert lines[3].split() == ["case", "drive.kp", "(V*s/rad)", "gain", "phase", "delay", "disk"]
    assert [line.split()[:2] for line in lines[4:7]] == [["#0", "0.02"], ["#1", "0.5"], ["#2", "2.5"]]
    assert lines[6].split()[-1] == "unstable" and lines[7] == "  unstable in 1 of 3 cases: #2"
    gain = float(lines[5].split()[2])
    assert lines[8].startswith(f"  tightest: gain {gain:.4g} times in #1, phase ")


@pytest.mark.release
def test_a_case_of_it_says_the_same(folder: Path) -> None:
    every = json.loads(
        met(folder, "linear", swept(folder), "gains", "--all-cases", *OPEN, "--format", "json", status=1)
    )  # fmt: skip
    one = json.loads(met(folder, "linear", "deck.ic", "gains", "--case", "#1", *OPEN, "--format", "json", status=0))
    assert every[1] == one


@pytest.mark.release
def test_a_case_of_several_says_which_it_is_also_where_none_is_asked_for(folder: Path) -> None:
    said = met(folder, "linear", swept(folder), "gains", *OPEN, status=0).splitlines()[0]
    assert said.startswith("gains, case #0 of 3: linear at t = 0 s, ")
    other = met(folder, "linear", "deck.ic", "gains", "--case", "#1", *OPEN, status=0).splitlines()[0]
    assert other == said.replace("#0", "#1")


@pytest.mark.slow
def test_what_cases_have_no_answer_is_told_below_with_the_reason_of_each(folder: Path) -> None:
    text = DECK.replace("hinge.qd = 0.1 rad/s", "hinge.q = 0 rad")
    (folder / "deck.ic").write_text(text + "sweep loads of hold { vary links.bar.mass = [1, 2] kg; }\n")
    said = met(folder, "linear", "deck.ic", "loads", "--all-cases", *OPEN, status=0)
    assert said.count("`hinge` breaks away, t = 0 s") == 2
    assert "\nno answer in 2 cases of 2\n" in said


@pytest.mark.release
def test_a_picture_of_all_cases_is_a_root_locus(folder: Path) -> None:
    path = folder / swept(folder)
    question = LinearQuestion(ic.compile(path, select=["gains"]).experiments[0], 0.0, (), (), OPEN[1:])
    found = answered(question)
    drawn = picture.locus_figure(question, [*found[:2], "`hinge` breaks away, t = 0 s"])
    z_plane, s_plane, bar = drawn.axes
    assert "3 cases, 1 of them without an answer" in drawn.get_suptitle() and bar.get_ylabel() == "drive.kp, V*s/rad"
    shown = [line.get_xydata() for line in z_plane.get_lines() if line.get_marker() == "."]
    for case, at in zip(found, shown, strict=False):
        assert isinstance(case, Linearized)
        assert at.tolist() == [[pole.z.real, pole.z.imag] for pole in case.poles]
    assert len(shown) == 2 and [line.get_marker() for line in s_plane.get_lines()].count("x") == 1
    with pytest.raises(Problem, match="E450") as refused:
        picture.locus_figure(question, ["`hinge` breaks away, t = 0 s"])
    assert refused.value.diagnostics[0].message == "there is nothing to draw: no case has an answer"
    met(folder, "linear", "deck.ic", "gains", "--all-cases", *OPEN, "--picture", "locus.svg", status=1)
    assert (folder / "locus.svg").read_text(encoding="utf-8").count("<svg") == 1


@pytest.mark.slow
def test_of_an_arm_that_does_not_move_there_is_no_root_locus() -> None:
    question = LinearQuestion(ic.compile(text=STILL, select=["heavier"]).experiments[0], 0.0, (), (), ())
    with pytest.raises(Problem, match="E450") as refused:
        picture.locus_figure(question, answered(question))
    assert refused.value.diagnostics[0].message == "there is nothing to draw: no case has a pole, for nothing moves"


STILL = """\
arm bar {
    link one { mass = 1 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = one;  axis = z; }
}
servo fixed { model = locked; }
run hold {
    arm = bar;  servos { hinge = fixed; }
    rates { dynamics = 1 kHz;  record = 100 Hz; }
    duration = 0.1 s;  record = [q];
}
sweep heavier of hold { vary links.one.mass = [1, 2] kg; }
"""


def test_a_file_is_of_one_case(folder: Path) -> None:
    said = CliRunner().invoke(linear, [str(folder / "deck.ic"), "--all-cases", "-o", "a.npz"])
    assert said.exit_code == 2 and "-o is of one case, and --all-cases of all" in said.output


@pytest.mark.slow
def test_of_a_joint_that_sticks_nothing_comes_back(folder: Path) -> None:
    text = DECK.replace("rate(0.1 rad/s)", "rate(0 rad/s)").replace("hinge.qd = 0.1 rad/s", "hinge.q = 0 rad")
    (folder / "deck.ic").write_text(text)
    said = met(folder, "linear", "deck.ic", *OPEN, status=0)
    assert said.splitlines()[1] == "  hinge sticks, and is held"
    assert said.endswith(
        "loop of hinge.servo.voltage\n"
        "  nothing comes back here: what it would move is held, or the law is at its limit\n"
    )


@pytest.mark.release
@pytest.mark.parametrize(
    ("weak", "limits"),
    [
        ("v_max = 0.001 V", "hinge.servo.v_max"),
        ("tau_max = 0.001 N*m", "hinge.servo.tau_max"),
    ],
)
def test_a_loop_at_its_limit_is_open_and_is_not_called_unstable(folder: Path, weak: str, limits: str) -> None:
    """An arm that falls from upright grows by itself, whatever the gains are."""
    text = DECK.replace("command = rate", f"ratio = 50;  f_c = 0 N*m;  {weak};  command = rate")
    upright = "environment { gravity = gravity(g = [-9.81, 0, 0] m/s^2); }"
    (folder / "deck.ic").write_text(
        text.replace("duration", f"{upright}  duration") + "sweep same of hold { vary links.bar.mass = [2, 3] kg; }\n"
    )
    said = met(folder, "linear", "deck.ic", "hold", *OPEN, "--at", "0.1 s", status=0)
    assert " grows  " in said
    assert said.endswith(
        f"loop of hinge.servo.voltage\n  nothing comes back here while at its limit: {limits}\n"
    )  # fmt: skip
    every = met(folder, "linear", "deck.ic", "same", "--all-cases", *OPEN, "--at", "0.1 s", status=0)
    assert every.count("nothing comes back") == 2 and "unstable" not in every
