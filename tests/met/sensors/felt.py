"""A sensor of a link that is not one to buy: its state is the integral of what is felt along a direction.

Under `semi_implicit_euler` a step adds the step's length times the specific force at its beginning, so what is felt at
every instant is what the state grows by.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import met.sensors
from met import run as engine
from met.parameter import ZEROS, Parameter, State
from met.run import Run
from met.sensors.sensor import ALONG, LINK, Reading, Sensor, component
from tests.ic.small_decks import experiment

INTEGRAL = Sensor(
    name="integral",
    doc="The integral of the specific force.",
    parameters=(LINK, Parameter(name="at", unit="m", shape="vector", default=ZEROS, doc="where it is"), ALONG),
    states=(State(name="sum", unit="of*s", doc="integral"),),
    measures=lambda p, felt: component(p.along, felt.specific_force(p.link, p.at)),
    unit="m/s^2",
    follow=lambda p, states, value: {"sum": value},
    begin=lambda p, value: {"sum": 0.0},
    read=lambda p, held, states, sensed: Reading(states.sum),
)


def known(patch: pytest.MonkeyPatch, sensor: Sensor = INTEGRAL) -> None:
    """Makes a model one of MET's own."""
    patch.setattr(met.sensors, "SENSORS", (*met.sensors.SENSORS, sensor))


def triad(name: str, link: str, at: str) -> str:
    """Entries of a run: three of them along the axes of a link."""
    return "".join(
        f"    sensor {name}_{axis} = integral {{ link = {link}; at = {at}; along = {along}; }}\n"
        for axis, along in zip("xyz", ("[1, 0, 0]", "[0, 1, 0]", "[0, 0, 1]"), strict=True)
    )


def felt(run: Run, name: str, case: int = 0) -> np.ndarray:
    """Specific force [instant but the last, axis] of a triad whose states are recorded at every instant."""
    states = np.column_stack([run.signals[f"sensors.{name}_{axis}.sum"][case].ravel() for axis in "xyz"])
    return np.diff(states, axis=0) / np.diff(run.time)[:, None]


def recorded(*names: str) -> str:
    return ", ".join(f"sensors.{name}_{axis}.sum" for name in names for axis in "xyz")


def run_of(folder: Path, *parts: str, **options: Any) -> Run:
    return engine.run(experiment(folder, *parts), **options)
