"""Plans as files: what is written comes back to the bit, and what cannot be read is refused in words."""

import codecs
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from met.diagnostic import Expansion, Place, Problem
from met.plan import Experiment, Origin, Plan, Quantity
from met.plan import file as plan_file
from met.plan.codec import Damaged, decode, encode
from met.trace.graph import Formulas
from tests.batch import plans


def messages(caught: pytest.ExceptionInfo[Problem]) -> list[str]:
    return [f"{d.code}: {d.message}" for d in caught.value.diagnostics]


def same(a: Plan, b: Plan) -> bool:
    """Equality field by field; a coordinate's values are an array."""
    for mine, theirs in zip(a.experiments, b.experiments, strict=True):
        for one, other in zip(mine.cases.coordinates, theirs.cases.coordinates, strict=True):
            if one.values.tobytes() != other.values.tobytes() or replace(one, values=None) != replace(
                other, values=None
            ):
                return False
        bare = [replace(e, cases=replace(e.cases, coordinates=())) for e in (mine, theirs)]
        if bare[0] != bare[1]:
            return False
    return replace(a, experiments=()) == replace(b, experiments=())


def test_a_plan_comes_back_equal(tmp_path: Path) -> None:
    plan = plans.plan(plans.nominal(), plans.gains(20))
    plan_file.write(plan, tmp_path / "p.json")
    assert same(plan_file.read(tmp_path / "p.json"), plan)


def test_a_byte_order_mark_is_no_part_of_a_plan(tmp_path: Path) -> None:
    plan_file.write(plans.plan(plans.nominal()), tmp_path / "a.json")
    (tmp_path / "b.json").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "a.json").read_bytes())
    assert plan_file.read(tmp_path / "b.json") == plan_file.read(tmp_path / "a.json")


def test_writing_what_was_read_gives_the_same_bytes(tmp_path: Path) -> None:
    plan_file.write(plans.plan(plans.gains(9)), tmp_path / "a.json")
    plan_file.write(plan_file.read(tmp_path / "a.json"), tmp_path / "b.json")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


@pytest.mark.parametrize("value", [0.1, 1 / 3, 5e-324, -0.0, 1.7976931348623157e308, math.inf, -math.inf, math.nan])
def test_every_double_comes_back_to_the_bit(value: float) -> None:
    experiment = plans.nominal()
    parameters = {**experiment.parameters, "metrics.settle.target": Quantity(value, "rad/s", plans.DECK)}
    text = json.dumps(encode(Experiment, replace(experiment, parameters=parameters)), allow_nan=False)
    back = decode(Experiment, json.loads(text)).parameters["metrics.settle.target"].value
    assert np.float64(back).tobytes() == np.float64(value).tobytes()


def test_words_and_lists_are_not_taken_for_numbers() -> None:
    experiment = plans.nominal()
    odd = {"word": Quantity("nan", "1", plans.DECK), "list": Quantity((1.0, math.inf), "s", plans.DECK)}
    back = decode(Experiment, encode(Experiment, replace(experiment, parameters=odd))).parameters
    assert back["word"].value == "nan"
    assert back["list"].value == (1.0, math.inf)


def test_the_origin_of_a_value_keeps_its_macros_and_includes() -> None:
    use = Place("main.ic", 9, 3, 3)
    place = Place("rods.ic", 4, 17, 2, (Expansion("ROD", use),), (("main.ic", 1),))
    origin = Origin("deck", place, (Place("old.ic", 1, 1),), "note")
    experiment = plans.nominal()
    parameters = {**experiment.parameters, "links.upper.mass": Quantity(40.0, "kg", origin)}
    plan = plans.plan(replace(experiment, parameters=parameters))
    back = plan_file.loads(plan_file.dumps(plan)).experiments[0].parameters["links.upper.mass"].origin
    assert back == origin


NODES = [["const", 0.5], ["input", "x"]]


@pytest.mark.parametrize("node", [
    ["bit", 2, 0], ["bit", 2, 63], ["flip", 0, 2, 0], ["flip", 0, 2, 63], ["philox", *[0, 2] * 3, 0],
    ["philox", *[0, 2] * 3, 3], ["gather", 2, [1.0]], ["gather", 2, [1.0, 2.0, 3.0]], ["add", 0, 3], ["const", "nan"],
])  # fmt: skip
def test_a_formula_s_node_has_what_its_operation_needs_behind_its_operands(node: list[Any]) -> None:
    back = decode(Formulas, {"inputs": ["x"], "nodes": [*NODES, node], "outputs": [4]})
    assert encode(Formulas, back)["nodes"][-1] == node


