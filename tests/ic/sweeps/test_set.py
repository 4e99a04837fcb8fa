"""Values set from outside of a deck, `--set PATH=VALUE`: the plan is that of the deck that says so itself."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

import ic
from ic.driver.compile import Compiled, Select
from met import cli
from met.plan import Experiment, Formula, keys
from met.plan import file as plan_file
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, messages

OTHERS = """\
let slow = 0.1 rad/s;
let times_of = [0, 1] s;
servo brisk like drive { kp = 0.3 V*s/rad; }
servo plain { model = ideal; bandwidth = 5 1/s; command = rate(slow); }
servo tabled like drive { command = rate(table(times = times_of, values = [0, 0.1] rad/s)); }
"""
PUSH = "push = wrench(link = bar, point = [1, 0, 0] m, force = [0, 1, 0] N);"
WHOLE = changed(
    RUN,
    ("arm = swing;", f"arm = swing; environment {{ {PUSH} }}"),
    ("duration", "metric top = settling_time { of = hinge.qd; target = 1 rad/s; band = 2 %; }\n    duration"),
)
ON_BED = changed(RUN, ("duration", "substitute hinge { bed = emulated(faults = typical); law = bare; } duration"))
GAINS = "sweep it of hold { vary drive.ki = [1, 2] V/rad; }\n"


def made(folder: Path, text: str, select: Select = None, settings: Sequence[str] = ()) -> tuple[Experiment, ...]:
    compiled = check(folder, text, select=select, set=settings)
    assert compiled.plan is not None, messages(compiled)
    return compiled.plan.experiments


def same(some: Sequence[Experiment], others: Sequence[Experiment]) -> bool:
    """Whether programs and cases are the same, to the bit."""
    return [(keys.structure_key(each.structure, keys.inputs(each)), keys.case_ids(each)) for each in some] == [
        (keys.structure_key(each.structure, keys.inputs(each)), keys.case_ids(each)) for each in others
    ]


def refused(folder: Path, *settings: str, text: str = ARM + SERVO + OTHERS + RUN, select: Select = None) -> str:
    compiled = check(folder, text, select=select, set=settings)
    assert compiled.plan is None
    return messages(compiled)


@pytest.mark.release
@pytest.mark.parametrize(("setting", "old", "new"), [
    ("drive.kp=0.2 V*s/rad", "kp = 0.1", "kp = 0.2"),
    ("hinge.servo.kp=0.2 V*s/rad", "hinge = drive;", "hinge = drive { kp = 0.2 V*s/rad; };"),
    ("drive.f_c=0.01 N*m", "ratio = 100;", "ratio = 100; f_c = 0.01 N*m;"),
    ("links.bar.mass=3 kg", "mass = 2 kg", "mass = 3 kg"),
    ("swing.links.bar.mass=3 kg", "mass = 2 kg", "mass = 3 kg"),
    ("links.bar.shape.length=80 cm", "length = 1 m", "length = 80 cm"),
    ("links.bar.com.x=0.4 m", "mass = 2 kg;", "mass = 2 kg; com = [0.4, 0, 0] m;"),
    ("hinge.axis.x=2", "axis = z", "axis = [2, 0, 1]"),
    ("initial.hinge.q=10 deg", "duration", "initial { q = 10 deg; } duration"),
    ("hinge.servo.command.value=-slow", "rate(0.1 rad/s)", "rate(-slow)"),
    ("drive.command=rate(step(to = slow))", "rate(0.1 rad/s)", "rate(step(to = slow))"),
    ("hinge.servo.command=torque(1 N*m)", "hinge = drive;", "hinge = drive { command = torque(1 N*m); };"),
    ("drive.rate=500 Hz", "ratio = 100;", "ratio = 100; rate = 500 Hz;"),
    ("hinge.servo=plain", "hinge = drive;", "hinge = plain;"),
    ("rates.dynamics=2 kHz", "dynamics = 1 kHz", "dynamics = 2 kHz"),
    ("duration=2 s", "duration = 1 s", "duration = 2 s"),
    ("integrator=rk4", "duration", "integrator = rk4; duration"),
    ("environment.velocity_products=off", "environment {", "environment { velocity_products = off;"),
    ("environment.push.axes=link", "link = bar,", "link = bar, axes = link,"),
    ("environment.push.force.y=2 N", "[0, 1, 0] N", "[0, 2, 0] N"),
    ("environment.pull=wrench(link = bar, force = [0, 0, 1] N, point = [1, 0, 0] m)", "[0, 1, 0] N);",
     "[0, 1, 0] N); pull = wrench(link = bar, force = [0, 0, 1] N, point = [1, 0, 0] m);"),
    ("metrics.top.band=5 %", "2 %", "5 %"),
])  # fmt: skip
def test_a_run_is_the_one_that_the_deck_would_say(setting: str, old: str, new: str, tmp_path: Path) -> None:
    text = ARM + SERVO + OTHERS + WHOLE
    (found,) = made(tmp_path, text, settings=[setting])
    assert same([found], made(tmp_path, changed(text, (old, new))))
    assert not same([found], made(tmp_path, text))
    assert not found.cases.coordinates and not any(isinstance(q.value, Formula) for q in found.parameters.values())


@pytest.mark.slow
@pytest.mark.parametrize(("setting", "old", "new"), [
    ("hinge.bed.kt=0.06 N*m/A", "emulated(", "emulated(kt = 0.06 N*m/A, "),
    ("drive.kt=0.06 N*m/A", "kt = 0.05", "kt = 0.06"),
    ("hinge.law=torque_balance", "law = bare", "law = torque_balance"),
    ("hinge.bed.faults=none", "faults = typical", "faults = none"),
    ("seed=7", "duration", "seed = 7; duration"),
])  # fmt: skip
def test_beds_laws_and_the_seed_of_noise_are_set_too(setting: str, old: str, new: str, tmp_path: Path) -> None:
    text = ARM + SERVO + ON_BED
    assert same(made(tmp_path, text, settings=[setting]), made(tmp_path, changed(text, (old, new))))


@pytest.mark.slow
@pytest.mark.parametrize(("settings", "old", "new"), [
    (["slow=0.2 rad/s"], "slow = 0.1", "slow = 0.2"),
    (["times_of=[0, 2] s", "slow=0.2 rad/s"], "slow = 0.1 rad/s;\nlet times_of = [0, 1] s",
     "slow = 0.2 rad/s;\nlet times_of = [0, 2] s"),
    (["hinge.servo.command=rate(slow)", "hinge.servo=brisk"], "run tabulated", "run unused {} run tabulated"),
])  # fmt: skip
def test_it_holds_for_all_runs_that_are_asked_for(settings: list[str], old: str, new: str, tmp_path: Path) -> None:
    text = ARM + SERVO + OTHERS + RUN + "run tabulated like hold { servos { hinge = tabled; } }\n"
    text += "run ideally like hold { servos { hinge = plain; } }\n"
    if old.startswith("slow"):
        edited = changed(text, (old, new))
    else:
        use = "hinge = brisk { command = rate(slow); };"
        edited = changed(text, ("hinge = drive;", use), ("hinge = tabled;", use), ("hinge = plain;", use))
    assert same(made(tmp_path, text, "all", settings), made(tmp_path, edited, "all"))


@pytest.mark.release
@pytest.mark.parametrize(("setting", "body", "old", "new"), [
    ("drive.kp=0.2 V*s/rad", "vary drive.ki = [1, 2] V/rad;", "kp = 0.1", "kp = 0.2"),
    ("integrator=rk4", "vary drive.ki = [1, 2] V/rad;", "duration", "integrator = rk4; duration"),
    ("hinge.servo=brisk", "vary hinge.servo.command = [rate(slow), rate(2 * slow)];", "hinge = drive", "hinge = brisk"),
    ("count=3", "vary drive.ki = linspace(1, 2, count) V/rad;", "count = 2", "count = 3"),
    ("most=1.5 V/rad", "vary drive.ki = [1, 1.6, 2] V/rad; exclude when drive.ki > most;", "1.7 V/rad", "1.5 V/rad"),
    ("slow=0.2 rad/s", "vary hinge.servo = [brisk, plain];", "slow = 0.1", "slow = 0.2"),
    ("seed=7", "sample lhs(4) { links.bar.mass = uniform(1, 2) kg; }", "duration", "seed = 7; duration"),
    ("links.bar.mass=3 kg", "vary macro FAST = [1, 2]; vary drive.ki = [1, 2] V/rad;", "mass = 2", "mass = 3"),
])  # fmt: skip
def test_a_sweep_is_the_one_that_the_deck_would_say(
    setting: str, body: str, old: str, new: str, tmp_path: Path
) -> None:
    macro = "#ifndef FAST\n#define FAST 1\n#endif\nlet count = 2;\nlet most = 1.7 V/rad;\n"
    text = macro + ARM + SERVO + OTHERS + changed(RUN, ("1 kHz", "FAST * 1 kHz")) + f"sweep it of hold {{ {body} }}\n"
    text += "sweep both = it + hold;\n"
    for asked in (["it"], ["both"]):
        found = made(tmp_path, text, asked, [setting])
        assert same(found, made(tmp_path, changed(text, (old, new)), asked))
        assert not any(setting.startswith(c.path) for each in found for c in each.cases.coordinates)


@pytest.mark.slow
def test_a_set_value_is_what_a_sweep_over_it_alone_has(tmp_path: Path) -> None:
    values = {
        "links.bar.mass": "3 kg", "links.bar.shape.length": "0.7 m", "links.bar.com.y": "0.1 m", "hinge.at.x": "1 m",
        "hinge.axis.y": "0.5", "drive.kt": "0.07 N*m/A", "hinge.servo.ratio": "50", "initial.hinge.qd": "0.1 rad/s",
    }  # fmt: skip
    text = ARM + SERVO + changed(RUN, ("[q]", "[q, energy, links.bar.position]"))
    for path, value in values.items():
        number, _, unit = value.partition(" ")
        (swept,) = made(tmp_path, text + f"sweep it of hold {{ vary {path} = [{number}] {unit}; }}\n", ["it"])
        (found,) = made(tmp_path, text, settings=[f"{path}={value}"])
        at = {coordinate.path: coordinate.values for coordinate in swept.cases.coordinates}
        outputs = swept.formulas.replay(at)
        by_case = {
            name: float(outputs[q.value.output][0]) if isinstance(q.value, Formula) else q.value
            for name, q in swept.parameters.items()
        }
        assert by_case == {name: q.value for name, q in found.parameters.items()}, path


def test_the_deck_may_lack_what_is_set(tmp_path: Path) -> None:
    text = ARM + changed(SERVO, ("kp = 0.1 V*s/rad; ", "")) + changed(RUN, ("    duration = 1 s;\n", ""))
    found = made(tmp_path, text, settings=["hinge.servo.kp=0.1 V*s/rad", "duration=1 s"])
    assert same(found, made(tmp_path, ARM + SERVO + RUN))


def test_python_takes_a_mapping_or_texts_and_the_plan_remembers_them(tmp_path: Path) -> None:
    check(tmp_path, ARM, SERVO, RUN)
    plan = ic.compile(tmp_path / "deck.ic", set={"drive.kp": "0.2 V*s/rad", "hinge.servo.ratio": 50})
    assert plan.settings == ("drive.kp=0.2 V*s/rad", "hinge.servo.ratio=50")
    assert plan == ic.compile(tmp_path / "deck.ic", set=["drive.kp=0.2 V*s/rad", "hinge.servo.ratio=50"])
    text = plan_file.dumps(plan)
    assert json.loads(text)["settings"] == list(plan.settings)
    plan_file.write(plan, tmp_path / "p.json")
    assert plan_file.read(tmp_path / "p.json").settings == plan.settings
    assert "settings" not in json.loads(plan_file.dumps(ic.compile(tmp_path / "deck.ic")))


def test_the_page_on_decks_tells_how(tmp_path: Path) -> None:
    from tests.docs.test_deck_page import PAGE, PICKER

    assert "met run picker.ic --set 'motor.kp=0.06 V*s/rad' --set integrator=rk4\n" in PAGE
    assert '`ic.compile("picker.ic", set={"motor.kp": "0.06 V*s/rad", "integrator": "rk4"})`' in PAGE
    (tmp_path / "picker.ic").write_text(PICKER, encoding="utf-8")
    plan = ic.compile(tmp_path / "picker.ic", set={"motor.kp": "0.06 V*s/rad", "integrator": "rk4"})
    (found,) = plan.experiments
    assert found.structure.integrator == "rk4"
    assert {found.parameters[f"{joint}.servo.kp"].value for joint in ("lift", "swing", "pan")} == {0.06}


# Where a value comes from


@pytest.fixture
def deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MET_DECK_PATH", raising=False)
    Path("a.ic").write_text(ARM + SERVO + OTHERS + RUN + GAINS, encoding="utf-8")
    return "a.ic"


@pytest.mark.parametrize(("path", "settings", "said"), [
    ("hinge.servo.kp", ["drive.kp=0.2 V*s/rad"], """\
