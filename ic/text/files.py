"""Finding and reading of a deck's files: regular files of UTF-8 text, not too large.

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
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from ic.text.limits import MOST_BYTES
from ic.text.source import SourceFile
from met.diagnostic import Diagnostic, Help, Place, Problem, error, write
from met.frozen import frozen
from met.host.files import open_regular, real_path

LIBRARY = Path(__file__).parents[1] / "decks"
MOST_LISTED = 2_000  # names that a "did you mean" compares with
MOST_SEEN = 20_000  # files and folders looked at for them
MOST_NAMED = 8  # files named in a message
CHUNK = 1 << 16  # bytes that a file is asked for beyond the size that it says

DECK_IN_MEMORY = "deck"
"""The name in messages and archives of a deck that is given as text."""

HDF5 = b"\x89HDF\r\n\x1a\n"
"""The first bytes of an HDF5 file."""

Unsaved = Mapping[str, str]
"""Texts that count in place of files' contents, by the files' real paths: those that an editor has not saved yet."""

NOTHING_UNSAVED: Unsaved = MappingProxyType({})

_XML = re.compile(r"\s*<[?!A-Za-z]")
_WIDE = (
    (re.compile(rb"\xff\xfe\0\0|\0\0\xfe\xff"), "utf-32"),
    (re.compile(rb"\xff\xfe|\xfe\xff"), "utf-16"),
    (re.compile(rb"(?:[\t\n\r -~]\0){4}"), "utf-16-le"),
    (re.compile(rb"(?:\0[\t\n\r -~]){4}"), "utf-16-be"),
)
"""How texts in other encodings begin: with a byte order mark, or with ASCII in twos of bytes."""

_NOT_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")


@frozen
class Directory:
    """A directory to search, and its name in messages; "<" begins the library's."""

    path: str
    name: str

    def join(self, file: str) -> FoundFile:
        """The file of a name in this folder; of one in the library, its name is in < >."""
        if self.name.startswith("<"):
            return FoundFile(
                os.path.join(self.path, file), f"<{posixpath.normpath(posixpath.join(self.name[1:-1], file))}>"
            )
        return file_at(os.path.join(self.path, file))

    @property
    def in_words(self) -> str:
        if self.name == "<>":
            return "the standard library"
        return f"`{self.name or '.'}`" + ("" if os.path.isdir(self.path or ".") else " (there is no such folder)")


@frozen
class FoundFile:
    """A file: its path, and its name in messages."""

    path: str
    name: str

    @property
    def directory(self) -> Directory:
        if self.name.startswith("<"):
            return Directory(os.path.dirname(self.path), f"<{posixpath.dirname(self.name[1:-1])}>")
        return Directory(os.path.dirname(self.path), os.path.dirname(self.name))

    @property
    def identity(self) -> str:
        return real_path(self.path)


def file_at(path: str) -> FoundFile:
    """A file outside of the library, under a unique name.

    `a/../b.ic` is `b.ic`, unless `a` is a link to elsewhere.
    """
    name = os.path.normpath(path)
    if ".." in path.split(os.sep) and real_path(name) != real_path(path):
        name = path
    return FoundFile(path, os.path.join(os.curdir, name) if name.startswith("<") else name)