@pytest.mark.parametrize("node", [
    ["bit", 2], ["bit", 2, -1], ["bit", 2, 64], ["bit", 2, 1.0], ["bit", 2, 0, 0], ["flip", 0, 2], ["flip", 0, 2, 64],
    ["philox", *[0, 2] * 3], ["philox", *[0, 2] * 3, -1], ["philox", *[0, 2] * 3, 4], ["philox", *[0, 2] * 3, 1.0],
    ["philox", *[0, 2] * 3, 0, 0], ["gather", 2], ["gather", 2, []], ["gather", 2, 1.0], ["gather", 2, ["x"]],
    ["gather", 2, [1.0], 0], ["add", 0, 3, 0], ["const", "x"], ["const", 1.0, 2.0], ["input", 1], ["input", "x", "y"],
])  # fmt: skip
def test_a_formula_s_node_with_anything_else_behind_its_operands_is_damage(node: list[Any]) -> None:
    with pytest.raises(Damaged, match=r"nodes\[2\]: it is not a formula's node"):
        decode(Formulas, {"inputs": ["x"], "nodes": [*NODES, node], "outputs": [4]}, "formulas")


def test_formulas_replay_as_before() -> None:
    experiment = plans.gains(6)
    back = plan_file.loads(plan_file.dumps(plans.plan(experiment))).experiments[0]
    values = {c.path: c.values for c in experiment.cases.coordinates}
    for mine, theirs in zip(experiment.formulas.replay(values), back.formulas.replay(values), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_a_large_case_table_lies_beside_the_plan(tmp_path: Path) -> None:
    plan = plans.plan(plans.gains(plan_file.LISTED_ROWS + 1))
    files = plan_file.write(plan, tmp_path / "p.json")
    assert [file.name for file in files] == ["p.gains.cases.npy", "p.json"]
    assert (tmp_path / "p.json").stat().st_size < 100_000  # the table itself is 160 kB
    assert same(plan_file.read(tmp_path / "p.json"), plan)


def test_another_case_table_is_noticed(tmp_path: Path) -> None:
    plan_file.write(plans.plan(plans.gains(10_001)), tmp_path / "p.json")
    table = tmp_path / "p.gains.cases.npy"
    data = bytearray(table.read_bytes())
    data[-1] ^= 1
    table.write_bytes(data)
    with pytest.raises(Problem) as caught:
        plan_file.read(tmp_path / "p.json")
    assert messages(caught) == [
        f"E302: the plan {tmp_path}/p.json is damaged: the case table p.gains.cases.npy beside it is not the one it "
        "was written with (SHA-256 differs)"
    ]


def test_a_missing_case_table_is_named(tmp_path: Path) -> None:
    plan_file.write(plans.plan(plans.gains(10_001)), tmp_path / "p.json")
    (tmp_path / "p.gains.cases.npy").unlink()
    with pytest.raises(Problem) as caught:
        plan_file.read(tmp_path / "p.json")
    assert messages(caught) == [
        f"E302: the plan {tmp_path}/p.json is damaged: its case table p.gains.cases.npy, which should lie beside it, "
        "cannot be read: no such file or directory"
    ]


def test_a_table_elsewhere_is_not_followed() -> None:
    plan = plans.plan(plans.gains(10_001))
    text = plan_file.dumps(plan, lambda *_: {"file": "../secret.npy", "row": 0, "sha256": ""})
    with pytest.raises(Problem) as caught:
        plan_file.loads(text, "p.json")
    assert caught.value.diagnostics[0].code == "E302"


def test_a_newer_plan_is_refused() -> None:
    document = json.loads(plan_file.dumps(plans.plan()))
    document["version"] = 3
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    assert messages(caught) == ["E303: p.json was written by a newer MET: plan schema 3, and this one reads up to 2"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda d: d["experiments"][0]["structure"]["joints"][1].update(kind="bendy"),
            "experiments[0].structure.joints[1].kind: it should be one of revolute, prismatic, fixed",
        ),
        (
            lambda d: d["experiments"][0]["structure"]["schedule"].update(ticks="many"),
            "experiments[0].structure.schedule.ticks: it should be a whole number",
        ),
        (lambda d: d["experiments"][0]["structure"].pop("arm"), "experiments[0].structure: `arm` is missing"),
        (lambda d: d["experiments"][0].update(colour="red"), "experiments[0]: `colour` is not known"),
        (
            lambda d: d["experiments"][0]["structure"]["joints"][1].update(parent="nowhere"),
            "experiments[0].structure.joints[1].parent: there is no link `nowhere`",
        ),
        (
            lambda d: d["experiments"][0]["structure"]["schedule"].update(record=0),
            "experiments[0].structure.schedule.record: it should be a whole number from 1 to 1000000000000",
        ),
        (
            lambda d: d["experiments"][0]["requirements"][0].update(metric="speed"),
            "experiments[0].requirements[0].metric: there is no metric `speed`",
        ),
        (
            lambda d: d["experiments"][0]["formulas"].update(nodes=[["add", 4, 6]], outputs=[0]),
            "experiments[0].formulas.nodes[0]: it is not a formula's node",
        ),
    ],
)
def test_damage_is_placed(change, said: str) -> None:  # type: ignore[no-untyped-def]
    document = json.loads(plan_file.dumps(plans.plan()))
    change(document)
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    assert messages(caught) == [f"E302: the plan p.json is damaged: {said}"]


