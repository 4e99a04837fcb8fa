"""Plans with motors on beds: as files, with parts missing or wrong, and what their keys depend on."""

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
from met.parameter import Memory
from met.plan import Experiment, Formula, Plan, Substitution, keys
from met.plan import file as plan_file
from met.substitution import BEDS, LAWS
from tests.batch import plans
from tests.ic.small_decks import ARM, RUN, SERVO, experiment

# ruff: noqa: E501 - messages are as wide as they are

Change = Callable[[dict[str, Any]], Any]
SWEEP = """\
run hybrid like hold { substitute hinge { bed = emulated(faults = typical, kt = 0.06 N*m/A); } }
sweep motors of hybrid { vary drive.resistance = [1, 2] ohm;  vary hinge.bed.i_max = [2, 3] A; }
"""


def on_beds(joints: tuple[str, ...] = ("shoulder", "elbow"), law: str = "torque_balance") -> Experiment:
    """Two links by hand, motors on beds, with the servos' and the models' defaults."""
    made = plans.gains(3)
    uses = tuple(Substitution(joint, "emulated", law) for joint in joints)
    made = replace(made, structure=replace(made.structure, substitutions=uses))
    return plan_file.completed(plans.plan(made)).experiments[0]


def document(found: Experiment) -> dict[str, Any]:
    made: dict[str, Any] = json.loads(plan_file.dumps(plans.plan(found)))
    return made


def said_of(change: Change) -> str:
    """What is said of a plan after this change of its only experiment."""
    told = document(on_beds())
    change(told["experiments"][0])
    with pytest.raises(Problem) as caught:
        plan_file.loads(json.dumps(told), "p.json")
    [diagnostic] = caught.value.diagnostics
    start = "the plan p.json is damaged: experiments[0]."
    return f"{diagnostic.code}: {diagnostic.message.removeprefix(start)}"


def substitution(**new: Any) -> Change:
    """Change the second joint that is on a bed."""
    return lambda e: e["structure"]["substitutions"][1].update(new)


@pytest.mark.slow
def test_a_plan_from_a_deck_reads_back_as_it_was(tmp_path: Path) -> None:
    swept = experiment(tmp_path, ARM, SERVO, RUN, SWEEP, select=["motors"])
    text = plan_file.dumps(Plan("deck.ic", (swept,)))
    (back,) = plan_file.loads(text).experiments
    assert back.structure.substitutions == swept.structure.substitutions
    assert back.parameters == swept.parameters and back.notes == swept.notes
    assert plan_file.dumps(Plan("deck.ic", (back,))) == text
    assert not any("faults" in path for path in back.parameters)


@pytest.mark.slow
def test_a_parameter_that_is_missing_is_the_servos_or_the_models_default(tmp_path: Path) -> None:
    swept = experiment(tmp_path, ARM, SERVO, RUN, SWEEP, select=["motors"])
    told = json.loads(plan_file.dumps(Plan("deck.ic", (swept,))))
    for path in ("hinge.bed.resistance", "hinge.bed.tau_max", "hinge.bed.lobes", "hinge.law.gain"):
        del told["experiments"][0]["parameters"][path]
    told["experiments"][0]["cases"]["coordinates"][0]["sets"].remove("hinge.bed.resistance")  # as written before it was
    (back,) = plan_file.loads(json.dumps(told)).experiments
    assert isinstance(back.parameters["hinge.bed.resistance"].value, Formula)
    for name in ("resistance", "tau_max"):
        assert back.parameters[f"hinge.bed.{name}"] == back.parameters[f"hinge.servo.{name}"]
    assert (back.parameters["hinge.bed.lobes"].value, back.parameters["hinge.law.gain"].value) == (7.0, 0.3)
    assert [note for note in back.notes if "not in the plan" in note] == [
        "`hinge.bed.resistance` is not in the plan (schema 1): its default, that of the joint's servo, is taken",
        "`hinge.bed.tau_max` is not in the plan (schema 1): its default, 1.0 N*m, is taken",
        "`hinge.bed.lobes` is not in the plan (schema 1): its default, 7.0 1, is taken",
        "`hinge.law.gain` is not in the plan (schema 1): its default, 0.3 1, is taken",
    ]


