"""Plans with payloads: files of them, keys, and what is said of one that somebody changed by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ic
from met import run as engine
from met.diagnostic import Problem
from met.plan import Payload, Plan
from met.plan import file as plan_file
from met.plan.keys import inputs, structure_key
from tests.ic.small_decks import changed
from tests.met.program.free_flyers import ARM
from tests.met.program.payload_decks import BOX, RUN

HELD = """\
    payload crate { mass = 3 kg;  shape = sphere(radius = 0.1 m);  on = upper;  rpy = [0, 0, 90] deg; }
"""
TWO = changed(RUN, (BOX, BOX + HELD))
SWEEP = "sweep some of tumbling { zip { payloads.box.mass = [12, 14] kg;  payloads.box.grapple = [0.8, 0.9] s; } }\n"


def plan(text: str = TWO, **options: object) -> Plan:
    return ic.compile(text=ARM + text, **options)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_plan_file_keeps_payloads_and_runs_without_the_deck(tmp_path: Path) -> None:
    made = plan(TWO + SWEEP, select=["some"])
    plan_file.write(made, tmp_path / "p.json")
    again = plan_file.read(tmp_path / "p.json")
    assert again.experiments[0].structure == made.experiments[0].structure
    assert again.experiments[0].parameters == made.experiments[0].parameters
    one, other = (engine.run(each.experiments[0]) for each in (made, again))
    for name in one.signals:
        assert one.signals[name].tobytes() == other.signals[name].tobytes(), name
    assert np.max(np.abs(one.signals["qd"][0] - one.signals["qd"][1])) > 0.1


def test_the_key_of_an_arm_without_payloads_is_what_it_was_and_others_have_their_own() -> None:
    two = plan().experiments[0].structure
    without = replace(two, payloads=())
    assert "payloads" not in plan_file.encode(type(without), without)
    box, crate = two.payloads
    some = (
        without,
        two,
        replace(two, payloads=(box,)),
        replace(two, payloads=(replace(box, released=False), crate)),
        replace(two, payloads=(replace(box, link="upper"), crate)),
    )
    assert len({structure_key(each) for each in some}) == len(some)
    drawn = replace(two, payloads=(replace(box, shape=None, place=None), crate))
    assert structure_key(drawn) == structure_key(two)


def test_a_mass_that_varies_is_an_input_of_the_program() -> None:
    made = plan(TWO + SWEEP, select=["some"]).experiments[0]
    assert {"payloads.box.mass", "payloads.box.grapple"} <= set(inputs(made))


Change = Callable[[dict[str, Any]], Any]


def box(**new: Any) -> Change:
    return lambda e: e["structure"]["payloads"][0].update(new)


def value(path: str, to: object) -> Change:
    return lambda e: e["parameters"][f"payloads.{path}"].update(value=to)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (box(name="upper"), "structure.payloads[0].name: `upper` is there twice"),
        (box(name="world"), "structure.payloads[0].name: `world` is there twice"),
        (box(name="crate"), "structure.payloads[1].name: `crate` is there twice"),
        (box(name="a box"), "structure.payloads[0].name: 'a box' is no name: letters, digits and _"),
        (box(link="hook"), "structure.payloads[0].link: there is no link `hook`"),
        (box(grappled="yes"), "structure.payloads[0].grappled: it should be true or false"),
        (
            lambda e: (e["structure"].update(velocity_products=False), e["structure"].pop("base")),
            "structure.velocity_products: a payload that flies needs them",
        ),
        (value("box.mass", 0.0), "parameters.payloads.box.mass: what flies has mass"),
        (
            value("box.inertia.xx", 0.0),
            "parameters.payloads.box.inertia: a principal moment is not above 0: what flies turns about all axes",
        ),
        (value("box.release", 0.8), "parameters.payloads.box.release: it is not after `grapple`"),
        (value("crate.mass", -1.0), "parameters.payloads.crate.mass: it should be at least 0"),
        (
            value("crate.inertia.xy", 9.0),
            "parameters.payloads.crate.inertia: a principal moment is below 0: no body has that",
        ),
        (
            lambda e: e["parameters"]["payloads.box.rate.x"].update(unit="m/s"),
            "parameters.payloads.box.rate.x.unit: it should be rad/s",
        ),
        (
            lambda e: e["parameters"].update({"payloads.box.colour": e["parameters"]["payloads.box.mass"]}),
            "parameters.payloads.box.colour: nothing in this run has this parameter",
        ),
    ],
)
def test_a_plan_that_somebody_broke_is_told(tmp_path: Path, change: Change, said: str) -> None:
    plan_file.write(plan(), tmp_path / "p.json")
    document = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))
    change(document["experiments"][0])
    (tmp_path / "p.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(Problem) as caught:
        plan_file.read(tmp_path / "p.json")
    (told,) = caught.value.diagnostics
    assert said in told.message, told.message


def test_a_parameter_that_is_missing_is_told(tmp_path: Path) -> None:
    plan_file.write(plan(), tmp_path / "p.json")
    document = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))
    del document["experiments"][0]["parameters"]["payloads.box.velocity.y"]
    (tmp_path / "p.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(Problem) as caught:
        plan_file.read(tmp_path / "p.json")
    assert [each.code for each in caught.value.diagnostics] == ["E304"]


def test_what_flies_is_what_is_grappled_or_released() -> None:
    flags = [(False, False), (True, False), (False, True), (True, True)]
    assert [Payload("box", "hand", *each).flies for each in flags] == [False, True, True, True]
