"""URDF files that a deck's arms are made from: found as CSV files are, each read once."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ic.grammar.syntax import Call, Deck, SourceText, String
from ic.meaning.complaints import known_words
from ic.text.files import LIBRARY, Files, FoundFile
from ic.text.lexer import COMMAND_LINE
from ic.text.limits import MOST_URDF_BYTES
from met.diagnostic import Diagnostic, Label, Problem, did_you_mean, error

if TYPE_CHECKING:
    from ic.robots.entries import Body

USAGE = 'write `arm NAME from urdf("FILE") { ... }`'
MODELS = ("urdf",)


class RobotFiles:
    """The files, beside the deck that names them, then where `-I` says."""

    def __init__(self, deck: Deck) -> None:
        self._deck = deck.file
        self._files = Files(deck.include_dirs)
        self._read: dict[str, Body | Problem] = {}

    @property
    def sources(self) -> tuple[SourceText, ...]:
        """The files that were read, whole, in order."""
        return tuple(self._files.read_so_far.values())

    @property
    def roots(self) -> set[str]:
        """Names of the links that are `base` in arms."""
        return {each.robot.root.name.text for each in self._read.values() if not isinstance(each, Problem)}

    def body(self, made_from: Call) -> Body:
        """The robot that `urdf("FILE")` names. Raises Problem; where that is the file's fault, the same each time."""
        named = _file_named(made_from)
        found = self._find(named)
        if found.name not in self._read:
            try:
                self._read[found.name] = load(self._files, found)
            except Problem as problem:
                placed = (d if d.at else Diagnostic(d.code, d.message, Label(named.place), d.also, d.help)
                          for d in problem.diagnostics)  # fmt: skip
                self._read[found.name] = Problem(placed)
        made = self._read[found.name]
        if isinstance(made, Problem):
            raise made
        return made

    def remarks(self, made_from: Call) -> Iterator[Diagnostic]:
        """What the arm has not of the file, which was read."""
        from ic.robots.told import told

        return told(self.body(made_from), _file_named(made_from).place)

    def _find(self, named: String) -> FoundFile:
        file = self._deck if named.place.file == COMMAND_LINE else named.place.file
        path = os.path.join(LIBRARY, file[1:-1]) if file.startswith("<") else file
        folders = self._files.where(FoundFile(path, file), False)
        found = self._files.find(named.value, folders) if named.value.strip() else None
        if found is None:
            near = did_you_mean(named.value, self._files.listed(folders, ".urdf"))
            looked = f"looked in {', '.join(dict.fromkeys(folder.said for folder in folders))}"
            raise Problem(error("D215", f'cannot find "{named.value}"', named.place, help=(*near, looked)))
        return found


def load(files: Files, found: FoundFile) -> Body:
    """The robot of a file. Raises Problem."""
    from ic.robots.entries import body  # only who has such a file pays for reading them
    from ic.robots.urdf import read

    return body(read(found.name, files.text(found, kind="URDF file", most=MOST_URDF_BYTES)))


def _file_named(made_from: Call) -> String:
    """Raises Problem D214 for what is not `urdf("FILE")`."""
    name = made_from.name.text
    if name not in MODELS:
        raise Problem(error("D214", f"no arm is made from `{name}`", made_from.name.place,
                            help=[*did_you_mean(name, MODELS), known_words("an arm is made from", MODELS)]))
    given = made_from.positional[0] if len(made_from.positional) == 1 and not made_from.named else None
    if not isinstance(given, String):
        raise Problem(error("D214", "`urdf` takes the name of one file, in quotes", made_from.place, help=USAGE))
    return given
