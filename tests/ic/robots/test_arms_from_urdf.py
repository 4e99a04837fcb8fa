"""Arms made from URDF files: as Pinocchio reads them, overridden as any base, named, explained, kept in the plan."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

import ic
from ic.driver.explain import explain
from ic.driver.import_robot import import_robot
from ic.robots.entries import moments, rotation
from ic.robots.names import deck_names
from ic.robots.urdf import read
from met import cli, run
from met.plan import Experiment
from met.plan import file as plan_file
from tests.ic.robots.two import DECK, TWO, changed, check, said
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


@pytest.mark.oracle
def test_random_robots_move_as_pinocchio_reads_them(tmp_path: Path) -> None:
    poses, torques, accelerations = Worst("poses"), Worst("tau against rnea"), Worst("qdd against aba")
    path = tmp_path / "random.urdf"
    for seed in SEEDS:
        path.write_text(random_urdf(seed), encoding="utf-8")
        see(made_from(path, tmp_path), path, f"seed {seed}", poses, torques, accelerations)
    for worst in (poses, torques, accelerations):
        worst.below(CLOSE)


@pytest.mark.slow
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


def test_a_joint_that_follows_another_moves_by_itself_once_its_mimic_is_removed(tmp_path: Path) -> None:
    robot = changed(TWO, ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><mimic joint="other"/>'))
    assert (
        made(tmp_path, robot, changed(DECK, ("{ }", "{ hinge { remove mimic; } }"))).structure.moving[0].name == "hinge"
    )
    fixed = "{ remove hinge;  joint hinge fixed { parent = base;  child = bar; }  link tip { mass = 1 kg; shape = sphere(radius = 1 cm); }  joint turn revolute { parent = bar; child = tip; axis = z; } }"
    assert [joint.kind for joint in made(tmp_path, robot, changed(DECK, ("{ }", fixed))).structure.joints] == [
        "fixed",
        "revolute",
    ]


@pytest.mark.parametrize("kind", ["floating", "planar", "spherical"])
def test_a_joint_that_met_has_not_may_be_put_in_another_way(kind: str, tmp_path: Path) -> None:
    robot = changed(TWO, ("revolute", kind))
    other = "{ remove hinge;  joint hinge prismatic { parent = base;  child = bar;  axis = z; } }"
    assert "D212" in said(tmp_path, robot)
    assert made(tmp_path, robot, changed(DECK, ("{ }", other))).structure.moving[0].kind == "prismatic"


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
 ::: two.urdf:4:5  the inertia of `m`: it is `base`, the ground
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
