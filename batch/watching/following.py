"""`met view DECK`: wait until a deck is saved, compile it, show its run, run its cases; until the terminal is closed.

The cases are run in a thread of their own, and given up when the deck is saved again, in the middle of one. A defect of
MET ends neither: it is reported in the terminal and on the page, and the next save is shown. Only the cache of compiled
objects is written, so that a killed process leaves nothing behind.

Editors write in many ways: over the file, or beside it and then by a rename; and some write a file that is as it was.
So a file has changed when its bytes have, which are compared only where its size, time or inode differs.
"""

from __future__ import annotations

import errno
import gc
import hashlib
import os
import re
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from batch.watching import answers
from batch.watching.answers import DeckAnswer, WatchedDeck
from batch.watching.board import Board
from batch.watching.serving import PageServer
from ic.text.files import LIBRARY
from ic.text.lexer import COMMAND_LINE
from met.analysis.memo import AnalysisMemo
from met.cli import of_machine
from met.diagnostic import Problem
from met.host.files import read_regular
from met.messages.render import render
from met.messages.visible import visible
from met.run import Prepared, prepare

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
    """The time (ns), size and inode of a file, by which a changed file is noticed; None where there is none."""
    try:
        about = os.stat(path)
    except OSError:
        return None
    return about.st_mtime_ns, about.st_size, about.st_ino


HEAD_START_SECONDS = 0.25
"""Seconds that a page has before its cases are run: it is fetched and drawn meanwhile."""

PATIENCE_SECONDS = 2.0
"""Seconds to wait at the end for cases that are given up, so that a compiler is not interrupted."""


def follow(
    deck: WatchedDeck,
    name: str | None,
    *,
    port: int,
    ready: Callable[[str], None],
    tell: Callable[[str], None],
    confess: Callable[[Exception], str],
) -> None:
    """Show the deck's run until an interrupt. Raises Problem of `answers.check`, and E477 where the port cannot be had.

    name     of the run or sweep; None: the one that `met run` would take, or that is chosen on the page
    ready    told the address of the page, when it can be opened
    tell     told what `met check` says of the deck as it is at first, where it says something
    confess  tells in the terminal that MET has a defect, and gives back in which words
    """
    answers.check(deck, name)
    board = Board(visible(deck.name))
    server = PageServer(board, port)
    server.begin()
    ready(server.address)
    loop = _Loop(deck, name, board, confess, tell)
    try:
        loop.run()
    finally:
        loop.give_up(PATIENCE_SECONDS)
        server.end()


