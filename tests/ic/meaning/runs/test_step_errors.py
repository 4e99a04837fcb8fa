"""`require step_error(METRIC) < LIMIT;`: what it makes of a run, and whole messages of what is wrong with it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from met.diagnostic import Problem
from met.plan import Plan
from met.plan import file as plan_file
from met.plan.judged import StepErrorLimit
from met.plan.keys import case_ids, structure_key
from tests.ic import small_decks

DECK = """\
arm chain {
    link a { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint one revolute { parent = base; child = a; axis = z; }
}
run plain {
    arm = chain;
    rates { dynamics = 500 Hz; }
    duration = 1 s;
    record = [];
    metric turn = final { of = one.q; }
    metric over = overshoot { of = one.q; target = 1 rad; }
}
"""


def deck(body: str) -> str:
    return f"{DECK}run other like plain {{\n    {body}\n}}\n"


def planned(tmp_path: Path, body: str) -> Plan:
    made = small_decks.check(tmp_path, deck(body), select=["other"])
    assert made.plan is not None, small_decks.messages(made)
    return made.plan


def limits(tmp_path: Path, body: str) -> list[StepErrorLimit]:
    return [replace(each, place=None) for each in planned(tmp_path, body).experiments[0].step_errors]


def test_a_limit_is_a_share_or_in_the_metric_s_unit(tmp_path: Path) -> None:
    assert limits(tmp_path, "require step_error(turn) < 1 %;  require 0.5 rad >= step_error(turn);") == [
        StepErrorLimit("step_error(turn) < 1 %", "turn", "<", 0.01, True),
        StepErrorLimit("0.5 rad >= step_error(turn)", "turn", "<=", 0.5, False),
    ]
    assert limits(tmp_path, "require step_error(over) <= 0.02;")[0].share


def test_it_changes_no_key_and_a_plan_keeps_it(tmp_path: Path) -> None:
    [bare], [with_limit] = (planned(tmp_path, body).experiments for body in ("", "require step_error(turn) < 1 %;"))
    assert structure_key(bare.structure) == structure_key(with_limit.structure)
    assert case_ids(bare) == case_ids(with_limit)
    plan = planned(tmp_path, "require step_error(turn) < 1 %;")
    assert plan_file.loads(plan_file.dumps(plan)) == plan
    assert "step_errors" not in plan_file.dumps(planned(tmp_path, ""))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"metric": "nothing"}, "step_errors[0].metric: there is no metric `nothing`"),
        ({"limit": 0.0}, "step_errors[0].limit: it should be a finite number above 0"),
    ],
)
def test_a_plan_that_is_damaged_is_refused(tmp_path: Path, change: dict[str, object], said: str) -> None:
    plan = planned(tmp_path, "require step_error(turn) < 1 %;")
    [one] = plan.experiments
    other = replace(one, step_errors=(replace(one.step_errors[0], **change),))  # type: ignore[arg-type]
    with pytest.raises(Problem, match="E302") as caught:
        plan_file.loads(plan_file.dumps(replace(plan, experiments=(other,))))
    assert said in caught.value.diagnostics[0].message


WRITE = "write `require step_error(METRIC) < 1 %;`, or a limit in the metric's unit"


@pytest.mark.parametrize(
    ("written", "code", "message", "helps"),
    [
        ("step_error() < 1 %", "D313", "an error by the step is one metric's", (WRITE,)),
        ("step_error(turn, over) < 1 %", "D313", "an error by the step is one metric's", (WRITE,)),
        ("step_error(of = turn) < 1 %", "D313", "an error by the step is one metric's", (WRITE,)),
        ("step_error(2) < 1 %", "D313", "an error by the step is one metric's", (WRITE,)),
        ("step_error(turn) > 1 %", "D313", "`step_error(turn) > 1 %` asks for errors that are large", (WRITE,)),
        ("1 % < step_error(turn)", "D313", "`1 % < step_error(turn)` asks for errors that are large", (WRITE,)),
        (
            "step_error(tur) < 1 %",
            "D132",
            "no metric `tur`",
            ("did you mean `turn`?", "metrics of this run: over, turn"),
        ),
        (
            "step_error(turn) < 0 rad",
            "D077",
            "the limit on the error by the step of `turn` must be above 0 rad",
            None,
        ),
        (
            "step_error(turn) < 2 s",
            "D061",
            "the limit on the error by the step of `turn` is in rad, and this is in s",
            None,
        ),
        (
            "step_error(turn) == 1 %",
            "D131",
            "a requirement compares a metric with a limit",
            ("write `require METRIC < LIMIT;`, or <=, >, >=",),
        ),
    ],
)
def test_what_is_wrong_is_told(
    tmp_path: Path, written: str, code: str, message: str, helps: tuple[str, ...] | None
) -> None:
    made = small_decks.check(tmp_path, deck(f"require {written};"), select=["other"])
    [found] = [each for each in made.diagnostics if each.severity == "error"]
    assert (found.code, found.message) == (code, message)
    assert found.at is not None and found.at.place.line == 14
    assert helps is None or found.help == helps
