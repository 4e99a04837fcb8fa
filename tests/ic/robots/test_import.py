"""`met import`: what it prints and writes, what it refuses, and that its decks run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ic
from ic.driver.import_robot import import_robot, import_with_remarks
from ic.robots.entries import rotation
from ic.robots.following import without_mimics
from ic.robots.urdf import read
from met import cli, run
from met.diagnostic import Problem
from tests.ic.robots.two import DECK, TWO, changed, refused

# ruff: noqa: E501 - messages are as wide as they are

ARM = """\
<robot name="pick-up">
  <link name="floor"/>
  <link name="upper">
    <inertial>
      <origin xyz="0.25 0 0" rpy="0 0 1.5707963267948966"/>
      <mass value="4.5"/>
      <inertia ixx="0.2" iyy="0.01" izz="0.2" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual/>
  </link>
  <link name="hand">
    <inertial> <mass value="1e-2"/> <inertia ixx="1e-05" iyy="2e-05" izz="2.5e-05"/> </inertial>
  </link>
  <link name="tool 1"/>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.3" rpy="0 -0.1 0"/> <parent link="floor"/> <child link="upper"/> <axis xyz="0 -1 0"/>
    <limit lower="0.5" upper="2" effort="50" velocity="3"/> <dynamics damping="0.5" friction="0.2"/>
  </joint>
  <joint name="roll" type="continuous">
    <origin xyz="0.5 0 0"/> <parent link="upper"/> <child link="hand"/> <limit effort="5" velocity="0"/>
  </joint>
  <joint name="finger" type="prismatic">
    <parent link="hand"/> <child link="tool 1"/> <mimic joint="roll" multiplier="0.1"/>
    <limit lower="0" upper="0.04" effort="0" velocity="0"/>
  </joint>
</robot>
"""
PRINTED = """\
// made by `met import arm.urdf --mimic fixed` from a file with the SHA-256 HASH...
// `base` is the file's link `floor`.
// Not in this deck: 1 visual.
deck 2;

arm pick_up {
    // inertia turned from axes at rpy 0 0 1.5707963267948966
    link upper { mass = 4.5 kg;  com = [0.25, 0, 0] m;  inertia = [0.01, 0.2, 0.2] kg*m^2; }
    link hand { mass = 0.01 kg;  inertia = [1e-05, 2e-05, 2.5e-05] kg*m^2; }
    link tool_1 { mass = 0 kg; }  // `tool 1` in the file

    joint shoulder revolute {  // damping 0.5; friction 0.2
        parent = base;  child = upper;
        at     = [0, 0, 0.3] m;
        rpy    = [0, -0.1, 0] rad;
        axis   = -y;
        q_min  = 0.5 rad;  q_max = 2 rad;  qd_max = 3 rad/s;  tau_max = 50 N*m;
    }
    joint roll revolute {  // continuous
        parent  = upper;  child = hand;
        at      = [0.5, 0, 0] m;
        axis    = x;
        tau_max = 5 N*m;
    }
    // follows `roll` in the file (multiplier 0.1); here it is held at 0
    joint finger fixed { parent = hand;  child = tool_1; }
}

// Each joint is held, and `tau` is what that takes. Put servos of yours in the place of these.
servo held { model = ideal;  bandwidth = 20 1/s;  command = position(0 rad); }

