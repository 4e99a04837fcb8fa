"""A model in MuJoCo's MJCF to a `Robot`, by the numbers that MuJoCo compiles it to.

Masses, inertias, frames and axes are those of MuJoCo's model, whatever the file has them from. A joint's frame in a
deck is at its anchor, and a link's at that of its last joint. A body of several joints is a chain of massless links.
"""

from __future__ import annotations

import base64
import json
import os
import re
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ic.robots.attributes import printable
from ic.robots.entries import rpy_of
from ic.robots.mjcf_model import BALL, FREE, SLIDE
from ic.robots.mjcf_xml import MjcfSource, source_of
from ic.robots.robot import Inertial, Mimic, Numbers, Robot, RobotJoint, RobotLink, Visual, Written
from ic.robots.visuals import Unseen, beside, three
from ic.robots.xml import Element
from ic.text.files import Files
from ic.text.limits import MOST_LINKS
from met.diagnostic import Label, Place, Problem, error
from met.host import interpreter

MOST_SECONDS = 60.0  # to compile a model: published ones take 1 s with their meshes
MOST_WORDS = 300  # characters of MuJoCo's message
WORLD = "world"
MOST_NAMED = 6  # places of a fault in one message


def read(root: Element, path: str, files: Files) -> Robot:
    """The robot of a model. path: of its file;  files: reads those that it includes. Raises Problem.

    D202: too many bodies;  D209: no joint, or more than one base;  D212: a ball joint;  D269: no model of MuJoCo's.
    """
    source = source_of(root, path, files)
    model = compiled(source, root.place)
    bodies, joints, dropped = model["bodies"], model["joints"], source.dropped
    if len(bodies) > MOST_LINKS:
        what = f"a robot has at most {MOST_LINKS} links"
        raise Problem(error("D202", what, root.place, help="a robot has some ten: is this the right file?"))
    for joint in joints:
        if joint["kind"] == BALL:
            what = f"joint `{printable(joint['name'])}` is a ball, and joints are revolute, prismatic or fixed"
            hinges = (
                "in the file, write three hinges in its place, such as about x, y and z: they are a chain in the deck"
            )
            raise Problem(error("D212", what, source.named["joint", joint["name"]].place, help=hinges))
    names = [Written(WORLD, root.place), *(_written(source, "body", body["name"]) for body in bodies)]
    carriers = _carriers(root, names, model)
    base = next(carriers[joint["body"]] for joint in joints if joint["kind"] != FREE)
    used = {*(name.text for name in names), *(joint["name"] for joint in joints)}

    def new_name(name: Written, text: str) -> Written:
        """A name that the file does not have, for a part that stands for something at the place of `name`."""
        while text in used:
            text += "_"
        used.add(text)
        return Written(text, name.place)

    inertials = [None, *(_inertial(body, source) for body in bodies)]
    unseen: dict[str, list[Element]] = {}
    visuals = _visuals(model["looks"], source, os.path.dirname(path), carriers, base, unseen)
    links, arm_joints = [RobotLink(names[base], inertials[base], visuals.get(base, ()))], list[RobotJoint]()
    for number, body in enumerate(bodies, 1):
        name = names[number]
        if carriers[number] != base:
            dropped.setdefault("body", []).append(source.named["body", name.text])
        elif number != base:
            own_joints = [joint for joint in joints if joint["body"] == number]
            ends = [
                names[body["parent"]],
                *(new_name(name, f"{name.text}_on_{joint['name']}") for joint in own_joints[:-1]),
            ]
            links += [
                *(RobotLink(end, None) for end in ends[1:]),
                RobotLink(name, inertials[number], visuals.get(number, ())),
            ]
            if not own_joints:
                mount = new_name(name, f"{name.text}_mount")
                arm_joints.append(
                    RobotJoint(mount, Written("fixed", name.place), ends[0], name, *_frame(body, name.place))
                )
            for joint, parent, child in zip(own_joints, ends, [*ends[1:], name], strict=False):
                title = _written(source, "joint", joint["name"])
                arm_joints.append(_joint(joint, title, parent, child, model["key"] is not None))
    for name in model["lost"]:
        element = source.named["actuator", name]
        dropped.setdefault(element.tag, []).append(element)
    keys = [element for element in source.lines if element.tag == "key"]
    keyframe = ""
    if model["key"] is not None:
        key_name = keys.pop(model["key"]).attributes.get("name")
        keyframe = f"the keyframe `{printable(key_name)}`" if key_name else "the first keyframe"
    dropped |= {"key": keys} if keys else {}
    pose = None
    if base:
        floating = next(joint for joint in joints if joint["body"] == base)
        pose = tuple(floating["at"]), rpy_of(floating["R"])
        element = source.named["joint", floating["name"]]
        dropped |= {f"{law} of a free joint": [element] for law, value in floating["passive"].items() if value}
    mimics = dict(_mimics(model["equalities"], source, {joint.name.text for joint in arm_joints}))
    return Robot(
        path,
        root.attributes.get("model", ""),
        tuple(links),
        tuple(replace(joint, mimic=mimics.get(joint.name.text)) for joint in arm_joints),
        links[0],
        {what: tuple(elements) for what, elements in dropped.items() if elements},
        {reason: tuple(elements) for reason, elements in unseen.items()},
        gravity=tuple(model["gravity"]),
        base_pose=pose,
        keyframe=keyframe,
        format="MJCF",
    )


