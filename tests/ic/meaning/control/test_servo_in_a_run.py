"""What a run puts upon a servo's definition, changes in it and removes: sensors, parameters, and mistakes in that."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, messages

SENSED = changed(
    SERVO,
    (
        "command",
        "sensor qd = tachometer { noise = 0.02 rad/s; }\n    sensor q = encoder { step = 1 deg; }\n    command",
    ),
)


def sensors(folder: Path, upon: str) -> dict[str, str]:
    """Models of the sensors that a run has whose servo is changed so, by quantity."""
    run = f"run other like hold {{ {upon} }}\n"
    (use,) = experiment(folder, ARM, SENSED, RUN, run, select=["other"]).structure.servos
    return {each.of: each.model for each in use.sensors}


@pytest.mark.parametrize(
    ("upon", "expected"),
    [
        ("servos { hinge { remove qd; } }", {"q": "encoder"}),
        ("servos { hinge { remove qd; remove q; } }  rates { servos = continuous; }", {}),
        ("servos { hinge = drive { remove q; } }", {"qd": "tachometer"}),
        ("servos { hinge { qd { delay = 2; } } }", {"qd": "tachometer", "q": "encoder"}),
        ("servos { hinge { qd = low_pass { cutoff = 9 Hz; } } }", {"qd": "low_pass", "q": "encoder"}),
        ("servos { hinge { remove qd; sensor qd = low_pass { cutoff = 9 Hz; } } }", {"q": "encoder", "qd": "low_pass"}),
        ("servos { hinge { kp = 0.2 V*s/rad; remove qd; } }", {"q": "encoder"}),
    ],
)
def test_a_run_changes_and_removes_sensors_of_a_servo(upon: str, expected: dict[str, str], tmp_path: Path) -> None:
    assert sensors(tmp_path, upon) == expected


def test_a_parameter_of_a_sensor_is_changed_alone(tmp_path: Path) -> None:
    run = "run other like hold { servos { hinge { qd { delay = 2; } } } }\n"
    found = experiment(tmp_path, ARM, SENSED, RUN, run, select=["other"]).parameters
    assert (found["hinge.servo.sensor.qd.delay"].value, found["hinge.servo.sensor.qd.noise"].value) == (2.0, 0.02)


def test_a_parameter_that_a_run_removes_has_its_default(tmp_path: Path) -> None:
    soft = changed(SERVO, ("j_m", "f_c = 0.01 N*m; j_m"))
    runs = "run over like hold { servos { hinge { f_c = 0.02 N*m; } } }\nrun other like over { servos { hinge { remove f_c; } } }\n"
    for name, value in (("over", 0.02), ("other", 0.0)):
        found = experiment(tmp_path, ARM, soft, RUN, runs, select=[name])
        assert found.parameters["hinge.servo.f_c"].value == value, (
            "with what it was written over, the definition's goes"
        )


def test_a_sweep_may_choose_a_servo_without_its_sensor(tmp_path: Path) -> None:
    sweep = "sweep kinds of hold { vary hinge.servo = [drive, drive { remove qd; }]; }\n"
    compiled = check(tmp_path, ARM, SENSED, RUN, sweep, select=["kinds"])
    assert compiled.plan is not None, messages(compiled)
    assert [len(each.structure.servos[0].sensors) for each in compiled.plan.experiments] == [2, 1]


def test_removing_what_is_not_there_is_told_once_the_definition_is_known(tmp_path: Path) -> None:
    run = "run other like hold { servos { hinge { remove qdd;  remove q;  remove q; } } }\n"
    assert (
        messages(check(tmp_path, ARM, SENSED, RUN, run, select=["other"]))
        == """\
error[D058]: nothing named `qdd` to remove
  --> deck.ic:20:47
   |
20 | run other like hold { servos { hinge { remove qdd;  remove q;  remove q; } } }
   |                                               ^^^
   = help: did you mean `qd`?
   = help: there is: model, ratio, kp, ki, v_max, resistance, kt, tau_max, j_m, qd, q, command