class Files:
    """The places to look in, and every file that was read, in order."""

    def __init__(
        self, include_dirs: Sequence[str | Path] = (), library: Path = LIBRARY, unsaved: Unsaved = NOTHING_UNSAVED
    ) -> None:
        self._unsaved = unsaved
        named = [os.fspath(d) for d in include_dirs]
        named += [d for d in os.environ.get("MET_DECK_PATH", "").split(os.pathsep) if d]
        self.path = [Directory(d, d) for d in named] + [Directory(os.fspath(library), "<>")]
        self.read_so_far: dict[str, SourceFile] = {}
        self.read_files: dict[str, FoundFile] = {}  # those that were read, by name
        self._refused: dict[str, Problem] = {}

    def deck(self, path: str | Path) -> FoundFile:
        """The deck of that name: a file, or else one of the library's."""
        name = os.fspath(path)
        as_named = file_at(name)
        if self._is_there(as_named) or os.path.isabs(name):
            return as_named
        return next((library_file for d in self.path if os.path.isfile((library_file := d.join(name)).path)), as_named)

    def in_memory(self, text: str) -> FoundFile:
        """The deck that is given as text; files that it includes are looked for from the current folder."""
        file = FoundFile(DECK_IN_MEMORY, DECK_IN_MEMORY)
        self._keep(file, text.encode("utf-8", "surrogatepass"), "deck", MOST_BYTES)
        return file

    def where(self, includer: FoundFile, angled: bool) -> list[Directory]:
        """The directories in which an include is searched, in order."""
        return self.path if angled else [includer.directory, *self.path]

    def find(self, header: str, directories: Sequence[Directory]) -> FoundFile | None:
        """The first existing file; a folder of that name only where there is no file."""
        candidates = [file_at(header)] if os.path.isabs(header) else [d.join(header) for d in directories]
        existing = [file for file in candidates if self._is_there(file)]
        return next((file for file in existing if not os.path.isdir(file.path)), existing[0] if existing else None)

    def _is_there(self, file: FoundFile) -> bool:
        return os.path.exists(file.path) or (bool(self._unsaved) and file.identity in self._unsaved)

    def dangling(self, header: str, directories: Sequence[Directory]) -> str | None:
        """The name of a broken link, where an include has found one."""
        files = (d.join(header) for d in directories)
        return next((file.name for file in files if os.path.islink(file.path)), None)

    def listed(self, directories: Sequence[Directory], ending: str = ".ic") -> list[str]:
        """Names that a file of this ending could have, for a "did you mean"."""
        names: list[str] = []
        seen = 0
        for directory in directories:
            for folder, folders, files in os.walk(directory.path or "."):
                seen += len(folders) + len(files)
                folders[:] = sorted(f for f in folders if not f.startswith("."))
                if folder.count(os.sep) - directory.path.count(os.sep) >= 2:
                    folders.clear()
                beside = os.path.relpath(folder, directory.path or ".")
                names += [
                    os.path.normpath(os.path.join(beside, f))
                    for f in _printable(files, ending)
                    if os.path.exists(os.path.join(folder, f))
                ]  # not a link to nowhere
                if len(names) > MOST_LISTED or seen > MOST_SEEN:
                    return names[:MOST_LISTED]
        return names

    def text(self, file: FoundFile, *, kind: str = "deck", most: int = MOST_BYTES) -> str:
        """The file's text, with lines ended by newlines; raises Problem (D001, D002, D018) where it has none.

        kind: what it should be, for messages; most: bytes that it may have.
        """
        if file.name in self._refused:
            raise self._refused[file.name]
        if file.name not in self.read_so_far:
            unsaved = self._unsaved.get(file.identity) if self._unsaved else None
            data = _read_bytes(file, kind, most) if unsaved is None else unsaved.encode("utf-8", "surrogatepass")
            self._keep(file, data, kind, most)
            if file.name in self._refused:
                raise self._refused[file.name]
        return self.read_so_far[file.name].text

    def _keep(self, file: FoundFile, data: bytes, kind: str, most: int) -> None:
        """Keep a file's bytes as text, with its errors. Raises Problem D018."""
        if len(data) > most:
            raise Problem(_too_large(file, kind, size_text(len(data)), most))
        text, complaint = decode(data, file.name, kind)
        self.read_files[file.name] = file
        self.read_so_far[file.name] = SourceFile(file.name, text, hashlib.sha256(data).hexdigest())
        if complaint is not None:
            self._refused[file.name] = Problem(complaint)


def library_defines(kind: str, name: str, library: Path = LIBRARY) -> str | None:
    """The file of the standard library, to be included, that defines a servo (arm, ...) of that name."""
    definition = re.compile(rf"^[ \t]*{re.escape(kind)}[ \t]+{re.escape(name)}\b", re.MULTILINE)
    for path in sorted(library.glob("*/**/*.ic")):
        if definition.search(path.read_text(encoding="utf-8", errors="replace")):
            return path.relative_to(library).as_posix()
    return None


def add_include(file: str, place: Place, what: str = "it") -> Help:
    """The help that says to include a standard deck, in the file of the place."""
    head = Place(place.file, 1, 1, 0)
    text = f"a standard deck defines {what}: add `#include <{file}>`"
    return write(f"#include <{file}>", text, at=head, where="head")


def folders_by_slash(name: str, quoted: str) -> tuple[Help, ...]:
    """The remedy for a file's name with a backslash, which is a letter of a name here. quoted: as the deck writes it"""
    slashed = quoted.replace("\\\\", "/").replace("\\", "/")
    text = f"`\\` does not part folders here: write `{slashed}`"
    return (write(slashed, text),) if "\\" in name else ()


def _printable(names: Iterable[str], ending: str) -> list[str]:
    """Names that a message can show and a deck can write, in order."""
    return sorted(name for name in names if name.endswith(ending) and name.isprintable())


