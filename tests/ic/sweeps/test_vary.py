"""Sweeps that a command line asks for, `--vary PATH=VALUES`: the plan is that of a deck with such a sweep."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from pathlib import Path

import pytest

import batch
import ic
from ic.driver.compile import Select
from met import cli
from met.plan import Experiment, Plan, keys
from met.plan import file as plan_file
from tests.ic.small_decks import ARM, RUN, SERVO, check, messages

LET = "let long = 1 m;\n"
DECK = LET + ARM.replace("length = 1 m", "length = long") + SERVO + RUN
BUILT = """\
#ifndef MASS
#define MASS 2
#endif
""" + DECK.replace("mass = 2 kg", "mass = MASS * 1 kg")
TWO = "sweep gains of hold { vary drive.kp = [1, 2] V*s/rad; }\nrun longer like hold { duration = 2 s; }\n"


@pytest.fixture
def deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("deck.ic").write_text(DECK, encoding="utf-8")
    return "deck.ic"


def plan(folder: Path, text: str, select: Select = ("hold",), **options: object) -> Plan:
    compiled = check(folder, text, select=select, **options)
    assert compiled.plan is not None, messages(compiled)
    return compiled.plan


def same(some: Sequence[Experiment], others: Sequence[Experiment]) -> bool:
    """Whether programs and cases are the same, to the bit."""
    return [(keys.structure_key(each.structure, keys.inputs(each)), keys.case_ids(each)) for each in some] == [
        (keys.structure_key(each.structure, keys.inputs(each)), keys.case_ids(each)) for each in others
    ]


def refused(folder: Path, *vary: str, text: str = DECK, select: Select = None, **options: object) -> str:
    compiled = check(folder, text, select=select, vary=vary, **options)
    assert compiled.plan is None
    return messages(compiled)


@pytest.mark.slow
@pytest.mark.parametrize(("vary", "body"), [
    (["drive.kp=0.1..0.4 by 0.1 V*s/rad"], "vary drive.kp = (0.1 .. 0.4 by 0.1) V*s/rad;"),
    (["drive.kp=linspace(0.1, 0.4, 4) V*s/rad"], "vary drive.kp = linspace(0.1, 0.4, 4) V*s/rad;"),
    (["drive.kp=[0.1 V*s/rad, 0.2 V*s/rad]", "links.bar.mass=[1, 2] kg"],
     "vary drive.kp = [0.1, 0.2] V*s/rad; vary links.bar.mass = [1, 2] kg;"),
    (["integrator=[rk4, midpoint]", "long=[1, 2] m"], "vary integrator = [rk4, midpoint]; vary long = [1, 2] m;"),
    (["hinge.servo.command=[rate(1 rad/s), torque(1 N*m)]"],
     "vary hinge.servo.command = [rate(1 rad/s), torque(1 N*m)];"),
    (["macro MASS=[1, 3]", "drive.ki=[1, 2] V/rad"], "vary macro MASS = [1, 3]; vary drive.ki = [1, 2] V/rad;"),
])  # fmt: skip
def test_cases_are_those_of_a_sweep_in_the_deck(vary: list[str], body: str, tmp_path: Path) -> None:
    found = plan(tmp_path, BUILT, vary=vary)
    assert {each.name_in_deck for each in found.experiments} == {"hold_varied"}
    assert found.selected == ("hold_varied",)
    assert found.settings == tuple(f"vary {each}" for each in vary)
    written = plan(tmp_path, f"{BUILT}sweep it of hold {{ {body} }}", ("it",))
    assert same(found.experiments, written.experiments)


def test_the_run_is_the_one_that_is_taken_without_a_name(tmp_path: Path) -> None:
    text = DECK + TWO.replace("run longer", "default run longer")
    (made,) = plan(tmp_path, text, None, vary=["drive.kp=[1, 2] V*s/rad"]).experiments
    assert made.name == "longer_varied"
    assert made.structure.schedule.duration == 2.0


@pytest.mark.parametrize("mark", ["", "default "])
def test_the_only_run_is_taken_beside_sweeps_of_it(mark: str, tmp_path: Path) -> None:
    text = f"{DECK}{mark}sweep gains of hold {{ vary drive.kp = [1, 2] V*s/rad; }}\n"
    assert [each.name for each in plan(tmp_path, text, None, vary=["long=[1, 2] m"]).experiments] == ["hold_varied"]


def test_met_check_takes_no_name_and_says_what_does(deck: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path(deck).write_text(DECK + TWO, encoding="utf-8")
    assert cli.main(["check", deck, "--vary", "long=[1, 2] m"]) == cli.BAD_INPUT
    assert (
        capsys.readouterr().err
        == """\
