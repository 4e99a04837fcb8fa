"""Signals over time: which panels, lines, colours and commands are in a picture."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.plotting import draw
from batch.plotting.layout import COLOURS, FLAT, PictureSheet
from tests.batch import plans
from tests.batch.plotting.pictures import archive, shown

pytestmark = pytest.mark.usefixtures("engine")


@pytest.mark.slow
def test_a_case_has_a_panel_a_signal_and_a_line_a_joint(here: Path, figures: list[Any]) -> None:
    with archive(1) as file:
        assert draw(file, "a.png") == Path("a.png")
    axes = shown(figures[0])
    assert [ax.get_ylabel() for ax in axes] == ["q  (rad)", "qd  (rad/s)", "tau  (N·m)", "shoulder.servo.voltage\n(V)"]
    assert [len(ax.lines) for ax in axes] == [2, 2, 2, 1]
    assert axes[-1].get_xlabel() == "time  (s)"
    assert figures[0].get_suptitle().strip() == "two_link.ic · nominal"
    np.testing.assert_array_equal(axes[1].lines[1].get_ydata(), plans.answer(plans.nominal()).signals["qd"][0, :, 1])


@pytest.mark.slow
def test_a_joint_has_one_colour_in_all_panels(here: Path, figures: list[Any]) -> None:
    with archive(1) as file:
        draw(file, "a.png", ["qd", "elbow.q", "shoulder.servo.voltage"])
    colours = [[line.get_color() for line in ax.lines] for ax in shown(figures[0])]
    assert colours == [[COLOURS[0], COLOURS[1]], [COLOURS[1]], [COLOURS[0]]]


@pytest.mark.slow
def test_few_cases_are_overlaid_and_named_by_what_varies(here: Path, figures: list[Any]) -> None:
    with archive(3) as file:
        draw(file, "a.png", ["qd"])
    left, right = shown(figures[0])
    assert len(left.lines) == len(right.lines) == 3
    words = [text.get_text() for text in figures[0].legends[0].get_texts()]
    assert figures[0].legends[0].get_title().get_text() == "gearbox.kp  (V·s/rad) ·\nlinks.lower.mass  (g)"
    assert words == ["0.01 · 20000", "0.025 · 20100", "0.04 · 20200"]


@pytest.mark.slow
def test_cases_that_are_told_apart_by_how_faint_they_are_have_a_key(here: Path, figures: list[Any]) -> None:
    with archive(3) as file:
        draw(file, "a.png", ["qd", "shoulder.servo.voltage"], sheet=PictureSheet(width=2.9))
    [legend] = figures[0].legends
    keys = dict(zip([text.get_text() for text in legend.get_texts()], legend.get_lines(), strict=True))
    cases = [text for text in keys if text.startswith("gearbox.kp = ")]
    assert len(cases) == 3 and cases[0] == "gearbox.kp = 0.01 V·s/rad, links.lower.mass = 20000 g"
    drawn = [line.get_alpha() for line in figures[0].axes[-1].lines if line.get_alpha() is not None]
    assert [keys[text].get_alpha() for text in cases] == drawn == [1.0, 0.625, 0.25]


@pytest.mark.slow
def test_joints_of_unlike_unit_stand_beside_one_another(here: Path, figures: list[Any]) -> None:
    with mixed(3) as file:
        draw(file, "a.png")
    axes = shown(figures[0])
    assert [ax.get_title("left") for ax in axes] == [
        "shoulder · joint position",
        "elbow · joint position",
        "shoulder · voltage on the drive motor",
    ]
    assert [ax.get_ylabel() for ax in axes] == ["q  (rad)", "q  (m)", "servo.voltage\n(V)"]
    assert [ax.get_xlabel() for ax in axes] == ["", "time  (s)", "time  (s)"]
    left, right = axes[:2]
    assert left.get_ylim() != right.get_ylim()


def mixed(cases: int) -> ArchiveFile:
    """A shoulder that turns and an elbow that slides, and the shoulder's voltage."""
    from dataclasses import replace

    experiment = plans.gains(cases)
    q, _, _, voltage = experiment.structure.record
    record = (replace(q, unit=("rad", "m")), voltage)
    batch.run(plans.plan(replace(experiment, structure=replace(experiment.structure, record=record))), output="a.h5")
    return ArchiveFile("a.h5")


def commanded(cases: int, monkeypatch: pytest.MonkeyPatch, slope: float = 0.0, fails: int = -1) -> ArchiveFile:
    """The shoulder's commanded rate is recorded: 0.03 rad/s, and `slope` more in each case; one case may break off."""
    from dataclasses import replace

    from met import run
    from met.plan import Recorded

    def answer(*arguments: Any, **options: Any) -> Any:
        found = plans.answer(*arguments, **options, fails=frozenset({fails}))
        asked = 0.03 + slope * found.case[:, None] + 0.0 * found.time[None, :]
        found.signals["shoulder.servo.command"] = np.where(np.isnan(found.signals["qd"][:, :, 0]), np.nan, asked)
        return found

    monkeypatch.setattr(run, "run", answer)
    experiment = plans.gains(cases)
    command = Recorded(
        "shoulder.servo.command", ("shoulder.servo.command",), (), ("rad/s",), "rate command of the servo"
    )
    structure = replace(experiment.structure, record=(*experiment.structure.record[:3], command))
    batch.run(plans.plan(replace(experiment, structure=structure)), output="a.h5")
    return ArchiveFile("a.h5")


