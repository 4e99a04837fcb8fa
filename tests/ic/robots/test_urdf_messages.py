"""Mistakes in the robot of a URDF file: whole messages."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.robots.two import OTHER, TWO, changed, said

# ruff: noqa: E501 - messages are as wide as they are


def mistake(what: str, *changes: tuple[str, str], says: str) -> tuple[str, str | bytes, str]:
    return what, changed(TWO, *changes), says


MISTAKES = [  # what, the file's text, what is said
    mistake(
        "a link without a mass",
        ('      <mass value="2"/>\n', ""),
        says="""\
error[D205]: this `<inertial>` has no `<mass>`
 --> two.urdf:4:5
  |
4 |     <inertial>
  |     ^^^^^^^^^
  = help: write `<mass value="..."/>`
""",
    ),
    mistake(
        "a number with a unit",
        ('value="2"', 'value="2 kg"'),
        says="""\
error[D206]: `kg` is not a number
 --> two.urdf:6:20
  |
6 |       <mass value="2 kg"/>
  |                    ^^^^
  = help: a number is finite, and written as 12.5 or -1e-3, without a unit
""",
    ),
    mistake(
        "a number that is none",
        ('value="2"', 'value="nan"'),
        says="""\
error[D206]: `nan` is not a number
 --> two.urdf:6:20
  |
6 |       <mass value="nan"/>
  |                    ^^^
  = help: a number is finite, and written as 12.5 or -1e-3, without a unit
""",
    ),
    mistake(
        "a number too large",
        ('value="2"', 'value="1e999"'),
        says="""\
error[D206]: `1e999` is not a number
 --> two.urdf:6:20
  |
6 |       <mass value="1e999"/>
  |                    ^^^^^
  = help: a number is finite, and written as 12.5 or -1e-3, without a unit
""",
    ),
    mistake(
        "two numbers for three",
        ('"0.5 0 0"', '"0.5 0"'),
        says="""\
error[D206]: 3 numbers are needed in `xyz` of `<origin>`, not 2
 --> two.urdf:5:20
  |
5 |       <origin xyz="0.5 0" rpy="0 0 0"/>
  |                    ^^^^^
  = help: spaces part the numbers
""",
    ),
    mistake(
        "a mass below zero",
        ('value="2"', 'value="-2"'),
        says="""\
error[D077]: `mass` of link `bar` must be at least 0 kg
 --> two.urdf:6:20
  |
6 |       <mass value="-2"/>
  |                    ^^ this is -2 kg
  = help: write a number of at least 0 kg (mass of the link)
""",
    ),
    mistake(
        "an inertia without mass",
        ('value="2"', 'value="0"'),
        says="""\
error[D087]: the inertia of link `bar` is no body's
 --> two.urdf:7:7
  |
7 |       <inertia ixx="0.1" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/>
  |       ^^^^^^^^ the link has no mass, and so no inertia
  = help: leave `inertia` out, or write the link's mass
  = help: in the arm's block: `bar { remove inertia; }`
  = help: if it is of an identified set (base parameters), which need be no body's: in the arm's block, `bar { lumped = on; }`
""",
    ),
    mistake(
        "a moment left out",
        ('ixx="0.1" ', ""),
        says="""\
error[D205]: this `<inertia>` has no `ixx`
 --> two.urdf:7:7
  |
7 |       <inertia iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/>
  |       ^^^^^^^^
  = help: write `<inertia ixx="..." iyy="..." izz="..." ixy="0" ixz="0" iyz="0"/>`
""",
    ),
    mistake(
        "an inertia of no body",
        ('izz="0.2"', 'izz="0.9"'),
        says="""\
error[D087]: the inertia of link `bar` is no body's
 --> two.urdf:7:7
  |
