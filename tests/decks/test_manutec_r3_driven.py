"""All of the Manutec r3, with its six servos, against the trajectory that the Modelica Association publishes for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from tests.ic.small_decks import experiment

ROWS = np.genfromtxt(Path(__file__).parents[1] / "oracles" / "manutec_r3_full.csv", delimiter=",", names=True,
                     comments="#", skip_header=4)  # fmt: skip
RATIOS = np.array([-105.0, 210.0, 60.0])
TURNS = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
"""Which way the library's motors turn."""

DECK = """\
#include <manutec_r3.ic>
let r3_library = 15 rad/s^2 / 125 deg;
#define MOVE(FROM, TO, WAY)  \\
    command = position(trapezoid(start = FROM, to = TO, max_rate = r3_pace * WAY, max_acceleration = r3_library * WAY))
run as_published like manutec_r3_driven {{
    servos {{
        joint1 {{ MOVE(-60 deg, 60 deg, 120 deg); }}
        joint2 {{ MOVE(20 deg, -70 deg, 90 deg); }}
        joint3 {{ MOVE(90 deg, -35 deg, 125 deg); {third} }}
        joint4 {{ MOVE(0 deg, 45 deg, 45 deg); }}
        joint5 {{ MOVE(-110 deg, 110 deg, 220 deg); }}
        joint6 {{ MOVE(0 deg, 45 deg, 45 deg); }}
    }}
    rates {{ dynamics = {rate_hz} Hz; record = 2500 Hz; }}
    record = [q, qd, servo.current, servo.deflection];
    {more}
}}
"""


def deviations(folder: Path, rate_hz: int, more: str = "", third: str = "") -> dict[str, np.ndarray]:
    """Deviations at the published instants: angles (rad), rates (rad/s), currents (A), springs (rad, motor side)."""
    deck = DECK.format(rate_hz=rate_hz, more=more, third=third)
    run = engine.run(experiment(folder, deck, select=["as_published"]))
    assert run.status.tolist() == [0]
    rows = np.rint(ROWS["time"] * 2500).astype(int)
    assert len(rows) == 7 and np.abs(run.time[rows] - ROWS["time"]).max() < 1e-12
    found = {name: values[0, rows] for name, values in run.signals.items()}
    return {
        "q": found["q"] - np.stack([ROWS[f"q{j}"] for j in range(1, 7)], axis=1),
        "qd": found["qd"][:, [0, 2, 3, 4, 5]] - np.stack([ROWS[f"w{j}"] for j in (1, 3, 4, 5, 6)], axis=1),
        "current": TURNS * found["servo.current"] - np.stack([ROWS[f"i{j}"] for j in range(1, 7)], axis=1),
        "spring": -RATIOS * found["servo.deflection"] - np.stack([ROWS[f"spring{j}"] for j in (1, 2, 3)], axis=1),
    }


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    return deviations(tmp_path_factory.mktemp("published"), 20_000)


def test_it_begins_in_the_published_balance(found: dict[str, np.ndarray]) -> None:
    """Winding of the springs and current of every motor, by gravity, to rounding."""
    assert all(np.abs(of[0]).max() < 5e-15 for of in found.values()), {name: of[0] for name, of in found.items()}


def test_the_published_trajectory_is_met(found: dict[str, np.ndarray]) -> None:
    """Of ranges of 0.8 to 3.8 rad, 0.8 to 3.3 rad/s, 3 to 11 A and 0.2 to 1.4 rad; the reference's tolerance is 1e-6.

    The row at 2.8 ms is left out here: joint 5 has broken away a millisecond before, and how fast its friction falls
    then is the deck's own assumption.
    """
    later = {name: np.abs(of[2:]).max() for name, of in found.items()}
    most = {"q": 2e-6, "qd": 3e-5, "current": 2.5e-3, "spring": 6e-5}
    assert all(0.3 * most[name] < later[name] < most[name] for name in most), later


def test_while_a_joint_breaks_away_the_others_are_there(found: dict[str, np.ndarray]) -> None:
    assert np.abs(found["q"][1]).max() < 5e-7
    assert np.abs(np.delete(found["current"][1], 4)).max() < 2e-4


def test_without_the_balance_or_with_less_friction_it_would_not_be(tmp_path: Path) -> None:
    assert np.abs(deviations(tmp_path, 20_000, "initial { servos = unloaded; }")["current"][1]).max() > 1.0
    (tmp_path / "b").mkdir()
    smooth = deviations(tmp_path / "b", 20_000, third="f_c = 0.69 N*m;")
    assert np.abs(smooth["current"][3]).max() > 5e-3
