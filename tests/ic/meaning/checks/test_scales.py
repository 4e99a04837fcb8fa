"""Numbers far outside what is usual beside others of the same run are remarked on; usual ones are not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import ic
from ic.meaning.checks.run_numbers import RunNumbers
from met.cli import main
from tests.ic.small_decks import changed
from tests.oracles.plan_tree import pinocchio
from tests.oracles.random_deck import random_deck

TWO_LINKS = """\
arm two {
    link upper { mass = 4 kg; com = [0.3, 0, 0] m; inertia = [0.01, 0.12, 0.12] kg*m^2; }
    link fore { mass = 2 kg; com = [0.2, 0, 0] m; inertia = [0.004, 0.03, 0.03] kg*m^2; }
    joint shoulder revolute { parent = base; child = upper; axis = y; }
    joint elbow revolute { parent = upper; child = fore; axis = y; at = [0.6, 0, 0] m; }
}
servo drive {
    model = rigid_gearbox;
    ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
    tau_max = 1 N*m; j_m = 1e-4 kg*m^2; f_c = 0.01 N*m; k_position = 4 1/s;
    sensor q = encoder { step = 0.0001 rad; }
    command = position(trapezoid(start = 0 deg, to = 60 deg, max_rate = 0.8 rad/s, max_acceleration = 2 rad/s^2));
}
run lift {
    arm = two;
    servos { shoulder = drive; elbow = drive; }
    environment { gravity = [0, 0, -9.81] m/s^2;  push = wrench { link = fore; point = [0.4, 0, 0] m; force = [0, 0, 1] N; } }
    payload tool { on = fore; at = [0.4, 0, 0] m; mass = 1 kg; inertia = [1e-3, 1e-3, 1e-3] kg*m^2; }
    rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 3 s;
    record = [q];
    metric late = settling_time(of = elbow.q, target = 60 deg, band = 2 %);
}
"""


def remarks(*changes: tuple[str, str], text: str = TWO_LINKS) -> list[tuple[str, tuple[str, ...]]]:
    """What D297 says of the deck after these changes, with its remedies but for the last, which allows it."""
    found = ic.check(text="deck 2;\n" + changed(text, *changes), select="all").diagnostics
    assert {each.code for each in found} <= {"D297", "D322"}, found  # a loop may be unstable besides
    return [(each.message, each.help[:-1]) for each in found if each.code == "D297"]


def test_the_deck_that_the_next_tests_change_is_usual() -> None:
    assert remarks() == []


PUSH = "push = wrench { link = fore; point = [0.4, 0, 0] m; force = [0, 0, 1] N; }"
"""A load on the arm, without which the motors alone hold it."""


SPRING = "servo spring { model = passive;  stiffness = 0.01 N*m/rad; }"


def test_two_driven_joints_about_one_line_are_told_and_a_spring_in_a_joint_is_not() -> None:
    roll = "joint elbow revolute { parent = upper; child = fore; axis = x; at = [0.6, 0, 0] m; }"
    hand = "link hand { mass = 0.1 kg; shape = sphere(radius = 50 mm); }"
    elbow, servos = next(line for line in TWO_LINKS.splitlines() if "joint elbow" in line), "elbow = drive; }"

    def found(axis: str, servo: str, place: str = "0.2", between: str = roll) -> list[str]:
        wrist = f"joint wrist revolute {{ parent = fore; child = hand; axis = {axis}; at = [{place}, 0, 0] m; }}"
        driven = (servos, f"elbow = drive;  wrist = {servo}; }}")
        changes = ((elbow.strip(), f"{between} {hand} {wrist}"), driven, ("run lift {", f"{SPRING}\nrun lift {{"))
        return [message for message, _ in remarks(*changes) if "the line of" in message]

    said = "`wrist.axis` turns `wrist` about the line of `elbow`; two motors in a row usually turn about two lines"
    assert found("x", "drive") == [said] == found("-x", "drive")
    assert found("z", "drive") == found("x", "spring") == found("y", "drive", between=elbow.strip()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said", "help"),
    [
        (("to = 60 deg, max_rate", "to = 60 rad, max_rate"),
         "`shoulder.servo.command.to` is 60 rad, 9.549 times a turn; 1 more is so; joints of published arms turn by at "
         "most 1.6 turns", ("in deg it would be 0.167 times a turn: is the unit another?", "at most 18.8 rad is usual")),
        (("com = [0.2, 0, 0] m", "com = [20, 0, 0] cm"), "", ()),
        (("to = 60 deg, max_rate", "to = 30 cycle, max_rate"), "", ()),  # a drum
        (("com = [0.2, 0, 0] m", "com = [20, 0, 0] m"),
         "`links.fore.com` is 20 m, 33.33 times the arm's reach, 0.6 m; of 470 links of published robots none is above 0.42", ("in cm it would be 0.333 times, in mm it would be 0.0333 times the arm's reach, 0.6 m: is the unit another?",
          "at most 1.2 m is usual")),
        (("at = [0.6, 0, 0] m", "at = [60, 0, 0] m"),
         "`elbow.at` is 60 m, 200 times the rest of its chain, 0.3 m; of 718 joints of published robots none is above 21.4", ("in cm it would be 2 times the rest of its chain, 0.3 m: is the unit another?",
          "at most 18 m is usual")),
        (("[0.004, 0.03, 0.03] kg*m^2", "[40, 300, 300] kg*m^2"),
         "`links.fore.inertia` has a radius of gyration of 12.25 m, 20.41 times the arm's reach, 0.6 m; of 620 links of published robots all have 0.00018 to 1.3 times their robot's reach",
         ("in kg*cm^2 it would be 0.204 times the arm's reach, 0.6 m: is the unit another?", "at most 2.4 m is usual")),
        (("[0.004, 0.03, 0.03] kg*m^2", "[3e-9, 3e-9, 3e-9] kg*m^2"),
         "`links.fore.inertia` has a radius of gyration of 3.873e-05 m, 6.455e-05 times the arm's reach, 0.6 m; of 620 links of published robots all have 0.00018 to 1.3 times their robot's reach",
         ("at least 6e-05 m is usual",)),
        (("point = [0.4, 0, 0] m", "point = [400, 0, 0] m"),
         "`environment.push.point` is 400 m, 666.7 times the arm's reach, 0.6 m; what acts on an arm acts on it, or on "
         "what it carries", ("in mm it would be 0.667 times, in cm it would be 6.67 times the arm's reach, 0.6 m: is the unit another?", "at most 6 m is usual")),
        (("ratio = 100", "ratio = 0.1"),
         "`shoulder.servo.ratio` is 0.1; 1 more is so; gears of arms slow their motor down, by 1 to some 3,000",
         ("at least 0.2 is usual",)),
        (("max_rate = 0.8 rad/s, max_acceleration = 2", "max_rate = 8 rad/s, max_acceleration = 200"),
         "`shoulder.servo.command` asks for 8 rad/s, 1.667 times the rate at which the motor's back-EMF is all of `v_max`, "
         "4.8 rad/s; 1 more is so; no motor runs faster", ("at most 4.8 rad/s is usual",)),
        (("tau_max = 1 N*m", "tau_max = 90 N*m"),
         "`shoulder.servo.tau_max` is 90 N*m, 75 times what all of `v_max` gives at a standstill, 1.2 N*m; 1 more is so; a "
         "motor has more only where it is turned backwards, and then at most twice that",
         ("in N*cm it would be 0.75 times what all of `v_max` gives at a standstill, 1.2 N*m: is the unit another?", "at most 12 N*m is usual")),
        (("tau_max = 1 N*m", "tau_max = 11 N*m"), "", ()),
        (("tau_max = 1 N*m", "tau_max = 1e9 N*m"), "", ()),  # none
        (("f_c = 0.01", "f_c = 1.5"),
         "`shoulder.servo.f_c` is 1.5 N*m, 1.5 times the motor's largest torque, 1 N*m; 1 more is so; a motor that cannot "
         "break away moves nothing", ("in N*cm it would be 0.015 times the motor's largest torque, 1 N*m: is the unit "
         "another?", "at most 1 N*m is usual")),
        (("tau_max = 1 N*m", "tau_max = 0.1 N*m"), "", ()),
        ((PUSH, ""), "", ()),
        (("step = 0.0001 rad", "step = 0.1 rad"),
         "`elbow.servo.sensor.q.step` is 0.1 rad, 4.775 times the band of metric `late`, 0.02094 rad; a servo knows its "
         "joint no better than its sensor", ("at most 0.0418 rad is usual",)),
        (("mass = 1 kg", "mass = 1500 kg"),
         "`payloads.tool.mass` is 1500 kg, 250 times the mass of the moved links, 6 kg; industrial robots lift a tenth to a "
         "third of their mass", ("at most 1.2e+03 kg is usual",)),
        (("-9.81", "-981"),
         "`environment.gravity.g` is 981 m/s^2, 100 times that on the Earth; the Moon has 0.17 of it, Jupiter 2.5, the Sun "
         "28", ("in cm/s^2 it would be 1 times that on the Earth: is the unit another?", "at most 294 m/s^2 is usual")),
    ],
)  # fmt: skip
def test_what_is_far_outside_what_is_usual_is_told(change: tuple[str, str], said: str, help: tuple[str, ...]) -> None:
    assert remarks(change) == ([(said, help)] if said else [])


def test_of_a_motor_that_cannot_hold_its_arm_the_load_and_what_it_holds_are_told() -> None:
    """Where something else may hold the arm as well nothing is."""
    weak = ("tau_max = 1 N*m", "tau_max = 0.1 N*m")
    [(said, (help,))] = remarks(weak, (PUSH, ""))
    load = 9.81 * (4.0 * 0.3 + 2.0 * 0.8 + 1.0 * 1.0)
    assert said.startswith(f"`shoulder.servo.tau_max` meets a load of {load:.4g} N*m, ")
    assert said.endswith("times what it holds at the joint, 11 N*m; a motor that cannot hold its arm lets it fall")
    enough = help.removesuffix(" would hold it")
    assert remarks((weak[0], f"tau_max = {enough}"), (PUSH, "")) == []
    stop = "stop = joint_stop { joint = NAME; lower = -1 rad; upper = 1 rad; stiffness = 0.01 N*m/rad; }"
    assert len(remarks(weak, (PUSH, stop.replace("NAME", "elbow")))) == 1
    assert remarks(weak, (PUSH, stop.replace("NAME", "shoulder"))) == []


def test_what_only_gears_and_sensors_do_is_told() -> None:
    play = ("model = rigid_gearbox;", "model = compliant_gearbox; backlash = 0.8 rad; stiffness = 1e4 N*m/rad;")
    [(said, _)] = remarks(play)
    assert said.startswith(
        "`shoulder.servo.backlash` is 0.8 rad, 0.7639 times the motion that is commanded, 1.047 rad; "
    )
    found = dict(remarks(("step = 0.0001 rad", "step = 2 rad")))
    assert any(
        each.startswith("`shoulder.servo.sensor.q.step` is 2 rad, 1.91 times what is commanded, ") for each in found
    )


def test_a_brake_that_is_on_throughout_a_motion_is_told() -> None:
    brake = "hold = brake { joint = elbow; torque = 150 N*m; }"
    [(said, _)] = remarks((PUSH, brake))
    assert said.startswith(
        "`environment.hold.torque` is 150 N*m, 1.5 times the motor's largest at the joint, 100 N*m; "
    )
    assert remarks((PUSH, brake.replace("150", "90"))) == []
    assert remarks((PUSH, brake.replace("150 N*m;", "150 N*m; until = 1 s;"))) == []


def test_a_joint_far_from_the_shape_that_carries_it_is_told() -> None:
    """What was found: a rod along z under a joint that sits along x."""
    body = "com = [0.3, 0, 0] m; inertia = [0.01, 0.12, 0.12] kg*m^2;"
    rod = (body, "shape = rod(length = 0.6 m, along = x);")
    assert remarks(rod) == []
    for shape in ("rod(length = 0.6 m, along = z)", "box(size = [0.02, 0.6, 0.02] m, along = y)"):
        [(said, _)] = remarks((body, f"shape = {shape};"))
        assert said.startswith("`elbow.at` is beside the shape of `upper` by 0.")
    hangs = ("tool { on = fore; at = [0.4, 0, 0] m", "tool { on = fore; at = [0.4, 0, -2] m")
    assert remarks(rod, hangs) == []
    assert remarks((body, "shape = sphere(radius = 0.02 m);")) == []
    far = ("tool { on = fore; at = [0.4, 0, 0] m", "tool { on = fore; at = [0.4, 0, -4] m")
    assert [each for each, _ in remarks(far)] == [
        "`payloads.tool.at` is beside the joints of `fore` by 4.02 m, 6.7 times the arm's reach, 0.6 m; a payload is "
        "usually at its link, or hangs from it"
    ]


def test_a_prismatic_joint_that_goes_far_for_its_arm_is_told() -> None:
    elbow = "joint elbow revolute { parent = upper; child = fore; axis = y;"
    slide = (elbow, elbow.replace("revolute", "prismatic").replace("axis = y", "axis = x"))
    way = "trapezoid(to = 300 UNIT, max_rate = 20 mm/s, max_acceleration = 1 m/s^2)"
    drive = (
        f"elbow = drive {{ ratio = 1 rad/mm; command = position({way}); sensor q = encoder {{ step = 10 um; }} }}; }}"
    )
    late = ("    metric late = settling_time(of = elbow.q, target = 60 deg, band = 2 %);\n", "")
    of_mm, of_m = (("elbow = drive; }", drive.replace("UNIT", unit)) for unit in ("mm", "m"))
    assert remarks((PUSH, ""), slide, late, of_mm) == []
    assert [each for each, _ in remarks((PUSH, ""), slide, late, of_m)] == [
        "`elbow.servo.command.to` is 300 m, 500 times the arm's reach, 0.6 m; a rail is seldom as long as 300 of its arms"
    ]


def test_a_free_base_that_falls_under_gravity_is_told() -> None:
    flight = ("    arm = two;", "    arm = two; base = free;")
    body = ("arm two {", "arm two {\n    link base { mass = 50 kg; shape = box(size = [0.5, 0.5, 0.5] m); }")
    said = [each for each, _ in remarks((PUSH, ""), flight, body)]
    assert said == [
        "`environment.gravity.g` lets the base fall freely by 44.15 m, 73.58 times the arm's reach, 0.6 m; what floats "
        "falls with its orbit, which is no gravity to it"
    ]
    assert remarks(flight, body) == []  # where something pushes it, it may fly


def test_of_a_sweep_the_worst_case_is_told() -> None:
    sweep = "sweep s of lift { vary initial.elbow.q = [10, 90, 20] rad; }\n"
    [(said, _)] = remarks(text=TWO_LINKS + sweep)
    assert said.startswith("`initial.elbow.q` is 90 rad in case #1, 14.32 times a turn; ")


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(6))
def test_loads_of_gravity_are_those_of_pinocchio(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "deck.ic"
    path.write_text(random_deck(seed))
    compiled = ic.check(path)
    assert compiled.plan is not None
    experiment, scope = compiled.plan.experiments[0], compiled.scopes[0]
    settled = {**scope.parameters, **scope.auxiliary}
    numbers = {path: each.value for path, each in settled.items() if isinstance(each.value, float)}
    run = RunNumbers(experiment.structure, (), settled, numbers, {})
    g = run.vector("environment.gravity.g")
    q = [numbers[f"initial.{joint.name}.q"] for joint in experiment.structure.moving]
    zero = np.zeros(len(q))
    wanted = pinocchio(experiment, gravity=g.tolist()).torques(q, zero, zero, {})
    np.testing.assert_allclose(list(run.loads.values()), -wanted, rtol=1e-9, atol=1e-9)


def test_all_scales_are_shown_and_given_to_programs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "deck.ic"
    path.write_text("deck 2;\n" + changed(TWO_LINKS, ("f_c = 0.01", "f_c = 1.5")))
    assert main(["explain", f"{path}", "--scales"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == "lift"
    assert [line.split("  ")[1] for line in shown if "OUTSIDE" in line] == ["dry friction"]
    at = next(at for at, line in enumerate(shown) if line.split() == ["gravity", "1", "1", "up", "to", "30"])
    assert shown[at + 1] == "      environment.gravity.g is 9.81 m/s^2, beside that on the Earth"
    assert shown[3].split("  ")[1] == "kind" and max(map(len, shown)) <= 100
    assert main(["explain", f"{path}", "--scales", "--format", "json"]) == 0
    [run] = json.loads(capsys.readouterr().out)
    [friction] = [each for each in run["scales"] if each["path"] == "elbow.servo.f_c"]
    assert (friction["multiple"], friction["high"], friction["unit"]) == (1.5, 1.0, "N*m")


def test_a_path_or_scales_must_be_asked_for_and_a_plan_has_none(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for words, said in (([], "write a PATH, or one of `--scales` and"), (["q", "--scales"], "write a PATH, or one")):
        assert main(["explain", "deck.ic", *words]) == 2
        assert said in capfd.readouterr().err
    assert main(["explain", "plan.json", "--scales"]) == 2
    assert "are of a deck; this is a plan" in capfd.readouterr().err


@pytest.mark.parametrize("place", ["1e120", "1e200", "-1e308"])
def test_a_length_whose_powers_no_float_has_is_remarked_on_like_others(place: str) -> None:
    (first, _), *_ = remarks(("com = [0.3, 0, 0] m", f"com = [{place}, 0, 0] m"))
    assert first.startswith("`links.upper.com")
