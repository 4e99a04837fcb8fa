"""What the commands print, whole: a deck in, the text that a user reads out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import ic
from ic.find import find, standard_decks
from ic.printing.cases import prefixes
from ic.printing.dump import ORDER, stage_names
from ic.printing.plan import print_plan
from met import cli
from met.diagnostic import Problem
from met.plan import file as plan_file
from tests.met.program import free_flyers

DECK = """\
#define BAR(NAME, MASS) link NAME { mass = MASS; shape = rod(length = 1 m, along = x); }

arm swing {
    BAR(first, 2 kg)
    BAR(second, 1 kg)
    link camera { mass = 0.5 kg; inertia = [0.01, 0.01, 0.01] kg*m^2; }
    link slider { mass = 3 kg; shape = box(size = [0.1, 0.1, 0.1] m, along = z); }
    joint pivot  revolute  { parent = base;   child = first;  axis = z; }
    joint knee   revolute  { parent = first;  child = second; axis = -y; at = [1, 0, 0] m; }
    joint mount  fixed     { parent = first;  child = camera; at = [0.5, 0, 0.1] m; }
    joint rail   prismatic { parent = second; child = slider; axis = [0, 3, 4]; at = [1, 0, 0] m; }
}

servo motor {
    model = rigid_gearbox;  command = rate(0.5 rad/s);
    ratio = 100;  kp = 0.05 V*s/rad;  ki = 0.2 V/rad;  v_max = 24 V;  resistance = 1 ohm;
    kt = 0.05 N*m/A;  tau_max = 1 N*m;  j_m = 1e-4 kg*m^2;
}
servo slow like motor { rate = 100 Hz; kp = 0.02 V*s/rad; }

default run free {
    arm = swing;
    servos { pivot = motor; knee = slow; }
    environment { gravity = [0, 0, -9.81] m/s^2; grease = joint_damping { damping = 0.1 N*m*s/rad; } }
    rates { dynamics = 1 kHz; servos = 500 Hz; record = 100 Hz; }
    duration = 2 s;
    record = [q, qd, pivot.servo.voltage];
    metric top = max { of = pivot.qd; }
    require top < 0.6 rad/s;
}

sweep load of free {
    vary links.slider.mass = linspace(1, 5, 30) kg;
    vary motor.kp = [50, 60] mV*s/rad;
}
"""

PLAN = """\
swing.ic: free

Arm swing: 4 links, 3 joints that move
  joint          moves                          at               link    mass    servo
  base
  └─ pivot       revolute about z                                first   2 kg    motor (rigid_gearbox): rate, constant
     ├─ knee     revolute about -y              [1, 0, 0] m      second  1 kg    slow (rigid_gearbox): rate, constant
     │  └─ rail  prismatic along [0, 0.6, 0.8]  [1, 0, 0] m      slider  3 kg    passive
     └─ mount    fixed                          [0.5, 0, 0.1] m  camera  0.5 kg

Schedule: 2 s, 2,000 ticks of the base rate, 1000 Hz
  servo motor of pivot   500 Hz  every 2 ticks   1,001 ticks
  servo slow of knee     100 Hz  every 10 ticks  201 ticks
  dynamics              1000 Hz  every tick      2,000 steps of 1 ms, modified_euler
  record                 100 Hz  every 10 ticks  201 rows
Step size: joint `knee` decays with 15.6 1/s: h * lambda = 0.0156, and a step makes 0.985 of it, in truth 0.985 (swing.ic:23)

Environment: with velocity products (Coriolis, centrifugal, gyroscopic)
  gravity  gravity        g = [0, 0, -9.81] m/s^2
  grease   joint_damping  damping = 0.1 N*m*s/rad, sliding = 0 N*s/m

Recorded: 7 channels in 201 rows, 11.0 KiB a case
  q                    rad, m      joint position              of pivot, knee, rail
  qd                   rad/s, m/s  joint rate                  of pivot, knee, rail
  pivot.servo.voltage  V           voltage on the drive motor

