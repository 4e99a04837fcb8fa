"""Linear answers against what is known without them: closed forms of two arms, monodromy of runs, limits of sweeps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import ic
from met import run as engine
from met.analysis.linear.answers import linear
from met.analysis.linear.period import PeriodProgram
from met.passing import run_past
from met.plan import Experiment
from tests.ic.small_decks import experiment
from tests.met.analysis.limits import Machine, bisect, loop, prepared_for, scaled, swings_up
from tests.met.analysis.limits import experiment as machines
from tests.met.analysis.linear.oracles import DECKS


def sorted_poles(values: np.ndarray) -> np.ndarray:
    return values[np.lexsort((np.round(values.imag, 9), np.round(values.real, 9)))]


def test_the_poles_of_one_axis_of_the_manutec_r3_are_the_closed_form() -> None:
    """The seven equations of the Modelica Standard Library's axis, with numbers of its pages, and Heun's step of them:
    load, current, amplifier, spring, motor, and the integral of the rate loop. To 1e-10."""
    (made,) = ic.compile(DECKS / "manutec_r3_one_axis.ic").experiments
    found = linear(made, at=0.5)
    assert not found.held and not found.at_limit
    n, c, d, J, J_m, kt, f_v = 210.0, 8.0, 0.01, 1.3 * 15.0, 1.3e-3, 1.1616, 0.1 / 130.0
    K, D, R, k_position, kp, ki = c * n * n, d * n * n, 250.0, 5.0, 0.5, 0.5 / 0.05
    omega, zeta = 5500.0, 0.6
    L, ki_current = 250.0 / (2.0 * zeta * omega), 125.0 * omega / zeta
    k_current = float(made.parameters["axis.servo.k_current"].value)  # type: ignore[arg-type]
    q, w, i, a, s, m, summed = np.eye(
        7
    )  # position and rate of the load, current, amplifier, spring, motor's rate, integral
    torque = K * s + D * (m / n - w)
    u = -k_position * n * (q + s) - m
    e = kp * u + ki * summed - i
    A = np.array([
        w, torque / J, (k_current * e + a - R * i - kt * m) / L, ki_current * e, m / n - w,
        (kt * i - torque / n - f_v * m) / J_m, u,
    ])  # fmt: skip
    roots = np.linalg.eigvals(A)
    own = sorted_poles(np.linalg.eigvals(found.plant.A))
    np.testing.assert_allclose(own, sorted_poles(roots), rtol=1e-10)
    x = 5e-5 * roots
    of_step = sorted_poles(1.0 + x + 0.5 * x * x)
    np.testing.assert_allclose(sorted_poles(np.linalg.eigvals(found.A)), of_step, rtol=1e-10)


@pytest.mark.slow
def test_the_poles_of_the_two_link_arm_are_the_closed_form(tmp_path: Path) -> None:
    """Lagrange's inertia at the pose, motors by table 1 of the paper, Heun under a held voltage, and the PI law's tick,
    at 100 Hz each. To 1e-10."""
    deck = DECKS / "two_link.ic"
    (tmp_path / "deck.ic").write_text(
        f'#include "{deck}"\nrun fast like nominal {{\n'
        "    rates { dynamics = 100 Hz;  servos = 100 Hz;  record = 25 Hz; }\n}\n"
    )
    (made,) = ic.compile(tmp_path / "deck.ic", select=["fast"]).experiments
    found = linear(made, at=20.0)
    assert not found.held and not found.at_limit and found.seconds == 0.01
    N, kt, R, f_v, J_m, kp, ki, h = 1570.0, 0.061, 2.05, 2.58e-5, 6.38e-5, 0.020, 0.125, 0.01
    length, m1, m2 = 2.0, 40.0, 20.0
    result = engine.run(made)
    q, qd = (float(result.signals[name][0, -1, 1]) for name in ("q", "qd"))
    damping, drive = N * N * (kt * kt / R + f_v) * np.eye(2), N * kt / R * np.eye(2)
    zero, one = np.zeros((2, 2)), np.eye(2)

    def slopes(turned: float) -> np.ndarray:
        """A of dx/dt = A x, of the rates that stay, at this angle of the elbow."""
        a, b = m1 * length**2 / 3.0 + m2 * length**2, m2 * length**2 / 3.0
        c = 0.5 * m2 * length**2 * math.cos(turned)
        M = np.array([[a + b + 2.0 * c, b + c], [b + c, b]]) + N * N * J_m * one
        return np.block(
            [[zero, one, zero], [zero, -np.linalg.solve(M, damping), np.linalg.solve(M, drive)], [zero] * 3]
        )

    first, second = slopes(q), slopes(q + h * qd)  # Heun's two stages
    step = np.eye(6) + 0.5 * h * (first + second @ (np.eye(6) + h * first))
    law = np.block([[one, zero, zero], [zero, one, zero], [zero, -kp * N * one, ki * one]])
    closed = step[:4] @ law
    integral = np.block([[zero, -h * N * one, one]])
    expected = np.vstack([closed, integral])
    own = sorted_poles(np.linalg.eigvals(found.A))
    np.testing.assert_allclose(own, sorted_poles(np.linalg.eigvals(expected)), atol=1e-10)


MULTIRATE = """\
#include <servos/rigid_gearbox.ic>
arm swing {
    link bar { mass = 40 kg;  shape = rod(length = 2 m, along = x); }
    link tip { mass = 20 kg;  shape = rod(length = 2 m, along = x); }
    joint a revolute { parent = base;  child = bar;  axis = z; }
    joint b revolute { parent = bar;  child = tip;  axis = z;  at = [2, 0, 0] m; }
}
servo slow like rigid_gearbox { command = rate(0.03 rad/s);  rate = SLOW;  SENSOR }
servo fast like rigid_gearbox { command = rate(0.02 rad/s);  rate = FAST; }
run r {
    arm = swing;  servos { a = slow;  b = fast; }  initial { a.qd = 0.03 rad/s;  b.qd = 0.02 rad/s; }
    rates { dynamics = STEP;  servos = STEP; }  duration = 4 s;  record = [q];
    allow D105 because "rates that are a test's own";
}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        {"SLOW": "20 Hz", "FAST": "100 Hz", "STEP": "100 Hz", "SENSOR": ""},
        {"SLOW": "50 Hz", "FAST": "200 Hz", "STEP": "100 Hz", "SENSOR": ""},
        {"SLOW": "40 Hz", "FAST": "60 Hz", "STEP": "120 Hz", "SENSOR": "sensor qd = tachometer { delay = 2; }"},
    ],
)
def test_multirate_poles_are_those_of_the_monodromy_matrix_of_a_simulated_period(
    words: Mapping[str, str], tmp_path: Path
) -> None:
    """All memory of the kernel is moved cell by cell, in the lanes of its blocks, and a period is run: its differences
    have the same poles, and zeros for what is no state."""
    deck = MULTIRATE
    for word, text in words.items():
        deck = deck.replace(word, text)
    made = experiment(tmp_path, deck)
    found, program = linear(made, at=3.0), PeriodProgram(made)
    first = round(found.time * program.schedule.base_hz)
    own = sorted_poles(np.linalg.eigvals(found.A))
    matrix = monodromy(made, program, first - 1)
    other = np.linalg.eigvals(matrix)
    other = other[np.argsort(-np.abs(other))][: len(own)]
    for pole in own[np.abs(own) > 1e-2]:
        assert np.min(np.abs(other - pole)) < 1e-6
    for pole in other[np.abs(other) > 1e-2]:
        assert np.min(np.abs(own - pole)) < 1e-6


