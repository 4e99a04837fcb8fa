"""Where a deck's files are found, and how they are read: a regular file of UTF-8 text, not too large.

An `#include "name"` looks beside the including file first; both forms then look in the `-I` directories, in those of
MET_DECK_PATH, and in the standard library (ic/decks), whose files are called `<servos/rigid_gearbox.ic>` in messages
and archives, so that neither depends on where MET is installed.
"""

from __future__ import annotations

import hashlib
import os
import posixpath
import re
import stat
from collections.abc import Sequence
from pathlib import Path

from ic.grammar.syntax import SourceText
from ic.text.limits import MOST_BYTES
from met.diagnostic import Diagnostic, Place, Problem, error
from met.frozen import frozen

LIBRARY = Path(__file__).parents[1] / "decks"
MOST_LISTED = 2_000  # files looked at for a "did you mean"
MOST_NAMED = 8  # files named in a message

_NOT_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")


@frozen
class Directory:
    """A directory to look in, and the name it goes by in messages; "<" begins the library's."""

    path: str
    name: str

    def join(self, file: str) -> FoundFile:
        if self.name.startswith("<"):
            return FoundFile(
                os.path.join(self.path, file), f"<{posixpath.normpath(posixpath.join(self.name[1:-1], file))}>"
            )
        return FoundFile(os.path.join(self.path, file), os.path.normpath(os.path.join(self.name, file)))

    @property
    def said(self) -> str:
        return "the standard library" if self.name == "<>" else f"`{self.name or '.'}`"


@frozen
class FoundFile:
    """A file: the path to open it by, and its name in messages."""

    path: str
    name: str

    @property
    def directory(self) -> Directory:
        if self.name.startswith("<"):
            return Directory(os.path.dirname(self.path), f"<{posixpath.dirname(self.name[1:-1])}>")
        return Directory(os.path.dirname(self.path), os.path.dirname(self.name))

    @property
    def identity(self) -> str:
        return os.path.realpath(self.path)


class Files:
    """The places to look in, and every file that was read, in order."""

    def __init__(self, include_dirs: Sequence[str | Path] = (), library: Path = LIBRARY) -> None:
        named = [os.fspath(d) for d in include_dirs]
        named += [d for d in os.environ.get("MET_DECK_PATH", "").split(os.pathsep) if d]
        self.path = [Directory(d, d) for d in named] + [Directory(os.fspath(library), "<>")]
        self.read_so_far: dict[str, SourceText] = {}

    def deck(self, path: str | Path) -> FoundFile:
        """The deck of that name: a file, or else one of the library's."""
        name = os.fspath(path)
        given = FoundFile(name, os.path.normpath(name))
        if os.path.exists(name) or os.path.isabs(name):
            return given
        return next((found for d in self.path if os.path.isfile((found := d.join(name)).path)), given)

    def where(self, includer: FoundFile, angled: bool) -> list[Directory]:
        """The directories in which an include is looked for, in order."""
        return self.path if angled else [includer.directory, *self.path]

    def find(self, header: str, directories: Sequence[Directory]) -> FoundFile | None:
        if os.path.isabs(header):
            return FoundFile(header, os.path.normpath(header)) if os.path.exists(header) else None
        return next((found for d in directories if os.path.exists((found := d.join(header)).path)), None)

    def listed(self, directories: Sequence[Directory], ending: str = ".ic") -> list[str]:
        """Names that a file of this ending could have, for a "did you mean"."""
        names: list[str] = []
        for directory in directories:
            for at, folders, files in os.walk(directory.path or "."):
                folders[:] = sorted(f for f in folders if not f.startswith("."))
                if at.count(os.sep) - directory.path.count(os.sep) >= 2:
                    folders.clear()
                beside = os.path.relpath(at, directory.path or ".")
                names += [os.path.normpath(os.path.join(beside, f)) for f in sorted(files)
                          if f.endswith(ending) and os.path.exists(os.path.join(at, f))]  # not a link to nowhere
                if len(names) > MOST_LISTED:
                    return names[:MOST_LISTED]
        return names

    def text(self, file: FoundFile, *, kind: str = "deck", most: int = MOST_BYTES) -> str:
        """The file's text, with lines ended by newlines; raises Problem (D001, D002, D018) where it has none.

        kind: what it should be, for messages; most: bytes that it may have.
        """
        if file.name not in self.read_so_far:
            data = _read_bytes(file, kind, most)
            text, complaint = _decode(data, file.name, kind)
            self.read_so_far[file.name] = SourceText(file.name, text, hashlib.sha256(data).hexdigest())
            if complaint is not None:
                raise Problem(complaint)
        return self.read_so_far[file.name].text


