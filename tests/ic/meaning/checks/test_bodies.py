"""Bodies that are too heavy for their size or for what carries them, or beside it, and joints that nothing holds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import changed, check

DECK = """\
arm leg {
    link coxa  { mass = 60 g;  shape = box(size = [40, 30, 30] mm, along = x); }
    link femur { mass = 80 g;  com = [40, 0, 0] mm;  inertia = [1e-5, 5e-5, 5e-5] kg*m^2; }
    link tibia { mass = 50 g;  shape = cylinder(radius = 5 mm, length = 120 mm, along = x); }
    joint hip  revolute { parent = base;   child = coxa;   axis = z; }
    joint lift revolute { parent = coxa;   child = femur;  axis = -y;  at = [40, 0, 0] mm; }
    joint knee revolute { parent = femur;  child = tibia;  axis = -y;  at = [80, 0, 0] mm; }
}
servo drive {
    model = rigid_gearbox;  ratio = 254;  kp = 0.02 V*s/rad;  ki = 0.2 V/rad;  v_max = 12 V;  resistance = 6 ohm;
    kt = 0.006 N*m/A;  tau_max = 0.02 N*m;  j_m = 2e-8 kg*m^2;  k_position = 8 1/s;
    command = position(trapezoid(to = 30 deg, max_rate = 60 deg/s, max_acceleration = 200 deg/s^2));
}
run stride {
    arm = leg;
    servos { hip = drive;  lift = drive;  knee = drive; }
    environment { gravity = [0, 0, -9.81] m/s^2;  }
    rates { dynamics = 4 kHz;  servos = 500 Hz;  record = 100 Hz; }
    duration = 2 s;
    record = [q];
}
"""
BARE = ("inertia = [1e-5, 5e-5, 5e-5] kg*m^2", "shape = box(size = [80, 30, 20] mm, along = x)")


def said(folder: Path, *changes: tuple[str, str]) -> list[str]:
    """What D297 says after these changes of the deck, from the first backquote to the first semicolon."""
    found = check(folder, changed(DECK, *changes), select="all").diagnostics
    assert not [each for each in found if each.severity == "error"], found
    return [each.message.partition(";")[0] for each in found if each.code == "D297"]


def test_the_deck_that_the_next_tests_change_is_usual(tmp_path: Path) -> None:
    assert said(tmp_path) == said(tmp_path, BARE) == []


def test_a_mass_is_told_beside_its_size_and_beside_what_carries_it(tmp_path: Path) -> None:
    found = said(tmp_path, ("mass = 80 g", "mass = 80 kg"))
    assert "`links.femur.mass` is 80 kg, 156.2 times that of water in a cube as long as it, 0.512 kg" in found
    assert "`links.femur.mass` is 80 kg, 1333 times the mass of the links that carry it, 0.06 kg" in found
    assert said(tmp_path, ("mass = 80 g", "mass = 800 g")) == []
    point = ("com = [40, 0, 0] mm;  inertia = [1e-5, 5e-5, 5e-5]", "inertia = [1e-9, 1e-9, 1e-9]")
    assert said(tmp_path, point) == []  # equal moments stand for a point


def test_a_mass_in_another_unit_is_blamed_for_a_joint_that_cannot_be_held(tmp_path: Path) -> None:
    balanced = ("duration = 2 s;", "duration = 2 s;  initial { servos = balanced; }")
    [first, *_] = check(tmp_path, changed(DECK, balanced, ("mass = 50 g", "mass = 50 kg")), select="all").diagnostics
    assert (first.code, first.help[0]) == (
        "D343",
        "`links.tibia.mass` is 50 kg, 3.83 times that of water in a cube as long as it, 13.05 kg: with 1,000 times "
        "less, which is usual, this would not be so",
    )
    assert said(tmp_path, balanced) == []  # the remedy


@pytest.mark.parametrize(
    ("changes", "beside"),
    [
        ([("com = [40, 0, 0] mm", "com = [150, 0, 0] mm")], "0.07 m, 0.28 times 10 times its radius of gyration"),
        ([BARE, ("com = [40, 0, 0] mm", "com = [140, 0, 0] mm")], "0.06 m, 0.6838 times the size of its shape"),
        ([BARE, ("com = [40, 0, 0] mm", "com = [-40, 0, 0] mm")], None),  # of a shape that leads the other way
        ([("com = [40, 0, 0] mm", "com = [90, 0, 0] mm")], None),
    ],
)
def test_a_centre_beside_the_shape_and_the_joints_of_its_link_is_told(
    tmp_path: Path, changes: list[tuple[str, str]], beside: str | None
) -> None:
    found = said(tmp_path, *changes)
    told = f"`links.femur.com` is beside the shape and the joints of `femur` by {beside}"
    assert [each.startswith(told) for each in found] == ([True] if beside else [])


def test_what_is_said_to_be_usual_is_not_told(tmp_path: Path) -> None:
    """What was found: of a limit of 0.0351 rad, rounded, 0.0351 rad and more was told again."""
    volts = changed(DECK, ("v_max = 12 V", "v_max = 11.7 V"), ("max_rate = 60 deg/s", "max_rate = 20 rad/s"))
    faster = changed(volts, ("max_acceleration = 200 deg/s^2", "max_acceleration = 9000 rad/s^2"))
    [first, *_] = [each for each in check(tmp_path, faster, select="all").diagnostics if each.code == "D297"]
    most = first.help[0].removeprefix("at most ").removesuffix(" is usual")
    assert most == "7.67 rad/s"  # 11.7/(0.006 * 254) = 7.677
    mended = changed(faster, ("max_rate = 20 rad/s", f"max_rate = {most}"))
    assert [each for each in check(tmp_path, mended, select="all").diagnostics if each.code == "D297"] == []


def test_a_joint_without_a_place_on_a_long_link_is_told(tmp_path: Path) -> None:
    without, line = (
        ("axis = -y;  at = [80, 0, 0] mm;", "axis = -y;"),
        "`knee.axis` turns `knee` about the line of `lift`",
    )
    assert said(tmp_path, BARE, without) == [
        "`knee.at` is not written, and `femur`, which carries the joint, is 0.08 m long",
        line,
    ]
    assert said(tmp_path, BARE, (without[0], "axis = -y;  at = [0, 0, 0] mm;")) == [line]  # the place is meant so
    short = ("axis = -y;  at = [40, 0, 0] mm;", "axis = -y;")
    assert said(tmp_path, short) == []  # no longer than wide


def test_a_joint_that_nothing_holds_beside_motors_is_told(tmp_path: Path) -> None:
    free = (";  knee = drive; }", "; }")
    assert said(tmp_path, free) == ["`knee` has no servo, and gravity loads it by 0.02943 N*m at the start"]
    for said_so in ("initial { knee.q = 0 rad; }", "initial { knee.q = 90 deg; }"):
        assert said(tmp_path, free, ("duration = 2 s;", f"duration = 2 s;  {said_so}")) == []
    assert said(tmp_path, free, ("gravity = [0, 0, -9.81] m/s^2;", "")) == []
    passive = ("run stride", "servo loose { model = passive;  damping = 1e-3 N*m*s/rad; }\nrun stride")
    assert said(tmp_path, (";  knee = drive;", ";  knee = loose;"), passive) == []


def test_a_spring_that_its_load_winds_up_is_told(tmp_path: Path) -> None:
    spring = "servo soft {{ model = passive;  stiffness = {} N*m/rad; }}\nrun stride"
    knee = (";  knee = drive;", ";  knee = soft;")
    assert said(tmp_path, knee, ("run stride", spring.format("0.5"))) == []
    assert said(tmp_path, knee, ("run stride", spring.format("5e-3"))) == [
        "`knee.servo.stiffness` lets the load at the start wind it up by 5.886 rad, 1.874 times half a turn"
    ]


def test_gravity_that_leads_up_is_told_but_not_on_a_ceiling(tmp_path: Path) -> None:
    up = ("0, 0, -9.81]", "0, 0, 9.81]")
    assert said(tmp_path, up) == ["`environment.gravity.g` leads up: its z is 9.81 m/s^2"]
    assert said(tmp_path, up, ("child = coxa;   axis = z;", "child = coxa;   axis = z;  rpy = [180, 0, 0] deg;")) == []
    assert said(tmp_path, ("0, 0, -9.81]", "9.81, 0, 0]")) == []


def test_a_wrench_far_beyond_the_motors_is_told(tmp_path: Path) -> None:
    def gust(newtons: int, window: str = "") -> tuple[str, str]:
        wrench = f"wrench {{ link = tibia;  point = [100, 0, 0] mm;  force = [0, {newtons}, 0] N;  {window} }}"
        return "m/s^2; ", f"m/s^2;  gust = {wrench}; "

    assert said(tmp_path, gust(20)) == []
    assert said(tmp_path, gust(2000)) == [
        "`environment.gust.force` loads a joint by 440 N*m, 86.61 times the motor's largest at joint `hip`, 5.08 N*m"
    ]
    assert said(tmp_path, gust(2000, "until = 0.1 s;")) == []  # a blow
