"""Deck files for `met fmt`: finding them, formatting them, and writing them back."""

from __future__ import annotations

import difflib
import io
import os
import re
import shlex
import stat
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress

from ic.formatting.formatter import formatted
from ic.text.files import Files, FoundFile, decode
from ic.text.lexer import Text, Token, logical_lines
from ic.text.limits import MOST_BYTES, MOST_INCLUDES
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host.files import open_regular, whole_file
from met.outputs import refusal_text

_INCLUDE = re.compile(r'\s*#\s*include\s*(?:"([^"\n]*)"|<([^>\n]*)>)')


def making_strings(text: str, file: FoundFile) -> frozenset[str]:
    """Names of such macros that this text or a file that it includes defines."""
    files = Files()
    names: set[str] = set()
    waiting, seen = [(text, file)], {file.identity}
    while waiting and len(seen) < MOST_INCLUDES:
        text, file = waiting.pop()
        if "#" not in text:
            continue
        names.update(_defined(Text(file.name, text)))
        for included in _included(text, file, files):
            if included.identity not in seen:
                seen.add(included.identity)
                waiting.append((_text(included), included))
    return frozenset(names)


def _defined(source: Text) -> Iterator[str]:
    """The macros of a text that make a string of an argument."""
    for line in logical_lines(source):
        tokens = [token for token in line if token.text.strip()]
        if [token.text for token in tokens[:2]] == ["#", "define"] and _makes_a_string(tokens[2:]):
            yield tokens[2].text


def _makes_a_string(definition: list[Token]) -> bool:
    return len(definition) > 1 and definition[1].text == "(" and any(token.text == "#" for token in definition)


def _included(text: str, file: FoundFile, files: Files) -> Iterator[FoundFile]:
    """The files that a text includes, as far as they are found."""
    for line in text.split("\n"):
        written = _INCLUDE.match(line)
        if written is not None:
            angled = written[1] is None
            included = files.find(written[2] if angled else written[1], files.where(file, angled))
            if included is not None:
                yield included


def _text(file: FoundFile) -> str:
    """The readable part of a file; `met check` reports its errors."""
    with suppress(OSError), open_regular(file.path) as stream:
        return stream.read(MOST_BYTES).decode("utf-8", "replace")
    return ""


STDIN = "-"


@frozen
class LaidOut:
    """A deck before and after formatting.

    name     for messages
    before   its text, its lines ended by newlines whatever they were
    after    that text laid out
    changes  whether the file's bytes differ from what is to be written
    ends     whether its lines did not end as they are to
    """

    name: str
    before: str
    after: str
    changes: bool
    ends: bool

    def diff(self) -> Iterator[str]:
        """The changes in the format of `diff -u`."""
        old, new = (list(io.StringIO(text)) for text in (self.before, self.after))
        for line in difflib.unified_diff(old, new, self.name, f"{self.name} (formatted)"):
            yield line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n"


def decks(paths: Sequence[str]) -> list[str]:
    """The files that these paths stand for: those of a folder and of its folders are all its `.ic` files.

    A file that is named twice, or by a link too, is taken once. Raises Problem E341 where a folder has none, OSError
    where one cannot be looked into.
    """
    files: list[str] = []
    for path in paths:
        if path != STDIN and os.path.isdir(path):
            inside = sorted(_inside(path))
            if not inside:
                help = "a deck's name ends in `.ic`; a file of another name is formatted where it is named"
                raise Problem(error("E341", f"there is no deck in the folder `{path}`", help=help))
            files += inside
        else:
            files.append(path)
    by_file: dict[str, str] = {}
    for path in files:
        by_file.setdefault(path if path == STDIN else os.path.realpath(path), path)
    return list(by_file.values())


def _inside(folder: str) -> Iterator[str]:
    """The deck files in a folder and in its folders, but for hidden ones. Raises OSError."""

    def refuse(reason: OSError) -> None:
        raise reason

    for path, folders, files in os.walk(folder, onerror=refuse):
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (os.path.normpath(os.path.join(path, name)) for name in files if name.endswith(".ic"))


def lay_out(path: str, text: str | None = None) -> LaidOut:
    """One formatted deck; with this text in place of its own, if given. Raises Problem where it cannot be read, is
    broken, or is not a deck."""
    if path == STDIN:
        if sys.stdin is None:
            raise Problem(error("D001", "cannot read standard input: it is closed", help="name a deck, or pipe one in"))
        return _laid_out(FoundFile("<stdin>", "<stdin>"), sys.stdin.buffer.read(MOST_BYTES + 1))
    if path.endswith(".json"):
        help = "`met fmt` is for decks"
        raise Problem(error("E342", f"`{path}` is a plan, and plans are written by `met plan`", help=help))
    file = FoundFile(path, os.path.normpath(path))
    Files().text(file)  # complains like every reader of decks
    with open_regular(path) as stream:
        return _laid_out(file, stream.read(MOST_BYTES + 1), text)


def lay_out_text(path: str, text: str) -> str:
    """The formatted text of a deck at a path, as an editor has it. Raises Problem where it is broken."""
    file = FoundFile(path, os.path.normpath(path))
    return formatted(file.name, text, making_strings(text, file))


def _laid_out(file: FoundFile, data: bytes, new: str | None = None) -> LaidOut:
    """A deck file with its formatted text. data: the file's bytes; new: the text to format in their place. Raises
    Problem D018 for one that is too large."""
    if len(data) > MOST_BYTES:
        raise Problem(error("D018", f"`{file.name}` has more than the {MOST_BYTES >> 20} MiB that a deck may have"))
    text, complaint = decode(data, file.name, "deck")
    if complaint is not None:
        raise Problem(complaint, {file.name: text})
    wanted = text if new is None else new
    after = formatted(file.name, wanted, making_strings(wanted, file))
    return LaidOut(file.name, text, after, after.encode() != data, b"\r" in data)


def write(path: str, text: str) -> None:
    """Replace the file's text, all at once; its permissions stay, and a link to it stays a link.

    Raises Problem E338, and leaves the file as it was, where the system refuses, or where a link leads to a file that
    is not called a deck: a folder that somebody gave may hold a link to any file.
    """
    target = os.path.realpath(path)
    if os.path.islink(path) and not target.endswith(".ic"):
        help = f"links are followed to `.ic` files alone; `met fmt {shlex.quote(target)}` names the file itself"
        raise Problem(error("E338", f"cannot write `{path}`: it is a link to `{target}`", help=help))
    try:
        if not os.access(target, os.W_OK):
            raise PermissionError(13, os.strerror(13))
        with whole_file(target, mode=stat.S_IMODE(os.stat(target).st_mode)) as file:
            file.write(text.encode())
    except OSError as reason:
        help = "it is as it was; what takes its place is written beside it, so its folder must allow that"
        raise Problem(error("E338", f"cannot write `{path}`: {refusal_text(reason)}", help=help)) from None
