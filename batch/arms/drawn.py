"""An arm as a page draws it: its scene, the loads on it, and where a run's rows have the numbers for both.

The environment models are asked as the simulation asks them (`met.program.motion.base`), once, over inputs instead of
numbers; a page (`assets/acting.js`) replays the formulas at each instant that it shows. Every ghost replays the scene's
formulas, so these are separate. Gravitation is left out: it acts on every part of the arm, so no arrow can show it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from batch.arms.meshes import NO_MESHES, ArmMeshes, arm_meshes, meshes_json
from batch.arms.scene import EARLY, OF_FREE_BASE, POSITION, ArmScene, arm_scene, lacking, parameters, scene_json
from batch.arms.shapes import numbers
from met.dynamics.kinematics import LinkMotion
from met.dynamics.spatial import Pose, is_zero, rotation_quaternion, settled, turn_vector_back
from met.environments.environment import Environment, Jet, Loads
from met.frozen import frozen
from met.integrators.integrator import Motion
from met.messages.visible import visible
from met.plan import BASE, INSTANT, Experiment, Joint, Payload
from met.program.cells import answer
from met.program.courses import TIME
from met.program.motion.base import ArmWorld, BaseMotion, environment_values, prescribed
from met.program.system import PARAMETER, ReadCell, System
from met.trace import Formulas, Graph, Real, both, floor, where
from met.vectors import Vector, scale

RATE = "qd"
MOST_NODES = 20_000
"""Largest number of operations and entries of tables in the formulas of all models: a page holds them, some 25 bytes
each."""

Kind = Literal["load", "contact", "plume"]


@frozen
class ActingArrow:
    """An arrow of a load. name: the deck's for the model; unit: N for a force, N*m for a moment"""

    kind: Kind
    name: str
    unit: Literal["N", "N*m"]


@frozen
class PayloadInHand:
    """A payload that flies for a time; link: the one that carries it at other times; body: its number in the scene, or
    -1."""

    name: str
    link: str
    body: int


@frozen
class NotDrawn:
    """A load or a payload that could not be drawn, by name, and the signals that the run would have to record; no
    signals where the load has too many formulas."""

    what: Literal["load", "payload"]
    name: str
    signals: tuple[str, ...] = ()


@frozen
class ActingOnArm:
    """The loads on an arm, with their gas jets and payloads.

    formulas  of each arrow the point where it acts and its components (N, N m); of each jet the nozzle, its direction,
              the share of the step in which it fires, its exponent, and middle and sides of the plate that it meets
              (`met.environments.environment.Jet`); of each payload its stage (0 it flies and waits, 1 its link carries
              it, 2 it is released) and the place where its link holds it. All in the world, m. Inputs are channels by
              path, `time` and varied parameters by path
    channels  inputs that the run records
    jets      the deck's names of their models
    """

    formulas: Formulas
    channels: tuple[str, ...]
    arrows: tuple[ActingArrow, ...]
    jets: tuple[str, ...]
    payloads: tuple[PayloadInHand, ...]
    not_drawn: tuple[NotDrawn, ...]


class RecordedWorld(ArmWorld):
    """The world of environment models, made from a run's recorded signals; payloads in flight too."""

    def __init__(self, system: System, graph: Graph, time: Real, read: ReadCell) -> None:
        def three(name: str) -> Vector:
            x, y, z = (graph.input(f"{name}.{axis}") for axis in "xyz")
            return x, y, z

        def moving(position: str, orientation: str, velocity: str, rate: str) -> LinkMotion:
            w, x, y, z = (graph.input(f"{orientation}.{part}") for part in "wxyz")
            R = rotation_quaternion(w, x, y, z)
            v, w_own = (turn_vector_back(R, three(name)) for name in (velocity, rate))
            return LinkMotion(Pose(R, three(position)), w_own, v)

        base = BaseMotion()
        if system.structure.free:
            base_motion = moving(*OF_FREE_BASE, f"links.{BASE}.velocity", f"links.{BASE}.rate")
            base = BaseMotion(base_motion.pose, base_motion.w, base_motion.v)
        elif system.structure.base is not None:
            base = prescribed(system, read, time)
        q, qd = (
            tuple(graph.input(f"{joint.name}.{quantity}") for joint in system.joints) for quantity in (POSITION, RATE)
        )
        super().__init__(system, read, system.tree(read), Motion(q, qd), base, time, time)
        heads = {payload.name: f"payloads.{payload.name}" for payload in system.flying}
        self._in_flight = {
            name: moving(f"{head}.position", f"{head}.orientation", f"{head}.velocity", f"{head}.rate")
            for name, head in heads.items()
        }

    def link(self, link: str) -> LinkMotion:
        return self._in_flight[link] if link in self._in_flight else super().link(link)


