"""Notebooks and exports, by somebody who means them harm: what was found, each as a sentence of what should be."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import batch
import ic
from batch.export import export
from batch.terminal import running
from met import cli
from met.diagnostic import Problem, error
from met.plan import Choice
from tests.batch import plans
from tests.batch.notebook.archives import answered

BRIEF = """
#include <two_link.ic>
let reach_back = 0.3 rad;
run brief like nominal { duration = 0.4 s;  remove settle;  initial { elbow.q = reach_back; } }
run blind like brief { record = [qd]; }
sweep backs of brief { vary reach_back = [0.1, 0.2] rad; }
"""

ONE = """
#ifndef KIND
#define KIND revolute
#endif
arm one {
    link first { mass = 4 kg;  shape = rod(length = 0.5 m, along = x); }
    link tool { mass = 0 kg; }
    joint joint_1 KIND { parent = base;  child = first;  axis = z; }
    joint hold fixed { parent = first;  child = tool;  at = [AT, 0, 0] m; }
}
servo drive { model = ideal;  command = acceleration(0.1 rad/s^2); }
run swing {
    arm = one;  rates { dynamics = 500 Hz;  record = 50 Hz; }  duration = 0.1 s;  record = [q, qd];
    metric end = final { of = joint_1.q; }
}
run driven like swing { servos { joint_1 = drive; }  rates { servos = 500 Hz; } }
sweep kinds of swing { vary macro KIND = [revolute, prismatic]; }
sweep pushes of driven { vary joint_1.servo.command.value = [0.1, 0.2] rad/s^2; }
run other like swing { initial { joint_1.q = TURNED rad; } }
run blind like swing { record = [qd]; }
"""


def made(folder: Path, text: str, *names: str, output: str = "a.h5", **words: str) -> Any:
    """The open archive of runs and sweeps of a deck."""
    for word, value in {"AT": "0.5", "TURNED": "0.3", **words}.items():
        text = text.replace(word, value)
    batch.run(ic.compile(text=text, select=list(names)), output=folder / output, fresh=True)
    return batch.open(folder / output)


def swept(name: str = "gains", choice: str = "", **columns: Any) -> Any:
    """A sweep over kp, and the lower mass, with these values in its cases."""
    base = plans.gains(1)
    given = dict(zip(("kp", "mass"), base.cases.coordinates, strict=True))
    coordinates = tuple(replace(given[key], values=np.array(columns[key], float)) for key in given if key in columns)
    cases = replace(
        base.cases,
        count=len(columns["kp"]),
        coordinates=coordinates,
        repeats=columns.get("repeats"),
        positions=columns.get("positions"),
        choices=(Choice("integrator", choice),) if choice else (),
    )
    return replace(base, name=name, cases=cases, sweep="s" if choice else "")


@pytest.mark.slow
def test_an_arm_whose_joint_is_called_joint_1_has_frames_of_one_case(tmp_path: Path) -> None:
    with made(tmp_path, ONE, "pushes") as data:
        np.testing.assert_array_equal(
            data.met.frames(case="#1")["position"], data.met.frames()["position"].sel(recorded_case=1)
        )


@pytest.mark.slow
def test_a_metric_in_metres_is_not_compared_with_degrees(tmp_path: Path) -> None:
    with made(tmp_path, ONE, "kinds") as tree:
        assert [tree[name]["end"].attrs["units"] for name in ("kinds.revolute", "kinds.prismatic")] == ["rad", "m"]
        with pytest.raises(Problem):
            tree.met.sel(end="0 deg")


@pytest.mark.slow
def test_a_block_is_in_one_unit(tmp_path: Path) -> None:
    with made(tmp_path, ONE, "kinds") as tree, pytest.raises(Problem):
        tree.met.grid("end")


@pytest.mark.slow
def test_two_parameters_that_follow_from_a_third_share_its_dimension(tmp_path: Path) -> None:
    text = (
        BRIEF
        + """sweep rows of brief {
    zip { gearbox.kp = [0.01, 0.01, 0.02, 0.02] V*s/rad;  gearbox.ki = [60, 90, 60, 90] mV/rad;
          reach_back = [0.1, 0.2, 0.3, 0.4] rad; }
}
"""
    )
    with made(tmp_path, text, "rows") as data:
        grid = data.met.grid("volts")
        assert dict(grid.sizes) == {"reach_back": 4} and grid.notnull().all()
        assert grid["gearbox.ki"].values.tolist() == [0.06, 0.09, 0.06, 0.09]


@pytest.mark.slow
def test_a_structure_of_which_one_repeat_is_left_is_at_that_repeat(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = (
        swept(f"s.{choice}", choice, kp=[0.01, 0.01], repeats=np.array([0, 1]), positions=np.array(rows))
        for choice, rows in (("rk4", [0, 1]), ("midpoint", [2, 3]))
    )
    with batch.open(answered(monkeypatch, tmp_path / "a.h5", one, other)) as tree:
        grid = tree.met.sel(case=[0, 1, 2]).met.grid("volts")
        assert dict(grid.sizes) == {"integrator": 2, "repeat": 2} and grid["repeat"].values.tolist() == [0, 1]


@pytest.mark.slow
def test_the_plan_of_an_archive_of_which_the_second_run_was_changed_is_refused(tmp_path: Path) -> None:
    with made(tmp_path, ONE, "swing", "other") as tree:
        made(tmp_path, ONE, "swing", "other", TURNED="0.7").close()
        with pytest.raises(Problem, match="E389"):
            tree.met.plan  # noqa: B018


@pytest.mark.slow
def test_what_xarray_answers_is_asked_for(tmp_path: Path) -> None:
    with made(tmp_path, BRIEF, "backs") as data:
        assert data.met.sel(case=data["volts"].idxmax())["case"].item() == int(np.argmax(data["volts"].values))
        assert data.met.sel(reach_back=data["reach_back"][1])["case"].values.tolist() == [1]
        assert data.met.sel(reach_back=data["reach_back"].values[1:].reshape(()))["case"].values.tolist() == [1]


@pytest.mark.slow
def test_a_range_that_ends_at_zero_has_the_zero_that_is_rounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = -0.7 + 0.1 * np.arange(15)
    assert 0.0 < values[7] < 1e-15
    with batch.open(answered(monkeypatch, tmp_path / "a.h5", swept(kp=values + 0.0))) as data:
        assert data.met.sel({"gearbox.kp": 0})["case"].values.tolist() == [7]
        assert data.met.sel({"gearbox.kp": slice(None, 0)})["case"].values.tolist() == list(range(8))


@pytest.mark.slow
def test_a_signal_that_one_run_lacks_is_put_in_another_unit_in_the_others(tmp_path: Path) -> None:
    with made(tmp_path, ONE, "swing", "blind") as tree:
        turned = tree.met.in_units(q="deg")
        assert turned["swing"]["q"].attrs["units"] == "deg" and "qd" in turned["blind"]


@pytest.mark.release
@pytest.mark.parametrize("name", ["time", "joint"])
def test_a_parameter_called_as_a_dimension_is_unfolded(tmp_path: Path, name: str) -> None:
    with made(tmp_path, BRIEF.replace("reach_back", name), "backs") as data:
        grid = data.met.grid("q")
        assert grid.sizes == {f"coordinates.{name}": 2, "time": 11, "joint": 2}
        data.met.frames().met.grid("position")


@pytest.mark.slow
def test_a_parameter_called_position_is_no_position(tmp_path: Path) -> None:
    with made(tmp_path, BRIEF.replace("reach_back", "position"), "backs") as data:
        frames = data.met.frames(case=1)
        assert frames["position"].dims == ("time", "link", "axis") and frames["coordinates.position"].item() == 0.2


@pytest.mark.release
def test_the_archive_may_be_told_by_a_path(tmp_path: Path) -> None:
    with made(tmp_path, BRIEF, "brief") as data:
        lost = data.drop_encoding()
        lost.encoding["source"] = tmp_path / "a.h5"
        xarray.testing.assert_identical(lost.met.frames(), data.met.frames())


@pytest.mark.oracle
def test_a_parameter_called_run_is_a_column_of_parquet(tmp_path: Path) -> None:
    from pyarrow import parquet

    made(tmp_path, BRIEF.replace("reach_back", "run"), "backs").close()
    path = export(tmp_path / "a.h5", tmp_path / "a.parquet", table="histories").path
    assert parquet.read_schema(path).names[:4] == ["run", "case", "coordinates.run", "time"]


class TestStraightFromARun:
    @pytest.fixture(autouse=True)
    def here(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        Path("deck.ic").write_text(BRIEF)

    def test_an_arm_whose_q_is_not_recorded_is_refused_before_it_runs(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert cli.main(["run", "deck.ic", "blind", "-o", "x.mcap", "-q"]) == cli.BAD_INPUT
        assert "error[E370]: the arm of `blind` could not be shown in x.mcap: q is not recorded" in (
            capsys.readouterr().err
        )
        assert not Path("x.h5").exists()

    @pytest.mark.slow
    def test_an_export_that_fails_is_told_to_programs_in_one_document(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(running, "export_run", full)
        assert cli.main(["run", "deck.ic", "brief", "-o", "x.mcap", "--format", "json"]) == cli.NO
        told = json.loads(capsys.readouterr().out)
        assert told["export"] is None and "cannot write x.mcap: no space left on device" in told["notes"]

    @pytest.mark.slow
    def test_what_is_said_to_make_a_missing_export_makes_all_of_it(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(running, "export_run", full)
        assert cli.main(["run", "deck.ic", "brief", "backs", "-o", "x.csv"]) == cli.NO
        assert "`met export x.h5 --run brief --run backs -o x.csv`" in capsys.readouterr().out

    @pytest.mark.slow
    def test_what_is_said_after_an_interrupt_makes_what_was_asked_for(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def stopped(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(running, "export_run", stopped)
        cli.main(["run", "deck.ic", "brief", "-o", "x.csv"])
        assert "x.h5 is whole; x.csv is missing: `met export x.h5 -o x.csv`" in capsys.readouterr().out


def full(*_: object, **__: object) -> None:
    raise Problem(error("E305", "cannot write x.mcap: no space left on device"))
