"""The formats that archives are exported to, by name.

All code that needs the list of formats uses this module: `met export`, `met run -o FILE.ending`, the check of an
archive's name, and the help texts.
"""

from __future__ import annotations

from pathlib import Path

FORMATS = {
    "mcap": "batch.export.mcap",
    "csv": "batch.export.csv",
    "parquet": "batch.export.parquet",
}
"""The module of each format, by its name, which is also the ending of its files. The first is the default."""


def format_of(path: Path) -> str | None:
    """The name of the format of a file's ending; None for any other ending."""
    ending = path.suffix.lower().removeprefix(".")
    return ending if ending in FORMATS else None


def endings(last: str = ", ") -> str:
    """The endings of all formats, for help and messages: `.mcap, .csv, .parquet`. last: between the last two."""
    *others, end = (f".{name}" for name in FORMATS)
    return ", ".join(others) + last + end
