"""`met view DECK`: wait until a deck is saved, compile it, show its run, run its cases; until the terminal is closed.

The cases are run in a thread of their own, and given up when the deck is saved again, in the middle of one. A defect of
MET ends neither: it is reported in the terminal and on the page, and the next save is shown. Only the cache of compiled
objects is written, so that a killed process leaves nothing behind.
"""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable
from typing import Any

from batch.watching import answers
from batch.watching.answers import DeckAnswer, WatchedDeck
from batch.watching.board import Board
from batch.watching.deck_files import DeckFiles
from batch.watching.serving import PageServer
from met.analysis.memo import AnalysisMemo
from met.cli import of_machine
from met.diagnostic import Problem
from met.messages.render import render
from met.messages.visible import visible
from met.run import Prepared, prepare

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
        }
        state["fault"] = False
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
