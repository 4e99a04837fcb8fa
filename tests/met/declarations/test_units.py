"""Every declared unit, on a revolute joint and on a prismatic one, under every kind of command.

A number in another unit of the same dimension is the same number in SI; a bare one is refused, and so is one of
another dimension: of all parameters of a model at once, each by its name and what it is in.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import pytest

from ic.language.unit_words import units_of
from met import models
from met.diagnostic import Diagnostic
from met.parameter import Parameter
from met.unit_parser import parse_unit
from met.units import PURE, UNITS, same
from tests.ic.small_decks import check, experiment, messages
from tests.met.declarations.values import NUMBERS, holds, inner, paths, several, shaped
from tests.met.small_models import EVERY, JOINTS, Use, Value, first_uses, smallest

pytestmark = pytest.mark.slow

ODD = "K"
"""A unit of a dimension that no parameter has."""

WITH_NUMBERS = [
    (kind, name)
    for kind, name in EVERY
    if any(parameter.shape in NUMBERS for parameter in models.written(models.find(kind, name)))
]


def every_use(kind: models.Kind, name: str, joint: str) -> Iterator[tuple[Use, list[Parameter]]]:
    """The uses that may give the model's units a meaning of their own, with the parameters that are new in each."""
    for use, new in first_uses(kind, name, joint):
        if kind == "command" or use.command == smallest(kind, name).command:
            yield use, new


def numbers_of(use: Use, parameters: Iterable[Parameter]) -> dict[str, tuple[Parameter, Value]]:
    """Each parameter that has numbers, with a value in SI that suits the deck: the smallest deck's, the default, ..."""
    found = {}
    for parameter in parameters:
        if parameter.shape not in NUMBERS:
            continue
        tries = (use.values.get(parameter.name), parameter.default, 1e-3, inner(parameter))
        value = next(v for v in tries if _writable(v) and all(holds(parameter, x) for x in several(v)))
        found[parameter.name] = (parameter, value if isinstance(value, tuple) else shaped(parameter, use, value))
    return found


def _writable(value: Value | None) -> bool:
    """Whether it is a number that a change of unit changes."""
    numbers = value if isinstance(value, tuple) else (value,)
    return all(isinstance(x, float) and math.isfinite(x) for x in numbers) and any(numbers)


def others(unit: str) -> list[str]:
    """Other units of the same dimension: each factor of it in another one, and those that have a name of their own."""
    found = [name for name in units_of(parse_unit(unit or "1").dimension) if name != unit]
    for match in re.finditer(r"[A-Za-z]+", unit):
        alike = units_of(UNITS[match[0]].measure.dimension)
        found += [unit[: match.start()] + name + unit[match.end() :] for name in alike if name != match[0]]
    return list(dict.fromkeys(found))


def written(value: Value, unit: str, scale: float = 1.0) -> str:
    numbers = [repr(x / scale) for x in several(value)]
    return f"[{', '.join(numbers)}] {unit}" if isinstance(value, tuple) else f"{numbers[0]} {unit}"


def refused(folder: Path, use: Use, texts: Mapping[str, str], code: str) -> dict[str, Diagnostic]:
    """What is said of each of these parameters, which all are refused by this code; nothing else is said.

    Of a number without a unit that is D060, whatever else would be wrong with it.
    """
    found = check(folder, use.put(folder).deck(texts), select=["it"])
    codes = sorted(code if re.search("[A-Za-z]", text) else "D060" for text in texts.values())
    assert sorted(each.code for each in found.diagnostics) == codes, messages(found)
    by_name = {each.message.split("`")[1]: each for each in found.diagnostics}
    assert by_name.keys() == texts.keys(), messages(found)
    for name, each in by_name.items():
        assert each.message.startswith(f"`{name}` of {use.owner(use.parameter(name))} is "), each.message
        assert each.help and each.at is not None
        line = found.sources[each.at.place.file].splitlines()[each.at.place.line - 1]
        shown = line[each.at.place.column - 1 :][: each.at.place.length]
        assert shown in texts[name] and shown.strip("[]"), (shown, texts[name])
    return by_name


@pytest.mark.release
@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize(("kind", "name"), WITH_NUMBERS)
def test_a_number_in_another_unit_is_the_same_number_in_si(
    kind: models.Kind, name: str, joint: str, tmp_path: Path
) -> None:
    for use, new in every_use(kind, name, joint):
        numbers = numbers_of(use, new)
        choices = {each: others(use.unit(parameter)) for each, (parameter, _) in numbers.items()}
        for turn in range(max(map(len, choices.values()), default=0)):
            units = {each: known[turn % len(known)] for each, known in choices.items() if known}
            texts = {each: written(numbers[each][1], unit, parse_unit(unit).scale) for each, unit in units.items()}
            found = experiment(tmp_path, use.put(tmp_path).deck(texts), select=["it"]).parameters
            for each, unit in units.items():
                parameter, value = numbers[each]
                values = [found[path].value for path in paths(use, parameter)]
                got = values[0] if isinstance(values[0], tuple) else values
                # a division here, and a multiplication by a product of some factors there
                assert got == pytest.approx(list(several(value)), rel=1e-15, abs=0), (each, unit, texts[each])


@pytest.mark.release
@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize(("kind", "name"), WITH_NUMBERS)
def test_a_bare_number_is_refused_where_there_is_a_dimension(
    kind: models.Kind, name: str, joint: str, tmp_path: Path
) -> None:
    for use, new in every_use(kind, name, joint):
        numbers = {each: (p, v) for each, (p, v) in numbers_of(use, new).items() if use.dimension(p) != PURE}
        said = refused(tmp_path, use, {each: written(v, "").strip() for each, (_, v) in numbers.items()}, "D060")
        for each, (parameter, _) in numbers.items():
            named = re.search(r" is in (\S+), and th", said[each].message)
            assert named is not None and parse_unit(named[1]) == parse_unit(use.unit(parameter)), said[each]


@pytest.mark.release
@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize(("kind", "name"), WITH_NUMBERS)
def test_a_number_of_another_dimension_is_refused(kind: models.Kind, name: str, joint: str, tmp_path: Path) -> None:
    for use, new in every_use(kind, name, joint):
        numbers = numbers_of(use, new)
        said = refused(tmp_path, use, {each: written(v, ODD) for each, (_, v) in numbers.items()}, "D061")
        for each, (parameter, _) in numbers.items():
            named = re.search(rf" is (?:a pure number|in (\S+)), and this is in {ODD}$", said[each].message)
            assert named is not None and parse_unit(named[1] or "1") == parse_unit(use.unit(parameter) or "1")


@pytest.mark.release
@pytest.mark.parametrize(("joint", "other"), [("hinge", "slide"), ("slide", "hinge")])
@pytest.mark.parametrize(("kind", "name"), WITH_NUMBERS)
def test_the_unit_of_the_other_kind_of_joint_is_refused(
    kind: models.Kind, name: str, joint: str, other: str, tmp_path: Path
) -> None:
    for (use, new), (elsewhere, _) in zip(every_use(kind, name, joint), every_use(kind, name, other), strict=True):
        numbers = {
            each: (p, v)
            for each, (p, v) in numbers_of(use, new).items()
            if not same(use.dimension(p), elsewhere.dimension(p))
        }
        texts = {each: written(v, elsewhere.unit(p)).strip() for each, (p, v) in numbers.items()}
        refused(tmp_path, use, texts, "D061")
