"""An MJCF text to the joints and links of MuJoCo's compiled model: a program of its own, as MuJoCo may end a process.

Reads `{"xml": TEXT, "files": {NAME: BASE64}}` as JSON, and writes one line of JSON: what `compiled_model` returns, or
`{"error": TEXT}` where the text is refused, which is empty where there is no MuJoCo.
"""

from __future__ import annotations

import base64
import json
import math
import sys
from collections.abc import Mapping
from typing import Any

FREE, BALL, SLIDE = 0, 1, 2  # of mjtJoint
DRAWN = 2  # the last group of shapes that MuJoCo draws: those of collisions are in the next
EXACT = 13  # digits of moments of inertia, as a share of the largest: MuJoCo's axes of inertia are exact to some more
FINITE = (
    "body_pos", "body_quat", "body_mass", "body_ipos", "body_iquat", "body_inertia", "qpos0", "qpos_spring", "jnt_pos",
    "jnt_axis", "jnt_stiffness", "jnt_range", "jnt_actfrcrange", "dof_armature", "dof_damping", "dof_frictionloss",
    "actuator_gainprm", "actuator_biasprm", "actuator_gear", "actuator_ctrlrange", "actuator_forcerange", "eq_data",
    "key_qpos", "key_ctrl", "geom_pos", "geom_quat",
)  # fmt: skip
POWERS = ("jnt_stiffnesspoly", "dof_dampingpoly")


def compiled_model(xml: str, files: Mapping[str, bytes]) -> dict[str, Any]:
    """The model in plain numbers, SI. Raises ModuleNotFoundError without MuJoCo, and ValueError in words.

    gravity     as vector in world axes, 0 where the file turns it off
    bodies      but the world: name, parent (a number, 0 for the world), mass, com and moments (xx, yy, zz, xy, xz,
                yz) in the frame of its last joint; `at` and `R` of this frame in the parent's if it has no joint
    joints      name, body, kind (mjtJoint), `at` and `R` in the frame of the joint before (of a joint that floats, in
                the world at the start), axis, range and effort or None, position at the start; passive: what acts
                without actuators, by keys of the servo `passive`; drive: the same with actuators at their controls, or
                None
    equalities  name, the joint that follows and its leader, ratio, offset: None where they are no straight line
    lost        actuators of which the joint's `drive` does not have the force
    looks       points that stand for meshes in groups that MuJoCo draws: name, body, and `at` and `R` in its frame
    """
    import mujoco
    import numpy as np

    model = mujoco.MjModel.from_xml_string(xml, dict(files))
    for name in FINITE:
        if not np.isfinite(getattr(model, name)).all():
            raise ValueError(f"`{name}` has numbers that are not finite")
    if any(np.any(getattr(model, name, 0.0)) for name in POWERS):
        raise ValueError("a spring or damper has powers of the deflection or rate, and `passive` is linear")

    def names(kind: str, count: int) -> list[str]:
        return [mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), i) for i in range(count)]

    def rotation(quaternion: Any) -> Any:
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, quaternion)
        return R.reshape(3, 3)

    keys = names("KEY", model.nkey)
    key = keys.index("home") if "home" in keys else 0
    start, controls = (model.key_qpos[key], model.key_ctrl[key]) if keys else (model.qpos0, np.zeros(model.nu))
    bodies, joints = [], []
    anchors = np.zeros((model.nbody, 3))
    for body, name in enumerate(names("BODY", model.nbody)):
        position, R = model.body_pos[body] - anchors[model.body_parentid[body]], rotation(model.body_quat[body])
        for j in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            q, dof, kind, axis = model.jnt_qposadr[j], model.jnt_dofadr[j], int(model.jnt_type[j]), model.jnt_axis[j]
            position, anchors[body] = position + R @ (model.jnt_pos[j] - anchors[body]), model.jnt_pos[j]
            if kind == SLIDE:
                position = position - model.qpos0[q] * (R @ axis)
            elif kind > SLIDE:
                turn = np.zeros(4)
                mujoco.mju_axisAngle2Quat(turn, axis, -model.qpos0[q])
                R = R @ rotation(turn)
            if kind == FREE:
                position, R = start[q : q + 3], rotation(start[q + 3 : q + 7])
            joint = {"body": body, "kind": kind, "at": position.tolist(), "R": R.tolist(), "axis": axis.tolist()}
            joint["range"] = model.jnt_range[j].tolist() if model.jnt_limited[j] else None
            joint["effort"] = abs(model.jnt_actfrcrange[j]).max() if model.jnt_actfrclimited[j] else math.inf
            joint["start"] = float(start[q])
            stiffness = float(model.jnt_stiffness[j])
            joint["passive"] = {
                "damping": float(model.dof_damping[dof]),
                "friction": float(model.dof_frictionloss[dof]),
                "stiffness": stiffness,
                "rest": float(model.qpos_spring[q]) if stiffness else 0.0,
                "rotor": float(model.dof_armature[dof]),
            }
            joints.append(joint)
            position, R = np.zeros(3), np.eye(3)
        inertia, axes = model.body_inertia[body], rotation(model.body_iquat[body])
        digits = EXACT - math.floor(math.log10(max(*inertia, 1e-30)))
        moments = ((axes * inertia) @ axes.T)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].round(min(digits, 300))
        vectors = {"com": model.body_ipos[body] - anchors[body], "moments": moments, "at": position, "R": R}
        numbers = {"parent": int(model.body_parentid[body]), "mass": float(model.body_mass[body])}
        bodies.append({"name": name, **numbers, **{key: vector.tolist() for key, vector in vectors.items()}})
    for joint, name in zip(joints, names("JOINT", model.njnt), strict=True):
        joint["name"] = name
    lost = _actuate(model, joints, names("ACTUATOR", model.nu), controls)
    equalities = []
    for i, name in enumerate(names("EQUALITY", model.neq)):
        first, second, (offset, ratio, *powers) = model.eq_obj1id[i], model.eq_obj2id[i], model.eq_data[i][:5].tolist()
        straight = model.eq_active0[i] and second >= 0 and ratio and not any(powers)
        offset += model.qpos0[model.jnt_qposadr[first]] - ratio * model.qpos0[model.jnt_qposadr[second]]
        law = (joints[first]["name"], joints[second]["name"], ratio, float(offset)) if straight else None
        equalities.append((name, law))
    looks = [
        {"name": name, "body": int(body), "at": (model.geom_pos[i] - anchors[body]).tolist(),
         "R": rotation(model.geom_quat[i]).tolist()}
        for i, (name, body) in enumerate(zip(names("GEOM", model.ngeom), model.geom_bodyid, strict=True))
        if name and model.geom_group[i] <= DRAWN
    ]  # fmt: skip
    weightless = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    gravity = [0.0, 0.0, 0.0] if weightless else model.opt.gravity.tolist()
    return {"gravity": gravity, "key": key if keys else None, "bodies": bodies[1:], "joints": joints,
            "equalities": equalities, "lost": lost, "looks": looks}  # fmt: skip


