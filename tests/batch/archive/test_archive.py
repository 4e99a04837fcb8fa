"""The archive: what xarray sees in it, and that its bytes follow from the plan alone."""

import json
import math
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import batch
from batch.archive import limits
from batch.archive.hdf5 import put_attributes
from batch.archive.read import ArchiveFile, _plain
from batch.campaigns import tasks
from met.host.provenance import UNKNOWN, Revision
from met.plan import file as plan_file
from met.plan import keys
from tests.batch import plans

pytestmark = pytest.mark.usefixtures("engine")

ROOT = Path(__file__).parents[3]
ENGINES = ("h5netcdf", pytest.param("netcdf4", marks=pytest.mark.oracle))


def opened(path: Path, engine: str) -> Any:
    import xarray

    return xarray.open_dataset(path, engine=engine)


@pytest.mark.slow
@pytest.mark.parametrize("engine_name", ENGINES)
def test_xarray_opens_a_single_experiment_as_it_is(here: Path, engine_name: str) -> None:
    plan = plans.plan(plans.gains(7))
    batch.run(plan, output="a.h5")
    expected = plans.answer(plans.gains(7))
    with opened(here / "a.h5", engine_name) as data:
        assert dict(data.sizes) == {"case": 7, "recorded_case": 7, "time": 51, "joint": 2, "requirement": 2}
        assert data.q.dims == ("recorded_case", "time", "joint")
        assert data["shoulder.servo.voltage"].dims == ("recorded_case", "time")
        for name, values in expected.signals.items():
            np.testing.assert_array_equal(data[name], values)
        for name, values in expected.metrics.items():
            np.testing.assert_array_equal(data[name], values)
        assert list(data.joint.values) == ["shoulder", "elbow"]
        np.testing.assert_array_equal(data.time, np.arange(51) * 4 / 100.0)
        assert {"case_id", "case_key", "gearbox.kp", "links.lower.mass"} <= set(data.coords)
        assert list(data.case_id.values) == keys.case_ids(plans.gains(7))
        assert data.qd.sel(joint="elbow", recorded_case=3).attrs["units"] == "rad/s"


def test_texts_of_attributes_are_characters_of_fixed_length(here: Path) -> None:
    """netCDF takes texts of variable length for strings, which NCO does not accept as CF's `coordinates`, and Octave's
    `ncreadatt` not at all."""
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    with h5py.File("a.h5") as file:
        every = [file, file["provenance"], *file.values(), *file["provenance"].values()]
        for name, kind in ((name, node.attrs.get_id(name).get_type()) for node in every for name in node.attrs):
            single = kind.get_class() == h5py.h5t.STRING and name not in ("schema", "metric", "comparison", "CLASS")
            assert not single or not kind.is_variable_str(), name
        own = file["gearbox.kp"].attrs.get_id("units").get_type()
        assert (own.get_size(), own.get_cset()) == (len("V*s/rad"), h5py.h5t.CSET_ASCII)


def test_attributes_of_any_text_come_back(here: Path) -> None:
    texts = {"empty": "", "letters": "N·m, 3 µs", "long": "x" * 70_000, "list": ["a", "bc"], "number": 0.5}
    with h5py.File("a.h5", "w", track_order=True) as file:
        put_attributes(file, texts)
        assert {name: _plain(value) for name, value in file.attrs.items()} == texts


@pytest.mark.slow
@pytest.mark.parametrize("engine_name", ENGINES)
def test_every_variable_has_a_long_name_and_every_number_its_unit(here: Path, engine_name: str) -> None:
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    with opened(here / "a.h5", engine_name) as data:
        units = {name: data[name].attrs.get("units") for name in data.variables if data[name].dtype == float}
        assert units == {
            "gearbox.kp": "V*s/rad",
            "links.lower.mass": "kg",
            **{
                f"at_limit.{joint}.servo.{name}": "1"
                for joint in ("shoulder", "elbow")
                for name in ("v_max", "tau_max")
            },
            "settle": "s",
            "volts": "V",
            "time": "s",
            "q": "rad",
            "qd": "rad/s",
            "tau": "N*m",
            "shoulder.servo.voltage": "V",
            "recorded.gearbox.kp": "V*s/rad",
            "recorded.links.lower.mass": "kg",
        }
        assert all(data[name].attrs.get("long_name") for name in data.variables)
        assert data.q.attrs["frame"] == "about or along the joint's axis"
        assert data["links.lower.mass"].attrs["deck_unit"] == "g"


