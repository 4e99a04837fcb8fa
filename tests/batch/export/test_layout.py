"""The layout beside an export opens on panels whose every path is in the export."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import batch
from batch.export import export
from met.diagnostic import Problem
from tests.batch import plans
from tests.batch.export.decks import Mcap, made, said


def leaves(layout: Any) -> Iterator[str]:
    """The panels of a layout's tree, from left to right and from the top down."""
    if isinstance(layout, str):
        yield layout
    else:
        assert 0 < layout["splitPercentage"] < 100 and layout["direction"] in ("row", "column")
        yield from leaves(layout["first"])
        yield from leaves(layout["second"])


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Mcap, dict[str, Any]]:
    """An export of two cases, and its layout."""
    folder = tmp_path_factory.mktemp("layout")
    done = export(made(folder, "reaches"), folder / "a.b.mcap", cases=["#1", "#0"], layout=True)
    assert done.layout == folder / "a.b.layout.json"
    return Mcap(done.path), json.loads(done.layout.read_text("utf-8"))


@pytest.mark.release
def test_it_opens_on_the_arm_beside_plots_and_the_log(written: tuple[Mcap, dict[str, Any]]) -> None:
    _, layout = written
    assert list(leaves(layout["layout"])) == ["3D!arm", "Plot!q", "Plot!qd", "Plot!tau", "RosOut!log"]
    assert set(layout["configById"]) == set(leaves(layout["layout"]))
    assert layout["layout"]["first"] == "3D!arm"


@pytest.mark.slow
def test_every_topic_and_field_that_it_names_is_in_the_file(written: tuple[Mcap, dict[str, Any]]) -> None:
    read, layout = written
    view, log = layout["configById"]["3D!arm"], layout["configById"]["RosOut!log"]
    assert set(view["topics"]) == {"/case0/scene", "/case1/scene"} and set(view["topics"]) < read.topics()
    assert view["followTf"] == view["layers"]["grid"]["frameId"] == "world"
    assert log["topicToRender"] in read.topics()
    for signal in ("q", "qd", "tau"):
        paths = layout["configById"][f"Plot!{signal}"]["paths"]
        assert len(paths) == 2 * 5
        for path in paths:
            topic, field = path["value"].split(".")
            assert field in read.of(topic)[0].data.DESCRIPTOR.fields_by_name


@pytest.mark.slow
def test_a_joint_has_one_colour_and_ghosts_are_faint(written: tuple[Mcap, dict[str, Any]]) -> None:
    plots = [panel["paths"] for name, panel in written[1]["configById"].items() if name.startswith("Plot!")]
    colours = [[path["color"] for path in paths] for paths in plots]
    assert colours[0] == colours[1] == colours[2]
    assert len(set(colours[0][:5])) == 5 and colours[0][5:] == [f"{colour}55" for colour in colours[0][:5]]
    assert [path["label"] for path in plots[0]][4:6] == ["case1 pan", "case0 lift"]


@pytest.mark.slow
def test_units_are_in_the_titles(written: tuple[Mcap, dict[str, Any]]) -> None:
    panels = written[1]["configById"]
    assert panels["Plot!tau"]["foxglovePanelTitle"] == panels["Plot!tau"]["lichtblickPanelTitle"] == "tau (N, N·m)"


def test_other_signals_are_shown_where_those_are_not(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    batch.run(plans.plan(), output="a.h5")
    export("a.h5", signals=["shoulder.servo.voltage"], layout=True)
    layout = json.loads(Path("a.layout.json").read_text("utf-8"))
    assert list(leaves(layout["layout"])) == ["3D!arm", "Plot!shoulder.servo.voltage", "RosOut!log"]
    [path] = layout["configById"]["Plot!shoulder.servo.voltage"]["paths"]
    assert (path["value"], path["label"]) == ("/shoulder/servo/voltage.value", "shoulder.servo.voltage")


@pytest.mark.slow
def test_a_layout_that_was_changed_is_kept(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    batch.run(plans.plan(), output="a.h5")
    export("a.h5", layout=True)
    export("a.h5", layout=True)  # the same one
    place = Path("a.layout.json")
    place.write_text(place.read_text("utf-8").replace("55", "60"), encoding="utf-8")
    with pytest.raises(Problem) as caught:
        export("a.h5", layout=True)
    assert said(caught.value) == (
        "error[E374]: a.layout.json exists, and may hold work that is not in the archive: it is not written over\n"
        " = help: give another name with `-o`, or say `--force`\n"
        "\n1 error\n"
    )
    export("a.h5", layout=True, force=True)


def test_tables_have_no_layout(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    batch.run(plans.plan(), output="a.h5")
    with pytest.raises(Problem) as caught:
        export("a.h5", "a.csv", layout=True)
    assert said(caught.value) == (
        "error[E375]: a layout shows an MCAP file, and a.csv is none\n"
        " = help: `-o FILE.mcap` writes one, and its layout\n"
        "\n1 error\n"
    )
