"""Finds a deck by its name: as a file, then in the directories of MET_DECK_PATH and in the standard library. So
`met run two_link.ic` works anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ic.text.files import LIBRARY, Files
from met.diagnostic import Problem, error, nearest


def find(name: str, include_dirs: Sequence[str | Path] = ()) -> Path:
    """The file of the deck of that name; folders of `-I` come before the library.

    Raises Problem D173 with what was probably meant and the standard decks.
    """
    deck_file = Files(include_dirs).deck(name)
    if Path(deck_file.path).exists():
        return Path(deck_file.path)
    beside = sorted(path.name for path in Path(name).parent.glob("*.ic") if path.exists() and path.name.isprintable())
    standard = standard_decks()
    folder = "" if str(Path(name).parent) == "." else f"{Path(name).parent}/"
    known = [f"{folder}{file_name}" for file_name in beside] + standard
    close = nearest(name, known) or nearest(f"{name}.ic", known)
    helps = [f"did you mean `{close}`?"] if close is not None else []
    raise Problem(error("D173", f"no deck `{name}`", help=[*helps, f"standard decks: {', '.join(standard)}"]))


def library_files() -> list[str]:
    """The names of all decks of the standard library, as an include between angles names them."""
    return sorted(path.relative_to(LIBRARY).as_posix() for path in LIBRARY.rglob("*.ic"))


def standard_decks() -> list[str]:
    """The decks of the standard library that can be run directly; those in its folders are for inclusion."""
    return sorted(path.name for path in LIBRARY.glob("*.ic"))
