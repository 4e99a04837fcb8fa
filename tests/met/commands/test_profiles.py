"""Command profiles: values and slopes against closed forms and scipy, recorded as with plain floats."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.signal import chirp as scipy_chirp

from met import models
from met.commands.points import clamped_slopes, segment
from met.trace import Formulas, Graph

SEED = 20261121


def profile(name: str) -> Any:
    return models.find_own("command")[name]


def values(name: str, at: np.ndarray, /, **given: Any) -> tuple[np.ndarray, np.ndarray]:
    """Value and slope at each time, with plain numbers; what is not given takes its default."""
    p = filled(name, **given)
    pairs = [profile(name).course(p, float(t)) for t in at]
    return np.array([v for v, _ in pairs], float), np.array([s for _, s in pairs], float)


def filled(name: str, /, **given: Any) -> SimpleNamespace:
    defaults = {p.name: p.default for p in profile(name).parameters if p.default is not None}
    return SimpleNamespace(**(defaults | given))


def recorded(name: str, at: np.ndarray, varied: dict[str, Any], /, **given: Any) -> tuple[np.ndarray, np.ndarray]:
    """The same by replay of what was recorded, with t and the varied parameters as inputs: arrays, a lane each."""
    graph = Graph()
    p = filled(name, **given, **{key: graph.input(key) for key in varied})
    formulas = Formulas.of(graph, list(profile(name).course(p, graph.input("t"))))
    value, slope = formulas.replay({"t": at, **varied})
    return np.broadcast_to(value, at.shape), np.broadcast_to(slope, at.shape)


# trapezoid


MOVES = [
    pytest.param(0.0, 2.0, 0.5, 1.0, id="long"),
    pytest.param(0.3, 0.4, 0.5, 1.0, id="short, a triangle"),
    pytest.param(1.0, -2.0, 0.7, 0.4, id="backwards"),
    pytest.param(0.1, -0.1, 5.0, 0.4, id="backwards, a triangle"),
    pytest.param(0.0, 0.25, 0.5, 1.0, id="just a triangle"),
]


@pytest.mark.parametrize(("start", "to", "max_rate", "max_acceleration"), MOVES)
def test_the_trapezoid_integrates_an_acceleration_that_is_either_the_limit_or_nothing(
    start: float, to: float, max_rate: float, max_acceleration: float
) -> None:
    begin, way = 0.5, abs(to - start)
    peak = min(max_rate, math.sqrt(max_acceleration * way))
    rise = peak / max_acceleration
    whole = rise + way / peak  # a trapezoid's area is its height times the mean of its two parallel sides
    corners = begin + np.array([0.0, rise, whole - rise, whole])
    t = np.concatenate([np.linspace(0.0, begin + whole + 1.0, 257), corners])
    value, slope = values(
        "trapezoid", t, start=start, to=to, max_rate=max_rate, max_acceleration=max_acceleration, begin=begin
    )
    sign = math.copysign(1.0, to - start)
    rate = sign * np.interp(t, corners, [0.0, peak, peak, 0.0])
    # the slope is a product and a sum away; corners are rounded, and the rate is steep there
    np.testing.assert_allclose(slope, rate, rtol=1e-13, atol=1e-15 * max_acceleration * (1.0 + whole) * 8)
    knots = np.cumsum([0.0, *(0.5 * np.diff(corners) * np.array([peak, 2.0 * peak, peak]))])
    u = np.clip(t, corners[0], corners[-1])
    k = np.clip(np.searchsorted(corners, u, side="right") - 1, 0, 2)
    s, into = u - corners[k], np.array([0.0, peak, peak])[k]
    bend = np.array([max_acceleration, 0.0, -max_acceleration])[k]
    np.testing.assert_allclose(
        value, start + sign * (knots[k] + s * (into + 0.5 * bend * s)), rtol=1e-14, atol=4e-15 * (1.0 + way)
    )
    assert np.abs(slope).max() <= max_rate


@pytest.mark.slow
@pytest.mark.parametrize(("start", "to", "max_rate", "max_acceleration"), MOVES)
def test_the_trapezoid_begins_and_ends_exactly_and_at_rest(
    start: float, to: float, max_rate: float, max_acceleration: float
) -> None:
    given = {"start": start, "to": to, "max_rate": max_rate, "max_acceleration": max_acceleration, "begin": 0.1}
    value, slope = values("trapezoid", np.array([0.0, 0.1, 100.0]), **given)
    assert value.tolist() == [start, start, to] and slope.tolist() == [0.0, 0.0, 0.0]
    t = np.linspace(0.1, 12.0, 4001)
    value, _ = values("trapezoid", t, **given)
    assert value.min() >= min(start, to) and value.max() <= max(start, to)  # to the last bit


@pytest.mark.parametrize("at", [0.0, 0.3, -1e-300])
def test_a_trapezoid_from_a_value_to_itself_stays_there(at: float) -> None:
    t = np.array([0.0, 0.2, 0.5, 3.0])
    value, slope = values("trapezoid", t, start=at, to=at, max_rate=1.0, max_acceleration=1.0, begin=0.2)
    assert value.tolist() == [at] * 4 and slope.tolist() == [0.0] * 4


# pulse


PULSES = [
    pytest.param(0.0, 2.0, 1.0, 7.0, id="up, on and down"),
    pytest.param(0.1, -0.7, 0.4, 5.0, id="down, on and up"),
    pytest.param(0.3, 0.4, 0.1, 2.0, id="a triangle"),
    pytest.param(0.0, 1e-3, 1e6, 0.5, id="steep"),
]


@pytest.mark.parametrize(("start", "to", "slope", "over"), PULSES)
def test_the_pulse_goes_along_straight_lines_through_its_four_corners(
    start: float, to: float, slope: float, over: float
) -> None:
    begin, rise = 0.5, abs(to - start) / slope
    corners = begin + np.array([0.0, rise, over - rise, over])
    t = np.concatenate([np.linspace(0.0, begin + over + 1.0, 257), corners])
    value, rate = values("pulse", t, start=start, to=to, slope=slope, over=over, begin=begin)
    tolerance = 1e-15 * slope * (1.0 + over) * 4  # a corner is rounded, and the value is steep there
    np.testing.assert_allclose(value, np.interp(t, corners, [start, to, to, start]), rtol=1e-14, atol=tolerance)
    inner = np.abs(t[:, None] - corners).min(axis=1) > 1e-9
    sign = math.copysign(1.0, to - start)
    part = np.searchsorted(corners, t, side="right")
    np.testing.assert_array_equal(rate[inner], (sign * slope * np.array([0.0, 1.0, 0.0, -1.0, 0.0])[part])[inner])
    assert value.min() >= min(start, to) and value.max() <= max(start, to)  # to the last bit


@pytest.mark.parametrize(("start", "to", "slope", "over"), PULSES)
def test_the_pulse_begins_and_ends_exactly_and_a_kink_has_the_slope_of_what_follows(
    start: float, to: float, slope: float, over: float
) -> None:
    given = {"start": start, "to": to, "slope": slope, "over": over}
    value, rate = values("pulse", np.array([0.0, 0.5 * over, over, 100.0]), **given)
    up = math.copysign(slope, to - start)
    triangle = profile("pulse").shortest(filled("pulse", **given)) >= over
    assert value.tolist() == [start, to, start, start]
    assert rate.tolist() == [up, -up if triangle else 0.0, 0.0, 0.0]


@pytest.mark.parametrize(("to", "slope", "over"), [(0.2, 0.1, 9.0), (-0.2, 0.1, 9.0), (0.2, 0.1, 4.0)])
def test_the_integral_of_a_pulse_is_what_its_docstring_says(to: float, slope: float, over: float) -> None:
    way, _ = quad(lambda t: values("pulse", np.array([t]), to=to, slope=slope, over=over)[0][0], 0.0, over,
                  points=[abs(to) / slope, over - abs(to) / slope])  # fmt: skip
    assert way == pytest.approx(to * (over - abs(to) / slope), rel=1e-12)


@pytest.mark.parametrize("at", [0.0, 0.3, -1e-300])
def test_a_pulse_from_a_value_to_itself_stays_there(at: float) -> None:
    value, slope = values("pulse", np.array([0.0, 0.2, 0.5, 3.0]), start=at, to=at, slope=1.0, over=0.3, begin=0.2)
    assert value.tolist() == [at] * 4 and slope.tolist() == [0.0] * 4


# chirp


@pytest.mark.parametrize(("f0", "f1"), [(0.5, 4.0), (4.0, 0.5), (2.0, 2.0), (1.0, 1.0 + 1e-9), (0.01, 20.0)])
@pytest.mark.parametrize(("growth", "method"), [("linear", "linear"), ("exponential", "logarithmic")])
def test_the_chirp_is_that_of_scipy(growth: str, method: str, f0: float, f1: float) -> None:
    over, begin, phase = 3.0, 0.25, 0.4
    t = np.linspace(begin, begin + over, 301)
    value, _ = values(
        "chirp", t, amplitude=2.0, f0=f0, f1=f1, over=over, growth=growth, offset=0.5, phase=phase, begin=begin
    )
    # scipy has a cosine and degrees; its exponential form loses digits where f0 is near f1, so there 2e-6
    known = 0.5 + 2.0 * scipy_chirp(t - begin, f0, over, f1, method, phi=math.degrees(phase) - 90.0)
    near = growth == "exponential" and abs(f1 / f0 - 1.0) < 1e-3 and f1 != f0
    np.testing.assert_allclose(value, known, atol=2e-6 if near else 2e-12)


@pytest.mark.parametrize("ratio", [1e-3, 0.2, 1.0 - 1e-9, 1.0, 1.0 + 1e-12, 1.001, 2.7, 2.8, 1e4])
def test_the_phase_of_an_exponential_chirp_is_the_integral_of_its_frequency(ratio: float) -> None:
    f0, over = 0.7, 2.0
    for t in (0.1, 0.9, 1.999):
        # with a small amplitude about zero, the sine is its angle up to the last digits: read it off in quadrature
        x, _ = values("chirp", np.array([t]), amplitude=1.0, f0=f0, f1=f0 * ratio, over=over, growth="exponential")
        y, _ = values(
            "chirp",
            np.array([t]),
            amplitude=1.0,
            f0=f0,
            f1=f0 * ratio,
            over=over,
            growth="exponential",
            phase=math.pi / 2,
        )
        turns, _ = quad(lambda s: f0 * ratio ** (s / over), 0.0, t, epsabs=1e-13, epsrel=1e-13)
        angle = 2.0 * math.pi * turns
        # rounding of an angle of up to 4e3 rad, and the quadrature's own error
        tolerance = 4e-16 * angle + 2e-12 * (1.0 + angle)
        assert abs(math.remainder(math.atan2(x[0], y[0]) - angle, 2.0 * math.pi)) < tolerance


@pytest.mark.parametrize("growth", ["linear", "exponential"])
def test_the_chirps_slope_is_its_derivative_and_zero_where_it_is_held(growth: str) -> None:
    given = {"amplitude": 0.3, "f0": 0.5, "f1": 3.0, "over": 2.0, "growth": growth, "begin": 0.5, "offset": 0.1}
    t, d = np.linspace(0.51, 2.49, 50), 1e-5
    ahead, behind = (values("chirp", t + step, **given)[0] for step in (d, -d))
    # d^2/6 of the third derivative, 0.3 (2 pi 3)^3 and more: 4e-8
    np.testing.assert_allclose(values("chirp", t, **given)[1], (ahead - behind) / (2.0 * d), atol=1e-7)
    held, slope = values("chirp", np.array([0.0, 0.5, 2.5, 9.0]), **given)
    assert held[0] == held[1] == 0.1 and held[2] == held[3]
    assert slope[[0, 2, 3]].tolist() == [0.0, 0.0, 0.0]


# tables and trajectories


def points(rng: np.random.Generator, n: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """n points at uneven times."""
    return tuple((np.cumsum(rng.uniform(0.01, 1.0, n)) - 0.3).tolist()), tuple(rng.normal(size=n).tolist())


@pytest.mark.slow
@pytest.mark.parametrize("n", [2, 3, 4, 5, 8, 9, 31, 32, 33, 1000])
def test_the_segment_is_the_one_that_numpys_search_finds(n: int) -> None:
    times, _ = points(np.random.default_rng(n), n)
    t = np.concatenate([times, np.random.default_rng(n + 1).uniform(times[0] - 1.0, times[-1] + 1.0, 200)])
    wanted = np.clip(np.searchsorted(times, t, side="right") - 1, 0, n - 2)
    assert [int(segment(times, float(x))) for x in t] == wanted.tolist()


@pytest.mark.parametrize("n", [2, 3, 4, 7, 40])
@pytest.mark.parametrize("name", ["table", "trajectory"])
def test_straight_lines_are_those_of_numpy(name: str, n: int) -> None:
    times, heights = points(np.random.default_rng(n), n)
    t = np.concatenate([times, np.linspace(times[0] - 0.5, times[-1] + 0.5, 200)])
    value, slope = values(name, t, times=times, values=heights)
    np.testing.assert_allclose(value, np.interp(t, times, heights), rtol=1e-13, atol=1e-14)  # other roundings
    k = np.clip(np.searchsorted(times, t, side="right") - 1, 0, n - 2)
    inside = (t >= times[0]) & (t < times[-1])
    np.testing.assert_allclose(slope, np.where(inside, (np.diff(heights) / np.diff(times))[k], 0.0), rtol=1e-15)


@pytest.mark.parametrize("n", [2, 3, 4, 7, 40])
def test_the_cubic_trajectory_is_scipys_clamped_spline_held_at_both_ends(n: int) -> None:
    times, heights = points(np.random.default_rng(100 + n), n)
    spline = CubicSpline(times, heights, bc_type="clamped")
    t = np.concatenate([times, np.linspace(times[0] - 0.5, times[-1] + 0.5, 200)])
    u = np.clip(t, times[0], times[-1])
    value, slope = values("trajectory", t, times=times, values=heights, interpolation="cubic")
    size = float(np.abs(spline(u)).max()), float(np.abs(spline(u, 1)).max())
    # two solutions of one system, whose diagonal dominates: rounding
    np.testing.assert_allclose(value, spline(u), atol=1e-12 * size[0])
    np.testing.assert_allclose(slope, np.where(u == t, spline(u, 1), 0.0), atol=1e-12 * size[1])
    assert clamped_slopes(times, heights)[0] == clamped_slopes(times, heights)[-1] == 0.0
    assert values(
        "trajectory", np.array([times[0] - 1.0, times[-1], 1e6]), times=times, values=heights, interpolation="cubic"
    )[0].tolist() == [heights[0], heights[-1], heights[-1]]


def test_a_trajectory_begins_when_it_is_told() -> None:
    times, heights = points(np.random.default_rng(5), 6)
    t = np.linspace(0.0, 6.0, 61)
    for how in ("linear", "cubic"):
        later = values("trajectory", t + 2.0, times=times, values=heights, interpolation=how, begin=2.0)
        now = values("trajectory", t, times=times, values=heights, interpolation=how)
        np.testing.assert_allclose(later, now, rtol=1e-12, atol=1e-12)  # (t + 2) - 2 is t up to rounding


# recorded


POINTS = points(np.random.default_rng(SEED), 50)
RECORDED = [
    ("pulse", {"to": (-2.0, 2.0), "slope": (2.0, 5.0), "over": (2.0, 3.0), "begin": (0.0, 1.0)}, {"start": 0.1}),
    ("trapezoid", {"to": (-2.0, 2.0), "max_rate": (0.2, 2.0), "max_acceleration": (0.2, 2.0), "begin": (0.0, 1.0)}, {}),
    ("trajectory", {"begin": (0.0, 1.0)}, dict(zip(("times", "values"), POINTS, strict=True))),
    (
        "trajectory", {"begin": (0.0, 1.0)},
        {"interpolation": "cubic", **dict(zip(("times", "values"), POINTS, strict=True))},
    ),
    ("table", {}, dict(zip(("times", "values"), POINTS, strict=True))),
    ("chirp", {"amplitude": (0.1, 1.0), "f0": (0.1, 2.0), "f1": (0.1, 2.0), "over": (0.5, 3.0)}, {}),
    ("chirp", {"f0": (0.1, 2.0), "f1": (0.1, 2.0)}, {"growth": "exponential", "amplitude": 0.4, "over": 2.0}),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("name", "varied", "given"), RECORDED, ids=[f"{n} {len(g)}" for n, _, g in RECORDED])
def test_what_is_recorded_gives_what_plain_floats_give_lane_by_lane(
    name: str, varied: dict[str, Any], given: dict[str, Any]
) -> None:
    rng = np.random.default_rng(SEED)
    t = rng.uniform(0.0, 4.0, 500)
    drawn = {key: rng.uniform(*limits, t.size) for key, limits in varied.items()}
    if name == "trapezoid":
        drawn["to"][:20] = 0.0  # from a value to itself, in some lanes
    if name == "chirp":
        drawn["f1"][:20] = drawn["f0"][:20]
    value, slope = recorded(name, t, drawn, **given)
    plain = [
        values(name, t[i : i + 1], **given, **{key: float(x[i]) for key, x in drawn.items()}) for i in range(t.size)
    ]
    wanted = np.array(plain)[:, :, 0].T
    if name == "chirp":  # sines differ by units in the last place, of angles up to 50 rad
        np.testing.assert_allclose([value, slope], wanted, atol=1e-12)
    else:
        np.testing.assert_array_equal([value, slope], wanted)


# what jumps


JUMPS = [
    ("constant", {"value": 0.4}, "none"),
    ("sine", {"amplitude": 1.0, "frequency": 2.0, "phase": 0.3}, "none"),
    ("trapezoid", {"to": 1.0, "max_rate": 2.0, "max_acceleration": 9.0}, "none"),
    ("trajectory", {"times": (0.1, 0.4, 0.9), "values": (0.0, 1.0, 0.5), "interpolation": "cubic"}, "none"),
    ("trajectory", {"times": (0.1, 0.4, 0.9), "values": (0.0, 1.0, 0.5)}, "rate"),
    ("table", {"times": (0.1, 0.4, 0.9), "values": (0.0, 1.0, 0.5)}, "rate"),
    ("ramp", {"to": 1.0, "over": 0.5}, "rate"),
    ("pulse", {"to": 1.0, "slope": 5.0, "over": 0.6}, "rate"),
    ("chirp", {"amplitude": 1.0, "f0": 1.0, "f1": 3.0, "over": 0.6}, "rate"),
    ("step", {"to": 1.0, "at": 0.5}, "value"),
]


def test_every_profile_is_here() -> None:
    assert {name for name, *_ in JUMPS} == set(models.find_own("command"))


@pytest.mark.release
@pytest.mark.parametrize(("name", "given", "jump"), JUMPS)
def test_a_profile_jumps_as_it_says(name: str, given: dict[str, Any], jump: str) -> None:
    assert profile(name).jump(filled(name, **given)) == jump
    at = np.linspace(0.0, 1.0, 100_001)
    value, slope = values(name, at, **given)
    # a step of 10 us: what does not jump changes by its slope times that, and slopes here change by 200/s at most
    steps = np.max(np.abs(np.diff(value))), np.max(np.abs(np.diff(slope)))
    assert (steps[0] > 0.1) == (jump == "value")
    assert (steps[1] > 0.1) == (jump == "rate")