hinge.servo.kp = 0.2 V*s/rad
  proportional gain Kp on the error of the motor's rate (rigid_gearbox)
 --> <command line>:1:10
  |
1 | drive.kp=0.2 V*s/rad
  |          ^^^^^^^^^^^ set on the command line
 ::: a.ic:7:18  overrides `kp = 0.1 V*s/rad`
"""),
    ("links.bar.mass", ["links.bar.mass=3 kg"], """\
links.bar.mass = 3 kg
 --> <command line>:1:16
  |
1 | links.bar.mass=3 kg
  |                ^^^^ set on the command line
 ::: a.ic:2:23  overrides `2 kg`
"""),
    ("integrator", ["duration=2 s", "integrator=rk4"], """\
integrator = rk4
 --> <command line>:2:12
  |
2 | integrator=rk4
  |            ^^^ set on the command line
"""),
    ("duration", ["duration=2 s", "integrator=rk4"], """\
duration = 2 s
 --> <command line>:1:10
  |
1 | duration=2 s
  |          ^^^ set on the command line
 ::: a.ic:20:5  overrides `duration = 1 s`
"""),
    ("slow", ["slow=2 rad/s", "hinge.servo=plain"], """\
slow = 2 rad/s
 --> <command line>:1:6
  |
1 | slow=2 rad/s
  |      ^^^^^^^ set on the command line
 ::: a.ic:11:5  overrides `slow = 0.1 rad/s`
