"""Poses of the links of a case at each of its rows, from the recorded q and the case's own parameters.

So it is with a base that is prescribed; of a free one position and orientation must be recorded too.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from batch.archive.read import reading
from batch.archive.stored import Stored
from batch.arms.meshes import NO_MESHES, ArmMeshes
from batch.arms.scene import OF_FREE_BASE, POSITION, free_pose, parameters, prescribed_pose, world_poses
from batch.export.picking import ExportedCase
from met.diagnostic import Problem, error
from met.dynamics.spatial import HERE, IDENTITY, Pose, compose, inverse, sub
from met.frozen import frozen
from met.outputs import quoted
from met.plan import BASE, Experiment, Plan
from met.vectors import quaternion


@frozen
class PosedArm:
    """The arm of a case.

    prefix    before the names of its frames and topics; "" where it is alone
    values    its parameters by path, in SI; the numbers among them
    first     the same of the case in which shapes are as the plan has them
    parents   of each link: the link, or "base", that carries it; "" of the base, where it is a link, and of payloads
              that fly for a time
    poses     of each link in its parent, by row; of the base in the world. And of each payload, but of those that fly
              for a time only where their position and orientation were recorded
    place     of each link's origin from the base's at the first row, world axes, m
    travel    of each joint that slides: the stretch of q, 0 in it, that this case uses, m
    meshes    what its links are drawn by, besides shapes
    """

    case: ExportedCase
    experiment: Experiment
    prefix: str
    values: Mapping[str, float]
    first: Mapping[str, float]
    parents: Mapping[str, str]
    poses: Mapping[str, PoseVariables]
    place: Mapping[str, np.ndarray]
    travel: Mapping[str, tuple[float, float]]
    meshes: ArmMeshes = NO_MESHES

    def topic(self, name: str) -> str:
        """The topic of a signal in an MCAP file, where dots would be taken for fields: `/case7/elbow/servo/voltage`."""
        return f"/{self.prefix}{name.replace('.', '/')}"


def root_frame(arms: Sequence[PosedArm]) -> str:
    """The name of the frame that all arms of an MCAP file stand in: the first of these names that no link has."""
    taken = {arm.prefix + name for arm in arms for name in arm.poses}
    names = itertools.chain(("world", "base", "ground"), (f"world_{number}" for number in itertools.count(2)))
    return next(name for name in names if name not in taken)


@frozen
class PoseVariables:
    """A frame in another: origin (row, 3), m; unit quaternion (row, 4) of w, x, y, z."""

    position: np.ndarray
    orientation: np.ndarray


def arm_of(plan: Plan, case: ExportedCase, prefix: str) -> PosedArm:
    """The arm of a case. Raises Problem E370 where q of a joint was not recorded, E302 where the archive's plan does
    not tell the arm."""
    group = case.group
    with reading(group.path):
        experiment = next((experiment for experiment in plan.experiments if experiment.name == group.name), None)
        if experiment is None:
            raise LookupError(group.name)
        varied = {v.path: case.value(v.name) for v in group.role("coordinate")}
        values = parameters(experiment, varied)
        first = parameters(
            experiment, {coordinate.path: coordinate.values[0] for coordinate in experiment.cases.coordinates}
        )
        joints = experiment.structure.moving
    q = positions(case, [joint.name for joint in joints], free=experiment.structure.free)
    with reading(group.path):
        base = HERE
        if experiment.structure.free:
            base = free_pose(*(case.signal(name).astype(np.float64) for name in OF_FREE_BASE))
        elif experiment.structure.base is not None:
            base = prescribed_pose(experiment, values, case.time)
        world = world_poses(experiment, values, q, base)
        parents = {joint.child: joint.parent for joint in experiment.structure.joints}
        parents |= {BASE: ""} if BASE in world else {}
        signal_names = {variable.name for variable in group.role("signal")}
        for payload in experiment.structure.payloads:
            parents[payload.name] = "" if payload.flies else payload.link
            names = [f"payloads.{payload.name}.{part}" for part in ("position", "orientation")]
            if payload.flies and signal_names.issuperset(names):
                world[payload.name] = free_pose(*(case.signal(name).astype(np.float64) for name in names))
        within = {name: compose(inverse(world.get(parents[name], HERE)), pose) for name, pose in world.items()}
        poses = {name: pose_variables(pose, len(case.time)) for name, pose in within.items()}
        links = [link.name for link in experiment.structure.links]
        place = {
            name: pose_variables(Pose(IDENTITY, sub(world[name].p, base.p)), len(case.time)).position for name in links
        }
    start = {name: rows[0] if len(rows) else np.zeros(3) for name, rows in place.items()}
    travel = {
        joint.name: (float(rows.min(initial=0.0)), float(rows.max(initial=0.0)))
        for joint, rows in zip(joints, q, strict=True)
        if joint.kind == "prismatic"
    }
    return PosedArm(case, experiment, prefix, values, first, parents, poses, start, travel)


def positions(case: ExportedCase, joints: Sequence[str], *, free: bool = False) -> list[np.ndarray]:
    """q of each of these joints by row, as one signal of all or a signal of each. Raises Problem E370: free, where what
    tells of a free base is missing too."""
    signals = {variable.name: variable for variable in case.group.role("signal")}
    q_of_joint = {joint: _position(case, joint, signals) for joint in joints}
    missing = [joint for joint, q in q_of_joint.items() if q is None]
    of_base = [name for name in OF_FREE_BASE if free and name not in signals]
    if missing or of_base:
        which = lacking_text(missing, joints, of_base)
        message = f"the arm of case #{case.number} of `{case.run_name}` cannot be shown: {which} was not recorded"
        helps = (
            lacking_help(free=bool(of_base)),
            f"`met export {quoted(case.group.path)} -o FILE.csv` needs no positions",
        )
        raise Problem(error("E370", message, help=helps))
    return [q for q in q_of_joint.values() if q is not None]


def _position(case: ExportedCase, joint: str, signals: Mapping[str, Stored]) -> np.ndarray | None:
    """q of a joint by row, rad or m, as a signal of its own or of all joints; None where neither was recorded."""
    alone = f"{joint}.{POSITION}"
    if alone in signals:
        return case.signal(alone)[:, 0].astype(np.float64)
    if POSITION in signals and joint in (joints := case.group.joints(signals[POSITION])):
        return case.signal(POSITION)[:, joints.index(joint)].astype(np.float64)
    return None


def lacking_text(lacking: Sequence[str], joints: Sequence[object], of_base: Sequence[str] = ()) -> str:
    """The signals without which an arm cannot be placed: `q` where all its joints lack it, else `elbow.q` for each that
    does; and those of its base."""
    all_lack = lacking and len(lacking) == len(joints)
    return ", ".join([*([POSITION] if all_lack else [f"{joint}.{POSITION}" for joint in lacking]), *of_base])


def lacking_help(*, free: bool) -> str:
    """Help that names the signals to record. free: also those of the base."""
    more = ", ".join(("q", *OF_FREE_BASE)) if free else "q, ..."
    return f"`record = [{more}]` in the run keeps where its joints{' and its base' * free} are; then run it again"


def pose_variables(pose: Pose, rows: int | tuple[int, ...], time: int | None = 0) -> PoseVariables:
    """A pose with its numbers by row, or by other axes of these sizes. time: along which axis of these its orientation
    is without a jump; None: along none, each with w >= 0."""
    rotation = tuple(tuple(np.broadcast_to(np.asarray(entry, np.float64), rows) for entry in row) for row in pose.R)
    parts = quaternion(rotation)  # type: ignore[arg-type]
    turn = _rows(parts, rows)
    return PoseVariables(_rows(pose.p, rows), turn if time is None else without_sign_jumps(turn, time))


def without_sign_jumps(q: np.ndarray, axis: int) -> np.ndarray:
    """Unit quaternions (..., 4), each with the sign by which it is nearer the one before it along an axis, as in
    records (`met.program.observe`); rows of not-a-number are passed over."""
    rows = np.moveaxis(q, axis, 0)
    number = np.arange(len(rows)).reshape(-1, *(1,) * (rows.ndim - 2))
    known = np.maximum.accumulate(np.where(np.isfinite(rows).all(axis=-1), number, 0), axis=0)
    before = np.take_along_axis(rows, known[:-1, ..., None], axis=0)
    flips = np.where(np.sum(rows[1:] * before, axis=-1) < 0.0, -1.0, 1.0)
    signs = np.concatenate([np.ones_like(rows[:1, ..., 0]), np.cumprod(flips, axis=0)])[: len(rows)]
    return np.moveaxis(rows * signs[..., None], 0, axis)


def _rows(numbers: Sequence[Any], rows: int | tuple[int, ...]) -> np.ndarray:
    return np.stack([np.broadcast_to(np.asarray(number, np.float64), rows) for number in numbers], axis=-1)