def _actuate(model: Any, joints: list[dict[str, Any]], names: list[str], controls: Any) -> list[str]:
    """Give joints their `drive`, and the `effort` that their actuators can have; returns the names of those whose force
    is not in it."""
    lost: list[str] = []
    for j, joint in enumerate(joints):
        damping, stiffness, constant, effort = 0.0, 0.0, 0.0, 0.0
        own = [i for i in range(len(names)) if model.actuator_trnid[i][0] == j]
        for i in own:
            low, high = model.actuator_ctrlrange[i] if model.actuator_ctrllimited[i] else (-math.inf, math.inf)
            gear, gain, bias = model.actuator_gear[i][0], model.actuator_gainprm[i][0], model.actuator_biasprm[i][:3]
            bias = bias * (model.actuator_biastype[i] == 1)  # affine
            odd = model.actuator_dyntype[i] or model.actuator_gaintype[i] or model.actuator_biastype[i] > 1
            force = gain * min(max(controls[i], low), high) + bias[0]
            if odd or joint["kind"] == FREE or max(bias[1:]) > 0.0 or (force and not bias[1]):
                lost.append(names[i])
                force, bias = 0.0, 0.0 * bias
            most = abs(model.actuator_forcerange[i]).max() if model.actuator_forcelimited[i] else math.inf
            if not any(bias[1:]) and not odd:
                most = min(most, abs(gain) * max(-low, high))
            constant, effort = constant + gear * force, effort + abs(gear) * most
            stiffness, damping = stiffness - gear**2 * bias[1], damping - gear**2 * bias[2]
        joint["effort"] = min(joint["effort"], effort) if own else joint["effort"]
        passive, joint["drive"] = joint["passive"], None
        if stiffness or damping:
            total = passive["stiffness"] + stiffness
            rest = (passive["stiffness"] * passive["rest"] + constant) / total if total else 0.0
            more = {"damping": passive["damping"] + damping, "stiffness": total, "rest": rest}
            joint["drive"] = {key: float(value) for key, value in {**passive, **more}.items()}
        joint["effort"] = float(joint["effort"]) if 0.0 < joint["effort"] < math.inf else None
    return lost


def main() -> None:
    asked = json.load(sys.stdin)
    try:
        files = {name: base64.b64decode(data) for name, data in asked["files"].items()}
        answer = compiled_model(asked["xml"], files)
    except ModuleNotFoundError:
        answer = {"error": ""}
    except Exception as reason:  # MuJoCo raises ValueError, and in some versions others
        answer = {"error": str(reason) or type(reason).__name__}
    print(f"\n{json.dumps(answer)}")


if __name__ == "__main__":
    main()
