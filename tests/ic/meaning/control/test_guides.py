"""Guides in a deck: what they set, who follows them and when they tick."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import models
from met import run as engine
from met.plan import Command, Course, GuideUse
from met.plan.file import dumps, loads
from met.plan.keys import structure_key
from tests.ic.small_decks import changed, check, experiment, messages

ARM = """\
arm pair {
    link one { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link two { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    joint low  revolute { parent = base; child = one; axis = z; }
    joint high revolute { parent = one;  child = two; axis = z; at = [1, 0, 0] m; }
}
servo follow { model = ideal; bandwidth = 20 1/s; command = rate(tip); }
"""
RUN = """\
run it {
    arm = pair;
    servos { low = follow; high = follow; }
    guide tip = resolved_rate {
        link = two; point = [1, 0, 0] m; guides = xy; max_damping = 0.1 m; threshold = 0.2 m;
        x = ramp(to = -20 cm, over = 1 s); max_rate = 1 rad/s;
    }
    initial { low.q = 20 deg; high.q = 60 deg; }
    environment {}
    rates { dynamics = 1 kHz; servos = 500 Hz; record = 100 Hz; }
    duration = 1 s;
    record = [q, guides.tip.error];
}
"""


def numbers(folder: Path, *changes: tuple[str, str], more: str = "") -> dict[str, object]:
    parameters = experiment(folder, ARM, changed(RUN, *changes), more, select=["it"]).parameters
    return {path: each.value for path, each in parameters.items() if path.startswith("guides.")}


def test_a_guide_is_what_the_servos_that_name_it_follow(tmp_path: Path) -> None:
    structure = experiment(tmp_path, ARM, RUN).structure
    (use,) = structure.guides
    assert (use.name, use.model, use.joints, use.divisor) == ("tip", "resolved_rate", ("low", "high"), 2)
    assert use.courses == (Course("x", "ramp"),)
    assert {servo.command for servo in structure.servos} == {Command("rate", "", "tip")}


def test_its_parameters(tmp_path: Path) -> None:
    assert numbers(tmp_path) == {
        "guides.tip.link": "two",
        "guides.tip.guides": "xy",
        "guides.tip.loop": "closed",
        "guides.tip.jacobian": "arm",
        "guides.tip.point.x": 1.0,
        "guides.tip.point.y": 0.0,
        "guides.tip.point.z": 0.0,
        "guides.tip.max_damping": 0.1,
        "guides.tip.threshold": 0.2,
        "guides.tip.gain": 1.0,
        "guides.tip.length": 1.0,
        "guides.tip.low.max_rate": 1.0,
        "guides.tip.high.max_rate": 1.0,
        "guides.tip.x.start": 0.0,
        "guides.tip.x.to": -0.2,
        "guides.tip.x.begin": 0.0,
        "guides.tip.x.over": 1.0,
    }


def test_a_joint_has_a_number_of_its_own(tmp_path: Path) -> None:
    found = numbers(tmp_path, ("max_rate = 1 rad/s;", "max_rate = 1 rad/s;  high.max_rate = 60 deg/s;"))
    assert found["guides.tip.low.max_rate"] == 1.0
    assert found["guides.tip.high.max_rate"] == pytest.approx(1.0471975511965976)


def test_a_run_like_another_changes_a_guide(tmp_path: Path) -> None:
    more = "run more like it { guide tip { gain = 3 1/s;  x { to = 5 cm; } } }\n".replace("guide tip", "tip")
    found = experiment(tmp_path, ARM, RUN, more, select=["more"]).parameters
    assert (found["guides.tip.gain"].value, found["guides.tip.x.to"].value) == (3.0, 0.05)


def test_a_path_comes_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("time [s], x [cm], far [m]\n0, 0, 0\n1, -20, 0.1\n", encoding="utf-8")
    course = 'x = trajectory("way.csv"); y = trajectory("way.csv", column = "far");'
    found = numbers(tmp_path, ("x = ramp(to = -20 cm, over = 1 s);", course))
    assert found["guides.tip.x.values"] == (0.0, -0.2)
    assert found["guides.tip.y.values"] == (0.0, 0.1)


@pytest.mark.slow
def test_a_sweep_varies_its_numbers_those_of_all_joints_too(tmp_path: Path) -> None:
    sweep = "sweep s of it { vary guides.tip.max_damping = [0, 0.1] m; vary guides.tip.max_rate = [0.1, 1] rad/s;"
    sweep += " vary guides.tip.x.to = [10, 20] cm; }"
    made = experiment(tmp_path, ARM, changed(RUN, ("threshold = 0.2 m", "threshold = 2 m")), sweep, select=["s"])
    assert made.cases.coordinates[1].sets == ("guides.tip.low.max_rate", "guides.tip.high.max_rate")
    run = engine.run(made)
    assert run.cause == [""] * 8
    assert len({run.signals["q"][case].tobytes() for case in range(8)}) == 8


def test_a_guide_ticks_as_it_says_else_as_the_servos_do(tmp_path: Path) -> None:
    text = changed(RUN, ("guides = xy;", "guides = xy; rate = 100 Hz;"), ("servos = 500 Hz;", "servos = continuous;"))
    assert experiment(tmp_path, ARM, text).structure.guides[0].divisor == 10


def test_a_plan_with_guides_is_read_as_it_was_written(tmp_path: Path) -> None:
    compiled = check(tmp_path, ARM, RUN)
    assert compiled.plan is not None
    assert loads(dumps(compiled.plan)) == compiled.plan


def test_a_plan_without_guides_says_nothing_of_them(tmp_path: Path) -> None:
    begin, end = RUN.index("    guide tip"), RUN.index("    initial")
    bare = (RUN[:begin] + RUN[end:]).replace(", guides.tip.error", "")
    text = ARM.replace("rate(tip)", "rate(1 rad/s)")
    compiled = check(tmp_path, text, bare)
    assert compiled.plan is not None, messages(compiled)
    assert '"guides"' not in dumps(compiled.plan)
    structure = compiled.plan.experiments[0].structure
    assert structure.guides == ()
    assert structure_key(structure) == "ffd7ff3480f40261", "as it was before there were guides"


def test_every_guide_has_a_kind_and_a_name_of_its_own() -> None:
    assert sorted(models.find_own("guide")) == ["resolved_rate", "together"]
    assert GuideUse("tip", "together", ("low",), 1).courses == ()


def test_a_unit_and_a_course_are_no_names_of_guides(tmp_path: Path) -> None:
    for name, what in (("m", "a unit"), ("step", "a course in time")):
        text = messages(check(tmp_path, ARM, changed(RUN, ("guide tip", f"guide {name}"))))
        assert (
            f"""\
error[D271]: `{name}` is {what}, so no guide can be called so
  --> deck.ic:11:5
"""
            in text
        )


@pytest.mark.slow
def test_at_a_singularity_a_damped_guide_stays_and_another_fails(tmp_path: Path) -> None:
    stretched = changed(RUN, ("low.q = 20 deg", "low.q = 0 deg"), ("high.q = 60 deg", "high.q = 0 deg"))
    run = engine.run(experiment(tmp_path, ARM, stretched))
    assert run.cause == [""]
    np.testing.assert_array_equal(run.signals["q"][0], 0.0)
    assert run.signals["guides.tip.error"][0, -1] == pytest.approx(0.2, rel=1e-12)
    bare = engine.run(experiment(tmp_path, ARM, changed(stretched, ("max_damping = 0.1 m", "max_damping = 0 m"))))
    assert bare.cause[0].replace(str(tmp_path), "") == (
        "t = 0 s: joint low: position, rate or acceleration is no longer a finite number (/deck.ic:4). Usual reasons: "
        "guide `tip` (/deck.ic:11), which it follows, at a singularity where its `max_damping` is 0 m; a step too long "
        "for the servo or the arm (see the step size of `met plan`; try a faster rate for the dynamics), or a "
        "model that divides by zero."
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "vary",
    [
        "high.at.x = [1, 1.2] m",
        "initial.low.q = [10, 30] deg",
        "guides.tip.point.x = [0.5, 1] m",
        "guides.tip.gain = [1, 100] 1/s",
    ],
)
def test_what_a_sweep_varies_reaches_the_law(vary: str, tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, ARM, RUN, f"sweep s of it {{ vary {vary}; }}", select=["s"]))
    assert run.cause == ["", ""]
    assert run.signals["guides.tip.error"][0].tobytes() != run.signals["guides.tip.error"][1].tobytes()


VARY = [
    ("guides.tip = [1, 2]", "cannot vary", "it is a guide: vary a parameter of it, `guides.tip.PARAMETER`"),
    (
        "guides.tip.x = [1, 2] m",
        "cannot vary",
        "it is a course in time: vary a parameter of it, `guides.tip.x.PARAMETER`",
    ),
    (
        "guides.tip.rate = [100, 200] Hz",
        "cannot vary",
        "it decides the program: write a run for each, `like` the first, and `sweep NAME = ONE + OTHER;`",
    ),
]


@pytest.mark.parametrize(("vary", "message", "remedy"), VARY)
def test_what_of_a_guide_does_not_vary(vary: str, message: str, remedy: str, tmp_path: Path) -> None:
    path = vary.partition(" ")[0]
    text = messages(check(tmp_path, ARM, RUN, f"sweep s of it {{ vary {vary}; }}", select=["s"]))
    assert text.startswith(f"error[D122]: `{path}` {message}\n")
    assert f"= help: {remedy}\n" in text


def test_words_of_a_guide_vary(tmp_path: Path) -> None:
    sweep = "sweep some of it { vary guides.tip.loop = [closed, open]; }"
    compiled = check(tmp_path, ARM, RUN, sweep, select=["some"])
    assert compiled.plan is not None, messages(compiled)
    assert [each.parameters["guides.tip.loop"].value for each in compiled.plan.experiments] == ["closed", "open"]
