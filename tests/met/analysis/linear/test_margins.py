"""Margins of sampled loops, against closed forms, against the poles of the closed loop, and against python-control."""

from __future__ import annotations

import cmath
import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from met.analysis.linear.margins import ScalarLoop, gain_limits, margins

PERIOD = 0.01


def integrator(gain: float, *, delay: int = 0) -> ScalarLoop:
    """L = gain/(z - 1) z^-delay: a rate that is held, with so many ticks of delay."""
    n = 1 + delay
    A, B = np.zeros((n, n)), np.zeros(n)
    A[0, 0] = 1.0
    for k in range(1, n):
        A[k, k - 1] = 1.0
    B[0] = -gain
    return ScalarLoop(A, B, np.eye(n)[-1], 0.0, PERIOD)


def random_loop(rng: np.random.Generator) -> ScalarLoop:
    """A loop with up to five poles within the unit circle."""
    n, roots = int(rng.integers(1, 6)), list[complex]()
    while len(roots) < n:
        if n - len(roots) > 1 and rng.random() < 0.6:
            root = cmath.rect(rng.uniform(0.2, 0.98), rng.uniform(0.1, 3.0))
            roots += [root, root.conjugate()]
        else:
            roots.append(complex(rng.uniform(-0.5, 0.98)))
    A = np.diag(np.ones(n - 1), -1)
    A[0] = -np.poly(roots).real[1:]
    made = ScalarLoop(A, np.eye(n)[0], rng.normal(size=n), 0.0, PERIOD)
    w = np.linspace(0.01, math.pi, 200) / PERIOD
    return ScalarLoop(A, made.B, made.C * rng.uniform(0.2, 3.0) / np.max(np.abs(made.response(w))), 0.0, PERIOD)


def stable_loops(seed: int, count: int) -> list[ScalarLoop]:
    rng, found = np.random.default_rng(seed), list[ScalarLoop]()
    while len(found) < count:
        made = random_loop(rng)
        if not made.grows():
            found.append(made)
    return found


def test_an_integrator_has_the_margins_of_its_closed_form() -> None:
    """L = k/(z - 1): |L| = k/(2 sin(wT/2)), its phase -(pi + wT)/2; it is unstable from k = 2 on, at the half of the
    rate; S - 1/2 is largest there, (2 + k)/(2 - k)/2."""
    k = 0.5
    found = margins(integrator(k))
    assert found is not None
    turn = 2.0 * math.asin(k / 2.0)
    assert math.isclose(found.gain_up or 0.0, 2.0 / k, rel_tol=1e-12)
    assert found.gain_down is None
    assert math.isclose(found.phase or 0.0, (math.pi - turn) / 2.0, rel_tol=1e-12)
    assert math.isclose(found.at_phase or 0.0, turn / PERIOD, rel_tol=1e-12)
    assert math.isclose(found.delay or 0.0, (math.pi - turn) / 2.0 / (turn / PERIOD), rel_tol=1e-12)
    assert math.isclose(found.disk, 2.0 * (2.0 - k) / (2.0 + k), rel_tol=1e-9)
    assert math.isclose(found.at_gain_up or 0.0, math.pi / PERIOD, rel_tol=1e-12)


def test_a_tick_of_delay_takes_its_share_of_the_margin() -> None:
    """k/(z (z - 1)) is stable up to k = 1, where its poles are at a sixth of the rate."""
    found = margins(integrator(0.5, delay=1))
    assert found is not None and found.gain_up is not None
    assert math.isclose(found.gain_up, 2.0, rel_tol=1e-12)
    assert math.isclose(found.at_gain_up or 0.0, math.pi / 3.0 / PERIOD, rel_tol=1e-12)


def test_an_unstable_loop_has_no_margins() -> None:
    assert margins(integrator(2.1)) is None
    assert margins(integrator(1.01, delay=1)) is None


@pytest.mark.slow
@pytest.mark.parametrize("loop", stable_loops(3, 12))
def test_at_each_limit_the_closed_loop_is_on_the_unit_circle(loop: ScalarLoop) -> None:
    found = margins(loop)
    assert found is not None
    for gain in (found.gain_up, found.gain_down):
        if gain is not None:
            beyond = gain * (1.0 + math.copysign(1e-5, gain - 1.0))
            assert loop.grows(beyond) and not loop.grows(gain + (1.0 - gain) * 1e-5)
    if found.phase is not None:
        for turn in (found.phase, -found.phase):
            closed = loop.A.astype(complex) + cmath.exp(1j * turn) * np.outer(loop.B, loop.C)
            distances = np.abs(np.abs(np.linalg.eigvals(closed)) - 1.0)
            assert distances.min() < 1e-9
    low, high = found.disk_gain
    assert (found.gain_up or math.inf) >= high * (1.0 - 1e-9) and (found.gain_down or 0.0) <= low * (1.0 + 1e-9)
    assert (found.phase or math.pi) >= found.disk_phase * (1.0 - 1e-9)
    w = np.concatenate([np.geomspace(1e-8, 1.0, 2000), np.linspace(1e-3, 1.0, 2000)]) * math.pi / PERIOD
    on_grid = 1.0 / np.max(np.abs(1.0 / (1.0 + loop.response(w)) - 0.5))
    assert on_grid * (1.0 - 1e-3) < found.disk <= on_grid * (1.0 + 1e-9)