Metrics and what is required of them
  top  max of pivot.qd  require top < 0.6 rad/s

Cases: 1, 11.0 KiB of histories
"""

EXPLAIN_OVERRIDDEN = """\
knee.servo.kp = 0.02 V*s/rad
  proportional gain Kp on the error of the motor's rate (rigid_gearbox)
  --> swing.ic:19:45
   |
19 | servo slow like motor { rate = 100 Hz; kp = 0.02 V*s/rad; }
   |                                             ^^^^^^^^^^^^ written here
  ::: swing.ic:16:19  overrides `kp = 0.05 V*s/rad`
"""

EXPLAIN_VARIED = """\
pivot.servo.kp = 0.05 to 0.06 V*s/rad, varies with the case
  proportional gain Kp on the error of the motor's rate (rigid_gearbox)
  varied by motor.kp: 50, 60 mV*s/rad
  --> swing.ic:34:10
   |
34 |     vary motor.kp = [50, 60] mV*s/rad;
   |          ^^^^^^^^ a sweep varies it, here
  ::: swing.ic:16:24  overrides `0.05 V*s/rad`
"""

EXPLAIN_MACRO = """\
links.first.mass = 2 kg
 --> swing.ic:4:16
  |
4 |     BAR(first, 2 kg)
  |                ^^^^ written here
  = note: in expansion of macro BAR, used at swing.ic:4:5
"""

EXPLAIN_VECTOR = """\
rail.axis = [0, 0.6, 0.8]
  --> swing.ic:11:70
   |
11 |     joint rail   prismatic { parent = second; child = slider; axis = [0, 3, 4]; at = [1, 0, 0] m; }
   |                                                                      ^^^^^^^^^ written here
"""

EXPLAIN_DEFAULT = """\
knee.servo.f_c = 0 N*m
  Coulomb friction F_c on the motor's shaft (rigid_gearbox)
  the default
"""

EXPLAIN_MANY = """\
links.camera.mass        = 0.5 kg       written      swing.ic:6:26
links.camera.com.x       = 0 m          the default
links.camera.com.y       = 0 m          the default
links.camera.com.z       = 0 m          the default
links.camera.inertia.xx  = 0.01 kg*m^2  written      swing.ic:6:45
links.camera.inertia.yy  = 0.01 kg*m^2  written      swing.ic:6:51
links.camera.inertia.zz  = 0.01 kg*m^2  written      swing.ic:6:57
links.camera.inertia.xy  = 0 kg*m^2     written      swing.ic:6:44
links.camera.inertia.xz  = 0 kg*m^2     written      swing.ic:6:44
links.camera.inertia.yz  = 0 kg*m^2     written      swing.ic:6:44
"""

DOC_METRIC = """\
metric settling_time
  The time from which the signal stays within a band around its target, until the end of the run.

  It is infinite if the signal is outside the band at the end. The half width of the band is `band` times the size of the
  target, plus `within`.

In a deck: metric NAME = settling_time { of = CHANNEL; ... }, in a run
Unit of the result: s

Parameters
  name    unit  default  range  meaning
  target  of    needed          target value of the signal
  band    -     0.02     >= 0   half width of the band around the target, as a share of the target
  within  of    0        >= 0   half width of the band around the target that is added to the share `band`
  of: the unit of the signal that the metric evaluates
"""


@pytest.fixture(autouse=True)
def deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """swing.ic in a directory of its own, which is the current one."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MET_DECK_PATH", raising=False)
    path = tmp_path / "swing.ic"
    path.write_text(DECK)
    return path


def printed(capsys: pytest.CaptureFixture[str], *words: str, status: int = 0) -> str:
    """What `met` with these words prints on stdout."""
    assert cli.main(list(words)) == status, capsys.readouterr().err
    return capsys.readouterr().out


