"""Remedies followed to the letter: what a message says to write is put in its place, and the deck compiles."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, check, messages

FREE = "servo free { model = ideal; bandwidth = 5 s^-1; command = position(both); }\n"
GUIDED = """\
arm pair {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link tip { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
    joint elbow revolute { parent = bar; child = tip; axis = z; at = [1, 0, 0] m; }
}
run both_move {
    arm = pair;
    guide both = together { max_rate = 1 rad/s; max_acceleration = 1 rad/s^2; to = [50, -76] deg; }
    servos { hinge = free; elbow = free; }
    rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    record = [q];
}
"""

FOLLOWED = {
    "D109: a servo's number": ("run it like hold { hinge.servo.kp = 0.2 V*s/rad; }", "hinge.servo.kp = 0.2 V*s/rad;"),
    "D109: by its block": ("run it like hold { servos.hinge.ki = 2 V/rad; }", "servos.hinge.ki = 2 V/rad;"),
    "D109: a servo": ("run it like hold { hinge.servo = drive; }", "hinge.servo = drive;"),
    "D109: an initial value": ("run it like hold { hinge.q = 3 deg; }", "hinge.q = 3 deg;"),
    "D109: initial, by its block": ("run it like hold { initial.hinge.q = 3 deg; }", "initial.hinge.q = 3 deg;"),
    "D109: a rate": ("run it like hold { dynamics = 2 kHz; }", "dynamics = 2 kHz;"),
    "D109: a rate by its block": ("run it like hold { rates.dynamics = 2 kHz; }", "rates.dynamics = 2 kHz;"),
    "D109: a tolerance": ("run it like hold { tolerances.hinge.q = 1 deg; }", "tolerances.hinge.q = 1 deg;"),
    "D083: a link's number": ("arm heavy like swing { bar.mass = 3 kg; }", "bar.mass = 3 kg;"),
    "D083: a link's path": ("arm heavy like swing { links.bar.mass = 3 kg; }", "links.bar.mass = 3 kg;"),
    "D083: a joint's vector": ("arm turned like swing { hinge.axis = [1, 0, 0]; }", "hinge.axis = [1, 0, 0];"),
    "D063: a bare number": ("let long = 2 m + 3;", "3;"),
    "D063: a bare expression": ("let long = 2 m + 3 / 4;", "3 / 4;"),
    "D063: on the left": ("let long = 3 / 4 - 2 m;", "3 / 4 "),
    "D071: a list for the joints": (FREE + GUIDED, "to = [50, -76] deg;"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", FOLLOWED)
def test_what_the_help_says_to_write(tmp_path: Path, name: str) -> None:
    text, wrong = FOLLOWED[name]
    base = ARM + SERVO + RUN
    (found, *more) = check(tmp_path, base, text, select="all").diagnostics
    assert not more
    assert found.code == name[:4]
    instead = re.search("write `(.*)`", found.help[0])
    assert instead is not None, found.help
    written = instead[1] + ("" if instead[1][-1] in ";}" else wrong[-1])
    compiled = check(tmp_path, base, text.replace(wrong, written), select="all")
    assert [each.code for each in compiled.diagnostics] == [], messages(compiled)


@pytest.mark.parametrize("wrong", ["links.bar.mass = 3 kg;", "drive.kp = 0.2 V*s/rad;", "reach = 2 m;"])
def test_a_path_in_a_run_is_set_by_with(tmp_path: Path, wrong: str) -> None:
    text, arm = (
        f"run it like hold {{ {wrong} }}\n",
        "let reach = 1 m;\n" + ARM.replace("length = 1 m", "length = reach"),
    )
    (found,) = check(tmp_path, arm, SERVO, RUN, text, select="all").diagnostics
    assert found.help == (f"write `with {wrong}`",)
    assert check(tmp_path, arm, SERVO, RUN, text.replace(wrong, f"with {wrong}"), select="all").diagnostics == ()


def test_a_joints_vector_in_a_run_goes_to_an_arm_like_the_runs(tmp_path: Path) -> None:
    text = "run it like hold { hinge.at = [1, 0, 0] m; }\n"
    (found,) = check(tmp_path, ARM, SERVO, RUN, text, select="all").diagnostics
    assert found.help == (
        "it is the arm's: `arm OTHER like swing { hinge { at = [1, 0, 0] m; } }`, and `arm = OTHER;` here",
    )
    arm, use = re.findall("`(.*?)`", found.help[0])
    followed = f"{arm}\n" + text.replace("hinge.at = [1, 0, 0] m;", use)
    assert check(tmp_path, ARM, SERVO, RUN, followed, select="all").diagnostics == ()


def test_a_sum_that_a_macro_made_is_the_macros_to_mend(tmp_path: Path) -> None:
    macro = "#define SUM 1 + 2\n"
    text = "let long = 2 / SUM * 1 m;\n"
    (found,) = check(tmp_path, macro, text, ARM, SERVO, RUN).diagnostics
    assert found.help == ("`+` comes from macro `SUM`: put brackets around the macro's body",)
    assert check(tmp_path, macro.replace("1 + 2", "(1 + 2)"), text, ARM, SERVO, RUN).diagnostics == ()


def test_a_macro_that_is_used_twice_with_one_name_is_no_file_included_twice(tmp_path: Path) -> None:
    text = "#define LONG let long = 3 m;\nLONG\nLONG\n"
    (found,) = check(tmp_path, text, ARM, SERVO, RUN).diagnostics
    assert found.help == (
        "macro `LONG` is used twice here: give it the name as an argument, another one each time, or use it once",
    )
    followed = "#define LONG(name) let name = 3 m;\nLONG(long)\nLONG(longer)\n"
    assert check(tmp_path, followed, ARM, SERVO, RUN).diagnostics == ()


def test_a_course_in_the_units_of_another_kind_of_command_is_not_mended_to_a_faster_one(tmp_path: Path) -> None:
    course = "trapezoid(to = {} rad, max_rate = 5 deg/s, max_acceleration = 1 rad/s^2)"
    servo = SERVO.replace("rate(0.1 rad/s)", f"rate({course.format('1').replace('1 rad,', '1 rad/s,')})")
    found = check(tmp_path, ARM, servo, RUN).diagnostics
    assert [each.code for each in found] == ["D061", "D061"]
    assert found[0].help[0] == (
        "of a `rate` command it is in rad/s^2; with `position(trapezoid(...))` it would be in rad/s, like all of that "
        "course"
    )


def test_a_trapezoid_of_rate_is_told_of_the_courses_that_come_to_rest(tmp_path: Path) -> None:
    servo = SERVO.replace("rate(0.1 rad/s)", "rate(trapezoid(to = 0.1 rad/s, max_rate = 0.1 rad/s))")
    found = check(tmp_path, ARM, servo, RUN).diagnostics
    assert sorted(each.code for each in found) == ["D061", "D075"]
    for each in found:
        assert each.help[-1] == (
            "the joint goes on at the rate `to`: to move and stop it write `rate(pulse(to = ..., slope = ..., over = "
            "...))`, or `position(trapezoid(...))`"
        )
    pulse = "rate(pulse(to = 0.1 rad/s, slope = 1 rad/s^2, over = 0.5 s))"
    assert check(tmp_path, ARM, SERVO.replace("rate(0.1 rad/s)", pulse), RUN).diagnostics == ()


def test_a_negative_gear_ratio_is_mended_by_its_magnitude(tmp_path: Path) -> None:
    servo = SERVO.replace("ratio = 100;", "ratio = -62.6111;")
    (found,) = check(tmp_path, ARM, servo, RUN).diagnostics
    assert found.code == "D077"
    assert found.help == (
        "write its magnitude, `62.6111`: the joint moves the same, and the motor's rate, torque and voltage have the "
        "other sign",
    )
    assert check(tmp_path, ARM, servo.replace("-62.6111", "62.6111"), RUN).diagnostics == ()


def test_a_list_for_more_joints_than_follow_a_guide_names_those_that_do(tmp_path: Path) -> None:
    guided = GUIDED.replace("elbow = free;", "elbow = free { command = position(0 deg); }")
    (found,) = check(tmp_path, FREE, guided, ARM).diagnostics
    assert found.help == ("write `hinge.to = ...;`", "`hinge` alone follows it")
    assert check(tmp_path, FREE, guided.replace("to = [50, -76] deg;", "hinge.to = 50 deg;"), ARM).diagnostics == ()


def test_several_numbers_for_set_are_told_of_vary(tmp_path: Path) -> None:
    (found,) = check(tmp_path, ARM, SERVO, RUN, set=("drive.kp=[0.1, 0.2] V*s/rad",)).diagnostics
    assert found.help == ("`--set` takes one number, and these are 2; `--vary`, in its place, runs each of them",)
    varied = check(tmp_path, ARM, SERVO, RUN, vary=("drive.kp=[0.1, 0.2] V*s/rad",))
    assert varied.plan is not None
    assert [each.cases.count for each in varied.plan.experiments] == [2]


def test_a_word_of_a_macro_of_the_command_line_is_told_of_that(tmp_path: Path) -> None:
    text = "let long = SIZE;\n"
    (found,) = check(tmp_path, text, ARM, SERVO, RUN, defines=("SIZE=tall",)).diagnostics
    assert found.help == (
        "it comes from `-D`: write a number there, as in `-D SIZE=2`, or define `let tall = ...;` in the deck",
    )
    assert check(tmp_path, text, ARM, SERVO, RUN, defines=("SIZE=2",)).diagnostics == ()


def test_a_word_that_set_gives_is_told_of_set(tmp_path: Path) -> None:
    (found,) = check(tmp_path, "let long = 2;\n", ARM, SERVO, RUN, set=("long=VALUE",)).diagnostics
    assert (found.code, found.help) == (
        "D065",
        ("`--set` takes a value as the deck would write it: a number with its unit, or a name of the deck",),
    )


@pytest.mark.parametrize("word", ["nan", "NaN", "inf", "infinity"])
def test_a_number_that_is_none_is_not_defined_by_a_let(tmp_path: Path, word: str) -> None:
    (found,) = check(tmp_path, f"let long = {word};\n", ARM, SERVO, RUN).diagnostics
    assert found.help == (
        "every number of a deck is finite: leave the entry out where its default is endless, or write one",
    )
