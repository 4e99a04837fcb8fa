"""`met sensitivity`: inputs that vary as one, failures, changes, cases of a design made for it, what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.sensitivity import sensitivities
from batch.terminal.sensitivity import as_data, sensitivity_lines
from met import cli
from met.diagnostic import Problem
from met.statistics.saltelli import saltelli_shares
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


@pytest.mark.slow
def test_parameters_that_are_zipped_are_one_input(tmp_path: Path) -> None:
    plan = ic.compile(text=ZIPPED)
    with ArchiveFile(batch.run(plan, output=tmp_path / "a.h5", experiments=["many"], histories="none").path) as file:
        settle, _ = sensitivities(file.groups[0])
    assert settle.inputs == ("links.upper.mass with links.lower.mass", "gearbox.kp") and not settle.together
    assert sum(each.first for each in settle.shares) > 0.9


DEPENDENT = """
#include <two_link.ic>
run brief like nominal { rates { dynamics = 100 Hz; servos = 100 Hz; record = 20 Hz; } duration = 5 s; record = []; }
sweep many of brief {
    vary links.upper.mass = linspace(40, 60, 8) kg;
    vary links.lower.mass = linspace(20, 30, 8) kg;
    vary gearbox.kp = linspace(0.02, 0.03, 3) V*s/rad;
    exclude when links.upper.mass + 2 * links.lower.mass > 100 kg;
}
"""


@pytest.mark.slow
def test_parameters_that_depend_on_each_other_have_no_intervals(tmp_path: Path) -> None:
    plan = ic.compile(text=DEPENDENT, select=["many"])
    with ArchiveFile(batch.run(plan, output=tmp_path / "a.h5", histories="none").path) as file:
        [settle, *_] = sensitivities(file.groups[0], ["settle"])
    by_name = dict(zip(settle.inputs, settle.shares, strict=True))
    assert np.isnan(by_name["links.upper.mass"].first_by) and np.isnan(by_name["links.lower.mass"].total_high)
    assert by_name["gearbox.kp"].first_by > 0.0
    lines = sensitivity_lines(settle)
    [mass] = [line for line in lines if "links.upper.mass  " in line]
    assert "±" not in mass
    assert any("their shares overlap, and have no interval" in line for line in lines)
    assert as_data(settle)["inputs"][0]["first_by"] is None


def test_a_metric_that_is_not_there_is_told(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with ArchiveFile(archive) as file, pytest.raises(Problem) as caught:
        sensitivities(file.groups[0], ["vols"])
    assert caught.value.diagnostics[0].code == "E362"
    assert cli.main(["sensitivity", str(archive), "failure"]) == 2
    assert "no case failed" in capsys.readouterr().err


@pytest.mark.slow
def test_few_cases_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    plans.answering(monkeypatch)
    path = batch.run(plans.plan(plans.gains(20)), output=tmp_path / "a.h5", histories="none").path
    with ArchiveFile(path) as file, pytest.raises(Problem) as caught:
        sensitivities(file.groups[0])
    assert caught.value.diagnostics[0].code == "E361"


def test_against_itself_nothing_changes(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["sensitivity", str(archive), "--against", str(archive)]) == 0
    assert "the change of volts: the same in all cases, 120 cases" in capsys.readouterr().out


SALTELLI = """
#include <two_link.ic>
run brief like nominal { rates { dynamics = 100 Hz; servos = 100 Hz; record = 20 Hz; } duration = 5 s; record = []; }
sweep made of brief {
    VARY
    sample saltelli(64) { gearbox.kp = uniform(0.015, 0.025) V*s/rad; gearbox.ki = uniform(0.05, 0.125) V/rad; }
}
"""


def made(folder: Path, vary: str = "", **options: Any) -> Path:
    plan = ic.compile(text=SALTELLI.replace("VARY", vary), select=["made"])
    return batch.run(plan, output=folder / "made.h5", histories="none", **options).path


@pytest.mark.slow
def test_cases_of_saltelli_are_estimated_as_their_design_has_it(tmp_path: Path) -> None:
    with ArchiveFile(made(tmp_path)) as file:
        [group] = file.groups
        found = next(each for each in sensitivities(group) if each.name == "volts")
        values = [group.values(each.name) for each in group.role("coordinate")]
        wanted = saltelli_shares(values, group.values("volts"))
    assert wanted is not None and found.shares == wanted.inputs
    assert (found.design, found.inputs, found.cases, found.left) == ("saltelli", ("gearbox.kp", "gearbox.ki"), 256, 0)
    said = sensitivity_lines(found)
    assert "  note: by the estimators of `saltelli`; with others: with any number of them, and with noise" in said


@pytest.mark.slow
def test_a_pair_of_points_with_a_case_that_failed_is_left_out(tmp_path: Path) -> None:
    path = made(tmp_path)
    with h5py.File(path, "r+") as file:
        file["volts"][5] = np.nan
    with ArchiveFile(path) as file:
        found = next(each for each in sensitivities(file.groups[0]) if each.name == "volts")
    assert (found.cases, found.left) == (252, 4)
    assert sensitivity_lines(found) == [
        "volts: not enough cases, 252 cases; 4 have no finite value, or are of a pair of points of which one has none; "
        "256 at least"
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("vary", "spoilt", "why"), [
    ("vary links.lower.mass = [20, 30] kg;", False, "more varies than was drawn by `saltelli`"),
    ("", True, "not all cases of `saltelli` are there"),
])  # fmt: skip
def test_of_other_cases_than_saltelli_s_the_estimators_for_any_are_used(
    tmp_path: Path, vary: str, spoilt: bool, why: str
) -> None:
    path = made(tmp_path, vary)
    if spoilt:
        with h5py.File(path, "r+") as file:
            file["gearbox.kp"][7] = 0.016
    with ArchiveFile(path) as file:
        found = sensitivities(file.groups[0])[0]
    assert (found.design, found.why) == ("", why)
    assert f"  note: {why}: estimated as from any cases" in sensitivity_lines(found)


IDLE = """
arm a {
    link l { mass = 2 kg;  shape = rod(length = 0.5 m, along = x); }
    link m { mass = 2 kg;  shape = rod(length = 0.5 m, along = x); }
    joint s revolute { parent = base;  child = l;  axis = z; }
    joint e revolute { parent = l;  child = m;  axis = z; }
}
let p = 0.5;
let idle = 0.5;
servo d { model = ideal;  bandwidth = 20 1/s;  command = position(p * 1 rad); }
run brief {
    arm = a;  servos { s = d;  e = d { command = position(idle * 1 rad); } }
    rates { dynamics = 100 Hz;  servos = 100 Hz; }
    duration = 1 s;  record = [];
    metric turn = final { of = s.q; }
}
sweep drawn of brief { sample saltelli(64) { p = uniform(0.4, 0.6);  idle = uniform(0, 1); } }
sweep grid of brief { vary p = linspace(0.4, 0.6, 8);  vary idle = linspace(0, 1, 8); }
"""


@pytest.mark.slow
def test_means_that_drawn_cases_do_not_tell_apart_are_not_said_and_those_of_a_grid_are_equal(tmp_path: Path) -> None:
    (tmp_path / "idle.ic").write_text(IDLE)
    said = {}
    for name in ("drawn", "grid"):
        plan = ic.compile(tmp_path / "idle.ic", select=[name])
        with ArchiveFile(batch.run(plan, output=tmp_path / f"{name}.h5", histories="none").path) as file:
            lines = sensitivity_lines(sensitivities(file.groups[0], ["turn"])[0])
        said[name] = {line.split()[0]: line for line in lines}
    assert "no difference seen" in said["drawn"]["idle"] and " .. " in said["drawn"]["p"]
    [low, high] = [word for word in said["grid"]["idle"].split() if word.startswith("0.")][-2:]
    assert low == high and " rad " in said["grid"]["idle"]