def _visuals(
    looks: Sequence[Mapping[str, Any]],
    source: MjcfSource,
    folder: str,
    carriers: Sequence[int],
    base: int,
    unseen: dict[str, list[Element]],
) -> dict[int, tuple[Visual, ...]]:
    """The meshes that are drawn, by body. Those that are taken leave what is dropped; of the others `unseen` has the
    elements by reason. folder: the model's"""
    taken: dict[int, tuple[Visual, ...]] = {}
    for look in looks:
        shape, body = source.looks[look["name"]], look["body"]
        name, scale = source.mesh_of(shape)
        if carriers[body] != base:
            continue
        try:
            at, rpy = tuple(look["at"]), rpy_of(look["R"])
            visual = Visual(beside(name, folder), shape.place, at, rpy, three(scale))
        except Unseen as reason:
            unseen.setdefault(str(reason), []).append(shape)
            continue
        taken[body] = (*taken.get(body, ()), visual)
        for tag, element in (("geom", shape), ("mesh", source.assets[shape.attributes["mesh"]])):
            source.dropped[tag] = [other for other in source.dropped.get(tag, ()) if other is not element]
    return taken


def compiled(source: MjcfSource, place: Place) -> dict[str, Any]:
    """The model that MuJoCo compiles, in numbers (`mjcf_model.compiled_model`). Raises Problem D269 where it compiles
    none."""
    files = {name: base64.b64encode(data).decode() for name, data in source.files.items()}
    asked = json.dumps({"xml": source.text, "files": files})
    command, variables = interpreter.command("ic.robots.mjcf_model"), interpreter.environment()
    with tempfile.TemporaryDirectory() as folder:  # where MuJoCo may write its log
        try:
            done = subprocess.run(
                command, input=asked, capture_output=True, text=True, cwd=folder, env=variables, timeout=MOST_SECONDS
            )
        except subprocess.TimeoutExpired:
            what = f"MuJoCo has not compiled this model after {MOST_SECONDS:g} s"
            raise Problem(error("D269", what, place, help="is this the right file?")) from None
    line = done.stdout.rpartition("\n{")[2]
    if done.returncode or not line:
        what = f"MuJoCo stopped while it compiled this model, with status {done.returncode}"
        raise Problem(error("D269", what, place, help="is a mesh broken? A body with an `<inertial>` needs none"))
    answer: dict[str, Any] = json.loads("{" + line)
    if "error" not in answer:
        return answer
    words = " ".join(answer["error"].split())
    if not words:
        install = "`pip install 'met-arm[mjcf]'`, or `pip install mujoco`, into the Python that runs MET"
        raise Problem(error("D269", "MJCF is read by MuJoCo, which is not here", place, help=install))
    line_number = re.search(r",? line (\d+)(, column \d+)?", words)
    if line_number is not None and 0 < int(line_number[1]) <= len(source.lines):
        place, words = source.lines[int(line_number[1]) - 1].place, words.replace(line_number[0], "", 1)
    what = f"MuJoCo makes no model of this: {words[:MOST_WORDS]}"
    raise Problem(error("D269", what, place, help="correct the file, or take out what the arm does not need"))