def acting_on(experiment: Experiment, scene: ArmScene, recorded: Collection[str]) -> ActingOnArm:
    """The loads on the arm of a scene. recorded: existing channels; loads that need others are listed in `not_drawn`"""
    system, graph = System(experiment), Graph()
    varied = {coordinate.path: graph.input(coordinate.path) for coordinate in experiment.cases.coordinates}
    values = {path: settled(value) for path, value in parameters(experiment, varied).items()}
    memory: dict[str, Any] = {PARAMETER + path: value for path, value in values.items()}
    system.keep_tree(memory.__getitem__, memory.__setitem__)
    step = system.structure.schedule.step
    time = floor(graph.input(TIME) / step + EARLY) * step
    world = RecordedWorld(system, graph, time, memory.__getitem__)
    known = {TIME, *varied, *recorded}
    joints = {joint.name: joint for joint in system.joints}

    arrows: list[tuple[ActingArrow, list[Real]]] = []
    jets: list[tuple[str, list[Real]]] = []
    not_drawn: list[NotDrawn] = []
    nodes = 0
    for name, model in system.environment:
        if model.loads is None or model.free_fall is not None:
            continue
        owner, p = environment_values(system, name, model, memory.__getitem__)
        loads = answer(owner, model.loads, p, world)
        own = [(ActingArrow(_kind(model), name, unit), x) for unit, x in _arrows(loads, world, joints, values)]
        gas = [] if model.jet is None else [(name, _jet(answer(owner, model.jet, p, world), world))]
        gas_formulas = Formulas.of(graph, [x for _, values_of in (*own, *gas) for x in values_of])
        if missing := set(gas_formulas.inputs) - known:
            not_drawn.append(NotDrawn("load", name, _signals(missing, system.joints)))
        elif nodes + (more := _size(gas_formulas)) > MOST_NODES:
            not_drawn.append(NotDrawn("load", name))
        else:
            nodes += more
            arrows += own
            jets += gas

    number = {body.name: place for place, body in enumerate(scene.bodies)}
    payloads: list[tuple[PayloadInHand, list[Real]]] = []
    for payload in system.flying:
        held = world.position(payload.link, numbers(values, f"payloads.{payload.name}.at"))
        stage = _stage(payload, graph.input(TIME), values, INSTANT * step)
        payloads.append((PayloadInHand(payload.name, payload.link, number.get(payload.name, -1)), [stage, *held]))
        if payload.name not in number:
            signals = (f"payloads.{payload.name}.position", f"payloads.{payload.name}.orientation")
            not_drawn.append(NotDrawn("payload", payload.name, signals))

    outputs = [x for group in (arrows, jets, payloads) for _, values_of in group for x in values_of]
    formulas = Formulas.of(graph, outputs)
    return ActingOnArm(
        formulas=formulas,
        channels=tuple(name for name in formulas.inputs if name != TIME and name not in varied),
        arrows=tuple(arrow for arrow, _ in arrows),
        jets=tuple(name for name, _ in jets),
        payloads=tuple(payload for payload, _ in payloads),
        not_drawn=tuple(not_drawn),
    )


def acting_json(acting: ActingOnArm) -> dict[str, Any]:
    """The loads as a page's script takes them."""
    return {
        "nodes": [list(node) for node in acting.formulas.nodes],
        "outputs": list(acting.formulas.outputs),
        "channels": list(acting.channels),
        "arrows": [[arrow.kind, arrow.name, arrow.unit] for arrow in acting.arrows],
        "jets": list(acting.jets),
        "payloads": [[payload.name, payload.link, payload.body] for payload in acting.payloads],
        "notDrawn": [[lacking.what, lacking.name, list(lacking.signals)] for lacking in acting.not_drawn],
    }


def _kind(model: Environment) -> Kind:
    """The kind of a model's loads: "contact" for a model with a spring that touches (`Environment.springs`)."""
    if model.jet is not None:
        return "plume"
    return "contact" if model.springs else "load"


def _arrows(
    loads: Loads, world: ArmWorld, joints: Mapping[str, Joint], values: Mapping[str, Any]
) -> Iterable[tuple[Literal["N", "N*m"], list[Real]]]:
    """Unit, and point and components in the world, of each load that is not always zero. A torque on a joint acts on
    the link that the joint moves, along the joint's axis."""
    for force in loads.forces:
        if world.is_ground(force.link):
            continue
        point = world.position(force.link, force.point)
        if not all(map(is_zero, force.force)):
            yield "N", [*point, *force.force]
        if not all(map(is_zero, force.moment)):
            yield "N*m", [*point, *force.moment]
    for name, torque in loads.torques.items():
        joint = joints[name]
        axis, pivot = (numbers(values, f"{name}.{part}") for part in ("axis", "pivot"))
        along = scale(torque, world.to_world(joint.child, axis))
        if not all(map(is_zero, along)):
            yield "N" if joint.kind == "prismatic" else "N*m", [*world.position(joint.child, pivot), *along]


