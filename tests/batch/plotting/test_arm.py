"""`met plot --arm`: the arm at chosen instants, with the path of its tip; and what it refuses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from batch.archive.read import ArchiveFile
from batch.plotting import arm, plot
from met import cli
from met.diagnostic import Problem
from met.messages.render import render
from tests.batch.plotting.pictures import said

DECK = """\
#include <two_link.ic>
run brief like nominal {
    duration = 2 s;  remove settle;  initial { elbow.q = 1 rad; }  record += [links.lower.position];
}
sweep lengths of brief { vary reach = [1.5, 2] m; }
run blind like brief { record = [qd, elbow.q]; }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("arm")
    (made / "deck.ic").write_text(DECK, encoding="utf-8")
    for name in ("lengths", "blind"):
        words = ["run", made / "deck.ic", name, "-q", "--no-picture", "-o", made / f"{name}.h5"]
        assert cli.main([str(word) for word in words]) == cli.YES
    return made


def refused(path: Path, **options: Any) -> str:
    with pytest.raises(Problem) as caught:
        plot(path, path.with_suffix(".png"), arm=True, **options)
    return render(caught.value.diagnostics).rpartition("\n1 error")[0]


@pytest.mark.release
def test_links_are_where_the_simulation_recorded_them(folder: Path) -> None:
    compared = 0
    with ArchiveFile(folder / "lengths.h5") as file:
        group = file.groups[0]
        for position in group.recorded_positions.tolist():
            time, channels = arm._recorded(group, position)
            scene = arm._scene(file, group, position, tuple(channels))
            numbers = arm._outputs(file, group, position, scene, channels, time)
            place = 12 * [body.name for body in scene.bodies].index("lower") + 9
            told = np.stack([channels[f"links.lower.position.{axis}"] for axis in "xyz"], axis=-1)
            assert np.abs(numbers[:, place : place + 3] - told).max() < 1e-14
            turned = channels["shoulder.q"] + channels["elbow.q"]
            reach = (1.5, 2.0)[position]
            tip = told + reach * np.stack([np.cos(turned), np.sin(turned), 0.0 * turned], axis=-1)
            assert np.abs(numbers[:, -3:] - tip).max() < 1e-14
            compared += len(time)
    assert compared == 102


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".png", ".svg"])
def test_the_same_archive_gives_the_same_picture_and_all_of_the_arm_is_in_it(
    folder: Path, ending: str, figures: list[Any]
) -> None:
    one, other = folder / f"one{ending}", folder / f"other{ending}"
    for target in (one, other):
        plot(folder / "lengths.h5", target, arm=True, cases=["#1"], at=[0.0, 2.0])
    assert one.read_bytes() == other.read_bytes()
    assert "reach = 2 m · at 0, 2 s · grid 0.5 m" in said(figures[0])
    (axes,) = figures[0].axes
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    arms = [each for each in axes.collections if each.get_zorder() >= 3]
    assert len(arms) == 2
    for drawn in arms:
        corners = np.concatenate([path.vertices for path in drawn.get_paths()])
        assert left < corners[:, 0].min() < corners[:, 0].max() < right
        assert low < corners[:, 1].min() < corners[:, 1].max() < high


@pytest.mark.slow
def test_what_cannot_be_drawn_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert refused(folder / "lengths.h5", cases=["#0"], at=[1.0, 2.5]) == (
        "error[E399]: case #0 "
        + refused(folder / "lengths.h5", cases=["#0"], at=[2.5]).split()[3]
        + " has no instant 2.5 s: its rows are from 0 s to 2 s\n"
        ' = help: `--at` takes an instant of these, `--at "1 s"`\n'
    )
    assert refused(folder / "blind.h5") == (
        "error[E370]: the arm of case #0 of `blind` cannot be shown: shoulder.q was not recorded\n"
        " = help: `record += [shoulder.q]` in the run keeps where it is; then run it again\n"
    )
    for words, words_said in (
        (["--arm", "qd"], "--arm draws an arm alone: leave out names"),
        (["--arm", "--over", "reach"], "--arm draws an arm alone: leave out --over"),
        (["--arm", "--case", "#0", "--case", "#1"], "--arm is of one case: leave all but one --case out"),
        (["--at", "1 s"], "--at is of --arm, which draws the arm at instants"),
    ):
        assert cli.main(["plot", str(folder / "lengths.h5"), *words]) == 2
        assert words_said in capsys.readouterr().err
