"""soft_capture.ic against closed forms of the two bodies that a latch joins, and the energy that its closing takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import airy

from ic.find import find
from met import run as engine
from tests.ic.small_decks import changed, experiment

DECK = find("soft_capture.ic").read_text(encoding="utf-8")
CART, SATELLITE, STIFFNESS, DRIFT, MEETS, HOLDS = 400.0, 1200.0, 2e4, 0.05, 1.0, 5.0
REDUCED = CART * SATELLITE / (CART + SATELLITE)
DAMPING = np.sqrt(STIFFNESS * REDUCED)  # twice the ratio, 0.5, of the critical damping
WHERE = ("energy, momentum]", "energy, momentum, payloads.satellite.position, payloads.satellite.velocity]")
ENERGY = 0.5 * REDUCED * DRIFT**2


def ran(folder: Path, *changes: tuple[str, str], select: list[str] | None = None) -> engine.Run:
    found = engine.run(experiment(folder, changed(DECK, *changes), select=select or ["capture"]))
    assert not any(found.cause)
    return found


def force(t: np.ndarray) -> np.ndarray:
    """The force of a latch that closes at once, t after it met, N: of a damped oscillator that begins with DRIFT."""
    fades, w = DAMPING / (2.0 * REDUCED), np.sqrt(STIFFNESS / REDUCED - (DAMPING / (2.0 * REDUCED)) ** 2)
    x = DRIFT / w * np.exp(-fades * t) * np.sin(w * t)
    return STIFFNESS * x + DAMPING * (DRIFT * np.exp(-fades * t) * np.cos(w * t) - fades * x)


def test_the_peak_of_a_latch_that_closes_at_once_is_that_of_a_damped_oscillator(tmp_path: Path) -> None:
    found = ran(tmp_path, ("ramp      = 0.5 s;", ""), ("record = 100 Hz", "record = 1 kHz"))
    t = found.time - MEETS
    exact = np.where((t >= 0.0) & (t < HOLDS - MEETS), force(np.maximum(t, 0.0)), 0.0)
    on_satellite = found.signals["environment.latch.force"][0, :, 0]
    # order 2: of a step of 1 ms, and a swing of 0.77 s
    np.testing.assert_allclose(-on_satellite, exact, atol=1e-4 * exact.max())
    assert exact.max() == pytest.approx(122.5, abs=0.05), "as the page says"
    assert found.metrics["most"][0] == pytest.approx(exact.max(), rel=1e-6)
    assert found.metrics["faster"][0] == pytest.approx(DRIFT * SATELLITE / (CART + SATELLITE), rel=1e-12)


def test_latches_that_close_slowly_have_the_peaks_that_the_page_shows(tmp_path: Path) -> None:
    found = ran(tmp_path, select=["closing"])
    for ramp, peak, stated in zip((0.0, 0.5, 2.0), found.metrics["most"], (122.5, 97.80, 67.67), strict=True):

        def share(t: float, ramp: float = ramp) -> float:
            return min(t / ramp, 1.0) if ramp else 1.0

        def felt(t: float, x: float, v: float) -> float:
            return share(t) * (STIFFNESS * x + DAMPING * v)

        exact = solve_ivp(
            lambda t, y: (y[1], -felt(t, *y) / REDUCED),
            (0.0, 2.0), (0.0, DRIFT), rtol=1e-8, atol=1e-11, t_eval=np.linspace(0.0, 2.0, 2001),
        )  # fmt: skip
        forces = np.abs([felt(t, *y) for t, y in zip(exact.t, exact.y.T, strict=True)])
        assert peak == pytest.approx(forces.max(), rel=2e-5) and peak == pytest.approx(stated, rel=4e-4)


def test_without_damping_the_ramp_is_one_of_airys_functions(tmp_path: Path) -> None:
    """x'' = -a^3 t x while it closes, with a^3 the stiffness over mass and ramp."""
    found = ran(
        tmp_path, ("latch_ratio     = 0.5;", "latch_ratio     = 0;"), ("ramp      = 0.5 s;", "ramp      = 2 s;"),
        ("record = 100 Hz", "record = 1 kHz"),
    )  # fmt: skip
    t = found.time - MEETS
    inside = (t > 0.0) & (t <= 2.0)
    a = np.cbrt(STIFFNESS / REDUCED / 2.0)
    ai, dai, bi, dbi = airy(0.0)
    A, _, B, _ = airy(-a * t[inside])
    x = DRIFT / a * (A * bi - B * ai) / (dbi * ai - dai * bi)
    exact = STIFFNESS * t[inside] / 2.0 * x
    np.testing.assert_allclose(
        -found.signals["environment.latch.force"][0, inside, 0], exact, atol=1e-4 * np.abs(exact).max()
    )


def summed(rate: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The integral of a rate from the first instant to each, by trapezia."""
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (rate[1:] + rate[:-1]) / 2.0)])


def unbalanced(found: engine.Run) -> float:
    """The largest share of the energy that is neither stored, moved nor lost, while the latch holds."""
    t = found.time - MEETS
    latched = (t >= 0.0) & (t < HOLDS - MEETS)
    t = t[latched]
    x, v = (
        found.signals[f"payloads.satellite.{of}"][0, latched, 0] - found.signals[joint][0, latched, 0]
        for of, joint in (("position", "q"), ("velocity", "qd"))
    )
    share, kinetic = np.minimum(t / 0.5, 1.0), found.signals["energy.kinetic"][0, latched]
    stored = share * STIFFNESS * x**2 / 2.0
    work = summed(STIFFNESS * x**2 / 2.0 / 0.5, t)
    work = np.where(t <= 0.5, work, np.interp(0.5, t, work))
    lost = summed(share * DAMPING * v**2, t)
    assert work[-1] == pytest.approx(0.44, rel=2e-3), "what closes the latch does work, as the page says"
    return float(np.abs(kinetic + stored - kinetic[0] - work + lost).max()) / ENERGY


@pytest.mark.slow
def test_energy_is_what_the_closing_latch_puts_in_less_what_its_damper_takes(tmp_path: Path) -> None:
    """To order 2, of the run and of the sums here."""
    off = []
    for rate in ("500 Hz", "1 kHz"):
        steps = ("dynamics = 1 kHz;  record = 100 Hz", f"dynamics = {rate};  record = {rate}")
        found = ran(tmp_path, steps, WHERE)
        off.append(unbalanced(found))
        assert found.grapples["satellite.energy"][0] < 1e-6 * ENERGY, "nothing is left for the grapple"
        np.testing.assert_allclose(found.signals["momentum.linear"][0, :, 0], SATELLITE * DRIFT, rtol=1e-12)
    assert off[0] < 3e-4 and 3.8 < off[0] / off[1] < 4.2
