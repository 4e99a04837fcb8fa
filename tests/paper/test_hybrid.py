"""The paper's figures 7 and 8, as numbers: the two-link arm with its shoulder's motor on a bed.

At the paper's rates and at 1 kHz. The curves are lost; held to is what the text says of them.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from met.run import Run
from tests.paper.figures import RATES, pair
from tests.paper.two_link import ONCE_A_TURN, RATIO, SLOW, hybrid

PAPER, FAST = RATES.values()
BOTH = pytest.mark.parametrize("rates", [PAPER, FAST], ids=["paper", "1 kHz"])


def rms(x: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(np.square(x), axis=0))


def late(run: Run) -> np.ndarray:
    """The rows from 5 s to 20 s, when both joints have settled: 112 turns of the shaft."""
    return (run.time >= 5.0) & (run.time < 20.0)


def spectra(run: Run, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies, power of x and of y, and their cross spectrum, from windows of 2 s: 15 turns of the shaft."""
    hz = 1.0 / (run.time[1] - run.time[0])
    options = {"fs": hz, "nperseg": round(2.0 * hz)}
    at, power_x = signal.welch(x, **options)
    return at, power_x, signal.welch(y, **options)[1], signal.csd(x, y, **options)[1]


@pytest.mark.slow
@BOTH
@pytest.mark.parametrize("joint", [0, 1])
def test_both_joints_settle_at_the_commanded_rate(rates, joint):
    """Measured: their means are off by 1.5e-5 at the paper's rates and 9e-6 at 1 kHz; the rest is oscillation."""
    _, mixed = pair(*rates)
    rate = mixed.signals["qd"][0, late(mixed), joint]
    # The mean of an oscillation of 1 % over 112 turns, cut anywhere in a turn, is off by 1 %/(112 pi) at most.
    assert abs(rate.mean() / SLOW - 1.0) < 1e-4
    assert np.all(np.abs(rate / SLOW - 1.0) < 0.02)  # inside the band in which a joint counts as settled


@pytest.mark.slow
@BOTH
def test_hybrid_and_pure_runs_agree(rates):
    """Measured rms over the run, as a share of the rate asked: shoulder 0.60 % and 0.33 %, elbow 0.07 % and 0.11 %."""
    pure, mixed = pair(*rates)
    off = rms(mixed.signals["qd"][0] - pure.signals["qd"][0]) / SLOW
    assert np.all(off < (0.008, 0.0015))
    # What is left is the bed's faults: without them 0.08 % and 0.07 %, 0.01 % and 0.001 %.
    ideal = hybrid("none", servo_hz=rates[0], dynamics_hz=rates[1])
    off = rms(ideal.signals["qd"][0] - pure.signals["qd"][0]) / SLOW
    assert np.all(off < (0.001, 0.0002))


@pytest.mark.slow
@BOTH
def test_joint_one_is_noisy_and_only_by_the_faults_of_the_bed(rates):
    """Measured deviation: 0.61 % and 0.28 % of the rate asked; 2e-9 and less without faults."""
    _, mixed = pair(*rates)
    noise = np.std(mixed.signals["qd"][0, late(mixed), 0]) / SLOW
    assert 0.002 < noise < 0.008
    ideal = hybrid("none", servo_hz=rates[0], dynamics_hz=rates[1])
    # What is left there is the end of settling: a mode of 1.7 /s, after 10 s.
    assert np.std(ideal.signals["qd"][0, ideal.time >= 10.0, 0]) / SLOW < 1e-6


@pytest.mark.slow
@BOTH
def test_joint_two_oscillates_with_joint_one_once_a_turn_of_the_shaft(rates):
    """Measured coherence 0.974 and 0.999, at 7.5 Hz."""
    _, mixed = pair(*rates)
    one, two = mixed.signals["qd"][0, late(mixed)].T
    at, power_one, power_two, cross = spectra(mixed, one, two)
    turn = int(np.argmin(np.abs(at - ONCE_A_TURN)))
    assert abs(at[turn] - ONCE_A_TURN) < 0.01 and at[turn] == at[power_one.argmax()] == at[power_two.argmax()]
    # Two signals that know nothing of each other reach 0.3 with these windows once in twenty times.
    assert abs(cross[turn]) ** 2 / (power_one[turn] * power_two[turn]) > 0.95
    # Motors in line: the oscillation is gone from both.
    straight = hybrid("typical, once = 0 N*m", servo_hz=rates[0], dynamics_hz=rates[1])
    one, two = straight.signals["qd"][0, late(straight)].T
    _, straight_one, straight_two, _ = spectra(straight, one, two)
    assert straight_one[turn] < 0.05 * power_one[turn] and straight_two[turn] < 0.05 * power_two[turn]


@pytest.mark.slow
def test_joint_two_oscillates_as_much_as_its_servo_lets_joint_one_push_it():
    """At 1 kHz, from the acceleration that the arm is told to the elbow's rate: closed form, friction sliding.

        (M_22 + N^2 J_m) s w_2 + N^2 (Kt^2/R + F_v + Kt/R (Kp + Ki/s)) w_2 = -M_12 s w_1,   s = 2 pi i f

    A tick's hold is half a tick of delay.
    """
    _, mixed = pair(*FAST)
    rows = late(mixed)
    at, power, _, cross = spectra(mixed, mixed.signals["qdd"][0, rows, 0], mixed.signals["qd"][0, rows, 1])
    turn = int(np.argmin(np.abs(at - ONCE_A_TURN)))
    # Two rods of 2 m, the outer one of 20 kg; its angle goes from 0.15 to 0.6 rad meanwhile.
    M_22, M_12 = 20.0 * 4.0 / 3.0, 20.0 * (4.0 / 3.0 + 2.0 * np.cos(mixed.signals["q"][0, rows, 1]).mean())
    kt, resistance, f_v, j_m, kp, ki = 0.061, 2.05, 2.58e-5, 6.38e-5, 0.020, 0.125
    s = 2.0j * math.pi * ONCE_A_TURN
    held = np.exp(-0.5 * s * 0.001)  # from tick to tick, as the voltage and the acceleration are
    braked = RATIO**2 * (kt**2 / resistance + f_v + kt / resistance * (kp + ki / s) * held)
    expected = -M_12 * held / ((M_22 + RATIO**2 * j_m) * s + braked)
    # Measured 0.09 % off: the elbow turns by 26 degrees meanwhile, and M_12 is taken at its mean.
    assert abs(cross[turn] / power[turn] / expected - 1.0) < 0.005