def library_defines(kind: str, name: str, library: Path = LIBRARY) -> str | None:
    """The file of the standard library, to be included, that defines a servo (arm, ...) of that name."""
    definition = re.compile(rf"^[ \t]*{re.escape(kind)}[ \t]+{re.escape(name)}\b", re.MULTILINE)
    for path in sorted(library.glob("*/**/*.ic")):
        if definition.search(path.read_text(encoding="utf-8", errors="replace")):
            return path.relative_to(library).as_posix()
    return None


def _read_bytes(file: FoundFile, kind: str, most: int) -> bytes:
    try:
        about = os.stat(file.path)
        if stat.S_ISDIR(about.st_mode):
            ending = ".ic" if kind == "deck" else ".csv"
            inside = sorted(f for f in os.listdir(file.path) if f.endswith(ending))[:MOST_NAMED]
            help = f"{kind}s in it: {', '.join(inside)}" if inside else f"there is no {kind} in it"
            raise Problem(error("D001", f"`{file.name}` is a directory, not a {kind}", help=help))
        if not stat.S_ISREG(about.st_mode):
            raise Problem(error("D001", f"`{file.name}` is not a regular file", help="copy what it gives to a file"))
        if about.st_size > most:
            whose = "deck's file" if kind == "deck" else kind
            size = f"{about.st_size / 2**20:.1f} MiB; a {whose} has at most {most >> 20}"
            help = "numbers in bulk belong in a CSV file, not in a deck" if kind == "deck" else "split it"
            raise Problem(error("D018", f"`{file.name}` has {size}", help=help))
        with open(file.path, "rb") as stream:
            return stream.read(most)
    except (OSError, ValueError) as reason:
        why = getattr(reason, "strerror", None) or str(reason)
        help = "look at the name, and at who may read the file"
        raise Problem(error("D001", f"cannot read `{file.name}`: {why}", help=help)) from None


def _decode(data: bytes, name: str, kind: str) -> tuple[str, Diagnostic | None]:
    """The text, and what is wrong with it; where something is, the text is good enough to show the line."""
    complaint = None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        complaint = error("D002", f"`{name}` is UTF-16, but {kind}s are UTF-8", help="save it as UTF-8")
        return data.decode("utf-16", errors="replace"), complaint
    found = _NOT_TEXT.search(data)
    if found is not None:
        place = _place_of_byte(data, found.start(), name)
        complaint = error(
            "D002", f"`{name}` is not text: it holds the byte 0x{data[found.start()]:02x}", place,
            help=f"is this an archive or a program? A {kind} is plain text in UTF-8",
        )  # fmt: skip
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        text = data.decode("utf-8-sig", errors="replace")
        if complaint is None:
            place = _place_of_byte(data, reason.start, name)
            message = f"`{name}` is not UTF-8: byte 0x{data[reason.start]:02x}"
            complaint = error("D002", message, place, help="save the file as UTF-8")
    return text.replace("\r\n", "\n").replace("\r", "\n"), complaint


def _place_of_byte(data: bytes, at: int, name: str) -> Place:
    before = data[:at].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    start = before.rfind(b"\n") + 1
    column = len(before[start:].decode("utf-8-sig" if start == 0 else "utf-8", errors="replace")) + 1
    return Place(name, before.count(b"\n") + 1, column)
