"""`met sensitivity`: inputs that vary as one, failures, changes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.sensitivity import sensitivities
from batch.terminal.sensitivity import as_data, sensitivity_lines
from met import cli
from met.diagnostic import Problem
from tests.batch import plans


@pytest.fixture
def archive(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    plans.answering(monkeypatch)
    return batch.run(plans.plan(plans.gains(120)), output=tmp_path / "a.h5", histories="none").path


def test_the_inputs_are_those_that_vary_and_their_order_is_by_share(archive: Path) -> None:
    with ArchiveFile(archive) as file:
        [group] = file.groups
        found = sensitivities(group)
        metrics = [each.name for each in group.role("metric")]
    assert [each.name for each in found] == metrics
    for each in found:
        lines = sensitivity_lines(each)
        assert lines[0].startswith(f"{each.name}: ")
        assert json.loads(json.dumps(as_data(each)))["name"] == each.name


ZIPPED = """
#include <two_link.ic>
sweep many of nominal {
    zip { links.upper.mass = linspace(40, 60, 10) kg;  links.lower.mass = linspace(30, 20, 10) kg; }
    vary gearbox.kp = linspace(0.02, 0.03, 8) V*s/rad;
}
"""


def test_parameters_that_are_zipped_are_one_input(tmp_path: Path) -> None:
    (tmp_path / "zipped.ic").write_text(ZIPPED)
    plan = ic.compile(tmp_path / "zipped.ic")
    with ArchiveFile(batch.run(plan, output=tmp_path / "a.h5", experiments=["many"], histories="none").path) as file:
        settle, _ = sensitivities(file.groups[0])
    assert settle.inputs == ("links.upper.mass with links.lower.mass", "gearbox.kp") and not settle.together
    assert sum(each.first for each in settle.shares) > 0.9


def test_a_metric_that_is_not_there_is_told(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with ArchiveFile(archive) as file, pytest.raises(Problem) as caught:
        sensitivities(file.groups[0], ["vols"])
    assert caught.value.diagnostics[0].code == "E362"
    assert cli.main(["sensitivity", str(archive), "failure"]) == 2
    assert "no case failed" in capsys.readouterr().err


def test_few_cases_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    plans.answering(monkeypatch)
    path = batch.run(plans.plan(plans.gains(20)), output=tmp_path / "a.h5", histories="none").path
    with ArchiveFile(path) as file, pytest.raises(Problem) as caught:
        sensitivities(file.groups[0])
    assert caught.value.diagnostics[0].code == "E361"


def test_against_itself_nothing_changes(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["sensitivity", str(archive), "--against", str(archive)]) == 0
    assert "the change of volts: the same in all cases, 120 cases" in capsys.readouterr().out