default run hold {
    arm         = pick_up;
    servos      {
        shoulder = held { command = position(1.25 rad); };  // the middle of its range, which 0 is not in
        roll = held;
    }
    initial {
        shoulder.q = 1.25 rad;
    }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates       { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration    = 1 s;
    record      = [q, tau];
}

// The joints let go, with the damping and friction of the file.
servo shoulder_bearing { model = passive;  damping = 0.5 N*m*s/rad;  friction = 0.2 N*m; }
servo roll_bearing { model = passive; }

run fall like hold {
    servos {
        shoulder = shoulder_bearing;
        roll = roll_bearing;
    }
}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(ARM, encoding="utf-8")
    return tmp_path


def test_the_deck_is_printed_to_be_read(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["import", "arm.urdf", "--mimic", "fixed"]) == 0
    out, err = capsys.readouterr()
    first = out.partition("\n")[0]
    assert out == PRINTED.replace("HASH", first.rpartition(" ")[2].removesuffix("..."))
    assert err == "note: the inertia of link `hand` has no `ixy`, `ixz`, `iyz`: taken as 0\n"


@pytest.mark.slow
def test_the_deck_is_checked_without_a_word_and_runs_hold_and_fall(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["import", "arm.urdf", "-o", "arm.ic", "--mimic", "fixed"]) == 0
    note = "note: the inertia of link `hand` has no `ixy`, `ixz`, `iyz`: taken as 0\n"
    assert capsys.readouterr() == ("wrote arm.ic\n", note)
    assert cli.main(["check", "arm.ic"]) == 0
    assert capsys.readouterr() == ("arm.ic: 2 runs, 2 cases: no errors\n", "")
    plan = ic.compile("arm.ic", select="all")
    held, fell = (run.run(experiment) for experiment in plan.experiments)
    assert (held.status == 0).all() and (fell.status == 0).all()
    assert np.ptp(held.signals["q"], axis=1).max() == 0.0
    assert np.ptp(fell.signals["q"][0, :, 0]) > 0.1
    # rpy turns the shoulder's frame by -0.1 about y, and it turns by 1.25 about -y: the bar is at 1.35 above the horizon
    weight = 9.81 * (4.5 * 0.25 + 0.01 * 0.5) * np.cos(1.35)
    assert held.signals["tau"][0, :, 0] == pytest.approx(weight, rel=1e-12)


def test_the_deck_is_laid_out_as_met_fmt_would(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["import", "arm.urdf", "-o", "arm.ic", "--mimic", "fixed"]) == 0
    assert cli.main(["fmt", "--check", "arm.ic"]) == 0


def test_a_joint_that_follows_another_follows_it_in_the_deck(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["import", "arm.urdf", "-o", "arm.ic"]) == 0
    capsys.readouterr()
    plan = ic.compile("arm.ic", select=["fall"])
    (finger,) = (joint for joint in plan.experiments[0].structure.moving if joint.follows)
    assert (finger.name, finger.follows) == ("finger", ("roll",))
    ratio = plan.experiments[0].parameters["finger.ratio"]
    assert (ratio.value, ratio.unit) == (0.1, "m/rad")
    assert (
        "finger =" not in Path("arm.ic").read_text(encoding="utf-8").partition("run hold")[2].partition("run fall")[0]
    )
    fell = run.run(plan.experiments[0])
    np.testing.assert_array_equal(fell.signals["q"][0, :, -1], 0.1 * fell.signals["q"][0, :, -2])


LED = """\
<robot name="led">
  <link name="base_link"/> <link name="a">BODY</link> <link name="b">BODY</link> <link name="c">BODY</link>
  <joint name="one" type="revolute">
    <parent link="base_link"/> <child link="a"/> <axis xyz="0 0 1"/> <limit lower="0.2" upper="0.6"/>
  </joint>
  <joint name="two" type="KIND">
    ORIGIN <parent link="a"/> <child link="b"/> <axis xyz="AXIS"/>
    <mimic joint="one" multiplier="-1.5" offset="0.5"/>
  </joint>
  <joint name="three" type="revolute">
    <origin xyz="0.3 0.2 0.1"/> <parent link="b"/> <child link="c"/> <axis xyz="0 1 0"/> <mimic joint="two"/>
  </joint>
</robot>
""".replace("BODY", '<inertial> <mass value="1"/> <inertia ixx="1" iyy="1" izz="1"/> </inertial>')


def led(kind: str, origin: str = "", axis: str = "0 0 1") -> str:
    return LED.replace("KIND", kind).replace("ORIGIN", origin).replace("AXIS", axis)


def turn(vector: np.ndarray) -> np.ndarray:
    """The rotation by a vector, as the power series of its cross product."""
    x, y, z = vector
    cross, term, total = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), np.eye(3), np.eye(3)
    for n in range(1, 25):
        term = term @ cross / n
        total = total + term
    return total


