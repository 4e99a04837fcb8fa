"""Arms made from URDF files: as Pinocchio reads them, overridden as any base, named, explained, kept in the plan."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import numpy as np
import pytest

import ic
from ic.driver.explain import explain
from ic.driver.import_robot import import_robot
from ic.robots.entries import LEFT_OUT, TURNED, moments, rotation
from ic.robots.names import deck_names
from ic.robots.urdf import read
from met import cli, run
from met.plan import Experiment
from met.plan import file as plan_file
from tests.ic.robots.two import DECK, OTHER, TWO, changed, check, said
from tests.ic.small_decks import messages
from tests.oracles.random_urdf import random_urdf
from tests.oracles.urdf_plan import made_from, see
from tests.oracles.worst import Worst

# ruff: noqa: E501 - messages are as wide as they are

SEEDS = range(60)
CLOSE = 1e-11  # rounding, times the condition number of the mass matrix (up to some 1e4)


def made(folder: Path, robot: str = TWO, deck: str = DECK) -> Experiment:
    compiled = check(folder, robot, deck)
    assert compiled.plan is not None, messages(compiled)
    return compiled.plan.experiments[0]


def values(experiment: Experiment) -> dict[str, object]:
    return {path: each.value for path, each in experiment.parameters.items()}


def bare(experiment: Experiment) -> object:
    """The structure without places."""
    arm = experiment.structure
    return (
        [(link.name, link.shape) for link in arm.links],
        [(joint.name, joint.kind, joint.parent, joint.child) for joint in arm.joints],
    )


# What the file says


@pytest.mark.release
@pytest.mark.oracle
def test_random_robots_move_as_pinocchio_reads_them(tmp_path: Path) -> None:
    poses, torques, accelerations = Worst("poses"), Worst("tau against rnea"), Worst("qdd against aba")
    path = tmp_path / "random.urdf"
    for seed in SEEDS:
        path.write_text(random_urdf(seed), encoding="utf-8")
        see(made_from(path, tmp_path), path, f"seed {seed}", poses, torques, accelerations)
    for worst in (poses, torques, accelerations):
        worst.below(CLOSE)


@pytest.mark.release
def test_the_imported_deck_has_the_plan_of_the_file_bit_for_bit(tmp_path: Path) -> None:
    path, deck = tmp_path / "random.urdf", tmp_path / "imported.ic"
    for seed in SEEDS:
        path.write_text(random_urdf(seed), encoding="utf-8")
        deck.write_text(
            import_robot(str(path)) + "run fall_of_file { arm = random; environment { gravity = [0, 0, -9.81] m/s^2; }"
            " rates { dynamics = 1 kHz; } duration = 1 ms; record = []; }\n",
            encoding="utf-8",
        )
        ours, theirs = made_from(path, tmp_path), ic.compile(deck, select=["fall_of_file"]).experiments[0]
        assert {
            path: np.float64(value).tobytes() for path, value in values(ours).items() if isinstance(value, float)
        } == {path: np.float64(value).tobytes() for path, value in values(theirs).items() if isinstance(value, float)}
        assert values(ours) == values(theirs) and bare(ours) == bare(theirs), f"{seed=}"


def test_an_inertia_in_turned_axes_is_that_of_the_body(tmp_path: Path) -> None:
    rpy = (0.3, -1.2, 2.5)
    (bar,) = read("two.urdf", changed(TWO, ('rpy="0 0 0"', f'rpy="{" ".join(map(str, rpy))}"'))).carried
    assert bar.inertial is not None
    xx, yy, zz, xy, xz, yz = moments(bar.inertial).values
    R = np.array(rotation(*rpy))
    np.testing.assert_allclose(
        [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], R @ np.diag([0.1, 0.2, 0.2]) @ R.T, atol=1e-16
    )


@pytest.mark.parametrize(
    ("written", "axis"),
    [
        ('<axis xyz="0 0 1"/>', (0.0, 0.0, 1.0)),
        ('<axis xyz="0 -1 0"/>', (0.0, -1.0, 0.0)),
        ('<axis xyz="0 3 4"/>', (0.0, 0.6, 0.8)),
        ("", (1.0, 0.0, 0.0)),
        ('<axis rpy="0 0.0 -0" xyz="0 2 0"/>', (0.0, 1.0, 0.0)),
    ],
)
def test_an_axis_is_made_a_unit_vector_and_is_x_by_itself(
    written: str, axis: tuple[float, ...], tmp_path: Path
) -> None:
    found = made(tmp_path, changed(TWO, ('<axis xyz="0 0 1"/>', written)))
    assert [found.parameters[f"hinge.axis.{letter}"].value for letter in "xyz"] == pytest.approx(axis, rel=1e-15)


def test_what_a_fixed_joint_says_of_an_axis_does_not_count(tmp_path: Path) -> None:
    tool = (
        "</robot>",
        '<link name="tool"/><joint name="mount" type="fixed"><parent link="bar"/><child link="tool"/>'
        '<axis xyz="0 0 0"/></joint></robot>',
    )
    found = made(tmp_path, changed(TWO, tool))
    assert found.parameters["links.tool.mass"].value == 0.0
    assert found.parameters["links.tool.inertia.xx"].value == 0.0
    assert "mount.axis.x" not in found.parameters


def test_a_file_is_read_with_either_quotes_any_lines_and_comments(tmp_path: Path) -> None:
    other = TWO.replace('value="2"', "value\n =\n'2'").replace(
        '<link name="bar">', "<!-- <link name='no'/> --><link\tname='bar'>"
    )
    assert (
        values(made(tmp_path, other.replace("\n", "\r\n")))
        == values(made(tmp_path, "\ufeff" + TWO))
        == values(made(tmp_path))
    )


def test_numbers_are_placed_where_they_stand(tmp_path: Path) -> None:
    robot = changed(
        TWO, ('      <mass value="2"/>', '      <!-- äöü 漢字 --> <mass kg=""\n\tvalue =  "2"/>'.replace(' kg=""', ""))
    )
    place = made(tmp_path, robot).parameters["links.bar.mass"].origin.place
    assert place is not None
    assert (Path(place.file).name, place.line, place.column, place.length) == ("two.urdf", 7, 12, 1)


# What a deck changes


def test_the_arms_block_overrides_adds_and_removes_as_on_any_base(tmp_path: Path) -> None:
    deck = changed(
        DECK,
        (
            "{ }",
            """{
        bar { mass = 3 kg;  remove inertia;  inertia = [1, 1, 1] kg*m^2; }
        hinge { axis = -y; }
        link tip { mass = 0.5 kg;  shape = sphere(radius = 1 cm); }
        joint wrist revolute { parent = bar;  child = tip;  at = [1, 0, 0] m;  axis = x; }
    }""",
        ),
    )
    found = made(tmp_path, deck=deck)
    assert [joint.name for joint in found.structure.joints] == ["hinge", "wrist"]
    assert found.parameters["links.bar.mass"].value == 3.0
    assert [each.line for each in found.parameters["links.bar.mass"].origin.overrides] == [6]
    assert found.parameters["hinge.axis.y"].value == -1.0
    assert found.parameters["links.bar.com.x"].value == 0.5
    without = changed(
        DECK, ("{ }", "{ remove hinge;  joint slide prismatic { parent = base;  child = bar;  axis = z; } }")
    )
    assert [joint.name for joint in made(tmp_path, deck=without).structure.joints] == ["slide"]


def test_an_arm_that_is_like_one_from_a_file_takes_after_it_and_sweeps_reach_it_by_every_name(tmp_path: Path) -> None:
    deck = """
