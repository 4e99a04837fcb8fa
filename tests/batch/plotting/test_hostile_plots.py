"""Pictures of archives that mean ill: what is lost, told wrongly or refused without a word that helps."""

from __future__ import annotations

import os
import shutil
import xml.dom.minidom
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from batch.plotting import plot
from batch.plotting.maps import DOTTED, STRIPES
from met import run as engine
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import Experiment
from met.plan.judged import Requirement
from tests.batch import plans
from tests.batch.plotting.pictures import cells, shown
from tests.batch.report import archives

pytestmark = pytest.mark.usefixtures("engine")

KP, MASS = [0.01, 0.02, 0.03, 0.04, 0.05], [10.0, 20.0, 30.0, 40.0, 50.0]


def settling(patch: pytest.MonkeyPatch, values: Sequence[float]) -> None:
    """From now on `settle` of case n is the n-th of these, over and over; `volts` is 1 V."""

    def answer(experiment: Experiment, *args: Any, **options: Any) -> Any:
        found = plans.answer(experiment, *args, **options)
        found.metrics["settle"][:] = np.asarray(values, float)[found.case % len(values)]
        found.metrics["volts"][:] = 1.0
        for each in experiment.requirements:
            found.met[each.text] = plans.COMPARE[each.comparison](found.metrics[each.metric], each.limit)
        return found

    patch.setattr(engine, "run", partial(answer))


def made(
    patch: pytest.MonkeyPatch, path: str, experiment: Experiment, values: Sequence[float] = (1.0,), **options: Any
) -> None:
    settling(patch, values)
    archives.made(Path(path), experiment, **{"histories": "none", **options})


def scattered(count: int) -> Experiment:
    """Samples of two parameters."""
    one = plans.gains(count)
    kp, mass = one.cases.coordinates
    rows = np.arange(count)
    coordinates = replace(kp, values=0.01 + 0.001 * rows), replace(mass, values=1.0 + rows * 7 % count)
    return replace(one, cases=replace(one.cases, coordinates=coordinates))


def legend(figure: Any) -> list[str]:
    return [text.get_text() for each in figure.legends for text in each.get_texts()]


