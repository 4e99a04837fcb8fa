"""All of the Manutec r3, with its six servos, against the trajectory that the Modelica Association publishes for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.ic.small_decks import experiment
from tests.oracles.manutec_r3 import FULL, SIGNALS, as_the_page_says, deviations

DECK = """\
#include <manutec_r3.ic>
let r3_library = 15 rad/s^2 / 125 deg;
#define MOVE(FROM, TO, WAY)  \\
    command = position(trapezoid(start = FROM, to = TO, max_rate = r3_pace * WAY, max_acceleration = r3_library * WAY))
arm without_inertia like manutec_r3_library {{
    link6 {{ inertia = [0, 0, 0] kg*m^2; }}
    load  {{ inertia = [0, 0, 0] kg*m^2; }}
}}
run as_published like manutec_r3_driven {{
    servos {{
        joint1 {{ MOVE(-60 deg, 60 deg, 120 deg); }}
        joint2 {{ MOVE(20 deg, -70 deg, 90 deg); }}
        joint3 {{ MOVE(90 deg, -35 deg, 125 deg); {third} }}
        joint4 {{ MOVE(0 deg, 45 deg, 45 deg); }}
        joint5 {{ MOVE(-110 deg, 110 deg, 220 deg); {fifth} }}
        joint6 {{ MOVE(0 deg, 45 deg, 45 deg); }}
    }}
    rates {{ dynamics = {rate_hz} Hz; record = 2500 Hz; }}
    duration = 1.856 s;
    record = [{signals}];
    {more}
}}
"""


def found_at(folder: Path, rate_hz: int, more: str = "", third: str = "", fifth: str = "") -> dict[str, np.ndarray]:
    """Deviations at every published row, (4641, joints)."""
    folder.mkdir(exist_ok=True)
    deck = DECK.format(rate_hz=rate_hz, more=more, third=third, fifth=fifth, signals=SIGNALS)
    return deviations(experiment(folder, deck, select=["as_published"]), FULL)


def largest(found: dict[str, np.ndarray]) -> dict[str, float]:
    return {name: float(np.abs(of).max()) for name, of in found.items()}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    return found_at(tmp_path_factory.mktemp("published"), 20_000)


@pytest.mark.slow
def test_all_rows_of_the_publication_are_compared(found: dict[str, np.ndarray]) -> None:
    joints = {"q": 6, "qd": 6, "current": 6, "integral": 6, "capacitor": 6, "spring": 3, "spring_rate": 3}
    assert {name: of.shape for name, of in found.items()} == {name: (4641, count) for name, count in joints.items()}


def test_it_begins_in_the_published_balance(found: dict[str, np.ndarray]) -> None:
    """Springs are wound and every motor has its current, by gravity; to rounding of figures up to 100."""
    assert all(np.abs(of[0]).max() < 1e-13 for of in found.values()), {name: of[0] for name, of in found.items()}


def test_the_published_trajectory_is_met_as_the_page_says(found: dict[str, np.ndarray]) -> None:
    """Largest in joints 5 and 6 after they have broken away: that is of the first order in the step."""
    assert largest(found) == as_the_page_says("20 kHz", "whole robot")


@pytest.mark.release
@pytest.mark.parametrize("rate", ["50 kHz", "100 kHz", "200 kHz", "400 kHz"])
def test_with_shorter_steps_it_is_met_as_the_page_says(rate: str, tmp_path: Path) -> None:
    """At 200 kHz and more what is left is near the tolerance of the publication, 1e-6."""
    short = largest(found_at(tmp_path, 1000 * int(rate.split()[0])))
    assert short == as_the_page_says(rate, "whole robot")
    assert rate not in ("200 kHz", "400 kHz") or (short["q"] < 1e-7 and short["spring"] < 1e-6)


@pytest.mark.release
@pytest.mark.parametrize(("change", "signal", "least"), [
    ({"more": "arm = without_inertia;"}, "spring", 5.0),
    ({"fifth": "rate_s = 0.01 rad/s;"}, "q", 5.0),
    ({"third": "f_c = 0.699 N*m;"}, "spring", 5.0),
    ({"more": "initial { servos = unloaded; }"}, "current", 50.0),
], ids=["inertia", "fall", "friction", "balance"])  # fmt: skip
def test_it_is_not_met_with_less_than_the_library_has(
    found: dict[str, np.ndarray], tmp_path: Path, change: dict[str, str], signal: str, least: float
) -> None:
    """The default inertia of two bodies, friction that falls at once, one part in 700 of it, wound springs."""
    at = largest(found_at(tmp_path, 20_000, **change))[signal]
    assert at > least * largest(found)[signal], at
