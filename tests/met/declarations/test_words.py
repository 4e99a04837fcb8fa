"""Every word of every parameter of words is taken, and no other; links and joints are those of the arm."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from met import models
from met.parameter import Parameter
from tests.ic.small_decks import check, messages
from tests.met.declarations.values import errors, inner
from tests.met.small_models import EVERY, LINKS, Use, smallest, uses

WITH_WORDS = [
    (kind, name)
    for kind, name in EVERY
    if any(parameter.shape == "word" for parameter in models.written(models.find(kind, name)))
]


def words_of(use: Use) -> Iterator[Parameter]:
    return (parameter for parameter in use.parameters() if parameter.shape == "word")


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), WITH_WORDS)
def test_every_word_that_is_declared_is_taken(kind: models.Kind, name: str, tmp_path: Path) -> None:
    found = set()
    for use in uses(kind, name):
        compiled = check(tmp_path, use.put(tmp_path).deck(), select=["it"])
        assert compiled.plan is not None, messages(compiled)
        held = compiled.plan.experiments[0].parameters
        for parameter in use.in_plan():
            if parameter.shape == "word":
                word = held[f"{use.head}.{parameter.name}"].value
                assert word == use.values.get(parameter.name, parameter.default)
                found.add((parameter.name, word))
    words = {parameter.name: parameter.words for parameter in models.find(kind, name).parameters}
    names = {p.name: LINKS for p in models.find(kind, name).parameters if p.names == "link"}
    assert {(each, word) for known in (words, names) for each in known for word in known[each]} <= found


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), WITH_WORDS)
def test_any_other_word_is_refused_with_those_there_are(kind: models.Kind, name: str, tmp_path: Path) -> None:
    use = smallest(kind, name)
    for parameter in words_of(use):
        compiled = check(tmp_path, use.put(tmp_path).deck({parameter.name: "wrongly"}), select=["it"])
        (refused,) = errors(compiled)
        if parameter.names:
            assert refused.code == "D159", messages(compiled)
            assert refused.message == f"no {parameter.names} `wrongly` in arm `small`"
        elif not parameter.words:  # it names something of a servo
            assert refused.code == "D247" and refused.message.endswith("does not see `wrongly`"), messages(compiled)
        else:
            assert refused.code == "D076", messages(compiled)
            assert refused.message == f"`{parameter.name}` of {use.label} cannot be `wrongly`"
            assert f"one of: {', '.join(parameter.words)}" in refused.help


@pytest.mark.slow
@pytest.mark.parametrize("text", ["1", "1 N*m", '"world"', "[1, 2]"])
@pytest.mark.parametrize(("kind", "name"), WITH_WORDS)
def test_what_is_no_word_is_refused(kind: models.Kind, name: str, text: str, tmp_path: Path) -> None:
    use = smallest(kind, name)
    for parameter in words_of(use):
        compiled = check(tmp_path, use.put(tmp_path).deck({parameter.name: text}), select=["it"])
        (refused,) = errors(compiled)
        quoted = ", without quotes" if text.startswith('"') else ""
        assert refused.code == "D076", messages(compiled)
        assert refused.message == f"`{parameter.name}` of {use.label} is a word{quoted}"


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), WITH_WORDS)
def test_a_word_does_not_vary_as_a_number_does(kind: models.Kind, name: str, tmp_path: Path) -> None:
    use = smallest(kind, name)
    for parameter in words_of(use):
        path = f"{use.head}.{parameter.name}"
        compiled = check(tmp_path, use.put(tmp_path).deck(cases=f"vary {path} = [1, 2];"), select=["cases"])
        (refused,) = errors(compiled)
        assert f"`{path}`" in refused.message and "word" in refused.message + " ".join(refused.help), messages(compiled)


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), WITH_WORDS)
def test_what_is_not_there_under_a_word_is_refused_with_the_words_under_which_it_is(
    kind: models.Kind, name: str, tmp_path: Path
) -> None:
    for use in uses(kind, name):
        for parameter in use.absent():
            text = use.text(parameter, use.small.values.get(parameter.name, inner(parameter)))
            compiled = check(tmp_path, use.put(tmp_path).deck({parameter.name: text}), select=["it"])
            (refused,) = errors(compiled)
            assert parameter.only is not None
            word, where = parameter.only
            assert refused.code == "D141", messages(compiled)
            assert refused.message == f"{use.label} has no `{parameter.name}` with `{word} = {use.chosen[word]}`"
            assert refused.help == (f"it is there with {' or '.join(f'`{word} = {each};`' for each in where)}",)
