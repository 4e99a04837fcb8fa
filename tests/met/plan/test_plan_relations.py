"""What parameters are to each other, held against plans that somebody changed by hand; decks are told the same."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from met.diagnostic import Problem
from met.plan import file as plan_file
from tests.ic.small_decks import check, codes

DECK = """\
arm rail {
    link block { mass = 2 kg; shape = sphere(radius = 0.1 m); }
    joint slide prismatic { parent = base; child = block; axis = x; }
}
run it {
    arm = rail;
    environment {
        push = wrench_table { link = block; times = [0.2, 0.4] s; force_x = [0, 6] N; }
        jet  = plume { link = block; width = 1 m; height = 1 m; nozzle = [2, 0, 0] m; axis = [-1, 0, 0]; thrust = 1 N;
                       exponent = 4; rpy = [0, 1.5, 0] rad; }
        end  = joint_stop { joint = slide; lower = -1 m; upper = 1 m; stiffness = 9 N/m; }
    }
    rates { dynamics = 100 Hz; }  duration = 1 s;  record = [q];
}
sweep some of it { vary environment.end.upper = [1, 2] m;  vary environment.jet.axis.x = [-1, -2]; }
"""
Change = Callable[[dict[str, Any]], Any]


def text(tmp_path: Path) -> str:
    compiled = check(tmp_path, DECK, select=["some"])
    assert compiled.plan is not None
    return plan_file.dumps(compiled.plan)


def value(path: str, new: Any) -> Change:
    return lambda e: e["parameters"][f"environment.{path}"].update(value=new)


def coordinate(number: int, **new: Any) -> Change:
    return lambda e: e["cases"]["coordinates"][number].update(new)


@pytest.mark.slow
def test_a_plan_with_all_of_them_is_read_as_it_was_written(tmp_path: Path) -> None:
    written = text(tmp_path)
    assert plan_file.dumps(plan_file.loads(written, "p.json")) == written
    assert json.loads(written)["experiments"][0]["parameters"]["environment.push.force_y"]["value"] == []


@pytest.mark.release
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (value("push.link", {"word": "blok"}), "push.link.value: it should name one of the arm's links"),
        (value("end.joint", {"word": "block"}), "end.joint.value: it should name one of the arm's joints"),
        (value("jet.nozzle_link", {"word": "base"}), "jet.nozzle_link.value: it should name one of the arm's links"),
        (value("push.times", [0.2, 0.1]), "push.times: they do not rise"),
        (value("push.force_x", [1.0]), "push.force_x: there are 1 for 2 of `times`"),
        (value("jet.switches", [1.0, 1.0]), "jet.switches: they do not rise"),
        (value("jet.cells", {"formula": 0}), "jet.cells.value: it decides the program, so it should be a number"),
        (value("end.lower", 1.5), "end.lower: it should be less than `upper`; in case #0"),
        (coordinate(0, values=[1.0, 1.0, -2.0, 2.0]), "end.lower: it should be less than `upper`; in case #2"),
        (coordinate(1, values=[-1.0, 0.0, -1.0, -2.0]), "jet.axis: it has no direction; in case #1"),
    ],
)
def test_what_does_not_go_together_is_said_with_its_path(change: Change, said: str, tmp_path: Path) -> None:
    document = json.loads(text(tmp_path))
    change(document["experiments"][0])
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "E302"
    head = "the plan p.json is damaged: experiments[0].parameters.environment."
    assert diagnostic.message.removeprefix(head) == said


def test_a_direction_that_a_sweep_takes_away_is_told_with_its_case(tmp_path: Path) -> None:
    compiled = check(tmp_path, DECK.replace("[-1, -2]", "[-1, 0]"), select=["some"])
    assert [d.message for d in compiled.diagnostics] == [
        "`axis` of environment `jet` has no direction; case #1 breaks it, and 1 more"
    ]


def test_a_number_that_decides_is_one_in_the_deck_and_on_the_command_line(tmp_path: Path) -> None:
    assert codes(tmp_path, DECK.replace("width = 1 m;", "width = 1 m; cells = 2.5;"), select=["it"]) == ["D077"]
    assert codes(tmp_path, DECK.replace("width = 1 m;", "width = 1 m; cells = 2 m;"), select=["it"]) == ["D061"]
    assert codes(tmp_path, DECK.replace("width = 1 m;", "width = 1 m; cells = [2, 3];"), select=["it"]) == ["D071"]
    compiled = check(tmp_path, DECK, select=["it"], set={"environment.jet.cells": "2"})
    assert [d.code for d in compiled.diagnostics] == ["D235"]