@pytest.mark.parametrize("loop", stable_loops(4, 6))
def test_the_search_over_gains_finds_the_same_limits(loop: ScalarLoop) -> None:
    found = margins(loop)
    assert found is not None
    down, up = gain_limits(loop.A, loop.B[:, None], loop.C[None, :], np.zeros((1, 1)))
    for searched, exact in ((down, found.gain_down), (up, found.gain_up)):
        if searched is not None or (exact is not None and 2e-4 < exact < 5e3):
            assert searched is not None and exact is not None and math.isclose(searched, exact, rel_tol=1e-6)


@pytest.mark.release
@pytest.mark.oracle
def test_200_loops_have_the_margins_that_python_control_finds() -> None:
    """To 1e-9, where the crossings that it names are ones: it goes by polynomials, and knows none at the half of the
    rate."""
    control = pytest.importorskip("control")
    compared = 0
    for loop in stable_loops(0, 200):
        found = margins(loop)
        assert found is not None
        system = control.ss(loop.A, loop.B[:, None], -loop.C[None, :], 0.0, PERIOD)
        with warnings.catch_warnings(record=True) as doubts:
            warnings.simplefilter("always")
            gains, phases, _, _, at_phase, _ = control.stability_margins(system, returnall=True)
        if doubts:  # it takes its own polynomials for inaccurate
            continue
        inner = [gain for gain in np.atleast_1d(gains).tolist() if 0.0 < gain < math.inf]
        own = [(found.gain_up, found.at_gain_up), (found.gain_down, found.at_gain_down)]
        for side, (gain, at) in zip(([g for g in inner if g > 1.0], [g for g in inner if g < 1.0]), own, strict=True):
            if gain is not None and at is not None and 0.0 < at < math.pi / PERIOD * (1.0 - 1e-9):
                assert min(abs(each / gain - 1.0) for each in side) < 1e-9
                compared += 1
        sound = [abs(abs(loop.at(cmath.exp(1j * w * PERIOD))) - 1.0) < 1e-11 for w in np.atleast_1d(at_phase)]
        if found.phase is not None and sound and all(sound):
            named = np.min(np.abs(np.radians(np.atleast_1d(phases))))
            assert math.isclose(found.phase, named, rel_tol=1e-9)
            compared += 1
    assert compared > 150


# Poles that are none of the loop's own


def beside(loop: ScalarLoop, *poles: float, moved: float = 0.0) -> ScalarLoop:
    """The loop among states of an arm that it does not see, turned so that no zero tells which they are.

    poles  of the others;  moved: how much what stands at the open place moves them
    """
    n, more = len(loop.A), len(poles)
    A = np.block([[loop.A, np.zeros((n, more))], [np.zeros((more, n)), np.diag(poles)]])
    B = np.concatenate([loop.B, np.full(more, moved)])
    C = np.concatenate([loop.C, np.zeros(more)])
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(n + more, n + more)))
    return replace(loop, A=turn.T @ A @ turn, B=turn.T @ B, C=C @ turn)


def pendulum(least: float) -> ScalarLoop:
    """A pole that stands up, held by its rate and place: it needs this times its gain."""
    gravity = 9.0
    A = expm(PERIOD * np.array([[0.0, 1.0], [gravity, 0.0]]))
    B = np.array([0.5 * PERIOD**2, PERIOD])
    C = -np.array([1.0, 0.4])
    at_rest = -(C @ np.linalg.solve(np.eye(2) - A, B))
    return ScalarLoop(A, B, C / (-at_rest * least), 0.0, PERIOD)


@pytest.mark.parametrize("moved", [0.0, 1.0])
def test_a_pole_that_a_loop_does_not_see_hides_no_limit_at_rest(moved: float) -> None:
    own = margins(pendulum(0.3))
    found = margins(beside(pendulum(0.3), 1.0, 1.0, 0.5, moved=moved))
    assert own is not None and found is not None
    assert own.gain_down == pytest.approx(0.3, rel=1e-9) and own.at_gain_down == 0.0
    assert found.gain_down == pytest.approx(0.3, rel=1e-6) and found.at_gain_down == 0.0
    assert found.gain_up == pytest.approx(own.gain_up, rel=1e-6)


@pytest.mark.slow
def test_two_integrals_have_no_limit_at_rest_that_rounding_makes() -> None:
    """Their double pole comes out as two beside it; what a loop gives there is no number."""
    for seed in range(20):
        turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
        A = turn.T @ np.array([[1.0, PERIOD, 0.0], [0.0, 0.98, 0.02], [0.0, 0.0, 1.0]]) @ turn
        loop = ScalarLoop(A, turn.T @ np.array([0.0, 1e-3, 1e-5]), -np.array([8.0, 2.0, 1.0]) @ turn, 0.0, PERIOD)
        found = margins(loop)
        assert found is not None and (found.gain_down is None or found.gain_down > 1e-6)


def test_a_loop_at_its_edge_has_the_limit_1() -> None:
    loop = ScalarLoop(np.array([[0.99]]), np.array([0.01]), np.array([1.0]), 0.0, PERIOD)
    assert np.max(np.abs(np.linalg.eigvals(loop.closed(1.01)))) > 1.0
    found = margins(loop)
    assert found is not None
    assert (found.gain_up, found.at_gain_up, found.gain_down) == (1.0, 0.0, None)


def test_states_of_very_other_sizes_are_reduced_without_a_warning() -> None:
    """Balancing them takes scales above 2^63, of which scipy warns."""
    A, B, C = np.array([[0.9, 1e60], [1e-62, 0.5]]), np.array([0.0, 1e-60]), np.array([1.0, 0.0])
    loop = ScalarLoop(A, B, C, 0.0, PERIOD)
    assert loop.minimal().response([3.0, 50.0]) == pytest.approx(loop.response([3.0, 50.0]), rel=1e-9)
