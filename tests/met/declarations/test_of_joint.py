"""What each joint has that follows a guide: written for all it reaches every joint; one joint's own goes over it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from met import models
from met.plan import keys
from tests.ic.small_decks import experiment
from tests.met.small_models import Use, smallest

GUIDES = [name for name, guide in models.find_own("guide").items() if guide.of_joint]


def for_all(name: str) -> Use:
    return replace(smallest("guide", name), for_all=True)


@pytest.mark.parametrize("name", GUIDES)
def test_what_is_written_for_all_is_every_joints(name: str, tmp_path: Path) -> None:
    use = for_all(name)
    found = experiment(tmp_path, use.deck(), select=["it"]).parameters
    for parameter in use.of_joint:
        values = [found[replace(use, joint=joint).path(parameter)].value for joint in use.kinds]
        assert len(values) > 1 and values == [use.values[parameter.name]] * len(values)


@pytest.mark.parametrize("name", GUIDES)
def test_what_one_joint_has_of_its_own_goes_over_it(name: str, tmp_path: Path) -> None:
    use = for_all(name)
    own = replace(use, for_all=False)
    for parameter in use.of_joint:
        value = use.values[parameter.name]
        assert isinstance(value, float)
        both = f"{use.text(parameter, value)}; {own.key(parameter)} = {use.text(parameter, 2.0 * value)}"
        found = experiment(tmp_path, use.deck({parameter.name: both}), select=["it"]).parameters
        for joint in use.kinds:
            expected = 2.0 * value if joint == use.joint else value
            assert found[replace(use, joint=joint).path(parameter)].value == expected, joint


@pytest.mark.slow
@pytest.mark.parametrize("name", GUIDES)
def test_a_sweep_varies_it_for_all_or_for_one(name: str, tmp_path: Path) -> None:
    use = for_all(name)
    for parameter in use.of_joint:
        value, unit = use.values[parameter.name], use.unit(parameter)
        assert isinstance(value, float)
        for path, varied in ((f"{use.head}.{parameter.name}", list(use.kinds)), (use.path(parameter), [use.joint])):
            deck = experiment(
                tmp_path, use.deck(cases=f"vary {path} = [{value}, {2.0 * value}] {unit};"), select=["cases"]
            )
            of_guide = {each for each in keys.inputs(deck) if each.startswith(use.head)}
            assert of_guide == {path, *(replace(use, joint=joint).path(parameter) for joint in varied)}