"""),
    ("hinge.servo.command.value", ["slow=2 rad/s", "hinge.servo=plain"], """\
hinge.servo.command.value = 2 rad/s
  value of the command at all times (constant)
  --> a.ic:14:64
   |
14 | servo plain { model = ideal; bandwidth = 5 1/s; command = rate(slow); }
   |                                                                ^^^^ written here
  ::: <command line>:1:6  slow = 2 rad/s
"""),
])  # fmt: skip
def test_explain_says_that_the_command_line_set_it_and_over_what(
    path: str, settings: list[str], said: str, deck: str, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [word for setting in settings for word in ("--set", setting)]
    assert cli.main(["explain", deck, path, "--run", "hold", *options]) == 0
    assert capsys.readouterr().out == said


def test_what_is_set_stands_behind_the_macros_of_the_command_line(
    deck: str, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["-D", "ONE=1", "--set", "duration=2 s", "-D", "TWO", "--run", "hold", "--format", "json"]
    assert cli.main(["explain", deck, "duration", *options]) == 0
    (said,) = json.loads(capsys.readouterr().out)
    assert (said["origin"], said["note"], said["place"]["file"], said["place"]["line"]) == (
        "deck",
        "set on the command line",
        "<command line>",
        3,
    )
    plan = ic.compile(deck, defines=["ONE=1", "TWO"], set=["duration=2 s"], select=["hold"])
    assert plan.sources[-1].text == "ONE 1\nTWO 1\nduration=2 s\n"


@pytest.mark.slow
@pytest.mark.parametrize("words", [
    ["check", "hold.ic"], ["plan", "a.ic", "hold"], ["cases", "a.ic"], ["explain", "a.ic", "duration", "--run", "hold"],
    ["dump", "plan", "a.ic", "hold"], ["run", "a.ic", "hold", "-q", "--no-picture"], ["profile", "a.ic", "hold"],
    ["margin", "bed.ic"],
], ids=lambda words: words[0])  # fmt: skip
def test_every_command_that_takes_a_deck_takes_it(
    words: list[str], deck: str, capfd: pytest.CaptureFixture[str]
) -> None:
    Path("hold.ic").write_text(ARM + SERVO + RUN, encoding="utf-8")
    Path("bed.ic").write_text(ARM + SERVO + ON_BED, encoding="utf-8")
    assert cli.main([*words, "--set", "drive.kp=0.11 V*s/rad"]) in (cli.YES, cli.NO)
    assert cli.main([*words, "--set", "drive.kq=0.11 V*s/rad"]) == cli.BAD_INPUT
    assert "error[D141]: servo `drive`" in capfd.readouterr().err


def test_the_plan_says_what_was_set(deck: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["plan", deck, "hold", "--set", "duration=2 s", "--set", "drive.kp=0.2 V*s/rad"]) == 0
    assert capsys.readouterr().out.endswith("\n\nSet on the command line\n  duration=2 s\n  drive.kp=0.2 V*s/rad\n")


@pytest.mark.parametrize(("words", "said"), [
    (["plan", "p.json"], "--set is for decks: `p.json` is a plan, whose values are settled; "
     "`met plan DECK --set 'duration=2 s' -o p.json` makes another"),
    (["run", "a.h5"], "--set is for decks: `a.h5` is an archive, of what was run"),
    (["dump", "model", "a.ic"], "`met dump model` shows what the deck says; `met dump plan`, what --set and --vary "
     "make of it"),
])  # fmt: skip
def test_only_a_deck_takes_it(words: list[str], said: str, deck: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*words, "--set", "duration=2 s"]) == cli.BAD_INPUT
    assert capsys.readouterr().err.endswith(f"Error: {said}\n")


# What is refused


@pytest.mark.parametrize(("setting", "message", "help"), [
    ("drive.kp", "`drive.kp` is set to nothing", "write `PATH=VALUE`, such as `gearbox.kp=0.02 V*s/rad`"),
    ("drive.kp=", "`drive.kp` is set to nothing", "write `PATH=VALUE`, such as `gearbox.kp=0.02 V*s/rad`"),
    ("=3", "this sets nothing: no path stands before the `=`",
     "write `PATH=VALUE`, such as `gearbox.kp=0.02 V*s/rad`"),
    ("slow=1; times=2", "this is not one path and its value", "write `PATH=VALUE`, such as `gearbox.kp=0.02 V*s/rad`"),
    ("macro FAST=1", "this is not one path and its value", "a macro is defined by `-D NAME=VALUE`"),
])  # fmt: skip
def test_what_sets_nothing_is_refused(setting: str, message: str, help: str, tmp_path: Path) -> None:
    assert refused(tmp_path, setting) == (
        f"error[D231]: {message}\n --> <command line>:1:1\n  |\n1 | {setting}\n  | {'^' * len(setting)}\n"
        f"  = help: {help}\n\n1 error\n"
    )


def test_a_value_that_cannot_be_read_is_told_as_a_decks_is(tmp_path: Path) -> None:
    assert (
        refused(tmp_path, "slow=1 rad/s", "duration=3 kg kg", "drive.kp=(1 +")
        == """\
