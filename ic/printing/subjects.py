"""What `met doc` says besides models: what can be recorded, and what Denavit-Hartenberg numbers are."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

from ic.meaning import dh
from ic.printing.columns import columns
from ic.printing.models import WORDS, default, unit_in_words
from met import channel

OF_ANY = (
    ("JOINT.servo.NAME", "what a servo holds, integrates and shows: `met doc` and the name of its model"),
    ("JOINT.servo.command", "what the servo was asked at its last tick, in the command's unit"),
    ("JOINT.bed.NAME, JOINT.law.NAME", "of a joint whose motor is on a bed: `met doc bed`, `met doc law`"),
)


def channels() -> list[dict[str, str]]:
    """Every channel that any arm has: its path, unit, components, meaning and frame."""

    def row(head: str, name: str, unit: str, doc: str, parts: tuple[str, ...], frame: str) -> dict[str, str]:
        path = f"{head}{name}" + ("" if head != LINK or not name.startswith("jacobian") else ".JOINT")
        return {"path": path, "unit": unit, "components": " ".join(parts), "meaning": doc, "frame": frame}

    axis = channel.JOINT_AXIS
    return [
        *(row(JOINT, name, unit, doc, (), axis) for name, unit, doc in channel.MOTION),
        *(row(JOINT, *each) for each in channel.OF_JOINT),
        *(row(LINK, *each) for each in channel.OF_LINK),
        *(row(LINK, name, unit, doc, channel.XYZ, channel.WORLD_AXES) for name, unit, doc in channel.JACOBIAN),
        *(row("", *each) for each in channel.OF_ARM),
    ]


JOINT, LINK = "JOINT.", "links.LINK."
MORE_WORDS = {word: f"{channel.TURNING[word]}, or {channel.SLIDING[word]} of a prismatic joint"
              for word in ("inertia", "angular", "linear")}


def print_channels() -> Iterator[str]:
    yield "What can be recorded, and watched by a metric: record = [q, JOINT.reaction, links.LINK.position, energy];"
    yield ""
    found = channels()
    rows = [("channel", "unit", "components", "meaning", "axes")]
    yield from columns(rows + [(each["path"], unit_in_words(each["unit"]), each["components"], each["meaning"],
                                each["frame"]) for each in found])
    yield ""
    yield from columns(list(OF_ANY))
    yield ""
    yield "Without `JOINT.` it is that of all joints that have it; with `.x`, one component of a vector."
    used = {word for each in found for word in each["unit"].replace("*", "/").split("/")}
    yield from (f"  {word}: {text}" for word, text in {**WORDS, **MORE_WORDS}.items() if word in used)


def print_dh() -> Iterator[str]:
    yield "dh: the frame of a joint by Denavit-Hartenberg numbers"
    yield from (f"  {line}".rstrip() for line in textwrap.dedent(dh.__doc__ or "").strip().splitlines())
    yield ""
    yield "In a deck: joint NAME revolute { parent = ...; child = ...; dh = classic(a = 0.4 m, alpha = 90 deg); }"
    yield ""
    yield "Numbers"
    yield from columns([("name", "unit", "default", "meaning"),
                        *((each.name, each.unit, default(each), each.doc) for each in dh.NUMBERS)])


def dh_json() -> list[dict[str, Any]]:
    fields = ("name", "unit", "doc", "default")
    return [{field: getattr(each, field) for field in fields} for each in dh.NUMBERS]


Subject = tuple[Callable[[], Iterator[str]], Callable[[], list[Any]]]

SUBJECTS: Mapping[str, Subject] = MappingProxyType({
    "channels": (print_channels, channels),
    "dh": (print_dh, dh_json),
})
"""By the word that `met doc` takes: what it prints, and the same for programs."""