def _read_bytes(file: FoundFile, kind: str, most: int) -> bytes:
    """The content of a file of at most so many bytes. Raises Problem D001 where it cannot be read."""
    try:
        file.name.encode()
    except UnicodeEncodeError:
        help = "give it, or the folder it lies in, another name: plans and archives hold it as text"
        raise Problem(error("D001", f"cannot read `{file.name}`: its name is not UTF-8", help=help)) from None
    try:
        about = os.stat(file.path)
        if stat.S_ISDIR(about.st_mode):
            ending = ".ic" if kind == "deck" else ".csv"
            inside = _printable(os.listdir(file.path), ending)[:MOST_NAMED]
            help = f"{kind}s in it: {', '.join(inside)}" if inside else f"there is no {kind} in it"
            raise Problem(error("D001", f"`{file.name}` is a directory, not a {kind}", help=help))
        if not stat.S_ISREG(about.st_mode):
            raise Problem(error("D001", f"`{file.name}` is not a regular file", help="copy what it gives to a file"))
        with open_regular(file.path) as stream:
            data = stream.read(len(HDF5))
            if data == HDF5:
                raise Problem(_archive(file, kind))
            if about.st_size > most:
                raise Problem(_too_large(file, kind, size_text(about.st_size), most))
            while len(data) <= most and (more := stream.read(min(most + 1 - len(data), about.st_size + CHUNK))):
                data += more  # room for `most` bytes at once may be more than a process is granted
        if len(data) > most:  # a file that does not say its size, or grows
            raise Problem(_too_large(file, kind, "no end", most))
        return data
    except (OSError, ValueError) as reason:
        why = getattr(reason, "strerror", None) or str(reason)
        help = "look at the name, and at who may read the file"
        raise Problem(error("D001", f"cannot read `{file.name}`: {why}", help=help)) from None


def _archive(file: FoundFile, kind: str) -> Diagnostic:
    """The error for an archive in place of a deck (D002)."""
    helps = [
        f"`met show {file.name}` and `met report {file.name}` show what is in it",
        f"its decks, and the parameters of a case: `batch.open({file.name!r}).met.sources`, `.met.parameters('#0')`",
    ]
    return error("D002", f"`{file.name}` is an archive (HDF5), not a {kind}", help=helps)


def _too_large(file: FoundFile, kind: str, size: str, most: int) -> Diagnostic:
    whose = "deck's file" if kind == "deck" else kind
    help = "numbers in bulk belong in a CSV file, not in a deck" if kind == "deck" else "split it"
    return error("D018", f"`{file.name}` has {size}; a {whose} has at most {most >> 20} MiB", help=help)


def size_text(n: int) -> str:
    """A size in MiB, or in GiB where it is as large: `7.3 MiB`."""
    return f"{n / 2**20:.1f} MiB" if n < 1 << 30 else f"{n / 2**30:.1f} GiB"


def decode(data: bytes, name: str, kind: str) -> tuple[str, Diagnostic | None]:
    """The text, with its errors; with errors, it is good enough to show the line."""
    complaint = None
    wide = next((encoding for begins, encoding in _WIDE if begins.match(data)), None)
    if wide is not None:
        complaint = error("D002", f"`{name}` is {wide[:6].upper()}, but {kind}s are UTF-8", help="save it as UTF-8")
        return data.decode(wide, errors="replace"), complaint
    matched = _NOT_TEXT.search(data)
    if matched is not None:
        place = _place_of_byte(data, matched.start(), name)
        complaint = error(
            "D002",
            f"`{name}` is not text: it holds the byte 0x{data[matched.start()]:02x}",
            place,
            help=f"is this an archive or a program? A {kind} is plain text in UTF-8",
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        text = data.decode("utf-8-sig", errors="replace")
        if complaint is None:
            place = _place_of_byte(data, reason.start, name)
            message = f"`{name}` is not UTF-8: byte 0x{data[reason.start]:02x}"
            complaint = error("D002", message, place, help="save the file as UTF-8")
    if complaint is None and kind == "deck" and _XML.match(text):
        complaint = _xml(text, name)
    return text.replace("\r\n", "\n").replace("\r", "\n"), complaint


def _xml(text: str, name: str) -> Diagnostic:
    """The error for an XML file in place of a deck (D002)."""
    before = text[: text.index("<")]
    place = Place(name, before.count("\n") + 1, len(before) - before.rfind("\n"))
    file = posixpath.basename(name)
    helps = [
        f"`met import {name} -o robot.ic` makes a deck of a robot's URDF file",
        f'a deck can take such a file as it is: `arm NAME from urdf("{file}") {{ ... }}`',
    ]
    if "<mujoco" in text:
        helps = [f"`met import {name} -o robot.ic` makes a deck of a model in MuJoCo's MJCF"]
    elif "<robot" not in text:
        helps = ["a deck is text in a language of its own; of robots in XML, `met import` reads URDF and MJCF"]
    return error("D002", f"`{name}` is XML, not a deck", place, help=helps)


def _place_of_byte(data: bytes, offset: int, name: str) -> Place:
    """The line and column of a byte of a file."""
    before = data[:offset].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    start = before.rfind(b"\n") + 1
    column = len(before[start:].decode("utf-8-sig" if start == 0 else "utf-8", errors="replace")) + 1
    return Place(name, before.count(b"\n") + 1, column)
