"""A group that is in no file says of its cases what an archive of the same cases says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.archive.in_memory import GroupInMemory
from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries import requirements
from batch.queries.pool import Pool
from batch.queries.signals import DeckUnits, Panel
from batch.report.contents.overview import overview
from batch.report.html.payload import overview_data
from met.plan import Experiment, Plan
from met.run import prepare, run
from tests.batch.watching.watched import DECK, LENGTH

ALONG_CASES = ("case", "requirement")


@pytest.fixture(scope="module")
def plan() -> Plan:
    return ic.compile(text=DECK.replace('#include "length.ic"', LENGTH))


@pytest.fixture(scope="module")
def experiment(plan: Plan) -> Experiment:
    return plan.experiments[0]


@pytest.fixture(scope="module")
def archive(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("kept") / "a.h5"
    batch.run(plan, output=path, verify="none")
    return path


@pytest.fixture(scope="module")
def group(experiment: Experiment) -> GroupInMemory:
    return GroupInMemory.of_run(experiment, run(prepare(experiment), record=False))


@pytest.mark.slow
def test_it_has_the_values_and_the_attributes_of_an_archive(group: ArchiveGroup, archive: Path) -> None:
    with ArchiveFile(archive) as file:
        stored = file.groups[0]
        wanted = [each for each in stored.variables.values() if each.dims[0] in ALONG_CASES]
        assert [each.name for each in wanted] == list(group.variables)
        for each in wanted:
            mine = group.variables[each.name]
            assert (mine.dims, mine.role, mine.unit, mine.long_name) == (
                each.dims, each.role, each.unit, each.long_name
            )  # fmt: skip
            assert mine.attributes == {name: of for name, of in each.attributes.items() if name != "code_key"}
            assert group.values(each.name).tolist() == stored.values(each.name).tolist(), each.name
            assert group.at(each.name, [0]).tolist() == stored.at(each.name, [0]).tolist()
            assert group.stretch(each.name, 0, 1).tolist() == stored.stretch(each.name, 0, 1).tolist()
        assert (group.name, group.sweep, group.count, group.recorded) == (stored.name, stored.sweep, 6, 0)
        assert requirements.group_requirements(group) == requirements.group_requirements(stored)
        of_cases = {name: of for name, of in group.attributes.items() if name != "coordinates"}  # of recorded ones
        assert of_cases.items() <= stored.attributes.items() and group.allowed == stored.allowed != ()


def test_what_is_drawn_of_its_cases_is_what_a_report_draws(group: ArchiveGroup, archive: Path) -> None:
    with ArchiveFile(archive) as file:
        points, expected = overview(Pool("tuned", [group])), overview(Pool("tuned", file.groups))
        assert points is not None and expected is not None
        assert overview_data(points) == overview_data(expected)


def test_units_are_those_that_the_deck_wrote(group: ArchiveGroup, plan: Plan, archive: Path) -> None:
    panel = Panel("q", "", "rad", "q", (), ())
    with ArchiveFile(archive) as file:
        expected = DeckUnits(file, file.groups[0]).panel(panel)
    assert DeckUnits(plan, group).panel(panel) == expected


def test_of_cases_that_have_not_run_it_has_their_places(experiment: Experiment) -> None:
    rows = np.array([1, 4])
    found = GroupInMemory.of_metrics(experiment, rows, np.array([-1, -1]), {"volts": np.array([np.nan, 2.0])})
    assert found.values("case").tolist() == [1, 4] and found.values("status").tolist() == [-1, -1]
    assert found.count == 2 and found.values("volts")[1] == 2.0
