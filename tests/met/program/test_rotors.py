"""Rotors on a free base through a run: what the whole has of momentum stays, whatever the motors do to the arm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.run import Run
from tests.ic.small_decks import experiment

DECK = """\
arm pair {{
    link base  {{ mass = 30 kg; inertia = [3, 4, 5] kg*m^2; }}
    link upper {{ mass = 4 kg; com = [0.3, 0, 0] m; inertia = [0.1, 0.4, 0.4] kg*m^2; }}
    link fore  {{ mass = 3 kg; com = [0.25, 0, 0.05] m; inertia = [0.1, 0.2, 0.2] kg*m^2; }}
    joint shoulder revolute {{ parent = base; child = upper; at = [0.2, 0, 0.3] m; axis = z; }}
    joint elbow    revolute {{ parent = upper; child = fore; at = [0.6, 0, 0] m; axis = [0, 0.6, 0.8]; }}
}}
servo drive {{
    model = {model};
    ratio = 20; kp = 0.3 V*s/rad; ki = 3 V/rad; v_max = 48 V;
    resistance = 1 ohm; kt = 0.1 N*m/A; tau_max = 2 N*m; j_m = 2e-3 kg*m^2; f_c = 0.01 N*m; f_v = 1e-3 N*m*s/rad;
    {more}
    rate = continuous;
}}
servo swing like drive {{ command = rate(chirp(amplitude = 0.8 rad/s, f0 = 0.5 Hz, f1 = 2 Hz, over = 1 s)); }}
servo hold like drive {{ command = rate(0.5 rad/s); }}
run it {{
    arm = pair; base = free;
    servos {{ shoulder = swing; elbow = hold; }}
    initial {{ base.rate = [0.1, -0.2, 0.3] rad/s; }}
    rates {{ dynamics = {hz} Hz; servos = {hz} Hz; record = 20 Hz; }}
    duration = 1 s;
    record = [q, qd, momentum.linear, momentum.angular, energy.kinetic, links.base.rate];
}}
"""
MODELS = {"rigid_gearbox": "", "compliant_gearbox": "stiffness = 4000 N*m/rad; damping = 20 N*m*s/rad;"}


def flown(folder: Path, model: str, hz: int) -> Run:
    return engine.run(experiment(folder, DECK.format(model=model, more=MODELS[model], hz=hz)))


def lost(run: Run) -> np.ndarray:
    """How far the momenta leave what they were, as a share of what motors move."""
    whole = np.concatenate([run.signals["momentum.linear"][0], run.signals["momentum.angular"][0]], axis=1)
    return np.max(np.abs(whole - whole[0]))


@pytest.mark.release
@pytest.mark.parametrize("model", MODELS)
def test_momentum_is_kept_to_the_integrators_order(tmp_path: Path, model: str) -> None:
    errors = [lost(flown(tmp_path, model, hz)) for hz in (1000, 2000, 4000)]
    print(model, errors)
    assert errors[2] < 1e-5
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0


BOX = """\
    payload box {
        mass = 6 kg; inertia = [0.3, 0.2, 0.4] kg*m^2;
        on = fore; at = [0.5, 0, 0] m; grapple = 0.4 s;
        position = [1.5, 0.1, 0.3] m; velocity = [0.2, -0.5, 0.1] m/s; rate = [1, -2, 1.5] rad/s;
    }
"""


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
def test_momentum_is_kept_through_a_grapple(tmp_path: Path, model: str) -> None:
    text = DECK.format(model=model, more=MODELS[model], hz=8000)
    text = text.replace("    initial {", BOX + "    initial {").replace(
        "links.base.rate]", "links.base.rate, payloads.box.rate]"
    )
    run = engine.run(experiment(tmp_path, text))
    rate = run.signals["links.base.rate"][0]
    before = int(np.searchsorted(run.time, 0.4 - 1e-9))
    assert np.max(np.abs(rate[before + 1] - rate[before])) > 0.05
    print(model, lost(run))
    assert lost(run) < 1e-7


@pytest.mark.slow
def test_a_base_with_less_inertia_than_the_rotor_it_carries_is_a_failed_case(tmp_path: Path) -> None:
    text = DECK.format(model="rigid_gearbox", more="", hz=1000).replace("j_m = 2e-3", "j_m = 60")
    [why] = engine.run(experiment(tmp_path, text)).cause
    assert "inertia" in why
    assert why.endswith("Give link base mass, and a shape or inertia, that of the rotors it carries among it.")
