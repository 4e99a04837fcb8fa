"""`data.met` of what was opened, however it was, and of what became of it; what was run; other units."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import batch
import batch.notebook
import ic
from tests.batch import plans
from tests.batch.notebook.archives import TUNING, answered, made, said


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("tuning"), ["tuning"], histories="every:4")


@pytest.fixture
def data(archive: Path) -> Iterator[xarray.Dataset]:
    with batch.open(archive) as data:
        yield data


@pytest.mark.slow
def test_xarray_is_loaded_by_who_opens_and_not_by_who_imports() -> None:
    script = "import sys, batch; assert 'xarray' not in sys.modules; import batch.notebook as n; n.xarray.Dataset().met"
    subprocess.run([sys.executable, "-W", "error", "-c", script], check=True)


@pytest.mark.release
@pytest.mark.parametrize("engine", ["h5netcdf", pytest.param("netcdf4", marks=pytest.mark.oracle), None])
def test_what_xarray_opens_alone_has_it_too(archive: Path, data: xarray.Dataset, engine: Any) -> None:
    with xarray.open_dataset(archive, engine=engine) as same:
        chosen = same.met.sel({"gearbox.kp": "0.03 V*s/rad"})
        assert chosen["case"].values.tolist() == [12, 13, 14, 15, 16, 17]
        xarray.testing.assert_identical(chosen.met.frames(), data.met.sel({"gearbox.kp": 0.03}).met.frames())
    with xarray.open_datatree(archive, engine=engine) as tree:
        np.testing.assert_array_equal(tree.met.grid("volts"), data.met.grid("volts"))
        np.testing.assert_array_equal(tree.met.frames("lower")["position"], data.met.frames("lower")["position"])


@pytest.mark.slow
def test_in_chunks_of_dask(archive: Path, data: xarray.Dataset) -> None:
    with batch.open(archive, chunks={}) as lazy:
        chosen = lazy.met.sel({"gearbox.kp": "0.03 V*s/rad"})
        assert chosen["qd"].chunks is not None
        xarray.testing.assert_identical(chosen.compute(), data.met.sel({"gearbox.kp": 0.03}).load())
        xarray.testing.assert_identical(lazy.met.frames().compute(), data.met.frames().compute())
        np.testing.assert_array_equal(lazy.met.grid("volts"), data.met.grid("volts"))
        assert lazy.met.in_units(qd="deg/s")["qd"].chunks is not None


@pytest.mark.slow
def test_copies_and_what_was_sent_elsewhere(data: xarray.Dataset) -> None:
    assert data.met.plan.deck.endswith("tuning.ic")
    expected = data.met.frames("lower", case=4)
    for same in (pickle.loads(pickle.dumps(data)), copy.deepcopy(data), data.copy(), data.compute()):
        xarray.testing.assert_identical(same.met.frames("lower", case=4).load(), expected.load())


@pytest.mark.release
def test_an_archive_that_is_run_anew_meanwhile(tmp_path: Path) -> None:
    archive = made(tmp_path, ["tuning"])
    with batch.open(archive) as data:
        before = data["q"].isel(recorded_case=3).values
        other = TUNING.replace("linspace(0.010, 0.040, 4)", "linspace(0.020, 0.050, 4)")
        batch.run(ic.compile(text=other, select=["tuning"]), output=archive, fresh=True)
        np.testing.assert_array_equal(data["q"].isel(recorded_case=3), before)
        assert data.met.sel({"gearbox.kp": 0.01}).sizes["case"] == 6
        told = (
            "E389",
            f"{archive} is another archive than the one that was opened\n  open it again: `batch.open(...)`",
        )
        assert said(lambda: data.met.frames()) == told
        assert said(lambda: data.met.parameters("#3")) == told
        assert said(lambda: data.met.plan) == told == said(lambda: data[["qd"]].met.sources)
    with batch.open(archive) as anew:
        assert anew.met.frames().sizes["recorded_case"] == 18


@pytest.mark.slow
def test_who_has_forgotten_the_archive_can_be_told(archive: Path, data: xarray.Dataset) -> None:
    lost = data.drop_encoding()
    assert lost.met.grid("volts").sizes["gearbox.kp"] == 4
    assert said(lambda: lost.met.frames("lower")) == (
        "E389",
        'it is not known from which archive these numbers are\n  `data.encoding["source"] = "FILE.h5"` says it',
    )
    lost.encoding["source"] = str(archive)
    xarray.testing.assert_identical(lost.met.frames("lower"), data.met.frames("lower"))


@pytest.mark.slow
def test_what_is_of_no_archive(archive: Path) -> None:
    other = xarray.Dataset({"a": ("x", [1.0, 2.0])})
    assert repr(other.met) == "a Dataset that is of no archive of MET"
    assert said(lambda: other.met.sel(a=1)) == (
        "E385",
        "this Dataset has no dimension of cases\n  one case was taken out of it, or none",
    )
    other.encoding["source"] = str(archive)
    assert said(lambda: other.met.frames()) == (
        "E389",
        "this Dataset is of no archive: it has no attribute `experiment`",
    )
    assert said(lambda: xarray.DataTree(other).met.grid()) == (
        "E389",
        "this DataTree is of no archive: nothing in it has an attribute `experiment`",
    )


class TestTheVariableOfVerdicts:
    """An archive has a variable `met`, and `data.met` is no longer it."""

    @pytest.mark.slow
    def test_it_is_had_by_its_name(self, data: xarray.Dataset) -> None:
        assert data["met"].dims == ("case", "requirement")

    @pytest.mark.slow
    def test_who_takes_one_for_the_other_is_told(self, data: xarray.Dataset) -> None:
        with pytest.raises(TypeError) as compared:
            data.met == 1  # noqa: B015
        assert str(compared.value) == '`data.met` is no variable; the one of that name, of verdicts, is data["met"]'
        with pytest.raises(AttributeError) as asked:
            data.met.values  # noqa: B018
        assert str(asked.value) == (
            '`data.met` has no `values`; the variable of that name, of verdicts, is data["met"]'
        )


class TestWhatWasRun:
    @pytest.mark.slow
    def test_the_parameters_of_a_case(self, data: xarray.Dataset, tmp_path: Path) -> None:
        table = data.met.parameters("#20")
        assert list(table.columns) == ["value", "unit", "varies", "origin", "place"]
        kp, mass, at = (table.loc[path] for path in ("elbow.servo.kp", "links.lower.inertia.zz", "elbow.at.x"))
        assert (kp["value"], kp["unit"], kp["varies"], kp["origin"]) == (0.04, "V*s/rad", True, "case")
        assert kp["place"].endswith("tuning.ic:5:10")
        assert mass["value"] == pytest.approx(20.0 * 2.0**2 / 12.0) and mass["varies"]
        assert (at["value"], at["unit"], at["varies"], at["origin"]) == (2.0, "m", False, "deck")
        assert at["place"].startswith("<two_link.ic>:")
        assert data.met.sel(case="#20").met.parameters().equals(table)
        assert said(lambda: data.met.parameters()) == (
            "E388",
            "parameters are those of one case, and here are 21\n"
            '  name one: `data.met.parameters("#0")`; of several runs, `data.met.sel(run=NAME)` before',
        )

    @pytest.mark.release
    def test_of_one_run_among_several(self, tmp_path: Path) -> None:
        with batch.open(made(tmp_path, ["brief", "ways"])) as tree:
            assert tree["brief"].met.parameters().loc["shoulder.servo.kp", "value"] == 0.02
            assert tree.met.parameters("#3").loc["shoulder.servo.kp", "value"] == 0.03
            assert said(lambda: tree.met.parameters("#0"))[1].startswith("parameters are those of one case, and ")
            assert tree["ways.rk4"].met.plan.deck == tree.met.plan.deck

    @pytest.mark.slow
    def test_the_deck_and_the_plan(self, data: xarray.Dataset) -> None:
        files = data.met.sources
        assert next(iter(files.values())) == TUNING and "<servos/rigid_gearbox.ic>" in files
        assert [experiment.name for experiment in data.met.plan.experiments] == ["tuning"]

    @pytest.mark.slow
    def test_a_few_lines_say_what_it_is(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        archive = answered(monkeypatch, tmp_path / "a.h5", plans.gains(7), plans.nominal(), fails=frozenset({3}))
        with batch.open(archive) as tree:
            told = repr(tree.met)
            assert (
                told
                == """\
