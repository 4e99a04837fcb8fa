"""Mistakes of those who come from elsewhere: the remedy is one that they can take. Whole messages."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ic.driver.compile import Compiled
from met import models
from tests.ic.meaning.test_reported_once import ARM, RUN, SLIDE
from tests.ic.small_decks import ARM as SWING
from tests.ic.small_decks import RUN as HOLD
from tests.ic.small_decks import SERVO, changed, check, messages


def said(compiled: Compiled) -> str:
    """What is said of a deck, without the counting line."""
    return messages(compiled).rpartition("\n\n")[0] + "\n"


def helps(compiled: Compiled) -> list[tuple[str, ...]]:
    return [each.help for each in compiled.diagnostics]


def test_a_bare_value_is_shown_the_kind_of_command_that_its_servo_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = models.find

    def of_positions(kind: models.Kind, name: str, place: Any = None) -> Any:
        found = find(kind, name, place)
        return replace(found, commands=("position",)) if kind == "servo" else found

    monkeypatch.setattr(models, "find", of_positions)
    servo = changed(SERVO, ("rate(0.1 rad/s)", "0.1 rad"))
    assert (
        said(check(tmp_path, SWING, servo, HOLD))
        == """\
error[D151]: a command is its kind and one value or course in time
 --> deck.ic:9:15
  |
9 |     command = 0.1 rad;
  |               ^^^^^^^
  = help: rigid_gearbox takes position(...): `position(30 deg)` or `position(step(to = ...))`
"""
    )
    sliding = changed(SWING, ("revolute", "prismatic"))
    assert "`position(0.1 m)` or " in said(check(tmp_path, sliding, changed(servo, ("100", "100 rad/m")), HOLD))


def test_a_ratio_of_a_definition_that_turns_some_joints_and_slides_another(tmp_path: Path) -> None:
    run = changed(RUN, ("lift = slide", "lift = drive { command = rate(0.1 m/s); }"))
    assert (
        said(check(tmp_path, ARM, SERVO, run))
        == """\
error[D060]: `ratio` of servo `drive` on joint `lift` is in rad/m, and this is a bare number
  --> deck.ic:11:13
   |
11 |     ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
   |             ^^^
   = help: joint `lift` slides, and others of servo `drive` turn: give its servo a ratio of its own, `lift = drive { ratio = 100 rad/m; }`
"""
    )


def test_taking_that_remedy_leaves_no_mistake(tmp_path: Path) -> None:
    run = changed(RUN, ("lift = slide", "lift = drive { command = rate(0.1 m/s); ratio = 100 rad/m; }"))
    assert said(check(tmp_path, ARM, SERVO, run)) == "\n"


def test_an_inherited_ratio_belongs_into_the_definition_that_slides(tmp_path: Path) -> None:
    slide = changed(SLIDE, ("ratio = 1 cycle/cm; ", ""))
    assert helps(check(tmp_path, ARM, SERVO, slide, RUN)) == [
        ("joint `lift` slides, and others of servo `drive` turn: write `ratio = 100 rad/m;` in servo `slide`",)
    ]


def test_a_ratio_of_a_screw_on_joints_that_turn(tmp_path: Path) -> None:
    servo = changed(SERVO, ("ratio = 100", "ratio = 100 rad/m"))
    assert helps(check(tmp_path, ARM, servo, changed(SLIDE, ("ratio = 1 cycle/cm; ", "")), RUN)) == [
        (
            "joint `hinge` turns, and others of servo `drive` slide: give its servo a ratio of its own, "
            "`hinge = drive { ratio = ...; }`",
        )
    ]


def test_a_command_of_joints_that_move_otherwise(tmp_path: Path) -> None:
    run = changed(RUN, ("lift = slide", "lift = drive { ratio = 100 rad/m; }"))
    assert helps(check(tmp_path, ARM, SERVO, run)) == [
        (
            "joint `lift` slides, and others of servo `drive` turn: give its servo a command of its own, "
            "`lift = drive { command = rate(...); }`",
        )
    ]


def test_what_is_wrong_on_every_joint_has_the_usual_remedy(tmp_path: Path) -> None:
    servo = changed(SERVO, ("kp = 0.1 V*s/rad", "kp = 0.1"))
    assert helps(check(tmp_path, ARM, servo, SLIDE, RUN)) == [("write `0.1 V*s/rad`",)]
    alone = changed(RUN, ("hinge = drive; elbow = drive { f_c = 1 N*m; } lift = slide;", "lift = slide;"))
    bare = changed(SLIDE, ("1 cycle/cm", "628"))
    assert helps(check(tmp_path, ARM, SERVO, bare, alone)) == [("write `628 rad/m`",)]


def test_a_normal_distribution_that_leaves_the_range_of_its_parameter(tmp_path: Path) -> None:
    sweep = "default sweep spread of hold { sample lhs(20) { drive.tau_max = normal(0.02, 0.03) N*m; } }\n"
    assert (
        said(check(tmp_path, SWING, SERVO, HOLD, sweep))
        == """\
