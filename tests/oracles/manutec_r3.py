"""Trajectories that the Modelica Association publishes for the Manutec r3; `manutec_r3.md` has source and licence."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from met.plan import Experiment
from met.run import run

KP_OVER_KI = 0.05
"""The integral time of the library's PI, s: its `x` is ours over this."""
CAPACITOR = -5.0
"""Our amplifier's integral is the voltage of the library's capacitor, amplified so."""
FULL = "manutec_r3_full.csv.gz", 2500.0, np.array([-105.0, 210.0, 60.0, -99.0, 79.2, -99.0])
"""File of the whole robot, its rows in a second, and the library's gear ratios, with their signs."""
ONE_AXIS = "manutec_r3_one_axis.csv.gz", 3125.0, np.array([210.0])
"""File of the one axis, its rows in a second, and the gear ratio."""
SIGNALS = "q, qd, servo.current, servo.integral, servo.amplifier, servo.deflection, servo.motor_rate"
"""Signals that a run has to record, at the rate of the rows, to be compared."""

COLUMNS = ("q", "qd", "current", "integral", "capacitor", "spring", "spring_rate")
"""Signals in the order in which the tables of docs/servos.md have them."""
PAGE = Path(__file__).parents[2] / "docs" / "servos.md"

Reference = tuple[str, float, np.ndarray]


def published(reference: Reference) -> dict[str, np.ndarray]:
    """Each signal of a reference, and `time`: (rows, joints). Units and signs are the library's."""
    name, rows_per_second, _ = reference
    with gzip.open(Path(__file__).parent / name, "rt", encoding="utf-8") as text:
        titles = text.readline().strip().split(",")
        table = np.loadtxt(text, delimiter=",").T
    assert np.abs(table[0] - np.arange(table.shape[1]) / rows_per_second).max() < 1e-12  # none is missing
    signals = dict.fromkeys(title.rstrip("123456") for title in titles)
    return {signal: table[[title.rstrip("123456") == signal for title in titles]].T for signal in signals}


def deviations(made: Experiment, reference: Reference) -> dict[str, np.ndarray]:
    """How far each signal of a run is from the reference, at each row: (rows, joints), in the library's units."""
    ran = run(made)
    assert ran.status.tolist() == [0]
    wanted = published(reference)
    count = len(wanted["time"])
    np.testing.assert_allclose(ran.time[:count], wanted["time"][:, 0], rtol=0.0, atol=1e-12)
    found = {name: values[0, :count] for name, values in ran.signals.items()}
    _, _, ratio = reference
    way, elastic = np.sign(ratio), found["servo.deflection"].shape[1]
    ours = {
        "q": found["q"],
        "qd": found["qd"],
        "current": way * found["servo.current"],
        "integral": way * found["servo.integral"] / KP_OVER_KI,
        "capacitor": way * found["servo.amplifier"] / CAPACITOR,
        "spring": -ratio[:elastic] * found["servo.deflection"],
        "spring_rate": ratio[:elastic] * found["qd"][:, :elastic] - way[:elastic] * found["servo.motor_rate"],
    }
    assert set(ours) == set(wanted) - {"time"}
    return {name: ours[name] - wanted[name] for name in ours}


def as_the_page_says(rate: str, title: str) -> object:
    """The figures that docs/servos.md has at this rate in the table of this title, to the two digits that it prints."""
    table = PAGE.read_text(encoding="utf-8").split(f"| {title} |")[1].split("\n\n")[0]
    (row,) = [line.split("|")[2:-1] for line in table.splitlines() if line.startswith(f"| {rate} |")]
    return pytest.approx(dict(zip(COLUMNS, map(float, row), strict=True)), rel=0.06, abs=0.0)
