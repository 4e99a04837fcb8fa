"""An arm as a page draws it: its scene, what acts on it, and where a run's rows have the numbers for both."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from batch.arms.acting import ActingOnArm, acting_json, acting_on
from batch.arms.meshes import NO_MESHES, ArmMeshes, arm_meshes, meshes_json
from batch.arms.scene import ArmScene, arm_scene, lacking, scene_json
from met.frozen import frozen
from met.messages.visible import visible
from met.plan import Experiment


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
    visible_data: dict[str, Any] = visible_texts(data)
    return visible_data


def visible_texts(value: Any) -> Any:
    """The same data, with escapes in place of characters of its texts that cannot be seen."""
    if isinstance(value, str):
        return visible(value)
    if isinstance(value, dict):
        return {visible(key): visible_texts(element) for key, element in value.items()}
    return [visible_texts(element) for element in value] if isinstance(value, list) else value
