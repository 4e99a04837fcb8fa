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
from ic.printing.columns import columns
from ic.printing.language import block_json, print_block
from ic.printing.models import FIELDS, OF_LANGUAGE, UNIT_WORDS, default, rows, summary, unit_in_words
from ic.printing.sweeps import print_words, words_json
from ic.printing.wrapping import described, paragraphs, terminal_width
from met import models, units
from met.plan import channel
from met.plan.linear_uses import FIGURES
from met.units import ONE

OF_ANY = (
    (
        "JOINT.servo.NAME",
        "an output, state or signal of the joint's servo; `met doc` and the name of its model lists them",
    ),
    ("JOINT.servo.command", "setpoint of the servo at its last tick, in the unit of the command"),
    (
        "JOINT.bed.NAME, JOINT.law.NAME",
        "values of the motor bed of a joint and of the law of its load motor: `met doc beds`, `met doc laws`",
    ),
    (
        "sensors.NAME, sensors.NAME.NAME",
        "reading of a sensor on a link, and a state of its filter; `sensors` is short for the readings of all sensors",
    ),
)


SHORT_FORMS = "`q` without `JOINT.` is that channel of all joints; `.x` behind a vector is one component of it."
"""The forms of a channel that are shorter or longer than its path."""


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
    word: f"{channel.TURNING[word]}, or {channel.SLIDING[word]} on a prismatic joint"
    for word in ("inertia", "angular", "linear")
}


def print_channels() -> Iterator[str]:
    yield "channels: the signals that a run can record and a metric can evaluate"
    yield ""
    yield "In a deck: record = [q, JOINT.reaction, links.LINK.position, energy];"
    yield ""
    found = channels()
    rows = [("channel", "unit", "components", "meaning; axes")]
    for each in found:
        meaning = "; ".join(filter(None, (each["meaning"], each["frame"])))
        rows.append((each["path"], unit_in_words(each["unit"]), each["components"], meaning))
    yield from described(rows, width=terminal_width(), head=True)
    yield ""
    yield from described(list(OF_ANY), width=terminal_width())
    yield ""
    yield SHORT_FORMS
    yield from (f"  {word}: {text}" for word, text in words_of(found))


def words_of(found: list[dict[str, str]]) -> list[tuple[str, str]]:
    """The words in the units of channels that depend on the joint, with their meanings."""
    used = {word for each in found for word in each["unit"].replace("*", "/").split("/")}
    return [(word, text) for word, text in {**UNIT_WORDS, **MORE_WORDS}.items() if word in used]


def print_dh() -> Iterator[str]:
    yield "dh: the frame of a joint by Denavit-Hartenberg numbers"
    width = terminal_width()
    doc = paragraphs(textwrap.dedent(dh.__doc__ or "").strip(), width=None if width is None else width - 2)
    yield from (f"  {line}".rstrip() for line in doc)
    yield ""
    yield "In a deck: joint NAME revolute { parent = ...; child = ...; dh = classic(a = 0.4 m, alpha = 90 deg); }"
    yield ""
    yield "Numbers"
    yield from described(
        [
            ("name", "unit", "default", "meaning"),
            *((each.name, each.unit, default(each), each.doc) for each in dh.NUMBERS),
        ],
        width=width,
        head=True,
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
        yield from described(rows(shape.parameters), width=terminal_width(), head=True)


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
        yield f"Models of a {kind}; the default is {usual}"
        listed = [(name, summary(model)) for name, model in models.available(kind).items()]
        yield from described(listed, width=terminal_width())
    yield ""
    yield "Parameters of a bed that have the value of the servo unless they are written"
    yield from described(
        [
            (name, p.name, f"the servo's {p.of_servo}", p.doc)
            for name, model in models.available("bed").items()
            for p in model.parameters
            if p.of_servo
        ],
        width=terminal_width(),
    )
    yield ""
    yield "`met doc` and the name of a bed or law lists its parameters, and its channels, which can be recorded."


def print_linear() -> Iterator[str]:
    yield from print_block(BLOCKS["linear"])
    yield ""
    yield "Figures that a metric can be: metric NAME = FIGURE { of = LINEAR; }, or require FIGURE(LINEAR) > LIMIT;"
    yield from described([(each.name, each.unit, each.doc) for each in FIGURES.values()], width=terminal_width())


def figures_json() -> list[dict[str, Any]]:
    """The block's entries, then the figures."""
    return [
        *block_json(BLOCKS["linear"]),
        *({"figure": each.name, "unit": each.unit, "doc": each.doc} for each in FIGURES.values()),
    ]


def unit_table() -> list[dict[str, Any]]:
    """Every unit: its name, its word, and its size in SI."""
    return [
        {"name": name, "word": unit.word, "scale": unit.measure.scale, "si": units.text(unit.measure.dimension)}
        for name, unit in units.ALL_UNITS.items()
    ]


def print_units() -> Iterator[str]:
    yield "units: the units that a deck may write behind a number, combined by * / ^ and brackets"
    yield ""
    yield from columns([("name", "word", "is"), *((each["name"], each["word"], in_si(each)) for each in unit_table())])
    yield ""
    yield "An angular rate is not a frequency: 60 rpm is 2 pi rad/s, but 1 Hz is 1/s. There are no other prefixes."


def in_si(unit: Mapping[str, Any]) -> str:
    """The size of a unit in SI: `0.001 m`; for a share `0.01`."""
    return f"{ONE.decimal(unit['scale'])} {unit['si']}" if unit["si"] != "1" else ONE.decimal(unit["scale"])


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
"""By the word of `met doc`: the functions that print a subject, for people and for programs."""
