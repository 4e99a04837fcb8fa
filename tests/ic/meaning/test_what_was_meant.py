"""Mistakes whose remedy is not the nearest word: what was meant is said, once. Whole messages."""

from __future__ import annotations

from pathlib import Path

from tests.ic.small_decks import ARM, RUN, changed, check, shown

IDEAL = "servo drive { model = ideal; bandwidth = 2 1/s; command = position(0 rad); }\n"
ARMS = changed(
    ARM,
    (
        "axis = z; }",
        """axis = z; }
    link tip { mass = 1 kg; shape = sphere(radius = 1 cm); }
    link end { mass = 1 kg; shape = sphere(radius = 1 cm); }
    joint wrist revolute { parent = bar; child = end; axis = z; }
    joint glue  fixed    { parent = bar; child = tip; }""",
    ),
)


def test_a_wrong_unit_of_a_vector_is_told_once(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, changed(ARM, ("axis = z;", "axis = z; at = [1, 2, 3] s;")), IDEAL, RUN)
        == """\
error[D061]: `at` of joint `hinge` is in m, and this is in s
 --> deck.ic:3:71
  |
3 |     joint hinge revolute { parent = base; child = bar; axis = z; at = [1, 2, 3] s; }
  |                                                                       ^^^^^^^^^
  = help: write it in m, km, cm, mm, um, inch or ft
"""
    )


def test_a_course_without_a_kind_of_command(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, changed(IDEAL, ("position(0 rad)", 'trajectory("f.csv")')), RUN)
        == """\
error[D152]: `trajectory` is a course in time, and a command is of a kind
 --> deck.ic:5:59
  |
5 | servo drive { model = ideal; bandwidth = 2 1/s; command = trajectory("f.csv"); }
  |                                                           ^^^^^^^^^^^^^^^^^^^
  = help: write `position(trajectory(...))`
  = help: ideal takes rate(...), position(...), acceleration(...)
"""
    )


def test_a_course_of_named_values_without_a_kind_of_command(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, changed(IDEAL, ("position(0 rad)", "trapezoid(to = 1 rad)")), RUN)
        == """\
error[D152]: `trapezoid` is a course in time, and a command is of a kind
 --> deck.ic:5:59
  |
5 | servo drive { model = ideal; bandwidth = 2 1/s; command = trapezoid(to = 1 rad); }
  |                                                           ^^^^^^^^^^^^^^^^^^^^^
  = help: write `position(trapezoid(...))`
  = help: ideal takes rate(...), position(...), acceleration(...)
"""
    )


def test_a_rate_in_degrees(tmp_path: Path) -> None:
    course = "trapezoid(to = 1 rad, max_rate = 60 deg, max_acceleration = 1 rad/s^2)"
    assert (
        shown(tmp_path, ARM, changed(IDEAL, ("0 rad", course)), RUN)
        == """\
error[D061]: `max_rate` of `trapezoid` is in rad/s, and this is in rad
 --> deck.ic:5:101
  |
5 | ...sition(trapezoid(to = 1 rad, max_rate = 60 deg, max_acceleration = 1 rad/s^2)); }
  |                                            ^^^^^^
  = help: write it in rad/s, deg/s or rpm
"""
    )


def test_a_jacobian_of_a_joint_that_does_not_carry_the_link(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARMS, IDEAL, changed(RUN, ("[q]", "[links.tip.jacobian.linear.wrist.z]")))
        == """\
error[D125]: no channel `links.tip.jacobian.linear.wrist.z`
  --> deck.ic:15:15
   |
15 |     record = [links.tip.jacobian.linear.wrist.z];
   |               ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
   = help: joint `wrist` does not carry link `tip`, so it does not move it
"""
    )


def test_a_reaction_of_a_fixed_joint(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARMS, IDEAL, changed(RUN, ("[q]", "[glue.reaction]")))
        == """\
error[D125]: no channel `glue.reaction`
  --> deck.ic:15:15
   |
15 |     record = [glue.reaction];
   |               ^^^^^^^^^^^^^
   = help: joint `glue` is fixed: its two links move as one body, and nothing is computed between them; what they take shows in the reaction of the moving joint that carries them
"""
    )


def test_uses_of_a_macro_that_was_refused_are_silent(tmp_path: Path) -> None:
    macros = "#define BAR(NAME, m) link NAME { mass = m; shape = rod(length = 1 m, along = x); }\n#define s(X) 3 X\n"
    arm = changed(
        ARM,
        ("link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }", "BAR(bar,\n        2 kg)"),
        ("axis = z;", "axis = z; at = [0 m, s(m), 0 m];"),
    )
    assert (
        shown(tmp_path, macros, arm, IDEAL, RUN)
        == """\
error[D011]: a macro's parameter cannot be called `m`: in its body that is the unit metre
 --> deck.ic:1:19
  |
1 | #define BAR(NAME, m) link NAME { mass = m; shape = rod(length = 1 m, along = x); }
  |                   ^
 ::: deck.ic:1:67  this `m` would be the argument, not the unit
  = help: choose another name for it

error[D011]: a macro cannot be called `s`: that is the unit second
 --> deck.ic:2:9
  |
2 | #define s(X) 3 X
  |         ^
  = help: it would replace the unit in every quantity after it: `2 s` would lose its unit
"""
    )


def test_a_name_that_was_refused_may_be_defined_soundly_after(tmp_path: Path) -> None:
    macros = "#define BAR(NAME, m) link NAME { at = 2 m }\n#define BAR(NAME, MASS) link NAME { mass = MASS }\n"
    arm = changed(ARM, ("link bar", "BAR(end, 2 kg)\n    link bar"))
    codes = [each.code for each in check(tmp_path, macros, arm, IDEAL, RUN).diagnostics]
    assert codes == ["D011", "D021"]  # its own body has no `;`