@pytest.mark.slow
@pytest.mark.parametrize("engine_name", ENGINES)
def test_a_signal_by_itself_says_what_was_varied_in_its_cases(here: Path, engine_name: str) -> None:
    batch.run(plans.plan(plans.gains(7)), output="a.h5")
    masses = plans.gains(7).cases.coordinates[1].values
    with opened(here / "a.h5", engine_name) as data:
        q = data.q
        assert {"recorded.case_id", "recorded.gearbox.kp", "recorded.links.lower.mass"} <= set(q.coords)
        heavy = q.where(q["recorded.links.lower.mass"] > 20.15, drop=True)
        assert list(heavy.recorded_case.values) == list(np.flatnonzero(masses > 20.15))
        one = q.set_xindex("recorded.gearbox.kp").sel({"recorded.gearbox.kp": 0.02}, method="nearest")
        assert one["recorded.case_id"].values == data.case_id.values[2]


def test_a_varied_parameter_whose_repeated_name_is_taken_gets_another(here: Path) -> None:
    """A sweep may vary both `servo.kp` and `recorded.servo.kp`: a definition `servo`, a joint `recorded`."""
    from dataclasses import replace

    from batch.archive.layout import layout

    experiment = plans.gains(3)
    first, second = experiment.cases.coordinates
    named = (replace(first, path="servo.kp"), replace(second, path="recorded.servo.kp"))
    experiment = replace(experiment, cases=replace(experiment.cases, coordinates=named))
    names = [variable.name for variable in layout(experiment, 3, True).variables]
    assert len(set(names)) == len(names)
    assert "recorded.recorded.servo.kp" in names


@pytest.mark.parametrize(
    ("text", "unit", "written"),
    [
        ("sag > -136 deg", "rad", ("deg", math.pi / 180)),
        ("over < 5 %", "1", ("%", 0.01)),
        ("rate <= 2*15 rpm", "rad/s", ("rpm", 0.10471975511965978)),
        ("effort < (1 + 2) kN*m", "N*m", ("kN*m", 1000.0)),
        ("slide < 20 1/s", "1/s", ("1/s", 1.0)),
        ("over < 0.05", "1", None),
        ("sag > low", "rad", None),
        ("sag > 2 * low", "rad", None),
        ("sag > 1 deg * 1 m / 1 mm", "rad", None),
        ("calm: always(abs(lag) < 2 deg/s, after = 1 s)", "rad/s", ("deg/s", math.pi / 180)),
        ("always(3 V < x and x < (1 + 1) kV) > 0.1 V", "V", ("V", 1.0)),
        ("holds_for(x < 2 deg/s, 0.2 s)", "s", None),
        ("share_of_time(x < 2 deg/s) > 95 %", "1", ("%", 0.01)),
        ("sag > -136 deg in 99 % of cases with 90 % confidence", "rad", ("deg", math.pi / 180)),
        ("over < 2 % in 99 % of cases", "1", ("%", 0.01)),
        ("percentile(over, 95 %) < 2 % with 90 % confidence", "1", ("%", 0.01)),
        ("over < 0.02 in 99 % of cases with 90 % confidence", "1", None),
    ],
)
def test_the_unit_a_requirement_is_written_in(text: str, unit: str, written: tuple[str, float] | None) -> None:
    assert limits.written_unit(text, unit) == written


@pytest.mark.release
@pytest.mark.parametrize("engine_name", ENGINES)
def test_several_experiments_are_groups_of_a_tree(here: Path, engine_name: str) -> None:
    import xarray

    batch.run(plans.plan(plans.nominal(), plans.gains(4)), output="a.h5")
    with xarray.open_datatree(here / "a.h5", engine=engine_name) as tree:
        assert list(tree.children) == ["nominal", "gains", "provenance"]
        assert tree["gains"].q.sizes["recorded_case"] == 4
        assert tree["nominal"].attrs["structure_key"] != ""


@pytest.mark.release
def test_open_gives_a_dataset_or_a_tree(here: Path) -> None:
    import xarray

    one = batch.run(plans.plan(plans.gains(2)), output="one.h5").open()
    two = batch.run(plans.plan(plans.nominal(), plans.gains(2)), output="two.h5").open()
    assert isinstance(one, xarray.Dataset)
    assert isinstance(two, xarray.DataTree)
    one.close()
    two.close()


