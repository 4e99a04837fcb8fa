"""What courses say of their content in time is so: of random courses, sampled finely."""

from __future__ import annotations

import math
import random
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from met import models
from met.content import NEVER, content_of_points

DURATION = 3.0


def random_course(name: str, pick: random.Random) -> SimpleNamespace:
    """Parameters of a course, from a seeded generator."""
    numbers = {each: pick.uniform(-2.0, 2.0) for each in ("to", "start", "amplitude", "offset", "phase")}
    times = sorted(pick.uniform(0.0, 4.0) for _ in range(8))
    values = tuple(pick.choice((0.0, 1.0, pick.uniform(-1.0, 1.0))) for _ in times)
    return SimpleNamespace(
        **numbers,
        at=pick.uniform(0.0, 4.0),
        begin=pick.uniform(0.0, 4.0) if name != "trajectory" else 0.5,
        over=pick.uniform(0.1, 3.0),
        slope=pick.uniform(5.0, 60.0),
        max_rate=pick.uniform(0.2, 3.0),
        max_acceleration=pick.uniform(0.2, 3.0),
        frequency=pick.uniform(1.0, 20.0),
        f0=pick.uniform(1.0, 20.0),
        f1=pick.uniform(1.0, 20.0),
        growth=pick.choice(("linear", "exponential")),
        interpolation="linear",
        times=tuple(times),
        values=values,
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("name", ["ramp", "pulse", "step", "sine", "chirp", "table", "trajectory", "trapezoid"])
def test_a_course_changes_from_its_beginning_to_its_end_and_not_outside(name: str, seed: int) -> None:
    profile, p = models.find_own("command")[name], random_course(name, random.Random(f"{name}{seed}"))
    content = profile.content(p, DURATION)
    first = profile.course(p, 0.0)[0]
    for t in np.linspace(0.0, min(content.begins, 20.0), 50)[:-1]:
        assert profile.course(p, float(t))[0] == pytest.approx(first, abs=1e-12)
    if math.isfinite(content.ends):
        last = profile.course(p, content.ends + 1e-9)[0]
        assert profile.course(p, content.ends + 10.0)[0] == pytest.approx(last, abs=1e-7)
    if math.isfinite(content.begins):
        after = content.begins + 1e-3
        assert profile.course(p, after)[0] != first or profile.course(p, after + 1e-3)[0] != first


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("name", ["sine", "chirp"])
def test_the_fastest_swing_is_that_of_the_course_within_the_run(name: str, seed: int) -> None:
    profile, p = models.find_own("command")[name], random_course(name, random.Random(f"{name}{seed}"))
    p.begin, p.amplitude = 0.25 * p.begin, 1.0
    content = profile.content(p, DURATION)
    t = np.arange(content.begins, min(content.ends, DURATION), 1e-4)
    course = [profile.course(p, float(x)) for x in t]
    x, v = np.array([each[0] for each in course]) - p.offset, np.array([each[1] for each in course])
    frequency = np.abs(v) / np.sqrt(np.maximum(1.0 - x * x, 1e-12)) / (2.0 * math.pi)
    assert np.max(frequency[np.abs(x) < 0.9]) == pytest.approx(content.frequency, rel=0.05)
    assert np.max(frequency[np.abs(x) < 0.9]) <= content.frequency * (1.0 + 1e-9)


def test_a_pulse_is_beyond_half_of_its_height_between_its_ends() -> None:
    content = content_of_points((0.0, 0.2, 0.4, 0.6), (1.0, 1.0, 3.0, 0.0), begin=10.0)
    assert (content.begins, content.ends) == (10.2, 10.6)
    (pulse,) = content.pulses
    assert pulse == pytest.approx((10.3, 10.4 + 0.2 / 3.0))


def test_a_jump_and_a_rise_are_no_pulse_and_a_ripple_of_a_large_range_is_none() -> None:
    assert content_of_points((0.0, 0.5, 0.5001, 1.0), (0.0, 0.0, 1.0, 1.0)).pulses == ()
    assert content_of_points((0.0, 1.0, 2.0, 3.0), (0.0, 0.5, 0.45, 1.0)).pulses == ()
    assert content_of_points((0.0, 1.0), (2.0, 2.0)) == NEVER
    assert len(content_of_points((0.0, 1.0, 2.0, 3.0, 4.0), (0.0, 1.0, 0.0, 1.0, 0.0)).pulses) == 3


@pytest.mark.parametrize("seed", range(50))
def test_instants_that_miss_a_pulse_see_less_than_half_of_it(seed: int) -> None:
    pick = random.Random(seed)
    times = tuple(np.cumsum([pick.uniform(0.001, 0.1) for _ in range(12)]).tolist())
    values = tuple(pick.uniform(-1.0, 1.0) for _ in times)
    table: Any = models.find_own("command")["table"]
    p = SimpleNamespace(times=times, values=values)
    fine = np.linspace(times[0], times[-1], 4001)
    curve = np.interp(fine, times, values)
    for first, last in content_of_points(times, values).pulses:
        inside = (fine > first) & (fine < last)
        ends = [table.course(p, first)[0], table.course(p, last)[0]]
        assert ends[0] == pytest.approx(ends[1], abs=1e-9), seed
        level = 0.5 * (ends[0] + ends[1])
        assert (curve[inside] > level - 1e-9).all() or (curve[inside] < level + 1e-9).all(), seed
