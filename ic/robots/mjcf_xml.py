"""The part of an MJCF file that MuJoCo is given to compile: bodies, joints, mass, actuators, couplings and keyframes.

The rest is counted by name, so that none of it is dropped in silence. MuJoCo gets a text of its own, one element a
line, with the contents of included files in their place and without names of files, so that it opens none. Meshes are
read here, and only where a body's mass comes from them. Files are those of the model's folder and of folders within it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from itertools import compress
from pathlib import Path
from xml.sax.saxutils import quoteattr

from ic.robots.attributes import printable
from ic.robots.xml import Element, parse
from ic.text.files import Files, FoundFile
from ic.text.limits import MOST_MESH_BYTES, MOST_URDF_BYTES
from met.diagnostic import Problem, did_you_mean, error

KIND = "MJCF file"
PLACED = "class name childclass pos quat axisangle xyaxes zaxis euler"
DRIVE = (
    "name class joint jointinparent gear ctrlrange ctrllimited forcerange forcelimited kp kv dampratio inheritrange "
    "gaintype biastype dyntype gainprm biasprm timeconst dynprm"
)

READ = {
    "body": PLACED,
    "frame": PLACED,
    "inertial": "mass pos diaginertia fullinertia quat axisangle xyaxes zaxis euler",
    "joint": "name class type pos axis range limited armature damping frictionloss stiffness springref springdamper "
    "ref actuatorfrcrange actuatorfrclimited joint1 joint2 polycoef active",
    "freejoint": "name",
    "option": "gravity",
    "flag": "gravity",
    "key": "name qpos ctrl time",
    **dict.fromkeys(("general", "motor", "position", "velocity"), DRIVE),
}
"""What the deck has of each element, by attributes; others are given to MuJoCo too, and counted as not read."""
COUNTED = {
    "size", "statistic", "visual", "custom", "sensor", "contact", "tendon", "deformable", "extension", "site",
    "camera", "light", "plugin", "texture", "material", "hfield", "skin", "model", "connect", "weld", "flex",
    "flexvert", "flexstrain", "pair", "equality", "lengthrange", "intvelocity",
    "damper", "cylinder", "muscle", "adhesion", "dcmotor",
}  # fmt: skip
"""Elements that are counted and not given to MuJoCo, wherever they stand."""
GROUPS = ("custom", "sensor", "contact", "tendon", "deformable", "extension")
"""Those of them of which the contents are counted."""
BODIES = ("composite", "flexcomp", "replicate", "attach")
"""Elements that stand for bodies, which would be missing."""
WITHIN = {
    "mujoco": ("compiler", "option", "default", "asset", "worldbody", "equality", "actuator", "keyframe"),
    "option": ("flag",),
    "asset": ("mesh",),
    "worldbody": ("body", "frame", "geom"),
    "body": ("body", "frame", "geom", "joint", "freejoint", "inertial"),
    "frame": ("body", "frame", "geom", "joint", "freejoint", "inertial"),
    "equality": ("joint",),
    "actuator": ("general", "motor", "position", "velocity"),
    "keyframe": ("key",),
    "default": ("default", "joint", "geom", "mesh", "general", "motor", "position", "velocity"),
}
"""What is given to MuJoCo of the contents of an element."""
LEFT = ("meshdir", "assetdir", "texturedir", "strippath", "fusestatic", "discardvisual", "material", "xmlns")
"""Attributes that MuJoCo is not given: where files are, which bodies and shapes it may leave out, and looks."""
NAMING = ("name", "class", "childclass", "joint", "joint1", "joint2", "jointinparent", "mesh", "file", "model")
"""Attributes that are names, also where they read like numbers."""
NOT_A_NUMBER = re.compile(r"(?<!\S)[+-]?nan\b", re.IGNORECASE)
KINDS = {
    ("", "body"): "body",
    ("", "joint"): "joint",
    ("", "freejoint"): "joint",
    ("equality", "joint"): "equality",
    **{("actuator", tag): "actuator" for tag in ("general", "motor", "position", "velocity")},
}
"""Elements that are named, by those that they are in, or in any."""
TAKEN_OUT = "take it out if it is not MuJoCo's"
WRITTEN_OUT = (
    "MuJoCo writes the bodies out: `python -c 'import mujoco, sys; spec = mujoco.MjSpec.from_file(sys.argv[1]); "
    'spec.compile(); open("flat.xml", "w").write(spec.to_xml())\' FILE`'
)


def source_of(root: Element, path: str, files: Files) -> MjcfSource:
    """The part of a model that is read. path: of its file;  files: reads those that it includes. Raises Problem.

    D202: too many bytes;  D204: a file included twice;  D206: `nan`;  D208: an element that is not known, or stands for
    bodies, or settings that go by what is not read;  D215: a file that is not there, or not in the model's folder.
    """
    folder = os.path.dirname(path)
    _include(root, folder, files, {os.path.realpath(path)})
    return MjcfSource(root, folder)


def _include(element: Element, folder: str, files: Files, included: set[str]) -> None:
    """Put the contents of included files in the place of each `<include>`. included: paths, each once"""
    for i, child in reversed([*enumerate(element.children)]):
        is_include = child.tag == "include"
        if is_include:
            path = _path(child, child.attributes.get("file", ""), folder)
            if os.path.realpath(path) in included:
                what = f"`{printable(child.attributes['file'])}` is included twice"
                help = "MuJoCo includes a file once: remove one"
                raise Problem(error("D204", what, child.place_of("file"), help=help))
            included.add(os.path.realpath(path))
            child = parse(path, files.text(FoundFile(path, path), kind=KIND, most=MOST_URDF_BYTES))
        _include(child, folder, files, included)
        if is_include:  # whatever the root is called, as MuJoCo has it
            element.children[i : i + 1] = child.children


def _names(element: Element) -> set[str]:
    """The names in an element and in all that it holds."""
    return {element.attributes.get("name", "")}.union(*map(_names, element.children))


def _path(element: Element, name: str, folder: str, within: str = "") -> str:
    """The path of a file that an element names. within: a folder that the name is in. Raises Problem D215."""
    path = os.path.normpath(os.path.join(folder, within, name))
    place = element.place_of("file") if name else element.place
    if not os.path.realpath(path).startswith(os.path.join(os.path.realpath(folder), "")):
        what = f'"{printable(name)}" is not in the folder of this model'
        raise Problem(error("D215", what, place, help="no file outside of it is read: copy it there"))
    if not os.path.isfile(path):
        mesh = "or give each body that has its mass from it an `<inertial>`: then no mesh is read"
        helps = [f"looked for `{printable(path)}`", *([mesh] if element.tag == "mesh" else [])]
        raise Problem(error("D215", f'cannot find "{printable(name)}"', place, help=helps))
    return path


class MjcfSource:
    """The part of a model that MuJoCo is given, and the elements that are not read.

    lines    the elements of `text`, one a line
    named    bodies, joints, actuators and equalities, by kind and the name in `text`, which may be made here
    files    meshes that bodies have their mass from, by their names in `text`
    assets   elements of meshes, by name
    looks    elements of shapes that are meshes, by the names in `text` of the points that stand for them
    dropped  elements that are not in the deck, by tag, or an attribute of which is not, by `NAME of TAG`
    """

    def __init__(self, root: Element, folder: str) -> None:
        """root: the whole model, its includes in their places; folder: that of its file. Raises Problem"""
        self._folder, self._settings = folder, dict[str, str]()
        for compiler in root.all("compiler"):
            self._settings |= compiler.attributes
        if self._settings.get("fusestatic") == "true" and "settotalmass" in self._settings:
            what, help = "`settotalmass` with `fusestatic` is not read", "write the masses of the bodies instead"
            raise Problem(error("D208", what, root.place, help=help))  # fused bodies share in another mass
        drives = [drive for group in root.all("actuator") for drive in group.children]
        self._on_joints = [self._is_on_joint(drive) for drive in drives]
        self._names = _names(root)
        self._meshes: set[str] = set()  # that bodies have mass from
        self.assets: dict[str, Element] = {}  # meshes of files, by name
        self._scales: dict[str, str] = {}  # of meshes without a scale, by class
        for defaults in root.all("default"):
            self._add_scales(defaults, "1 1 1")
        self.lines: list[Element] = []
        self.named: dict[tuple[str, str], Element] = {}
        self.files: dict[str, bytes] = {}
        self.looks: dict[str, Element] = {}
        self.dropped: dict[str, list[Element]] = {}
        self.text = "".join(self._written(root, "", False))

    @staticmethod
    def _is_on_joint(drive: Element) -> bool:
        return drive.tag in WITHIN["actuator"] and not {"joint", "jointinparent"}.isdisjoint(drive.attributes)

    def _written(self, element: Element, parent: str, weighs: bool) -> Iterator[str]:
        """Yield the text of an element with what is read in it. weighs: whether shapes in it give a body its mass"""
        attributes = {name: text for name, text in element.attributes.items() if name not in LEFT}
        for name in attributes if element.tag in READ else ():
            if name not in READ[element.tag].split():
                self.dropped.setdefault(f"{name} of {element.tag}", []).append(element)
        for name, text in attributes.items():
            if name not in NAMING and NOT_A_NUMBER.search(text):  # which MuJoCo takes for what is not written
                what = f"`{name}` has a number that is none"
                raise Problem(error("D206", what, element.place_of(name), help="write a number, or leave it out"))
        kind = KINDS.get((parent, element.tag)) or KINDS.get(("", element.tag))
        if kind and parent != "default":
            name = element.attributes.get("name") or f"{kind}_{len(self.lines)}"
            while not element.attributes.get("name") and name in self._names:
                name += "_"
            attributes["name"] = name
            self.named[kind, attributes["name"]] = element
        elif (parent, element.tag) == ("asset", "mesh") and "file" in attributes:
            attributes |= self._mesh(element)
        elif element.tag == "key":
            attributes = {name: attributes[name] for name in READ["key"].split() if name in attributes}
            numbers = attributes.get("ctrl", "").split()
            if numbers and len(numbers) == len(self._on_joints):  # else MuJoCo refuses them
                attributes["ctrl"] = " ".join(compress(numbers, self._on_joints))
        elif element.tag == "geom":
            self._meshes.add(attributes.get("mesh", ""))
            attributes.pop("name", None)  # nothing that is read names it
        words = "".join(f" {name}={quoteattr(text)}" for name, text in attributes.items())
        yield f"{chr(10) if self.lines else ''}<{element.tag}{words}>"
        self.lines.append(element)
        weighs = weighs or element.tag == "default"
        if element.tag == "body":
            weighs = self._settings.get("inertiafromgeom") == "true" or not any(element.all("inertial"))
        for child in sorted(element.children, key=lambda child: child.tag == "asset"):  # last, as it asks for meshes
            if child.tag == "geom" and element.tag != "default" and child.attributes.get("type", "mesh") == "mesh":
                yield from self._stand_in(child)
            if self._is_read(element, child, weighs):
                yield from self._written(child, element.tag, weighs)
            elif element.tag != "default":
                for part in child.children if child.tag in GROUPS else [child]:
                    self.dropped.setdefault(child.tag, []).append(part)
        yield f"</{element.tag}>"

    def _stand_in(self, shape: Element) -> Iterator[str]:
        """Yield the text of a point without mass where a mesh is, so that MuJoCo says where that is."""
        if "mesh" in shape.attributes:
            name = f"look {len(self.lines)}"
            words = "".join(
                f" {key}={quoteattr(text)}"
                for key, text in shape.attributes.items()
                if key in ("class", "group", *PLACED.split()[3:], "pos")
            )
            yield f'\n<geom name="{name}" type="sphere" size="1e-6" mass="0"{words}/>'
            self.lines.append(shape)
            self.looks[name] = shape

    def _add_scales(self, defaults: Element, scale: str) -> None:
        """Take the scales of meshes from a class and the classes in it. scale: of the class that it is in"""
        for mesh in defaults.all("mesh"):
            scale = mesh.attributes.get("scale", scale)
        self._scales[defaults.attributes.get("class", "main")] = scale
        for inner in defaults.all("default"):
            self._add_scales(inner, scale)

    def mesh_of(self, shape: Element) -> tuple[str, str]:
        """The name of the file of a shape's mesh from the model's folder, "" where it has none, and the scale."""
        attributes = {} if (mesh := self.assets.get(shape.attributes["mesh"])) is None else mesh.attributes
        if "file" not in attributes or not {"refpos", "refquat"}.isdisjoint(attributes):
            return "", ""
        scale = attributes.get("scale", self._scales.get(attributes.get("class", "main"), "1 1 1"))
        return os.path.normpath(os.path.join(self._mesh_folder, self._bare(attributes["file"]))), scale

    @property
    def _mesh_folder(self) -> str:
        """The folder of meshes, from the model's."""
        return self._settings.get("meshdir", self._settings.get("assetdir", ""))

    def _bare(self, name: str) -> str:
        """The name of a file as it is looked for."""
        return os.path.basename(name) if self._settings.get("strippath") == "true" else name

    def _is_read(self, element: Element, child: Element, weighs: bool) -> bool:
        """Return True if MuJoCo is given this part of an element. Raises Problem D208."""
        within = WITHIN.get(element.tag, ())
        if child.tag not in within and child.tag not in COUNTED:
            stands = [WRITTEN_OUT] if child.tag in BODIES else [*did_you_mean(child.tag, within), TAKEN_OUT]
            what = f"`<{printable(child.tag)}>` in `<{element.tag}>` is not read"
            raise Problem(error("D208", what, child.place, help=stands))
        if element.tag == "actuator":
            return self._is_on_joint(child)
        if child.tag == "geom":
            return weighs and "hfield" not in child.attributes
        if (element.tag, child.tag) == ("asset", "mesh"):
            name = child.attributes.get("name") or Path(child.attributes.get("file", "")).stem
            self.assets[name] = child
            return name in self._meshes
        return child.tag in within

    def _mesh(self, element: Element) -> dict[str, str]:
        """Name and file of a mesh, which is read. Raises Problem D202, D215."""
        name = element.attributes["file"]
        path = _path(element, self._bare(name), self._folder, self._mesh_folder)
        room = MOST_MESH_BYTES - sum(map(len, self.files.values()))
        if os.path.getsize(path) > room:
            what = f"meshes that bodies have their mass from are more than {MOST_MESH_BYTES >> 20} MiB"
            help = "give these bodies an `<inertial>`: then no mesh is read"
            raise Problem(error("D202", what, element.place, help=help))
        key = f"mesh{len(self.files)}{os.path.splitext(path)[1]}"
        with open(path, "rb") as file:
            self.files[key] = file.read(room)
        return {"name": element.attributes.get("name") or Path(name).stem, "file": key}