def _written(source: MjcfSource, kind: str, name: str) -> Written:
    """A name with its place, which is its element's where the file gives it none."""
    element = source.named[kind, name]
    return Written(name, element.place_of("name") if element.attributes.get("name") else element.place)


def _carriers(root: Element, names: Sequence[Written], model: Mapping[str, Any]) -> list[int]:
    """The number of the floating body that carries each body, or 0, the world, [body]. Raises Problem D209 where not
    one of them carries all joints."""
    free = [joint["body"] for joint in model["joints"] if joint["kind"] == FREE]
    carriers = [0]
    for number, body in enumerate(model["bodies"], 1):
        carriers.append(number if number in free else carriers[body["parent"]])
    bases = sorted({carriers[joint["body"]] for joint in model["joints"] if joint["kind"] != FREE})
    if not bases:
        help = "an arm has a joint at least, a hinge or a slide"
        raise Problem(error("D209", "this model has no joints", root.place, help=help))
    if len(bases) > 1:
        also = [Label(names[body].place, printable(names[body].text)) for body in bases[:MOST_NAMED]]
        what, help = f"this model is {len(bases)} arms that move apart", "take all but one out of the file"
        raise Problem(error("D209", what, root.place, also=also, help=help))
    return carriers


def _inertial(body: Mapping[str, Any], source: MjcfSource) -> Inertial | None:
    place = source.named["body", body["name"]].place
    mass, com, moments = (Numbers(tuple(values), place) for values in ([body["mass"]], body["com"], body["moments"]))
    return None if mass.nothing else Inertial(mass, com, None, moments, place)


def _frame(part: Mapping[str, Any], place: Place) -> tuple[Numbers, Numbers]:
    return Numbers(tuple(part["at"]), place), Numbers(rpy_of(part["R"]), place)


def _joint(joint: Mapping[str, Any], name: Written, parent: Written, child: Written, has_key: bool) -> RobotJoint:
    """The joint of an arm from one of MuJoCo's model (`mjcf_model.compiled_model`), SI. has_key: whether a keyframe
    gives all positions at the start, so that one of 0 counts too"""
    place, ends = name.place, joint["range"] or ()
    limits = {end: Numbers((value,), place) for end, value in zip(("lower", "upper"), ends, strict=False)}
    limits |= {"effort": Numbers((joint["effort"],), place)} if joint["effort"] else {}
    kind = "prismatic" if joint["kind"] == SLIDE else "revolute" if ends else "continuous"
    return RobotJoint(
        name,
        Written(kind, place),
        parent,
        child,
        *_frame(joint, place),
        axis=Numbers(tuple(joint["axis"]), place),
        limits=limits,
        limits_at=place if limits else None,
        friction=joint["passive"],
        friction_at=place if any(joint["passive"].values()) else None,
        drive=joint["drive"] or {},
        start=joint["start"] if has_key or joint["start"] else None,
    )


def _mimics(equalities: Sequence[Any], source: MjcfSource, joints: set[str]) -> Iterator[tuple[str, Mimic]]:
    """The joints that follow others, by name. Equalities that are no such thing are counted."""
    leaders: dict[str, str] = {}
    for name, law in equalities:
        follower, leader, ratio, offset = law or ("", "", 1.0, 0.0)
        if follower in leaders:  # so let the other one follow
            follower, leader, ratio, offset = leader, follower, 1.0 / ratio, -offset / ratio
        chain = [leader]
        while chain[-1] in leaders:
            chain.append(leaders[chain[-1]])
        element = source.named["equality", name]
        if law is None or follower in leaders or follower in chain or not {follower, leader} <= joints:
            source.dropped.setdefault("equality", []).append(element)
            continue
        leaders[follower] = leader
        yield follower, Mimic(Written(leader, element.place), ratio, offset + 0.0)
