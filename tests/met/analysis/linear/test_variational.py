"""How smooth arms move with where they begin, against heyoka's variational equations (tests/oracles/arms_heyoka.py)."""

from __future__ import annotations

import gzip
import json

import numpy as np
import pytest

from ic.driver.given_values import given_run
from met.analysis.linear.gradient import GradientProgram
from tests.oracles.arms_heyoka import ANSWERS, COUNTS, GRAVITY, SECONDS, begins, couplings, pulls, rods

RATE = 4000


def deck(count: int) -> str:
    """The arm as a deck: its state at the end of a run is its metrics."""
    lines, parent = ["arm chain {"], "base"
    for i, (mass, _, centre, inertia) in enumerate(rods(count)):
        at = f"at = [{rods(count)[i - 1][1]!r}, 0, 0] m;" if i else ""
        about = f"inertia = [0, {inertia!r}, {inertia!r}] kg*m^2;"
        lines += [
            f"link l{i} {{ mass = {mass!r} kg; com = [{centre!r}, 0, 0] m; {about} }}",
            f"joint j{i} revolute {{ parent = {parent}; child = l{i}; axis = z; {at} }}",
        ]  # fmt: skip
        parent = f"l{i}"
    first = [
        f"j{i}.q = {q!r} rad; j{i}.qd = {qd!r} rad/s;" for i, (q, qd) in enumerate(zip(*begins(count), strict=True))
    ]
    ends = [
        f"metric {part}{i} = final {{ of = j{i}.{part}; }}" for part in ("q", "qd") for i in range(count)
    ]  # fmt: skip
    return "\n".join([
        *lines, "}", "run swing {", "arm = chain; integrator = rk4; record = [];",
        f"environment {{ g = gravity {{ g = [0, {-GRAVITY!r}, 0] m/s^2; }} }}",
        f"rates {{ dynamics = {RATE} Hz; record = 100 Hz; }}", f"duration = {SECONDS!r} s;",
        "initial {", *first, "}", *ends, "}",
    ])  # fmt: skip


def gradients(count: int) -> tuple[np.ndarray, np.ndarray]:
    """The state at the end of a run, and how it moves with where it begins: [state], [state, state]."""
    q, qd = begins(count)
    numbers = {f"initial.j{i}.q": (value, "rad") for i, value in enumerate(q)}
    numbers |= {f"initial.j{i}.qd": (value, "rad/s") for i, value in enumerate(qd)}
    found = GradientProgram(given_run("", text=deck(count)).vary(numbers).experiment).of([0])
    assert not found.why_not
    return found.value[0], found.slope[0]


@pytest.mark.release
@pytest.mark.parametrize("count", [each if each < 8 else pytest.param(each, marks=pytest.mark.slow) for each in COUNTS])
def test_a_run_moves_with_where_it_begins_as_variational_equations_have_it(count: int) -> None:
    """Of joints that turn freely, by Runge-Kutta's steps: to 1e-10 of the largest entry."""
    with gzip.open(ANSWERS, "rt", encoding="utf-8") as file:
        expected = json.load(file)[str(count)]
    value, slope = gradients(count)
    np.testing.assert_allclose(value, expected["state"], rtol=0, atol=1e-10)
    moves = np.array(expected["moves"])
    assert np.abs(slope - moves).max() <= 1e-10 * np.abs(moves).max()


def by_complex_step(count: int) -> np.ndarray:
    """The same of Lagrange's equations in numpy, by steps in the imaginary direction, all at once: [state, state]."""
    A, pull, step = np.array(couplings(count)), np.array(pulls(count)), 1e-30

    def slope(y: np.ndarray) -> np.ndarray:
        angle, rate = np.cumsum(y[:, :count], axis=1), np.cumsum(y[:, count:], axis=1)
        apart = angle[:, :, None] - angle[:, None, :]
        right = -pull * np.cos(angle) - (A * np.sin(apart) @ (rate**2)[:, :, None])[:, :, 0]
        turns = np.linalg.solve(A * np.cos(apart), right[:, :, None])[:, :, 0]
        return np.concatenate([y[:, count:], np.diff(turns, axis=1, prepend=0.0)], axis=1)

    y = np.concatenate(begins(count)) + 1j * step * np.eye(2 * count)
    h = 1.0 / RATE
    for _ in range(round(SECONDS * RATE)):
        a = slope(y)
        b = slope(y + 0.5 * h * a)
        c = slope(y + 0.5 * h * b)
        y = y + h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(y + h * c))
    return y.imag.T / step


@pytest.mark.release
@pytest.mark.parametrize("count", [4, pytest.param(30, marks=pytest.mark.slow)])
def test_a_run_moves_with_where_it_begins_as_lagranges_equations_do(count: int) -> None:
    """By the same Runge-Kutta's steps, of up to thirty joints: to 1e-10 of the largest entry."""
    moves = by_complex_step(count)
    assert np.abs(gradients(count)[1] - moves).max() <= 1e-10 * np.abs(moves).max()