def test_a_servos_parameter_that_is_missing_too_is_its_default() -> None:
    made = on_beds()
    told = document(made)
    for path in ("elbow.servo.f_c", "elbow.bed.f_c"):
        del told["experiments"][0]["parameters"][path]
    (back,) = plan_file.loads(json.dumps(told)).experiments
    assert back.parameters["elbow.bed.f_c"].value == back.parameters["elbow.servo.f_c"].value == 0.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (substitution(joint="wrist"), "structure.substitutions[1].joint: there is no joint `wrist`"),
        (substitution(joint="shoulder"), "structure.substitutions[1].joint: joint `shoulder` is on a bed already"),
        (
            substitution(law="bare"),
            "structure.substitutions[1].law: it should be torque_balance, that of the first substituted joint",
        ),
        (lambda e: e["structure"]["servos"].pop(), "structure.substitutions[1].joint: joint `elbow` has no servo"),
        (
            lambda e: (e["structure"]["joints"][1].update(kind="fixed"), e["structure"]["servos"].pop()),
            "structure.substitutions[1].joint: joint `elbow` is fixed",
        ),
        (
            lambda e: e["structure"]["servos"][1].update(model="ideal"),
            "structure.substitutions[1].joint: the servo of joint `elbow`, ideal, has no motor for a bed",
        ),
        (
            lambda e: e["structure"]["servos"][1].update(divisor=2),
            "structure.substitutions[1].joint: the servo of joint `elbow` should tick with that of `shoulder`, the first on a bed",
        ),
        (
            lambda e: e["parameters"]["elbow.bed.kt"].update(value=-1.0),
            "parameters.elbow.bed.kt.value: it should be above 0",
        ),
        (
            lambda e: e["parameters"]["elbow.law.band"].update(unit="rad"),
            "parameters.elbow.law.band.unit: it should be rad/s",
        ),
        (
            lambda e: e["structure"].update(substitutions=[]),
            "parameters.elbow.bed.converter_current: nothing in this run has this parameter",
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_path(change: Change, said: str) -> None:
    assert said_of(change) == f"E302: {said}"


@pytest.mark.parametrize("kind", ["bed", "law"])
def test_a_model_that_there_is_not_is_said(kind: str) -> None:
    assert said_of(substitution(**{kind: "none"})) == f"D140: no {kind} model `none`"


def test_what_only_a_deck_writes_is_in_no_plan() -> None:
    def change(e: dict[str, Any]) -> None:
        e["parameters"]["elbow.bed.faults"] = {**e["parameters"]["elbow.bed.kt"], "value": {"word": "typical"}}

    assert said_of(change) == "E304: p.json: run `gains`: parameter `elbow.bed.faults` is none of its model's"


def test_a_whole_number_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    bed = BEDS[0]
    parameters = tuple(replace(p, whole=True) if p.name == "delay" else p for p in bed.parameters)
    monkeypatch.setattr("met.substitution.BEDS", (replace(bed, parameters=parameters),))
    said = said_of(lambda e: e["parameters"]["elbow.bed.delay"].update(value=0.5))
    assert said == "E302: parameters.elbow.bed.delay.value: it should be a whole number"


def test_motors_on_beds_make_another_program() -> None:
    made = [on_beds(()), on_beds(("elbow",)), on_beds(("shoulder",)), on_beds(), on_beds(law="bare")]
    assert len({keys.structure_key(each.structure) for each in made}) == len(made)


@pytest.mark.parametrize(
    ("kind", "model"),
    [
        ("law", replace(LAWS[0], name="mine", memory=(Memory(name="rate", unit="rad/s", doc="a rate"),))),
        ("bed", replace(BEDS[0], name="mine", memory=(Memory(name="load_current", unit="A", doc="a current"),))),
    ],
)
def test_a_model_may_not_take_a_name_of_the_engines(
    kind: models.Kind, model: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    point = SimpleNamespace(name="mine", value="my_arm:MODEL", package="my-arm", load=lambda: model)
    monkeypatch.setattr(models, "offered", lambda group: [point] if group == f"met.{kind}s" else [])
    with pytest.raises(Problem) as caught:
        models.available.__wrapped__(kind)
    [diagnostic] = caught.value.diagnostics
    assert (diagnostic.code, diagnostic.message) == (
        "E215",
        f"entry point `mine = my_arm:MODEL` of my-arm in group `met.{kind}s` declares `{model.memory[0].name}` twice",
    )