def dashed(ax: Any) -> list[Any]:
    return [line for line in ax.lines if line.is_dashed() and len(line.get_xdata())]


@pytest.mark.release
def test_a_command_is_drawn_over_what_follows_it_and_nowhere_else(
    here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    for cases, chosen in ((3, ()), (40, ()), (40, ("#3",))):
        with commanded(cases, monkeypatch) as file:
            draw(file, "a.png", cases=chosen)
        axes = shown(figures[-1])
        over = [ax for ax in axes if dashed(ax)]
        assert len(over) == 1
        assert "joint rate" in over[0].get_title("left")
        np.testing.assert_array_equal(dashed(over[0])[0].get_ydata(), np.full(51, 0.03))
        assert not any("rate command" in ax.get_title("left") for ax in axes)


@pytest.mark.slow
def test_commands_that_differ_have_their_cases_colours(
    here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    with commanded(3, monkeypatch, slope=0.01) as file:
        draw(file, "a.png", ["shoulder.qd"])
    [ax] = shown(figures[0])
    assert [line.get_ydata()[0] for line in dashed(ax)] == pytest.approx([0.03, 0.04, 0.05])
    assert [line.get_color() for line in dashed(ax)] == [line.get_color() for line in ax.lines[:3]]


@pytest.mark.slow
def test_a_command_is_shared_by_a_case_that_broke_off(
    here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    with commanded(12, monkeypatch, fails=0) as file:
        draw(file, "a.png", ["qd"])
    [line] = dashed(shown(figures[0])[0])
    assert np.isfinite(line.get_ydata()).all()


@pytest.mark.slow
def test_a_fan_of_unlike_commands_leaves_them_a_panel(
    here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    with commanded(12, monkeypatch, slope=0.01) as file:
        draw(file, "a.png")
    axes = shown(figures[0])
    assert not any(dashed(ax) for ax in axes)
    assert any("rate command" in ax.get_title("left") for ax in axes)


@pytest.mark.slow
def test_many_cases_are_a_fan(here: Path, figures: list[Any]) -> None:
    with archive(40) as file:
        draw(file, "a.png", ["qd"])
    left, _ = shown(figures[0])
    assert len(left.lines) == 1 and len(left.collections) == 2
    values = plans.answer(plans.gains(40)).signals["qd"][:, :, 0]
    np.testing.assert_allclose(left.lines[0].get_ydata(), np.median(values, axis=0), rtol=1e-15)


@pytest.mark.slow
def test_one_case_of_a_sweep_is_named(here: Path, figures: list[Any]) -> None:
    with archive(40) as file:
        draw(file, "a.png", ["qd"], cases=["#3"])
    words = [text.get_text() for text in figures[0].texts]
    assert any(text.startswith("case #3 ") and "gearbox.kp = 0.01231 V·s/rad" in text for text in words)


@pytest.mark.slow
def test_a_case_that_breaks_off_is_marked(here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    from functools import partial

    from met import run

    monkeypatch.setattr(run, "run", partial(plans.answer, fails=frozenset({0})))
    with archive(1) as file:
        draw(file, "a.png", ["shoulder.qd"])
    [ax] = shown(figures[0])
    assert [line.get_marker() for line in ax.lines] == ["None", "x"]
    assert ax.lines[1].get_xdata()[0] == pytest.approx(0.16)  # the fifth row, the last that is valid


@pytest.mark.slow
def test_the_legend_is_outside_of_the_data(here: Path, figures: list[Any]) -> None:
    for cases in (1, 3):
        with archive(cases) as file:
            draw(file, "a.png", ["qd"])
        figure = figures[-1]
        boxes = [ax.get_window_extent() for ax in shown(figure)]
        legends = [*figure.legends, *(ax.get_legend() for ax in shown(figure) if ax.get_legend())]
        assert legends
        for legend in legends:
            drawn = legend.get_window_extent()
            assert all(drawn.x0 >= box.x1 for box in boxes)
            assert drawn.x1 <= figure.bbox.x1


@pytest.mark.slow
def test_a_row_that_is_zero_throughout_is_low_and_the_others_are_not(
    here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    from batch.plotting import histories as module

    real = module.history
    monkeypatch.setattr(
        module, "history", lambda group, panel, position: real(group, panel, position) * (panel.name != "qd")
    )
    with archive(1) as file:
        draw(file, "a.png", ["q", "qd"])
    rows = figures[0].axes[0].get_subplotspec().get_gridspec()
    assert [ax.get_ylabel() for ax in shown(figures[0])] == ["q  (rad)", "qd  (rad/s)"]
    assert rows.get_height_ratios() == [1.0, FLAT]


@pytest.mark.slow
def test_under_many_panels_the_legend_is_there_again(here: Path, figures: list[Any]) -> None:
    with archive(1) as file:
        draw(file, "a.png", ["q", "qd", "tau", "q", "qd", "tau"])
    assert [ax.get_legend() is not None for ax in shown(figures[0])] == [True, False, False, False, True, False]
