"""Keys and ids: what they depend on, what they do not, and that they stay what they are."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from met.diagnostic import Place
from met.plan import Cases, Experiment, Quantity, Structure, keys
from tests.batch import plans

ROOT = Path(__file__).resolve().parents[3]
CASE_KEYS = ["d9f6d43def9ece78", "5c0b17f28b717e62", "2f0bcebdefa8c834"]
CASE_IDS = ["a152d04dcd853ed6", "14c98b2ecb75da00", "6b7fa51b851fcffd"]
STRUCTURE_KEY = "d40f15af1496fedc"


def first_plan() -> Experiment:
    """As a plan had it when these keys were made: without what its models' declarations have got since."""
    experiment = plans.gains(3)
    parameters = {path: q for path, q in experiment.parameters.items() if not path.endswith(".servo.friction")}
    return replace(experiment, parameters=parameters)


def swap(experiment: Experiment, **parameters: float) -> Experiment:
    changed = {path.replace("__", "."): value for path, value in parameters.items()}
    quantities = {
        path: Quantity(changed[path], q.unit, q.origin) if path in changed else q
        for path, q in experiment.parameters.items()
    }
    return replace(experiment, parameters=quantities)


def test_ids_and_keys_are_what_they_were() -> None:
    """Archives hold them: a change here breaks the matching of cases with older archives."""
    experiment = first_plan()
    assert keys.case_keys(experiment) == CASE_KEYS
    assert keys.case_ids(experiment) == CASE_IDS
    assert keys.structure_key(experiment.structure, keys.inputs(experiment)) == STRUCTURE_KEY


@pytest.mark.slow
def test_another_process_finds_the_same_ids() -> None:
    """String hashes differ from process to process; ids must not."""
    module = "tests.met.plan.test_keys"
    program = f"from met.plan import keys; from {module} import first_plan; print(*keys.case_ids(first_plan()))"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    assert said.stdout.split() == CASE_IDS


def test_a_case_key_follows_from_coordinates_alone() -> None:
    experiment = plans.gains(5)
    assert keys.case_keys(swap(experiment, elbow__servo__kt=0.07)) == keys.case_keys(experiment)
    assert keys.case_ids(swap(experiment, elbow__servo__kt=0.07)) != keys.case_ids(experiment)


def test_a_case_key_does_not_depend_on_the_order_of_coordinates_or_cases() -> None:
    experiment = plans.gains(5)
    a, b = experiment.cases.coordinates
    turned = [replace(c, values=c.values[::-1].copy()) for c in (b, a)]
    other = replace(experiment, cases=Cases(5, tuple(turned), 7))
    assert keys.case_keys(other) == keys.case_keys(experiment)[::-1]


def test_rows_can_be_asked_for_alone() -> None:
    experiment = plans.gains(50)
    whole = keys.case_ids(experiment)
    assert keys.case_ids(experiment, [48, 3]) == [whole[48], whole[3]]
    assert keys.case_ids(experiment, []) == keys.case_keys(experiment, []) == []


def test_zero_has_one_key() -> None:
    experiment = plans.gains(2)
    first, second = experiment.cases.coordinates
    zeros = replace(first, values=np.array([0.0, -0.0]))
    same = replace(second, values=np.array([1.0, 1.0]))
    one, other = keys.case_keys(replace(experiment, cases=Cases(2, (zeros, same), 7)))
    assert one == other


def test_a_digest_of_content_goes_by_numbers_structure_and_rows_and_not_by_places_or_names() -> None:
    experiment = first_plan()
    digest = keys.content_digest("steps", experiment, [0, 2])
    place = Place("other.ic", 7, 1)
    moved = replace(
        experiment.structure, links=tuple(replace(each, place=place) for each in experiment.structure.links)
    )
    alike = replace(
        experiment, name="another", structure=moved, parameters=dict(reversed(experiment.parameters.items()))
    )
    assert keys.content_digest("steps", alike, [0, 2]) == digest
    path, quantity = next((path, q) for path, q in experiment.parameters.items() if isinstance(q.value, float))
    numbers = {**experiment.parameters, path: replace(quantity, value=np.nextafter(quantity.value, 1e9))}
    others = [
        keys.content_digest("margins", experiment, [0, 2]),
        keys.content_digest("steps", experiment, [0, 1]),
        keys.content_digest("steps", replace(experiment, parameters=numbers), [0, 2]),
        keys.content_digest("steps", replace(experiment, structure=replace(moved, integrator="rk4")), [0, 2]),
        keys.content_digest("steps", replace(experiment, cases=replace(experiment.cases, seed=8)), [0, 2]),
    ]
    assert len({digest, *others}) == 6


def test_the_seed_is_part_of_a_case_id() -> None:
    experiment = plans.nominal()
    assert keys.case_ids(experiment) != keys.case_ids(replace(experiment, cases=Cases(1, seed=1)))


def test_a_formula_is_part_of_a_case_id() -> None:
    experiment = plans.gains(2)
    formulas = replace(experiment.formulas, outputs=experiment.formulas.outputs[::-1])
    assert keys.case_ids(replace(experiment, formulas=formulas)) != keys.case_ids(experiment)


def test_where_a_deck_was_written_changes_no_key() -> None:
    structure = plans.structure()
    moved = replace(structure, joints=tuple(replace(j, place=Place("b.ic", 2, 3)) for j in structure.joints))
    renamed = replace(moved, servos=tuple(replace(s, definition="other") for s in moved.servos))
    assert keys.structure_key(renamed) == keys.structure_key(structure)


def test_what_makes_another_program_changes_the_structure_key() -> None:
    structure = plans.structure()
    others: list[Structure] = [
        replace(structure, integrator="rk4"),
        replace(structure, velocity_products=True),
        replace(structure, joints=structure.joints[::-1]),
        replace(structure, servos=structure.servos[:1]),
        replace(structure, schedule=replace(structure.schedule, dynamics=2)),
        replace(structure, record=structure.record[:1]),
    ]
    found = {keys.structure_key(other) for other in [structure, *others]}
    assert len(found) == len(others) + 1
    assert keys.structure_key(structure, ["gearbox.kp"]) not in found


@pytest.mark.release
def test_a_million_cases_have_names_of_their_own() -> None:
    """In 1.5 s; a row-by-row JSON would take a minute. tests/costs.py sees to that."""
    experiment = plans.gains(1_000_000)
    ids = keys.case_ids(experiment)
    assert len(set(ids)) == len(ids)
