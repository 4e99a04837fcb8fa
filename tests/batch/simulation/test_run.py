"""`Simulation.run`: values of parameters to the Dataset that an archive of the same sweep would hold."""

from __future__ import annotations

import gc
import os
import re
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import xarray

import batch
import ic
from met.diagnostic import Problem
from tests.batch.simulation.arms import ARM, NOISY


@pytest.fixture(scope="module")
def arm() -> batch.Simulation:
    return batch.Simulation(text=ARM, run="reach")


def of_archive(text: str, sweep: str, run: str, where: Path, **options: Any) -> xarray.Dataset:
    """The cases of a sweep as an archive holds them, in the name of the run that it varies."""
    archive = batch.run(ic.compile(text=text, select=sweep), output=where / "a.h5", verify="none", **options)
    with archive.open() as data:
        found = cast(xarray.Dataset, data.load())
    found.attrs["experiment"] = run
    return found


class TestLikeAnArchive:
    @pytest.mark.slow
    def test_lists_in_step_give_what_an_archive_of_the_zip_holds(self, arm: batch.Simulation, tmp_path: Path) -> None:
        data = arm.run({"gearbox.kp": [0.01, 0.02, 0.03], "load": ["10 kg", "20000 g", 30]}, histories=True)
        xarray.testing.assert_identical(data, of_archive(ARM, "in_step", "reach", tmp_path))

    @pytest.mark.slow
    def test_a_product_gives_what_an_archive_of_the_axes_holds(self, arm: batch.Simulation, tmp_path: Path) -> None:
        data = arm.run({"gearbox.kp": [0.01, 0.02, 0.03], "load": [10, 20]}, product=True)
        kept = of_archive(ARM, "each_with_each", "reach", tmp_path, histories="none")
        xarray.testing.assert_identical(data, kept)
        assert dict(data.met.grid("settle").sizes) == {"gearbox.kp": 3, "load": 2}

    @pytest.mark.release
    @pytest.mark.parametrize("deck", ["panda.ic", "free_flyer.ic", "stanford_arm.ic", "ets_vii.ic", "station_arm.ic"])
    def test_any_parameters_of_any_deck_give_what_an_archive_holds(self, deck: str, tmp_path: Path) -> None:
        sim = batch.Simulation(deck, set={"duration": "0.4 s"})
        name, known = sim.experiment.name, sim.experiment.parameters
        rng = np.random.default_rng(len(deck))
        paths = [path for path, each in known.items() if isinstance(each.value, float) and each.value and "." in path]
        for _ in range(40):
            chosen = rng.choice(paths, 3, replace=False).tolist()
            values = {path: [known[path].value, 1.001 * float(cast(float, known[path].value))] for path in chosen}
            units = {path: "" if (unit := known[path].unit) == "1" else f" {unit}" for path in chosen}
            lines = [f"vary {path} = [{one!r}, {two!r}]{units[path]};" for path, (one, two) in values.items()]
            text = f"#include <{deck}>\nsweep own_sweep of {name} {{ {' '.join(lines)} }}"
            checked = ic.check(text=text, select=["own_sweep"], set={"duration": "0.4 s"})
            if checked.plan is not None:  # else some of them change nothing, or cannot vary
                break
        assert checked.plan is not None
        with batch.run(checked.plan, output=tmp_path / "a.h5", verify="none").open() as opened:
            wanted = opened.load()
        wanted.attrs |= {"experiment": name, "deck": f"<{deck}>"}
        xarray.testing.assert_identical(sim.run(values, product=True, histories=True), wanted)

    @pytest.mark.slow
    def test_noise_is_that_of_the_decks_seed_and_repeats(self, tmp_path: Path) -> None:
        data = batch.Simulation(text=NOISY, run="noisy").run({"gearbox.kp": [0.01, 0.02]}, repeat=3, histories=True)
        xarray.testing.assert_identical(data, of_archive(NOISY, "repeated", "noisy", tmp_path))
        assert len(np.unique(data.qd.values[:3, -1, 0])) == 3

    @pytest.mark.slow
    def test_without_values_it_is_the_run_of_the_deck(self, arm: batch.Simulation, tmp_path: Path) -> None:
        xarray.testing.assert_identical(arm.run(histories=True), of_archive(ARM, "reach", "reach", tmp_path))

    @pytest.mark.slow
    def test_some_signals_are_kept_by_name(self, arm: batch.Simulation) -> None:
        whole, some = arm.run({"load": 25}, histories=True), arm.run({"load": 25}, histories=["qd"])
        assert {"qd", "q", "tau"} <= set(whole.data_vars) and {"q", "tau"}.isdisjoint(some.variables)
        np.testing.assert_array_equal(some.qd, whole.qd)
        assert "time" in some.dims and "time" not in arm.run({"load": 25}).dims

    @pytest.mark.slow
    def test_a_case_that_fails_says_why_and_leaves_the_others(self, arm: batch.Simulation) -> None:
        data = arm.run({"initial.elbow.qd": [0.0, 1e200]}, histories="q")
        assert data.status.values.tolist() == [0, 1]
        assert data.cause.values[0] == ""
        assert data.cause.values[1].startswith("t = 0.04 s: joint ")
        assert np.isnan(data.settle.values).tolist() == [False, True]
        assert np.isnan(data.q.values).any(axis=(1, 2)).tolist() == [False, True]


