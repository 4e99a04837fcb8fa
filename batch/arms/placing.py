"""Poses of the links in the world, from the numbers of a case: at all its rows at once, or traced."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from met.dynamics.spatial import HERE, Pose, rotation_quaternion
from met.plan import BASE, Experiment, Formula
from met.program.motion.base import BaseMotion, motions, prescribed
from met.program.system import PARAMETER, System
from met.trace import Scalar

POSITION = "q"

OF_FREE_BASE = (f"links.{BASE}.position", f"links.{BASE}.orientation")
"""Signals that give the pose of a free base."""

INSTANT = 1e-6
"""Share of a step by which a row's time may be rounded below its instant."""


def parameters(experiment: Experiment, varied: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers among a case's parameters, of which some follow from varied ones. varied: numbers, arrays of one
    shape, or traced numbers; dependent parameters are of the same kind"""
    outputs = experiment.formulas.replay({path: _plain(value) for path, value in varied.items()})
    out = {}
    for path, quantity in experiment.parameters.items():
        value = outputs[quantity.value.output] if isinstance(quantity.value, Formula) else quantity.value
        if isinstance(value, int | float | np.floating | np.ndarray | Scalar):
            out[path] = _plain(value)
    return out


def _plain(value: Any) -> Any:
    return value if isinstance(value, Scalar) or np.ndim(value) else float(value)


def free_pose(position: np.ndarray, orientation: np.ndarray) -> Pose:
    """A free base's pose from its recorded numbers: (..., 3) and (..., 4)."""
    p, q = np.moveaxis(position, -1, 0), np.moveaxis(orientation, -1, 0)
    return Pose(rotation_quaternion(q[0], q[1], q[2], q[3]), (p[0], p[1], p[2]))


def prescribed_pose(experiment: Experiment, values: Mapping[str, Any], time: np.ndarray) -> Pose:
    """A prescribed base's pose at rows of these times, s: that of the step's instant, like all recorded values."""
    memory = {PARAMETER + path: value for path, value in values.items()}
    step = experiment.structure.schedule.step
    instant: Any = np.floor(time / step + INSTANT) * step
    return prescribed(System(experiment), memory.__getitem__, instant).pose


def world_poses(
    experiment: Experiment, values: Mapping[str, Any], q: Sequence[Any], base: Pose = HERE
) -> dict[str, Pose]:
    """Every link's frame in the world; where it changes, its numbers are arrays over all rows."""
    system = System(experiment)
    memory = {PARAMETER + path: value for path, value in values.items()}
    system.keep_tree(memory.__getitem__, memory.__setitem__)
    motion_of = motions(system.tree(memory.__getitem__), q, [0.0] * len(q), BaseMotion(base))
    return {name: motion.pose for name, motion in motion_of.items()}
