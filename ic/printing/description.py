"""The whole language as one JSON object, `met doc language --format json`: for editors, generators and checkers.

It is made from the declarations that the compiler uses, including models of other packages.
"""

from __future__ import annotations

from typing import Any

from ic.find import library_files
from ic.language import ANYWHERE, BLOCKS, DEFINITIONS, TOP_LEVEL
from ic.language.bodies import JOINT_KINDS
from ic.language.runs import BASE_KINDS
from ic.meaning.expressions.evaluate import COMPARISONS, CONSTANTS, RESERVED, USAGE
from ic.printing import looked_up, subjects, sweeps
from ic.printing.columns import count
from ic.printing.models import KINDS, UNIT_WORDS, model_record, parameter_record, where_written
from ic.printing.page import Page, Table
from ic.printing.subjects import block_page
from ic.text.edition import EDITIONS, FIRST
from ic.text.preprocess import DIRECTIVES
from met import models, units
from met.messages.warning_codes import WARNINGS
from met.version import VERSION

SCHEMA = "met.language"
VERSION_OF_SCHEMA = 1
"""Version of the schema; raised where a key is removed or changes its meaning, but not for new keys."""


def description() -> dict[str, Any]:
    """The language: blocks with their entries, models with their parameters, and all words that a deck may use."""
    return {
        "schema": SCHEMA,
        "version": VERSION_OF_SCHEMA,
        "met": VERSION,
        "definitions": list(DEFINITIONS),
        "blocks": [
            {
                "name": block.name,
                "doc": block.doc,
                "written": block.written,
                "within": block.within,
                "head": block.head,
                "free": block.free,
                "entries": [
                    {**record, "parameter": None if entry.parameter is None else parameter_record(entry.parameter)}
                    for record, entry in zip(block_page(block).records, block.entries, strict=True)
                ],
            }
            for block in BLOCKS.values()
        ],
        "top_level": [
            {key: record[key] for key in ("name", "written", "doc")} for record in block_page(TOP_LEVEL).records
        ],
        "anywhere": [
            {key: record[key] for key in ("name", "written", "doc")} for record in block_page(ANYWHERE).records
        ],
        "models": [
            {**model_record(kind, model), "written": where_written(kind, model)}
            for kind in KINDS
            for model in models.available(kind).values()
        ],
        "shapes": subjects.shapes_page().records,
        "dh": subjects.dh_page().records,
        "joint_kinds": list(JOINT_KINDS),
        "base_kinds": list(BASE_KINDS),
        "channels": subjects.channels(),
        "units": subjects.unit_table(),
        "unit_words": {**UNIT_WORDS, **subjects.MORE_WORDS},
        "functions": [
            {**record, "arguments": list(USAGE[record["name"]])}
            for record in sweeps.functions_page().records
            if record["name"] in USAGE
        ],
        "constants": dict(CONSTANTS),
        "comparisons": list(COMPARISONS),
        "designs": sweeps.designs_page().records,
        "distributions": sweeps.distributions_page().records,
        "directives": list(DIRECTIVES),
        "taken_names": _taken_names(FIRST),
        "editions": [{"edition": edition, "taken_names": _taken_names(edition)} for edition in EDITIONS],
        "diagnostics": [
            {"code": code, "title": title, "may_be_allowed": code in WARNINGS}
            for code, title in sorted(looked_up.titles().items())
        ],
        "library": library_files(),
    }


def _taken_names(edition: int) -> list[str]:
    """The names that cannot name a value in an edition."""
    of_units = [name for name in units.UNITS if name.isidentifier()] if edition == FIRST else []
    return [*CONSTANTS, *RESERVED, *of_units]


def language_page() -> Page:
    """The description for programs; a terminal shows the sizes of its parts."""
    parts = description()
    rows = [
        (name, count(len(part), "entry", "entries")) for name, part in parts.items() if isinstance(part, list | dict)
    ]
    return Page(
        subject="language",
        summary=f"all of it, for programs: `met doc language --format json`, {SCHEMA} {VERSION_OF_SCHEMA}",
        parts=(Table(head=("part", "entries"), rows=rows, headed=False),),
        records=parts,
    )
