"""Kinds of sources on the command line, by their names: a plan, an archive, else a deck."""

from __future__ import annotations

ARCHIVES = (".h5", ".hdf5", ".nc")


def names_plan(source: str) -> bool:
    """True for the name of a plan file."""
    return source.endswith(".json")


def names_archive(source: str) -> bool:
    """True for the name of an archive."""
    return source.endswith(ARCHIVES)
