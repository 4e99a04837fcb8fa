"""Plans that somebody changed by hand: whatever is wrong in one is placed, and what is let through is sound."""

import copy
import json
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import pytest

from met.diagnostic import Problem
from met.plan import file as plan_file
from tests.batch import plans

Change = Callable[[dict[str, Any]], Any]


@cache
def text() -> str:
    return plan_file.dumps(plans.plan(plans.gains(3)))


def said_of(change: Change) -> str:
    """What is said of a plan after this change of its only experiment."""
    document = json.loads(text())
    change(document["experiments"][0])
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    [diagnostic] = caught.value.diagnostics
    assert diagnostic.code == "E302"
    return diagnostic.message.removeprefix("the plan p.json is damaged: experiments[0].")


def value(path: str, new: Any) -> Change:
    return lambda e: e["parameters"][path].update(value=new)


def structure(part: str, **new: Any) -> Change:
    """Change the second link, joint, servo ... or the first metric and record."""
    index = 1 if part in ("links", "joints", "servos") else 0
    return lambda e: e["structure"][part][index].update(new)


def schedule(**new: Any) -> Change:
    return lambda e: e["structure"]["schedule"].update(new)


def coordinate(**new: Any) -> Change:
    return lambda e: e["cases"]["coordinates"][0].update(new)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (value("links.upper.mass", {"word": "heavy"}), "parameters.links.upper.mass.value: it should be a number"),
        (value("links.upper.mass", [40.0]), "parameters.links.upper.mass.value: it should be a number"),
        (value("links.upper.mass", -40.0), "parameters.links.upper.mass: it should be at least 0"),
        (value("links.upper.mass", "inf"), "parameters.links.upper.mass.value: it is not finite"),
        (
            value("links.upper.inertia.xx", -1.0),
            "parameters.links.upper.inertia: a principal moment is below 0: no body has that",
        ),
        (
            value("links.upper.inertia.xy", 99.0),
            "parameters.links.upper.inertia: a principal moment is below 0: no body has that",
        ),
        (value("elbow.axis.z", 0.0), "parameters.elbow.axis: its length should be 1"),
        (value("elbow.axis.x", 1.0), "parameters.elbow.axis: its length should be 1"),
        (
            value("elbow.servo.ratio", {"formula": 3}),
            "parameters.elbow.servo.ratio.value: there is no formula 3, but 3 of them",
        ),
        (
            value("elbow.servo.ratio", {"formula": -1}),
            "parameters.elbow.servo.ratio.value: there is no formula -1, but 3 of them",
        ),
        (value("elbow.servo.resistance", -2.0), "parameters.elbow.servo.resistance.value: it should be above 0"),
        (
            lambda e: e["parameters"]["elbow.servo.kt"].update(unit="V"),
            "parameters.elbow.servo.kt.unit: it should be N*m/A",
        ),
        (
            lambda e: e["parameters"]["links.upper.mass"].update(unit="g"),
            "parameters.links.upper.mass.unit: it should be kg",
        ),
        (
            lambda e: e["parameters"].update({"links.ghost.mass": e["parameters"]["links.upper.mass"]}),
            "parameters.links.ghost.mass: nothing in this run has this parameter",
        ),
        (
            lambda e: e["parameters"].update({"wrist.at.x": e["parameters"]["elbow.at.x"]}),
            "parameters.wrist.at.x: nothing in this run has this parameter",
        ),
        (structure("metrics", of="shoulder.speed"), "structure.metrics[0].of: there is no channel `shoulder.speed`"),
        (
            structure("record", channels=["shoulder.q", "elbow.speed"]),
            "structure.record[0].channels: there is no channel `elbow.speed`",
        ),
        (
            structure("record", joints=["elbow", "shoulder"]),
            "structure.record[0].channels: `q` of these joints is elbow.q, shoulder.q",
        ),
        (structure("record", joints=["shoulder"]), "structure.record[0].channels: `q` of these joints is shoulder.q"),
        (structure("record", joints=[]), "structure.record[0].channels: `q` of these joints is q"),
        (
            structure("record", name="time"),
            "structure.record[0].channels: `time` of these joints is shoulder.time, elbow.time",
        ),
        (
            structure("record", components=["x", "y"]),
            "structure.record[0].components: it should be x, y, z or w, x, y, z",
        ),
        (
            structure("record", components=["x", "y", "z"]),
            "structure.record[0].channels: `q` of these joints is "
            "shoulder.q.x, shoulder.q.y, shoulder.q.z, elbow.q.x, elbow.q.y, elbow.q.z",
        ),
        (structure("record", unit=[]), "structure.record[0].unit: it should be one unit, or one a channel"),
        (
            lambda e: e["structure"]["record"].append(e["structure"]["record"][0]),
            "structure.record[4].name: `q` is there twice",
        ),
        (
            structure("servos", command={"kind": "voltage", "model": "constant"}),
            "structure.servos[1].command.kind: rigid_gearbox takes no command `voltage`, but rate, position, torque",
        ),
        (structure("servos", command=None), "structure.servos[1].command: a rigid_gearbox needs one"),
        (structure("servos", joint="wrist"), "structure.servos[1].joint: there is no joint `wrist`"),
        (structure("servos", joint="shoulder"), "structure.servos[1].joint: joint `shoulder` has a servo already"),
        (
            structure("servos", divisor=0),
            "structure.servos[1].divisor: it should be a whole number from 1 to 1000000000000",
        ),
        (structure("joints", kind="fixed"), "structure.servos[1].joint: joint `elbow` is fixed"),
        (structure("joints", parent="lower"), "structure.joints[1].parent: link `lower` hangs on itself"),
        (
            structure("joints", child="upper", parent="lower"),
            "structure.joints[1].child: link `upper` is another joint's child already",
        ),
        (
            lambda e: e["structure"]["joints"][0].update(parent="lower"),
            "structure.joints[0].parent: link `upper` hangs on itself",
        ),
        (structure("joints", child="base"), "structure.joints[1].child: there is no link `base`"),
        (structure("joints", name="shoulder"), "structure.joints[1].name: `shoulder` is there twice"),
        (structure("links", name="upper"), "structure.links[1].name: `upper` is there twice"),
        (structure("links", name="a/b"), "structure.links[1].name: 'a/b' is no name: letters, digits and _"),
        (lambda e: e["structure"]["joints"].pop(), "structure.links[1]: no joint holds link `lower`"),
        (lambda e: e["structure"].update(links=[], joints=[]), "structure.links: there is none"),
        (schedule(base_hz=0.0), "structure.schedule.base_hz: it should be above 0, and finite"),
        (schedule(base_hz="inf"), "structure.schedule.base_hz: it should be above 0, and finite"),
        (schedule(base_hz="nan"), "structure.schedule.base_hz: it should be above 0, and finite"),
        (schedule(ticks=-1), "structure.schedule.ticks: it should be a whole number from 0 to 1000000000000"),
        (schedule(ticks=10**13), "structure.schedule.ticks: it should be a whole number from 0 to 1000000000000"),
        (schedule(dynamics=0), "structure.schedule.dynamics: it should be a whole number from 1 to 1000000000000"),
        (lambda e: e["cases"].update(seed=-1), f"cases.seed: it should be a whole number from 0 to {2**63 - 1}"),
        (lambda e: e["cases"].update(seed=2**63), f"cases.seed: it should be a whole number from 0 to {2**63 - 1}"),
        (lambda e: e["cases"].update(count=4), "cases.coordinates[0].values: there are 3 for 4 cases"),
        (coordinate(path="gearbox.ki"), "cases.coordinates[0].path: no formula follows `gearbox.ki`"),
        (coordinate(path="links.lower.mass", sets=[]), "cases.coordinates[1].path: `links.lower.mass` is there twice"),
        (coordinate(path="a/b"), "cases.coordinates[0].path: 'a/b' is no path"),
        (coordinate(scale=0.0), "cases.coordinates[0].scale: it should be above 0, and finite"),
        (coordinate(sets=["elbow.servo.kpp"]), "cases.coordinates[0].sets: there is no parameter `elbow.servo.kpp`"),
        (lambda e: e["formulas"]["inputs"].append("gearbox.ki"), "formulas.inputs[2]: no coordinate is `gearbox.ki`"),
        (
            lambda e: e["formulas"]["nodes"].__setitem__(0, ["const", "many"]),
            "formulas.nodes[0]: it is not a formula's node",
        ),
        (lambda e: e["formulas"]["nodes"].append(["and", 0, 2]), "formulas.nodes[6]: it is not a formula's node"),
        (lambda e: e["requirements"][0].update(limit="nan"), "requirements[0].limit: it is not a number"),
        (
            lambda e: e["requirements"][1].update(text="settle < 10 s"),
            "requirements[1].text: another requirement has the same text",
        ),
        (
            lambda e: e["cases"]["coordinates"][1].update(values=[20.0, -0.1, 20.0]),
            "parameters.links.lower.mass: it should be at least 0; in case #1",
        ),
        (lambda e: e.update(name="a/b"), "name: 'a/b' is no name: letters, digits and _"),
        (lambda e: e["structure"].update(arm="a\0b"), "structure.arm: a null character is in it"),
        (lambda e: e["requirements"][0].update(text="\ud800"), "requirements[0].text: half of a character is in it"),
    ],
)
def test_what_is_wrong_is_said_with_its_path(change: Change, said: str) -> None:
    assert said_of(change) == said


