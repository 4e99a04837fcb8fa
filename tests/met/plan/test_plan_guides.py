"""Guides in plans that somebody changed by hand: whatever is wrong with one is placed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from met.diagnostic import Problem
from met.plan import file as plan_file
from tests.ic.small_decks import check, messages

DECK = """\
arm pair {
    link one { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link two { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    link end { mass = 1 kg; shape = sphere(radius = 0.1 m); }
    joint low  revolute  { parent = base; child = one; axis = z; }
    joint high revolute  { parent = one;  child = two; axis = z; at = [1, 0, 0] m; }
    joint out  prismatic { parent = two;  child = end; axis = x; at = [1, 0, 0] m; }
}
servo follow { model = ideal; bandwidth = 20 1/s; command = rate(tip); }
servo go     { model = ideal; bandwidth = 20 1/s; command = position(move); }
run it {
    arm = pair;
    servos { low = follow; high = follow; out = go; }
    guide tip = resolved_rate {
        link = two; point = [1, 0, 0] m; guides = xy; max_damping = 0.1 m; threshold = 0.2 m;
        x = table(times = [0, 1] s, values = [0, 0.2] m); y = ramp(to = 1 cm, over = 1 s);
    }
    guide move = together { to = 1 cm; max_rate = 1 cm/s; max_acceleration = 1 cm/s^2; }
    initial { high.q = 60 deg; }
    environment {}
    rates { dynamics = 1 kHz; servos = 500 Hz; record = 100 Hz; }
    duration = 1 s;
    record = [q, guides.tip.error];
}
"""
Change = Callable[[dict[str, Any]], Any]


def text(folder: Path) -> str:
    compiled = check(folder, DECK)
    assert compiled.plan is not None, messages(compiled)
    return plan_file.dumps(compiled.plan)


def guide(number: int, **new: Any) -> Change:
    return lambda e: e["structure"]["guides"][number].update(new)


def course(number: int, **new: Any) -> Change:
    return lambda e: e["structure"]["guides"][0]["courses"][number].update(new)


def command(joint: int, **new: Any) -> Change:
    return lambda e: e["structure"]["servos"][joint]["command"].update(new)


def value(path: str, new: Any) -> Change:
    return lambda e: e["parameters"][f"guides.{path}"].update(value=new)


def test_a_plan_with_guides_is_read_as_it_was_written(tmp_path: Path) -> None:
    written = text(tmp_path)
    assert plan_file.dumps(plan_file.loads(written, "p.json")) == written


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (guide(0, name="a tip"), "structure.guides[0].name: 'a tip' is no name: letters, digits and _"),
        (guide(1, name="tip"), "structure.guides[1].name: `tip` is there twice"),
        (guide(0, divisor=0), "structure.guides[0].divisor: it should be a whole number from 1 to 1000000000000"),
        (
            guide(1, divisor=2),
            "structure.guides[1].divisor: of a guide that does not tick it should be that of the dynamics",
        ),
        (
            lambda e: (
                e["structure"]["schedule"].update(dynamics=2, ticks=1000),
                guide(0, divisor=3)(e),
                guide(1, divisor=2)(e),
            ),
            "structure.guides[0].divisor: it should be a multiple of that of the dynamics, 2",
        ),
        (
            guide(0, joints=["low"]),
            "structure.guides[0].joints: it should be those whose servos follow it, in the arm's order: low, high",
        ),
        (
            guide(0, joints=["high", "low"]),
            "structure.guides[0].joints: it should be those whose servos follow it, in the arm's order: low, high",
        ),
        (
            command(0, guide="top"),
            "structure.guides[0].joints: it should be those whose servos follow it, in the arm's order: high",
        ),
        (
            lambda e: (command(2, guide="top")(e), e["structure"]["guides"].pop()),
            "structure.servos[2].command.guide: there is no guide `top`",
        ),
        (command(2, kind="rate"), "structure.servos[2].command.kind: a together gives no command `rate`, but position"),
        (command(2, model="ramp"), "structure.servos[2].command.model: a command that follows a guide has none"),
        (
            course(0, component="w"),
            "structure.guides[0].courses[0].component: it should be one of x, y, z, roll, pitch, yaw, in this order",
        ),
        (
            course(1, component="x"),
            "structure.guides[0].courses[1].component: it should be one of x, y, z, roll, pitch, yaw, in this order",
        ),
        (
            lambda e: e["structure"]["guides"][1].update(courses=[{"component": "x", "model": "ramp"}]),
            "structure.guides[1].courses[0].component: this guide has no path",
        ),
        (value("tip.x.values", [0.0]), "parameters.guides.tip.x.values: there are 1 for 2 times"),
        (value("tip.x.times", [1.0, 0.0]), "parameters.guides.tip.x.times: they do not rise"),
        (value("tip.link", {"word": "tow"}), "parameters.guides.tip.link.value: it should name one of the arm's links"),
        (value("tip.link", {"word": "one"}), "parameters.guides.tip.link: joint `high` does not carry link `one`"),
        (
            value("tip.guides", {"word": "zz"}),
            "parameters.guides.tip.guides.value: it should be a word: pose, position, xy, xz, yz",
        ),
        (value("tip.guides", {"word": "xz"}), "parameters.guides.tip.y: this component is not guided"),
        (value("tip.guides", {"word": "pose"}), "parameters.guides.tip: there are 2 joints for 6 components"),
        (value("tip.low.max_rate", 0.0), "parameters.guides.tip.low.max_rate.value: it should be above 0"),
        (
            lambda e: e["parameters"]["guides.move.out.to"].update(unit="rad"),
            "parameters.guides.move.out.to.unit: it should be m",
        ),
        (
            lambda e: e["structure"]["record"][1].update(channels=["guides.tip.eror"]),
            "structure.record[1].channels: there is no channel `guides.tip.eror`",
        ),
    ],
)
def test_what_a_plan_says_wrong_of_guides_is_placed(change: Change, said: str, tmp_path: Path) -> None:
    document = json.loads(text(tmp_path))
    change(document["experiments"][0])
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    assert caught.value.diagnostics[0].message == f"the plan p.json is damaged: experiments[0].{said}"


@pytest.mark.parametrize(
    ("path", "what"), [("guides.tip.speed", "guides.tip.link"), ("guides.tip.low.max_rat", "guides.tip.low.max_rate")]
)
def test_a_parameter_that_no_guide_has_is_told(path: str, what: str, tmp_path: Path) -> None:
    document = json.loads(text(tmp_path))
    parameters = document["experiments"][0]["parameters"]
    parameters[path] = parameters[what]
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    (diagnostic,) = caught.value.diagnostics
    assert (diagnostic.code, diagnostic.message) == (
        "E304",
        f"p.json: run `it`: parameter `{path}` is none of its model's",
    )


def test_a_parameter_that_is_missing_takes_its_default(tmp_path: Path) -> None:
    document = json.loads(text(tmp_path))
    experiment = document["experiments"][0]
    experiment["parameters"].pop("guides.tip.gain")
    experiment["parameters"].pop("guides.tip.high.max_rate")
    (read,) = plan_file.loads(json.dumps(document), "p.json").experiments
    assert (read.parameters["guides.tip.gain"].value, read.parameters["guides.tip.high.max_rate"].value) == (
        1.0,
        float("inf"),
    )
    assert read.notes[-2:] == (
        "`guides.tip.gain` is not in the plan (schema 1): its default, 1.0 1/s, is taken",
        "`guides.tip.high.max_rate` is not in the plan (schema 1): its default, inf rad/s, is taken",
    )
