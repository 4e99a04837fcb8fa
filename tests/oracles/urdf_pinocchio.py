"""A URDF file read by Pinocchio: poses of its links, torques and accelerations, by the file's own names.

Nothing here comes from met or ic. Joints that follow others move by themselves, as Pinocchio has them by default.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tests.oracles.package import Package

pin = Package("pinocchio")


class UrdfPinocchio:
    """The robot on a fixed base, under g = 9.81 m/s^2 along -z."""

    def __init__(self, path: Path) -> None:
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.joints = tuple(self.model.names[1:])  # of those that move

    def _q(self, q: Mapping[str, float]) -> np.ndarray:
        """The configuration: of a joint without limits, cosine and sine."""
        made = pin.neutral(self.model)
        for name, value in q.items():
            joint = self.model.joints[self.model.getJointId(name)]
            if joint.nq == 2:
                made[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
            else:
                made[joint.idx_q] = value
        return made

    def _v(self, given: Mapping[str, float]) -> np.ndarray:
        made = np.zeros(self.model.nv)
        for name, value in given.items():
            made[self.model.joints[self.model.getJointId(name)].idx_v] = value
        return made

    def _named(self, found: np.ndarray) -> dict[str, float]:
        return {name: float(found[self.model.joints[self.model.getJointId(name)].idx_v]) for name in self.joints}

    def poses(self, q: Mapping[str, float]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """R and p in the world of every link's frame."""
        pin.framesForwardKinematics(self.model, self.data, self._q(q))
        frames = enumerate(self.model.frames)
        return {frame.name: (self.data.oMf[i].rotation.copy(), self.data.oMf[i].translation.copy())
                for i, frame in frames if frame.type == pin.FrameType.BODY}  # fmt: skip

    def torques(self, q: Mapping[str, float], qd: Mapping[str, float], qdd: Mapping[str, float]) -> dict[str, float]:
        return self._named(pin.rnea(self.model, self.data, self._q(q), self._v(qd), self._v(qdd)))

    def accelerations(
        self, q: Mapping[str, float], qd: Mapping[str, float], tau: Mapping[str, float]
    ) -> dict[str, float]:
        return self._named(pin.aba(self.model, self.data, self._q(q), self._v(qd), self._v(tau)))
