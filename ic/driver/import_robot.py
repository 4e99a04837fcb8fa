"""`met import`: a URDF or MJCF file to the text of a deck. A robot that no arm can be made of is refused, with
every reason.
"""

from __future__ import annotations

import os
from dataclasses import replace

from ic.grammar.syntax import Deck, Group, Word
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.mechanics.arm import check_arm
from ic.meaning.parameters.scope import Scope
from ic.read import in_order
from ic.robots.deck import arm_name, print_deck, remarks
from ic.robots.entries import ArmEntries, arm_entries
from ic.robots.files import load
from ic.robots.following import Treatment, without_mimics
from ic.robots.mjcf import read as read_mjcf
from ic.robots.robot import RobotLink
from ic.robots.xml import MJCF, parse
from ic.text.complaints import Complaints
from ic.text.files import Files, FoundFile
from ic.text.limits import MOST_URDF_BYTES
from met.diagnostic import Diagnostic, Problem


def import_robot(path: str, mimic: Treatment = "follow") -> str:
    """The text of the deck. mimic: treatment of joints that follow others. Raises Problem, with the file's text."""
    return import_with_remarks(path, mimic)[0]


def import_with_remarks(path: str, mimic: Treatment = "follow", beside: str | None = None) -> tuple[str, list[str]]:
    """The text of the deck, and lines about what is not in it or doubtful. mimic: treatment of joints that follow
    others; beside: the file that the deck will be, None where it is one in the current folder. Raises Problem, with the
    file's text."""
    files = Files()
    try:
        arm = _load(FoundFile(path, os.path.normpath(path)), files)
        if mimic != "follow":
            arm = arm_entries(without_mimics(arm.robot, mimic))
        arm = _checked(arm)
        arm = _meshes_from(os.path.dirname(beside or ""), arm)
    except Problem as problem:
        sources = tuple(files.read_so_far.values())
        raise Problem(
            in_order(problem.diagnostics, sources), {source.name: source.text for source in sources}
        ) from None
    source, *included = files.read_so_far.values()
    option = f" --mimic {mimic}" if mimic != "follow" else ""
    name = os.path.basename(path)
    title = f"made by `met import {name}{option}` from a file with the SHA-256 {source.sha256[:16]}..."
    title += f", which includes {len(included)} more" if included else ""
    lines = print_deck(arm, title)
    return "\n".join(lines) + "\n", list(remarks(arm))


def _meshes_from(folder: str, arm: ArmEntries) -> ArmEntries:
    """The entries with paths of meshes from another folder than that of the robot's file."""
    robot, home = arm.robot, os.path.dirname(arm.robot.file)
    if os.path.abspath(folder) == os.path.abspath(home) or not any(link.visuals for link in robot.links):
        return arm

    def moved(link: RobotLink) -> RobotLink:
        paths = (os.path.relpath(os.path.join(home, visual.path), folder or ".") for visual in link.visuals)
        visuals = (replace(visual, path=path) for visual, path in zip(link.visuals, paths, strict=True))
        return replace(link, visuals=tuple(visuals))

    links = tuple(map(moved, robot.links))
    other = arm_entries(replace(robot, links=links, root=links[robot.links.index(robot.root)]))
    return replace(other, base=None, no_body=arm.no_body) if arm.base is None else other


def _load(file: FoundFile, files: Files) -> ArmEntries:
    """The robot of a file, in either format. Raises Problem."""
    text = files.text(file, kind="file of a robot", most=MOST_URDF_BYTES)
    root = parse(file.name, text)
    return arm_entries(read_mjcf(root, file.name, files)) if root.tag in MJCF else load(file.name, text)


def _checked(arm: ArmEntries) -> ArmEntries:
    """The entries, without the base if only this is of no body: it does not count while the base is fixed. Raises
    Problem where they do not make an arm."""
    try:
        _check(arm)
    except Problem as problem:
        if arm.base is None:
            raise
        first = problem.diagnostics[0]
        why = first.at.text if first.at is not None and first.at.text else first.message
        arm = replace(arm, base=None, no_body=why)
        _check(arm)
    return arm


def _check(arm: ArmEntries) -> None:
    """Raise Problem where these entries do not make an arm."""
    place = arm.robot.root.name.place
    words = (Word("arm", place), Word(arm_name(arm), place))
    complaints = Complaints()
    entries = (*([arm.base.entry] if arm.base is not None else []), *arm.entries)
    definitions = Definitions(Deck(arm.robot.file, (Group(words, None, None, entries, place),), ()), complaints)
    if arm.robot.format == "URDF":  # which a deck may name
        definitions.robot_files.take(arm)
    for definition in definitions.of_kind("arm").values():
        check_arm(Scope(definitions, complaints), definition)
    if complaints.errors:
        raise Problem(_mended(complaints.errors, arm.robot.format))


def _mended(diagnostics: tuple[Diagnostic, ...], format: str) -> list[Diagnostic]:
    """The errors with the remedies of `met import` in place of those for a deck."""
    follow = (
        "`--mimic free` lets such joints move by themselves, `--mimic fixed` holds them where they are at the start"
    )
    mended = [
        replace(diagnostic, help=(follow,)) if diagnostic.code == "D213" else diagnostic for diagnostic in diagnostics
    ]
    if mended[-1].code != "D213" and format == "URDF":
        other = 'write a deck with `arm NAME from urdf("FILE") { ... }`: its block can change what the file says'
        mended[-1] = replace(mended[-1], help=(*mended[-1].help, other))
    return mended