error[D058]: nothing named `q` to remove
  --> deck.ic:20:71
   |
20 | run other like hold { servos { hinge { remove qdd;  remove q;  remove q; } } }
   |                                                                       ^
   = help: did you mean `qd`?
   = help: there is: model, ratio, kp, ki, v_max, resistance, kt, tau_max, j_m, qd, command

2 errors
"""
    )


def test_a_model_has_no_definition_under_it_to_remove_from(tmp_path: Path) -> None:
    loads = "environment { d = joint_damping { damping = 1 N*m*s/rad; remove jont; } } record"
    assert (
        messages(check(tmp_path, ARM, SERVO, changed(RUN, ("record = [q]", f"{loads} = [q]"))))
        == """\
error[D058]: nothing named `jont` to remove
  --> deck.ic:16:69
   |
16 |     environment { d = joint_damping { damping = 1 N*m*s/rad; remove jont; } } record = [q];
   |                                                                     ^^^^
   = help: there is: damping

1 error
"""
    )


def test_what_a_run_removed_and_the_model_needs_is_told_where_it_was_removed(tmp_path: Path) -> None:
    run = "run other like hold { servos { hinge { remove kp; } } }\n"
    assert (
        messages(check(tmp_path, ARM, SERVO, RUN, run, select=["other"]))
        == """\
error[D075]: servo `drive` on joint `hinge` has no `kp`
  --> deck.ic:18:40
   |
