"""`met explain` of what is no parameter of a plan, and `met check` of a plan file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from met import cli
from met.units import UNITS
from tests.ic.small_decks import ARM, RUN, SERVO, changed

SWEEP = "sweep sizes of hold { vary links.bar.shape.length = [1, 2] m; }\n"


@pytest.fixture(autouse=True)
def deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MET_DECK_PATH", raising=False)
    run = changed(RUN, ("run hold {", "default run hold { environment { gravity = [0, 0, -9.81] m/s^2; }"))
    Path("a.ic").write_text(ARM + SERVO + run + SWEEP)


def explained(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, object]:
    """What is said of one path, as JSON: path and value, and the line where it is written."""
    assert cli.main(["explain", *words, "--format", "json"]) == 0
    return {
        each["path"]: (each["value"], each["unit"], (each["place"] or {}).get("line"))
        for each in json.loads(capsys.readouterr().out)
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "value", "unit", "line"),
    [
        ("links.bar.shape.length", 1.0, "m", 2),
        ("links.bar.shape.along", "x", "", 2),
        ("arm", "swing", "", 12),
        ("duration", 1.0, "s", 15),
        ("rates.dynamics", 1000.0, "Hz", 14),
        ("rates.base", 1000.0, "Hz", None),
        ("hinge.servo.rate", 1000.0, "Hz", None),
        ("hinge.servo.model", "rigid_gearbox", "", 6),
        ("hinge.parent", "base", "", 3),
        ("environment.velocity_products", "on", "", None),
        ("integrator", "modified_euler", "", None),
        ("record", "q", "", 16),
        ("seed", 0.0, "1", None),
    ],
)
def test_a_setting_of_a_run_can_be_asked_for(
    path: str, value: object, unit: str, line: int | None, capsys: pytest.CaptureFixture[str]
) -> None:
    assert explained(capsys, "a.ic", path) == {path: (value, unit, line)}


def test_the_servo_of_a_joint_is_the_head_of_its_parameters(capsys: pytest.CaptureFixture[str]) -> None:
    found = explained(capsys, "a.ic", "hinge.servo")
    assert found["hinge.servo"] == ("drive", "", 13) and found["hinge.servo.kp"] == (0.1, "V*s/rad", 7)
    assert cli.main(["explain", "a.ic", "servos.hinge.kp"]) == cli.BAD_INPUT
    assert "did you mean `hinge.servo.kp`?" in capsys.readouterr().err


def test_a_metric_is_written_where_its_model_and_its_channel_are(capsys: pytest.CaptureFixture[str]) -> None:
    run = changed(RUN, ("record = [q];", "record = [q];\n    metric top = max {\n        of = hinge.qd;\n    }"))
    Path("b.ic").write_text(ARM + SERVO + run)
    assert explained(capsys, "b.ic", "metrics.top") == {
        "metrics.top.model": ("max", "", 17),
        "metrics.top.of": ("hinge.qd", "", 18),
        "metrics.top.after": (0.0, "s", None),
        "metrics.top.within": ("inf", "s", None),
    }


def test_explain_shows_a_setting_as_it_shows_a_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["explain", "a.ic", "duration"]) == 0
    assert capsys.readouterr().out == (
        "duration = 1 s\n  --> a.ic:15:16\n   |\n15 |     duration = 1 s;\n   |                ^^^ written here\n"
    )
    assert cli.main(["explain", "a.ic", "integrator"]) == 0
    assert capsys.readouterr().out == "integrator = modified_euler\n  the default\n"


def test_the_head_of_settings_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(explained(capsys, "a.ic", "rates")) == ["rates.dynamics", "rates.servos", "rates.record", "rates.base"]
    assert {"environment.gravity.g.z", "environment.velocity_products"} <= set(explained(capsys, "a.ic", "environment"))


def test_a_swept_size_of_a_shape_is_shown_over_its_cases(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["explain", "a.ic", "links.bar.shape.length", "--run", "sizes"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("links.bar.shape.length = 1 to 2 m, varies with the case\n")
    assert "a sweep varies it, here" in out


@pytest.mark.slow
@pytest.mark.parametrize(("name", "run"), [("hold", "hold"), ("hold", "sizes"), ("sizes", "sizes")])
def test_the_name_of_a_run_is_no_path(name: str, run: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["explain", "a.ic", name, "--run", run]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"""\
error[D170]: `{name}` is a run or a sweep, and no parameter
 = help: `met plan DECK {name}` prints it
 = help: paths begin with links, hinge, """), said
    assert cli.main(["explain", "a.ic", "hold.environment.gravity.g.z", "--run", run]) == 0  # which is one
    assert cli.main(["plan", "a.ic", name]) == 0


@pytest.mark.parametrize("name", ["swing", "drive"])
def test_the_name_of_an_arm_or_a_servo_stands_for_what_it_writes(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["explain", "a.ic", name]) == 0
    assert len(capsys.readouterr().out.splitlines()) > 10


def test_paths_that_a_deck_may_write_otherwise_are_understood(capsys: pytest.CaptureFixture[str]) -> None:
    gravity = {"environment.gravity.g.z": (-9.81, "m/s^2", 11)}
    assert explained(capsys, "a.ic", "environment.gravity.z") == gravity
    assert explained(capsys, "a.ic", "swing.links.bar.mass") == {"links.bar.mass": (2.0, "kg", 2)}
    assert cli.main(["plan", "a.ic", "-o", "p.json", "-q"]) == 0
    assert explained(capsys, "p.json", "environment.gravity.z") == gravity


def test_a_plan_file_knows_the_settings_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["plan", "a.ic", "-o", "p.json", "-q"]) == 0
    assert explained(capsys, "p.json", "duration") == {"duration": (1.0, "s", None)}
    assert explained(capsys, "p.json", "hinge.servo")["hinge.servo"] == ("drive", "", 13)
    assert cli.main(["explain", "p.json", "integrator"]) == 0
    assert capsys.readouterr().out == "integrator = modified_euler\n  as the plan has it\n"


def test_check_says_what_a_plan_file_holds(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["plan", "a.ic", "--all", "-o", "p.json", "-q"]) == 0
    assert cli.main(["check", "p.json"]) == 0
    assert capsys.readouterr().out == "p.json: plan of a.ic: 1 run, 1 sweep, 3 cases: no errors\n"
    assert cli.main(["check", "p.json", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["diagnostics"] == []
    Path("p.json").write_text("{")
    assert cli.main(["check", "p.json"]) == 2
    assert "error[E302]" in capsys.readouterr().err
    assert cli.main(["check", "none.json"]) == 2
    assert "error[E301]" in capsys.readouterr().err


def test_the_base_is_explained_of_a_deck_and_of_a_plan(capsys: pytest.CaptureFixture[str]) -> None:
    text = Path("a.ic").read_text(encoding="utf-8")
    base = "base = prescribed { x = sine(amplitude = 1 cm, frequency = 2 Hz); }"
    Path("b.ic").write_text(changed(text, ("arm = swing;", f"arm = swing; {base}")), encoding="utf-8")
    assert cli.main(["plan", "b.ic", "-q", "-o", "b.json"]) == 0
    capsys.readouterr()
    for file in ("b.ic", "b.json"):
        assert explained(capsys, file, "base")["base"][0] == "prescribed"
        found = explained(capsys, file, "base.x")
        assert {path: value for path, (value, _, _) in found.items()} == {
            "base.x.amplitude": 0.01,
            "base.x.frequency": 2.0,
            "base.x.offset": 0.0,
            "base.x.phase": 0.0,
            "base.x.model": "sine",
        }
    assert explained(capsys, "a.ic", "base")["base"][0] == "fixed"


def test_a_unit_is_no_parameter_and_has_a_size(capsys: pytest.CaptureFixture[str]) -> None:
    Path("own.ic").write_text('deck 2;\n#include "a.ic"\nunit ozin = 7.061552e-3 N*m;\n')
    for path, what, size in (
        ("ozin", "a unit that the deck declares", "1 ozin is 0.007061552 N*m"),
        ("rpm", "a unit", f"{UNITS['rpm'].word}, 0.1047197551 rad/s: `met doc units`"),
    ):
        assert cli.main(["explain", "own.ic", path]) == 2
        said = f"error[D170]: `{path}` is {what}, and no parameter\n = help: {size}\n\n1 error\n"
        assert capsys.readouterr() == ("", said)


def test_a_value_of_a_sum_is_without_the_noise_of_its_rounding(capsys: pytest.CaptureFixture[str]) -> None:
    Path("sum.ic").write_text(changed(ARM, ("2 kg", "70 g + 3 g")) + SERVO + RUN, encoding="utf-8")
    assert cli.main(["explain", "sum.ic", "links.bar.mass"]) == 0
    assert capsys.readouterr().out.startswith("links.bar.mass = 0.073 kg\n")