class TestPoints:
    @pytest.mark.slow
    @pytest.mark.parametrize("values", [[np.inf, 2.0, 3.0, 4.0, np.nan], [np.inf]])
    def test_on_the_edge_are_within_the_axis(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch, values: list[float]
    ) -> None:
        made(monkeypatch, "a.h5", plans.gains(5), values)
        plot("a.h5", names=["settle"], over=["gearbox.kp"])
        figures[0].canvas.draw()
        low, high = shown(figures[0])[0].get_xlim()
        assert 0.0 < low < 0.01 and 0.04 < high < 0.05

    @pytest.mark.slow
    def test_of_the_other_archive_that_are_no_numbers_are_on_the_edge(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made(monkeypatch, "a.h5", plans.gains(5), [1.0, 2.0, 3.0, 4.0, 5.0])
        made(monkeypatch, "b.h5", plans.gains(5), [1.0, np.inf, 3.0, np.nan, 5.0])
        plot("a.h5", names=["settle"], over=["gearbox.kp"], against="b.h5")
        ax = shown(figures[0])[0]
        on_edge = [each.get_offsets() for each in ax.collections if each.get_offset_transform() != ax.transData]
        assert sorted(float(x) for each in on_edge for x in each[:, 0]) == pytest.approx([0.0175, 0.0325])

    @pytest.mark.slow
    def test_of_a_map_tell_apart_which_archive_misses(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made(monkeypatch, "a.h5", scattered(24), [12.0, 3.0, 3.0, 3.0])
        made(monkeypatch, "b.h5", scattered(24), [3.0, 3.0, 13.0, 3.0])
        plot("a.h5", names=["settle"], over=["gearbox.kp", "links.lower.mass"], against="b.h5")
        rings = [each for each in shown(figures[0])[0].collections if not len(each.get_facecolor())]
        assert [len(each.get_offsets()) for each in rings] == [6, 6]
        handles = figures[0].legends[0].legend_handles
        assert legend(figures[0])[:2] == ["missed in a.h5 alone", "missed in b.h5 alone"]
        assert handles[0].get_marker() != handles[1].get_marker()


class TestMapsOfADifference:
    @pytest.mark.slow
    def test_judge_each_archive_by_what_it_requires_itself(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        one = archives.grid(KP, MASS)
        tight = replace(one, requirements=(Requirement("settle < 5 s", "settle", "<", 5.0),))
        made(monkeypatch, "a.h5", one, [12.0, 7.0, 4.0, 3.0, 2.0])
        made(monkeypatch, "b.h5", tight, [12.0, 7.0, 4.0, 3.0, 2.0])
        plot("a.h5", names=["settle"], against="b.h5")
        plot("b.h5", names=["settle"], against="a.h5")
        found = [(cells(ax, hatch=STRIPES), cells(ax, hatch=DOTTED)) for ax in (shown(each)[0] for each in figures)]
        assert found == [(0, 5), (5, 0)]

    @pytest.mark.slow
    def test_mark_nothing_that_is_not_in_both(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made(monkeypatch, "a.h5", archives.grid(KP, MASS), [12.0])
        made(monkeypatch, "b.h5", archives.grid(KP[:3], MASS), [12.0])
        plot("a.h5", names=["settle"], against="b.h5")
        assert (cells(shown(figures[0])[0], hatch=STRIPES), legend(figures[0])) == (0, ["not in both"])

    @pytest.mark.slow
    def test_say_which_of_two_is_infinite(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made(monkeypatch, "a.h5", archives.grid(KP, MASS), [1.0, np.inf, 1.0, 1.0, 1.0])
        made(monkeypatch, "b.h5", archives.grid(KP, MASS), [1.0, 1.0, np.inf, 1.0, 1.0])
        plot("a.h5", names=["settle"], against="b.h5")
        marks = [each for each in shown(figures[0])[0].collections if not each.get_clip_on()]
        assert [len(each.get_offsets()) for each in marks] == [5, 5]


class TestNames:
    @pytest.mark.slow
    def test_that_begin_with_an_underscore_are_in_the_legend(self, here: Path, figures: list[Any]) -> None:
        one = plans.nominal()
        q, *rest = one.structure.record
        record = (replace(q, joints=("_shoulder", "_elbow")), *rest)
        archives.made(here / "a.h5", replace(one, structure=replace(one.structure, record=record)))
        plot("a.h5", names=["q"])
        ax = shown(figures[0])[0]
        assert [text.get_text().strip() for text in ax.get_legend().get_texts()] == ["_shoulder", "_elbow"]

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("name", "shown_as"),
        [
            (b"na\xffme.h5", "na\\udcffme.h5"),
            (b"con\x08trol.h5", "con\\x08trol.h5"),
            (b"two\nlines.h5", "two\\nlines.h5"),
        ],
        ids=["byte", "control", "line"],
    )
    def test_of_files_may_be_anything(
        self, here: Path, monkeypatch: pytest.MonkeyPatch, name: bytes, shown_as: str
    ) -> None:
        made(monkeypatch, "a.h5", plans.gains(5))
        shutil.copy("a.h5", os.fsdecode(name))
        drawn = plot("a.h5", "a.svg", ["settle"], over=["gearbox.kp"], against=os.fsdecode(name))
        text = drawn.read_text(encoding="utf-8")
        xml.dom.minidom.parseString(text)
        assert f"<!-- {shown_as} -->" in text

    @pytest.mark.slow
    def test_of_files_may_be_long(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        made(monkeypatch, "a.h5", plans.gains(5))
        shutil.copy("a.h5", "x" * 200 + ".h5")
        assert plot("a.h5", names=["settle"], over=["gearbox.kp"], against="x" * 200 + ".h5").exists()


class TestOutput:
    @pytest.mark.slow
    def test_of_more_dots_than_memory_holds_is_refused(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        made(monkeypatch, "a.h5", archives.grid(KP, MASS))
        with pytest.raises(Problem) as caught:
            plot("a.h5", size="120x120cm", dpi=2400)
        assert render(caught.value.diagnostics) == (
            "error[E392]: 113,386 x 113,386 dots: a PNG has 200,000,000 at most\n"
            " = help: a smaller `--dpi` or `--size`\n = help: an SVG or a PDF has no dots\n\n1 error\n"
        )

    def test_is_not_written_over_what_another_program_of_such_a_name_drew(
        self, here: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from PIL import Image, PngImagePlugin

        said = PngImagePlugin.PngInfo()
        said.add_text("Software", "METASHAPE 2")
        Image.new("RGB", (9, 9)).save("theirs.png", pnginfo=said)
        made(monkeypatch, "a.h5", plans.gains(5))
        with pytest.raises(Problem, match="was not drawn by MET"):
            plot("a.h5", "theirs.png")

    @pytest.mark.slow
    @pytest.mark.parametrize("over", [[], ["gearbox.kp"]], ids=["map", "points"])
    def test_is_drawn_of_values_that_overflow(
        self, here: Path, monkeypatch: pytest.MonkeyPatch, over: list[str]
    ) -> None:
        made(monkeypatch, "a.h5", archives.grid(KP, MASS), [1.7e308, -1.7e308, 1.0])
        assert plot("a.h5", names=["settle"], over=over).exists()