@pytest.mark.parametrize("text", ["", "{", "[1, 2", "\0", "[" * 100_000, '{"schema": "met.plan", "version": NaN}'])
def test_what_is_not_json_is_refused_without_a_traceback(text: str) -> None:
    with pytest.raises(Problem) as caught:
        plan_file.loads(text, "p.json")
    assert caught.value.diagnostics[0].code == "E302"


def test_every_truncation_is_a_problem() -> None:
    text = plan_file.dumps(plans.plan(plans.gains(3)))
    for length in range(0, len(text) - 2, 97):
        with pytest.raises(Problem):
            plan_file.loads(text[:length])


def test_json_that_is_no_plan_is_said_so() -> None:
    with pytest.raises(Problem) as caught:
        plan_file.loads('{"a": 1}', "package.json")
    assert messages(caught) == ["E302: package.json is not a plan of MET"]


def test_a_parameter_that_an_older_plan_lacks_takes_its_default_and_is_listed() -> None:
    document = json.loads(plan_file.dumps(plans.plan()))
    del document["experiments"][0]["parameters"]["elbow.servo.k_position"]
    experiment = plan_file.loads(json.dumps(document)).experiments[0]
    assert experiment.parameters["elbow.servo.k_position"].value == 0.0
    assert experiment.parameters["elbow.servo.k_position"].origin.kind == "default"
    assert experiment.notes == (
        "`elbow.servo.k_position` is not in the plan (schema 1): its default, 0.0 1/s, is taken",
    )


def test_a_missing_parameter_without_a_default_is_an_error() -> None:
    document = json.loads(plan_file.dumps(plans.plan()))
    del document["experiments"][0]["parameters"]["elbow.servo.kt"]
    del document["experiments"][0]["parameters"]["links.upper.mass"]
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    assert messages(caught) == [
        "E304: p.json: run `nominal`: parameter `links.upper.mass` is missing and has no default",
        "E304: p.json: run `nominal`: parameter `elbow.servo.kt` is missing and has no default",
    ]


def test_a_parameter_that_no_model_has_is_an_error() -> None:
    document = json.loads(plan_file.dumps(plans.plan()))
    parameters = document["experiments"][0]["parameters"]
    parameters["elbow.servo.kpp"] = parameters["elbow.servo.kp"]
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(document), "p.json")
    assert messages(caught) == ["E304: p.json: run `nominal`: parameter `elbow.servo.kpp` is none of its model's"]
    assert caught.value.diagnostics[0].help[0] == "did you mean `elbow.servo.kp`?"


def test_a_plan_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(Problem) as caught:
        plan_file.read(tmp_path / "none.json")
    assert messages(caught) == [f"E301: cannot read the plan {tmp_path}/none.json: no such file or directory"]


def test_a_plan_is_written_over_by_the_next_and_so_are_its_tables(tmp_path: Path) -> None:
    for cases in (10_001, 10_002, 3):
        plan_file.write(plans.plan(plans.gains(cases)), tmp_path / "p.json")
        assert plan_file.read(tmp_path / "p.json").experiments[0].cases.count == cases


def test_a_plan_with_a_byte_order_mark_is_written_over(tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    plan_file.write(plans.plan(plans.gains(3)), path)
    path.write_bytes(codecs.BOM_UTF8 + path.read_bytes())
    assert plan_file.read(path).experiments[0].cases.count == 3
    plan_file.write(plans.plan(plans.gains(4)), path)
    assert plan_file.read(path).experiments[0].cases.count == 4


@pytest.mark.parametrize(
    "content", [b"run nominal { }", b"\x89HDF\r\n\x1a\n" + bytes(99), b'{"name": "left-pad"}', b"{", b"\xff\xfe"]
)
def test_what_is_no_plan_is_not_written_over(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "deck.ic").write_bytes(content)
    with pytest.raises(Problem) as caught:
        plan_file.write(plans.plan(plans.gains(10_001)), tmp_path / "deck.ic")
    assert messages(caught) == [f"E300: {tmp_path}/deck.ic exists and is no plan of MET: it is not written over"]
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("deck.ic", content)]


def test_a_table_of_somebody_elses_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "p.gains.cases.npy").write_bytes(b"mine")
    with pytest.raises(Problem) as caught:
        plan_file.write(plans.plan(plans.gains(10_001)), tmp_path / "p.json")
    assert "it exists, and is no case table of" in messages(caught)[0]
    assert [path.name for path in tmp_path.iterdir()] == ["p.gains.cases.npy"]


@pytest.mark.parametrize("target", ["", ".", "/"])
def test_a_plan_needs_a_name(target: str) -> None:
    with pytest.raises(Problem) as caught:
        plan_file.write(plans.plan(), target)
    assert caught.value.diagnostics[0].code == "E300"


def test_a_plan_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "p.json").mkdir()
    with pytest.raises(Problem) as caught:
        plan_file.write(plans.plan(), tmp_path / "p.json")
    assert messages(caught) == [f"E300: cannot write {tmp_path}/p.json: is a directory"]
    assert [path.name for path in tmp_path.iterdir()] == ["p.json"]
