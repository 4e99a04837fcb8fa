"""Every declared bound holds where a parameter's number comes from: deck, sweep, command line, plan.

At the bound or just inside a number is taken as it is; just outside it is refused, with its parameter's name, at its
place.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import met.environments
from met import models
from met.environments import Environment
from met.environments.environment import Loads
from met.parameter import Parameter
from met.plan import Experiment
from met.plan import check as plan_check
from met.plan.codec import Damaged
from tests.ic.small_decks import check, experiment, messages
from tests.met.declarations.values import NUMBERS, bounds, constant, errors, inner, paths, several, shaped, varied
from tests.met.small_models import EVERY, SMALLEST, Small, Use, smallest, uses

pytestmark = pytest.mark.slow

UNSTABLE = {"D104", "D384"}
"""What else a number may be refused for: one at its bound may make a servo too fast for the step, a course too slow."""


def ranged(kind: models.Kind, name: str) -> Iterator[tuple[Use, Parameter]]:
    """Every parameter that has numbers, in the first use that it is there in, and wherever its bounds are others."""
    seen = set()
    for use in uses(kind, name):
        for parameter in use.parameters():
            if parameter.shape in NUMBERS and (use.key(parameter), parameter) not in seen:
                seen.add((use.key(parameter), parameter))
                yield use, parameter


def refused(
    folder: Path,
    use: Use,
    parameter: Parameter,
    deck: str,
    written: str,
    words: str,
    *,
    ends: str = "",
    settings: tuple[str, ...] = (),
    select: str = "it",
) -> None:
    """The deck is refused for one number alone: by code, parameter and bound, and at the place where it is written."""
    found = check(folder, deck, select=[select], set=settings)
    refusals = [each for each in errors(found) if each.code not in UNSTABLE]
    assert [each.code for each in refusals] == ["D077"], (parameter.name, written, messages(found))
    message, at = refusals[0].message, refusals[0].at
    assert message.startswith(f"`{parameter.name}` of {use.owner(parameter)} must be "), message
    assert words in message and message.endswith(ends), (words, message)
    assert at is not None
    line = found.sources[at.place.file].splitlines()[at.place.line - 1]
    assert line[at.place.column - 1 :][: at.place.length] == written, (line, written)


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_a_number_at_its_bound_is_taken_as_it_is(kind: models.Kind, name: str, tmp_path: Path) -> None:
    for use, parameter in ranged(kind, name):
        for inside, _, _ in bounds(parameter):
            text = use.text(parameter, shaped(parameter, use, inside))
            found = check(tmp_path, use.put(tmp_path).deck({parameter.name: text}), select=["it"])
            assert {each.code for each in errors(found)} <= UNSTABLE, messages(found)
            if found.plan is not None:
                value = found.plan.experiments[0].parameters[paths(use, parameter)[-1]].value
                assert (value[-1] if isinstance(value, tuple) else value) == inside, parameter.name


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_a_number_just_outside_is_refused_where_the_deck_writes_it(
    kind: models.Kind, name: str, tmp_path: Path
) -> None:
    for use, parameter in ranged(kind, name):
        for _, outside, words in bounds(parameter):
            value = shaped(parameter, use, outside)
            text = use.text(parameter, value)
            deck = use.put(tmp_path).deck({parameter.name: text})
            refused(tmp_path, use, parameter, deck, repr(outside) if isinstance(value, tuple) else text, words)


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_so_it_is_in_a_case_of_a_sweep(kind: models.Kind, name: str, tmp_path: Path) -> None:
    for use, parameter in ranged(kind, name):
        if constant(parameter):
            continue  # which no case varies
        for _, outside, words in bounds(parameter):
            path, unit = varied(use, parameter)[-1], use.unit(parameter)
            cases = f"vary {path} = [{inner(parameter)!r}, {outside!r}] {unit};"
            deck = use.put(tmp_path).deck(cases=cases)
            refused(tmp_path, use, parameter, deck, path, words, ends="; case #1 breaks it", select="cases")


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_so_it_is_on_the_command_line(kind: models.Kind, name: str, tmp_path: Path) -> None:
    for use, parameter in ranged(kind, name):
        if constant(parameter):
            continue
        for _, outside, words in bounds(parameter):
            text = f"{outside!r} {use.unit(parameter)}".rstrip()
            settings = (f"{varied(use, parameter)[-1]}={text}",)
            refused(tmp_path, use, parameter, use.put(tmp_path).deck(), text, words, settings=settings)


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), EVERY)
@pytest.mark.parametrize("expression", ["{}*way/way", "{}/way"], ids=["nan", "inf"])
def test_what_comes_out_as_no_number_or_infinite_is_refused(
    kind: models.Kind, name: str, expression: str, tmp_path: Path
) -> None:
    """No deck can write either; a formula can make one in a case."""
    for use, parameter in ranged(kind, name):
        if constant(parameter):
            continue
        number = expression.format(repr(inner(parameter)))
        text = f"({number}) {use.unit(parameter)}".rstrip()
        if parameter.shape == "vector":
            text = f"[0, 0, {number}] {use.unit(parameter)}".rstrip()
        deck = use.put(tmp_path).deck({parameter.name: text}, before="let way = 1;\n", cases="vary way = [1, 0];")
        shown = "nan" if "*" in expression else "inf"
        found = check(tmp_path, deck, select=["cases"])
        refusals = [each for each in errors(found) if each.code not in UNSTABLE]
        assert [each.code for each in refusals] == ["D077"], (parameter.name, messages(found))
        assert refusals[0].at is not None and refusals[0].at.text.startswith(f"this is {shown}"), refusals[0]
        assert refusals[0].message.startswith(f"`{parameter.name}` of {use.owner(parameter)} must be "), refusals[0]


def changed(deck: Experiment, path: str, value: object) -> Experiment:
    """The experiment with another value in its plan."""
    return replace(deck, parameters={**deck.parameters, path: replace(deck.parameters[path], value=value)})


@pytest.mark.release
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_so_it_is_in_a_plan_by_hand(kind: models.Kind, name: str, tmp_path: Path) -> None:
    for use, parameter in ranged(kind, name):
        deck, path = experiment(tmp_path, use.put(tmp_path).deck(), select=["it"]), paths(use, parameter)[-1]
        wrong = [(outside, words) for _, outside, words in bounds(parameter)]
        wrong += [(x, "") for x in (math.nan, math.inf, -math.inf) if x not in several(parameter.default)]
        for number, words in wrong:
            value = shaped(parameter, use, number) if parameter.shape == "list" else number
            with pytest.raises(Damaged) as raised:
                plan_check.check([changed(deck, path, value)])
                pytest.fail(f"{path} = {number} was taken")
            assert path in str(raised.value) and words in str(raised.value), str(raised.value)


# The whole message, of each kind of bound


PROBE = Environment(
    name="probe",
    doc="Probe: it has a parameter of every kind of bound.",
    parameters=(
        Parameter(name="over", unit="N", default=1.0, above=0.0, doc="a force"),
        Parameter(name="least", unit="1/s", default=1.0, at_least=0.0, doc="a rate"),
        Parameter(name="under", unit="m", default=1.0, below=2.0, doc="a length"),
        Parameter(name="most", default=0.5, at_least=0.0, at_most=1.0, doc="a share"),
        Parameter(name="count", default=1.0, at_least=1.0, whole=True, doc="a number of things"),
        Parameter(name="free", unit="rad", default=0.0, doc="an angle"),
        Parameter(name="list", unit="s", shape="list", above=0.0, doc="times"),
        Parameter(name="arrow", unit="N*m", shape="vector", default=(1.0, 1.0, 1.0), at_most=1.0, doc="a moment"),
    ),
    loads=lambda p, world: Loads(gravity=(p.over * p.least, p.under * p.most * p.count, p.free + p.arrow[2])),
)


@pytest.fixture
def probe(monkeypatch: pytest.MonkeyPatch) -> Iterator[Use]:
    monkeypatch.setattr(met.environments, "ENVIRONMENTS", (*met.environments.ENVIRONMENTS, PROBE))
    monkeypatch.setitem(SMALLEST, ("environment", "probe"), Small({"list": (1.0, 2.0)}))
    models.available.cache_clear()
    yield smallest("environment", "probe")
    models.available.cache_clear()


@pytest.mark.parametrize(
    ("name", "text", "bad", "must", "this", "remedy"),
    [
        ("over", "0 N", "0 N", "above 0 N", "0 N", "a number above 0 N (a force)"),
        ("least", "-1 1/s", "-1 1/s", "at least 0 1/s", "-1 1/s", "a number of at least 0 1/s (a rate)"),
        ("under", "2 m", "2 m", "below 2 m", "2 m", "a number below 2 m (a length)"),
        ("most", "150 %", "150 %", "at least 0 and at most 1", "1.5", "a number of at least 0 and at most 1 (a share)"),
        ("count", "1.5", "1.5", "whole and at least 1", "1.5", "a whole number of at least 1 (a number of things)"),
        ("list", "[1, 0] s", "0", "above 0 s", "0 s", "a number above 0 s (times)"),
        ("arrow", "[0, 1, 2] N*m", "2", "at most 1 N*m", "2 N*m", "a number of at most 1 N*m (a moment)"),
    ],
)
def test_what_is_said_of_each_kind_of_bound(
    probe: Use, name: str, text: str, bad: str, must: str, this: str, remedy: str, tmp_path: Path
) -> None:
    deck = probe.deck({name: text})
    number = next(n for n, line in enumerate(deck.splitlines(), 1) if "probe" in line)
    line = deck.splitlines()[number - 1]
    before = line.index(bad, line.index(f" {name} = ") + len(name) + 3)
    assert (
        messages(check(tmp_path, deck, select=["it"]))
        == f"""\