@pytest.mark.parametrize("axis", [(0, 0, 1), (-1, 0, 0), (0, -2, 0), (1, 2, 3)])
@pytest.mark.parametrize("rpy", [(0, 0, 0), (0.3, -1.1, 2), (0.4, np.pi / 2, 0), (3, -1.4, -3)])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_follower_is_fixed_where_its_leader_puts_it(kind: str, rpy: tuple[float, ...], axis: tuple[int, ...]) -> None:
    """The leader is held in the middle of its range, at 0.4 rad, so the follower is at -1.5 0.4 + 0.5 = -0.1."""
    origin = f'<origin xyz="0.1 0.2 0.3" rpy="{" ".join(map(repr, map(float, rpy)))}"/>'
    robot = read("led.urdf", led(kind, origin, " ".join(map(str, axis))))
    before, (_, after, _) = robot.joints[1], without_mimics(robot, "fixed").joints
    assert before.at and before.rpy and after.at and after.rpy and after.type.text == "fixed"
    along = -0.1 * np.array(axis) / np.linalg.norm(axis)
    R = np.array(rotation(*before.rpy.values))
    moved = R @ along if kind == "prismatic" else np.zeros(3)
    np.testing.assert_allclose(after.at.values, before.at.values + moved, atol=1e-15)
    R = R if kind == "prismatic" else R @ turn(along)
    np.testing.assert_allclose(rotation(*after.rpy.values), R, atol=4e-16 * 8)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_the_deck_with_followers_held_has_its_links_where_followers_are_that_move(kind: str) -> None:
    Path("led.urdf").write_text(led(kind, '<origin xyz="0 1 0" rpy="0.3 -1.1 2"/>', "1 2 3"), encoding="utf-8")
    free, fixed = (import_robot("led.urdf", treatment) for treatment in ("free", "fixed"))  # type: ignore[arg-type]
    unit = "rad" if kind == "revolute" else "m"
    assert "follows `one` in the file (multiplier -1.5, offset 0.5); here it is held at -0.1" in fixed
    assert "follows `two` in the file; here it is held at -0.1" in fixed and "one.q = 0.4 rad;" in fixed
    free = free.replace("one.q = 0.4 rad;", f"one.q = 0.4 rad;  two.q = -0.1 {unit};  three.q = -0.1 rad;")
    poses = []
    for deck in (free, fixed):
        [plan] = [ic.compile(text=deck.replace("[q, tau]", "[links.c.position, links.c.orientation]"), select=["hold"])]
        found = run.run(plan.experiments[0])
        poses.append(np.concatenate([found.signals[f"links.c.{name}"][0, 0] for name in ("position", "orientation")]))
    np.testing.assert_allclose(poses[0], poses[1], atol=1e-14)


def test_a_follower_that_is_fixed_stays_where_it_is() -> None:
    Path("led.urdf").write_text(led("fixed"), encoding="utf-8")
    assert "joint two fixed { parent = a;  child = b; }" in import_robot("led.urdf", "fixed")


@pytest.mark.parametrize("treatment", [None, "free", "fixed"])
def test_a_joint_that_follows_none_that_there_is_is_refused_however_it_is_treated(treatment: str | None) -> None:
    Path("two.urdf").write_text(changed(TWO, ("<axis", '<mimic joint="ghost"/> <axis')), encoding="utf-8")
    with pytest.raises(Problem) as problem:
        import_robot("two.urdf", treatment)  # type: ignore[arg-type]
    assert [each.code for each in problem.value.diagnostics] == ["D207"]


def test_a_joint_that_is_let_go_and_moves_nothing_is_refused() -> None:
    with pytest.raises(Problem) as problem:
        import_robot("arm.urdf", "free")
    assert refused(problem.value).startswith(
        "error[D217]: joint `finger` moves nothing that has mass\n  --> arm.urdf:22:16\n"
    )


