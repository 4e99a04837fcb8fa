"""The oracle is held to laws of its own before anything else is held to it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.oracles.two_link_lagrange import Command, Gearbox, Motion, Rods, mass_matrix, reference, velocity_torque

ARM = Rods()


def rate(value: float) -> Command:
    return Command("rate", lambda t: ((value, 0.0), (value, 0.0)))


def sine_rate(amplitude: float, hz: float) -> Command:
    def course(t: float) -> tuple[tuple[float, float], tuple[float, float]]:
        w = 2.0 * math.pi * hz
        both = (amplitude * math.sin(w * t), amplitude * w * math.cos(w * t))
        return both, both

    return Command("rate", course)


def energy(motion: Motion, motor: Gearbox) -> np.ndarray:
    rotor = motor.ratio**2 * motor.j_m * np.eye(2)
    states = zip(motion.q, motion.qd, strict=True)
    return np.array([qd @ (mass_matrix(ARM, q[1]) + rotor) @ qd / 2.0 for q, qd in states])


def test_mass_matrix_is_that_of_rods_in_the_textbook():
    """Two rods of equal length l and mass m: Spong, Hutchinson, Vidyasagar, Robot Modeling and Control (2006), 7.3."""
    m, length, q2 = 3.0, 0.7, 0.4
    square = m * length * length
    expected = np.array(
        [
            [square * (5.0 / 3.0 + math.cos(q2)), square * (1.0 / 3.0 + math.cos(q2) / 2.0)],
            [square * (1.0 / 3.0 + math.cos(q2) / 2.0), square / 3.0],
        ]
    )
    np.testing.assert_allclose(mass_matrix(Rods(length, length, m, m), q2), expected, rtol=1e-14)


def test_velocity_torque_follows_from_the_mass_matrix():
    """h_i = sum over j, k of (dM_ij/dq_k - 1/2 dM_jk/dq_i) qd_j qd_k, the derivative by central difference."""
    q2, qd, step = 0.8, np.array([0.5, -0.9]), 1e-5
    slope = (mass_matrix(ARM, q2 + step) - mass_matrix(ARM, q2 - step)) / (2.0 * step)
    h = slope @ qd * qd[1] - np.array([0.0, qd @ slope @ qd / 2.0])
    # the difference quotient is good to step^2 = 1e-10 of some 30 N m
    np.testing.assert_allclose(velocity_torque(ARM, q2, qd), h, atol=1e-7)


def test_without_servo_and_friction_energy_is_conserved():
    coasting = Gearbox(kt=1e-9, kp=0.0, ki=0.0)  # a motor that does nothing
    start = {"q": (0.3, 1.2), "qd": (0.4, -0.7)}
    swing = {"command": rate(0.0), "servo_hz": 1.0, "motor": coasting, "friction": False, **start}
    motion = reference(np.linspace(0.0, 10.0, 11), velocity_products=True, **swing)
    total = energy(motion, coasting)
    assert np.ptp(motion.q[:, 1]) > 3.0  # it really moves
    np.testing.assert_allclose(total, total[0], rtol=1e-11)  # rtol 1e-12 a step of the solver, tens of steps
    without = energy(reference(np.array([0.0, 10.0]), velocity_products=False, **swing), coasting)
    assert abs(without[1] / without[0] - 1.0) > 1e-3  # and so the law is not empty


@pytest.mark.release
def test_two_tolerances_agree_so_the_digits_have_converged():
    times = np.linspace(0.0, 4.0, 41)
    drive = {"command": sine_rate(0.03, 0.5), "servo_hz": 100.0, "friction": True}
    fine = reference(times, rtol=1e-12, **drive)
    coarse = reference(times, rtol=1e-9, **drive)
    assert len(fine.events) == len(coarse.events) > 4
    np.testing.assert_allclose(coarse.qd, fine.qd, atol=1e-12)
    np.testing.assert_allclose(coarse.q, fine.q, atol=1e-12)


@pytest.mark.slow
def test_a_motion_started_from_a_later_servo_tick_is_the_same_motion():
    """Frictionless, under a torque command, whose law remembers nothing."""
    push = Command("torque", lambda t: ((20.0, 0.0), (-5.0, 0.0)))
    options = {"command": push, "servo_hz": 50.0, "friction": False, "velocity_products": True}
    whole = reference(np.array([0.0, 1.0, 2.0]), **options)
    second = reference(np.array([0.0, 1.0]), q=whole.q[1], qd=whole.qd[1], **options)
    np.testing.assert_allclose(second.q[-1], whole.q[-1], rtol=1e-11)
    np.testing.assert_allclose(second.qd[-1], whole.qd[-1], rtol=1e-11)


@pytest.mark.release
def test_a_reversing_command_makes_joints_stick_and_release():
    motion = reference(np.linspace(0.0, 6.0, 601), command=sine_rate(0.03, 0.5), servo_hz=100.0)
    for joint in (0, 1):
        stops = [e.time for e in motion.events if e.joint == joint and e.after == 0]
        releases = [e.time for e in motion.events if e.joint == joint and e.before == 0]
        assert len(stops) >= 5 and len(releases) >= 5
    assert np.all(motion.qd[motion.mode == 0] == 0.0)  # stuck is at rest, exactly
    moving = motion.qd != 0.0
    assert np.all(np.sign(motion.qd[moving]) == motion.mode[moving])
    need = 0.061 * motion.voltage / 2.05 - motion.tau / 1570.0
    assert np.all(np.abs(need[motion.mode == 0]) <= 0.0205 * (1.0 + 1e-9))


@pytest.mark.slow
def test_a_torque_below_friction_moves_nothing_and_one_above_it_does():
    for share, moves in ((0.98, False), (1.02, True)):
        push = Command("torque", lambda t, share=share: ((share * 0.0205 * 1570.0, 0.0), (0.0, 0.0)))
        motion = reference(np.array([0.0, 1.0]), command=push, servo_hz=25.0)
        assert bool(motion.q[-1, 0] != 0.0) is moves


def test_a_stuck_joint_breaks_away_between_ticks_where_its_need_reaches_friction():
    """The elbow, unpowered, is carried around by the shoulder until centrifugal torque frees it.

    It is bent so that M_12 = m l^2 (1/3 + cos(q2)/2) is zero: the shoulder's acceleration asks nothing of it.
    """
    motor = Gearbox(f_c=5e-4)
    push = Command("torque", lambda t: ((1e4, 0.0), (0.0, 0.0)))  # full voltage on the shoulder
    bent = (0.0, math.acos(-2.0 / 3.0))
    options = {"command": push, "servo_hz": 0.25, "motor": motor, "velocity_products": True, "q": bent}
    released = [e for e in reference(np.array([0.0, 3.0]), **options).events if e.joint == 1]
    assert [(e.before, abs(e.after)) for e in released] == [(0, 1)] and 0.1 < released[0].time < 2.9
    just_before = reference(np.array([released[0].time - 1e-6]), **options)
    assert just_before.mode[0, 1] == 0 and just_before.qd[0, 1] == 0.0
    # the need grows by less than 1 N m/s, so a microsecond before it is F_c to 1e-6 N m of 0.8 N m
    np.testing.assert_allclose(abs(just_before.tau[0, 1]), motor.ratio * motor.f_c, rtol=1e-5)


@pytest.mark.release
def test_steady_rate_takes_the_voltage_of_back_emf_and_friction():
    motion = reference(np.array([0.0, 20.0]), command=rate(0.03), servo_hz=25.0)
    w = 1570.0 * 0.03
    volts = 0.061 * w + 2.05 / 0.061 * (0.0205 + 2.58e-5 * w)
    np.testing.assert_allclose(motion.qd[-1], 0.03, rtol=1e-6)  # the PI's slowest mode dies by exp(-1 /s * 20 s)
    np.testing.assert_allclose(motion.voltage[-1], volts, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["position", "torque"])
def test_every_kind_of_command_is_understood(kind):
    value = 0.01 if kind == "position" else 60.0
    command = Command(kind, lambda t: ((value, 0.0), (value, 0.0)))
    motion = reference(np.array([0.0, 3.0]), command=command, servo_hz=25.0, motor=Gearbox(k_position=2.0))
    assert np.all(motion.q[-1] > 0.005)
