"""Parts of a servo that are there only under a word, and laws that are continuous: what a deck may write."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, LIGHT, RUN, SERVO, changed, check, codes, experiment, messages

CURVED = changed(SERVO, ("j_m", "friction = stribeck;  f_c = 0.01 N*m;  f_s = 0.02 N*m;  rate_s = 3 rad/s;  j_m"))


def test_a_parameter_of_another_word_is_told_with_the_words_that_have_it(tmp_path: Path) -> None:
    coulomb = changed(CURVED, ("friction = stribeck", "friction = coulomb"))
    assert (
        messages(check(tmp_path, ARM, coulomb, RUN)).split("\n\n")[0]
        == """\
error[D141]: servo `drive` has no `f_s` with `friction = coulomb`
 --> deck.ic:8:60
  |
8 |     tau_max = 1 N*m; friction = coulomb;  f_c = 0.01 N*m;  f_s = 0.02 N*m;  rate_s = 3 rad/s;  j_m = 1e-4 kg*m^2;
  |                                                            ^^^
 ::: deck.ic:8:33  chosen here
  = help: it is there with `friction = stribeck;` or `friction = lugre;`"""
    )
    assert codes(tmp_path, ARM, changed(CURVED, ("friction = stribeck;", "")), RUN) == ["D141", "D141"]


def test_a_word_that_was_written_over_another_leaves_what_that_one_had(tmp_path: Path) -> None:
    plain = CURVED + "servo plain like drive { friction = coulomb; }\n"
    made = experiment(tmp_path, ARM, plain, changed(RUN, ("hinge = drive", "hinge = plain")))
    (use,) = made.structure.servos
    assert use.words == ()
    assert "hinge.servo.f_s" not in made.parameters and made.parameters["hinge.servo.friction"].value == "coulomb"


def test_what_a_word_needs_is_asked_for(tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, changed(CURVED, ("rate_s = 3 rad/s;", "")), RUN) == ["D075"]


def test_a_word_may_be_chosen_by_a_sweep(tmp_path: Path) -> None:
    sweep = "sweep laws of hold { vary drive.friction = [coulomb, stribeck]; }\n"
    compiled = check(tmp_path, ARM, CURVED, RUN, sweep, select=["laws"])
    assert compiled.plan is not None, messages(compiled)
    words = [e.structure.servos[0].words for e in compiled.plan.experiments]
    assert words == [(), (("friction", "stribeck"),)], "a default is no choice: keys of older archives stay"


def test_states_of_a_word_can_be_recorded_under_it_alone(tmp_path: Path) -> None:
    record = changed(RUN, ("[q]", "[q, servo.bristle]"))
    lugre = changed(CURVED, ("stribeck;", "lugre;  sigma_0 = 1 N*m/rad;"))
    assert codes(tmp_path, ARM, lugre, record) == []
    assert "no" in messages(check(tmp_path, ARM, CURVED, record))


@pytest.mark.parametrize(("place", "continuous"), [("servos", True), ("own", True), ("neither", False)])
def test_a_law_is_continuous_where_the_servo_or_the_run_says_so(place: str, continuous: bool, tmp_path: Path) -> None:
    servo = changed(SERVO, ("command", "rate = continuous; command")) if place == "own" else SERVO
    run = changed(RUN, ("servos = 1 kHz", "servos = continuous")) if place == "servos" else RUN
    (use,) = experiment(tmp_path, ARM, servo, run).structure.servos
    assert (use.continuous, use.divisor) == (continuous, 1)


def test_a_motor_on_a_bed_has_a_servo_that_ticks_and_coulombs_friction(tmp_path: Path) -> None:
    bed = changed(RUN, ("record = [q];", "record = [q]; substitute hinge { }"))
    assert codes(tmp_path, ARM, SERVO, bed) == []
    assert codes(tmp_path, ARM, changed(SERVO, ("command", "rate = continuous; command")), bed) == ["D106"]
    assert codes(tmp_path, ARM, CURVED, bed) == ["D176"]


def test_the_gains_of_a_continuous_law_count_for_its_stability(tmp_path: Path) -> None:
    """(Kt^2/R + Kt Kp/R)/J_m = 25 + 50 a second: at 100 Hz sampled 0.25, and continuous 0.75."""
    slow = changed(RUN, ("dynamics = 1 kHz", "dynamics = 100 Hz"), ("servos = 1 kHz", "servos = 100 Hz"))
    assert codes(tmp_path, LIGHT, SERVO, slow) == []
    compiled = check(tmp_path, LIGHT, SERVO, changed(slow, ("servos = 100 Hz", "servos = continuous")))
    assert [each.code for each in compiled.diagnostics] == ["D105"]
    assert "h * lambda = 0.75" in compiled.diagnostics[0].message


@pytest.mark.parametrize("used", [True, False], ids=["used", "by no run"])
def test_a_wrong_word_is_told_once_and_nothing_of_what_depends_on_it(used: bool, tmp_path: Path) -> None:
    wrong = changed(CURVED, ("friction = stribeck", "friction = stribek"))
    servos = wrong if used else wrong.replace("servo drive", "servo other") + SERVO
    assert (
        messages(check(tmp_path, ARM, servos, RUN))
        == f"""\
error[D076]: `friction` of servo `{"drive" if used else "other"}` cannot be `stribek`
 --> deck.ic:8:33
  |
8 |     tau_max = 1 N*m; friction = stribek;  f_c = 0.01 N*m;  f_s = 0.02 N*m;  rate_s = 3 rad/s;  j_m = 1e-4 kg*m^2;
  |                                 ^^^^^^^
  = help: did you mean `stribeck`?
  = help: one of: coulomb, stribeck, lugre

1 error
"""
    )


def test_a_word_in_quotes_is_told_once(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, ARM, changed(CURVED, ("= stribeck", '= "stribeck"')), RUN))
        == """\
error[D076]: `friction` of servo `drive` is a word, without quotes
 --> deck.ic:8:33
  |
8 |     tau_max = 1 N*m; friction = "stribeck";  f_c = 0.01 N*m;  f_s = 0.02 N*m;  rate_s = 3 rad/s;  j_m = 1e-4 kg*m^2;
  |                                 ^^^^^^^^^^
  = help: one of: coulomb, stribeck, lugre

1 error
"""
    )


def test_a_ratio_whose_square_is_nothing_is_infinitely_fast(tmp_path: Path) -> None:
    elastic = "compliant_gearbox; stiffness = 9 N*m/rad; damping = 1 N*m*s/rad"
    geared = changed(SERVO, ("rigid_gearbox", elastic), ("100", "1e-200"))
    assert (
        messages(check(tmp_path, ARM, geared, RUN))
        == """\
error[D104]: servo `drive` is unstable with modified_euler at this rate of the dynamics
  --> deck.ic:14:24
   |
14 |     rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
   |                        ^^^^^ h * lambda = inf; the slowest rate that fits is none
   = help: h * lambda must stay below 2; lambda is the servo's fastest rate constant, on any arm

1 error
"""
    )
