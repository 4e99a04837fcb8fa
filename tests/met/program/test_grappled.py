"""Figures of grapples, against a closed form and the energy of the run itself."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.backends.reference.plain import execute
from met.plan.outputs import GRAPPLE_FIGURES
from met.program.build import build
from tests.ic.small_decks import changed, experiment
from tests.met.program.free_flyers import ARM
from tests.met.program.payload_decks import RUN

SPHERES = """\
arm chaser { link base { mass = 3 kg; inertia = [0.7, 0.7, 0.7] kg*m^2; } }
run it {
    arm = chaser; base = free;
    initial { base.velocity = [4, 0, 0] m/s; base.position = [-2, 0, 0] m; }
    payload ball { mass = 1 kg; inertia = [0.2, 0.2, 0.2] kg*m^2; on = base; at = [0, 0.5, 0] m; grapple = 0.5 s;
                   position = [0, 0.7, 0] m; rate = [0, 0, 3] rad/s; }
    rates { dynamics = 1 kHz; record = 10 Hz; }  duration = 1 s;  record = [energy];
}
sweep times of it { vary payloads.ball.grapple = [0.5, 3] s; }
"""


@pytest.mark.slow
def test_of_two_spheres_all_figures_are_as_the_formulas_say(tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, SPHERES, select="times"))
    got = {name: run.grapples[f"ball.{name}"] for name in GRAPPLE_FIGURES}
    size = math.sqrt(3.0 * 0.2 / 1.0)
    assert got["distance"][0] == pytest.approx(0.2, abs=1e-12)
    assert got["near"][0] == pytest.approx(1.5 * size + 0.2 * math.sqrt(3.0 * 0.7 / 3.0))
    assert got["speed"][0] == pytest.approx(4.0 + 3.0 * size)
    assert got["rate"][0] == pytest.approx(3.0)
    energy = run.signals["energy.kinetic"][0]
    assert got["energy"][0] == pytest.approx(energy[4] - energy[5], rel=1e-12)
    mu, d, both = 0.75, 0.7, 0.9  # reduced mass; the way between the lines of flight; moments of inertia
    spin = 0.2 * 3.0 + mu * d * 4.0  # about the common centre, where the base does not turn
    lost = 0.5 * mu * 4.0**2 + 0.5 * 0.2 * 3.0**2 - 0.5 * spin**2 / (both + mu * d * d)
    assert got["energy"][0] == pytest.approx(lost, rel=1e-12)
    assert all(np.isnan(values[1]) for values in got.values()), "its time is after the run's end"


@pytest.mark.slow
def test_of_a_jointed_flyer_the_energy_is_what_the_run_loses_at_the_instant(tmp_path: Path) -> None:
    every = ("record = 10 Hz", "record = 100 Hz")
    run = engine.run(experiment(tmp_path, ARM, changed(RUN, every)))
    before = engine.run(experiment(tmp_path, ARM, changed(RUN, every, ("grapple  = 0.8 s", "grapple  = 0.9 s"))))
    was, now = (each.signals["energy.kinetic"][0, 80] for each in (before, run))
    assert run.grapples["box.energy"][0] == pytest.approx(was - now, rel=1e-12)
    assert run.grapples["box.distance"][0] == pytest.approx(before.signals["payloads.box.distance"][0, 80], rel=1e-12)


def test_a_body_without_mass_has_no_size(tmp_path: Path) -> None:
    arm = "arm a { link b { mass = 1 kg; shape = rod(length = 1 m, along = x); } link hand { mass = 0 kg; }\n"
    arm += "joint j revolute { parent = base; child = b; axis = z; } "
    arm += "joint k fixed { parent = b; child = hand; at = [1, 0, 0] m; } }\n"
    run = "run r { arm = a; payload p { mass = 1 kg; inertia = [0.01, 0.01, 0.01] kg*m^2; on = hand; "
    run += "grapple = 0.1 s; position = [1.02, 0, 0] m; } rates { dynamics = 100 Hz; } duration = 0.2 s; record = []; }"
    found = engine.run(experiment(tmp_path, arm, run)).grapples
    assert found["p.distance"][0] == pytest.approx(0.02)
    assert found["p.near"][0] == pytest.approx(1.5 * math.sqrt(0.03) + 0.05 * 1.0)  # the hand is its place, at 1 m
    assert found["p.energy"][0] == 0.0


CART = """\
arm cart {
    link block { mass = 3 kg;  shape = sphere(radius = 0.1 m); }
    joint slide prismatic { parent = base;  child = block;  axis = x; }
}
servo geared {
    model = rigid_gearbox;  ratio = 10 rad/m;  kp = 0 V*s/rad;  ki = 0 V/rad;  v_max = 1 V;  resistance = 1 ohm;
    kt = 1e-9 N*m/A;  tau_max = 1 N*m;  j_m = 0.02 kg*m^2;  f_c = 0 N*m;  f_v = 0 N*m*s/rad;  command = torque(0 N);
}
run catch {
    arm = cart;  servos { slide = geared; }
    payload ball { mass = 1 kg;  inertia = [1, 1, 1] kg*m^2;  on = block;  position = [-0.06, 0, 0] m;
                   velocity = [6, 0, 0] m/s;  grapple = 0.004 s;  release = 0.009 s; }
    payload box { mass = 2 kg;  inertia = [1, 1, 1] kg*m^2;  on = block;  position = [1, 0, 0] m;
                   velocity = [-2, 0, 0] m/s;  grapple = 0.007 s; }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 1 kHz; }  duration = 0.012 s;
    record = [qd, payloads.ball.carried, payloads.box.carried];
}
"""


def test_a_cart_that_catches_two_payloads_keeps_momentum_with_its_motors_share(tmp_path: Path) -> None:
    """Of 3 kg, and 2 kg by its rotor; each time at the very instant, and what is not released stays."""
    found = experiment(tmp_path, CART)
    rows, _ = execute(build(found), {}, found.structure.schedule.ticks)
    rates = [0.0] * 4 + [1.0 * 6.0 / (5.0 + 1.0)] * 3 + [(6.0 * 1.0 - 2.0 * 2.0) / (6.0 + 2.0)] * 6
    np.testing.assert_allclose(rows[:, 0], rates, rtol=1e-12, atol=1e-15)
    assert rows[:, 1].tolist() == [0.0] * 4 + [1.0] * 5 + [0.0] * 4
    assert rows[:, 2].tolist() == [0.0] * 7 + [1.0] * 6
