"""What has changed between two plans, in words."""

from __future__ import annotations

from pathlib import Path

import pytest

from batch.campaigns.changes import between
from tests.ic.meaning.mechanics.test_booms import BOOM
from tests.ic.small_decks import changed, experiment


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("[3e6, 1e6] N*m^2", "[2e6, 1e6] N*m^2"), ["links.jib.EI: 3e+06 N*m^2 -> 2e+06 N*m^2 (deck.ic:2)"]),
        (("GJ = 1e6 N*m^2", "GJ = 2e6 N*m^2"), ["links.jib.GJ: 1e+06 N*m^2 -> 2e+06 N*m^2 (deck.ic:2)"]),
        (("damping_ratio = 1 %", "damping_ratio = 2 %"), []),
    ],
)
def test_a_stiffness_of_a_boom_is_told_as_its_own_and_not_spring_by_spring(
    tmp_path: Path, change: tuple[str, str], expected: list[str]
) -> None:
    before = experiment(tmp_path, BOOM)
    found = [each.text for each in between(before, experiment(tmp_path, changed(BOOM, change)), ordered=True)]
    damping = [each for each in found if each.startswith("damping of the springs of boom jib: ")]
    told = [each.replace(f"{tmp_path}/", "") for each in found if each not in damping]
    assert told == expected and 1 <= len(damping) <= 3


def test_a_longer_boom_of_the_same_stiffness_has_no_other_EI(tmp_path: Path) -> None:
    longer = changed(BOOM, ("size = [7,", "size = [7.5,"), ("at = [7,", "at = [7.5,"))
    found = [each.text for each in between(experiment(tmp_path, BOOM), experiment(tmp_path, longer), ordered=True)]
    assert not [each for each in found if "EI" in each or "GJ" in each]
    assert [each for each in found if each.startswith("jib_1y.servo.stiffness: ")]
