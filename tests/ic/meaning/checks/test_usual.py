"""What is said of an unstable loop, or of a servo too weak, begins with the one number that is to blame, if any is."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import changed, check

DECK = """\
arm two {
    link upper { mass = 4 kg;  shape = cylinder(radius = 40 mm, length = 0.5 m, along = x); }
    link fore { mass = 2 kg;  shape = cylinder(radius = 30 mm, length = 0.4 m, along = x); }
    joint shoulder revolute { parent = base;  child = upper;  axis = -y; }
    joint elbow revolute { parent = upper;  child = fore;  axis = -y;  at = [0.5, 0, 0] m; }
}
servo drive {
    model = rigid_gearbox;  ratio = 100;  kp = 0.4 V*s/rad;  ki = 3 V/rad;  v_max = 48 V;  resistance = 0.5 ohm;
    kt = 0.1 N*m/A;  tau_max = 2 N*m;  j_m = 1e-4 kg*m^2;  k_position = 8 1/s;
    command = position(0 deg);
}
run move {
    arm = two;
    servos { shoulder = drive;  elbow = drive; }
    payload box { on = fore;  mass = 1 kg;  at = [0.4, 0, 0] m;  shape = sphere(radius = 5 cm); }
    rates { dynamics = 2 kHz;  servos = 500 Hz;  record = 100 Hz; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    duration = 3 s;
    record = [q];
}
"""
START = ("duration = 3 s;", "duration = 3 s;  initial { servos = balanced; }")


def helps(
    folder: Path, code: str, *changes: tuple[str, str], more: str = "", select: str = "all"
) -> list[tuple[str, ...]]:
    """The remedies of each diagnostic of this code after these changes of the deck."""
    found = check(folder, changed(DECK, *changes) + more, select=select).diagnostics
    return [each.help for each in found if each.code == code]


def test_a_loop_that_a_payload_makes_unstable_begins_with_it(tmp_path: Path) -> None:
    assert helps(tmp_path, "D322") == []
    first = helps(tmp_path, "D322", ("mass = 1 kg", "mass = 500 kg"))[0][0]
    assert first == (
        "`payloads.box.mass` is 500 kg, 83.33 times the mass of the moved links, 6 kg: with 1,000 times less, which "
        "is usual, this would not be so"
    )
    assert helps(tmp_path, "D322", ("mass = 1 kg", "mass = 500 g")) == []  # the remedy


def test_the_number_of_a_servo_that_two_joints_share_is_one(tmp_path: Path) -> None:
    both = helps(tmp_path, "D322", ("j_m = 1e-4", "j_m = 0.1"))
    assert {each[0] for each in both} == {
        "`shoulder.servo.j_m` is felt at the joint as 1000 kg*m^2, 205.8 times the mass of the moved links times the "
        "reach squared, 4.86 kg*m^2: with 69 times less, which is usual, this would not be so"
    }


@pytest.mark.parametrize(
    ("change", "blamed"),
    [
        (("mass = 4 kg;", "mass = 4 kg;  com = [250, 0, 0] m;"), "`links.upper.com` is 250 m, 277.8 times "),
        (("ratio = 100;", "ratio = 0.01;"), "`shoulder.servo.ratio` is 0.01: with 10,000 times more, which is usual, "),
        (("-9.81", "-981"), "`environment.gravity.g` is 981 m/s^2, 100 times that on the Earth: with 100 times less, "),
        (("tau_max = 2 N*m;", "tau_max = 0.1 N*m;"), None),  # nothing that the motion depends on is far from usual
    ],
)
def test_a_start_that_no_servo_holds_begins_with_the_number_to_blame(
    tmp_path: Path, change: tuple[str, str], blamed: str | None
) -> None:
    assert helps(tmp_path, "D343", START) == []
    found = helps(tmp_path, "D343", START, change)
    assert found and all(len(each) == (2 if blamed is None else 3) for each in found)
    assert blamed is None or all(each[0].startswith(blamed) for each in found)


def test_where_a_third_of_the_gain_is_stable_no_other_number_is_blamed(tmp_path: Path) -> None:
    """What was found: a needle, on a motor that suits it, was told to have 47 times less rotor."""
    needle = """\
arm needle {
    link bar { mass = 20 mg;  shape = cylinder(radius = 0.5 mm, length = 12 mm, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = -y; }
}
servo drive {
    model = rigid_gearbox;  ratio = 64;  kp = 5e-3 V*s/rad;  ki = 0.05 V/rad;  v_max = 3 V;  resistance = 30 ohm;
    kt = 1e-3 N*m/A;  tau_max = 2e-4 N*m;  j_m = 1e-10 kg*m^2;  k_position = 4 1/s;  command = position(0 deg);
}
run move {
    arm = needle;  servos { hinge = drive; }
    rates { dynamics = 2 kHz;  servos = 500 Hz;  record = 100 Hz; }
    duration = 3 s;  record = [q];
}
"""
    [found] = check(tmp_path, needle, select="all").diagnostics
    assert (found.code, found.help[0][:27]) == ("D320", "stable up to 0.61 times the")


def test_a_number_that_a_sweep_varies_is_not_blamed(tmp_path: Path) -> None:
    sweep = "sweep s of move { vary payloads.box.mass = [500, 600] kg; }\n"
    found = helps(tmp_path, "D322", ("mass = 1 kg", "mass = 500 kg"), more=sweep, select="s")
    assert found and not any(each[0].startswith("`payloads.box.mass`") for each in found)
