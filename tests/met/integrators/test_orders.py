"""Every integrator falls to the exact motion with the order that it declares, from deck to kernel.

The exact motion: closed-form Lagrange equations and scipy's DOP853 between ticks of the servo, with stops and releases
located as events (tests/oracles/two_link_lagrange.py).
"""

from __future__ import annotations

import numpy as np
import pytest

import ic
from met import models
from met import run as engine
from tests.oracles.two_link_lagrange import Rods, mass_matrix, reference
from tests.paper.test_two_link import off, sine
from tests.paper.two_link import DRY, SLOW, run

ORDERS = {"modified_euler": 2, "midpoint": 2, "semi_implicit_euler": 1, "rk4": 4}
SWING = {"command": sine(0.2, 0.3), "servo_hz": 100.0, "friction": False, "q": (0.0, 1.0)}


def swung(integrator: str, hz: float, duration: float = 2.0) -> engine.Run:
    """The elbow bent, both joints told a sine of rate: no friction, with velocity products."""
    body = "environment { velocity_products = on; } initial { elbow.q = 1 rad; } integrator = " + integrator + ";"
    asked = "rate(sine(amplitude = 0.2 rad/s, frequency = 0.3 Hz))"
    return run(dynamics_hz=hz, record_hz=100, duration=duration, friction=False, run=body, command=asked)


def orders(errors: list[float]) -> np.ndarray:
    """The power of the step with which errors fall, from one to the next at half the step."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def test_all_integrators_are_held_to_their_order() -> None:
    assert {name: model.order for name, model in models.find_own("integrator").items()} == ORDERS


@pytest.mark.release
@pytest.mark.parametrize("integrator", ORDERS)
def test_the_error_falls_with_the_order_through_the_whole_program(integrator: str) -> None:
    """Measured at 800 Hz, share of the rates' range: 6e-4, 6e-6 (both of order 2), 3e-10."""
    exact = reference(np.arange(201) / 100.0, velocity_products=True, **SWING)
    runs = [swung(integrator, hz) for hz in (200.0, 400.0, 800.0)]
    for signal in ("q", "qd", "tau"):
        found = orders([off(one, exact, signal) for one in runs])
        # the error's next term is smaller by h times the motor's 29/s: 0.07 of the power at 200 Hz, half that at 400
        assert np.abs(found - ORDERS[integrator]).max() < 0.1, (signal, found)


@pytest.mark.slow
def test_rk4_at_1_khz_is_exact_to_a_part_in_1e9() -> None:
    """Measured 6.8e-11 of q's range and 6.0e-11 of qd's."""
    exact = reference(np.arange(501) / 100.0, velocity_products=True, **SWING)
    found = swung("rk4", 1000.0, 5.0)
    assert off(found, exact, "q") < 1e-9
    assert off(found, exact, "qd") < 1e-9


FREE = """
#include <two_link.ic>
run free like nominal {{
    servos      {{ remove shoulder; remove elbow; }}
    initial     {{ q = [0.3, 1.2] rad;  qd = [0.4, -0.7] rad/s; }}
    environment {{ velocity_products = on;  gravity = [0, -9.81, 0] m/s^2; }}
    rates       {{ dynamics = {hz} Hz;  record = 100 Hz; }}
    integrator  = {integrator};
    duration    = 2 s;
    record      = [q, qd];
    remove settle;  remove volts;
}}
"""


def energy(q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic and potential energy of the two rods [time], J, written down in closed form."""
    rods = Rods()
    kinetic = np.array([rate @ mass_matrix(rods, pose[1]) @ rate / 2.0 for pose, rate in zip(q, qd, strict=True)])
    elbow = rods.length_1 * np.sin(q[:, 0])
    middle = elbow + rods.length_2 / 2.0 * np.sin(q.sum(axis=1))
    return kinetic, 9.81 * (rods.mass_1 * elbow / 2.0 + rods.mass_2 * middle)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ORDERS)
def test_energy_of_a_free_fall_is_kept_to_the_order(integrator: str) -> None:
    """Measured at 1600 Hz, largest share of the kinetic energy's range: 6e-3, 2e-6, 1e-6, 3e-11."""
    errors = []
    for hz in (400, 800, 1600):
        found = engine.run(ic.compile(text=FREE.format(hz=hz, integrator=integrator), select=["free"]).experiments[0])
        assert found.cause == [""]
        kinetic, potential = energy(found.signals["q"][0], found.signals["qd"][0])
        assert np.ptp(kinetic) > 500.0, "the arm really falls"
        total = kinetic + potential
        errors.append(float(np.abs(total - total[0]).max()))
    # the next term is smaller by h times the arm's some 5 rad/s
    assert np.abs(orders(errors) - ORDERS[integrator]).max() < 0.1, errors


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ORDERS)
def test_friction_keeps_order_two_where_the_integrator_has_it(integrator: str) -> None:
    """A sine that reverses both joints: ten stops and twelve releases.

    Measured at 2 kHz, share of the rates' range: 4e-4, 1.1e-6 (both of order 2), 4e-10. A split is found on a parabola,
    so rk4 is of no more than order 3 here, and of 2 where a joint breaks away between two steps (test_passive.py).
    """
    exact = reference(np.arange(601) / 100.0, command=sine(SLOW, 0.5), servo_hz=100.0)
    stops = sum(event.after == 0 for event in exact.events)
    assert stops == 10 and len(exact.events) == 22
    asked, body = "rate(sine(amplitude = slow, frequency = 0.5 Hz))", f"integrator = {integrator};"
    runs = [run(dynamics_hz=hz, record_hz=100, duration=6, command=asked, run=body) for hz in (500, 1000, 2000)]
    for one in runs:
        assert {name: int(n[0]) for name, n in one.events.items()} == {"splits": stops, "clamped": 0, "undecided": 0}
    for signal in ("q", "qd"):
        found = orders([off(one, exact, signal) for one in runs])
        if integrator == "rk4":  # ragged: which term of the error rules depends on where in a step the stops lie
            assert found.min() > 2.0, found
        else:
            # the next term is smaller by h times 29/s: 0.06 at 500 Hz
            assert np.abs(found - ORDERS[integrator]).max() < 0.1, (signal, found)
    np.testing.assert_array_equal(runs[-1].signals["qd"][0] == 0.0, exact.qd == 0.0)


@pytest.mark.release
@pytest.mark.parametrize("integrator", ORDERS)
def test_a_joint_held_below_its_friction_stops_and_does_not_creep(integrator: str) -> None:
    pushed = {"dynamics_hz": 25, "servo_hz": 25, "record_hz": 1, "duration": 120}
    body = "initial { shoulder.qd = 0.01 rad/s; elbow.qd = -0.01 rad/s; } integrator = " + integrator + ";"
    held = run(command=f"torque({0.98 * DRY!r} N*m)", run=body, **pushed).signals
    assert held["q"][0, 10, 0] > 1e-3, "it came to rest from a motion"
    assert np.all(held["qd"][0, 10:] == 0.0)
    assert np.all(held["q"][0, 10:] == held["q"][0, 10])
    moved = run(command=f"torque({1.02 * DRY!r} N*m)", run=body, **pushed).signals
    assert np.all(moved["q"][0, -1] > 0.1)