def complained(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """What `met` with these words, which are wrong, prints on stderr; it prints nothing else."""
    assert cli.main(list(words)) == cli.BAD_INPUT
    out, err = capsys.readouterr()
    assert out == ""
    return err


def test_check_says_what_it_checked(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "check", "swing.ic") == "swing.ic: 1 run, 1 sweep, 61 cases: no errors\n"
    assert printed(capsys, "check", "swing.ic", "-q") == ""


def test_check_finds_a_mistake_in_a_sweep_that_is_not_the_default(
    deck: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    deck.write_text(DECK.replace("vary motor.kp", "vary motor.kq"))
    err = complained(capsys, "check", "swing.ic")
    assert err.startswith("error[")
    assert " --> swing.ic:34:10\n" in err
    assert err.endswith("\n1 error\n")


def test_plan_shows_the_arm_the_schedule_the_channels_and_the_size(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "plan", "swing.ic") == PLAN


def test_plan_of_a_sweep_shows_what_varies_and_how_much_is_written(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "plan", "swing.ic", "load")
    assert out.startswith("swing.ic: load\n")
    assert "slider  1 to 5 kg" in out
    # 60 cases, 201 rows, 7 channels, 8 bytes: 675,360
    assert out.endswith(
        "Cases: 60, 660 KiB of histories\n"
        "  links.slider.mass  30 values from 1 to 5 kg\n"
        "  motor.kp           50, 60 mV*s/rad\n"
    )


def test_all_plans_of_a_deck_are_shown_one_below_the_other(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "plan", "swing.ic", "--all")
    assert out.startswith(PLAN + "\nswing.ic: load\n")


def test_a_plan_that_was_written_shows_as_its_deck_does(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "plan", "swing.ic", "-o", "p.json") == "wrote p.json\n"
    assert printed(capsys, "plan", "p.json") == PLAN


@pytest.mark.parametrize("name", ["p.plan", "p", "p.JSON"])
def test_a_plan_that_met_run_would_take_for_a_deck_is_not_written(
    capsys: pytest.CaptureFixture[str], name: str
) -> None:
    assert cli.main(["plan", "swing.ic", "-o", name]) == 2
    assert capsys.readouterr().err == (
        f"error[E300]: cannot write {name}: a plan's name ends in .json\n"
        " = help: `met run` knows a plan by its ending, and takes any other file for a deck\n\n1 error\n"
    )
    assert not Path(name).exists()


def test_plan_as_json_is_the_plan_file(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "plan", "swing.ic", "--format", "json")
    printed(capsys, "plan", "swing.ic", "-o", "p.json")
    assert out == Path("p.json").read_text()
    assert plan_file.loads(out).experiments[0].name == "free"


@pytest.mark.release
def test_an_arm_of_a_thousand_joints_is_drawn(deck: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Deeper than Python's stack."""
    links = "".join(f"link l{i} {{ mass = 1 kg; shape = sphere(radius = 1 m); }}\n" for i in range(1200))
    parents = ["base", *(f"l{i}" for i in range(1199))]
    joints = "".join(
        f"joint j{i} revolute {{ parent = {parent}; child = l{i}; axis = z; }}\n" for i, parent in enumerate(parents)
    )
    run = "run r { arm = long; rates { dynamics = 1 kHz; } duration = 1 s; record = []; }\n"
    deck.write_text(f"arm long {{\n{links}{joints}}}\n{run}")
    out = printed(capsys, "plan", "swing.ic")
    assert "   └─ j1199  revolute about z" in out
    assert "Recorded: nothing" in out


def test_cases_lists_position_id_and_coordinates_in_the_units_of_the_deck(capsys: pytest.CaptureFixture[str]) -> None:
    ids = [case["id"] for case in json.loads(printed(capsys, "cases", "swing.ic", "--format", "json"))[0]["cases"]]
    near = prefixes(ids)
    head, *lines = printed(capsys, "cases", "swing.ic").splitlines()
    assert head == "load: 60 cases, 11.0 KiB of histories each"
    assert [line.split() for line in (*lines[:6], lines[-1])] == [
        ["id", "links.slider.mass", "motor.kp"],
        ["kg", "mV*s/rad"],
        ["#0", near[0], "1", "50"],
        ["#1", near[1], "1", "60"],
        ["#2", near[2], "1.1379310344827587", "50"],
        ["#3", near[3], "1.1379310344827587", "60"],
        ["#59", near[59], "5", "60"],
    ]


@pytest.mark.slow
def test_a_long_table_shows_head_and_tail_and_all_of_it_when_asked(capsys: pytest.CaptureFixture[str]) -> None:
    short = printed(capsys, "cases", "swing.ic").splitlines()
    whole = printed(capsys, "cases", "swing.ic", "--all").splitlines()
    gap = short.index("  ... 20 more; --all prints them")
    assert len(whole) == 3 + 60
    assert short[:gap] + whole[gap : gap + 20] + short[gap + 1 :] == whole


def test_cases_as_json_are_in_si(capsys: pytest.CaptureFixture[str]) -> None:
    (told,) = json.loads(printed(capsys, "cases", "swing.ic", "--format", "json"))
    assert (told["experiment"], told["count"], len(told["cases"])) == ("load", 60, 60)
    assert told["cases"][1]["values"] == [1.0, pytest.approx(0.06, rel=1e-15)]  # 60 mV: one rounding


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["knee.servo.kp"], EXPLAIN_OVERRIDDEN),
        (["slow.kp"], EXPLAIN_OVERRIDDEN),
        (["motor.kp", "--run", "load"], EXPLAIN_VARIED),
        (["links.first.mass"], EXPLAIN_MACRO),
        (["rail.axis"], EXPLAIN_VECTOR),
        (["knee.servo.f_c"], EXPLAIN_DEFAULT),
        (["links.camera"], EXPLAIN_MANY),
    ],
)
def test_explain_says_where_a_value_comes_from(
    words: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert printed(capsys, "explain", "swing.ic", *words) == expected


def test_explain_of_an_unknown_path_says_what_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    assert complained(capsys, "explain", "swing.ic", "knee.servo.kq") == (
        "error[D170]: no parameter `knee.servo.kq` in `free`\n"
        " = help: did you mean `knee.servo.kt`, `knee.servo.kp`, `knee.servo.ki`?\n"
        " = help: `knee.servo` has: ratio, kp, ki, v_max, k_position, resistance, kt, tau_max, j_m, f_c, f_v, "
        "friction, command.value, rate, model\n"
        "\n"
        "1 error\n"
    )


@pytest.mark.slow
@pytest.mark.parametrize("path", ["knee.qdd", "tau", "knee.reaction", "links.first.position.z", "energy.kinetic"])
def test_explain_of_a_channel_says_that_only_a_run_has_it(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert complained(capsys, "explain", "swing.ic", path) == (
        f"error[D170]: no parameter `{path}` in `free`\n"
        f" = help: it is a channel, which only a run computes: `record = [{path}];` keeps it\n"
        "\n"
        "1 error\n"
    )


def test_explain_as_json_has_the_places(capsys: pytest.CaptureFixture[str]) -> None:
    (told,) = json.loads(printed(capsys, "explain", "swing.ic", "knee.servo.kp", "--format", "json"))
    assert (told["path"], told["value"], told["unit"], told["origin"]) == ("knee.servo.kp", 0.02, "V*s/rad", "deck")
    assert (told["place"]["line"], [place["line"] for place in told["overrides"]]) == (19, [16])


def test_doc_prints_what_a_model_declares(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "doc", "settling_time") == DOC_METRIC
    assert printed(capsys, "doc", "metric", "settling_time") == DOC_METRIC


def test_doc_lists_every_model_with_a_line_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "doc")
    for name in ("rigid_gearbox", "gravity", "sine", "rms", "modified_euler"):
        assert f"\n  {name} " in out
    assert "rms" in printed(capsys, "doc", "metrics")
    assert "gravity" not in printed(capsys, "doc", "metrics")


def test_doc_of_no_model_says_what_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    err = complained(capsys, "doc", "rigid_gearbx")
    assert err.startswith("error[D171]: no kind of model and no model `rigid_gearbx`\n")
    assert " = help: did you mean `rigid_gearbox`?\n" in err


@pytest.mark.parametrize(
    ("stage", "line"),
    [
        ("tokens", "swing.ic:1:37                    CPP_ID         mass  from BAR at swing.ic:4:5"),
        ("syntax", "Group default run free    // swing.ic:21:1"),
        ("model", "    kp = 0.02 V*s/rad    // swing.ic:19:40, overrides swing.ic:16:19"),
        ("program", "program of free: base rate 1000 Hz"),
    ],
)
def test_dump_shows_what_a_stage_hands_on(stage: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(capsys, "dump", stage, "swing.ic").splitlines()
    assert line in lines


def test_dump_of_the_kernel_is_code_for_llvm(capsys: pytest.CaptureFixture[str]) -> None:
    assert "define " in printed(capsys, "dump", "kernel", "swing.ic")


def test_dump_knows_every_stage_of_the_way_in_order(capsys: pytest.CaptureFixture[str]) -> None:
    assert tuple(stage_names()) == ORDER
    assert complained(capsys, "dump", "modl", "swing.ic") == (
        "error[D172]: no stage `modl`\n"
        " = help: did you mean `model`?\n"
        f" = help: stages: {', '.join(ORDER)}\n"
        "\n"
        "1 error\n"
    )


@pytest.mark.slow
def test_a_deck_is_a_file_first_and_then_one_of_the_standard_library(capsys: pytest.CaptureFixture[str]) -> None:
    assert "two_link.ic" in standard_decks()
    assert printed(capsys, "check", "two_link.ic").endswith("no errors, 1 warning allowed\n")
    Path("two_link.ic").write_text(DECK)
    assert printed(capsys, "check", "two_link.ic") == "two_link.ic: 1 run, 1 sweep, 61 cases: no errors\n"
    assert find("two_link.ic") == Path("two_link.ic")


def test_a_deck_that_is_nowhere_is_answered_with_what_was_meant() -> None:
    with pytest.raises(Problem) as raised:
        find("tow_link.ic")
    (diagnostic,) = raised.value.diagnostics
    assert diagnostic.message == "no deck `tow_link.ic`"
    assert diagnostic.help == ("did you mean `two_link.ic`?", f"standard decks: {', '.join(standard_decks())}")


def test_explain_follows_the_names_that_a_value_is_written_with(deck: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deck.write_text(DECK.replace("rate(0.5 rad/s)", "rate(quick)") + "let quick = 0.5 rad/s;\n")
    lines = printed(capsys, "explain", "swing.ic", "pivot.servo.command.value").splitlines()
    assert lines[0] == "pivot.servo.command.value = 0.5 rad/s"
    assert lines[-1] == "  ::: swing.ic:36:5  quick = 0.5 rad/s"


def test_plan_shows_how_a_joints_frame_is_turned(deck: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deck.write_text(DECK.replace("child = second; axis = -y;", "child = second; axis = -y; rpy = [0, -90, 30] deg;"))
    lines = printed(capsys, "plan", "swing.ic").splitlines()
    assert lines[3].split() == ["joint", "moves", "at", "rpy", "link", "mass", "servo"]
    assert "[1, 0, 0] m      [0, -90, 30] deg  second" in lines[6]
    assert lines[7].count("deg") == 0


def test_plan_that_is_asked_for_more_shows_centres_of_mass_and_inertias(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(capsys, "plan", "swing.ic", "-v").splitlines()
    at = next(n for n, line in enumerate(lines) if line.startswith("  link "))
    assert lines[at].endswith("inertia about it: xx, yy, zz, xy, xz, yz")
    # a rod of 2 kg and 1 m: m l^2 / 12
    assert lines[at + 1].split(maxsplit=1) == [
        "first",
        "2 kg    [0.5, 0, 0] m   [0, 0.166667, 0.166667, 0, 0, 0] kg*m^2",
    ]


def test_check_that_is_asked_for_more_names_the_joints_without_a_servo(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "check", "swing.ic", "-v").splitlines() == [
        "free: no servo on rail, which moves freely",
        "load: no servo on rail, which moves freely",
        "swing.ic: 1 run, 1 sweep, 61 cases: no errors",
    ]


def test_dump_of_a_plan_has_a_line_for_each_value_on_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = printed(capsys, "dump", "plan", "swing.ic")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    pretty = printed(capsys, "dump", "plan", "swing.ic")
    assert json.loads(pretty) == json.loads(plain)
    assert len(pretty.splitlines()) > 10 * len(plain.splitlines())


def test_explain_of_a_component_names_only_what_it_is_written_with(
    deck: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    deck.write_text(DECK.replace("at = [0.5, 0, 0.1] m", "at = [boom/2, 0 m, 0.1 m]") + "let boom = 1 m;\n")
    x, y, z = printed(capsys, "explain", "swing.ic", "mount.at").split("\n\n")
    assert x.startswith("mount.at.x = 0.5 m\n")
    assert x.endswith("  ::: swing.ic:36:5  boom = 1 m")
    assert "boom = 1 m" not in y + z


@pytest.mark.slow
@pytest.mark.parametrize(
    ("asked", "same"),
    [("camera", "links.camera"), ("camera.mass", "links.camera.mass"), ("top", "metrics.top"), ("slow", "knee.servo")],
)
def test_explain_knows_links_metrics_and_definitions_by_their_names(
    asked: str, same: str, capsys: pytest.CaptureFixture[str]
) -> None:
    told = {line.split(" ")[0] for line in printed(capsys, "explain", "swing.ic", asked).splitlines()}
    meant = {line.split(" ")[0] for line in printed(capsys, "explain", "swing.ic", same).splitlines()}
    assert told
    assert told <= meant


def test_explain_of_a_definitions_parameter_in_a_sweep_shows_every_joint_that_follows(
    deck: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    deck.write_text(DECK.replace("rate = 100 Hz; kp = 0.02 V*s/rad;", "rate = 100 Hz;"))
    out = printed(capsys, "explain", "swing.ic", "motor.kp", "--run", "load")
    assert [line.split(" ")[0] for line in out.splitlines() if " = 0.05 to" in line] == [
        "pivot.servo.kp",
        "knee.servo.kp",
    ]


def test_explain_of_a_let_says_what_it_is_and_what_it_is_made_of(
    deck: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    deck.write_text(DECK + "let half = 0.5 m;\nlet whole = 2*half;\n")
    lines = printed(capsys, "explain", "swing.ic", "whole").splitlines()
    assert lines[0] == "whole = 1 m"
    assert lines[1] == "  --> swing.ic:37:13"
    assert lines[-1] == "  ::: swing.ic:36:5  half = 0.5 m"


def test_a_default_has_no_source(capsys: pytest.CaptureFixture[str]) -> None:
    (told,) = json.loads(printed(capsys, "explain", "swing.ic", "knee.servo.f_c", "--format", "json"))
    assert (told["origin"], told["note"]) == ("default", "")
    assert "Hill, Hopping, Price 1989" in printed(capsys, "doc", "rigid_gearbox")


def test_explain_of_a_varied_number_stops_at_the_bracket_that_holds_what_it_overrides(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "d.ic").write_text("""\
let span = 0.5 m;
arm a {
    link bar { mass = 1 kg; shape = sphere(radius = 1 cm); }
    joint hinge revolute { parent = base; child = bar; dh = classic(a = span); }
}
run r { arm = a; rates { dynamics = 1 kHz; } duration = 1 s; record = [q]; }
sweep s of r { vary hinge.dh.a = [0.4, 0.6] m; }
""")
    deck = str(tmp_path / "d.ic")
    assert (
        printed(capsys, "explain", deck, "hinge.dh.a", "--run", "s")
        == f"""\
hinge.dh.a = 0.4 to 0.6 m, varies with the case
 --> {deck}:7:21
  |
7 | sweep s of r {{ vary hinge.dh.a = [0.4, 0.6] m; }}
  |                     ^^^^^^^^^^ a sweep varies it, here
 ::: {deck}:1:5  span = 0.5 m
 ::: {deck}:4:73  overrides `span`
"""
    )
    assert complained(capsys, "explain", deck, "hinge.servo", "--run", "r") == (
        "error[D170]: no parameter `hinge.servo` in `r`\n"
        " = help: joint `hinge` has no servo here: it is free\n"
        "\n1 error\n"
    )


def test_doc_lists_every_channel_that_an_arm_has(capsys: pytest.CaptureFixture[str]) -> None:
    from met.plan.channel import channels

    out = printed(capsys, "doc", "channels")
    (run,) = ic.compile("puma_560.ic").experiments
    heads = {f"{joint.name}.": "JOINT." for joint in run.structure.moving}
    heads |= {f"links.{link.name}.": "links.LINK." for link in run.structure.links}
    for path, channel in channels(run.structure).items():
        whole = path.rpartition(".")[0] if channel.components else path
        for head, said in heads.items():
            whole = whole.replace(head, said, 1) if whole.startswith(head) else whole
        if ".servo." not in path and ".jacobian." not in path:
            assert f"\n  {whole} " in out
    assert "links.LINK.jacobian.linear.JOINT" in out


def test_doc_says_what_denavit_hartenberg_numbers_are(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "doc", "dh")
    assert "classic     Rz(theta) Tz(d) Tx(a) Rx(alpha)" in out
    assert [each["name"] for each in json.loads(printed(capsys, "doc", "dh", "--format", "json"))] == [
        "a",
        "alpha",
        "d",
        "theta",
    ]


def test_a_base_that_moves_is_told() -> None:
    said = "\n".join(print_plan(ic.compile(text=free_flyers.ARM + free_flyers.RUN)))
    assert (
        """
  joint        moves             at             rpy              link   mass   servo
  base         free                                                     40 kg
  └─ shoulder  revolute about z  [0.5, 0, 0] m  [20, 30, 0] deg  upper  10 kg  passive
     └─ elbow  revolute about y  [1, 0, 0] m                     lower  5 kg   passive

Base: moves freely, at the start with
  position  [1, 2, 3] m
  rpy       [10, 20, 30] deg
  velocity  [0.1, -0.2, 0.3] m/s
  rate      [40, 20, -60] deg/s
"""
        in said
    )


@pytest.mark.slow
def test_a_sweep_of_one_case_shows_the_vectors_that_follow_from_what_varies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("swing.ic").write_text(DECK + "sweep one of free { vary links.slider.mass = [6] kg; }\n", encoding="utf-8")
    assert cli.main(["plan", "swing.ic", "one", "-v", "-q"]) == 0
    assert cli.main(["plan", "swing.ic", "one", "-v"]) == 0
    shown = capsys.readouterr().out
    assert "  slider  6 kg    [0, 0, 0.05] m  [0.01, 0.01, 0.01, 0, 0, 0] kg*m^2\n" in shown


def test_the_plan_of_a_deck_without_a_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from met.cli import main

    (tmp_path / "empty.ic").write_text("// nothing\n")
    assert main(["plan", str(tmp_path / "empty.ic"), "--all", "-o", str(tmp_path / "p.json")]) == 2
    assert "error[D161]: this deck has no run\n" in capsys.readouterr().err
    assert not (tmp_path / "p.json").exists()
