"""How right sin, cos and their like are over their whole range, and what they are at its ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from met import trace
from met.trace import Formulas, Graph
from tests.oracles.package import Package

mpmath = Package("mpmath")

QUARTER = np.longdouble(math.pi / 2) + np.longdouble(6.123233995736766e-17)
SMALLEST, LARGEST, TINY = 5e-324, 1.7976931348623157e308, 2.0**-1022


def recorded(name, *arrays):
    """The recorded function's values, by replay (which has the kernel's bits)."""
    graph = Graph()
    names = [f"x{i}" for i in range(len(arrays))]
    formulas = Formulas.of(graph, [getattr(trace, name)(*(graph.input(n) for n in names))])
    return np.asarray(formulas.replay(dict(zip(names, arrays, strict=True)))[0])


def spread(rng, low, high, count):
    """Numbers of either sign whose size is spread evenly over the powers of two."""
    size = np.exp2(rng.uniform(math.log2(low), math.log2(high), count))
    return np.clip(size, low, high) * rng.choice([-1.0, 1.0], count)


def with_neighbours(x):
    return np.concatenate([x, np.nextafter(x, np.inf), np.nextafter(x, -np.inf)])


def unit(x):
    """One unit in the last place of the double nearest to x."""
    return np.spacing(np.abs(np.asarray(x, dtype=np.float64)))


def greatest_error(name, *arrays):
    """The greatest error of the recorded function, in units in the last place of the exact value.

    All points are compared with numpy's long double, the worst 20 of them with mpmath. Long double has 11 bits more
    and functions right to 1.5 of its own units, so the two may differ by 0.001.
    """
    assert np.finfo(np.longdouble).nmant >= 63
    wide = {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2}.get(name)
    values = recorded(name, *arrays)
    with np.errstate(all="ignore"):
        near = (wide or getattr(np, name))(*(x.astype(np.longdouble) for x in arrays))
        finite = np.isfinite(near.astype(np.float64))
        error = np.where(finite, np.abs(values - near) / unit(near), 0.0).astype(np.float64)
    assert np.array_equal(np.isfinite(values), finite)
    worst, checked = np.argsort(-error)[:20], []
    for i in worst:
        with mpmath.workdps(60):
            exact = getattr(mpmath, name)(*(mpmath.mpf(float(x[i])) for x in arrays))
            checked.append(float(abs(mpmath.mpf(float(values[i])) - exact) / mpmath.mpf(float(unit(float(exact))))))
    np.testing.assert_allclose(checked, error[worst], atol=0.001, rtol=1e-3)
    return max(checked)


def one_number(name):
    """200,000 points over all that a function takes, thickest where it is hard."""
    rng = np.random.default_rng(list(name.encode()))
    if name in ("sin", "cos", "tan"):
        turns = np.concatenate([np.arange(2000.0), np.exp2(rng.uniform(11, 47.3, 18000)).round()])
        near = (turns.astype(np.longdouble) * QUARTER).astype(np.float64)
        ranges = ((SMALLEST, 1e-9, 10000), (1e-9, 0.1, 20000), (0.1, 10.0, 60000), (10.0, 2.0**48, 50000))
        extra = [with_neighbours(near), [2.0**48, -(2.0**48)]]
    elif name == "exp":
        ranges = ((SMALLEST, 1e-9, 10000), (1e-9, 1.0, 90000), (1.0, 708.0, 60000), (708.0, 745.2, 40000))
        extra = [with_neighbours(np.arange(-1075, 1024) * math.log(2.0))]
    elif name == "log":
        ranges = ((SMALLEST, TINY, 30000), (TINY, LARGEST, 70000), (0.5, 2.0, 80000), (0.999, 1.001, 20000))
        extra = [with_neighbours(np.exp2(np.arange(-1074.0, 1023.0))), [LARGEST]]
    elif name == "tanh":
        ranges = (
            (SMALLEST, 1e-9, 10000),
            (1e-9, 0.05, 40000),
            (0.05, 2.0, 110000),
            (2.0, 30.0, 30000),
            (30.0, LARGEST, 10000),
        )
        extra = [[22.0, -22.0, LARGEST]]
    elif name == "sqrt":
        ranges = ((SMALLEST, TINY, 50000), (TINY, LARGEST, 150000))
        extra = [[LARGEST]]
    elif name == "atan":
        ranges = ((SMALLEST, 1e-3, 20000), (1e-3, 0.3, 40000), (0.3, 3.0, 120000), (3.0, LARGEST, 20000))
        extra = [with_neighbours(np.array([1.0, math.sqrt(2.0) - 1.0, math.sqrt(2.0) + 1.0])), [LARGEST]]
    else:
        ranges = ((SMALLEST, 1e-9, 10000), (1e-9, 0.2, 40000), (0.2, 1.0, 140000), (0.9999, 1.0, 20000))
        extra = [1.0 - np.exp2(np.arange(-53.0, 0.0)), [1.0, -1.0]]
    x = np.concatenate([*(spread(rng, *one) for one in ranges), *extra])
    return np.abs(x) if name in ("log", "sqrt") else x


# in each limit, 0.5 is the last rounding. exp, log: a polynomial's last sum. sin, cos: what is left of the angle may be
# a unit off. tan: a quotient of two that are 0.8 off. atan2: a quotient, then two sums. tanh: 1 off in e^x - 1 twice.
# asin, acos: a leg that is 0.8 off goes into atan2.
@pytest.mark.release
@pytest.mark.oracle
@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("sin", 1.6),
        ("cos", 1.6),
        ("tan", 2.4),
        ("exp", 1.0),
        ("log", 1.0),
        ("tanh", 2.7),
        ("sqrt", 0.501),
        ("atan", 2.0),
        ("asin", 2.6),
        ("acos", 2.6),
    ],
)
def test_functions_are_right_to_a_few_units_over_all_they_take(name, limit):
    x = one_number(name)
    assert len(x) >= 200_000
    error = greatest_error(name, x)
    assert limit / 2 < error < limit  # below half, the page claims too little or the points miss what is hard


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sines_of_angles_too_far_out_lose_places_as_the_page_says(name):
    # the number of quarter turns is rounded to a few percent of one there, so the polynomials leave their range
    x = spread(np.random.default_rng(7), 2.0**48, 2.0**51, 50000)
    assert 10.0 < greatest_error(name, x) < 100.0


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("size_y", "size_x"),
    [
        ((1e-6, 1e6), (1e-6, 1e6)),
        ((1e-300, 1e300), (1e-300, 1e300)),
        ((SMALLEST, TINY), (SMALLEST, TINY)),
        ((1e300, LARGEST), (1e300, LARGEST)),
        ((SMALLEST, 1e-310), (1.0, 1e10)),
        ((1e-160, 1e-140), (1e140, 1e160)),
        ((0.4, 0.42), (1.0, 1.0)),
        ((2.4, 2.42), (1.0, 1.0)),
        ((0.99, 1.01), (1.0, 1.0)),
        ((2.0**499, 2.0**501),) * 2,
    ],
)
def test_atan2_is_right_in_every_quadrant_and_at_every_size(size_y, size_x):
    rng = np.random.default_rng(4)
    assert greatest_error("atan2", spread(rng, *size_y, 25000), spread(rng, *size_x, 25000)) < 2.0


NAN, INF = math.nan, math.inf
EDGES = {
    "sin": [(0.0, 0.0), (SMALLEST, SMALLEST), (2.0**48, 0.12949601773888192), (INF, NAN), (-INF, NAN)],
    "cos": [(0.0, 1.0), (SMALLEST, 1.0), (-(2.0**48), 0.9915799420065793), (INF, NAN), (-INF, NAN)],
    "tan": [
        (0.0, 0.0),
        (-SMALLEST, -SMALLEST),
        (2.0**48, 0.13059564060647638),
        (np.nextafter(2.0**48, INF), NAN),
        (LARGEST, NAN),
        (INF, NAN),
        (-INF, NAN),
    ],
    # ln(2^1024) and ln(2^-1075) lie between the two numbers of each pair
    "exp": [
        (0.0, 1.0),
        (-SMALLEST, 1.0),
        (709.782712893384, 1.797693134862273e308),
        (709.7827128933841, INF),
        (-745.1332191019411, SMALLEST),
        (-745.1332191019412, 0.0),
        (LARGEST, INF),
        (-LARGEST, 0.0),
        (INF, INF),
        (-INF, 0.0),
    ],
    "log": [
        (0.0, -INF),
        (-0.0, -INF),
        (SMALLEST, -744.4400719213812),
        (1.0, 0.0),
        (LARGEST, 709.782712893384),
        (INF, INF),
        (-SMALLEST, NAN),
        (-1.0, NAN),
        (-INF, NAN),
    ],
    "tanh": [(0.0, 0.0), (SMALLEST, SMALLEST), (22.0, 1.0), (-LARGEST, -1.0), (INF, 1.0), (-INF, -1.0)],
    "sqrt": [(0.0, 0.0), (SMALLEST, 2.0**-537), (INF, INF), (-SMALLEST, NAN), (-INF, NAN)],
    "atan": [
        (0.0, 0.0),
        (-0.0, -0.0),
        (-SMALLEST, -SMALLEST),
        (1.0, math.pi / 4),
        (LARGEST, math.pi / 2),
        (INF, math.pi / 2),
        (-INF, -math.pi / 2),
    ],
    "asin": [
        (0.0, 0.0),
        (-0.0, -0.0),
        (SMALLEST, SMALLEST),
        (1.0, math.pi / 2),
        (-1.0, -math.pi / 2),
        (np.nextafter(1.0, 2.0), NAN),
        (-LARGEST, NAN),
        (INF, NAN),
    ],
    "acos": [
        (0.0, math.pi / 2),
        (SMALLEST, math.pi / 2),
        (1.0, 0.0),
        (-1.0, math.pi),
        (np.nextafter(1.0, 2.0), NAN),
        (-LARGEST, NAN),
        (-INF, NAN),
    ],
}


@pytest.mark.parametrize("name", EDGES)
def test_ends_of_the_range_are_the_same_recorded_over_arrays_and_plain(name):
    x, expected = np.array([*EDGES[name], (NAN, NAN)]).T
    function = getattr(trace, name)
    for values in (recorded(name, x), function(x), np.array([function(v) for v in x.tolist()])):
        np.testing.assert_allclose(values, expected, rtol=3e-16, atol=0.0)  # a unit and a half, and none for zeros
    if name in ("atan", "asin"):
        zero = expected == 0.0
        assert np.array_equal(np.signbit(recorded(name, x)[zero]), np.signbit(expected[zero]))


def test_atan2_at_its_edges_is_that_of_ieee():
    numbers = (0.0, -0.0, SMALLEST, -SMALLEST, 1.0, -1.0, LARGEST, -LARGEST, INF, -INF)
    y, x = np.array([(a, b) for a in numbers for b in numbers]).T
    values = recorded("atan2", y, x)
    np.testing.assert_allclose(values, np.arctan2(y, x), rtol=3e-16, atol=0.0)
    assert np.array_equal(np.signbit(values), np.signbit(y))
    assert np.isnan(recorded("atan2", np.array([NAN, 1.0, NAN]), np.array([1.0, NAN, INF]))).all()