def test_a_robot_that_is_no_arm_is_told_with_what_a_deck_could_do() -> None:
    Path("two.urdf").write_text(changed(TWO, ('izz="0.2"', 'izz="0.9"')), encoding="utf-8")
    with pytest.raises(Problem) as problem:
        import_robot("two.urdf")
    assert (
        refused(problem.value)
        == """\
error[D087]: the inertia of link `bar` is no body's
 --> two.urdf:7:7
  |
7 |       <inertia ixx="0.1" iyy="0.2" izz="0.9" ixy="0" ixz="0" iyz="0"/>
  |       ^^^^^^^^ principal moments 0.1, 0.2 and 0.9 kg*m^2; no body has one above the sum of the others
  = help: inertia is about the centre of mass, in link axes: [xx, yy, zz] or [xx, yy, zz, xy, xz, yz] kg*m^2
  = help: products have the sign of -sum(m x y)
  = help: in the arm's block: `bar { inertia = [...] kg*m^2; }`
  = help: if it is of an identified set (base parameters), which need be no body's: in the arm's block, `bar { lumped = on; }`
  = help: write a deck with `arm NAME from urdf("FILE") { ... }`: its block can change what the file says
"""
    )


def test_the_root_is_a_base_with_its_mass_unless_no_body_is_so() -> None:
    root = '<link name="ground"> <inertial> <mass value="7"/> <inertia ixx="1" iyy="1" izz="1"/> </inertial> </link>'
    Path("two.urdf").write_text(changed(TWO, ('<link name="ground"/>', root)), encoding="utf-8")
    assert (
        ic.compile(text=import_robot("two.urdf").replace("duration", "base = free;  duration", 1))
        .experiments[0]
        .parameters["links.base.mass"]
        .value
        == 7.0
    )
    odd = root.replace('ixx="1"', 'ixx="3"')
    Path("two.urdf").write_text(changed(TWO, ('<link name="ground"/>', odd)), encoding="utf-8")
    text = import_robot("two.urdf")
    assert "`base` is the file's link `ground`. Its inertia is left out: no body has it." in text
    assert "link base" not in text
    told = import_with_remarks("two.urdf")[1]
    assert told[0] == "the inertia of link `ground` has no `ixy`, `ixz`, `iyz`: taken as 0"
    assert told[1].startswith("the inertia of `ground`, the base, is not in the deck: ")


ANGLES = [
    ('lower="-90" upper="1"', "0 0 3", "0 0 0", ["`lower` of joint `hinge` is -90 rad, 14.3 turns: is it in degrees?"]),
    ('lower="0" upper="720"', "0 0 0", "0 0 0", ["`upper` of joint `hinge` is 720 rad, 114.6 turns: is it in degrees?"]),
    ('lower="-1e16" upper="12.5"', "0 -6.28318 0", "0 4.72 0", []),
    ("", "0 0 180", "0 0 0", ["`rpy` of joint `hinge` is 180 rad, 28.6 turns: is it in degrees?"]),
    ("", "0 0 0", "1 -90 0", ["`rpy` of the inertia of link `bar` is -90 rad, 14.3 turns: is it in degrees?"]),
]  # fmt: skip


@pytest.mark.parametrize(("limit", "turned", "inertia", "told"), ANGLES)
def test_angles_that_look_like_degrees_are_told(limit: str, turned: str, inertia: str, told: list[str]) -> None:
    joint = f'<origin rpy="{turned}"/> <limit {limit} effort="1" velocity="1"/> <axis'
    text = changed(TWO, ("<axis", joint), ('rpy="0 0 0"/>\n      <mass', f'rpy="{inertia}"/>\n      <mass'))
    Path("two.urdf").write_text(text, encoding="utf-8")
    assert list(import_with_remarks("two.urdf")[1]) == told
    warned = [each for each in ic.check(text=DECK).diagnostics if each.code == "D218"]
    assert [label.text for each in warned for label in each.also] == told