error[D162]: this deck has 2 runs, and none is marked `default`
::: deck.ic:12:1  hold
::: deck.ic:20:1  longer
 = help: name one: hold, longer
 = help: or write `default run ...` for one of them
 = help: `met check` takes no name: `met cases DECK NAME --vary ...` does, and says what is wrong

1 error
"""
    )


def test_all_that_is_set_holds_in_the_sweep_too(tmp_path: Path) -> None:
    found = plan(tmp_path, DECK, vary=["drive.kp=[0.2, 0.3] V*s/rad"], set=["drive.ki=2 V/rad", "duration=2 s"])
    text = DECK.replace("ki = 1", "ki = 2").replace("duration = 1 s", "duration = 2 s")
    assert same(found.experiments, plan(tmp_path, text, vary=["drive.kp=[0.2, 0.3] V*s/rad"]).experiments)


def test_a_name_that_the_deck_has_is_not_taken(tmp_path: Path) -> None:
    text = DECK + "run hold_varied like hold {}\n"
    assert plan(tmp_path, text, vary=["long=[1, 2] m"]).experiments[0].name == "hold_varied_2"


def test_values_may_come_from_python(tmp_path: Path) -> None:
    vary = {"drive.kp": ["0.2 V*s/rad", "0.3 V*s/rad"], "drive.ratio": (50, 100)}
    text = "sweep it of hold { vary drive.kp = [0.2, 0.3] V*s/rad; vary drive.ratio = [50, 100]; }"
    found = ic.compile(text=DECK, vary=vary)
    assert same(found.experiments, plan(tmp_path, DECK + text, ("it",)).experiments)


@pytest.mark.slow
def test_batch_runs_it(deck: str) -> None:
    made = batch.run(deck, experiments=["hold"], vary={"long": "[1, 2] m"}, set={"duration": "0.5 s"}, verify="none")
    assert made.path == Path("deck.hold_varied.h5")
    assert made.open()["long"].values.tolist() == [1.0, 2.0]
    with pytest.raises(TypeError, match="are of decks"):
        batch.run(ic.compile(deck), vary=["long=[1, 2] m"])


@pytest.mark.slow
@pytest.mark.parametrize("words", [
    ["check", "deck.ic"],
    ["cases", "deck.ic"],
    ["cases", "deck.ic", "hold"],
    ["plan", "deck.ic", "hold"],
    ["plan", "deck.ic", "-o", "p.json"],
    ["explain", "deck.ic", "hinge.servo.kp"],
    ["run", "deck.ic", "hold", "--no-picture", "--verify", "none"],
    ["profile", "deck.ic", "hold"],
    ["linear", "deck.ic", "hold", "--at", "0.1"],
], ids=lambda words: "-".join(words[:1]))  # fmt: skip
def test_every_command_that_takes_a_deck_takes_it(
    words: list[str], deck: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([*words, "--vary", "drive.kp=0.1..0.3 by 0.1 V*s/rad"]) in (cli.YES, cli.NO)
    assert cli.main([*words, "--vary", "drive.kq=[1, 2] V*s/rad"]) == cli.BAD_INPUT
    assert "`drive.kq`" in capfd.readouterr().err


@pytest.mark.slow
def test_the_archive_is_named_after_the_sweep_and_its_commands_work(
    deck: str, capsys: pytest.CaptureFixture[str]
) -> None:
    metric = "metric top = max { of = hinge.qd; } require top < 1 rad/s; }"
    Path(deck).write_text(DECK.replace("record = [q];\n}", f"record = [q]; {metric}"), encoding="utf-8")
    words = ["--vary", "drive.kp=[0.1, 0.2] V*s/rad", "--vary", "links.bar.mass=[1, 2] kg"]
    assert cli.main(["run", deck, "hold", "--no-picture", *words, "--set", "drive.ki=2 V/rad"]) == cli.YES
    assert Path("deck.hold_varied.h5").is_file()
    lead = re.findall(r"met (show .*)$", capsys.readouterr().out, re.MULTILINE)
    assert len(lead) == 2
    assert cli.main(["best", "deck.hold_varied.h5"]) == cli.YES
    (command,) = re.findall(r"met (run .*)$", capsys.readouterr().out, re.MULTILINE)
    options = r"--set 'drive.ki=2 V/rad' --vary 'links.bar.mass=\[1, 2\] kg' --set 'drive.kp=0.[12] V\*s/rad'"
    assert re.fullmatch(f"run deck.ic hold {options} -o chosen.h5", command)
    for each in [*lead, f"{command} --no-picture"]:
        assert cli.main(shlex.split(each)) == cli.YES
    assert batch.open("chosen.h5").sizes["case"] == 2


def test_a_plan_file_holds_it(deck: str) -> None:
    assert cli.main(["plan", deck, "--vary", "long=[1, 2] m", "-o", "p.json", "-q"]) == cli.YES
    assert plan_file.read("p.json").settings == ("vary long=[1, 2] m",)
    assert cli.main(["run", "p.json", "hold_varied", "--no-picture", "-q", "--verify", "none"]) == cli.YES


# What is refused


def test_a_mistake_is_shown_in_the_text_of_the_option(tmp_path: Path) -> None:
    assert refused(tmp_path, "drive.kp=[0.1, 0.2] V/rad", set=["drive.ki=2 V/rad"]) == (
        """\
