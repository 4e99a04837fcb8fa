"""Files that a deck names besides decks, found beside the naming file, then in the folders of `-I`; each read once."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

from ic.grammar.syntax import Deck, String
from ic.text.files import LIBRARY, Files, FoundFile, folders_by_slash
from ic.text.lexer import COMMAND_LINE
from ic.text.limits import MOST_MESH_BYTES
from ic.text.source import SourceFile
from met.diagnostic import Diagnostic, Label, Problem, did_you_mean, error
from met.host.files import read_regular

T = TypeVar("T")


class NamedFiles(Generic[T]):
    """The files of one kind, each as the result of `load` for its name and text.

    kind, ending  what messages call one, and how their names end;  most  bytes of one
    missing       the code of the message where there is none of a name
    was_asked     whether a file was asked for, be it there or not
    """

    def __init__(
        self, deck: Deck, load: Callable[[str, str], T], *, kind: str, ending: str, most: int, missing: str
    ) -> None:
        self._deck, self._load, self._kind, self._ending = deck.file, load, kind, ending
        self._most, self._missing = most, missing
        self._files = Files(deck.include_dirs, unsaved=deck.unsaved)
        self._read: dict[str, T | Problem] = {}
        self.was_asked = False

    @property
    def sources(self) -> tuple[SourceFile, ...]:
        """The files that were read, complete, in order."""
        return tuple(self._files.read_so_far.values())

    @property
    def loaded(self) -> Iterable[T]:
        """The contents of the files without mistakes."""
        return (content for content in self._read.values() if not isinstance(content, Problem))

    def get(self, named: String) -> T:
        """The content of the file of this name. Raises Problem, the same each time for a fault of the file."""
        file = self.find(named)
        if file.name not in self._read:
            try:
                text = self._files.text(file, kind=self._kind, most=self._most)
                self._read[file.name] = self._load(file.name, text)
            except Problem as problem:
                placed = (
                    d if d.at else Diagnostic(d.code, d.message, Label(named.place), d.also, d.help)
                    for d in problem.diagnostics
                )
                self._read[file.name] = Problem(placed)
        content = self._read[file.name]
        if isinstance(content, Problem):
            raise content
        return content

    def find(self, named: String) -> FoundFile:
        """The file of this name. Raises Problem where there is none."""
        self.was_asked = True
        file = self._deck if named.place.file == COMMAND_LINE else named.place.file
        path = os.path.join(LIBRARY, file[1:-1]) if file.startswith("<") else file
        folders = self._files.where(FoundFile(path, file), False)
        found_file = self._files.find(named.value, folders) if named.value.strip() else None
        if found_file is None:
            slashed = folders_by_slash(named.value, f'"{named.value}"')
            near = slashed or did_you_mean(named.value, self._files.listed(folders, self._ending))
            looked = f"looked in {', '.join(dict.fromkeys(folder.in_words for folder in folders))}"
            raise Problem(error(self._missing, f'cannot find "{named.value}"', named.place, help=(*near, looked)))
        return found_file


class MeshFiles(NamedFiles[str]):
    """The files of meshes that a deck names. They are looked at alone: of each its digest is known here."""

    def __init__(self, deck: Deck) -> None:
        super().__init__(
            deck, lambda name, text: text, kind="mesh", ending=".stl", most=MOST_MESH_BYTES, missing="D219"
        )
        self._digests: dict[str, str] = {}

    def digest(self, named: String) -> tuple[str, str]:
        """The name of a file, and the SHA-256 of its contents. Raises Problem D219 where it cannot be read."""
        file = self.find(named)
        if file.name not in self._digests:
            try:
                self._digests[file.name] = hashlib.sha256(read_regular(file.path, MOST_MESH_BYTES)).hexdigest()
            except OSError as reason:
                most = f"a mesh is a file of at most {MOST_MESH_BYTES >> 20} MB: a program for meshes reduces it"
                message = f"cannot read `{file.name}`: {reason.strerror}"
                raise Problem(error("D219", message, named.place, help=most)) from None
        return file.name, self._digests[file.name]
