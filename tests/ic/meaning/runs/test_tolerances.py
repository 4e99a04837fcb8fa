"""`tolerances { }`: what it makes of a run, what it leaves alone, and whole messages of what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from met.diagnostic import Problem
from met.plan import Experiment, Plan
from met.plan import file as plan_file
from met.plan.keys import case_ids, structure_key
from tests.ic import small_decks

DECK = """\
arm chain {
    link a { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link b { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint one revolute  { parent = base;  child = a;  axis = z; }
    joint two prismatic { parent = a;     child = b;  axis = x; }
}
run plain {
    arm = chain;
    rates { dynamics = 500 Hz; }
    duration = 1 s;
    record = [q, one.qd, links.b.position, tau_load, links.b.jacobian.linear];
    metric reach = max { of = links.b.position.x; }
    metric tau_load = final { of = one.tau_load; }
}
"""


def deck(body: str) -> str:
    return f"{DECK}run other like plain {{\n    tolerances {{ {body} }}\n}}\n"


@pytest.fixture
def compiled(tmp_path: Path) -> Callable[..., Plan]:
    """The plan of a deck's text, of the run or sweep `name`."""

    def compile_it(text: str, name: str = "other", **options: object) -> Plan:
        made = small_decks.check(tmp_path, text, select=[name], **options)
        assert made.plan is not None, small_decks.messages(made)
        return made.plan

    return compile_it


@pytest.fixture
def told(tmp_path: Path) -> Callable[..., str]:
    def tell(text: str, **options: object) -> str:
        return small_decks.messages(small_decks.check(tmp_path, text, select="all", **options))

    return tell


def one(plan: Plan) -> Experiment:
    [experiment] = plan.experiments
    return experiment


def found(plan: Plan) -> dict[str, tuple[float, str]]:
    return {each.of: (each.value, each.text) for each in one(plan).tolerances}


def test_each_is_in_si_and_as_the_deck_wrote_it(compiled: Callable[..., Plan]) -> None:
    text = deck(
        "one.q = 0.5 deg;  two.q = 20 um;  one.qd = 1 mrad/s;  links.b.position = 1 mm;  reach = 2 * 1 mm;  "
        "rel = 2 %;  time = 1 ms;"
    )
    assert found(compiled(text)) == {
        "one.q": (pytest.approx(0.5 * 3.14159265358979 / 180), "0.5 deg"),
        "two.q": (pytest.approx(20e-6), "20 um"),
        "one.qd": (1e-3, "1 mrad/s"),
        "links.b.position": (1e-3, "1 mm"),
        "reach": (2e-3, "2 * 1 mm"),
        "rel": (0.02, "2 %"),
        "time": (1e-3, "1 ms"),
    }


def test_of_a_joint_in_a_jacobian_and_of_a_metric_that_is_called_as_a_signal(compiled: Callable[..., Plan]) -> None:
    text = deck("links.b.jacobian.linear.one = 1 mm/rad;  metrics.tau_load = 2 N*m;  one.tau_load = 1 N*m;")
    assert found(compiled(text)) == {
        "links.b.jacobian.linear.one": (1e-3, "1 mm/rad"),
        "metrics.tau_load": (2.0, "2 N*m"),
        "one.tau_load": (1.0, "1 N*m"),
    }


def test_a_run_takes_over_and_overrides(compiled: Callable[..., Plan]) -> None:
    body = deck("rel = 1e-9;  reach = 1 mm;") + "run third like other { tolerances { reach = 2 mm;  remove rel; } }\n"
    assert found(compiled(body, "third")) == {"reach": (2e-3, "2 mm")}


def test_they_are_no_part_of_what_is_run(compiled: Callable[..., Plan]) -> None:
    with_them, without = one(compiled(deck("rel = 1e-3;"))), one(compiled(deck("          ")))
    assert structure_key(with_them.structure) == structure_key(without.structure)
    assert case_ids(with_them) == case_ids(without)
    assert replace(with_them, tolerances=()) == without


def test_they_are_in_a_plan_file(compiled: Callable[..., Plan]) -> None:
    plan = compiled(deck("rel = 1e-3;  reach = 1 mm;"))
    assert plan_file.loads(plan_file.dumps(plan)) == plan


@pytest.mark.parametrize(("old", "new", "why"), [
    ('"of":"reach"', '"of":"raech"', "tolerances[0].of: there is no signal or metric `raech`"),
    ('"value":0.001', '"value":-0.001', "tolerances[0].value: it should be a finite number, at least 0"),
    ('"value":0.001', '"value":"nan"', "tolerances[0].value: it should be a finite number, at least 0"),
    ('"of":"rel"', '"of":"reach"', "tolerances: something has two tolerances"),
])  # fmt: skip
def test_a_plan_file_that_was_changed(compiled: Callable[..., Plan], old: str, new: str, why: str) -> None:
    text = plan_file.dumps(compiled(deck("reach = 1 mm;  rel = 3;")))
    assert old in text
    with pytest.raises(Problem) as problem:
        plan_file.loads(text.replace(old, new))
    assert problem.value.diagnostics[0].message == f"the plan plan is damaged: experiments[0].{why}"


def test_what_is_set_on_the_command_line(compiled: Callable[..., Plan]) -> None:
    plan = compiled(deck("reach = 1 mm;"), set={"tolerances.reach": "3 mm"})
    assert found(plan) == {"reach": (3e-3, "3 mm")}


@pytest.mark.parametrize(("body", "message"), [
    ("qd = 1 rad/s;", """\
error[D237]: no signal or metric `qd` here that could differ
  --> deck.ic:16:18
   |
16 |     tolerances { qd = 1 rad/s; }
   |                  ^^
   = help: only what is recorded can differ: `record += [qd];`
   = help: signals and metrics here: q, one.qd, links.b.position, tau_load, links.b.jacobian.linear, reach, metrics.tau_load
"""),
    ("raech = 1 mm;", """\
error[D237]: no signal or metric `raech` here that could differ
  --> deck.ic:16:18
   |
16 |     tolerances { raech = 1 mm; }
   |                  ^^^^^
   = help: did you mean `reach`?
   = help: signals and metrics here: q, one.qd, links.b.position, tau_load, links.b.jacobian.linear, reach, metrics.tau_load
"""),
    ("links.b.jacobian = 1 mm;", """\
error[D237]: no signal or metric `links.b.jacobian` here that could differ
  --> deck.ic:16:18
   |
16 |     tolerances { links.b.jacobian = 1 mm; }
   |                  ^^^^^^^^^^^^^^^^
   = help: `links.b.jacobian` is several signals: links.b.jacobian.angular, links.b.jacobian.linear
"""),
    ("q = 1 deg;", """\
error[D238]: `q` is in rad and in m
  --> deck.ic:16:18
   |
16 |     tolerances { q = 1 deg; }
   |                  ^
   = help: give each joint its own: one.q, two.q
"""),
    ("reach = [1, 2] mm;", """\
error[D071]: `reach` of the tolerances is one number, and this is a list
"""),
    ("reach = 1 deg;", """\
error[D061]: the tolerance of `reach` is in m, and this is in rad
"""),
    ("time = 1;", """\
error[D060]: the tolerance of `time` is in s, and this is a bare number
"""),
    ("metric reach = 1 mm;", """\
error[D239]: `metric` is no tolerance
"""),
])  # fmt: skip
def test_what_is_wrong(told: Callable[..., str], body: str, message: str) -> None:
    assert told(deck(body)).startswith(message)


def test_one_that_is_taken_over_and_not_recorded_any_more(told: Callable[..., str]) -> None:
    body = deck("one.qd = 1 rad/s;") + "run third like other { record = [q]; }\n"
    assert (
        told(body)
        == """\
error[D237]: no signal or metric `one.qd` here that could differ
  --> deck.ic:16:18
   |
16 |     tolerances { one.qd = 1 rad/s; }
   |                  ^^^^^^
   = help: only what is recorded can differ: `record += [one.qd];`, or `remove one.qd;` here
   = help: signals and metrics here: q, reach, tau_load

1 error
"""
    )


@pytest.mark.parametrize(("sweep", "message"), [
    ("tolerances { reach = 2 mm; }", """\
error[D136]: `tolerances` in a sweep
  --> deck.ic:18:20
   |
18 | sweep s of other { tolerances { reach = 2 mm; } }
   |                    ^^^^^^^^^^
   = help: they belong to the run: write a run `like other` with them, and sweep that

1 error
"""),
    ("tolerances.reach = 2 mm;", """\
error[D136]: `tolerances.reach = ...` in a sweep
  --> deck.ic:18:20
   |
18 | sweep s of other { tolerances.reach = 2 mm; }
   |                    ^^^^^^^^^^^^^^^^
   = help: set it in a run `like other`, and sweep that

1 error
"""),
    ("vary tolerances.reach = [1, 2] mm;", """\
error[D122]: the tolerance of `reach` varies with the sweep
  --> deck.ic:18:25
   |
18 | sweep s of other { vary tolerances.reach = [1, 2] mm; }
   |                         ^^^^^^^^^^^^^^^^
   = help: it is the same for all cases: write a number that stands still

1 error
"""),
])  # fmt: skip
def test_no_tolerance_in_a_sweep(told: Callable[..., str], sweep: str, message: str) -> None:
    assert told(deck("reach = 1 mm;") + f"sweep s of other {{ {sweep} }}\n") == message