arm two from urdf("two.urdf");
arm heavy like two { bar { mass = 20 kg; } }
run fall { arm = heavy;  rates { dynamics = 1 kHz; }  duration = 10 ms;  record = [q]; }
sweep many of fall { vary two.links.bar.com.x = [0.1, 0.2] m;  vary links.bar.mass = [1, 0.5] kg; }
"""
    plan = ic.compile(check_file(tmp_path, deck), select=["many"])
    found = plan.experiments[0]
    assert found.cases.count == 4
    assert (run.run(found).status == 0).all()


def check_file(folder: Path, deck: str) -> Path:
    check(folder, TWO, deck)
    return folder / "deck.ic"


def test_a_joint_follows_another_as_in_the_file_or_moves_by_itself_once_that_is_removed(tmp_path: Path) -> None:
    mimic = '<axis xyz="0 0 1"/><mimic joint="other" multiplier="-2.5" offset="0.3"/>'
    robot = changed(TWO, ('<axis xyz="0 0 1"/>', mimic), ("</robot>", OTHER.replace("fixed", "revolute")))
    follows = made(tmp_path, robot, DECK)
    assert follows.structure.moving[0].follows == ("other",)
    assert [follows.parameters[f"hinge.{name}"].value for name in ("ratio", "offset")] == [-2.5, 0.3]
    free = made(
        tmp_path,
        robot,
        changed(DECK, ("{ }", "{ hinge { remove follows; }  tip { mass = 1 kg;  shape = sphere(radius = 1 cm); } }")),
    )
    assert free.structure.independent[0].name == "hinge"
    robot = robot.replace('"other" type="revolute"', '"other" type="fixed"')
    fixed = "{ remove hinge;  joint hinge fixed { parent = base;  child = bar; }  link tip { mass = 1 kg; shape = sphere(radius = 1 cm); }  joint turn revolute { parent = bar; child = tip; axis = z; } }"
    fixed = fixed.replace("tip", "end")
    assert [joint.kind for joint in made(tmp_path, robot, changed(DECK, ("{ }", fixed))).structure.joints] == [
        "fixed",
        "fixed",
        "revolute",
    ]


LIMIT_NAMES = ("q_min", "q_max", "qd_max", "tau_max")


@pytest.mark.parametrize(
    ("written", "limits"),
    [
        ('lower="-1" upper="2" effort="50" velocity="3"', (-1.0, 2.0, 3.0, 50.0)),
        ('lower=" -1e0&#10;" upper="+2." effort=".5e2" velocity="3"', (-1.0, 2.0, 3.0, 50.0)),
        ('lower="-1"', (-1.0, 0.0, None, None)),  # URDF takes an end that is left out as 0
        ('lower="0" upper="0" effort="0" velocity="0"', (None, None, None, None)),
        ('lower="-inf" upper="+INF" effort="Infinity" velocity="inf"', (None, None, None, None)),
        ('lower="-1.79769e+308" upper="1.7976931348623157e+308"', (None, None, None, None)),
        ('lower="-inf" upper="inf" effort="50"', (None, None, None, 50.0)),
    ],
)
def test_limits_are_what_is_written_and_an_infinite_one_is_none(
    written: str, limits: tuple[float | None, ...], tmp_path: Path
) -> None:
    known = made(tmp_path, changed(TWO, ("<axis", f"<limit {written}/> <axis"))).parameters
    found = [known.get(f"hinge.{name}") for name in LIMIT_NAMES]
    assert tuple(None if each is None else each.value for each in found) == limits


def test_an_arms_block_corrects_limits_that_are_none(tmp_path: Path) -> None:
    robot = changed(TWO, ("<axis", '<limit lower="1" upper="-1" effort="-5"/> <axis'))
    block = "{ hinge { remove q_min;  remove q_max;  tau_max = 5 N*m; } }"
    assert "hinge.q_min" not in made(tmp_path, robot, changed(DECK, ("{ }", block))).parameters
    robot = changed(TWO, ("<axis", '<limit lower="1" upper="inf"/> <axis'))
    found = made(tmp_path, robot, changed(DECK, ("{ }", "{ hinge { q_max = 3 rad; } }")))
    assert [found.parameters[f"hinge.{end}"].value for end in ("q_min", "q_max")] == [1.0, 3.0]


def test_other_attributes_are_counted_with_what_is_not_read(tmp_path: Path) -> None:
    robot = changed(TWO, ("<axis", '<limit gear_velocity="1" effort="5"/> <axis'), ('"hinge" ', '"hinge" kept="yes" '))
    assert "not read: 1 `gear_velocity of limit`, 1 `kept of joint`\n" in said(tmp_path, robot)


WEIGHTY = changed(
    TWO,
    ('<link name="ground"/>', '<link name="ground"> <inertial> <mass value="7"/> <inertia ixx="1" iyy="1" izz="1"/> </inertial> </link>'),
)  # fmt: skip
FREE_RUN = DECK.replace("{ arm = two;", "{ arm = two;  base = free;")


def test_the_inertia_of_the_root_is_that_of_a_free_base_and_of_no_other(tmp_path: Path) -> None:
    known = made(tmp_path, WEIGHTY, FREE_RUN).parameters
    assert [known[f"links.base.{name}"].value for name in ("mass", "inertia.xx", "inertia.xy")] == [7.0, 1.0, 0.0]
    assert values(made(tmp_path, WEIGHTY)) == values(made(tmp_path))
    swept = FREE_RUN + "sweep s of fall { vary links.base.mass = [5, 6] kg; }\n"
    assert made(tmp_path, WEIGHTY, swept).parameters["links.base.inertia.xx"].value == 1.0
    own = changed(FREE_RUN, ("{ }", "{ link base { mass = 3 kg;  shape = sphere(radius = 0.3 m); } }"))
    assert made(tmp_path, WEIGHTY, own).parameters["links.base.mass"].value == 3.0
    like = changed(FREE_RUN, ("arm = two", "arm = other")) + "arm other like two { }\n"
    assert made(tmp_path, WEIGHTY, like).parameters["links.base.mass"].value == 7.0


@pytest.mark.parametrize("change", [('izz="0.2"', 'izz="0.9"'), ('value="2"', 'value="0"')])
def test_a_link_of_a_file_is_lumped_as_the_message_says(change: tuple[str, str], tmp_path: Path) -> None:
    robot = changed(TWO, change)
    (entry,) = re.findall(r"which need be no body's: in the arm's block, `(.*)`\n", said(tmp_path, robot))
    found = made(tmp_path, robot, changed(DECK, ("{ }", f"{{ {entry} }}")))
    assert [link.name for link in found.structure.links if link.lumped] == ["bar"]
    assert any(note.startswith("lumped links: bar; mass matrix positive definite at ") for note in found.notes)


def test_a_root_of_no_body_is_told_where_its_base_moves_and_replaced_as_the_message_says(tmp_path: Path) -> None:
    robot = changed(WEIGHTY, ('ixx="1"', 'ixx="9"'))
    assert made(tmp_path, robot) is not None
    told = said(tmp_path, robot, FREE_RUN)
    assert "D087" in told and "`link base { mass = ...;  inertia = [...] kg*m^2; }`" in told
    own = changed(FREE_RUN, ("{ }", "{ link base { mass = 7 kg;  inertia = [1, 1, 1] kg*m^2; } }"))
    assert made(tmp_path, robot, own) is not None


@pytest.mark.parametrize("root", [TWO, WEIGHTY])
def test_a_robot_that_floats_does_so_by_a_free_base_as_the_message_says(root: str, tmp_path: Path) -> None:
    arm = OTHER.replace('"fixed"', '"revolute"').replace(
        '<link name="tip"/>', '<link name="tip"> <inertial> <mass value="1"/> <inertia ixx="1" iyy="1" izz="1"/> </inertial> </link>'
    )  # fmt: skip
    robot = changed(root, ("revolute", "floating"), ("<axis", '<origin xyz="0 0 1"/> <axis'), ("</robot>", arm))
    (help,) = re.findall(r"in the arm's block, `(.*)`, and in the run `base = free;`", said(tmp_path, robot))
    found = made(tmp_path, robot, changed(FREE_RUN, ("{ }", f"{{ {help} }}")))
    assert found.parameters["hinge.at.z"].value == 1.0 and found.parameters["links.base.mass"].value == 0.0
    assert [joint.name for joint in found.structure.moving] == ["other"]


def test_a_floating_joint_that_does_not_carry_all_is_no_free_base(tmp_path: Path) -> None:
    beside = changed(TWO, ("revolute", "floating"), ("</robot>", OTHER.replace('"bar"', '"ground"')))
    assert (
        "three prismatic and three revolute joints do the same, except where the middle one of these is at 90 deg"
        in (said(tmp_path, beside))
    )


@pytest.mark.parametrize("kind", ["floating", "planar", "spherical"])
def test_a_joint_that_met_has_not_may_be_put_in_another_way(kind: str, tmp_path: Path) -> None:
    robot = changed(TWO, ("revolute", kind))
    other = "{ remove hinge;  joint hinge prismatic { parent = base;  child = bar;  axis = z; } }"
    assert "D212" in said(tmp_path, robot)
    assert made(tmp_path, robot, changed(DECK, ("{ }", other))).structure.moving[0].kind == "prismatic"


BARS = "".join(
    f"""\
  <link name="{name}"> <inertial>
    <origin xyz="{com}"/> <mass value="1"/> <inertia ixx="0.003" iyy="0.003" izz="0.003"/>
  </inertial> </link>
