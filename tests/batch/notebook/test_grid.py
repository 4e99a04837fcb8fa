"""`data.met.grid`: cases as a block, a dimension for each parameter that is varied."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import batch
import ic
from tests.batch import plans
from tests.batch.notebook.archives import TUNING, answered, made, said


@pytest.fixture(scope="module")
def tuning(tmp_path_factory: pytest.TempPathFactory) -> Iterator[xarray.Dataset]:
    with batch.open(made(tmp_path_factory.mktemp("tuning"), ["tuning"], histories="every:4")) as data:
        yield data


def of_values(**columns: Any) -> Any:
    """A sweep over kp and the lower mass with these values in its cases."""
    kp, mass = plans.gains(1).cases.coordinates
    given = {"kp": kp, "mass": mass}
    coordinates = tuple(
        replace(given[name], values=np.array(values, float)) for name, values in columns.items() if name in given
    )
    repeats = np.array(columns["repeats"]) if "repeats" in columns else None
    cases = replace(plans.gains(1).cases, count=len(coordinates[0].values), coordinates=coordinates, repeats=repeats)
    return replace(plans.gains(1), cases=cases)


def block(patch: pytest.MonkeyPatch, folder: Path, **columns: Any) -> Any:
    with batch.open(answered(patch, folder / "a.h5", of_values(**columns))) as data:
        return data.load()


@pytest.mark.slow
def test_a_product_unfolds_and_what_is_excluded_is_not_a_number(tuning: xarray.Dataset) -> None:
    volts = tuning.met.grid("volts")
    assert volts.sizes == {"gearbox.kp": 4, "gearbox.ki": 3, "links.upper.mass": 2}
    assert volts.isnull().sum() == 3 and volts.sel({"links.upper.mass": 60}).isel({"gearbox.kp": 3}).isnull().all()
    for case in range(21):
        one = tuning.isel(case=case)
        place = {path: one[path].item() for path in volts.dims}
        assert volts.sel(place).item() == one["volts"].item()
    assert volts.attrs == tuning["volts"].attrs
    assert volts["gearbox.kp"].attrs["units"] == "V*s/rad"


@pytest.mark.slow
def test_it_is_what_xarray_makes_of_the_axes(tuning: xarray.Dataset) -> None:
    axes = ["gearbox.kp", "gearbox.ki", "links.upper.mass"]
    plain = tuning[["volts"]].set_index(case=axes).unstack("case")["volts"]
    np.testing.assert_array_equal(plain.values, tuning.met.grid("volts").values)


@pytest.mark.slow
def test_what_is_varied_in_step_shares_a_dimension(tuning: xarray.Dataset) -> None:
    mass = tuning.met.grid("volts")["links.lower.mass"]
    assert mass.dims == ("links.upper.mass",) and mass.values.tolist() == [20.0, 30.0]


def test_names_give_a_dataset_and_none_all_metrics(tuning: xarray.Dataset) -> None:
    assert set(tuning.met.grid()) == {"settle", "volts"}
    both = tuning.met.grid("volts", "met", "case")
    assert both["met"].dims == (*both["volts"].dims, "requirement")
    assert both["met"].isnull().sum() == 3


def test_what_all_cases_share_is_no_dimension(tuning: xarray.Dataset) -> None:
    part = tuning.met.sel({"gearbox.kp": 0.02}).met.grid("status")
    assert part.dims == ("gearbox.ki", "links.upper.mass") and part.dtype == np.int8
    assert part["gearbox.kp"].item() == pytest.approx(0.02)
    alone = tuning.met.sel(case=["#3"]).met.grid("volts")
    assert alone.dims == () and alone.item() == tuning["volts"].values[3]


def test_signals_of_the_cases_that_have_them(tuning: xarray.Dataset) -> None:
    q = tuning.met.grid("q")
    assert q.dims[-2:] == ("time", "joint") and set(q.dims) <= {*tuning.met.grid("volts").dims, "time", "joint"}
    for case in tuning["recorded_case"].values:
        one = tuning.sel(case=case, recorded_case=case)
        np.testing.assert_array_equal(q.sel({path: one[path].item() for path in q.dims[:-2]}), one["q"])
    again = tuning[["q"]].met.grid("q")
    np.testing.assert_array_equal(again, q)


@pytest.mark.slow
def test_one_list_follows_from_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = block(monkeypatch, tmp_path, kp=[0.02, 0.02, 0.01], mass=[3, 1, 2])
    grid = data.met.grid("settle")
    assert grid.dims == ("links.lower.mass",)
    assert grid["gearbox.kp"].values.tolist() == [0.02, 0.01, 0.02]
    np.testing.assert_allclose(grid, [5.0, np.inf, 5.0])


@pytest.mark.slow
def test_repeats_are_a_dimension(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = block(monkeypatch, tmp_path, kp=[0.01, 0.01, 0.02, 0.02], repeats=[0, 1, 0, 1])
    assert data.met.grid("settle").sizes == {"gearbox.kp": 2, "repeat": 2}
    assert data.met.sel(repeat=1)["case"].values.tolist() == [1, 3]
    assert data.met.grid("cause").sel(repeat=0).values.tolist() == ["", ""]


@pytest.mark.slow
def test_words_where_there_is_no_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = block(monkeypatch, tmp_path, kp=[0.01, 0.01, 0.02], mass=[1, 2, 1])
    causes = data.met.grid("cause")
    assert causes.isnull().sum() == 1 and causes.values[0, 0] == ""


@pytest.mark.release
def test_structures_are_side_by_side(tmp_path: Path) -> None:
    with batch.open(made(tmp_path, ["brief", "ways"])) as tree:
        ways = tree.met.sel(run="ways")
        grid = ways.met.grid("volts")
        assert grid.dims == ("integrator", "gearbox.kp") and grid["integrator"].values.tolist() == ["rk4", "midpoint"]
        for name in ("rk4", "midpoint"):
            np.testing.assert_array_equal(grid.sel(integrator=name), tree[f"ways.{name}"]["volts"])
        assert said(lambda: tree.met.grid("volts")) == (
            "E388",
            "these are the cases of several: brief, ways\n  of one of them: `data.met.sel(run='brief').met.grid(...)`",
        )
        assert said(lambda: ways.met.grid("qd")) == (
            "E388",
            "`qd` is a signal, which each structure has at times of its own\n"
            "  of one structure: `data[NAME].met.grid(...)`",
        )
        assert tree["ways.rk4"].met.grid("qd").sizes == {"gearbox.kp": 2, "time": 11, "joint": 2}


@pytest.mark.release
def test_a_sum_of_sweeps_that_vary_different_things(tmp_path: Path) -> None:
    deck = tmp_path / "sum.ic"
    deck.write_text(
        TUNING
        + """
        sweep gain of brief { vary gearbox.kp = [0.03] V*s/rad; }
        sweep both = ways + gain;
    """
    )
    batch.run(ic.compile(deck, select=["both"]), output=tmp_path / "both.h5")
    with batch.open(tmp_path / "both.h5") as tree:
        grid = tree.met.grid("volts")
        assert grid.sizes == {"integrator": 3, "gearbox.kp": 2} and grid.notnull().sum() == 5
        assert sorted(grid["integrator"].values.tolist()) == ["", "midpoint", "rk4"]
        assert grid.sel({"integrator": "", "gearbox.kp": 0.03}).notnull()


@pytest.mark.slow
def test_a_single_run_has_no_dimensions(tmp_path: Path) -> None:
    with batch.open(made(tmp_path, ["brief"])) as data:
        assert data.met.grid("volts").dims == () and data.met.grid("qd").dims == ("time", "joint")


class TestMessages:
    @pytest.mark.slow
    def test_two_cases_at_one_place(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        data = block(monkeypatch, tmp_path, kp=[0.01, 0.02, 0.02, 0.01], mass=[1, 2, 2, 2])
        assert said(lambda: data.met.grid("settle")) == (
            "E388",
            "cases #1 and #2 are both at gearbox.kp = 0.02 V*s/rad, links.lower.mass = 2000 g\n"
            "  choose some by `data.met.sel(...)`, one of them by `data.met.sel(case=[...])`",
        )

    @pytest.mark.slow
    def test_samples_are_no_block(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        each = np.arange(1, 2001)
        data = block(monkeypatch, tmp_path, kp=each // 2 + 1, mass=(each + 1) // 2)
        assert said(lambda: data.met.grid("settle")) == (
            "E388",
            "2,000 cases are no block of 1001 of gearbox.kp x 1000 of links.lower.mass\n"
            "  samples are points: plot them over `data[PATH]`, or choose fewer by `data.met.sel(...)`",
        )

    def test_names_of_nothing_over_cases(self, tuning: xarray.Dataset) -> None:
        assert said(lambda: tuning.met.grid("setle"))[1].startswith(
            "no variable of cases `setle` in `tuning`\n  did you mean `settle`?\n  there are: repeat, seed, "
        )
        assert said(lambda: tuning.met.grid("time"))[1].startswith("no variable of cases `time` in `tuning`\n")

    def test_signals_beside_metrics(self, tuning: xarray.Dataset) -> None:
        assert said(lambda: tuning.met.grid("settle", "volts", "qd")) == (
            "E388",
            "one of `settle` and `qd` is a signal, which only some cases may have\n"
            "  a block of each: `data.met.grid(...)` twice",
        )

    def test_no_cases(self, tuning: xarray.Dataset) -> None:
        assert said(lambda: tuning.isel(case=[]).met.grid("settle")) == (
            "E388",
            "there are no cases of which `settle` could be",
        )
