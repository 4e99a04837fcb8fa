"""The standard deck of a satellite with an arm: it drifts without momentum, and thrusters hold it."""

from __future__ import annotations

import numpy as np
import pytest

import ic
from met import run as engine


@pytest.mark.slow
def test_the_arm_turns_the_satellite_the_other_way_and_no_momentum_comes_of_it() -> None:
    (made,) = ic.compile("free_flyer.ic").experiments
    run = engine.run(made)
    assert run.status.tolist() == [0]
    # The satellite and the arm about the vertical: 96 kg m^2 and its share of the offset arm's. 90 degrees of the arm,
    # stretched out only at the end, take it back by some ten.
    w, x, y, z = run.signals["links.base.orientation"][0, -1]
    turned = np.degrees(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    assert -13.0 < turned < -8.0
    for name in ("momentum.linear", "momentum.angular"):
        # nothing at the start: what the integrator makes of it in 4000 steps
        assert np.max(np.abs(run.signals[name][0])) < 2e-3, name
    np.testing.assert_allclose(np.linalg.norm(run.signals["links.base.rate"][0, -1]), 0.0, atol=1e-4)


@pytest.mark.slow
def test_on_board_it_feels_that_it_turns_and_shakes_and_not_that_it_falls() -> None:
    (made,) = ic.compile("free_flyer.ic", select=["flyer_felt"]).experiments
    run = engine.run(made)
    w, x, y, z = run.signals["links.base.orientation"][0].T
    axis = np.column_stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
    off = run.signals["sensors.drift"][0].ravel() - np.einsum("ij,ij->i", axis, run.signals["links.base.rate"][0])
    # noise of 0.005 deg/s and steps of 0.002: of 401 draws none beyond five of the one and half of the other
    assert 0.0 < np.max(np.abs(off)) < np.radians(5 * 0.005 + 0.001)
    shake = run.signals["sensors.shake"][0].ravel()
    assert np.max(np.abs(shake[run.time < 1.0])) < 5e-3 < 0.1 < np.max(np.abs(shake))


@pytest.mark.slow
def test_held_it_keeps_its_attitude_and_takes_momentum_from_outside() -> None:
    (made,) = ic.compile("free_flyer.ic", select=["flyer_held"]).experiments
    run = engine.run(made)
    assert run.met == {"turned > -0.05": [1]}
    assert np.max(np.abs(run.signals["momentum.angular"][0])) > 0.1
