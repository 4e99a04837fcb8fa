"""Random arms as decks, and where their links are by Rodrigues' formula: nothing of MET computes it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import ic
from met.plan import Experiment


@dataclass
class RandomJoint:
    """A joint as the deck has it; its link is of the same number. parent: number of the link, -1 for the base."""

    kind: str
    parent: int
    at: np.ndarray
    rpy: np.ndarray
    axis: np.ndarray


def random_joints(rng: np.random.Generator, count: int) -> list[RandomJoint]:
    joints = []
    for number in range(count):
        axis = rng.normal(size=3)
        if number % 3 == 0:
            axis = np.eye(3)[rng.integers(3)]
        kind = str(rng.choice(["revolute", "revolute", "prismatic", "fixed"])) if number else "revolute"
        joints.append(
            RandomJoint(
                kind,
                int(rng.integers(-1, number)),
                rng.normal(size=3),
                rng.uniform(-3, 3, 3),
                axis / np.linalg.norm(axis),
            )
        )
    return joints


def deck(joints: Sequence[RandomJoint], *, free: bool = False) -> str:
    """The deck of an arm, of which a factor `far` of all offsets is varied."""

    def vector(numbers: np.ndarray, unit: str) -> str:
        return "[" + ", ".join(f"{float(x)!r}" for x in numbers) + f"]{unit}"

    lines = ["let far = 1.0;", "arm tree {"]
    names = ["base", *(f"link{n}" for n in range(len(joints)))]
    for n, joint in enumerate(joints):
        lines.append(
            f"  link link{n} {{ mass = {n + 1} kg; com = [0.1, 0.2, {0.1 * n}] m; "
            "inertia = [1, 1.1, 1.2, 0, 0, 0] kg*m^2; }"
        )
        axis = "" if joint.kind == "fixed" else f"axis = {vector(joint.axis, '')}; "
        at = "[" + ", ".join(f"far * {float(x)!r} m" for x in joint.at) + "]"
        lines.append(
            f"  joint j{n} {joint.kind} {{ parent = {names[joint.parent + 1]}; child = link{n}; at = {at}; "
            f"rpy = {vector(joint.rpy, ' rad')}; {axis}}}"
        )
    if free:
        lines.append("  link base { mass = 10 kg; com = [0, 0, 0] m; inertia = [1, 1, 1, 0, 0, 0] kg*m^2; }")
    record = ", links.base.position, links.base.orientation" if free else ""
    lines += [
        "}",
        f"run it {{ arm = tree; {'base = free;' if free else ''} rates {{ dynamics = 100 Hz; record = 100 Hz; }} "
        f"duration = 10 ms; record = [q, links.link{len(joints) - 1}.position{record}]; }}",
        "sweep sizes of it { vary far = [1, 1.5]; }",
    ]
    return "\n".join(lines)


def compiled(text: str, name: str = "sizes") -> Experiment:
    return ic.compile(text=text, select=[name]).experiments[0]


def link_frames(
    joints: Sequence[RandomJoint], q: Sequence[float], far: float, base: tuple[np.ndarray, np.ndarray]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rotation and origin in the world of each link. q: of each joint, of fixed ones too."""
    out: list[tuple[np.ndarray, np.ndarray]] = []
    for joint, position in zip(joints, q, strict=True):
        R, p = base if joint.parent < 0 else out[joint.parent]
        roll, pitch, yaw = joint.rpy
        p, R = p + R @ (far * joint.at), R @ about([0, 0, 1], yaw) @ about([0, 1, 0], pitch) @ about([1, 0, 0], roll)
        if joint.kind == "revolute":
            R = R @ about(joint.axis, position)
        elif joint.kind == "prismatic":
            p = p + R @ (position * joint.axis)
        out.append((R, p))
    return out


def about(axis: Sequence[float] | np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)
