"""Vectors and derived signals in archives of real runs: layout, units, labels, and how they are shown and drawn."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.plotting import draw
from batch.plotting.layout import COLOURS
from batch.queries.signals import Panel, history, panels
from batch.terminal.show import show
from met import run as engine
from met.diagnostic import Problem

DECK = """
arm crane {
    link mast { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    link sled { mass = 1 kg;  shape = sphere(radius = 0.1 m);  com = [0.2, 0, 0.1] m; }
    link hook { mass = 1 kg;  shape = sphere(radius = 0.1 m); }
    joint y revolute  { parent = base;  child = mast;  axis = y; }
    joint x prismatic { parent = mast;  child = sled;  axis = x; }
    joint tie fixed   { parent = mast;  child = hook;  at = [1, 0, 0] m; }
}
run swing {
    arm         = crane;
    initial     { y.q = 0.2 rad;  x.qd = 0.3 m/s; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates       { dynamics = 1 kHz;  record = 100 Hz; }
    duration    = 0.2 s;
    record      = [q, J_eff, reaction, energy, momentum, x.b, links.sled.position, links.sled.orientation,
                   links.sled.jacobian, links.hook.jacobian, mode];
    metric axis = max { of = links.sled.position.x; }
}
sweep masses of swing { vary links.sled.mass = [1, 2, 3] kg; }
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("vectors")
    (folder / "crane.ic").write_text(DECK)
    made = {}
    for name in ("swing", "masses"):
        made[name] = folder / f"{name}.h5"
        batch.run(ic.compile(folder / "crane.ic", select=[name]), output=made[name])
    return made


@pytest.fixture
def one(files: dict[str, Path]) -> Iterator[ArchiveFile]:
    with ArchiveFile(files["swing"]) as file:
        yield file


@pytest.fixture
def sweep(files: dict[str, Path]) -> Iterator[ArchiveFile]:
    with ArchiveFile(files["masses"]) as file:
        yield file


@pytest.mark.slow
def test_plain_xarray_finds_joints_and_components_by_name(files: dict[str, Path]) -> None:
    before = ("recorded_case", "time")
    with xarray.open_dataset(files["masses"]) as data:
        dims = {
            "q": (*before, "joint"), "J_eff": (*before, "joint"), "mode": (*before, "joint"),
            "reaction.moment": (*before, "joint", "axis"), "reaction.force": (*before, "joint", "axis"),
            "energy.kinetic": before, "energy.potential": before, "x.b": before,
            "momentum.linear": (*before, "axis"), "momentum.angular": (*before, "axis"),
            "links.sled.position": (*before, "axis"), "links.sled.orientation": (*before, "quaternion"),
            "links.sled.jacobian.angular": (*before, "joint", "axis"),
            "links.sled.jacobian.linear": (*before, "joint", "axis"),
            "links.hook.jacobian.angular": (*before, "joint_of_links_hook", "axis"),
            "links.hook.jacobian.linear": (*before, "joint_of_links_hook", "axis"),
        }  # fmt: skip
        assert {str(name): data[name].dims for name in data if data[name].attrs["role"] == "signal"} == dims
        assert data.joint.values.tolist() == ["y", "x"]
        assert data.axis.values.tolist() == ["x", "y", "z"] and data["quaternion"].values.tolist() == [*"wxyz"]
        assert data["joint_of_links_hook"].values.tolist() == ["y"]
        assert data["metrics.axis"].dims == ("case",), "a metric whose name is a dimension's gets another"
        force = data["reaction.force"].sel(joint="y", recorded_case=2)
        assert force.sel(axis="z")[0] > 0.0, "the base carries the arm"
        position = data["links.sled.position"].sel(axis="x")
        assert data["metrics.axis"].values.tolist() >= position.max("time").values.tolist()


@pytest.mark.slow
def test_units_and_frames_are_told(files: dict[str, Path]) -> None:
    with xarray.open_dataset(files["swing"]) as data:
        told = {name: dict(data[name].attrs) for name in data}
    assert told["J_eff"]["units_by_joint"] == ["kg*m^2", "kg"] and "units" not in told["J_eff"]
    assert told["links.sled.jacobian.linear"]["units_by_joint"] == ["m/rad", "1"]
    assert told["links.sled.jacobian.angular"]["units_by_joint"] == ["1", "rad/m"]
    assert told["links.hook.jacobian.linear"]["units"] == "m/rad"
    assert {name: told[name]["units"] for name in ("reaction.moment", "reaction.force", "x.b", "mode")} == {
        "reaction.moment": "N*m",
        "reaction.force": "N",
        "x.b": "N",
        "mode": "1",
    }
    assert told["momentum.angular"]["units"] == "kg*m^2/s" and told["energy.potential"]["units"] == "J"
    assert told["reaction.moment"]["frame"] == "link axes, about the link frame's origin"
    assert told["links.sled.position"]["frame"] == "world axes" and "frame" not in told["energy.kinetic"]


@pytest.mark.slow
def test_the_archive_holds_what_the_engine_gave(files: dict[str, Path]) -> None:
    run = engine.run(ic.compile(text=DECK, select=["masses"]).experiments[0])
    with xarray.open_dataset(files["masses"]) as data:
        for name, values in run.signals.items():
            assert data[name].values.tobytes() == np.ascontiguousarray(values).tobytes(), name


def brief(found: list[Panel]) -> list[tuple[str, str, tuple[str, ...]]]:
    return [(panel.name, panel.unit, panel.lines) for panel in found]


def test_a_vector_of_joints_has_a_panel_a_component_and_others_a_line(one: ArchiveFile) -> None:
    (group,) = one.groups
    assert brief(panels(group, ["reaction.force", "links.sled.orientation", "energy"])) == [
        *((f"reaction.force.{axis}", "N", ("y", "x")) for axis in "xyz"),
        ("links.sled.orientation", "1", ("w", "x", "y", "z")),
        ("energy.kinetic", "J", ("",)),
        ("energy.potential", "J", ("",)),
    ]
    assert brief(panels(group, ["links.sled.jacobian.linear"]))[:2] == [
        ("links.sled.jacobian.linear.x", "m/rad", ("y",)),
        ("links.sled.jacobian.linear.x", "1", ("x",)),
    ]


def test_a_part_of_a_vector_is_asked_for_by_its_name(one: ArchiveFile) -> None:
    (group,) = one.groups
    forces = group.signal("reaction.force", 0)
    for name, lines, values in (
        ("x.reaction.force", ("x", "y", "z"), forces[:, 1]),
        ("x.reaction.force.z", ("",), forces[:, 1, 2:]),
        ("reaction.force.z", ("y", "x"), forces[:, :, 2]),
        ("links.sled.position.z", ("",), group.signal("links.sled.position", 0)[:, 2:]),
        ("links.sled.jacobian.linear.y", ("x", "y", "z"), group.signal("links.sled.jacobian.linear", 0)[:, 0]),
        ("links.sled.jacobian.linear.y.z", ("",), group.signal("links.sled.jacobian.linear", 0)[:, 0, 2:]),
    ):
        (panel,) = panels(group, [name])
        assert (panel.name, panel.lines) == (name, lines)
        np.testing.assert_array_equal(history(group, panel, 0), values)
    assert [panel.name for panel in panels(group, ["x.reaction"])] == ["x.reaction.moment", "x.reaction.force"]


def test_a_component_that_is_not_there(one: ArchiveFile) -> None:
    with pytest.raises(Problem) as caught:
        panels(one.groups[0], ["links.sled.position.w"])
    (diagnostic,) = caught.value.diagnostics
    assert (diagnostic.code, diagnostic.message) == ("E324", "no signal `links.sled.position.w` in `swing`")
    assert diagnostic.help[0].startswith("did you mean `links.sled.position.")
    assert diagnostic.help[1].startswith("signals here: q, J_eff, reaction.moment, reaction.force, energy.kinetic, ")
    assert diagnostic.help[1].endswith("links.hook.jacobian.linear, mode; `<joint>.q` is one joint's")


def test_a_terminal_shows_components_by_their_names(one: ArchiveFile) -> None:
    lines = show(one, ["links.sled.position"], width=72).splitlines()
    rows = [line.split() for line in lines if line.strip().startswith("links.sled.position")]
    assert [row[1] for row in rows] == ["x", "y", "z"], lines


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The figures that were drawn, kept for a look at what is in them."""
    from batch.plotting import output as module

    kept: list[Any] = []
    monkeypatch.setattr(module, "save", lambda figure, output: kept.append(figure))
    return kept


def shown(figure: Any) -> list[Any]:
    return [ax for ax in figure.axes if ax.get_visible()]


@pytest.mark.slow
def test_components_have_colours_in_turn_and_joints_their_own(
    one: ArchiveFile, figures: list[Any], tmp_path: Path
) -> None:
    draw(one, tmp_path / "a.png", ["links.sled.position", "x.reaction.force", "reaction.force.z", "x.b"])
    colours = [[COLOURS.index(line.get_color()) for line in ax.lines] for ax in shown(figures[0])]
    assert colours == [[0, 1, 2], [0, 1, 2], [0, 1], [1]]


@pytest.mark.slow
def test_cases_of_a_vector_have_a_plot_a_component(sweep: ArchiveFile, figures: list[Any], tmp_path: Path) -> None:
    draw(sweep, tmp_path / "a.png", ["q", "x.reaction.force", "links.sled.position"])
    axes = shown(figures[0])
    assert [(ax.get_title("left"), ax.get_ylabel().replace("\n", " ")) for ax in axes] == [
        ("y · joint position", "q  (rad)"),
        ("x · joint position", "q  (m)"),
        *(("x · force that the joint exerts on its link, link axes", f"reaction.force.{axis} (N)") for axis in "xyz"),
        *(
            ("position of the origin of the link's frame, world axes", f"links.sled.position.{axis} (m)")
            for axis in "xyz"
        ),
    ]
    assert all(len(ax.lines) == 3 for ax in axes)


@pytest.mark.slow
def test_many_cases_are_a_fan_of_each_component(files: dict[str, Path], figures: list[Any], tmp_path: Path) -> None:
    batch.run(
        ic.compile(text=DECK.replace("[1, 2, 3] kg", "linspace(1, 3, 12) kg"), select=["masses"]),
        output=tmp_path / "a.h5",
    )
    with ArchiveFile(tmp_path / "a.h5") as file:
        draw(file, tmp_path / "a.png", ["links.sled.position"])
        middle = np.median([file.groups[0].signal("links.sled.position", i)[:, 2] for i in range(12)], axis=0)
    axes = shown(figures[0])
    assert [len(ax.collections) for ax in axes] == [2, 2, 2]
    np.testing.assert_allclose(axes[2].lines[0].get_ydata(), middle, rtol=1e-15)
