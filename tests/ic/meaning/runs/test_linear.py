"""Linear answers that a run asks for: what a plan keeps of them, and what is said of mistakes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from met.diagnostic import Problem
from met.plan import Plan
from met.plan import file as plan_file
from met.plan.judged import MetricUse
from tests.ic.small_decks import ARM, RUN, SERVO, check, experiment, messages

LOOP = (
    "linear loop { at = 0.5 s;  inputs = hinge.servo.command;  outputs = [q, hinge.tau];  open = hinge.servo.voltage; }"
)


def run_with(*entries: str) -> str:
    return RUN.removesuffix("}\n") + "".join(f"    {each}\n" for each in entries) + "}\n"


def said(folder: Path, *entries: str) -> str:
    """What is said of the run with these entries, from its first line to the line with the place's marks."""
    return messages(check(folder, ARM, SERVO, run_with(*entries)))


def test_a_plan_keeps_what_is_asked_and_metrics_of_it(tmp_path: Path) -> None:
    asked = ("metric room = delay_margin { of = loop; }", "require firm: phase_margin(loop) > 30 deg;")
    made = experiment(tmp_path, ARM, SERVO, run_with(LOOP, *asked, "require gain_margin(loop) > 2;"))
    (use,) = made.linear
    assert (use.name, use.at, use.inputs) == ("loop", 0.5, ("hinge.servo.command",))
    assert (use.outputs, use.opened) == (("q", "hinge.tau"), ("hinge.servo.voltage",))
    assert [(each.name, each.model, each.of) for each in made.linear_metrics] == [
        ("room", "delay_margin", "loop"),
        ("firm", "phase_margin", "loop"),
        ("loop_gain_margin", "gain_margin", "loop"),
    ]
    assert made.structure.metrics == () and made.metrics == made.linear_metrics
    assert [(each.metric, round(each.limit, 6)) for each in made.requirements] == [
        ("firm", 0.523599),
        ("loop_gain_margin", 2.0),
    ]
    kept = plan_file.loads(plan_file.dumps(Plan("deck.ic", (made,)))).experiments[0]
    assert kept.linear == made.linear and kept.linear_metrics == made.linear_metrics


@pytest.mark.parametrize(
    ("written", "pose"), [("", ()), ("(q = [30] deg)", (0.523599,)), ("(q = 30 deg)", (0.523599,))]
)
def test_a_pose_is_kept_in_si(written: str, pose: tuple[float, ...], tmp_path: Path) -> None:
    made = experiment(tmp_path, ARM, SERVO, run_with(f"linear b {{ at = equilibrium{written}; }}"))
    (use,) = made.linear
    assert use.pose is not None and tuple(round(each, 6) for each in use.pose) == pose
    assert plan_file.loads(plan_file.dumps(Plan("deck.ic", (made,)))).experiments[0].linear == made.linear


def test_a_plan_without_them_has_no_word_of_them(tmp_path: Path) -> None:
    assert "linear" not in plan_file.dumps(Plan("deck.ic", (experiment(tmp_path, ARM, SERVO, RUN),)))


def test_a_run_like_another_changes_and_removes_them(tmp_path: Path) -> None:
    firm = "require phase_margin(loop) > 30 deg;"
    later = "run later like hold { loop { at = 0.75 s; } }\n"
    made = experiment(tmp_path, ARM, SERVO, run_with(LOOP, firm), later, select=["later"])
    assert made.linear[0].at == 0.75 and made.linear[0].opened == ("hinge.servo.voltage",)
    gone = check(tmp_path, ARM, SERVO, run_with(LOOP, firm), "run none like hold { remove loop; }\n", select=["none"])
    assert "error[D376]: no `linear loop` in this run\n  --> deck.ic:18:26" in messages(gone)


WRONG = {
    "linear b { at = 5 s; }": "error[D375]: t = 5 s is not in the run, which ends at 1 s",
    "linear b { open = hinge.servo.volts; }": "error[D375]: there is no place to open a loop `hinge.servo.volts`",
    "linear b { inputs = hinge.q; }": "error[D375]: there is no input `hinge.q`",
    "linear b { outputs = hinge.qq; }": "error[D125]: no channel `hinge.qq`",
    "linear b { outputs = 3; }": "error[D375]: `outputs` is a list of signals",
    "linear b { outputs = [q, q]; }": "error[D040]: `q` is there twice",
    "linear b { opne = hinge.servo.voltage; }": "error[D141]: `linear b` has no `opne`",
    "linear b { at = equilibrium(q = [1, 2] deg); }": "error[D375]: `q` of an equilibrium is a position of each joint "
    "that follows none, 1 in all",
    "linear b { at = equilibrium(q = 3 s); }": "error[D061]: the position of `hinge` is in rad, and this is in s",
    "linear b { at = equilibrium(p = 3 deg); }": "error[D141]: `equilibrium` of `linear b` has no `p`",
    "linear b { at = equilibrium(3 deg); }": "error[D153]: `equilibrium` takes its values by name",
    "linear b = 3;": "error[D375]: `linear b` is a block",
    f"{LOOP} require phase_margin(lop) > 30 deg;": "error[D376]: no `linear lop` in this run",
    f"{LOOP} require phase_margin(loop, 2) > 30 deg;": "error[D376]: `phase_margin` takes the name of a `linear` block",
    f"{LOOP} require phase_margin(loop);": "error[D131]: a requirement compares a metric with a limit",
    f"{LOOP} require phase_margin(loop) > 3 s;": "error[D061]: the limit on `loop_phase_margin` is in rad, and this is in s",
    f"{LOOP} metric a = phase_margin;": "error[D376]: a `phase_margin` is of a `linear` block",
    f"{LOOP} metric a = phase_margn {{ of = loop; }}": "error[D140]: no metric model `phase_margn`",
    f"{LOOP} metric a = damping {{ of = loop; band = 2; }}": "error[D141]: metric `a` has no `band`",
    "linear b { } require disk_margin(b) > 1;": "error[D376]: `linear b` opens no loop, so it has no `disk_margin`",
    f"{LOOP} metric a = damping {{ of = loop; }} require step_error(a) < 1 %;": "error[D313]: `a` is of linear answers, "
    "of which no error by the step is computed",
    f"{LOOP} require delay_margin(loop) >= 0 s;": "warning[D340]: `require delay_margin(loop) >= 0 s` cannot be missed: "
    "a metric `delay_margin` is never below 0",
}


