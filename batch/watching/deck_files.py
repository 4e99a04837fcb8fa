"""The files of a deck, and detection of their changes.

Editors write in many ways: over the file, or beside it and then by a rename; and some write a file that is as it was.
So a file has changed when its bytes have, which are compared only where its size, time or inode differs.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from ic.text.files import LIBRARY
from ic.text.lexer import COMMAND_LINE
from met.host.files import read_regular

PAUSE = 0.02
"""Seconds between two checks, which take some 50 us."""

SETTLED, LONGEST = 0.02, 0.5
"""Seconds without a change after which a file counts as written; and the longest wait for that."""

NAMED, MOST_NAMED = re.compile(rb"""["<]([^"<>\x00-\x1f]{1,200})/[^"<>/\r\n]{1,200}[">]"""), 100
"""A file in another folder, as decks name one, included or read; and the largest number of them in a file."""

MOST_COMPARED = 16 << 20
"""Bytes of a file that are compared: a larger one has changed when its size, time or inode has."""

Stamp = tuple[int, int, int] | None
"""Time, size and inode of a file; None where there is none."""


class DeckFiles:
    """The watched files and folders, as of the last check."""

    def __init__(self, deck: Path, include_dirs: Sequence[str] = ()) -> None:
        more = [folder for folder in os.environ.get("MET_DECK_PATH", "").split(os.pathsep) if folder]
        self._deck, self._folders = deck, [Path(folder) for folder in (*include_dirs, *more)]
        self._stamps: dict[Path, Stamp] = {}
        self._digests: dict[Path, bytes] = {}
        self._named: dict[Path, list[str]] = {}
        self._around: dict[Path, Stamp] = {}
        self._look(deck)

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files that are watched, the deck first."""
        return tuple(self._stamps)

    def begin(self) -> float:
        """Note all files, before they are read; returns the time, for `watch_files`."""
        for path in self.paths:
            self._look(path)
        self._around = {folder: _stamp(folder) for folder in self._all_folders()}
        return time.time()

    def watch_files(self, names: Iterable[str], begun: float) -> bool:
        """Watch the files from which a deck was read since then, by their names in messages. True where a new one has
        changed meanwhile, so that the contents read are uncertain."""
        paths = dict.fromkeys([self._deck, *(path_of(name) for name in names if name != COMMAND_LINE)])
        new = [path for path in paths if path not in self._stamps]
        for path in [path for path in self._stamps if path not in paths]:
            del self._stamps[path], self._digests[path], self._named[path]
        for path in new:
            self._look(path)
        self._around |= {folder: _stamp(folder) for folder in self._all_folders() if folder not in self._around}
        return any((stamp := self._stamps[path]) is not None and stamp[0] > begun * 1e9 for path in new)

    def changed(self, *, around: bool = False) -> bool:
        """True if the bytes of a file have changed. around: also if in a folder something came, went or was renamed,
        where a searched file may be"""
        others = [path for path in self.paths if _stamp(path) != self._stamps[path]]
        changed = sum(map(self._look, others)) > 0
        if around and not changed:
            now = {folder: _stamp(folder) for folder in self._around}
            changed, self._around = now != self._around, now
        return changed

    def wait(self, *, around: bool = False, until: Callable[[], bool] = lambda: False) -> None:
        """Wait until something has changed and is written, or another event has occurred."""
        while not until():
            if self.changed(around=around):
                self._settle()
                return
            time.sleep(PAUSE)

    def _settle(self) -> None:
        """Wait while a file is being written, or replaced by a rename."""
        end = time.monotonic() + LONGEST
        while time.monotonic() < end:
            before = {path: _stamp(path) for path in self.paths}
            time.sleep(SETTLED)
            if None not in before.values() and before == {path: _stamp(path) for path in self.paths}:
                return

    def _look(self, path: Path) -> bool:
        """Note a file's present state. True where its bytes have changed."""
        self._stamps[path] = stamp = _stamp(path)
        text: bytes | None = None
        try:
            text = read_regular(path, MOST_COMPARED)
            digest = hashlib.sha256(text).digest()
        except OSError as reason:
            digest = repr(stamp).encode() if reason.errno == errno.EFBIG else b""  # no file of a deck is as large
        named = () if text is None or LIBRARY in path.parents else dict.fromkeys(NAMED.findall(text))
        self._named[path] = [os.fsdecode(name) for name in [*named][:MOST_NAMED]]
        before = self._digests.get(path)
        self._digests[path] = digest
        return before is not None and before != digest

    def _all_folders(self) -> list[Path]:
        """Folders in which a file is searched: beside the watched ones, in the `-I` folders and those of MET_DECK_PATH,
        and in folders that a deck names in these, existing or not."""
        named = [
            base / name
            for path, names in self._named.items()
            for base in (path.parent, *self._folders)
            for name in names
        ]
        return list(dict.fromkeys([*(path.parent for path in self._stamps), *self._folders, *named]))


def path_of(name: str) -> Path:
    """The file of a name in messages: `<servos/rigid_gearbox.ic>` is one of the standard library's."""
    return LIBRARY / name[1:-1] if name.startswith("<") and name.endswith(">") else Path(name)


def _stamp(path: Path) -> Stamp:
    try:
        about = os.stat(path)
    except OSError:
        return None
    return about.st_mtime_ns, about.st_size, about.st_ino
