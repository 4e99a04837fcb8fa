"""An arm as formulas: its bodies' frames and shapes, from a case's recorded signals and varied parameters; and the
links' frames in the world, from the numbers of a case.

The functions of the simulation are recorded once, over inputs instead of numbers, and stored as `met.trace.Formulas`; a
page (`assets/formulas.js`) and `met plot --arm` replay them. So all pictures use the same kinematics, for each case
with its own numbers, including moving bases and flying payloads.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from batch.arms.shapes import ArmNumbers, drawn, numbers, shape_of, shapes
from met.dynamics.spatial import HERE, IDENTITY, Pose, Vector, compose, rotation_quaternion, scale, settled
from met.frozen import frozen
from met.plan import BASE, Experiment, Formula, Link, Payload
from met.program.courses import TIME
from met.program.motion.base import BaseMotion, motions, prescribed
from met.program.system import PARAMETER, System
from met.trace import Formulas, Graph, Scalar

POSITION = "q"

OF_FREE_BASE = (f"links.{BASE}.position", f"links.{BASE}.orientation")
"""Signals that give the pose of a free base."""

EARLY = 1e-6
"""Share of a step by which a row's time may be rounded below its instant."""

LIMB, LIMB_OF_LINK = 0.03, 0.32
"""Radius of a limb without a size of its own: at most this share of the arm's reach, and of its middle link's
length."""

NO_REACH = 1.0
POSE_NUMBERS, SHAPE_NUMBERS = 12, 9


@frozen
class ArmBody:
    """A link, a payload or the base. carrier: number of the body that carries it, or -1"""

    name: str
    carrier: int


@frozen
class SceneShape:
    """A shape of the body with this number; for a joint, its number among those that move (otherwise -1)."""

    body: int
    kind: str
    role: str
    joint: int


@frozen
class ArmScene:
    """An arm that can be drawn.

    formulas  of each body the rows of its rotation and its origin in the world; then of each shape middle, axis and
              size (`ArmShape`), in the body's frame; last the tip in the world, whose path is drawn. Inputs are
              channels by path, `time`, varied parameters by path, and of a joint that slides the stretch that a case
              uses, `low:JOINT` and `high:JOINT`
    channels  inputs that a run must record
    joints    names of those that move
    reach     from the base to the farthest tip, m, stretched out
    limb      radius with which lines and rods are drawn, m
    up        against gravity, world axes; z where there is none
    gravity   in the world, m/s^2; None where there is none, or cases differ in it
    moves     whether the base moves: then there is no floor under it
    """

    bodies: tuple[ArmBody, ...]
    shapes: tuple[SceneShape, ...]
    formulas: Formulas
    channels: tuple[str, ...]
    joints: tuple[str, ...]
    reach: float
    limb: float
    up: tuple[float, float, float]
    gravity: tuple[float, float, float] | None
    moves: bool


