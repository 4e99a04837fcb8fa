"""Decks to plans: what is in a plan, where its values come from, and which run is taken."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest

import ic
from ic.driver.explain import explain
from ic.text.files import LIBRARY
from met.diagnostic import Problem
from met.plan import Command, Recorded
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment

TWO_LINK = LIBRARY / "two_link.ic"


@pytest.mark.release
def test_the_decks_that_come_with_met_compile() -> None:
    for deck in sorted(LIBRARY.glob("*.ic")):
        compiled = ic.check(deck, select="all")
        assert compiled.plan is not None, (deck.name, [(d.code, d.message) for d in compiled.diagnostics])


def test_the_paper_deck_means_what_the_paper_says() -> None:
    (run,) = ic.compile(TWO_LINK).experiments
    assert run.name == "nominal"
    schedule = run.structure.schedule
    assert (schedule.base_hz, schedule.dynamics, schedule.record, schedule.duration) == (100.0, 4, 4, 20.0)
    assert [use.divisor for use in run.structure.servos] == [1, 1]
    assert not run.structure.velocity_products
    expected = {  # Hill, Hopping and Price 1989, table 1, in SI
        "ratio": 1570.0,
        "kp": 0.020,
        "ki": 0.125,
        "v_max": 20.0,
        "resistance": 2.05,
        "kt": 0.061,
        "tau_max": 0.144,
        "j_m": 6.38e-5,
        "f_c": 0.0205,
        "f_v": 2.58e-5,
        "command.value": 0.03,
    }
    for joint in ("shoulder", "elbow"):
        assert {name: run.parameters[f"{joint}.servo.{name}"].value for name in expected} == expected
    assert run.parameters["links.upper.inertia.zz"].value == pytest.approx(40.0 * 4.0 / 12.0, rel=1e-15)
    assert run.parameters["elbow.at.x"].value == 2.0
    (note,) = run.notes  # the lower arm of mass m swings about the elbow: the arm's inertia adds to the rotor's
    assert note.startswith("step size: joint `elbow` decays with 27.5 1/s: h * lambda = 1.1, ")


def test_the_paper_decks_sweep_has_the_cases_that_it_says() -> None:
    (run,) = ic.compile(TWO_LINK, select=["gains"]).experiments
    assert run.cases.count == 7 * 3 * 2 - 2 * 3  # two of the seven gains are above 0.032, and go without the heavy load
    kp, ki, upper, lower = (coordinate.values for coordinate in run.cases.coordinates)
    assert not ((kp > 0.032) & (upper > 50.0)).any()
    assert (lower * 2.0 == upper).all()
    assert sorted(set(ki)) == [0.06, 0.125, 0.25]


def test_a_plan_holds_every_file_that_was_read() -> None:
    plan = ic.compile(TWO_LINK)
    assert [source.name for source in plan.sources][1:] == ["<servos/rigid_gearbox.ic>"]
    assert all(len(source.sha256) == 64 and source.text for source in plan.sources)


def test_a_value_knows_its_place_and_its_macro() -> None:
    origin = ic.compile(TWO_LINK).experiments[0].parameters["links.upper.mass"].origin
    assert origin.kind == "deck" and origin.place is not None
    assert [expansion.macro for expansion in origin.place.expansions] == ["ROD"]
    derived = ic.compile(TWO_LINK).experiments[0].parameters["links.upper.inertia.zz"].origin
    assert (derived.kind, derived.note) == ("derived", "uniform rod of the link's mass")


def test_defaults_are_said_to_be_defaults(tmp_path: Path) -> None:
    run = experiment(tmp_path)
    friction = run.parameters["hinge.servo.f_c"]
    assert (friction.value, friction.origin.kind, friction.origin.place) == (0.0, "default", None)
    assert run.parameters["initial.hinge.q"].value == 0.0
    assert run.structure.velocity_products
    assert run.structure.environment == ()
    assert run.structure.integrator == "modified_euler"


def test_gravity_is_a_vector_in_the_environment(tmp_path: Path) -> None:
    run = experiment(
        tmp_path,
        ARM,
        SERVO,
        changed(
            RUN,
            (
                "duration",
                "environment { gravity = [0, 0, -9.81] m/s^2; grease = joint_damping { damping = 2 N*m*s/rad; } }\n"
                "duration",
            ),
        ),
    )
    assert [(use.name, use.model) for use in run.structure.environment] == [
        ("gravity", "gravity"),
        ("grease", "joint_damping"),
    ]
    assert run.parameters["environment.gravity.g.z"].value == -9.81
    assert run.parameters["environment.gravity.g.z"].unit == "m/s^2"
    assert run.parameters["environment.grease.damping"].value == 2.0


def test_an_initial_state_is_for_all_joints_or_one(tmp_path: Path) -> None:
    arm = changed(
        ARM,
        (
            "axis = z; }",
            "axis = z; }\nlink tip { mass = 1 kg; shape = sphere(radius = 1 cm); }\n"
            "joint wrist revolute { parent = bar; child = tip; axis = z; }",
        ),
    )
    run = changed(RUN, ("duration", "initial { q = 90 deg; wrist.q = 1 rad; qd = [1, 2] rad/s; }\nduration"))
    parameters = experiment(tmp_path, arm, SERVO, run).parameters
    assert parameters["initial.hinge.q"].value == pytest.approx(math.pi / 2, rel=1e-15)
    assert parameters["initial.wrist.q"].value == 1.0
    assert [parameters[f"initial.{joint}.qd"].value for joint in ("hinge", "wrist")] == [1.0, 2.0]


def test_a_prismatic_joint_is_in_metres_and_newtons(tmp_path: Path) -> None:
    servo = changed(
        SERVO,
        ("ratio = 100;", "ratio = 100 rad/m; k_position = 1 s^-1;"),
        ("rate(0.1 rad/s)", "position(ramp(to = 2 cm, over = 1 s))"),
    )
    run = experiment(tmp_path, changed(ARM, ("revolute", "prismatic")), servo, changed(RUN, ("[q]", "[q, tau]")))
    assert run.parameters["hinge.servo.ratio"].unit == "rad/m"
    assert run.parameters["hinge.servo.command.to"].value == 0.02
    assert run.structure.servos[0].command == Command("position", "ramp")
    assert [each.unit for each in run.structure.record] == [("m",), ("N",)]
    assert codes(tmp_path, changed(ARM, ("revolute", "prismatic")), SERVO, RUN) == [
        "D060",
        "D061",
    ]  # turns a metre; metres a second


def test_a_table_is_two_lists(tmp_path: Path) -> None:
    servo = changed(SERVO, ("rate(0.1 rad/s)", "rate(table(times = [0, 1, 2.5] s, values = [0, 60, 0] rpm))"))
    parameters = experiment(tmp_path, ARM, servo, RUN).parameters
    assert parameters["hinge.servo.command.times"].value == (0.0, 1.0, 2.5)
    assert parameters["hinge.servo.command.values"].value == pytest.approx((0.0, 2 * math.pi, 0.0), rel=1e-15)


def test_a_record_is_of_all_joints_or_of_one(tmp_path: Path) -> None:
    run = experiment(tmp_path, ARM, SERVO, changed(RUN, ("[q]", "[q, hinge.qd, servo.voltage]")))
    assert [(each.name, each.channels, each.joints) for each in run.structure.record] == [
        ("q", ("hinge.q",), ("hinge",)),
        ("hinge.qd", ("hinge.qd",), ()),
        ("servo.voltage", ("hinge.servo.voltage",), ("hinge",)),
    ]
    assert isinstance(run.structure.record[0], Recorded)


def test_a_run_may_record_nothing_but_must_say_so(tmp_path: Path) -> None:
    assert experiment(tmp_path, ARM, SERVO, changed(RUN, ("[q]", "[]"))).structure.record == ()
    assert codes(tmp_path, ARM, SERVO, changed(RUN, ("record = [q];", ""))) == ["D124"]


def test_a_requirement_is_in_si_and_may_be_written_either_way_round(tmp_path: Path) -> None:
    run = changed(
        RUN, ("duration", "metric top = max { of = hinge.qd; } require top < 60 rpm; require 1 deg/s <= top;\nduration")
    )
    found = [(each.text, each.comparison, each.limit) for each in experiment(tmp_path, ARM, SERVO, run).requirements]
    assert found == [
        ("top < 60 rpm", "<", pytest.approx(2 * math.pi, rel=1e-15)),
        ("1 deg/s <= top", ">=", pytest.approx(math.pi / 180, rel=1e-15)),
    ]


def test_a_joint_without_a_servo_is_passive(tmp_path: Path) -> None:
    run = experiment(tmp_path, ARM, SERVO, changed(RUN, ("servos { hinge = drive; }", ""), ("servos = 1 kHz; ", "")))
    assert run.structure.servos == ()


# Which run


def names(folder: Path, *parts: str, select: object = None) -> list[str]:
    plan = check(folder, *parts, select=select).plan  # type: ignore[arg-type]
    return [] if plan is None else [each.name for each in plan.experiments]


SECOND = "run second like hold { duration = 2 s; }\n"
SWEEP = "sweep many of hold { vary drive.kp = [1, 2] V*s/rad; }\n"


def test_the_only_run_is_taken(tmp_path: Path) -> None:
    assert names(tmp_path, ARM, SERVO, RUN) == ["hold"]


def test_the_one_marked_default_is_taken(tmp_path: Path) -> None:
    assert names(tmp_path, ARM, SERVO, RUN, "default " + SWEEP, SECOND) == ["many"]


def test_runs_are_taken_by_name_or_all(tmp_path: Path) -> None:
    assert names(tmp_path, ARM, SERVO, RUN, SECOND, SWEEP, select=["many", "hold"]) == ["many", "hold"]
    assert names(tmp_path, ARM, SERVO, RUN, SECOND, SWEEP, select="all") == ["hold", "second", "many"]


def test_several_without_a_default_are_listed(tmp_path: Path) -> None:
    (diagnostic,) = check(tmp_path, ARM, SERVO, RUN, SECOND, SWEEP).diagnostics
    assert diagnostic.code == "D162"
    assert diagnostic.help[0] == "name one: hold, second, many"


def test_an_unknown_run_is_told_with_the_nearest(tmp_path: Path) -> None:
    (diagnostic,) = check(tmp_path, ARM, SERVO, RUN, SECOND, select=["secnd"]).diagnostics
    assert (diagnostic.code, diagnostic.help[0]) == ("D164", "did you mean `second`?")


def test_a_deck_without_a_run_says_so(tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, SERVO) == ["D161"]


def test_two_defaults_are_an_error(tmp_path: Path) -> None:
    assert codes(tmp_path, ARM, SERVO, "default " + RUN, "default " + SECOND) == ["D050"]


def test_compile_raises_with_everything_and_the_text_of_every_file(tmp_path: Path) -> None:
    path = tmp_path / "deck.ic"
    path.write_text(changed(ARM, ("2 kg", "-2 kg")) + SERVO + changed(RUN, ("[q]", "[w]")))
    with pytest.raises(Problem) as caught:
        ic.compile(path)
    assert [diagnostic.code for diagnostic in caught.value.diagnostics] == ["D077", "D125"]
    assert list(caught.value.sources.values()) == [path.read_text()]


def test_the_same_deck_gives_the_same_plan(tmp_path: Path) -> None:
    assert repr(check(tmp_path, select="all").plan) == repr(check(tmp_path, select="all").plan)


# Explaining


def test_explain_says_value_place_overridden_places_and_names(tmp_path: Path) -> None:
    deck = "let base_gain = 2 V*s/rad;\nlet gain = 2 * base_gain;\n"
    path = tmp_path / "deck.ic"
    path.write_text(deck + ARM + SERVO + "servo own like drive { kp = gain; }\n" + changed(RUN, ("= drive", "= own")))
    (found,) = explain(path, "hinge.servo.kp")
    assert (found.value, found.unit, found.written, found.origin) == (4.0, "V*s/rad", "gain", "deck")
    assert found.place is not None and found.place.line == 13
    assert [place.line for place in found.overrode] == [9]
    assert [(label.text, label.place.line) for label in found.names] == [
        ("gain = 2 * base_gain", 2),
        ("base_gain = 2 V*s/rad", 1),
    ]
    assert found.doc == "proportional gain Kp on the error of the motor's rate"


def test_explain_of_a_definition_gives_all_that_follow_it() -> None:
    assert [each.path for each in explain(TWO_LINK, "gearbox.kp")] == ["shoulder.servo.kp", "elbow.servo.kp"]
    varied = explain(TWO_LINK, "gearbox.kp", select=["gains"])
    assert [(each.value, each.varies, each.origin) for each in varied] == [((0.01, 0.04), True, "case")] * 2


def test_explain_of_a_vector_gives_its_parts() -> None:
    assert [each.path for each in explain(TWO_LINK, "elbow.at")] == ["elbow.at.x", "elbow.at.y", "elbow.at.z"]


def test_explain_of_nothing_offers_the_nearest() -> None:
    with pytest.raises(Problem) as caught:
        explain(TWO_LINK, "elbow.servo.ktt")
    assert caught.value.diagnostics[0].help == ("did you mean `elbow.servo.kt`?",)


@pytest.mark.slow
def test_compiling_loads_nothing_heavy() -> None:
    """What would take longer to load than the whole of `met check` may take."""
    program = (
        f"import sys, ic; ic.compile({str(TWO_LINK)!r}, select='all');"
        "print(*(set(sys.modules) & {'llvmlite', 'h5py', 'scipy', 'xarray', 'matplotlib', 'dask'}))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
