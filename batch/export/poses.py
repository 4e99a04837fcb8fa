"""Where the links of a case are at each of its rows: from the q that was recorded, and the case's own parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from batch.archive.read import Stored, reading
from batch.export.picking import Case
from batch.output import quoted
from met.diagnostic import Problem, error
from met.dynamics.kinematics import link_motions
from met.dynamics.spatial import HERE, Pose, compose, inverse
from met.frozen import frozen
from met.plan import Experiment, Formula, Plan
from met.program.machine import PARAMETER, Machine
from met.rotation import quaternion

POSITION = "q"


@frozen
class Arm:
    """The arm of a case.

    prefix    before the names of its frames and topics; "" where it is alone
    values    its parameters by path, in SI; the numbers among them
    first     the same of the case in which shapes are as the plan has them
    parents   of each link: the link, or "base", that carries it
    poses     of each link in its parent, by row
    place     of each link's origin in the world at the first row, m
    travel    of each joint that slides: the stretch of q, 0 in it, that this case uses, m
    """

    case: Case
    experiment: Experiment
    prefix: str
    values: Mapping[str, float]
    first: Mapping[str, float]
    parents: Mapping[str, str]
    poses: Mapping[str, Moved]
    place: Mapping[str, np.ndarray]
    travel: Mapping[str, tuple[float, float]]


@frozen
class Moved:
    """A frame in another: origin (row, 3), m; unit quaternion (row, 4) of w, x, y, z."""

    position: np.ndarray
    orientation: np.ndarray


def arm_of(plan: Plan, case: Case, prefix: str) -> Arm:
    """The arm of a case. Raises Problem E370 where q of a joint was not recorded, E302 where the archive's plan does
    not tell the arm."""
    group = case.group
    with reading(group.path):
        experiment = next((each for each in plan.experiments if each.name == group.name), None)
        if experiment is None:
            raise LookupError(group.name)
        varied = {v.path: group.at(v.name, [case.position])[0] for v in group.role("coordinate")}
        values = parameters(experiment, varied)
        first = parameters(experiment, {each.path: each.values[0] for each in experiment.cases.coordinates})
        joints = experiment.structure.moving
    q = positions(case, [joint.name for joint in joints])
    with reading(group.path):
        world = world_poses(experiment, values, q)
        parents = {joint.child: joint.parent for joint in experiment.structure.joints}
        within = {name: compose(inverse(world.get(parents[name], HERE)), pose) for name, pose in world.items()}
        poses = {name: moved(pose, len(case.time)) for name, pose in within.items()}
        links = [link.name for link in experiment.structure.links]
        place = {name: moved(world[name], len(case.time)).position for name in links}
    start = {name: rows[0] if len(rows) else np.zeros(3) for name, rows in place.items()}
    travel = {joint.name: (float(rows.min(initial=0.0)), float(rows.max(initial=0.0)))
              for joint, rows in zip(joints, q, strict=True) if joint.kind == "prismatic"}  # fmt: skip
    return Arm(case, experiment, prefix, values, first, parents, poses, start, travel)


def parameters(experiment: Experiment, varied: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers among a case's parameters, of which some follow from what is varied. varied: numbers, or arrays of
    one shape, with which those that follow are arrays too."""
    outputs = experiment.formulas.replay({path: _plain(value) for path, value in varied.items()})
    out = {}
    for path, quantity in experiment.parameters.items():
        value = outputs[quantity.value.output] if isinstance(quantity.value, Formula) else quantity.value
        if isinstance(value, int | float | np.floating | np.ndarray):
            out[path] = _plain(value)
    return out


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else value


def positions(case: Case, joints: Sequence[str]) -> list[np.ndarray]:
    """q of each of these joints by row, as one signal of all or a signal of each. Raises Problem E370."""
    signals = {variable.name: variable for variable in case.group.role("signal")}
    found = {joint: _position(case, joint, signals) for joint in joints}
    missing = [joint for joint, q in found.items() if q is None]
    if missing:
        which = "q" if len(missing) == len(joints) else ", ".join(f"{joint}.q" for joint in missing)
        message = f"the arm of case #{case.number} of `{case.asked}` cannot be shown: {which} was not recorded"
        helps = ("`record = [q, ...]` in the run keeps where its joints are; then run it again",
                 f"`met export {quoted(case.group.path)} -o FILE.csv` needs no positions")  # fmt: skip
        raise Problem(error("E370", message, help=helps))
    return [q for q in found.values() if q is not None]


def _position(case: Case, joint: str, signals: Mapping[str, Stored]) -> np.ndarray | None:
    alone = f"{joint}.{POSITION}"
    if alone in signals:
        return case.signal(alone)[:, 0].astype(np.float64)
    if POSITION in signals and joint in (joints := case.group.joints(signals[POSITION])):
        return case.signal(POSITION)[:, joints.index(joint)].astype(np.float64)
    return None


def world_poses(experiment: Experiment, values: Mapping[str, Any], q: Sequence[Any]) -> dict[str, Pose]:
    """Every link's frame in the world, whose numbers are those of all rows at once where they change."""
    machine = Machine(experiment)
    memory = {PARAMETER + path: value for path, value in values.items()}
    machine.keep_tree(memory.__getitem__, memory.__setitem__)
    motions = link_motions(machine.tree(memory.__getitem__), q, [0.0] * len(q))
    return {name: motion.pose for name, motion in motions.items()}


def moved(pose: Pose, rows: int | tuple[int, ...]) -> Moved:
    """A pose with its numbers by row, or by whatever these are the sizes of."""
    rotation = tuple(tuple(np.broadcast_to(np.asarray(entry, np.float64), rows) for entry in row) for row in pose.R)
    parts = quaternion(rotation)  # type: ignore[arg-type]
    return Moved(_rows(pose.p, rows), _rows(parts, rows))


def _rows(numbers: Sequence[Any], rows: int | tuple[int, ...]) -> np.ndarray:
    return np.stack([np.broadcast_to(np.asarray(number, np.float64), rows) for number in numbers], axis=-1)
