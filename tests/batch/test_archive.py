"""The archive: what xarray sees in it, and that its bytes follow from the plan alone."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
from batch import campaign
from batch.archive.read import ArchiveFile
from met import keys, plan_file
from met.diagnostic import Problem
from tests.batch import plans

pytestmark = pytest.mark.usefixtures("engine")

ENGINES = ("h5netcdf", "netcdf4")


def opened(path: Path, engine: str) -> Any:
    import xarray

    return xarray.open_dataset(path, engine=engine)


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


@pytest.mark.parametrize("engine_name", ENGINES)
def test_every_variable_has_a_long_name_and_every_number_its_unit(here: Path, engine_name: str) -> None:
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    with opened(here / "a.h5", engine_name) as data:
        units = {name: data[name].attrs.get("units") for name in data.variables if data[name].dtype == float}
        assert units == {
            "gearbox.kp": "V*s/rad", "links.lower.mass": "kg", "settle": "s", "volts": "V", "time": "s",
            "q": "rad", "qd": "rad/s", "tau": "N*m", "shoulder.servo.voltage": "V",
        }  # fmt: skip
        assert all(data[name].attrs.get("long_name") for name in data.variables)
        assert data.q.attrs["frame"] == "about or along the joint's axis"
        assert data["links.lower.mass"].attrs["deck_unit"] == "g"


@pytest.mark.parametrize("engine_name", ENGINES)
def test_several_experiments_are_groups_of_a_tree(here: Path, engine_name: str) -> None:
    import xarray

    batch.run(plans.plan(plans.nominal(), plans.gains(4)), output="a.h5")
    with xarray.open_datatree(here / "a.h5", engine=engine_name) as tree:
        assert list(tree.children) == ["nominal", "gains", "provenance"]
        assert tree["gains"].q.sizes["recorded_case"] == 4
        assert tree["nominal"].attrs["structure_key"] != ""


def test_open_gives_a_dataset_or_a_tree(here: Path) -> None:
    import xarray

    one = batch.run(plans.plan(plans.gains(2)), output="one.h5").open()
    two = batch.run(plans.plan(plans.nominal(), plans.gains(2)), output="two.h5").open()
    assert isinstance(one, xarray.Dataset)
    assert isinstance(two, xarray.DataTree)
    one.close()
    two.close()


def test_the_bytes_do_not_depend_on_batches_or_the_clock(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plans.plan(plans.nominal(), plans.gains(23))
    found = set()
    for case_bytes in (1, 5, 23):
        monkeypatch.setattr(campaign, "BATCH_BYTES", case_bytes * campaign.history_bytes(plans.gains(1)))
        batch.run(plan, output="a.h5")
        found.add((here / "a.h5").read_bytes())
        time.sleep(1.1)  # HDF5's times count seconds
    assert len(found) == 1


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
        assert list(data.met.sel(requirement="volts < 5 V").values) == [0, 0, -1, 0]


def test_a_metric_that_is_not_a_number_leaves_its_requirement_open(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from met import run

    def unknown(*arguments: Any, **options: Any) -> Any:
        answer = plans.answer(*arguments, **options)
        answer.metrics["volts"][1] = np.nan
        return answer

    monkeypatch.setattr(run, "run", unknown)
    archive = batch.run(plans.plan(plans.gains(3)), output="a.h5")
    assert archive.summaries[0].requirements[1].unknown == 1


def test_values_of_coordinates_are_what_the_engine_read(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from met import run

    def rounded(*arguments: Any, **options: Any) -> Any:
        answer = plans.answer(*arguments, **options)
        answer.coordinates["gearbox.kp"] = answer.coordinates["gearbox.kp"] + 1.0
        return answer

    monkeypatch.setattr(run, "run", rounded)
    with batch.run(plans.plan(plans.gains(3)), output="a.h5").open() as data:
        np.testing.assert_array_equal(data["gearbox.kp"], plans.gains(3).cases.coordinates[0].values + 1.0)


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
    assert {"began", "seconds", "cpu", "threads", "experiments"} <= set(beside)
    inside = (here / "a.h5").read_bytes()
    assert platform.node().encode() not in inside or len(platform.node()) < 4
    assert beside["began"][:10].encode() not in inside


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


def test_joints_of_unlike_kind_have_their_own_units(here: Path) -> None:
    from dataclasses import replace

    experiment = plans.gains(3)
    q = replace(experiment.structure.record[0], unit=("rad", "m"))
    path = run_with(replace(experiment, structure=replace(experiment.structure, record=(q,))), {})
    with ArchiveFile(path) as file:
        assert file.groups[0].variables["q"].units_by_joint == ("rad", "m")
        assert file.groups[0].variables["q"].unit == ""


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


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "E301: cannot read the archive a.h5: no such file or directory"),
        (b"", "E302: a.h5 is no archive of MET: it is not an HDF5 file"),
        (b"run nominal {}", "E302: a.h5 is no archive of MET: it is not an HDF5 file"),
        (b"\x89HDF\r\n\x1a\n" + b"\0" * 100, "E302: the archive a.h5 is damaged"),
    ],
)
def test_what_is_no_archive_is_refused(here: Path, content: bytes | None, said: str) -> None:
    if content is not None:
        Path("a.h5").write_bytes(content)
    with pytest.raises(Problem) as caught:
        batch.open("a.h5")
    assert [f"{d.code}: {d.message}" for d in caught.value.diagnostics] == [said]


def test_a_truncated_archive_is_refused(here: Path) -> None:
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    whole = Path("a.h5").read_bytes()
    Path("a.h5").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(Problem) as caught:
        ArchiveFile("a.h5")
    assert caught.value.diagnostics[0].code == "E302"


def test_another_hdf5_file_is_refused(here: Path) -> None:
    import h5py

    with h5py.File("other.h5", "w") as file:
        file["x"] = [1.0]
    with pytest.raises(Problem) as caught:
        ArchiveFile("other.h5")
    assert caught.value.diagnostics[0].message == "other.h5 is an HDF5 file, but no archive of MET"


def test_an_archive_of_a_newer_met_is_refused(here: Path) -> None:
    import h5py

    batch.run(plans.plan(), output="a.h5")
    with h5py.File("a.h5", "r+") as file:
        file.attrs["schema_version"] = 2
    with pytest.raises(Problem) as caught:
        ArchiveFile("a.h5")
    assert caught.value.diagnostics[0].message == "a.h5 was written by a newer MET: schema 2, known here is 1"
