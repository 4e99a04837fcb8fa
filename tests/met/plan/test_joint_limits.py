"""Limits of joints in plans: an older plan has none; one that lacks a number, or has none that it can have, is told."""

from __future__ import annotations

import json

import pytest

import ic
from met import run as engine
from met.diagnostic import Problem
from met.plan import file as plan_file
from tests.ic.small_decks import ARM, RUN, SERVO

LIMITED = ARM.replace("axis = z;", "axis = z;  q_min = -1 rad;  q_max = 1 rad;  qd_max = 2 rad/s;  tau_max = 9 N*m;")


def document(arm: str) -> dict:  # type: ignore[type-arg]
    found: dict = json.loads(plan_file.dumps(ic.compile(text=arm + SERVO + RUN)))  # type: ignore[type-arg]
    return found


def test_a_plan_keeps_them_and_one_of_before_there_were_any_is_run_as_it_was() -> None:
    kept, old = document(LIMITED), document(ARM)
    [experiment] = plan_file.loads(json.dumps(kept)).experiments
    assert experiment.structure.joints[0].limits == ("q_min", "q_max", "qd_max", "tau_max")
    assert list(engine.run(experiment).excess) == [f"hinge.{name}" for name in experiment.structure.joints[0].limits]
    assert "limits" not in old["experiments"][0]["structure"]["joints"][0]
    [before] = plan_file.loads(json.dumps(old)).experiments
    without = engine.run(before)
    assert without.excess == {}
    assert without.signals["q"].tobytes() == engine.run(experiment).signals["q"].tobytes()


def test_a_limit_without_its_number_is_told() -> None:
    kept = document(LIMITED)
    del kept["experiments"][0]["parameters"]["hinge.qd_max"]
    with pytest.raises(Problem, match=r"E304: .*`hinge\.qd_max` is missing and has no default"):
        plan_file.loads(json.dumps(kept))


@pytest.mark.parametrize(("name", "value", "why"), [("q_min", 1.0, "less than `q_max`"), ("tau_max", 0.0, "above 0")])
def test_limits_that_a_deck_could_not_write_are_refused(name: str, value: float, why: str) -> None:
    kept = document(LIMITED)
    kept["experiments"][0]["parameters"][f"hinge.{name}"]["value"] = value
    with pytest.raises(Problem, match=rf"E302: .*{why}"):
        plan_file.loads(json.dumps(kept))