@pytest.mark.parametrize(
    ("kind", "limit", "told"),
    [
        ("revolute", 'upper="1" velocity="115"', ["`velocity` of joint `hinge` is 115 rad/s: is it in deg/s?"]),
        ("continuous", 'velocity="180"', ["`velocity` of joint `hinge` is 180 rad/s: is it in deg/s?"]),
        ("revolute", 'upper="1" velocity="1e3"', []),  # which is written for no limit
        ("revolute", 'upper="1" velocity="59"', []),
        ("prismatic", 'upper="800" velocity="1"', ["`upper` of joint `hinge` is 800 m: is it in mm?"]),
        ("prismatic", 'upper="0.8" velocity="250"', ["`velocity` of joint `hinge` is 250 m/s: is it in mm/s?"]),
        ("prismatic", 'lower="-15" upper="15" velocity="5"', []),
    ],
)
def test_limits_that_look_like_degrees_or_millimetres_are_told(kind: str, limit: str, told: list[str]) -> None:
    joint = f'<limit {limit} effort="1"/> <axis'
    Path("two.urdf").write_text(changed(TWO, ('type="revolute"', f'type="{kind}"'), ("<axis", joint)), encoding="utf-8")
    assert [each for each in import_with_remarks("two.urdf")[1] if "is it in" in each] == told


def test_a_file_that_is_there_is_left_alone_unless_forced(capsys: pytest.CaptureFixture[str]) -> None:
    Path("arm.ic").write_text("mine", encoding="utf-8")
    assert cli.main(["import", "arm.urdf", "-o", "arm.ic", "--mimic", "fixed"]) == 2
    assert (
        capsys.readouterr().err
        == """\
error[D216]: `arm.ic` is there already
 = help: --force writes over it, -o names another

1 error
"""
    )
    assert Path("arm.ic").read_text(encoding="utf-8") == "mine"
    assert cli.main(["import", "arm.urdf", "-o", "arm.ic", "--mimic", "fixed", "--force", "-q"]) == 0
    assert capsys.readouterr() == ("", "")
    assert Path("arm.ic").read_text(encoding="utf-8").startswith("// made by")
    assert cli.main(["import", "arm.urdf", "--force"]) == 2
    assert "--force is for -o" in capsys.readouterr().err


@pytest.mark.parametrize(("output", "says"), [
    ("two.urdf", "`two.urdf` is the file that is read\n = help: -o names another"),
    (".", "`.` is no name of a file\n = help: name the deck: `-o arm.ic`"),
    ("", "`` is no name of a file\n = help: name the deck: `-o arm.ic`"),
])  # fmt: skip
def test_neither_the_file_that_is_read_nor_a_folder_is_written_over(
    output: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("two.urdf").write_text(TWO, encoding="utf-8")
    assert cli.main(["import", "two.urdf", "-o", output, "--force"]) == 2
    assert capsys.readouterr().err == f"error[D216]: {says}\n\n1 error\n"
    assert Path("two.urdf").read_text(encoding="utf-8") == TWO


def test_no_such_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["import", "leg.urdf"]) == 2
    assert (
        capsys.readouterr().err
        == """\
error[D001]: cannot read `leg.urdf`: No such file or directory
 = help: look at the name, and at who may read the file

1 error
"""
    )


def test_comments_hold_whatever_a_file_says() -> None:
    nasty = changed(
        TWO,
        ('"two"', '"a&#10;b"'),
        ('"ground"', '"x &#10; } \\"'),
        ('"ground"', '"x &#10; } \\"'),
        ('<link name="bar">', '<link name="bar\\"> <sensor/>'),
        ('"bar"', '"bar\\"'),
    )
    Path("two.urdf").write_text(nasty, encoding="utf-8")
    compiled = ic.check(text=import_robot("two.urdf"))
    assert compiled.plan is not None and compiled.diagnostics == ()


@pytest.mark.parametrize(("lower", "upper", "held"), [
    ("0.1", "0.3123456", "0.2062"), ("10.00001", "10.00002", "10.000015"), ("1e308", "1.5e308", "1.25e+308"),
    ("-1.5e308", "-1e308", "-1.25e+308"),
])  # fmt: skip
def test_a_joint_whose_range_is_without_0_is_held_within_it(lower: str, upper: str, held: str) -> None:
    limit = f'<limit lower="{lower}" upper="{upper}"/><axis'
    Path("two.urdf").write_text(changed(TWO, ("<axis", limit)), encoding="utf-8")
    text = import_robot("two.urdf")
    assert f"command = position({held} rad);" in text and float(lower) <= float(held) <= float(upper)
    assert ic.check(text=text).plan is not None