7 |       <inertia ixx="0.1" iyy="0.2" izz="0.9" ixy="0" ixz="0" iyz="0"/>
  |       ^^^^^^^^ principal moments 0.1, 0.2 and 0.9 kg*m^2; no body has one above the sum of the others
  = help: inertia is about the centre of mass, in link axes: [xx, yy, zz] or [xx, yy, zz, xy, xz, yz] kg*m^2
  = help: products have the sign of -sum(m x y)
  = help: in the arm's block: `bar { inertia = [...] kg*m^2; }`
  = help: if it is of an identified set (base parameters), which need be no body's: in the arm's block, `bar { lumped = on; }`
""",
    ),
    mistake(
        "an attribute that says where",
        ('rpy="0 0 0"', 'quat="1 0 0 0"'),
        says="""\
error[D208]: `<origin>` has no attribute `quat`
 --> two.urdf:5:29
  |
5 |       <origin xyz="0.5 0 0" quat="1 0 0 0"/>
  |                             ^^^^
  = help: it has `xyz`, `rpy`
""",
    ),
    mistake(
        "numbers with commas",
        ('xyz="0.5 0 0"', 'xyz="0.5, 0, 0"'),
        says="""\
error[D206]: `0.5,` is not a number
 --> two.urdf:5:20
  |
5 |       <origin xyz="0.5, 0, 0" rpy="0 0 0"/>
  |                    ^^^^^^^^^
  = help: spaces part the numbers, not commas
""",
    ),
    mistake(
        "an attribute misspelt",
        ('rpy="0 0 0"', 'rpz="0 0 1"'),
        says="""\
error[D208]: `<origin>` has no attribute `rpz`
 --> two.urdf:5:29
  |
5 |       <origin xyz="0.5 0 0" rpz="0 0 1"/>
  |                             ^^^
  = help: did you mean `rpy`?
  = help: it has `xyz`, `rpy`
""",
    ),
    mistake(
        "a child that is not there",
        ('<child link="bar"/>', '<child link="bra"/>'),
        says="""\
error[D207]: no link `bra` in this file
  --> two.urdf:12:18
   |
12 |     <child link="bra"/>
   |                  ^^^
  ::: two.urdf:10:16  joint `hinge`
   = help: did you mean `bar`?
   = help: links: bar, ground
""",
    ),
    mistake(
        "a joint without a child",
        ('    <child link="bar"/>\n', ""),
        says="""\
error[D205]: this `<joint>` has no `<child>`
  --> two.urdf:10:3
   |
10 |   <joint name="hinge" type="revolute">
   |   ^^^^^^
   = help: write `<child link="..."/>`
""",
    ),
    mistake(
        "a joint without a type",
        (' type="revolute"', ""),
        says="""\
error[D205]: this `<joint>` has no `type`
  --> two.urdf:10:3
   |
10 |   <joint name="hinge">
   |   ^^^^^^
   = help: write `<joint name="..." type="revolute">`
""",
    ),
    mistake(
        "a type that is none",
        ("revolute", "revolut"),
        says="""\
error[D090]: no kind of joint `revolut`
  --> two.urdf:10:29
   |
10 |   <joint name="hinge" type="revolut">
   |                             ^^^^^^^
   = help: did you mean `revolute`?
   = help: write `joint hinge revolute { ... }`, or prismatic, or fixed
""",
    ),
    mistake(
        "a planar joint",
        ("revolute", "planar"),
        says="""\
error[D212]: joint `hinge` is planar, and joints are revolute, prismatic or fixed
  --> two.urdf:10:29
   |
10 |   <joint name="hinge" type="planar">
   |                             ^^^^^^
   = help: two prismatic joints and a revolute one do the same; put links of `mass = 0 kg` between them
   = help: in the arm's block, `remove hinge;` makes room for them
""",
    ),
    mistake(
        "a floating joint",
        ("revolute", "floating"),
        says="""\
error[D212]: joint `hinge` is floating, and joints are revolute, prismatic or fixed
  --> two.urdf:10:29
   |
10 |   <joint name="hinge" type="floating">
   |                             ^^^^^^^^
   = help: in the arm's block, `remove hinge;  joint hinge fixed { parent = base;  child = bar; }`, and in the run `base = free;`: base and `bar` then float as one
