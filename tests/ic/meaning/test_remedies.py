"""Messages that say what to write, and one broken thing that makes one message."""

from __future__ import annotations

from pathlib import Path

import pytest

from met.messages.edits import apply, edits
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


OWN = changed(
    RUN, ("record = [q];", "record = [q];\n    metric top = max { of = hinge.qd; }\n    signal s = hinge.qd;")
)

APPLIED = [
    ("D147", 1, "deck 2; // this\n" + ARM + SERVO + changed(RUN, ("= drive", "= rigid_gearbox { command = rate(1 rad/s); }"))),
    ("D147", 1, ARM + SERVO + changed(RUN, ("= drive", "= rigid_gearbox { command = rate(1 rad/s); }"))),
    ("D053", 1, ARM + SERVO + RUN + "arm b like swing { joint hinge revolute { axis = y; } }\n"),
    ("D053", 1, ARM + SERVO + RUN + "arm b like swing { link bar { mass = 3 kg; } }\n"),
    ("D053", 0, ARM + SERVO + RUN + "arm b like swing { joint hinge prismatic { axis = y; } }\n"),
    ("D023", 2, ARM + SERVO + changed(OWN, ("\n}", "\n    require top = 1 rad/s;\n}"))),
    ("D020", 1, ARM + SERVO + changed(OWN, ("\n}", "\n    linear hinge.servo { open = hinge.servo.voltage; }\n}"))),
    ("D125", 1, ARM + SERVO + changed(OWN, ("[q]", "[q, reaction.hinge]"))),
    ("D125", 1, ARM + SERVO + changed(OWN, ("[q]", "[q, s]"))),
    ("D128", 1, ARM + SERVO + RUN + "sweep it of hold { vary joints.hinge.servo.kp = [1, 2] V*s/rad; }\n"),
    ("D128", 0, ARM + SERVO + RUN + "sweep it of hold { vary swing.hinge.at = [1, 2] m; }\n"),
    ("D052", 1, ARM + SERVO + changed(OWN, ("= drive;", "like drive { kp = 2 V*s/rad; }"))),
    ("D307", 1, ARM + SERVO + changed(OWN, ("\n}", "\n    require percentile(top, 99) < 9 rad/s;\n}"))),
]  # fmt: skip


TOLD = [
    (changed(OWN, ("\n}", "\n    hinge { q_max = 1 rad; }\n}")),
     "it is the arm's: `arm OTHER like ARM { hinge { ... } }`, and `arm = OTHER;` here"),
    (changed(OWN, ("\n}", "\n    linear { open = hinge.servo.voltage; }\n}")), "write `linear NAME { ... }`"),
    (changed(OWN, ("\n}", "\n    servos.hinge = drive;\n}")),
     "write `hinge = drive;` in the run's `servos { ... }`, in place of what is there"),
    (changed(OWN, ("\n}", "\n    rates.base = 2 kHz;\n}")), "write `base = 2 kHz;` in the run's `rates { ... }`"),
    (OWN + "run two like hold { servos.hinge = drive; }\n", "write `servos { hinge = drive; }`"),
    (OWN + "sweep it of hold { vary hold.duration = [1, 2] s; }\n",
     "it decides the program: write `vary duration = [...];`"),
    (changed(OWN, ("\n}", "\n    sensor s = gyroscope { link = bar; along = z; rate = 300 Hz; }\n}")),
     "where the axis is meant, write `[0, 0, 1]`"),
    (changed(OWN, ("\n}", "\n    sensor s = gyroscope { link = bar; along = [0, 0, 1]; rate = 300 Hz; }\n}")),
     "give the sensor a `rate` that divides 1000 Hz, or quicken the dynamics"),
    (OWN + "sweep it of hold { vary drive.kp = normal(1, 2) V*s/rad; }\n",
     "a value is drawn in a sample: `sample lhs(200) { PATH = normal(...); }`, in a sweep"),
    (OWN + "sweep it of hold { vary drive.kp = between(1, 2) V*s/rad; }\n",
     "a range is chosen from in a `tune` or a `search`; a sweep has `linspace(FROM, TO, COUNT)`"),
    (OWN + "arm b like swing { remove bar; }\n", "remove joint `hinge` too, or hang it elsewhere"),
    (changed(OWN, ("\n}", "\n    metric m = gain_margin { of = hinge.servo.voltage; }\n}")),
     "write `linear hinge_servo_voltage { open = hinge.servo.voltage; }` in the run, and `of = hinge_servo_voltage;` "
     "here"),
    (OWN + "tune t of hold { choose drive.kp = between(0.1, 1) V*s/rad; goal = top; }\n",
     "a tune has: choose, against, confirm, minimise, maximise, margin, least_margin, gradients, at_most, seed, allow"),
]  # fmt: skip


@pytest.mark.parametrize(("rest", "help"), TOLD)
def test_what_stands_in_another_block_or_word_is_told_as_that(tmp_path: Path, rest: str, help: str) -> None:
    found = check(tmp_path, ARM, SERVO, rest, select="all").diagnostics
    assert help in [each.help[0] for each in found if each.help]


@pytest.mark.parametrize(("code", "count", "text"), APPLIED)
def test_what_a_help_writes_into_the_text_is_sound(tmp_path: Path, code: str, count: int, text: str) -> None:
    found = next(each for each in check(tmp_path, text, select="all").diagnostics if each.code == code)
    made = [apply(edit, text) for _, edit in edits(found, {str(tmp_path / "deck.ic"): text})]
    assert len(made) == count, found.help
    for mended in made:
        assert "error" not in {each.severity for each in check(tmp_path, mended, select="all").diagnostics}, mended


def test_a_file_that_is_included_twice_is_mended_behind_its_edition(tmp_path: Path) -> None:
    beside = tmp_path / "beside.ic"
    beside.write_text("deck 2;\nlet reach = 1 m;\n", encoding="utf-8")
    both = '#include "beside.ic"\n#include "beside.ic"\n'
    (found,) = check(tmp_path, both).diagnostics
    ((_, edit),) = edits(found, {str(beside): beside.read_text("utf-8")})
    beside.write_text(apply(edit, beside.read_text("utf-8")), encoding="utf-8")
    assert "D040" not in codes(tmp_path, both) and "D391" not in codes(tmp_path, both)


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
