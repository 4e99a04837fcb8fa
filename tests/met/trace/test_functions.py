"""What models call: rounding, limits, choices, tables and conditions, recorded and plain, and with not-a-number."""

from __future__ import annotations

import math

import numpy as np
import pytest

from met import trace
from met.trace import Formulas, Graph


def recorded(function, *arrays):
    """The recorded function's values, by replay (which has the kernel's bits)."""
    graph = Graph()
    names = [f"x{i}" for i in range(len(arrays))]
    formulas = Formulas.of(graph, [function(*(graph.input(name) for name in names))])
    return np.asarray(formulas.replay(dict(zip(names, arrays, strict=True)))[0])


def spread(rng, low, high, count=700):
    """Numbers of either sign whose size is spread evenly over the powers of ten."""
    return 10.0 ** rng.uniform(math.log10(low), math.log10(high), count) * rng.choice([-1.0, 1.0], count)


EDGES = [0.0, -0.0, 1.0, -1.0, 0.5, 2.5, -2.5, math.inf, -math.inf, math.nan, 5e-324, -5e-324, 1e308, 2.0**52 + 1.0]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (
            "floor",
            [0.0, 0.0, 1.0, -1.0, 0.0, 2.0, -3.0, math.inf, -math.inf, math.nan, 0.0, -1.0, 1e308, 2.0**52 + 1.0],
        ),
        ("rint", [0.0, 0.0, 1.0, -1.0, 0.0, 2.0, -2.0, math.inf, -math.inf, math.nan, 0.0, 0.0, 1e308, 2.0**52 + 1.0]),
    ],
)
def test_rounding_is_that_of_ieee_recorded_or_not(name, expected):
    function = getattr(trace, name)
    assert np.array_equal(recorded(function, np.array(EDGES)), expected, equal_nan=True)
    assert np.array_equal([function(x) for x in EDGES], expected, equal_nan=True)


NAN, ONES = np.array([math.nan, 1.0, math.nan]), np.array([1.0, math.nan, math.nan])


@pytest.mark.parametrize("function", [trace.minimum, trace.maximum])
def test_not_a_number_survives_minimum_and_maximum(function):
    assert np.isnan(recorded(function, NAN, ONES)).all()
    assert all(math.isnan(function(a, b)) for a, b in zip(NAN.tolist(), ONES.tolist(), strict=True))
    assert np.isnan(recorded(lambda x: function(x, 2.0), NAN)[[0, 2]]).all()
    assert np.isnan(recorded(lambda x: function(2.0, x), NAN)[[0, 2]]).all()


def test_not_a_number_survives_clip_and_sign_and_gather():
    for function in (
        lambda x: trace.clip(x, -2.0, 2.0),
        trace.sign,
        lambda x: trace.gather((1.0, 2.0), x),
        abs,
        lambda x: trace.fma(x, 0.5, 1.0),
    ):
        assert np.array_equal(np.isnan(recorded(function, NAN)), [True, False, True])
        assert math.isnan(function(math.nan))


def test_clip_and_extremes_give_the_lesser_and_the_greater():
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=50), rng.normal(size=50)
    assert np.array_equal(recorded(trace.minimum, a, b), np.minimum(a, b))
    assert np.array_equal(recorded(trace.maximum, a, b), np.maximum(a, b))
    assert np.array_equal(recorded(lambda x: trace.clip(x, -0.5, 0.5), a), np.clip(a, -0.5, 0.5))
    assert np.array_equal(recorded(trace.sign, np.array([3.0, -3.0, 0.0])), [1.0, -1.0, 0.0])


def test_gather_holds_its_index_within_the_table():
    table = (10.0, 11.0, 12.0)
    index = np.array([-5.0, -0.5, 0.0, 0.99, 1.0, 2.0, 2.5, 1e30, math.inf, -math.inf])
    expected = [10.0, 10.0, 10.0, 10.0, 11.0, 12.0, 12.0, 12.0, 12.0, 10.0]
    assert np.array_equal(recorded(lambda x: trace.gather(table, x), index), expected)
    assert [trace.gather(table, x) for x in index.tolist()] == expected


def test_fused_multiply_add_is_rounded_once():
    from fractions import Fraction

    rng = np.random.default_rng(6)
    a, b = spread(rng, 1e-12, 1e12), spread(rng, 1e-12, 1e12)
    c = np.where(
        rng.random(a.size) < 0.5, -a * b * (1.0 + rng.choice([0.0, 1e-16, 1e-10], a.size)), spread(rng, 1e-20, 1e20)
    )
    exact = [float(Fraction(x) * Fraction(y) + Fraction(z)) for x, y, z in zip(a, b, c, strict=True)]
    assert recorded(trace.fma, a, b, c).tolist() == exact
    assert [trace.fma(*three) for three in zip(a.tolist(), b.tolist(), c.tolist(), strict=True)] == exact
    edges = [
        (1e-200, 1e-200, 1e-320),
        (1e-308, 1e-10, -3e-318),
        (1e200, 1e200, -math.inf),
        (1e200, 1e200, -1e308),
        (math.inf, 1.0, 2.0),
        (5e-324, 0.5, 5e-324),
        (0.0, -1.0, 0.0),
    ]
    expected = [1e-320, 1e-318 - 3e-318, -math.inf, math.inf, math.inf, 1e-323, 0.0]
    assert recorded(trace.fma, *np.array(edges).T).tolist() == expected
    assert [trace.fma(*three) for three in edges] == expected


def test_plain_results_divide_as_ieee_does():
    with np.errstate(all="ignore"):
        zeros = [
            trace.floor(0.5),
            trace.where(True, 0.0, 1.0),
            trace.sin(0.0),
            trace.clip(0.0, -1.0, 1.0),
            trace.gather((0.0,), 3.0),
            trace.atan2(0.0, 1.0),
            trace.fma(0.0, 1.0, 0.0),
            trace.maximum(0.0, -1.0),
        ]
        assert all(math.isinf(1.0 / zero) for zero in zeros)


def test_conditions_combine_alike_recorded_and_plain():
    for a in (True, False):
        for b in (True, False):
            graph = Graph()
            x = graph.input("x")
            p, q = (x > 0.0 if a else x < 0.0), (x > 1.0 if b else x < 1.0)
            outputs = [
                trace.where(t, 1.0, 0.0)
                for t in (
                    trace.both(p, q),
                    trace.either(p, q),
                    trace.not_(p),
                    p ^ q,
                    p == q,
                    trace.all_of([p, q, True]),
                    trace.any_of([p, q, False]),
                    trace.where(p, q, trace.not_(q)),
                )
            ]
            expected = [a and b, a or b, not a, a != b, a == b, a and b, a or b, b if a else not b]
            assert Formulas.of(graph, outputs).replay({"x": 2.0}) == [float(e) for e in expected]
            assert [trace.both(a, b), trace.either(a, b), trace.not_(a)] == expected[:3]