def test_a_name_that_is_there_twice_is_refused() -> None:
    document = json.loads(text())
    document["experiments"] *= 2
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    assert caught.value.diagnostics[0].message.endswith("experiments[1].name: `gains` is there twice")


def test_a_plan_without_an_experiment_is_refused() -> None:
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps({**json.loads(text()), "experiments": []}), "p.json")
    assert caught.value.diagnostics[0].message.endswith("experiments: there is none")


@pytest.mark.parametrize(("times", "values"), [([], []), ([0.0, 1.0], [0.1]), ([1.0, 1.0], [0.1, 0.2])])
def test_a_table_of_a_command_is_one(times: list[float], values: list[float]) -> None:
    def change(e: dict[str, Any]) -> None:
        e["structure"]["servos"][1]["command"]["model"] = "table"
        given = e["parameters"].pop("elbow.servo.command.value")
        e["parameters"]["elbow.servo.command.times"] = {**given, "value": times, "unit": "s"}
        e["parameters"]["elbow.servo.command.values"] = {**given, "value": values}

    assert said_of(change).startswith("parameters.elbow.servo.command.")


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ([0.0], "values: there are 1 for 1 times, and 2 are needed"),
        ([1.0, 1.0], "times: they do not rise"),
        ([0.0, "inf"], "times.value: one of its numbers is not finite"),
        ([0.0, "nan"], "times.value: one of its numbers is not finite"),
    ],
)
def test_a_trajectory_has_two_points_or_more(times: list[float | str], said: str) -> None:
    def change(e: dict[str, Any]) -> None:
        e["structure"]["servos"][1]["command"]["model"] = "trajectory"
        given = e["parameters"].pop("elbow.servo.command.value")
        e["parameters"]["elbow.servo.command.times"] = {**given, "value": times, "unit": "s"}
        e["parameters"]["elbow.servo.command.values"] = {**given, "value": times}

    assert said_of(change) == "parameters.elbow.servo.command." + said


