"""`data.met.sel`: cases by what is varied in them, by their names, by how they ended; signals follow."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import batch
from tests.batch import plans
from tests.batch.notebook.archives import answered, made, said


@pytest.fixture(scope="module")
def tuning(tmp_path_factory: pytest.TempPathFactory) -> Iterator[xarray.Dataset]:
    """21 cases; of #0, #4, #8, #12, #16, #20 there are histories."""
    with batch.open(made(tmp_path_factory.mktemp("tuning"), ["tuning"], histories="every:4")) as data:
        yield data


@pytest.fixture(scope="module")
def ways(tmp_path_factory: pytest.TempPathFactory) -> Iterator[xarray.DataTree]:
    with batch.open(made(tmp_path_factory.mktemp("ways"), ["ways"])) as tree:
        yield tree


@pytest.fixture
def gains(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[xarray.Dataset]:
    """Seven cases with kp from 0.01 to 0.04; the first never settles, #3 fails."""
    with batch.open(answered(monkeypatch, tmp_path / "a.h5", plans.gains(7), fails=frozenset({3}))) as data:
        yield data


def rows(data: xarray.Dataset) -> list[int]:
    return data["case"].values.tolist()


@pytest.mark.release
@pytest.mark.parametrize("value", [0.02, "0.02 V*s/rad", "20 mV*s/rad", "20 N*mm/A", np.float64(0.02), 0.02000000001])
def test_a_value_may_have_any_unit_and_the_rounding_of_who_types_it(tuning: xarray.Dataset, value: Any) -> None:
    chosen = tuning.met.sel({"gearbox.kp": value})
    assert rows(chosen) == [6, 7, 8, 9, 10, 11]
    np.testing.assert_allclose(chosen["gearbox.kp"], 0.02, rtol=1e-15)


@pytest.mark.slow
def test_signals_are_cut_as_cases_are(tuning: xarray.Dataset) -> None:
    chosen = tuning.met.sel({"gearbox.kp": 0.02})
    assert chosen["recorded_case"].values.tolist() == [8] == chosen["qd"]["recorded_case"].values.tolist()
    xarray.testing.assert_identical(chosen["qd"].load(), tuning["qd"].sel(recorded_case=[8]).load())
    xarray.testing.assert_identical(chosen["settle"].load(), tuning["settle"].isel(case=slice(6, 12)).load())
    none = tuning.met.sel(case=[1, 2])
    assert rows(none) == [1, 2] and none.sizes["recorded_case"] == 0


@pytest.mark.slow
def test_several_values_ranges_and_names_hold_together(tuning: xarray.Dataset) -> None:
    kp, ki = "gearbox.kp", "gearbox.ki"
    assert rows(tuning.met.sel({kp: [0.01, "0.04 V*s/rad"], ki: "125 mV/rad"})) == [2, 3, 19]
    assert rows(tuning.met.sel({kp: slice("0.03 V*s/rad", None), "links.lower.mass": "30 kg"})) == [13, 15, 17]
    assert rows(tuning.met.sel({kp: slice(0.02, 0.03), ki: slice(None, 0.06)})) == [6, 7, 12, 13]
    assert rows(tuning.met.sel({kp: np.array([0.01]), "links.lower.mass": "20000 g"}, case=slice(2, 6))) == [2, 4]
    assert rows(tuning.met.sel({kp: 0.04, "links.upper.mass": 60})) == []  # excluded by the deck


@pytest.mark.slow
def test_a_metric_chooses_too_and_what_never_comes_is_beyond_every_range(gains: xarray.Dataset) -> None:
    np.testing.assert_allclose(gains["settle"][:3], [np.inf, 10 / 1.5, 5])
    assert rows(gains.met.sel(settle=slice(None, "6000 ms"))) == [2, 4, 5, 6]
    assert rows(gains.met.sel(settle=slice("5 s", None))) == [0, 1, 2]
    assert rows(gains.met.sel(settle=slice(np.inf, None))) == [0]


@pytest.mark.slow
def test_how_cases_ended(gains: xarray.Dataset) -> None:
    assert rows(gains.met.sel(failed=True)) == [3]
    assert rows(gains.met.sel(failed=False)) == [0, 1, 2, 4, 5, 6]
    assert (gains["met"].values == [[0, 0], [1, 0], [1, 0], [-1, -1], [1, 0], [1, 0], [1, 0]]).all()
    assert rows(gains.met.sel(met=True)) == []
    assert rows(gains.met.sel(missed=True)) == [0, 1, 2, 4, 5, 6]
    assert rows(gains.isel(requirement=[0]).met.sel(met=True)) == [1, 2, 4, 5, 6]
    assert rows(gains.isel(requirement=0).met.sel(missed=True)) == [0]
    assert rows(gains.met.sel(missed=False)) == [3]


def test_one_case_by_its_name_is_no_dimension_any_more(tuning: xarray.Dataset) -> None:
    case_id = str(tuning["case_id"].values[8])
    for name in (8, "#8", case_id, case_id[:10]):
        one = tuning.met.sel(case=name)
        assert "case" not in one.dims and "recorded_case" not in one.dims
        np.testing.assert_array_equal(one["qd"], tuning["qd"].sel(recorded_case=8))
        assert one["gearbox.kp"].item() == one["recorded.gearbox.kp"].item() == tuning["gearbox.kp"].values[8]
    assert rows(tuning.met.sel(case=["#8"])) == [8]
    without = tuning.met.sel(case="#7")
    assert without["settle"].dims == () and "qd" not in without


def test_signals_alone_are_chosen_by_what_is_repeated_along_them(tuning: xarray.Dataset) -> None:
    signals = tuning[["qd"]]
    assert "case" not in signals.dims
    assert signals.met.sel({"gearbox.kp": "0.02 V*s/rad"})["recorded_case"].values.tolist() == [8]
    assert signals.met.sel(case="#4")["qd"].dims == ("time", "joint")
    case_id = str(tuning["case_id"].values[4])
    assert int(signals.met.sel(case=case_id)["recorded_case"]) == 4
    assert signals.met.sel(case=slice(5, 15))["recorded_case"].values.tolist() == [8, 12]


def test_a_selection_of_a_selection(tuning: xarray.Dataset) -> None:
    some = tuning.isel(case=slice(5, None))
    assert rows(some.met.sel({"gearbox.kp": 0.01})) == [5]
    assert some.met.sel({"gearbox.ki": 0.06})["recorded_case"].values.tolist() == [12]


class TestOfSeveral:
    @pytest.mark.slow
    def test_structures_are_chosen_by_a_word(self, ways: xarray.DataTree) -> None:
        found = ways.met.sel(integrator="midpoint")
        assert list(found.children) == ["ways.midpoint"]
        assert rows(ways.met.sel({"gearbox.kp": 0.03}, integrator="rk4")["ways.rk4"]) == [1]
        assert list(ways.met.sel(integrator=["rk4", "midpoint"]).children) == ["ways.rk4", "ways.midpoint"]

    @pytest.mark.slow
    def test_a_value_is_cut_out_of_every_structure(self, ways: xarray.DataTree) -> None:
        found = ways.met.sel({"gearbox.kp": "0.03 V*s/rad"})
        assert {name: rows(node) for name, node in found.children.items()} == {"ways.rk4": [1], "ways.midpoint": [3]}
        assert found.attrs == ways.attrs

    @pytest.mark.slow
    def test_a_position_is_in_one_structure(self, ways: xarray.DataTree) -> None:
        found = ways.met.sel(case="#2")
        assert list(found.children) == ["ways.midpoint"] and found["ways.midpoint"]["qd"].dims == ("time", "joint")

    @pytest.mark.slow
    def test_a_node_by_itself(self, ways: xarray.DataTree) -> None:
        node = ways["ways.midpoint"]
        assert rows(node.met.sel({"gearbox.kp": 0.03})) == [3]
        assert rows(node.to_dataset().met.sel({"gearbox.kp": 0.03})) == [3]

    @pytest.mark.release
    def test_a_run_or_a_sweep(self, tmp_path: Path) -> None:
        with batch.open(made(tmp_path, ["brief", "ways"])) as tree:
            assert list(tree.met.sel(run="ways").children) == ["ways.rk4", "ways.midpoint"]
            assert list(tree.met.sel(run=["brief", "ways.rk4"]).children) == ["brief", "ways.rk4"]
            assert said(lambda: tree.met.sel(run="way")) == (
                "E325",
                "no run or sweep `way` here\n  there are: brief, ways",
            )

    def test_messages_are_about_all_structures(self, ways: xarray.DataTree) -> None:
        assert said(lambda: ways.met.sel(integrator="rk5")) == (
            "E387",
            "no case has `integrator` = rk5\n  did you mean `rk4`?\n  there are: rk4, midpoint",
        )
        assert said(lambda: ways.met.sel(case="#4")) == (
            "E321",
            "no case `#4` in `ways`\n  cases here: #0 to #3; or the beginning of a case_id",
        )
        ids = [case_id for name in ("ways.rk4", "ways.midpoint") for case_id in ways[name]["case_id"].values]
        assert said(lambda: ways.met.sel(case="")) == (
            "E322",
            f"case `` may be any of 4: {', '.join(ids)}\n  give more of its id",
        )


class TestMessages:
    def test_a_name_that_nothing_has(self, tuning: xarray.Dataset) -> None:
        there = "there are: gearbox.kp, gearbox.ki, links.upper.mass, links.lower.mass, settle, volts, case, failed, "
        assert said(lambda: tuning.met.sel({"gearbox.kpp": 0.02})) == (
            "E385",
            f"no parameter or metric `gearbox.kpp` in `tuning`\n  did you mean `gearbox.kp`?\n  {there}met, missed",
        )
        assert said(lambda: tuning.met.sel(time=1.0)) == (
            "E385",
            "no parameter or metric `time` in `tuning`\n"
            "  `time` is a dimension: `data.sel(time=...)`\n"
            f"  {there}met, missed",
        )

    def test_a_value_that_no_case_has(self, tuning: xarray.Dataset) -> None:
        assert said(lambda: tuning.met.sel({"gearbox.ki": "130 mV/rad"})) == (
            "E387",
            'no case has `gearbox.ki` = 130 mV/rad\n  nearest are: "60 mV/rad", "125 mV/rad"',
        )
        assert said(lambda: tuning.met.sel({"links.lower.mass": [20, 25000]})) == (
            "E387",
            "no case has `links.lower.mass` = 25000 kg\n"
            '  nearest are: "20000 g", "30000 g"\n'
            "  a number alone is in kg, as the values here are",
        )

    @pytest.mark.slow
    def test_what_is_nearest_can_be_typed(self, gains: xarray.Dataset) -> None:
        third = (gains["gearbox.kp"] / 3.0).assign_attrs(gains["gearbox.kp"].attrs)
        gains = gains.assign_coords({"gearbox.kp": third})
        message = said(lambda: gains.met.sel({"gearbox.kp": "0.004 V*s/rad"}))
        nearest = message[1].rpartition("nearest are: ")[2].split(", ")
        assert len(nearest) == 2
        for number, text in enumerate(nearest):
            assert rows(gains.met.sel({"gearbox.kp": text.strip('"')})) == [number]

    @pytest.mark.parametrize(
        ("value", "message"),
        [
            ("0.02 s", "`gearbox.kp` = '0.02 s' is in s; it is in V*s/rad\n  write one such as \"0.5 V*s/rad\""),
            ("0.02", "`gearbox.kp` = '0.02' has no unit; it is in V*s/rad\n  write one such as \"0.5 V*s/rad\""),
            (
                "0.02 Vs",
                "`gearbox.kp`: unit `Vs`: `Vs` is not a unit; `V*s`?\n  units are those of decks: `met doc units`",
            ),
            ("much", "`gearbox.kp` = 'much' cannot be read\n  write a number and its unit, such as \"0.5 V*s/rad\""),
            (True, '`gearbox.kp` = True: it must be a number\n  write a number, or a text such as "0.5 V*s/rad"'),
            (slice(0.01, 0.02, 2), "`gearbox.kp`: a range of values has no step\n  `slice(first, last)`"),
        ],
    )
    def test_a_value_that_cannot_be_one(self, tuning: xarray.Dataset, value: Any, message: str) -> None:
        assert said(lambda: tuning.met.sel({"gearbox.kp": value})) == ("E386", message)

    def test_other_values_that_cannot_be(self, tuning: xarray.Dataset, ways: xarray.DataTree) -> None:
        assert said(lambda: tuning.met.sel(failed="yes")) == ("E386", "`failed` = 'yes': it is True or False")
        assert said(lambda: tuning.met.sel(case=7.5)) == (
            "E386",
            '`case` = 7.5 names no case\n  a position, 7; "#7"; or the beginning of a case_id',
        )
        assert said(lambda: ways.met.sel(integrator=slice("a", "b"))) == (
            "E386",
            "`integrator` is a word: it has no range\n  write a list of words",
        )

    def test_cases_that_there_are_not(self, tuning: xarray.Dataset) -> None:
        assert said(lambda: tuning.met.sel(case="#21")) == (
            "E321",
            "no case `#21` in `tuning`\n  cases here: #0 to #20; or the beginning of a case_id",
        )
        assert said(lambda: tuning.met.sel({"gearbox.kp": 0.01}, case="#20")) == (
            "E387",
            "case '#20' is none of those that are chosen by the other values",
        )
        assert said(lambda: tuning.isel(case=0, recorded_case=0).met.sel(case=0)) == (
            "E385",
            "this Dataset has no dimension of cases\n  one case was taken out of it, or none",
        )

    def test_what_a_part_of_a_dataset_does_not_say(self, tuning: xarray.Dataset) -> None:
        assert said(lambda: tuning[["settle"]].met.sel(failed=True)) == (
            "E385",
            "how cases ended is not in this Dataset: it lacks the variable `status`",
        )
        assert said(lambda: tuning[["settle", "status"]].met.sel(met=True)) == (
            "E385",
            "how cases ended is not in this Dataset: it lacks the variable `met`\n"
            "  a run that requires nothing has none",
        )

    def test_nothing_is_said_of_where_in_met_it_was_noticed(self, tuning: xarray.Dataset) -> None:
        from met.diagnostic import Problem

        with pytest.raises(Problem) as caught:
            tuning.met.sel(case="#21")
        assert [entry.name for entry in caught.traceback][1:] == ["outer"]
        assert caught.value.__suppress_context__
