"""Values written into a deck's text: where they stand, in which unit, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from ic.driver.write_values import DeckWithValues, with_values
from ic.driver.written_value import WrittenValue
from met.diagnostic import Problem

ARM = """#include <servos/rigid_gearbox.ic>

#define STIFF 0.02 V*s/rad
let slow = 0.03 rad/s;

arm pole {
    link rod { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = rod;  axis = z; }
}

servo base_drive like rigid_gearbox {
    kp      = 30 mV*s/rad;     // as delivered
    ki      = 0.2 V/rad;
    command = rate(slow);
}
servo drive like base_drive { ki = 0.1 V/rad; }
servo other like base_drive { kp = STIFF; }

run hold {
    arm      = pole;
    servos   { hinge = drive; }
    rates    { dynamics = 1 kHz;  servos = 1 kHz;  record = 10 Hz; }
    duration = 1 s;
    record   = [q];
    initial  { hinge.q = 10 deg; }
}
run longer like hold { duration = 2 s; }
run stiff like hold { servos { hinge = other; } }
sweep many of longer { vary drive.kp = [0.02, 0.03] V*s/rad; }
sweep few of longer { vary drive.ki = [0.2, 0.3] V/rad; }
sweep more = many + few;
"""


def made(tmp_path: Path, *values: tuple[str, float, str], text: str = ARM, run: str = "hold") -> DeckWithValues:
    wanted = [WrittenValue(*each) for each in values]
    return with_values(text, wanted, name="arm.ic", folder=tmp_path, experiment=run, remark="of 9: many, a.h5")


def changed(before: str, after: str) -> list[str]:
    old = before.splitlines()
    return [line for line in after.splitlines() if line not in old]


def refused(tmp_path: Path, *values: tuple[str, float, str], run: str = "hold") -> list[str]:
    with pytest.raises(Problem) as found:
        made(tmp_path, *values, run=run)
    (diagnostic,) = found.value.diagnostics
    assert diagnostic.code == "E397"
    return [diagnostic.message, *diagnostic.help]


def test_a_number_of_a_list_is_replaced_in_the_unit_behind_the_brackets(tmp_path: Path) -> None:
    text = ARM.replace("shape = rod(length = 1 m, along = x)", "com = [40, 1, 0] cm;  inertia = [1, 1, 1] kg*m^2")
    values = (("links.rod.com.x", 0.52, "m"), ("links.rod.com.y", 0.025, "m"), ("links.rod.inertia.zz", 1.5, "kg*m^2"))
    found = made(tmp_path, *values, text=text)
    assert "com = [52, 2.5, 0] cm;  inertia = [1, 1, 1.5] kg*m^2;" in found.text


def test_a_number_is_replaced_where_it_stands_in_its_own_unit(tmp_path: Path) -> None:
    found = made(tmp_path, ("base_drive.kp", 0.05, "V*s/rad"))
    assert changed(ARM, found.text) == ["    kp      = 50 mV*s/rad;     // as delivered"]
    assert found.others == ("longer",)


def test_a_line_without_a_comment_says_by_what_it_was_chosen(tmp_path: Path) -> None:
    found = made(tmp_path, ("base_drive.ki", 0.25, "V/rad"), run="stiff")
    assert changed(ARM, found.text) == ["    ki      = 0.25 V/rad;    // chosen of 9: many, a.h5"]


def test_the_next_choice_takes_the_place_of_the_remark(tmp_path: Path) -> None:
    first = made(tmp_path, ("drive.ki", 0.25, "V/rad")).text
    second = made(tmp_path, ("drive.ki", 0.5, "V/rad"), text=first.replace("of 9", "of 5")).text
    assert changed(ARM, second) == ["servo drive like base_drive { ki = 0.5 V/rad; }    // chosen of 9: many, a.h5"]


def test_what_comes_from_a_base_becomes_an_entry_of_the_definition_and_the_base_stays(tmp_path: Path) -> None:
    found = made(tmp_path, ("drive.kp", 0.05, "V*s/rad"))
    wanted = "servo drive like base_drive { ki = 0.1 V/rad;  kp = 0.05 V*s/rad; }    // chosen of 9: many, a.h5"
    assert changed(ARM, found.text) == [wanted]
    assert (found.run, found.others) == ("hold", ("longer",))


def test_what_comes_from_a_default_becomes_an_entry_among_those_of_several_lines(tmp_path: Path) -> None:
    found = made(tmp_path, ("base_drive.f_c", 0.03, "N*m"))
    assert changed(ARM, found.text) == ["    f_c     = 0.03 N*m;    // chosen of 9: many, a.h5"]


def test_what_comes_through_a_macro_is_left_to_its_author(tmp_path: Path) -> None:
    said = refused(tmp_path, ("other.kp", 0.05, "V*s/rad"), run="stiff")
    assert said == [
        "`other.kp` cannot be written into the deck: it comes through the macro STIFF",
        "write it by hand: `kp = 0.05 V*s/rad;` in what `other` is",
        "or leave the deck as it is, and run it with `--set 'other.kp=0.05 V*s/rad'`",
    ]


@pytest.mark.slow
def test_a_let_a_link_and_a_start_are_replaced(tmp_path: Path) -> None:
    values = ("slow", 0.05, "rad/s"), ("links.rod.mass", 3.5, "kg"), ("initial.hinge.q", 0.3490658503988659, "rad")
    found = made(tmp_path, *values)
    assert [line.split("//")[0].strip() for line in changed(ARM, found.text)] == [
        "let slow = 0.05 rad/s;",
        "link rod { mass = 3.5 kg;  shape = rod(length = 1 m, along = x); }",
        "initial  { hinge.q = 20 deg; }",
    ]


def test_what_a_run_has_from_the_run_that_it_is_like_is_left_alone(tmp_path: Path) -> None:
    said = refused(tmp_path, ("initial.hinge.q", 0.1, "rad"), run="longer")
    assert (
        said[0] == "`initial.hinge.q` cannot be written into the deck: it stands at line 25, which is of more than this"
    )


def test_a_value_of_one_joint_is_not_written_into_a_servo_of_its_own_accord(tmp_path: Path) -> None:
    said = refused(tmp_path, ("hinge.servo.kp", 0.1, "V*s/rad"))
    assert said[0].startswith("`hinge.servo.kp` cannot be written into the deck: it stands at line 12")


def test_the_run_of_a_sweep_is_written_to_and_a_sum_has_none(tmp_path: Path) -> None:
    assert made(tmp_path, ("drive.kp", 0.05, "V*s/rad"), run="many").run == "longer"
    said = refused(tmp_path, ("drive.kp", 0.05, "V*s/rad"), run="more")
    assert said[0] == "`more` is no sweep of one run, so no run can be given its values"


def test_a_long_line_has_its_remark_above_and_keeps_one(tmp_path: Path) -> None:
    long = ARM.replace(
        "servo drive like base_drive { ki", "servo drive like base_drive { v_max = 19.5 V;  j_m = 6e-5 kg*m^2;  ki"
    )
    found = made(tmp_path, ("drive.kp", 0.05, "V*s/rad"), ("drive.ki", 0.3, "V/rad"), text=long)
    assert changed(long, found.text) == [
        "// chosen of 9: many, a.h5",
        "servo drive like base_drive { v_max = 19.5 V;  j_m = 6e-5 kg*m^2;  ki = 0.3 V/rad;  kp = 0.05 V*s/rad; }",
    ]


def test_a_remark_above_goes_where_the_next_one_fits_at_the_end_of_the_line(tmp_path: Path) -> None:
    above = ARM.replace(
        "servo drive like base_drive", "// chosen of 400: many, an_archive.h5\nservo drive like base_drive"
    )
    found = made(tmp_path, ("drive.ki", 0.3, "V/rad"), text=above)
    assert changed(ARM, found.text) == ["servo drive like base_drive { ki = 0.3 V/rad; }    // chosen of 9: many, a.h5"]


@pytest.mark.slow
@pytest.mark.parametrize("si", [0.1, 1 / 3, 0.30000000000000004, 1e-5, 0.05 * (1 + 2**-52), 123456.789])
def test_the_deck_written_means_what_set_does_to_the_bit(si: float, tmp_path: Path) -> None:
    found = made(tmp_path, ("base_drive.kp", si, "V*s/rad"))
    plan = ic.compile(text=found.text, select="hold")
    assert plan.experiments[0].parameters["hinge.servo.kp"].value == si


def test_a_value_that_does_not_change_keeps_its_text(tmp_path: Path) -> None:
    text = ARM.replace("let slow = 0.03 rad/s;", "let slow = 30e-3 rad/s;\nlet soft = 1;\nlet whole = 3;")
    text = text.replace("mass = 2 kg", "mass = 2 kg * soft * whole")
    values = [("slow", 0.03, "rad/s"), ("soft", 1.0, ""), ("drive.ki", 0.1, "V/rad"), ("whole", 4.0, "1")]
    found = made(tmp_path, *values, text=text)
    assert changed(text, found.text) == ["let whole = 4;    // chosen of 9: many, a.h5"]


@pytest.mark.slow
@pytest.mark.parametrize(("si", "text"), [(4.0, "4"), (0.0, "0"), (2.5, "2.5"), (1e9, "1e+09")])
def test_whole_numbers_are_written_as_a_deck_would(si: float, text: str, tmp_path: Path) -> None:
    deck = ARM.replace("let slow", "let soft = 1;\nlet slow").replace("mass = 2 kg", "mass = 2 kg + 1 kg * soft")
    found = made(tmp_path, ("soft", si, ""), text=deck)
    assert changed(deck, found.text) == [f"let soft = {text};    // chosen of 9: many, a.h5"]
