"""What a deck need not write has the declared default, and writing that changes nothing; what it must write is
missed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from met import models
from met import run as engine
from met.parameter import Parameter
from met.plan import Experiment, keys
from tests.ic.small_decks import check, experiment, messages
from tests.met.declarations.values import errors, inner, paths, varied
from tests.met.small_models import EVERY, Use, finite, first_uses, uses

pytestmark = pytest.mark.slow

WITH_PARAMETERS = [(kind, name) for kind, name in EVERY if models.written(models.find(kind, name))]


def defaulted(use: Use, parameters: Iterable[Parameter]) -> Iterator[Parameter]:
    """Of these, the parameters that the declaration says what they are where a deck does not write them."""
    for parameter in parameters:
        if parameter.default is not None and not parameter.of_servo and not use.needed(parameter):
            yield parameter


def found_at(deck: Experiment, use: Use, parameter: Parameter) -> tuple[object, set[str]]:
    """The parameter's value in a plan, and the kinds of its origins."""
    found = [deck.parameters[path] for path in paths(use, parameter)]
    value = tuple(each.value for each in found) if parameter.shape == "vector" else found[0].value
    return value, {each.origin.kind for each in found}


@pytest.mark.parametrize(("kind", "name"), WITH_PARAMETERS)
def test_what_a_deck_leaves_out_has_its_default(kind: models.Kind, name: str, tmp_path: Path) -> None:
    for use in uses(kind, name):
        left_out = [
            parameter
            for parameter in defaulted(use, use.parameters())
            if parameter.name not in use.words and not (use.file and parameter.shape == "text")
        ]
        deck = experiment(tmp_path, use.put(tmp_path).deck(without=[p.name for p in left_out]), select=["it"])
        for parameter in left_out:
            if parameter.shape == "text" or parameter.name == models.FAULTS:
                continue  # for the compiler alone: no plan holds it
            if parameter.timing:
                assert not {*paths(use, parameter)} & {*deck.parameters}, "plans stay what they were"
                continue
            if use.words.get(models.FAULTS) and parameter.name in use.model.presets[use.words[models.FAULTS]]:
                continue  # that word is its default
            assert found_at(deck, use, parameter) == (parameter.default, {"default"}), parameter.name
        for parameter in use.parameters():
            if parameter.of_servo:
                of = deck.parameters[f"{use.joint}.servo.{parameter.of_servo}"]
                assert found_at(deck, use, parameter)[0] == of.value, parameter.name


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), WITH_PARAMETERS)
def test_writing_the_defaults_changes_neither_plan_nor_bits(kind: models.Kind, name: str, tmp_path: Path) -> None:
    for n, (use, new) in enumerate(first_uses(kind, name)):
        # what stands for never cannot be written, nor what is called after a joint
        said = {
            p.name: use.text(p, p.default)
            for p in defaulted(use, new)
            if finite(p.default) and p.shape != "text" and p.name not in use.words
        }
        if not said:
            continue
        use.put(tmp_path)
        silent, spoken = (
            experiment(tmp_path, use.deck(written, without=said.keys() - written.keys()), select=["it"])
            for written in ({}, said)
        )
        assert {path: q.value for path, q in silent.parameters.items()} == {
            path: q.value for path, q in spoken.parameters.items()
        }
        for parameter in use.in_plan():
            if parameter.name in said:
                assert found_at(spoken, use, parameter)[1] == {"deck"}, parameter.name
        named = [
            (keys.structure_key(deck.structure, keys.inputs(deck)), keys.case_ids(deck)) for deck in (silent, spoken)
        ]
        assert named[0] == named[1]
        if n == 0:
            a, b = (engine.run(deck, threads=1) for deck in (silent, spoken))
            assert all(a.signals[channel].tobytes() == b.signals[channel].tobytes() for channel in a.signals)
            assert a.metrics["m"].tobytes() == b.metrics["m"].tobytes()


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), WITH_PARAMETERS)
def test_what_must_be_written_is_missed_by_its_name(kind: models.Kind, name: str, tmp_path: Path) -> None:
    for use, new in first_uses(kind, name):
        for parameter in new:
            found = check(tmp_path, use.put(tmp_path).deck(without=[parameter.name]), select=["it"])
            if not use.needed(parameter):
                assert not errors(found), (parameter.name, messages(found))
                continue
            message = f"{use.owner(parameter)} has no `{parameter.name}`"
            if use.command in parameter.needed_for:
                message = f"{use.owner(parameter)} needs `{parameter.name}` under a {use.command} command"
            assert [each.message for each in errors(found)] == [message], (parameter.name, messages(found))
            (missed,) = errors(found)
            assert missed.at is not None and missed.help[0].startswith(f"write `{parameter.name} = "), messages(found)
            assert parameter.doc in missed.help[0] or parameter.shape == "text", "and what it is is said"


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), WITH_PARAMETERS)
def test_what_must_be_written_and_is_misspelt_is_told_once(kind: models.Kind, name: str, tmp_path: Path) -> None:
    for use, new in first_uses(kind, name):
        for parameter in new:
            if not use.needed(parameter):
                continue
            key, deck = use.key(parameter), use.put(tmp_path).deck()
            written = f"{key} = {use.text(parameter, use.values[parameter.name])}"
            assert deck.count(f" {written}") + deck.count(f"({written}") == 1, written
            misspelt = deck.replace(written, f"{key}{key[-1]}{written[len(key) :]}")
            (found,) = errors(check(tmp_path, misspelt, select=["it"]))
            assert found.code == "D141" and found.message == f"{use.label} has no `{key}{key[-1]}`"
            assert found.help[0] == f"did you mean `{key}`?"


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), WITH_PARAMETERS)
def test_what_must_be_written_may_come_from_a_sweep_or_the_command_line(
    kind: models.Kind, name: str, tmp_path: Path
) -> None:
    taken: dict[str, bool] = {}
    for use, new in first_uses(kind, name):
        for parameter in new:
            if not use.needed(parameter) or parameter.shape != "number":
                continue
            value = use.values.get(parameter.name, inner(parameter))
            path, text = varied(use, parameter)[0], use.text(parameter, value)
            deck = use.put(tmp_path).deck(without=[parameter.name], cases=f"vary {path} = [{text}];")
            swept = check(tmp_path, deck, select=["cases"])
            given = check(tmp_path, deck, select=["it"], set=[f"{path}={text}"])
            # what this command makes no use of, an error of its own; under another command it is used
            assert {each.code for each in errors(swept)} <= {"D137"}, messages(swept)
            assert {each.code for each in errors(given)} <= {"D236"}, messages(given)
            taken[parameter.name] = taken.get(parameter.name, False) or not (errors(swept) or errors(given))
    assert all(taken.values()), taken
