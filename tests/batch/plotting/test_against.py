"""Two archives in one picture: the same cases by what is varied, whatever their order, instants and units."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import QuadMesh

from batch.plotting import plot
from batch.plotting.histories import PALE
from batch.plotting.maps import DOTTED, STRIPES
from met import run as engine
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import Experiment
from tests.batch import plans
from tests.batch.plotting.pictures import cells, mesh, said, shown
from tests.batch.report import archives

pytestmark = pytest.mark.usefixtures("engine")

KP, MASS = [0.01, 0.02, 0.03, 0.04, 0.05], [10.0, 20.0, 30.0, 40.0, 50.0]


def turned(one: Experiment, order: Any) -> Experiment:
    """The same cases in another order, or some of them."""
    rows = np.asarray(order)
    coordinates = tuple(replace(each, values=each.values[rows]) for each in one.cases.coordinates)
    return replace(one, cases=replace(one.cases, count=len(rows), coordinates=coordinates))


def slower(patch: pytest.MonkeyPatch, factor: float = 1.5) -> None:
    """From now on rates are lower, and settling takes longer."""
    real = engine.run

    def answer(*args: Any, **options: Any) -> Any:
        found = real(*args, **options)
        found.metrics["settle"] *= factor
        found.metrics["settle"][found.metrics["settle"] > 4.0] = np.inf
        found.met["settle < 10 s"] = found.metrics["settle"] < 10.0
        if "qd" in found.signals:
            found.signals["qd"] /= factor
        return found

    patch.setattr(engine, "run", partial(answer))


def pale(ax: Any) -> list[Any]:
    return [line for line in ax.lines if line.get_alpha() == PALE]


def refused(*names: str, **options: Any) -> str:
    with pytest.raises(Problem) as caught:
        plot("a.h5", names=names, against="b.h5", **options)
    return render(caught.value.diagnostics).rpartition("\n1 error")[0]


class TestSignals:
    @pytest.mark.slow
    def test_of_the_same_cases_lie_under_the_own_ones(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        archives.made(here / "a.h5", plans.gains(3))
        slower(monkeypatch)
        archives.made(here / "b.h5", turned(plans.gains(3), [2, 0, 1]))
        plot("a.h5", names=["qd"], against="b.h5")
        shoulder, elbow = shown(figures[0])
        assert len(pale(shoulder)) == len(pale(elbow)) == 3
        own = [line for line in shoulder.lines if line.get_alpha() is None]
        for mine, theirs in zip(own, pale(shoulder), strict=True):
            np.testing.assert_allclose(theirs.get_ydata() * 1.5, mine.get_ydata(), rtol=1e-14)
            assert theirs.get_color() == mine.get_color() and theirs.get_linewidth() > 2 * mine.get_linewidth()
        words = [text.get_text() for text in figures[0].legends[0].get_texts()]
        assert words[-2:] == ["a.h5", "b.h5"]

    @pytest.mark.slow
    def test_may_have_other_instants(self, here: Path, figures: list[Any]) -> None:
        archives.made(here / "a.h5", plans.nominal())
        other = plans.nominal()
        archives.made(here / "b.h5", replace(other, structure=plans.structure(400, 8)))
        plot("a.h5", names=["shoulder.qd"], against="b.h5")
        [ax] = shown(figures[0])
        assert [len(line.get_xdata()) for line in ax.lines] == [51, 51]
        assert [line.get_xdata()[-1] for line in ax.lines] == pytest.approx([4.0, 2.0])
        assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a.h5", "b.h5"]

    @pytest.mark.slow
    def test_of_a_fan_are_a_median_and_edges(self, here: Path, figures: list[Any]) -> None:
        archives.made(here / "a.h5", plans.gains(40))
        archives.made(here / "b.h5", turned(plans.gains(40), range(12)))
        plot("a.h5", names=["qd"], against="b.h5")
        ax = shown(figures[0])[0]
        [median] = pale(ax)
        values = plans.answer(plans.gains(40)).signals["qd"][:12, :, 0]
        np.testing.assert_allclose(median.get_ydata(), np.median(values, axis=0), rtol=1e-14)
        assert len([line for line in ax.lines if line.get_linestyle() == ":"]) == 2
        assert said(figures[0]) == "40 cases: median, nine in ten, and all; 12 of them also in b.h5"

    @pytest.mark.slow
    def test_that_the_other_lacks_are_drawn_alone_and_told_where_they_are_named(
        self, here: Path, figures: list[Any]
    ) -> None:
        one = plans.nominal()
        archives.made(here / "a.h5", one)
        few = replace(one, structure=replace(one.structure, record=one.structure.record[:2]))
        archives.made(here / "b.h5", few)
        plot("a.h5", against="b.h5")
        assert [len(pale(ax)) for ax in shown(figures[0])] == [2, 2, 0, 0]
        assert refused("tau") == ("error[E393]: no `tau` in b.h5 to draw against\n = help: in b.h5: q, qd\n")

    @pytest.mark.slow
    def test_in_another_unit_are_refused(self, here: Path) -> None:
        one = plans.nominal()
        archives.made(here / "a.h5", one)
        q, *rest = one.structure.record
        archives.made(
            here / "b.h5", replace(one, structure=replace(one.structure, record=(replace(q, unit=("rad", "m")), *rest)))
        )
        assert refused("q") == (
            "error[E393]: `elbow.q` is in rad in a.h5, and in m in b.h5\n = help: name what is alike in both\n"
            " = help: `met diff a.h5 b.h5` says what differs\n"
        )

    @pytest.mark.slow
    def test_that_were_not_kept_are_told_of(self, here: Path) -> None:
        archives.made(here / "a.h5", plans.gains(3))
        archives.made(here / "b.h5", plans.gains(3), histories="none")
        assert refused("qd") == (
            "error[E393]: no histories of `gains` are in b.h5 to draw against\n"
            " = help: `met run b.h5 --all --histories all` runs it again with them\n"
        )
        archives.made(here / "b.h5", plans.gains(3), histories=["#1"])
        assert refused("qd", cases=["#0"]) == (
            "error[E393]: no case that is drawn has its history in b.h5\n = help: `met show b.h5` lists its cases\n"
        )


class TestMetrics:
    @pytest.mark.slow
    def test_as_points_are_hollow(self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
        archives.made(here / "a.h5", archives.grid([0.03, 0.04, 0.05], [20.0]), histories="none")
        slower(monkeypatch)
        archives.made(here / "b.h5", turned(archives.grid([0.03, 0.04, 0.05], [20.0]), [2, 1, 0]), histories="none")
        plot("a.h5", names=["settle"], against="b.h5")
        [ax] = shown(figures[0])
        below_first = sorted(ax.collections, key=lambda each: each.get_zorder())
        hollow, own = (np.ma.filled(each.get_offsets(), np.nan) for each in below_first[:2])
        np.testing.assert_allclose(own[:, 1], [0.1 / 0.03, 2.5, 2.0], rtol=1e-14)
        assert np.isnan(hollow[0, 1])  # infinite
        np.testing.assert_allclose(hollow[1:, 1], [3.75, 3.0], rtol=1e-14)
        assert [text.get_text() for text in figures[0].legends[0].get_texts()] == ["a.h5", "b.h5"]

    @pytest.mark.slow
    def test_as_maps_are_the_difference_around_zero(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        one = archives.grid(KP, MASS)
        archives.made(here / "a.h5", one, histories="none")
        slower(monkeypatch)
        archives.made(here / "b.h5", turned(one, np.arange(25)[::-1]), histories="none")
        plot("a.h5", names=["settle"], against="b.h5")
        ax, bar = shown(figures[0])
        expected = np.array([0.0, np.nan, np.nan, -1.25, -1.0])  # infinite in both; in b alone; slower
        np.testing.assert_allclose(mesh(ax), np.tile(expected, (5, 1)), rtol=1e-13)
        [drawn] = [each for each in ax.collections if isinstance(each, QuadMesh)]
        assert drawn.norm.vmin == -drawn.norm.vmax
        assert bar.get_ylabel() == "settle: a.h5 − b.h5  (s)"
        assert [text.get_text() for text in figures[0].legends[0].get_texts()] == ["missed in b.h5 alone", "infinite"]
        assert cells(ax, hatch=DOTTED) == 10 and cells(ax, hatch=STRIPES) == 0

    @pytest.mark.slow
    def test_of_cases_that_are_in_one_alone_have_no_colour(self, here: Path, figures: list[Any]) -> None:
        one = archives.grid(KP, MASS)
        archives.made(here / "a.h5", one, histories="none")
        archives.made(here / "b.h5", turned(one, np.arange(20)), histories="none")
        plot("a.h5", names=["volts"], against="b.h5")
        assert np.isnan(mesh(shown(figures[0])[0])).sum() == 5
        assert said(figures[0]) == "25 cases, 20 of them also in b.h5: a cell a case"

    @pytest.mark.slow
    def test_that_the_other_lacks_are_told_of(self, here: Path) -> None:
        one = archives.grid(KP, MASS)
        archives.made(here / "a.h5", one, histories="none")
        fewer = replace(
            one, structure=replace(one.structure, metrics=one.structure.metrics[:1]), requirements=one.requirements[:1]
        )
        archives.made(here / "b.h5", fewer, histories="none")
        assert refused("volts") == "error[E393]: no `volts` in b.h5 to draw against\n = help: in b.h5: settle\n"


@pytest.mark.slow
def test_archives_that_have_nothing_in_common(here: Path) -> None:
    archives.made(here / "a.h5", plans.gains(3))
    archives.made(here / "b.h5", archives.grid([0.5, 0.6], [1.0]))
    assert refused() == (
        "error[E393]: no case of `gains` is in both a.h5 and b.h5\n"
        " = help: cases are the same where what is varied has the same values\n"
        " = help: `met diff a.h5 b.h5` says what differs\n"
    )
    archives.made(here / "b.h5", plans.nominal("one"), plans.nominal("two"))
    assert refused() == ("error[E393]: no run or sweep `gains` in b.h5 to draw against\n = help: in it: one, two\n")


@pytest.mark.slow
def test_archives_of_the_same_name_have_their_folders(here: Path, figures: list[Any]) -> None:
    (here / "old").mkdir()
    archives.made(here / "a.h5", plans.nominal())
    archives.made(here / "old" / "a.h5", plans.nominal())
    plot("a.h5", names=["shoulder.qd"], against="old/a.h5")
    [ax] = shown(figures[0])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a.h5", "old/a.h5"]


@pytest.mark.slow
def test_names_of_files_are_written_as_they_are(here: Path, figures: list[Any]) -> None:
    archives.made(here / "_$a$.h5", plans.nominal())
    archives.made(here / "$\\frac{b.h5", plans.nominal())
    plot("_$a$.h5", "a.png", names=["shoulder.qd"], against="$\\frac{b.h5")
    [ax] = shown(figures[0])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["./_$a$.h5", "$\\frac{b.h5"]