"""
    for name, com in (("crank", "0 0 0.1"), ("coupler", "0.15 0 0"), ("rocker", "0 0 0.1"))
)
JOINTS = "".join(
    f"""\
  <joint name="{name}" type="{kind}">
    <origin xyz="{at}"/> <parent link="{parent}"/> <child link="{child}"/> <axis xyz="0 1 0"/>
  </joint>
"""
    for name, kind, at, parent, child in (
        ("a", "revolute", "0 0 0", "ground", "crank"),
        ("b", "revolute", "0 0 0.2", "crank", "coupler"),
        ("end", "fixed", "0.3 0 0", "coupler", "tip"),
        ("d", "revolute", "0.3 0 0", "ground", "rocker"),
        ("c", "revolute", "0 0 0.2", "rocker", "tip"),
    )
)
FOUR_BAR = f'<robot name="four_bar">\n  <link name="ground"/> <link name="tip"/>\n{BARS}{JOINTS}</robot>\n'
SWING = """\
arm two from urdf("two.urdf") { BLOCK }
run fall {
    arm         = two;
    environment { gravity = [0, 0, -9.81] m/s^2;  BUSHING }
    initial     { a.q = 2.6 rad;  b.q = -2.6 rad;  d.q = 2.6 rad; }
    rates       { dynamics = 10 kHz;  record = 100 Hz; }
    duration    = 0.5 s;
    record      = [q, links.tip.position];
}
"""


@pytest.mark.slow
def test_a_chain_is_closed_as_the_message_says_and_swings_as_one_body(tmp_path: Path) -> None:
    """A parallelogram has one degree of freedom: J q'' = m g l sin q."""
    told = said(tmp_path, FOUR_BAR, SWING.replace("BLOCK", "").replace("BUSHING", ""))
    (remove,) = re.findall(r"in the arm's block, `(.*)`", told)
    (bushing,) = re.findall(r"then, in the run's `environment`: `(.*)`", told)
    found = run.run(made(tmp_path, FOUR_BAR, SWING.replace("BLOCK", remove).replace("BUSHING", bushing)))
    q, tip = found.signals["q"][0], found.signals["links.tip.position"][0]
    meeting = np.stack([0.3 + 0.2 * np.sin(q[:, 2]), 0 * q[:, 2], 0.2 * np.cos(q[:, 2])], axis=1)
    assert np.abs(tip - meeting).max() < 1e-4  # some 10 N, over 1e5 N/m
    angle, rate, step = 2.6, 0.0, 1e-4
    inertia, weight = 2 * (0.003 + 0.1**2) + 0.2**2, 9.81 * (0.1 + 0.1 + 0.2)
    for _ in range(5000):  # by the midpoint rule
        half = rate + 0.5 * step * weight / inertia * np.sin(angle)
        middle = angle + 0.5 * step * rate
        angle, rate = angle + step * half, rate + step * weight / inertia * np.sin(middle)
    np.testing.assert_allclose(q[-1], [angle, -angle, angle], atol=1e-3)


# What is kept and told


def test_the_file_is_kept_in_the_plan_with_its_hash_so_that_the_plan_runs_without_it(tmp_path: Path) -> None:
    plan = ic.compile(check_file(tmp_path, DECK))
    names = [Path(source.name).name for source in plan.sources]
    assert names == ["deck.ic", "two.urdf"]
    assert plan.sources[1].text == TWO and plan.sources[1].sha256 == hashlib.sha256(TWO.encode()).hexdigest()
    plan_file.write(plan, tmp_path / "p.json")
    (tmp_path / "two.urdf").unlink()
    assert (run.run(plan_file.read(tmp_path / "p.json").experiments[0]).status == 0).all()


def test_explain_shows_the_files_line(tmp_path: Path) -> None:
    (found,) = explain(check_file(tmp_path, DECK), "links.bar.mass")
    assert found.value == 2.0 and found.written == "2 kg" and found.place is not None
    assert (Path(found.place.file).name, found.place.line, found.place.column) == ("two.urdf", 6, 20)
    (over,) = explain(check_file(tmp_path, changed(DECK, ("{ }", "{ bar { mass = 3 kg; } }"))), "links.bar.mass")
    assert [(Path(each.file).name, each.line) for each in over.overrode] == [("two.urdf", 6)]


def test_explain_says_of_what_is_not_written_that_it_is_not(tmp_path: Path) -> None:
    turned = changed(TWO, ('rpy="0 0 0"', 'rpy="0 0 1"'), ('<axis xyz="0 0 1"/>', '<limit lower="-1"/>'))
    turned = turned.replace("</robot>", OTHER)
    deck = check_file(tmp_path, DECK)
    deck.with_name("two.urdf").write_text(turned, encoding="utf-8")
    notes = {}
    for path in ("hinge.q_min", "hinge.q_max", "hinge.axis.x", "links.bar.inertia.xx", "links.tip.mass"):
        (found,) = explain(deck, path)
        notes[path] = found.note
    assert notes == {
        "hinge.q_min": "",
        "hinge.q_max": LEFT_OUT,
        "hinge.axis.x": LEFT_OUT,
        "links.bar.inertia.xx": TURNED,
        "links.tip.mass": LEFT_OUT,
    }
    (product,) = explain(check_file(tmp_path, DECK), "links.bar.inertia.xy")
    assert product.note == "written here as 0, or left out"


def test_explain_prints_what_a_deck_overrides_of_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    check_file(tmp_path, changed(DECK, ("{ }", "{ bar { mass = 3 kg; } }")))
    assert cli.main(["explain", str(tmp_path / "deck.ic"), "links.bar.mass"]) == 0
    assert (
        capsys.readouterr().out.replace(f"{tmp_path}/", "")
        == """\
