"""The first axis of the Manutec r3 against the trajectory that the Modelica Association publishes for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from met import run as engine
from tests.ic.small_decks import changed, experiment

HERE = Path(__file__).parent
DECK = (HERE.parents[1] / "ic" / "decks" / "manutec_r3_one_axis.ic").read_text(encoding="utf-8")
REFERENCE = HERE.parent / "oracles" / "manutec_r3_one_axis.csv"
RATIO = 210.0


def deviations(folder: Path, rate_hz: int) -> dict[str, float]:
    """Largest deviation of each signal, as a share of its range, at this rate of the dynamics."""
    text = changed(DECK, ("dynamics = 20 kHz;  record = 1 kHz", f"dynamics = {rate_hz} Hz;  record = {rate_hz} Hz"))
    run = engine.run(experiment(folder, text))
    names = {"load_angle": "q", "load_rate": "qd", "spring_angle": "servo.deflection", "current": "servo.current"}
    reference = np.genfromtxt(REFERENCE, delimiter=",", names=True, comments="#", skip_header=3)
    assert len(reference) == 937 and reference["time"][-1] > 1.49
    found = {}
    for name, signal in names.items():
        values = run.signals[signal][0, :, 0] * (-RATIO if name == "spring_angle" else 1.0)
        # between rows of this fine a grid, a cubic through values and slopes: slopes by differences
        curve = CubicHermiteSpline(run.time, values, np.gradient(values, run.time, edge_order=2))
        expected = reference[name]
        found[name] = float(np.abs(curve(reference["time"]) - expected).max() / np.ptp(expected))
    return found


@pytest.mark.parametrize(("rate_hz", "most"), [
    (50_000, {"load_angle": 2e-7, "load_rate": 1e-5, "spring_angle": 1e-4, "current": 2e-3}),
    (10_000, {"load_angle": 2e-6, "load_rate": 1e-4, "spring_angle": 1e-3, "current": 1e-2}),
])  # fmt: skip
def test_the_published_trajectory_is_met(rate_hz: int, most: dict[str, float], tmp_path: Path) -> None:
    """The reference's own tolerance is 1e-6; of ours, the step that holds the command's corner counts most."""
    found = deviations(tmp_path, rate_hz)
    assert all(found[name] < limit for name, limit in most.items()), found
    # ten times better than was asked for, and in the other direction a check that the comparison is not of nothing
    assert all(found[name] < 0.11 * limit for name, limit in most.items()), found
    assert all(found[name] > 1e-10 for name in most), found
