"""One mistake that many uses find is told once at its place, and of several of a kind the worst. Whole messages."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import SERVO, changed, check, codes, shown

ARM = """\
arm swing {
    link bar  { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link tip  { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link tool { mass = 1 kg; shape = sphere(radius = 1 cm); }
    joint hinge revolute  { parent = base; child = bar; axis = z; }
    joint elbow revolute  { parent = bar;  child = tip; axis = z; at = [1 m, 0 m, 0 m]; }
    joint lift  prismatic { parent = tip;  child = tool; axis = z; at = [1 m, 0 m, 0 m]; }
}
"""
SLIDE = "servo slide like drive { ratio = 1 cycle/cm; command = rate(0.1 m/s); }\n"
RUN = """\
run hold {
    arm = swing;
    servos { hinge = drive; elbow = drive { f_c = 1 N*m; } lift = slide; }
    rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    record = [q];
}
"""
SWEEP = "sweep gains of hold { vary drive.kp = [0.1, 0.2] V*s/rad; }\n"


def test_the_decks_that_the_next_tests_break_are_sound(tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, SERVO, SLIDE, RUN, SWEEP, select="all") == []


def test_an_unknown_key_of_a_definition_that_three_joints_use(tmp_path: Path) -> None:
    servo = changed(SERVO, ("ratio = 100;", "ratio = 100; kpp = 3;"))
    assert (
        shown(tmp_path, ARM, servo, SLIDE, RUN, SWEEP)
        == """\
error[D141]: servo `drive` has no `kpp`
  --> deck.ic:11:18
   |
11 |     ratio = 100; kpp = 3; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
   |                  ^^^
   = help: did you mean `kp`?
   = help: it has: ratio, kp, ki, v_max, k_position, resistance, kt, tau_max, j_m, f_c, f_v, friction, model, command, rate
"""
    )


def test_two_unknown_keys_are_two_mistakes(tmp_path: Path) -> None:
    servo = changed(SERVO, ("ratio = 100;", "ratio = 100; kpp = 3; kii = 4;"))
    assert codes(tmp_path, ARM, servo, SLIDE, RUN) == ["D141", "D141"]


def test_a_missing_parameter_of_a_definition_that_two_joints_use(tmp_path: Path) -> None:
    run = changed(RUN, ("lift = slide;", ""))
    assert (
        shown(tmp_path, ARM, changed(SERVO, ("v_max = 24 V;", "")), run)
        == """\
error[D075]: servo `drive` has no `v_max`
 --> deck.ic:9:1
  |
9 | servo drive {
  | ^^^^^^^^^^^
  = help: write `v_max = ... V;` (largest voltage V_max of the drive's amplifier)
"""
    )


def test_a_missing_parameter_is_told_of_the_base_and_not_of_what_is_like_it(tmp_path: Path) -> None:
    compiled = check(tmp_path, ARM, changed(SERVO, ("v_max = 24 V;", "")), SLIDE, RUN)
    assert [each.message for each in compiled.diagnostics] == ["servo `drive` has no `v_max`"]


def test_what_only_the_derived_definition_lacks_is_told_of_it(tmp_path: Path) -> None:
    run = changed(RUN, ("hinge = drive;", "hinge = drive { v_max = 24 V; }"), ("f_c = 1 N*m;", "v_max = 24 V;"))
    compiled = check(tmp_path, ARM, changed(SERVO, ("v_max = 24 V;", "")), SLIDE, run)
    assert [each.message for each in compiled.diagnostics] == ["servo `slide` has no `v_max`"]


def test_two_missing_parameters_of_one_definition_are_two_mistakes(tmp_path: Path) -> None:
    servo = changed(SERVO, ("v_max = 24 V;", ""), ("ki = 1 V/rad;", ""))
    compiled = check(tmp_path, ARM, servo, changed(RUN, ("lift = slide;", "")))
    assert [each.message for each in compiled.diagnostics] == [
        "servo `drive` has no `ki`",
        "servo `drive` has no `v_max`",
    ]


def test_a_channel_that_is_none_of_a_run_and_of_its_sweep(tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, SERVO, SLIDE, changed(RUN, ("[q]", "[q, hinge.pos]")), SWEEP, select="all") == ["D125"]


def test_of_one_rate_that_is_too_slow_for_several_servos_the_fastest_is_named(tmp_path: Path) -> None:
    stiff = changed(SLIDE, ("ratio", "kt = 0.1 N*m/A; ratio"))
    run = changed(RUN, ("dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz", "dynamics = 10 Hz; servos = 10 Hz"))
    assert (
        shown(tmp_path, ARM, SERVO, stiff, run)
        == """\
error[D104]: servo `slide` is unstable with modified_euler at this rate of the dynamics
  --> deck.ic:19:24
   |
19 |     rates { dynamics = 10 Hz; servos = 10 Hz; }
   |                        ^^^^^ h * lambda = 10; the slowest rate that fits is 60 Hz
   = help: h * lambda must stay below 2; lambda is the servo's fastest rate constant, on any arm
"""
    )


def test_a_duration_that_is_out_of_range_is_used_by_no_run_like_the_one_that_writes_it(tmp_path: Path) -> None:
    """What was told of the one is not told of the other, whose sensor's filter is reckoned with its duration."""
    felt = "sensor g = gyroscope { link = bar; along = [0, 0, 1]; filter = butterworth; cutoff = 5 Hz; rate = 1 kHz; }"
    run = changed(RUN, ("duration = 1 s;", f"duration = -1e305 s; {felt}"), ("lift = slide;", ""))
    more = "run again like hold { seed = 1; }\nsweep seeds of again { vary links.bar.mass = [1] kg; }\n"
    assert codes(tmp_path, ARM, SERVO, SLIDE, run, more, select="all") == ["D077"]


WATCHED = """\
run hold {
    arm = swing;
    servos { hinge = drive; elbow = drive; lift = slide; }
    initial { elbow.q = 10 deg; }
    rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    signal amps_1 = hinge.servo.motor_torque / hinge.servo.kt;
    signal amps_2 = elbow.servo.motor_torque / elbow.servo.kt;
    record = [q, signals.amps_1, signals.amps_2];
    metric most = max { of = max(abs(signals.amps_1), abs(signals.amps_2)); }
    require most < 5 A;
}
search worst of hold { drive.kp = between(0.1, 0.2) V*s/rad; maximise most; at_most = 5; }
"""


@pytest.mark.parametrize(("change", "code"), [
    (("parent = bar;", "parent = baar;"), "D094"),
    (("joint elbow", "joint elbw"), "D144"),
    (("kt = 0.05 N*m/A", "kt = 0.05 N*m"), "D061"),
    (("signal amps_2 = elbow", "signal amps_2 = elbw"), "D125"),
    (("of = max(", "of = maxx("), "D069"),
])  # fmt: skip
def test_what_follows_from_a_mistake_is_not_told_beside_it(tmp_path: Path, change: tuple[str, str], code: str) -> None:
    assert set(codes(tmp_path, changed(ARM + SERVO + SLIDE + WATCHED, change), select="all")) == {code}


def test_the_watched_run_is_sound(tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, SERVO, SLIDE, WATCHED, select="all") == []


def test_an_unknown_name_beside_another_kind_of_mistake_carries_no_fix(tmp_path: Path) -> None:
    run = changed(RUN, ("record = [q]", "record = [qq]"))
    (alone,) = check(tmp_path, ARM, SERVO, SLIDE, run, select="all").diagnostics
    assert any(getattr(line, "changes", ()) for line in alone.help)
    servo = changed(SERVO, ("ratio = 100;", "ratio = 100 m;"))
    _, beside = check(tmp_path, ARM, servo, SLIDE, run, select="all").diagnostics
    assert beside.code == alone.code == "D125"
    assert not any(getattr(line, "changes", ()) for line in beside.help)
    assert beside.help[-1] == "it may follow from another error here: mend that first"