links.bar.mass = 3 kg
 --> deck.ic:1:46
  |
1 | arm two from urdf("two.urdf") { bar { mass = 3 kg; } }
  |                                              ^^^^ written here
 ::: two.urdf:6:20  overrides `2`
"""
    )


def test_a_file_is_looked_for_beside_the_deck_and_then_where_i_says(tmp_path: Path) -> None:
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "two.urdf").write_text(TWO, encoding="utf-8")
    (tmp_path / "deck.ic").write_text(DECK, encoding="utf-8")
    assert ic.check(tmp_path / "deck.ic").plan is None
    assert ic.check(tmp_path / "deck.ic", include_dirs=[tmp_path / "robots"]).plan is not None


def test_a_plain_robot_is_told_nothing_of(tmp_path: Path) -> None:
    assert said(tmp_path) == ""


RICH = """\
<robot name="rich">
  <material name="grey"/>
  <link name="m">
    <inertial> <mass value="9"/> <inertia ixx="1" iyy="1" izz="1"/> </inertial>
    <visual/> <collision/>
  </link>
  <link name="2nd-arm">
    <inertial> <mass value="2"/> <inertia ixx="1" iyy="1" izz="1"/> </inertial>
    <visual/>
  </link>
  <joint name="base" type="revolute">
    <parent link="m"/> <child link="2nd-arm"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/>
    <dynamics damping="0.1" friction="0"/>
  </joint>
  <transmission name="t"/>
