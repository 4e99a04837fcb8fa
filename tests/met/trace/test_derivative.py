"""Derivatives of recorded numbers: against the functions' own, by mpmath's digits, and by differences."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from met.trace import (
    Formulas,
    Graph,
    Real,
    absolute,
    acos,
    asin,
    atan,
    atan2,
    clip,
    cos,
    exp,
    floor,
    fma,
    gather,
    log,
    rint,
    sign,
    sin,
    sqrt,
    tan,
    tanh,
    where,
)
from met.trace.derivative import derivative
from tests.oracles.package import Package

mpmath = Package("mpmath")

ANGLES = np.concatenate([np.linspace(-9.0, 9.0, 700), [1e3, -1e5]])
POSITIVE = np.geomspace(1e-6, 1e6, 500)
INNER = np.linspace(-0.97, 0.97, 300)


def slopes(function: Callable[[Real], Real], x: np.ndarray) -> np.ndarray:
    """The derivative of a function, recorded once and replayed over an array."""
    graph = Graph()
    found = derivative(function(graph.input("x")), "x")  # type: ignore[arg-type]
    return np.broadcast_to(Formulas.of(graph, [found]).replay({"x": x})[0], x.shape)


# Of a polynomial of n terms on a stretch of length 1 the derivative may be n^2 times as wrong: some tens of units.
@pytest.mark.oracle
@pytest.mark.parametrize(
    ("function", "exact", "where_", "size"),
    [
        (sin, lambda x: mpmath.cos(x), ANGLES, lambda x: 1.0),
        (cos, lambda x: -mpmath.sin(x), ANGLES, lambda x: 1.0),
        (exp, lambda x: mpmath.exp(x), np.linspace(-20.0, 20.0, 400), np.exp),
        (log, lambda x: 1 / x, POSITIVE, lambda x: 1.0 / x),
        (tanh, lambda x: mpmath.sech(x) ** 2, np.linspace(-4.0, 4.0, 400), lambda x: 1.0),
        (atan, lambda x: 1 / (1 + x * x), np.linspace(-9.0, 9.0, 401), lambda x: 1.0),
        (asin, lambda x: 1 / mpmath.sqrt(1 - x * x), INNER, lambda x: 1.0 / (1.0 - x * x)),
        (acos, lambda x: -1 / mpmath.sqrt(1 - x * x), INNER, lambda x: 1.0 / (1.0 - x * x)),
        (tan, lambda x: mpmath.sec(x) ** 2, INNER, lambda x: 1.0 / np.cos(x) ** 2),
        (sqrt, lambda x: 1 / (2 * mpmath.sqrt(x)), POSITIVE, lambda x: 0.5 / np.sqrt(x)),
    ],
)
def test_functions_have_their_own_derivatives(
    function: Callable[[Real], Real], exact: Callable, where_: np.ndarray, size: Callable
) -> None:
    with mpmath.workdps(40):
        expected = np.array([float(exact(mpmath.mpf(float(x)))) for x in where_])
    wrong = np.max(np.abs(slopes(function, where_) - expected) / size(where_))
    print(f"{function.__name__}: {wrong:.2g}")
    assert wrong < 2e-15


def test_arithmetic_has_the_derivatives_of_the_calculus() -> None:
    x = np.linspace(-2.0, 2.0, 41) + 0.01
    cases: list[tuple[Callable[[Real], Real], Callable[[np.ndarray], np.ndarray]]] = [
        (lambda x: 3.0 - x, lambda x: -1.0 + 0.0 * x),
        (lambda x: x * x * x - 2.0 * x, lambda x: 3.0 * x * x - 2.0),
        (lambda x: (1.0 + x) / (3.0 + x * x), lambda x: (3.0 - 2.0 * x - x * x) / (3.0 + x * x) ** 2),
        (lambda x: fma(x, x, -x), lambda x: 2.0 * x - 1.0),
        (absolute, np.sign),
        (lambda x: atan2(x, 2.0 - x), lambda x: 2.0 / ((2.0 - x) ** 2 + x * x)),
        (lambda x: where(x < 0.3, x * x, -x), lambda x: np.where(x < 0.3, 2.0 * x, -1.0)),
        (lambda x: clip(x, -1.0, 1.0), lambda x: np.where(np.abs(x) <= 1.0, 1.0, 0.0)),
        (lambda x: -sin(-x), np.cos),
    ]  # fmt: skip
    for function, exact in cases:
        np.testing.assert_allclose(slopes(function, x), exact(x), rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("function", [floor, rint, lambda x: gather((1.0, 4.0, 9.0), x), lambda x: 2.0 + 0.0 * x])
def test_what_changes_in_jumps_alone_has_none(function: Callable[[Real], Real]) -> None:
    assert (slopes(function, np.linspace(-3.0, 3.0, 50)) == 0.0).all()


def test_other_inputs_are_held() -> None:
    graph = Graph()
    x, y = graph.input("x"), graph.input("y")
    found = Formulas.of(graph, [derivative(x * y + sin(y), name) for name in "xy"])
    assert found.replay({"x": 3.0, "y": 0.5}) == pytest.approx([0.5, 3.0 + math.cos(0.5)], rel=1e-15)


def test_the_derivative_of_a_derivative_is_the_second() -> None:
    graph = Graph()
    second = derivative(derivative(sin(2.0 * graph.input("x")), "x"), "x")
    x = np.linspace(-5.0, 5.0, 300)
    # another n^2
    found = Formulas.of(graph, [second]).replay({"x": x})[0]
    np.testing.assert_allclose(found, -4.0 * np.sin(2.0 * x), rtol=0, atol=1e-12)


def test_a_sign_moves_with_nothing() -> None:
    graph = Graph()
    x = graph.input("x")
    for inner in (x, -x, x * x - x, -(x * x - x)):
        found = derivative(3.0 * sign(inner) + x, "x")
        assert [Formulas.of(graph, [found]).replay({"x": at}) for at in (-2.0, 0.0, 0.5, 1.0)] == [[1.0]] * 4