error[D077]: `tau_max` of servo `drive` must be above 0 N*m; case #8 breaks it, and 4 more
  --> deck.ic:18:49
   |
18 | default sweep spread of hold { sample lhs(20) { drive.tau_max = normal(0.02, 0.03) N*m; } }
   |                                                 ^^^^^^^^^^^^^ this is -0.00740745 N*m
   = help: case #8: drive.tau_max = -0.00740744883737 N*m
   = help: a normal distribution has no bounds: `truncated(mean, deviation, from, to) N*m` has two
"""
    )
    cut = changed(sweep, ("normal(0.02, 0.03)", "truncated(0.02, 0.03, 0.001, 0.1)"))
    assert said(check(tmp_path, SWING, SERVO, HOLD, cut)) == "\n"


def test_a_let_that_is_drawn_from_a_normal_distribution(tmp_path: Path) -> None:
    sweep = "default sweep spread of hold { sample lhs(20) { torque = normal(0.02, 0.03) N*m; } }\n"
    servo = changed(SERVO, ("tau_max = 1 N*m", "tau_max = torque"))
    (found,) = helps(check(tmp_path, "let torque = 1 N*m;\n", SWING, servo, HOLD, sweep))
    assert found[1:] == ("a normal distribution has no bounds: `truncated(mean, deviation, from, to) N*m` has two",)


def test_values_of_another_distribution_or_of_a_list_keep_the_usual_remedy(tmp_path: Path) -> None:
    for body in ("sample lhs(20) { drive.tau_max = uniform(-1, 1) N*m; }", "vary drive.tau_max = [-1, 1] N*m;"):
        (found,) = helps(check(tmp_path, SWING, SERVO, HOLD, f"default sweep spread of hold {{ {body} }}\n"))
        assert found[1].startswith("write a number above 0 N*m (")


def test_a_channel_that_is_like_none_of_its_joint_has_them_listed(tmp_path: Path) -> None:
    assert (
        said(check(tmp_path, SWING, SERVO, changed(HOLD, ("[q]", "[hinge.pos]"))))
        == """\
error[D125]: no channel `hinge.pos`
  --> deck.ic:16:15
   |
16 |     record = [hinge.pos];
   |               ^^^^^^^^^
   = help: channels of `hinge`: hinge.q, hinge.qd, hinge.qdd, hinge.tau, hinge.tau_load, hinge.J_eff, hinge.b, hinge.mode, hinge.reaction, hinge.servo.command, hinge.servo.voltage, hinge.servo.integral, hinge.servo.motor_rate, hinge.servo.motor_torque
"""
    )
    near = check(tmp_path, SWING, SERVO, changed(HOLD, ("[q]", "[hinge.servo.volts]")))
    assert near.diagnostics[0].help[0] == "did you mean `hinge.servo.voltage`?"


def test_stops_of_a_joint(tmp_path: Path) -> None:
    arm = changed(SWING, ("axis = z; }", "axis = z; limit = [-1, 1] rad; }"))
    assert (
        said(check(tmp_path, arm, SERVO, HOLD))
        == """\
error[D141]: joint `hinge` has no `limit`
 --> deck.ic:3:66
  |
3 |     joint hinge revolute { parent = base; child = bar; axis = z; limit = [-1, 1] rad; }
  |                                                                  ^^^^^
  = help: limits of a joint are `q_min`, `q_max`, `qd_max` and `tau_max`; what stops it is a `joint_stop` of a run
  = help: it has: parent, child, at, rpy, axis, dh, q_min, q_max, qd_max, tau_max, follows, ratio, offset
"""
    )


def test_a_model_of_ones_own_that_is_not_installed(tmp_path: Path) -> None:
    assert (
        said(check(tmp_path, SWING, changed(SERVO, ("rigid_gearbox", "my_pd")), HOLD))
        == """\
error[D140]: no servo model `my_pd`
 --> deck.ic:6:13
  |
6 |     model = my_pd;
  |             ^^^^^
  = help: servo models: cascade, compliant_gearbox, external, ideal, locked, passive, rigid_gearbox
  = help: a model of your own is known once its package is installed, `pip install -e FOLDER`; `met new` writes such a package
"""
    )
