"""Rotation vectors: the logarithm of a rotation, from none at all to half a turn."""

from __future__ import annotations

import math

import numpy as np

from met.trace import Formulas, Graph
from met.vectors import Matrix, rotation_about, rotation_vector


def axes() -> np.ndarray:
    rng = np.random.default_rng(3)
    some = rng.standard_normal((40, 3))
    some = np.concatenate([some, np.eye(3), -np.eye(3), np.eye(3) + 1e-9 * rng.standard_normal((3, 3))])
    return some / np.linalg.norm(some, axis=1, keepdims=True)


def turned(axis: np.ndarray, angle: float) -> Matrix:
    return rotation_about(tuple(axis.tolist()), np.float64(angle))


def test_it_is_axis_times_angle_from_nothing_to_half_a_turn() -> None:
    for angle in (0.0, 1e-300, 1e-17, 1e-9, 1e-4, 0.3, 2.0, 3.1, math.pi - 1e-6, math.pi - 1e-9):
        for axis in axes():
            # the rotation's entries are rounded to 1e-16; the nine of them say the angle some roundings less well
            assert np.abs(np.array(rotation_vector(turned(axis, angle))) - angle * axis).max() < 4e-15, (angle, axis)


def test_at_half_a_turn_it_is_one_of_the_two_that_are_right() -> None:
    for axis in axes():
        found = np.array(rotation_vector(turned(axis, math.pi)))
        assert min(np.abs(found - math.pi * axis).max(), np.abs(found + math.pi * axis).max()) < 4e-15


def test_beyond_half_a_turn_it_goes_the_other_way_round() -> None:
    for axis in axes():
        found = np.array(rotation_vector(turned(axis, 1.25 * math.pi)))
        assert np.abs(found + 0.75 * math.pi * axis).max() < 4e-15


def test_recorded_it_computes_the_same() -> None:
    graph = Graph()
    names = [f"r{i}{j}" for i in range(3) for j in range(3)]
    entries = [graph.input(name) for name in names]
    recorded = Formulas.of(graph, rotation_vector((tuple(entries[:3]), tuple(entries[3:6]), tuple(entries[6:]))))  # type: ignore[arg-type]
    for angle in (0.0, 1e-9, 0.7, 3.0, math.pi):
        for axis in axes()[::7]:
            R = turned(axis, angle)
            found = recorded.replay(dict(zip(names, [float(x) for row in R for x in row], strict=True)))
            assert np.abs(np.array(found) - np.array(rotation_vector(R))).max() < 2e-15  # atan2 is to 3 units


def test_of_no_rotation_it_is_no_number() -> None:
    assert np.isnan(rotation_vector(((math.nan,) * 3,) * 3)).all()