def arm_scene(experiment: Experiment, recorded: Sequence[str]) -> ArmScene:
    """The scene of an experiment. recorded: existing channels; payloads that fly for a time are drawn only where their
    position and orientation are among them"""
    structure = experiment.structure
    graph = Graph()
    varied = {coordinate.path: graph.input(coordinate.path) for coordinate in experiment.cases.coordinates}
    values = {path: settled(value) for path, value in parameters(experiment, varied).items()}
    first = parameters(
        experiment, {coordinate.path: coordinate.values[0] for coordinate in experiment.cases.coordinates}
    )
    joints = structure.moving
    channels = [f"{joint.name}.{POSITION}" for joint in joints]
    q = [graph.input(channel) for channel in channels]
    base = HERE
    if structure.free:
        base = _recorded_pose(graph, *OF_FREE_BASE)
        channels += [*_channels(OF_FREE_BASE[0], "xyz"), *_channels(OF_FREE_BASE[1], "wxyz")]
    elif structure.base is not None:
        memory = {PARAMETER + path: value for path, value in values.items()}
        base = prescribed(System(experiment), memory.__getitem__, graph.input(TIME)).pose
    world: dict[str, Pose] = {BASE: base, **world_poses(experiment, values, q, base)}
    carriers = {joint.child: joint.parent for joint in structure.joints}
    payloads = []
    for payload in structure.payloads:
        signals = (f"payloads.{payload.name}.position", f"payloads.{payload.name}.orientation")
        channels_of_pose = [*_channels(signals[0], "xyz"), *_channels(signals[1], "wxyz")]
        if payload.flies and set(channels_of_pose) <= set(recorded):
            world[payload.name] = _recorded_pose(graph, *signals)
            channels += channels_of_pose
        elif payload.flies:
            continue
        else:
            carriers[payload.name] = payload.link
        payloads.append(payload)
    travel = {
        joint.name: (graph.input(f"low:{joint.name}"), graph.input(f"high:{joint.name}"))
        for joint in joints
        if joint.kind == "prismatic"
    }
    bodies: list[Link | Payload] = [*structure.links, *payloads]
    lengths = _lengths(experiment, first)
    reach = max([*lengths.values(), 0.0])
    reach = reach if 0.0 < reach < math.inf else NO_REACH
    arm = ArmNumbers(experiment, values, varied, first, travel, reach)
    shapes_of = shapes(arm, bodies)
    names = list(dict.fromkeys([BASE, *(body.name for body in bodies)]))
    number = {name: place for place, name in enumerate(names)}
    moving = {joint.name: place for place, joint in enumerate(joints)}
    listed = [(number[name], shape) for name, several in shapes_of.items() for shape in several]
    outputs: list[Any] = [x for name in names for x in (*(e for row in world[name].R for e in row), *world[name].p)]
    outputs += [x for _, shape in listed for vector in (shape.middle, shape.axis, shape.size) for x in vector]
    tip = max((body.name for body in structure.links), key=lambda name: lengths.get(name, 0.0), default=BASE)
    outputs += compose(world[tip], Pose(IDENTITY, _end(arm, tip))).p
    return ArmScene(
        tuple(ArmBody(name, number.get(carriers.get(name, ""), -1)) for name in names),
        tuple(SceneShape(b, shape.kind, shape.role, moving.get(shape.joint, -1)) for b, shape in listed),
        Formulas.of(graph, outputs),
        tuple(channels),
        tuple(joint.name for joint in joints),
        reach,
        _limb(experiment, first, reach),
        _up(experiment, first),
        _gravity(experiment, first, varied),
        structure.base is not None,
    )


def lacking(scene: ArmScene, recorded: Sequence[str]) -> tuple[str, ...]:
    """Signals, by a deck's names, that are needed to draw the scene and are not recorded."""
    missing = set(scene.channels) - set(recorded)
    joints = [name for name in scene.joints if f"{name}.{POSITION}" in missing]
    every = [POSITION] if joints and len(joints) == len(scene.joints) else [f"{name}.{POSITION}" for name in joints]
    return (*every, *(name for name in OF_FREE_BASE if any(channel.startswith(f"{name}.") for channel in missing)))


def scene_json(scene: ArmScene) -> dict[str, Any]:
    """The scene as a page's script takes it."""
    return {
        "bodies": [[body.name, body.carrier] for body in scene.bodies],
        "shapes": [[shape.body, shape.kind, shape.role, shape.joint] for shape in scene.shapes],
        "nodes": [list(node) for node in scene.formulas.nodes],
        "outputs": list(scene.formulas.outputs),
        "channels": list(scene.channels),
        "joints": list(scene.joints),
        "reach": scene.reach,
        "limb": scene.limb,
        "up": list(scene.up),
        "gravity": None if scene.gravity is None else list(scene.gravity),
        "moves": scene.moves,
    }


def _channels(name: str, parts: str) -> list[str]:
    return [f"{name}.{part}" for part in parts]


def _recorded_pose(graph: Graph, position: str, orientation: str) -> Pose:
    """The frame in the world that two signals give."""
    x, y, z = (graph.input(name) for name in _channels(position, "xyz"))
    turn = [graph.input(name) for name in _channels(orientation, "wxyz")]
    return Pose(rotation_quaternion(turn[0], turn[1], turn[2], turn[3]), (x, y, z))


