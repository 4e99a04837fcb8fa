"""Loops of random lengths, closed by formulas: their two points meet, and the formulas' derivatives are theirs."""

from __future__ import annotations

import numpy as np
import pytest

from met.plan import Joint
from met.plan.closing import Led, Loop, close, corners_of, ways
from met.vectors import IDENTITY, ZERO, Vector, add, product, rotation_about, rotation_rpy, scale, turn_vector

BARS = (("crank", "revolute", ""), ("coupler", "revolute", "crank"), ("rocker", "revolute", ""))
RAM = (("swing", "revolute", ""), ("stroke", "prismatic", "swing"), ("hinge", "revolute", ""))
SLIDER = (("crank", "revolute", ""), ("coupler", "revolute", "crank"), ("slide", "prismatic", ""))
LED = [(BARS, "crank"), (BARS, "coupler"), (BARS, "rocker"), (RAM, "stroke"), (SLIDER, "slide")]


def drawn(kinds: tuple[tuple[str, str, str], ...], rng: np.random.Generator) -> dict[str, float]:
    """Numbers of a loop in the plane across z of a frame that is turned at random."""
    rpy, numbers = rng.uniform(-3.0, 3.0, 3), dict[str, float]()

    def vector(path: str, xyz: tuple[float, float, float]) -> None:
        numbers.update({f"{path}.{axis}": float(x) for axis, x in zip("xyz", xyz, strict=True)})

    for name, kind, parent in kinds:
        place = (*rng.uniform(-1.0, 1.0, 2), 0.0)
        turned = rotation_rpy(*rpy) if not parent else IDENTITY
        vector(f"{name}.at", turn_vector(turned, place))
        vector(f"{name}.rpy", tuple(rpy) if not parent else ZERO)
        angle = rng.uniform(-3.0, 3.0)
        slides = (float(np.cos(angle)), float(np.sin(angle)), 0.0)
        vector(f"{name}.axis", slides if kind == "prismatic" else (0.0, 0.0, float(rng.choice([-1.0, 1.0]))))
    for point in ("at", "to_at"):
        vector(f"pin.{point}", (*rng.uniform(-1.0, 1.0, 2), 0.0))
    return numbers


@pytest.mark.parametrize(("kinds", "leader"), LED)
@pytest.mark.parametrize("branch", ["left", "right"])
def test_a_loop_closes_and_its_rates_are_derivatives_of_its_positions(
    kinds: tuple[tuple[str, str, str], ...], leader: str, branch: str
) -> None:
    rng, closed, step = np.random.default_rng(7), 0, 1e-5
    joints = [Joint(name, kind, f"{parent}_link" if parent else "base", f"{name}_link") for name, kind, parent in kinds]  # type: ignore[arg-type]
    loop = Loop("pin", leader, f"{kinds[1][0]}_link", f"{kinds[2][0]}_link", branch)  # type: ignore[arg-type]
    for _ in range(60):
        numbers, u = drawn(kinds, rng), float(rng.uniform(-1.0, 1.0))
        corners = corners_of(loop, joints, lambda path, numbers=numbers: numbers.get(path, 0.0))  # type: ignore[misc]
        low, here, high = (followers(close(corners, u + d, left=branch == "left")[0]) for d in (-step, 0.0, step))
        if (
            not np.isfinite([led.q for led in (*low.values(), *high.values())]).all()
            or max(abs(led.bend) for led in here.values()) > 10
        ):
            continue
        closed += 1
        assert gap(loop, joints, numbers, {leader: u, **{name: led.q for name, led in here.items()}}) < 1e-14
        for name, led in here.items():
            assert (high[name].q - low[name].q) / (2 * step) == pytest.approx(led.ratio, abs=1e-8)
            assert (high[name].ratio - low[name].ratio) / (2 * step) == pytest.approx(led.bend, abs=1e-7)
    assert closed > 10


def followers(corners: dict[str, Led]) -> dict[str, Led]:
    """The corners that are joints, without the pin."""
    return {name: led for name, led in corners.items() if name}


def gap(loop: Loop, joints: list[Joint], numbers: dict[str, float], q: dict[str, float]) -> float:
    """The distance of a loop's two points, along the joints, m."""

    def vector(path: str) -> Vector:
        return numbers[f"{path}.x"], numbers[f"{path}.y"], numbers[f"{path}.z"]

    ends = []
    for way, point in zip(ways(loop, joints), ("at", "to_at"), strict=True):
        R, p = IDENTITY, ZERO
        for joint in way:
            p = add(p, turn_vector(R, vector(f"{joint.name}.at")))
            R = product(R, rotation_rpy(*vector(f"{joint.name}.rpy")))
            axis = vector(f"{joint.name}.axis")
            if joint.kind == "revolute":
                R = product(R, rotation_about(axis, q[joint.name]))
            else:
                p = add(p, turn_vector(R, scale(q[joint.name], axis)))
        ends.append(add(p, turn_vector(R, vector(f"pin.{point}"))))
    return float(np.abs(np.subtract(*ends)).max())