class TestCallAfterCall:
    @pytest.mark.slow
    def test_a_set_of_paths_is_compiled_once(self, arm: batch.Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
        from ic.driver import given_values

        first = arm.run({"load": 25, "gearbox.ki": 0.1})
        monkeypatch.setattr(given_values, "compile_deck", None)
        again = arm.run({"load": [5, 25], "gearbox.ki": 0.1})
        for name in ("case_id", "case_key", "settle", "volts"):
            assert first[name].values[0] == again[name].values[1]

    def test_results_are_each_calls_own(self, arm: batch.Simulation) -> None:
        first = arm.run({"load": 25})
        was = first.copy(deep=True)
        arm.run({"load": 5})["settle"][:] = 0.0
        first["settle"].attrs["units"] = "min"
        assert arm.run({"load": 25})["settle"].attrs["units"] == "s"
        np.testing.assert_array_equal(first["settle"], was["settle"])

    @pytest.mark.release
    def test_a_thousand_calls_leak_nothing_and_write_nothing(
        self, arm: batch.Simulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)

        def calls(count: int) -> None:
            for number in range(count):
                arm.run({"load": 10 + number % 7, "gearbox.kp": [0.01, 0.02]}, histories=bool(number % 2))
            gc.collect()

        calls(100)
        files, memory = len(os.listdir("/proc/self/fd")), resident()
        calls(1000)
        assert len(os.listdir("/proc/self/fd")) == files
        assert resident() - memory < 4 << 20  # a result with its histories has 60 kB: a tenth of them kept would show
        assert not list(tmp_path.iterdir())


def resident() -> int:
    """Bytes of memory that this process has."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


class Measured:
    """A quantity as pint has them."""

    def __init__(self, magnitude: object, units: str) -> None:
        self.magnitude, self.units = magnitude, units


VALUES = 'a value is a number in SI, a text such as "25 kg", a quantity with its unit, or a list of these'
"""What E431 says a value may be."""


def nested(depth: int) -> list[object]:
    """A list in a list in a list, so deep."""
    found: list[object] = [1.0]
    for _ in range(depth):
        found = [found]
    return found


class TestValues:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        "given",
        [
            "20 mV*s/rad",
            0.02,
            np.float64(0.02),
            Measured(20, "mV * s / rad"),
            Measured(0.02, "V*s/rad"),
            xarray.DataArray(20.0, attrs={"units": "mV*s/rad"}),
        ],
    )
    def test_one_value_has_its_unit_or_is_in_si(self, arm: batch.Simulation, given: object) -> None:
        assert arm.run({"gearbox.kp": given})["gearbox.kp"].values.tolist() == [0.02]

    @pytest.mark.parametrize(
        "given",
        [
            [10, "20 kg"],
            (10.0, np.int64(20)),
            np.array([10, 20]),
            range(10, 21, 10),
            Measured(np.array([10e3, 20e3]), "g"),
            [Measured(0.01, "t"), 20],
            xarray.DataArray([10.0, 20.0], dims="case", attrs={"units": "kg"}),
        ],
    )
    def test_a_list_has_one_value_a_case(self, arm: batch.Simulation, given: object) -> None:
        assert arm.run({"load": given})["load"].values.tolist() == [10.0, 20.0]

    @pytest.mark.slow
    def test_one_value_is_for_all_cases(self, arm: batch.Simulation) -> None:
        data = arm.run({"load": [10, 20], "gearbox.kp": 0.03})
        assert data["gearbox.kp"].values.tolist() == [0.03, 0.03]

    @pytest.mark.parametrize(
        ("values", "code", "said"),
        [
            (
                {"load": [1, 2, 3], "gearbox.kp": [0.1, 0.2]},
                "E430", "`load` has 3 values, and `gearbox.kp` 2\n"
                "  lists go in step, a case for each of their values\n"
                "  `product=True` runs each with each",
            ),
            ({"load": []}, "E430", "`load` has no value\n  one at least, or leave it out"),
            ({"load": [[1, 2]]}, "E430", "`load` has a list inside a list\n  one value a case: a list of numbers"),
            ({"load": np.ones((2, 2))}, "E430", "`load` has 2 dimensions\n  one value a case: `.ravel()` lists them"),
            ({"load": [1.0, np.nan]}, "E431", f"value 1 of `load` is not a finite number: nan\n  {VALUES}"),
            ({"load": True}, "E431", f"`load` is not a finite number: True\n  {VALUES}"),
            ({"load": "25 m"}, "E386", "`load` = '25 m' is in m; it is in kg\n  write one such as \"0.5 kg\""),
            (
                {"load": Measured(25, "furlong")},
                "E386", "`load`: unit `furlong`: `furlong` is not a unit\n  units are those of decks: `met doc units`",
            ),
            (
                {"integrator": "rk4"},
                "E434", "`integrator` is a word, not a number\n"
                "  what decides the program is set once: `batch.Simulation(..., set={\"integrator\": 'rk4'})`",
            ),
            (
                {"duration": "3 s"},
                "E434", "`duration` decides the program, and is no number that a case brings\n"
                '  `batch.Simulation(..., set={"duration": "..."})` sets it',
            ),
            (
                {"shoulder.servo": "gearbox"},
                "E434", "`shoulder.servo` decides the program, and is no number that a case brings\n"
                '  `batch.Simulation(..., set={"shoulder.servo": "..."})` sets it',
            ),
        ],
    )  # fmt: skip
    def test_what_is_no_value_is_refused(
        self, arm: batch.Simulation, values: dict[str, object], code: str, said: str
    ) -> None:
        with pytest.raises(Problem) as caught:
            arm.run(values)
        assert str(caught.value) == f"{code}: {said}"

    @pytest.mark.parametrize(
        ("given", "where", "shown"),
        [
            (10**400, "`load`", f"1{'0' * 17}...{'0' * 19}"),
            ([1, 10**400], "value 1 of `load`", f"1{'0' * 17}...{'0' * 19}"),
            pytest.param(10**5000, "`load`", "<int>", id="beyond what Python prints"),
            ("1e999 kg", "`load`", "'1e999 kg'"),
            (np.ma.array([1.0, 2.0], mask=[False, True]), "value 1 of `load`", "masked"),
            (Measured(np.ma.array([1.0, 2.0], mask=[False, True]), "kg"), "value 1 of `load`", "masked"),
            (np.array([True]), "value 0 of `load`", "np.True_"),
            (np.array([1j]), "value 0 of `load`", "np.complex128(1j)"),
            (np.array(["2020-01-01"], "M8[D]"), "value 0 of `load`", "np.datetime64('2020-01-01')"),
            (np.timedelta64(5, "s"), "`load`", "np.timedelta64(5,'s')"),
            (np.zeros(2, [("a", float)]), "value 0 of `load`", "np.void((0.0,...('a', '<f8')])"),
            (Measured("x", "kg"), "`load`", "'x'"),
            (Measured(1j, "kg"), "`load`", "1j"),
            (Measured(10**400, "kg"), "`load`", f"1{'0' * 17}...{'0' * 19}"),
            (xarray.DataArray(["a"], attrs={"units": "kg"}), "value 0 of `load`", "np.str_('a')"),
            (None, "`load`", "None"),
            ({"a": 1}, "`load`", "{'a': 1}"),
            ({1}, "`load`", "{1}"),
            (b"12", "`load`", "b'12'"),
        ],
    )
    def test_what_is_no_real_finite_number_is_refused(
        self, arm: batch.Simulation, given: object, where: str, shown: str
    ) -> None:
        with pytest.raises(Problem) as caught:
            arm.run({"load": given})
        assert str(caught.value) == f"E431: {where} is not a finite number: {shown}\n  {VALUES}"

    @pytest.mark.parametrize("given", [nested(3000), [1, [2]], [Measured([1, 2], "kg")], Measured([[1]], "kg")])
    def test_a_list_inside_a_list_is_refused(self, arm: batch.Simulation, given: object) -> None:
        with pytest.raises(Problem) as caught:
            arm.run({"load": given})
        assert str(caught.value) == "E430: `load` has a list inside a list\n  one value a case: a list of numbers"

    @pytest.mark.parametrize("values", [[1], "abc", 0, {1: 2}, {None: 1}, [("load", 1)]])
    def test_values_are_given_by_path(self, arm: batch.Simulation, values: Any) -> None:
        for call in (arm.run, lambda given: arm.start(given, commands="elbow")):
            with pytest.raises(Problem) as caught:
                call(values)
            assert str(caught.value) == (
                f"E431: values are given by the paths of parameters, and not as {values!r}\n"
                '  by path: `{"gearbox.kp": 0.02}`'
            )

    def test_a_product_that_memory_has_no_room_for_is_refused_before_it_is_made(self, arm: batch.Simulation) -> None:
        many = np.full(1_000_000, 0.1)
        with pytest.raises(Problem) as caught:
            arm.run({"load": many, "gearbox.kp": many}, product=True)
        assert str(caught.value) == (
            "E430: 1,000,000,000,000 cases take 14.6 TiB of memory\n"
            "  run fewer at once, or `batch.run` a sweep into an archive"
        )

    def test_repeats_that_memory_has_no_room_for_are_refused(self) -> None:
        with pytest.raises(Problem) as caught:
            batch.Simulation(text=NOISY, run="noisy").run(repeat=2**32 - 1)
        assert str(caught.value).startswith("E430: 4,294,967,295 cases take ")

    @pytest.mark.parametrize("name", ["repeat", "threads"])
    @pytest.mark.parametrize("given", [True, 0, -1, 1.5, float("nan"), "a", 10**400])
    def test_repeats_and_threads_are_whole_numbers(self, arm: batch.Simulation, name: str, given: object) -> None:
        with pytest.raises(Problem) as caught:
            arm.run({"load": 1}, **{name: given})  # type: ignore[arg-type]
        assert str(caught.value).startswith(f"E431: `{name}` is a whole number, at least 1 and below 2^32, and not ")

    @pytest.mark.parametrize("given", [None, 1, [None], b"q", {"q": 1}])
    def test_histories_are_names(self, arm: batch.Simulation, given: Any) -> None:
        with pytest.raises(Problem) as caught:
            arm.run({"load": 1}, histories=given)
        assert str(caught.value) == (
            f'E432: `histories` is one text or a list of texts, and not {given!r}\n  write `histories=True`, or `["q"]`'
        )

    def test_a_wrong_name_is_told_with_the_right_one(self, arm: batch.Simulation) -> None:
        with pytest.raises(Problem) as caught:
            arm.run({"gearbox.kpp": 0.1})
        assert str(caught.value) == "\n".join(
            [
                "error[D128]: no parameter `gearbox.kpp` in this run",
                " --> (given):2:6",
                "  |",
                "2 |      gearbox.kpp",
                "  |      ^^^^^^^^^^^",
                "  = help: did you mean `gearbox.kp`?",
                "",
                "1 error",
            ]
        )

    def test_messages_show_no_text_that_was_not_given(self, arm: batch.Simulation) -> None:
        shown = []
        for values, repeat in (({"gearbox.kt": -1.0}, 1), ({"shoulder.servo": "nobody"}, 1), ({"load": 1.0}, 2)):
            with pytest.raises(Problem) as caught:
                arm.run(values, repeat=repeat)
            shown.append(
                [line.partition(" | ")[2] for line in str(caught.value).splitlines() if re.match(r"\d+ [|]", line)]
            )
        assert shown == [["     gearbox.kt"], ["nobody"], ["repeat"]]

    @pytest.mark.slow
    @pytest.mark.parametrize("calls_before", [0, 1])
    def test_a_value_out_of_range_is_refused_in_every_call(self, arm: batch.Simulation, calls_before: int) -> None:
        for _ in range(calls_before):
            arm.run({"load": [1, 2], "gearbox.v_max": [20, 10]})
        for _ in range(2):
            with pytest.raises(Problem) as caught:
                arm.run({"load": [1, 2], "gearbox.v_max": [20, -10]})
            (found,) = caught.value.diagnostics
            assert (found.code, found.message.partition("; ")[2]) == ("D077", "case #1 breaks it")
            assert "case #1: load = 2 kg, gearbox.v_max = -10 V" in found.help

    def test_what_is_not_recorded_cannot_be_kept(self, arm: batch.Simulation) -> None:
        with pytest.raises(Problem) as caught:
            arm.run({"load": 1}, histories="qdd")
        (found,) = caught.value.diagnostics
        assert (found.code, str(caught.value)) == (
            "E432",
            "E432: `reach` records no `qdd`\n  did you mean `qd`?\n"
            "  the run records: q, qd, tau, shoulder.servo.voltage\n  the deck's `record` says what",
        )

    def test_histories_that_memory_has_no_room_for_are_refused(
        self, arm: batch.Simulation, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("batch.simulation.simulation.memory", lambda: 1000)
        with pytest.raises(Problem) as caught:
            arm.run({"load": [1, 2]}, histories=True)
        (found,) = caught.value.diagnostics
        assert (found.code, str(caught.value)) == (
            "E432",
            "E432: histories of 2 cases take 5.6 KiB of memory\n"
            "  run fewer at once, or `batch.run` the sweep into an archive",
        )


class TestWhichRun:
    TWO = "#include <two_link.ic>\nrun a like nominal { duration = 1 s; }\nrun b like nominal { duration = 2 s; }\n"

    SWEEP = "sweep s of a { vary reach = [1, 2] m; }"

    def test_the_only_run_or_the_default_one(self) -> None:
        assert repr(batch.Simulation("two_link.ic")) == "Simulation of `nominal` in <two_link.ic>"
        assert repr(batch.Simulation(text=self.TWO + "default run c like a {}")) == "Simulation of `c` in deck"
        only = "#include <two_link.ic>\nrun a like nominal {}\ndefault sweep s of a { vary reach = [1, 2] m; }"
        assert repr(batch.Simulation(text=only)) == "Simulation of `a` in deck"

    @pytest.mark.parametrize(
        ("more", "run", "said"),
        [
            ("", None, "this deck has 2 runs, and none is marked `default`"),
            ("default " + SWEEP, None, "this deck has 2 runs, and it marks a sweep, `s`, `default`"),
            ("", "aa", "no run `aa` in this deck"),
            (SWEEP, "s", "`s` is a sweep, and a simulation is of one run, whose values are given"),
        ],
    )
    def test_where_none_can_be_told_it_says_which_there_are(self, more: str, run: str | None, said: str) -> None:
        with pytest.raises(Problem) as caught:
            batch.Simulation(text=self.TWO + more, run=run)
        (found,) = caught.value.diagnostics
        assert (found.code, found.message) == ("E433", said)
        assert any("a" in text for text in found.help)

    def test_a_deck_is_given_by_path_or_text(self) -> None:
        for given in ({}, {"path": "two_link.ic", "text": "x"}):
            with pytest.raises(TypeError, match="a deck is given by its path or by its text"):
                batch.Simulation(**given)  # type: ignore[arg-type]

    @pytest.mark.parametrize(
        ("given", "said"),
        [
            ({"text": b"x"}, "`text` is a text, and not b'x'"),
            ({"path": 5}, "`path` is a text, and not 5"),
            ({"path": "two_link.ic", "run": 5}, "`run` is a text, and not 5"),
            ({"path": "two_link.ic", "set": 5}, "`set` is one text or a list of texts, and not 5"),
            ({"path": "two_link.ic", "set": {5: 1}}, "`set` is one text or a list of texts, and not [5]"),
            ({"path": "two_link.ic", "set": b"a=1"}, "`set` is one text or a list of texts, and not b'a=1'"),
            ({"path": "two_link.ic", "defines": 5}, "`defines` is one text or a list of texts, and not 5"),
            ({"path": "two_link.ic", "include_dirs": 5}, "`include_dirs` is one text or a list of texts, and not 5"),
        ],
    )
    def test_what_is_no_text_is_refused(self, given: dict[str, Any], said: str) -> None:
        with pytest.raises(Problem) as caught:
            batch.Simulation(**given)
        (found,) = caught.value.diagnostics
        assert (found.code, found.message) == ("E431", said)

    def test_one_text_is_one_setting(self) -> None:
        sim = batch.Simulation("two_link.ic", set="duration=1 s")
        assert sim.experiment.structure.schedule.duration == 1.0

    @pytest.mark.slow
    def test_what_is_given_comes_before_what_is_set(self) -> None:
        sim = batch.Simulation(text=ARM, run="reach", set={"gearbox.kp": "0.03 V*s/rad", "load": "5 kg"})
        data = sim.run({"gearbox.kp": [0.01, 0.02], "load": 25})
        plain = batch.Simulation(text=ARM, run="reach").run({"gearbox.kp": [0.01, 0.02], "load": 25})
        xarray.testing.assert_identical(data, plain)
        assert sim.run({"load": 25})["settle"].item() not in plain["settle"].values

    @pytest.mark.slow
    def test_a_part_of_what_is_set_may_be_given(self) -> None:
        sim = batch.Simulation("two_link.ic", set={"shoulder.servo.command": "rate(step(to = 10 mrad/s, at = 0.1 s))"})
        data = sim.run({"shoulder.servo.command.to": [0.02, 0.03]}, histories="qd")
        assert data["qd"].isel(time=-1, joint=0).values.round(6).tolist() == [0.02, 0.03]

    def test_what_decides_the_program_is_set_once(self) -> None:
        sim = batch.Simulation("two_link.ic", set={"integrator": "rk4", "duration": "1 s"})
        assert (sim.experiment.structure.integrator, sim.experiment.structure.schedule.duration) == ("rk4", 1.0)
