"""A world for models that are called by themselves: links where a test puts them, in a step of a given length."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from met.environments.environment import Environment
from met.parameter import WORLD


@dataclass
class Link:
    """Where a link is and how it moves, and its inertia; world axes but for com and inertia."""

    R: Any = field(default_factory=lambda: np.eye(3))
    p: Any = (0.0, 0.0, 0.0)
    w: Any = (0.0, 0.0, 0.0)
    v: Any = (0.0, 0.0, 0.0)
    mass: float = 1.0
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = (0.0,) * 6


@dataclass
class Given:
    """What `met.environments.environment.World` answers, of these links and joints (name: position, rate)."""

    placed: dict[str, Link]
    moving: dict[str, tuple[float, float]] = field(default_factory=dict)
    time: float = 0.0
    begin: float = 0.0
    step: float = 0.001

    @property
    def links(self) -> tuple[str, ...]:
        return tuple(self.placed)

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(self.moving)

    def _link(self, link: str) -> Link:
        return Link() if link == WORLD else self.placed[link]

    def q(self, joint: str) -> float:
        return self.moving[joint][0]

    def qd(self, joint: str) -> float:
        return self.moving[joint][1]

    def position(self, link: str, point: Any = (0.0, 0.0, 0.0)) -> Any:
        of = self._link(link)
        return tuple(np.asarray(of.p) + of.R @ np.asarray(point))

    def velocity(self, link: str, point: Any = (0.0, 0.0, 0.0)) -> Any:
        of = self._link(link)
        return tuple(np.asarray(of.v) + np.cross(of.w, of.R @ np.asarray(point)))

    def to_world(self, link: str, vector: Any) -> Any:
        return tuple(self._link(link).R @ np.asarray(vector))

    def orientation(self, link: str) -> Any:
        return tuple(map(tuple, self._link(link).R))

    def rate(self, link: str) -> Any:
        return tuple(self._link(link).w)

    def mass(self, link: str) -> float:
        return self._link(link).mass

    def com(self, link: str) -> Any:
        return self._link(link).com

    def inertia(self, link: str) -> Any:
        return self._link(link).inertia


def given(model: Environment, **values: Any) -> SimpleNamespace:
    """The model's parameters: these, and its defaults."""
    made = {p.name: p.default for p in model.parameters} | values
    unknown = values.keys() - {p.name for p in model.parameters}
    assert not unknown, unknown
    return SimpleNamespace(**made)


def turned(seed: int) -> np.ndarray:
    """A rotation drawn at random."""
    Q, R = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    Q = Q @ np.diag(np.sign(np.diag(R)))
    return Q if np.linalg.det(Q) > 0.0 else -Q
