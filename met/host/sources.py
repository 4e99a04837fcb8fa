"""What the name of a source on the command line says that it is: a plan, an archive, else a deck."""

from __future__ import annotations

ARCHIVES = (".h5", ".hdf5", ".nc")


def names_plan(source: str) -> bool:
    """Whether a name is that of a plan file."""
    return source.endswith(".json")


def names_archive(source: str) -> bool:
    """Whether a name is that of an archive."""
    return source.endswith(ARCHIVES)
