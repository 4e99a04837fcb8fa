"""Metrics as points and as maps: what is drawn over what, in which colours, and what is marked."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import to_hex

from batch.archive.read import ArchiveFile
from batch.plotting import draw, plot
from batch.plotting.cells import FAILED, INFINITE, STRIPES
from batch.plotting.layout import COLOURS
from batch.plotting.maps import ABOVE
from batch.plotting.points import NAMED
from batch.plotting.sides import MOST_CELLS
from met import run as engine
from tests.batch import plans
from tests.batch.plotting.pictures import archive, cells, mesh, said, shown
from tests.batch.report import archives

pytestmark = pytest.mark.usefixtures("engine")

KP, MASS = [0.01, 0.02, 0.03, 0.04, 0.05], [10.0, 20.0, 30.0, 40.0, 50.0]


def made(kps: list[float] = KP, masses: list[float] = MASS, **options: Any) -> Path:
    """A sweep over all combinations, without histories."""
    return archives.made(Path("a.h5"), archives.grid(kps, masses, **options), histories="none")


class TestPoints:
    @pytest.mark.slow
    def test_are_drawn_over_what_varies_where_there_are_no_histories(self, here: Path, figures: list[Any]) -> None:
        with archive(40, "none") as file:
            draw(file, "a.png")
        axes = shown(figures[0])
        assert [ax.get_ylabel() for ax in axes] == ["settle  (s)", "volts  (V)"]
        assert [ax.get_xlabel() for ax in axes] == ["", "gearbox.kp  (V·s/rad)"]
        assert axes[0].get_title("left") == (
            "settling_time of shoulder.qd · settle < 10 s: missed by 2 of 40 · infinite in 2 (▲)"
        )
        assert said(figures[0]) == "40 cases"

    @pytest.mark.slow
    def test_of_cases_without_a_value_stand_on_the_edge(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        archives.failing(monkeypatch, 5, 6, 7)
        with archive(40, "none") as file:
            draw(file, "a.png", ["settle"])
        [ax] = shown(figures[0])
        assert ax.get_title("left").endswith("infinite in 2 (▲), no value in 3 (×)")
        *points, infinite, lost = (each for each in ax.collections if isinstance(each, PathCollection))
        heights = np.concatenate([np.ma.filled(each.get_offsets(), np.nan)[:, 1] for each in points])
        assert np.isfinite(heights).sum() == 35
        assert (infinite.get_offsets()[:, 1] == 1.0).all() and len(infinite.get_offsets()) == 2
        figures[0].draw_without_rendering()
        box = infinite.get_offset_transform().transform(infinite.get_offsets())[:, 1]
        half = 0.5 * infinite.get_sizes()[0] ** 0.5 * figures[0].dpi / 72
        assert (box + half < ax.bbox.y1).all()  # clear of what stands above the panel
        assert len(lost.get_offsets()) == 3

    @pytest.mark.slow
    def test_of_few_values_of_another_parameter_are_curves_with_its_name(self, here: Path, figures: list[Any]) -> None:
        made(masses=MASS[:3])
        plot("a.h5", over=["gearbox.kp"])
        axes = shown(figures[0])
        assert [len([line for line in ax.lines if len(line.get_xdata()) > 2]) for ax in axes] == [3, 3]
        words = [text.get_text() for text in figures[0].legends[0].get_texts()]
        assert words == [*(f"links.lower.mass = {mass} g" for mass in (10000, 20000, 30000)), "limit"]

    @pytest.mark.slow
    def test_of_many_values_of_another_parameter_have_a_colour_bar(self, here: Path, figures: list[Any]) -> None:
        made(masses=[10.0 + mass for mass in range(NAMED + 1)])
        plot("a.h5", over=["gearbox.kp"])
        assert [ax.get_ylabel() for ax in figures[0].axes] == ["settle  (s)", "volts  (V)", "links.lower.mass  (g)"]
        assert not figures[0].legends

    @pytest.mark.slow
    def test_of_a_logarithmic_sweep_have_logarithmic_colours_with_round_numbers(
        self, here: Path, figures: list[Any]
    ) -> None:
        made(kps=np.geomspace(0.001, 0.1, NAMED + 1).tolist(), masses=MASS)
        plot("a.h5", over=["links.lower.mass"])
        bar = figures[0].axes[-1]
        assert (bar.get_ylabel(), bar.get_yscale()) == ("gearbox.kp  (V·s/rad)", "log")
        assert bar.get_ylim() == pytest.approx((0.001, 0.1), rel=1e-12)
        assert [text.get_text() for text in bar.get_yticklabels()] == [
            "0.001",
            "0.002",
            "0.005",
            "0.01",
            "0.02",
            "0.05",
            "0.1",
        ]

    @pytest.mark.slow
    def test_have_the_limit_as_a_line_where_it_is_near(self, here: Path, figures: list[Any]) -> None:
        def limits(ax: Any) -> list[float]:
            return [line.get_ydata()[0] for line in ax.lines if line.get_label() == "limit"]

        made(kps=[0.03, 0.035, 0.04], masses=[10.0])
        plot("a.h5")
        assert [limits(ax) for ax in shown(figures[0])] == [[], [5.0]]  # what takes 4 s at most may take 10 s

    def test_of_a_million_cases_are_those_that_are_seen(self) -> None:
        from batch.plotting.points import DOTS, _apart

        rng = np.random.default_rng(1)
        x, y = rng.random(300_000), rng.random(300_000) ** 9
        y[7], y[8] = 40.0, np.nan
        kept = _apart(x, y)
        assert 7 in kept and 8 not in kept and len(kept) <= DOTS[0] * DOTS[1] / 8
        assert _apart(x[:100], y[:100]).tolist() == list(range(100))


class TestLogarithmicAxes:
    @pytest.mark.release
    @pytest.mark.parametrize(
        ("kps", "expected"),
        [
            ([0.5, 1.0, 2.0, 4.0], ["0.5", "1", "2", "4"]),
            (np.geomspace(0.005, 0.05, 5).tolist(), ["0.005", "0.01", "0.02", "0.05"]),
            (np.geomspace(2000.0, 8000.0, 3).tolist(), ["2000", "4000", "8000"]),
            (np.geomspace(1e-7, 0.5, 9).tolist(), None),
            (np.geomspace(0.02, 0.025, 4).tolist(), None),
        ],
    )
    @pytest.mark.parametrize("size", ["", "8.5cm"])
    def test_have_plain_numbers_that_stand_apart(
        self, size: str, kps: list[float], expected: list[str] | None, here: Path, figures: list[Any]
    ) -> None:
        made(kps, MASS[:3])
        plot("a.h5", names=["settle"], over=["gearbox.kp"], size=size)
        ax = shown(figures[0])[0]
        assert ax.get_xscale() == "log"
        texts = [text.get_text() for text in (*ax.get_xticklabels(), *ax.get_xticklabels(minor=True))]
        assert texts == expected or (expected is None and len(texts) > 1)
        assert all(float(text) > 0.0 for text in texts), "no TeX"
        boxes = sorted((t.get_window_extent() for t in ax.get_xticklabels()), key=lambda box: box.x0)
        assert all(one.x1 < other.x0 for one, other in pairwise(boxes))


class TestMaps:
    @pytest.mark.slow
    def test_are_drawn_where_two_parameters_make_a_grid(self, here: Path, figures: list[Any]) -> None:
        made()
        plot("a.h5")
        settle, volts, *bars = shown(figures[0])
        assert [ax.get_ylabel() for ax in bars] == ["settle  (s)", "volts  (V)"]
        assert settle.get_ylabel() == "links.lower.mass  (g)" and volts.get_ylabel() == ""
        assert {settle.get_xlabel(), volts.get_xlabel()} == {"gearbox.kp  (V·s/rad)"}
        with np.errstate(divide="ignore"):
            expected = np.where(np.array(KP) < 0.011, np.nan, 0.1 / np.array(KP))
        np.testing.assert_allclose(mesh(settle), np.tile(expected, (5, 1)), rtol=1e-14)
        assert said(figures[0]) == "25 cases: a cell a case"
        assert settle.get_title("left") == (
            "settling_time of shoulder.qd\nsettle < 10 s: missed by 5 of 25\ninfinite in 5"
        )

    @pytest.mark.slow
    def test_stripe_what_misses_and_mark_what_has_no_number(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        archives.failing(monkeypatch, 24)
        made()
        plot("a.h5")
        settle, volts = shown(figures[0])[:2]
        assert cells(settle, hatch=STRIPES) == 5 and cells(volts, hatch=STRIPES) == 24
        assert (cells(settle, face=INFINITE), cells(settle, face=FAILED)) == (5, 1)
        assert (cells(volts, face=INFINITE), cells(volts, face=FAILED)) == (0, 1)
        assert settle.get_title("left").endswith("\ninfinite in 5, failed: 1")
        marks = [len(each.get_offsets()) for each in settle.collections if isinstance(each, PathCollection)]
        assert marks == [1, 5, 5]  # what is around an infinity sign is drawn by itself
        assert [text.get_text() for text in figures[0].legends[0].get_texts()] == [
            "misses what is required",
            "infinite",
            "failed",
        ]

    @pytest.mark.slow
    def test_have_signs_that_are_whole_at_the_edge_and_cover_no_other_cell(
        self, here: Path, figures: list[Any]
    ) -> None:
        made(kps=np.geomspace(0.001, 0.01, 40).tolist())
        plot("a.h5")
        figures[0].draw_without_rendering()
        ax = shown(figures[0])[0]
        around, signs = (each for each in ax.collections if isinstance(each, PathCollection))
        assert not signs.get_clip_on()
        np.testing.assert_array_equal(around.get_offsets(), signs.get_offsets())
        clip, affine = around.get_transformed_clip_path_and_affine()
        greys = np.isinf(np.where(np.isnan(mesh(ax)), np.inf, mesh(ax)))
        [drawn] = (each for each in ax.collections if isinstance(each, QuadMesh))
        edges = drawn.get_coordinates()[0, :, 0]
        right = ax.transData.transform((edges[np.flatnonzero(greys[0])[-1] + 1], MASS[0]))[0]
        assert affine.transform_path(clip).get_extents().x1 == pytest.approx(right, abs=1e-6)

    @pytest.mark.slow
    def test_leave_cells_white_that_have_no_case(self, here: Path, figures: list[Any]) -> None:
        one = archives.grid(KP, MASS)
        first, second = one.cases.coordinates
        kept = np.arange(25) != 12
        coordinates = (replace(first, values=first.values[kept]), replace(second, values=second.values[kept]))
        cases = replace(one.cases, count=24, coordinates=coordinates)
        archives.made(Path("a.h5"), replace(one, cases=cases), histories="none")
        plot("a.h5", names=["volts"])
        ax, _ = shown(figures[0])
        assert np.isnan(mesh(ax)).sum() == 1 and cells(ax, face=INFINITE) == cells(ax, face=FAILED) == 0
        assert [text.get_text() for text in figures[0].legends[0].get_texts()] == ["misses what is required", "no case"]

    @pytest.mark.slow
    def test_show_the_worst_of_several_cases_and_say_so(self, here: Path, figures: list[Any]) -> None:
        steps = np.linspace(0.02, 0.05, 2 * MOST_CELLS).tolist()
        made(kps=steps)
        plot("a.h5")
        [ax] = shown(figures[0])[:1]
        assert mesh(ax).shape == (5, MOST_CELLS)
        np.testing.assert_allclose(mesh(ax)[0], 0.1 / np.array(steps[::2]), rtol=1e-14)  # the longest of each two
        assert said(figures[0]) == "3,000 cases: up to 2 cases in a cell, which shows the worst by what is required"

    @pytest.mark.release
    @pytest.mark.parametrize("count", [49, 60, MOST_CELLS, MOST_CELLS + 1])
    def test_of_a_dense_logarithmic_sweep_have_a_logarithmic_axis_and_no_gaps(
        self, count: int, here: Path, figures: list[Any]
    ) -> None:
        made(kps=np.geomspace(0.02, 2.0, count).tolist())
        plot("a.h5", names=["settle"])
        ax = shown(figures[0])[0]
        assert ax.get_xscale() == "log" and mesh(ax).shape == (5, min(count, MOST_CELLS))
        assert np.isfinite(mesh(ax)).all()
        assert not figures[0].legends

    @pytest.mark.slow
    def test_of_cases_that_fill_no_grid_are_points(self, here: Path, figures: list[Any]) -> None:
        with archive(40, "none") as file:
            draw(file, "a.png", ["volts"], over=["gearbox.kp", "links.lower.mass"])
        [ax] = shown(figures[0])[:1]
        points = ax.collections[0]
        assert isinstance(points, PathCollection) and len(points.get_offsets()) == 40
        assert said(figures[0]) == "40 cases: a point a case"

    @pytest.mark.slow
    def test_of_cases_that_fill_no_grid_lie_by_their_values_with_room_around(
        self, here: Path, figures: list[Any]
    ) -> None:
        kps = [0.010, 0.011, 0.012, 0.040, 0.041]
        sweep = archives.grid(kps, [20.0])
        first, second = sweep.cases.coordinates
        second = replace(second, values=np.array([20.0, 21.0, 30.0, 22.0, 29.0]))
        archives.made(Path("a.h5"), replace(sweep, cases=replace(sweep.cases, coordinates=(first, second))))
        plot("a.h5", names=["volts"], over=["gearbox.kp", "links.lower.mass"])
        [ax] = shown(figures[0])[:1]
        np.testing.assert_allclose(sorted(ax.collections[0].get_offsets()[:, 0]), kps)
        assert ax.get_xscale() == "linear"
        (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
        assert left < 0.010 and right > 0.041 and low < 20e3 and high > 30e3
        assert "0.020" in [text.get_text() for text in ax.get_xticklabels()]

    @pytest.mark.release
    def test_have_axes_of_the_values_and_logarithmic_ones_of_factors(self, here: Path, figures: list[Any]) -> None:
        made(kps=[0.02, 0.04, 0.06, 0.08, 0.1], masses=[1.0, 10.0, 100.0, 1000.0, 10000.0])
        plot("a.h5")
        [ax] = shown(figures[0])[:1]
        assert (ax.get_xscale(), ax.get_yscale()) == ("linear", "log")
        assert ax.get_xlim() == pytest.approx((0.01, 0.11))
        made(masses=[1.0, 2.0, 30.0, 31.0, 90.0])
        plot("a.h5")
        ax = shown(figures[1])[0]
        assert ax.get_ylim() == (-0.5, 4.5)
        assert [text.get_text() for text in ax.get_yticklabels()] == ["1000", "2000", "30000", "31000", "90000"]

    @pytest.mark.slow
    def test_have_colours_for_the_many_where_a_few_stray(
        self, here: Path, figures: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        real = plans.answer

        def answer(*args: Any, **options: Any) -> Any:
            found = real(*args, **options)
            volts = np.where(np.isin(found.case, (3, 9)), 1e9, found.metrics["volts"])
            return replace(found, metrics={**found.metrics, "volts": volts})

        monkeypatch.setattr(engine, "run", answer)
        made()
        plot("a.h5", names=["volts"])
        ax, bar = shown(figures[0])
        [found] = [each for each in ax.collections if isinstance(each, QuadMesh)]
        assert found.norm.vmax < 10.0
        assert bar.get_ylabel() == "volts  (V)\n2 above, up to 1e+09"
        assert to_hex(found.cmap.get_over()) == ABOVE

    def test_read_in_grey(self) -> None:
        import matplotlib

        from batch.plotting.cells import _lightness
        from batch.plotting.maps import RISING

        light = _lightness(matplotlib.colormaps[RISING](np.linspace(0, 1, 50)))
        assert (np.diff(light) > 0).all() and light[-1] - light[0] > 0.6


def test_colours_of_words_are_those_that_eyes_tell_apart() -> None:
    from batch.plotting.points import _sets
    from batch.queries.pool import CaseColumn

    by = CaseColumn("choice:a", "a", "", "choice", np.array([0.0, 1.0, 0.0, 1.0]), ("one", "two"))
    x = CaseColumn("parameter:x", "x", "", "parameter", np.array([0.0, 0.0, 1.0, 1.0]))
    found = _sets(x, by)
    assert [(one.text, one.colour, one.joined) for one in found] == [
        ("one", COLOURS[0], True),
        ("two", COLOURS[1], True),
    ]


@pytest.mark.slow
def test_an_archive_file_that_is_open_is_drawn_as_well(here: Path) -> None:
    made()
    with ArchiveFile("a.h5") as file:
        first = draw(file, "b.png").read_bytes()
    assert plot("a.h5").read_bytes() == first