@pytest.mark.slow
def test_the_bytes_do_not_depend_on_batches_or_the_clock(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plans.plan(plans.nominal(), plans.gains(23))
    found = set()
    for case_bytes in (1, 5, 23):
        monkeypatch.setattr(tasks, "MOST_BYTES", case_bytes * plans.gains(1).structure.history_bytes)
        batch.run(plan, output="a.h5", fresh=True)
        found.add((here / "a.h5").read_bytes())
        time.sleep(1.1)  # HDF5's times count seconds
    assert len(found) == 1


@pytest.mark.slow
def test_a_failed_case_says_why_and_is_not_a_number_from_there(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from functools import partial

    from met import run

    monkeypatch.setattr(run, "run", partial(plans.answer, fails=frozenset({2})))
    archive = batch.run(plans.plan(plans.gains(4)), output="a.h5")
    assert not archive.ok
    with archive.open() as data:
        assert list(data.status.values) == [0, 0, 1, 0]
        assert data.cause.values[2].startswith("t = 0.2 s: joint elbow: D is not above 0")
        assert list(data.cause.values[[0, 1, 3]]) == ["", "", ""]
        assert data.n_valid.values[2] == 5
        assert np.isfinite(data.q.values[2, :5]).all() and np.isnan(data.q.values[2, 5:]).all()
        assert list(data["met"].sel(requirement="volts < 5 V").values) == [0, 0, -1, 0]


def test_a_metric_that_is_not_a_number_leaves_its_requirement_open(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from met import run

    def unknown(*arguments: Any, **options: Any) -> Any:
        answer = plans.answer(*arguments, **options)
        answer.metrics["volts"][1] = np.nan
        return answer

    monkeypatch.setattr(run, "run", unknown)
    archive = batch.run(plans.plan(plans.gains(3)), output="a.h5")
    assert archive.summaries[0].requirements[1].unknown == 1


@pytest.mark.slow
def test_values_of_coordinates_are_what_the_engine_read(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from met import run

    def rounded(*arguments: Any, **options: Any) -> Any:
        answer = plans.answer(*arguments, **options)
        answer.coordinates["gearbox.kp"] = answer.coordinates["gearbox.kp"] + 1.0
        return answer

    monkeypatch.setattr(run, "run", rounded)
    with batch.run(plans.plan(plans.gains(3)), output="a.h5").open() as data:
        np.testing.assert_array_equal(data["gearbox.kp"], plans.gains(3).cases.coordinates[0].values + 1.0)


@pytest.mark.slow
def test_the_plan_and_the_deck_are_inside(here: Path) -> None:
    plan = plans.plan(plans.nominal(), plans.gains(5))
    batch.run(plan, output="a.h5")
    with ArchiveFile("a.h5") as file:
        assert plan_file.dumps(file.plan()) == plan_file.dumps(plan)
        assert file.sources() == {"two_link.ic": plan.sources[0].text}
        assert set(file.provenance) == {
            "version_met",
            "version_llvmlite",
            "version_numpy",
            "git_commit",
            "git_dirty",
            "defines",
        }


@pytest.mark.slow
def test_the_plan_of_a_large_sweep_comes_back_from_some_of_its_cases(here: Path) -> None:
    """A case that is run alone leaves the whole case table in its archive: others can be run from it."""
    plan = plans.plan(plans.gains(10_001))
    batch.run(plan, output="a.h5", cases=[17])
    with ArchiveFile("a.h5") as file:
        assert plan_file.dumps(file.plan()) == plan_file.dumps(plan)
        assert list(file.groups[0].values("case")) == [17]
        assert file.groups[0].values("case_id")[0] == keys.case_ids(plans.gains(10_001), [17])[0]


def test_dates_and_hosts_are_beside_the_archive_not_in_it(here: Path) -> None:
    import platform

    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    beside = json.loads((here / "a.h5.run.json").read_text())
    assert beside["host"] == platform.node()
    assert {"began", "seconds", "cpu", "workers", "experiments"} <= set(beside)
    inside = (here / "a.h5").read_bytes()
    assert platform.node().encode() not in inside or len(platform.node()) < 4
    assert beside["began"][:10].encode() not in inside


@pytest.mark.slow
def test_a_signal_of_some_joints_has_a_dimension_of_its_own(here: Path) -> None:
    from dataclasses import replace

    from met.plan import Recorded

    experiment = plans.gains(3)
    one = Recorded("servo.voltage", ("shoulder.servo.voltage",), ("shoulder",), ("V",), "voltage")
    structure = replace(experiment.structure, record=(experiment.structure.record[0], one))
    with ArchiveFile(
        run_with(replace(experiment, structure=structure), {"servo.voltage": "shoulder.servo.voltage"})
    ) as file:
        group = file.groups[0]
        assert group.variables["servo.voltage"].dims == ("recorded_case", "time", "joint_of_servo_voltage")
        assert group.joints(group.variables["servo.voltage"]) == ("shoulder",)


@pytest.mark.slow
def test_joints_of_unlike_kind_have_their_own_units(here: Path) -> None:
    from dataclasses import replace

    experiment = plans.gains(3)
    q = replace(experiment.structure.record[0], unit=("rad", "m"))
    path = run_with(replace(experiment, structure=replace(experiment.structure, record=(q,))), {})
    with ArchiveFile(path) as file:
        assert file.groups[0].variables["q"].units_by_joint == ("rad", "m")
        assert file.groups[0].variables["q"].unit == ""


@pytest.mark.slow
def test_a_metric_with_a_taken_name_gets_another(here: Path) -> None:
    from dataclasses import replace

    experiment = plans.nominal()
    uses = (replace(experiment.structure.metrics[0], name="time"),)
    experiment = replace(experiment, structure=replace(experiment.structure, metrics=uses), requirements=())
    with ArchiveFile(run_with(experiment, {}, {"time": "settle"})) as file:
        assert [variable.name for variable in file.groups[0].role("metric")] == ["metrics.time"]


def run_with(experiment: Any, signals: dict[str, str], metrics: dict[str, str] | None = None) -> Path:
    """An archive of an experiment whose results go by other names."""
    from unittest import mock

    from met import run

    def answer(*arguments: Any, **options: Any) -> Any:
        found = plans.answer(*arguments, **options)
        for name, source in signals.items():
            found.signals[name] = found.signals[source][:, :, None]
        for name, source in (metrics or {}).items():
            found.metrics[name] = found.metrics[source]
        return found

    with mock.patch.object(run, "run", answer):
        return batch.run(plans.plan(experiment), output="a.h5").path


OWN_NAMES = (
    "q",
    "time",
    "case",
    "status",
    "seed",
    "met",
    "joint",
    "recorded_case",
    "case_id",
    "requirement",
    "cause",
    "n_valid",
    "repeat",
    "friction_splits",
    "provenance",
    "failure",
    "volts",
)


@pytest.mark.release
@pytest.mark.parametrize("name", OWN_NAMES)
def test_a_swept_coordinate_may_be_called_as_anything_of_our_own(here: Path, name: str) -> None:
    experiment = renamed(plans.gains(3), "gearbox.kp", name)
    with batch.run(plans.plan(experiment), output="a.h5").open() as data:
        variable = name if name in ("failure", "volts") else f"coordinates.{name}"
        np.testing.assert_array_equal(data[variable], experiment.cases.coordinates[0].values)
        assert data.volts.dims == ("case",) if name != "volts" else data["metrics.volts"].dims == ("case",)
    with ArchiveFile("a.h5") as file:
        assert list(file.groups[0].coordinates_of(2)) == [name, "links.lower.mass"]


def renamed(experiment: Any, path: str, name: str) -> Any:
    """A sweep whose coordinate has another path."""
    from dataclasses import replace

    coordinates = tuple(replace(c, path=name) if c.path == path else c for c in experiment.cases.coordinates)
    nodes = tuple(("input", name) if node == ("input", path) else node for node in experiment.formulas.nodes)
    inputs = tuple(name if i == path else i for i in experiment.formulas.inputs)
    return replace(
        experiment,
        cases=replace(experiment.cases, coordinates=coordinates),
        formulas=replace(experiment.formulas, nodes=nodes, inputs=inputs),
    )


@pytest.mark.slow
def test_runs_and_metrics_may_be_called_provenance(here: Path) -> None:
    from dataclasses import replace

    batch.run(plans.plan(plans.nominal("provenance"), plans.gains(2)), output="two.h5")
    with ArchiveFile("two.h5") as file:
        assert [group.name for group in file.groups] == ["provenance", "gains"]
        assert file.sources()
        assert [experiment.name for experiment in file.plan().experiments] == ["provenance", "gains"]
    experiment = plans.nominal()
    uses = (replace(experiment.structure.metrics[0], name="provenance"),)
    experiment = replace(experiment, structure=replace(experiment.structure, metrics=uses), requirements=())
    with ArchiveFile(run_with(experiment, {}, {"provenance": "settle"})) as file:
        assert [variable.name for variable in file.groups[0].role("metric")] == ["metrics.provenance"]


# Damage


def test_whose_the_checkout_is_does_not_show_in_the_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = Revision().read()
    if plain == (UNKNOWN, UNKNOWN):
        pytest.skip("no git, or no checkout")
    git = shutil.which("git")
    (tmp_path / "git").write_text(f'#!/bin/sh\nexport GIT_TEST_ASSUME_DIFFERENT_OWNER=1\nexec {git} "$@"\n')
    (tmp_path / "git").chmod(0o755)
    refused = subprocess.run([tmp_path / "git", "describe", "--always"], cwd=ROOT, capture_output=True, text=True)
    assert "dubious ownership" in refused.stderr
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    assert Revision().read() == plain
