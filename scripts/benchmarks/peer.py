"""The peer that anyone can install: Pinocchio's articulated-body algorithm over a batch, from its PyPI wheel `pin`.

Its models are built here from the same bodies, with its fastest joint (JointModelRZ, about z) throughout.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.arms import GRAVITY, Arm
from benchmarks.benchmark import Untaken

BATCH = 4096
"""Number of states in one call: a few thousand, so that the call's own cost is negligible."""


def pinocchio() -> Any:
    """The module; raises Untaken where it is not installed."""
    try:
        import pinocchio
    except ImportError:
        raise Untaken("`pin` is not installed; `scripts/environment test` adds it") from None
    return pinocchio


def model(arm: Arm) -> Any:
    """The arm as a Pinocchio model; bodies behind fixed joints are merged into their parents."""
    pin = pinocchio()
    pin_model = pin.Model()
    pin_model.gravity.linear = np.array(GRAVITY)
    joint_of: list[int] = []
    placed: list[Any] = []
    for body in arm.bodies():
        place = pin.SE3(pin.rpy.rpyToMatrix(*map(float, body.rpy)), np.array(body.at, float))
        parent = 0 if body.parent < 0 else joint_of[body.parent]
        place = place if body.parent < 0 else placed[body.parent] * place
        if body.kind == "fixed":
            joint_of.append(parent)
            placed.append(place)
        else:
            joint_of.append(pin_model.addJoint(parent, pin.JointModelRZ(), place, body.joint))
            placed.append(pin.SE3.Identity())
        xx, yy, zz, xy, xz, yz = body.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], float)
        pin_model.appendBodyToJoint(
            joint_of[-1], pin.Inertia(float(body.mass), np.array(body.com, float), inertia), placed[-1]
        )
    return pin_model


def accelerations(arm: Arm, q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Joint accelerations [case, joint], rad/s^2; all arguments [case, joint] in our order of joints."""
    pin, pin_model = pinocchio(), model(arm)
    order = _order(pin_model, arm)
    pool = pin.ModelPool(pin_model, 1)
    qdd = np.empty_like(q)
    qdd[:, order] = pin.abaInParallel(1, pool, *(np.asfortranarray(x[:, order].T) for x in (q, qd, tau))).T
    return qdd


def evaluations(arm: Arm, q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> Callable[[], float]:
    """A function that returns the ns of an evaluation, over this batch [case, joint], on one thread, without
    allocations."""
    pin, pin_model = pinocchio(), model(arm)
    pool = pin.ModelPool(pin_model, 1)
    columns = [np.asfortranarray(x[:, _order(pin_model, arm)].T) for x in (q, qd, tau)]
    qdd = np.asfortranarray(np.empty_like(columns[0]))

    def measure() -> float:
        begun = time.thread_time()
        pin.abaInParallel(1, pool, *columns, qdd)
        return (time.thread_time() - begun) * 1e9 / len(q)

    return measure


def _order(pin_model: Any, arm: Arm) -> list[int]:
    """Our joint at each place of the peer's vectors."""
    joint_at = {pin_model.joints[pin_model.getJointId(joint)].idx_v: i for i, joint in enumerate(arm.joints)}
    return [joint_at[i] for i in range(len(joint_at))]
