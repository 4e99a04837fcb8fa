"""Decks of random chains under a guide, and what the law of resolved rates should give them, by Pinocchio and numpy."""

from __future__ import annotations

import random

import numpy as np

from met.plan import Experiment
from tests.oracles.package import Package
from tests.oracles.plan_tree import pinocchio

pin = Package("pinocchio")

Array = np.ndarray

PATH = {
    "x": "ramp(to = 9 cm, over = 1 s)",
    "y": "sine(amplitude = 5 cm, frequency = 0.5 Hz)",
    "z": "ramp(to = -6 cm, over = 1 s)",
    "roll": "ramp(to = 20 deg, over = 1 s)",
    "pitch": "sine(amplitude = 10 deg, frequency = 0.4 Hz)",
    "yaw": "ramp(to = -15 deg, over = 1 s)",
}
POINT = (0.1, -0.2, 0.05)
HZ = 100.0


def chain(
    seed: int,
    count: int,
    more: str,
    *,
    base: str = "",
    sliding: int = -1,
    initial: str = "",
    command: str = "rate",
    rates: str = "dynamics = 200 Hz; servos = 100 Hz; record = 100 Hz;",
    bandwidth: float = 40.0,
    duration: str = "0.5 s",
) -> str:
    """A chain of so many joints in general position, one of them prismatic, all following the guide `tip`."""
    pick = random.Random(seed)

    def vector(size: float, unit: str) -> str:
        return "[" + ", ".join(f"{pick.uniform(-size, size):.4f}" for _ in range(3)) + f"] {unit}"

    arm, servos, begins = [], [], []
    for i in range(count):
        kind = "prismatic" if i == sliding else "revolute"
        inertia = ", ".join(f"{pick.uniform(0.1, 0.2):.4f}" for _ in range(3))
        arm.append(
            f"    link link{i} {{ mass = {pick.uniform(1, 4):.4f} kg; com = {vector(0.2, 'm')};"
            f" inertia = [{inertia}] kg*m^2; }}"
        )
        arm.append(
            f"    joint j{i} {kind} {{ parent = {f'link{i - 1}' if i else 'base'}; child = link{i};"
            f" axis = {vector(1, '')}; at = {vector(0.5, 'm')}; rpy = {vector(1, 'rad')}; }}"
        )
        servos.append(f"j{i} = follow;")
        begins.append(f"j{i}.q = {pick.uniform(-1, 1):.4f} {'m' if i == sliding else 'rad'};")
    return "\n".join(
        [
            f"servo follow {{ model = ideal; bandwidth = {bandwidth} 1/s; command = {command}(tip); }}",
            "arm chain {",
            *arm,
            "}",
            "run it {",
            f"    arm = chain;  {base}  servos {{ {' '.join(servos)} }}",
            f"    initial {{ {' '.join(begins)} {initial} }}  environment {{}}",
            f"    guide tip = resolved_rate {{ link = link{count - 1}; point = [{', '.join(map(str, POINT))}] m;",
            f"        {more} }}",
            f"    rates {{ {rates} }}  duration = {duration};  integrator = rk4;",
            "    record = [q, qd, servo.command, guides.tip.error, guides.tip.turn_error, guides.tip.manipulability,"
            " guides.tip.damping, guides.tip.share];",
            "}",
            "",
        ]
    )


def path(names: tuple[str, ...] = tuple(PATH)) -> str:
    return " ".join(f"{name} = {PATH[name]};" for name in names)


def wanted(t: float, names: tuple[str, ...] = tuple(PATH)) -> tuple[Array, Array, Array, Array]:
    """The path's offset, turn, velocity and angular velocity at t, up to 1 s."""
    deg = np.pi / 180

    def wave(amplitude: float, hz: float) -> tuple[float, float]:
        w = 2 * np.pi * hz
        return amplitude * np.sin(w * t), amplitude * w * np.cos(w * t)

    known = {
        "x": (0.09 * t, 0.09),
        "y": wave(0.05, 0.5),
        "z": (-0.06 * t, -0.06),
        "roll": (20 * deg * t, 20 * deg),
        "pitch": wave(10 * deg, 0.4),
        "yaw": (-15 * deg * t, -15 * deg),
    }
    x, y, z, (roll, rolls), (pitch, pitches), (yaw, yaws) = (known[n] if n in names else (0.0, 0.0) for n in PATH)
    R = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    # Rz(yaw) Ry(pitch) Rx(roll): each axis turned by what stands left of it
    w = yaws * np.array([0.0, 0.0, 1.0]) + pitches * np.array([-np.sin(yaw), np.cos(yaw), 0.0]) + rolls * R[:, 0]
    return np.array([x[0], y[0], z[0]]), R, np.array([x[1], y[1], z[1]]), w


class Oracle:
    """Pinocchio's kinematics of a compiled chain."""

    def __init__(self, experiment: Experiment) -> None:
        self.tree = pinocchio(experiment)
        self.link = experiment.structure.links[-1].name
        self.frame = self.tree.model.addFrame(
            pin.Frame(
                "guided",
                self.tree.joint_of[-1],
                self.tree.placed[-1] * pin.SE3(np.eye(3), np.array(POINT)),
                pin.FrameType.OP_FRAME,
            )
        )
        self.data = self.tree.model.createData()

    def at(self, q: Array) -> tuple[Array, Array, Array]:
        """R and p of the guided frame, and its Jacobian, linear over angular, world axes."""
        theirs = self.tree.vector(q)
        J = pin.computeFrameJacobian(
            self.tree.model, self.data, theirs, self.frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        pin.framesForwardKinematics(self.tree.model, self.data, theirs)
        pose = self.data.oMf[self.frame]
        return pose.rotation.copy(), pose.translation.copy(), J[:, self.tree.at]


def least_squares(J: Array, damping: float, v: Array) -> Array:
    """The rates of damped least squares, by numpy's solver."""
    n = J.shape[1]
    return np.linalg.lstsq(np.vstack([J, damping * np.eye(n)]), np.concatenate([v, np.zeros(n)]), rcond=None)[0]