def test_a_margin_without_its_loop_is_told_where_this_run_can_open_one(tmp_path: Path) -> None:
    closed = said(tmp_path, "linear b { } require disk_margin(b) > 1;")
    assert "= help: write `open = hinge.servo.voltage;` in it\n\n1 error" in closed
    assert "= help: write `linear b { open = hinge.servo.voltage; }`" in said(tmp_path, "require disk_margin(b) > 1;")


@pytest.mark.slow
@pytest.mark.parametrize("entry", WRONG)
def test_what_is_wrong_is_said_where_it_is_written(entry: str, tmp_path: Path) -> None:
    first, place, *_ = said(tmp_path, entry).splitlines()
    assert first == WRONG[entry]
    line = len((ARM + SERVO + RUN).splitlines())
    assert place.strip().startswith(f"--> deck.ic:{line}:")


def test_a_mistake_is_said_whole(tmp_path: Path) -> None:
    assert (
        said(tmp_path, "linear loop { open = hinge.servo.volts; }")
        == """\
error[D375]: there is no place to open a loop `hinge.servo.volts`
  --> deck.ic:17:26
   |
17 |     linear loop { open = hinge.servo.volts; }
   |                          ^^^^^^^^^^^^^^^^^
   = help: did you mean `hinge.servo.voltage`?
   = help: there are: hinge.servo.voltage

1 error
"""
    )


def test_an_instant_is_one_for_a_sweep(tmp_path: Path) -> None:
    swept = "sweep when of hold { vary linear.loop.at = [0.25, 0.5] s; }\n"
    found = messages(check(tmp_path, ARM, SERVO, run_with(LOOP), swept, select=["when"]))
    assert "error[D122]: `linear.loop.at` cannot vary\n  --> deck.ic:19:27\n" in found
    assert "= help: it is one for the whole sweep: write a `linear` block for each instant" in found
    when = "let when = 0.25 s;\n"
    swept = "sweep later of hold { vary when = [0.25, 0.5] s; }\n"
    found = messages(check(tmp_path, when, ARM, SERVO, run_with("linear b { at = when; }"), swept, select=["later"]))
    assert "error[D122]: `at` of `linear b` varies with the sweep\n" in found
    assert "\n   = help: write a `linear` block for each instant\n" in found


DAMAGED = {
    "pose": (lambda of: of["linear"][0].update(at=0.0, pose=[0.5, 0.5]), "linear[0].pose"),
    "pose and instant": (lambda of: of["linear"][0].update(pose=[0.5]), "linear[0].pose"),
    "at": (lambda of: of["linear"][0].update(at=3.0), "linear[0].at"),
    "opened": (lambda of: of["linear"][0].update(opened=["hinge.servo.command"]), "linear[0].opened"),
    "outputs": (lambda of: of["linear"][0].update(outputs=["nothing"]), "linear[0].outputs"),
    "twice": (lambda of: of["linear"][0].update(inputs=2 * ["hinge.servo.command"]), "linear[0].inputs"),
    "figure": (lambda of: of["linear_metrics"][0].update(model="beauty"), "linear_metrics[0].model"),
    "of": (lambda of: of["linear_metrics"][0].update(of="other"), "linear_metrics[0].of"),
    "no loop": (lambda of: of["linear"][0].update(opened=[]), "linear_metrics[0].of"),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", DAMAGED)
def test_a_plan_that_was_damaged_is_refused(what: str, tmp_path: Path) -> None:
    made = experiment(tmp_path, ARM, SERVO, run_with(LOOP, "require phase_margin(loop) > 30 deg;"))
    document = json.loads(plan_file.dumps(Plan("deck.ic", (made,))))
    change, where = DAMAGED[what]
    change(document["experiments"][0])
    with pytest.raises(Problem, match=r"E302|damaged") as refused:
        plan_file.loads(json.dumps(document))
    assert f"experiments[0].{where}" in refused.value.diagnostics[0].message


def test_a_metric_is_one_of_the_run_whatever_it_is_of(tmp_path: Path) -> None:
    made = experiment(
        tmp_path, ARM, SERVO, run_with("metric top = peak { of = hinge.q; }", LOOP, "metric d = damping { of = loop; }")
    )
    assert made.metrics[1] == MetricUse("d", "damping", "loop", made.linear_metrics[0].place)
    assert [each.name for each in made.metrics] == ["top", "d"]