error[D077]: `{name}` of environment `used` must be {must}
  --> deck.ic:{number}:{before + 1}
   |
{number} | {line}
   | {" " * before}{"^" * len(bad)} this is {this}
   = help: write {remedy}

1 error
"""
    )


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("over", 0.0, "over.value: it should be above 0"),
        ("least", -1.0, "least.value: it should be at least 0"),
        ("under", 2.0, "under.value: it should be below 2"),
        ("most", 1.5, "most.value: it should be at most 1"),
        ("count", 1.5, "count.value: it should be a whole number"),
        ("free", math.inf, "free.value: it is not finite"),
        ("list", (1.0, 0.0), "list.value: one of its numbers: it should be above 0"),
        ("list", (1.0, math.nan), "list.value: one of its numbers is not finite"),
        ("arrow.z", 2.0, "arrow.z.value: it should be at most 1"),
    ],
)
def test_what_is_said_of_each_kind_of_bound_in_a_plan(
    probe: Use, path: str, value: object, said: str, tmp_path: Path
) -> None:
    deck = experiment(tmp_path, probe.deck(), select=["it"])
    plan_check.check([deck])
    with pytest.raises(Damaged) as raised:
        plan_check.check([changed(deck, f"environment.used.{path}", value)])
    assert str(raised.value) == f"experiments[0].parameters.environment.used.{said}"


def test_a_parameter_of_a_plan_that_is_no_number_in_a_case_is_told(tmp_path: Path) -> None:
    """As a number that a formula makes; the deck above says it first, a plan by hand has nobody else to."""
    use = smallest("environment", "wrench")
    deck = experiment(tmp_path, use.deck(cases="vary environment.used.force.x = [1, 2, 3] N;"), select=["cases"])
    (column,) = deck.cases.coordinates
    column = replace(column, values=np.array([1.0, math.nan, 3.0]))
    with pytest.raises(Damaged) as raised:
        plan_check.check([replace(deck, cases=replace(deck.cases, coordinates=(column,)))])
    assert str(raised.value) == ("experiments[0].parameters.environment.used.force.x: it is not finite; in case #1")
