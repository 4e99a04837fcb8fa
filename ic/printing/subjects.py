"""Pages of `met doc` about other subjects than models: blocks, channels, Denavit-Hartenberg numbers, shapes, units, and
the words of values and sweeps (ic/printing/sweeps.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

from ic.language import BLOCKS, BlockDeclaration, Entry
from ic.meaning.control.substitution import DEFAULTS
from ic.meaning.mechanics import dh, matter
from ic.printing import sweeps
from ic.printing.models import (
    UNIT_WORDS,
    default,
    parameter_record,
    parameter_table,
    range_,
    summary,
    unit_in_words,
    words_in,
)
from ic.printing.page import Page, Table
from ic.text.complaints import with_article
from met import models, units
from met.plan import channel
from met.plan.judged import FIGURES
from met.units import ONE


def block_page(block: BlockDeclaration) -> Page:
    """The page of a block."""
    numbers = [
        (entry.name, type_of(entry), "" if entry.parameter.words else range_(entry.parameter))
        for entry in block.entries
        if entry.parameter
    ]
    varying = [(_path(entry), _varies(entry)) for entry in block.entries if entry.path and entry.varies != "never"]
    return Page(
        subject=block.name,
        title=f"block {block.name}",
        summary=block.doc,
        usage=block.written + (f", in {with_article(block.within)}" if block.within else ""),
        parts=(
            Table(
                head=("written", "default", "meaning"),
                rows=[(entry.written, entry.default, entry.doc) for entry in block.entries],
            ),
            f"Also {block.free}." if block.free else "",
            Table(
                head=("name", "type", "bounds"), rows=numbers, headed=False, caption="Types, with bounds in SI units"
            ),
            Table(
                head=("path", "what varies"),
                rows=varying,
                headed=False,
                caption="What a sweep varies and `--set` replaces",
            ),
        ),
        records=[_entry_record(entry) for entry in block.entries],
    )


def in_block(block: BlockDeclaration) -> str:
    """A block in words, as the place of its entries: `a deck`, `an arm`, `any block`."""
    return {"deck": "a deck", "anywhere": "any block"}.get(block.name) or with_article(block.name)


def _entry_record(entry: Entry) -> dict[str, Any]:
    """An entry of a block, for programs."""
    return {
        "name": entry.name,
        "form": entry.form,
        "written": entry.written,
        "doc": entry.doc,
        "default": entry.default,
        "type": type_of(entry),
        "unit": entry.unit,
        "varies": entry.varies,
        "path": entry.path,
    }


def type_of(entry: Entry) -> str:
    """The type of an entry's value, in words: `number, kg`, `3 numbers, m`, `on or off`; "" where it has no value."""
    wanted = entry.parameter
    if wanted is None:
        return ""
    if wanted.shape == "word":
        return " or ".join(wanted.words)
    kind = {"vector": "3 numbers", "list": "numbers"}.get(wanted.shape, "number")
    return f"{kind}, {wanted.unit}" if wanted.unit != "1" else kind


def _path(entry: Entry) -> str:
    """The path by which a sweep varies an entry; for several numbers, that of one of them."""
    shape = entry.parameter.shape if entry.parameter is not None else ""
    return entry.path + {"vector": ".x, .y, .z", "list": ".xx, .yy, ..."}.get(shape, "")


def _varies(entry: Entry) -> str:
    return "a number" if entry.varies == "number" else "a choice; each choice makes a program of its own"


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
    ("environment.NAME.NAME", "a signal of a model of the environment; `met doc` and the name of the model lists them"),
    (
        "sensors.NAME, sensors.NAME.NAME",
        "reading of a sensor on a link, and a state of its filter; `sensors` is short for the readings of all sensors",
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
        *(row(JOINT, *channel_row) for channel_row in channel.OF_JOINT),
        *(row(LINK, *channel_row) for channel_row in channel.OF_LINK),
        *(row(BOOM, *channel_row) for channel_row in channel.OF_BOOM),
        *(row(LINK, name, unit, doc, channel.XYZ, channel.WORLD_AXES) for name, unit, doc in channel.JACOBIAN),
        *(row(PAYLOAD, *channel_row) for channel_row in channel.OF_PAYLOAD),
        *(row("", *channel_row) for channel_row in channel.OF_ARM),
    ]


JOINT, LINK, BOOM, PAYLOAD = "JOINT.", "links.LINK.", "links.BOOM.", "payloads.PAYLOAD."
MORE_WORDS = {
    word: f"{channel.TURNING[word]}, or {channel.SLIDING[word]} on a prismatic joint"
    for word in ("inertia", "angular", "linear")
}


def channels_page() -> Page:
    """The page of `met doc channels`, one row for each channel: path, unit, components, meaning."""
    records = channels()
    rows = [
        (
            record["path"],
            unit_in_words(record["unit"]),
            record["components"],
            "; ".join(filter(None, (record["meaning"], record["frame"]))),
        )
        for record in records
    ]
    words = words_in([record["unit"] for record in records], {**UNIT_WORDS, **MORE_WORDS})
    return Page(
        subject="channels",
        title="Channels",
        summary="the signals that a run can record and a metric can evaluate",
        prose="`q` without `JOINT.` is that channel of all joints; `.x` behind a vector is one component of it.",
        usage="record = [q, JOINT.reaction, links.LINK.position, energy];",
        parts=(
            Table(head=("channel", "unit", "components", "meaning; axes"), rows=rows, words=words),
            Table(head=("channel", "is"), rows=OF_ANY, headed=False),
        ),
        records=records,
    )


