"""The first axis of the Manutec r3 against the trajectory that the Modelica Association publishes for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.ic.small_decks import changed, experiment
from tests.oracles.manutec_r3 import ONE_AXIS, SIGNALS, as_the_page_says, deviations, published

DECK = (Path(__file__).parents[2] / "ic" / "decks" / "manutec_r3_one_axis.ic").read_text(encoding="utf-8")


def shares(folder: Path, rate_hz: int) -> dict[str, float]:
    """Largest deviation of each signal over all rows, as a share of its range, at this rate of the dynamics."""
    text = changed(
        DECK,
        ("dynamics = 20 kHz;  record = 1 kHz", f"dynamics = {rate_hz} Hz;  record = 3125 Hz"),
        ("duration    = 1.5 s", "duration    = 1.49792 s"),
        ("[q, qd, servo.current, servo.deflection]", f"[{SIGNALS}]"),
    )
    found = deviations(experiment(folder, text), ONE_AXIS)
    assert len(found) == 7 and all(of.shape == (4682, 1) for of in found.values())
    reference = published(ONE_AXIS)
    return {name: float(np.abs(of).max() / np.ptp(reference[name])) for name, of in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize("rate", ["12.5 kHz", "50 kHz"])
def test_the_published_trajectory_is_met_as_the_page_says(rate: str, tmp_path: Path) -> None:
    """Between the two rates the error falls with the square of the step.

    The reference's own tolerance is 1e-6; of ours, the step that holds the command's corner counts most.
    """
    assert shares(tmp_path, round(1e3 * float(rate.split()[0]))) == as_the_page_says(rate, "one axis")
