"""Messages that say what to write, and one broken thing that makes one message."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes

BESIDE = changed(  # a run that names the joint and the link in every way there is
    RUN,
    (
        "record = [q];",
        "record = [q, hinge.qd, hinge.servo.voltage]; initial { hinge.q = 3 deg; }\n"
        "    metric top = max { of = hinge.qd; } require top < 3 rad/s;",
    ),
)
SWEEP = (
    "sweep it of hold { vary links.bar.mass = [1, 2] kg; vary links.bar.com.x = [0, 1] m; "
    "vary drive.kp = [0.1, 0.2] V*s/rad; }\n"
)
RAIL = changed(
    ARM,
    (
        "axis = z; }",
        "axis = z; }\n    link tip { mass = 1 kg; shape = sphere(radius = 1 cm); }\n"
        "    joint rail prismatic { parent = bar; child = tip; axis = x; }",
    ),
)


def only_help(folder: Path, *parts: str) -> tuple[str, tuple[str, ...]]:
    """The message and the helps of the one diagnostic that there is."""
    (diagnostic,) = check(folder, *parts, select="all").diagnostics
    return diagnostic.message, diagnostic.help


@pytest.mark.parametrize(
    ("arm", "servo", "run", "help"),
    [
        (("axis = z;", "axis = z; rpy = [0 rad, 90, 0 rad];"), None, None, "write `90 deg` or `90 rad`"),
        (("axis = z;", "axis = z; rpy = [0, 90, 0];"), None, None,
         "write `[...] deg` or `[...] rad`: a unit after the bracket is for all of them"),
        (None, ("0.1 rad/s", "0.1"), None, "write `0.1 deg/s` or `0.1 rad/s`"),
        (None, None, ("    record =", "    initial { q = 30; }\n    record ="), "write `30 deg` or `30 rad`"),
        (None, None, ("    record =", "    environment { gravity = -9.81 m/s^2; }\n    record ="),
         "write `gravity = [0, 0, -9.81] m/s^2;`"),
        (("2 kg", "2 m"), None, None, "write it in kg, g, t or mg"),
        (None, ("0.1 rad/s", "sine(amplitude = 1 rad/s, frequency = 0.5 cycle/s)"), None,
         "a frequency counts cycles, without an angle: write `0.5 Hz`"),
        (None, ("kp = ", "k_position = 15 rad/s; kp = "), None, "leave the angle out: write `15 1/s`"),
        (("axis = z", "axis = w"), None, None,
         "an axis is x, y, z, -x, -y or -z, or three numbers such as [0, 0.6, 0.8]"),
        (("axis = z", "axis = -w"), None, None,
         "an axis is x, y, z, -x, -y or -z, or three numbers such as [0, 0.6, 0.8]"),
        (None, None, ("run hold", "Default Run hold"), "write `default run`: the language's words are in lower case"),
        (None, ("servo drive", "Servo drive"), ("hinge = drive", ""),
         "write `servo`: the language's words are in lower case"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_what_to_write(
    tmp_path: Path, arm: tuple[str, str], servo: tuple[str, str], run: tuple[str, str], help: str
) -> None:
    parts = (
        changed(ARM, *([arm] if arm else [])),
        changed(SERVO, *([servo] if servo else [])),
        changed(RUN, *([run] if run else [])),
    )
    assert only_help(tmp_path, *parts)[1] == (help,)


def test_one_initial_value_for_joints_that_move_differently_is_told_once(tmp_path: Path) -> None:
    run = changed(RUN, ("    record =", "    initial { q = 0 rad; }\n    record ="))
    message, helps = only_help(tmp_path, RAIL, SERVO, run)
    assert message == "`q` of joint `rail`, which is prismatic, is in m, and this is in rad"
    assert helps == ("write it joint by joint: `rail.q = 0 m;`", "or leave it out: without it all joints begin at 0")
    assert codes(tmp_path, RAIL, SERVO, changed(run, ("q = 0 rad", "q = 0 rad; rail.q = 0 m"))) == []


def test_a_servo_of_the_library_that_is_not_included_is_told_as_that(tmp_path: Path) -> None:
    like = changed(SERVO, ("model = rigid_gearbox;", ""), ("servo drive", "servo drive like rigid_gearbox"))
    message, helps = only_help(tmp_path, ARM, like, RUN)
    assert message == "no servo `rigid_gearbox`"
    assert helps[0] == "a standard deck defines it: add `#include <servos/rigid_gearbox.ic>`"


def test_a_definition_and_its_base_that_both_vary_are_parted_by_a_value_of_its_own(tmp_path: Path) -> None:
    light = "servo light like drive { ki = 2 V/rad; }\n"
    sweep = "sweep it of hold { vary drive.kp = [0.1, 0.2] V*s/rad; vary light.kp = [0.1, 0.2] V*s/rad; }\n"
    message, helps = only_help(tmp_path, ARM, SERVO, light, changed(RUN, ("hinge = drive", "hinge = light")), sweep)
    assert message == "`drive.kp` and `light.kp` both set `hinge.servo.kp`"
    assert helps[1] == "or give `light` its own `kp`, which `drive` does not reach"


def test_a_sweep_path_that_is_like_nothing_is_told_what_paths_begin_with(tmp_path: Path) -> None:
    _, helps = only_help(tmp_path, ARM, SERVO, RUN, "sweep it of hold { vary nothing_at_all = [1, 2] kg; }\n")
    assert helps == ("paths begin with: links, swing, hinge, drive, initial",)


def test_a_record_faster_than_the_dynamics_is_warned_of(tmp_path: Path) -> None:
    (diagnostic,) = check(tmp_path, ARM, SERVO, changed(RUN, ("record = 100 Hz", "record = 4 kHz"))).diagnostics
    assert (diagnostic.code, diagnostic.severity) == ("D167", "warning")
    assert diagnostic.message == "`record` is faster than the dynamics: rows repeat, 4 for each step"
    assert codes(tmp_path, ARM, SERVO, changed(RUN, ("record = 100 Hz", "record = 1 kHz"))) == []


def test_the_deck_that_the_next_test_breaks_is_sound(tmp_path: Path) -> None:
    assert [d.code for d in check(tmp_path, ARM, SERVO, BESIDE, SWEEP, select="all").diagnostics] == []


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (("child = bar", "child = ber"), "D094"),
        (("revolute", "revolut"), "D090"),
        (("2 kg", "2 m"), "D061"),
        (("link bar", "link bar heavy"), "D085"),
        (("    arm = swing;\n", ""), "D112"),
        (("arm = swing;", "arm = swig;"), "D041"),
        (("hinge = drive", "hing = drive"), "D144"),
        (("hinge = drive", "hinge = driv"), "D041"),
        (("kp = 0.1 V*s/rad", "kp = 3 V"), "D061"),
        (("model = rigid_gearbox", "model = rigid_gearbx"), "D140"),
    ],
)
def test_one_broken_thing_makes_one_error_whatever_hangs_on_it(
    tmp_path: Path, change: tuple[str, str], code: str
) -> None:
    deck = changed("".join((ARM, SERVO, BESIDE, SWEEP)), change)
    assert [d.code for d in check(tmp_path, deck, select="all").diagnostics] == [code]