def _jet(jet: Jet, world: ArmWorld) -> list[Real]:
    """The numbers by which a page draws a jet: point and axis in the world, its strength, and the plate."""
    point, axis = world.position(jet.link, jet.point), world.to_world(jet.link, jet.axis)
    sides = [world.to_world(jet.plate.link, side) for side in (jet.plate.width, jet.plate.height)]
    middle = world.position(jet.plate.link, jet.plate.middle)
    return [*point, *axis, jet.fires, jet.exponent, *middle, *(x for side in sides for x in side)]


def _stage(payload: Payload, time: Real, values: Mapping[str, Any], early: float) -> Real:
    """The stage of a payload at a time, as in `met.program.grapple`: grappled, then released."""
    head = f"payloads.{payload.name}"
    held = time >= values[f"{head}.grapple"] - early if payload.grappled else True
    gone = both(held, time >= values[f"{head}.release"] - early) if payload.released else False
    return where(gone, 2.0, where(held, 1.0, 0.0))


def _size(formulas: Formulas) -> int:
    """The number of operations and entries of tables in formulas."""
    return sum(len(node[2]) if node[0] == "gather" else 1 for node in formulas.nodes)


def _signals(missing: Collection[str], joints: Sequence[Joint]) -> tuple[str, ...]:
    """Signals that contain these channels, by their names in a deck's record."""
    of_joints = {f"{joint.name}.{quantity}": quantity for joint in joints for quantity in (POSITION, RATE)}
    return tuple(sorted({of_joints.get(name, name.rpartition(".")[0]) for name in missing}))


@frozen
class DrawnArm:
    """An arm, or why it is not drawn.

    recorded  channels of the run, in the order of the columns of its rows
    scene     None where the run does not record the signals that it is `lacking`
    acting    None where nothing acts on the arm
    meshes    those of its links that are drawn;  none where they are left out
    """

    recorded: tuple[str, ...]
    scene: ArmScene | None
    acting: ActingOnArm | None
    lacking: tuple[str, ...]
    meshes: ArmMeshes = NO_MESHES


def drawn_arm(experiment: Experiment, recorded: Sequence[str], folder: Path | None) -> DrawnArm:
    """The arm of an experiment whose rows have these channels. folder: of its archive, where files of meshes are looked
    for too; None to leave meshes out"""
    scene = arm_scene(experiment, recorded)
    if missing := lacking(scene, recorded):
        return DrawnArm(tuple(recorded), None, None, missing)
    acting = acting_on(experiment, scene, recorded)
    meshes = NO_MESHES if folder is None else arm_meshes(experiment.structure, folder)
    is_shown = acting.arrows or acting.payloads or acting.not_drawn
    return DrawnArm(tuple(recorded), scene, acting if is_shown else None, (), meshes)


def drawn_json(arm: DrawnArm) -> dict[str, Any]:
    """The arm as a page's script takes it. Characters that cannot be seen are escapes there.

    columns    of the run's rows, in the order of the scene's channels; in `acting` in the order of its own
    reactions  body, and the columns of x, y and z, of each joint whose force on its link is recorded
    """
    if arm.scene is None:
        return {"lacking": [visible(name) for name in arm.lacking]}
    places = {channel: place for place, channel in enumerate(arm.recorded)}

    def columns(channels: Sequence[str]) -> list[int]:
        return [places[channel] for channel in channels]

    bodies = {shape.joint: shape.body for shape in reversed(arm.scene.shapes) if shape.role == "joint"}
    forces = []
    for number, joint in enumerate(arm.scene.joints):
        channels = [f"{joint}.reaction.force.{axis}" for axis in "xyz"]
        if number in bodies and all(channel in places for channel in channels):
            forces.append([bodies[number], *columns(channels)])
    data: dict[str, Any] = {
        "scene": scene_json(arm.scene),
        "columns": columns(arm.scene.channels),
        "reactions": forces,
    }
    if arm.meshes.words:
        data["scene"]["meshes"] = meshes_json(arm.meshes, [body.name for body in arm.scene.bodies])
        data["meshes"] = arm.meshes.words
    if arm.acting is not None:
        data["acting"] = acting_json(arm.acting) | {"columns": columns(arm.acting.channels)}
    return visible_texts(data)


def visible_texts(value: Any) -> Any:
    """The same data, with escapes in place of characters of its texts that cannot be seen."""
    if isinstance(value, str):
        return visible(value)
    if isinstance(value, dict):
        return {visible(key): visible_texts(element) for key, element in value.items()}
    return [visible_texts(element) for element in value] if isinstance(value, list) else value
