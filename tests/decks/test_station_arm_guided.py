"""The Station's arm along lines by resolved rates: far from, by and through a singularity, and beyond its reach.

The figures are those of the table in docs/physics.md. The errors are found anew from the frames of the payload.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import ic
from met import run as engine
from met.run import Run

DEG = np.pi / 180.0
LIMIT = 4.0 * DEG
PAGE = Path(__file__).parents[2] / "docs" / "physics.md"

# Start, and lambda's maximum (m): error (m), turn (deg), smallest singular value (m), share of the rates left
FIGURES = {
    ("far", 0.0): (0.0030, 0.0075, 2.157, 1.0),
    ("far", 0.3): (0.0030, 0.0075, 2.157, 1.0),
    ("by", 0.0): (0.309, 0.76, 0.282, 0.213),
    ("by", 0.3): (0.296, 0.92, 0.278, 0.213),
    ("through", 0.0): (0.336, 0.82, 0.0255, 0.113),
    ("through", 0.3): (0.157, 3.07, 0.123, 0.540),
}
STARTS = {(40.0, 20.0): "far", (110.0, 75.0): "by", (108.0, 72.0): "through"}


@cache
def lines() -> tuple[Run, list[tuple[str, float]]]:
    """The sweep, and which start and damping each case has."""
    (made,) = ic.compile("station_arm.ic", select=["station_arm_lines"]).experiments
    damping, *yaws = (coordinate.values / coordinate.scale for coordinate in made.cases.coordinates)
    starts = [STARTS[round(a, 6), round(b, 6)] for a, b in zip(*yaws, strict=True)]
    return engine.run(made), list(zip(starts, damping.tolist(), strict=True))


@pytest.mark.release
@pytest.mark.parametrize("case", FIGURES)
def test_the_figures_of_the_page(case: tuple[str, float]) -> None:
    run, cases = lines()
    n = cases.index(case)
    away, turned, nearest, slowest = (run.metrics[name][n] for name in ("away", "turned", "nearest", "slowest"))
    assert (away, turned / DEG, nearest, slowest) == pytest.approx(FIGURES[case], rel=0.02)
    assert run.metrics["left"][n] < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("case", FIGURES)
def test_what_is_asked_stays_within_the_limits_and_no_error_is_hidden(case: tuple[str, float]) -> None:
    run, cases = lines()
    n = cases.index(case)
    asked = np.diff(run.signals["servo.command"][n], axis=0) * 10.0  # rows at 10 Hz: mean rates between them
    assert np.abs(asked).max() <= LIMIT * (1.0 + 1e-9)
    place = run.signals["links.payload.position"][n]
    t = run.time
    rise, peak, way = 5.0, 0.1, 2.4  # the trapezoid of the deck: 0.02 m/s^2 up to 0.1 m/s
    whole = way / peak + rise
    s = np.clip(t, 0.0, whole)
    even, falling = peak * (s - rise / 2), way - 0.01 * (whole - s) ** 2
    z = np.where(s < rise, 0.01 * s**2, np.where(s < whole - rise, even, falling))
    path = place[0] + np.stack([0.0 * t, 0.0 * t, z], axis=1)
    np.testing.assert_allclose(
        run.signals["guides.tip.error"][n], np.linalg.norm(place - path, axis=1), rtol=0, atol=1e-11
    )


@pytest.mark.slow
def test_at_the_end_of_its_reach_the_error_is_what_cannot_be_reached_and_what_the_damping_costs() -> None:
    (made,) = ic.compile("station_arm.ic", select=["station_arm_stretch"]).experiments
    run = engine.run(made)
    beyond = run.signals["links.payload.position"][0, 0, 2] + 1.96 - 2.0 * (1.3589 + 7.11)
    assert beyond == pytest.approx(0.05, abs=0.005)
    # stretched the arm ends there, and higher by the slant of its side steps, 1.6 m over a turn's error of 0.3 deg
    assert run.signals["links.payload.position"][0, :, 2].max() < 2.0 * (1.3589 + 7.11) + 0.01
    assert beyond < run.metrics["away"][0] < 0.125
    assert run.metrics["nearest"][0] < 0.02
    assert run.metrics["left"][0] < 2e-4
    assert np.abs(np.diff(run.signals["servo.command"][0], axis=0) * 10.0).max() <= LIMIT * (1.0 + 1e-9)


@pytest.mark.slow
def test_a_line_through_the_singularity_that_asks_nothing_impossible_is_kept(tmp_path: Path) -> None:
    (tmp_path / "deck.ic").write_text("""#include <station_arm.ic>
run straight like station_arm_line {
    initial { shoulder_yaw.q = 108 deg;  wrist_yaw.q = 72 deg; }
    tip { pitch = 0 deg; }
}
""")
    (made,) = ic.compile(tmp_path / "deck.ic", select=["straight"]).experiments
    run = engine.run(made)
    assert run.metrics["nearest"][0] < 1e-3
    assert run.metrics["away"][0] == pytest.approx(3.0e-3, rel=0.02)
    assert run.metrics["slowest"][0] == 1.0


def test_the_page_has_these_figures() -> None:
    page = PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| (far|by|through) \| (\S+) \| (\S+) \| (\S+) \| (\S+) \| (\S+) \|$", page, re.MULTILINE)
    told = {(start, float(damping)): tuple(map(float, figures)) for start, damping, *figures in rows}
    assert told == {
        case: (1e3 * away, turned, nearest, slowest) for case, (away, turned, nearest, slowest) in FIGURES.items()
    }
