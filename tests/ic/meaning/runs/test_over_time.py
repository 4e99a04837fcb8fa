"""Expressions of signals, and requirements over time: what a deck says, what comes of it, what is said of mistakes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.backends.reference.plain import execute
from met.diagnostic import Problem
from met.plan import Experiment, Plan
from met.plan import file as plan_file
from met.plan.judged import CHANNEL_INPUT
from met.plan.outputs import metric_units
from met.program import build
from met.program.build import METRIC
from tests.ic.small_decks import SERVO, changed, check, experiment, messages

ARM = """\
arm pair {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link arm { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    link sled { mass = 1 kg; shape = sphere(radius = 0.1 m); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
    joint knee revolute { parent = bar; child = arm; axis = z; at = [1, 0, 0] m; }
    joint rail prismatic { parent = arm; child = sled; axis = x; }
}
let limit = 0.04 rad/s;
let two = [1, 2, 3];
"""
RUN = """\
run hold {
    arm = pair;
    servos { hinge = drive; knee = drive { command = rate(0.05 rad/s); }; }
    rates { dynamics = 500 Hz; servos = 1 kHz; record = 1 kHz; }
    duration = 0.5 s;
    record = [q, qd, hinge.servo.voltage, knee.servo.voltage, hinge.servo.command];
}
"""


def run_with(*entries: str) -> str:
    return RUN.removesuffix("}\n") + "".join(f"    {each}\n" for each in entries) + "}\n"


def made(folder: Path, *entries: str, more: str = "", select: str = "hold") -> Experiment:
    return experiment(folder, ARM, SERVO, run_with(*entries), more, select=[select])


def said(folder: Path, *entries: str, more: str = "") -> str:
    slower = changed(run_with(*entries), ("record = 1 kHz", "record = 500 Hz"))
    return messages(check(folder, ARM, SERVO, slower, more))


def of(result: engine.Run, name: str) -> np.ndarray:
    joint, _, channel = name.partition(".")
    if name in result.signals:
        return result.signals[name][0]
    return result.signals[channel][0][:, ["hinge", "knee", "rail"].index(joint)]


EXPRESSIONS = {
    "hinge.qd - hinge.servo.command": lambda s: s("hinge.qd") - s("hinge.servo.command"),
    "abs(hinge.qd) / limit": lambda s: np.abs(s("hinge.qd")) / 0.04,
    "max(*.servo.voltage)": lambda s: np.maximum(s("hinge.servo.voltage"), s("knee.servo.voltage")),
    "min(hinge.q, 2 * knee.q) + 1 deg": lambda s: np.minimum(s("hinge.q"), 2 * s("knee.q")) + np.radians(1),
    "atan2(sin(hinge.q), cos(hinge.q) + 0.5)": lambda s: np.arctan2(np.sin(s("hinge.q")), np.cos(s("hinge.q")) + 0.5),
    "sqrt(hinge.qd^2 + knee.qd^2)": lambda s: np.hypot(s("hinge.qd"), s("knee.qd")),
    "hinge.servo.voltage * hinge.servo.v_max": lambda s: s("hinge.servo.voltage") * 24.0,
    "floor(hinge.q / (1 mrad)) + 1": lambda s: np.floor(s("hinge.q") / 1e-3) + 1,
    "ceil(2 - hinge.q / (1 mrad))": lambda s: np.ceil(2 - s("hinge.q") / 1e-3),
    "round(hinge.q / (2 mrad)) * 2 mrad + 1 rad": lambda s: np.floor(s("hinge.q") / 2e-3 + 0.5) * 2e-3 + 1,
    "sign(hinge.qd - knee.qd) + 2": lambda s: np.sign(s("hinge.qd") - s("knee.qd")) + 2,
    "hinge.qd * two.y + 1 rad/s": lambda s: s("hinge.qd") * 2 + 1,
}


@pytest.mark.release
@pytest.mark.parametrize("text", EXPRESSIONS)
def test_expressions_are_what_numpy_makes_of_the_recorded_channels(tmp_path: Path, text: str) -> None:
    found = made(
        tmp_path,
        f"signal made = {text};",
        f"metric most = max {{ of = {text}; }}",
        "metric same = max { of = signals.made; }",
        "record += [signals.made];",
    )
    result = engine.run(found)
    wanted = EXPRESSIONS[text](lambda name: of(result, name))
    np.testing.assert_allclose(result.signals["signals.made"][0], wanted, rtol=1e-12, atol=1e-15)
    assert result.metrics["most"][0] == result.metrics["same"][0] == result.signals["signals.made"][0].max()


@pytest.mark.slow
@pytest.mark.parametrize(("model", "reduce"), [
    ("max", np.max),
    ("min", np.min),
    ("peak", lambda x: np.abs(x).max()),
    ("rms", lambda x: np.sqrt((x**2).mean())),
])  # fmt: skip
def test_a_metric_of_every_joint_is_that_of_all_their_samples(tmp_path: Path, model: str, reduce: object) -> None:
    found = made(tmp_path, f"metric all = {model} {{ of = *.servo.voltage; }}")
    result = engine.run(found)
    both = np.stack([of(result, "hinge.servo.voltage"), of(result, "knee.servo.voltage")])  # rail has no servo
    np.testing.assert_allclose(result.metrics["all"][0], reduce(both), rtol=1e-12)  # type: ignore[operator]
    assert metric_units(found.structure) == {"all": "V"}


def test_an_expression_is_looked_at_whenever_one_of_its_channels_is_sampled(tmp_path: Path) -> None:
    """The servos tick at 1 kHz, between instants of 500 Hz; the joints' rates are held there."""
    found = made(tmp_path, "metric n = rms { of = hinge.servo.voltage - 0 * knee.servo.voltage; }",
                 "metric one = rms { of = hinge.servo.voltage; }")  # fmt: skip
    result = engine.run(found)
    assert result.metrics["n"][0] == result.metrics["one"][0]


MARGINS = {
    "hinge.qd < 0.12 rad/s": lambda s: 0.12 - s("hinge.qd"),
    "hinge.qd >= limit": lambda s: s("hinge.qd") - 0.04,
    "hinge.qd > 0 rad/s and knee.qd < 0.1 rad/s": lambda s: np.minimum(s("hinge.qd"), 0.1 - s("knee.qd")),
    "hinge.qd > 0.05 rad/s or knee.qd > limit": lambda s: np.maximum(s("hinge.qd") - 0.05, s("knee.qd") - 0.04),
    "not (hinge.qd > 0.05 rad/s or not knee.qd > limit)": lambda s: np.minimum(
        0.05 - s("hinge.qd"), s("knee.qd") - 0.04
    ),
    "abs(*.qd - *.servo.command) < 0.01 rad/s": lambda s: np.minimum(
        0.01 - np.abs(s("hinge.qd") - s("hinge.servo.command")), 0.01 - np.abs(s("knee.qd") - 0.05)
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("text", MARGINS)
def test_margins_of_a_run_are_those_of_its_recorded_channels(tmp_path: Path, text: str) -> None:
    found = made(
        tmp_path,
        f"require always({text}, after = 0.1 s);",
        f"require ever: eventually({text}, within = 0.2 s);",
        f"require stretch: holds_for({text}, 0.05 s);",
        f"require share_of_time({text}, after = 0.1 s) >= 50 % in 90 % of cases with 80 % confidence;",
    )
    result = engine.run(found)
    margin, t = MARGINS[text](lambda name: of(result, name)), result.time
    np.testing.assert_allclose(result.metrics["always"][0], margin[t >= 0.1].min(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(result.metrics["ever"][0], margin[t <= 0.2].max(), rtol=0, atol=1e-12)
    assert result.metrics["share_of_time"][0] == (margin[t >= 0.1] >= 0).mean()
    holds = any((margin[k : k + 51] >= 0).all() for k in range(len(t) - 50))
    assert (result.metrics["stretch"][0] >= 0) == holds
    assert [bool(each[0]) for each in result.met.values()] == [
        margin[t >= 0.1].min() >= 0, margin[t <= 0.2].max() >= 0, holds, (margin[t >= 0.1] >= 0).mean() >= 0.5,
    ]  # fmt: skip


def test_never_is_about_any_joint(tmp_path: Path) -> None:
    found = made(tmp_path, "require never(*.servo.voltage > 3 V);")
    result = engine.run(found)
    both = np.stack([of(result, "hinge.servo.voltage"), of(result, "knee.servo.voltage")])
    np.testing.assert_allclose(result.metrics["never"][0], 3.0 - both.max(), atol=1e-12)


def test_a_requirement_over_time_is_a_metric_with_a_limit(tmp_path: Path) -> None:
    found = made(
        tmp_path,
        "require always(abs(hinge.qd) < 20 deg/s, after = 0.1 s);",
        "require always(abs(knee.qd) < 20 deg/s);",
        "require slow: always(hinge.qd < 20 deg/s) > 1 deg/s;",
    )
    assert [(use.name, use.model, use.of) for use in found.structure.metrics] == [
        ("always", "always", "abs(hinge.qd) < 20 deg/s"),
        ("always_2", "always", "abs(knee.qd) < 20 deg/s"),
        ("slow", "always", "hinge.qd < 20 deg/s"),
    ]
    assert [(each.text, each.metric, each.comparison, each.limit) for each in found.requirements] == [
        ("always(abs(hinge.qd) < 20 deg/s, after = 0.1 s)", "always", ">=", 0.0),
        ("always(abs(knee.qd) < 20 deg/s)", "always_2", ">=", 0.0),
        ("slow: always(hinge.qd < 20 deg/s) > 1 deg/s", "slow", ">", pytest.approx(np.radians(1))),
    ]
    assert found.parameters["metrics.always.after"].value == 0.1
    assert metric_units(found.structure) == {"always": "rad/s", "always_2": "rad/s", "slow": "rad/s"}


def test_windows_and_limits_may_vary(tmp_path: Path) -> None:
    more = "sweep both of hold { vary metrics.quick.after = [0.1, 0.3] s; vary limit = [0.2, 0.4] rad/s; }\n"
    found = made(tmp_path, "require quick: always(abs(hinge.qd) < limit);", more=more, select="both")
    (made_of,) = found.structure.expressions
    assert set(made_of.formula.inputs) == {f"{CHANNEL_INPUT}hinge.qd", "limit"}
    result = engine.run(found)
    for case, (after, limit) in enumerate([(0.1, 0.2), (0.1, 0.4), (0.3, 0.2), (0.3, 0.4)]):
        qd = result.signals["qd"][case][:, 0]
        wanted = (limit - np.abs(qd))[result.time >= after].min()
        np.testing.assert_allclose(result.metrics["quick"][case], wanted, atol=1e-12)


def test_a_plan_with_expressions_reads_back_to_itself(tmp_path: Path) -> None:
    found = made(tmp_path, "signal a = hinge.qd - knee.qd;", "require quick: always(abs(signals.a) < 1 rad/s);")
    plan = Plan("deck.ic", (found,))
    assert plan_file.loads(plan_file.dumps(plan)) == plan


# Requirements with names


def texts(folder: Path, derived: str) -> list[str]:
    base = ("metric top = max { of = hinge.qd; }", "require quick: top < 1 rad/s;", "require top < 2 rad/s;",
            "require calm: always(hinge.qd < 1 rad/s);")  # fmt: skip
    found = made(folder, *base, more=f"run other like hold {{ {derived} }}\n", select="other")
    return [each.text for each in found.requirements]


def test_like_replaces_and_removes_requirements_by_name(tmp_path: Path) -> None:
    calm = "calm: always(hinge.qd < 1 rad/s)"
    assert texts(tmp_path, "") == ["quick: top < 1 rad/s", "top < 2 rad/s", calm]
    assert texts(tmp_path, "require quick: top < 3 rad/s in 90 % of cases;") == [
        "top < 2 rad/s", calm, "quick: top < 3 rad/s in 90 % of cases",
    ]  # fmt: skip
    assert texts(tmp_path, "remove quick; remove calm;") == ["top < 2 rad/s"]
    assert texts(tmp_path, "require calm: top > 0 rad/s;") == [
        "quick: top < 1 rad/s", "top < 2 rad/s", "calm: top > 0 rad/s",
    ]  # fmt: skip
    # what goes with a metric that is removed, and what is required of another in its place
    assert texts(tmp_path, "remove quick; remove top; metric top = min { of = knee.qd; } require top > 0 rad/s;") == [
        calm, "top > 0 rad/s",
    ]  # fmt: skip


# Words that are new name what they named before


def test_new_words_name_what_they_named_before(tmp_path: Path) -> None:
    run = run_with(
        "metric never = max { of = hinge.qd; }",
        "metric signals = max { of = knee.q; }",
        "require never < 1 rad/s;",
        "require signals < 2 rad;",
    )
    text, run = (
        each.replace("hinge", "signal").replace("knee", "always").replace("limit", "abs") for each in (ARM, run)
    )
    found = experiment(tmp_path, text, SERVO, run)
    assert [each.text for each in found.requirements] == ["never < 1 rad/s", "signals < 2 rad"]
    assert found.structure.expressions == ()


# Mistakes

MISTAKES = {
    "metric m = max { of = hinge.qd - 2; }": "error[D063]: `-` of rad/s and a pure number",
    "metric m = max { of = hinge.qd - knee.speed; }": "error[D125]: no channel `knee.speed`",
    "metric m = max { of = 2 * limit; }": "error[D356]: `2 * limit` is of no channel",
    "metric m = max { of = q - 1 rad; }": "error[D125]: `q` is 3 channels",
    "metric m = max { of = *.q; }": "error[D063]: `*.q` of joint `hinge` and of joint `rail` are of different units",
    "metric m = max { of = *.speed; }": "error[D125]: no joint has a channel `speed`",
    "metric m = final { of = *.servo.voltage; }": "error[D356]: a metric `final` watches one channel, and "
    "`*.servo.voltage` is one of each joint",
    "metric m = max { of = hinge.qd < 1 rad/s; }": "error[D064]: `<` is not arithmetic: a number is needed here",
    "metric m = always { of = hinge.qd; }": "error[D353]: a condition is needed here",
    "metric m = always { after = 1 s; }": "error[D125]: metric `m` watches no condition",
    "signal s = *.qd;": "error[D356]: a signal is one number, and `*.qd` is one of each joint",
    "signal s = hinge.qd; signal s = knee.qd;": "error[D040]: signal `s` is written twice",
    "signal s { of = hinge.qd; }": "error[D356]: signal `s` is an expression of channels",
    "record += [hinge.qd - knee.qd];": "error[D124]: a record is a list of channels; this is none",
    "require always(hinge.qd == 1 rad/s);": "error[D353]: `==` of numbers that change in time has no margin",
    "require always(hinge.qd < 1 V);": "error[D063]: `<` of rad/s and V",
    "require always(hinge.qd < 1 rad/s and hinge.servo.voltage < 3 V);": "error[D354]: the margin of this condition is "
    "of two units: rad/s and V",
    "require always(eventually(hinge.qd < 1 rad/s));": "error[D355]: `eventually` inside a condition: requirements over "
    "time do not nest",
    "require always();": "error[D355]: `always` takes a condition",
    "require always(hinge.qd < 1 rad/s, 2 s);": "error[D355]: `always` takes a condition",
    "require holds_for(hinge.qd < 1 rad/s);": "error[D075]: metric `holds_for` has no `time`",
    "require always(hinge.qd < 1 rad/s, before = 2 s);": "error[D141]: metric `always` has no `before`",
    "require share_of_time(hinge.qd < 1 rad/s);": "error[D355]: `share_of_time` is a share, and there is no limit for it",
    "require always(hinge.qd < 1 rad/s) < 2 V;": "error[D061]: the limit on `always` is",
    "metric m = max { of = hinge.qd; } require m: m < 1 rad/s;": "error[D040]: `m` is a metric, and a requirement",
    "metric m = max { of = hinge.qd; } require a: m < 1 rad/s; require a: m < 2 rad/s;": "error[D040]: requirement `a` is "
    "written twice",
    "require always(hinge.qd < 1 rad/s, after = 2 s);": "warning[D341]: `require always(hinge.qd < 1 rad/s, "
    "after = 2 s)` looks beyond this run, which ends at 0.5 s: its window begins at 2 s",
    "require eventually(hinge.qd < 1 rad/s, within = 2 s);": "warning[D341]: `require eventually(hinge.qd < 1 rad/s, "
    "within = 2 s)` looks beyond this run, which ends at 0.5 s: its window ends at 2 s",
}


@pytest.mark.slow
@pytest.mark.parametrize("entry", MISTAKES)
def test_mistakes_are_told_with_their_place(tmp_path: Path, entry: str) -> None:
    text = said(tmp_path, entry)
    heads = re.findall(r"^(?:error|warning)\[.*$", text, re.MULTILINE)
    assert len(heads) == 1 and heads[0].startswith(MISTAKES[entry]), text
    assert "= help:" in text or "D064" in text


def test_a_signal_may_not_hide_a_channel(tmp_path: Path) -> None:
    run = run_with("signal q = 2 * hinge.qd;").replace("hinge", "signals")
    text = messages(check(tmp_path, ARM.replace("hinge", "signals"), SERVO, run))
    assert "error[D040]: there is a channel `signals.q` already" in text


def test_conditions_of_several_units_are_counted(tmp_path: Path) -> None:
    """A share of time needs to know whether the condition holds, and no margin."""
    text = "hinge.qd > 0.05 rad/s and hinge.servo.voltage > 1 V or knee.q > 1 mrad"
    found = made(tmp_path, f"require part: share_of_time({text}) > 0 %;")
    result = engine.run(found)
    holds = (of(result, "hinge.qd") > 0.05) & (of(result, "hinge.servo.voltage") > 1) | (of(result, "knee.q") > 1e-3)
    assert result.metrics["part"][0] == holds.mean()
    assert 0.0 < holds.mean() < 1.0


@pytest.mark.parametrize(("old", "new", "why"), [
    ('"channel:hinge.qd"', '"channel:hinge.speed"', "there is no channel `hinge.speed`"),
    ('"channel:hinge.qd"', '"limit"', "it is computed of no channel"),
    ('"name":"signals.a"', '"name":"hinge.q"', "there is a channel `hinge.q` already"),
    ('"outputs":[', '"outputs":[0,', "it should have one output, a number"),
])  # fmt: skip
def test_a_plan_whose_expressions_are_damaged_is_refused(tmp_path: Path, old: str, new: str, why: str) -> None:
    text = plan_file.dumps(Plan("deck.ic", (made(tmp_path, "signal a = 2 * hinge.qd;"),)))
    start = text.index('"expressions"')
    assert old in text[start:]
    with pytest.raises(Problem, match=re.escape(why)):
        plan_file.loads(text[:start] + text[start:].replace(old, new))


@pytest.mark.release
def test_the_reference_and_the_kernel_agree(tmp_path: Path) -> None:
    more = "sweep both of hold { vary limit = [0.2, 0.4] rad/s; }\n"
    found = made(
        tmp_path,
        "signal a = atan2(hinge.qd, 1 rad/s) * links.arm.position.x;",
        "record += [signals.a];",
        "require always(abs(hinge.qd) < limit, after = 0.1 s);",
        "require holds_for(hinge.qd > 0 rad/s and not knee.servo.voltage > 2 V, 0.1 s);",
        "metric most = rms { of = *.servo.voltage; }",
        more=more,
        select="both",
    )
    result, program = engine.run(found), build(found)
    for case, limit in enumerate((0.2, 0.4)):
        rows, outputs = execute(program, {"limit": limit}, found.structure.schedule.ticks)
        column = sum(len(each.channels) for each in found.structure.record[:-1])
        # sines of the kernel and of the C library differ in the last place
        np.testing.assert_allclose(rows[:, column], result.signals["signals.a"][case], rtol=1e-10, atol=1e-14)
        for name, values in result.metrics.items():
            assert outputs[METRIC + name] == pytest.approx(values[case], rel=1e-10, abs=1e-12)