error[D030]: units are multiplied with `*`
 --> <command line>:2:15
  |
2 | duration=3 kg kg
  |               ^^
  = help: write `kg*kg`

error[D020]: expected a value, found the end of the line
 --> <command line>:3:14
  |
3 | drive.kp=(1 +
  |              ^

2 errors
"""
    )


def test_a_path_is_set_once(tmp_path: Path) -> None:
    assert (
        refused(tmp_path, "drive.kp=0.2 V*s/rad", "drive.kp=0.3 V*s/rad")
        == """\
error[D232]: `drive.kp` is set twice
 --> <command line>:2:1
  |
2 | drive.kp=0.3 V*s/rad
  | ^^^^^^^^
  = help: leave one of the two out

1 error
"""
    )


def test_two_paths_to_one_parameter_are_told(tmp_path: Path) -> None:
    assert (
        refused(tmp_path, "drive.kp=0.2 V*s/rad", "hinge.servo.kp=0.3 V*s/rad")
        == """\
error[D232]: this sets `hinge.servo.kp`, which is set already
 --> <command line>:2:16
  |
2 | hinge.servo.kp=0.3 V*s/rad
  |                ^^^^^^^^^^^
 ::: <command line>:1:10  here
  = help: leave one of the two out

1 error
"""
    )


def test_a_part_of_what_a_sweep_varies_is_not_set(tmp_path: Path) -> None:
    assert (
        refused(tmp_path, "hinge.servo.ki=3 V/rad", text=ARM + SERVO + RUN + GAINS, select=["it"])
        == """\
error[D233]: this sets `hinge.servo.ki`, which the sweep varies
 --> <command line>:1:16
  |
1 | hinge.servo.ki=3 V/rad
  |                ^^^^^^^
 ::: deck.ic:18:25  `drive.ki` varies here
  = help: leave it out here, or name runs and sweeps that do not vary this

1 error
"""
    )


@pytest.mark.parametrize(("setting", "body", "said"), [
    ("drive.ki=3 V/rad", "vary hinge.servo.ki = [1, 2] V/rad;", "this sets `hinge.servo.ki`, which the sweep varies"),
    ("hinge.servo.command=rate(slow)", "vary hinge.servo = [drive, plain];",
     "this sets `hinge.servo.command`, which the sweep varies"),
    ("links.bar.mass=3 kg", "sample lhs(4) { swing.links.bar.mass = uniform(1, 2) kg; }",
     "this sets `links.bar.mass`, which the sweep varies"),
])  # fmt: skip
def test_however_a_sweep_varies_it(setting: str, body: str, said: str, tmp_path: Path) -> None:
    text = ARM + SERVO + OTHERS + RUN + f"sweep it of hold {{ {body} }}\n"
    assert refused(tmp_path, setting, text=text, select=["it"]).startswith(f"error[D233]: {said}\n")


@pytest.mark.slow
@pytest.mark.parametrize(("settings", "body", "rest"), [
    (["drive.ki=3 V/rad"], "vary drive.ki = [1, 2] V/rad; vary drive.kp = [0.1, 0.2] V*s/rad;",
     "vary drive.kp = [0.1, 0.2] V*s/rad;"),
    (["links.bar.mass=3 kg"], "zip { links.bar.mass = [1, 2] kg; drive.ki = [1, 2] V/rad; }",
     "vary drive.ki = [1, 2] V/rad;"),
    (["links.bar.mass=3 kg"], "zip { links.bar.mass = [1, 2, 2] kg; drive.ki = [1, 1, 2] V/rad; }",
     "vary drive.ki = [1, 2] V/rad;"),
    (["integrator=rk4"], "vary integrator = [rk4, midpoint]; vary drive.ki = [1, 2] V/rad;",
     "vary drive.ki = [1, 2] V/rad;"),
    (["seed=3"], "sample random(4) { links.bar.mass = uniform(1, 2) kg; } seed = 4;",
     "sample random(4) { links.bar.mass = uniform(1, 2) kg; } seed = 3;"),
])  # fmt: skip
def test_what_is_set_no_longer_varies(settings: list[str], body: str, rest: str, tmp_path: Path) -> None:
    head = ARM + SERVO + OTHERS + RUN
    wanted = made(tmp_path, f"{head}sweep it of hold {{ {rest} }}\n", ["it"], settings)
    assert same(made(tmp_path, f"{head}sweep it of hold {{ {body} }}\n", ["it"], settings), wanted)


def test_what_is_drawn_beside_it_stays_what_it_was(tmp_path: Path) -> None:
    text = (
        ARM
        + SERVO
        + RUN
        + (
            "sweep it of hold { sample random(9) { "
            "links.bar.mass = uniform(1, 2) kg; drive.ki = uniform(1, 2) V/rad; } }\n"
        )
    )
    [whole], [fixed] = (made(tmp_path, text, ["it"], settings) for settings in ([], ["links.bar.mass=3 kg"]))
    before = {each.path: each.values.tolist() for each in whole.cases.coordinates}
    assert {each.path: each.values.tolist() for each in fixed.cases.coordinates} == {"drive.ki": before["drive.ki"]}


def test_a_sweep_of_which_all_is_set_is_one_case(tmp_path: Path) -> None:
    [one] = made(tmp_path, ARM + SERVO + RUN + GAINS, ["it"], ["drive.ki=3 V/rad"])
    assert one.cases.count == 1 and not one.cases.coordinates


def test_a_path_that_no_run_has_is_told_with_the_one_that_was_meant(tmp_path: Path) -> None:
    assert (
        refused(tmp_path, "links.bra.mass=3 kg", "integratr=rk4", "FAST=1", "hinge.law=bare")
        == """\
error[D234]: nothing in `hold` is called `links.bra.mass`
 --> <command line>:1:1
  |
1 | links.bra.mass=3 kg
  | ^^^^^^^^^^^^^^
  = help: did you mean `links.bar.mass`?

error[D234]: nothing in `hold` is called `integratr`
 --> <command line>:2:1
  |
2 | integratr=rk4
  | ^^^^^^^^^
  = help: did you mean `integrator`?

error[D234]: nothing in `hold` is called `FAST`
 --> <command line>:3:1
  |
3 | FAST=1
  | ^^^^
  = help: a macro is defined by `-D FAST=VALUE`
  = help: paths begin with: links, swing, hinge, drive, initial

error[D234]: nothing in `hold` is called `hinge.law`
 --> <command line>:4:1
  |
4 | hinge.law=bare
  | ^^^^^^^^^
  = help: its motor is on no bed there: `substitute hinge { }` puts it on one

4 errors
"""
    )


@pytest.mark.parametrize(("setting", "helps"), [
    ("links.bar.com=[0, 0, 1] m", "it is made of 3 numbers; set one of them: "
     "`links.bar.com.x`, `links.bar.com.y`, `links.bar.com.z`"),
    ("links.bar.shape.along=y",
     "it is a word: write a name in its place in the deck, and give its value by `-D NAME=VALUE`"),
    ("links.bar.shape=sphere(radius = 1 m)", "set one of: links.bar.shape.length"),
    ("record=[q, qd]", "one value is set, not a block or a list: such as `rates.dynamics=1 kHz`"),
    ("environment=off", "one value is set, not a block or a list: such as `rates.dynamics=1 kHz`"),
])  # fmt: skip
def test_what_cannot_be_set_is_told_with_what_can(setting: str, helps: str, tmp_path: Path) -> None:
    path = setting.partition("=")[0]
    assert refused(tmp_path, setting) == (
        f"error[D235]: `{path}` cannot be set\n --> <command line>:1:1\n  |\n1 | {setting}\n  | {'^' * len(path)}\n"
        f"  = help: {helps}\n\n1 error\n"
    )


def test_what_is_no_number_is_given_by_a_macro_as_the_message_says(tmp_path: Path) -> None:
    text = ARM + SERVO + OTHERS + RUN
    for key, value in (("parent", "base"), ("along", "x")):
        other = changed(text, (f"{key} = {value}", f"{key} = CHOICE"))
        compiled = check(tmp_path, other, defines=[f"CHOICE={value}"])
        assert compiled.plan is not None, messages(compiled)
        assert same(compiled.plan.experiments, made(tmp_path, text))


def test_what_changes_nothing_in_any_run_that_is_asked_for_is_told(tmp_path: Path) -> None:
    assert (
        refused(tmp_path, "slow=1 rad/s", "brisk.kp=1 V*s/rad", "hinge.at.x=1 m", "seed=3")
        == """\
error[D236]: `slow` changes nothing in `hold`
 --> <command line>:1:1
  |
1 | slow=1 rad/s
  | ^^^^
 ::: deck.ic:11:5  defined here
  = help: nothing that is computed depends on it: leave it out, or name a run that uses it

1 error
"""
    )
    for setting in ("brisk.kp=1 V*s/rad", "brisk.rate=1 kHz", "hinge.at.x=1 m", "seed=3", "times_of=[0, 2] s"):
        assert refused(tmp_path, setting).startswith(
            f"error[D236]: `{setting.partition('=')[0]}` changes nothing in `hold`\n"
        )


def test_a_let_that_is_overridden_by_what_varies_changes_nothing(tmp_path: Path) -> None:
    text = "let gain = 1 V/rad;\n" + ARM + changed(SERVO, ("ki = 1 V/rad", "ki = gain")) + RUN + GAINS
    made(tmp_path, text, ["hold"], ["gain=2 V/rad"])
    said = refused(tmp_path, "gain=2 V/rad", text=text, select=["it"])
    assert said.startswith("error[D236]: `gain` changes nothing in `it`\n")


def test_the_decks_own_value_may_be_set(tmp_path: Path) -> None:
    text = ARM + SERVO + OTHERS + RUN
    settings = ["drive.kp=0.1 V*s/rad", "duration=1 s", "integrator=modified_euler", "hinge.servo=drive"]
    assert same(made(tmp_path, text, settings=settings), made(tmp_path, text))


@pytest.mark.parametrize(("setting", "said"), [
    ("slow=2", "error[D060]: `slow` is in rad/s, and this is a bare number\n"
     " --> <command line>:1:6\n  |\n1 | slow=2\n  |      ^\n ::: deck.ic:11:5  defined here\n"
     "  = help: write `2 rad/s`\n\n1 error\n"),
    ("slow=2 kg", "error[D061]: `slow` is in rad/s, and this is in kg\n"
     " --> <command line>:1:6\n  |\n1 | slow=2 kg\n  |      ^^^^\n ::: deck.ic:11:5  defined here\n"
     "  = help: write it in rad/s, deg/s or rpm\n\n1 error\n"),
    ("links.bar.mass=2 m", "error[D061]: `mass` of link `bar` is in kg, and this is in m\n"
     " --> <command line>:1:16\n  |\n1 | links.bar.mass=2 m\n  |                ^^^\n"
     "  = help: write it in kg, g, t or mg\n\n1 error\n"),
    ("links.bar.mass=-2 kg", "error[D077]: `mass` of link `bar` must be at least 0 kg\n"
     " --> <command line>:1:16\n  |\n1 | links.bar.mass=-2 kg\n  |                ^^^^^ this is -2 kg\n"
     "  = help: write a number of at least 0 kg (mass of the link)\n\n1 error\n"),
    ("links.bar.mass=[2] kg", "error[D071]: `links.bar.mass` is one number, and this is a list\n"
     " --> <command line>:1:16\n  |\n1 | links.bar.mass=[2] kg\n  |                ^^^\n"
     "  = help: leave the brackets out\n\n1 error\n"),
    ("integrator=rk5", "error[D140]: no integrator model `rk5`\n"
     " --> <command line>:1:12\n  |\n1 | integrator=rk5\n  |            ^^^\n  = help: did you mean `rk4`?\n"
     "  = help: integrator models: midpoint, modified_euler, rk4, semi_implicit_euler\n\n1 error\n"),
])  # fmt: skip
def test_a_wrong_value_is_told_at_the_command_line(setting: str, said: str, tmp_path: Path) -> None:
    assert refused(tmp_path, setting) == said


def test_it_is_told_once_in_however_many_structures(tmp_path: Path) -> None:
    text = ARM + SERVO + OTHERS + RUN + "sweep it of hold { vary integrator = [rk4, midpoint]; }\n"
    compiled: Compiled = check(tmp_path, text, select="all", set=["drive.kp=2 V"])
    assert [diagnostic.code for diagnostic in compiled.diagnostics] == ["D061"]
