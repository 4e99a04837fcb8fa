"""Sensors of links in plans that somebody changed by hand: whatever is wrong with one is placed."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from met import models
from met.diagnostic import Problem
from met.plan import file as plan_file
from tests.ic.small_decks import check, messages

DECK = """\
arm swing {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
}
servo drive { model = ideal; bandwidth = 5 1/s; command = rate(0.1 rad/s); sensor qd = tachometer { } }
run it {
    arm = swing;
    servos { hinge = drive; }
    sensor up   = accelerometer { link = bar; along = [0, 0, 1]; cutoff = 20 Hz; rate = 100 Hz; }
    sensor spin = gyroscope { link = base; along = [0, 0, 1]; filter = butterworth; cutoff = 20 Hz; }
    rates { dynamics = 500 Hz; servos = 500 Hz; record = 100 Hz; base = 1 kHz; }
    duration = 1 s;
    record = [q, sensors];
}
"""
Change = Callable[[dict[str, Any]], Any]


def text(folder: Path) -> str:
    compiled = check(folder, DECK)
    assert compiled.plan is not None, messages(compiled)
    return plan_file.dumps(compiled.plan)


def sensor(number: int, **new: Any) -> Change:
    return lambda e: e["structure"]["sensors"][number].update(new)


def value(path: str, new: Any) -> Change:
    return lambda e: e["parameters"][f"sensors.{path}"].update(value=new)


def test_a_plan_with_sensors_is_read_as_it_was_written(tmp_path: Path) -> None:
    written = text(tmp_path)
    assert plan_file.dumps(plan_file.loads(written, "p.json")) == written


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (sensor(0, name="an up"), "structure.sensors[0].name: 'an up' is no name: letters, digits and _"),
        (sensor(1, name="up"), "structure.sensors[1].name: `up` is there twice"),
        (sensor(0, divisor=0), "structure.sensors[0].divisor: it should be a whole number from 1 to 1000000000000"),
        (sensor(0, divisor=3), "structure.sensors[0].divisor: it should be a multiple of that of the dynamics, 2"),
        (
            sensor(0, model="encoder"),
            "structure.sensors[0].model: `encoder` is a sensor of a joint: it stands in a servo",
        ),
        (sensor(1, words=[["filtr", "none"]]), "structure.sensors[1].words: `gyroscope` has no word `filtr`"),
        (sensor(0, words=[["link", "bar"]]), "structure.sensors[0].words: `accelerometer` has no word `link`"),
        (
            lambda e: e["structure"]["servos"][0]["sensors"][0].update(model="gyroscope"),
            "structure.servos[0].sensors[0].model: `gyroscope` is a sensor of a link: it stands in a run",
        ),
        (value("up.link", {"word": "bra"}), "parameters.sensors.up.link.value: it should name one of the arm's links"),
        (
            value("up.link", {"word": "world"}),
            "parameters.sensors.up.link.value: it should name one of the arm's links",
        ),
        (
            value("spin.filter", {"word": "none"}),
            "parameters.sensors.spin.filter: it should be butterworth, as the structure says",
        ),
        (value("up.cutoff", 0.0), "parameters.sensors.up.cutoff.value: it should be above 0"),
        (value("up.along.z", 0.0), "parameters.sensors.up.along: it has no direction"),
        (
            lambda e: e["parameters"]["sensors.up.noise"].update(unit="m/s"),
            "parameters.sensors.up.noise.unit: it should be m/s^2",
        ),
        (
            lambda e: e["structure"]["record"][1].update(channels=["sensors.pu"]),
            "structure.record[1].channels: there is no channel `sensors.pu`",
        ),
    ],
)
def test_what_a_plan_says_wrong_of_sensors_is_placed(change: Change, said: str, tmp_path: Path) -> None:
    document = json.loads(text(tmp_path))
    change(document["experiments"][0])
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    assert caught.value.diagnostics[0].message == f"the plan p.json is damaged: experiments[0].{said}"


def test_a_parameter_that_no_sensor_has_is_told_and_one_that_is_missing_takes_its_default(tmp_path: Path) -> None:
    document = json.loads(text(tmp_path))
    parameters = document["experiments"][0]["parameters"]
    parameters.pop("sensors.up.noise")
    assert plan_file.loads(json.dumps(document), "p.json").experiments[0].parameters["sensors.up.noise"].value == 0.0
    parameters["sensors.up.nois"] = parameters["sensors.up.bias"]
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    (diagnostic,) = caught.value.diagnostics
    assert (diagnostic.code, diagnostic.message) == (
        "E304",
        "p.json: run `it`: parameter `sensors.up.nois` is none of its model's",
    )


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ("", "unit `` ends too early"),
        ("m/ss", "unit `m/ss`: `ss` is not a unit"),
    ],
)
def test_a_sensor_of_a_link_says_in_which_unit_it_measures(
    unit: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = replace(models.find("sensor", "gyroscope"), name="mine", unit=unit)
    point = SimpleNamespace(name="mine", value="my_arm:MODEL", package="my-arm", load=lambda: model)
    monkeypatch.setattr(models, "offered", lambda group: [point] if group == "met.sensors" else [])
    with pytest.raises(Problem) as caught:
        models.available.__wrapped__("sensor")
    [diagnostic] = caught.value.diagnostics
    head = "entry point `mine = my_arm:MODEL` of my-arm in group `met.sensors` measures something with "
    assert diagnostic.code == "E215" and diagnostic.message.startswith(head + said)
