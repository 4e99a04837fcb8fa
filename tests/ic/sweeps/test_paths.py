"""What a sweep's path means: components of an axis, gravity as the deck writes it, names that are taken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ic.driver.explain import explain
from met.plan import Experiment, Formula
from met.run import run as simulate
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, messages

TWO = """\
arm swing {
    link bar { mass = 2 kg; shape = box(size = [1, 0.2, 0.1] m, along = x); }
    link tip { mass = 1 kg; shape = box(size = [1, 0.2, 0.1] m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
    joint wrist revolute { parent = bar; child = tip; axis = [2, 0, 1]; at = [1, 0, 0] m; }
}
"""
HEAVY = "environment { gravity = [0, 0, -9.81] m/s^2; }"
BOTH = changed(RUN, ("hinge = drive;", f"hinge = drive; wrist = drive; }} {HEAVY[:-1]}"), ("1 s", "0.2 s"))


def swept(folder: Path, body: str, arm: str = TWO, run: str = BOTH) -> Experiment:
    return experiment(folder, arm, SERVO, run, f"sweep it of hold {{ {body} }}\n", select=["it"])


def values(run: Experiment, path: str) -> np.ndarray:
    """A parameter over all cases."""
    found = run.parameters[path].value
    inputs = {coordinate.path: coordinate.values for coordinate in run.cases.coordinates}
    return np.asarray(run.formulas.replay(inputs)[found.output] if isinstance(found, Formula) else found)


@pytest.mark.release
@pytest.mark.parametrize(
    ("axis", "component", "swept_over"),
    [
        ("[1, 0, 1]", "x", [0, 0.5, 2]),
        ("[3, 0, 4]", "x", [3, 0.6]),  # the components are those that the deck writes, not those of the unit vector
        ("[3, 0, 4]", "y", [-1, 0]),
        ("z", "x", [0, 1]),
    ],
)
def test_a_swept_axis_is_that_of_the_deck_with_the_component_written(
    tmp_path: Path, axis: str, component: str, swept_over: list[float]
) -> None:
    arm = changed(TWO, ("[2, 0, 1]", axis))
    run = swept(tmp_path, f"vary wrist.axis.{component} = {swept_over};", arm)
    signals = simulate(run).signals["q"]
    assert run.cases.coordinates[0].values.tolist() == swept_over
    for case, value in enumerate(swept_over):
        parts = {"z": [0, 0, 1]}.get(axis) or [float(part) for part in axis.strip("[]").split(",")]
        parts["xyz".index(component)] = value
        plain = experiment(tmp_path, changed(TWO, ("[2, 0, 1]", str(parts))), SERVO, BOTH)
        for part in "xyz":
            # one rounding more or less in the length and in the division
            expected = plain.parameters[f"wrist.axis.{part}"].value
            assert np.broadcast_to(values(run, f"wrist.axis.{part}"), len(swept_over))[case] == pytest.approx(
                expected, rel=4e-16, abs=0.0
            )
        # the two programs round differently, for one has the axis as constants: 1e-16 a step, 200 steps
        assert signals[case] == pytest.approx(simulate(plain).signals["q"][0], rel=1e-11, abs=1e-12)


def test_a_let_in_an_axis_may_vary(tmp_path: Path) -> None:
    arm = "let slant = 1;\n" + changed(TWO, ("[2, 0, 1]", "[slant, 0, 4]"))
    run = swept(tmp_path, "vary slant = [0, 3];", arm)
    assert values(run, "wrist.axis.x").tolist() == [0.0, 0.6]
    assert values(run, "wrist.axis.z").tolist() == [1.0, 0.8]


def test_an_axis_without_direction_in_one_case_names_the_case(tmp_path: Path) -> None:
    arm = changed(TWO, ("[2, 0, 1]", "x"))
    compiled = check(tmp_path, arm, SERVO, BOTH, "sweep it of hold { vary wrist.axis.x = [1, 0]; }", select=["it"])
    (diagnostic,) = compiled.diagnostics
    assert diagnostic.code == "D097"
    assert "case #1" in diagnostic.message
    assert diagnostic.help[0] == "case #1: wrist.axis.x = 0"


def test_explain_shows_the_axis_as_the_engine_has_it(tmp_path: Path) -> None:
    swept(tmp_path, "vary wrist.axis.x = [0, 0.75];")
    x, y, z = explain(tmp_path / "deck.ic", "wrist.axis", select=["it"])
    assert (x.value, y.value, z.value) == ((0.0, pytest.approx(0.6)), (0.0, 0.0), (pytest.approx(0.8), 1.0))


@pytest.mark.slow
def test_gravity_varies_under_the_name_that_the_deck_gives_it(tmp_path: Path) -> None:
    run = swept(tmp_path, "vary environment.gravity.x = [1, 2] m/s^2; exclude when environment.gravity.x > 1.5 m/s^2;")
    (coordinate,) = run.cases.coordinates
    assert (coordinate.path, coordinate.sets) == ("environment.gravity.x", ("environment.gravity.g.x",))
    assert values(run, "environment.gravity.g.x").tolist() == [1.0]
    run = swept(tmp_path, "vary environment.gravity.x = [1, 2] m/s^2; exclude when environment.gravity.g.x < 2 m/s^2;")
    assert values(run, "environment.gravity.g.x").tolist() == [2.0]
    assert simulate(run).coordinates["environment.gravity.x"].tolist() == [2.0]
    (found,) = explain(tmp_path / "deck.ic", "environment.gravity.z", select=["hold"])
    assert (found.path, found.value) == ("environment.gravity.g.z", -9.81)


def test_gravity_under_two_names_is_one_parameter_varied_twice(tmp_path: Path) -> None:
    body = "vary environment.gravity.x = [1, 2] m/s^2; vary environment.gravity.g.x = [3, 4] m/s^2;"
    assert codes(tmp_path, TWO, SERVO, BOTH, f"sweep it of hold {{ {body} }}", select=["it"]) == ["D123"]
    body = "vary environment.gravity = [1, 2] m/s^2;"
    compiled = check(tmp_path, TWO, SERVO, BOTH, f"sweep it of hold {{ {body} }}", select=["it"])
    assert [diagnostic.code for diagnostic in compiled.diagnostics] == ["D122"]
    assert "`environment.gravity.x`" in messages(compiled)


def test_an_exclusion_by_a_definition_whose_joints_differ_is_an_error(tmp_path: Path) -> None:
    body = "vary wrist.servo.kp = [0.1, 0.2] V*s/rad; exclude when drive.kp > 0.15 V*s/rad;"
    compiled = check(tmp_path, TWO, SERVO, BOTH, f"sweep it of hold {{ {body} }}", select=["it"])
    (diagnostic,) = compiled.diagnostics
    assert diagnostic.code == "D165"
    assert diagnostic.help == ("say which is meant: write `hinge.servo.kp` or `wrist.servo.kp`",)
    for path, left in (("wrist.servo.kp", [0.1]), ("hinge.servo.kp + wrist.servo.kp - 0.1 V*s/rad", [0.1])):
        run = swept(tmp_path, body.replace("drive.kp", path))
        assert run.cases.coordinates[0].values.tolist() == left
    # a value that all joints share is one value, whatever else of the servo varies
    assert (
        swept(
            tmp_path,
            "vary wrist.servo.kp = [1, 2] V*s/rad; vary drive.ki = [1, 2] V/rad;exclude when drive.ki > 1.5 V/rad;",
        ).cases.count
        == 2
    )


def test_an_exclusion_may_ask_for_a_shapes_size(tmp_path: Path) -> None:
    run = swept(tmp_path, "vary links.bar.shape.size.x = [1, 2] m; exclude when links.bar.shape.size.x > 1.5 m;")
    assert run.cases.coordinates[0].values.tolist() == [1.0]


@pytest.mark.parametrize("word", ["links", "initial", "environment", "metrics", "rates"])
def test_what_begins_paths_of_its_own_names_no_joint_arm_or_servo(tmp_path: Path, word: str) -> None:
    arm = changed(ARM, ("joint hinge", f"joint {word}"))
    assert "D166" in codes(tmp_path, arm, SERVO, changed(RUN, ("hinge", word)))
    assert "D166" in codes(tmp_path, changed(ARM, ("swing", word)), SERVO, changed(RUN, ("swing", word)))
    assert "D166" in codes(tmp_path, ARM, changed(SERVO, ("drive", word)), changed(RUN, ("drive", word)))


@pytest.mark.parametrize("word", ["links", "initial", "environment", "metrics", "rates"])
def test_links_lets_and_runs_may_be_called_like_what_begins_paths(tmp_path: Path, word: str) -> None:
    arm = f"let {word} = 1 m;\n" + changed(
        ARM, ("link bar", f"link {word}"), ("child = bar", f"child = {word}"), ("length = 1 m", f"length = {word}")
    )
    sweep = f"sweep it of {word} {{ vary {word} = [1, 2] m; vary links.{word}.mass = [3, 4] kg; }}"
    run = experiment(tmp_path, arm, SERVO, changed(RUN, ("hold", word)), sweep, select=["it"])
    assert [coordinate.path for coordinate in run.cases.coordinates] == [word, f"links.{word}.mass"]
    assert values(run, f"links.{word}.com.x").tolist() == [0.5, 0.5, 1.0, 1.0]


INHERITED = """\
servo strong like drive { }
let thrice = strong.kp * 3;
servo follower like drive { kp = thrice; }
"""


def test_an_expression_that_names_an_inheriting_servo_follows_the_sweep_of_its_base(tmp_path: Path) -> None:
    run = changed(BOTH, ("hinge = drive; wrist = drive;", "hinge = strong; wrist = follower;"))
    sweep = "sweep it of hold { vary drive.kp = [0.03, 0.04] V*s/rad; }\n"
    made = experiment(tmp_path, TWO, SERVO, INHERITED, run, sweep, select=["it"])
    assert values(made, "hinge.servo.kp").tolist() == [0.03, 0.04]
    assert values(made, "wrist.servo.kp") == pytest.approx([0.09, 0.12], rel=4e-16)


def test_an_exclusion_by_a_definition_whose_heirs_differ_asks_which_is_meant(tmp_path: Path) -> None:
    run = changed(BOTH, ("hinge = drive; wrist = drive;", "hinge = strong;"))
    sweep = "sweep it of hold { vary strong.kp = [0.03, 0.04] V*s/rad; exclude when drive.kp > 0.035 V*s/rad; }\n"
    parts = (TWO, SERVO, "servo strong like drive { }\n", run, sweep)
    assert codes(tmp_path, *parts, select=["it"]) == ["D165"]
