"""Plans of arms on bases that move: files of them, keys, and what is said of one that somebody changed by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import ic
from met.diagnostic import Problem
from met.plan import Base, Course, Link, Plan
from met.plan import file as plan_file
from met.plan.keys import structure_key
from tests.ic.small_decks import changed
from tests.met.program.free_flyers import ARM, RUN

STATE = RUN[RUN.index("        base.position") : RUN.index("    }\n    environment")]
SHAKEN = changed(
    RUN,
    (STATE, ""),
    (
        "base     = free;",
        """\
base = prescribed {
        x   = sine(amplitude = 20 cm, frequency = 1 Hz);
        yaw = table(times = [0, 1] s, values = [0, 0] rad);
    }""",
    ),
)


def plan(text: str) -> Plan:
    return ic.compile(text=ARM + text)


@pytest.mark.parametrize("text", [RUN, SHAKEN], ids=["free", "prescribed"])
def test_a_plan_file_keeps_the_base(tmp_path: Path, text: str) -> None:
    made = plan(text)
    plan_file.write(made, tmp_path / "p.json")
    again = plan_file.read(tmp_path / "p.json")
    assert again.experiments[0].structure == made.experiments[0].structure
    assert again.experiments[0].parameters == made.experiments[0].parameters


def test_the_key_of_a_fixed_base_is_what_it_was_and_others_have_their_own() -> None:
    free = plan(RUN).experiments[0].structure
    fixed = replace(free, base=None)
    assert "base" not in plan_file.encode(type(fixed), fixed)
    told = replace(free, base=Base("prescribed", (Course("x", "sine"),)))
    other = replace(free, base=Base("prescribed", (Course("x", "chirp"),)))
    assert len({structure_key(each) for each in (free, fixed, told, other)}) == 4


Change = Callable[[dict[str, Any]], Any]


def base(**new: Any) -> Change:
    return lambda e: e["structure"]["base"].update(new)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "change", "said"),
    [
        (RUN, base(kind="loose"), "structure.base.kind: it should be one of prescribed, free"),
        (RUN, base(courses=[{"component": "x", "model": "sine"}]), "structure.base.courses: a free base has none"),
        (
            RUN,
            lambda e: e["structure"].update(velocity_products=False),
            "structure.velocity_products: a base that turns needs them",
        ),
        (
            RUN,
            lambda e: e["structure"].update(links=[link for link in e["structure"]["links"] if link["name"] != "base"]),
            "structure.base: there is no link `base`, and it moves",
        ),
        (
            RUN,
            lambda e: e["parameters"]["links.base.mass"].update(value=0.0),
            "parameters.links.base.mass: the base moves freely and has no mass",
        ),
        (
            RUN,
            lambda e: e["parameters"]["initial.base.rpy.x"].update(unit="m"),
            "parameters.initial.base.rpy.x.unit: it should be rad",
        ),
        (
            RUN,
            lambda e: e["structure"]["joints"][1].update(child="base"),
            "structure.joints[1].child: there is no link `base`",
        ),
        (
            SHAKEN,
            lambda e: e["structure"]["base"]["courses"].reverse(),
            "structure.base.courses[1].component: it should be one of x, y, z, roll, pitch, yaw, in this order",
        ),
        (
            SHAKEN,
            lambda e: e["structure"]["base"]["courses"][0].update(component="up"),
            "structure.base.courses[0].component: it should be one of x, y, z, roll, pitch, yaw, in this order",
        ),
        (
            SHAKEN,
            lambda e: e["parameters"]["base.yaw.times"].update(value=[1.0, 0.0]),
            "parameters.base.yaw.times: they do not rise",
        ),
        (
            SHAKEN,
            lambda e: e["parameters"]["base.x.frequency"].update(value=0.0),
            "parameters.base.x.frequency.value: it should be above 0",
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_path(text: str, change: Change, said: str) -> None:
    document = json.loads(plan_file.dumps(plan(text)))
    change(document["experiments"][0])
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.message.removeprefix("the plan p.json is damaged: experiments[0].") == said


def test_a_missing_number_of_the_base_is_told() -> None:
    document = json.loads(plan_file.dumps(plan(RUN)))
    del document["experiments"][0]["parameters"]["initial.base.rate.y"]
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.message == (
        "p.json: run `tumbling`: parameter `initial.base.rate.y` is missing and has no default"
    )


def test_a_link_named_base_may_stand_on_a_fixed_base() -> None:
    structure = plan(RUN).experiments[0].structure
    assert Link("base") in {replace(link, place=None, shape=None) for link in structure.links}
    assert structure.ground == ("base",)