""",
    ),
    mistake(
        "a joint that follows one that is fixed",
        ('<axis xyz="0 0 1"/>', '<mimic joint="other" multiplier="-1"/>'),
        ("</robot>", OTHER),
        says="""\
error[D213]: no moving joint `other` for joint `hinge` to follow
  --> two.urdf:13:19
   |
13 |     <mimic joint="other" multiplier="-1"/>
   |                   ^^^^^
   = help: joints that move: none
   = help: in the arm's block, `hinge { remove follows; }` lets it move by itself
""",
    ),
    mistake(
        "a joint that follows none that there is",
        ('<axis xyz="0 0 1"/>', '<mimic joint="othre"/>'),
        ("</robot>", OTHER),
        says="""\
error[D207]: no joint `othre` in this file
  --> two.urdf:13:19
   |
13 |     <mimic joint="othre"/>
   |                   ^^^^^
  ::: two.urdf:10:16  joint `hinge`
   = help: did you mean `other`?
   = help: joints: hinge, other
""",
    ),
    mistake(
        "joints that follow each other",
        ('<axis xyz="0 0 1"/>', '<mimic joint="other"/>'),
        ("</robot>", OTHER.replace("<parent", '<mimic joint="hinge"/> <parent')),
        says="""\
error[D213]: joint `hinge` follows itself: hinge -> other -> hinge
  --> two.urdf:13:19
   |
13 |     <mimic joint="other"/>
   |                   ^^^^^
   = help: remove the `<mimic>` of one of these joints in the file: it then moves by itself; no deck and no `--mimic` can change it
""",
    ),
    mistake(
        "a limit with a decimal comma and one in degrees",
        ("<axis", '<limit lower="-180deg" upper="3,14" effort="5 Nm" velocity="nan"/> <axis'),
        says="""\
error[D206]: `-180deg` is not a number
  --> two.urdf:13:19
   |
13 |     <limit lower="-180deg" upper="3,14" effort="5 Nm" velocity="nan"/> <axis xyz="0 0 1"/>
   |                   ^^^^^^^
   = help: a number is finite, and written as 12.5 or -1e-3, without a unit; `-inf` stands for no limit

error[D206]: `3,14` is not a number
  --> two.urdf:13:35
   |
13 |     <limit lower="-180deg" upper="3,14" effort="5 Nm" velocity="nan"/> <axis xyz="0 0 1"/>
   |                                   ^^^^
   = help: the decimal sign is a point: `3.14`

error[D206]: `Nm` is not a number
  --> two.urdf:13:49
   |
13 |     <limit lower="-180deg" upper="3,14" effort="5 Nm" velocity="nan"/> <axis xyz="0 0 1"/>
   |                                                 ^^^^
   = help: a number is finite, and written as 12.5 or -1e-3, without a unit; `inf` stands for no limit

error[D206]: `nan` is not a number
  --> two.urdf:13:65
   |
13 |     <limit lower="-180deg" upper="3,14" effort="5 Nm" velocity="nan"/> <axis xyz="0 0 1"/>
   |                                                                 ^^^
   = help: a number is finite, and written as 12.5 or -1e-3, without a unit; `inf` stands for no limit
""",
    ),
    mistake(
        "a limit that xacro would fill in, and an endless one on the wrong side",
        ("<axis", '<limit lower="inf" upper="$(arg up)"/> <axis'),
        says="""\
error[D206]: `lower` cannot be `inf`
  --> two.urdf:13:19
   |
13 |     <limit lower="inf" upper="$(arg up)"/> <axis xyz="0 0 1"/>
   |                   ^^^
   = help: `-inf` stands for no limit

error[D203]: `$(arg up)` is to be filled in
  --> two.urdf:13:31
   |
13 |     <limit lower="inf" upper="$(arg up)"/> <axis xyz="0 0 1"/>
   |                               ^^^^^^^^^
   = help: this is xacro, from which a URDF file is made: run `xacro FILE > robot.urdf` and take that
