"""Margins that a sweep requires: the same archive whoever ran it, in all that is asked of an archive."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import batch
import ic
from batch.campaigns import drive, tasks
from batch.cli.linear import linear
from met.diagnostic import Problem
from met.plan import Plan
from met.plan import file as plan_file
from tests.batch.begun import begin, go_on, short_tasks
from tests.docs.mended_servo import met

DECK = """\
arm swing {
    link bar { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo drive {
    model = rigid_gearbox;  ratio = 100;  kp = 0.1 V*s/rad;  ki = 1 V/rad;  v_max = 24 V;  resistance = 1 ohm;
    kt = 0.05 N*m/A;  tau_max = 1 N*m;  j_m = 1e-4 kg*m^2;  command = rate(0.1 rad/s);
    sensor qd = tachometer { delay = 1; }
}
run hold {
    arm = swing;  servos { hinge = drive; }  rates { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }
    duration = 1 s;  record = [q];
    metric top = peak { of = hinge.qd; }
    linear loop { at = 0.9 s;  open = hinge.servo.voltage; }
    require firm: phase_margin(loop) > 60 deg;
    require gain_margin(loop) > 4;
}
sweep gains of hold { vary drive.kp = linspace(0.1, 0.9, 12) V*s/rad; }
sweep drawn of hold {
    sample random(40) { drive.kp = uniform(0.1, 0.9) V*s/rad; }
}
search worst of hold { drive.kp = between(0.1, 0.9) V*s/rad;  minimise firm;  at_most = 40; }
tune best of hold { choose drive.kp = between(0.05, 0.9) V*s/rad;  minimise top;  at_most = 40; }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the deck, and the archive of its sweep that one thread made."""
    folder = tmp_path_factory.mktemp("margins")
    (folder / "deck.ic").write_text(DECK)
    batch.run(plan_of(folder), output=folder / "a.h5", threads=1)
    return folder


def plan_of(folder: Path, name: str = "gains") -> Plan:
    """The plan as a file keeps it, so that all are of the same bytes."""
    plan_file.write(ic.compile(folder / "deck.ic", select=[name]), folder / f"{name}.json")
    return plan_file.read(folder / f"{name}.json")


@pytest.mark.release
@pytest.mark.parametrize("how", [{"threads": 2}, {"processes": 2}])
def test_threads_and_processes_make_the_same_archive(
    how: dict[str, Any], folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks, "MOST_CASES", 5)
    monkeypatch.setattr(tasks, "GRANULE", 1)
    monkeypatch.setattr(drive, "GRANULE", 1)
    made = batch.run(plan_of(folder), output=tmp_path / "b.h5", **how).path
    assert made.read_bytes() == (folder / "a.h5").read_bytes()


@pytest.mark.slow
def test_a_campaign_that_goes_on_makes_the_same_archive(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short_tasks(monkeypatch)
    monkeypatch.setattr(tasks, "MOST_CASES", 3)
    begin(tmp_path / "b.h5", plan_of(folder), after=2)
    go_on(tmp_path / "b.h5", plan_of(folder))
    assert (tmp_path / "b.h5").read_bytes() == (folder / "a.h5").read_bytes()


@pytest.mark.slow
def test_every_case_has_what_it_has_alone(folder: Path) -> None:
    data = batch.open(folder / "a.h5")
    plan = plan_of(folder)
    for case in (0, 5, 11):
        found = batch.linear(plan, case=case, of="loop").found.loops[0]
        assert found.margins is not None
        assert float(data.firm.sel(case=case)) == found.margins.phase
        assert float(data.loop_gain_margin.sel(case=case)) == found.gains[1]
    assert data.firm.attrs["units"] == "rad" and data.firm.attrs["deck_unit"] == "deg"
    assert (data["met"].values[:, 0] == (data.firm.values > np.radians(60.0))).all()
    assert set(data["met"].values.ravel()) == {0, 1}


@pytest.mark.slow
def test_show_counts_them_and_diff_finds_none_of_its_own(folder: Path) -> None:
    said = met(folder, "show", "a.h5", status=None)
    assert "require firm: phase_margin(loop) > 60 deg  met by" in said and "phase_margin of loop" in said
    assert batch.diff(folder / "a.h5", folder / "a.h5").verdict == "identical"


@pytest.mark.slow
def test_a_diff_tells_margins_that_another_sensor_leaves(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "deck.ic").write_text(DECK.replace("delay = 1", "delay = 2"))
    batch.run(plan_of(tmp_path), output=tmp_path / "b.h5")
    found = batch.diff(folder / "a.h5", tmp_path / "b.h5")
    assert found.verdict == "different" and "firm" in str(found)


@pytest.mark.slow
def test_a_case_that_is_run_again_for_its_history_is_the_same_case(folder: Path, tmp_path: Path) -> None:
    made = batch.run(plan_of(folder), output=tmp_path / "b.h5", histories="worst:1:firm")
    data, before = made.open(), batch.open(folder / "a.h5")
    assert np.array_equal(data.firm.values, before.firm.values)
    assert data.recorded_case.values.tolist() == [int(np.argmin(before.firm.values))]


@pytest.mark.release
def test_a_summary_and_evidence_have_them(folder: Path, tmp_path: Path) -> None:
    batch.run(plan_of(folder, "drawn"), output=tmp_path / "b.h5", rows="summary")
    said = met(tmp_path, "show", "b.h5", "--evidence", "--format", "json", status=None)
    assert "firm" in json.dumps(json.loads(said))


@pytest.mark.release
def test_a_search_finds_the_least_margin_and_a_tuning_keeps_it(folder: Path, tmp_path: Path) -> None:
    """The loop has least phase at one end of its gains; a tuning goes as far as its limits let it."""
    worst = batch.run(plan_of(folder, "worst"), output=tmp_path / "w.h5").open()
    assert float(worst["drive.kp"][int(np.argmin(worst.firm.values))]) in (0.1, 0.9)
    best = batch.run(plan_of(folder, "best"), output=tmp_path / "t.h5").open()
    kept = (best["met"].values == 1).all(axis=1)
    assert kept.any() and not kept.all()
    assert (best.loop_gain_margin.values[kept] > 4.0).all()


@pytest.mark.slow
def test_a_simulation_has_them(folder: Path) -> None:
    data = batch.Simulation(folder / "deck.ic", run="hold").run({"drive.kp": [0.1, 0.9]})
    archive = batch.open(folder / "a.h5")
    assert data.firm.values == pytest.approx(archive.firm.values[[0, -1]], rel=1e-12)


def test_a_block_that_no_run_can_answer_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    """Rates that meet too seldom."""
    odd = DECK.replace("dynamics = 1 kHz;  servos = 500 Hz", "dynamics = 9973 Hz;  servos = 1009 Hz")
    odd = odd.replace("record = 100 Hz", "record = 9973 Hz;  base = 10062757 Hz")
    (tmp_path / "deck.ic").write_text(odd)
    with pytest.raises(Problem, match="tick together only every"):
        batch.run(plan_of(tmp_path, "hold"), output=tmp_path / "b.h5")
    assert not list(tmp_path.glob("b.h5*"))


@pytest.mark.release
def test_the_command_asks_what_the_deck_asks(folder: Path) -> None:
    """By name, and by itself where there is one block and no question."""
    said = met(folder, "linear", "deck.ic", "hold", "--of", "loop", status=0)
    assert said.splitlines()[0].startswith("hold: linear at t = 0.9 s") and "loop of hinge.servo.voltage" in said
    assert met(folder, "linear", "deck.ic", "hold", status=0) == said
    assert "t = 0 s" in met(folder, "linear", "deck.ic", "hold", "--at", "0 s", status=0)
    with pytest.raises(Problem, match="there is no `linear lop` in `hold`"):
        batch.linear(plan_of(folder, "hold"), of="lop")
    by_name, by_itself = (batch.linear(plan_of(folder, "hold"), of=of).found for of in ("loop", None))
    assert by_name.time == by_itself.time == 0.9 and by_itself.loops[0].margins == by_name.loops[0].margins
    assert batch.linear(plan_of(folder, "hold"), at=0.0).found.time == 0.0
    with pytest.raises(ValueError, match="`at` asks, and so does `of`, 'loop': leave one of them out"):
        batch.linear(plan_of(folder, "hold"), of="loop", at=0.0)
    both = CliRunner().invoke(linear, [str(folder / "deck.ic"), "hold", "--of", "loop", "--at", "0"])
    assert both.exit_code == 2 and "--at asks, and so does --of loop: leave one of them out" in both.output