def dh_page() -> Page:
    """The page of `met doc dh`: how a joint's frame is written by Denavit-Hartenberg numbers."""
    return Page(
        subject="dh",
        title="Denavit-Hartenberg numbers",
        summary="the frame of a joint by Denavit-Hartenberg numbers",
        prose=dh.__doc__ or "",
        usage="joint NAME revolute { parent = ...; child = ...; dh = classic(a = 0.4 m, alpha = 90 deg); }",
        parts=(
            Table(
                head=("name", "unit", "default", "meaning"),
                rows=[(parameter.name, parameter.unit, default(parameter), parameter.doc) for parameter in dh.NUMBERS],
                caption="Numbers",
            ),
        ),
        records=[
            {"name": parameter.name, "unit": parameter.unit, "doc": parameter.doc, "default": parameter.default}
            for parameter in dh.NUMBERS
        ],
    )


def shapes_page() -> Page:
    """The page of `met doc shapes`: the solids that give a link its inertia."""
    return Page(
        subject="shapes",
        title="Shapes of links",
        summary="uniform solids, which give a link its inertia and its centre of mass",
        prose=(matter.__doc__ or "").strip().split("\n\n", 1)[1],
        usage="link NAME { mass = 2 kg;  shape = rod(length = 1 m, along = x); }",
        parts=[parameter_table(shape.parameters, caption=name) for name, shape in matter.SHAPES.items()],
        records=[
            {"name": name, "parameters": [parameter_record(parameter) for parameter in shape.parameters]}
            for name, shape in matter.SHAPES.items()
        ],
    )


def substitute_page(known: Callable[[models.Kind], Mapping[str, Any]] = models.available) -> Page:
    """The page of `substitute`, with the models of beds and laws. known: the models of a kind, by name"""
    page = block_page(BLOCKS["substitute"])
    tables = [
        Table(
            head=("name", "meaning"),
            rows=[(name, summary(model)) for name, model in known(kind).items()],
            headed=False,
            caption=f"Models of a {kind}; the default is {usual}",
        )
        for kind, usual in DEFAULTS.items()
    ]
    of_servo = Table(
        head=("bed", "parameter", "default", "meaning"),
        rows=[
            (name, parameter.name, f"the servo's {parameter.of_servo}", parameter.doc)
            for name, model in known("bed").items()
            for parameter in model.parameters
            if parameter.of_servo
        ],
        headed=False,
        caption="Parameters of a bed that have the value of the servo unless they are written",
    )
    end = "`met doc` and the name of a bed or law lists its parameters, and its channels, which can be recorded."
    return replace(page, parts=(*page.parts, *tables, of_servo, end))


def linear_page() -> Page:
    """The page of `linear`, with the figures of a linear analysis that a metric can be."""
    page = block_page(BLOCKS["linear"])
    table = Table(
        head=("figure", "unit", "meaning"),
        rows=[(figure.name, figure.unit, figure.doc) for figure in FIGURES.values()],
        headed=False,
        caption="Figures for `metric NAME = FIGURE { of = LINEAR; }` and `require FIGURE(LINEAR) > LIMIT;`",
    )
    figures = [{"figure": figure.name, "unit": figure.unit, "doc": figure.doc} for figure in FIGURES.values()]
    return replace(page, parts=(*page.parts, table), records=[*page.records, *figures])


def units_page() -> Page:
    """The page of `met doc units`: each unit with its size in SI."""
    records = unit_table()
    rows = [(record["name"], record["word"], in_si(record)) for record in records]
    return Page(
        subject="units",
        title="Units",
        summary="the units that a deck may write behind a number, combined by * / ^ and brackets",
        parts=(
            Table(head=("name", "word", "is"), rows=rows),
            "An angular rate is not a frequency: 60 rpm is 2 pi rad/s, but 1 Hz is 1/s. There are no other prefixes.",
        ),
        records=records,
    )


def unit_table() -> list[dict[str, Any]]:
    """Every unit: its name, its word, and its size in SI."""
    return [
        {"name": name, "word": unit.word, "scale": unit.measure.scale, "si": units.text(unit.measure.dimension)}
        for name, unit in units.ALL_UNITS.items()
    ]


def in_si(unit: Mapping[str, Any]) -> str:
    """The size of a unit in SI: `0.001 m`; for a share `0.01`."""
    return f"{ONE.decimal(unit['scale'])} {unit['si']}" if unit["si"] != "1" else ONE.decimal(unit["scale"])


BLOCK_PAGES: Mapping[str, Callable[[], Page]] = MappingProxyType(
    {
        **{name: partial(block_page, block) for name, block in BLOCKS.items()},
        "linear": linear_page,
        "substitute": substitute_page,
    }
)
"""The page of each block of the deck language."""

OTHER_PAGES: Mapping[str, Callable[[], Page]] = MappingProxyType(
    {"shapes": shapes_page, "dh": dh_page, "channels": channels_page, "units": units_page, **sweeps.PAGES}
)
"""The page of each subject that is neither a block nor a model, in the order of docs/reference.md."""
