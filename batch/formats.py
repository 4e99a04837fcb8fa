"""The formats that archives are exported to, by name.

Everything that asks which formats there are asks here: `met export`, `met run -o FILE.ending`, what an archive must not
be called, and what their help lists.
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
    """The name of the format that a file's ending says; None for any other ending."""
    ending = path.suffix.lower().removeprefix(".")
    return ending if ending in FORMATS else None


def endings(last: str = ", ") -> str:
    """The endings of all formats, for help and messages: `.mcap, .csv, .parquet`. last: between the last two."""
    *others, end = (f".{name}" for name in FORMATS)
    return ", ".join(others) + last + end
