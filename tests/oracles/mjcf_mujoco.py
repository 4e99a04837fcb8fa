"""An MJCF file read by MuJoCo: mass matrix, forces and accelerations, by the file's own joints in their order.

Nothing here comes from met or ic. Contacts, limits, couplings and actuators are off. Joints have their armature, and in
`start` also their springs and dampers.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.oracles.package import Package

mujoco = Package("mujoco")


class MjcfMujoco:
    def __init__(self, path: Path) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(path))
        bits = mujoco.mjtDisableBit
        self.model.opt.disableflags |= (bits.mjDSBL_CONTACT | bits.mjDSBL_LIMIT | bits.mjDSBL_EQUALITY
                                        | bits.mjDSBL_FRICTIONLOSS | bits.mjDSBL_ACTUATION)  # fmt: skip
        self.model.opt.viscosity = self.model.opt.density = 0.0
        self.model.body_gravcomp[:] = 0.0
        self.data = mujoco.MjData(self.model)
        moving = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        self.joints = [j for j in range(self.model.njnt) if self.model.jnt_type[j] in moving]
        self.names = [self.model.joint(j).name for j in self.joints]
        self._q = self.model.jnt_qposadr[self.joints]
        self._v = self.model.jnt_dofadr[self.joints]

    def _set(self, q: np.ndarray, qd: np.ndarray) -> None:
        self.data.qpos[self._q] = q
        self.data.qvel[self._v] = qd

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        self._set(q, 0.0 * q)
        mujoco.mj_forward(self.model, self.data)
        M = np.zeros((self.model.nv, self.model.nv))
        for row, unit in zip(M, np.eye(self.model.nv), strict=True):  # mj_fullM takes other arguments in each version
            mujoco.mj_mulM(self.model, self.data, row, unit)
        return M[np.ix_(self._v, self._v)]

    def bias(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Torques of gravity and of velocity products."""
        self._set(q, qd)
        mujoco.mj_forward(self.model, self.data)
        return self.data.qfrc_bias[self._v].copy()

    def accelerations(self, q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Accelerations under torques alone, without springs and dampers."""
        self._set(q, qd)
        mujoco.mj_forward(self.model, self.data)
        self.data.qfrc_applied[:] = -self.data.qfrc_passive
        self.data.qfrc_applied[self._v] += tau
        mujoco.mj_forward(self.model, self.data)
        found = self.data.qacc[self._v].copy()
        self.data.qfrc_applied[:] = 0.0
        return found

    def start(self, q: np.ndarray | None, qd: np.ndarray) -> np.ndarray:
        """Accelerations at the start, under gravity, springs and dampers, with a base that is at rest and free, if it
        is. q: positions; None for those of the keyframe `home`, or of the first one."""
        names = [self.model.key(k).name for k in range(self.model.nkey)]
        if names:
            mujoco.mj_resetDataKeyframe(self.model, self.data, names.index("home") if "home" in names else 0)
        self.data.qvel[:] = 0.0
        self._set(self.data.qpos[self._q] if q is None else q, qd)
        mujoco.mj_forward(self.model, self.data)
        return self.data.qacc[self._v].copy()