error[D061]: `kp` of servo `drive` is in V*s/rad, and this is in V/rad
 --> <command line>:2:16
  |
2 | vary drive.kp=[0.1, 0.2] V/rad
  |                ^^^
  = help: write it in V*s/rad

1 error
"""
    )


@pytest.mark.parametrize(("vary", "select", "message"), [
    (["long=[1, 2] m"], ["gains"], """\
error[D288]: `--vary` varies a run, and `gains` is a sweep
 --> <command line>:1:1
  |
1 | vary long=[1, 2] m
  | ^^^^^^^^^
 ::: deck.ic:19:1  defined here
  = help: name the run that it is of: `hold`
"""),
    (["long=[1, 2] m"], ["hold", "longer"], """\
error[D288]: `--vary` varies one run, and 2 are asked for
 --> <command line>:1:1
  |
1 | vary long=[1, 2] m
  | ^^^^^^^^^
 ::: deck.ic:12:1  `hold`
 ::: deck.ic:20:1  `longer`
  = help: name one: hold, longer
"""),
    (["long=[1, 2] m", "long=[3, 4] m"], ["hold"], """\
error[D232]: `long` is varied twice
 --> <command line>:2:1
  |
2 | vary long=[3, 4] m
  | ^^^^^^^^^
  = help: leave one of the two out
"""),
    (["long=2 m"], ["hold"], """\
error[D126]: `long` varies over a list of values, and this is one value
 --> <command line>:1:11
  |
1 | vary long=2 m
  |           ^^^
  = help: write `[a, b, c] UNIT`, `(a .. b by c) UNIT` or `linspace(from, to, count) UNIT`
  = help: one value that stands still belongs in the run
"""),
    (["long"], ["hold"], """\
error[D231]: `long` varies over nothing
 --> <command line>:1:1
  |
1 | vary long
  | ^^^^^^^^^
  = help: write `PATH=VALUES`, such as `gearbox.kp=[0.01, 0.02] V*s/rad` or `gearbox.kp=0.1..0.5 by 0.1 V*s/rad`
"""),
    (["vary long=[1, 2] m"], ["hold"], """\
error[D231]: this is not one path and its values
 --> <command line>:1:1
  |
1 | vary vary long=[1, 2] m
  | ^^^^^^^^^^^^^^^^^^^^^^^
  = help: leave out the word `vary`: `--vary` says it
"""),
])  # fmt: skip
def test_what_cannot_be_varied_is_refused(vary: list[str], select: list[str], message: str, tmp_path: Path) -> None:
    assert refused(tmp_path, *vary, text=DECK + TWO, select=select) == f"{message}\n1 error\n"


def test_set_varies_nothing(deck: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["check", deck, "--set", "vary long=[1, 2] m"]) == cli.BAD_INPUT
    assert (
        capsys.readouterr().err
        == """\
error[D231]: this is not one path and its value
 --> <command line>:1:1
  |
1 |  vary long=[1, 2] m
  | ^^^^^^^^^^^^^^^^^^^
  = help: `--vary PATH=VALUES` varies a path

1 error
"""
    )


def test_what_is_set_does_not_vary_besides(tmp_path: Path) -> None:
    said = refused(tmp_path, "long=[1, 2] m", set=["long=3 m"])
    assert said.startswith("error[D232]: `long` is set, and varied\n --> <command line>:2:1\n")


@pytest.mark.parametrize(("words", "said"), [
    (["plan", "p.json"], "--vary is for decks: `p.json` is a plan, whose cases are listed; "
     "`met plan DECK --vary 'long=[1, 2] m' -o p.json` makes another"),
    (["run", "a.h5"], "--vary is for decks: `a.h5` is an archive, of what was run"),
    (["run", "deck.ic", "--all"], "--vary is of one run, and --all of all: name the run"),
])  # fmt: skip
def test_only_one_run_of_a_deck_takes_it(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*words, "--vary", "long=[1, 2] m"]) == cli.BAD_INPUT
    assert capsys.readouterr().err.endswith(f"Error: {said}\n")
