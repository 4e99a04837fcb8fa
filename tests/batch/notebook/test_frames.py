"""`data.met.frames`: links are where the archive recorded them, where kinematics have them, and in closed form."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray

import batch
from batch.archive.read import ArchiveFile
from batch.export import poses
from batch.export.picking import pick
from met.dynamics.kinematics import link_motions
from met.program.system import System
from met.vectors import quaternion
from tests.batch import plans
from tests.batch.export import decks
from tests.batch.notebook.archives import answered, said

CLOSE = 1e-12
"""m, and of a unit quaternion: a hundred roundings of an arm of a few metres."""


@pytest.fixture(scope="module")
def reaches(tmp_path_factory: pytest.TempPathFactory) -> Iterator[xarray.Dataset]:
    """An arm of every kind of joint, whose reach is varied; it records where its links are, too."""
    with batch.open(decks.made(tmp_path_factory.mktemp("reaches"), "reaches")) as data:
        yield data


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[xarray.DataTree]:
    """Planar chains of one and of two links, turning at 3 rpm."""
    with batch.open(decks.made(tmp_path_factory.mktemp("chain"), "links", decks.CHAIN)) as tree:
        yield tree


@pytest.mark.release
def test_all_links_of_all_cases_are_where_the_archive_recorded_them(reaches: xarray.Dataset) -> None:
    frames = reaches.met.frames()
    assert frames["position"].dims == ("recorded_case", "time", "link", "axis")
    assert frames["orientation"].dims == ("recorded_case", "time", "link", "quaternion")
    assert frames["link"].values.tolist() == list(decks.LINKS)
    assert np.ptp(frames["position"].sel(link="wrist").values, axis=0).max() > 0.1  # reach is varied
    for link in decks.LINKS:
        for name, atol in (("position", CLOSE), ("orientation", CLOSE)):
            kept = reaches[f"links.{link}.{name}"]
            np.testing.assert_allclose(frames[name].sel(link=link), kept, rtol=0, atol=atol)
            for told in ("units", "long_name", "frame"):
                assert frames[name].attrs[told] == kept.attrs[told]


@pytest.mark.slow
def test_the_frames_are_those_of_the_kinematics_one_row_at_a_time(reaches: xarray.Dataset) -> None:
    frames = reaches.met.frames("tool", "lamp")
    [experiment] = reaches.met.plan.experiments
    for case, reach in enumerate(reaches["reach"].values):
        values = poses.parameters(experiment, {"reach": reach})
        tree = System(experiment).tree(lambda name, values=values: values[name.removeprefix("parameter:")])
        for row in (0, 17, 50):
            q = reaches["q"].values[case, row].tolist()
            motions = link_motions(tree, q, [0.0] * 5)
            for place, link in enumerate(("tool", "lamp")):
                pose = motions[link].pose
                here = frames.isel(recorded_case=case, time=row, link=place)
                np.testing.assert_allclose(here["position"], pose.p, rtol=0, atol=CLOSE)
                turn = np.array(quaternion(pose.R))  # whose sign is of that row alone
                sign = np.sign(turn @ here["orientation"].values)
                np.testing.assert_allclose(here["orientation"], sign * turn, rtol=0, atol=CLOSE)


@pytest.mark.slow
def test_the_frames_are_those_of_an_export(reaches: xarray.Dataset) -> None:
    with ArchiveFile(reaches.encoding["source"]) as file:
        cases = pick(file, (), ["#1"], ())
        arm = poses.arm_of(file.plan(), cases[0], "")
    stand = reaches.met.frames("stand", case="#1")
    np.testing.assert_allclose(stand["position"].isel(link=0), arm.poses["stand"].position, rtol=0, atol=CLOSE)
    np.testing.assert_allclose(stand["orientation"].isel(link=0), arm.poses["stand"].orientation, rtol=0, atol=CLOSE)


@pytest.mark.slow
def test_a_planar_arm_in_closed_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with batch.open(answered(monkeypatch, tmp_path / "a.h5", plans.gains(4))) as data:
        frames = data.met.frames()
        shoulder, elbow = (data["q"].sel(joint=joint) for joint in ("shoulder", "elbow"))
        place = frames["position"].sel(link="lower")
        np.testing.assert_allclose(place.sel(axis="x"), 2.0 * np.cos(shoulder), rtol=0, atol=CLOSE)
        np.testing.assert_allclose(place.sel(axis="y"), 2.0 * np.sin(shoulder), rtol=0, atol=CLOSE)
        assert (place.sel(axis="z") == 0.0).all() and (frames["position"].sel(link="upper") == 0.0).all()
        turn = frames["orientation"].sel(link="lower")
        np.testing.assert_allclose(turn.sel(quaternion="w"), np.cos((shoulder + elbow) / 2), rtol=0, atol=CLOSE)
        np.testing.assert_allclose(turn.sel(quaternion="z"), np.sin((shoulder + elbow) / 2), rtol=0, atol=CLOSE)


@pytest.mark.slow
def test_after_a_failure_there_are_no_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    archive = answered(monkeypatch, tmp_path / "a.h5", plans.gains(4), fails=frozenset({2}))
    with batch.open(archive) as data:
        frames = data.met.frames()
        for name in ("position", "orientation"):
            unknown = frames[name].isnull().any(("link", frames[name].dims[-1]))
            assert (unknown == frames[name].isnull().all(("link", frames[name].dims[-1]))).all()
            assert unknown.sum("time").values.tolist() == [0, 0, data.sizes["time"] - 5, 0]


@pytest.mark.slow
def test_frames_are_where_q_is_taken(reaches: xarray.Dataset) -> None:
    whole = reaches.met.frames("tool")["position"]
    rows = reaches.isel(time=slice(None, None, 10)).met.frames("tool")["position"]
    np.testing.assert_array_equal(rows, whole.isel(time=slice(None, None, 10)))
    instant = reaches.sel(time=0.5).met.frames("tool")["position"]
    assert instant.dims == ("recorded_case", "link", "axis")
    np.testing.assert_allclose(instant, whole.sel(time=0.5), rtol=0, atol=CLOSE)
    one = reaches.isel(recorded_case=2).met.frames("tool")["position"]
    assert one.dims == ("time", "link", "axis")
    np.testing.assert_allclose(one, whole.isel(recorded_case=2), rtol=0, atol=CLOSE)
    turned = reaches.transpose("joint", "time", "recorded_case", ...).met.frames("tool")["position"]
    np.testing.assert_array_equal(turned, whole)
    between = reaches[["q"]].interp(time=[0.01]).met.frames("tool")["position"].isel(time=0)
    assert 0 < abs(between - whole.isel(time=0)).max() < 0.05


@pytest.mark.slow
def test_of_one_case_of_several_and_of_those_that_are_selected(reaches: xarray.Dataset) -> None:
    whole = reaches.met.frames("tool")
    one = reaches.met.frames("tool", case="#2")
    assert one["position"].dims == ("time", "link", "axis") and one["reach"].item() == 0.5
    np.testing.assert_allclose(one["position"], whole["position"].sel(recorded_case=2), rtol=0, atol=CLOSE)
    assert reaches.met.frames(case=[2, 0])["recorded_case"].values.tolist() == [0, 2]
    far = reaches.met.sel(reach="1.1 m").met.frames("tool")
    assert far["recorded_case"].values.tolist() == [1]
    again = whole.met.sel(reach="1.1 m")  # frames say what is varied in their cases
    np.testing.assert_allclose(far["position"], again["position"], rtol=0, atol=CLOSE)


@pytest.mark.slow
def test_structures_have_their_own_links(chain: xarray.DataTree) -> None:
    frames = chain.met.frames()
    assert {name: node["link"].values.tolist() for name, node in frames.children.items()} == {
        "links.1": ["first"],
        "links.2": ["first", "second"],
    }
    assert list(chain.met.frames("second").children) == ["links.2"]
    angle = chain["links.2"]["q"].sel(joint="one")
    place = chain["links.2"].met.frames("second")["position"].isel(link=0)
    np.testing.assert_allclose(place.sel(axis="y"), 0.5 * np.sin(angle), rtol=0, atol=CLOSE)
    assert list(chain.met.frames(case="#3").children) == ["links.2"]


@pytest.mark.slow
def test_joints_that_are_recorded_one_by_one_and_in_other_units(tmp_path: Path, reaches: xarray.Dataset) -> None:
    with batch.open(decks.made(tmp_path, "apart")) as data:
        assert "q" not in data
        frames = data.met.frames("tool")
        in_degrees = data.met.in_units({"swing.q": "deg", "lift.q": "mm"}).met.frames("tool")
        np.testing.assert_allclose(in_degrees["position"], frames["position"], rtol=0, atol=CLOSE)
        nominal = reaches.met.frames("tool", case="#0")
        np.testing.assert_allclose(frames["position"].isel(recorded_case=0), nominal["position"], rtol=0, atol=CLOSE)


@pytest.mark.slow
def test_numbers_of_four_bytes(tmp_path: Path, reaches: xarray.Dataset) -> None:
    with batch.open(decks.made(tmp_path, "reaches", float32=True)) as data:
        frames = data.met.frames()
        assert data["q"].dtype == np.float32 and frames["position"].dtype == np.float64
        np.testing.assert_allclose(frames["position"], reaches.met.frames()["position"], rtol=0, atol=1e-6)


@pytest.mark.slow
def test_an_arm_whose_joints_are_all_fixed(tmp_path: Path) -> None:
    post = """
    arm post {
        link top { mass = 1 kg;  shape = rod(length = 1 m, along = x); }
        joint bolt fixed { parent = base;  child = top;  at = [1, 2, 3] m; }
    }
    run still { arm = post;  rates { dynamics = 100 Hz; }  duration = 0.1 s;  record = [links.top.position]; }
    """
    with batch.open(decks.made(tmp_path, "still", post)) as data:
        frames = data.met.frames()
        assert frames["position"].sizes == {"recorded_case": 1, "time": 11, "link": 1, "axis": 3}
        assert (frames["position"].values == [1.0, 2.0, 3.0]).all()


@pytest.mark.slow
def test_what_cannot_be_placed(reaches: xarray.Dataset, tmp_path: Path) -> None:
    assert said(lambda: reaches.met.frames("tol")) == (
        "E385",
        "no link `tol` in `reaches`\n"
        "  did you mean `tool`?\n"
        "  there are: stand, carriage, boom, wrist, pointer, tool, plate, lamp",
    )
    remedy = "  `record = [q, ...]` in the run keeps where its joints are; then run it again"
    assert said(lambda: reaches[["qd", "n_valid"]].met.frames()) == (
        "E370",
        "the links of `reaches` cannot be placed: q is not in this Dataset\n" + remedy,
    )
    assert said(lambda: reaches.sel(joint=["lift", "swing", "roll"]).met.frames()) == (
        "E370",
        "the links of `reaches` cannot be placed: point.q, pan.q is not in this Dataset\n" + remedy,
    )
    assert said(lambda: reaches.sel(joint="lift").met.frames()) == (
        "E370",
        "the links of `reaches` cannot be placed: swing.q, roll.q, point.q, pan.q is not in this Dataset\n" + remedy,
    )
    assert said(lambda: reaches[["q"]].mean("recorded_case", keep_attrs=True).met.frames()) == (
        "E389",
        "it is not known of which case this q is: `recorded_case` is gone",
    )


@pytest.mark.slow
def test_a_case_without_a_history(tmp_path: Path) -> None:
    archive = decks.made(tmp_path, "reaches", histories=["#1"])
    with batch.open(archive) as data:
        assert data.met.frames()["recorded_case"].values.tolist() == [1]
        for case in ("#2", [1, 2]):
            assert said(lambda case=case: data.met.frames(case=case)) == (
                "E328",
                "no history of case #2 of `reaches` was kept\n"
                f"  `met run {archive} --case '#2'` runs it again, to the same bits, into an archive of its own",
            )


@pytest.mark.slow
def test_orientations_do_not_jump_where_a_link_passes_half_a_turn(reaches: xarray.Dataset) -> None:
    lamp = reaches.met.frames("lamp")["orientation"].isel(link=0)  # whose q goes from 3 rad to beyond pi
    assert (lamp.sel(quaternion="w").isel(time=0) >= 0.0).all() and (lamp.sel(quaternion="w") < 0.0).any()
    assert ((lamp * lamp.shift(time=1)).sum("quaternion").isel(time=slice(1, None)) > 0.0).all()
    turned = reaches.transpose("time", ...).met.frames("lamp")["orientation"].isel(link=0)
    np.testing.assert_array_equal(turned.transpose(*lamp.dims), lamp)
    end = reaches.isel(time=-1).met.frames("lamp")["orientation"].isel(link=0)
    np.testing.assert_array_equal(end, -lamp.isel(time=-1))  # alone, it is the first: w >= 0


def test_rows_that_are_unknown_do_not_break_an_orientation() -> None:
    half = np.linspace(0.0, 5.0, 40)
    closed = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=-1)
    given = np.where(closed[:, :1] < 0.0, -closed, closed)
    given[[0, 1, 11, 12, 39]] = np.nan
    found = poses.without_sign_jumps(np.stack([given, -given], axis=1), 0)
    known = np.isfinite(given[:, 0])
    np.testing.assert_array_equal(found[known, 0], closed[known])
    np.testing.assert_array_equal(found[known, 1], -closed[known])
    assert np.isnan(found[~known]).all()
