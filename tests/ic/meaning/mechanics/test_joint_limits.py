"""Limits of joints in decks: units of their kind of joint, ranges with two ends, none of a fixed joint."""

from __future__ import annotations

from pathlib import Path

from tests.ic.small_decks import ARM, RUN, SERVO, check, experiment, messages


def limited(keys: str, kind: str = "revolute") -> str:
    return ARM.replace("axis = z;", f"axis = z;  {keys}").replace("revolute", kind)


def test_they_are_parameters_in_the_units_of_the_joint(tmp_path: Path) -> None:
    known = experiment(
        tmp_path, limited("q_min = -10 cm;  q_max = 1 m;  tau_max = 2 kN;", "prismatic"), FREE
    ).parameters
    assert [(known[f"hinge.{name}"].value, known[f"hinge.{name}"].unit) for name in ("q_min", "q_max", "tau_max")] == [
        (-0.1, "m"),
        (1.0, "m"),
        (2000.0, "N"),
    ]


FREE = "run free { arm = swing;  rates { dynamics = 1 kHz;  record = 100 Hz; }  duration = 1 s;  record = [q]; }"


def test_an_arm_made_from_another_and_a_set_value_change_them(tmp_path: Path) -> None:
    wide = "arm wide like swing { hinge { q_max = 2 rad; } }\n"
    known = experiment(tmp_path, limited("q_min = -1 rad;  q_max = 1 rad;"), wide, FREE.replace("swing", "wide"))
    assert known.parameters["hinge.q_max"].value == 2.0
    found = check(tmp_path, limited("q_min = -1 rad;  q_max = 1 rad;"), FREE, set=["hinge.q_max=90 deg"])
    assert found.plan is not None, messages(found)
    assert abs(found.plan.experiments[0].parameters["hinge.q_max"].value - 1.5707963267948966) < 1e-15  # type: ignore


def test_a_range_that_is_none(tmp_path: Path) -> None:
    found = messages(check(tmp_path, limited("q_min = 1 rad;  q_max = -1 rad;"), FREE))
    assert "error[D241]: `q_min` of joint `hinge` must be less than `q_max`" in found


def test_a_fixed_joint_has_none(tmp_path: Path) -> None:
    fixed = ARM.replace("}\n", "    link tip { mass = 1 kg;  shape = sphere(radius = 1 cm); }\n", 0).replace(
        "\n}",
        "\n    link tip { mass = 1 kg;  shape = sphere(radius = 1 cm); }\n"
        "    joint grip fixed { parent = bar;  child = tip;  qd_max = 1 rad/s; }\n}",
    )
    assert "error[D346]: a fixed joint has no `qd_max`" in messages(check(tmp_path, fixed, FREE))


def test_another_word_for_them_is_told_what_they_are_called(tmp_path: Path) -> None:
    assert "limits of a joint are `q_min`, `q_max`, `qd_max` and `tau_max`" in messages(
        check(tmp_path, limited("limits = 3;"), SERVO, RUN)
    )


def test_a_margin_is_a_channel_of_joints_with_limits_alone(tmp_path: Path) -> None:
    asked = FREE.replace("[q]", "[q, limit_margin]")
    assert experiment(tmp_path, limited("qd_max = 1 rad/s;"), asked).structure.record[1].name == "limit_margin"
    assert check(tmp_path, ARM, asked).plan is None