gains: 7 cases, 7 with a history
  6 done, 1 failed
  require settle < 10 s: met by 5 of 7
  require volts < 5 V: met by 0 of 7
  gearbox.kp: 0.01 V*s/rad to 0.04 V*s/rad, 7 values
  links.lower.mass: 20000 g, 20100 g, 20200 g
nominal: 1 case, 1 with a history
  1 done
  require settle < 10 s: met by 1 of 1"""
            )
            one = tree["gains"].to_dataset().met.sel(case=4)
            assert repr(one.met) == "gains: case #4"
            assert repr(tree["gains"].to_dataset()[["q"]].met).splitlines()[0] == "gains: histories of 7 cases"


class TestUnits:
    @pytest.mark.slow
    def test_a_signal_in_another_unit(self, data: xarray.Dataset) -> None:
        turned = data.met.in_units(qd="deg/s", time="ms")
        np.testing.assert_allclose(turned["qd"], np.degrees(data["qd"]), rtol=1e-15)
        assert turned["qd"].attrs == {**data["qd"].attrs, "units": "deg/s"}
        assert turned["qd"].sel(time=400.0).sizes == data["qd"].sel(time=0.4).sizes
        assert turned["q"].attrs == data["q"].attrs

    @pytest.mark.slow
    def test_as_the_deck_writes_them(self, data: xarray.Dataset) -> None:
        deck = data.met.in_units()
        assert deck["gearbox.ki"].attrs["units"] == "mV/rad"
        assert np.unique(deck["gearbox.ki"]).tolist() == [60, 125, 250]
        assert deck["recorded.links.lower.mass"].values.max() == 20000
        assert set(deck.coords) == set(data.coords)
        assert deck.met.grid("volts")["gearbox.ki"].attrs["units"] == "mV/rad"
        xarray.testing.assert_identical(
            deck["volts"].drop_vars(list(deck["volts"].coords)), data["volts"].drop_vars(list(data["volts"].coords))
        )

    @pytest.mark.slow
    def test_a_selection_knows_them(self, data: xarray.Dataset) -> None:
        deck = data.met.in_units()
        for value in ("125 mV/rad", "0.125 V/rad", 125):
            assert deck.met.sel({"gearbox.ki": value}).sizes["case"] == 7
        assert said(lambda: deck.met.sel({"gearbox.ki": 0.125})) == (
            "E387",
            'no case has `gearbox.ki` = 0.125 mV/rad\n  nearest are: "60 mV/rad", "125 mV/rad"',
        )

    @pytest.mark.slow
    def test_of_several(self, tmp_path: Path) -> None:
        with batch.open(made(tmp_path, ["ways"])) as tree:
            turned = tree.met.in_units({"gearbox.kp": "mV*s/rad"})
            assert [node["gearbox.kp"].values.tolist() for node in turned.children.values()] == [[20, 30], [20, 30]]

    @pytest.mark.slow
    def test_units_that_cannot_be(self, data: xarray.Dataset) -> None:
        assert said(lambda: data.met.in_units(qd="rad")) == ("E386", "`qd` cannot be in rad; it is in rad/s")
        assert said(lambda: data.met.in_units(qd="rads")) == (
            "E386",
            "`qd`: unit `rads`: `rads` is not a unit; `rad`?\n  units are those of decks: `met doc units`",
        )
        assert said(lambda: data.met.in_units(status="s")) == ("E386", "`status` cannot be in s; it is in 1")
        assert said(lambda: data.met.in_units(qdd="deg/s^2"))[1].startswith("no variable `qdd` in `tuning`\n")

    @pytest.mark.slow
    def test_joints_that_have_units_of_their_own(self, tmp_path: Path) -> None:
        from tests.batch.export import decks

        with batch.open(decks.made(tmp_path, "pick")) as data:
            assert said(lambda: data.met.in_units(qd="deg/s")) == (
                "E386",
                "`qd` has units of its own at each joint: m/s, rad/s",
            )
