"""Friction at a motor: the steady curve of each law, what sticks, what creeps, and energy."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from met import run as engine
from met.run import Run
from met.servos.friction import friction
from tests.ic.small_decks import ARM, changed, experiment

F_C, F_S, RATE_S, F_V = 0.02, 0.035, 3.0, 1e-4
LAWS = {
    "coulomb": "friction = coulomb;",
    "stribeck": "friction = stribeck;  f_s = 0.035 N*m;  rate_s = 3 rad/s;",
    "lugre": "friction = lugre;  f_s = 0.035 N*m;  rate_s = 3 rad/s;  sigma_0 = 2 N*m/rad;  sigma_1 = 0.002 N*m*s/rad;",
}
SERVO = """\
servo drive {
    model = rigid_gearbox;  rate = continuous;
    ratio = 100;  kp = 0.5 V*s/rad;  ki = 20 V/rad;  v_max = 48 V;  resistance = 1 ohm;  kt = 0.05 N*m/A;
    tau_max = 3 N*m;
    j_m = 1e-4 kg*m^2;  f_c = 0.02 N*m;  f_v = 1e-4 N*m*s/rad;
    command = rate(0.3 rad/s);
}
"""
RUN = """\
run it {
    arm = swing;  servos { hinge = drive; }
    rates { dynamics = 4 kHz;  record = 200 Hz; }
    duration = 3 s;
    record = [q, qd, servo.motor_torque, servo.motor_rate];
}
sweep rates of it { vary drive.command.value = [-0.5, -0.02, 0.005, 0.02, 0.05, 0.1, 0.5] rad/s; }
sweep pushes of it { vary drive.command.value = [0.5, 1.5, 1.9, 2.1, 3.4, 3.6] N*m; }
"""


def ran(folder: Path, law: str, *changes: tuple[str, str], select: str) -> Run:
    text = changed(SERVO + RUN, ("f_c = 0.02", f"{LAWS[law]}  f_c = 0.02"), *changes)
    keep = text.split(f"sweep {'pushes' if select == 'rates' else 'rates'}")
    text = keep[0] + ("" if select == "rates" else "sweep pushes" + text.split("sweep pushes")[1])
    return engine.run(experiment(folder, ARM, text, select=[select]))


def level(law: str, w: np.ndarray) -> np.ndarray:
    curve = F_C + 0.0 * w
    return curve if law == "coulomb" else curve + (F_S - F_C) * np.exp(-((w / RATE_S) ** 2))


@pytest.mark.slow
@pytest.mark.parametrize("law", sorted(LAWS))
def test_the_torque_of_a_steady_rate_is_the_laws_curve(law: str, tmp_path: Path) -> None:
    run = ran(tmp_path, law, select="rates")
    asked = run.coordinates["drive.command.value"]
    np.testing.assert_allclose(run.signals["qd"][:, -1, 0], asked, rtol=1e-11)
    w = 100.0 * asked
    curve = np.sign(w) * level(law, w) + F_V * w
    # an integral that has settled; of LuGre's bristles the slowest rate constant is sigma_0 w/g = 2 * 0.5/0.035 = 29/s
    np.testing.assert_allclose(run.signals["servo.motor_torque"][:, -1, 0], curve, rtol=1e-11)


TORQUE = (("command = rate(0.3 rad/s)", "command = torque(1 N*m)"),)


@pytest.mark.parametrize(("law", "breaks"), [("coulomb", 2.0), ("stribeck", 3.5)])
def test_it_sticks_up_to_the_torque_that_breaks_it_away(law: str, breaks: float, tmp_path: Path) -> None:
    run = ran(tmp_path, law, *TORQUE, select="pushes")
    for asked, qd in zip(run.coordinates["drive.command.value"], run.signals["qd"][:, :, 0], strict=True):
        assert (qd == 0.0).all() if asked < breaks else qd[-1] > 0.0, asked


def test_bristles_bend_as_a_spring_before_they_slip(tmp_path: Path) -> None:
    """Pushed by less than breaks away, the shaft yields by torque over stiffness; more than that, it runs off."""
    run = ran(tmp_path, "lugre", *TORQUE, ("duration = 3 s", "duration = 10 s"), select="pushes")
    for asked, q in zip(run.coordinates["drive.command.value"], run.signals["q"][:, :, 0], strict=True):
        bent = asked / 100.0 / 2.0 / 100.0
        if asked < 2.0:
            assert bent < q[-1] < 10.0 * bent, "it slips a little on its way"
            assert abs(q[-1] - q[-200]) < 1e-6 * bent, "and then stands"
        elif asked > 3.5:
            assert np.nanmax(q) > 0.5  # and fails at last, where it is too fast for the step


@pytest.mark.release
@pytest.mark.parametrize("law", sorted(LAWS))
def test_friction_takes_energy_out_or_stores_what_it_gives_back(law: str) -> None:
    """Over any motion of the shaft the energy taken in is never less than nothing (LuGre's bristles store some)."""
    rng = np.random.default_rng(5)
    p = SimpleNamespace(friction=law, f_c=F_C, f_s=F_S, rate_s=RATE_S, f_v=F_V, sigma_0=2.0, sigma_1=0.002)
    t = np.arange(0.0, 4.0, 1e-4)
    for _ in range(20):
        w = sum(a * np.sin(f * t + b) for a, f, b in rng.uniform([-8, 0.5, 0], [8, 20, 6], (3, 3)))
        z, taken, least = np.float64(0.0), 0.0, 0.0
        for rate in w:
            rubs = friction(p, np.float64(rate), SimpleNamespace(bristle=z))
            taken += 1e-4 * rate * (rubs.torque + np.sign(rate) * rubs.level)
            z = z + 1e-4 * rubs.bending.get("bristle", 0.0)
            least = min(least, taken)
        assert least > -1e-6 and taken > 0.0


@pytest.mark.slow
def test_bristles_bent_beyond_what_they_bear_fail_the_case(tmp_path: Path) -> None:
    """At h sigma_0 |w|/g of 31 they are bent to a thousand times; a step that is short enough is true."""
    stiff = ("sigma_0 = 2 N*m/rad;  sigma_1 = 0.002 N*m*s/rad;", "sigma_0 = 50 N*m/rad;  sigma_1 = 0.01 N*m*s/rad;")
    run = ran(tmp_path, "lugre", stiff, select="rates")
    asked = np.abs(run.coordinates["drive.command.value"])
    assert (run.status == np.where(asked >= 0.05, 1, 0)).all(), run.cause
    when, _, why = run.cause[-1].partition(" s: joint hinge: a state of its servo is where it can never be (")
    assert when.startswith("t = ") and why.partition("): ")[2] == (
        "a step is too long for the servo (try a faster rate for the dynamics). The bristles of `friction = lugre` "
        "want sigma_0 |motor rate|/f_c times the step to stay below the integrator's limit."
    ), run.cause[-1]
    short = ran(tmp_path, "lugre", stiff, ("dynamics = 4 kHz", "dynamics = 200 kHz"), select="rates")
    assert (short.status == 0).all()


def test_without_friction_bristles_do_nothing() -> None:
    p = SimpleNamespace(friction="lugre", f_c=0.0, f_s=0.0, rate_s=1.0, f_v=0.0, sigma_0=2.0, sigma_1=0.1)
    rubs = friction(p, np.float64(3.0), SimpleNamespace(bristle=np.float64(0.0)))
    assert (rubs.torque, rubs.level, rubs.bending) == (0.0, 0.0, {"bristle": 0.0})