@pytest.mark.parametrize(
    ("pivot", "said"),
    [
        ({"x": 1.0}, "pivot: it is made of three numbers, .x .y .z"),
        ({"x": 1.0, "y": 0.0, "z": "inf"}, "pivot.z.value: it is not finite"),
        ({"x": 1.0, "y": 0.0, "z": 0.0, "w": 0.0}, "pivot.w: nothing in this run has this parameter"),
    ],
)
def test_a_pivot_is_three_numbers(pivot: dict[str, Any], said: str) -> None:
    def change(e: dict[str, Any]) -> None:
        given = e["parameters"]["elbow.at.x"]
        e["parameters"] |= {f"elbow.pivot.{axis}": {**given, "value": x} for axis, x in pivot.items()}

    assert said_of(change) == "parameters.elbow." + said


def leaves(part: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where anything stands in a document, besides the deck's text, origins, and what is there twice."""
    if path:
        yield path
    for key, inner in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        if key not in ("origin", "place", "sources") and not str(key).startswith(("shoulder.", "links.upper")):
            yield from leaves(inner, (*path, key))


@pytest.mark.release
def test_whatever_is_put_anywhere_is_a_problem_or_a_plan_that_makes_a_program() -> None:
    """Every value of a plan in turn is replaced by values of every type."""
    from met.program import build

    document = json.loads(text())
    odd = (None, -1, 0.5, "nan", "elbow", [1], {"word": "x"})
    read = 0
    for path in leaves(document):
        for new in odd:
            changed = copy.copy(document)
            part: Any = changed
            for key in path[:-1]:
                part[key] = copy.copy(part[key])
                part = part[key]
            part[path[-1]] = new
            try:
                plan = plan_file.loads(json.dumps(changed), "p.json")
            except Problem:
                continue
            read += 1
            if path[0] == "experiments" and "parameters" not in path:
                build(plan.experiments[0])
    assert read > 100  # some parameters may well be 0 or -2.5


def test_a_value_that_a_sweep_takes_out_of_its_bounds_is_refused() -> None:
    negative = coordinate(values=[0.01, -0.02, 0.03])
    assert said_of(negative) == "parameters.shoulder.servo.kp: it should be at least 0; in case #1"