# Sizes, by the numbers of the first case


def _lengths(experiment: Experiment, first: Mapping[str, float]) -> dict[str, float]:
    """By link, the distance from the base to its far end, along the links that carry it, m."""
    carrier = {joint.child: joint for joint in experiment.structure.joints}
    out: dict[str, float] = {}
    for link in experiment.structure.links:
        far, name = _size(experiment, first, link.name), link.name
        while name in carrier:
            joint = carrier[name]
            far += math.hypot(*(first.get(f"{joint.name}.at.{part}", 0.0) for part in "xyz"))
            if joint.kind == "prismatic":
                ends = (first.get(f"{joint.name}.{end}", 0.0) for end in ("q_min", "q_max"))
                far += max(abs(end) for end in ends)
            name = joint.parent
        out[link.name] = far
    return out


def _size(experiment: Experiment, first: Mapping[str, float], name: str) -> float:
    """The distance from a link's origin to its far end, m."""
    end = _end(ArmNumbers(experiment, first, {}, first, {}, NO_REACH), name)
    return math.hypot(*(float(x) for x in end))


def _end(arm: ArmNumbers, name: str) -> Vector:
    """A link's far end in its frame, m: of its shape; else of the last joint that it carries, or its centre of mass."""
    structure = arm.experiment.structure
    link = next((link for link in structure.links if link.name == name), None)
    carried = [joint for joint in structure.joints if joint.parent == name]
    if link is not None and drawn(link) and link.shape is not None:
        kind, sizes = shape_of(arm, link)
        along = int(dict(link.shape[1]).get("along", 0.0))
        far = {"sphere": 0.0, "box": sizes.get(f"size_{'xyz'[along]}", 0.0)}.get(kind, sizes.get("length", 0.0))
        return (far * float(along == 0), far * float(along == 1), far * float(along == 2))
    if link is not None and link.root:
        return scale(2.0, numbers(arm.values, f"links.{name}.com"))
    return numbers(arm.values, f"{carried[-1].name}.at" if carried else f"links.{name}.com")


def _limb(experiment: Experiment, first: Mapping[str, float], reach: float) -> float:
    """The thickness of drawn links, m, by the arm's reach and the middle one of its links' lengths."""
    ways = [_size(experiment, first, link.name) for link in experiment.structure.links]
    lengths = sorted(way for way in ways if way > 1e-6 * reach)
    middle = lengths[len(lengths) // 2] if lengths else reach
    return min(LIMB * reach, LIMB_OF_LINK * middle)


def _gravity(
    experiment: Experiment, first: Mapping[str, float], varied: Collection[str]
) -> tuple[float, float, float] | None:
    """The gravity in the world, m/s^2; None where there is none, or cases differ in it."""
    for use in experiment.structure.environment:
        if use.model == "gravity":
            path = f"environment.{use.name}.g"
            x, y, z = (float(first.get(f"{path}.{part}", 0.0)) for part in "xyz")
            return None if any(path_.startswith(path) for path_ in varied) or x == y == z == 0.0 else (x, y, z)
    return None


def _up(experiment: Experiment, first: Mapping[str, float]) -> tuple[float, float, float]:
    """The direction against gravity, along the nearest axis of the world; z where there is none."""
    for use in experiment.structure.environment:
        if use.model == "gravity":
            g = [first.get(f"environment.{use.name}.g.{part}", 0.0) for part in "xyz"]
            most = max(range(3), key=lambda axis: abs(g[axis]))
            if g[most] != 0.0:
                x, y, z = (-math.copysign(1.0, g[most]) if axis == most else 0.0 for axis in range(3))
                return (x, y, z)
    return (0.0, 0.0, 1.0)


# Poses of the links in the world, from the numbers of a case: at all its rows at once, or traced


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
    instant: Any = np.floor(time / step + EARLY) * step
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