""",
    ),
    mistake(
        "limits the wrong way round, and below zero",
        ("<axis", '<limit lower="1" upper="-1" effort="-5" velocity="2"/> <axis'),
        says="""\
error[D241]: `q_min` of joint `hinge` must be less than `q_max`
  --> two.urdf:13:19
   |
13 |     <limit lower="1" upper="-1" effort="-5" velocity="2"/> <axis xyz="0 0 1"/>
   |                   ^ 1 rad is not less than -1 rad
   = help: swap them, or leave both out: a range has two ends
   = help: in the arm's block: `hinge { remove q_min;  remove q_max; }`, or write both there

error[D077]: `tau_max` of joint `hinge` must be above 0 N*m
  --> two.urdf:13:41
   |
13 |     <limit lower="1" upper="-1" effort="-5" velocity="2"/> <axis xyz="0 0 1"/>
   |                                         ^^ this is -5 N*m
   = help: write a number above 0 N*m (largest torque of the servo on the joint in either direction)
""",
    ),
    mistake(
        "a range of one end",
        ("<axis", '<limit lower="1" upper="inf"/> <axis'),
        says="""\
error[D346]: joint `hinge` has `q_min` and no `q_max`
  --> two.urdf:13:19
   |
13 |     <limit lower="1" upper="inf"/> <axis xyz="0 0 1"/>
   |                   ^
   = help: write `q_max` too: a range has two ends
   = help: in the arm's block: `hinge { q_max = ...; }`
""",
    ),
    mistake(
        "an attribute in capitals, and an element",
        ("<axis", '<Limits lower="-1"/> <limit Lower="-1"/> <axis'),
        says="""\
error[D208]: `<joint>` has no element `<Limits>`
  --> two.urdf:13:5
   |
13 |     <Limits lower="-1"/> <limit Lower="-1"/> <axis xyz="0 0 1"/>
   |     ^^^^^^^
   = help: did you mean `limit`?

error[D208]: `<limit>` has no attribute `Lower`
  --> two.urdf:13:33
   |
13 |     <Limits lower="-1"/> <limit Lower="-1"/> <axis xyz="0 0 1"/>
   |                                 ^^^^^
   = help: did you mean `lower`?
   = help: it has `lower`, `upper`, `effort`, `velocity`
""",
    ),
    mistake(
        "an element in the place of an attribute",
        ("<axis", "<limit> <lower>-1</lower> </limit> <axis"),
        says="""\
error[D208]: `<limit>` has no element `<lower>`
  --> two.urdf:13:13
   |
13 |     <limit> <lower>-1</lower> </limit> <axis xyz="0 0 1"/>
   |             ^^^^^^
   = help: `lower` is an attribute: `<limit lower="..." upper="..." effort="..." velocity="..."/>`
""",
    ),
    mistake(
        "an axis without direction",
        ("0 0 1", "0 0 0"),
        says="""\
error[D097]: the axis of joint `hinge` has no direction
  --> two.urdf:13:16
   |
13 |     <axis xyz="0 0 0"/>
   |                ^^^^^
   = help: write numbers of ordinary size, not all of them zero
""",
    ),
    mistake(
        "negative damping",
        ('    <axis xyz="0 0 1"/>\n', '    <dynamics damping="-1"/>\n'),
        says="""\
error[D206]: `damping` is below 0
  --> two.urdf:13:24
   |
13 |     <dynamics damping="-1"/>
   |                        ^^
   = help: write 0, or a number above it
""",
    ),
    mistake(
        "two links of one name",
        ('<link name="ground"/>', '<link name="ground"/>\n  <link name="bar"/>'),
        says="""\
error[D204]: link `bar` is there twice
 --> two.urdf:4:15
  |
4 |   <link name="bar">
  |               ^^^ again
 ::: two.urdf:3:15  first
  = help: give one of the two another name