class _Loop:
    """The shown run, and the thread that runs its cases. name, group: requested, or chosen on the page; confess, tell:
    as for `follow`, tell is None after its first call"""

    def __init__(
        self,
        deck: WatchedDeck,
        name: str | None,
        board: Board,
        confess: Callable[[Exception], str],
        tell: Callable[[str], None] | None = None,
    ) -> None:
        """Watch the deck's files; nothing is compiled before `run`."""
        self._deck, self._name, self._board, self._confess, self._tell = deck, name, board, confess, tell
        self._group: str | None = None
        self._files = DeckFiles(deck.file, deck.include_dirs)
        self._known: dict[bytes, Any] = {}
        self._page = ""
        self._prepared: Prepared | None = None
        self._is_broken = False
        self._cases: threading.Thread | None = None
        self._stop = threading.Event()
        self._running = threading.Lock()
        self._telling = threading.Lock()

    def run(self) -> None:
        """Compile, show and wait, for ever."""
        again = self._sound()
        gc.freeze()  # objects of the start are permanent: collecting over them takes a tenth of a save
        while True:
            if not again:
                self._files.wait(around=self._is_broken, until=self._board.is_chosen)
            if (chosen := self._board.take_chosen()) is not None:
                self._name, self._group = chosen
            self._board.tell(doing="compiling")
            again = self._sound()

    def give_up(self, seconds: float | None = None) -> None:
        """Stop running the shown cases; wait for that, at most this long."""
        self._stop.set()
        if self._cases is not None and self._cases.is_alive():  # an interrupt may have come while it was started
            self._cases.join(seconds)

    def _sound(self) -> bool:
        """Compile and show as `_once` does; unexpected errors are reported, and the deck is watched on."""
        try:
            return self._once()
        except Exception as mishap:
            self._is_broken, self._page = True, ""
            self._board.tell(**self._message_about(mishap), doing="")
            return False

    def _message_about(self, mishap: Exception) -> dict[str, Any]:
        """The message about an error that is not a mistake of the deck: the machine's, or MET's own, which is also
        printed in the terminal. To be called while it is handled."""
        state: dict[str, Any] = {"broken": True, "tried": time.time()}
        if isinstance(mishap, MemoryError | OSError):
            return state | {"messages": _words(Problem(of_machine(mishap)))}
        with self._telling:
            return state | {"messages": visible(self._confess(mishap)), "fault": True}

    def _once(self) -> bool:
        """Compile the files on the disk, and show the result. True where they have changed meanwhile."""
        begun = self._files.begin()
        memo = AnalysisMemo(self._known)
        answer = answers.compiled(self._deck, self._name, self._group, memo)
        self._known = memo.so_far
        if self._files.watch_files(answer.files, begun):
            return True
        if self._tell is not None and answer.messages:
            self._tell(answer.messages)
        self._tell = None
        self._is_broken = answer.experiment is None
        state: dict[str, Any] = {
            "names": list(answer.names),
            "groups": list(answer.groups),
            "messages": answer.messages,
            "fault": False,
        }
        if answer.experiment is None:
            self._board.tell(**state, broken=True, tried=begun, doing="")
            return False
        try:
            self._show(answer, prepare(answer.experiment), state, begun)
        except Problem as problem:
            self._is_broken = True
            self._board.tell(**state | {"messages": _words(problem)}, broken=True, tried=begun, doing="")
        return False

    def _show(self, answer: DeckAnswer, prepared: Prepared, state: dict[str, Any], begun: float) -> None:
        """Show the page, and begin to run its cases; an unchanged page or program stays."""
        experiment = prepared.experiment
        state |= {
            "run": experiment.name_in_deck, "group": experiment.name, "broken": False, "saved": begun, "tried": begun,
        }  # fmt: skip
        text = answers.page(answer, prepared)
        if text == self._page and self._prepared is not None and prepared.work_key == self._prepared.work_key:
            self._board.tell(**state, doing="")
            return
        self.give_up(0.0)
        self._page, self._prepared, self._stop = text, prepared, threading.Event()
        page = self._board.show("page", text, **state, numbers=0, doing="compiling for this machine")
        self._cases = threading.Thread(target=self._run_cases, args=(prepared, page, self._stop), daemon=True)
        self._cases.start()

    def _run_cases(self, prepared: Prepared, page: int, stop: threading.Event) -> None:
        """Run the cases of a page, and report their results while it is shown."""
        experiment, board = prepared.experiment, self._board
        total = len(answers.shown_rows(experiment))

        def progress(done: int) -> None:
            board.tell(page, doing=f"{done:,} of {total:,} cases are run")

        if stop.wait(HEAD_START_SECONDS):
            return
        while not self._running.acquire(timeout=HEAD_START_SECONDS):  # no compiler is running
            if stop.is_set():
                return
            board.tell(page, doing="waiting for the end of what an earlier deck began")
        try:
            for run in answers.run_cases(prepared, stop.is_set, progress):
                board.show("numbers", answers.numbers(experiment, run), page)
            board.tell(page, doing="")
        except Problem as problem:
            board.tell(page, messages=_words(problem), doing="the cases were not run")
        except Exception as mishap:
            board.tell(page, **self._message_about(mishap), doing="the cases were not run")
        finally:
            self._running.release()


def _words(problem: Problem) -> str:
    return visible(render(problem.diagnostics, problem.sources))
