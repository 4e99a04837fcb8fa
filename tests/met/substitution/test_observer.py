"""The filter, the shaft and the observer against matrix exponentials, fine steps and scipy's Riccati equation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from met.substitution import butterworth, observer, shaft

J, KT, R, F_V, F_C = 6.38e-5, 0.061, 2.05, 2.58e-5, 0.0205  # table 1 of Hill, Hopping and Price (1989)
DAMPING = KT * KT / R + F_V
NOISE = observer.Noise(torque=1e-6, drift=1e-8, reading=1e-2)


def continuous(f_cut: float) -> tuple[np.ndarray, np.ndarray]:
    """x' = A x + B u of (w, y, z, d)."""
    wc = 2.0 * math.pi * f_cut
    A = np.zeros((4, 4))
    A[0, 0], A[0, 3], A[1, 2] = -DAMPING / J, 1.0 / J, 1.0
    A[2, :3] = wc * wc, -wc * wc, -math.sqrt(2.0) * wc
    return A, np.array([1.0 / J, 0.0, 0.0, 0.0])


def made(f_cut: float, period: float) -> observer.DiscreteModel:
    return observer.model(inertia=J, damping=DAMPING, f_cut=f_cut, period=period)


@pytest.mark.parametrize("f_cut", [5.0, 50.0, 400.0])
@pytest.mark.parametrize("period", [1e-4, 1e-3, 1e-2])
def test_the_model_is_the_matrix_exponential(f_cut: float, period: float) -> None:
    A, B = continuous(f_cut)
    whole = expm(np.block([[A, B[:, None]], [np.zeros((1, 5))]]) * period)
    model = made(f_cut, period)
    # units that make the states one size, so that a share of the largest entry says something
    size = np.array([1.0, 1.0, 2.0 * math.pi * f_cut, DAMPING])
    for found, wanted in ((np.array(model.A), whole[:4, :4]), (np.array(model.B)[:, None], whole[:4, 4:])):
        columns = size if wanted.shape[1] == 4 else np.array([DAMPING])
        scaled = (found - wanted) * columns / size[:, None]
        assert np.abs(scaled).max() < 1e-12


def test_the_filter_follows_a_straight_line_exactly() -> None:
    time, f_cut, begin, end = 2.5e-4, 50.0, 30.0, 31.7
    wc = 2.0 * math.pi * f_cut
    A = np.array([[0.0, 1.0], [-wc * wc, -math.sqrt(2.0) * wc]])
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[1, 2], whole[2, 3] = A, wc * wc, 1.0
    wanted = expm(whole * time) @ [12.0, -300.0, begin, (end - begin) / time]
    found = butterworth.along_line(butterworth.over(f_cut, time), (12.0, -300.0), begin, end)
    assert found == pytest.approx(wanted[:2], rel=1e-12)


def test_a_filter_at_rest_with_its_drive_stays() -> None:
    of = butterworth.over(50.0, 1e-3)
    assert butterworth.along_line(of, (7.0, 0.0), 7.0, 7.0) == pytest.approx((7.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("period", [1e-3, 1e-2])
def test_riccatis_recursion_ends_at_scipys_solution(period: float) -> None:
    model = made(50.0, period)
    A, B = np.array(model.A), np.array(model.B)
    Q = np.outer(B, B) * NOISE.torque + np.diag([0.0, 0.0, 0.0, NOISE.drift])
    C = np.array([[0.0, 1.0, 0.0, 0.0]])
    S = np.diag([1.0, 1.0, 1e-2, 1e2])  # states of one size: scipy loses digits otherwise
    T = np.linalg.inv(S)
    scaled = solve_discrete_are((S @ A @ T).T, (C @ T).T, S @ Q @ S, np.array([[NOISE.reading]]))
    P = T @ scaled @ T
    wanted = (P @ C.T / (C @ P @ C.T + NOISE.reading))[:, 0]
    found = tuple(tuple(row) for row in np.diag([1e4, 1e4, 1e8, 1e-2]).tolist())
    for _ in range(400):
        found = observer.next_covariance(model, found, NOISE)
    assert observer.gain_of(found, NOISE) == pytest.approx(wanted, rel=1e-8)
    radius = np.abs(np.linalg.eigvals((np.eye(4) - np.outer(wanted, C[0])) @ A)).max()
    assert radius < 1.0


def test_the_observer_finds_a_torque_that_nobody_told_it() -> None:
    """From the filtered rate alone: 0.01 N m besides what the model is told, found within the noise of its gain."""
    model = made(50.0, 1e-3)
    P = tuple(tuple(row) for row in np.diag([1e4, 1e4, 1e8, 1e-2]).tolist())
    for _ in range(400):
        P = observer.next_covariance(model, P, NOISE)
    gain = observer.gain_of(P, NOISE)
    true, hat = (5.0, 5.0, 0.0, 0.01), (0.0, 0.0, 0.0, 0.0)
    for k in range(600):
        u = 0.03 * math.sin(0.01 * k)
        hat = observer.corrected(hat, gain, true[1])
        true, hat = observer.predicted(model, true, u), observer.predicted(model, hat, u)
    assert hat == pytest.approx(true, rel=1e-6)


# The shaft


def fine(w: float, drive: float, time: float, steps: int = 200_000) -> float:
    """The rate after some time under a constant torque, back-EMF, and friction that sticks, by Euler's small steps."""
    h = time / steps
    for _ in range(steps):
        smooth = drive - DAMPING * w
        s = math.copysign(1.0, w) if w else math.copysign(1.0, smooth) if abs(smooth) > F_C else 0.0
        after = w + (smooth - s * F_C) / J * h if s else 0.0
        w = 0.0 if s * after < 0.0 else after
    return w


@pytest.mark.slow
@pytest.mark.parametrize(("w", "drive"), [(0.0, 0.05), (0.0, 0.0204), (0.0, -0.04), (20.0, 0.05), (-20.0, -0.01)])
def test_the_shaft_is_exact_while_it_does_not_turn_back(w: float, drive: float) -> None:
    found = shaft.slid(w, drive - DAMPING * w, F_C, inertia=J, decay=DAMPING / J, time=5e-3)
    assert found == pytest.approx(fine(w, drive, 5e-3), rel=2e-5, abs=1e-12)  # Euler's error at 25 ns


@pytest.mark.parametrize(("w", "drive"), [(0.5, -0.05), (-0.5, 0.0), (1.0, -0.0206)])
def test_a_shaft_that_would_turn_back_stops_exactly(w: float, drive: float) -> None:
    assert shaft.slid(w, drive, F_C, inertia=J, decay=DAMPING / J, time=5e-3) == 0.0


def test_a_shaft_held_by_friction_does_not_move_in_an_hour() -> None:
    w = 0.0
    for _ in range(3600):
        w = shaft.slid(w, 0.98 * F_C, F_C, inertia=J, decay=DAMPING / J, time=1.0)
    assert w == 0.0