def test_servos_of_the_deck_never_bear_a_joints_name() -> None:
    Path("two.urdf").write_text(TWO.replace("hinge", "held").replace('"bar"', '"held_"'), encoding="utf-8")
    text = import_robot("two.urdf")
    assert "servo held__ {" in text and "held = held__;" in text


def test_a_robot_without_a_joint_that_moves_makes_an_arm_and_no_run() -> None:
    Path("two.urdf").write_text(TWO.replace("revolute", "fixed"), encoding="utf-8")
    assert import_robot("two.urdf").endswith("joint hinge fixed { parent = base;  child = bar; }\n}\n")


def test_the_files_limits_are_the_joints_and_a_run_that_passes_one_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["import", "arm.urdf", "-o", "arm.ic", "--mimic", "fixed"]) == 0
    [plan] = [ic.compile("arm.ic", select=["fall"])]
    known = plan.experiments[0].parameters
    limits = {path: (known[path].value, known[path].unit) for path in known if path.split(".")[-1] in LIMITS}
    assert limits == {
        "shoulder.q_min": (0.5, "rad"),
        "shoulder.q_max": (2.0, "rad"),
        "shoulder.qd_max": (3.0, "rad/s"),
        "shoulder.tau_max": (50.0, "N*m"),
        "roll.tau_max": (5.0, "N*m"),  # of a continuous joint, whose velocity of 0 says nothing
    }
    fell = run.run(plan.experiments[0])
    lowest = fell.signals["q"][0, :, 0].min()
    assert fell.excess["shoulder.q_min"][0] == pytest.approx(0.5 - lowest, abs=1e-4) and lowest < 0.4


LIMITS = ("q_min", "q_max", "qd_max", "tau_max")


def test_a_follower_that_is_held_beyond_its_limits_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    limit = '<limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>'
    text = led("revolute").replace('<mimic joint="one"', f'{limit}<mimic joint="one"').replace('"0.5"', '"9"')
    Path("led.urdf").write_text(text, encoding="utf-8")
    assert cli.main(["import", "led.urdf", "--mimic", "fixed", "-o", "led.ic"]) == cli.YES
    out, err = capsys.readouterr()
    assert out == "wrote led.ic\n"
    assert "note: joint `two` is held at 8.4, beyond its limits, -1.5 to 1.5\n" in err and "degrees" not in err
    assert "here it is held at 8.4, beyond its limits, -1.5 to 1.5" in Path("led.ic").read_text()
    assert cli.main(["import", "led.urdf", "--mimic", "fixed", "-o", "led.ic", "--force", "-q"]) == cli.YES
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("output", [(), ("-o", "two.ic")])
def test_what_is_not_read_is_told_with_its_number(output: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    Path("two.urdf").write_text(changed(TWO, ("<axis", '<limit upper="1" lower="0" jerk="3"/> <axis')), "utf-8")
    assert cli.main(["import", "two.urdf", *output]) == cli.YES
    assert capsys.readouterr().err == "note: attributes not read, and not in the deck: 1 jerk of limit\n"


@pytest.mark.parametrize(("name", "meant"), [("min", "lower"), ("Max", "upper"), ("torque", "effort")])
def test_another_word_for_a_limit_is_refused_with_the_word(name: str, meant: str) -> None:
    Path("two.urdf").write_text(changed(TWO, ("<axis", f'<limit {name}="1"/> <axis')), encoding="utf-8")
    with pytest.raises(Problem) as problem:
        import_robot("two.urdf")
    [found] = problem.value.diagnostics
    assert (found.code, found.message) == ("D208", f"`<limit>` has no attribute `{name}`")
    assert found.help[0] == f"did you mean `{meant}`?"
    # beside the word itself it is another thing
    both = f'<limit {name}="1" lower="0" upper="1" effort="1" velocity="1"/> <axis'
    Path("two.urdf").write_text(changed(TWO, ("<axis", both)), encoding="utf-8")
    assert f"1 {name} of limit" in import_robot("two.urdf")