@pytest.mark.slow
def test_the_gain_limit_of_a_law_that_ticks_twice_a_period_is_where_a_pole_leaves_the_unit_circle(
    tmp_path: Path,
) -> None:
    words = {"SLOW": "50 Hz", "FAST": "200 Hz", "STEP": "100 Hz", "SENSOR": ""}
    deck = MULTIRATE.replace("rate = FAST", "rate = FAST;  kp = GAIN*0.02 V*s/rad;  ki = GAIN*0.125 V/rad")
    for word, text in words.items():
        deck = deck.replace(word, text)
    (opened,) = linear(experiment(tmp_path, deck.replace("GAIN", "1")), opened=["b.servo.voltage"]).loops
    assert opened.ticks == 4 and opened.loop is None and opened.gains[1] is not None
    for share, grows in ((0.9999, False), (1.0001, True)):
        found = linear(experiment(tmp_path, deck.replace("GAIN", repr(share * opened.gains[1]))))
        assert (max(abs(pole.z) for pole in found.poles) > 1.0 + 1e-8) == grows


def monodromy(made: Experiment, program: PeriodProgram, tick: int) -> np.ndarray:
    """Differences of the kernel's memory a period after a tick, by its memory at its end."""
    prepared = engine.prepare(made)
    kernel, cells = prepared.kernel, prepared.recording.cells
    given = engine.inputs(made, np.array([0]))
    _, _, memory = run_past(kernel, given, tick, [tick], record=False)
    start = memory[0, 0]
    moved = [slot for slot, name in enumerate(cells) if name in program.moving]
    columns = []
    for slot in moved:
        size = 1e-5 * max(abs(start[slot]), 1e-2)
        block = kernel.block(np.repeat(given, 2, axis=0))
        block.step(0, tick)
        block.state[slot, 0] += size
        block.state[slot, 1] -= size
        block.step(tick + 1, tick + program.ticks)
        columns.append((block.state[moved, 0] - block.state[moved, 1]) / (2.0 * size))
    return np.array(columns).T


RANGE = {"Kx": (1e-4, 1e6, "V*s/rad"), "Ci": (0.1, 5.0, "1/s")}
SLOW_FILTER = "sensor qd = tachometer { filter = butterworth;  cutoff = Fs; }"
ARMS: Mapping[str, Machine] = {
    "100 Hz": loop(RANGE, "Kx"),
    "250 Hz": loop(RANGE, "Kx", RATE="250 Hz"),
    "100 Hz, a tick late": loop(RANGE, "Kx", SENSOR="sensor qd = tachometer { delay = 1; }"),
    "250 Hz, two ticks late": loop(RANGE, "Kx", RATE="250 Hz", SENSOR="sensor qd = tachometer { delay = 2; }"),
    "1 kHz, filtered": loop(RANGE | {"Fs": (5.0, 20.0, "Hz")}, "Kx", RATE="1 kHz", SENSOR=SLOW_FILTER),
}


@pytest.mark.release
@pytest.mark.parametrize("name", ARMS)
def test_the_predicted_gain_limit_is_that_of_a_sweep(name: str) -> None:
    """Of four random arms each, within 1 %: the gain at which runs of the kernel begin to swing up, by bisection."""
    count, start = 4, 0.01
    made = machines(ARMS[name], count, np.random.default_rng(5))
    prepared = prepared_for(made)
    nominal = scaled(made, "Kx", np.full(count, start))
    predicted = np.zeros(count)
    for case in range(count):
        (opened,) = linear(nominal, case=case, opened=["x.servo.voltage"]).loops
        assert opened.gains[1] is not None
        predicted[case] = start * opened.gains[1]
    found = bisect(
        lambda k: swings_up(prepared, scaled(made, "Kx", k)), 0.9 * predicted, 1.1 * predicted, 5e-4
    )  # fmt: skip
    np.testing.assert_allclose(predicted, found, rtol=0.01)