""",
    ),
    mistake(
        "two masses",
        ('<mass value="2"/>', '<mass value="2"/>\n      <mass value="1"/>'),
        says="""\
error[D204]: `<mass>` is there twice in this `<inertial>`
 --> two.urdf:7:7
  |
7 |       <mass value="1"/>
  |       ^^^^^ again
 ::: two.urdf:6:7  first
  = help: remove one of the two
""",
    ),
    mistake(
        "two bases",
        ('<link name="ground"/>', '<link name="ground"/>\n  <link name="other"/>'),
        says="""\
error[D209]: 2 links of this robot hang on no other, and an arm has one base
 --> two.urdf:2:15
  |
2 |   <link name="ground"/>
  |               ^^^^^^ ground
 ::: two.urdf:3:15  other
  = help: join them by a `<joint type="fixed">`, or take one of the robots out of the file
""",
    ),
    mistake(
        "two parents",
        (
            "  <joint",
            '  <joint name="first" type="fixed"> <parent link="ground"/> <child link="bar"/> </joint>\n  <joint',
        ),
        says="""\
error[D098]: link `bar` has two parents
  --> two.urdf:11:16
   |
11 |   <joint name="hinge" type="revolute">
   |                ^^^^^ `base`
  ::: two.urdf:10:16  `base`, by joint `first`
   = help: a branch is a parent with two children
   = help: a stiff `bushing` closes a chain: in the arm's block, `remove hinge;`
   = help: then, in the run's `environment`: `hinge = bushing { link = bar;  stiffness = [100000, 100000, 100000] N/m;  damping = [100, 100, 100] N*s/m;  turning = [1000, 1000, 0] N*m/rad;  turning_damping = [1, 1, 0] N*m*s/rad; }`
""",
    ),
    mistake(
        "a loop without a base",
        (
            "  <joint",
            '  <joint name="back" type="fixed"> <parent link="bar"/> <child link="ground"/> </joint>\n  <joint',
        ),
        says="""\
error[D209]: every link of this robot hangs on another: none is its base
  --> two.urdf:10:16
   |
10 |   <joint name="back" type="fixed"> <parent link="bar"/> <child link="ground"/> </joint>
   |                ^^^^
  ::: two.urdf:11:16  joint `hinge`
   = help: one of the joints closes a loop: take it out, and close it by a stiff `bushing` in the run
""",
    ),
    mistake(
        "a loop beside the arm",
        (
            "</robot>",
            '  <link name="a"/>\n  <link name="b"/>\n  <joint name="ab" type="fixed"> <parent link="a"/> <child link="b"/> </joint>\n  <joint name="ba" type="fixed"> <parent link="b"/> <child link="a"/> </joint>\n</robot>',
        ),
        says="""\
error[D086]: these joints make a loop, which hangs on no base: a -> b -> a
  --> two.urdf:18:16
   |
18 |   <joint name="ba" type="fixed"> <parent link="b"/> <child link="a"/> </joint>
   |                ^^ joint `ba` closes it
  ::: two.urdf:17:16  joint `ab`
   = help: one of them should have `parent = base;`
""",
    ),
    mistake(
        "no mass to move",
        (
            '    <inertial>\n      <origin xyz="0.5 0 0" rpy="0 0 0"/>\n      <mass value="2"/>\n      <inertia ixx="0.1" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/>\n    </inertial>\n',
            "",
        ),
        says="""\
error[D217]: joint `hinge` moves nothing that has mass
 --> two.urdf:5:16
  |
5 |   <joint name="hinge" type="revolute">
  |                ^^^^^
  = help: write the mass of link `bar`, or of one that it carries
  = help: or make the joint fixed
""",
    ),
]


@pytest.mark.slow
@pytest.mark.parametrize(("text", "says"), [each[1:] for each in MISTAKES], ids=[each[0] for each in MISTAKES])
def test_a_mistake_is_told_at_its_place(text: str | bytes, says: str, tmp_path: Path) -> None:
    assert said(tmp_path, text) == says