18 | run other like hold { servos { hinge { remove kp; } } }
   |                                        ^^^^^^ removed here
  ::: deck.ic:5:1  servo `drive` on joint `hinge` stands here
   = help: write `kp = ... V*s/rad;` (proportional gain Kp on the error of the motor's rate)

1 error
"""
    )


def test_a_block_in_the_wrong_place_is_sent_to_where_its_name_stands(tmp_path: Path) -> None:
    damped = changed(RUN, ("duration", "environment { damp = joint_damping { damping = 1 N*m*s/rad; } } duration"))
    run = "run other like hold { damp { damping = 2 N*m*s/rad; }  hinge { kp = 0.2 V*s/rad; } }\n"
    assert (
        messages(check(tmp_path, ARM, SERVO, damped, run, select=["other"]))
        == """\
error[D109]: nothing named `damp` in run `other` to change
  --> deck.ic:18:23
   |
18 | run other like hold { damp { damping = 2 N*m*s/rad; }  hinge { kp = 0.2 V*s/rad; } }
   |                       ^^^^
   = help: write `environment { damp { ... } }`: it is there that `damp` stands

error[D109]: nothing named `hinge` in run `other` to change
  --> deck.ic:18:56
   |
18 | run other like hold { damp { damping = 2 N*m*s/rad; }  hinge { kp = 0.2 V*s/rad; } }
   |                                                        ^^^^^
   = help: write `servos { hinge { ... } }`: it is there that `hinge` stands

2 errors
"""
    )


@pytest.mark.parametrize(
    ("change", "code"), [("arm { bar { mass = 3 kg; } }", "D112"), ("integrator { order = 2; }", "D143")]
)
def test_a_block_upon_a_name_that_takes_none_is_not_ignored(change: str, code: str, tmp_path: Path) -> None:
    run = changed(RUN, ("arm =", "integrator = rk4; arm ="))
    assert codes(tmp_path, ARM, SERVO, run, f"run other like hold {{ {change} }}\n", select=["other"]) == [code]


def test_a_channel_under_another_word_of_the_model_is_told_with_that_word(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, ARM, SERVO, changed(RUN, ("[q]", "[servo.bristle]"))))
        == """\
error[D125]: no channel `servo.bristle`
  --> deck.ic:16:15
   |
16 |     record = [servo.bristle];
   |               ^^^^^^^^^^^^^
   = help: the servo of joint `hinge` (rigid_gearbox) has it with `friction = lugre;`

1 error
"""
    )


def test_a_share_with_a_unit_is_sent_to_the_parameter_that_has_it(tmp_path: Path) -> None:
    metric = "metric settle = settling_time { of = hinge.q; target = 1 rad; band = 0.2 deg; }\n    record = [q]"
    assert (
        messages(check(tmp_path, ARM, SERVO, changed(RUN, ("record = [q]", metric))))
        == """\
error[D061]: `band` of metric `settle` is a pure number, and this is in rad
  --> deck.ic:16:74
   |
16 |     metric settle = settling_time { of = hinge.q; target = 1 rad; band = 0.2 deg; }
   |                                                                          ^^^^^^^
   = help: `within` is what is in rad: half width of the band around the target that is added to the share `band`
   = help: leave the unit out; `%` is the only unit of a pure number

1 error
"""
    )


def test_an_encoder_under_a_continuous_law(tmp_path: Path) -> None:
    run = changed(RUN, ("servos = 1 kHz", "servos = continuous"))
    told_ = messages(check(tmp_path, ARM, SENSED, run))
    assert "error[D106]: an `encoder` reads at ticks, and the law of joint `hinge` is continuous" in told_


@pytest.mark.parametrize("wrong", ["0.2", "0.2 m"])
def test_a_value_of_a_wrong_unit_is_told_of_the_servo_that_writes_it(tmp_path: Path, wrong: str) -> None:
    like = "servo other like drive { kp = 0.3 V*s/rad;  ki = WRONG; }\n".replace("WRONG", wrong)
    run = changed(RUN, ("hinge = drive", "hinge = other"))
    drive = changed(SERVO, ("v_max = 24 V", f"v_max = {wrong}"))
    (of_other, of_drive) = sorted(each.message for each in check(tmp_path, ARM, drive, like, run).diagnostics)
    assert of_other.startswith("`ki` of servo `other` is in V/rad")
    assert of_drive.startswith("`v_max` of servo `drive` is in V")


NO_RUNS = [
    ("command = position(sine(1 rad, 1 Hz));", ["D153"]),
    ("command = rate(table(times = [0, 1, 1] s, values = [0, 1, 2] rad/s));", ["D156"]),
    ("command = rate(table(times = [0, 1] s, values = [0, 1, 2] rad/s));", ["D154"]),
    ("command = position(trapezoid(to = 10 deg));", ["D075", "D075"]),
    ("command = position(10 kg);", ["D061"]),
    ("command = position(step(to = 1 m, at = 1 s));", ["D061"]),
    ("tau_max = 3 kg;", ["D061"]),
    ("kp = 3;", ["D060"]),
    ("ratio = 3 rad/m; command = rate(1 m/s);", []),  # of a slide
    ("remove kp; remove command; remove ratio;", []),  # which may be written where it is used
    ("command = position(some_guide);", ["D065"]),
    ('command = position(trajectory(file = "no.csv"));', []),  # which is read by the joint's name
]


@pytest.mark.parametrize(("changes", "told"), NO_RUNS)
def test_a_servo_that_no_run_uses_is_checked_but_for_what_it_lacks(
    changes: str, told: list[str], tmp_path: Path
) -> None:
    assert codes(tmp_path, ARM, SERVO, RUN, f"servo other like drive {{ {changes} }}\n", select="all") == told


@pytest.mark.parametrize("wrong", ["rate(trapezoid(to = 10 deg/s, max_rate = 1 rad/s^2))", "rate(sine(1 rad/s, 1 Hz))"])
def test_what_is_wrong_with_a_servo_that_a_run_uses_is_told_once(wrong: str, tmp_path: Path) -> None:
    assert len(codes(tmp_path, ARM, changed(SERVO, ("rate(0.1 rad/s)", wrong)), RUN, select="all")) == 1
