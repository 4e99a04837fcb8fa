"""URDF files for a deck's arms, found like CSV files, each read once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ic.grammar.syntax import Call, Deck, String
from ic.named_files import NamedFiles
from ic.text.complaints import known_words
from ic.text.limits import MOST_URDF_BYTES
from met.diagnostic import Diagnostic, Place, Problem, did_you_mean, error

if TYPE_CHECKING:
    from ic.robots.entries import ArmEntries

USAGE = 'write `arm NAME from urdf("FILE") { ... }`'
MODELS = ("urdf",)
KIND = "URDF file"


class RobotFiles(NamedFiles["ArmEntries"]):
    """The URDF files that a deck names."""

    def __init__(self, deck: Deck) -> None:
        super().__init__(deck, load, kind=KIND, ending=".urdf", most=MOST_URDF_BYTES, missing="D215")

    @property
    def roots(self) -> set[str]:
        """Names of the links that are called `base` in arms."""
        return {entries.robot.root.name.text for entries in self.loaded}

    def take(self, entries: ArmEntries) -> None:
        """Let a robot that was read elsewhere count as one of these files."""
        self._read[entries.robot.file] = entries

    def hold(self, place: Place) -> bool:
        """Return True if a place is in one of these files, which a deck can override, but not change."""
        return place.file in self._read

    def note_at(self, place: Place) -> str:
        """A note on a place whose text is not the number from there, empty elsewhere."""
        return next((note for entries in self.loaded if (note := entries.notes.get(place)) is not None), "")

    def arm_entries(self, made_from: Call) -> ArmEntries:
        """The robot of `urdf("FILE")`. Raises Problem."""
        return self.get(_file_named(made_from))

    def remarks(self, made_from: Call) -> Iterator[Diagnostic]:
        """Warnings about the parts of the file, which was read, that the arm leaves out."""
        from ic.robots.warnings import warnings_of

        return warnings_of(self.arm_entries(made_from), _file_named(made_from).place)


def load(name: str, text: str) -> ArmEntries:
    """The robot of a file. Raises Problem."""
    from ic.robots.entries import arm_entries  # only who has such a file pays for reading them
    from ic.robots.urdf import read

    return arm_entries(read(name, text))


def _file_named(made_from: Call) -> String:
    """The file of `urdf("FILE")`, from which an arm is made. Raises Problem D214 for anything else."""
    name = made_from.name.text
    if name not in MODELS:
        raise Problem(
            error(
                "D214",
                f"no arm is made from `{name}`",
                made_from.name.place,
                help=[*did_you_mean(name, MODELS), known_words("an arm is made from", MODELS)],
            )
        )
    file_name = made_from.positional[0] if len(made_from.positional) == 1 and not made_from.named else None
    if not isinstance(file_name, String):
        raise Problem(error("D214", "`urdf` takes the name of one file, in quotes", made_from.place, help=USAGE))
    return file_name
