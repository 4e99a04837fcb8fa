"""Subjects of `met doc` besides models: channels, Denavit-Hartenberg numbers, shapes, motors on beds, units, and the
words of values and sweeps (ic/printing/sweeps.py)."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

from ic.language import BLOCKS
from ic.meaning.control.substitution import DEFAULTS
from ic.meaning.mechanics import dh, shapes
from ic.printing.columns import columns, exactly
from ic.printing.language import block_json, print_block
from ic.printing.models import FIELDS, OF_LANGUAGE, UNIT_WORDS, default, rows, summary, unit_in_words
from ic.printing.sweeps import print_words, words_json
from met import models, units
from met.plan import channel
from met.plan.linear_uses import FIGURES

OF_ANY = (
    ("JOINT.servo.NAME", "what a servo holds, integrates and shows: `met doc` and the name of its model"),
    ("JOINT.servo.command", "what the servo was asked at its last tick, in the command's unit"),
    ("JOINT.bed.NAME, JOINT.law.NAME", "of a joint whose motor is on a bed: `met doc bed`, `met doc law`"),
    (
        "sensors.NAME, sensors.NAME.NAME",
        "what a sensor of a link reads, and its states; `sensors`: what all of them read",
    ),
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
        *(row(PAYLOAD, *each) for each in channel.OF_PAYLOAD),
        *(row("", *each) for each in channel.OF_ARM),
    ]


JOINT, LINK, PAYLOAD = "JOINT.", "links.LINK.", "payloads.PAYLOAD."
MORE_WORDS = {
    word: f"{channel.TURNING[word]}, or {channel.SLIDING[word]} of a prismatic joint"
    for word in ("inertia", "angular", "linear")
}


def print_channels() -> Iterator[str]:
    yield "What can be recorded, and watched by a metric: record = [q, JOINT.reaction, links.LINK.position, energy];"
    yield ""
    found = channels()
    rows = [("channel", "unit", "components", "meaning", "axes")]
    yield from columns(
        rows
        + [
            (each["path"], unit_in_words(each["unit"]), each["components"], each["meaning"], each["frame"])
            for each in found
        ]
    )
    yield ""
    yield from columns(list(OF_ANY))
    yield ""
    yield "Without `JOINT.` it is that of all joints that have it; with `.x`, one component of a vector."
    yield from (f"  {word}: {text}" for word, text in words_of(found))


def words_of(found: list[dict[str, str]]) -> list[tuple[str, str]]:
    """The words in the units of channels that the joint decides, and what they stand for."""
    used = {word for each in found for word in each["unit"].replace("*", "/").split("/")}
    return [(word, text) for word, text in {**UNIT_WORDS, **MORE_WORDS}.items() if word in used]


def print_dh() -> Iterator[str]:
    yield "dh: the frame of a joint by Denavit-Hartenberg numbers"
    yield from (f"  {line}".rstrip() for line in textwrap.dedent(dh.__doc__ or "").strip().splitlines())
    yield ""
    yield "In a deck: joint NAME revolute { parent = ...; child = ...; dh = classic(a = 0.4 m, alpha = 90 deg); }"
    yield ""
    yield "Numbers"
    yield from columns(
        [
            ("name", "unit", "default", "meaning"),
            *((each.name, each.unit, default(each), each.doc) for each in dh.NUMBERS),
        ]
    )


def dh_json() -> list[dict[str, Any]]:
    fields = ("name", "unit", "doc", "default")
    return [{field: getattr(each, field) for field in fields} for each in dh.NUMBERS]


def print_shapes() -> Iterator[str]:
    yield "shapes: uniform solids, which give a link its inertia and its centre of mass"
    yield from (f"  {line}".rstrip() for line in BEGIN.splitlines())
    yield ""
    yield "In a deck: link NAME { mass = 2 kg;  shape = rod(length = 1 m, along = x); }"
    for name, shape in shapes.SHAPES.items():
        yield ""
        yield name
        yield from columns(rows(shape.parameters))


BEGIN = (shapes.__doc__ or "").strip().split("\n\n", 1)[1]
"""The position of each shape in its link, in the words of the module `shapes`."""


def shapes_json() -> list[dict[str, Any]]:
    return [
        {"name": name, "parameters": [{field: getattr(p, field) for field in FIELDS} for p in shape.parameters]}
        for name, shape in shapes.SHAPES.items()
    ]


def print_substitute() -> Iterator[str]:
    yield from print_block(BLOCKS["substitute"])
    for kind, usual in DEFAULTS.items():
        yield ""
        yield f"{kind}s; {usual} unless written"
        yield from columns([(name, summary(model)) for name, model in models.available(kind).items()])
    yield ""
    yield "Parameters of a bed that are the servo's unless they are written"
    yield from columns(
        [
            (name, p.name, f"the servo's {p.of_servo}", p.doc)
            for name, model in models.available("bed").items()
            for p in model.parameters
            if p.of_servo
        ]
    )
    yield ""
    yield "`met doc emulated`, and so for every bed and law, says what it takes and what of it can be recorded."


def print_linear() -> Iterator[str]:
    yield from print_block(BLOCKS["linear"])
    yield ""
    yield "Figures, as metrics: metric NAME = FIGURE { of = LINEAR; }, or require FIGURE(LINEAR) > LIMIT;"
    yield from columns([(each.name, each.unit, each.doc) for each in FIGURES.values()])


def figures_json() -> list[dict[str, Any]]:
    """The block's entries, then the figures."""
    return [
        *block_json(BLOCKS["linear"]),
        *({"figure": each.name, "unit": each.unit, "doc": each.doc} for each in FIGURES.values()),
    ]


def unit_table() -> list[dict[str, Any]]:
    """Every unit: its name, its word, and what one of it is in SI."""
    return [
        {"name": name, "word": unit.word, "scale": unit.measure.scale, "si": units.text(unit.measure.dimension)}
        for name, unit in units.ALL_UNITS.items()
    ]


def print_units() -> Iterator[str]:
    yield "units: those that a deck may write, behind a number, joined by * / ^ and brackets"
    yield ""
    yield from columns([("name", "word", "is"), *((each["name"], each["word"], in_si(each)) for each in unit_table())])
    yield ""
    yield "A rate of turning is no frequency: 60 rpm is 2 pi rad/s, and 1 Hz is 1/s. There are no further prefixes."


def in_si(unit: Mapping[str, Any]) -> str:
    """`0.001 m`; of a share `0.01`."""
    return f"{exactly(unit['scale'])} {unit['si']}" if unit["si"] != "1" else exactly(unit["scale"])


Subject = tuple[Callable[[], Iterator[str]], Callable[[], list[Any]]]

SUBJECTS: Mapping[str, Subject] = MappingProxyType(
    {
        "channels": (print_channels, channels),
        "designs": (partial(print_words, "designs"), partial(words_json, "designs")),
        "dh": (print_dh, dh_json),
        "distributions": (partial(print_words, "distributions"), partial(words_json, "distributions")),
        "functions": (partial(print_words, "functions"), partial(words_json, "functions")),
        "shapes": (print_shapes, shapes_json),
        "units": (print_units, unit_table),
        **{name: (partial(print_block, BLOCKS[name]), partial(block_json, BLOCKS[name])) for name in OF_LANGUAGE},
        "linear": (print_linear, figures_json),
        "substitute": (print_substitute, partial(block_json, BLOCKS["substitute"])),
    }
)
"""By the word that `met doc` takes: what it prints, and the same for programs."""