</robot>
"""


def test_what_is_not_taken_over_and_what_is_called_otherwise_is_told_once_each(tmp_path: Path) -> None:
    deck = DECK.replace("arm two from", "#define NOT_TWICE\narm two from")
    assert (
        said(tmp_path, RICH, deck)
        == """\
warning[D210]: not all that `two.urdf` says is in this arm
 --> deck.ic:2:19
  |
2 | arm two from urdf("two.urdf") { }
  |                   ^^^^^^^^^^
 ::: two.urdf:14:5  damping and friction of 1 joint (base_joint): a servo has these, such as `passive`
 ::: two.urdf:5:5  not read: 2 `visual`, 1 `collision`, 1 `material`, 1 `transmission`
  = help: `met import` makes a deck of such a file, with friction beside each joint

warning[D211]: 2 names of `two.urdf` are another in decks
 --> deck.ic:2:19
  |
2 | arm two from urdf("two.urdf") { }
  |                   ^^^^^^^^^^
 ::: two.urdf:7:15  link `2nd-arm` is `_2nd_arm`
 ::: two.urdf:11:16  joint `base` is `base_joint`
  = help: a deck's names are letters, digits and `_`, each once
"""
    )


# Names


def named(links: list[str], joints: list[str]) -> tuple[list[str], list[str]]:
    """Deck's names of links behind a root, each on a joint."""
    text = '<robot name="x"><link name="root"/>' + "".join(f'<link name="{name}"/>' for name in links)
    text += "".join(
        f'<joint name="{joint}" type="fixed"><parent link="root"/><child link="{link}"/></joint>'
        for joint, link in zip(joints, links, strict=True)
    )
    names = deck_names(read("x.urdf", text + "</robot>"))
    return [names.links[name] for name in links], [names.joints[name] for name in joints]


def test_names_become_a_decks_and_no_two_the_same() -> None:
    links = ["arm-1", "arm 1", "arm_1", "arm/1", "1", "base", "m", "rate", "é", "-"]
    joints = ["links", "initial", "kg", "arm_1", "j 1", "j_1", "__LINE__", "x" * 300, "x" * 301, "shoulder"]
    assert named(links, joints) == (
        ["arm_1_2", "arm_1_3", "arm_1", "arm_1_4", "_1", "base_link", "m_link", "rate", "_", "__2"],
        [
            "links_joint",
            "initial_joint",
            "kg_joint",
            "arm_1_joint",
            "j_1_2",
            "j_1",
            "__LINE___joint",
            "x" * 200,
            "x" * 200 + "_2",
            "shoulder",
        ],
    )


def test_names_that_need_no_change_are_not_told(tmp_path: Path) -> None:
    assert "D211" not in said(tmp_path, changed(TWO, ('"hinge"', '"at"'), ('"bar"', '"sample"'), ('"bar"', '"sample"')))
