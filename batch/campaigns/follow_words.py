"""The warning, in words, about a joint or guided point that does not follow its command (D348)."""

from __future__ import annotations

from collections.abc import Sequence

from batch.queries.signals import number_text
from met.analysis.following import Unfollowed, unfollowed
from met.analysis.step_size import chosen_cases, step_size
from met.diagnostic import Diagnostic, Label, Place
from met.passing import Memories
from met.plan import Experiment

LOOPS = frozenset({"D317", "D320", "D321", "D322"})
"""Warnings of a loop or a step because of which nothing follows: with one of these, at the check too, D348 is left
out."""


def not_followed(
    experiment: Experiment, memories: Memories, cells: Sequence[str], others_warnings: Sequence[Diagnostic]
) -> list[Diagnostic]:
    """The warning about joints and points that do not follow their commands, if there are any: the worst, with the
    others by name.

    others_warnings  what else is told of the same instants
    """
    if experiment.allows("D348") or any(diagnostic.code in LOOPS for diagnostic in others_warnings):
        return []
    unfollowed_commands = unfollowed(experiment, memories.ticks, memories.by_case, cells)
    if not unfollowed_commands:
        return []
    begun = step_size(experiment, chosen_cases(experiment))
    if begun.loops or any(fault.kind == "grows" for fault in begun.faults):
        return []
    worst, *others = unfollowed_commands
    place, what = _place(experiment, worst), "path of guide" if worst.kind == "path" else "joint"
    does = "is not followed" if worst.kind == "path" else "does not follow its command"
    at_limit = f", and `{worst.limit}` was reached for most of that time" if worst.limit else ""
    case = f" in case #{int(experiment.cases.table[worst.case])}" if experiment.cases.count > 1 else ""
    message = f"{what} `{worst.subject}` {does}{case}: it is {_off(experiment, worst)}{at_limit}"
    helps = [_remedy(experiment, worst)]
    if others:
        helps.append(f"the same of {', '.join(f'`{other.subject}`' for other in others)}")
    helps.append(f"root mean square from {worst.since:.4g} s to {worst.until:.4g} s, and it does not fall")
    return [Diagnostic("D348", message, None if place is None else Label(place), (), tuple(helps), "warning")]


def _off(experiment: Experiment, follower: Unfollowed) -> str:
    """The error in words: `1.047 rad off, of 1.047 rad that it is told to move`."""
    straight = follower.kind == "path" or any(
        joint.name == follower.subject and joint.kind == "prismatic" for joint in experiment.structure.joints
    )
    unit = ("m" if straight else "rad") + ("/s" if follower.kind == "rate" else "")
    off = f"{number_text(follower.off)} {unit} off"
    if not follower.commanded:
        return f"{off}, and is told to stay"
    does = {"position": "it is told to move", "rate": "it is told", "path": "it leads"}[follower.kind]
    return f"{off}, of {number_text(follower.commanded)} {unit} that {does}"


def _remedy(experiment: Experiment, follower: Unfollowed) -> str:
    """The remedies, in words, with which it may follow."""
    if follower.kind == "path":
        return "let the path stay where the arm reaches, and within what rates and damping leave"
    structure, beside = experiment.structure, []
    for use in structure.environment:
        about = experiment.parameters.get(f"environment.{use.name}.joint")
        if about is not None and about.value == follower.subject:
            beside.append(f"`{use.name}`")
    other = f", or take away what holds it: {', '.join(beside)}" if beside else ""
    if follower.limit:
        return f"raise `{follower.limit}`, give it less to move{other}"
    return f"look at its servo's gains, ratio and friction, and at what it has to move{other}"


def _place(experiment: Experiment, follower: Unfollowed) -> Place | None:
    """The place where the command, or the guide, is written."""
    if follower.kind == "path":
        return next(use.place for use in experiment.structure.guides if use.name == follower.subject)
    commands = (
        parameter
        for path, parameter in experiment.parameters.items()
        if path.startswith(f"{follower.subject}.servo.command.")
    )
    places = [command.origin.place for command in commands if command.origin.place is not None]
    servos = [use.place for use in experiment.structure.servos if use.joint == follower.subject]
    return (places or servos)[0]
